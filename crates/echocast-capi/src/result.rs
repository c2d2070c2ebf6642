//! Results: the points of scans, column by column.

use crate::boxes::{echocast_box, echocast_box_view};
use crate::column::{computed, echocast_pack_item, echocast_view, number_of};
use crate::context::Context;
use crate::guard::{Failure, Outcome, echocast_status, guard, guard_or};
use crate::handle::{self, handles};
use crate::image::{Images, echocast_image_box, echocast_image_box_view, echocast_image_view};
use crate::label::{LabelStrings, put_label_number};
use crate::pack::Packing;
use crate::pose::{ECHOCAST_COORDINATES_SENSOR, ECHOCAST_COORDINATES_WORLD, echocast_pose};
use crate::reuse::{Inputs, Reused};
use crate::text;
use echocast::PackItem;
use echocast::emitter::ImageGrid;
use echocast::image::Layer;
use echocast::{FieldSet, Frame, PointCloud, Sensor};
use std::ffi::{c_char, c_void};
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
    /// Most rays that a beam was given, apart from those behind mirrors and glass: what beam.sub_rays allows, or less
    /// if scan_desc.time_budget_ns requires it; 0 for sonars.
    pub most_rays: u32,
    /// 0.
    pub reserved: u32,
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
            most_rays: 0,
            reserved: 0,
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
    most_rays,
    reserved,
});

/// Runs `look` on the points while no thread changes them.
pub(crate) fn look<T>(result: *const echocast_result, look: impl FnOnce(&ResultPoints) -> Outcome<T>) -> Outcome<T> {
    let result = handle::get(result, "result")?;
    look(&*handle::read(&result, "result")?)
}

/// Runs `make` on the images of the points and the grid of their sensor.
fn with_images<T>(points: &ResultPoints, make: impl FnOnce(&mut Images, &ImageGrid) -> Outcome<T>) -> Outcome<T> {
    let Some(sensor) = &points.sensor else {
        let found = "of scans of several sensors, or of one that was changed between them";
        return Err(Failure::argument("result", found, "scans of one sensor, of which images are made"));
    };
    // What a panic left half made is not marked as made.
    let mut images = points.images.lock().unwrap_or_else(PoisonError::into_inner);
    let grid = match images.grid.take() {
        Some(grid) => grid,
        None => sensor.image_grid()?,
    };
    let made = make(&mut images, &grid);
    images.grid = Some(grid);
    made
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
            let [rows, columns] = cloud.organised().unwrap_or_default();
            let found = echocast_result_info {
                struct_size: size_of::<echocast_result_info>(),
                count: cloud.len(),
                rows,
                columns,
                coordinates: match cloud.frame {
                    Frame::World => ECHOCAST_COORDINATES_WORLD,
                    Frame::Sensor => ECHOCAST_COORDINATES_SENSOR,
                },
                intensity_full_scale: cloud.intensity_full_scale.unwrap_or(0.0),
                origin: cloud.origin.to_array(),
                sensor_pose: echocast_pose::of(&cloud.sensor_pose),
                most_rays: cloud.most_rays,
                reserved: 0,
            };
            // SAFETY: `info` is a structure (see `text`).
            unsafe { text::put_structure(found, info, "info") }
        })
    })
}

/// The number of points; 0 for an invalid handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_count(result: *const echocast_result) -> usize {
    guard_or(0, || look(result, |points| Ok(points.cloud.len())))
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
            let field = computed(points.cloud.fields(), name)?;
            *out = echocast_view::of(&points.cloud.column(field));
            Ok(())
        })
    })
}

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
            unsafe { to.fill(cloud.fields(), cloud.packed_len(stride), pack) }
        })
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

/// Gives access to the boxes around the labelled instances that a scan with `boxes` sees, in place, sorted by
/// instance_id; those of appended results follow in order. Objects with the same instance_id share a box.
/// echocast_result_label_name returns the names of categories and instances. The view is valid until the result is used
/// for another scan, appended to or released.
///
/// Errors: ECHOCAST_E_ARGUMENT (a scan without boxes), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// scan.boxes = ECHOCAST_BOXES_OBJECT;
/// echocast_scan(snapshot, &scan, &result);
/// echocast_box_view boxes;
/// echocast_result_boxes(result, &boxes);
/// for (size_t i = 0; i < boxes.count; ++i)
///     printf("%u points\n", (unsigned)ECHOCAST_AT(echocast_box, boxes, i)->points);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_boxes(
    result: *const echocast_result,
    out: *mut echocast_box_view,
) -> echocast_status {
    guard(|| {
        let none = echocast_box_view { data: ptr::null(), count: 0, stride: size_of::<echocast_box>() };
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(none);
        look(result, |points| {
            if points.cloud.boxes.is_none() {
                return Err(Failure::argument("result", "of a scan without boxes", "one of scans with them"));
            }
            if let Some(first) = points.boxes.first() {
                *out = echocast_box_view { data: first, count: points.boxes.len(), ..none };
            }
            Ok(())
        })
    })
}

/// Gives access to a layer of the image that a camera, a spinning or a sweeping sensor sees; of several returns of a
/// beam, the nearest is shown. Beams without a return are NaN, 0 or black. Layers and the columns that they show:
///
/// - "depth": distance along the axis of a camera (`depth`), for other sensors the slant range (`range`), metres; F32
/// - "range": slant range, metres (`range`); F32
/// - "category", "part", "instance": label numbers (`category_id`, `part_id`, `instance_id`); U32
/// - "color": base colour, sRGB (`red`, `green`, `blue`); 3 of U8
/// - "intensity": what the instrument reports (`intensity`); F32
/// - "normal": unit normals to the right, up and towards the sensor (`normal_x`, `normal_y`, `normal_z`); 3 of F32
///
/// If the result is organised, it needs no other columns, and a layer of one column is not copied where the column of a
/// camera already is the image; if not, it also needs the columns `beam` and `range`. Other layers are made when they
/// are first requested, in memory that the result keeps for those of later scans. echocast_sensor_get_info gives the
/// size and the lens. The view is valid until the result is used for another scan, appended to or released.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such layer; a column that was not computed; scans of several sensors),
/// ECHOCAST_E_UNSUPPORTED (a sensor whose beams form no rows and columns; a sonar), ECHOCAST_E_MEMORY,
/// ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
///
/// ```c
/// scan.columns = "depth";
/// scan.organised = 1;
/// echocast_scan(snapshot, &scan, &result);
/// echocast_image_view depth;
/// echocast_result_image(result, "depth", &depth);
/// const float *metres = depth.data;
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_image(
    result: *const echocast_result,
    layer: *const c_char,
    out: *mut echocast_image_view,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(echocast_image_view::NONE);
        // SAFETY: `layer` is a string (see `text`).
        let layer = unsafe { text::required(layer, "layer") }?;
        let layer = Layer::from_name(layer)?;
        look(result, |points| {
            with_images(points, |images, grid| {
                let pixels = images.layers.get(&points.cloud, grid, layer)?;
                let channels = pixels.len() / grid.len().max(1);
                *out = echocast_image_view {
                    data: pixels.bytes().as_ptr().cast(),
                    row_stride: grid.width * channels * pixels.kind().size(),
                    width: grid.width as u32,
                    height: grid.height as u32,
                    channels: channels as u32,
                    kind: number_of(pixels.kind()),
                };
                Ok(())
            })
        })
    })
}

/// Gives access to the instances that the image of a result shows, in place, sorted by instance_id. They are found in
/// the layers "category" and "instance"; what is hidden comes from the boxes of the scan. The view is valid until the
/// result is used for another scan, appended to or released.
///
/// Errors: as echocast_result_image.
///
/// ```c
/// scan.columns = "category_id,instance_id";
/// scan.organised = 1;
/// scan.boxes = ECHOCAST_BOXES_OBJECT;
/// scan.image_boxes = 1;
/// echocast_scan(snapshot, &scan, &result);
/// echocast_image_box_view seen;
/// echocast_result_image_boxes(result, &seen);
/// for (size_t i = 0; i < seen.count; ++i)
///     printf("%.0f %% hidden\n", 100 * ECHOCAST_AT(echocast_image_box, seen, i)->occlusion);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_image_boxes(
    result: *const echocast_result,
    out: *mut echocast_image_box_view,
) -> echocast_status {
    guard(|| {
        let none = echocast_image_box_view { data: ptr::null(), count: 0, stride: size_of::<echocast_image_box>() };
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(none);
        look(result, |points| {
            with_images(points, |images, grid| {
                if !images.boxed {
                    let found = images.layers.annotations(&points.cloud, grid)?;
                    images.boxes.clear();
                    images.boxes.extend(found.iter().map(echocast_image_box::of));
                    images.boxed = true;
                }
                if let Some(first) = images.boxes.first() {
                    *out = echocast_image_box_view { data: first, count: images.boxes.len(), ..none };
                }
                Ok(())
            })
        })
    })
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
        let sensor = if result.cloud.fields() == FieldSet::EMPTY {
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
