//! What a load, a scan or a write did beyond its result: warnings are data, libraries do not print.

use crate::ground::shown;

/// Warnings and counts of one piece of work.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// One sentence each, in the order they arose; repeated ones are kept once.
    pub warnings: Vec<String>,
}

impl Report {
    /// Adds `warning`, on one line and cut where it is as long as nobody reads, unless it has been said.
    pub fn warn(&mut self, warning: impl AsRef<str>) {
        let warning = shown::message(warning.as_ref());
        if !self.warnings.contains(&warning) {
            log::warn!("{warning}");
            self.warnings.push(warning);
        }
    }

    /// Takes over the warnings of `other`.
    pub fn absorb(&mut self, other: Report) {
        for warning in other.warnings {
            if !self.warnings.contains(&warning) {
                self.warnings.push(warning);
            }
        }
    }
}
