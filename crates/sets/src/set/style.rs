//! A style in which samples are written.

use super::whole::Whole;
use crate::Sample;
use crate::sample::BoxScope;
use cloud::{FieldSet, InstanceBox, PointCloud};
use ground::error::Result;
use ground::report::Report;
use std::fmt;
use std::path::Path;

/// A style of sets, with its keys.
pub(super) trait Style: fmt::Debug + Send + Sync {
    /// Checks its keys.
    ///
    /// # Errors
    /// A value that is not allowed, with the name of its key.
    fn check(&self) -> Result<()> {
        Ok(())
    }

    /// The folder in the set that it writes to.
    fn root(&self) -> &'static str;

    /// Whether each sample has a folder there; otherwise samples share the folders in it, and each file must be named
    /// after its sample.
    fn folder_per_sample(&self) -> bool {
        false
    }

    /// Columns that it needs for `sample`.
    fn fields(&self, sample: &Sample) -> FieldSet;

    /// How it takes strips.
    fn strips(&self) -> StripUse {
        StripUse::Refused
    }

    /// The boxes around instances that it needs for this frame of a scan of `sample`, both counted from 0.
    fn boxes(&self, _sample: &Sample, _scan: usize, _frame: usize) -> BoxScope {
        BoxScope::None
    }

    /// Checks that it can hold the scans of `sample`.
    ///
    /// # Errors
    /// A missing or unsuitable sensor; several where one is written.
    fn fits(&self, sample: &Sample) -> Result<()>;

    /// Begins to write `sample`, which has this `number`, to `folder`, which is empty.
    ///
    /// # Errors
    /// I/O errors.
    fn writer<'w>(&'w self, number: u64, sample: &Sample, folder: &'w Path) -> Result<Box<dyn Writer + 'w>>;

    /// Its section of the set's `README.md`, in Markdown: what is where, and how it is read.
    fn readme(&self) -> String;

    /// Makes the files of all samples together from what was written of each: the same for the same samples, whatever
    /// exists already.
    ///
    /// # Errors
    /// I/O errors; a file that has changed since it was written.
    fn join(&self, _whole: &mut Whole) -> Result<()> {
        Ok(())
    }
}

/// How a style takes the strips of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StripUse {
    /// Not at all: its frames have one pose.
    Refused,
    /// Each as one cloud.
    Whole,
    /// In pieces, as they are scanned.
    Pieces,
}

/// Writes one sample in a style.
pub(super) trait Writer {
    /// Writes a frame of a scan, or a piece of one. Scans arrive one after the other, the frames of each in order, and
    /// the pieces of each frame.
    ///
    /// # Errors
    /// I/O errors.
    fn add(&mut self, scanned: &Scanned) -> Result<Report>;

    /// Writes what is only known after the last frame.
    ///
    /// # Errors
    /// I/O errors.
    fn finish(self: Box<Self>) -> Result<Report> {
        Ok(Report::default())
    }
}

/// A frame of a scan of a sample.
pub(super) struct Scanned<'s> {
    pub sample: &'s Sample,
    /// Index of the scan, from 0.
    pub scan: usize,
    /// Index of the frame in the scan, from 0.
    pub frame: usize,
    /// Whether no further piece of the frame follows.
    pub last: bool,
    /// With the columns that all styles need; `fields` are the requested ones.
    pub cloud: &'s PointCloud,
    /// Boxes around its instances, if a style needs them.
    pub boxes: &'s [InstanceBox],
}
