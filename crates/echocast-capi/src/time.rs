//! Times: whole nanoseconds in C, seconds here.

use crate::guard::{Failure, Outcome};

pub(crate) fn seconds(ns: i64) -> f64 {
    // Whole seconds separately, so that a time in 2026 is rounded only once; divided, because 1e-9 itself is rounded.
    (ns / 1_000_000_000) as f64 + (ns % 1_000_000_000) as f64 / 1e9
}

/// Of a duration `name` for which 0 means none is given.
pub(crate) fn optional_seconds(ns: i64, name: &str) -> Outcome<Option<f64>> {
    match ns {
        0 => Ok(None),
        1.. => Ok(Some(seconds(ns))),
        other => Err(Failure::argument(name, other, "0 or more")),
    }
}

pub(crate) fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
