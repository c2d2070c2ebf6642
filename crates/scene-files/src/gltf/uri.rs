//! Resolves the URIs of buffers and images.

use crate::{inside, outside};
use ground::read::{self, Limit};
use ground::shown;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The files that URIs may refer to.
#[derive(Clone, Copy)]
pub(super) struct UriBase<'a> {
    /// Base of relative paths; `None`: files cannot be reached.
    pub folder: Option<&'a Path>,
    /// Whether they may leave that folder.
    pub allow_outside: bool,
}

impl UriBase<'_> {
    /// Reads what `uri` names: a data URI, or a file of at most `limit`.
    pub fn load(self, uri: &str, limit: Limit) -> Result<Vec<u8>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            return data_uri(data);
        }
        let path = self.path(uri)?;
        read::bytes(&path, limit).map_err(|error| format!("cannot read {error}"))
    }

    /// The file that `uri` refers to.
    fn path(self, uri: &str) -> Result<PathBuf, String> {
        let Some(folder) = self.folder else {
            return Err(format!("{:?} is a file of its own, which data in memory cannot refer to", shown::name(uri)));
        };
        let file = uri.strip_prefix("file://").map(|file| file.strip_prefix("localhost").unwrap_or(file));
        let name = match file {
            Some(file) if file.starts_with('/') => file,
            _ if has_scheme(uri) => {
                return Err(format!("{:?} is not a path; allowed: a file, or a data URI", shown::name(uri)));
            }
            _ => uri,
        };
        // Escapes may disguise a path, so it is decoded before the check.
        let name = percent_decoded(name);
        let path = folder.join(&*name);
        match inside(folder, &path).filter(|_| !name.starts_with(['/', '\\'])) {
            Some(path) => Ok(path),
            None if self.allow_outside => Ok(path),
            None => Err(outside(uri)),
        }
    }
}

/// Whether `uri` begins with a scheme (RFC 3986, 3.1), such as `http:` or a drive letter.
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// Replaces `%20` and the like; invalid escapes stay as they are.
pub(crate) fn percent_decoded(uri: &str) -> Cow<'_, str> {
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
    fn uris_are_distinguished() {
        let no_folder = UriBase { folder: None, allow_outside: false };
        assert_eq!(no_folder.load("data:application/octet-stream;base64,AAEC", Limit::SCENE).unwrap(), [0, 1, 2]);
        assert_eq!(no_folder.load("data:,a%20b", Limit::SCENE).unwrap(), b"a b");
        assert!(no_folder.load("data:base64", Limit::SCENE).unwrap_err().contains("comma"));
        assert!(no_folder.load("x", Limit::SCENE).unwrap_err().contains("in memory"));
        assert_eq!(percent_decoded("my%20ch%c3%A4ir 100%.bin"), "my chäir 100%.bin");
        assert_eq!(percent_decoded("%ff"), "%ff", "no UTF-8: taken literally");
        let here = UriBase { folder: Some(Path::new(".")), allow_outside: true };
        assert_eq!(here.load("src", Limit::SCENE).unwrap_err(), "cannot read ./src: is a directory");
        for elsewhere in ["http://x/y.bin", "file://host/x.bin", "C:\\x.bin"] {
            assert!(here.load(elsewhere, Limit::SCENE).unwrap_err().contains("is not a path"), "{elsewhere}");
        }
    }

    #[test]
    fn paths_stay_in_the_folder_unless_they_may_leave_it() {
        let files = |allow_outside| UriBase { folder: Some(Path::new("scenes/a")), allow_outside };
        for uri in [
            "/etc/passwd",
            "%2Fetc%2Fpasswd",
            "file:///etc/passwd",
            "file://localhost/etc/passwd",
            "../b.bin",
            "%2e%2e/b.bin",
            "x/../../b.bin",
            "x/..%2f..%2Fb.bin",
            "\\\\host\\x",
            "%5c%5chost%5cx",
        ] {
            let error = files(false).load(uri, Limit::SCENE).unwrap_err();
            assert!(
                error.contains("leads out of the folder of the scene") && error.contains("--allow"),
                "{uri}: {error}"
            );
        }
        assert_eq!(files(true).path("file:///etc/passwd").unwrap(), Path::new("/etc/passwd"));
        assert_eq!(files(true).path("../b.bin").unwrap(), Path::new("scenes/a/../b.bin"));
        for allow_outside in [false, true] {
            for uri in ["b.bin", "./b.bin", "x/../b.bin", "x/y/../../b.bin", "%62.bin"] {
                assert_eq!(files(allow_outside).path(uri).unwrap(), Path::new("scenes/a/b.bin"), "{uri}");
            }
        }
        // The folder of a bare file name is the empty path.
        let here = UriBase { folder: Some(Path::new("")), allow_outside: false };
        assert_eq!(here.path("x/../b.bin").unwrap(), Path::new("b.bin"));
        assert!(here.path("/etc/passwd").is_err() && here.path("..").is_err());
    }
}
