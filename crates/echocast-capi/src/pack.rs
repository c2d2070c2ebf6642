//! Columns packed into the caller's memory.

use crate::column::{
    ECHOCAST_TYPE_F32, ECHOCAST_TYPE_F64, ECHOCAST_TYPE_I8, ECHOCAST_TYPE_I16, ECHOCAST_TYPE_I32, ECHOCAST_TYPE_I64,
    ECHOCAST_TYPE_U8, ECHOCAST_TYPE_U16, ECHOCAST_TYPE_U32, ECHOCAST_TYPE_U64, computed, echocast_pack_item,
};
use crate::guard::{Failure, Outcome};
use crate::text;

use echocast::{Field, FieldSet, PackItem, PackType};
use std::ffi::c_void;
use std::fmt::Display;

/// Most columns of a packed point.
const MOST_ITEMS: usize = 64;

/// The arguments of a C function that packs columns.
pub(crate) struct Packing {
    pub items: *const echocast_pack_item,
    pub item_count: usize,
    pub stride: usize,
    pub to: *mut c_void,
    pub capacity: usize,
    pub needed: *mut usize,
}

impl Packing {
    /// Runs `pack` on the items, whose columns are among `fields`, and on `room` bytes of `to`; if that is NULL, only
    /// reports the number of bytes.
    ///
    /// # Safety
    /// `items` is an array, `to` a buffer of `capacity` bytes and `needed` an output, as [`text`] describes.
    pub unsafe fn fill(
        &self,
        fields: FieldSet,
        room: Option<usize>,
        pack: impl FnOnce(&[PackItem], &mut [u8]) -> echocast::Result<()>,
    ) -> Outcome {
        // SAFETY: as the caller promises.
        let items = unsafe { text::array(self.items, self.item_count, "items") }?;
        if !(1..=MOST_ITEMS).contains(&items.len()) {
            return Err(Failure::argument("item_count", items.len(), &format!("1 to {MOST_ITEMS}")));
        }
        let mut packed = [PackItem::new(Field::X, PackType::F32, 0); MOST_ITEMS];
        for (number, (item, to)) in items.iter().zip(&mut packed).enumerate() {
            let at = |failure: Failure| Failure { text: format!("items[{number}]: {}", failure.text), ..failure };
            // SAFETY: as the caller promises.
            let name = unsafe { text::required(item.column, "column") }.map_err(at)?;
            let (field, kind) = (computed(fields, name).map_err(at)?, pack_type(item.kind).map_err(at)?);
            *to = PackItem::new(field, kind, item.offset as usize);
            to.shift = item.shift;
            if item.scale != 0.0 {
                to.scale = item.scale;
            }
        }
        let to = CallerBuffer { to: self.to, capacity: self.capacity, needed: self.needed };
        // SAFETY: as the caller promises.
        let Some(to) = unsafe { to.bytes("stride", self.stride, room) }? else { return Ok(()) };
        Ok(pack(&packed[..items.len()], to)?)
    }
}

/// Memory provided by the caller.
pub(crate) struct CallerBuffer {
    pub to: *mut c_void,
    pub capacity: usize,
    pub needed: *mut usize,
}

impl CallerBuffer {
    /// The first `room` bytes of it; `None` if `to` is NULL and the caller only requested their number. `name` and
    /// `value`: the argument that `room` depends on.
    ///
    /// # Safety
    /// `to` is a buffer of `capacity` bytes and `needed` an output, as [`text`] describes.
    pub unsafe fn bytes<'a>(
        self,
        name: &str,
        value: impl Display,
        room: Option<usize>,
    ) -> Outcome<Option<&'a mut [u8]>> {
        let Some(room) = room.filter(|&room| room <= isize::MAX as usize) else {
            return Err(Failure::argument(name, value, "such that all of it fits into memory"));
        };
        if !self.needed.is_null() {
            // SAFETY: as the caller promises.
            unsafe { text::output(self.needed, "needed") }?.write(room);
        }
        if self.to.is_null() && !self.needed.is_null() {
            return Ok(None);
        }
        if self.capacity < room {
            return Err(Failure::argument("capacity", self.capacity, &format!("{room} bytes or more")));
        }
        if room == 0 {
            return Ok(Some(&mut []));
        }
        let to = self.to.cast();
        text::check_array(to, room, "to")?;
        // SAFETY: by the caller's promise `to` is valid for `capacity` bytes and not used elsewhere; `room` is no more
        // than that. The bytes are only written, and any value is valid.
        Ok(Some(unsafe { std::slice::from_raw_parts_mut(to, room) }))
    }
}

/// The ECHOCAST_TYPE_ number of a type of packed columns.
pub(crate) fn number_of_packed(kind: PackType) -> i32 {
    match kind {
        PackType::F32 => ECHOCAST_TYPE_F32,
        PackType::F64 => ECHOCAST_TYPE_F64,
        PackType::U8 => ECHOCAST_TYPE_U8,
        PackType::U16 => ECHOCAST_TYPE_U16,
        PackType::U32 => ECHOCAST_TYPE_U32,
        PackType::I8 => ECHOCAST_TYPE_I8,
        PackType::I16 => ECHOCAST_TYPE_I16,
        PackType::I32 => ECHOCAST_TYPE_I32,
        PackType::I64 => ECHOCAST_TYPE_I64,
        PackType::U64 => ECHOCAST_TYPE_U64,
    }
}

fn pack_type(number: i32) -> Outcome<PackType> {
    Ok(match number {
        ECHOCAST_TYPE_F32 => PackType::F32,
        ECHOCAST_TYPE_F64 => PackType::F64,
        ECHOCAST_TYPE_U8 => PackType::U8,
        ECHOCAST_TYPE_U16 => PackType::U16,
        ECHOCAST_TYPE_U32 => PackType::U32,
        ECHOCAST_TYPE_I8 => PackType::I8,
        ECHOCAST_TYPE_I16 => PackType::I16,
        ECHOCAST_TYPE_I32 => PackType::I32,
        ECHOCAST_TYPE_I64 => PackType::I64,
        ECHOCAST_TYPE_U64 => PackType::U64,
        other => return Err(Failure::argument("kind", other, "1 to 10, an ECHOCAST_TYPE_ number")),
    })
}
