//! Names of the files of a run: of single frames, and whether two are the same.

use anyhow::{Result, ensure};
use echocast::shown;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// The folder that contains `file`.
pub fn folder(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// `name_0007.las` for frame 7 of `name.las`.
pub fn numbered(file: &Path, frame: u32) -> PathBuf {
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push(format!("_{frame:04}"));
    if let Some(ending) = file.extension() {
        name.push(".");
        name.push(ending);
    }
    file.with_file_name(name)
}

/// Whether `name` could be the name of a frame of `file`.
pub fn is_numbered(name: &Path, file: &Path) -> bool {
    numbered_as(name, file).is_some_and(|frame| frame.file_name() == name.file_name()) && same_folder(name, file)
}

/// Whether both files are in one folder.
pub fn same_folder(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| folder(path).canonicalize().unwrap_or_default();
    place(a) == place(b)
}

/// The frame of `file` that has the number of `name`, whatever its ending.
pub fn numbered_as(name: &Path, file: &Path) -> Option<PathBuf> {
    let name = name.file_name()?.to_string_lossy();
    let (_, rest) = name.rsplit_once('_')?;
    let digits = rest.split('.').next()?;
    Some(numbered(file, digits.parse().ok()?))
}

/// Whether both names refer to the same existing file, also through links.
pub fn is_same(a: &Path, b: &Path) -> bool {
    let identity = |path: &Path| path.metadata().ok().map(|file| (file.dev(), file.ino()));
    identity(a).is_some_and(|file| identity(b) == Some(file))
}

/// Checks that `file`, which is to be written, is not `input`, which is read.
pub fn check_kept(file: &Path, input: &Path) -> Result<()> {
    ensure!(
        !is_same(file, input),
        "{}: would overwrite {}, which this run reads; allowed: another name",
        shown::path(file),
        shown::path(input)
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered_before_the_ending() {
        assert_eq!(numbered(Path::new("out/a.b.las"), 7), Path::new("out/a.b_0007.las"));
        assert_eq!(numbered(Path::new("name"), 12345), Path::new("name_12345"));
        let is = |name, file| is_numbered(Path::new(name), Path::new(file));
        assert!(is("a_0007.npz", "./a.npz") && is("a_12345.npz", "a.npz"));
        for other in ["a_7.npz", "a_0007.npy", "b_0007.npz", "a.npz", "a_0007", "src/a_0007.npz"] {
            assert!(!is(other, "a.npz"), "{other}");
        }
    }
}
