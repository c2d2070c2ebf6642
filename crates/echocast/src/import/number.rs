//! Numbers in records of bytes.

use super::Source;
use super::rows::{Goal, Rows};
use crate::cloud::record::BLOCK_BYTES;
use crate::ground::error::Result;
use crate::read::number::Number;
use std::io::Read;

/// A number of each record of a file, and where it goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub goal: Goal,
    pub number: Number,
    /// First byte in the record.
    pub at: usize,
}

impl Member {
    /// Adds its numbers in `records` of `size` bytes each, which are big-endian if `big`, to `rows`.
    pub(super) fn take(&self, records: &[u8], size: usize, big: bool, rows: &mut Rows) -> Result<()> {
        let at = self.at;
        macro_rules! all {
            ($t:ty) => {
                rows.add(
                    self.goal,
                    records.chunks_exact(size).map(move |record| {
                        let bytes = record[at..].first_chunk().copied().unwrap_or_default();
                        (if big { <$t>::from_be_bytes(bytes) } else { <$t>::from_le_bytes(bytes) }) as f64
                    }),
                )
            };
        }
        match self.number {
            Number::I8 => all!(i8),
            Number::U8 => all!(u8),
            Number::I16 => all!(i16),
            Number::U16 => all!(u16),
            Number::I32 => all!(i32),
            Number::U32 => all!(u32),
            Number::I64 => all!(i64),
            Number::U64 => all!(u64),
            Number::F32 => all!(f32),
            Number::F64 => all!(f64),
        }
    }
}

/// Reads `count` records of `size` bytes, block by block.
pub(super) fn blocks(
    source: &Source,
    mut from: impl Read,
    size: usize,
    count: usize,
    mut take: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let block = (BLOCK_BYTES / size.max(1)).max(1);
    let mut buffer = vec![0; block.min(count) * size];
    for start in (0..count).step_by(block) {
        let records = &mut buffer[..block.min(count - start) * size];
        from.read_exact(records).map_err(|error| source.failed(error, "its points"))?;
        take(records)?;
    }
    Ok(())
}
