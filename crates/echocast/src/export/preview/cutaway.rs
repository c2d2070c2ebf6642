//! What hides the scene from a viewer who is not the sensor: ceilings, and walls behind the sensor.

use super::points::{Points, quantile};
use glam::Vec3;

/// Thickness of the layer that a ceiling's points lie in, metres.
const LAYER: f32 = 0.15;
/// Where a cloud is cut open.
pub(super) struct Cutaway {
    /// Height right under a ceiling above the sensor; infinite without one.
    ///
    /// The highest points of a room lie in one thin layer, fuller than the part of the walls under it; the
    /// highest points outdoors do not.
    pub ceiling: f32,
    sensor: Vec3,
    /// Height below which surfaces may be floors.
    floor: f32,
}

impl Cutaway {
    pub(super) fn new(points: &Points<'_>) -> Cutaway {
        let mut heights: Vec<f32> = points.sample.iter().map(|(_, position)| position.z).collect();
        let (bottom, top) = (quantile(&mut heights, 0.02), quantile(&mut heights, 0.998));
        let below = top - 1.5 * LAYER;
        let within = |low: f32, high: f32| heights.iter().filter(|&&z| low < z && z <= high).count();
        let (layer, under) = (within(top - LAYER, top), within(top - 4.0 * LAYER, top - LAYER));
        // Most of a cloud is no ceiling, or nothing would be left to see.
        let part = layer as f32 / heights.len().max(1) as f32;
        let full = (0.02..0.6).contains(&part) && layer > under;
        let ceiling = if full && points.sensor.z < below { below } else { f32::INFINITY };
        Cutaway { ceiling, sensor: points.sensor, floor: bottom.midpoint(points.sensor.z) }
    }

    /// Whether a viewer in the direction `toward_viewer` (unit) sees the surface at `position` from behind.
    ///
    /// A surface shows its front to the sensor. So one well above the floor that is seen from nearly the
    /// opposite side is seen from behind; left out, it gives the view into a doll's house.
    pub(super) fn seen_from_behind(&self, position: Vec3, toward_viewer: Vec3) -> bool {
        let to_sensor = self.sensor - position;
        position.z > self.floor && to_sensor.dot(toward_viewer) < -0.25 * to_sensor.length()
    }
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
        let found = |slab| Cutaway::new(&Points::new(&room(slab), &mut Report::default())).ceiling;
        let height = found(Some(2.5));
        assert!((2.2..2.5).contains(&height), "{height}");
        assert_eq!((found(None), found(Some(0.0))), (f32::INFINITY, f32::INFINITY));
    }

    #[test]
    fn only_what_stands_beyond_the_sensor_is_seen_seen_from_behind() {
        let cloud = room(None);
        let cutaway = Cutaway::new(&Points::new(&cloud, &mut Report::default()));
        let viewer = Vec3::new(-0.8, 0.0, 0.6);
        let behind = |x, z| cutaway.seen_from_behind(Vec3::new(x, 0.0, z), viewer);
        assert!(behind(-3.0, 1.5), "wall behind the sensor");
        assert!(!behind(3.0, 1.5), "wall before it");
        assert!(!behind(-3.0, 0.0), "floor");
    }
}
