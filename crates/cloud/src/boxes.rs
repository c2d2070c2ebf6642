//! Boxes around the labelled instances of a scene.

use glam::DVec3;
use ground::builder;
use ground::named;
use ground::pose::Pose;

builder! {
    /// The box around a labelled instance as it is during a scan, see [`BoxTime`].
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct InstanceBox {
        /// Frame index of the scan.
        pub frame: u32,
        /// Time at which the box is valid, s since the start of the run.
        pub time: f64,
        /// Object over all frames, as in the column `track_id`.
        pub track_id: u32,
        /// Object, as in the column `instance_id`; never 0.
        pub instance_id: u32,
        /// Category, as in the column `category_id`; 0 = unlabelled.
        pub category_id: u32,
        /// Position of the centre of the box, metres, and rotation from its axes, in the frame of the cloud. For a cloud in
        /// sensor coordinates, that is the sensor frame at the time of the box, or at the start of the scan if its points
        /// are transformed to it (`ScanOptions::deskew`).
        pub pose: Pose,
        /// Lengths along its axes, metres.
        pub size: DVec3,
        /// Velocity of its centre over the ground, m/s, in the frame of the cloud; deformation is included with its mean
        /// velocity.
        pub velocity: DVec3,
        /// Number of returns of the scan on it: the rows with its `instance_id`.
        pub points: u32,
        /// Visible fraction, 0 to 1: of the beams that would hit it within their range if it were alone, the fraction that
        /// hit it before anything else, traced in straight lines along their axes; light passes through glass, and weather,
        /// noise and detection are ignored. 0 if no beam would hit it.
        pub visible: f64,
        /// Left, top, right and bottom, pixels, of the whole object in the [image](emitter::ImageGrid) of the sensor
        /// at the time of the box, regardless of occlusion and of the borders of the image; `None`: not requested
        /// (`ScanOptions::image_boxes`), or no part of it is in front of the camera.
        pub image: Option<[f64; 4]>,
    }
}

/// The time for which boxes are valid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum BoxTime {
    /// Each when its object is scanned: the mean time of the points on it; if a revolution meets the object both at its
    /// beginning and at its end, the mean time of the points at the end that has more of them; without points, the
    /// middle of the scan. If points are deskewed to the start of the scan, that time.
    #[default]
    Scan,
    /// When the scan starts.
    Start,
    /// When its last beam fires.
    End,
}

named! { BoxTime: Scan "scan", Start "start", End "end" }

/// The axes with which boxes are aligned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum BoxAxes {
    /// Those of each object, z up as modelled: its x axis, and the component of its z axis perpendicular to that. For a
    /// mesh with a skeleton, they rotate with the root of the skeleton.
    #[default]
    Object,
    /// Those of the cloud's frame.
    Frame,
}

named! { BoxAxes: Object "object", Frame "frame" }

impl InstanceBox {
    /// Its corners; bit k of an index is the end of axis k at which the corner is.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|corner| {
            let side = |axis: usize| if corner >> axis & 1 == 1 { 0.5 } else { -0.5 };
            self.pose.position + self.pose.orientation * (self.size * DVec3::new(side(0), side(1), side(2)))
        })
    }

    /// Pairs of indices of [`InstanceBox::corners`] that an edge joins.
    pub const EDGES: [[usize; 2]; 12] =
        [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
}
