//! Clouds and pings in the memory layouts of other programs: PointCloud2, PCL's point types, Autoware's; images of
//! sonars.

use super::points::offset;
use super::record::{self, BLOCK_BYTES};
use super::{Column, Field, FieldSet, Ping, PointCloud};
use bytemuck::NoUninit;
use ground::error::{Error, Result};
use ground::parallel;
use std::ops::Range;

/// Type of a number in a packed row, in the machine's byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PackType {
    /// 32-bit IEEE float.
    F32,
    /// 64-bit IEEE float.
    F64,
    /// Unsigned byte.
    U8,
    /// 16-bit unsigned.
    U16,
    /// 32-bit unsigned.
    U32,
    /// Signed byte.
    I8,
    /// 16-bit signed.
    I16,
    /// 32-bit signed.
    I32,
    /// 64-bit signed.
    I64,
    /// 64-bit unsigned.
    U64,
}

impl PackType {
    /// Bytes of one number.
    pub const fn size(self) -> usize {
        match self {
            PackType::U8 | PackType::I8 => 1,
            PackType::U16 | PackType::I16 => 2,
            PackType::F32 | PackType::U32 | PackType::I32 => 4,
            PackType::F64 | PackType::I64 | PackType::U64 => 8,
        }
    }
}

/// A number in every packed row: see [`PointCloud::pack`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PackItem {
    /// Column that it comes from.
    pub field: Field,
    /// Type in the packed row.
    pub kind: PackType,
    /// Its first byte in the row; any, aligned or not.
    pub offset: usize,
    /// Subtracted from the column's number first, in its unit; usually 0.
    pub shift: f64,
    /// Factor for the difference; usually 1.
    pub scale: f64,
}

impl PackItem {
    /// `field` as it is, as `kind` at `offset`.
    pub const fn new(field: Field, kind: PackType, offset: usize) -> PackItem {
        PackItem { field, kind, offset, shift: 0.0, scale: 1.0 }
    }
}

impl PointCloud {
    /// Writes row `i` at byte `i * stride` of `to`: for each of `items` a number of its type. All other bytes stay
    /// unchanged.
    ///
    /// Positions (`x`, `true_x` and so on) become world (or sensor) coordinates as [`PackType::F64`] and stay relative
    /// to [`PointCloud::origin`] as any other type. Then the item's shift is subtracted and the difference scaled.
    /// Floats become integers by rounding to the nearest, halves to even; values out of an integer type's range become
    /// its least or greatest value, NaN becomes 0.
    ///
    /// The work is shared by the threads of the enclosing `Engine::install`, or by rayon's.
    ///
    /// # Errors
    /// A column that was not computed; an item that extends past `stride` or overlaps another; a stride of 0; a `to`
    /// that is shorter than [`PointCloud::packed_len`].
    pub fn pack(&self, items: &[PackItem], stride: usize, to: &mut [u8]) -> Result<()> {
        check_items(self.fields, items, stride)?;
        let to = room(to, self.len, stride)?;
        let rows = (BLOCK_BYTES / stride).max(1);
        parallel::for_each_chunk(to, rows * stride, |block, records| {
            let first = block * rows;
            let rows = first..first + records.len() / stride;
            for item in items {
                put(self.column(item.field), self.offset(item.field), item, records, stride, &rows);
            }
        });
        Ok(())
    }

    /// Bytes of all rows, packed `stride` bytes apart; `None` if there are too many for any memory.
    pub fn packed_len(&self, stride: usize) -> Option<usize> {
        self.len.checked_mul(stride)
    }
}

impl Ping {
    /// Writes the cells as an image with a row for each bin, the nearest first, and a pixel of `stride` bytes for each
    /// beam: cell `beam * bins + bin` at byte `(bin * beams + beam) * stride` of `to`, a number for each of `items`.
    /// This is the layout of sonar images in ROS. Numbers are converted as in [`PointCloud::pack`], on the same
    /// threads.
    ///
    /// # Errors
    /// As [`PointCloud::pack`].
    pub fn pack(&self, items: &[PackItem], stride: usize, to: &mut [u8]) -> Result<()> {
        self.check("ping")?;
        check_items(self.fields, items, stride)?;
        let (beams, bins) = (self.layout.beams(), self.layout.bins);
        let to = room(to, self.layout.cells(), stride)?;
        let line = beams * stride;
        let lines = (BLOCK_BYTES / line).max(1);
        parallel::for_each_chunk(to, lines * line, |block, records| {
            for (bin, records) in (block * lines..).zip(records.chunks_exact_mut(line)) {
                for item in items {
                    let offset = offset(self.origin, item.field);
                    put(self.column(item.field), offset, item, records, stride, &AcrossBeams { bin, bins });
                }
            }
        });
        Ok(())
    }

    /// Bytes of all cells, packed `stride` bytes apart; `None` if there are too many for any memory.
    pub fn packed_len(&self, stride: usize) -> Option<usize> {
        self.layout.cells().checked_mul(stride)
    }
}

/// The part of `to` that `rows` rows fill.
pub(super) fn room(to: &mut [u8], rows: usize, stride: usize) -> Result<&mut [u8]> {
    let length = to.len();
    rows.checked_mul(stride).and_then(|needed| to.get_mut(..needed)).ok_or_else(|| {
        let needed = rows as u128 * stride as u128;
        let allowed = format!("{needed} bytes or more, {rows} rows of {stride} bytes");
        Error::invalid("memory to pack into", format!("{length} bytes long"), allowed)
    })
}

/// Checks that the columns that `items` need are among `fields`, and that each has bytes of its own.
fn check_items(fields: FieldSet, items: &[PackItem], stride: usize) -> Result<()> {
    if stride == 0 {
        return Err(Error::invalid("stride", 0, "1 byte or more"));
    }
    let name = |index: usize| format!("item {index} ({})", items[index].field.info().name);
    let bytes = |item: &PackItem| item.offset..item.offset.saturating_add(item.kind.size());
    for (index, item) in items.iter().enumerate() {
        if !fields.contains(item.field) {
            let columns: Vec<&str> = fields.iter().map(|info| info.name).collect();
            let allowed = format!("columns that were: {}", columns.join(", "));
            return Err(Error::invalid(name(index), "a column that was not computed", allowed));
        }
        let Range { start, end } = bytes(item);
        let found = || format!("from byte {start} to {end}");
        if end > stride {
            return Err(Error::invalid(name(index), found(), format!("up to the stride, {stride}")));
        }
        let over = |other: &PackItem| bytes(other).start < end && start < bytes(other).end;
        if let Some(other) = items[..index].iter().position(over) {
            let allowed = format!("bytes other than those of {}", name(other));
            return Err(Error::invalid(name(index), found(), allowed));
        }
    }
    Ok(())
}

/// The elements of a column that become successive records.
trait RowSelection {
    fn of<'c, E>(&self, column: &'c [E]) -> impl Iterator<Item = &'c E>;
}

impl RowSelection for Range<usize> {
    fn of<'c, E>(&self, column: &'c [E]) -> impl Iterator<Item = &'c E> {
        column[self.clone()].iter()
    }
}

/// The elements of one bin, beam by beam.
struct AcrossBeams {
    bin: usize,
    bins: usize,
}

impl RowSelection for AcrossBeams {
    fn of<'c, E>(&self, column: &'c [E]) -> impl Iterator<Item = &'c E> {
        column[self.bin..].iter().step_by(self.bins)
    }
}

/// Writes one number of each of `rows` of `column`, whose 0 is at `offset`, into its record.
fn put(
    column: Column,
    offset: Option<f64>,
    item: &PackItem,
    records: &mut [u8],
    stride: usize,
    rows: &impl RowSelection,
) {
    match item.kind {
        PackType::F32 => put_as::<f32>(column, None, item, records, stride, rows),
        PackType::F64 => put_as::<f64>(column, offset, item, records, stride, rows),
        PackType::U8 => put_as::<u8>(column, None, item, records, stride, rows),
        PackType::U16 => put_as::<u16>(column, None, item, records, stride, rows),
        PackType::U32 => put_as::<u32>(column, None, item, records, stride, rows),
        PackType::I8 => put_as::<i8>(column, None, item, records, stride, rows),
        PackType::I16 => put_as::<i16>(column, None, item, records, stride, rows),
        PackType::I32 => put_as::<i32>(column, None, item, records, stride, rows),
        PackType::I64 => put_as::<i64>(column, None, item, records, stride, rows),
        PackType::U64 => put_as::<u64>(column, None, item, records, stride, rows),
    }
}

fn put_as<T: PackedNumber>(
    column: Column,
    offset: Option<f64>,
    item: &PackItem,
    records: &mut [u8],
    stride: usize,
    rows: &impl RowSelection,
) {
    let (offset, shift, scale, at) = (offset.unwrap_or(0.0), item.shift, item.scale, item.offset);
    if (offset, shift, scale) == (0.0, 0.0, 1.0) {
        match column {
            Column::F32(c) => record::put(records, stride, at, rows.of(c), |&v| T::from_f64(v.into())),
            Column::F64(c) => record::put(records, stride, at, rows.of(c), |&v| T::from_f64(v)),
            Column::U8(c) => record::put(records, stride, at, rows.of(c), |&v| T::from_u32(v.into())),
            Column::U16(c) => record::put(records, stride, at, rows.of(c), |&v| T::from_u32(v.into())),
            Column::U32(c) => record::put(records, stride, at, rows.of(c), |&v| T::from_u32(v)),
        }
        return;
    }
    let of = |v: f64| T::from_f64((v + offset - shift) * scale);
    match column {
        Column::F32(c) => record::put(records, stride, at, rows.of(c), |&v| of(v.into())),
        Column::F64(c) => record::put(records, stride, at, rows.of(c), |&v| of(v)),
        Column::U8(c) => record::put(records, stride, at, rows.of(c), |&v| of(v.into())),
        Column::U16(c) => record::put(records, stride, at, rows.of(c), |&v| of(v.into())),
        Column::U32(c) => record::put(records, stride, at, rows.of(c), |&v| of(v.into())),
    }
}

/// A type of packed numbers, converted from those of any column.
trait PackedNumber: NoUninit {
    fn from_f64(value: f64) -> Self;
    fn from_u32(value: u32) -> Self;
}

macro_rules! floats {
    ($($t:ty)*) => {$(
        impl PackedNumber for $t {
            fn from_f64(value: f64) -> Self { value as $t }
            fn from_u32(value: u32) -> Self { value as $t }
        }
    )*};
}
floats! { f32 f64 }

macro_rules! integers {
    ($($t:ty)*) => {$(
        impl PackedNumber for $t {
            // The cast saturates and turns NaN into 0.
            fn from_f64(value: f64) -> Self { nearest(value) as $t }
            // The greatest value of a wider type becomes the greatest u32 here.
            fn from_u32(value: u32) -> Self { value.min(<$t>::MAX as u32) as $t }
        }
    )*};
}
integers! { u8 u16 u32 i8 i16 i32 i64 u64 }

/// The integer nearest to `value`, halves to even.
fn nearest(value: f64) -> f64 {
    /// The sum of this and a smaller number has no bits below 1; much faster than calling the C library.
    const WHOLE: f64 = (1u64 << 52) as f64;
    if value.abs() < WHOLE { (value.abs() + WHOLE - WHOLE).copysign(value) } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FieldSet;
    use PackType::*;
    use glam::DVec3;

    const fn item(field: Field, kind: PackType, offset: usize) -> PackItem {
        PackItem::new(field, kind, offset)
    }

    /// A cloud far from the world's origin.
    fn cloud(rows: usize) -> PointCloud {
        let mut cloud = PointCloud { len: rows, origin: DVec3::new(5e5, 5.6e6, 100.0), ..PointCloud::default() };
        cloud.fields = FieldSet::parse("x,y,z,intensity,return_number,channel,category_id,time").unwrap();
        let c = &mut cloud.columns;
        c.x = (0..rows).map(|row| row as f32 / 8.0).collect();
        c.y = (0..rows).map(|row| -(row as f32)).collect();
        c.z = vec![0.5; rows];
        c.intensity = (0..rows).map(|row| (row % 300) as f32).collect();
        c.return_number = vec![1; rows];
        c.channel = (0..rows).map(|row| (row % 1000) as u16).collect();
        c.category_id = (0..rows as u32).collect();
        c.time = (0..rows).map(|row| row as f64 * 1e-6).collect();
        cloud
    }

    /// The `N` bytes at `offset` in row `row`.
    fn bytes<const N: usize>(packed: &[u8], stride: usize, row: usize, offset: usize) -> [u8; N] {
        packed[row * stride + offset..][..N].try_into().unwrap()
    }

    #[test]
    fn rows_are_packed_as_in_a_point_cloud_2() {
        let cloud = cloud(10_000);
        let items = [
            item(Field::X, F32, 0),
            item(Field::Y, F32, 4),
            item(Field::Z, F32, 8),
            item(Field::Intensity, F32, 12),
            item(Field::Channel, U16, 16),
            item(Field::Time, F64, 18),
        ];
        let pack = |threads| {
            let mut packed = vec![0xee; 26 * 10_000 + 5];
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| cloud.pack(&items, 26, &mut packed)).unwrap();
            packed
        };
        let packed = pack(1);
        assert!(packed == pack(3));
        let c = &cloud.columns;
        for row in 0..10_000 {
            let float = |offset| f32::from_ne_bytes(bytes(&packed, 26, row, offset));
            assert_eq!([0, 4, 8, 12].map(float), [c.x[row], c.y[row], c.z[row], c.intensity[row]]);
            assert_eq!(u16::from_ne_bytes(bytes(&packed, 26, row, 16)), c.channel[row]);
            assert_eq!(f64::from_ne_bytes(bytes(&packed, 26, row, 18)), c.time[row]);
        }
        assert_eq!(packed[26 * 10_000..], [0xee; 5]);
        assert_eq!(cloud.packed_len(26), Some(260_000));
    }

    #[test]
    fn rows_are_packed_as_in_autowares_points() {
        let mut cloud = cloud(3);
        cloud.columns.intensity = vec![254.5, 400.0, f32::NAN];
        cloud.columns.time = vec![0.5, 1.5, -1.0];
        // Without azimuth, elevation and distance, which are floats like x.
        let items = [
            item(Field::X, F32, 0),
            item(Field::Y, F32, 4),
            item(Field::Z, F32, 8),
            item(Field::Intensity, U8, 12),
            item(Field::ReturnNumber, U8, 13),
            item(Field::Channel, U16, 14),
            item(Field::Time, U32, 28),
        ];
        let mut packed = vec![7; 96];
        cloud.pack(&items, 32, &mut packed).unwrap();
        for (row, (intensity, time)) in [(254, 0u32), (255, 2), (0, 0)].into_iter().enumerate() {
            assert_eq!(bytes(&packed, 32, row, 4), cloud.columns.y[row].to_ne_bytes());
            assert_eq!(bytes(&packed, 32, row, 12), [intensity, 1]);
            assert_eq!(bytes(&packed, 32, row, 14), (row as u16).to_ne_bytes());
            assert_eq!(bytes(&packed, 32, row, 16), [7; 12]);
            assert_eq!(bytes(&packed, 32, row, 28), time.to_ne_bytes());
        }
    }

    #[test]
    fn positions_are_complete_in_double_precision_only() {
        let mut cloud = cloud(2);
        cloud.fields = cloud.fields.with(Field::TrueZ);
        cloud.columns.true_z = vec![0.25; 2];
        let items = [item(Field::Y, F64, 1), item(Field::TrueZ, F64, 9), item(Field::Y, I32, 17)];
        let mut packed = vec![0; 42];
        cloud.pack(&items, 21, &mut packed).unwrap();
        assert_eq!(f64::from_ne_bytes(bytes(&packed, 21, 1, 1)), 5.6e6 - 1.0);
        assert_eq!(f64::from_ne_bytes(bytes(&packed, 21, 1, 9)), 100.25);
        assert_eq!(i32::from_ne_bytes(bytes(&packed, 21, 1, 17)), -1);
    }

    #[test]
    fn numbers_are_rounded_and_kept_within_their_type() {
        fn of<T: PackedNumber + PartialEq + std::fmt::Debug>(cases: &[(f64, T)]) {
            for &(value, expected) in cases {
                assert_eq!(T::from_f64(value), expected, "{value}");
            }
        }
        of::<u8>(&[(0.5, 0), (1.5, 2), (2.5, 2), (254.6, 255), (1e9, 255), (-1.0, 0), (f64::NAN, 0)]);
        of::<i8>(&[(-0.5, 0), (-1.5, -2), (127.4, 127), (f64::INFINITY, 127), (f64::NEG_INFINITY, -128)]);
        of::<i32>(&[
            (2_147_483_646.5, 2_147_483_646),
            (1e10, i32::MAX),
            (-1e10, i32::MIN),
            (0.499_999_999_999_999_94, 0),
        ]);
        of::<u16>(&[(65_535.4, 65_535)]);
        of::<i16>(&[(-32_768.4, i16::MIN)]);
        of::<u32>(&[(4_294_967_294.6, u32::MAX)]);
        let half = 2_251_799_813_685_249.5; // 2^51 + 1.5
        of::<i64>(&[
            (half, half as i64 + 1),
            (-half, -(half as i64) - 1),
            (-1e300, i64::MIN),
            (9e15, 9_000_000_000_000_000),
        ]);
        of::<u64>(&[(1e300, u64::MAX), (9.007_199_254_740_993e15, 9_007_199_254_740_992)]);
        of::<f32>(&[(1e300, f32::INFINITY), (0.1, 0.1)]);
        let large = u32::MAX;
        assert_eq!((u8::from_u32(256), u16::from_u32(large), u32::from_u32(large)), (255, 65_535, large));
        assert_eq!((i8::from_u32(128), i16::from_u32(large), i32::from_u32(large)), (127, 32_767, i32::MAX));
        assert_eq!((i64::from_u32(large), u64::from_u32(large)), (large.into(), large.into()));
        assert_eq!((f32::from_u32(large), f64::from_u32(large)), (4_294_967_296.0, 4_294_967_295.0));
    }

    #[test]
    fn every_column_becomes_every_type() {
        let cloud = cloud(1000);
        for field in cloud.fields.iter().map(|info| info.field) {
            for kind in [F32, F64, U8, U16, U32, I8, I16, I32, I64, U64] {
                let mut packed = vec![0; 8000];
                cloud.pack(&[item(field, kind, 0)], 8, &mut packed).unwrap();
                for row in [0, 100, 999] {
                    let is = match kind {
                        F32 => f32::from_ne_bytes(bytes(&packed, 8, row, 0)).into(),
                        F64 => f64::from_ne_bytes(bytes(&packed, 8, row, 0)) - cloud.offset(field).unwrap_or(0.0),
                        U8 => u8::from_ne_bytes(bytes(&packed, 8, row, 0)).into(),
                        U16 => u16::from_ne_bytes(bytes(&packed, 8, row, 0)).into(),
                        U32 => u32::from_ne_bytes(bytes(&packed, 8, row, 0)).into(),
                        I8 => i8::from_ne_bytes(bytes(&packed, 8, row, 0)).into(),
                        I16 => i16::from_ne_bytes(bytes(&packed, 8, row, 0)).into(),
                        I32 => i32::from_ne_bytes(bytes(&packed, 8, row, 0)).into(),
                        I64 => i64::from_ne_bytes(bytes(&packed, 8, row, 0)) as f64,
                        U64 => u64::from_ne_bytes(bytes(&packed, 8, row, 0)) as f64,
                    };
                    let (low, high) = match kind {
                        U8 => (0.0, 255.0),
                        U16 | U32 | U64 => (0.0, 65_535.0),
                        I8 => (-128.0, 127.0),
                        _ => (-32_768.0, 32_767.0),
                    };
                    let value = cloud.column(field).get_f64(row).clamp(low, high);
                    let slack = if matches!(kind, F32 | F64) { 1e-9 } else { 0.5 };
                    assert!((is - value).abs() <= slack, "{field:?} {kind:?} {row}: {is}, {value}");
                }
            }
        }
    }

    #[test]
    fn pings_are_packed_bin_by_bin() {
        let layout = crate::cells::Layout {
            axes: vec![[0.0; 2]; 300],
            bins: 200,
            threshold_db: vec![0.0; 200],
            tvg_db: vec![0.0; 200],
            ..crate::cells::Layout::default()
        };
        let mut ping = Ping { layout: layout.into(), origin: DVec3::new(0.0, 5.6e6, 0.0), ..Ping::default() };
        ping.fields = FieldSet::parse("intensity,category_id,true_y").unwrap();
        ping.cells.intensity = (0..60_000).map(|cell| cell as f32 / 100.0).collect();
        ping.cells.category_id = (0..60_000).collect();
        ping.cells.true_y = vec![0.25; 60_000];
        // From 100 dB on, one step per 2 dB.
        let level = PackItem { shift: 100.0, scale: 0.5, ..item(Field::Intensity, U8, 0) };
        let items = [level, item(Field::CategoryId, U16, 1), item(Field::TrueY, F64, 3)];
        let pack = |threads| {
            let mut packed = vec![0xee; 11 * 60_000 + 5];
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ping.pack(&items, 11, &mut packed)).unwrap();
            packed
        };
        let packed = pack(1);
        assert!(packed == pack(3));
        for (row, cell) in (0..200).flat_map(|bin| (0..300).map(move |beam| beam * 200 + bin)).enumerate() {
            let expected_level = u8::from_f64((cell as f64 / 100.0 - 100.0) / 2.0);
            assert!(bytes::<1>(&packed, 11, row, 0)[0].abs_diff(expected_level) <= 1, "{row}");
            assert_eq!(bytes(&packed, 11, row, 1), (cell as u16).to_ne_bytes());
            assert_eq!(f64::from_ne_bytes(bytes(&packed, 11, row, 3)), 5.6e6 + 0.25);
        }
        assert_eq!(packed[11 * 60_000..], [0xee; 5]);
        assert_eq!(ping.packed_len(11), Some(660_000));
        let error = ping.pack(&items, 11, &mut [0; 659_999]).unwrap_err().to_string();
        assert!(error.ends_with("allowed: 660000 bytes or more, 60000 rows of 11 bytes"), "{error}");
        let error = ping.pack(&[item(Field::PartId, U8, 0)], 1, &mut []).unwrap_err().to_string();
        assert!(error.ends_with("allowed: columns that were: intensity, category_id, true_y"), "{error}");
        assert!(Ping::default().pack(&[level], 1, &mut []).is_err());
    }

    #[test]
    fn layouts_that_do_not_fit_are_refused() {
        let cloud = cloud(10);
        let x = item(Field::X, F32, 0);
        let refused = |items: &[PackItem], stride, length| {
            let mut packed = vec![9; length];
            let error = cloud.pack(items, stride, &mut packed).unwrap_err().to_string();
            assert_eq!(packed, vec![9; length]);
            error
        };
        assert_eq!(refused(&[x], 0, 40), "stride is 0; allowed: 1 byte or more");
        assert_eq!(
            refused(&[x, item(Field::Range, F32, 4)], 8, 80),
            "item 1 (range) is a column that was not computed; allowed: columns that were: \
             x, y, z, intensity, category_id, return_number, channel, time"
        );
        assert_eq!(
            refused(&[x, item(Field::Time, F64, 4)], 11, 110),
            "item 1 (time) is from byte 4 to 12; allowed: up to the stride, 11"
        );
        assert!(refused(&[item(Field::X, U8, usize::MAX)], 8, 80).contains("to 18446744073709551615; allowed"));
        assert_eq!(
            refused(&[item(Field::Channel, U16, 7), x, item(Field::Y, F32, 3)], 16, 160),
            "item 2 (y) is from byte 3 to 7; allowed: bytes other than those of item 1 (x)"
        );
        assert_eq!(
            refused(&[x], 16, 159),
            "memory to pack into is 159 bytes long; allowed: 160 bytes or more, 10 rows of 16 bytes"
        );
        assert!(refused(&[x], usize::MAX, 159).contains("184467440737095516150 bytes or more"));
        cloud.pack(&[], 1, &mut [0; 10]).unwrap();
        PointCloud::default().pack(&[], 4, &mut []).unwrap();
    }
}
