//! Measurement of radial velocities.

use super::Returns;
use ground::error::Result;
use ground::lanes::LANES;
use ground::read::bounds::Bounds;
use ground::rng::{Draw, Rng};
use serde::{Deserialize, Serialize};

/// `doppler`: how an instrument measures radial velocities, as those with a frequency-modulated continuous wave (FMCW)
/// do; without any key it measures them exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Doppler {
    /// Standard deviation of the Gaussian error, m/s, 0 to 1000.
    pub sigma_m_s: f64,
    /// Width of the interval of unambiguous velocities, m/s, 0.001 to 1e6: measured velocities wrap into [-ambiguity /
    /// 2, ambiguity / 2). If a data sheet says +-X, this is 2 X. Without it nothing wraps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambiguity_m_s: Option<f64>,
}

impl Doppler {
    /// Checks that both values are within their allowed ranges; reports them to `bounds`.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("doppler.sigma_m_s", self.sigma_m_s, 0.0, 1000.0)?;
        bounds.within("doppler.ambiguity_m_s", self.ambiguity_m_s, 1e-3, 1e6)
    }

    /// Turns the true radial velocities of `returns`, m/s, into measured ones. Those that are a `false_alarm` are
    /// uniform over the interval, or NaN if it has no ends.
    pub(super) fn measure(
        &self,
        rng: &Rng,
        returns: &Returns,
        false_alarm: impl Fn(usize) -> bool,
        velocity: &mut [f32; LANES],
    ) {
        let count = returns.beams.len();
        if self.sigma_m_s > 0.0 {
            let mut noise = [0.0; LANES];
            rng.normals(returns.beams, returns.numbers, Draw::Doppler, &mut noise[..count]);
            for lane in 0..count {
                velocity[lane] += self.sigma_m_s as f32 * noise[lane];
            }
        }
        if let Some(width) = self.ambiguity_m_s {
            velocity[..count].iter_mut().for_each(|value| *value = wrap(*value, width as f32));
        }
        for lane in (0..count).filter(|&lane| false_alarm(lane)) {
            let [place, ..] = rng.four(returns.beams[lane], Draw::Doppler, returns.numbers[lane]);
            velocity[lane] = self.ambiguity_m_s.map_or(f32::NAN, |width| (place - 0.5) * width as f32);
        }
    }
}

/// `value` moved by multiples of `width` into [-width / 2, width / 2).
pub(super) fn wrap(value: f32, width: f32) -> f32 {
    let half = 0.5 * width;
    let wrapped = value - (value / width + 0.5).floor() * width;
    // Rounding may end on the wrong side of either end.
    if wrapped >= half { -half } else { wrapped.max(-half) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Worked out by hand: both ends and their neighbours.
    #[test]
    fn velocities_wrap_into_half_open_intervals() {
        for (value, width, expected) in [
            (0.0, 40.0, 0.0),
            (19.5, 40.0, 19.5),
            (20.0, 40.0, -20.0),
            (-20.0, 40.0, -20.0),
            (-20.5, 40.0, 19.5),
            (65.0, 40.0, -15.0),
            (-65.0, 40.0, 15.0),
            (30.0, 256.0, 30.0),
            (-130.0, 256.0, 126.0),
        ] {
            assert_eq!(wrap(value, width), expected, "{value} in {width}");
        }
        for width in [0.001f32, 0.3, 7.77, 1e6] {
            for value in [width * 0.5, -width * 0.5, width * 1e4, -width * 33.33] {
                for value in [value.next_down(), value, value.next_up()] {
                    let wrapped = wrap(value, width);
                    assert!((-0.5 * width..0.5 * width).contains(&wrapped), "{value} in {width} is {wrapped}");
                }
            }
        }
    }
}
