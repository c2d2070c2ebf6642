//! Files of a set, one by one and by folder.

use ground::error::{Error, Result};
use ground::write;
use std::fs;
use std::path::{Path, PathBuf};

/// Writes a file that appears under its name only when it is complete.
///
/// # Errors
/// I/O errors.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    let pending = write::Pending::create(path)?;
    write::bytes(pending.path(), bytes).map_err(|source| write::failed(path, source))?;
    pending.commit()
}

/// All files below `folder`, sorted by name, relative to `root`.
///
/// # Errors
/// I/O errors.
pub(super) fn files_below(root: &Path, folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        let failed = |source| Error::Io { path: folder.clone(), source };
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.is_dir() {
                open.push(path);
            } else if let Ok(relative) = path.strip_prefix(root) {
                files.push(relative.to_owned());
            }
        }
    }
    files.sort();
    Ok(files)
}
