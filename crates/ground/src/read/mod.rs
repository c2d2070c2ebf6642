//! Reading files: all files, named by a user or by another file, are opened here.

pub mod bounds;
pub mod csv;
pub mod number;
pub mod ply;
pub mod presets;
pub mod xml;
pub mod yaml;

use crate::error::{Error, Result};
use crate::shown;
use echocast_memory::tried;
use std::cell::RefCell;
use std::fs::{self, File, FileType, OpenOptions};
use std::io::{self, ErrorKind, Read, Take};
use std::path::{Path, PathBuf};

thread_local! {
    /// Files that have been read, if they are being recorded.
    static NOTED: RefCell<Option<Vec<PathBuf>>> = const { RefCell::new(None) };
}

/// Does `work` and returns the files that it has read on this thread: those it was given, and those that these name,
/// such as the textures of a scene.
pub fn noting<R>(work: impl FnOnce() -> R) -> (R, Vec<PathBuf>) {
    let before = NOTED.replace(Some(Vec::new()));
    let result = work();
    (result, NOTED.replace(before).unwrap_or_default())
}

/// Ending of the file name `path`, lower case, without the dot; empty if it has none.
pub fn ending(path: &Path) -> String {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Largest size of a kind of file, bytes.
#[derive(Clone, Copy)]
pub struct Limit(u64);

impl Limit {
    /// Scenes and their buffers.
    pub const SCENE: Limit = Limit(16 << 30);
    /// Clouds.
    pub const CLOUD: Limit = Limit(1 << 40);
    /// Label names that accompany clouds.
    pub const NAMES: Limit = Limit(256 << 20);
    /// Materials of scenes.
    pub const MATERIALS: Limit = Limit(256 << 20);
    /// Images, as they are stored.
    pub const IMAGE: Limit = Limit(1 << 30);
    /// Sensors, weather, labels.
    pub const YAML: Limit = Limit(16 << 20);
    /// Surveys and robots of other programs, whose trees take many times their size.
    pub const XML: Limit = Limit(64 << 20);
    /// Scenes as XML, whose numbers are text.
    pub const COLLADA: Limit = Limit(512 << 20);
    /// Trajectories, beams, casts.
    pub const TABLE: Limit = Limit(1 << 30);

    /// Checks that no more than this has been read of `origin`.
    pub fn check(self, origin: &str, bytes: u64) -> Result<()> {
        if bytes <= self.0 {
            return Ok(());
        }
        let (size, unit) = if self.0 < 1 << 30 { (self.0 >> 20, "MiB") } else { (self.0 >> 30, "GiB") };
        let message = format!("is longer than {size} {unit}, the most allowed");
        Err(Error::Parse { origin: origin.to_owned(), place: String::new(), message })
    }
}

/// Opens the file at `path`; reads no more than its present size, so that reading a growing file ends, too.
///
/// # Errors
/// A missing file; a folder, pipe or device, which could be endless or block for ever; a file beyond `limit`.
pub fn open(path: &Path, limit: Limit) -> Result<Take<File>> {
    let fault = |source| Error::io(path, source);
    // Merely opening a device can have effects.
    only_files(fs::metadata(path).map_err(fault)?.file_type()).map_err(fault)?;
    let file = open_at_once(path).map_err(fault)?;
    let found = file.metadata().map_err(fault)?;
    only_files(found.file_type()).map_err(fault)?;
    limit.check(&shown::path(path), found.len())?;
    NOTED.with_borrow_mut(|noted| noted.iter_mut().for_each(|files| files.push(path.to_owned())));
    Ok(file.take(found.len()))
}

/// The bytes of the file at `path`.
///
/// # Errors
/// As [`open`]; out of memory.
pub fn bytes(path: &Path, limit: Limit) -> Result<Vec<u8>> {
    let mut file = open(path, limit)?;
    let mut bytes = Vec::new();
    let length = usize::try_from(file.limit()).unwrap_or(usize::MAX);
    tried(|| bytes.try_reserve_exact(length))
        .map_err(|_| Error::Memory(format!("{length} bytes of {}", shown::path(path))))?;
    file.read_to_end(&mut bytes).map_err(|source| Error::io(path, source))?;
    Ok(bytes)
}

/// Opens without waiting for the other end, in case the file has become a pipe since it was checked.
fn open_at_once(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        use std::os::unix::fs::OpenOptionsExt as _;
        options.custom_flags((OFlags::NONBLOCK | OFlags::NOCTTY).bits() as i32);
    }
    options.read(true).open(path)
}

fn only_files(found: FileType) -> io::Result<()> {
    if found.is_file() {
        return Ok(());
    }
    let what = match found {
        folder if folder.is_dir() => return Err(ErrorKind::IsADirectory.into()),
        #[cfg(unix)]
        other if std::os::unix::fs::FileTypeExt::is_fifo(&other) => "a pipe",
        #[cfg(unix)]
        other if std::os::unix::fs::FileTypeExt::is_socket(&other) => "a socket",
        _ => "a device",
    };
    Err(io::Error::new(ErrorKind::InvalidInput, format!("is {what}; allowed: regular files")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(path: &Path, limit: Limit) -> String {
        bytes(path, limit).unwrap_err().to_string().replace(&shown::path(path), "FILE")
    }

    #[test]
    fn what_is_read_is_noted() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let (inner, outer) = noting(|| {
            bytes(file.path(), Limit::YAML).unwrap();
            noting(|| bytes(file.path(), Limit::YAML).unwrap()).1
        });
        assert_eq!([inner, outer], [[file.path()], [file.path()]]);
        assert!(NOTED.take().is_none());
    }

    #[test]
    fn only_regular_files_of_some_length_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.yaml");
        fs::write(&file, "abc").unwrap();
        assert_eq!(bytes(&file, Limit(3)).unwrap(), b"abc");
        File::options().write(true).open(&file).unwrap().set_len((16 << 20) + 1).unwrap();
        assert_eq!(fault(&file, Limit::YAML), "FILE: is longer than 16 MiB, the most allowed");
        // Without a byte on disk.
        File::options().write(true).open(&file).unwrap().set_len((16 << 30) + 1).unwrap();
        assert_eq!(fault(&file, Limit::SCENE), "FILE: is longer than 16 GiB, the most allowed");
        assert_eq!(fault(folder.path(), Limit::YAML), "FILE: is a directory");
        assert!(fault(&folder.path().join("no"), Limit::YAML).starts_with("FILE: No such file"));
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_are_refused_at_once() {
        use std::os::unix::fs::symlink;
        use std::os::unix::net::UnixListener;
        assert_eq!(fault(Path::new("/dev/zero"), Limit::YAML), "FILE: is a device; allowed: regular files");
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        symlink("/dev/zero", at("y.glb")).unwrap();
        assert_eq!(fault(&at("y.glb"), Limit::SCENE), "FILE: is a device; allowed: regular files");
        rustix::fs::mkfifoat(rustix::fs::CWD, at("x.glb"), rustix::fs::Mode::RWXU).unwrap();
        assert_eq!(fault(&at("x.glb"), Limit::SCENE), "FILE: is a pipe; allowed: regular files");
        let _socket = UnixListener::bind(at("s")).unwrap();
        assert_eq!(fault(&at("s"), Limit::SCENE), "FILE: is a socket; allowed: regular files");
        // It was not a pipe when it was checked.
        assert!(open_at_once(&at("x.glb")).unwrap().metadata().is_ok());
    }

    #[test]
    fn a_file_that_grows_ends() {
        use std::io::Write as _;
        let mut growing = tempfile::NamedTempFile::new().unwrap();
        growing.write_all(b"abc").unwrap();
        let mut file = open(growing.path(), Limit::YAML).unwrap();
        growing.write_all(b"def").unwrap();
        let mut text = String::new();
        file.read_to_string(&mut text).unwrap();
        assert_eq!(text, "abc");
    }
}
