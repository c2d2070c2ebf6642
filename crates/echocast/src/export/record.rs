//! Packing of rows into records of fixed size, as LAS and binary PLY want them.

/// Bytes of records that are packed before they go to the file: small enough to stay in a core's cache.
pub(super) const BLOCK_BYTES: usize = 128 * 1024;

/// Puts `bytes(row)` at `offset` of successive records of `size` bytes, one for each of `rows`.
pub(super) fn put<const N: usize>(
    records: &mut [u8],
    size: usize,
    offset: usize,
    rows: impl IntoIterator<Item = usize>,
    bytes: impl Fn(usize) -> [u8; N],
) {
    for (record, row) in records.chunks_exact_mut(size).zip(rows) {
        record[offset..offset + N].copy_from_slice(&bytes(row));
    }
}
