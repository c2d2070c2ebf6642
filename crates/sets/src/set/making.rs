//! The folders in which samples are made, until they are complete.

use super::files::files_below;
use super::lock;
use super::names::{numbered, sample_folder};
use super::origin::Origin;
use super::style::Style;
use ground::error::{Error, Result};
use ground::write;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Suffix of the names of folders in which samples are made.
const UNFINISHED: &str = ".unfinished";

/// A folder for the files of a sample while it is made, with a name that no other process uses; it is removed with any
/// remaining files.
#[derive(Debug)]
pub(super) struct Making(PathBuf);

impl Making {
    /// Creates the folder for `sample`, in the folder `name` of a style.
    ///
    /// # Errors
    /// I/O errors.
    pub fn begin(root: &Path, name: &str, sample: u64) -> Result<Making> {
        let folder = root.join(name);
        let prefix = format!(".{}-", numbered(sample));
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(UNFINISHED).rand_bytes(12);
        // Not with tempfile's own function, which creates folders that only their owner may read.
        let made = builder.make_in(&folder, |path| fs::create_dir(path));
        let kept = made.and_then(|made| made.into_temp_path().keep().map_err(|error| error.error));
        kept.map(Making).map_err(|source| Error::Io { path: folder, source })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Making {
    fn drop(&mut self) {
        // What cannot be removed now is removed when the set is completed.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Moves the files made for `sample` to their place in the folder of `style`; returns them, relative to `root`.
///
/// # Errors
/// I/O errors.
pub(super) fn settle(root: &Path, style: &dyn Style, sample: u64, made: Making) -> Result<Vec<PathBuf>> {
    let name = style.root();
    let unfinished = made.path();
    let rename =
        |from: &Path, to: &Path| fs::rename(from, to).map_err(|source| Error::Io { path: to.to_owned(), source });
    if style.folder_per_sample() {
        let place = root.join(sample_folder(name, sample));
        let _ = fs::remove_dir_all(&place);
        rename(unfinished, &place)?;
        return files_below(root, &place);
    }
    let mut files = files_below(unfinished, unfinished)?;
    for file in &mut files {
        let place = root.join(name).join(&*file);
        if let Some(folder) = place.parent() {
            fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.to_owned(), source })?;
        }
        rename(&unfinished.join(&*file), &place)?;
        *file = Path::new(name).join(&*file);
    }
    Ok(files)
}

/// Removes what killed runs have left half written, in a set that no other run writes to.
///
/// # Errors
/// I/O errors.
pub(super) fn sweep(root: &Path, origin: &Origin) -> Result<()> {
    lock::sweep(root);
    let mut open: Vec<PathBuf> = origin.roots.iter().map(|name| root.join(name)).collect();
    open.extend([root.to_owned(), root.join("splits")]);
    while let Some(folder) = open.pop() {
        let failed = |source| Error::Io { path: folder.clone(), source };
        let entries = match fs::read_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            entries => entries.map_err(failed)?,
        };
        for entry in entries {
            let path = entry.map_err(failed)?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with(write::PREFIX) {
                fs::remove_file(&path).map_err(failed)?;
            } else if name.starts_with('.') && name.ends_with(UNFINISHED) {
                fs::remove_dir_all(&path).map_err(failed)?;
            } else if folder != root && !name.bytes().all(|byte| byte.is_ascii_digit()) && path.is_dir() {
                // Folders of samples appear only when complete.
                open.push(path);
            }
        }
    }
    Ok(())
}
