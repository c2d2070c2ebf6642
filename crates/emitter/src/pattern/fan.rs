//! Evenly spaced angles.

use ground::error::{Error, Result};
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use serde::{Deserialize, Serialize};
use std::fmt::Display;

/// Angles at `centre - fov/2 + i step`, both ends included when `fov / step` is whole; a full turn has no duplicate at
/// its seam.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Fan {
    /// Angle covered, degrees, above 0, at most 360.
    pub fov_deg: f64,
    /// Angle from sample to sample, degrees, above 0.
    pub step_deg: f64,
    /// Direction of the middle, degrees.
    #[serde(default)]
    pub centre_deg: f64,
}

impl Fan {
    /// Number of samples.
    pub fn len(&self) -> u64 {
        samples(self.fov_deg, self.step_deg)
    }

    /// Whether there are no samples: never, as there is always one at the start.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sample `i`, degrees.
    pub fn angle_deg(&self, i: usize) -> f64 {
        self.centre_deg - 0.5 * self.fov_deg + i as f64 * self.step_deg
    }

    pub(super) fn check(&self, bounds: &mut Bounds, key: &str, widest_deg: f64) -> Result<()> {
        check_fov(bounds, format_args!("{key}.fov_deg"), self.fov_deg, widest_deg)?;
        check_above_zero(bounds, format_args!("{key}.step_deg"), self.step_deg)?;
        bounds.within(format_args!("{key}.centre_deg"), self.centre_deg, -360.0, 360.0)
    }

    /// Checks that all elevations are between straight down and straight up.
    pub(super) fn check_elevations(&self, bounds: &mut Bounds, key: &str) -> Result<()> {
        self.check(bounds, key, 180.0)?;
        let (low, high) = (self.angle_deg(0), self.angle_deg(self.len() as usize - 1));
        // Sums of decimal fractions may pass the pole by a rounding error.
        if low < -90.0 - 1e-9 || high > 90.0 + 1e-9 {
            return Err(Error::invalid(key, format!("{low} to {high} deg"), "elevations of -90 to 90 deg"));
        }
        Ok(())
    }
}

/// Number of samples of a fan; the last of a full turn is one step before the first.
pub(super) fn samples(fov_deg: f64, step_deg: f64) -> u64 {
    let steps = fov_deg / step_deg;
    if fov_deg == 360.0 { (steps.round() as u64).max(1) } else { ((steps + 1e-6).floor() as u64).saturating_add(1) }
}

pub(super) fn check_fov(bounds: &mut Bounds, key: impl Display, value: f64, widest: f64) -> Result<()> {
    bounds.number(key, value, [ABOVE_ZERO, widest], format_args!("above 0, at most {widest}"))
}

pub(super) fn check_above_zero(bounds: &mut Bounds, key: impl Display, value: impl Into<Option<f64>>) -> Result<()> {
    // Far below any instrument, and far from where quotients overflow.
    bounds.number(key, value, [1e-9, 1e12], "above 0 (1e-9 to 1e12)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_samples_but_a_turn_has_no_duplicate() {
        let fan = |fov_deg, step_deg| Fan { fov_deg, step_deg, centre_deg: 0.0 };
        assert_eq!(fan(30.0, 1.0).len(), 31);
        assert_eq!((fan(30.0, 1.0).angle_deg(0), fan(30.0, 1.0).angle_deg(30)), (-15.0, 15.0));
        // 0.3 / 0.1 is 2.9999999999999996 in f64.
        assert_eq!(fan(0.3, 0.1).len(), 4);
        assert_eq!(fan(40.0, 0.33).len(), 122);
        assert_eq!(fan(360.0, 0.2).len(), 1800);
        assert_eq!(fan(360.0, 0.1990656).len(), 1808);
        assert_eq!(fan(1.0, 5.0).len(), 1);
    }

    #[test]
    fn fans_do_not_pass_the_poles() {
        let fan = Fan { fov_deg: 60.0, step_deg: 1.0, centre_deg: 70.0 };
        let error = fan.check_elevations(&mut Bounds::none(), "pattern.elevation").unwrap_err().to_string();
        assert_eq!(error, "pattern.elevation is 40 to 100 deg; allowed: elevations of -90 to 90 deg");
        assert!(
            Fan { fov_deg: 180.0, step_deg: 0.1, centre_deg: 0.0 }.check_elevations(&mut Bounds::none(), "e").is_ok()
        );
    }
}
