//! How a Doppler velocity log derives its velocity from range rates.

use super::doppler::wrap;
use cloud::cells::Track;
use emitter::pattern::JANUS_BEAMS;
use glam::{DMat3, DVec3};
use ground::error::{Error, Result};
use ground::read::bounds::{ABOVE_ZERO, Bounds, FARTHEST_M};
use ground::rng::{Draw, Rng};
use serde::{Deserialize, Serialize};

/// `dvl`: how a Doppler velocity log measures; without any key it measures the bottom exactly, and no water.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct VelocityLog {
    /// Standard deviation of the velocity along a beam, from one ping with a clear echo, m/s, 0 to 10. For the velocity
    /// along x or y it is `1 / (sqrt(2) sin(janus_deg))` times that.
    pub sigma_m_s: f64,
    /// Growth of that with every m/s of speed over the bottom, or through the water, 0 to 1; it adds in quadrature.
    pub sigma_per_m_s: f64,
    /// Standard deviation, over many instruments of its kind, of a relative error of all velocities, 0 to 1.
    pub scale_sigma: f64,
    /// Likewise of a constant error along each beam, m/s, 0 to 10.
    pub bias_sigma_m_s: f64,
    /// Which of many instruments of its kind this is: each has a scale and biases of its own, the same in all pings.
    pub instrument: u32,
    /// Width of the interval of unambiguous velocities along a beam, m/s, 0.001 to 1e6: measured velocities wrap into
    /// [-ambiguity / 2, ambiguity / 2). Without it nothing wraps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambiguity_m_s: Option<f64>,
    /// The layer of water that it tracks in addition to the bottom; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water: Option<WaterLayer>,
}

/// `dvl.water`: a layer of water. Particles that drift in it must scatter sound: see `volume_backscatter_db` of the
/// water.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct WaterLayer {
    /// Where it begins, m straight down from the sonar, along its -z.
    pub from_m: f64,
    /// Where it ends, likewise. The bottom must be too far for a side lobe straight down to pick it up at the same
    /// time: a beam leaves the layer at a range of `to_m / cos(janus_deg)`, and the bottom below the sonar must be
    /// beyond that.
    pub to_m: f64,
    /// Standard deviation of the velocity of the water along a beam, from one ping with a clear echo, m/s, 0 to 10.
    pub sigma_m_s: f64,
}

/// What a beam receives from what it tracks.
#[derive(Clone, Copy, Debug)]
pub struct BeamRate {
    /// Range rate by the Doppler shift, m/s.
    pub rate: f64,
    /// Speed of the sonar relative to it, in any direction, m/s.
    pub speed: f64,
    /// Power of the echo over that of the noise.
    pub snr: f64,
}

/// What is tracked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tracked {
    Bottom,
    Water,
}

impl VelocityLog {
    /// `janus`: angle of the beams from straight down, rad; `farthest`: greatest range, m.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds, janus: f64, farthest: f64) -> Result<()> {
        bounds.within("dvl.sigma_m_s", self.sigma_m_s, 0.0, 10.0)?;
        bounds.within("dvl.sigma_per_m_s", self.sigma_per_m_s, 0.0, 1.0)?;
        bounds.within("dvl.scale_sigma", self.scale_sigma, 0.0, 1.0)?;
        bounds.within("dvl.bias_sigma_m_s", self.bias_sigma_m_s, 0.0, 10.0)?;
        bounds.within("dvl.instrument", f64::from(self.instrument), 0.0, u32::MAX.into())?;
        bounds.within("dvl.ambiguity_m_s", self.ambiguity_m_s, 1e-3, 1e6)?;
        let Some(WaterLayer { from_m, to_m, sigma_m_s }) = self.water else { return Ok(()) };
        bounds.within("dvl.water.from_m", from_m, 0.0, FARTHEST_M)?;
        bounds.number("dvl.water.to_m", to_m, [ABOVE_ZERO, FARTHEST_M], "above 0")?;
        bounds.rising(("dvl.water.from_m", from_m), ("dvl.water.to_m", to_m))?;
        bounds.within("dvl.water.sigma_m_s", sigma_m_s, 0.0, 10.0)?;
        let deepest = farthest * janus.cos();
        if to_m > deepest {
            let allowed = format!("at most {deepest:.2}, where beams reach range.max_m");
            return Err(Error::invalid("dvl.water.to_m", to_m, allowed));
        }
        Ok(())
    }

    /// What it measures along the `axes` of its beams, unit vectors in the sensor's frame, from what they `received`;
    /// `rng` is that of the ping.
    #[doc(hidden)]
    pub fn track(
        &self,
        rng: &Rng,
        of: Tracked,
        axes: &[DVec3; JANUS_BEAMS],
        received: &[Option<BeamRate>; JANUS_BEAMS],
    ) -> Track {
        let maker = Rng::new(self.instrument.into(), 0);
        let scale = 1.0 + self.scale_sigma * f64::from(maker.normal(0, Draw::VelocityScale, 0));
        let radial = std::array::from_fn(|beam| {
            let number = beam as u32;
            let Some(received) = received[beam] else { return f64::NAN };
            let bias = self.bias_sigma_m_s * f64::from(maker.normal(number, Draw::VelocityBias, 0));
            let noise = self.sigma(of, &received) * f64::from(rng.normal(number, Draw::BeamVelocity, of as u32));
            let rate = received.rate * scale + bias + noise;
            self.ambiguity_m_s.map_or(rate, |width| wrap(rate as f32, width as f32).into())
        });
        solve(axes, radial)
    }

    /// Standard deviation along a beam, m/s. Noise adds to it as to the mean phase of pairs of pulses, the variance of
    /// which is proportional to `(1 + 1/SNR)^2 - rho^2` (Zrnic 1977, IEEE Trans. Aerospace and Electronic Systems 13,
    /// 344-354), where `rho = 1/2` for the echo of a pulse and its repetition, half of which comes from elsewhere
    /// (Brumley et al. 1991, IEEE J. Oceanic Eng. 16, 402-407).
    fn sigma(&self, of: Tracked, received: &BeamRate) -> f64 {
        const RHO: f64 = 0.5;
        let clear = match (of, self.water) {
            (Tracked::Water, Some(layer)) => layer.sigma_m_s,
            _ => self.sigma_m_s,
        };
        let noisy = ((1.0 + 1.0 / received.snr).powi(2) - RHO * RHO) / (1.0 - RHO * RHO);
        clear.hypot(self.sigma_per_m_s * received.speed) * noisy.sqrt()
    }
}

/// The velocity that fits the range rates best (NaN for beams without one): a sonar that moves at v shortens the range
/// of a beam with the axis `a` by `a v` per second, so the sum of `(rate + a v)^2` is minimised.
fn solve(axes: &[DVec3; JANUS_BEAMS], radial: [f64; JANUS_BEAMS]) -> Track {
    let mut track = Track::default().radial(radial.map(|rate| rate as f32));
    let beams = || axes.iter().zip(radial).filter(|(_, rate)| !rate.is_nan());
    if beams().count() < 3 {
        return track;
    }
    let outer = |axis: &DVec3| DMat3::from_cols(*axis * axis.x, *axis * axis.y, *axis * axis.z);
    let inverse = beams().map(|(axis, _)| outer(axis)).fold(DMat3::ZERO, |sum, part| sum + part).inverse();
    track.velocity = (inverse * -beams().map(|(axis, rate)| *axis * rate).sum::<DVec3>()).as_vec3();
    // The combination of rates that no velocity produces: by Cramer's rule the triple products of the other axes. Its
    // scale is that of the error velocity of Teledyne RD Instruments, "ADCP coordinate transformation" (1998).
    let others = |beam: usize| {
        let [a, b, c] = std::array::from_fn(|index| axes[if index < beam { index } else { index + 1 }]);
        a.cross(b).dot(c) * if beam.is_multiple_of(2) { 1.0 } else { -1.0 }
    };
    let weights: [f64; JANUS_BEAMS] = std::array::from_fn(others);
    let length = weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
    let apart: f64 = weights.iter().zip(radial).map(|(weight, rate)| weight * rate / length).sum();
    let level = 0.5 * (inverse.x_axis.x + inverse.y_axis.y);
    track.error = (apart * level.sqrt()) as f32;
    track
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four beams 30 degrees from straight down, at the corners.
    fn axes() -> [DVec3; JANUS_BEAMS] {
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| DVec3::new(x * 0.125f64.sqrt(), y * 0.125f64.sqrt(), -0.75f64.sqrt()))
    }

    #[test]
    fn velocities_come_back_from_four_beams_and_from_three() {
        let velocity = DVec3::new(1.5, -0.3, 0.2);
        let radial = axes().map(|axis| -axis.dot(velocity));
        let four = solve(&axes(), radial);
        assert!((four.velocity.as_dvec3() - velocity).length() < 1e-6 && four.error.abs() < 1e-6, "{four:?}");
        for lost in 0..JANUS_BEAMS {
            let mut radial = radial;
            radial[lost] = f64::NAN;
            let three = solve(&axes(), radial);
            assert!((three.velocity.as_dvec3() - velocity).length() < 1e-6 && three.error.is_nan(), "{three:?}");
            radial[(lost + 1) % JANUS_BEAMS] = f64::NAN;
            assert!(solve(&axes(), radial).velocity.is_nan());
        }
    }

    /// `(b1 - b2 + b3 - b4) / (2 sqrt(2) sin(30 deg))` for the opposite beams 1 and 3, 2 and 4.
    #[test]
    fn the_error_velocity_is_that_of_the_field() {
        let found = solve(&axes(), [0.03, 0.0, 0.0, 0.0]);
        assert!((f64::from(found.error.abs()) - 0.03 / 2f64.sqrt()).abs() < 1e-7, "{found:?}");
        let same = solve(&axes(), [0.03, -0.03, 0.03, -0.03]);
        assert!((f64::from(same.error.abs()) - 0.12 / 2f64.sqrt()).abs() < 1e-7, "{same:?}");
    }

    #[test]
    fn noise_grows_with_speed_and_where_the_echo_drowns() {
        let log = VelocityLog { sigma_m_s: 0.003, sigma_per_m_s: 0.002, ..VelocityLog::default() };
        let sigma = |speed, snr| log.sigma(Tracked::Bottom, &BeamRate { rate: 0.0, speed, snr });
        assert!((sigma(0.0, f64::INFINITY) - 0.003).abs() < 1e-12);
        assert!((sigma(2.0, f64::INFINITY) - 0.005).abs() < 1e-12);
        // (4 - 1/4) / (3/4) = 5.
        assert!((sigma(0.0, 1.0) / sigma(0.0, f64::INFINITY) - 5f64.sqrt()).abs() < 1e-12);
    }
}
