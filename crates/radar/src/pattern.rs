//! In which directions an element transmits or receives.

use ground::error::{Error, Result};
use ground::read::bounds::{Bounds, check_rows};
use serde::{Deserialize, Serialize};

/// The pattern of an element: the product of a pattern in azimuth, `atan2(y, x)`, and one in elevation, `asin(z)`, to
/// which it radiates along x. Waves whose field is across that of the array are left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct ElementPattern {
    /// Gain straight ahead, dBi, -50 to 60.
    pub gain_dbi: f64,
    /// Shape of the lobe in a plane of which the width is given.
    pub shape: LobeShape,
    /// Full width at half the power in azimuth, degrees, 0.01 to 179; without it, and without a table, all azimuths are
    /// alike.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Likewise in elevation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<f64>,
    /// Instead of a width: rows `[degrees, dB]` in rising order, 1 to 1000, linear between them, nothing (-200 dB)
    /// outside; added to `gain_dbi`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub azimuth_table: Vec<[f64; 2]>,
    /// Likewise in elevation.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub elevation_table: Vec<[f64; 2]>,
}

/// Shapes of lobes of elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LobeShape {
    /// The power in dB falls with the square of the angle.
    #[default]
    Gaussian,
    /// The power is that power of the cosine which gives the width; nothing behind.
    Cosine,
}

/// Level of directions in which there is nothing, dB.
const NOTHING_DB: f64 = -200.0;

/// Steps of a table over a quarter turn.
const QUARTER: usize = 1024;

impl ElementPattern {
    /// Checks that its numbers, below `key`, are within their allowed ranges.
    pub(crate) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        bounds.within(format_args!("{key}.gain_dbi"), self.gain_dbi, -50.0, 60.0)?;
        for (name, width, table) in [
            ("azimuth", self.azimuth_deg, &self.azimuth_table),
            ("elevation", self.elevation_deg, &self.elevation_table),
        ] {
            bounds.within(format_args!("{key}.{name}_deg"), width, 0.01, 179.0)?;
            if table.is_empty() {
                continue;
            }
            let key = format!("{key}.{name}_table");
            if width.is_some() {
                return Err(Error::invalid(key, "given", format!("this or {name}_deg")));
            }
            check_rows(&key, table.len())?;
            for (row, [at, level]) in table.iter().enumerate() {
                bounds.within(format_args!("{key}[{row}][0]"), *at, -180.0, 180.0)?;
                bounds.within(format_args!("{key}[{row}][1]"), *level, NOTHING_DB, 60.0)?;
            }
            for row in 1..table.len() {
                bounds.rising(
                    (format_args!("{key}[{}][0]", row - 1), table[row - 1][0]),
                    (format_args!("{key}[{row}][0]"), table[row][0]),
                )?;
            }
        }
        Ok(())
    }

    /// Level at `degrees` in a plane with this width or table, dB.
    fn level(&self, width: Option<f64>, table: &[[f64; 2]], degrees: f64) -> f64 {
        if let Some(last) = table.len().checked_sub(1) {
            let after = table.partition_point(|row| row[0] <= degrees);
            return match after {
                0 => NOTHING_DB,
                _ if after > last => {
                    if degrees <= table[last][0] {
                        table[last][1]
                    } else {
                        NOTHING_DB
                    }
                }
                _ => {
                    let ([from, low], [to, high]) = (table[after - 1], table[after]);
                    low + (high - low) * (degrees - from) / (to - from)
                }
            };
        }
        let Some(width) = width else { return 0.0 };
        match self.shape {
            // Half the power, 10 log 2 dB, at half the width.
            LobeShape::Gaussian => (-10.0 * 2f64.log10() * (2.0 * degrees / width).powi(2)).max(NOTHING_DB),
            LobeShape::Cosine if degrees.abs() >= 90.0 => NOTHING_DB,
            LobeShape::Cosine => {
                let decibels = |degrees: f64| 10.0 * degrees.to_radians().cos().log10();
                (-10.0 * 2f64.log10() * decibels(degrees) / decibels(0.5 * width)).max(NOTHING_DB)
            }
        }
    }

    /// Its gain in the unit vector `direction`, as a factor of power.
    pub fn gain(&self, [x, y, z]: [f64; 3]) -> f64 {
        let azimuth = self.level(self.azimuth_deg, &self.azimuth_table, y.atan2(x).to_degrees());
        let elevation = self.level(self.elevation_deg, &self.elevation_table, z.clamp(-1.0, 1.0).asin().to_degrees());
        10f64.powf(0.1 * (self.gain_dbi + azimuth + elevation))
    }

    /// As a table, for many directions.
    pub fn table(&self) -> LobeTable {
        let amplitude = |level: f64| 10f64.powf(0.05 * level) as f32;
        let azimuth = |step: usize| {
            let diamond = step as f64 / QUARTER as f64 - 2.0;
            let degrees = angle_of_diamond(diamond).to_degrees();
            amplitude(self.gain_dbi + self.level(self.azimuth_deg, &self.azimuth_table, degrees))
        };
        let elevation = |step: usize| {
            let degrees = (step as f64 / QUARTER as f64 - 1.0).clamp(-1.0, 1.0).asin().to_degrees();
            amplitude(self.level(self.elevation_deg, &self.elevation_table, degrees))
        };
        // One more, for what is interpolated after the last.
        LobeTable {
            azimuth: (0..=4 * QUARTER + 1).map(azimuth).collect(),
            elevation: (0..=2 * QUARTER + 1).map(elevation).collect(),
        }
    }
}

/// The angle, radians, of the directions whose `y / (|x| + |y|)`, continued to -2 to 2 around the back, is `diamond`.
fn angle_of_diamond(diamond: f64) -> f64 {
    let (quarter, sign) = (diamond.abs().min(2.0), diamond.signum());
    let (x, y) = if quarter <= 1.0 { (1.0 - quarter, quarter) } else { (1.0 - quarter, 2.0 - quarter) };
    sign * y.atan2(x)
}

/// Amplitudes of a pattern over numbers that increase with the azimuth and the elevation but need no arctangents.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeTable {
    azimuth: Vec<f32>,
    elevation: Vec<f32>,
}

impl LobeTable {
    /// Amplitude in the unit vector `direction`: the root of the gain.
    pub fn amplitude(&self, [x, y, z]: [f32; 3]) -> f32 {
        let part = y.abs() / (x.abs() + y.abs()).max(1e-30);
        let diamond = (if x >= 0.0 { part } else { 2.0 - part }).copysign(y);
        let at = |table: &[f32], place: f32, last: usize| {
            let place = place.clamp(0.0, last as f32);
            let cell = place as usize;
            table[cell] + (table[cell + 1] - table[cell]) * (place - cell as f32)
        };
        at(&self.azimuth, (diamond + 2.0) * QUARTER as f32, 4 * QUARTER)
            * at(&self.elevation, (z + 1.0) * QUARTER as f32, 2 * QUARTER)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::read::yaml::from_str;

    fn direction(azimuth: f64, elevation: f64) -> [f64; 3] {
        let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
        [ce * ca, ce * sa, se]
    }

    #[test]
    fn half_the_power_at_half_the_width() {
        for shape in ["gaussian", "cosine"] {
            let text = format!("{{gain_dbi: 10, shape: {shape}, azimuth_deg: 80, elevation_deg: 12}}");
            let pattern: ElementPattern = from_str("text", &text).unwrap();
            assert!((pattern.gain(direction(0.0, 0.0)) - 10.0).abs() < 1e-9);
            for (azimuth, elevation, expected) in
                [(40.0, 0.0, 5.0), (-40.0, 0.0, 5.0), (0.0, 6.0, 5.0), (40.0, -6.0, 2.5)]
            {
                assert!((pattern.gain(direction(azimuth, elevation)) - expected).abs() < 1e-9, "{shape}");
            }
            assert!(pattern.gain(direction(180.0, 0.0)) < 0.01);
        }
    }

    #[test]
    fn tables_follow_patterns() {
        for text in [
            "{gain_dbi: 10, azimuth_deg: 80, elevation_deg: 12}",
            "{gain_dbi: 3, shape: cosine, azimuth_deg: 100}",
            "{azimuth_table: [[-60, -20], [-10, 0], [10, 0], [60, -20]], elevation_deg: 20}",
            "{}",
        ] {
            let pattern: ElementPattern = from_str("text", text).unwrap();
            pattern.check("pattern", &mut Bounds::none()).unwrap();
            let (table, ahead) = (pattern.table(), pattern.gain([1.0, 0.0, 0.0]).sqrt());
            for step in 0..2000 {
                let (azimuth, elevation) = (-179.9 + 0.18 * f64::from(step), 60.0 * (f64::from(step) * 0.37).sin());
                // The ends of a table are steps.
                if (azimuth.abs() - 60.0).abs() < 0.2 || (azimuth.abs() - 90.0).abs() < 0.2 {
                    continue;
                }
                let direction = direction(azimuth, elevation);
                let found = f64::from(table.amplitude(direction.map(|axis| axis as f32)));
                let error = (found - pattern.gain(direction).sqrt()).abs() / ahead;
                assert!(error < 1e-3, "{text} at {azimuth}, {elevation}: {error}");
            }
        }
    }

    #[test]
    fn tables_that_do_not_rise_are_refused() {
        let error = |text: &str| {
            let pattern: ElementPattern = from_str("text", text).unwrap();
            pattern.check("pattern", &mut Bounds::none()).unwrap_err().to_string()
        };
        assert!(error("azimuth_table: [[0, 0], [0, -3]]").contains("pattern.azimuth_table[1][0] is 0"));
        assert_eq!(
            error("{azimuth_deg: 10, azimuth_table: [[0, 0]]}"),
            "pattern.azimuth_table is given; allowed: this or azimuth_deg"
        );
        assert!(error("elevation_deg: 200").contains("pattern.elevation_deg"));
    }
}
