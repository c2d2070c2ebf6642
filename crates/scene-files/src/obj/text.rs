//! The text of OBJ and MTL files: statements, words and numbers, read byte by byte without copies.

use crate::number::{decimal, integer};
use ground::error::{Error, Result};
use model::LARGEST;
use std::path::Path;

/// A position in the text of a file.
pub(super) struct Text<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    line: usize,
    /// Whether errors quote words of the text.
    quotes_words: bool,
}

impl<'a> Text<'a> {
    /// The start of `bytes`, the content of the file at `path`.
    ///
    /// # Errors
    /// UTF-16 text.
    pub fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let utf16 =
            bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") || bytes.iter().take(2).any(|&b| b == 0);
        if utf16 {
            return Err(Error::parse(path, "", "the text is UTF-16; allowed: UTF-8 or ASCII"));
        }
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        Ok(Text { path, bytes, at: 0, line: 1, quotes_words: true })
    }

    /// The same text, but errors quote none of its words.
    pub fn without_quotes(self) -> Self {
        Text { quotes_words: false, ..self }
    }

    /// Line number of the current position, from 1.
    pub fn line(&self) -> usize {
        self.line
    }

    /// An error at this line.
    #[cold]
    pub fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(self.path, format!("line {}", self.line), message)
    }

    /// The current byte.
    #[inline]
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Skips blanks, and line ends escaped by a backslash.
    #[inline]
    fn skip_blanks(&mut self) {
        while let Some(byte) = self.peek() {
            match byte {
                b' ' | b'\t' | b'\r' => self.at += 1,
                b'\\' => match join_length(&self.bytes[self.at..]) {
                    Some(length) => {
                        self.at += length;
                        self.line += 1;
                    }
                    None => return,
                },
                _ => return,
            }
        }
    }

    /// Whether only a comment is left of the statement.
    #[inline]
    pub fn statement_is_over(&mut self) -> bool {
        self.skip_blanks();
        matches!(self.peek(), None | Some(b'\n' | b'#'))
    }

    /// Advances to the next statement; false at the end of the file.
    #[inline]
    pub fn next_statement(&mut self) -> bool {
        loop {
            if !self.statement_is_over() {
                return true;
            }
            match self.peek() {
                None => return false,
                Some(b'\n') => {
                    self.at += 1;
                    self.line += 1;
                }
                // A backslash at the end of a comment joins no lines: it usually belongs to a Windows path.
                Some(_) => self.at = self.line_end(),
            }
        }
    }

    /// Skips the rest of the statement.
    #[inline]
    pub fn skip_statement(&mut self) {
        if !self.statement_is_over() {
            self.rest_bytes();
        } else if self.peek() == Some(b'#') {
            self.at = self.line_end();
        }
    }

    /// Next run of bytes that are not blank; empty at the end of the statement.
    #[inline]
    pub fn word(&mut self) -> &'a [u8] {
        self.skip_blanks();
        let word = self.word_here();
        self.at += word.len();
        word
    }

    /// [`Text::word`] without advancing.
    pub fn peek_word(&mut self) -> &'a [u8] {
        self.skip_blanks();
        self.word_here()
    }

    #[inline]
    fn word_here(&self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().enumerate().position(|(i, &byte)| match byte {
            b' ' | b'\t' | b'\r' | b'\n' => true,
            b'\\' => join_length(&rest[i..]).is_some(),
            _ => false,
        });
        &rest[..length.unwrap_or(rest.len())]
    }

    /// The rest of the statement as a name, which may contain blanks and `#`. Invalid UTF-8 is replaced.
    pub fn rest(&mut self) -> String {
        self.skip_blanks();
        let text = String::from_utf8_lossy(self.rest_bytes());
        if text.contains('\n') {
            text.replace("\\\r\n", " ").replace("\\\n", " ").trim().to_owned()
        } else {
            text.trim().to_owned()
        }
    }

    fn rest_bytes(&mut self) -> &'a [u8] {
        let start = self.at;
        loop {
            let end = self.line_end();
            let line = &self.bytes[self.at..end];
            self.at = end;
            let joined = line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\");
            if !joined || end == self.bytes.len() {
                return &self.bytes[start..end];
            }
            self.at += 1;
            self.line += 1;
        }
    }

    /// Position of the next line feed, or the end of the file.
    fn line_end(&self) -> usize {
        let rest = &self.bytes[self.at..];
        self.at + rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len())
    }

    /// Next number.
    ///
    /// # Errors
    /// The statement has ended, the word is not a finite decimal number, or it is beyond 1e18.
    #[inline]
    pub fn number(&mut self) -> Result<f64> {
        self.skip_blanks();
        match decimal(&self.bytes[self.at..]) {
            Some((value, length)) if value.abs() <= LARGEST && self.ends_word(length) => {
                self.at += length;
                Ok(value)
            }
            _ => Err(self.number_error()),
        }
    }

    #[cold]
    fn number_error(&mut self) -> Error {
        if self.statement_is_over() {
            return self.error("a number is missing");
        }
        if !self.quotes_words {
            return self.error("not a number from -1e18 to 1e18");
        }
        let word = self.word_here();
        match decimal(word) {
            Some((_, length)) if length == word.len() => {
                self.error(format!("{} is too large; allowed: -1e18 to 1e18", quoted(word)))
            }
            _ => self.error(format!("{} is not a finite number", quoted(word))),
        }
    }

    /// Next number, if the next word is one.
    pub fn optional_number(&mut self) -> Option<f64> {
        let word = self.peek_word();
        let (value, length) = decimal(word)?;
        let taken = length == word.len() && value.abs() <= LARGEST;
        taken.then(|| {
            self.at += length;
            value
        })
    }

    /// Next face corner: the indices of vertex, texture coordinate and normal as written, 0 where there is none.
    ///
    /// # Errors
    /// The word is not `1`, `1/2`, `1//3` or `1/2/3`.
    #[inline]
    pub fn corner(&mut self) -> Result<[i64; 3]> {
        let start = self.at;
        let mut indices = [0; 3];
        let mut slot = 0;
        loop {
            let (index, length) = integer(&self.bytes[self.at..]);
            // Only the vertex is required, and 0 is not an index.
            if index == 0 && (slot == 0 || length > 0) {
                break;
            }
            indices[slot] = index;
            self.at += length;
            if self.ends_word(0) {
                return Ok(indices);
            }
            if self.peek() != Some(b'/') || slot == 2 {
                break;
            }
            self.at += 1;
            slot += 1;
        }
        self.at = start;
        let word = quoted(self.word_here());
        Err(self.error(format!(
            "{word} is not a face corner; allowed: V, V/T, V//N or V/T/N with indices from 1, or from -1 backwards"
        )))
    }

    /// Whether a word ends `length` bytes from here.
    #[inline]
    fn ends_word(&self, length: usize) -> bool {
        matches!(self.bytes.get(self.at + length), None | Some(b' ' | b'\n' | b'\r' | b'\t' | b'#' | b'\\'))
    }
}

/// Length of a backslash and line end at the start of `bytes`.
fn join_length(bytes: &[u8]) -> Option<usize> {
    [&b"\\\n"[..], b"\\\r\n"].iter().find(|join| bytes.starts_with(join)).map(|join| join.len())
}

/// `word` for an error message: in quotes, at most 40 characters.
pub(super) fn quoted(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(&word[..word.len().min(200)]);
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{:?}...", &text[..end]),
        None => format!("{text:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(content: &str) -> Text<'_> {
        Text::new(Path::new("t.obj"), content.as_bytes()).unwrap()
    }

    #[test]
    fn numbers_of_real_exporters_are_read() {
        let forms = [
            ("2.", 2.0),
            ("+1", 1.0),
            ("2.e1", 20.0),
            ("1e-7", 1e-7),
            ("-.5", -0.5),
            ("1E+3", 1000.0),
            ("-0.000000", 0.0),
            ("00012.50", 12.5),
            ("5600000.5678", 5600000.5678),
            ("0.12345678901234567890123", 0.123_456_789_012_345_68),
            ("1e-400", 0.0),
            ("0e99999999999999999999", 0.0),
        ];
        for (form, value) in forms {
            assert_eq!(text(form).number().unwrap(), value, "{form}");
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for form in
            ["nan", "inf", "-inf", "NaN", ".", "-", "+", "1e", "1e+", "1.2.3", "1,5", "0x10", "1d5", "--1", "abc"]
        {
            let message = text(form).number().unwrap_err().to_string();
            assert_eq!(message, format!("t.obj: line 1: {form:?} is not a finite number"));
        }
        for form in ["1e19", "-1e400", "1e99999999999999999999"] {
            let message = text(form).number().unwrap_err().to_string();
            assert_eq!(message, format!("t.obj: line 1: {form:?} is too large; allowed: -1e18 to 1e18"));
        }
        assert_eq!(text(" # 1").number().unwrap_err().to_string(), "t.obj: line 1: a number is missing");
        let long = "x".repeat(1000);
        assert!(text(&long).number().unwrap_err().to_string().len() < 100);
    }

    #[test]
    fn corners_have_four_forms() {
        for (form, indices) in
            [("1", [1, 0, 0]), ("+1/-2", [1, -2, 0]), ("1//3", [1, 0, 3]), ("1/2/3", [1, 2, 3]), ("7//", [7, 0, 0])]
        {
            assert_eq!(text(form).corner().unwrap(), indices, "{form}");
        }
        for form in ["0", "/1", "1/0", "1/2/3/4", "a", "1.5", "1/b", "-", "1//0"] {
            assert!(text(form).corner().unwrap_err().to_string().contains("is not a face corner"), "{form}");
        }
        assert_eq!(text("99999999999999999999").corner().unwrap()[0], i64::MAX);
        assert_eq!(text("-99999999999999999999").corner().unwrap()[0], -i64::MAX);
    }

    #[test]
    fn statements_are_split_and_joined() {
        let mut text = text("\u{feff}# note \\\nv\t1 \\\r\n 2 # 3\r\n\n  o  a # b \\\n c \nlast\\");
        assert!(text.next_statement());
        assert_eq!((text.word(), text.line()), (&b"v"[..], 2));
        assert_eq!(text.number().unwrap(), 1.0);
        assert_eq!((text.number().unwrap(), text.line()), (2.0, 3));
        assert!(text.statement_is_over());
        text.skip_statement();
        assert!(text.next_statement());
        assert_eq!(text.word(), b"o");
        assert_eq!((text.rest(), text.line()), ("a # b   c".to_owned(), 6));
        assert!(text.next_statement());
        assert_eq!(text.word(), b"last\\");
        text.skip_statement();
        assert!(!text.next_statement());
    }

    #[test]
    fn utf16_is_refused() {
        for bytes in [&b"\xff\xfev\0"[..], b"\xfe\xff\0v", b"v\0 \0", b"\0v"] {
            let error = Text::new(Path::new("t.obj"), bytes).err().unwrap();
            assert_eq!(error.to_string(), "t.obj: the text is UTF-16; allowed: UTF-8 or ASCII");
        }
    }

    proptest! {
        #[test]
        fn printed_numbers_come_back(value in -1e18..1e18f64, places in 0..20usize) {
            for form in [format!("{value}"), format!("{value:e}"), format!("{value:.places$}")] {
                prop_assert_eq!(text(&form).number().unwrap(), form.parse::<f64>().unwrap(), "{}", form);
            }
        }

        #[test]
        fn small_numbers_come_back(bits in 0u64..(1e18f64).to_bits()) {
            let value = f64::from_bits(bits);
            prop_assert_eq!(text(&format!("-{value:e}")).number().unwrap(), -value);
        }

        #[test]
        fn any_bytes_terminate(bytes in prop::collection::vec(prop::sample::select(b"v1.e-+/\\\r\n\t #a\xff".to_vec()), 0..60)) {
            let Ok(mut text) = Text::new(Path::new("t.obj"), &bytes) else { return Ok(()) };
            while text.next_statement() {
                text.word();
                let _ = text.number();
                let _ = text.corner();
                text.rest();
            }
            prop_assert_eq!(text.at, text.bytes.len());
        }
    }
}
