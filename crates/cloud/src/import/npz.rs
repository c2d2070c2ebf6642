//! NPZ: a zip of NumPy arrays, one for each column.

use super::about::{ABOUT, About, Arrays};
use super::names;
use super::number::{Member, blocks};
use super::rows::Rows;
use super::target::FieldTarget;
use super::{MOST_OF_ONE, Source, boxes};
use crate::{FIELDS, Field, FieldSet, PointCloud};
use ground::error::{Error, Result};
use ground::read::number::Number;
use ground::report::Report;
use ground::shown;
use std::fs::File;
use std::io::{self, BufReader, Read};
use zip::ZipArchive;

/// Longest header of an array, bytes.
const HEADER: usize = 1 << 16;

/// A zip of arrays.
struct NpzReader<'a> {
    source: &'a Source<'a>,
    zip: ZipArchive<BufReader<&'a File>>,
}

/// The header of an array.
#[derive(Debug, PartialEq)]
struct NpyHeader {
    /// Text has this many characters.
    element: NpyDtype,
    big: bool,
    shape: Vec<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum NpyDtype {
    Number(Number),
    Text(usize),
}

impl NpyHeader {
    fn count(&self) -> Option<usize> {
        self.shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length))
    }

    fn size(&self) -> usize {
        match self.element {
            NpyDtype::Number(number) => number.size(),
            NpyDtype::Text(characters) => characters * 4,
        }
    }
}

impl NpzReader<'_> {
    /// Passes the array `name`, its number of elements and their reader to `take`; `None`: there is none.
    fn array<T>(
        &mut self,
        name: &str,
        take: impl FnOnce(&Source, &NpyHeader, usize, &mut dyn Read) -> Result<T>,
    ) -> Result<Option<T>> {
        let source = self.source;
        let place = format!("{name}.npy");
        let Some(index) = self.zip.index_for_name(&place) else { return Ok(None) };
        let fault = |error: io::Error| source.failed(error, &place);
        let mut file = self.zip.by_index(index).map_err(|error| fault(error.into()))?;
        let wrong = |message: String| Error::parse(source.path, &*place, message);
        if file.size() > file.compressed_size().saturating_mul(MOST_OF_ONE) || file.compressed_size() > source.length {
            let (packed, whole) = (file.compressed_size(), file.size());
            return Err(wrong(format!("{packed} bytes in it cannot be {whole}: it is damaged")));
        }
        let mut head = [0; 8];
        file.read_exact(&mut head).map_err(fault)?;
        if !head.starts_with(b"\x93NUMPY") {
            return Err(wrong("is not a NumPy array".into()));
        }
        // From version 2 on, the length of the header text has four bytes.
        let mut length = [0; 4];
        let digits = if head[6] < 2 { 2 } else { 4 };
        file.read_exact(&mut length[..digits]).map_err(fault)?;
        let length = u32::from_le_bytes(length) as usize;
        if length > HEADER {
            return Err(wrong(format!("its header is longer than {HEADER} bytes")));
        }
        let mut text = vec![0; length];
        file.read_exact(&mut text).map_err(fault)?;
        let array = parse(&String::from_utf8_lossy(&text)).map_err(&wrong)?;
        let rest = file.size().saturating_sub((8 + digits + length) as u64);
        let count = array.count().filter(|count| count.checked_mul(array.size()) == usize::try_from(rest).ok());
        let Some(count) = count else {
            return Err(wrong(format!("its {rest} bytes are not an array of shape {:?}", array.shape)));
        };
        let taken = take(source, &array, count, &mut file)?;
        // The checksum is verified at the end of the file.
        let end = file.read(&mut [0]).map_err(fault)?;
        if end > 0 { Err(wrong("is longer than its header states".into())) } else { Ok(Some(taken)) }
    }
}

impl Arrays for NpzReader<'_> {
    fn numbers(&mut self, name: &str) -> Result<Option<Vec<f64>>> {
        self.array(name, |source, array, count, file| {
            let NpyDtype::Number(number) = array.element else {
                return Err(Error::parse(source.path, name, "is text; expected numbers"));
            };
            source.check_beside(name, count as u64, size_of::<f64>())?;
            // A column of f64 serves as a list of numbers.
            let mut numbers = Rows::new(FieldSet::EMPTY.with(Field::Time), 0, None)?;
            let member = Member { goal: Field::Time.into(), number, at: 0 };
            blocks(source, file, number.size(), count, |bytes| {
                member.take(bytes, number.size(), array.big, &mut numbers)
            })?;
            Ok(numbers.columns().time.clone())
        })
    }

    fn texts(&mut self, name: &str) -> Result<Option<Vec<String>>> {
        self.array(name, |source, array, count, file| {
            let NpyDtype::Text(characters) = array.element else {
                return Err(Error::parse(source.path, name, "is numbers; expected text"));
            };
            source.check_beside(name, count as u64, characters * 4 + size_of::<String>())?;
            let mut texts = Vec::new();
            blocks(source, file, characters * 4, count, |bytes| {
                texts.extend(bytes.chunks_exact(characters * 4).map(|text| {
                    let letters = text.chunks_exact(4).map(|letter| letter.first_chunk().copied().unwrap_or_default());
                    let numbers =
                        letters.map(|b| if array.big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) });
                    let text: String = numbers.map(|n| char::from_u32(n).unwrap_or('\u{fffd}')).collect();
                    text.trim_end_matches('\0').to_owned()
                }));
                Ok(())
            })?;
            Ok(texts)
        })
    }
}

/// Reads the text of a header: `{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }`.
fn parse(text: &str) -> Result<NpyHeader, String> {
    let after = |key: &str| text.split_once(key).map(|(_, rest)| rest.trim_start_matches([':', ' ']));
    let unknown = || format!("has the header {:?}, which is not that of an array of numbers", shown::text(text.trim()));
    let kind = after("'descr'").and_then(|rest| rest.strip_prefix('\'')?.split('\'').next()).ok_or_else(unknown)?;
    let shape = after("'shape'").and_then(|rest| rest.strip_prefix('(')?.split(')').next()).ok_or_else(unknown)?;
    let lengths = shape.split(',').map(str::trim).filter(|length| !length.is_empty());
    let shape = lengths.map(|length| length.parse().map_err(|_| unknown())).collect::<Result<_, _>>()?;
    let (order, kind) = kind.split_at_checked(1).ok_or_else(unknown)?;
    let (letter, size) = kind.split_at_checked(1).ok_or_else(unknown)?;
    let size: usize = size.parse().map_err(|_| unknown())?;
    let element = match letter {
        "U" if (1..=1 << 20).contains(&size) => NpyDtype::Text(size),
        "b" if size == 1 => NpyDtype::Number(Number::U8),
        letter => NpyDtype::Number(letter.chars().next().and_then(|l| Number::of(l, size)).ok_or_else(unknown)?),
    };
    Ok(NpyHeader { element, big: order == ">", shape })
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let zip = ZipArchive::new(source.from(0)?);
    let zip = zip.map_err(|error| source.failed(error.into(), "its list of arrays"))?;
    let mut archive = NpzReader { source, zip };
    let mut about = About::of_arrays(&mut archive, source)?;
    about.boxes = boxes::read(&mut archive, source)?;
    let mut rows = Rows::new(FieldSet::EMPTY, 0, Some(&about))?;
    for info in FIELDS {
        archive.array(info.name, |source, array, count, file| {
            let (NpyDtype::Number(number), [_]) = (array.element, &*array.shape) else {
                return Err(Error::parse(source.path, info.name, "is not one number for each point"));
            };
            rows.also([info.field]);
            let goal = FieldTarget { shift: about.offset(info.field), ..info.field.into() };
            let member = Member { goal, number, at: 0 };
            blocks(source, file, number.size(), count, |bytes| member.take(bytes, number.size(), array.big, &mut rows))
        })?;
    }
    let mut names: Vec<String> = Vec::new();
    for name in archive.zip.file_names() {
        let name = name.map_err(|error| source.failed(error.into(), "its list of arrays"))?;
        let name = name.strip_suffix(".npy").unwrap_or(&name);
        let known = Field::from_name(name).is_ok() || ABOUT.contains(&name) || name.starts_with("boxes/");
        if !known {
            names.push(name.to_owned());
        }
    }
    names::lost(names.iter().map(String::as_str), "npz", report);
    rows.finish(source.path, "npz", about, report)
}
