//! Whether a position is inside of something: seen from there, surfaces show their back faces.

use super::hits::{Cover, load};
use super::{BuiltScene, Tables};
use embree4::{Candidate, Coherence, INVALID, Packet};
use glam::{DVec3, Vec3};
use ground::lanes::{LANES, RayBatch};
use model::{corners, surrounding};
use std::collections::BTreeMap;
use std::f32::consts::TAU;

/// What a position is inside of, see [`BuiltScene::enclosure`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Enclosure {
    /// The object that most of the surfaces around belong to; empty if it has no name.
    pub name: String,
    /// Fraction of the directions that hit a back face, 0 to 1.
    pub part: f64,
    /// Distance of the farthest of these back faces, m.
    pub within_m: f64,
}

/// From a position inside, at least this fraction of all directions hits something within reach: the ground does not
/// extend for ever.
const LEAST_HITS: f64 = 0.75;

/// At least this fraction of the hits are back faces: there may be furniture, and open doors.
const BACKS: f64 = 0.9;

/// Surfaces of two-sided materials that are nearer than this all around, m, are not a room.
const ROOM: f64 = 1.0;

/// By how much the ranges of the two sides of a sheet may differ, relative to the range.
const SHEET: f32 = 1e-4;

/// A back face hit by a ray.
#[derive(Clone, Copy)]
struct Back {
    instance: u32,
    /// Range, m.
    range: f32,
    /// Whether its material is two-sided.
    two_sided: bool,
}

impl BuiltScene {
    /// What the world position `place` is inside of, if anything: it is if most directions from the horizon up hit a
    /// surface within `reach_m`, and nearly all of these its back face. A surface shows its back face where its corners
    /// run clockwise, as in glTF and OBJ. So a body, a building whose walls face outwards, and the ground enclose what
    /// is in or below them; a room whose walls face inwards encloses nothing, nor does one whose surfaces are doubled
    /// by others in the same place. Directions below the horizon are ignored, as the ground may be within the walls.
    ///
    /// Some programs mark all materials as two-sided
    /// ([`Material::double_sided`](model::material::Material::double_sided)), so that the walls of a room may face
    /// either way. Such surfaces enclose a position if they belong to one instance and are either very near or not the
    /// whole scene: around a room there is mostly nothing, around a body the scene.
    ///
    /// The scene is taken as it is at the start of the time span that it is built for.
    pub fn enclosure(&self, place: DVec3, reach_m: f64) -> Option<Enclosure> {
        let met = self.0.met(&self.0.upward_rays(place, reach_m));
        let backs: Vec<Back> = met.iter().copied().flatten().collect();
        let nearly_all = |count: usize| count as f64 >= BACKS * met.len() as f64;
        if (met.len() as f64) < LEAST_HITS * LANES as f64 || !nearly_all(backs.len()) {
            return None;
        }
        let mut counts = BTreeMap::new();
        for back in &backs {
            *counts.entry(back.instance).or_insert(0) += 1;
        }
        let (most, count) = counts.into_iter().max_by_key(|&(_, count)| count)?;
        let within_m = backs.iter().map(|back| f64::from(back.range)).fold(0.0, f64::max);
        let one_sided = backs.iter().filter(|back| !back.two_sided).count();
        if !nearly_all(one_sided) && !(nearly_all(count) && (within_m < ROOM || self.0.reaches_beyond(most))) {
            return None;
        }
        let name = self.labels().instance.name(most).unwrap_or_default();
        let part = backs.len() as f64 / LANES as f64;
        Some(Enclosure { name: name.to_owned(), part, within_m })
    }
}

impl Tables {
    /// Rays from `place` in directions spread evenly over the upper hemisphere.
    fn upward_rays(&self, place: DVec3, reach_m: f64) -> RayBatch {
        /// From the golden ratio: no two of many directions come close (Vogel, 1979).
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

    /// Whether the scene extends beyond one of its instances.
    fn reaches_beyond(&self, instance: u32) -> bool {
        /// By which fraction of its size: floors and walls overlap.
        const PART: f64 = 0.05;
        let start = self.span.map_or(0.0, |span| span.start);
        let found = self.instances().iter().find(|known| known.id == instance);
        let corners = found.into_iter().flat_map(|instance| &instance.objects).filter_map(|&object| {
            let (place, _) = self.transform_at(object, start, u32::MAX)?;
            Some(corners(self.extents[object as usize].bounds?, &place))
        });
        let Some((low, high)) = surrounding(corners.flatten()) else { return false };
        let [least, most] = self.structure.bounds().map(|end| Vec3::from(end).as_dvec3() + self.origin);
        let slack = PART * (high - low).max_element();
        (low - least).max_element() > slack || (most - high).max_element() > slack
    }

    /// For each of `rays` that hits something, the back face, if it shows only that.
    fn met(&self, rays: &RayBatch) -> Vec<Option<Back>> {
        const WIDTH: usize = 4;
        let mut met = Vec::new();
        for first in (0..LANES).step_by(WIDTH) {
            let mut packet = Packet { id: std::array::from_fn(|lane| lane as u32), ..Packet::<WIDTH>::new() };
            load(&mut packet, rays, first);
            let mut near = packet;
            let stops = |hit: &Candidate| self.surfaces.stops(hit, Cover::Solid, rays);
            self.structure.intersect_where(&[-1; WIDTH], &mut near, Coherence::Incoherent, &stops);
            // A second triangle in the same place is the other side.
            packet.tnear = near.tfar.map(|range| range * (1.0 - SHEET));
            packet.tfar = near.tfar.map(|range| range * (1.0 + SHEET));
            let valid = near.geom_id.map(|geometry| if geometry == INVALID { 0 } else { -1 });
            let others = |hit: &Candidate| {
                let lane = hit.ray as usize;
                let same = [near.geom_id[lane], near.inst_id[lane], near.prim_id[lane]];
                [hit.geom_id, hit.inst_id, hit.prim_id] != same && stops(hit)
            };
            self.structure.intersect_where(&valid, &mut packet, Coherence::Incoherent, &others);
            met.extend((0..WIDTH).filter(|&lane| valid[lane] != 0).map(|lane| {
                let back = self.back(&near, lane)?;
                let front = packet.geom_id[lane] != INVALID && self.back(&packet, lane).is_none();
                (!front).then_some(back)
            }));
        }
        met
    }

    /// The surface that the ray of a lane has hit, if it shows its back face.
    fn back<const W: usize>(&self, packet: &Packet<W>, lane: usize) -> Option<Back> {
        if packet.geom_id[lane] == INVALID {
            return None;
        }
        let row = self.surfaces.row(packet.geom_id[lane], packet.inst_id[lane]);
        let surface = &self.surfaces.rows[row as usize];
        let normal = Vec3::new(packet.ng_x[lane], packet.ng_y[lane], packet.ng_z[lane]);
        let direction = Vec3::new(packet.dir_x[lane], packet.dir_y[lane], packet.dir_z[lane]);
        let two_sided = self.surfaces.materials[surface.material as usize].double_sided;
        self.shows_back(row, normal, direction, packet.time[lane]).then_some(Back {
            instance: surface.instance_id,
            range: packet.tfar[lane],
            two_sided,
        })
    }

    /// Whether `surface`, a row, shows its back face to a ray along `direction` that hits it at `time`, with this
    /// `normal` as Embree reports it.
    pub(super) fn shows_back(&self, surface: u32, normal: Vec3, direction: Vec3, time: f32) -> bool {
        // The winding order is that before an object is mirrored.
        let mirrored = self.is_mirrored(self.surfaces.rows[surface as usize].object, time);
        (self.world_normal(surface, normal, time).dot(direction) > 0.0) != mirrored
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mesh, Object, Part};
    use crate::trace::{Engine, LiveScene};
    use glam::DAffine3;
    use model::material::Material;
    use std::sync::Arc;

    /// A box from -`half` to `half`, m, whose sides face outwards, inwards or both.
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
        Part::default().positions(positions.into()).triangles(triangles.into()).material(material)
    }

    fn built(part: Part, place: DAffine3) -> BuiltScene {
        let house = Object::new("House_3", Arc::new(Mesh::new("house", vec![part]).unwrap()));
        let mut scene = LiveScene::new(&Engine::new().unwrap());
        scene.add(Object { world_from_object: place, ..house }).unwrap();
        scene.commit().unwrap()
    }

    /// Two-sided, as Blender exports all materials: a body in a scene counts as one, a room that is the whole scene
    /// does not.
    #[test]
    fn bodies_of_two_sided_materials_are_inside() {
        let two_sided = Material::default().double_sided(true);
        let body = |half: f32| {
            let mesh = Mesh::new("body", vec![sides(half, true, false, two_sided.clone())]).unwrap();
            Object { instance_id: 1, ..Object::new("body", Arc::new(mesh)) }
        };
        let floor = Mesh::new("floor", vec![sides(20.0, true, false, two_sided.clone())]).unwrap();
        let below = DAffine3::from_translation(DVec3::NEG_Z * 30.0);
        let floor = Object { instance_id: 2, world_from_object: below, ..Object::new("floor", Arc::new(floor)) };
        for (half, with_floor, expected) in
            [(0.1, true, true), (0.1, false, true), (2.0, true, true), (2.0, false, false)]
        {
            let mut scene = LiveScene::new(&Engine::new().unwrap());
            scene.add(body(half)).unwrap();
            if with_floor {
                scene.add(floor.clone()).unwrap();
            }
            let built = scene.commit().unwrap();
            assert_eq!(built.enclosure(DVec3::ZERO, 100.0).is_some(), expected, "{half} {with_floor}");
            assert_eq!(built.enclosure(5.0 * DVec3::X, 100.0), None);
        }
    }

    #[test]
    fn backs_all_around_are_inside() {
        let plain = Material::default();
        let two_sided = Material::default().double_sided(true);
        let high = DAffine3::from_translation(DVec3::new(1e6, 0.0, 5.0));
        let mirrored = high * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        for (part, expected) in [
            (sides(2.0, true, false, plain.clone()), true),
            (sides(2.0, false, true, plain.clone()), false),
            (sides(2.0, true, true, plain.clone()), false),
            (sides(2.0, true, false, two_sided.clone()), false),
        ] {
            for place in [high, mirrored] {
                let built = built(part.clone(), place);
                let found = built.enclosure(high.translation, 100.0);
                assert_eq!(found.is_some(), expected, "{part:?} {place}");
                // Outside of it, or beyond the reach.
                assert_eq!(built.enclosure(high.translation + 3.0 * DVec3::X, 100.0), None);
                assert_eq!(built.enclosure(high.translation, 1.9), None);
                if let Some(found) = found {
                    assert!((found.part - 1.0).abs() < 1e-9 && (2.0..3.5).contains(&found.within_m), "{found:?}");
                }
            }
        }
    }
}
