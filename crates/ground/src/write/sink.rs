//! Files that libraries write to.

use super::unfinished;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Bytes written at a time, between two checks for cancellation.
const PIECE: usize = 8 << 20;

/// A file that, after the first error, accepts everything and keeps nothing: writers in libraries complete their files
/// when they are dropped, even those that cannot be completed, and print their errors.
pub struct Sink {
    file: File,
    /// The first error.
    error: Option<io::Error>,
    /// Where the next byte would go after that.
    at: u64,
}

impl Sink {
    /// Writes the file at `path` from its beginning.
    pub fn create(path: &Path) -> io::Result<Sink> {
        // Readable, for writers that go back to a page.
        let file = File::options().read(true).write(true).create(true).truncate(true).open(path)?;
        Ok(Sink { file, error: None, at: 0 })
    }

    /// Checks that everything was written.
    pub fn finish(mut self) -> io::Result<()> {
        self.take_error()
    }

    /// The first error since the last time, if there was one.
    pub fn take_error(&mut self) -> io::Result<()> {
        self.error.take().map_or(Ok(()), Err)
    }

    /// Remembers the error of `done` if it is the first one that matters.
    fn watch<T>(&mut self, done: io::Result<T>) -> io::Result<T> {
        if let Err(error) = &done
            && error.kind() != ErrorKind::Interrupted
        {
            // Wherever it was: writers that went back to patch what they wrote rely on the end being behind it.
            self.at = self.file.seek(SeekFrom::End(0)).unwrap_or_default();
            let same = |code| io::Error::from_raw_os_error(code);
            let as_text = || io::Error::new(error.kind(), error.to_string());
            self.error = Some(error.raw_os_error().map_or_else(as_text, same));
        }
        done
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.error.is_some() {
            self.at += bytes.len() as u64;
            return Ok(bytes.len());
        }
        let piece = &bytes[..bytes.len().min(PIECE)];
        let written = unfinished::check().and_then(|()| {
            #[cfg(debug_assertions)]
            full_disk::take_room()?;
            match self.file.write(piece)? {
                0 if !piece.is_empty() => Err(ErrorKind::WriteZero.into()),
                count => Ok(count),
            }
        });
        self.watch(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Read for Sink {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.error.is_some() { Ok(0) } else { self.file.read(bytes) }
    }
}

impl Seek for Sink {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        if self.error.is_none() {
            let reached = self.file.seek(to);
            return self.watch(reached);
        }
        self.at = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::Current(by) | SeekFrom::End(by) => self.at.saturating_add_signed(by),
        };
        Ok(self.at)
    }
}

/// Full disks, which tests of any crate simulate; only in builds with debug assertions.
#[cfg(debug_assertions)]
pub mod full_disk {
    use std::cell::Cell;
    use std::io::{Error, ErrorKind};

    thread_local! {
        /// Writes of this thread until the disk is full.
        pub static WRITES: Cell<usize> = const { Cell::new(usize::MAX) };
    }

    /// Fails unless there is room for one more write.
    pub(super) fn take_room() -> Result<(), Error> {
        let left = WRITES.get();
        WRITES.set(left.saturating_sub(1));
        if left == 0 { Err(ErrorKind::StorageFull.into()) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_error_is_reported_and_the_rest_is_discarded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let mut sink = Sink::create(&path).unwrap();
        sink.write_all(&[7; 100]).unwrap();
        // A file that cannot be written to simulates a full disk.
        sink.file = File::open(&path).unwrap();
        let error = sink.write(&[7; 100]).unwrap_err();
        sink.write_all(&[7; 100]).unwrap();
        assert_eq!(sink.seek(SeekFrom::Start(20)).unwrap(), 20);
        sink.write_all(&[7; 100]).unwrap();
        assert_eq!(sink.stream_position().unwrap(), 120);
        sink.flush().unwrap();
        assert_eq!(sink.finish().unwrap_err().raw_os_error(), error.raw_os_error());
        assert_eq!(std::fs::metadata(&path).unwrap().len(), 100);
    }

    #[test]
    fn large_pieces_are_cut() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = Sink::create(&folder.path().join("a")).unwrap();
        assert_eq!(sink.write(&vec![0; PIECE + 1]).unwrap(), PIECE);
        sink.finish().unwrap();
    }
}
