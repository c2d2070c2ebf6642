//! How the echoes of a beam become returns.

use crate::detect::{ReturnMode, ReturnRule};
use crate::emitter::Footprint;

/// How beams of several rays or returns are made; the same for the whole scan.
pub(crate) struct Signals {
    /// None: one ray along the beam.
    pub footprint: Option<Footprint>,
    /// Standard deviation of the pulse, m of range.
    pub sigma: f64,
    pub rule: ReturnRule,
}

impl Signals {
    /// Whether each beam is one ray and has one return: then there is a shortcut.
    pub fn are_simple(&self) -> bool {
        let single = match self.rule.mode {
            ReturnMode::Strongest => true,
            ReturnMode::First | ReturnMode::Last => self.rule.separation == 0.0,
            _ => false,
        };
        self.footprint.is_none() && single
    }

    /// Rays per beam.
    pub fn rays(&self) -> usize {
        self.footprint.as_ref().map_or(1, Footprint::len)
    }
}
