//! Whether a place is inside of something: there, surfaces show their backs.

use super::hits::load;
use super::{BuiltScene, Surface, Tables};
use crate::ground::lanes::{LANES, RayBatch};
use embree4::{Candidate, Coherence, INVALID, Packet};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::f32::consts::TAU;

/// What a place is inside of, see [`BuiltScene::enclosure`].
#[derive(Clone, Debug, PartialEq)]
pub struct Enclosure {
    /// The object that most of the surfaces around belong to; empty if it has no name.
    pub name: String,
    /// Which part of the directions meets a back, 0 to 1.
    pub part: f64,
    /// How far away the farthest of these backs is, m.
    pub within_m: f64,
}

/// Where a place is inside, at least this part of all directions meets something within reach: the ground does not go
/// on for ever.
const MET: f64 = 0.75;

/// At least this part of what is met there are backs: there may be furniture, and open doors to look through.
const BACKS: f64 = 0.9;

/// How much nearer or farther than each other the two sides of a sheet may be, in parts of the range.
const SHEET: f32 = 1e-4;

impl BuiltScene {
    /// What the world position `place` is inside of, if it is: where most directions from the horizon up meet a surface
    /// within `reach_m`, and nearly all of these its back. A surface shows its back where its corners run clockwise, as
    /// in glTF and OBJ. So a body, a building whose walls face outwards and the ground enclose what is in or below
    /// them; a room whose walls face inwards encloses nothing, nor do surfaces with two sides, whether by their
    /// material ([`Material::double_sided`](crate::material::Material::double_sided)) or because there is a second
    /// surface in the same place. Below the horizon, the ground may lie within the walls.
    ///
    /// The scene is looked at as it is when the scans begin that it is built for.
    pub fn enclosure(&self, place: DVec3, reach_m: f64) -> Option<Enclosure> {
        let met = self.0.met(&self.0.looks_up(place, reach_m));
        let backs: Vec<(u32, f32)> = met.iter().copied().flatten().collect();
        if (met.len() as f64) < MET * LANES as f64 || (backs.len() as f64) < BACKS * met.len() as f64 {
            return None;
        }
        let mut counts = BTreeMap::new();
        for (instance, _) in &backs {
            *counts.entry(*instance).or_insert(0) += 1;
        }
        let (most, _) = counts.into_iter().max_by_key(|&(_, count)| count)?;
        let name = self.labels().instance.name(most).unwrap_or_default();
        let within_m = backs.iter().map(|(_, range)| f64::from(*range)).fold(0.0, f64::max);
        let part = backs.len() as f64 / LANES as f64;
        Some(Enclosure { name: name.to_owned(), part, within_m })
    }
}

impl Tables {
    /// Rays from `place` in directions that are spread evenly over the upper half of all.
    fn looks_up(&self, place: DVec3, reach_m: f64) -> RayBatch {
        /// Of the golden ratio: no two of many directions come close (Vogel, 1979).
        const TURN: f32 = 0.618_034;
        let origin = (place - self.origin).as_vec3();
        let mut rays = RayBatch::default();
        for lane in 0..LANES {
            let up = (lane as f32 + 0.5) / LANES as f32;
            let (sin, cos) = (TAU * (lane as f32 * TURN).fract()).sin_cos();
            let out = (1.0 - up * up).sqrt();
            (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = origin.into();
            (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = (out * cos, out * sin, up);
            rays.range_max[lane] = reach_m as f32;
        }
        rays
    }

    /// For each of `rays` that meets something, the number of its instance and how far away it is, m, if that shows its
    /// back alone.
    fn met(&self, rays: &RayBatch) -> Vec<Option<(u32, f32)>> {
        const WIDTH: usize = 4;
        let mut met = Vec::new();
        for first in (0..LANES).step_by(WIDTH) {
            let mut packet = Packet { id: std::array::from_fn(|lane| lane as u32), ..Packet::<WIDTH>::new() };
            load(&mut packet, rays, first);
            let mut near = packet;
            let stops = |hit: &Candidate| self.surfaces.stops(hit);
            self.committed.intersect_where(&[-1; WIDTH], &mut near, Coherence::Incoherent, &stops);
            // A second triangle in the same place is another side.
            packet.tnear = near.tfar.map(|range| range * (1.0 - SHEET));
            packet.tfar = near.tfar.map(|range| range * (1.0 + SHEET));
            let valid = near.geom_id.map(|geometry| if geometry == INVALID { 0 } else { -1 });
            let others = |hit: &Candidate| {
                let lane = hit.ray as usize;
                let same = [near.geom_id[lane], near.inst_id[lane], near.prim_id[lane]];
                [hit.geom_id, hit.inst_id, hit.prim_id] != same && stops(hit)
            };
            self.committed.intersect_where(&valid, &mut packet, Coherence::Incoherent, &others);
            met.extend((0..WIDTH).filter(|&lane| valid[lane] != 0).map(|lane| {
                let back = self.back(&near, lane)?;
                let front = packet.geom_id[lane] != INVALID && self.back(&packet, lane).is_none();
                (!front).then_some((back.instance_id, near.tfar[lane]))
            }));
        }
        met
    }

    /// The surface that the ray of a lane has met, if it shows its back and has no front there.
    fn back<const W: usize>(&self, packet: &Packet<W>, lane: usize) -> Option<&Surface> {
        if packet.geom_id[lane] == INVALID {
            return None;
        }
        let row = self.surfaces.row(packet.geom_id[lane], packet.inst_id[lane]);
        let surface = &self.surfaces.rows[row as usize];
        let normal = Vec3::new(packet.ng_x[lane], packet.ng_y[lane], packet.ng_z[lane]);
        let direction = Vec3::new(packet.dir_x[lane], packet.dir_y[lane], packet.dir_z[lane]);
        let back = self.shows_back(row, normal, direction, packet.time[lane]);
        let two_sided = self.surfaces.materials[surface.material as usize].double_sided;
        (back && !two_sided).then_some(surface)
    }

    /// Whether `surface`, a row, shows its back to a ray along `direction` that meets it at `time` where Embree gives
    /// it this `normal`.
    pub(super) fn shows_back(&self, surface: u32, normal: Vec3, direction: Vec3, time: f32) -> bool {
        // The order of corners is that before an object is mirrored.
        let mirrored = self.is_mirrored(self.surfaces.rows[surface as usize].object, time);
        (self.world_normal(surface, normal, time).dot(direction) > 0.0) != mirrored
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;
    use crate::scene::{Mesh, Object, Part};
    use crate::trace::{Engine, LiveScene};
    use glam::DAffine3;
    use std::sync::Arc;

    /// A box from -`half` to `half`, m, whose sides face outwards, or inwards too or alone.
    fn sides(half: f32, outward: bool, inward: bool, material: Material) -> Part {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { half } else { -half });
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let outwards = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let mut triangles = Vec::new();
        for [a, b, c] in outwards {
            triangles.extend(outward.then_some([a, b, c]));
            triangles.extend(inward.then_some([a, c, b]));
        }
        let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
        let material = Some(Arc::new(material));
        Part { positions: positions.into(), triangles: triangles.into(), material, ..Part::default() }
    }

    fn built(part: Part, place: DAffine3) -> BuiltScene {
        let house = Object::new("House_3", Arc::new(Mesh::new("house", vec![part]).unwrap()));
        let mut scene = LiveScene::new(&Engine::new().unwrap());
        scene.add(Object { world_from_object: place, ..house }).unwrap();
        scene.commit().unwrap()
    }

    #[test]
    fn backs_all_around_are_inside() {
        let plain = Material::default();
        let two_sided = Material { double_sided: true, ..Material::default() };
        let high = DAffine3::from_translation(DVec3::new(1e6, 0.0, 5.0));
        let mirrored = high * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        for (part, expected) in [
            (sides(2.0, true, false, plain.clone()), true),
            (sides(2.0, false, true, plain.clone()), false),
            (sides(2.0, true, true, plain.clone()), false),
            (sides(2.0, true, false, two_sided), false),
        ] {
            for place in [high, mirrored] {
                let built = built(part.clone(), place);
                let found = built.enclosure(high.translation, 100.0);
                assert_eq!(found.is_some(), expected, "{part:?} {place}");
                // Beside it, or beyond the reach.
                assert_eq!(built.enclosure(high.translation + 3.0 * DVec3::X, 100.0), None);
                assert_eq!(built.enclosure(high.translation, 1.9), None);
                if let Some(found) = found {
                    assert!((found.part - 1.0).abs() < 1e-9 && (2.0..3.5).contains(&found.within_m), "{found:?}");
                }
            }
        }
    }
}
