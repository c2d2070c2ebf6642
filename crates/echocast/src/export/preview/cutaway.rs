//! What hides the scene from a viewer who is not the sensor: ceilings, and walls behind the sensor.

use super::points::{Points, quantile};
use glam::Vec3;

/// Thickness of the layer that a ceiling's points lie in, metres.
const LAYER: f32 = 0.15;

/// Height right under a ceiling above the sensor.
///
/// The highest points of a room lie in one thin layer, fuller than the part of the walls under it; the
/// highest points outdoors do not.
pub(super) fn ceiling(points: &Points<'_>) -> Option<f32> {
    let mut heights: Vec<f32> = points.sample().map(|(_, position)| position.z).collect();
    let top = quantile(&mut heights, 0.998);
    let below = top - 1.5 * LAYER;
    let within = |low: f32, high: f32| heights.iter().filter(|&&z| low < z && z <= high).count();
    let (layer, under) = (within(top - LAYER, top), within(top - 4.0 * LAYER, top - LAYER));
    let full = layer as f32 > 0.02 * heights.len() as f32 && layer > under;
    (full && points.sensor.z < below).then_some(below)
}

/// Whether a viewer in the direction `toward_viewer` (unit) sees the surface at `position` from behind.
///
/// A surface shows its front to the sensor. So one above the sensor, where no floor is, that is seen from
/// nearly the opposite side is seen from behind, and is left out, as in a doll's house.
pub(super) fn from_behind(points: &Points<'_>, position: Vec3, toward_viewer: Vec3) -> bool {
    let to_sensor = points.sensor - position;
    to_sensor.z < 0.0 && to_sensor.dot(toward_viewer) < -0.3 * to_sensor.length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::PointCloud;
    use crate::emitter::Pose;
    use crate::report::Report;

    /// A grid of points on a wall 4 m wide and 2.5 m high at x = 3, and on a slab 4 m x 4 m at `slab`.
    fn room(slab: Option<f32>) -> PointCloud {
        let mut cloud = PointCloud { sensor_pose: Pose::at(0.0, 0.0, 1.0), ..PointCloud::default() };
        for i in 0..40 {
            for j in 0..40 {
                let (along, up) = (i as f32 / 10.0 - 2.0, j as f32 / 16.0);
                let slab = slab.map(|slab| [j as f32 / 10.0 - 2.0, along, slab]);
                for [x, y, z] in [[3.0, along, up]].into_iter().chain(slab) {
                    cloud.columns.x.push(x);
                    cloud.columns.y.push(y);
                    cloud.columns.z.push(z);
                }
            }
        }
        cloud.len = cloud.columns.x.len();
        cloud
    }

    #[test]
    fn a_ceiling_is_found_and_a_floor_or_a_wall_is_none() {
        let found = |slab| ceiling(&Points::new(&room(slab), &mut Report::default()));
        let height = found(Some(2.5)).unwrap();
        assert!((2.2..2.5).contains(&height), "{height}");
        assert_eq!((found(None), found(Some(0.0))), (None, None));
    }

    #[test]
    fn only_what_is_above_and_beyond_the_sensor_is_seen_from_behind() {
        let cloud = room(None);
        let points = Points::new(&cloud, &mut Report::default());
        let viewer = Vec3::new(-0.8, 0.0, 0.6);
        let behind = |x, z| from_behind(&points, Vec3::new(x, 0.0, z), viewer);
        assert!(behind(-3.0, 1.5), "wall behind the sensor");
        assert!(!behind(3.0, 1.5), "wall before it");
        assert!(!behind(-3.0, 0.0), "floor");
    }
}
