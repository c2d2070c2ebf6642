//! Allowed ranges of numbers: defined once, for checking and for querying.

use crate::error::{Error, Result};
use crate::read::yaml;
use std::fmt::Display;

/// A numeric parameter of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its value; for an optional key without one, infinity (`range.max_m`) or NaN (all others).
    pub value: f64,
    /// Least value allowed with the present values of the other keys; -infinite without such a bound. Where a number
    /// must be above another, this is the next one in `f64`.
    pub min: f64,
    /// Greatest value allowed, likewise.
    pub max: f64,
}

/// Least number accepted where one must be above 0: far below anything real, and far from where its square, or a
/// quotient, would leave the range of single precision.
pub const ABOVE_ZERO: f64 = 1e-9;

/// Farthest range that makes sense anywhere, m.
pub const FARTHEST_M: f64 = 1e9;

/// Passed along during a check from number to number: rejects those out of bounds, and records the bounds of one key.
pub struct Bounds<'k> {
    requested: Option<&'k str>,
    /// Least value that all checks of the requested key allow; -infinite without such a bound.
    pub min: f64,
    /// Greatest value, likewise; infinite without such a bound.
    pub max: f64,
    /// The keys visited, if bounds of a key are requested.
    pub keys: Vec<String>,
}

impl<'k> Bounds<'k> {
    /// For a check only.
    pub fn none() -> Self {
        Bounds { requested: None, min: f64::NEG_INFINITY, max: f64::INFINITY, keys: Vec::new() }
    }

    /// For a check that determines the bounds of `key`.
    pub fn of(key: &'k str) -> Self {
        Bounds { requested: Some(key), ..Bounds::none() }
    }

    /// Checks that the number at `key`, if there is one, is from `min` to `max`, a range that errors describe as
    /// `allowed`.
    pub fn number(
        &mut self,
        key: impl Display,
        value: impl Into<Option<f64>>,
        [min, max]: [f64; 2],
        allowed: impl Display,
    ) -> Result<()> {
        if let Some(requested) = self.requested {
            let key = key.to_string();
            if yaml::same_path(&key, requested) {
                (self.min, self.max) = (self.min.max(min), self.max.min(max));
            }
            self.keys.push(key);
        }
        match value.into() {
            Some(value) if !(min..=max).contains(&value) => {
                let too_small = min == ABOVE_ZERO && value > 0.0 && value < min;
                let least = if too_small { " (1e-9 or more)" } else { "" };
                Err(Error::invalid(key.to_string(), value, format!("{allowed}{least}")))
            }
            _ => Ok(()),
        }
    }

    /// Checks that the number at `key`, if there is one, is from `min` to `max`.
    pub fn within(&mut self, key: impl Display, value: impl Into<Option<f64>>, min: f64, max: f64) -> Result<()> {
        self.number(key, value, [min, max], format_args!("{min} to {max}"))
    }

    /// Does `check`, whose keys are those below `section`, and names them in full.
    pub fn section(&mut self, section: &str, check: impl FnOnce(&mut Bounds) -> Result<()>) -> Result<()> {
        let below = self.requested.map(|key| key.strip_prefix(section).and_then(|key| key.strip_prefix('.')));
        // That of another section is the same as no key there.
        let mut inner = Bounds { requested: below.map(Option::unwrap_or_default), ..Bounds::none() };
        let done = check(&mut inner);
        (self.min, self.max) = (self.min.max(inner.min), self.max.min(inner.max));
        self.keys.extend(inner.keys.iter().map(|key| format!("{section}.{key}")));
        done.map_err(|error| match error {
            Error::InvalidParameter { name, value, allowed } => {
                Error::InvalidParameter { name: format!("{section}.{name}"), value, allowed }
            }
            other => other,
        })
    }

    /// Checks that the number at the key `far` is above that at `near`.
    pub fn rising<F: Into<Option<f64>> + Copy>(
        &mut self,
        (near, from): (impl Display, f64),
        (far, to): (impl Display, F),
    ) -> Result<()> {
        self.number(&far, to, [from.next_up(), f64::INFINITY], format_args!("above {near} ({from})"))?;
        let to = to.into().unwrap_or(f64::INFINITY);
        self.number(&near, from, [f64::NEG_INFINITY, to.next_down()], format_args!("below {far} ({to})"))
    }
}

/// Checks that the table at `key` has rows, and not too many for every beam to search.
pub fn check_rows(key: &str, rows: usize) -> Result<()> {
    const MOST: usize = 1000;
    if (1..=MOST).contains(&rows) {
        return Ok(());
    }
    Err(Error::invalid(key, format!("a list of {rows}"), format!("1 to {MOST} points")))
}

/// Checks that the `at_m` values of the table at `key` rise from row to row.
pub fn rising_rows(bounds: &mut Bounds, key: &str, at_m: impl Iterator<Item = f64> + Clone) -> Result<()> {
    let row = |index: usize| format!("{key}[{index}].at_m");
    at_m.clone()
        .zip(at_m.skip(1))
        .enumerate()
        .try_for_each(|(index, (near, far))| bounds.rising((row(index), near), (row(index + 1), far)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_a_key_are_those_that_are_checked() {
        let walk = |bounds: &mut Bounds, near: f64, far: Option<f64>| {
            bounds.within("a", near, -1.0, 9.0)?;
            bounds.number(format_args!("b[{}]", 0), far, [0.0, 10.0], "0 to ten")?;
            bounds.rising(("a", near), ("b[0]", far))
        };
        let of = |key, near, far| {
            let mut bounds = Bounds::of(key);
            walk(&mut bounds, near, far).unwrap();
            (bounds.min, bounds.max)
        };
        assert_eq!(of("a", 1.0, Some(2.0)), (-1.0, 2f64.next_down()));
        assert_eq!(of("a", 1.0, None), (-1.0, 9.0));
        assert_eq!(of("b[0]", 1.0, None), (1f64.next_up(), 10.0));
        assert_eq!(of("c", 1.0, None), (f64::NEG_INFINITY, f64::INFINITY));
        let refused = |near, far| walk(&mut Bounds::none(), near, Some(far)).unwrap_err().to_string();
        assert_eq!(refused(-2.0, 1.0), "a is -2; allowed: -1 to 9");
        assert_eq!(refused(f64::NAN, 1.0), "a is NaN; allowed: -1 to 9");
        assert_eq!(refused(1.0, 11.0), "b[0] is 11; allowed: 0 to ten");
        assert_eq!(refused(1.0, 1.0), "b[0] is 1; allowed: above a (1)");
        let section = |bounds: &mut Bounds| bounds.section("part", |bounds| walk(bounds, -2.0, None));
        assert_eq!(section(&mut Bounds::none()).unwrap_err().to_string(), "part.a is -2; allowed: -1 to 9");
        let mut bounds = Bounds::of("part.a");
        section(&mut bounds).unwrap_err();
        assert_eq!((bounds.min, bounds.max, &*bounds.keys), (-1.0, 9.0, &["part.a".to_owned()][..]));
        let mut bounds = Bounds::of("a");
        section(&mut bounds).unwrap_err();
        assert_eq!((bounds.min, bounds.max), (f64::NEG_INFINITY, f64::INFINITY));
        let small = |value| Bounds::none().number("a", value, [ABOVE_ZERO, 1.0], "above 0").unwrap_err().to_string();
        assert_eq!(
            [small(0.0), small(1e-300)],
            ["a is 0; allowed: above 0", "a is 1e-300; allowed: above 0 (1e-9 or more)"]
        );
    }
}
