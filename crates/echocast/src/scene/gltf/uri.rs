//! What a buffer's or image's URI leads to.

use std::borrow::Cow;
use std::path::Path;

/// Reads what `uri` names: a data URI, or a file relative to `folder` (`None`: files cannot be reached).
pub(super) fn load(uri: &str, folder: Option<&Path>) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        return data_uri(data);
    }
    let shown = shorten(uri);
    if uri.starts_with(['/', '\\']) || has_scheme(uri) {
        return Err(format!(
            "{shown:?} is not a relative path; allowed: a path relative to the scene file, or a data URI"
        ));
    }
    let Some(folder) = folder else {
        return Err(format!("{shown:?} is a file of its own, which data in memory cannot refer to"));
    };
    let path = folder.join(&*percent_decoded(uri));
    let unreadable = |reason: &dyn std::fmt::Display| format!("cannot read {}: {reason}", path.display());
    // Reading a pipe or device could wait for ever.
    if !std::fs::metadata(&path).map_err(|error| unreadable(&error))?.is_file() {
        return Err(unreadable(&"not a file"));
    }
    std::fs::read(&path).map_err(|error| unreadable(&error))
}

/// The first characters of `text`, for messages.
fn shorten(text: &str) -> Cow<'_, str> {
    const SHOWN: usize = 80;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]).into(),
        None => text.into(),
    }
}

/// Whether `uri` begins with a scheme (RFC 3986, 3.1), such as `http:` or a drive letter.
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// `%20` and the like replaced; what is no valid escape stays as it is.
fn percent_decoded(uri: &str) -> Cow<'_, str> {
    if !uri.contains('%') {
        return uri.into();
    }
    String::from_utf8(percent_decoded_bytes(uri.as_bytes())).map_or(uri.into(), Cow::from)
}

fn percent_decoded_bytes(text: &[u8]) -> Vec<u8> {
    let digit = |byte: Option<&u8>| byte.and_then(|b| (*b as char).to_digit(16));
    let mut decoded = Vec::with_capacity(text.len());
    let mut at = 0;
    while let Some(&byte) = text.get(at) {
        match (byte, digit(text.get(at + 1)), digit(text.get(at + 2))) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                at += 3;
            }
            _ => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    decoded
}

/// Content of a data URI (RFC 2397), given without `data:`.
fn data_uri(uri: &str) -> Result<Vec<u8>, String> {
    let (kind, data) = uri.split_once(',').ok_or("a data URI has no comma before its data")?;
    if kind.ends_with(";base64") { base64(data.as_bytes()) } else { Ok(percent_decoded_bytes(data.as_bytes())) }
}

/// Decodes base64 (RFC 4648, 4), with or without padding.
fn base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let end = text.iter().rposition(|&byte| byte != b'=').map_or(0, |last| last + 1);
    let mut decoded = Vec::with_capacity(end / 4 * 3 + 2);
    for group in text[..end].chunks(4) {
        let mut bits = 0;
        for &byte in group {
            let value = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return Err(format!("a data URI holds {:?}, which is not base64", byte as char)),
            };
            bits = bits << 6 | u32::from(value);
        }
        // Four characters hold three bytes, three hold two, two hold one.
        let bytes = (bits << (6 * (4 - group.len()))).to_be_bytes();
        match group.len() {
            1 => return Err("the base64 of a data URI is cut off".into()),
            length => decoded.extend_from_slice(&bytes[1..length]),
        }
    }
    Ok(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded_with_and_without_padding() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob"), ("Zm9vYmFy", "foobar")]
        {
            assert_eq!(base64(text.as_bytes()).unwrap(), bytes.as_bytes(), "RFC 4648, 10: {text}");
        }
        assert_eq!(base64(b"+/+/").unwrap(), [0xfb, 0xff, 0xbf]);
        assert!(base64(b"Zm9vY").unwrap_err().contains("cut off"));
        assert!(base64(b"Zm 9").unwrap_err().contains("' '"));
    }

    #[test]
    fn uris_are_told_apart() {
        assert_eq!(load("data:application/octet-stream;base64,AAEC", None).unwrap(), [0, 1, 2]);
        assert_eq!(load("data:,a%20b", None).unwrap(), b"a b");
        assert!(load("data:base64", None).unwrap_err().contains("comma"));
        for absolute in ["/etc/passwd", "\\\\host\\x", "http://x/y.bin", "file:///x", "C:\\x.bin"] {
            assert!(load(absolute, Some(Path::new("."))).unwrap_err().contains("not a relative path"), "{absolute}");
        }
        assert_eq!(percent_decoded("my%20ch%c3%A4ir 100%.bin"), "my chäir 100%.bin");
        assert_eq!(percent_decoded("%ff"), "%ff", "no UTF-8: taken literally");
        assert!(load("x", None).unwrap_err().contains("in memory"));
        assert!(load(".", Some(Path::new("."))).unwrap_err().contains("not a file"));
    }
}
