//! What a load, a scan or a write reports in addition to its result: warnings are data, libraries do not print.

use crate::shown;

/// Warnings and counts of one piece of work.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// One sentence each, in the order they arose; duplicates are kept once.
    pub warnings: Vec<String>,
}

impl Report {
    /// Adds `warning`, on one line and cut if too long to read, unless it is already there.
    pub fn warn(&mut self, warning: impl AsRef<str>) {
        let warning = shown::message(warning.as_ref());
        if !self.warnings.contains(&warning) {
            log::warn!("{warning}");
            self.warnings.push(warning);
        }
    }

    /// Adds the warnings of `other`.
    pub fn absorb(&mut self, other: Report) {
        for warning in other.warnings {
            if !self.warnings.contains(&warning) {
                self.warnings.push(warning);
            }
        }
    }
}
