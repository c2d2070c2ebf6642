//! Columns of results and pings, in place and packed.

use crate::guard::{Failure, Outcome};
use echocast::cloud::{Column, ColumnType};
use echocast::{Field, FieldSet};
use std::ffi::{c_char, c_void};
use std::ptr;

/// 32-bit IEEE float.
pub const ECHOCAST_TYPE_F32: i32 = 1;
/// 64-bit IEEE float.
pub const ECHOCAST_TYPE_F64: i32 = 2;
/// Unsigned 8-bit number.
pub const ECHOCAST_TYPE_U8: i32 = 3;
/// Unsigned 16-bit number.
pub const ECHOCAST_TYPE_U16: i32 = 4;
/// Unsigned 32-bit number.
pub const ECHOCAST_TYPE_U32: i32 = 5;
/// Signed 8-bit number; for packing only.
pub const ECHOCAST_TYPE_I8: i32 = 6;
/// Signed 16-bit number; for packing only.
pub const ECHOCAST_TYPE_I16: i32 = 7;
/// Signed 32-bit number; for packing only.
pub const ECHOCAST_TYPE_I32: i32 = 8;
/// Signed 64-bit number; for packing only.
pub const ECHOCAST_TYPE_I64: i32 = 9;
/// Unsigned 64-bit number; for packing only.
pub const ECHOCAST_TYPE_U64: i32 = 10;

/// A column of a result or a ping, in place.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_view {
    /// The first element; NULL if there are none.
    pub data: *const c_void,
    /// Number of elements: as many as the result has points, or the ping has cells.
    pub count: usize,
    /// Bytes from element to element.
    pub stride: usize,
    /// Type: ECHOCAST_TYPE_F32 to ECHOCAST_TYPE_U32.
    pub kind: i32,
    /// 0.
    pub reserved: i32,
}

impl echocast_view {
    /// An empty view.
    pub(crate) const NONE: Self = echocast_view { data: ptr::null(), count: 0, stride: 0, kind: 0, reserved: 0 };

    pub(crate) fn of(column: &Column) -> echocast_view {
        let (bytes, kind) = (column.bytes(), column.kind());
        echocast_view {
            data: if bytes.is_empty() { ptr::null() } else { bytes.as_ptr().cast() },
            count: column.len(),
            stride: kind.size(),
            kind: number_of(kind),
            reserved: 0,
        }
    }
}

/// A column in packed points.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_pack_item {
    /// Name of the column.
    pub column: *const c_char,
    /// Type in the packed point: an ECHOCAST_TYPE_ number.
    pub kind: i32,
    /// Offset in the packed point, bytes.
    pub offset: u32,
    /// Subtracted from the column's number first, in its unit: 0, or the start of the scan for times.
    pub shift: f64,
    /// Factor for the rest: 1 (0 also means 1), or 1e9 for nanoseconds, 255 for an intensity in bytes.
    pub scale: f64,
}

/// The ECHOCAST_TYPE_ number of a type.
pub(crate) fn number_of(kind: ColumnType) -> i32 {
    match kind {
        ColumnType::F32 => ECHOCAST_TYPE_F32,
        ColumnType::F64 => ECHOCAST_TYPE_F64,
        ColumnType::U8 => ECHOCAST_TYPE_U8,
        ColumnType::U16 => ECHOCAST_TYPE_U16,
        ColumnType::U32 => ECHOCAST_TYPE_U32,
    }
}

/// A column that is among those computed.
pub(crate) fn computed(fields: FieldSet, name: &str) -> Outcome<Field> {
    let field = Field::from_name(name)?;
    if fields.contains(field) {
        return Ok(field);
    }
    let has: Vec<&str> = fields.iter().map(|info| info.name).collect();
    Err(Failure::argument("column", format!("{name:?}, which was not computed"), &has.join(", ")))
}
