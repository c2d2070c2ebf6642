//! Numbers in CSV files, read line by line.

use crate::error::{Error, Result};
use crate::read::{self, Limit};
use crate::shown;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;

/// Longest line that is read, bytes.
const MAX_LINE: u64 = 64 << 10;

/// The lines of a text file, counted; blank ones and comments (`#`) are skipped.
pub struct Lines {
    /// The file, or a word for text from elsewhere.
    origin: String,
    reader: Box<dyn BufRead>,
    buffer: Vec<u8>,
    number: u64,
}

impl Lines {
    /// Opens the file at `path`.
    pub fn open(path: &Path) -> Result<Lines> {
        let file = read::open(path, Limit::TABLE)?;
        Ok(Lines::new(shown::path(path), BufReader::with_capacity(1 << 18, file)))
    }

    /// The lines of `text`, which came from `origin`.
    pub fn of(origin: &str, text: String) -> Lines {
        Lines::new(origin.to_owned(), Cursor::new(text))
    }

    fn new(origin: String, reader: impl BufRead + 'static) -> Lines {
        Lines { origin, reader: Box::new(reader), buffer: Vec::new(), number: 0 }
    }

    /// Advances to the next non-empty line; false at the end.
    pub fn advance(&mut self) -> Result<bool> {
        loop {
            self.buffer.clear();
            self.number += 1;
            let read = self.reader.by_ref().take(MAX_LINE + 1).read_until(b'\n', &mut self.buffer);
            if read.map_err(|source| Error::io(&self.origin, source))? == 0 {
                return Ok(false);
            }
            if self.buffer.len() as u64 > MAX_LINE {
                return Err(self.error(format!("is longer than {MAX_LINE} bytes, the most allowed")));
            }
            // A byte order mark, as spreadsheets write it.
            if self.number == 1 && self.buffer.starts_with(b"\xef\xbb\xbf") {
                self.buffer.drain(..3);
            }
            let text = str::from_utf8(&self.buffer).map_err(|_| self.error("is not UTF-8 text".into()))?.trim();
            if !(text.is_empty() || text.starts_with('#')) {
                return Ok(true);
            }
        }
    }

    /// The current line, trimmed.
    pub fn text(&self) -> &str {
        str::from_utf8(&self.buffer).unwrap_or_default().trim()
    }

    /// An error in the current line.
    pub fn error(&self, message: String) -> Error {
        Error::Parse { origin: self.origin.clone(), place: format!("line {}", self.number), message }
    }

    /// An error in the file as a whole.
    pub fn error_at_all(&self, message: &str) -> Error {
        Error::Parse { origin: self.origin.clone(), place: String::new(), message: message.to_owned() }
    }
}

/// A CSV file of finite numbers with a header.
pub struct CsvReader {
    lines: Lines,
    /// Whether errors may show an unexpected header.
    shows: bool,
    header: Vec<String>,
    row: Vec<f64>,
}

impl CsvReader {
    /// Opens the file at `path`, which another file names, and reads its header. It may be any file of the user's:
    /// errors show its content only once the header has the expected columns.
    pub fn open(path: &Path) -> Result<CsvReader> {
        let mut lines = Lines::open(path)?;
        if !lines.advance()? {
            return Err(lines.error_at_all("is empty; expected a header"));
        }
        CsvReader::new(lines, false)
    }

    /// Takes the current line of `lines`, from a file the user named, as the header.
    pub fn with_header(lines: Lines) -> Result<CsvReader> {
        CsvReader::new(lines, true)
    }

    fn new(lines: Lines, shows: bool) -> Result<CsvReader> {
        let header: Vec<String> = lines.text().split(',').map(|name| name.trim().to_owned()).collect();
        let row = Vec::with_capacity(header.len());
        let csv = CsvReader { lines, shows, header, row };
        let header = &csv.header;
        match header.iter().enumerate().find_map(|(i, name)| header[..i].contains(name).then_some(name)) {
            Some(twice) if shows => Err(csv.error(format!("has the column {:?} twice", shown::name(twice)))),
            Some(_) => Err(csv.error("has two columns of one name".into())),
            None => Ok(csv),
        }
    }

    /// Index of each of the columns `names`.
    pub fn optional<const N: usize>(&self, names: [&str; N]) -> [Option<usize>; N] {
        names.map(|name| self.header.iter().position(|column| column == name))
    }

    /// Index of each of the columns `names`, which are required.
    pub fn required<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N]> {
        let found = self.optional(names);
        match found.iter().position(Option::is_none) {
            None => Ok(found.map(Option::unwrap_or_default)),
            Some(missing) => Err(self.error(format!(
                "the column {} is missing; expected a header with {}{}",
                names[missing],
                names.join(", "),
                if self.shows { format!(", found {:?}", shown::name(&self.header.join(","))) } else { String::new() }
            ))),
        }
    }

    /// Checks that there are no columns other than `known`.
    pub fn only(&self, known: &[&str]) -> Result<()> {
        match self.header.iter().find(|name| !known.contains(&name.as_str())) {
            None => Ok(()),
            Some(name) => {
                let name = shown::name(name);
                Err(self.error(format!("unknown column {name:?}; allowed: {}", known.join(", "))))
            }
        }
    }

    /// The numbers of the next row, in the order of the header; none at the end.
    pub fn next_row(&mut self) -> Result<Option<&[f64]>> {
        if !self.lines.advance()? {
            return Ok(None);
        }
        self.row.clear();
        for (column, field) in self.lines.text().split(',').enumerate() {
            match field.trim().parse::<f64>() {
                Ok(value) if value.is_finite() => self.row.push(value),
                _ => {
                    let name = shown::name(self.header.get(column).map_or("", String::as_str));
                    let found = shown::name(field.trim());
                    return Err(self.error(format!("{name} is {found:?}; expected a finite number")));
                }
            }
        }
        if self.row.len() != self.header.len() {
            return Err(self.error(format!("has {} numbers; the header has {}", self.row.len(), self.header.len())));
        }
        Ok(Some(&self.row))
    }

    /// An error in the current line.
    pub fn error(&self, message: String) -> Error {
        self.lines.error(message)
    }

    /// An error in the file as a whole.
    pub fn error_at_all(&self, message: &str) -> Error {
        self.lines.error_at_all(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn files_that_other_files_name_are_not_shown() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let require_angles = |csv: CsvReader| csv.required(["azimuth_deg", "elevation_deg"]);
        for text in ["root:x:0:0", "root,root", "azimuth_deg,azimuth_deg,root", "azimuth_deg,root"] {
            fs::write(file.path(), text).unwrap();
            let error = CsvReader::open(file.path()).and_then(require_angles).unwrap_err().to_string();
            assert!(!error.contains("root") && error.contains(": line 1: "), "{text}: {error}");
            let mut lines = Lines::open(file.path()).unwrap();
            lines.advance().unwrap();
            let error = CsvReader::with_header(lines).and_then(require_angles).unwrap_err().to_string();
            assert!(error.contains("root") || error.contains("\"azimuth_deg\" twice"), "{text}: {error}");
        }
    }
}
