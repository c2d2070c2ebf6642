//! Who writes to a set: one run, or the shards of one run side by side.
//!
//! | file | who has its lock |
//! |---|---|
//! | `.lock` | whoever writes to the set: a run or `--finish` alone, shards together |
//! | `.lock.3_of_16` | the run of that shard |
//!
//! The system gives locks back when a process ends, however it does. The files say which process has them and are removed
//! with the locks; those of processes that were killed mean nothing.

use crate::ground::error::{Error, Result};
use crate::ground::shown;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How the names of lock files begin; that of the whole set has no more.
const NAME: &str = ".lock";

/// How long others may have a lock only to see whether somebody else has it, or to give theirs back.
const PATIENCE: Duration = Duration::from_millis(50);

/// The exclusive right to write to a set, or to a shard of it, for as long as this lives.
#[derive(Debug)]
pub(super) struct Lock {
    /// The last is given back first.
    held: Vec<Held>,
    /// Whether the file system has no locks.
    pub unlocked: bool,
}

/// A lock of a file.
#[derive(Debug)]
struct Held {
    file: File,
    path: PathBuf,
    shared: bool,
}

/// What became of asking for a lock.
enum Asked {
    Given(Held),
    /// Another process has it.
    Taken,
    /// The file system has none.
    Unknown,
}

impl Lock {
    /// Of the set in the folder `root`.
    ///
    /// # Errors
    /// Another process writes to it; the system's.
    pub fn of_set(root: &Path) -> Result<Lock> {
        let mut lock = Lock { held: Vec::new(), unlocked: false };
        if !lock.take(&root.join(NAME), false)? {
            return Err(taken(root, &writer(root)));
        }
        Ok(lock)
    }

    /// Of a part of the samples, counted from 0, beside other parts of as many.
    ///
    /// # Errors
    /// Another process makes it, or the set in other parts or as a whole; the system's.
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
        // The same samples are in other parts where these are more or fewer.
        let ending = format!("_of_{parts}");
        let foreign = |path: &PathBuf| !path.to_string_lossy().ends_with(&ending);
        match shards(root).into_iter().find(|path| foreign(path) && is_kept(path)) {
            Some(other) => Err(taken(root, &format!("{} in another number of shards", holder(&other)))),
            None => Ok(lock),
        }
    }

    /// Whether the lock of `path` could be had.
    fn take(&mut self, path: &Path, shared: bool) -> Result<bool> {
        let started = Instant::now();
        loop {
            match ask(path, shared).map_err(|source| Error::io(path, source))? {
                Asked::Given(held) => self.held.push(held),
                Asked::Taken if started.elapsed() < PATIENCE => {
                    std::thread::sleep(PATIENCE / 10);
                    continue;
                }
                Asked::Taken => return Ok(false),
                Asked::Unknown => {
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
            // The last of those who share it can have it alone.
            let alone = !shared || file.unlock().is_ok() && file.try_lock().is_ok();
            if alone && is_at(&file, &path) {
                let _ = fs::remove_file(path);
            }
        }
    }
}

/// Asks for the lock of the file at `path`, which then says whose it is.
fn ask(path: &Path, shared: bool) -> io::Result<Asked> {
    loop {
        let mut file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
        match if shared { file.try_lock_shared() } else { file.try_lock() } {
            Err(TryLockError::WouldBlock) => return Ok(Asked::Taken),
            Err(TryLockError::Error(_)) => return Ok(Asked::Unknown),
            // Who had it removed the file after it was opened here.
            Ok(()) if !is_at(&file, path) => {}
            Ok(()) => {
                if !shared {
                    // On a full disk it is a lock all the same.
                    let name = format!("{} {}\n", std::process::id(), host());
                    let _ = file.set_len(0).and_then(|()| file.write_all(name.as_bytes()));
                }
                return Ok(Asked::Given(Held { file, path: path.to_owned(), shared }));
            }
        }
    }
}

/// Whether a process has the lock of the file at `path`.
fn is_taken(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// Whether a process has the lock of the file at `path`, and does not give it back in a moment.
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
    // Where what is open cannot be removed.
    #[cfg(not(unix))]
    {
        open.is_file() && there.is_file()
    }
}

/// Who keeps a run from the whole set in `root`: shards, or another such run.
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

/// The process that has the lock of the file at `path`, as that says.
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

/// Name of this machine, which tells processes of several apart that share a file system.
fn host() -> String {
    #[cfg(unix)]
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    let name = std::env::var("COMPUTERNAME").unwrap_or_default();
    let word: String = name.chars().filter(|letter| !letter.is_whitespace()).collect();
    if word.is_empty() { "unknown".to_owned() } else { word }
}

fn taken(root: &Path, who: &str) -> Error {
    let found = format!("{}, which is being written by {who}", shown::path(root));
    Error::invalid("set.folder", found, "another folder, or to wait until that has ended")
}

/// Removes what killed runs have left of the locks of shards, for who has the whole set.
pub(super) fn sweep(root: &Path) {
    shards(root).into_iter().for_each(|path| drop(fs::remove_file(path)));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What keeps the first from its lock.
    fn told(lock: Result<Lock>) -> String {
        lock.err().map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn a_set_has_one_writer_or_its_shards() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let own = format!("which is being written by process {}", std::process::id());
        let whole = Lock::of_set(root).unwrap();
        for other in [Lock::of_set(root), Lock::of_shard(root, [0, 2])] {
            assert!(told(other).contains(&format!("{own}; allowed: another folder, or to wait")));
        }
        drop(whole);
        // The file of one that was killed means nothing.
        fs::write(root.join(".lock"), "1 elsewhere\n").unwrap();
        fs::write(root.join(".lock.1_of_2"), "1 elsewhere\n").unwrap();
        let [first, second] = [0, 1].map(|part| Lock::of_shard(root, [part, 2]).unwrap());
        assert!(told(Lock::of_shard(root, [1, 2])).contains(&format!("{own}, which makes this shard")));
        assert!(told(Lock::of_shard(root, [2, 3])).contains(&format!("{own} in another number of shards")));
        assert!(told(Lock::of_set(root)).contains(&own));
        drop(first);
        assert!(told(Lock::of_set(root)).contains(&own));
        drop(second);
        assert!(!Lock::of_set(root).unwrap().unlocked);
        assert_eq!(fs::read_dir(root).unwrap().count(), 0);
    }

    /// A lock that is released within a moment does not make others fail.
    #[test]
    fn a_moment_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for _ in 0..10 {
            let whole = Lock::of_set(root).unwrap();
            std::thread::scope(|scope| {
                scope.spawn(move || {
                    std::thread::sleep(PATIENCE / 5);
                    drop(whole);
                });
                assert_eq!(told(Lock::of_shard(root, [0, 2])), "");
            });
            let shard = Lock::of_shard(root, [0, 2]).unwrap();
            std::thread::scope(|scope| {
                scope.spawn(move || {
                    std::thread::sleep(PATIENCE / 5);
                    drop(shard);
                });
                assert_eq!(told(Lock::of_shard(root, [0, 3])), "");
            });
        }
    }

    /// Whoever waits between opening a lock file and locking it must not have that of a file that is gone.
    #[test]
    fn one_of_many_has_a_lock() {
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
