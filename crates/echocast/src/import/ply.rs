//! PLY: vertices without faces.

use super::Source;
use super::about::About;
use super::names::Named;
use super::number::{Member, blocks};
use super::rows::{self, Rows};
use super::text::{self, Lines, Place, Separator};
use crate::cloud::PointCloud;
use crate::ground::error::{Error, Result};
use crate::ground::report::Report;
use crate::ground::shown;
use crate::read::ply::{Encoding, Header, Property};
use std::io::Read as _;

/// Most bytes before the points.
const HEADER: u64 = 1 << 20;

fn header(source: &Source) -> Result<Header> {
    let mut bytes = Vec::new();
    source.from(0)?.take(HEADER).read_to_end(&mut bytes).map_err(|error| Error::io(source.path, error))?;
    Header::parse(&bytes).map_err(|(line, message)| Error::parse(source.path, format!("line {line}"), message))
}

/// Whether it is a mesh rather than a cloud.
///
/// # Errors
/// A header that is none.
pub(super) fn has_faces(source: &Source) -> Result<bool> {
    Ok(faces(&header(source)?) > 0)
}

fn faces(header: &Header) -> u64 {
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
    if header.elements[..at].iter().any(|element| element.count > 0) {
        return Err(source.error("has other elements before its vertices; allowed: vertices first"));
    }
    let vertex = &header.elements[at];
    let mut columns = Vec::new();
    for Property { name, kind, length } in &vertex.properties {
        if length.is_some() {
            return Err(source.error(format!("{:?} of its vertices is a list; allowed: numbers", shown::name(name))));
        }
        columns.push(Named::new(name, *kind));
    }
    let others = header.elements[at + 1..].iter().filter(|element| element.count > 0);
    rows::lost(others.map(|element| element.name.as_str()), "ply", report);
    let goals = rows::goals(&columns, "ply", report);
    let mut about = About::beside(source.path)?.unwrap_or_default();
    if let [Some(rows), Some(columns)] = header.grid {
        about.shape = Some([rows, columns]);
    }
    if header.encoding == Encoding::Text {
        let lines = Lines::behind(source, header.length as u64, header.lines as u64)?;
        let count = usize::try_from(vertex.count).unwrap_or(usize::MAX);
        let mut rows = Rows::new(rows::fields(&goals), 0, Some(&about))?;
        let places: Vec<Option<Place>> = goals.into_iter().map(|goal| goal.map(Place::Goal)).collect();
        text::read(lines, Separator::Blanks, &places, Some(count), &mut rows)?;
        return rows.finish(source.path, "ply", about, report);
    }
    let big = header.encoding == Encoding::Big;
    let mut members = Vec::new();
    let mut size = 0;
    for (column, goal) in columns.iter().zip(goals) {
        members.extend(goal.map(|goal| Member { goal, number: column.number, at: size }));
        size += column.number.size();
    }
    let start = header.length as u64;
    let count = source.check_count(vertex.count, size, start)?;
    let mut rows = Rows::new(members.iter().map(|member| member.goal.field).collect(), count, Some(&about))?;
    let take = |records: &[u8]| members.iter().try_for_each(|member| member.take(records, size, big, &mut rows));
    blocks(source, source.from(start)?, size, count, take)?;
    rows.finish(source.path, "ply", about, report)
}
