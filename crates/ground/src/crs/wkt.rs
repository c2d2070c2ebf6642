//! Well-known text of coordinate systems, version 1 (OGC 01-009): what is needed of it.

use crate::error::{Error, Result};
use crate::shown;

/// Deepest nesting that any coordinate system has, with room to spare.
const DEEPEST: usize = 32;

/// An entry: a keyword with a text, numbers, words and further entries in brackets.
#[derive(Debug, Default)]
pub(super) struct WktEntry {
    /// Its keyword, upper case.
    pub keyword: String,
    /// Its first text in quotation marks; empty if it has none.
    pub name: String,
    /// Its numbers.
    pub numbers: Vec<f64>,
    /// The entries in it.
    pub inner: Vec<WktEntry>,
}

impl WktEntry {
    /// Reads `text`, all of it.
    ///
    /// # Errors
    /// What is not well-known text, and where.
    pub fn parse(text: &str) -> Result<WktEntry> {
        let mut reader = WktReader { text, at: 0 };
        let entry = reader.entry(0)?;
        reader.skip_spaces();
        if reader.at < text.len() { Err(reader.fault("more text after its last bracket")) } else { Ok(entry) }
    }

    /// The first entry with this keyword, in it or below.
    pub fn find(&self, keyword: &str) -> Option<&WktEntry> {
        if self.keyword == keyword {
            return Some(self);
        }
        self.inner.iter().find_map(|entry| entry.find(keyword))
    }

    /// The number of the parameter called `name`, in any case.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let known = |entry: &&WktEntry| entry.keyword == "PARAMETER" && entry.name.eq_ignore_ascii_case(name);
        self.inner.iter().find(known)?.numbers.first().copied()
    }
}

/// A text and how far it is read.
struct WktReader<'t> {
    text: &'t str,
    at: usize,
}

impl WktReader<'_> {
    fn fault(&self, what: &str) -> Error {
        let line = 1 + self.text[..self.at].matches('\n').count();
        let message = format!("{what}; expected well-known text, version 1, such as PROJCS[\"name\", ...]");
        Error::Parse { origin: "coordinate system".into(), place: format!("line {line}"), message }
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn skip_spaces(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    /// Whether the next character is one of `wanted`, which is then read.
    fn take(&mut self, wanted: [char; 2]) -> bool {
        self.skip_spaces();
        let found = self.rest().starts_with(wanted);
        self.at += usize::from(found);
        found
    }

    /// The letters, digits and signs up to the next other character.
    fn word(&mut self) -> String {
        self.skip_spaces();
        let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '+' | '-');
        let length = self.rest().find(|c| !is_part(c)).unwrap_or(self.rest().len());
        let word = self.rest()[..length].to_owned();
        self.at += length;
        word
    }

    fn entry(&mut self, depth: usize) -> Result<WktEntry> {
        let keyword = self.word().to_ascii_uppercase();
        if !keyword.starts_with(|c: char| c.is_ascii_alphabetic()) || !self.take(['[', '(']) {
            return Err(self.fault("no keyword with a bracket"));
        }
        self.content(keyword, depth)
    }

    /// What is in the brackets of `keyword`, the first of which is read.
    fn content(&mut self, keyword: String, depth: usize) -> Result<WktEntry> {
        if depth == DEEPEST {
            return Err(self.fault(&format!("brackets nested deeper than {DEEPEST}")));
        }
        let mut entry = WktEntry { keyword, ..WktEntry::default() };
        loop {
            if self.take(['"', '"']) {
                let Some(length) = self.rest().find('"') else { return Err(self.fault("a text without its end")) };
                let name = self.rest()[..length].to_owned();
                self.at += length + 1;
                if entry.name.is_empty() {
                    entry.name = name;
                }
            } else {
                let word = self.word();
                if word.is_empty() {
                    return Err(self.fault("neither a text nor a number nor a keyword"));
                }
                if self.take(['[', '(']) {
                    entry.inner.push(self.content(word.to_ascii_uppercase(), depth + 1)?);
                } else if let Ok(number) = word.parse::<f64>() {
                    entry.numbers.push(number);
                } else if !word.starts_with(|c: char| c.is_ascii_alphabetic()) {
                    return Err(self.fault(&format!("{:?}, which is no number", shown::name(&word))));
                }
            }
            if self.take([']', ')']) {
                return Ok(entry);
            }
            if !self.take([',', ',']) {
                return Err(self.fault("no comma or closing bracket"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_nest() {
        let entry = WktEntry::parse("PROJCS [\"a \u{e9}\" , parameter(\"b\",-1.5e3),AXIS[\"x\",EAST]]\n").unwrap();
        assert_eq!((entry.keyword.as_str(), entry.name.as_str()), ("PROJCS", "a \u{e9}"));
        assert_eq!(entry.parameter("B"), Some(-1500.0));
        assert!(entry.find("AXIS").is_some() && entry.find("UNIT").is_none());
    }

    #[test]
    fn errors_name_the_line() {
        let message = |text: &str| WktEntry::parse(text).unwrap_err().to_string();
        for (text, expected) in [
            ("", "line 1: no keyword with a bracket"),
            ("PROJCS", "line 1: no keyword with a bracket"),
            ("PROJCS[\n\"a", "line 2: a text without its end"),
            ("PROJCS[\"a\"", "line 1: no comma or closing bracket"),
            ("PROJCS[\"a\",]", "line 1: neither a text nor a number nor a keyword"),
            ("PROJCS[\"a\",1.2.3]", "line 1: \"1.2.3\", which is no number"),
            ("PROJCS[\"a\"]]", "line 1: more text after its last bracket"),
        ] {
            assert!(message(text).contains(expected), "{text}: {}", message(text));
        }
        assert!(message(&"A[".repeat(100_000)).contains("nested deeper than 32"));
    }
}
