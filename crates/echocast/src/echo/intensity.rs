//! What an instrument reports as intensity.

use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

/// How received energy becomes the `intensity` column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntensityEncoding {
    /// Range-corrected reflectivity `rho cos(theta)`, 0..1.
    #[default]
    Reflectivity,
    /// The same in 8 bits: 0..100 diffuse percent, 101..255 retro-reflectors.
    Reflectivity8,
    /// Relative received energy of the hard-target radar equation, `rho cos(theta) / (pi R^2)`, 1/(m^2 sr).
    Power,
}

impl IntensityEncoding {
    /// Value that means full scale; relative energy has none.
    pub fn full_scale(self) -> Option<f32> {
        match self {
            IntensityEncoding::Reflectivity => Some(1.0),
            IntensityEncoding::Reflectivity8 => Some(255.0),
            IntensityEncoding::Power => None,
        }
    }
}

/// How a scan computes intensity: the instrument's encoding, or what a profile puts in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum IntensityModel {
    /// As the instrument encodes it.
    Encoded(IntensityEncoding),
    /// `P_n = rho / (pi R^2)`: the paper's eq. 5 in clear air, which has no cosine.
    PaperEq5,
    /// `rho cos(theta)`, and 0 where it is not detected: the paper's program.
    Blainder,
}

impl IntensityModel {
    /// As [`IntensityEncoding::full_scale`].
    pub(crate) fn full_scale(self) -> Option<f32> {
        match self {
            IntensityModel::Encoded(encoding) => encoding.full_scale(),
            IntensityModel::PaperEq5 => None,
            IntensityModel::Blainder => Some(1.0),
        }
    }

    /// Intensity of a hard target: reflectance `rho` (0..1), `cos` of the incidence angle, `range` in m.
    #[inline(always)]
    pub(crate) fn of(self, rho: f32, cos: f32, range: f32) -> f32 {
        match self {
            IntensityModel::Encoded(IntensityEncoding::Reflectivity) | IntensityModel::Blainder => rho * cos,
            // Diffuse targets only reach the lower part of the scale, 1 = 100 %.
            IntensityModel::Encoded(IntensityEncoding::Reflectivity8) => (100.0 * rho * cos).round_ties_even(),
            IntensityModel::Encoded(IntensityEncoding::Power) => rho * cos / (PI * range * range),
            IntensityModel::PaperEq5 => rho / (PI * range * range),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of `P_n` made with numpy: gamma, R in m, theta in degrees, eq. 5 without and with cosine.
    #[test]
    fn relative_energy_follows_the_radar_equation() {
        for (gamma, range, theta, without, with) in [
            (0.05f32, 1.0f32, 0.0f32, 1.591_549_4e-2, 1.591_549_4e-2),
            (0.05, 5.0, 60.0, 6.366_197_6e-4, 3.183_098_8e-4),
            (0.5, 10.0, 60.0, 1.591_549_4e-3, 7.957_747e-4),
        ] {
            let cos = theta.to_radians().cos();
            let power = IntensityModel::Encoded(IntensityEncoding::Power).of(gamma, cos, range);
            let paper = IntensityModel::PaperEq5.of(gamma, cos, range);
            assert!((power / with - 1.0).abs() < 3e-5, "{power} {with}");
            assert!((paper / without - 1.0).abs() < 3e-5, "{paper} {without}");
        }
    }

    #[test]
    fn energy_falls_with_the_square_of_range() {
        let model = IntensityModel::Encoded(IntensityEncoding::Power);
        let ratio = model.of(0.3, 0.7, 20.0) / model.of(0.3, 0.7, 40.0);
        assert!((ratio - 4.0).abs() < 1e-5);
        assert_eq!((model.full_scale(), IntensityModel::PaperEq5.full_scale()), (None, None));
    }

    #[test]
    fn eight_bit_reflectivity_counts_diffuse_percent() {
        let model = IntensityModel::Encoded(IntensityEncoding::Reflectivity8);
        assert_eq!(model.of(0.8, 0.5, 33.0), 40.0);
        assert_eq!(model.of(1.0, 1.0, 33.0), 100.0);
        assert_eq!(model.full_scale(), Some(255.0));
    }
}
