//! Light of a bright return that leaks into the beams around it.

use serde::{Deserialize, Serialize};

/// How much light from a surface brighter than a white wall, hit directly by the centre of a beam, leaks into other
/// beams of the scan: at the angle `d` between them the fraction `weight exp(-d / width_deg) + floor`. The optics
/// spread it, within the transmitted beam or over the detectors; either way the other beam has an echo at the same
/// range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Blooming {
    /// Fraction of the light right next to the bright return, above `floor`, 0 to 1.
    pub weight: f64,
    /// Angle over which that falls to 1/e, degrees, above 0, at most 90.
    pub width_deg: f64,
    /// Fraction of the light that leaks into all beams, 0 to 1.
    #[serde(default)]
    pub floor: f64,
}

impl Blooming {
    /// Fraction of the light that leaks into a beam at an `angle` in rad.
    #[doc(hidden)]
    pub fn part(&self, angle: f32) -> f32 {
        self.weight as f32 * (-angle / self.width_deg.to_radians() as f32).exp() + self.floor as f32
    }

    /// Angle in rad beyond which that fraction is below `least`; negative if it is below it everywhere.
    #[doc(hidden)]
    pub fn reach(&self, least: f32) -> f32 {
        let above = f64::from(least) - self.floor;
        let reach = if above > 0.0 { self.width_deg.to_radians() * (self.weight / above).ln() } else { f64::INFINITY };
        reach as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a fraction of 1e-4 a retro-reflector as bright as a Lambert surface of 785 acts like one of 0.0785, which a
    /// receiver that just detects 0.8 at 200 m detects up to 62.7 m.
    #[test]
    fn a_retro_reflector_blooms_into_neighbouring_beams() {
        let blooming = Blooming { weight: 9e-5, width_deg: 0.5, floor: 1e-5 };
        let rho_eff = 785.0 * blooming.part(0.0);
        assert!((rho_eff - 0.0785).abs() < 1e-7);
        assert!(((rho_eff / (0.8 / 200.0f32.powi(2))).sqrt() - 62.65).abs() < 5e-3);
        let e = std::f32::consts::E;
        assert!((blooming.part(0.5f32.to_radians()) - (9e-5 / e + 1e-5)).abs() < 1e-11);
    }

    #[test]
    fn the_reach_is_where_the_part_falls_below() {
        let blooming = Blooming { weight: 1e-3, width_deg: 0.5, floor: 1e-6 };
        for least in [1e-5, 1e-4, 9e-4] {
            assert!((blooming.part(blooming.reach(least)) / least - 1.0).abs() < 1e-5);
        }
        assert_eq!(blooming.reach(1e-6), f32::INFINITY);
        assert!(blooming.reach(2e-3) < 0.0);
    }
}
