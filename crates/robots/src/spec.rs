//! Sensors that robots' files declare, as sensor files.

use ground::error::Result;
use ground::read::xml::Xml;
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;

/// Most rows and columns of a scan, each: those of a spinning sensor.
const MOST: f64 = 65_536.0;

/// Whether the type of a `<sensor>` is that of a LiDAR: in Gazebo Classic and in Gazebo, by rays or by the graphics card.
pub(crate) fn is_lidar(kind: &str) -> bool {
    ["gpu_lidar", "lidar", "gpu_ray", "ray"].contains(&kind)
}

/// The sensor file of a LiDAR of SDF called `name`: its rows and columns, ranges, rate and noise, without divergence, as
/// Gazebo simulates it. All of its rays are of one moment there, here the columns are of one turn.
///
/// # Errors
/// Counts that are no whole numbers above 0, angles or ranges of which the lower is not below the upper one.
pub(crate) fn lidar(sensor: Xml<'_>, name: &str) -> Result<Value> {
    let Some(about) = sensor.child("lidar").or_else(|| sensor.child("ray")) else {
        return Err(sensor.error("has no lidar (or ray)"));
    };
    let scan = about.child("scan");
    let horizontal = angles(scan.and_then(|scan| scan.child("horizontal")), 640)?;
    let vertical = angles(scan.and_then(|scan| scan.child("vertical")), 1)?;
    if vertical.low < -FRAC_PI_2 - 1e-6 || vertical.high > FRAC_PI_2 + 1e-6 {
        return Err(about.error("has vertical angles beyond straight up or down; allowed: -pi/2 to pi/2"));
    }
    let rate = sensor.number_of("update_rate")?.filter(|rate| *rate > 0.0).unwrap_or(10.0);
    // A single column is in the middle of a field of view of no width.
    let (fov, step) = match horizontal.count {
        1.0 => (1e-6, 1.0),
        count => ((horizontal.high - horizontal.low).to_degrees().min(360.0), horizontal.step(count)),
    };
    let elevations = (0..vertical.count as usize).map(|row| {
        let step = if vertical.count > 1.0 { vertical.step(vertical.count) } else { 0.0 };
        (vertical.low.to_degrees() + row as f64 * step).clamp(-90.0, 90.0)
    });
    let mut made = json!({
        "name": name,
        "kind": "lidar",
        "pattern": {
            "type": "spinning",
            "azimuth": {
                "fov_deg": fov,
                "step_deg": step,
                "rate_hz": rate,
                "direction": "ccw",
                "centre_deg": (horizontal.low + horizontal.high).to_degrees() / 2.0,
            },
            "channels": {"elevation_deg": elevations.collect::<Vec<f64>>()},
        },
        "beam": {"divergence_mrad": 0.0, "sub_rays": 1},
    });
    if let Some(range) = about.child("range") {
        let [low, high] = [range.number_of("min")?.unwrap_or(0.0), range.number_of("max")?.unwrap_or(0.0)];
        if low < 0.0 || high <= low {
            return Err(range.error(format_args!("has min {low} and max {high}; allowed: min from 0, max above it")));
        }
        made["range"] = json!({"min_m": low, "max_m": high});
    }
    let noise = about.child("noise").or_else(|| sensor.child("noise"));
    if let Some(sigma) = noise.map(|noise| noise.number_of("stddev")).transpose()?.flatten() {
        if sigma < 0.0 {
            return Err(about.error(format_args!("has the stddev {sigma}; allowed: 0 and more")));
        }
        made["noise"] = json!({"range_sigma_m": sigma});
    }
    Ok(made)
}

/// The sensor file of a rangefinder of MuJoCo called `name`: one ray ahead, up to `cutoff` metres where it is not 0.
pub(crate) fn rangefinder(name: &str, cutoff: f64, noise: f64) -> Value {
    let mut made = json!({
        "name": name,
        "kind": "lidar",
        "pattern": {
            "type": "spinning",
            "azimuth": {"fov_deg": 1e-6, "step_deg": 1.0, "rate_hz": 10.0},
            "channels": {"elevation_deg": [0.0]},
        },
        "beam": {"divergence_mrad": 0.0, "sub_rays": 1},
        "noise": {"range_sigma_m": noise},
    });
    if cutoff > 0.0 {
        made["range"] = json!({"min_m": 0.0, "max_m": cutoff});
    }
    made
}

/// The rays of a scan in one direction, radians; both ends are rays.
struct ScanAngles {
    low: f64,
    high: f64,
    count: f64,
}

impl ScanAngles {
    /// From ray to ray, degrees.
    fn step(&self, count: f64) -> f64 {
        (self.high - self.low).to_degrees() / (count - 1.0)
    }
}

fn angles(holder: Option<Xml<'_>>, missing: u32) -> Result<ScanAngles> {
    let Some(holder) = holder else { return Ok(ScanAngles { low: 0.0, high: 0.0, count: f64::from(missing.min(1)) }) };
    // Of more simulated than measured rays, those between are interpolated: all are measured here.
    let samples = holder.number_of("samples")?.unwrap_or(f64::from(missing));
    let resolution = holder.number_of("resolution")?.unwrap_or(1.0);
    let count = (samples * resolution).round();
    if !(1.0..=MOST).contains(&count) {
        return Err(holder
            .error(format_args!("has {samples} samples at a resolution of {resolution}; allowed: 1 to {MOST} rays")));
    }
    let [low, high] = [holder.number_of("min_angle")?.unwrap_or(0.0), holder.number_of("max_angle")?.unwrap_or(0.0)];
    if low > high || count > 1.0 && low == high {
        return Err(
            holder.error(format_args!("has min_angle {low} and max_angle {high}; allowed: min_angle below max_angle"))
        );
    }
    Ok(ScanAngles { low, high, count })
}
