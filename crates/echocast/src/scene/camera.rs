//! Camera nodes: places in the scene where a sensor can be put.

use crate::emitter::Pose;

/// A camera node of the scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name of the node.
    pub name: String,
    /// Sensor pose at the camera: x = the view direction, z = the camera's up.
    pub pose: Pose,
}
