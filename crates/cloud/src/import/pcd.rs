//! PCD, the format of the Point Cloud Library.

use super::about::{self, About};
use super::names::{self, NamedColumn};
use super::number::{Member, blocks};
use super::rows::Rows;
use super::target::FieldTarget;
use super::text::{self, TextLines, TextStyle, WordTarget};
use super::{Source, contained};
use crate::{Field, Frame, PointCloud};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::read::number::Number;
use ground::report::Report;
use std::io::{self, Read as _};

/// Maximum number of lines before the points.
const HEADER: usize = 1000;
/// Maximum number of bytes of a point.
const POINT: usize = 1 << 16;
/// Maximum expansion of LZF: 264 bytes from 3.
const MOST: u64 = 88;

/// Whether a file that begins with `bytes` is in this format.
pub(super) fn begins(bytes: &[u8]) -> bool {
    [&b"# .PCD"[..], b"#.PCD", b"VERSION ", b"FIELDS "].iter().any(|beginning| bytes.starts_with(beginning))
}

/// The header, which precedes the points.
#[derive(Default)]
struct PcdHeader {
    fields: Vec<PcdField>,
    width: u64,
    height: u64,
    points: Option<u64>,
    viewpoint: Option<[f64; 7]>,
}

/// Numbers of one name in a point.
struct PcdField {
    name: String,
    size: usize,
    kind: char,
    count: usize,
}

impl PcdField {
    fn bytes(&self) -> usize {
        self.size * self.count
    }

    /// Red, green and blue in one number.
    fn is_packed(&self) -> bool {
        matches!(&*self.name, "rgb" | "rgba") && self.size == 4 && self.count == 1
    }
}

/// Reads lines of keys and words up to the one that states how the points are stored; returns the header, that word,
/// and the lines after it.
fn header<'a>(source: &'a Source<'a>) -> Result<(PcdHeader, String, TextLines<'a>)> {
    let mut lines = TextLines::of(source)?;
    let mut header = PcdHeader::default();
    for _ in 0..HEADER {
        let Some(line) = lines.next()? else { break };
        let line = line.to_owned();
        let mut words = line.split_whitespace();
        let key = words.next().unwrap_or_default();
        let words: Vec<&str> = words.collect();
        let fields = &mut header.fields;
        let done = match key {
            "FIELDS" | "COLUMNS" => {
                let entry = |name: &&str| PcdField { name: (*name).to_owned(), size: 4, kind: 'F', count: 1 };
                *fields = words.iter().map(entry).collect();
                Some(())
            }
            "SIZE" => each(fields, &words, |entry, word| word.parse().ok().map(|size| entry.size = size)),
            "TYPE" => each(fields, &words, |entry, word| word.parse().ok().map(|kind| entry.kind = kind)),
            "COUNT" => each(fields, &words, |entry, word| word.parse().ok().map(|count| entry.count = count)),
            "WIDTH" => number(&words).map(|width| header.width = width),
            "HEIGHT" => number(&words).map(|height| header.height = height),
            "POINTS" => number(&words).map(|points| header.points = Some(points)),
            "VIEWPOINT" => {
                let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
                numbers.and_then(|numbers| numbers.try_into().ok()).map(|numbers| header.viewpoint = Some(numbers))
            }
            "DATA" => {
                let data = words.first().copied().unwrap_or_default().to_lowercase();
                return Ok((header, data, lines));
            }
            _ => Some(()),
        };
        if done.is_none() {
            return Err(
                lines.error(format!("{key} is not followed by what it needs for {} fields", header.fields.len()))
            );
        }
    }
    Err(source.error("has no line DATA: it is cut off, or no PCD"))
}

/// Calls `set` with a word for each of `fields`.
fn each(fields: &mut [PcdField], words: &[&str], set: impl Fn(&mut PcdField, &str) -> Option<()>) -> Option<()> {
    if fields.len() != words.len() {
        return None;
    }
    fields.iter_mut().zip(words).try_for_each(|(entry, word)| set(entry, word))
}

fn number(words: &[&str]) -> Option<u64> {
    words.first()?.parse().ok()
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let (header, data, lines) = header(source)?;
    let fields = &header.fields;
    let size = fields.iter().try_fold(0_usize, |sum, entry| {
        entry.size.checked_mul(entry.count).and_then(|bytes| sum.checked_add(bytes)).filter(|&bytes| bytes <= POINT)
    });
    let Some(size) = size.filter(|&size| size > 0) else {
        return Err(source.error(format!("says that a point has no bytes, or more than {POINT}")));
    };
    let product = header.width.checked_mul(header.height.max(1));
    let Some(count) = header.points.or(product) else {
        return Err(source.error(format!("says that it is {} by {} points", header.width, header.height)));
    };
    let mut about = About::beside(source.path)?.unwrap_or_default();
    if header.height > 1 && product == Some(count) && about.shape.is_none() {
        about.shape = u32::try_from(header.height).ok().zip(u32::try_from(header.width).ok()).map(Into::into);
    }
    if let (Some([x, y, z, qw, qx, qy, qz]), None) = (header.viewpoint, about.sensor_pose) {
        let pose = about::pose([x, y, z], [qx, qy, qz, qw]).map_err(|message| source.error(message))?;
        if pose != Pose::IDENTITY {
            // The points are in the frame of the sensor.
            (about.sensor_pose, about.frame) = (Some(pose), about.frame.or(Some(Frame::Sensor)));
        }
    }

    let places = places(fields, source, report)?;
    let goals: Vec<FieldTarget> = places
        .iter()
        .flatten()
        .flat_map(|place| match place {
            WordTarget::Goal(goal) => vec![*goal],
            WordTarget::Packed { goals, .. } => goals.to_vec(),
            WordTarget::List => Vec::new(),
        })
        .collect();
    let columns = goals.iter().map(|goal| goal.field).collect();
    let rows = |room| Rows::new(columns, room, Some(&about));
    let rows = match &*data {
        "ascii" => {
            let mut rows = rows(0)?;
            let count = usize::try_from(count).unwrap_or(usize::MAX);
            // Fields of several numbers take as many words.
            let words = places.into_iter().zip(fields).flat_map(|(place, entry)| vec![place; entry.count]);
            text::read(lines, TextStyle::default(), &words.collect::<Vec<_>>(), Some(count), &mut rows)?;
            rows
        }
        "binary" => {
            let at = lines.at();
            let count = source.check_count(count, size, at)?;
            let mut rows = rows(count)?;
            let members = members(fields, &places);
            let take = |records: &[u8]| members.iter().try_for_each(|(m, _)| m.take(records, size, false, &mut rows));
            blocks(source, source.from(at)?, size, count, take)?;
            rows
        }
        "binary_compressed" => {
            let bytes = decompressed(source, lines.at(), count, size)?;
            let count = bytes.len() / size;
            let mut rows = rows(count)?;
            for (member, entry) in members(fields, &places) {
                // The data is column after column.
                let before: usize = fields[..entry].iter().map(PcdField::bytes).sum();
                let width = fields[entry].bytes();
                let within = member.at - before;
                let column = &bytes[before * count..(before + width) * count];
                Member { at: within, ..member }.take(column, width, false, &mut rows)?;
            }
            rows
        }
        other => {
            let message = format!("its points are kept as {other:?}; allowed: ascii, binary, binary_compressed");
            return Err(source.error(message));
        }
    };
    rows.finish(source.path, "pcd", about, report)
}

/// The target of each of `fields`.
fn places(fields: &[PcdField], source: &Source, report: &mut Report) -> Result<Vec<Option<WordTarget>>> {
    let mut columns = Vec::new();
    for entry in fields {
        let number = Number::of(entry.kind.to_ascii_lowercase(), entry.size).ok_or_else(|| {
            let PcdField { name, size, kind, .. } = entry;
            source.error(format!(
                "{name:?} is of type {kind} with {size} bytes; allowed: I and U with 1, 2, 4 and 8, F with 4 and 8"
            ))
        })?;
        // A field of several numbers is not a column.
        let name = if entry.count == 1 { entry.name.clone() } else { format!("{}[{}]", entry.name, entry.count) };
        let name = if entry.name == "_" { "_".to_owned() } else { name };
        // Claims red, so that no other field is taken for it.
        let name = if entry.is_packed() { Field::Red.info().name.to_owned() } else { name };
        columns.push(NamedColumn { name, number: if entry.is_packed() { Number::U8 } else { number } });
    }
    let mut goals = names::goals(&columns, "pcd", report);
    if fields.iter().any(PcdField::is_packed) {
        let twice = |goal: &FieldTarget| matches!(goal.field, Field::Green | Field::Blue);
        goals.iter_mut().for_each(|goal| *goal = goal.filter(|goal| !twice(goal)));
    }
    let place = |(goal, entry): (Option<FieldTarget>, &PcdField)| match goal {
        Some(goal) if entry.is_packed() && goal.field == Field::Red => {
            let goals = [Field::Red, Field::Green, Field::Blue].map(FieldTarget::from);
            Some(WordTarget::Packed { float: entry.kind.eq_ignore_ascii_case(&'f'), goals })
        }
        goal => goal.map(WordTarget::Goal),
    };
    Ok(goals.into_iter().zip(fields).map(place).collect())
}

/// The members of a point that are read into columns, each with the index of its field.
fn members(fields: &[PcdField], places: &[Option<WordTarget>]) -> Vec<(Member, usize)> {
    let mut members = Vec::new();
    let mut at = 0;
    for (index, (entry, place)) in fields.iter().zip(places).enumerate() {
        match place {
            Some(WordTarget::Goal(goal)) => {
                let number = Number::of(entry.kind.to_ascii_lowercase(), entry.size);
                members.extend(number.map(|number| (Member { goal: *goal, number, at }, index)));
            }
            Some(WordTarget::Packed { goals, .. }) => {
                // Little-endian: blue comes first.
                let byte = |(goal, byte)| (Member { goal, number: Number::U8, at: at + byte }, index);
                members.extend(goals.iter().copied().zip([2, 1, 0]).map(byte));
            }
            Some(WordTarget::List) | None => {}
        }
        at += entry.bytes();
    }
    members
}

/// The columns of `count` points of `size` bytes, which are compressed from byte `at` on.
fn decompressed(source: &Source, at: u64, count: u64, size: usize) -> Result<Vec<u8>> {
    let mut file = source.from(at)?;
    let mut sizes = [0; 8];
    file.read_exact(&mut sizes).map_err(|error| source.failed(error, "the sizes of its compressed points"))?;
    let [packed, whole] = [0, 4].map(|at| sizes[at..].first_chunk().copied().map_or(0, u32::from_le_bytes));
    if u64::from(whole) != count.saturating_mul(size as u64) {
        let message = format!("says it has {count} points of {size} bytes, which are {whole} bytes: it is damaged");
        return Err(source.error(message));
    }
    if u64::from(packed) > source.length.saturating_sub(at + 8) {
        return Err(source.error("ends within its compressed points: it is cut off"));
    }
    if u64::from(whole) > u64::from(packed) * MOST {
        return Err(source.error(format!("says that {packed} bytes are {whole} when decompressed: it is damaged")));
    }
    if whole == 0 {
        return Ok(Vec::new());
    }
    if i32::try_from(whole).is_err() {
        return Err(source.error("has more than 2 GiB of compressed points; allowed: as much as that, or binary"));
    }
    let mut bytes = Vec::new();
    file.take(packed.into()).read_to_end(&mut bytes).map_err(|error| Error::io(source.path, error))?;
    let done =
        contained(|| lzf::decompress(&bytes, whole as usize).map_err(|error| io::Error::other(error.to_string())));
    match done {
        Ok(bytes) if bytes.len() == whole as usize => Ok(bytes),
        _ => Err(source.error("its compressed points are damaged")),
    }
}
