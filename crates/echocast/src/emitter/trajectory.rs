//! Poses over time.

use super::Pose;
use crate::error::Result;
use std::path::Path;

/// The path of a sensor: poses at rising times, linear in position and slerp in orientation between
/// them; before the first and after the last key the sensor stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    keys: Vec<(f64, Pose)>,
}

impl Trajectory {
    /// A sensor that stands at `pose`.
    pub fn fixed(pose: Pose) -> Self {
        Trajectory { keys: vec![(0.0, pose)] }
    }

    /// A sensor that passes `keys`: (time in s, pose), times strictly rising.
    ///
    /// # Errors
    /// No key, times that do not rise, numbers that are not finite, a quaternion without length.
    pub fn new(_keys: Vec<(f64, Pose)>) -> Result<Self> {
        todo!()
    }

    /// Reads TUM text (`t x y z qx qy qz qw`, `#` comments) or CSV with a header.
    ///
    /// # Errors
    /// A missing file, or the line and what is wrong with it.
    pub fn load(_path: impl AsRef<Path>) -> Result<Self> {
        todo!()
    }

    /// The pose, where it never changes.
    pub fn constant(&self) -> Option<Pose> {
        (self.keys.len() == 1).then(|| self.keys[0].1)
    }

    /// Pose at `time`, s.
    pub fn at(&self, _time: f64) -> Pose {
        todo!()
    }
}
