//! Files that appear only when they are complete.

use crate::error::{Error, Result};
use crate::shown;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// How the names of this process's unfinished files begin: a program that is interrupted may remove them from the
/// folders it writes to.
pub fn unfinished_prefix() -> String {
    format!(".echocast-{}-", std::process::id())
}

/// A file being written beside its final name. Dropped without [`Pending::commit`] it leaves nothing behind, and an
/// older file of that name stays as it was.
#[derive(Debug)]
pub(crate) struct Pending {
    temporary: TempPath,
    target: PathBuf,
}

impl Pending {
    /// An empty file in the folder of `target`, with the permissions of any newly created file.
    ///
    /// # Errors
    /// When the folder is missing or not writable, or `target` is something else than a file: a folder, a device.
    pub(crate) fn create(target: &Path) -> Result<Self> {
        // A link stays, what it points to is replaced.
        let target = fs::canonicalize(target).unwrap_or_else(|_| target.to_owned());
        if fs::metadata(&target).is_ok_and(|what| !what.is_file()) {
            return Err(Error::invalid(
                "output file",
                shown::path(&target),
                "the name of a file, not of a folder or device",
            ));
        }
        let file = tempfile::Builder::new()
            .prefix(&unfinished_prefix())
            // Not tempfile's own way of making files, which only their owner may read.
            .make_in(folder(&target), |path| File::create_new(path))
            .map_err(|source| Error::io(&target, source))?;
        Ok(Pending { temporary: file.into_temp_path(), target })
    }

    /// Where to write.
    pub(crate) fn path(&self) -> &Path {
        &self.temporary
    }

    /// The name it will have.
    #[cfg(feature = "hdf5")]
    pub(super) fn target(&self) -> &Path {
        &self.target
    }

    /// Gives the file its name, in place of an older one.
    ///
    /// # Errors
    /// The system's.
    pub(crate) fn commit(self) -> Result<()> {
        self.temporary.persist(&self.target).map_err(|e| Error::io(&self.target, e.error))
    }
}

/// Folder of the file at `path`.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_older_file_stays_until_the_new_one_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.csv");
        fs::write(&path, "old").unwrap();
        let pending = Pending::create(&path).unwrap();
        fs::write(pending.path(), "half").unwrap();
        drop(pending);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        let pending = Pending::create(&path).unwrap();
        fs::write(pending.path(), "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        pending.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_files_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Pending::create(folder.path()).is_err());
        let error = Pending::create(&folder.path().join("missing/cloud.las")).unwrap_err().to_string();
        assert!(error.contains("missing/cloud.las: No such file") && !error.contains(".echocast-"), "{error}");
        assert!(Pending::create(Path::new("/dev/null")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_and_permissions_are_those_of_a_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [plain, file, link] = ["plain", "file", "link"].map(|name| folder.path().join(name));
        fs::write(&plain, "").unwrap();
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        let pending = Pending::create(&link).unwrap();
        fs::write(pending.path(), "new").unwrap();
        pending.commit().unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&file), mode(&plain));
    }
}
