//! Processor time, which a busy machine distorts less than wall-clock time.

use rustix::time::{ClockId, clock_gettime};
use std::time::{Duration, Instant};

/// Processor time of all threads of this process, s.
pub fn cpu_seconds() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

/// Processor seconds per call of `work`, repeated until `least` has passed on the wall clock.
pub fn cpu_per_call(least: Duration, mut work: impl FnMut()) -> f64 {
    let (start, wall) = (cpu_seconds(), Instant::now());
    let mut calls = 0;
    while calls == 0 || wall.elapsed() < least {
        work();
        calls += 1;
    }
    (cpu_seconds() - start) / f64::from(calls)
}

/// Median of `values`.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The quantile of `values`, which are sorted, at `part`.
pub fn quantile(values: &[f64], part: f64) -> f64 {
    values[((values.len() - 1) as f64 * part).round() as usize]
}

/// A number above 0, rounded to two digits.
pub fn two_digits(value: f64) -> String {
    let scientific = format!("{value:.1e}");
    let (_, exponent) = scientific.split_once('e').expect("written so");
    let exponent: i32 = exponent.parse().expect("a whole number");
    let rounded: f64 = scientific.parse().expect("a number");
    format!("{rounded:.*}", (1 - exponent).max(0) as usize)
}
