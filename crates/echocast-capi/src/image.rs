//! Images of what cameras, spinning and sweeping sensors see.

use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::result::{ResultPoints, echocast_result, look, number_of};
use crate::text;
use echocast::emitter::ImageGrid;
use echocast::image::{Annotation, Layer, Layers};
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::PoisonError;

/// Images of a result, made on request.
#[derive(Default)]
pub(crate) struct Images {
    /// The image grid of the sensor, once it was requested.
    grid: Option<ImageGrid>,
    layers: Layers,
    /// Whether `boxes` are up to date with the points.
    boxed: bool,
    boxes: Vec<echocast_image_box>,
}

impl Images {
    /// Discards what was made from the points, but keeps its memory.
    pub fn clear(&mut self) {
        self.layers.clear();
        self.boxed = false;
    }

    /// Discards the grid: the next points come from another sensor.
    pub fn forget_sensor(&mut self) {
        self.grid = None;
    }
}

/// A layer of the image of a result or of pings, in place: rows from top to bottom, pixels from left to right.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_image_view {
    /// The top left pixel; the channels of a pixel are contiguous, and so are the pixels of a row.
    pub data: *const c_void,
    /// Bytes from row to row.
    pub row_stride: usize,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Numbers per pixel: 1, or 3 for colours and normals.
    pub channels: u32,
    /// Type of the numbers: ECHOCAST_TYPE_F32, ECHOCAST_TYPE_U8 or ECHOCAST_TYPE_U32.
    pub kind: i32,
}

impl echocast_image_view {
    /// An empty view.
    pub(crate) const NONE: Self =
        echocast_image_view { data: ptr::null(), row_stride: 0, width: 0, height: 0, channels: 0, kind: 0 };
}

/// An instance as an image shows it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_image_box {
    /// The instance; never 0.
    pub instance_id: u32,
    /// Category of most of its pixels; 0 = unlabelled.
    pub category_id: u32,
    /// First column of its pixels.
    pub left: u32,
    /// First row of its pixels.
    pub top: u32,
    /// Columns from the first to the last that have pixels of it.
    pub width: u32,
    /// Rows from the first to the last.
    pub height: u32,
    /// Number of its pixels.
    pub area: u32,
    /// 0.
    pub reserved: u32,
    /// Left, top, right and bottom of the whole object, pixels, including what is hidden or outside of the image;
    /// column c reaches from c to c + 1. NaN if unknown, as without scan_desc.image_boxes.
    pub amodal: [f64; 4],
    /// Fraction of the area of the amodal box that is outside of the image, 0 to 1; NaN if unknown.
    pub truncation: f64,
    /// Fraction of it that is hidden by what is in front of it, 0 to 1; NaN if unknown, as without scan_desc.boxes.
    pub occlusion: f64,
}

impl echocast_image_box {
    fn of(found: &Annotation) -> echocast_image_box {
        let [left, top, width, height] = found.bounds;
        echocast_image_box {
            instance_id: found.instance_id,
            category_id: found.category_id,
            left,
            top,
            width,
            height,
            area: found.area,
            reserved: 0,
            amodal: found.amodal.unwrap_or([f64::NAN; 4]),
            truncation: found.truncation.unwrap_or(f64::NAN),
            occlusion: found.occlusion.unwrap_or(f64::NAN),
        }
    }
}

/// The boxes in the image of a result, in place. Those of a newer library may be longer than those of this header:
/// ECHOCAST_AT steps by the stride.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_image_box_view {
    /// The first; NULL if there are none.
    pub data: *const echocast_image_box,
    /// Number of boxes.
    pub count: usize,
    /// Bytes from one to the next.
    pub stride: usize,
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
