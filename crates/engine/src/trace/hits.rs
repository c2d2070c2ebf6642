//! What the rays of a block hit, one per lane.

use super::Tables;
use embree4::{Candidate, Coherence, INVALID, Packet};
use glam::Vec3;
use ground::lanes::{LANES, MISS, RayBatch, gather};
use ground::rng::Rng;
use model::material::ReflectanceSource;
use std::cell::Cell;

thread_local! {
    static TRACED: Cell<u64> = const { Cell::new(0) };
}

/// How many rays this thread has traced.
pub(crate) fn traced() -> u64 {
    TRACED.get()
}

fn count_rays(count: usize) {
    TRACED.set(TRACED.get() + count as u64);
}

/// Whether a surface (a row) is a pane.
pub(crate) type IsPane<'a> = &'a (dyn Fn(u32) -> bool + Sync);

/// What rays see of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Only objects whose mask shares a bit with it.
    pub mask: u32,
    pub cover: Cover,
}

/// Which rays pass through surfaces with partial coverage ([`Alpha::Coverage`](model::material::Alpha::Coverage)).
#[derive(Clone, Copy, Debug)]
pub enum Cover {
    /// Each by its own random draw.
    Drawn(Rng),
    /// None, except where a surface covers nothing.
    Solid,
    /// None at all: alpha is the reflectance.
    Reflecting,
}

impl Sight {
    /// For sound, and wherever only geometry matters.
    pub(crate) fn of_shapes(mask: u32) -> Sight {
        Sight { mask, cover: Cover::Solid }
    }
}

impl Cover {
    /// For light, in a scan with the reflectances of `source` and the draws of `rng`.
    pub(crate) fn of_light(source: ReflectanceSource, rng: Rng) -> Cover {
        if source == ReflectanceSource::Alpha { Cover::Reflecting } else { Cover::Drawn(rng) }
    }
}

/// Closest hits of one block.
#[repr(align(64))]
pub(crate) struct HitBatch {
    /// Slant range, m.
    pub range: [f32; LANES],
    /// Geometric normal, any length and sign; in the mesh's frame until [`HitBatch::orient_normals`].
    pub normal_x: [f32; LANES],
    pub normal_y: [f32; LANES],
    pub normal_z: [f32; LANES],
    /// Unit normal of the triangle itself on the sensor's side, where that of a smooth surface differs; known once
    /// incidence is.
    pub facet: [[f32; LANES]; 3],
    /// Barycentric weights of the second and third corner.
    pub u: [f32; LANES],
    pub v: [f32; LANES],
    /// Triangle of the part.
    pub triangle: [u32; LANES],
    /// Row of [`super::Surfaces`], or [`MISS`].
    pub surface: [u32; LANES],
    /// Distance to the nearest surface at which a draw decided, m, if any is not behind the hit. Stale in scenes
    /// without holes.
    pub veil: [f32; LANES],
}

impl HitBatch {
    pub fn new() -> Self {
        HitBatch {
            range: [0.0; LANES],
            normal_x: [0.0; LANES],
            normal_y: [0.0; LANES],
            normal_z: [0.0; LANES],
            facet: [[0.0; LANES]; 3],
            u: [0.0; LANES],
            v: [0.0; LANES],
            triangle: [0; LANES],
            surface: [MISS; LANES],
            veil: [f32::INFINITY; LANES],
        }
    }

    /// Traces the first `count` rays, through the holes of surfaces. `coherent`: neighbours in the batch are neighbours
    /// in angle.
    pub fn trace(&mut self, scene: &Tables, rays: &RayBatch, count: usize, coherent: bool, sight: Sight) {
        count_rays(count);
        if scene.surfaces.has_holes {
            self.veil[..count].fill(f32::INFINITY);
        }
        let coherence = if coherent { Coherence::Coherent } else { Coherence::Incoherent };
        match scene.packet_width {
            16 => self.trace_packets::<16>(scene, rays, count, coherence, sight),
            8 => self.trace_packets::<8>(scene, rays, count, coherence, sight),
            _ => self.trace_packets::<4>(scene, rays, count, coherence, sight),
        }
        if scene.surfaces.has_quadrics {
            self.meet_quadrics(scene, rays, count);
        }
    }

    fn trace_packets<const W: usize>(
        &mut self,
        scene: &Tables,
        rays: &RayBatch,
        count: usize,
        coherence: Coherence,
        sight: Sight,
    ) {
        let mut packet = Packet { mask: [sight.mask; W], ..Packet::<W>::new() };
        let mut valid = [-1; W];
        for first in (0..count).step_by(W) {
            let lanes = first..first + W;
            load(&mut packet, rays, first);
            if scene.span.is_some() {
                packet.time.copy_from_slice(&rays.time[first..first + W]);
            }
            packet.geom_id = [INVALID; W];
            packet.inst_id = [INVALID; W];
            if first + W > count {
                valid[count - first..].fill(0);
            }
            if scene.surfaces.has_holes {
                packet.id = std::array::from_fn(|lane| (first + lane) as u32);
                let veil = Cell::from_mut(&mut self.veil[..]).as_slice_of_cells();
                let stops = |hit: &Candidate| {
                    let Some(row) = scene.surfaces.with_holes(hit) else { return true };
                    // This is called for everything that is not behind the hit, in any order.
                    if scene.surfaces.is_drawn(row, sight.cover) {
                        let nearest = &veil[hit.ray as usize];
                        nearest.set(nearest.get().min(hit.far));
                    }
                    scene.surfaces.covers(row, hit, sight.cover, rays)
                };
                scene.structure.intersect_where(&valid, &mut packet, coherence, &stops);
            } else {
                scene.structure.intersect(&valid, &mut packet, coherence);
            }
            self.range[lanes.clone()].copy_from_slice(&packet.tfar);
            self.normal_x[lanes.clone()].copy_from_slice(&packet.ng_x);
            self.normal_y[lanes.clone()].copy_from_slice(&packet.ng_y);
            self.normal_z[lanes.clone()].copy_from_slice(&packet.ng_z);
            self.u[lanes.clone()].copy_from_slice(&packet.u);
            self.v[lanes.clone()].copy_from_slice(&packet.v);
            self.triangle[lanes.clone()].copy_from_slice(&packet.prim_id);
            for (lane, surface) in self.surface[lanes].iter_mut().enumerate() {
                let (geometry, instance) = (packet.geom_id[lane], packet.inst_id[lane]);
                *surface = if geometry == INVALID { MISS } else { scene.surfaces.row(geometry, instance) };
            }
        }
    }

    /// Finds which of the first `count` rays hit anything before their end; see [`HitBatch::trace`].
    pub(crate) fn blocked(
        scene: &Tables,
        rays: &RayBatch,
        count: usize,
        coherent: bool,
        sight: Sight,
    ) -> [bool; LANES] {
        HitBatch::occluded(scene, rays, count, coherent, sight, None).0
    }

    /// Finds which of the first `count` rays hit anything before their end but rows that are panes, if any are, and which of
    /// the others may have passed one; see [`HitBatch::trace`].
    pub(crate) fn occluded(
        scene: &Tables,
        rays: &RayBatch,
        count: usize,
        coherent: bool,
        sight: Sight,
        is_pane: Option<IsPane>,
    ) -> ([bool; LANES], [bool; LANES]) {
        count_rays(count);
        let coherence = if coherent { Coherence::Coherent } else { Coherence::Incoherent };
        match scene.packet_width {
            16 => Self::occluded_packets::<16>(scene, rays, count, coherence, sight, is_pane),
            8 => Self::occluded_packets::<8>(scene, rays, count, coherence, sight, is_pane),
            _ => Self::occluded_packets::<4>(scene, rays, count, coherence, sight, is_pane),
        }
    }

    fn occluded_packets<const W: usize>(
        scene: &Tables,
        rays: &RayBatch,
        count: usize,
        coherence: Coherence,
        sight: Sight,
        is_pane: Option<IsPane>,
    ) -> ([bool; LANES], [bool; LANES]) {
        let (mut blocked, mut passed) = ([false; LANES], [false; LANES]);
        let mut packet = Packet { mask: [sight.mask; W], ..Packet::<W>::new() };
        let mut valid = [-1; W];
        for first in (0..count).step_by(W) {
            load(&mut packet, rays, first);
            if scene.span.is_some() {
                packet.time.copy_from_slice(&rays.time[first..first + W]);
            }
            if first + W > count {
                valid[count - first..].fill(0);
            }
            if is_pane.is_some() || scene.surfaces.has_holes {
                packet.id = std::array::from_fn(|lane| (first + lane) as u32);
            }
            if let Some(is_pane) = is_pane {
                let passed = Cell::from_mut(&mut passed[..]).as_slice_of_cells();
                let stops = |hit: &Candidate| {
                    let stops = scene.surfaces.stops(hit, sight.cover, rays);
                    let passes = stops && is_pane(scene.surfaces.row(hit.geom_id, hit.inst_id));
                    if passes {
                        passed[hit.ray as usize].set(true);
                    }
                    stops && !passes
                };
                scene.structure.occlude_where(&valid, &mut packet, coherence, &stops);
            } else if scene.surfaces.has_holes {
                let stops = |hit: &Candidate| scene.surfaces.stops(hit, sight.cover, rays);
                scene.structure.occlude_where(&valid, &mut packet, coherence, &stops);
            } else {
                scene.structure.occlude(&valid, &mut packet, coherence);
            }
            for lane in 0..W {
                blocked[first + lane] = packet.tfar[lane] == f32::NEG_INFINITY;
            }
        }
        (blocked, passed)
    }

    /// Normal of the hit of a lane.
    pub fn normal(&self, lane: usize) -> Vec3 {
        Vec3::new(self.normal_x[lane], self.normal_y[lane], self.normal_z[lane])
    }

    /// Unit normal of the triangle that a lane hits.
    pub(crate) fn facet(&self, lane: usize) -> Vec3 {
        Vec3::from_array(self.facet.each_ref().map(|axis| axis[lane]))
    }

    /// Copies lane `other` of `from` to `lane`.
    pub fn take(&mut self, lane: usize, from: &HitBatch, other: usize) {
        self.range[lane] = from.range[other];
        self.normal_x[lane] = from.normal_x[other];
        self.normal_y[lane] = from.normal_y[other];
        self.normal_z[lane] = from.normal_z[other];
        for (axis, from) in self.facet.iter_mut().zip(&from.facet) {
            axis[lane] = from[other];
        }
        (self.u[lane], self.v[lane]) = (from.u[other], from.v[other]);
        self.triangle[lane] = from.triangle[other];
        self.surface[lane] = from.surface[other];
        self.veil[lane] = from.veil[other];
    }

    /// Copies `lanes` of `from` to the first lanes.
    pub(crate) fn gather(&mut self, from: &HitBatch, lanes: &[u8]) {
        let HitBatch { range, normal_x, normal_y, normal_z, facet, u, v, triangle, surface, veil } = from;
        gather(&mut self.range, range, lanes);
        gather(&mut self.normal_x, normal_x, lanes);
        gather(&mut self.normal_y, normal_y, lanes);
        gather(&mut self.normal_z, normal_z, lanes);
        self.facet.iter_mut().zip(facet).for_each(|(to, from)| gather(to, from, lanes));
        gather(&mut self.u, u, lanes);
        gather(&mut self.v, v, lanes);
        gather(&mut self.triangle, triangle, lanes);
        gather(&mut self.surface, surface, lanes);
        gather(&mut self.veil, veil, lanes);
    }

    /// Copies lane `from` to `lane`.
    pub(crate) fn move_lane(&mut self, lane: usize, from: usize) {
        let HitBatch { range, normal_x, normal_y, normal_z, facet: [x, y, z], u, v, triangle, surface, veil } = self;
        for column in [range, normal_x, normal_y, normal_z, x, y, z, u, v, veil] {
            column[lane] = column[from];
        }
        (triangle[lane], surface[lane]) = (triangle[from], surface[from]);
    }

    /// Transforms the normals of hits in instances to the world frame.
    pub(crate) fn orient_normals(&mut self, scene: &Tables, rays: &RayBatch, count: usize) {
        for lane in 0..count {
            if scene.surfaces.rows.get(self.surface[lane] as usize).is_some_and(|row| row.instanced) {
                let normal = scene.world_normal(self.surface[lane], self.normal(lane), rays.time[lane]);
                (self.normal_x[lane], self.normal_y[lane], self.normal_z[lane]) = normal.into();
            }
        }
    }
}

/// Loads rays into a packet, from lane `first` on.
pub(super) fn load<const W: usize>(packet: &mut Packet<W>, rays: &RayBatch, first: usize) {
    let lanes = first..first + W;
    packet.org_x.copy_from_slice(&rays.org_x[lanes.clone()]);
    packet.org_y.copy_from_slice(&rays.org_y[lanes.clone()]);
    packet.org_z.copy_from_slice(&rays.org_z[lanes.clone()]);
    packet.dir_x.copy_from_slice(&rays.dir_x[lanes.clone()]);
    packet.dir_y.copy_from_slice(&rays.dir_y[lanes.clone()]);
    packet.dir_z.copy_from_slice(&rays.dir_z[lanes.clone()]);
    packet.tfar.copy_from_slice(&rays.range_max[lanes]);
}

impl Tables {
    /// The `normal` of a hit on a `surface` (a row, or [`MISS`]) at `time` as Embree reports it, transformed to the
    /// world frame.
    pub(crate) fn world_normal(&self, surface: u32, normal: Vec3, time: f32) -> Vec3 {
        match self.surfaces.rows.get(surface as usize) {
            Some(row) if row.instanced => self.turned(row.object, normal, time),
            _ => normal,
        }
    }
}
