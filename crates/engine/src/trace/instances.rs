//! The labelled instances of a scene: their poses and extents, and which rays would hit them.

use super::hits::{Sight, load};
use super::{Mover, Surfaces, Tables};
use crate::scene::{Object, UpAxis};
use embree4::{Candidate, Coherence, Packet};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use ground::lanes::RayBatch;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering};

/// Pose and extent of an object.
#[derive(Clone, Copy, Debug)]
pub struct ObjectExtent {
    pub(super) world_from_object: DAffine3,
    /// Box of its mesh, object frame; `None`: it has no triangles.
    pub(super) bounds: Option<[[f32; 3]; 2]>,
    /// Which of its axes pointed up as modelled.
    up: UpAxis,
    mask: u32,
}

/// The objects with one instance number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelledInstance {
    /// Never 0.
    pub id: u32,
    /// Category of the first object.
    pub category_id: u32,
    /// Numbers of its objects ([`super::Surface::object`]), ascending.
    pub objects: Vec<u32>,
}

/// All instances of a scene.
#[derive(Debug, Default)]
pub struct Instances {
    /// By ascending number.
    all: Vec<LabelledInstance>,
    /// Index in `all` for each row of [`Surfaces`], or [`UNLABELLED`].
    of_row: Vec<u32>,
}

const UNLABELLED: u32 = u32::MAX;

/// For every instance of a scene, the number of rays that hit it.
#[derive(Debug, Default)]
pub struct Crossings {
    /// How many would hit it if it were alone.
    pub alone: Vec<AtomicU32>,
    /// How many hit nothing before it.
    pub first: Vec<AtomicU32>,
}

impl Crossings {
    /// No rays yet, for `count` instances.
    pub fn new(count: usize) -> Crossings {
        let zeros = || (0..count).map(|_| AtomicU32::new(0)).collect();
        Crossings { alone: zeros(), first: zeros() }
    }
}

impl ObjectExtent {
    pub(super) fn new(object: &Object, bounds: Option<[[f32; 3]; 2]>) -> ObjectExtent {
        ObjectExtent { world_from_object: object.world_from_object, bounds, up: object.up, mask: object.mask }
    }
}

impl Instances {
    pub(super) fn new(surfaces: &Surfaces) -> Instances {
        let mut by_id: BTreeMap<u32, LabelledInstance> = BTreeMap::new();
        for row in surfaces.rows.iter().filter(|row| row.instance_id != 0) {
            let new = || LabelledInstance { id: row.instance_id, category_id: row.category_id, objects: Vec::new() };
            let objects = &mut by_id.entry(row.instance_id).or_insert_with(new).objects;
            if objects.last() != Some(&row.object) {
                objects.push(row.object);
            }
        }
        let all: Vec<LabelledInstance> = by_id.into_values().collect();
        let place = |id: u32| all.binary_search_by_key(&id, |instance| instance.id).map_or(UNLABELLED, |at| at as u32);
        let of_row = surfaces.rows.iter().map(|row| place(row.instance_id)).collect();
        Instances { all, of_row }
    }
}

impl Tables {
    /// The labelled instances, by ascending number.
    pub fn instances(&self) -> &[LabelledInstance] {
        &self.surfaces.instances().all
    }

    /// Pose of an object at `time`, s, and its orientation with z up; `None` if scans with this mask do not see it
    /// then.
    pub(crate) fn transform_at(&self, object: u32, time: f64, mask: u32) -> Option<(DAffine3, DMat3)> {
        let ObjectExtent { world_from_object, bounds, up, mask: own } = self.extents[object as usize];
        if own & mask == 0 || bounds.is_none() {
            return None;
        }
        let (place, turned) = match self.mover(object) {
            None => (world_from_object, world_from_object.matrix3),
            // With time frozen, it is where the mover starts.
            Some(mover) => mover.transform_at(self.span.map_or(mover.start, |_| time))?,
        };
        Some((place, up.upright(&turned)))
    }

    /// Whether an object is mirrored at `time`, 0 to 1.
    pub(super) fn is_mirrored(&self, object: u32, time: f32) -> bool {
        match self.mover(object) {
            Some(mover) => mover.path.at(time).inverse.determinant() < 0.0,
            None => self.extents[object as usize].world_from_object.matrix3.determinant() < 0.0,
        }
    }

    /// Passes the corners of all triangles of an object at `time`, 0 to 1, in its own frame, triangle by triangle, to
    /// `visit`.
    pub(crate) fn each_corner(&self, object: u32, time: f32, visit: &mut dyn FnMut(DVec3)) {
        if let Some(mover) = self.mover(object).filter(|mover| !mover.is_stiff()) {
            return mover.each_corner(time, &mut |place, _| visit(place.as_dvec3()));
        }
        let first = self.surfaces.rows.partition_point(|row| row.object < object);
        for row in self.surfaces.rows[first..].iter().take_while(|row| row.object == object) {
            let part = &self.surfaces.parts[row.part as usize];
            for &corner in part.triangles.iter().flatten() {
                visit(DVec3::from_array(part.positions[corner as usize].map(f64::from)));
            }
        }
    }

    /// Least and greatest coordinates of an object at `time`, 0 to 1, in the frame of `frame_from_object`.
    pub fn extent(&self, object: u32, frame_from_object: &DAffine3, time: f32) -> Option<[DVec3; 2]> {
        let mut ends: Option<[DVec3; 2]> = None;
        let mut add = |place: DVec3| {
            let place = frame_from_object.transform_point3(place);
            let [low, high] = ends.get_or_insert([place; 2]);
            (*low, *high) = (low.min(place), high.max(place));
        };
        let stiff = self.mover(object).is_none_or(Mover::is_stiff);
        if stiff && keeps_axes(&frame_from_object.matrix3) {
            // Along the axes of its mesh the box is known.
            let ends = self.extents[object as usize].bounds?;
            ends.into_iter().for_each(|end| add(DVec3::from_array(end.map(f64::from))));
        } else {
            self.each_corner(object, time, &mut add);
        }
        ends
    }

    /// Velocity of the point of an object that is at `place` (world) at `time`, 0 to 1, m/s; a change of shape
    /// contributes the mean velocity of the corners.
    pub(crate) fn velocity_at(&self, object: u32, place: DVec3, time: f32) -> Vec3 {
        let (Some(mover), Some(span)) = (self.mover(object), self.span) else { return Vec3::ZERO };
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        mover.each_corner(time, &mut |_, rate| (sum, count) = (sum + rate, count + 1.0));
        let own = if count > 0.0 { sum / (count * span.length as f32) } else { Vec3::ZERO };
        let piece = mover.path.piece(time);
        let part = piece.part(time);
        let at = piece.at_part(part);
        piece.velocity(part, at.inverse * ((place - self.origin).as_vec3() - at.place)) + at.turn(own)
    }

    /// Adds to `crossings` which instances the first `count` rays hit; glass does not stop them if they are of `light`.
    pub fn cross(
        &self,
        rays: &RayBatch,
        count: usize,
        coherent: bool,
        sight: Sight,
        light: bool,
        crossings: &Crossings,
    ) {
        let coherence = if coherent { Coherence::Coherent } else { Coherence::Incoherent };
        match self.packet_width {
            16 => self.cross_packets::<16>(rays, count, coherence, (sight, light), crossings),
            8 => self.cross_packets::<8>(rays, count, coherence, (sight, light), crossings),
            _ => self.cross_packets::<4>(rays, count, coherence, (sight, light), crossings),
        }
    }

    fn cross_packets<const W: usize>(
        &self,
        rays: &RayBatch,
        count: usize,
        coherence: Coherence,
        (sight, light): (Sight, bool),
        crossings: &Crossings,
    ) {
        let surfaces = &*self.surfaces;
        let instances = self.surfaces.instances();
        let mut packet = Packet { mask: [sight.mask; W], ..Packet::<W>::new() };
        let mut valid = [-1; W];
        let met = RefCell::new([const { PiercedInstances::NOTHING }; W]);
        for first in (0..count).step_by(W) {
            load(&mut packet, rays, first);
            packet.id = std::array::from_fn(|lane| (first + lane) as u32);
            if self.span.is_some() {
                packet.time.copy_from_slice(&rays.time[first..first + W]);
            }
            if first + W > count {
                valid[count - first..].fill(0);
            }
            // A rejected hit does not end its ray.
            self.structure.intersect_where(&valid, &mut packet, coherence, &|hit: &Candidate| {
                let row = surfaces.row(hit.geom_id, hit.inst_id) as usize;
                if surfaces.stops(hit, sight.cover, rays) {
                    let lets_through = light && surfaces.is_glass(&surfaces.rows[row]);
                    met.borrow_mut()[hit.ray as usize - first].add(instances.of_row[row], hit.far, !lets_through);
                }
                false
            });
            met.borrow_mut().iter_mut().for_each(|met| met.count(crossings));
        }
    }
}

/// Whether a linear map takes every axis to an axis.
fn keeps_axes(linear: &DMat3) -> bool {
    let columns = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::abs);
    let size = columns.iter().map(|column| column.max_element()).fold(0.0, f64::max);
    columns.iter().all(|column| column.element_sum() - column.max_element() <= 1e-9 * size)
}

/// The instances that a ray hits.
#[derive(Clone, Debug)]
struct PiercedInstances {
    /// Instances and their distances, m; some may occur several times.
    instances: Vec<(u32, f32)>,
    /// Where the ray ends, m.
    end: f32,
}

impl PiercedInstances {
    const NOTHING: PiercedInstances = PiercedInstances { instances: Vec::new(), end: f32::INFINITY };
    /// Number of instances among which it is worth searching for one that is hit again.
    const FEW: usize = 16;

    /// Adds what is hit at `far`, m; `ends`: the ray ends there.
    fn add(&mut self, instance: u32, far: f32, ends: bool) {
        if ends {
            self.end = self.end.min(far);
        }
        if instance == UNLABELLED {
            return;
        }
        match self.instances.iter_mut().take(PiercedInstances::FEW).find(|(known, _)| *known == instance) {
            Some((_, nearest)) => *nearest = nearest.min(far),
            None => self.instances.push((instance, far)),
        }
    }

    /// Moves what has been collected to `crossings`.
    fn count(&mut self, crossings: &Crossings) {
        if self.instances.len() > PiercedInstances::FEW {
            self.instances.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            self.instances.dedup_by_key(|(instance, _)| *instance);
        }
        for (instance, far) in self.instances.drain(..) {
            crossings.alone[instance as usize].fetch_add(1, Ordering::Relaxed);
            if far <= self.end {
                crossings.first[instance as usize].fetch_add(1, Ordering::Relaxed);
            }
        }
        self.end = f32::INFINITY;
    }
}
