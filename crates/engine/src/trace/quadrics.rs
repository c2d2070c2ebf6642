//! Rays on curved surfaces that triangles only stand for.

use super::Tables;
use super::hits::HitBatch;
use glam::{DAffine3, Vec3};
use ground::lanes::RayBatch;

impl HitBatch {
    /// Moves hits on triangles that stand for quadrics to these: range and normal are then theirs. Rays that pass the surface
    /// itself, at the outline of a body, stay at the triangle.
    pub(super) fn meet_quadrics(&mut self, scene: &Tables, rays: &RayBatch, count: usize) {
        // Neighbours mostly hit the same object.
        let mut known: Option<(u32, DAffine3)> = None;
        for lane in 0..count {
            let Some(row) = scene.surfaces.rows.get(self.surface[lane] as usize).filter(|row| row.curved) else {
                continue;
            };
            let part = &scene.surfaces.parts[row.part as usize];
            let object_from_local = match known {
                Some((object, frame)) if object == row.object => frame,
                _ => {
                    let Some((frame, stays)) = scene.object_from_local(row.object, rays.time[lane]) else { continue };
                    known = stays.then_some((row.object, frame));
                    frame
                }
            };
            let [origin, direction] = [rays.origin(lane), rays.direction(lane)].map(Vec3::as_dvec3);
            let origin = object_from_local.transform_point3(origin);
            let direction = object_from_local.transform_vector3(direction);
            let met = part.meet(self.triangle[lane], origin, direction, self.range[lane].into());
            let Some((range, normal)) = met else { continue };
            self.range[lane] = range as f32;
            let normal = normal.as_vec3();
            let normal = if row.instanced { normal } else { scene.turned(row.object, normal, rays.time[lane]) };
            (self.normal_x[lane], self.normal_y[lane], self.normal_z[lane]) = normal.into();
        }
    }
}

impl Tables {
    /// From Embree's frame to that of an object at `time`, 0 to 1, and whether it is so at all times; `None`: its shape
    /// changes.
    fn object_from_local(&self, object: u32, time: f32) -> Option<(DAffine3, bool)> {
        let Some(mover) = self.mover(object) else {
            let place = self.extents[object as usize].world_from_object;
            return Some((DAffine3 { translation: place.translation - self.origin, ..place }.inverse(), true));
        };
        let pose = mover.is_stiff().then(|| mover.path.at(time))?;
        let inverse = pose.inverse.as_dmat3();
        Some((DAffine3 { matrix3: inverse, translation: inverse * -pose.place.as_dvec3() }, false))
    }
}
