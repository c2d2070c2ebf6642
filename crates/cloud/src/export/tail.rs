//! A file whose end is in memory, for writers that write small pages and read each back.

use ground::write::Sink;
use std::io::{self, Read, Seek, SeekFrom, Write};

/// Maximum number of bytes in memory.
const LIMIT: usize = 1 << 18;

/// What is written after `start` is in the file only after [`Write::flush`].
pub(super) struct Tail {
    file: Sink,
    /// Where the bytes in memory begin.
    start: u64,
    bytes: Vec<u8>,
    /// Where the next byte is read or written.
    at: u64,
}

impl Tail {
    /// The end of the new file `file`.
    pub(super) fn of(file: Sink) -> Tail {
        Tail { file, start: 0, bytes: Vec::with_capacity(LIMIT), at: 0 }
    }

    fn end(&self) -> u64 {
        self.start + self.bytes.len() as u64
    }

    /// Where `at`, which is not past the end, is in memory; `None`: in the file.
    fn here(&self) -> Option<usize> {
        self.at.checked_sub(self.start).map(|offset| offset as usize)
    }
}

impl Write for Tail {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.bytes.len() >= LIMIT {
            self.flush()?;
        }
        let count = match self.here() {
            Some(offset) => {
                let over = bytes.len().min(self.bytes.len() - offset);
                self.bytes[offset..offset + over].copy_from_slice(&bytes[..over]);
                self.bytes.extend_from_slice(&bytes[over..]);
                bytes.len()
            }
            None => {
                let before = bytes.len().min((self.start - self.at) as usize);
                self.file.seek(SeekFrom::Start(self.at))?;
                self.file.write(&bytes[..before])?
            }
        };
        self.at += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(self.start))?;
        self.start = self.end();
        // A failed write is not retried.
        let written = self.file.write_all(&self.bytes);
        self.bytes.clear();
        written
    }
}

impl Read for Tail {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = match self.here() {
            Some(offset) => (&self.bytes[offset..]).read(bytes)?,
            None => {
                let before = bytes.len().min((self.start - self.at) as usize);
                self.file.seek(SeekFrom::Start(self.at))?;
                self.file.read(&mut bytes[..before])?
            }
        };
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Tail {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
            SeekFrom::End(by) => self.end().checked_add_signed(by),
        };
        self.at = at.filter(|&at| at <= self.end()).ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_as_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let mut tail = Tail::of(Sink::create(&path).unwrap());
        let mut whole = io::Cursor::new(Vec::new());
        let (mut random, mut end) = (1_u64, 0_u64);
        let mut draw = |limit: u64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) % limit
        };
        for step in 0..3000 {
            // Mostly at the end, sometimes anywhere before it.
            let at = if step % 3 == 0 { SeekFrom::Start(draw(end + 1)) } else { SeekFrom::End(0) };
            assert_eq!(tail.seek(at).unwrap(), whole.seek(at).unwrap());
            let mut bytes = vec![draw(256) as u8; draw(2000) as usize];
            if step % 7 == 0 {
                let mut expected = bytes.clone();
                let count = tail.read(&mut bytes).unwrap();
                whole.read_exact(&mut expected[..count]).unwrap();
                assert_eq!(bytes[..count], expected[..count]);
            } else {
                tail.write_all(&bytes).unwrap();
                whole.write_all(&bytes).unwrap();
            }
            end = whole.get_ref().len() as u64;
        }
        assert!(end > 4 * LIMIT as u64);
        assert!(tail.seek(SeekFrom::Start(end + 1)).is_err());
        tail.flush().unwrap();
        assert!(std::fs::read(&path).unwrap() == *whole.get_ref());
    }
}
