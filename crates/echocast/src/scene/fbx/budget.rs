//! What a file may take.

use std::cell::Cell;

/// Bytes allowed per byte of the file. Honest files stay below 20 (compressed normals that hardly vary); a compressed
/// list can claim a thousand.
const EXPANSION_LIMIT: usize = 64;

/// Bytes allowed whatever the size of the file.
const LEAST_BYTES: usize = 64 << 20;

/// Values of curves that may be looked at whatever the size of the file: a few seconds.
const LEAST_LOOKS: usize = 4_000_000;

/// Values that may be looked at per byte of the file. Honest files take one: a key with its time has at least four bytes
/// for each number, and is looked at some thirty times for nine of them.
const LOOKS_PER_BYTE: usize = 2;

/// Memory and time that a file may still take.
pub(super) struct Budget {
    /// Bytes that parsing may take.
    pub limit: usize,
    bytes: Cell<usize>,
    looks: Cell<usize>,
}

impl Budget {
    /// For a file of `size` bytes.
    pub fn new(size: usize) -> Budget {
        let limit = size.saturating_mul(EXPANSION_LIMIT).saturating_add(LEAST_BYTES);
        let looks = size.saturating_mul(LOOKS_PER_BYTE).saturating_add(LEAST_LOOKS);
        Budget { limit, bytes: Cell::new(limit), looks: Cell::new(looks) }
    }

    /// What is wrong with a file that takes more.
    pub fn exceeded(&self) -> String {
        format!("is too much: the file would take more than {EXPANSION_LIMIT} times its size in memory")
    }

    /// Asks for `bytes` of memory.
    pub fn charge(&self, bytes: usize) -> Result<(), String> {
        let left = self.bytes.get().checked_sub(bytes).ok_or_else(|| self.exceeded())?;
        self.bytes.set(left);
        Ok(())
    }

    /// Asks to look at `count` values of curves.
    pub fn look(&self, count: usize) -> Result<(), String> {
        let left = self.looks.get().checked_sub(count);
        self.looks.set(left.ok_or("is animated by more curves than a file of its size may have")?);
        Ok(())
    }
}
