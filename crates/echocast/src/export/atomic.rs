//! Files that appear only when they are complete.

use crate::error::{Error, Result};
use std::path::Path;

/// Lets `write` fill a file beside `path`, then renames it to `path`; on failure nothing is left and
/// an older file is untouched.
///
/// # Errors
/// Those of `write`, or the system's.
pub fn replace(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let temporary = tempfile::Builder::new()
        .prefix(".echocast-")
        .tempfile_in(folder)
        .map_err(|source| Error::io(path, source))?
        .into_temp_path();
    write(&temporary)?;
    temporary.persist(path).map_err(|e| Error::io(path, e.error))
}
