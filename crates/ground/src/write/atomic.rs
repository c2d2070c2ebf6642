//! Files that appear only when they are complete.

use super::unfinished::{Temporary, Unfinished, failed};
use crate::error::{Error, Result};
use crate::shown;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// A file being written next to its final name. Dropped without [`Pending::commit`], it leaves nothing behind, and an
/// older file of that name stays as it was.
#[derive(Debug)]
pub struct Pending {
    temporary: Temporary,
    target: PathBuf,
}

impl Pending {
    /// An empty file in the folder of `target`, with the permissions of any newly created file.
    ///
    /// # Errors
    /// The folder is missing or not writable, or `target` is not a file but a folder or a device.
    pub fn create(target: &Path) -> Result<Self> {
        // A link is kept; what it points to is replaced.
        let target = fs::canonicalize(target).unwrap_or_else(|_| target.to_owned());
        if fs::metadata(&target).is_ok_and(|what| !what.is_file()) {
            return Err(Error::invalid(
                "output file",
                shown::path(&target),
                "the name of a file, not of a folder or device",
            ));
        }
        // Not in tempfile's own way, which makes files that only their owner may read.
        let made = Unfinished::lock().make(folder(&target), |path| File::create_new(path).map(drop));
        let temporary = made.map_err(|source| failed(&target, source))?;
        Ok(Pending { temporary, target })
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        self.temporary.path()
    }

    /// Its final name.
    #[cfg(feature = "hdf5")]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Gives the file its final name, replacing an older file, once its content is on the disk: after a power cut there
    /// is either the old file or the new one.
    ///
    /// # Errors
    /// The system's errors; [`Error::Cancelled`] if writing files has been cancelled.
    pub fn commit(self) -> Result<()> {
        commit_all(vec![self])
    }

    /// Waits until its content is on the disk.
    fn sync(&self) -> Result<()> {
        let file = File::options().write(true).open(self.path());
        file.and_then(|file| file.sync_all()).map_err(|source| failed(&self.target, source))
    }
}

/// Gives files that belong together their final names, one after the other; all or none. A process killed in between
/// leaves the first files with new and the others with old content: the file that readers wait for comes last.
///
/// # Errors
/// As [`Pending::commit`]; all older files are then unchanged.
pub fn commit_all(mut files: Vec<Pending>) -> Result<()> {
    files.iter().try_for_each(Pending::sync)?;
    // Older files whose names have been taken over.
    let mut olds: Vec<Option<Temporary>> = Vec::new();
    let mut unfinished = Unfinished::lock();
    let count = files.len();
    for index in 0..count {
        let Pending { temporary, target } = &mut files[index];
        // After the last one nothing can fail.
        let old = if index + 1 < count { keep(target, &mut unfinished) } else { Ok(None) };
        let renamed = old.and_then(|old| {
            olds.push(old);
            unfinished.rename(temporary, target)
        });
        if let Err(source) = renamed {
            let error = failed(target, source);
            for (place, (Pending { target, .. }, old)) in files.iter().zip(&olds).enumerate() {
                // A failure to give an old file its name back cannot be reported in addition.
                let _ = match old {
                    Some(old) => fs::rename(old.path(), target),
                    None if place < index => fs::remove_file(target),
                    None => Ok(()),
                };
            }
            return Err(error);
        }
    }
    Ok(())
}

/// A second name for the file `target`, if it exists.
fn keep(target: &Path, unfinished: &mut Unfinished) -> io::Result<Option<Temporary>> {
    let kept = unfinished.make(folder(target), |path| match fs::hard_link(target, path) {
        // File systems without links, files of other users.
        Err(error) if !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::AlreadyExists) => {
            fs::rename(target, path)
        }
        linked => linked,
    });
    match kept {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        kept => kept.map(Some),
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
    fn files_that_belong_together_change_together() {
        let folder = tempfile::tempdir().unwrap();
        let [names, cloud] = ["a.labels.json", "a.csv"].map(|name| folder.path().join(name));
        let begin = || {
            [&names, &cloud].map(|path| {
                let pending = Pending::create(path).unwrap();
                fs::write(pending.path(), "new").unwrap();
                pending
            })
        };
        for old in [Some("old"), None] {
            fs::remove_file(&cloud).unwrap_or_default();
            match old {
                Some(old) => fs::write(&names, old).unwrap(),
                None => fs::remove_file(&names).unwrap(),
            }
            let files = begin();
            // In place of the second, a folder appears, which no file can replace.
            fs::create_dir(&cloud).unwrap();
            let error = commit_all(files.into()).unwrap_err().to_string();
            assert!(error.contains("a.csv: "), "{error}");
            assert_eq!(fs::read_to_string(&names).ok().as_deref(), old);
            fs::remove_dir(&cloud).unwrap();
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), usize::from(old.is_some()));
            commit_all(begin().into()).unwrap();
            assert!([&names, &cloud].iter().all(|path| fs::read_to_string(path).unwrap() == "new"));
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        }
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
