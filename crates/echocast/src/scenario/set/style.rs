//! How a sample is written.

use super::kitti::SemanticKitti;
use super::plain::Plain;
use crate::cloud::FieldSet;
use crate::cloud::PointCloud;
use crate::ground::error::{Error, Result, nearest};
use crate::ground::report::Report;
use crate::read::yaml::Document;
use crate::scenario::{Sample, Scenario};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A style of sets, with its keys.
#[derive(Clone, Debug)]
pub(super) enum Style {
    Plain(Plain),
    SemanticKitti(SemanticKitti),
}

/// Names of the styles, and of that which `echocast scan` reports.
const NAMES: [&str; 3] = ["plain", "semantic_kitti", "files"];

/// What one style writes of one sample.
pub(super) enum Writer<'w> {
    Plain(super::plain::Writer<'w>),
    SemanticKitti(super::kitti::Writer<'w>),
}

impl Style {
    /// The styles of the section `outputs`; plain, if it names none.
    ///
    /// # Errors
    /// An unknown style or key.
    pub fn all(scenario: &Scenario) -> Result<Vec<Style>> {
        let outputs = &scenario.spec.outputs;
        let document = Document::from_value(&scenario.origin, scenario.value.clone());
        if outputs.is_empty() {
            return Ok(vec![Style::Plain(Plain::default())]);
        }
        let mut all: Vec<Style> = Vec::new();
        for (index, output) in outputs.iter().enumerate() {
            let key = format!("outputs[{index}]");
            let mut keys = output.clone();
            let name = keys.as_object_mut().and_then(|keys| keys.shift_remove("style"));
            let style = match name.as_ref().and_then(Value::as_str) {
                Some("plain") => Style::Plain(document.read_at(&key, &keys)?),
                Some("semantic_kitti") => Style::SemanticKitti(document.read_at(&key, &keys)?),
                Some("files") => {
                    let message = "writes the files of one sample; allowed in a set: plain, semantic_kitti";
                    return Err(document.error(&format!("{key}.style"), message));
                }
                Some(other) => {
                    let near = nearest(other, NAMES);
                    let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
                    let message = format!("unknown value {other:?}{near}; allowed: {}", NAMES.join(", "));
                    return Err(document.error(&format!("{key}.style"), &message));
                }
                None => return Err(document.error(&key, "the key `style` is missing")),
            };
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

    fn check(&self) -> Result<()> {
        match self {
            Style::Plain(style) => style.check(),
            Style::SemanticKitti(_) => Ok(()),
        }
    }

    /// The folder in the set that it writes to.
    pub fn root(&self) -> &'static str {
        match self {
            Style::Plain(_) => "data",
            Style::SemanticKitti(_) => "sequences",
        }
    }

    /// Columns that it needs of `sample`.
    pub fn fields(&self, sample: &Sample) -> FieldSet {
        match self {
            Style::Plain(style) => style.fields(),
            Style::SemanticKitti(_) => SemanticKitti::fields(sample),
        }
    }

    /// Checks that it can hold the scans of `sample`.
    ///
    /// # Errors
    /// A sensor that is not there; several sensors where one is written.
    pub fn fits(&self, sample: &Sample) -> Result<()> {
        match self {
            Style::Plain(_) => Ok(()),
            Style::SemanticKitti(style) => style.scan(sample).map(drop),
        }
    }

    /// Begins to write `sample` to `folder`, which is empty.
    ///
    /// # Errors
    /// The system's.
    pub fn writer<'w>(&'w self, sample: &Sample, folder: &'w Path) -> Result<Writer<'w>> {
        Ok(match self {
            Style::Plain(style) => Writer::Plain(style.writer(folder)),
            Style::SemanticKitti(style) => Writer::SemanticKitti(style.writer(sample, folder)?),
        })
    }
}

impl Writer<'_> {
    /// Writes the cloud of a frame of a scan, both counted from 0.
    ///
    /// # Errors
    /// The system's.
    pub fn add(&mut self, sample: &Sample, scan: usize, frame: usize, cloud: &PointCloud) -> Result<Report> {
        match self {
            Writer::Plain(writer) => writer.add(sample, scan, frame, cloud),
            Writer::SemanticKitti(writer) => writer.add(sample, scan, frame, cloud),
        }
    }

    /// Writes what is known once all frames are there.
    ///
    /// # Errors
    /// The system's.
    pub fn finish(self) -> Result<()> {
        match self {
            Writer::Plain(_) => Ok(()),
            Writer::SemanticKitti(writer) => writer.finish(),
        }
    }
}

/// `000017`: numbers of samples sort as text does.
pub(super) fn numbered(sample: u64) -> String {
    format!("{sample:06}")
}

/// The folder of a sample in that of a style.
pub(super) fn sample_folder(root: &str, sample: u64) -> PathBuf {
    Path::new(root).join(numbered(sample))
}
