//! Reading YAML: the only file that knows which crate does it.

use crate::error::{Error, Result};
use serde::de::DeserializeOwned;
use std::path::Path;

/// Reads the YAML file at `path`.
///
/// # Errors
/// A missing file; a syntax error, unknown key, wrong type or missing key with its line.
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
    from_str(&path.display().to_string(), &text)
}

/// Reads YAML `text` that came from `origin` (a file name, or a word for messages).
///
/// # Errors
/// As [`load`].
pub fn from_str<T: DeserializeOwned>(origin: &str, text: &str) -> Result<T> {
    serde_yaml::from_str(text).map_err(|e| Error::parse(origin, "", e.to_string()))
}
