//! PLY: vertices without faces.

use super::Source;
use super::about::About;
use super::names::{self, NamedColumn};
use super::number::{Member, blocks, value};
use super::rows::Rows;
use super::target::{self, FieldTarget};
use super::text::{self, TextLines, TextStyle, WordTarget};
use crate::PointCloud;
use ground::error::{Error, Result};
use ground::read::number::Number;
use ground::read::ply::{Encoding, PlyElement, PlyHeader, PlyProperty};
use ground::report::Report;
use ground::shown;
use std::io::{self, ErrorKind, Read};

/// Maximum number of bytes before the points.
const HEADER: u64 = 1 << 20;

fn header(source: &Source) -> Result<PlyHeader> {
    let mut bytes = Vec::new();
    source.from(0)?.take(HEADER).read_to_end(&mut bytes).map_err(|error| Error::io(source.path, error))?;
    PlyHeader::parse(&bytes).map_err(|(line, message)| Error::parse(source.path, format!("line {line}"), message))
}

/// Whether it is a mesh rather than a cloud.
///
/// # Errors
/// An invalid header.
pub(super) fn has_faces(source: &Source) -> Result<bool> {
    Ok(faces(&header(source)?) > 0)
}

fn faces(header: &PlyHeader) -> u64 {
    let surfaces = ["face", "tristrips"];
    header.elements.iter().filter(|element| surfaces.contains(&&*element.name)).map(|element| element.count).sum()
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let header = header(source)?;
    if faces(&header) > 0 {
        return Err(source.error(format!("has {} faces: it is a mesh; allowed: points without faces", faces(&header))));
    }
    let Some(at) = header.elements.iter().position(|element| element.name == "vertex") else {
        return Err(source.error("has no element vertex"));
    };
    let vertex = &header.elements[at];
    let columns: Vec<NamedColumn> = vertex.properties.iter().map(column).collect();
    let others = header.elements.iter().enumerate().filter(|&(index, element)| index != at && element.count > 0);
    names::lost(others.map(|(_, element)| element.name.as_str()), "ply", report);
    let goals = names::goals(&columns, "ply", report);
    let mut about = About::beside(source.path)?.unwrap_or_default();
    if let [Some(rows), Some(columns)] = header.grid {
        about.shape = Some([rows, columns]);
    }
    let before = &header.elements[..at];
    let rows = if header.encoding == Encoding::Text {
        let mut lines = TextLines::behind(source, header.length as u64, header.lines as u64)?;
        for element in before {
            skip_lines(&mut lines, element, source)?;
        }
        let count = usize::try_from(vertex.count).unwrap_or(usize::MAX);
        let mut rows = Rows::new(target::fields(&goals), 0, Some(&about))?;
        let place = |(goal, property): (Option<FieldTarget>, &PlyProperty)| match property.length {
            Some(_) => Some(WordTarget::List),
            None => goal.map(WordTarget::Goal),
        };
        let places: Vec<Option<WordTarget>> = goals.into_iter().zip(&vertex.properties).map(place).collect();
        text::read(lines, TextStyle::default(), &places, Some(count), &mut rows)?;
        rows
    } else {
        binary(source, &header, before, vertex, &goals, &about)?
    };
    rows.finish(source.path, "ply", about, report)
}

/// The column of a property; for a list, a name that no column has.
fn column(property: &PlyProperty) -> NamedColumn {
    match property.length {
        Some(_) => NamedColumn::new(&format!("{}[]", property.name), property.kind),
        None => NamedColumn::new(&property.name, property.kind),
    }
}

/// Skips the rows of `element`, one per line.
fn skip_lines(lines: &mut TextLines, element: &PlyElement, source: &Source) -> Result<()> {
    let mut left = element.count;
    while left > 0 {
        match lines.next()? {
            None => return Err(source.error(format!("ends within its element {:?}", shown::name(&element.name)))),
            Some("") => {}
            Some(_) => left -= 1,
        }
    }
    Ok(())
}

/// The rows of `vertex`, which follow those of the elements `before` it.
fn binary(
    source: &Source,
    header: &PlyHeader,
    before: &[PlyElement],
    vertex: &PlyElement,
    goals: &[Option<FieldTarget>],
    about: &About,
) -> Result<Rows> {
    let big = header.encoding == Encoding::Big;
    let mut start = header.length as u64;
    for element in before {
        start = skip_rows(source, start, element, big)?;
    }
    let mut members = Vec::new();
    let mut size = 0;
    for (property, goal) in vertex.properties.iter().zip(goals).filter(|(property, _)| property.length.is_none()) {
        members.extend(goal.map(|goal| Member { goal, number: property.kind, at: size }));
        size += property.kind.size();
    }
    let count = source.check_count(vertex.count, row_size(vertex), start)?;
    let mut rows = Rows::new(members.iter().map(|member| member.goal.field).collect(), count, Some(about))?;
    let take = |records: &[u8]| members.iter().try_for_each(|member| member.take(records, size, big, &mut rows));
    let file = source.from(start)?;
    if has_lists(vertex) {
        blocks(source, WithoutLists::of(file, &vertex.properties, big), size, count, take)?;
    } else {
        blocks(source, file, size, count, take)?;
    }
    Ok(rows)
}

fn has_lists(element: &PlyElement) -> bool {
    element.properties.iter().any(|property| property.length.is_some())
}

/// Minimum bytes of a row: those of numbers, and of the lengths of lists.
fn row_size(element: &PlyElement) -> usize {
    element.properties.iter().map(|property| property.length.unwrap_or(property.kind).size()).sum()
}

/// The byte where the rows of `element` end, which begin at byte `start`.
fn skip_rows(source: &Source, start: u64, element: &PlyElement, big: bool) -> Result<u64> {
    let size = row_size(element);
    let count = if size == 0 { 0 } else { source.check_count(element.count, size, start)? };
    if !has_lists(element) {
        return Ok(start + (count * size) as u64);
    }
    let mut rows = WithoutLists::of(source.from(start)?, &element.properties, big);
    let place = || format!("its element {:?}", shown::name(&element.name));
    (0..count).try_for_each(|_| rows.row()).map_err(|error| source.failed(error, &place()))?;
    Ok(start + rows.read)
}

/// A reader of rows that returns only the numbers, without lists.
struct WithoutLists<'p, R> {
    file: R,
    properties: &'p [PlyProperty],
    big: bool,
    /// The numbers of the current row, and how many of their bytes have been returned.
    row: Vec<u8>,
    out: usize,
    /// Bytes of rows read so far.
    read: u64,
}

impl<'p, R: Read> WithoutLists<'p, R> {
    fn of(file: R, properties: &'p [PlyProperty], big: bool) -> Self {
        WithoutLists { file, properties, big, row: Vec::new(), out: 0, read: 0 }
    }

    /// Appends the bytes of the next number to the row.
    fn number(&mut self, kind: Number) -> io::Result<()> {
        let at = self.row.len();
        self.row.resize(at + kind.size(), 0);
        self.file.read_exact(&mut self.row[at..])?;
        self.read += kind.size() as u64;
        Ok(())
    }

    fn row(&mut self) -> io::Result<()> {
        self.row.clear();
        self.out = 0;
        for property in self.properties {
            let Some(length) = property.length else {
                self.number(property.kind)?;
                continue;
            };
            let at = self.row.len();
            self.number(length)?;
            // The cast saturates: negative lengths and NaN become 0.
            let items = value(length, &self.row[at..], self.big) as u64;
            self.row.truncate(at);
            let bytes = items.saturating_mul(property.kind.size() as u64);
            if io::copy(&mut (&mut self.file).take(bytes), &mut io::sink())? < bytes {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            self.read += bytes;
        }
        Ok(())
    }
}

impl<R: Read> Read for WithoutLists<'_, R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.out == self.row.len() {
            self.row()?;
        }
        let count = bytes.len().min(self.row.len() - self.out);
        bytes[..count].copy_from_slice(&self.row[self.out..self.out + count]);
        self.out += count;
        Ok(count)
    }
}
