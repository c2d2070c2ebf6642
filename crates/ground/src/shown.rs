//! How names, texts and numbers of any origin are shown to people: without control characters, and short enough to
//! read.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

/// Messages are shorter than this, bytes.
const LONGEST: usize = 500;
/// Longest name, bytes, shown whole in a message.
const LONGEST_NAME: usize = 160;
/// Numbers with more digits get an exponent.
const MOST_DIGITS: usize = 24;

/// `text` on one line: anything but letters, digits, symbols and spaces is escaped, such as `\n` or `\u{1b}`.
pub fn text(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unseen) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if is_unseen(c) { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    shown.into()
}

/// A file name as [`text()`]; bytes that are not UTF-8 as `\xff`.
pub fn path(path: &Path) -> String {
    let mut shown = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        shown.push_str(&text(chunk.valid()));
        for byte in chunk.invalid() {
            let _ = write!(shown, "\\x{byte:02x}");
        }
    }
    shown
}

/// A message: one line as [`text()`], of fewer than 500 bytes.
pub fn message(message: &str) -> String {
    cut(&text(message), LONGEST - 1).into_owned()
}

/// A name or value for a message; only the beginning of long ones.
pub fn name(name: &str) -> Cow<'_, str> {
    match text(name) {
        Cow::Borrowed(name) => cut(name, LONGEST_NAME),
        Cow::Owned(name) => cut(&name, LONGEST_NAME).into_owned().into(),
    }
}

/// An origin for a message; only the end of long ones: the file's own name.
pub fn origin(origin: &str) -> String {
    let shown = text(origin);
    let Some(start) = shown.len().checked_sub(LONGEST_NAME) else { return shown.into_owned() };
    format!("...{}", &shown[shown.ceil_char_boundary(start + 3)..])
}

/// `text` with exponents for numbers with too many digits: 1e300 has 301.
pub fn short_numbers(text: &str) -> Cow<'_, str> {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+');
    let bare = |word: &'_ str| -> Option<String> {
        let number = word.trim_matches(|c: char| "()[]`,;:".contains(c)).trim_end_matches('.');
        let is_long = number.len() > MOST_DIGITS && number.chars().all(is_part);
        let value: f64 = number.parse().ok().filter(|_| is_long)?;
        Some(word.replacen(number, &format!("{value:e}"), 1))
    };
    if !text.split(' ').any(|word| bare(word).is_some()) {
        return text.into();
    }
    let words: Vec<Cow<str>> = text.split(' ').map(|word| bare(word).map_or(word.into(), Cow::from)).collect();
    words.join(" ").into()
}

/// The beginning of `text`, at most `most` bytes.
fn cut(text: &str, most: usize) -> Cow<'_, str> {
    if text.len() <= most {
        return text.into();
    }
    format!("{}...", &text[..text.floor_char_boundary(most - 3)]).into()
}

/// Whether `c` controls a terminal, or reverses the text after it.
pub(crate) fn is_unseen(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The first names of a list, and the number of the others.
pub fn some_of(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let shown = names[..names.len().min(SHOWN)].iter().map(|text| name(text)).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// `1 triangle`, `2 triangles`.
pub fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminal_controls_are_escaped() {
        assert_eq!(text("caf\u{e9} \u{1f600} \\ \"a\""), "caf\u{e9} \u{1f600} \\ \"a\"");
        assert_eq!(text("a\nb\t\x1b[31m\u{7f}\u{9b}\u{202e}"), "a\\nb\\t\\u{1b}[31m\\u{7f}\\u{9b}\\u{202e}");
    }

    #[cfg(unix)]
    #[test]
    fn names_of_files_are_bytes() {
        use std::os::unix::ffi::OsStrExt as _;
        let shown = |bytes: &[u8]| path(Path::new(std::ffi::OsStr::from_bytes(bytes)));
        assert_eq!(shown(b"a/x\xff\xc3\n.las"), "a/x\\xff\\xc3\\n.las");
        assert_eq!(shown("a/\u{e9}.las".as_bytes()), "a/\u{e9}.las");
    }

    #[test]
    fn long_texts_are_cut_between_characters() {
        for character in ["x", "\u{e9}", "\u{1f600}", "\n"] {
            for length in [100, 159, 160, 161, 499, 500, 501, 10_000] {
                let long = character.repeat(length);
                assert!(message(&long).len() < LONGEST && name(&long).len() <= LONGEST_NAME);
                assert!(origin(&long).len() <= LONGEST_NAME);
            }
        }
        assert_eq!(message(&"x".repeat(499)), "x".repeat(499));
        assert!(message(&"x".repeat(500)).ends_with("x..."));
        assert!(origin(&format!("{}/scene.obj", "x".repeat(500))).ends_with("x/scene.obj"));
    }

    #[test]
    fn numbers_are_short() {
        let shown = |text: &str| short_numbers(text).into_owned();
        assert_eq!(
            shown(&format!("is {}; allowed: {} to {}", 1e300, -1e300, 1e-300)),
            "is 1e300; allowed: -1e300 to 1e-300"
        );
        assert_eq!(shown(&format!("`{:?}`, ({})", 1e15, f64::MAX)), "`1000000000000000.0`, (1.7976931348623157e308)");
        for same in [
            "is 0.30000000000000004",
            "1000000000000000000",
            "a/2024010112345678901234567.csv",
            "0.0011111111111111111",
            "...",
        ] {
            assert_eq!(shown(same), same);
        }
    }
}
