//! Numbers in records of bytes.

use super::Source;
use super::rows::Rows;
use super::target::FieldTarget;
use crate::record::BLOCK_BYTES;
use ground::error::Result;
use ground::read::number::Number;
use std::io::Read;

/// A number in each record of a file, and its target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub goal: FieldTarget,
    pub number: Number,
    /// First byte in the record.
    pub at: usize,
}

/// Calls the macro `$make` with the type of `$number`.
macro_rules! of_type {
    ($number:expr, $make:ident) => {
        match $number {
            Number::I8 => $make!(i8),
            Number::U8 => $make!(u8),
            Number::I16 => $make!(i16),
            Number::U16 => $make!(u16),
            Number::I32 => $make!(i32),
            Number::U32 => $make!(u32),
            Number::I64 => $make!(i64),
            Number::U64 => $make!(u64),
            Number::F32 => $make!(f32),
            Number::F64 => $make!(f64),
        }
    };
}

/// The number of the type `$t` at the start of the bytes `$from`.
macro_rules! number {
    ($t:ty, $from:expr, $big:expr) => {{
        let bytes = $from.first_chunk().copied().unwrap_or_default();
        (if $big { <$t>::from_be_bytes(bytes) } else { <$t>::from_le_bytes(bytes) }) as f64
    }};
}

/// The number of this type at the start of `bytes`, which are big-endian if `big`.
pub(super) fn value(number: Number, bytes: &[u8], big: bool) -> f64 {
    macro_rules! one {
        ($t:ty) => {
            number!($t, bytes, big)
        };
    }
    of_type!(number, one)
}

impl Member {
    /// Adds its numbers in `records` of `size` bytes each, which are big-endian if `big`, to `rows`.
    pub(super) fn take(&self, records: &[u8], size: usize, big: bool, rows: &mut Rows) -> Result<()> {
        let at = self.at;
        macro_rules! all {
            ($t:ty) => {
                rows.add(self.goal, records.chunks_exact(size).map(move |record| number!($t, record[at..], big)))
            };
        }
        of_type!(self.number, all)
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
