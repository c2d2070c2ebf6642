//! Validity ranges of formulas fitted to measurements.

use std::fmt;

/// A quantity outside the range that a formula was fitted to; the formula still yields a number there, but of unknown
/// accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Outside {
    /// Its name: `temperature`, `salinity`, `pH`, `depth` or `frequency`.
    pub quantity: &'static str,
    /// Its value, in `unit`.
    pub value: f64,
    /// Range in which the formula holds, in `unit`.
    pub range: [f64; 2],
    /// Unit of both; may be empty.
    pub unit: &'static str,
}

impl fmt::Display for Outside {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Outside { quantity, value, range: [least, most], unit } = self;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        write!(f, "{quantity} {value}{unit} (valid for {least} to {most}{unit})")
    }
}

/// Those of `quantities` (name, value, range, unit) that are outside their ranges.
pub(super) fn outside<const N: usize>(quantities: [(&'static str, f64, [f64; 2], &'static str); N]) -> Vec<Outside> {
    quantities
        .into_iter()
        .filter(|(_, value, [least, most], _)| !(least..=most).contains(&value))
        .map(|(quantity, value, range, unit)| Outside { quantity, value, range, unit })
        .collect()
}
