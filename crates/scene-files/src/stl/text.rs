//! STL as text.

use super::Triangle;
use crate::number::decimal;
use ground::error::{Error, Result};
use model::LARGEST;
use std::path::Path;

/// Reads the text in `bytes` and passes each solid that has facets to `add`, with its name, which may be empty. Returns
/// whether the last solid was complete.
///
/// # Errors
/// An unexpected word; a number that is not finite; a file that ends in a facet or has none.
pub(super) fn read(path: &Path, bytes: &[u8], mut add: impl FnMut(&str, &[Triangle]) -> Result<()>) -> Result<bool> {
    let mut words = StlWords { bytes: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), at: 0, line: 1 };
    let (mut name, mut triangles) = (String::new(), Vec::new());
    let (mut in_facet, mut in_solid, mut found) = (false, false, false);
    let mut corners = Vec::new();
    loop {
        let word = words.next();
        let fault = |message: String| Error::parse(path, format!("line {}", words.line), message);
        match word.to_ascii_lowercase().as_slice() {
            b"facet" if !in_facet => (in_facet, found) = (true, true),
            // Redundant, as the corners define it; some programs write something other than numbers here.
            b"normal" if in_facet => (0..3).for_each(|_| _ = words.next()),
            b"outer" | b"loop" if in_facet => {}
            b"vertex" if in_facet => {
                corners.push([words.number(path)?, words.number(path)?, words.number(path)?]);
            }
            b"endloop" if in_facet => {
                let found = corners.len();
                let triangle = corners.as_slice().try_into();
                triangles.push(triangle.map_err(|_| fault(format!("a facet of {found} vertices; allowed: 3")))?);
                corners.clear();
            }
            b"endfacet" if in_facet && corners.is_empty() => in_facet = false,
            solid @ (b"solid" | b"endsolid" | b"") if !in_facet => {
                if !triangles.is_empty() {
                    add(&name, &triangles)?;
                    triangles.clear();
                }
                if solid.is_empty() {
                    if !found {
                        return Err(Error::parse(path, "", "the file holds no facet"));
                    }
                    return Ok(!in_solid);
                }
                in_solid = solid == b"solid";
                name = words.rest();
            }
            _ if in_facet && words.at == words.bytes.len() => {
                return Err(fault("the file is cut off in a facet".into()));
            }
            _ => {
                let shown = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
                let allowed =
                    if in_facet { "normal, outer loop, vertex, endloop, endfacet" } else { "facet, endsolid, solid" };
                return Err(fault(format!("unexpected {shown:?}; allowed: {allowed}")));
            }
        }
    }
}

/// The words of a text.
struct StlWords<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> StlWords<'a> {
    /// The next word; empty at the end.
    #[inline]
    fn next(&mut self) -> &'a [u8] {
        while let Some(byte) = self.bytes.get(self.at).filter(|byte| byte.is_ascii_whitespace()) {
            self.line += usize::from(*byte == b'\n');
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    /// The rest of the line.
    fn rest(&mut self) -> String {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| byte == b'\n' || byte == b'\r').unwrap_or(rest.len());
        self.at += length;
        String::from_utf8_lossy(&rest[..length]).trim().to_owned()
    }

    #[inline]
    fn number(&mut self, path: &Path) -> Result<f64> {
        let word = self.next();
        match decimal(word) {
            Some((value, length)) if length == word.len() && value.abs() <= LARGEST => Ok(value),
            _ => {
                let message = if word.is_empty() {
                    "the file is cut off in a facet".to_owned()
                } else {
                    let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
                    format!("{shown:?} is not a finite number from -1e18 to 1e18")
                };
                Err(Error::parse(path, format!("line {}", self.line), message))
            }
        }
    }
}
