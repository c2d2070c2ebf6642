//! HDF5: a dataset for each column. The C library reads it; what it claims is checked before, but whether a file does
//! harm to that library cannot be.

use super::about::{ABOUT, About, Arrays};
use super::rows::{Goal, Rows};
use super::{MOST_OF_ONE, Source, boxes, rows};
use crate::cloud::{FIELDS, FieldSet, PointCloud};
use crate::export::hdf5_error;
use crate::ground::error::{Error, Result};
use crate::ground::report::Report;
use ::hdf5::types::{TypeDescriptor, VarLenUnicode};
use ::hdf5::{Dataset, File};

struct Datasets<'a> {
    source: &'a Source<'a>,
    file: File,
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
}

impl Arrays for Datasets<'_> {
    fn numbers(&mut self, name: &str) -> Result<Option<Vec<f64>>> {
        let Some(dataset) = self.dataset(name)? else { return Ok(None) };
        dataset.read_raw().map(Some).map_err(|error| self.failed(error, name))
    }

    fn texts(&mut self, name: &str) -> Result<Option<Vec<String>>> {
        let Some(dataset) = self.dataset(name)? else { return Ok(None) };
        let texts = dataset.read_raw::<VarLenUnicode>().map_err(|error| self.failed(error, name))?;
        Ok(Some(texts.iter().map(|text| text.as_str().to_owned()).collect()))
    }
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let file = File::open(source.path).map_err(|error| source.failed(hdf5_error(error), "its structure"))?;
    let mut datasets = Datasets { source, file };
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
    rows.finish(source.path, "hdf5", about, report)
}
