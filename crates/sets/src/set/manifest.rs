//! Contents of a set, sample by sample.

use super::files::replace;
use super::names::numbered;
use ground::error::{Error, Result};
use ground::shown;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, ErrorKind, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

/// A sample of a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Entry {
    /// Its number.
    pub sample: u64,
    /// Its files, by name; empty if it has failed.
    pub files: Vec<FileEntry>,
    /// Why it has failed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error: Option<String>,
    /// Number of points of all its clouds.
    pub points: u64,
    /// Number of points of each category.
    pub categories: BTreeMap<String, u64>,
    /// Number of empty clouds and images, by sensor.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub empty: BTreeMap<String, u64>,
    /// Number of points by range, in steps of 10 m; the last counts all from 500 m on.
    pub ranges: Vec<u64>,
    /// Warnings.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub warnings: Vec<String>,
}

/// A file of a sample.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FileEntry {
    /// Its path in the set's folder.
    pub path: String,
    /// Its offset in that file, bytes, if it is only a part of it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub offset: Option<u64>,
    /// Its length, bytes.
    pub bytes: u64,
    /// SHA-256 of its contents, in hexadecimal digits.
    pub sha256: String,
}

/// Width of the steps of ranges, m.
pub(super) const RANGE_STEP_M: f64 = 10.0;

/// Ranges from here on are counted together, m.
pub(super) const FARTHEST_M: f64 = 500.0;

impl Entry {
    /// A sample that has failed.
    pub(super) fn failed(sample: u64, error: &Error) -> Entry {
        Entry {
            sample,
            files: Vec::new(),
            error: Some(error.to_string()),
            points: 0,
            categories: BTreeMap::new(),
            empty: BTreeMap::new(),
            ranges: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

impl FileEntry {
    /// The file at `path` in the set's folder `root`.
    ///
    /// # Errors
    /// I/O errors.
    pub(super) fn of(root: &Path, path: &Path) -> Result<FileEntry> {
        let (bytes, sha256) = digest(&root.join(path))?;
        Ok(FileEntry { path: shown::path(path), offset: None, bytes, sha256 })
    }

    /// Its contents, from the folder `root`.
    fn open(&self, root: &Path) -> io::Result<impl io::Read> {
        let mut file = File::open(root.join(&self.path))?;
        file.seek(SeekFrom::Start(self.offset.unwrap_or(0)))?;
        Ok(file.take(self.bytes))
    }

    /// What is wrong with the file in the folder `root`, if anything is.
    pub(super) fn fault(&self, root: &Path) -> Option<String> {
        self.copy(root, &mut io::sink()).err().map(|error| error.to_string())
    }

    /// Copies its contents from the folder `root` to `out`.
    ///
    /// # Errors
    /// Those of `out`; contents that have changed since they were written, as a sentence.
    pub(super) fn copy(&self, root: &Path, out: &mut dyn io::Write) -> io::Result<()> {
        let wrong = |message: String| io::Error::other(message);
        let path = root.join(&self.path);
        match (fs::metadata(&path), self.offset) {
            (Err(error), _) if error.kind() != ErrorKind::NotFound => {
                return Err(wrong(Error::Io { path, source: error }.to_string()));
            }
            (Err(_), _) => return Err(wrong(format!("{} is missing", self.path))),
            (Ok(found), _) if !found.is_file() => return Err(wrong(format!("{} is not a file", self.path))),
            (Ok(found), None) if found.len() != self.bytes => {
                return Err(wrong(format!("{} has {} bytes instead of {}", self.path, found.len(), self.bytes)));
            }
            _ => {}
        }
        let file = self.open(root).map_err(|source| wrong(Error::Io { path, source }.to_string()))?;
        if digest_all(file, out)? == (self.bytes, self.sha256.clone()) {
            return Ok(());
        }
        Err(wrong(format!("{} has other contents", self.path)))
    }

    /// Whether it is in the folder of the set.
    pub(super) fn is_inside(&self) -> bool {
        let mut parts = Path::new(&self.path).components();
        !self.path.is_empty() && parts.all(|part| matches!(part, std::path::Component::Normal(_)))
    }
}

/// Length and SHA-256 of a file.
pub(super) fn digest(path: &Path) -> Result<(u64, String)> {
    let found = File::open(path).and_then(|file| digest_all(file, &mut io::sink()));
    found.map_err(|source| Error::Io { path: path.to_owned(), source })
}

/// Length and SHA-256 of the rest of `file`, which is copied to `out`.
fn digest_all(mut file: impl io::Read, out: &mut dyn io::Write) -> io::Result<(u64, String)> {
    let (mut hash, mut bytes, mut block) = (Sha256::new(), 0, vec![0; 1 << 16]);
    loop {
        let count = file.read(&mut block)?;
        if count == 0 {
            return Ok((bytes, hex(&hash.finalize())));
        }
        hash.update(&block[..count]);
        out.write_all(&block[..count])?;
        bytes += count as u64;
    }
}

/// SHA-256 of `bytes`, in hexadecimal digits.
pub(super) fn digest_of(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The manifest of a run or shard, to which lines are added.
pub(super) struct ManifestLog(File);

impl ManifestLog {
    /// # Errors
    /// I/O errors.
    pub fn open(path: &Path) -> Result<ManifestLog> {
        let failed = |source| Error::Io { path: path.to_owned(), source };
        let mut file = File::options().create(true).append(true).read(true).open(path).map_err(failed)?;
        // What a killed run left half written gets a line of its own.
        file.write_all(b"\n").map_err(failed)?;
        Ok(ManifestLog(file))
    }

    /// # Errors
    /// I/O errors.
    pub fn add(&mut self, entry: &Entry, path: &Path) -> Result<()> {
        let line = serde_json::to_string(entry).map_err(|error| Error::Internal(error.to_string()))? + "\n";
        self.0.write_all(line.as_bytes()).map_err(|source| Error::Io { path: path.to_owned(), source })
    }
}

/// Writes the manifest of the whole set.
///
/// # Errors
/// I/O errors.
pub(super) fn write(root: &Path, entries: &BTreeMap<u64, Entry>) -> Result<()> {
    let all: Vec<&Entry> = entries.values().collect();
    let text = serde_json::to_string(&all).map_err(|error| Error::Internal(error.to_string()))?;
    // A line for each sample.
    let text = text.replace("},{\"sample\":", "},\n{\"sample\":") + "\n";
    replace(&root.join(WHOLE), text.as_bytes())
}

/// The manifest of a whole set.
const WHOLE: &str = "manifest.json";

/// All samples in the manifests of `root`, the newest entry of each. Incomplete lines, which killed runs leave, are
/// skipped.
///
/// # Errors
/// I/O errors; an invalid manifest, or one that names files outside the set.
pub(super) fn read(root: &Path) -> Result<BTreeMap<u64, Entry>> {
    let mut all: BTreeMap<u64, Entry> = BTreeMap::new();
    let whole = root.join(WHOLE);
    if whole.exists() {
        let bytes = ground::read::bytes(&whole, ground::read::Limit::SCENE)?;
        let entries: Vec<Entry> =
            serde_json::from_slice(&bytes).map_err(|error| Error::parse(&whole, "", error.to_string()))?;
        entries.iter().try_for_each(|entry| inside(&whole, entry))?;
        all.extend(entries.into_iter().map(|entry| (entry.sample, entry)));
    }
    let mut made: BTreeMap<u64, Entry> = BTreeMap::new();
    for path in logs(root)? {
        let file = File::open(&path).map_err(|source| Error::Io { path: path.clone(), source })?;
        // A sample that is made again was damaged: its last entry counts, whatever the outcome.
        let mut own: BTreeMap<u64, Entry> = BTreeMap::new();
        // A truncated line may end within a character.
        for line in BufReader::new(file).split(b'\n') {
            let line = line.map_err(|source| Error::Io { path: path.clone(), source })?;
            if let Ok(entry) = serde_json::from_slice::<Entry>(&line) {
                inside(&path, &entry)?;
                own.insert(entry.sample, entry);
            }
        }
        for (sample, entry) in own {
            // What one shard has made remains, even if it fails in another.
            let worse = |known: &Entry| known.error.is_none() && entry.error.is_some();
            if !made.get(&sample).is_some_and(worse) {
                made.insert(sample, entry);
            }
        }
    }
    all.extend(made);
    Ok(all)
}

/// Checks that the files of an entry of the manifest at `path` are in the folder of the set.
fn inside(path: &Path, entry: &Entry) -> Result<()> {
    match entry.files.iter().find(|file| !file.is_inside()) {
        Some(file) => Err(elsewhere(path, file)),
        None => Ok(()),
    }
}

/// The error for a list at `path` that names a file outside the set.
pub(super) fn elsewhere(path: &Path, file: &FileEntry) -> Error {
    Error::parse(path, "", format!("names {:?}, which is not in the set", shown::text(&file.path)))
}

/// The manifests of runs and shards, by name.
pub(super) fn logs(root: &Path) -> Result<Vec<std::path::PathBuf>> {
    let failed = |source| Error::Io { path: root.to_owned(), source };
    let mut logs = Vec::new();
    for entry in fs::read_dir(root).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if name.starts_with("manifest") && name.ends_with(".jsonl") {
            logs.push(path);
        }
    }
    logs.sort();
    Ok(logs)
}

/// Name of the file with what was drawn for a sample.
pub(super) fn drawn_file(sample: u64) -> String {
    format!("samples/{}.json", numbered(sample))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(sample: u64, path: &str, error: Option<&str>) -> String {
        let file = FileEntry { path: path.into(), offset: None, bytes: 0, sha256: String::new() };
        let failed = Entry::failed(sample, &Error::Internal(error.unwrap_or_default().into()));
        let made = Entry { files: vec![file], error: None, ..failed.clone() };
        serde_json::to_string(if error.is_some() { &failed } else { &made }).unwrap() + "\n"
    }

    /// A run that makes a sample again has found it damaged; another shard that fails at it has not.
    #[test]
    fn the_last_entry_of_a_run_counts() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, lines: &[String]| fs::write(folder.path().join(name), lines.concat()).unwrap();
        write("manifest.json", &["[".into(), line(0, "old", None), ",".into(), line(1, "old", None), "]".into()]);
        write(
            "manifest.jsonl",
            &[line(0, "a", None), line(0, "b", None), line(1, "a", None), line(1, "", Some("lost"))],
        );
        let mut cut = [line(2, "a", None), line(3, "\u{e9}", None)].concat().into_bytes();
        let within = cut.iter().rposition(|&byte| byte == 0xc3).unwrap();
        cut.truncate(within + 1);
        fs::write(folder.path().join("manifest.0_of_2.jsonl"), [&cut[..], b"\n"].concat()).unwrap();
        write("manifest.1_of_3.jsonl", &[line(2, "", Some("lost"))]);
        let entries = read(folder.path()).unwrap();
        let found = |sample: u64| entries[&sample].files.first().map(|file| file.path.as_str());
        assert_eq!([found(0), found(1), found(2)], [Some("b"), None, Some("a")]);
        for path in ["../a", "/a", "a/../../b", "", "./a/.."] {
            write("manifest.0_of_2.jsonl", &[line(2, path, None)]);
            let error = read(folder.path()).unwrap_err().to_string();
            assert!(
                error.contains("manifest.0_of_2.jsonl: names ") && error.ends_with("which is not in the set"),
                "{error}"
            );
        }
    }
}
