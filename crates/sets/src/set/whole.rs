//! Files made from all samples of a set together.

use super::files::{files_below, replace};
use super::manifest::{self, Entry, FileEntry};
use super::names::numbered;
use super::origin::Origin;
use crate::splits::Splits;
use ground::error::{Error, Result};
use ground::shown;
use ground::write::{self, Pending, Sink};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A set whose samples are all present.
pub(super) struct Whole<'w> {
    /// Its folder.
    pub root: &'w Path,
    /// Its samples by number, including failed ones.
    pub entries: BTreeMap<u64, Entry>,
    /// Its splits.
    pub splits: Splits,
    /// Its licence, as given in the scenario.
    pub licence: Option<String>,
    seed: u64,
    /// Files of the whole set, relative to `root`.
    files: BTreeSet<PathBuf>,
    /// Files that are not needed once the set is complete.
    unneeded: Vec<PathBuf>,
}

impl<'w> Whole<'w> {
    pub fn new(
        root: &'w Path,
        origin: &'w Origin,
        mut entries: BTreeMap<u64, Entry>,
        splits: Splits,
        seed: u64,
    ) -> Self {
        entries.split_off(&origin.samples);
        Whole { root, entries, splits, licence: None, seed, files: BTreeSet::new(), unneeded: Vec::new() }
    }

    /// The samples that were made, in ascending order.
    pub fn samples(&self) -> Vec<u64> {
        self.entries.values().filter(|entry| entry.error.is_none()).map(|entry| entry.sample).collect()
    }

    /// The splits of the set by name, each with its samples that were made, in ascending order. A set that is not split
    /// is all `train`.
    pub fn parts(&self) -> Vec<(String, Vec<u64>)> {
        self.splits.names().map(|name| (name.to_owned(), self.of_part(name, self.samples()))).collect()
    }

    /// All samples of a split in ascending order, including failed ones.
    pub fn numbers_in(&self, part: &str) -> Vec<u64> {
        self.of_part(part, self.entries.keys().copied().collect())
    }

    fn of_part(&self, part: &str, mut samples: Vec<u64>) -> Vec<u64> {
        samples.retain(|sample| self.splits.of(self.seed, *sample) == part);
        samples
    }

    /// The files that are joined: those of `samples`, which were made, at the paths `of`.
    ///
    /// # Errors
    /// A sample without that file.
    pub fn pieces(&self, samples: &[u64], of: impl Fn(u64) -> PathBuf) -> Result<Vec<FileEntry>> {
        let piece = |&sample: &u64| {
            let path = shown::path(&of(sample));
            let found = self.entries[&sample].files.iter().find(|file| file.path == path);
            found.cloned().ok_or_else(|| damaged(format!("sample {sample} has no {path}")))
        };
        samples.iter().map(piece).collect()
    }

    /// The text of a piece.
    ///
    /// # Errors
    /// A piece that is missing or changed, as a sentence.
    pub fn text(root: &Path, piece: &FileEntry) -> io::Result<String> {
        let mut bytes = Vec::new();
        piece.copy(root, &mut bytes)?;
        String::from_utf8(bytes).map_err(|_| io::Error::other(format!("{} is not UTF-8", piece.path)))
    }

    /// Writes the lists of samples, one file for each split: `splits/train.txt`.
    ///
    /// # Errors
    /// I/O errors.
    pub fn write_splits(&mut self) -> Result<()> {
        if self.splits.is_empty() {
            return Ok(());
        }
        for (name, samples) in self.parts() {
            let lines: String = samples.into_iter().map(|sample| numbered(sample) + "\n").collect();
            self.write(format!("splits/{name}.txt"), &mut |out| out.write_all(lines.as_bytes()))?;
        }
        Ok(())
    }

    /// Writes a file of the whole set: `path`, relative to the set's folder, appears when it is complete.
    ///
    /// # Errors
    /// I/O errors.
    pub fn write(&mut self, path: impl AsRef<Path>, write: WriteAll) -> Result<()> {
        self.prepare(path.as_ref(), write)?.commit()
    }

    /// [`Whole::write`], but the file does not appear yet.
    ///
    /// # Errors
    /// I/O errors.
    pub fn prepare(&mut self, path: &Path, write: WriteAll) -> Result<Pending> {
        let whole = self.root.join(path);
        if let Some(folder) = whole.parent() {
            fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.to_owned(), source })?;
        }
        let failed = |source| write::failed(&whole, source);
        let pending = Pending::create(&whole)?;
        let mut out = BufWriter::with_capacity(1 << 16, Sink::create(pending.path()).map_err(failed)?);
        write(&mut out).map_err(failed)?;
        out.into_inner().map_err(|error| failed(error.into_error()))?.finish().map_err(failed)?;
        self.keep(path);
        Ok(pending)
    }

    /// Notes that a file of the whole set is up to date.
    pub fn keep(&mut self, path: &Path) {
        self.files.insert(path.to_owned());
    }

    /// Marks the files in `folder`, relative to the set's, that belong to no sample, to be removed in the end.
    ///
    /// # Errors
    /// I/O errors.
    pub fn drop_unlisted(&mut self, folder: &Path) -> Result<()> {
        let listed: BTreeSet<&str> =
            self.entries.values().flat_map(|entry| &entry.files).map(|file| file.path.as_str()).collect();
        let there = files_below(self.root, &self.root.join(folder))?;
        self.unneeded.extend(there.into_iter().filter(|file| !listed.contains(shown::path(file).as_str())));
        Ok(())
    }

    /// Removes the files that are not needed, now that all else is written.
    ///
    /// # Errors
    /// I/O errors.
    pub fn clear(&self) -> Result<()> {
        self.unneeded.iter().try_for_each(|file| remove(&self.root.join(file)))
    }

    /// Writes the list of files of the whole set, with their digests; files of an older list that are not in it are
    /// removed.
    ///
    /// # Errors
    /// I/O errors.
    pub fn finish(&self) -> Result<()> {
        let files = self.files.iter().map(|path| FileEntry::of(self.root, path)).collect::<Result<Vec<_>>>()?;
        for old in read(self.root)?.iter().filter(|old| !self.files.contains(Path::new(&old.path))) {
            remove(&self.root.join(&old.path))?;
        }
        let text = serde_json::to_string_pretty(&files).map_err(|error| Error::Internal(error.to_string()))? + "\n";
        replace(&self.root.join(FILES), text.as_bytes())
    }
}

/// The error for a set with a file that has changed since it was written.
pub(super) fn damaged(fault: String) -> Error {
    Error::invalid("the set", format!("damaged: {fault}"), "a set as written; `echocast run --resume` repairs it")
}

/// Writes the contents of a file.
type WriteAll<'f> = &'f mut dyn FnMut(&mut dyn Write) -> io::Result<()>;

/// Removes a file, if it exists.
fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => Err(Error::Io { path: path.to_owned(), source }),
        _ => Ok(()),
    }
}

/// The files of the whole set, with sizes and digests.
const FILES: &str = "files.json";

/// The listed files of the set in `root`; none before it was complete.
///
/// # Errors
/// An invalid list, or one that names a file outside the set.
pub(super) fn read(root: &Path) -> Result<Vec<FileEntry>> {
    let path = root.join(FILES);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let bytes = ground::read::bytes(&path, ground::read::Limit::SCENE)?;
    let files: Vec<FileEntry> =
        serde_json::from_slice(&bytes).map_err(|error| Error::parse(&path, "", error.to_string()))?;
    match files.iter().find(|file| !file.is_inside()) {
        Some(file) => Err(manifest::elsewhere(&path, file)),
        None => Ok(files),
    }
}
