//! PLY: vertices without faces.

use super::Source;
use super::about::About;
use super::names::Named;
use super::number::{Member, blocks};
use super::rows::{self, Rows};
use super::text::{self, Lines, Place, Separator};
use crate::cloud::PointCloud;
use crate::ground::error::Result;
use crate::ground::report::Report;
use crate::ground::shown;
use crate::read::number::Number;

/// Most lines before the points.
const HEADER: usize = 10_000;

/// What stands before the points.
#[derive(Default)]
struct Header {
    format: String,
    elements: Vec<Element>,
    /// Rows and columns of an organised cloud.
    grid: [Option<u32>; 2],
}

struct Element {
    name: String,
    count: u64,
    /// Without a number: a list.
    properties: Vec<(String, Option<Number>)>,
}

/// The header of `source`, and the lines behind it.
fn header<'a>(source: &'a Source<'a>) -> Result<(Header, Lines<'a>)> {
    let mut lines = Lines::of(source)?;
    let mut header = Header::default();
    for _ in 0..HEADER {
        let Some(line) = lines.next()? else { break };
        let line = line.to_owned();
        let words: Vec<&str> = line.split_whitespace().collect();
        let fault = match *words {
            ["end_header"] => return Ok((header, lines)),
            ["format", format, _] => {
                format.clone_into(&mut header.format);
                None
            }
            ["element", name, count] => match count.parse() {
                Ok(count) => {
                    header.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                    None
                }
                Err(_) => Some(format!("{:?} is not a number of elements", shown::name(count))),
            },
            ["property", ref rest @ ..] => match (header.elements.last_mut(), rest) {
                (Some(element), ["list", _, _, name]) => {
                    element.properties.push(((*name).to_owned(), None));
                    None
                }
                (Some(element), [kind, name]) => match number(kind) {
                    Some(number) => {
                        element.properties.push(((*name).to_owned(), Some(number)));
                        None
                    }
                    None => Some(format!("{:?} is no type of PLY", shown::name(kind))),
                },
                _ => Some("is not a property of an element".to_owned()),
            },
            ["obj_info", "num_rows", rows] => {
                header.grid[0] = rows.parse().ok();
                None
            }
            ["obj_info", "num_cols", columns] => {
                header.grid[1] = columns.parse().ok();
                None
            }
            ["ply" | "comment" | "obj_info", ..] | [] => None,
            _ => Some(format!("{:?} is no line of a header", shown::name(&line))),
        };
        if let Some(fault) = fault {
            return Err(lines.error(fault));
        }
    }
    Err(source.error("has no line end_header: it is cut off, or no PLY"))
}

/// The type of this name.
fn number(name: &str) -> Option<Number> {
    Some(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}

/// Whether it is a mesh rather than a cloud.
///
/// # Errors
/// A header that is none.
pub(super) fn has_faces(source: &Source) -> Result<bool> {
    let (header, _) = header(source)?;
    Ok(faces(&header) > 0)
}

fn faces(header: &Header) -> u64 {
    let surfaces = ["face", "tristrips"];
    header.elements.iter().filter(|element| surfaces.contains(&&*element.name)).map(|element| element.count).sum()
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let (header, lines) = header(source)?;
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
    for (name, number) in &vertex.properties {
        let Some(number) = *number else {
            return Err(source.error(format!("{:?} of its vertices is a list; allowed: numbers", shown::name(name))));
        };
        columns.push(Named::new(name, number));
    }
    let others = header.elements[at + 1..].iter().filter(|element| element.count > 0);
    rows::lost(others.map(|element| element.name.as_str()), "ply", report);
    let goals = rows::goals(&columns, "ply", report);
    let mut about = About::beside(source.path)?.unwrap_or_default();
    if let [Some(rows), Some(columns)] = header.grid {
        about.shape = Some([rows, columns]);
    }
    let big = match &*header.format {
        "ascii" => {
            let count = usize::try_from(vertex.count).unwrap_or(usize::MAX);
            let mut rows = Rows::new(rows::fields(&goals), 0, Some(&about))?;
            let places: Vec<Option<Place>> = goals.into_iter().map(|goal| goal.map(Place::Goal)).collect();
            text::read(lines, Separator::Blanks, &places, Some(count), &mut rows)?;
            return rows.finish(source.path, "ply", about, report);
        }
        "binary_little_endian" => false,
        "binary_big_endian" => true,
        other => {
            let allowed = "ascii, binary_little_endian, binary_big_endian";
            return Err(source.error(format!("its format is {:?}; allowed: {allowed}", shown::name(other))));
        }
    };
    let mut members = Vec::new();
    let mut size = 0;
    for (column, goal) in columns.iter().zip(goals) {
        members.extend(goal.map(|goal| Member { goal, number: column.number, at: size }));
        size += column.number.size();
    }
    let start = lines.at();
    let count = source.check_count(vertex.count, size, start)?;
    let mut rows = Rows::new(members.iter().map(|member| member.goal.field).collect(), count, Some(&about))?;
    let take = |records: &[u8]| members.iter().try_for_each(|member| member.take(records, size, big, &mut rows));
    blocks(source, source.from(start)?, size, count, take)?;
    rows.finish(source.path, "ply", about, report)
}
