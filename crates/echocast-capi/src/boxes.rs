//! Boxes around the labelled instances of a scan.

use crate::time::nanoseconds;
use echocast::InstanceBox;

/// The box around a labelled instance. Position, orientation and velocity are in the frame of the points; in sensor
/// coordinates that is the sensor frame at the time of the box, or at the start of the scan if its points are deskewed.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_box {
    /// Time for which the box is valid (scan_desc.box_time), ns. Times since 1970 are rounded to 0.2 microseconds.
    pub t_ns: i64,
    /// Number of the frame, as in the column `frame`.
    pub frame: u32,
    /// The object across all frames, as in the column `track_id`.
    pub track_id: u32,
    /// The instance, as in the column `instance_id`; never 0.
    pub instance_id: u32,
    /// The category, as in the column `category_id`; 0 = unlabelled.
    pub category_id: u32,
    /// Number of returns of the scan on it.
    pub points: u32,
    /// 0.
    pub reserved: u32,
    /// Centre of the box, x, y, z, metres; absolute, not relative to the result's origin.
    pub position: [f64; 3],
    /// Size along its axes, metres.
    pub size: [f64; 3],
    /// Rotation from its axes, a unit quaternion x, y, z, w.
    pub orientation_xyzw: [f64; 4],
    /// Velocity of its centre over the ground, m/s.
    pub velocity: [f64; 3],
    /// Visible fraction, 0 to 1: of the beams that would hit it if it were alone, the share that does.
    pub visible: f64,
    /// Left, top, right and bottom of the whole object in the image of the sensor, pixels, including what is hidden or
    /// outside of the image; NaN if not requested (scan_desc.image_boxes), or if no part of it is in front of the
    /// camera.
    pub image: [f64; 4],
}

impl echocast_box {
    pub(crate) fn of(found: &InstanceBox) -> echocast_box {
        echocast_box {
            t_ns: nanoseconds(found.time),
            frame: found.frame,
            track_id: found.track_id,
            instance_id: found.instance_id,
            category_id: found.category_id,
            points: found.points,
            reserved: 0,
            position: found.pose.position.to_array(),
            size: found.size.to_array(),
            orientation_xyzw: found.pose.orientation.to_array(),
            velocity: found.velocity.to_array(),
            visible: found.visible,
            image: found.image.unwrap_or([f64::NAN; 4]),
        }
    }
}

/// The boxes of a result, in place. Those of a newer library may be longer than those of this header: ECHOCAST_AT steps
/// by the stride.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_box_view {
    /// The first; NULL if there are none.
    pub data: *const echocast_box,
    /// Number of boxes.
    pub count: usize,
    /// Bytes from one to the next.
    pub stride: usize,
}
