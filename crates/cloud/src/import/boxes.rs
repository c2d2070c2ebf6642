//! Boxes, from files of arrays.

use super::Source;
use super::about::Arrays;
use crate::InstanceBox;
use glam::{DQuat, DVec3};
use ground::error::Result;
use ground::pose::Pose;

/// The boxes of `arrays` of the file `source`; `None`: there are none.
///
/// # Errors
/// Arrays that cannot be read or are of unequal length.
pub(super) fn read(arrays: &mut dyn Arrays, source: &Source) -> Result<Option<Vec<InstanceBox>>> {
    let Some(frame) = arrays.numbers("boxes/frame")? else { return Ok(None) };
    let mut column = |name: &str, width: usize| -> Result<Vec<f64>> {
        let found = arrays.numbers(&format!("boxes/{name}"))?.unwrap_or_default();
        let fits = found.len() == frame.len() * width;
        if fits { Ok(found) } else { Err(source.error(format!("boxes/{name} does not fit the other boxes"))) }
    };
    let (time, track_id, instance_id) = (column("time", 1)?, column("track_id", 1)?, column("instance_id", 1)?);
    let (category_id, points, visible) = (column("category_id", 1)?, column("points", 1)?, column("visible", 1)?);
    let (position, size, velocity) = (column("position", 3)?, column("size", 3)?, column("velocity", 3)?);
    let orientation = column("orientation_xyzw", 4)?;
    let vector = |from: &[f64], row: usize| DVec3::from_slice(&from[row * 3..]);
    let boxes = (0..frame.len()).map(|row| InstanceBox {
        frame: frame[row] as u32,
        time: time[row],
        track_id: track_id[row] as u32,
        instance_id: instance_id[row] as u32,
        category_id: category_id[row] as u32,
        pose: Pose { position: vector(&position, row), orientation: DQuat::from_slice(&orientation[row * 4..]) },
        size: vector(&size, row),
        velocity: vector(&velocity, row),
        points: points[row] as u32,
        visible: visible[row],
        image: None,
    });
    Ok(Some(boxes.collect()))
}
