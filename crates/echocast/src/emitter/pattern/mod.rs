//! Scan patterns: where each beam points and when it fires.

use super::BeamTable;
use crate::error::Result;
use std::path::Path;

/// A scan pattern, as the `pattern` section of a sensor file says it.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {}

impl Pattern {
    /// The beams of one scan. `folder` is where relative file names start.
    ///
    /// # Errors
    /// Values out of range, naming the key; a beam table that cannot be read.
    pub fn beams(&self, _folder: &Path) -> Result<BeamTable> {
        match *self {}
    }
}
