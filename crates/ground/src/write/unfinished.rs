//! Files that this process has begun and not completed: an interrupted program removes them.

use crate::error::Error;
use crate::shown;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use std::{fs, io, mem, thread};

/// How the names of unfinished files begin.
pub const PREFIX: &str = ".echocast-";

static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Paths of these files. Locked whenever one is created, renamed or removed, so that the holder of the lock never sees
/// a pair of files half renamed.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// The source of [`Error::Cancelled`] while files are written: once this is set, whatever this process is writing fails
/// with that error and leaves nothing behind, and no more files get their names. It is false unless a program sets it,
/// on Ctrl-C for instance; a signal handler may set it.
pub fn cancel_flag() -> &'static AtomicBool {
    &CANCELLED
}

/// Removes the files that this process has begun and not completed, for a program that is about to exit without running
/// destructors: sets [`cancel_flag`], so that no more files are begun or get their names. It waits a tenth of a second
/// for files that are just being renamed, and then gives up.
pub fn remove_unfinished() {
    CANCELLED.store(true, Ordering::SeqCst);
    let start = Instant::now();
    loop {
        match UNFINISHED.try_lock() {
            Ok(mut files) => return files.drain(..).for_each(|path| drop(fs::remove_file(path))),
            Err(_) if start.elapsed() > Duration::from_millis(100) => return,
            Err(_) => thread::sleep(Duration::from_millis(1)),
        }
    }
}

/// Fails if writing files has been cancelled.
pub fn check() -> io::Result<()> {
    if CANCELLED.load(Ordering::SeqCst) { Err(io::Error::other("cancelled")) } else { Ok(()) }
}

/// The error for a failure to write the file that will be called `path`.
pub fn failed(path: &Path, source: io::Error) -> Error {
    match source.kind() {
        _ if check().is_err() => Error::Cancelled,
        io::ErrorKind::OutOfMemory => Error::Memory(format!("writing {}", shown::path(path))),
        _ => Error::io(path, source),
    }
}

/// The list of all unfinished files, whose lock must not be held where a [`Temporary`] is dropped.
pub(super) struct Unfinished(MutexGuard<'static, Vec<PathBuf>>);

impl Unfinished {
    pub(super) fn lock() -> Unfinished {
        Unfinished(UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The file that `make` creates under an unused name in `folder`. The process ID would not make it unique, as
    /// processes in different containers may share one.
    pub(super) fn make(&mut self, folder: &Path, make: impl FnMut(&Path) -> io::Result<()>) -> io::Result<Temporary> {
        check()?;
        let made = tempfile::Builder::new().prefix(PREFIX).rand_bytes(12).make_in(folder, make)?;
        let path = made.into_temp_path().keep().map_err(|error| error.error)?;
        self.0.push(path.clone());
        Ok(Temporary { path })
    }

    /// Gives a file the name `target`, replacing an older file.
    pub(super) fn rename(&mut self, file: &mut Temporary, target: &Path) -> io::Result<()> {
        check()?;
        fs::rename(&file.path, target)?;
        self.forget(&mem::take(&mut file.path));
        Ok(())
    }

    fn forget(&mut self, path: &Path) {
        self.0.retain(|known| known != path);
    }
}

/// A file that is removed when this is dropped, unless it has been given its final name.
#[derive(Debug)]
pub(super) struct Temporary {
    /// Empty once it has.
    path: PathBuf,
}

impl Temporary {
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.path.as_os_str().is_empty() {
            let mut unfinished = Unfinished::lock();
            let _ = fs::remove_file(&self.path);
            unfinished.forget(&self.path);
        }
    }
}
