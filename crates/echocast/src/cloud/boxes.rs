//! Boxes around the labelled instances of a scene.

use crate::ground::named::named;
use crate::ground::pose::Pose;
use glam::DVec3;

/// The box around a labelled instance as it is during a scan, see [`BoxTime`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceBox {
    /// Frame index of the scan.
    pub frame: u32,
    /// When the box holds, s since the start of the run.
    pub time: f64,
    /// Object over all frames, as in the column `track_id`.
    pub track_id: u32,
    /// Object, as in the column `instance_id`; never 0.
    pub instance_id: u32,
    /// What it is, as in the column `category_id`; 0 = unlabelled.
    pub category_id: u32,
    /// Position of the middle of the box, metres, and rotation from its axes, in the frame of the cloud. In a cloud in
    /// sensor coordinates that is the sensor's frame when the box holds, or when the scan starts if its points are brought
    /// there ([`crate::ScanOptions::deskew`]).
    pub pose: Pose,
    /// Lengths along its axes, metres.
    pub size: DVec3,
    /// How fast its middle moves over the ground, m/s, in the frame of the cloud; with what changes its shape, as that
    /// does on average.
    pub velocity: DVec3,
    /// Returns of the scan that lie on it: the rows with its `instance_id`.
    pub points: u32,
    /// How much of it is not hidden, 0 to 1: of the beams that would meet it within their range if it were alone, how
    /// many meet it before anything else, seen in straight lines along their axes; light passes through glass, and
    /// weather, noise and detection play no part. 0 where no beam would meet it.
    pub visible: f64,
    /// Left, top, right and bottom, pixels, of all of it in the [image](crate::emitter::ImageGrid) of the sensor when the
    /// box holds, whatever hides it and where the image ends; `None`: it was not asked for
    /// ([`crate::ScanOptions::image_boxes`]), or nothing of it is in front of the camera.
    pub image: Option<[f64; 4]>,
}

/// When boxes hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BoxTime {
    /// Each when its object is scanned: at the mean time of the points that lie on it, or, of those that a turn meets at its
    /// beginning and at its end, of the end with more of them; without any, in the middle of the scan. Where points are
    /// brought to its start, then.
    #[default]
    Scan,
    /// When the scan starts.
    Start,
    /// When its last beam fires.
    End,
}

named! { BoxTime: Scan "scan", Start "start", End "end" }

/// Along which axes boxes lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BoxAxes {
    /// Those of each object, z up as it was modelled: its x axis, and the z axis as far as it is at right angles to
    /// that. Of a mesh with a skeleton, they turn with the root of the skeleton.
    #[default]
    Object,
    /// Those of the cloud's frame.
    Frame,
}

named! { BoxAxes: Object "object", Frame "frame" }

impl InstanceBox {
    /// Its corners; bit k of an index says at which end of axis k the corner is.
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
