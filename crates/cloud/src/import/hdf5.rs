//! HDF5: a dataset for each column. It is read by the C library, except for texts of variable length; what the file
//! claims is checked first, but whether it harms that library cannot be checked.

use super::about::{ABOUT, About, Arrays};
use super::heap::{ELEMENT, Heaps};
use super::names;
use super::rows::Rows;
use super::target::FieldTarget;
use super::{MOST_OF_ONE, Source, boxes};
use crate::export::HDF5_WIDEST as WIDEST;
use crate::{FIELDS, FieldSet, PointCloud};
use echocast_hdf5::{Dataset, Kind, Reader, StorageLayout};
use ground::error::{Error, Result};
use ground::report::Report;
use std::borrow::Cow;
use std::io::{self, ErrorKind, Read as _};

/// Start of a file, or of what follows its user block.
pub(super) const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Minimum of numbers that are read together.
const ROWS: u64 = 1 << 16;
/// Maximum bytes of a chunk in a file that is shorter.
const CHUNK: u64 = 16 << 20;

/// Where HDF5 begins in the file: a user block with any content may precede it, of 512 bytes or two, four times as many
/// and so on.
pub(super) fn begins_at(source: &Source) -> io::Result<Option<u64>> {
    let starts = std::iter::successors(Some(512), |at: &u64| at.checked_mul(2)).take_while(|&at| at < source.length);
    for at in std::iter::once(0).chain(starts) {
        let mut beginning = Vec::new();
        source.at(at)?.take(SIGNATURE.len() as u64).read_to_end(&mut beginning)?;
        if beginning == SIGNATURE {
            return Ok(Some(at));
        }
    }
    Ok(None)
}

struct Datasets<'a> {
    source: &'a Source<'a>,
    file: Reader,
    /// Whether texts were not UTF-8.
    garbled: bool,
}

impl Datasets<'_> {
    fn failed(&self, error: io::Error, place: &str) -> Error {
        self.source.failed(error, place)
    }

    /// The dataset `name`, if there is one, and its count of numbers, no more than the file can hold.
    fn dataset(&self, name: &str) -> Result<Option<(Dataset, u64)>> {
        let found = self.file.dataset(name).map_err(|error| self.failed(error, name))?;
        let Some(dataset) = found else { return Ok(None) };
        let wrong = |message: String| Err(Error::parse(self.source.path, name, message));
        if dataset.place == StorageLayout::Elsewhere {
            return wrong("is in other files; allowed: in this one".into());
        }
        let (stored, size) = (dataset.stored(), dataset.size as u64);
        let whole = match (&dataset.place, dataset.chunks()) {
            (StorageLayout::Chunks(_), chunks) => chunks.map(|[_, all]| all),
            _ => dataset.count().and_then(|count| count.checked_mul(size)),
        };
        let Some(count) = dataset
            .count()
            .filter(|_| whole.is_some_and(|whole| whole <= stored.min(self.source.length).saturating_mul(MOST_OF_ONE)))
        else {
            return wrong(format!("claims the shape {:?} but does not hold its bytes", dataset.shape));
        };
        // Reading a single number takes memory for its whole chunk.
        if let Some([one, _]) = dataset.chunks().filter(|&[one, _]| one > CHUNK.max(self.source.length)) {
            return wrong(format!("has chunks of {one} bytes; allowed: {CHUNK}, or as many as the file has"));
        }
        Ok(Some((dataset, count)))
    }

    /// The texts of `dataset`, whose lengths differ.
    fn variable(&self, dataset: &Dataset, name: &str, count: u64) -> Result<Vec<Vec<u8>>> {
        let stored = count.checked_mul(ELEMENT as u64).filter(|&stored| stored == dataset.stored());
        let at = match (&dataset.place, stored) {
            // Nothing was ever written.
            _ if dataset.stored() == 0 => return Ok(vec![Vec::new(); count as usize]),
            (StorageLayout::Together(Some(at)), Some(_)) => *at,
            (place, _) => {
                let place = if *place == StorageLayout::Compact { "in compact storage" } else { "in chunks" };
                let message =
                    format!("has texts of variable length {place}; allowed: of a fixed length, or contiguous");
                return Err(Error::parse(self.source.path, name, message));
            }
        };
        let mut elements = Vec::new();
        let read = self.source.from(at)?.take(dataset.stored()).read_to_end(&mut elements);
        read.map_err(|error| self.failed(error, name))?;
        if elements.len() as u64 != dataset.stored() {
            return Err(self.failed(ErrorKind::UnexpectedEof.into(), name));
        }
        let base = begins_at(self.source).map_err(|error| self.failed(error, name))?;
        let mut heaps = Heaps::of(self.source, base.unwrap_or(0))?;
        let (elements, _) = elements.as_chunks();
        elements.iter().map(|element| Ok(heaps.text(name, element)?.to_vec())).collect()
    }
}

impl Arrays for Datasets<'_> {
    fn numbers(&mut self, name: &str) -> Result<Option<Vec<f64>>> {
        let Some((dataset, count)) = self.dataset(name)? else { return Ok(None) };
        if let Some(message) = no_numbers(&dataset) {
            return Err(Error::parse(self.source.path, name, message));
        }
        self.source.check_beside(name, count, size_of::<f64>())?;
        dataset.numbers(None).map(Some).map_err(|error| self.failed(error, name))
    }

    fn texts(&mut self, name: &str) -> Result<Option<Vec<String>>> {
        let Some((dataset, count)) = self.dataset(name)? else { return Ok(None) };
        let wrong = |message: String| Err(Error::parse(self.source.path, name, message));
        if dataset.shape.len() > 1 {
            return wrong(format!("has texts of shape {:?}; allowed: one after the other", dataset.shape));
        }
        self.source.check_beside(name, count, dataset.size.saturating_add(size_of::<[String; 2]>()))?;
        let bytes = match dataset.kind {
            Kind::Texts if dataset.size <= WIDEST => dataset.texts().map_err(|error| self.failed(error, name))?,
            Kind::AnyTexts => self.variable(&dataset, name, count)?,
            Kind::Texts => return wrong(format!("has texts of {} bytes; allowed: up to {WIDEST}", dataset.size)),
            kind => return wrong(format!("is of {}; allowed: texts", called(kind))),
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

fn called(kind: Kind) -> &'static str {
    match kind {
        Kind::Numbers => "numbers",
        Kind::Texts | Kind::AnyTexts => "texts",
        Kind::Lists => "lists",
        Kind::Other(name) => name,
    }
}

/// What is wrong with a dataset that should hold numbers, if it does not.
fn no_numbers(dataset: &Dataset) -> Option<String> {
    let message = || format!("is of {}; allowed: numbers", called(dataset.kind));
    (dataset.kind != Kind::Numbers).then(message)
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let file = Reader::open(source.path).map_err(|error| source.failed(error, "its structure"))?;
    let mut datasets = Datasets { source, file, garbled: false };
    let mut about = About::of_arrays(&mut datasets, source)?;
    about.boxes = boxes::read(&mut datasets, source)?;
    let mut rows = Rows::new(FieldSet::EMPTY, 0, Some(&about))?;
    for info in FIELDS {
        let Some((dataset, count)) = datasets.dataset(info.name)? else { continue };
        if dataset.kind == Kind::Lists {
            return Err(source.error("has a row for each frame; allowed: files of one cloud, without --single"));
        }
        if let Some(message) = no_numbers(&dataset) {
            return Err(Error::parse(source.path, info.name, message));
        }
        if dataset.shape.len() != 1 {
            return Err(Error::parse(source.path, info.name, "is not one number for each point"));
        }
        rows.also([info.field]);
        let goal = FieldTarget { shift: about.offset(info.field), ..info.field.into() };
        // No chunk is decompressed twice.
        let step = match &dataset.place {
            StorageLayout::Chunks(chunk) => chunk.first().map_or(ROWS, |&chunk| ROWS.next_multiple_of(chunk.max(1))),
            _ => ROWS,
        };
        for start in (0..count).step_by(usize::try_from(step).unwrap_or(usize::MAX)) {
            let numbers = dataset.numbers(Some(start..count.min(start.saturating_add(step))));
            let numbers = numbers.map_err(|error| datasets.failed(error, info.name))?;
            rows.add(goal, numbers.iter().copied())?;
        }
    }
    let names = datasets.file.names().map_err(|error| datasets.failed(error, "its structure"))?;
    let known = |name: &str| FIELDS.iter().any(|info| info.name == name) || ABOUT.contains(&name) || name == "boxes";
    names::lost(names.iter().map(String::as_str).filter(|name| !known(name)), "hdf5", report);
    if datasets.garbled {
        report.warn("hdf5: names that are not UTF-8 text have \u{fffd} where it is not");
    }
    rows.finish(source.path, "hdf5", about, report)
}
