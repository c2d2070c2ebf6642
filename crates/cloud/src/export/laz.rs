//! Compression of LAS records, by the crate `laz`: LASzip version 3, in chunks that are compressed in parallel.

use ::las::Vlr;
use ::laz::laszip::{ChunkTable, ChunkTableEntry};
use ::laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr};
use ground::parallel;
use ground::write::Sink;
use std::io::{self, Cursor, Seek, SeekFrom, Write};

/// Flag of the point format in the header of files with compressed points.
pub(super) const COMPRESSED: u8 = 1 << 7;

/// Size of the offset of the chunk table, which comes first in what a compressor writes.
const TABLE_AT: usize = 8;

/// Records on their way to the file.
pub(super) struct Laz {
    vlr: LazVlr,
    table: ChunkTable,
    /// Records of chunks that are not written yet.
    waiting: Vec<u8>,
    /// Where the offset of the chunk table is in the file.
    start: u64,
}

impl Laz {
    pub(super) fn new(point_format: u8, extra_bytes: u16) -> io::Result<Laz> {
        let items = LazItemRecordBuilder::default_for_point_format_id(point_format, extra_bytes).map_err(io_error)?;
        Ok(Laz { vlr: LazVlr::from_laz_items(items), table: ChunkTable::default(), waiting: Vec::new(), start: 0 })
    }

    /// The record of the header that describes how points are compressed.
    pub(super) fn record(&self) -> io::Result<Vlr> {
        let mut data = Vec::new();
        self.vlr.write_to(&mut data)?;
        Ok(Vlr {
            user_id: LazVlr::USER_ID.into(),
            record_id: LazVlr::RECORD_ID,
            description: LazVlr::DESCRIPTION.into(),
            data,
        })
    }

    /// Leaves room for the offset of the chunk table.
    pub(super) fn begin(&mut self, file: &mut Sink) -> io::Result<()> {
        self.start = file.stream_position()?;
        file.write_all(&[0; TABLE_AT])
    }

    /// Adds whole records, and writes chunks when there is one for each thread.
    pub(super) fn add(&mut self, records: &[u8], file: &mut Sink) -> io::Result<()> {
        self.waiting.extend_from_slice(records);
        let chunks = self.waiting.len() / self.chunk_bytes();
        if chunks >= parallel::threads() { self.write(chunks * self.chunk_bytes(), file) } else { Ok(()) }
    }

    /// Writes the last chunk and the table of chunks.
    pub(super) fn finish(&mut self, file: &mut Sink) -> io::Result<()> {
        self.write(self.waiting.len(), file)?;
        let end = file.stream_position()?;
        self.table.write_to(&mut *file, &self.vlr)?;
        let after = file.stream_position()?;
        file.seek(SeekFrom::Start(self.start))?;
        file.write_all(&end.to_le_bytes())?;
        file.seek(SeekFrom::Start(after)).map(drop)
    }

    fn chunk_bytes(&self) -> usize {
        self.vlr.chunk_size() as usize * self.vlr.items_size() as usize
    }

    /// Compresses the first `bytes` that are waiting and writes them.
    fn write(&mut self, bytes: usize, file: &mut Sink) -> io::Result<()> {
        let waiting = self.waiting[..bytes].chunks(self.chunk_bytes());
        let mut chunks: Vec<(&[u8], io::Result<Vec<u8>>)> = waiting.map(|chunk| (chunk, Ok(Vec::new()))).collect();
        parallel::for_each(&mut chunks, |_, (records, compressed)| *compressed = self.compress(records));
        for (records, compressed) in chunks {
            let compressed = compressed?;
            file.write_all(&compressed)?;
            let point_count = (records.len() / self.vlr.items_size() as usize) as u64;
            self.table.push(ChunkTableEntry { point_count, byte_count: compressed.len() as u64 });
        }
        self.waiting.drain(..bytes);
        Ok(())
    }

    /// One chunk.
    fn compress(&self, records: &[u8]) -> io::Result<Vec<u8>> {
        let mut compressor = LasZipCompressor::new(Cursor::new(Vec::new()), self.vlr.clone()).map_err(io_error)?;
        compressor.compress_many(records)?;
        compressor.done()?;
        // The output is a complete stream: the offset of its table, the chunk, the table.
        let mut file = compressor.into_inner().into_inner();
        let place = file[..TABLE_AT].try_into().map_or(0, u64::from_le_bytes);
        file.truncate(place as usize);
        file.drain(..TABLE_AT);
        Ok(file)
    }
}

fn io_error(error: ::laz::LasZipError) -> io::Error {
    match error {
        ::laz::LasZipError::IoError(error) => error,
        other => io::Error::other(other),
    }
}
