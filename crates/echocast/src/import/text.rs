//! Rows of numbers as text.

use super::Source;
use super::rows::{Goal, Rows};
use crate::ground::error::{Error, Result};
use crate::ground::shown;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Take};

/// Longest line that is read, bytes.
const MAX_LINE: u64 = 1 << 20;

/// Rows that are read before they go to the columns.
const ROWS: usize = 4096;

/// The lines of a file, counted.
pub(super) struct Lines<'a> {
    source: &'a Source<'a>,
    reader: Take<BufReader<&'a File>>,
    buffer: Vec<u8>,
    number: u64,
    /// Bytes so far.
    at: u64,
}

impl<'a> Lines<'a> {
    /// Those of `source`, as long as it was when it was opened.
    pub(super) fn of(source: &'a Source<'a>) -> Result<Self> {
        Lines::behind(source, 0, 0)
    }

    /// Those from byte `at` on, behind `number` others.
    pub(super) fn behind(source: &'a Source<'a>, at: u64, number: u64) -> Result<Self> {
        let reader = source.from(at)?.take(source.length.saturating_sub(at));
        Ok(Lines { source, reader, buffer: Vec::new(), number, at })
    }

    /// The next line, without blanks around it; `None` at the end.
    ///
    /// # Errors
    /// The system's; a line that is too long or no text.
    pub(super) fn next(&mut self) -> Result<Option<&str>> {
        self.buffer.clear();
        self.number += 1;
        let read = (&mut self.reader).take(MAX_LINE + 1).read_until(b'\n', &mut self.buffer);
        let read = read.map_err(|error| Error::io(self.source.path, error))?;
        self.at += read as u64;
        if read == 0 {
            return Ok(None);
        }
        if self.buffer.len() as u64 > MAX_LINE {
            return Err(self.error(format!("is longer than {MAX_LINE} bytes, the most allowed")));
        }
        let Ok(line) = str::from_utf8(&self.buffer) else { return Err(self.error("is not UTF-8 text")) };
        // A byte order mark, as spreadsheets write it.
        Ok(Some(line.trim_start_matches('\u{feff}').trim()))
    }

    /// What is wrong with the current line.
    pub(super) fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(self.source.path, format!("line {}", self.number), message)
    }

    /// Where the next line begins, bytes.
    pub(super) fn at(&self) -> u64 {
        self.at
    }
}

/// How numbers of a line are separated.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Separator {
    Blanks,
    Sign(char),
}

/// A number of each line, and where it goes.
#[derive(Clone)]
pub(super) enum Place {
    Goal(Goal),
    /// Red, green and blue in one number; as a float it is the bits of that.
    Packed {
        float: bool,
        goals: [Goal; 3],
    },
}

/// Adds the rows of `lines` to `rows`, `count` of them or all that are left. There are as many `places` as numbers in a
/// line; those that go nowhere need not be numbers. Empty lines and comments (`#`) are skipped.
///
/// # Errors
/// A line with more or fewer numbers, or words; fewer rows than `count`.
pub(super) fn read(
    mut lines: Lines,
    separator: Separator,
    places: &[Option<Place>],
    count: Option<usize>,
    rows: &mut Rows,
) -> Result<()> {
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); places.len()];
    let mut read = 0;
    let mut numbers = Vec::new();
    while count.is_none_or(|count| read < count) {
        let Some(line) = lines.next()? else { break };
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fault = match separator {
            Separator::Blanks => parse(line.split_whitespace(), places, &mut numbers),
            Separator::Sign(sign) => parse(line.split(sign).map(str::trim), places, &mut numbers),
        };
        if let Some(fault) = fault {
            return Err(lines.error(fault));
        }
        columns.iter_mut().zip(&numbers).for_each(|(column, &number)| column.push(number));
        read += 1;
        if read % ROWS == 0 {
            flush(&mut columns, places, rows)?;
        }
    }
    if let Some(count) = count.filter(|&count| read < count) {
        let source = lines.source;
        return Err(source.error(format!("says it has {count} points, and has {read}: it is cut off, or damaged")));
    }
    flush(&mut columns, places, rows)
}

/// Puts the numbers of a line into `numbers`, or says what is wrong with them.
fn parse<'a>(words: impl Iterator<Item = &'a str>, places: &[Option<Place>], numbers: &mut Vec<f64>) -> Option<String> {
    numbers.clear();
    for word in words {
        let number = match places.get(numbers.len()) {
            Some(Some(_)) => match word.parse::<f64>() {
                Ok(number) => number,
                Err(_) => return Some(format!("{:?} is not a number", shown::name(word))),
            },
            _ => 0.0,
        };
        numbers.push(number);
    }
    let wrong = numbers.len() != places.len();
    wrong.then(|| format!("has {} numbers; expected {}", numbers.len(), places.len()))
}

/// Moves what was read to `rows`.
fn flush(columns: &mut [Vec<f64>], places: &[Option<Place>], rows: &mut Rows) -> Result<()> {
    for (column, place) in columns.iter_mut().zip(places) {
        match place {
            Some(Place::Goal(goal)) => rows.add(*goal, column.iter().copied())?,
            Some(Place::Packed { float, goals }) => {
                let bits = |value: f64| if *float { (value as f32).to_bits() } else { value as u32 };
                for (goal, shift) in goals.iter().zip([16, 8, 0]) {
                    rows.add(*goal, column.iter().map(|&value| f64::from(bits(value) >> shift & 0xff)))?;
                }
            }
            None => {}
        }
        column.clear();
    }
    Ok(())
}
