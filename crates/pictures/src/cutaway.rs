//! What hides the scene from a viewer other than the sensor: ceilings, and the walls nearest to the viewer.

use super::points::{Points, quantile};
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Thickness of the layer that holds a ceiling's points, metres.
const LAYER: f32 = 0.15;
/// Azimuth sectors for the reach of a cloud, and the number of neighbours on each side that count with a sector, to
/// bridge gaps in walls.
const SECTORS: usize = 64;
const NEIGHBOURS: usize = 3;
/// Fraction of the reach beyond which surfaces enclose the room; nearer ones are furniture.
const CLOSING: f32 = 0.6;

/// Where a cloud is cut open.
pub(super) struct Cutaway {
    /// Height just below a ceiling above the sensor; infinite without one.
    ///
    /// The highest points of a room lie in one thin layer, denser than the part of the walls below it; outdoors they do
    /// not.
    pub ceiling: f32,
    sensor: Vec3,
    /// Greatest horizontal distance from the sensor by sector of azimuth, metres.
    reach: [f32; SECTORS],
    /// Height below which surfaces may be floors.
    floor: f32,
}

impl Cutaway {
    pub(super) fn new(points: &Points<'_>) -> Cutaway {
        let mut heights: Vec<f32> = points.scene.iter().map(|position| position.z).collect();
        let (bottom, top) = (quantile(&mut heights, 0.02), quantile(&mut heights, 0.998));
        let below = top - 1.5 * LAYER;
        let within = |low: f32, high: f32| heights.iter().filter(|&&z| low < z && z <= high).count();
        let (layer, under) = (within(top - LAYER, top), within(top - 4.0 * LAYER, top - LAYER));
        // Most of a cloud is not ceiling, or nothing would be left to see.
        let part = layer as f32 / heights.len().max(1) as f32;
        let full = (0.02..0.6).contains(&part) && layer > under;
        let ceiling = if full && points.sensor.z < below { below } else { f32::INFINITY };
        let mut farthest = [0.0f32; SECTORS];
        for position in &points.scene {
            let out = (position - points.sensor).truncate();
            farthest[sector(out)] = farthest[sector(out)].max(out.length());
        }
        let around = |sector: usize| (0..=2 * NEIGHBOURS).map(move |i| (sector + SECTORS + i - NEIGHBOURS) % SECTORS);
        let reach = std::array::from_fn(|sector| around(sector).map(|i| farthest[i]).fold(0.0, f32::max));
        Cutaway { ceiling, sensor: points.sensor, reach, floor: bottom.midpoint(points.sensor.z) }
    }

    /// Whether a viewer in the direction `toward_viewer` (unit) sees a wall at `position` from behind.
    ///
    /// A surface shows its front to the sensor. Seen from nearly the opposite side, a surface well above the floor is
    /// therefore seen from behind; where it limits the sensor's view, leaving it out gives a doll's-house view.
    pub(super) fn seen_from_behind(&self, position: Vec3, toward_viewer: Vec3) -> bool {
        let out = position - self.sensor;
        let horizontal = out.truncate();
        position.z > self.floor
            && out.dot(toward_viewer) > 0.25 * out.length()
            && horizontal.length() >= CLOSING * self.reach[sector(horizontal)]
    }
}

fn sector(out: Vec2) -> usize {
    (out.to_angle().rem_euclid(TAU) / TAU * SECTORS as f32) as usize % SECTORS
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloud::PointCloud;
    use ground::pose::Pose;
    use ground::report::Report;

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
    fn only_walls_between_viewer_and_sensor_are_seen_from_behind() {
        let cloud = room(None);
        let cutaway = Cutaway::new(&Points::new(&cloud, &mut Report::default()));
        // The wall at x = 3 between viewer and sensor, then beyond it.
        let behind = |x, z, viewer| cutaway.seen_from_behind(Vec3::new(x, 0.0, z), Vec3::new(viewer, 0.0, 0.6));
        assert!(behind(3.0, 1.5, 0.8), "wall");
        assert!(!behind(1.5, 1.5, 0.8), "desk before it");
        assert!(!behind(3.0, 1.5, -0.8), "wall beyond the sensor");
        assert!(!behind(3.0, 0.0, 0.8), "floor");
    }
}
