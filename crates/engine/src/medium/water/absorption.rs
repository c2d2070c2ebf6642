//! Absorption of sound by water.

use super::validity::{Outside, outside};
use serde::{Deserialize, Serialize};

/// How absorption depends on the frequency and the water.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Absorption {
    /// Francois and Garrison 1982, J. Acoust. Soc. Am. 72, 896 and 1879: 200 Hz to 1 MHz, to 5 %.
    #[default]
    FrancoisGarrison,
    /// Ainslie and McColm 1998, J. Acoust. Soc. Am. 103, 1671: the same, simplified, to 10 % of it.
    AinslieMccolm,
    /// Thorp, as in Jensen and others (Computational Ocean Acoustics, eq. 1.34): 100 Hz to 50 kHz, water of 4 C, 35 PSU
    /// and pH 8 in 1 km, whatever the actual water.
    Thorp,
    /// None.
    None,
}

impl Absorption {
    /// Its name in YAML.
    pub(super) fn word(self) -> &'static str {
        match self {
            Absorption::FrancoisGarrison => "francois_garrison",
            Absorption::AinslieMccolm => "ainslie_mccolm",
            Absorption::Thorp => "thorp",
            Absorption::None => "none",
        }
    }

    /// Whether it depends on the water, not only on the frequency.
    pub(super) fn depends_on_the_water(self) -> bool {
        matches!(self, Absorption::FrancoisGarrison | Absorption::AinslieMccolm)
    }

    /// Absorption, dB/km, at a frequency in Hz (0 where it is not above 0), a temperature in degrees Celsius, a
    /// practical salinity (PSU), a pH and a depth below the surface in metres.
    pub fn db_per_km(self, frequency_hz: f64, temperature_c: f64, salinity: f64, ph: f64, depth_m: f64) -> f64 {
        // Without this the relaxation of boric acid is 0/0 in fresh water.
        if frequency_hz <= 0.0 {
            return 0.0;
        }
        let (f2, t, s, z) = ((frequency_hz * 1e-3).powi(2), temperature_c, salinity.max(0.0), depth_m);
        // Frequency dependence of a process with the relaxation frequency `at`, kHz; zero if the process is absent.
        let relaxed = |at: f64| at * f2 / (at * at + f2);
        match self {
            Absorption::FrancoisGarrison => {
                let speed = 1412.0 + 3.21 * t + 1.19 * s + 0.0167 * z;
                let kelvin = t + 273.0;
                let boric_acid = 8.86 / speed
                    * 10f64.powf(0.78 * ph - 5.0)
                    * relaxed(2.8 * (s / 35.0).sqrt() * 10f64.powf(4.0 - 1245.0 / kelvin));
                let magnesium_sulphate = 21.44 * s / speed
                    * (1.0 + 0.025 * t)
                    * (1.0 + z * (-1.37e-4 + z * 6.2e-9))
                    * relaxed(8.17 * 10f64.powf(8.0 - 1990.0 / kelvin) / (1.0 + 0.0018 * (s - 35.0)));
                let viscosity = if t <= 20.0 {
                    4.937e-4 + t * (-2.59e-5 + t * (9.11e-7 - t * 1.50e-8))
                } else {
                    3.964e-4 + t * (-1.146e-5 + t * (1.45e-7 - t * 6.5e-10))
                };
                let water = viscosity * (1.0 + z * (-3.83e-5 + z * 4.9e-10)) * f2;
                boric_acid + magnesium_sulphate + water
            }
            Absorption::AinslieMccolm => {
                let km = z * 1e-3;
                let boric_acid =
                    0.106 * relaxed(0.78 * (s / 35.0).sqrt() * (t / 26.0).exp()) * ((ph - 8.0) / 0.56).exp();
                let magnesium_sulphate =
                    0.52 * (1.0 + t / 43.0) * s / 35.0 * relaxed(42.0 * (t / 17.0).exp()) * (-km / 6.0).exp();
                boric_acid + magnesium_sulphate + 0.000_49 * f2 * (-t / 27.0 - km / 17.0).exp()
            }
            Absorption::Thorp => 3.3e-3 + 0.11 * f2 / (1.0 + f2) + 44.0 * f2 / (4100.0 + f2) + 3.0e-4 * f2,
            Absorption::None => 0.0,
        }
    }

    /// Which of these are outside the validity range of the law.
    pub fn outside(self, frequency_hz: f64, temperature_c: f64, salinity: f64, ph: f64, depth_m: f64) -> Vec<Outside> {
        let (frequency, temperature, salt, acid, depth) = match self {
            // Their 5 % hold in oceans; above 500 kHz, where only the water itself absorbs, in most waters.
            Absorption::FrancoisGarrison if frequency_hz <= 500e3 => {
                ([200.0, 1e6], [-2.0, 22.0], [30.0, 35.0], [7.7, 8.3], [0.0, 3500.0])
            }
            Absorption::FrancoisGarrison => ([200.0, 1e6], [0.0, 30.0], [0.0, 40.0], [7.7, 8.3], [0.0, 10_000.0]),
            Absorption::AinslieMccolm => ([100.0, 1e6], [-6.0, 35.0], [5.0, 50.0], [7.7, 8.3], [0.0, 7000.0]),
            Absorption::Thorp => return outside([("frequency", frequency_hz, [100.0, 50e3], "Hz")]),
            Absorption::None => return Vec::new(),
        };
        outside([
            ("frequency", frequency_hz, frequency, "Hz"),
            ("temperature", temperature_c, temperature, "C"),
            ("salinity", salinity, salt, "PSU"),
            ("pH", ph, acid, ""),
            ("depth", depth_m, depth, "m"),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thorp_by_hand() {
        for (frequency, expected) in [(1e3, 0.003_3 + 0.055 + 44.0 / 4101.0 + 3e-4), (10e3, 1.189_83)] {
            let found = Absorption::Thorp.db_per_km(frequency, 30.0, 0.0, 7.0, 0.0);
            assert!((found - expected).abs() < 1e-5, "{frequency}: {found}");
        }
    }

    /// Fresh water has no relaxing salts: what remains grows with the square of the frequency.
    #[test]
    fn fresh_water_only_is_viscous() {
        for law in [Absorption::FrancoisGarrison, Absorption::AinslieMccolm] {
            let at = |frequency| law.db_per_km(frequency, 10.0, 0.0, 8.0, 50.0);
            assert!((at(400e3) / at(100e3) - 16.0).abs() < 1e-9);
            assert_eq!(law.db_per_km(0.0, 10.0, 0.0, 8.0, 50.0), 0.0);
            assert_eq!(law.db_per_km(100e3, 10.0, -1.0, 8.0, 50.0), at(100e3));
        }
    }

    #[test]
    fn absorption_rises_with_frequency_and_falls_with_depth() {
        for law in [Absorption::FrancoisGarrison, Absorption::AinslieMccolm] {
            for t in [-1.0, 10.0, 30.0] {
                let mut before = 0.0;
                for exponent in 0..60 {
                    let frequency = 100.0 * 10f64.powf(f64::from(exponent) / 15.0);
                    let at = law.db_per_km(frequency, t, 35.0, 8.0, 0.0);
                    assert!(at > before && law.db_per_km(frequency, t, 35.0, 8.0, 3000.0) < at);
                    before = at;
                }
            }
        }
        assert_eq!(Absorption::None.db_per_km(1e5, 10.0, 35.0, 8.0, 0.0), 0.0);
    }

    #[test]
    fn values_outside_the_validity_range_are_reported() {
        let names_outside = |law: Absorption, frequency, salinity| {
            law.outside(frequency, 10.0, salinity, 8.0, 0.0).iter().map(|it| it.quantity).collect::<Vec<_>>()
        };
        assert!(names_outside(Absorption::FrancoisGarrison, 400e3, 35.0).is_empty());
        assert_eq!(names_outside(Absorption::FrancoisGarrison, 400e3, 5.0), ["salinity"]);
        assert!(names_outside(Absorption::FrancoisGarrison, 900e3, 5.0).is_empty());
        assert_eq!(names_outside(Absorption::FrancoisGarrison, 1.2e6, 35.0), ["frequency"]);
        assert_eq!(names_outside(Absorption::FrancoisGarrison, 100.0, 35.0), ["frequency"]);
        assert_eq!(names_outside(Absorption::Thorp, 400e3, 0.0), ["frequency"]);
        assert!(names_outside(Absorption::None, 1e9, 0.0).is_empty());
    }
}
