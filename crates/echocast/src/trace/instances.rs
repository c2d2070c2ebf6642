//! The labelled instances of a scene: where each is, how far it reaches, and which rays would meet it.

use super::hits::load;
use super::{Surfaces, Tables};
use crate::ground::lanes::RayBatch;
use crate::scene::Object;
use embree4::{Candidate, Coherence, Packet};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering};

/// Where an object is, and how far it reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    world_from_object: DAffine3,
    /// Box of its mesh, object frame; `None`: it has no triangles.
    bounds: Option<[[f32; 3]; 2]>,
    mask: u32,
}

/// Objects of one number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Instance {
    /// Never 0.
    pub id: u32,
    /// That of the first object.
    pub category_id: u32,
    /// Numbers of its objects ([`super::Surface::object`]), rising.
    pub objects: Vec<u32>,
}

/// All instances of a scene.
#[derive(Debug, Default)]
pub(crate) struct Instances {
    /// By rising number.
    all: Vec<Instance>,
    /// Place in `all` of each row of [`Surfaces`], or [`UNLABELLED`].
    of_row: Vec<u32>,
}

const UNLABELLED: u32 = u32::MAX;

/// What scans see of an object: those with this mask, and whether they see through glass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    pub mask: u32,
    pub through_glass: bool,
}

/// For every instance of a scene the rays that meet it.
#[derive(Debug, Default)]
pub(crate) struct Crossings {
    /// How many would meet it if it were alone.
    pub alone: Vec<AtomicU32>,
    /// How many meet nothing before it.
    pub first: Vec<AtomicU32>,
}

impl Crossings {
    /// No rays yet, for `count` instances.
    pub(crate) fn new(count: usize) -> Crossings {
        let zeros = || (0..count).map(|_| AtomicU32::new(0)).collect();
        Crossings { alone: zeros(), first: zeros() }
    }
}

impl Extent {
    pub(super) fn new(object: &Object, bounds: Option<[[f32; 3]; 2]>) -> Extent {
        Extent { world_from_object: object.world_from_object, bounds, mask: object.mask }
    }
}

impl Instances {
    fn new(surfaces: &Surfaces) -> Instances {
        let mut by_id: BTreeMap<u32, Instance> = BTreeMap::new();
        for row in surfaces.rows.iter().filter(|row| row.instance_id != 0) {
            let new = || Instance { id: row.instance_id, category_id: row.category_id, objects: Vec::new() };
            let objects = &mut by_id.entry(row.instance_id).or_insert_with(new).objects;
            if objects.last() != Some(&row.object) {
                objects.push(row.object);
            }
        }
        let all: Vec<Instance> = by_id.into_values().collect();
        let place = |id: u32| all.binary_search_by_key(&id, |instance| instance.id).map_or(UNLABELLED, |at| at as u32);
        let of_row = surfaces.rows.iter().map(|row| place(row.instance_id)).collect();
        Instances { all, of_row }
    }
}

impl Tables {
    fn known_instances(&self) -> &Instances {
        self.surfaces.instances.get_or_init(|| Instances::new(&self.surfaces))
    }

    /// The labelled instances, by rising number.
    pub(crate) fn instances(&self) -> &[Instance] {
        &self.known_instances().all
    }

    /// Where an object is at `time`, s; `None` if scans with this mask do not see it then.
    pub(crate) fn pose(&self, object: u32, time: f64, mask: u32) -> Option<DAffine3> {
        let Extent { world_from_object, bounds, mask: own } = self.extents[object as usize];
        if own & mask == 0 || bounds.is_none() {
            return None;
        }
        match (self.mover(object), self.span) {
            (None, _) => Some(world_from_object),
            (Some(mover), Some(_)) => mover.is_visible(time).then(|| mover.world_from_object(time)),
            // It holds still.
            (Some(mover), None) => mover.path.piece(0.0).is_visible().then_some(world_from_object),
        }
    }

    /// Least and greatest coordinates of an object, as it was modelled, in the frame of `frame_from_object`. It has the
    /// same shape at all times.
    pub(crate) fn extent(&self, object: u32, frame_from_object: &DAffine3) -> Option<[DVec3; 2]> {
        let linear = &frame_from_object.matrix3;
        let columns = [linear.x_axis, linear.y_axis, linear.z_axis];
        let size = columns.iter().map(|column| column.abs().max_element()).fold(0.0, f64::max);
        let diagonal = DMat3::from_diagonal(DVec3::new(columns[0].x, columns[1].y, columns[2].z));
        if linear.abs_diff_eq(diagonal, 1e-9 * size) {
            // Along the object's own axes its box is known.
            let ends = self.extents[object as usize]
                .bounds?
                .map(|end| frame_from_object.transform_point3(DVec3::from_array(end.map(f64::from))));
            return Some([ends[0].min(ends[1]), ends[0].max(ends[1])]);
        }
        let first = self.surfaces.rows.partition_point(|row| row.object < object);
        let rows = self.surfaces.rows[first..].iter().take_while(|row| row.object == object);
        let vertices = rows.flat_map(|row| {
            let part = &self.surfaces.parts[row.part as usize];
            part.triangles.iter().flatten().map(|&index| part.positions[index as usize])
        });
        let places =
            vertices.map(|vertex| frame_from_object.transform_point3(DVec3::from_array(vertex.map(f64::from))));
        places.map(|place| [place; 2]).reduce(|[low, high], [place, _]| [low.min(place), high.max(place)])
    }

    /// How fast the point of an object that is at `place` (world) moves at `time`, m/s.
    pub(crate) fn velocity_at(&self, object: u32, place: DVec3, time: f32) -> Vec3 {
        let Some(mover) = self.mover(object).filter(|_| self.span.is_some()) else { return Vec3::ZERO };
        let at = mover.path.at(time).to_object((place - self.origin).as_vec3());
        self.velocity_of(object, at, time)
    }

    /// Adds to `crossings` which instances the first `count` rays meet.
    pub(crate) fn cross(&self, rays: &RayBatch, count: usize, coherent: bool, sight: Sight, crossings: &Crossings) {
        let coherence = if coherent { Coherence::Coherent } else { Coherence::Incoherent };
        match self.packet_width {
            16 => self.cross_packets::<16>(rays, count, coherence, sight, crossings),
            8 => self.cross_packets::<8>(rays, count, coherence, sight, crossings),
            _ => self.cross_packets::<4>(rays, count, coherence, sight, crossings),
        }
    }

    fn cross_packets<const W: usize>(
        &self,
        rays: &RayBatch,
        count: usize,
        coherence: Coherence,
        sight: Sight,
        crossings: &Crossings,
    ) {
        let surfaces = &*self.surfaces;
        let instances = self.known_instances();
        let ids = std::array::from_fn(|lane| lane as u32);
        let mut packet = Packet { mask: [sight.mask; W], id: ids, ..Packet::<W>::new() };
        let mut valid = [-1; W];
        let met = RefCell::new([const { Met::NOTHING }; W]);
        for first in (0..count).step_by(W) {
            load(&mut packet, rays, first);
            if self.span.is_some() {
                packet.time.copy_from_slice(&rays.time[first..first + W]);
            }
            if first + W > count {
                valid[count - first..].fill(0);
            }
            // Refused, a hit does not end its ray.
            self.committed.intersect_where(&valid, &mut packet, coherence, &|hit: &Candidate| {
                let row = surfaces.row(hit.geom_id, hit.inst_id) as usize;
                if surfaces.stops(hit) {
                    let lets_through = sight.through_glass && surfaces.is_glass(&surfaces.rows[row]);
                    met.borrow_mut()[hit.ray as usize].add(instances.of_row[row], hit.far, !lets_through);
                }
                false
            });
            met.borrow_mut().iter_mut().for_each(|met| met.count(crossings));
        }
    }
}

/// What a ray meets.
#[derive(Clone, Debug)]
struct Met {
    /// Instances and how far away they are, m; some may be there several times.
    instances: Vec<(u32, f32)>,
    /// Where the ray ends, m.
    end: f32,
}

impl Met {
    const NOTHING: Met = Met { instances: Vec::new(), end: f32::INFINITY };
    /// Instances among which it is worth looking for one that is met again.
    const FEW: usize = 16;

    /// Adds what is met at `far`, m; `ends`: the ray goes no further.
    fn add(&mut self, instance: u32, far: f32, ends: bool) {
        if ends {
            self.end = self.end.min(far);
        }
        if instance == UNLABELLED {
            return;
        }
        match self.instances.iter_mut().take(Met::FEW).find(|(known, _)| *known == instance) {
            Some((_, nearest)) => *nearest = nearest.min(far),
            None => self.instances.push((instance, far)),
        }
    }

    /// Moves what is known to `crossings`.
    fn count(&mut self, crossings: &Crossings) {
        if self.instances.len() > Met::FEW {
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
