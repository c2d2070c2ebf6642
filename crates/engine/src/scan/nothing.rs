//! Why a scan has no points.

use crate::detect::Detection;
use crate::medium::Environment;
use crate::sensor::Sensor;
use glam::DVec3;

/// Possible reasons why no beam of `sensor` has a return, as a sentence: the scene extends from its lowest to its
/// highest corner, `bounds`, m (`None`: it is empty), the sensor starts at `start`.
pub fn why_nothing(bounds: Option<(DVec3, DVec3)>, sensor: &Sensor, start: DVec3, environment: &Environment) -> String {
    let Some((low, high)) = bounds else {
        return "no beam has a return: the scene has no triangles".into();
    };
    let spec = sensor.spec();
    let nearest = start.clamp(low, high).distance(start);
    let farthest = (start - low).abs().max((start - high).abs()).length();
    let max = spec.range.max_m.unwrap_or(f64::INFINITY);
    if nearest > max || farthest < spec.range.min_m {
        let range = match (spec.range.min_m, spec.range.max_m) {
            (min, Some(max)) => format!("{min} to {max} m"),
            (min, None) => format!("{min} m and more"),
        };
        return format!(
            "no beam has a return: the sensor starts at {:.1},{:.1},{:.1} and sees {range}, the scene reaches from \
             {:.1},{:.1},{:.1} to {:.1},{:.1},{:.1}",
            start.x, start.y, start.z, low.x, low.y, low.z, high.x, high.y, high.z
        );
    }
    // Reasons that cannot be distinguished here are listed, as far as they apply to this sensor and this weather.
    let mut causes = vec!["its beams miss the scene"];
    if sensor.kind().makes_pings() || spec.detection.model != Detection::None {
        causes.push("echoes are below its detection limit");
    }
    if sensor.kind().is_optical() && !environment.is_empty() {
        causes.push("the weather attenuates their light");
    }
    if spec.tof.is_some() {
        causes.push("its pixels are invalid (amplitude, ambiguous range, saturation)");
    }
    if spec.noise.dropout > 0.0 {
        causes.push("returns are lost (noise.dropout)");
    }
    format!("no beam has a return, though the scene is within range of the sensor; perhaps {}", causes.join(", or "))
}
