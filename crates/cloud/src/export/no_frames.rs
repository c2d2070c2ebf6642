//! In place of `frames.rs` in builds without HDF5.

use super::format_for;
use crate::PointCloud;
use ground::error::{Error, Result};
use ground::report::Report;
use std::path::Path;

/// An HDF5 file that grows by one frame at a time: in this build there are none.
#[derive(Debug)]
pub enum FramesFile {}

impl FramesFile {
    /// Fails: HDF5 is not in this build.
    ///
    /// # Errors
    /// [`Error::Unsupported`], naming the feature.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        format_for(path.as_ref(), Some("hdf5"))?;
        Err(Error::Internal("HDF5 is known, but not built in".into()))
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// There is no file to add it to.
    pub fn add(&mut self, _: &PointCloud) -> Result<()> {
        match *self {}
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// There is no file.
    pub fn finish(self) -> Result<Report> {
        match self {}
    }
}
