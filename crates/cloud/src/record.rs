//! Packing of rows into records of fixed size, as LAS, binary PLY and [`super::PackItem`] require them.

use bytemuck::NoUninit;

/// Bytes of records that are packed before they are written to the file: small enough to stay in a core's cache.
pub(crate) const BLOCK_BYTES: usize = 128 * 1024;

/// Writes `value(row)` at `offset` of successive records of `size` bytes, one for each of `rows`.
pub fn put<R, T: NoUninit>(
    records: &mut [u8],
    size: usize,
    offset: usize,
    rows: impl IntoIterator<Item = R>,
    value: impl Fn(R) -> T,
) {
    for (record, row) in records.chunks_exact_mut(size).zip(rows) {
        record[offset..offset + size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&value(row)));
    }
}
