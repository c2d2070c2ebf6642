//! Images of what cameras, spinning and sweeping sensors see.

use echocast::emitter::ImageGrid;
use echocast::image::{Annotation, Layers};
use std::ffi::c_void;
use std::ptr;

/// Images of a result, made on request.
#[derive(Default)]
pub(crate) struct Images {
    /// The image grid of the sensor, once it was requested.
    pub grid: Option<ImageGrid>,
    pub layers: Layers,
    /// Whether `boxes` are up to date with the points.
    pub boxed: bool,
    pub boxes: Vec<echocast_image_box>,
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
    pub(crate) fn of(found: &Annotation) -> echocast_image_box {
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
