//! From the times of a scan to those of its rays.

use super::Tables;
use ground::error::{Error, Result};
use ground::lanes::LANES;
use model::motion::Span;

/// Converts the times of beams to those of rays.
#[derive(Clone, Copy)]
pub(crate) struct Clock {
    /// Start of the scan since that of the scene's time span, in lengths of that span.
    offset: f64,
    /// One over the length of the scene's time span, 1/s; 0 where time is frozen.
    rate: f64,
}

impl Clock {
    /// Times of rays of beams that fire `times` s after the start of the scan.
    pub fn set(&self, times: &[f64], to: &mut [f32; LANES]) {
        for (to, time) in to.iter_mut().zip(times) {
            *to = self.of(*time);
        }
    }

    /// The time of a ray of a beam that fires `time` s after the start of the scan.
    pub fn of(&self, time: f64) -> f32 {
        ((self.offset + time * self.rate) as f32).clamp(0.0, 1.0)
    }
}

impl Tables {
    /// In a moving scene, the clock of a scan that starts at `start_time`, s; with `freeze` all its beams have the same
    /// time.
    pub(crate) fn clock(&self, start_time: f64, freeze: bool) -> Option<Clock> {
        let Span { start, length } = self.span?;
        Some(Clock { offset: (start_time - start) / length, rate: if freeze { 0.0 } else { 1.0 / length } })
    }

    /// Checks that a scan from `start_time` on that takes `length`, s, is within the time span that the scene is
    /// prepared for.
    ///
    /// # Errors
    /// If something moves, and it is not.
    pub(crate) fn check_time(&self, start_time: f64, length: f64) -> Result<()> {
        // Sums of times are rounded.
        const SLACK: f64 = 1e-6;
        match self.span {
            Some(Span { start, length: whole })
                if start_time < start - SLACK || start_time + length > start + whole + SLACK =>
            {
                Err(Error::invalid(
                    "start_time",
                    format!("{start_time} s for a scan of {length} s"),
                    format!("within {start} to {} s, for which the moving scene was set", start + whole),
                ))
            }
            _ => Ok(()),
        }
    }
}
