//! Decompression of LAZ, by the crate `laz`: several chunks in parallel. What the file claims is checked first, because
//! the crate would trust it.

use super::{Source, contained};
use ::laz::laszip::ChunkTable;
use ::laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use ::laz::{LazItem, LazItemType, LazVlr};
use echocast_memory::tried;
use ground::error::{Error, Result};
use ground::parallel;
use std::io::{self, Cursor, ErrorKind, Read as _};

/// Maximum plausible bytes of points per byte of the file; real clouds have ten to a hundred.
const MOST: u64 = 1000;

/// Bytes of points that are accepted in any case: a few bytes can hold many points that are all the same.
const BELIEVED: u64 = 256 << 20;

/// Start of a record with which all points are one chunk.
const POINTWISE: [u8; 2] = [1, 0];

/// Bytes before the first chunk: the offset of the chunk table.
const TABLE_AT: u64 = 8;

/// Where a chunk is in the file, and how many points it has.
struct LazChunk {
    at: u64,
    bytes: u64,
    points: u64,
}

/// Reads `count` points of `size` bytes that are compressed from byte `start` on, as described by `record`, and passes
/// them to `take`.
pub(super) fn read(
    source: &Source,
    record: &[u8],
    start: u64,
    count: u64,
    size: usize,
    mut take: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let vlr = contained(|| LazVlr::read_from(record).map_err(io::Error::other));
    let vlr = vlr.map_err(|error| source.failed(error, "its record of LASzip"))?;
    let wrong = |what: &str| source.error(format!("its record of LASzip {what}"));
    let first = vlr.items().first().map(|item| item.item_type());
    if !matches!(first, Some(LazItemType::Point10 | LazItemType::Point14)) {
        return Err(wrong("does not begin with the coordinates of points"));
    }
    let made = contained(|| decompress(vlr.items(), &[], &mut []).map(|found| found == size));
    if !made.map_err(|error| source.failed(error, "its record of LASzip"))? {
        return Err(wrong(&format!("is not that of points of {size} bytes")));
    }
    if count == 0 {
        return Ok(());
    }
    if count > (source.length * MOST + BELIEVED) / size as u64 {
        let length = source.length;
        return Err(source.error(format!("says it has {count} points, in {length} bytes: it is damaged")));
    }
    let pointwise = record.starts_with(&POINTWISE);
    let chunks = if pointwise { one_chunk(source, start, count) } else { chunks(source, &vlr, start, count, size)? };
    for group in chunks.chunks(parallel::threads().max(1)) {
        let mut work = Vec::new();
        for chunk in group {
            let mut bytes = Vec::new();
            let read = source.from(chunk.at)?.take(chunk.bytes).read_to_end(&mut bytes);
            read.map_err(|error| Error::io(source.path, error))?;
            let length = chunk.points as usize * size;
            let mut points = Vec::new();
            tried(|| points.try_reserve_exact(length))
                .map_err(|_| Error::Memory(format!("{length} bytes of points")))?;
            points.resize(length, 0);
            work.push((bytes, points, Ok(())));
        }
        parallel::for_each(&mut work, |_, (bytes, points, done)| {
            *done = contained(|| {
                check_layers(vlr.items(), bytes, size)?;
                decompress(vlr.items(), bytes, points).map(drop)
            });
        });
        for (_, points, done) in work {
            done.map_err(|error| source.failed(error, "its compressed points"))?;
            take(&points)?;
        }
    }
    Ok(())
}

/// Fills `points` from the chunk `bytes`, and returns the size of a point.
fn decompress(items: &Vec<LazItem>, bytes: &[u8], points: &mut [u8]) -> io::Result<usize> {
    let input = Cursor::new(bytes);
    let layered = items.first().is_some_and(|item| item.version() >= 3);
    let mut decompressor: Box<dyn RecordDecompressor<_>> = if layered {
        Box::new(LayeredPointRecordDecompressor::new(input))
    } else {
        Box::new(SequentialPointRecordDecompressor::new(input))
    };
    decompressor.set_fields_from(items).map_err(io::Error::other)?;
    let size = decompressor.record_size();
    if size > 0 {
        points.chunks_exact_mut(size).try_for_each(|point| decompressor.decompress_next(point))?;
    }
    Ok(size)
}

/// Checks that the layers of the chunk `bytes` are within it: memory is allocated for the sizes that it claims.
fn check_layers(items: &[LazItem], bytes: &[u8], size: usize) -> io::Result<()> {
    let layers = |item: &LazItem| match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::RGB14 | LazItemType::WavePacket14 => 1,
        LazItemType::Byte14(count) => usize::from(count),
        _ => 0,
    };
    let count: usize = items.iter().map(layers).sum();
    if count == 0 {
        return Ok(());
    }
    // They follow the first point and the number of points.
    let sizes = bytes.get(size + 4..size + 4 + 4 * count).ok_or(ErrorKind::UnexpectedEof)?;
    let sizes =
        sizes.chunks_exact(4).map(|bytes| u64::from(bytes.first_chunk().copied().map_or(0, u32::from_le_bytes)));
    if sizes.sum::<u64>() > bytes.len() as u64 {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    Ok(())
}

/// All points from byte `start` on, as the first versions of LASzip compressed them.
fn one_chunk(source: &Source, start: u64, count: u64) -> Vec<LazChunk> {
    vec![LazChunk { at: start, bytes: source.length.saturating_sub(start), points: count }]
}

/// The chunks of `count` points.
fn chunks(source: &Source, vlr: &LazVlr, start: u64, count: u64, size: usize) -> Result<Vec<LazChunk>> {
    let (table, end) = table(source, vlr, start, size)?;
    let mut chunks = Vec::new();
    let (mut at, mut left) = (start + TABLE_AT, count);
    for entry in table.as_ref() {
        let points = if vlr.uses_variable_size_chunks() { entry.point_count } else { vlr.chunk_size().into() };
        let points = points.min(left);
        if entry.byte_count > end.saturating_sub(at) {
            return Err(source.error("its table of chunks extends past its points: it is damaged"));
        }
        if points > 0 {
            chunks.push(LazChunk { at, bytes: entry.byte_count, points });
        }
        (at, left) = (at + entry.byte_count, left - points);
    }
    if left > 0 {
        let held = count - left;
        let message = format!("says it has {count} points, and its chunks hold {held}: it is cut off, or damaged");
        return Err(source.error(message));
    }
    Ok(chunks)
}

/// The table of chunks, and where it begins.
fn table(source: &Source, vlr: &LazVlr, start: u64, size: usize) -> Result<(ChunkTable, u64)> {
    let length = source.length;
    let none = "has no table of the chunks of its points: it was not finished, or is cut off";
    let place = |at: u64| -> Result<u64> {
        let mut bytes = [0; TABLE_AT as usize];
        let read = source.from(at)?.read_exact(&mut bytes);
        read.map_err(|_| source.error(none))?;
        Ok(u64::from_le_bytes(bytes))
    };
    let is_place = |at: u64| at >= start + TABLE_AT && at.saturating_add(8) <= length;
    let mut at = place(start)?;
    if !is_place(at) {
        // Programs that write to a pipe cannot seek back, and write it at the end.
        at = place(length.saturating_sub(TABLE_AT))?;
    }
    if !is_place(at) {
        return Err(source.error(none));
    }
    let mut head = [0; 8];
    let read = source.from(at)?.read_exact(&mut head);
    read.map_err(|error| source.failed(error, "its table of chunks"))?;
    let chunks = u64::from(head[4..].first_chunk().copied().map_or(0, u32::from_le_bytes));
    // A chunk begins with an uncompressed point.
    if chunks > (at - start) / size as u64 {
        return Err(source.error(format!("says it has {chunks} chunks of points, more than it has room for")));
    }
    let mut file = source.from(at)?;
    let table = contained(|| ChunkTable::read(&mut file, vlr.uses_variable_size_chunks()));
    drop(file);
    let table = table.map_err(|error| source.failed(error, "its table of chunks"))?;
    Ok((table, at))
}
