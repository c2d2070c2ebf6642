//! Texts of variable length in HDF5 files, which are in the global heaps, by our own code: the C library trusts the
//! header of a heap, and crashes or never returns if it is wrong.
//!
//! Layout: HDF5 File Format Specification 3.0, II.A (superblock) and III.E (global heap).

use super::Source;
use ground::error::{Error, Result};
use std::collections::BTreeMap;
use std::io::Read as _;
use std::ops::Range;

/// Bytes of the reference to a text in a dataset: its length, the address of its heap, its number there.
pub(super) const ELEMENT: usize = 16;
/// Bytes before the first object of a heap, and of an object.
const HEAD: usize = 16;

/// Heaps, read when they are needed. In a valid file no heap overlaps another, and each text is referenced once.
pub(super) struct Heaps<'a> {
    source: &'a Source<'a>,
    /// The byte that addresses count from.
    base: u64,
    heaps: BTreeMap<u64, Heap>,
    /// Bytes of heaps and of texts that may still be read.
    heaps_left: u64,
    texts_left: u64,
}

struct Heap {
    bytes: Vec<u8>,
    /// Where each object is.
    objects: BTreeMap<u32, Range<usize>>,
}

impl<'a> Heaps<'a> {
    /// The heaps of the file `source`, in which HDF5 begins at byte `base`.
    ///
    /// # Errors
    /// A file whose addresses do not have the usual eight bytes.
    pub(super) fn of(source: &'a Source<'a>, base: u64) -> Result<Heaps<'a>> {
        let mut head = [0; 16];
        source.from(base)?.read_exact(&mut head).map_err(|error| source.failed(error, "its superblock"))?;
        // Sizes of addresses and of lengths; their position depends on the version.
        let sizes = if head[8] < 2 { &head[13..15] } else { &head[9..11] };
        if sizes != [8, 8] {
            let message = "has texts of variable length behind addresses that are not of 8 bytes; allowed: of 8";
            return Err(source.error(message));
        }
        Ok(Heaps { source, base, heaps: BTreeMap::new(), heaps_left: source.length, texts_left: source.length })
    }

    /// The bytes of the text that `element` of the dataset `name` refers to.
    ///
    /// # Errors
    /// Errors of the system; a damaged heap.
    pub(super) fn text(&mut self, name: &str, element: &[u8; ELEMENT]) -> Result<&[u8]> {
        let number = |at: usize| element[at..].first_chunk().copied().map_or(0, u32::from_le_bytes);
        let length = number(0) as usize;
        let address = element[4..].first_chunk().copied().map_or(0, u64::from_le_bytes);
        if length == 0 {
            return Ok(&[]);
        }
        let source = self.source;
        let damaged = || Error::parse(source.path, name, "points outside the heaps of its texts: it is damaged");
        self.texts_left = self.texts_left.checked_sub(length as u64).ok_or_else(damaged)?;
        if !self.heaps.contains_key(&address) {
            let at = self.base.checked_add(address).ok_or_else(damaged)?;
            let heap = Heap::read(source, at, self.heaps_left)?.ok_or_else(damaged)?;
            self.heaps_left -= heap.bytes.len() as u64;
            self.heaps.insert(address, heap);
        }
        let heap = self.heaps.get(&address).ok_or_else(damaged)?;
        let object = heap.objects.get(&number(12)).ok_or_else(damaged)?;
        heap.bytes[object.clone()].get(..length).ok_or_else(damaged)
    }
}

impl Heap {
    /// The heap at byte `address`, of at most `most` bytes; `None`: there is none.
    fn read(source: &Source, address: u64, most: u64) -> Result<Option<Heap>> {
        if address > source.length {
            return Ok(None);
        }
        let mut file = source.from(address)?;
        let mut head = [0; HEAD];
        let failed = |error| source.failed(error, "a heap of its texts");
        file.read_exact(&mut head).map_err(failed)?;
        let size = head[8..].first_chunk().copied().map_or(0, u64::from_le_bytes);
        if !head.starts_with(b"GCOL\x01") || size > most.min(source.length - address) {
            return Ok(None);
        }
        let mut bytes = Vec::new();
        file.take(size.saturating_sub(HEAD as u64)).read_to_end(&mut bytes).map_err(failed)?;
        let mut objects = BTreeMap::new();
        let mut at = 0;
        while let Some(head) = bytes.get(at..).and_then(<[u8]>::first_chunk::<HEAD>) {
            let index = u16::from_le_bytes([head[0], head[1]]);
            let length = head[8..].first_chunk().copied().map_or(0, u64::from_le_bytes);
            let start = at + HEAD;
            let end = usize::try_from(length).ok().and_then(|length| start.checked_add(length));
            // The rest after the last object is free space, which is object 0.
            let Some(end) = end.filter(|&end| index != 0 && end <= bytes.len()) else { break };
            objects.insert(index.into(), start..end);
            at = end.next_multiple_of(8);
        }
        Ok(Some(Heap { bytes, objects }))
    }
}
