//! Results: the points of scans, column by column.

use crate::boxes::echocast_box;
use crate::context::Context;
use crate::guard::{Failure, Outcome, echocast_status, guard, guard_or};
use crate::handle::{self, handles};
use crate::image::Images;
use crate::scan::{Inputs, Reused};
use crate::scene::{echocast_pose, label_table, put_label_number};
use crate::text;
use echocast::cloud::{Column, ColumnType, PackItem, PackType};
use echocast::scene::Labels;
use echocast::{Field, FieldSet, Frame, PointCloud, Sensor};
use std::collections::HashMap;
use std::ffi::{CString, c_char, c_void};
use std::fmt::Display;
use std::ptr;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

/// Points, column by column. Any number of threads may read a result; only one at a time may change it.
pub struct echocast_result(());

handles! {
    echocast_result: RwLock<ResultPoints>, "result", 7;
}

/// The points of a result, and memory that a scan reuses.
pub struct ResultPoints {
    pub(crate) context: Arc<Context>,
    pub(crate) cloud: PointCloud,
    pub(crate) inputs: Inputs,
    /// The sensor of all points; `None` if they come from several.
    pub(crate) sensor: Option<Arc<Sensor>>,
    /// The boxes of `cloud` as structures of C.
    pub(crate) boxes: Vec<echocast_box>,
    pub(crate) images: Mutex<Images>,
    names: Mutex<LabelStrings>,
}

/// Label names that were requested, as C strings.
#[derive(Default)]
pub(crate) struct LabelStrings {
    /// The labels that they belong to.
    labels: Arc<Labels>,
    /// By table and number.
    texts: HashMap<(&'static str, u32), CString>,
}

impl LabelStrings {
    /// Name of a number in a table of `labels`, valid as long as these names belong to the same labels; NULL if there
    /// is none.
    pub fn get(&mut self, labels: &Arc<Labels>, table: &str, number: u32) -> Outcome<*const c_char> {
        let (stem, names) = label_table(labels, table)?;
        let Some(name) = names.name(number) else { return Ok(ptr::null()) };
        if !Arc::ptr_eq(&self.labels, labels) {
            // The names of earlier scenes are no longer valid.
            *self = LabelStrings { labels: labels.clone(), ..LabelStrings::default() };
        }
        let made = || CString::new(name.replace('\0', "?")).unwrap_or_default();
        Ok(self.texts.entry((stem, number)).or_insert_with(made).as_ptr())
    }
}

impl Reused for ResultPoints {
    fn new(context: &Arc<Context>) -> ResultPoints {
        let (cloud, inputs, sensor, boxes, images, names) = Default::default();
        ResultPoints { context: context.clone(), cloud, inputs, sensor, boxes, images, names }
    }

    fn context(&self) -> &Arc<Context> {
        &self.context
    }
}

impl ResultPoints {
    /// Runs `scan`, a scan by `sensor`.
    pub(crate) fn scanned(&mut self, sensor: &Arc<Sensor>, scan: impl FnOnce(&mut ResultPoints) -> Outcome) -> Outcome {
        let done = scan(self);
        // On an error the points are unchanged, or there are none.
        let sensor = if done.is_ok() { Some(sensor.clone()) } else { self.sensor.take() };
        self.changed(sensor);
        done
    }

    /// Updates what is derived from the points: to be called whenever they may have changed. `sensor`: the one that
    /// they now come from.
    fn changed(&mut self, sensor: Option<Arc<Sensor>>) {
        let images = self.images.get_mut().unwrap_or_else(PoisonError::into_inner);
        images.clear();
        let same = |old: &Arc<Sensor>| sensor.as_ref().is_some_and(|new| Arc::ptr_eq(old, new));
        if !self.sensor.as_ref().is_some_and(same) {
            images.forget_sensor();
        }
        self.sensor = sensor;
        self.boxes.clear();
        self.boxes.extend(self.cloud.boxes.iter().flatten().map(echocast_box::of));
    }
}

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

/// Information on a result; ECHOCAST_RESULT_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_result_info {
    /// sizeof(echocast_result_info).
    pub struct_size: usize,
    /// Points.
    pub count: usize,
    /// Rows of the range image, if every beam has its point (scan_desc.organised); else 0. For side-scan and imaging
    /// sonars, a row is a beam and a column is a range bin.
    pub rows: u32,
    /// Columns of the range image, or 0.
    pub columns: u32,
    /// Frame of the positions: an ECHOCAST_COORDINATES_ number.
    pub coordinates: i32,
    /// Full scale of the column `intensity`: 1 or 255; 0 if it has none, as for levels in dB.
    pub intensity_full_scale: f32,
    /// World position, metres, that the columns x, y, z, true_x to true_z and corrected_x to corrected_z are
    /// relative to.
    pub origin: [f64; 3],
    /// Pose of the sensor at the start of the scan.
    pub sensor_pose: echocast_pose,
}

impl Default for echocast_result_info {
    fn default() -> Self {
        echocast_result_info {
            struct_size: size_of::<Self>(),
            count: 0,
            rows: 0,
            columns: 0,
            coordinates: 0,
            intensity_full_scale: 0.0,
            origin: [0.0; 3],
            sensor_pose: echocast_pose::IDENTITY,
        }
    }
}

text::versioned!(echocast_result_info {
    struct_size,
    count,
    rows,
    columns,
    coordinates,
    intensity_full_scale,
    origin,
    sensor_pose,
});

/// Runs `look` on the points while no thread changes them.
pub(crate) fn look<T>(result: *const echocast_result, look: impl FnOnce(&ResultPoints) -> Outcome<T>) -> Outcome<T> {
    let result = handle::get(result, "result")?;
    look(&*handle::read(&result, "result")?)
}

/// Gets information on a result. The caller sets struct_size of `*info`.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_get_info(
    result: *const echocast_result,
    info: *mut echocast_result_info,
) -> echocast_status {
    guard(|| {
        look(result, |points| {
            let cloud = &points.cloud;
            let [rows, columns] = cloud.organised.unwrap_or_default();
            let found = echocast_result_info {
                struct_size: size_of::<echocast_result_info>(),
                count: cloud.len,
                rows,
                columns,
                coordinates: match cloud.frame {
                    Frame::World => crate::ECHOCAST_COORDINATES_WORLD,
                    Frame::Sensor => crate::ECHOCAST_COORDINATES_SENSOR,
                },
                intensity_full_scale: cloud.intensity_full_scale.unwrap_or(0.0),
                origin: cloud.origin.to_array(),
                sensor_pose: echocast_pose::of(&cloud.sensor_pose),
            };
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// The number of points; 0 for an invalid handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_count(result: *const echocast_result) -> usize {
    guard_or(0, || look(result, |points| Ok(points.cloud.len)))
}

/// Gives access to a column without copying it. The view is valid until the result is used for another scan, appended
/// to or released.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such column, or one that was not computed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// echocast_view view;
/// echocast_result_view(result, "range", &view);
/// const float *range = view.data;
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_view(
    result: *const echocast_result,
    column: *const c_char,
    out: *mut echocast_view,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(echocast_view::NONE);
        // SAFETY: `column` is a string (see `text`).
        let name = unsafe { text::required(column, "column") }?;
        look(result, |points| {
            let field = computed(points.cloud.fields, name)?;
            *out = echocast_view::of(&points.cloud.column(field));
            Ok(())
        })
    })
}

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

/// Most columns of a packed point.
const MOST_ITEMS: usize = 64;

/// Writes the points in the host's layout, all at once: point i at `to + i * stride`, each column converted to its type
/// at its offset; bytes that no item covers stay unchanged. Numbers are rounded to the nearest value of the type;
/// not-a-number becomes 0 in integers. Positions are relative to the result's origin as ECHOCAST_TYPE_F32, and absolute
/// as ECHOCAST_TYPE_F64. Up to 64 items. `capacity`: size of `to`, bytes; `*needed` (may be NULL): stride * points; if
/// `to` is NULL, only that is written.
///
/// Errors: ECHOCAST_E_ARGUMENT (a wrong item, too little room), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// // Positions, and the category in a byte; echocast_result_pack_driver has the layouts of ROS 2 drivers.
/// static const echocast_pack_item items[] = {
///     {"x", ECHOCAST_TYPE_F32, 0, 0, 1}, {"y", ECHOCAST_TYPE_F32, 4, 0, 1},
///     {"z", ECHOCAST_TYPE_F32, 8, 0, 1}, {"category_id", ECHOCAST_TYPE_U8, 12, 0, 1}};
/// echocast_result_pack(result, items, 4, 16, bytes, sizeof bytes, NULL);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_pack(
    result: *const echocast_result,
    items: *const echocast_pack_item,
    item_count: usize,
    stride: usize,
    to: *mut c_void,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        let to = Packing { items, item_count, stride, to, capacity, needed };
        look(result, |points| {
            let cloud = &points.cloud;
            let pack =
                |items: &[PackItem], to: &mut [u8]| points.context.engine.install(|| cloud.pack(items, stride, to));
            // SAFETY: `items` is an array, `to` a buffer and `needed` an output (see `text`).
            unsafe { to.fill(cloud.fields, cloud.packed_len(stride), pack) }
        })
    })
}

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
            *to = PackItem {
                field: computed(fields, name).map_err(at)?,
                kind: pack_type(item.kind).map_err(at)?,
                offset: item.offset as usize,
                shift: item.shift,
                scale: if item.scale == 0.0 { 1.0 } else { item.scale },
            };
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

/// The name of a label number. `table`: "category", "part", "material" or "instance". NULL if it has none.
///
/// Valid until the result is used for another scan or released.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_label_name(
    result: *const echocast_result,
    table: *const c_char,
    number: u32,
) -> *const c_char {
    guard_or(ptr::null(), || {
        // SAFETY: `table` is a string (see `text`).
        let table = unsafe { text::required(table, "table") }?;
        look(result, |points| {
            let mut names = points.names.lock().unwrap_or_else(PoisonError::into_inner);
            names.get(&points.cloud.labels, table, number)
        })
    })
}

/// Gets the number of a label by its name. `table`: "category", "part", "material" or "instance", of which the first
/// with the name counts.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_label_number(
    result: *const echocast_result,
    table: *const c_char,
    name: *const c_char,
    number: *mut u32,
) -> echocast_status {
    // SAFETY: `table` and `name` are strings and `number` an output (see `text`).
    unsafe { put_label_number(table, name, number, |put| look(result, |points| put(&points.cloud.labels))) }
}

/// Appends the points of another scan of the same scene with the same columns, to be written to one file.
///
/// Errors: ECHOCAST_E_ARGUMENT (a scan that does not fit), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY;
/// nothing is then appended.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_append(
    result: *mut echocast_result,
    other: *const echocast_result,
) -> echocast_status {
    guard(|| {
        let (result, other) = (handle::get(result, "result")?, handle::get(other, "other")?);
        if Arc::ptr_eq(&result, &other) {
            return Err(Failure::argument("other", "the same result", "another one"));
        }
        let mut result = handle::write(&result, "result")?;
        let other = handle::read(&other, "other")?;
        // An empty result takes the sensor of what is appended.
        let sensor = if result.cloud.fields == FieldSet::EMPTY {
            other.sensor.clone()
        } else {
            let same = |sensor: &Arc<Sensor>| other.sensor.as_ref().is_some_and(|more| Arc::ptr_eq(sensor, more));
            result.sensor.clone().filter(same)
        };
        result.cloud.append(&other.cloud)?;
        result.changed(sensor);
        Ok(())
    })
}

/// Releases a result. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_release(result: *mut echocast_result) {
    guard(|| {
        handle::release(result);
        Ok(())
    });
}
