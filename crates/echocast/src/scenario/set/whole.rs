//! What is made of all samples of a set together.

use super::folder::Origin;
use super::manifest::{Entry, FileEntry};
use super::splits::Splits;
use super::style::numbered;
use crate::export::{self, Pending, Sink};
use crate::ground::error::{Error, Result};
use crate::ground::shown;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A set whose samples are all there.
pub(super) struct Whole<'w> {
    /// Its folder.
    pub root: &'w Path,
    /// Its samples by number, those that have failed among them.
    pub entries: BTreeMap<u64, Entry>,
    /// The parts that it is in.
    pub splits: Splits,
    seed: u64,
    /// Files of the whole set, relative to `root`.
    files: BTreeSet<PathBuf>,
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
        Whole { root, entries, splits, seed, files: BTreeSet::new() }
    }

    /// The samples that were made, rising.
    pub fn samples(&self) -> Vec<u64> {
        self.entries.values().filter(|entry| entry.error.is_none()).map(|entry| entry.sample).collect()
    }

    /// The parts of the set by name, each with its samples, rising. A set that is not divided is all `train`.
    pub fn parts(&self) -> Vec<(String, Vec<u64>)> {
        let mut parts: Vec<(String, Vec<u64>)> = self.splits.names().map(|name| (name.to_owned(), vec![])).collect();
        for sample in self.samples() {
            let name = self.splits.of(self.seed, sample);
            parts.iter_mut().filter(|(known, _)| known == name).for_each(|(_, samples)| samples.push(sample));
        }
        parts
    }

    /// Writes which samples are in which part, a file for each: `splits/train.txt`.
    ///
    /// # Errors
    /// The system's.
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
    /// The system's.
    pub fn write(
        &mut self,
        path: impl AsRef<Path>,
        write: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
    ) -> Result<()> {
        let whole = self.root.join(&path);
        if let Some(folder) = whole.parent() {
            fs::create_dir_all(folder).map_err(|source| Error::Io { path: folder.to_owned(), source })?;
        }
        let failed = |source| export::failed(&whole, source);
        let pending = Pending::create(&whole)?;
        let mut out = BufWriter::with_capacity(1 << 16, Sink::create(pending.path()).map_err(failed)?);
        write(&mut out).map_err(failed)?;
        out.into_inner().map_err(|error| failed(error.into_error()))?.finish().map_err(failed)?;
        pending.commit()?;
        self.files.insert(path.as_ref().to_owned());
        Ok(())
    }

    /// The files that were written, with their digests; files of an older whole that are no more are removed.
    ///
    /// # Errors
    /// The system's.
    pub fn finish(&self) -> Result<()> {
        let files = self.files.iter().map(|path| FileEntry::of(self.root, path)).collect::<Result<Vec<_>>>()?;
        for old in read(self.root)?.iter().filter(|old| !self.files.contains(Path::new(&old.path))) {
            let path = self.root.join(&old.path);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(Error::Io { path, source: error }),
                _ => {}
            }
        }
        let text = serde_json::to_string_pretty(&files).map_err(|error| Error::Internal(error.to_string()))? + "\n";
        super::folder::replace(&self.root.join(FILES), text.as_bytes())
    }
}

/// The files of the whole set, with sizes and digests.
const FILES: &str = "files.json";

/// Those files of the set in `root`; none before it was complete.
///
/// # Errors
/// A file that is not ours, or names one elsewhere.
pub(super) fn read(root: &Path) -> Result<Vec<FileEntry>> {
    let path = root.join(FILES);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let bytes = crate::read::bytes(&path, crate::read::Limit::SCENE)?;
    let wrong = |message: String| Error::parse(&path, "", message);
    let files: Vec<FileEntry> = serde_json::from_slice(&bytes).map_err(|error| wrong(error.to_string()))?;
    let inside = |path: &Path| path.components().all(|part| matches!(part, std::path::Component::Normal(_)));
    match files.iter().find(|file| !inside(Path::new(&file.path))) {
        Some(file) => Err(wrong(format!("names {}, which is not in the set", shown::text(&file.path)))),
        None => Ok(files),
    }
}
