//! Numbers in CSV files, read line by line.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Longest line that is read, bytes.
const MAX_LINE: u64 = 64 << 10;

/// The lines of a text file, counted; blank ones and comments (`#`) are left out.
pub(crate) struct Lines {
    path: PathBuf,
    reader: Box<dyn BufRead>,
    buffer: Vec<u8>,
    number: u64,
}

impl Lines {
    /// Opens the file at `path`.
    pub fn open(path: &Path) -> Result<Lines> {
        let file = File::open(path).map_err(|source| Error::io(path, source))?;
        Ok(Lines::new(path, BufReader::with_capacity(1 << 18, file)))
    }

    fn new(path: &Path, reader: impl BufRead + 'static) -> Lines {
        Lines { path: path.to_owned(), reader: Box::new(reader), buffer: Vec::new(), number: 0 }
    }

    /// Goes to the next line with something on it; false at the end.
    pub fn advance(&mut self) -> Result<bool> {
        loop {
            self.buffer.clear();
            self.number += 1;
            let read = self.reader.by_ref().take(MAX_LINE + 1).read_until(b'\n', &mut self.buffer);
            if read.map_err(|source| Error::io(&self.path, source))? == 0 {
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

    /// The current line, without blanks around it.
    pub fn text(&self) -> &str {
        str::from_utf8(&self.buffer).unwrap_or_default().trim()
    }

    /// An error in the current line.
    pub fn error(&self, message: String) -> Error {
        Error::parse(&self.path, format!("line {}", self.number), message)
    }
}

/// A CSV file of finite numbers with a header.
pub(crate) struct Csv {
    lines: Lines,
    header: Vec<String>,
    row: Vec<f64>,
}

impl Csv {
    /// Opens the file at `path` and reads its header.
    pub fn open(path: &Path) -> Result<Csv> {
        let mut lines = Lines::open(path)?;
        if !lines.advance()? {
            return Err(Error::parse(path, "", "is empty; expected a header"));
        }
        Csv::with_header(lines)
    }

    /// Takes the current line of `lines` for the header.
    pub fn with_header(lines: Lines) -> Result<Csv> {
        let header: Vec<String> = lines.text().split(',').map(|name| name.trim().to_owned()).collect();
        if let Some(twice) = header.iter().enumerate().find_map(|(i, name)| header[..i].contains(name).then_some(name))
        {
            return Err(lines.error(format!("has the column {twice:?} twice")));
        }
        let row = Vec::with_capacity(header.len());
        Ok(Csv { lines, header, row })
    }

    /// Index of each of the columns `names`.
    pub fn optional<const N: usize>(&self, names: [&str; N]) -> [Option<usize>; N] {
        names.map(|name| self.header.iter().position(|column| column == name))
    }

    /// Index of each of the columns `names`, which must be there.
    pub fn required<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N]> {
        let found = self.optional(names);
        match found.iter().position(Option::is_none) {
            None => Ok(found.map(Option::unwrap_or_default)),
            Some(missing) => Err(self.error(format!(
                "the column {} is missing; expected a header with {}, found {:?}",
                names[missing],
                names.join(", "),
                self.header.join(",")
            ))),
        }
    }

    /// That there are no columns but `known`.
    pub fn only(&self, known: &[&str]) -> Result<()> {
        match self.header.iter().find(|name| !known.contains(&name.as_str())) {
            None => Ok(()),
            Some(name) => Err(self.error(format!("unknown column {name:?}; allowed: {}", known.join(", ")))),
        }
    }

    /// The numbers of the next row, in the order of the header; none at the end.
    pub fn next_row(&mut self) -> Result<Option<&[f64]>> {
        if !self.lines.advance()? {
            return Ok(None);
        }
        self.row.clear();
        for (column, field) in self.lines.text().split(',').enumerate() {
            let name = self.header.get(column).map_or("", String::as_str);
            match field.trim().parse::<f64>() {
                Ok(value) if value.is_finite() => self.row.push(value),
                _ => return Err(self.error(format!("{name} is {:?}; expected a finite number", field.trim()))),
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
}
