//! Camera nodes: places in the scene where a sensor can be put.

use crate::ground::error::{Error, Result};
use crate::ground::pose::Pose;

/// A camera node of the scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name of the node.
    pub name: String,
    /// Sensor pose at the camera at time 0: x = the view direction, z = the camera's up.
    pub pose: Pose,
    /// Node of the timeline that it is; `None`: it never moves.
    pub(crate) node: Option<usize>,
}

impl Camera {
    /// The first of `cameras` called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub(crate) fn find<'a>(cameras: &'a [Camera], name: &str) -> Result<&'a Camera> {
        let found = cameras.iter().find(|camera| camera.name == name);
        found.ok_or_else(|| Error::missing("camera node", name, cameras.iter().map(|camera| &camera.name)))
    }
}
