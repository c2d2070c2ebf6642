//! What an instrument reports as intensity.

use echocast_kernels::light;
use ground::lanes::LANES;
use ground::named;
use ground::profile::Profile;
use serde::{Deserialize, Serialize};

/// How received energy is encoded in the `intensity` column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum IntensityEncoding {
    /// Range-corrected reflectivity: the effective reflectance `rho cos(theta)`, 0..1 for diffuse surfaces, above 1 for
    /// retro-reflectors and gloss.
    #[default]
    Reflectivity,
    /// The same in 8 bits as Velodyne, RoboSense and Livox define it: a white surface has a count of their choice (100,
    /// 110, 150), darker surfaces are in proportion, and brighter ones have the counts up to 255, in equal logarithmic
    /// steps up to 1000 times as much.
    Reflectivity8,
    /// The same in 8 bits as Hesai defines it: percent, 0..255.
    Reflectivity255,
    /// Relative received energy of the hard-target radar equation, `rho cos(theta) / (pi R^2)`, 1/(m^2 sr).
    Power,
    /// The effective reflectance in dB, as surveyors' LAS files have it: 0 for -40 dB and less, 1 for 10 dB and more, in
    /// proportion between.
    ReflectanceDb,
}

named! { IntensityEncoding: Reflectivity "reflectivity", Reflectivity8 "reflectivity8", Reflectivity255 "reflectivity255",
Power "power", ReflectanceDb "reflectance_db" }

/// Effective reflectances, dB, for which [`IntensityEncoding::ReflectanceDb`] is 0 and 1.
const DECIBELS: [f32; 2] = [-40.0, 10.0];

impl IntensityEncoding {
    /// Full-scale value; relative energy has none.
    pub fn full_scale(self) -> Option<f32> {
        match self {
            IntensityEncoding::Reflectivity | IntensityEncoding::ReflectanceDb => Some(1.0),
            IntensityEncoding::Reflectivity8 | IntensityEncoding::Reflectivity255 => Some(255.0),
            IntensityEncoding::Power => None,
        }
    }
}

/// How a scan computes intensity: the instrument's encoding, or what a profile uses instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum IntensityModel {
    /// As the instrument encodes it; the count of a white surface in 8 bits.
    Encoded(IntensityEncoding, f32),
    /// `P_n = rho / (pi R^2)`: the paper's eq. 5 in clear air, which has no cosine.
    PaperEq5,
    /// `rho cos(theta)`, and 0 where it is not detected: as computed by the paper's program.
    Blainder,
}

impl IntensityModel {
    /// That of a scan in `profile` with an instrument that encodes it so; the count of a white surface in 8 bits.
    pub fn new(profile: Profile, encoding: IntensityEncoding, white_count: f32) -> IntensityModel {
        profile.choose(
            IntensityModel::Encoded(encoding, white_count),
            IntensityModel::PaperEq5,
            IntensityModel::Blainder,
        )
    }

    /// As [`IntensityEncoding::full_scale`].
    pub(crate) fn full_scale(self) -> Option<f32> {
        match self {
            IntensityModel::Encoded(encoding, _) => encoding.full_scale(),
            IntensityModel::PaperEq5 => None,
            IntensityModel::Blainder => Some(1.0),
        }
    }

    /// Whether it is corrected for the efficiency of the channel, as a calibrated reflectivity is.
    pub(crate) fn is_calibrated(self) -> bool {
        matches!(self, IntensityModel::Encoded(encoding, _) if encoding != IntensityEncoding::Power)
    }

    /// Intensity of a hard target: Lambert reflectance `rho` (0 or more), `cos` of the incidence angle, `range` in m.
    pub fn of(self, rho: f32, cos: f32, range: f32) -> f32 {
        match self {
            IntensityModel::Encoded(IntensityEncoding::Reflectivity, _) | IntensityModel::Blainder => rho * cos,
            IntensityModel::Encoded(IntensityEncoding::Reflectivity8, white) => light::eight_bits(rho, cos, white),
            IntensityModel::Encoded(IntensityEncoding::Reflectivity255, _) => light::percent(rho, cos),
            IntensityModel::Encoded(IntensityEncoding::Power, _) => light::power(rho * cos, range),
            IntensityModel::Encoded(IntensityEncoding::ReflectanceDb, _) => {
                let [least, most] = DECIBELS;
                ((10.0 * (rho * cos).log10() - least) / (most - least)).clamp(0.0, 1.0)
            }
            IntensityModel::PaperEq5 => light::power(rho, range),
        }
    }

    /// [`IntensityModel::of`] for each lane.
    pub(crate) fn of_all(self, rho: &[f32; LANES], cos: &[f32; LANES], range: &[f32; LANES], to: &mut [f32; LANES]) {
        match self {
            IntensityModel::Encoded(IntensityEncoding::Reflectivity, _) | IntensityModel::Blainder => {
                light::product(rho, cos, to);
            }
            IntensityModel::Encoded(IntensityEncoding::Reflectivity8, white) => {
                light::to_eight_bits(rho, cos, white, to)
            }
            IntensityModel::Encoded(IntensityEncoding::Reflectivity255, _) => light::to_percent(rho, cos, to),
            IntensityModel::Encoded(IntensityEncoding::Power, _) => light::to_power(rho, cos, range, to),
            IntensityModel::Encoded(IntensityEncoding::ReflectanceDb, _) => {
                for lane in 0..LANES {
                    to[lane] = self.of(rho[lane], cos[lane], range[lane]);
                }
            }
            IntensityModel::PaperEq5 => light::to_power_without_cosine(rho, range, to),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of `P_n` computed with numpy: gamma, R in m, theta in degrees, eq. 5 without and with cosine.
    #[test]
    fn relative_energy_follows_the_radar_equation() {
        for (gamma, range, theta, without, with) in [
            (0.05f32, 1.0f32, 0.0f32, 1.591_549_4e-2, 1.591_549_4e-2),
            (0.05, 5.0, 60.0, 6.366_197_6e-4, 3.183_098_8e-4),
            (0.5, 10.0, 60.0, 1.591_549_4e-3, 7.957_747e-4),
        ] {
            let cos = theta.to_radians().cos();
            let power = IntensityModel::Encoded(IntensityEncoding::Power, 100.0).of(gamma, cos, range);
            let paper = IntensityModel::PaperEq5.of(gamma, cos, range);
            assert!((power / with - 1.0).abs() < 3e-5, "{power} {with}");
            assert!((paper / without - 1.0).abs() < 3e-5, "{paper} {without}");
        }
    }

    /// 60 % are -2.218487 dB, 5 % are -13.01030 dB.
    #[test]
    fn decibels_are_in_proportion() {
        let model = IntensityModel::Encoded(IntensityEncoding::ReflectanceDb, 100.0);
        for (rho, decibels) in [(0.6f32, -2.218_487f32), (0.05, -13.010_3), (1e-9, -40.0), (0.0, -40.0), (50.0, 10.0)] {
            assert!((model.of(rho, 1.0, 7.0) * 50.0 - 40.0 - decibels).abs() < 1e-4, "{rho}");
        }
        assert_eq!(model.full_scale(), Some(1.0));
    }

    #[test]
    fn energy_falls_with_the_square_of_range() {
        let model = IntensityModel::Encoded(IntensityEncoding::Power, 100.0);
        let ratio = model.of(0.3, 0.7, 20.0) / model.of(0.3, 0.7, 40.0);
        assert!((ratio - 4.0).abs() < 1e-5);
        assert_eq!((model.full_scale(), IntensityModel::PaperEq5.full_scale()), (None, None));
    }

    #[test]
    fn eight_bit_reflectivity_counts_diffuse_percent() {
        let model = IntensityModel::Encoded(IntensityEncoding::Reflectivity8, 100.0);
        assert_eq!(model.of(0.8, 0.5, 33.0), 40.0);
        assert_eq!(model.of(1.0, 1.0, 33.0), 100.0);
        assert_eq!(model.full_scale(), Some(255.0));
    }

    /// Computed from the two lines of the scale; 785.398 and 219.911 correspond to 250 and 70 cd/(lx m^2).
    #[test]
    fn eight_bits_hold_retro_reflectors() {
        let model = IntensityModel::Encoded(IntensityEncoding::Reflectivity8, 100.0);
        for (rho_eff, expected) in [
            (0.0, 0.0),
            (0.994, 99.0),
            (1.0, 100.0),
            (1.000_1, 101.0),
            (2.0, 116.0),
            (31.622_78, 178.0),
            (219.911, 221.0),
            (785.398, 250.0),
            (1000.0, 255.0),
            (1e9, 255.0),
            (f32::INFINITY, 255.0),
        ] {
            assert_eq!(model.of(rho_eff, 1.0, 7.0), expected, "{rho_eff}");
        }
        // What lanes without a hit may contain.
        for none in [f32::NAN, -f32::NAN] {
            assert!(model.of(none, 1.0, 7.0).is_nan());
        }
        assert_eq!(model.of(-0.0, 1.0, 7.0), 0.0);
        // Other counts of a white surface.
        for (white, rho_eff, expected) in
            [(110.0, 0.5, 55.0), (110.0, 1.0, 110.0), (110.0, 1.000_1, 111.0), (150.0, 0.4, 60.0), (150.0, 1e9, 255.0)]
        {
            let model = IntensityModel::Encoded(IntensityEncoding::Reflectivity8, white);
            assert_eq!(model.of(rho_eff, 1.0, 7.0), expected, "{white} {rho_eff}");
        }
        let linear = IntensityModel::Encoded(IntensityEncoding::Reflectivity255, 100.0);
        for (rho_eff, expected) in
            [(0.0, 0.0), (0.8, 80.0), (1.234, 123.0), (2.55, 255.0), (2.6, 255.0), (785.0, 255.0)]
        {
            assert_eq!(linear.of(rho_eff, 1.0, 7.0), expected, "{rho_eff}");
        }
        assert!(linear.of(f32::NAN, 1.0, 7.0).is_nan());
        assert_eq!(linear.full_scale(), Some(255.0));
    }
}
