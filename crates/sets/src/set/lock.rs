//! Locks of a set, to which one run writes, or the shards of one run side by side.
//!
//! | file | holder of its lock |
//! |---|---|
//! | `.lock` | any writer of the set: a run or `--finish` exclusively, shards jointly |
//! | `.lock.3_of_16` | the run of that shard |
//!
//! The system releases locks when a process ends, however it ends. The files state which process holds the locks, and
//! are removed with them; files that killed processes leave mean nothing.

use ground::error::{Error, Result};
use ground::shown;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Prefix of the names of lock files, and the whole name of that of the set.
const NAME: &str = ".lock";

/// How long others may hold a lock just to find out whether it is taken, or to release their own.
const PATIENCE: Duration = Duration::from_millis(50);

/// The exclusive right to write to a set, or to a shard of it, for as long as this lives.
#[derive(Debug)]
pub(super) struct Lock {
    /// The last is released first.
    held: Vec<Held>,
    /// Whether the file system has no locks.
    pub unlocked: bool,
}

/// A lock on a file.
#[derive(Debug)]
struct Held {
    file: File,
    path: PathBuf,
    shared: bool,
}

/// Result of an attempt to lock.
enum LockAttempt {
    Given(Held),
    /// Another process holds it.
    Taken,
    /// The file system has no locks.
    Unknown,
}

impl Lock {
    /// Locks the set in the folder `root`.
    ///
    /// # Errors
    /// Another process writes to it; I/O errors.
    pub fn of_set(root: &Path) -> Result<Lock> {
        let mut lock = Lock { held: Vec::new(), unlocked: false };
        if !lock.take(&root.join(NAME), false)? {
            return Err(taken(root, &writer(root)));
        }
        Ok(lock)
    }

    /// Locks one shard, counted from 0; others of the same number of shards may be locked as well.
    ///
    /// # Errors
    /// Another process makes this shard, or the set in another number of shards or as a whole; I/O errors.
    pub fn of_shard(root: &Path, [part, parts]: [u64; 2]) -> Result<Lock> {
        let mut lock = Lock { held: Vec::new(), unlocked: false };
        let set = root.join(NAME);
        if !lock.take(&set, true)? {
            return Err(taken(root, &holder(&set)));
        }
        let own = root.join(format!("{NAME}.{part}_of_{parts}"));
        if !lock.take(&own, false)? {
            return Err(taken(root, &format!("{}, which makes this shard", holder(&own))));
        }
        // With another number of shards, the same samples are in other shards.
        let ending = format!("_of_{parts}");
        let foreign = |path: &PathBuf| !path.to_string_lossy().ends_with(&ending);
        match shards(root).into_iter().find(|path| foreign(path) && is_kept(path)) {
            Some(other) => Err(taken(root, &format!("{} with another number of shards", holder(&other)))),
            None => Ok(lock),
        }
    }

    /// Takes the lock of the file at `path`; returns whether that was possible.
    fn take(&mut self, path: &Path, shared: bool) -> Result<bool> {
        let started = Instant::now();
        loop {
            match try_lock_at(path, shared).map_err(|source| Error::io(path, source))? {
                LockAttempt::Given(held) => self.held.push(held),
                LockAttempt::Taken if started.elapsed() < PATIENCE => {
                    std::thread::sleep(PATIENCE / 10);
                    continue;
                }
                LockAttempt::Taken => return Ok(false),
                LockAttempt::Unknown => {
                    let _ = fs::remove_file(path);
                    self.unlocked = true;
                }
            }
            return Ok(true);
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        while let Some(Held { file, path, shared }) = self.held.pop() {
            // The last holder of a shared lock can take it exclusively.
            let alone = !shared || file.unlock().is_ok() && file.try_lock().is_ok();
            if alone && is_at(&file, &path) {
                let _ = fs::remove_file(path);
            }
        }
    }
}

/// Tries to lock the file at `path`, which then names the holder.
fn try_lock_at(path: &Path, shared: bool) -> io::Result<LockAttempt> {
    loop {
        let mut file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
        match if shared { file.try_lock_shared() } else { file.try_lock() } {
            Err(TryLockError::WouldBlock) => return Ok(LockAttempt::Taken),
            Err(TryLockError::Error(_)) => return Ok(LockAttempt::Unknown),
            // The previous holder removed the file after it was opened here.
            Ok(()) if !is_at(&file, path) => {}
            Ok(()) => {
                if !shared {
                    // On a full disk the lock is valid all the same.
                    let name = format!("{} {}\n", std::process::id(), host());
                    let _ = file.set_len(0).and_then(|()| file.write_all(name.as_bytes()));
                }
                return Ok(LockAttempt::Given(Held { file, path: path.to_owned(), shared }));
            }
        }
    }
}

/// Whether a process holds the lock of the file at `path`.
fn is_taken(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// Whether a process holds the lock of the file at `path` for longer than [`PATIENCE`].
fn is_kept(path: &Path) -> bool {
    let started = Instant::now();
    while is_taken(path) {
        if started.elapsed() >= PATIENCE {
            return true;
        }
        std::thread::sleep(PATIENCE / 10);
    }
    false
}

/// Whether `file` is the one at `path`.
fn is_at(file: &File, path: &Path) -> bool {
    let (Ok(open), Ok(there)) = (file.metadata(), fs::metadata(path)) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        (open.dev(), open.ino()) == (there.dev(), there.ino())
    }
    // On systems where open files cannot be removed.
    #[cfg(not(unix))]
    {
        open.is_file() && there.is_file()
    }
}

/// The process that keeps a run from the whole set in `root`: that of a shard, or another such run.
fn writer(root: &Path) -> String {
    holder(&shards(root).into_iter().find(|path| is_taken(path)).unwrap_or_else(|| root.join(NAME)))
}

/// The lock files of shards.
fn shards(root: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(root).into_iter().flatten().filter_map(std::result::Result::ok);
    let is_shard = |name: &str| name.starts_with(&format!("{NAME}."));
    let mut all: Vec<PathBuf> =
        entries.filter(|entry| is_shard(&entry.file_name().to_string_lossy())).map(|entry| entry.path()).collect();
    all.sort();
    all
}

/// The process that holds the lock of the file at `path`, as named there.
fn holder(path: &Path) -> String {
    let mut text = String::new();
    let read = File::open(path).and_then(|file| file.take(1 << 10).read_to_string(&mut text));
    let words: Vec<&str> = text.split_whitespace().collect();
    match (read, words.as_slice()) {
        (Ok(_), [process, there]) if process.parse::<u32>().is_ok() && *there != host() => {
            format!("process {process} on {}", shown::text(there))
        }
        (Ok(_), [process, _]) if process.parse::<u32>().is_ok() => format!("process {process}"),
        _ => "another process".to_owned(),
    }
}

/// Name of this machine, which distinguishes processes of several machines that share a file system.
fn host() -> String {
    #[cfg(unix)]
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    let name = std::env::var("COMPUTERNAME").unwrap_or_default();
    let word: String = name.chars().filter(|letter| !letter.is_whitespace()).collect();
    if word.is_empty() { "unknown".to_owned() } else { word }
}

fn taken(root: &Path, process_name: &str) -> Error {
    let found = format!("{}, which is being written by {process_name}", shown::path(root));
    Error::invalid("set.folder", found, "another folder, or another try when that has ended")
}

/// Removes the lock files of shards that killed runs have left, for the holder of the lock of the whole set.
pub(super) fn sweep(root: &Path) {
    shards(root).into_iter().for_each(|path| drop(fs::remove_file(path)));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Why a lock was refused; empty if it was not.
    fn refusal(lock: Result<Lock>) -> String {
        lock.err().map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn a_set_has_one_writer_or_its_shards() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let own = format!("which is being written by process {}", std::process::id());
        let whole = Lock::of_set(root).unwrap();
        for other in [Lock::of_set(root), Lock::of_shard(root, [0, 2])] {
            assert!(refusal(other).contains(&format!("{own}; allowed: another folder, or another try")));
        }
        drop(whole);
        // The files of killed processes mean nothing.
        fs::write(root.join(".lock"), "1 elsewhere\n").unwrap();
        fs::write(root.join(".lock.1_of_2"), "1 elsewhere\n").unwrap();
        let [first, second] = [0, 1].map(|part| Lock::of_shard(root, [part, 2]).unwrap());
        assert!(refusal(Lock::of_shard(root, [1, 2])).contains(&format!("{own}, which makes this shard")));
        assert!(refusal(Lock::of_shard(root, [2, 3])).contains(&format!("{own} with another number of shards")));
        assert!(refusal(Lock::of_set(root)).contains(&own));
        drop(first);
        assert!(refusal(Lock::of_set(root)).contains(&own));
        drop(second);
        assert!(!Lock::of_set(root).unwrap().unlocked);
        assert_eq!(fs::read_dir(root).unwrap().count(), 0);
    }

    /// A lock that is released within a moment does not make others fail.
    #[test]
    fn locks_are_awaited_for_a_moment() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for _ in 0..10 {
            let whole = Lock::of_set(root).unwrap();
            std::thread::scope(|scope| {
                scope.spawn(move || {
                    std::thread::sleep(PATIENCE / 5);
                    drop(whole);
                });
                assert_eq!(refusal(Lock::of_shard(root, [0, 2])), "");
            });
            let shard = Lock::of_shard(root, [0, 2]).unwrap();
            std::thread::scope(|scope| {
                scope.spawn(move || {
                    std::thread::sleep(PATIENCE / 5);
                    drop(shard);
                });
                assert_eq!(refusal(Lock::of_shard(root, [0, 3])), "");
            });
        }
    }

    /// A process that waits between opening a lock file and locking it must not get the lock of a removed file.
    #[test]
    fn only_one_of_many_holds_a_lock() {
        let folder = tempfile::tempdir().unwrap();
        let (inside, most) = (std::sync::atomic::AtomicUsize::new(0), std::sync::atomic::AtomicUsize::new(0));
        let count = |number: &std::sync::atomic::AtomicUsize| number.load(std::sync::atomic::Ordering::SeqCst);
        let work = || {
            for _ in 0..100 {
                if let Ok(_lock) = Lock::of_set(folder.path()) {
                    let now = inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst) + 1;
                    most.fetch_max(now, std::sync::atomic::Ordering::SeqCst);
                    std::thread::yield_now();
                    inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                }
            }
        };
        std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(work))));
        assert_eq!((count(&inside), count(&most)), (0, 1));
    }
}
