//! Rows of numbers as text.

use super::Source;
use super::rows::Rows;
use super::target::FieldTarget;
use ground::error::{Error, Result};
use ground::shown;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Take};

/// Longest line that is read, bytes.
const MAX_LINE: u64 = 1 << 20;

/// Number of rows that are read before they are added to the columns.
const ROWS: usize = 4096;

/// The lines of a file, with their numbers.
pub(super) struct TextLines<'a> {
    source: &'a Source<'a>,
    reader: Take<BufReader<&'a File>>,
    buffer: Vec<u8>,
    number: u64,
    /// Bytes read so far.
    at: u64,
}

impl<'a> TextLines<'a> {
    /// The lines of `source`, up to the length it had when it was opened.
    pub(super) fn of(source: &'a Source<'a>) -> Result<Self> {
        TextLines::behind(source, 0, 0)
    }

    /// The lines from byte `at` on, after `number` others.
    pub(super) fn behind(source: &'a Source<'a>, at: u64, number: u64) -> Result<Self> {
        let reader = source.from(at)?.take(source.length.saturating_sub(at));
        Ok(TextLines { source, reader, buffer: Vec::new(), number, at })
    }

    /// The next line, without surrounding blanks; `None` at the end.
    ///
    /// # Errors
    /// Errors of the system; a line that is too long or not text.
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
        if str::from_utf8(&self.buffer).is_err() {
            // Names in a legacy encoding; numbers have no such characters.
            self.buffer.iter_mut().filter(|byte| !byte.is_ascii()).for_each(|byte| *byte = b'?');
        }
        let Ok(line) = str::from_utf8(&self.buffer) else { return Err(self.error("is not UTF-8 text")) };
        // A byte order mark, as spreadsheets write it.
        Ok(Some(line.trim_start_matches('\u{feff}').trim()))
    }

    /// An error in the current line.
    pub(super) fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(self.source.path, format!("line {}", self.number), message)
    }

    /// How many lines were read.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Where the next line begins, bytes.
    pub(super) fn at(&self) -> u64 {
        self.at
    }
}

/// How a line is divided into words.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TextStyle {
    /// The separator of words; `None`: blanks.
    pub sign: Option<char>,
    /// Whether the decimal separator is a comma.
    pub decimal_comma: bool,
    /// Whether a number alone on a line is the count of the rows that follow.
    pub counts: bool,
}

impl TextStyle {
    /// The words of `line`. Within quotes, separators are a part of them.
    pub(super) fn words(self, line: &str) -> impl Iterator<Item = &str> {
        let quoted = line.contains('"');
        let mut rest = Some(line).filter(|line| !line.is_empty());
        std::iter::from_fn(move || {
            let line = rest?;
            let mut inside = false;
            let ends = |c: char| self.sign.map_or(c.is_whitespace(), |sign| c == sign);
            let end = line.find(|c: char| {
                inside ^= quoted && c == '"';
                !inside && ends(c)
            });
            let word = end.map_or(line, |at| &line[..at]);
            rest = end.map(|at| &line[at..]).and_then(|rest| rest.strip_prefix(ends));
            if self.sign.is_none() {
                // Several blanks count as one.
                rest = rest.map(str::trim_start).filter(|rest| !rest.is_empty());
            }
            Some(if quoted { word.trim().trim_matches('"').trim() } else { word.trim() })
        })
    }

    /// The number in `word`; NaN if it is empty.
    pub(super) fn number(self, word: &str) -> Option<f64> {
        if word.is_empty() {
            return Some(f64::NAN);
        }
        match word.parse() {
            Ok(number) => Some(number),
            Err(_) if self.decimal_comma && is_decimal(word) => word.replace(',', ".").parse().ok(),
            Err(_) => odd(word),
        }
    }

    /// The number of words of `line`, not counting an empty one after the last separator.
    pub(super) fn count(self, line: &str) -> usize {
        let (mut count, mut last) = (0, "");
        self.words(line).for_each(|word| (count, last) = (count + 1, word));
        count - usize::from(count > 0 && last.is_empty())
    }
}

/// Whether `word` has digits on both sides of each comma.
fn is_decimal(word: &str) -> bool {
    let digit = |at: Option<usize>| at.and_then(|at| word.as_bytes().get(at)).is_some_and(u8::is_ascii_digit);
    word.contains(',') && word.match_indices(',').all(|(at, _)| digit(at.checked_sub(1)) && digit(Some(at + 1)))
}

/// Numbers as Windows (1.#INF, -1.#IND), C (-nan(ind)) and Fortran (1.5D+03) write them.
fn odd(word: &str) -> Option<f64> {
    let (sign, plain) = match word.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, word.strip_prefix('+').unwrap_or(word)),
    };
    let plain = plain.to_ascii_lowercase();
    if let Some((_, what)) = plain.split_once(".#").filter(|(one, _)| *one == "1") {
        return match what.trim_end_matches('0') {
            "inf" => Some(sign * f64::INFINITY),
            "qnan" | "snan" | "ind" | "nan" => Some(f64::NAN),
            _ => None,
        };
    }
    if plain.strip_prefix("nan(").is_some_and(|rest| rest.ends_with(')')) {
        return Some(f64::NAN);
    }
    let (digits, exponent) =
        plain.split_once('d').filter(|(digits, _)| digits.ends_with(|c: char| c.is_ascii_digit()))?;
    format!("{digits}e{exponent}").parse().ok().map(|number: f64| sign * number)
}

/// The target of a word of each line.
#[derive(Clone)]
pub(super) enum WordTarget {
    Goal(FieldTarget),
    /// Red, green and blue in one number; if it is a float, in its bits.
    Packed {
        float: bool,
        goals: [FieldTarget; 3],
    },
    /// A list, which begins with its length and is ignored.
    List,
}

/// Adds the rows of `lines` to `rows`, `count` of them or all that are left. There are as many `places` as numbers in a
/// line; words without a target need not be numbers. Empty lines and comments (`#`, `//`, `%`) are skipped.
///
/// # Errors
/// A line with more or fewer numbers, or with words; fewer rows than announced.
pub(super) fn read(
    mut lines: TextLines,
    style: TextStyle,
    places: &[Option<WordTarget>],
    count: Option<usize>,
    rows: &mut Rows,
) -> Result<()> {
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); places.len()];
    let mut read = 0;
    // Number of rows announced by the lines.
    let mut announced: Option<usize> = None;
    let mut numbers = Vec::new();
    while count.is_none_or(|count| read < count) {
        let Some(line) = lines.next()? else { break };
        if line.is_empty() || is_comment(line) {
            continue;
        }
        if style.counts
            && let Ok(more) = line.parse::<usize>()
        {
            announced = Some(announced.unwrap_or(0).saturating_add(more));
            continue;
        }
        if let Some(fault) = parse(style, line, places, &mut numbers) {
            return Err(lines.error(fault));
        }
        columns.iter_mut().zip(&numbers).for_each(|(column, &number)| column.push(number));
        read += 1;
        if read % ROWS == 0 {
            flush(&mut columns, places, rows)?;
        }
    }
    if let Some(count) = count.or(announced).filter(|&count| read < count) {
        let source = lines.source;
        return Err(source.error(format!("says it has {count} points, and has {read}: it is cut off, or damaged")));
    }
    flush(&mut columns, places, rows)
}

/// Whether `line` is a comment.
pub(super) fn is_comment(line: &str) -> bool {
    line.starts_with(['#', '%']) || line.starts_with("//")
}

/// Puts the numbers of `line` into `numbers`, or returns what is wrong with them.
fn parse(style: TextStyle, line: &str, places: &[Option<WordTarget>], numbers: &mut Vec<f64>) -> Option<String> {
    numbers.clear();
    let mut words = style.words(line);
    let mut found = 0;
    for place in places {
        let Some(word) = words.next() else { break };
        found += 1;
        let number = match place {
            None => Some(0.0),
            Some(WordTarget::List) => {
                let items = word.parse::<usize>().ok();
                items.filter(|&items| items == 0 || words.nth(items - 1).is_some()).map(|_| 0.0)
            }
            Some(_) => style.number(word),
        };
        match number {
            Some(number) => numbers.push(number),
            None if matches!(place, Some(WordTarget::List)) => {
                return Some(format!("has a list of {:?} numbers, which it does not hold", shown::name(word)));
            }
            None => return Some(format!("{:?} is not a number", shown::name(word))),
        }
    }
    // A separator after the last number does not add a number.
    found += words.by_ref().enumerate().filter(|(index, word)| *index > 0 || !word.is_empty()).count();
    (found != places.len()).then(|| format!("has {found} numbers; expected {}", places.len()))
}

/// Moves what was read to `rows`.
fn flush(columns: &mut [Vec<f64>], places: &[Option<WordTarget>], rows: &mut Rows) -> Result<()> {
    for (column, place) in columns.iter_mut().zip(places) {
        match place {
            Some(WordTarget::Goal(goal)) => rows.add(*goal, column.iter().copied())?,
            Some(WordTarget::Packed { float, goals }) => {
                let bits = |value: f64| if *float { (value as f32).to_bits() } else { value as u32 };
                for (goal, shift) in goals.iter().zip([16, 8, 0]) {
                    rows.add(*goal, column.iter().map(|&value| f64::from(bits(value) >> shift & 0xff)))?;
                }
            }
            Some(WordTarget::List) | None => {}
        }
        column.clear();
    }
    Ok(())
}
