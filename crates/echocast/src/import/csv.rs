//! CSV: a header of column names, one row per point.

use super::about::About;
use super::names::Named;
use super::rows::{self, Rows};
use super::text::{self, Lines, Place, Separator};
use super::{Source, names};
use crate::cloud::PointCloud;
use crate::ground::error::Result;
use crate::ground::report::Report;
use crate::ground::shown;
use crate::read::number::Number;

/// Most columns.
const COLUMNS: usize = 4096;

/// Whether a file that begins with `bytes` is one: its first line names columns of ours.
pub(super) fn begins(bytes: &[u8]) -> bool {
    let text = match str::from_utf8(bytes) {
        Ok(text) => text,
        // What follows may be half a letter.
        Err(error) if error.error_len().is_none() => str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
        Err(_) => return false,
    };
    let header = text.trim_start_matches('\u{feff}').lines().find(|line| !line.trim().is_empty());
    let Some(header) = header.filter(|line| !line.contains('\0')) else { return false };
    let (separator, columns) = header_of(header);
    match separator {
        Separator::Sign(_) => columns.iter().any(|column| names::own(column).is_some()),
        Separator::Blanks => ["x", "y", "z"].iter().all(|axis| columns.iter().any(|column| column.name == *axis)),
    }
}

/// The columns that a header names, and how they are separated.
fn header_of(line: &str) -> (Separator, Vec<Named>) {
    // Some programs mark the header as a comment.
    let line = line.trim_start_matches(['#', '/']).trim();
    let separator = [',', ';', '\t'].into_iter().find(|&sign| line.contains(sign));
    // Of the types of numbers, that whose numbers are meant as they are.
    let column = |word: &str| Named::new(word.trim().trim_matches('"'), Number::U8);
    match separator {
        Some(sign) => (Separator::Sign(sign), line.split(sign).map(column).collect()),
        None => (Separator::Blanks, line.split_whitespace().map(column).collect()),
    }
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let mut lines = Lines::of(source)?;
    let (separator, columns) = loop {
        match lines.next()? {
            Some("") => {}
            Some(line) => break header_of(line),
            None => return Err(source.error("is empty; expected a header")),
        }
    };
    if columns.len() > COLUMNS {
        return Err(source.error(format!("has {} columns; allowed: {COLUMNS}", columns.len())));
    }
    let about = About::beside(source.path)?;
    // Integers have their own unit of time in other formats; here all are seconds.
    let goals = rows::goals(&columns, "csv", report);
    let told = about.as_ref().and_then(|about| about.columns.as_deref()).unwrap_or_default();
    if let Some(missing) = told.iter().find(|name| !columns.iter().any(|column| column.name == **name)) {
        let missing = shown::name(missing);
        return Err(source.error(format!("has no column {missing}, of which its label names tell: it is cut off")));
    }
    let mut rows = Rows::new(rows::fields(&goals), 0, about.as_ref())?;
    let places: Vec<Option<Place>> = goals.into_iter().map(|goal| goal.map(Place::Goal)).collect();
    text::read(lines, separator, &places, None, &mut rows)?;
    rows.finish(source.path, "csv", about.unwrap_or_default(), report)
}
