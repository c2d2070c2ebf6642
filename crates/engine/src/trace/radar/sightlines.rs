//! Whether waves get from a radar to places, by way of mirrors and through panes.

use super::images::{MOST_MIRRORS, MirrorChain};
use crate::trace::Tables;
use crate::trace::hits::{HitBatch, IsPane, Sight};
use glam::DVec3;
use ground::lanes::{LANES, MISS, RayBatch};

/// Where a path meets a mirror.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct MirrorHit {
    /// Row of surfaces.
    pub row: u32,
    pub triangle: u32,
    /// Weights of the second and third corner.
    pub uv: [f32; 2],
}

/// What a line of sight found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sighted {
    /// Fraction of the amplitude that gets through panes on the way; 0: something blocks it.
    pub through: f32,
    pub mirrors: [MirrorHit; MOST_MIRRORS],
}

/// Fraction of the amplitude that a surface (a row) lets through, met at a cosine of incidence: 0 for what is opaque.
pub(crate) type Panes<'a> = &'a (dyn Fn(u32, f32) -> f32 + Sync);

/// Lines of sight in one scene at one moment.
pub(crate) struct Sightlines<'a> {
    pub scene: &'a Tables,
    pub sight: Sight,
    /// 0 to 1 in the scene's time span.
    pub time: f32,
    pub panes: Panes<'a>,
    /// Whether a surface (a row) lets waves through; `None`: none does.
    pub is_pane: Option<IsPane<'a>>,
}

/// Buffers of [`Sightlines::look`].
pub(crate) struct SightMemory {
    rays: Box<RayBatch>,
    hits: Box<HitBatch>,
    /// The targets that are still in sight, by lane.
    lanes: Vec<u32>,
    /// Those of them that are traced on behind panes.
    active: Vec<u32>,
    bends: Vec<[DVec3; MOST_MIRRORS]>,
}

impl Default for SightMemory {
    fn default() -> Self {
        SightMemory {
            rays: Box::new(RayBatch::default()),
            hits: Box::new(HitBatch::new()),
            lanes: Vec::new(),
            active: Vec::new(),
            bends: Vec::new(),
        }
    }
}

/// Most panes in a row on one leg.
pub(super) const MOST_PANES: usize = 8;

/// Clearance from the ends of a leg, m, and per metre from the scene's origin: single precision rounds places.
const CLEAR: [f64; 2] = [5e-5, 1e-6];

fn clearance(place: DVec3) -> f64 {
    CLEAR[0] + CLEAR[1] * place.abs().max_element()
}

impl Sightlines<'_> {
    /// Looks from `start` by way of `mirrors` at `targets`; `found` gets what is found of each. Targets are on surfaces,
    /// or free: a surface at the target itself does not hide it.
    pub fn look(
        &self,
        start: DVec3,
        mirrors: &MirrorChain,
        targets: &[DVec3],
        memory: &mut SightMemory,
        found: &mut Vec<Sighted>,
    ) {
        found.clear();
        found.resize(targets.len(), Sighted::default());
        for (block, found) in targets.chunks(LANES).zip(found.chunks_mut(LANES)) {
            self.look_at_block(start, mirrors, block, memory, found);
        }
    }

    fn look_at_block(
        &self,
        start: DVec3,
        mirrors: &MirrorChain,
        targets: &[DVec3],
        memory: &mut SightMemory,
        found: &mut [Sighted],
    ) {
        memory.lanes.clear();
        memory.bends.clear();
        memory.bends.resize(targets.len(), [DVec3::ZERO; MOST_MIRRORS]);
        for (target, place) in targets.iter().enumerate() {
            if let Some(bends) = mirrors.bends(*place).filter(|bends| mirrors.hold(bends, 0.0)) {
                memory.bends[target] = bends;
                memory.lanes.push(target as u32);
                found[target].through = 1.0;
            }
        }
        let last = mirrors.all().len();
        for leg in 0..=last {
            self.follow_leg(start, mirrors, targets, leg, memory, found);
            let seen = |&target: &u32| found[target as usize].through > 0.0;
            memory.lanes.retain(seen);
        }
    }

    /// Traces leg number `leg` of the paths in `memory.lanes`.
    fn follow_leg(
        &self,
        start: DVec3,
        mirrors: &MirrorChain,
        targets: &[DVec3],
        leg: usize,
        memory: &mut SightMemory,
        found: &mut [Sighted],
    ) {
        let SightMemory { rays, hits, lanes, active, bends } = memory;
        let mirror = mirrors.all().get(leg);
        let ends = |target: usize| {
            let from = if leg == 0 { start } else { bends[target][leg - 1] };
            (from, mirror.map_or(targets[target], |_| bends[target][leg]))
        };
        for (lane, &target) in lanes.iter().enumerate() {
            let (from, to) = ends(target as usize);
            let along = to - from;
            let length = along.length();
            let along = along / length;
            // Off the mirror that it comes from; one that it goes to is met, a target is not.
            let off = if leg == 0 { 0.0 } else { clearance(from) };
            let beside = leg.checked_sub(1).map_or(DVec3::ZERO, |before| {
                let normal = mirrors.all()[before].normal;
                normal * (off * normal.dot(along).signum())
            });
            // Ranges are as exact as the coarser end.
            let slack = clearance(from).max(clearance(to)) * if mirror.is_some() { 2.0 } else { -2.0 };
            (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = (from + beside).as_vec3().into();
            (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = along.as_vec3().into();
            // MirrorChain that are met at grazing incidence are farther along by as much as rounding moves them.
            let steep = mirror.map_or(1.0, |mirror| mirror.normal.dot(along).abs().max(1e-3));
            rays.range_max[lane] = (length + slack / steep).max(0.0) as f32;
            rays.time[lane] = self.time;
        }
        active.clear();
        active.extend_from_slice(lanes);
        if mirror.is_none() {
            // Only where panes are on the way, they are traced one by one.
            let (blocked, passed) =
                HitBatch::occluded(self.scene, rays, lanes.len(), leg == 0, self.sight, self.is_pane);
            active.clear();
            for (lane, &target) in lanes.iter().enumerate() {
                if blocked[lane] {
                    found[target as usize].through = 0.0;
                } else if passed[lane] {
                    rays.move_lane(active.len(), lane);
                    active.push(target);
                }
            }
        }
        for pass in 0..=MOST_PANES {
            if active.is_empty() {
                return;
            }
            hits.trace(self.scene, rays, active.len(), leg == 0 && pass == 0, self.sight);
            let mut kept = 0;
            for lane in 0..active.len() {
                let target = active[lane] as usize;
                let seen = &mut found[target];
                let row = hits.surface[lane];
                if row == MISS {
                    if mirror.is_some() {
                        seen.through = 0.0;
                    }
                    continue;
                }
                let along = rays.direction(lane);
                let normal = self.scene.world_normal(row, hits.normal(lane), self.time).normalize_or_zero();
                let (place, (from, end)) = (rays.origin(lane) + along * hits.range[lane], ends(target));
                let on_mirror = mirror.is_some_and(|mirror| {
                    let near = 4.0 * clearance(from).max(clearance(end)) / f64::from(normal.dot(along).abs()).max(1e-3);
                    mirror.is_plane(normal.as_dvec3(), place.as_dvec3()) && (place.as_dvec3() - end).length() < near
                });
                if let (true, Some(met)) = (on_mirror, seen.mirrors.get_mut(leg)) {
                    *met = MirrorHit { row, triangle: hits.triangle[lane], uv: [hits.u[lane], hits.v[lane]] };
                    continue;
                }
                let through = if pass == MOST_PANES { 0.0 } else { (self.panes)(row, normal.dot(along).abs()) };
                seen.through *= through;
                if seen.through > 0.0 {
                    // On from the other side of the pane.
                    let from = place + along * clearance(place.as_dvec3()) as f32;
                    let rest = rays.range_max[lane] - hits.range[lane] - clearance(place.as_dvec3()) as f32;
                    rays.move_lane(kept, lane);
                    (rays.org_x[kept], rays.org_y[kept], rays.org_z[kept]) = from.into();
                    rays.range_max[kept] = rest.max(0.0);
                    active[kept] = active[lane];
                    kept += 1;
                }
            }
            active.truncate(kept);
        }
    }
}
