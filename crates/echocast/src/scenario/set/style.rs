//! Styles in which samples are written: one source file for each, and one table of all.

use super::coco::Coco;
use super::kitti::Kitti;
use super::nuscenes::NuScenes;
use super::plain::Plain;
use super::semantic_kitti::SemanticKitti;
use super::voc::Voc;
use super::webdataset::WebDataset;
use super::whole::Whole;
use crate::cloud::{FieldSet, InstanceBox, PointCloud};
use crate::ground::error::{Error, Result, nearest};
use crate::ground::report::Report;
use crate::read::yaml::Document;
use crate::scenario::Sample;
use crate::scenario::sample::BoxScope;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::fmt;
use std::path::{Path, PathBuf};

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

/// Writes one sample in a style.
pub(super) trait Writer {
    /// Writes a frame of a scan. Scans arrive one after the other, the frames of each in order.
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
    /// With the columns that all styles need; `fields` are the requested ones.
    pub cloud: &'s PointCloud,
    /// Boxes around its instances, if a style needs them.
    pub boxes: &'s [InstanceBox],
}

type ReadKeys = fn(&Document, &str, &Value) -> Result<Box<dyn Style>>;

/// All styles.
const STYLES: &[(&str, ReadKeys)] = &[
    ("plain", keys::<Plain>),
    ("semantic_kitti", keys::<SemanticKitti>),
    ("kitti", keys::<Kitti>),
    ("nuscenes", keys::<NuScenes>),
    ("webdataset", keys::<WebDataset>),
    ("coco", keys::<Coco>),
    ("voc", keys::<Voc>),
];

/// Names of all styles.
pub(super) fn names() -> impl Iterator<Item = &'static str> + Clone {
    STYLES.iter().map(|(name, _)| *name)
}

/// The style of the files that `echocast scan` reports.
const FILES: &str = "files";

fn keys<S: Style + DeserializeOwned + 'static>(document: &Document, key: &str, keys: &Value) -> Result<Box<dyn Style>> {
    Ok(Box::new(document.read_at::<S>(key, keys)?))
}

/// The styles of the section `outputs` of `document`; plain, if it names none.
///
/// # Errors
/// An unknown style or key.
pub(super) fn all(outputs: &[Value], document: &Document) -> Result<Vec<Box<dyn Style>>> {
    if outputs.is_empty() {
        return Ok(vec![Box::new(Plain::default())]);
    }
    let mut all: Vec<Box<dyn Style>> = Vec::new();
    for (index, output) in outputs.iter().enumerate() {
        let key = format!("outputs[{index}]");
        let mut keys = output.clone();
        let name = keys.as_object_mut().and_then(|keys| keys.shift_remove("style"));
        let Some(name) = name.as_ref().and_then(Value::as_str) else {
            return Err(document.error(&key, "the key `style` is missing"));
        };
        let Some((_, read)) = STYLES.iter().find(|(known, _)| *known == name) else {
            let message = if name == FILES {
                let allowed = names().collect::<Vec<_>>().join(", ");
                format!("writes the files of one sample; allowed in a set: {allowed}")
            } else {
                let near = nearest(name, names().chain([FILES]));
                let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
                let allowed = names().chain([FILES]).collect::<Vec<_>>().join(", ");
                format!("unknown value {name:?}{near}; allowed: {allowed}")
            };
            return Err(document.error(&format!("{key}.style"), &message));
        };
        let style = read(document, &key, &keys)?;
        style.check().map_err(|error| match error {
            Error::InvalidParameter { name, value, allowed } => {
                document.error(&format!("{key}.{name}"), &format!("is {value}; allowed: {allowed}"))
            }
            other => other,
        })?;
        if all.iter().any(|other| other.root() == style.root()) {
            return Err(document.error(&key, "is of the same style as one before it; allowed: each style once"));
        }
        all.push(style);
    }
    Ok(all)
}

/// `000017`: the text of sample numbers sorts like the numbers.
pub(super) fn numbered(sample: u64) -> String {
    format!("{sample:06}")
}

/// The folder of a sample in that of a style.
pub(super) fn sample_folder(root: &str, sample: u64) -> PathBuf {
    Path::new(root).join(numbered(sample))
}
