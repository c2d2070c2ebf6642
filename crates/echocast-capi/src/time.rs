//! Times: whole nanoseconds in C, seconds here.

pub(crate) fn seconds(ns: i64) -> f64 {
    // Whole seconds separately, so that a time in 2026 is rounded only once; divided, because 1e-9 itself is rounded.
    (ns / 1_000_000_000) as f64 + (ns % 1_000_000_000) as f64 / 1e9
}

pub(crate) fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
