//! Limits of the memory and time that a file may take.

use std::cell::Cell;

/// Bytes allowed per byte of the file. Legitimate files stay below 20 (compressed normals that hardly vary); a
/// compressed list can claim a thousand.
const EXPANSION_LIMIT: usize = 64;

/// Bytes allowed regardless of the size of the file.
const LEAST_BYTES: usize = 64 << 20;

/// Curve values that may be evaluated regardless of the size of the file: a few seconds.
const LEAST_EVALUATIONS: usize = 4_000_000;

/// Curve values that may be evaluated per byte of the file. Legitimate files take one: a key with its time has at least
/// four bytes for each number, and takes some thirty evaluations for nine numbers.
const EVALUATIONS_PER_BYTE: usize = 2;

/// Memory and time that a file may still take.
pub(super) struct Budget {
    /// Bytes that parsing may take.
    pub limit: usize,
    bytes: Cell<usize>,
    check_budget: Cell<usize>,
}

impl Budget {
    /// For a file of `size` bytes.
    pub fn new(size: usize) -> Budget {
        let limit = size.saturating_mul(EXPANSION_LIMIT).saturating_add(LEAST_BYTES);
        let check_budget = size.saturating_mul(EVALUATIONS_PER_BYTE).saturating_add(LEAST_EVALUATIONS);
        Budget { limit, bytes: Cell::new(limit), check_budget: Cell::new(check_budget) }
    }

    /// The error message for a file that takes more memory.
    pub fn exceeded(&self) -> String {
        format!("is too much: the file would take more than {EXPANSION_LIMIT} times its size in memory")
    }

    /// Takes `bytes` of memory from the budget.
    pub fn charge(&self, bytes: usize) -> Result<(), String> {
        let left = self.bytes.get().checked_sub(bytes).ok_or_else(|| self.exceeded())?;
        self.bytes.set(left);
        Ok(())
    }

    /// Takes the evaluation of `count` curve values from the budget.
    pub fn look(&self, count: usize) -> Result<(), String> {
        let left = self.check_budget.get().checked_sub(count);
        self.check_budget.set(left.ok_or("is animated by more curves than a file of its size may have")?);
        Ok(())
    }
}
