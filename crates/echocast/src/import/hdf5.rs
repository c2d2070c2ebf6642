//! HDF5: a dataset for each column. The C library reads it, but for texts of variable length; what the file claims is
//! checked before, but whether it does harm to that library cannot be.

use super::about::{ABOUT, About, Arrays};
use super::heap::{ELEMENT, Heaps};
use super::rows::{Goal, Rows};
use super::{MOST_OF_ONE, Source, boxes, rows};
use crate::cloud::{FIELDS, FieldSet, PointCloud};
use crate::export::{HDF5_ROWS as ROWS, HDF5_WIDEST as WIDEST, hdf5_error};
use crate::ground::error::{Error, Result};
use crate::ground::report::Report;
use ::hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor};
use ::hdf5::{Dataset, File, H5Type};
use std::borrow::Cow;
use std::io::{ErrorKind, Read as _};

struct Datasets<'a> {
    source: &'a Source<'a>,
    file: File,
    /// Whether texts were not UTF-8.
    garbled: bool,
}

impl Datasets<'_> {
    fn failed(&self, error: ::hdf5::Error, place: &str) -> Error {
        self.source.failed(hdf5_error(error), place)
    }

    /// The dataset `name`, if there is one.
    fn dataset(&self, name: &str) -> Result<Option<Dataset>> {
        // Asked for within a group that is not there, the library complains.
        let group = name.split_once('/').is_none_or(|(group, _)| self.file.link_exists(group));
        if !group || !self.file.link_exists(name) {
            return Ok(None);
        }
        let dataset = self.file.dataset(name).map_err(|error| self.failed(error, name))?;
        let whole = dataset.size().saturating_mul(dataset.dtype().map_or(1, |kind| kind.size())) as u64;
        if whole > dataset.storage_size().min(self.source.length).saturating_mul(MOST_OF_ONE) {
            let message = format!("says that it has {} numbers, of which it does not hold the bytes", dataset.size());
            return Err(Error::parse(self.source.path, name, message));
        }
        Ok(Some(dataset))
    }

    /// The texts of `dataset`, each of at most [`WIDEST`] bytes.
    fn fixed<T: H5Type>(&self, dataset: &Dataset, name: &str, bytes: fn(&T) -> &[u8]) -> Result<Vec<Vec<u8>>> {
        let failed = |error| self.failed(error, name);
        if dataset.ndim() != 1 {
            return Ok(dataset.read_raw::<T>().map_err(failed)?.iter().map(|text| bytes(text).to_vec()).collect());
        }
        let mut texts = Vec::new();
        for start in (0..dataset.size()).step_by(ROWS) {
            let rows = start..dataset.size().min(start + ROWS);
            let read = dataset.read_slice_1d::<T, _>(rows).map_err(failed)?;
            texts.extend(read.iter().map(|text| bytes(text).to_vec()));
        }
        Ok(texts)
    }

    /// The texts of `dataset`, whose lengths differ.
    fn variable(&self, dataset: &Dataset, name: &str) -> Result<Vec<Vec<u8>>> {
        let count = dataset.size();
        if dataset.storage_size() == 0 {
            // Nothing was ever written.
            return Ok(vec![Vec::new(); count]);
        }
        let stored = (count as u64).checked_mul(ELEMENT as u64);
        let Some(at) = dataset.offset().filter(|_| stored == Some(dataset.storage_size())) else {
            let message = "has texts of variable length in chunks; allowed: of a fixed length, or all together";
            return Err(Error::parse(self.source.path, name, message));
        };
        let mut elements = Vec::new();
        let read = self.source.from(at)?.take(dataset.storage_size()).read_to_end(&mut elements);
        read.map_err(|error| self.source.failed(error, name))?;
        if elements.len() as u64 != dataset.storage_size() {
            return Err(self.source.failed(ErrorKind::UnexpectedEof.into(), name));
        }
        let mut heaps = Heaps::of(self.source)?;
        let (elements, _) = elements.as_chunks();
        elements.iter().map(|element| Ok(heaps.text(name, element)?.to_vec())).collect()
    }
}

impl Arrays for Datasets<'_> {
    fn numbers(&mut self, name: &str) -> Result<Option<Vec<f64>>> {
        let Some(dataset) = self.dataset(name)? else { return Ok(None) };
        dataset.read_raw().map(Some).map_err(|error| self.failed(error, name))
    }

    fn texts(&mut self, name: &str) -> Result<Option<Vec<String>>> {
        let Some(dataset) = self.dataset(name)? else { return Ok(None) };
        let kind = dataset.dtype().and_then(|kind| kind.to_descriptor()).map_err(|error| self.failed(error, name))?;
        let bytes = match kind {
            TypeDescriptor::FixedAscii(width) if width <= WIDEST => self.fixed(&dataset, name, ascii)?,
            TypeDescriptor::FixedUnicode(width) if width <= WIDEST => self.fixed(&dataset, name, unicode)?,
            TypeDescriptor::VarLenAscii | TypeDescriptor::VarLenUnicode => self.variable(&dataset, name)?,
            other => {
                let message =
                    format!("is of type {other}; allowed: texts, those of a fixed length up to {WIDEST} bytes");
                return Err(Error::parse(self.source.path, name, message));
            }
        };
        let mut texts = Vec::with_capacity(bytes.len());
        for bytes in bytes {
            let text = String::from_utf8_lossy(&bytes);
            self.garbled |= matches!(text, Cow::Owned(_));
            texts.push(text.into_owned());
        }
        Ok(Some(texts))
    }
}

/// Whatever is read as text is bytes until it has been looked at: these types believe the file.
fn ascii(text: &FixedAscii<WIDEST>) -> &[u8] {
    text.as_bytes()
}

fn unicode(text: &FixedUnicode<WIDEST>) -> &[u8] {
    text.as_bytes()
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let file = echocast_hdf5::open(source.path);
    let file = file.map_err(|error| source.failed(hdf5_error(error), "its structure"))?;
    let mut datasets = Datasets { source, file, garbled: false };
    let mut about = About::of_arrays(&mut datasets, source)?;
    about.boxes = boxes::read(&mut datasets, source)?;
    let mut rows = Rows::new(FieldSet::EMPTY, 0, Some(&about))?;
    for info in FIELDS {
        let Some(dataset) = datasets.dataset(info.name)? else { continue };
        let kind = dataset.dtype().and_then(|kind| kind.to_descriptor());
        let kind = kind.map_err(|error| datasets.failed(error, info.name))?;
        if matches!(kind, TypeDescriptor::VarLenArray(_)) {
            return Err(source.error("has a row for each frame; allowed: files of one cloud, without --single"));
        }
        if dataset.ndim() != 1 {
            return Err(Error::parse(source.path, info.name, "is not one number for each point"));
        }
        let numbers: Vec<f64> = dataset.read_raw().map_err(|error| datasets.failed(error, info.name))?;
        rows.also([info.field]);
        let goal = Goal { shift: about.offset(info.field), ..info.field.into() };
        rows.add(goal, numbers.iter().copied())?;
    }
    let names = datasets.file.member_names().map_err(|error| datasets.failed(error, "its structure"))?;
    let known = |name: &str| FIELDS.iter().any(|info| info.name == name) || ABOUT.contains(&name) || name == "boxes";
    rows::lost(names.iter().map(String::as_str).filter(|name| !known(name)), "hdf5", report);
    if datasets.garbled {
        report.warn("hdf5: names that are not UTF-8 text have \u{fffd} where it is not");
    }
    rows.finish(source.path, "hdf5", about, report)
}
