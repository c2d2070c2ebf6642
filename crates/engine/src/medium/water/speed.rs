//! The speed of sound in water.

use super::validity::{Outside, outside};
use serde::{Deserialize, Serialize};

/// How the speed of sound depends on temperature, salinity and depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SoundSpeed {
    /// Mackenzie 1981, J. Acoust. Soc. Am. 70, 807: oceans to 8000 m, to 0.07 m/s.
    #[default]
    #[serde(alias = "mackenzie1981")]
    Mackenzie,
    /// Medwin 1975, J. Acoust. Soc. Am. 58, 1318: to 1000 m, to 0.2 m/s.
    #[serde(alias = "medwin1975")]
    Medwin,
    /// Leroy, Robinson and Goldsmith 2008, J. Acoust. Soc. Am. 124, 2774: all oceans and seas, including the Baltic, to
    /// 0.2 m/s.
    #[serde(alias = "leroy2008")]
    Leroy,
    /// Chen and Millero 1977, J. Acoust. Soc. Am. 62, 1129, the UNESCO algorithm.
    Unesco,
}

impl SoundSpeed {
    /// Its name in YAML.
    pub(super) fn word(self) -> &'static str {
        match self {
            SoundSpeed::Mackenzie => "mackenzie",
            SoundSpeed::Medwin => "medwin",
            SoundSpeed::Leroy => "leroy",
            SoundSpeed::Unesco => "unesco",
        }
    }

    /// Speed of sound, m/s, at a temperature in degrees Celsius (ITS-90), a practical salinity (PSU), a depth below the
    /// surface in metres and a latitude in degrees; only `Leroy` and `Unesco` use the latitude.
    ///
    /// Only `Unesco` corrects for the temperature scale of its time; in the others the correction would be 0.02 m/s at
    /// 30 C.
    pub fn speed(self, temperature_c: f64, salinity: f64, depth_m: f64, latitude_deg: f64) -> f64 {
        let (t, s, z) = (temperature_c, salinity, depth_m);
        match self {
            SoundSpeed::Mackenzie => {
                1448.96
                    + t * (4.591 + t * (-5.304e-2 + t * 2.374e-4))
                    + 1.340 * (s - 35.0)
                    + z * (1.630e-2 + z * 1.675e-7)
                    - 1.025e-2 * t * (s - 35.0)
                    - 7.139e-13 * t * z.powi(3)
            }
            SoundSpeed::Medwin => {
                1449.2 + t * (4.6 + t * (-0.055 + t * 0.00029)) + (1.34 - 0.010 * t) * (s - 35.0) + 0.016 * z
            }
            SoundSpeed::Leroy => {
                1402.5
                    + t * (5.0 + t * (-5.44e-2 + t * 2.1e-4))
                    + s * (1.33 + t * (-1.23e-2 + t * 8.7e-5))
                    + z * (1.56e-2 + z * (2.55e-7 - z * 7.3e-12))
                    // Gravity, and with it pressure, is the same north and south.
                    + 1.2e-6 * z * (latitude_deg.abs() - 45.0)
                    - 9.5e-13 * t * z.powi(3)
                    + 3e-7 * t * t * z
                    + 1.43e-5 * s * z
            }
            SoundSpeed::Unesco => unesco_speed(t, s, pressure_bar(z, latitude_deg)),
        }
    }

    /// Which of these are outside the validity range of the formula.
    pub fn outside(self, temperature_c: f64, salinity: f64, depth_m: f64) -> Vec<Outside> {
        let (temperature, salt, depth) = match self {
            SoundSpeed::Mackenzie => ([-2.0, 30.0], [30.0, 40.0], [0.0, 8000.0]),
            SoundSpeed::Medwin => ([0.0, 35.0], [0.0, 45.0], [0.0, 1000.0]),
            // "All oceans": from freezing to the warmest surface, to the deepest trench.
            SoundSpeed::Leroy => ([-2.0, 34.0], [0.0, 42.0], [0.0, 12_000.0]),
            // 1000 bar are reached at 9700 m.
            SoundSpeed::Unesco => ([0.0, 40.0], [0.0, 40.0], [0.0, 9700.0]),
        };
        outside([
            ("temperature", temperature_c, temperature, "C"),
            ("salinity", salinity, salt, "PSU"),
            ("depth", depth_m, depth, "m"),
        ])
    }
}

/// Pressure above atmospheric, bar, at a depth in metres and a latitude in degrees: Leroy and Parthiot 1998, J. Acoust.
/// Soc. Am. 103, 1346, their standard ocean (0 C, 35 PSU).
pub fn pressure_bar(depth_m: f64, latitude_deg: f64) -> f64 {
    let z = depth_m;
    let at_45_degrees = z * (1.008_18e-2 + z * (2.465e-8 + z * (-1.25e-13 + z * 2.8e-19)));
    let gravity = 9.7803 * (1.0 + 5.3e-3 * latitude_deg.to_radians().sin().powi(2));
    // MPa to bar.
    10.0 * at_45_degrees * (gravity - 2e-5 * z) / (9.806_12 - 2e-5 * z)
}

/// [`SoundSpeed::Unesco`] by pressure: speed of sound, m/s, at a temperature in degrees Celsius (ITS-90), a practical
/// salinity (PSU) and a pressure in bar above atmospheric.
///
/// Coefficients: Fofonoff and Millard 1983, UNESCO technical papers in marine science 44.
pub fn unesco_speed(temperature_c: f64, salinity: f64, pressure_bar: f64) -> f64 {
    const WATER: [&[f64]; 4] = [
        &[1402.388, 5.037_11, -5.808_52e-2, 3.3420e-4, -1.478_00e-6, 3.1464e-9],
        &[0.153_563, 6.8982e-4, -8.1788e-6, 1.3621e-7, -6.1185e-10],
        &[3.1260e-5, -1.7107e-6, 2.5974e-8, -2.5335e-10, 1.0405e-12],
        &[-9.7729e-9, 3.8504e-10, -2.3643e-12],
    ];
    const SALT: [&[f64]; 4] = [
        &[1.389, -1.262e-2, 7.164e-5, 2.006e-6, -3.21e-8],
        &[9.4742e-5, -1.2580e-5, -6.4885e-8, 1.0507e-8, -2.0122e-10],
        &[-3.9064e-7, 9.1041e-9, -1.6002e-10, 7.988e-12],
        &[1.100e-10, 6.649e-12, -3.389e-13],
    ];
    // The coefficients use the temperature scale of 1968.
    let (t, s, p) = (1.000_24 * temperature_c, salinity.max(0.0), pressure_bar);
    let polynomial = |coefficients: &[f64], x: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let of = |rows: [&[f64]; 4]| polynomial(&rows.map(|row| polynomial(row, t)), p);
    let b = -1.922e-2 - 4.42e-5 * t + (7.3637e-5 + 1.7945e-7 * t) * p;
    let d = 1.727e-3 - 7.9836e-6 * p;
    of(WATER) + s * (of(SALT) + b * s.sqrt() + d * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Check values published by the authors.
    #[test]
    fn published_values() {
        assert!((SoundSpeed::Mackenzie.speed(25.0, 35.0, 1000.0, 45.0) - 1550.744).abs() < 1e-3);
        assert!((unesco_speed(40.0 / 1.000_24, 40.0, 1000.0) - 1731.995).abs() < 1e-3);
    }

    /// Where all formulas are valid, they agree within their stated accuracy.
    #[test]
    fn formulas_agree_where_they_hold() {
        for (t, z) in [(0.0, 0.0), (5.0, 500.0), (10.0, 1000.0), (20.0, 100.0), (30.0, 0.0)] {
            let all = [SoundSpeed::Mackenzie, SoundSpeed::Medwin, SoundSpeed::Leroy, SoundSpeed::Unesco]
                .map(|formula| formula.speed(t, 35.0, z, 45.0));
            let most = all.iter().fold(f64::MIN, |a, &b| a.max(b));
            let least = all.iter().fold(f64::MAX, |a, &b| a.min(b));
            assert!(most - least < 0.6, "{t} {z}: {all:?}");
        }
    }

    #[test]
    fn pressure_grows_by_a_bar_in_ten_metres() {
        assert_eq!(pressure_bar(0.0, 45.0), 0.0);
        assert!((pressure_bar(10.0, 45.0) - 1.008).abs() < 1e-3);
        // Gravity is greater at the poles.
        assert!(pressure_bar(1000.0, 90.0) > pressure_bar(1000.0, 0.0));
        assert_eq!(pressure_bar(1000.0, 90.0), pressure_bar(1000.0, -90.0));
        for formula in [SoundSpeed::Leroy, SoundSpeed::Unesco] {
            let [south, north] = [-60.0, 60.0].map(|latitude| formula.speed(2.0, 35.0, 4000.0, latitude));
            assert_eq!(south, north);
        }
    }

    #[test]
    fn values_outside_the_validity_range_are_reported() {
        assert!(SoundSpeed::Mackenzie.outside(10.0, 35.0, 100.0).is_empty());
        let messages: Vec<String> =
            SoundSpeed::Mackenzie.outside(35.0, 5.0, 9000.0).iter().map(ToString::to_string).collect();
        assert_eq!(
            messages,
            [
                "temperature 35 C (valid for -2 to 30 C)",
                "salinity 5 PSU (valid for 30 to 40 PSU)",
                "depth 9000 m (valid for 0 to 8000 m)",
            ]
        );
        assert_eq!(SoundSpeed::Medwin.outside(10.0, 35.0, 5000.0)[0].range, [0.0, 1000.0]);
        assert_eq!(SoundSpeed::Leroy.outside(10.0, f64::NAN, 0.0).len(), 1);
    }
}
