//! Tubes: dedicated rays for a body that the rays of a ping sample too coarsely, side by side over the visible outline
//! of its box, and from facet to facet where it reflects sound specularly.

use super::direct::CandidatePath;
use super::{Direct, SoundTracer, Start, State, TracerMemory, rounding};
use crate::trace::{HitBatch, Stand};
use echocast_kernels::boundary;
use glam::{DVec3, Mat3, Quat, Vec3};
use ground::lanes::{LANES, MISS, RayBatch};
use ground::math::cofactors;

/// Most facets that a tube hits: a corner of three returns everything.
const MOST_FACETS: usize = 3;

/// Where a tube hits a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TubeHit {
    /// As in [`Arrival`].
    pub surface: u32,
    pub triangle: u32,
    pub corner: [f32; 2],
    pub place: Vec3,
    pub normal: Vec3,
    /// Unit vectors along the tube where it arrives, and along the direct path from the sonar to there.
    pub along: Vec3,
    pub straight: Vec3,
    /// Directions in which sound leaves along the tube and returns along the direct path, unit vectors at the sonar,
    /// world.
    pub launch: Vec3,
    pub back: Vec3,
    /// Mean length of the path there and the direct path back, m.
    pub path: f64,
    /// Sides of the tube, across it, m.
    pub sides: [Vec3; 2],
    /// Loss of the reflections along the path, dB.
    pub loss: f32,
    /// Number of these reflections.
    pub order: u8,
}

/// A tube while it is traced.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube {
    from: Vec3,
    along: Vec3,
    launch: Vec3,
    /// Length of the path so far and of the part to be traced, m.
    path: f64,
    reach: f32,
    sides: [Vec3; 2],
    loss: f32,
}

/// The origin of the tubes to a body: as straight lines they would start at `place`; only their last part, from `from`
/// m on, is traced.
struct TubeFan<'s> {
    stand: &'s Stand,
    /// Whether a row has smooth facets.
    smooth: &'s dyn Fn(u32) -> bool,
    place: DVec3,
    from: f64,
    /// Rotation from directions at the body to those at the sonar.
    turn: Quat,
    /// Scan time when the sound is there, 0 to 1.
    time: f32,
    /// Matrix from normals in the body's frame to the world frame.
    normals: Mat3,
}

impl SoundTracer<'_> {
    /// Collects the hits of tubes on a body in `found`; returns the direct path to its middle, unless something blocks
    /// it or it is out of range. `grid` gives the numbers of columns and rows of tubes for the half sides of the
    /// visible outline, m; `smooth`, which rows reflect specularly.
    ///
    /// Water refracts all tubes alike: over the extent of the body they are straight.
    pub fn cover(
        &self,
        place: DVec3,
        stand: &Stand,
        grid: impl Fn([f64; 2]) -> [usize; 2],
        smooth: &dyn Fn(u32) -> bool,
        memory: &mut TracerMemory,
        found: &mut Vec<TubeHit>,
    ) -> Option<Direct> {
        found.clear();
        let depth = self.surface_z - place.z;
        let start = Start { place, speed: self.slabs[self.slab_at(depth)].speed_at(depth) };
        let (state, end) = self.way_to(&start, stand.middle)?;
        let radius = stand.radius();
        if self.believed * end.time > self.reach + radius {
            return None;
        }
        let from = if self.uniform { 0.0 } else { (end.path - 2.0 * radius).max(0.0) };
        let way = self.arrival(&State { ray: end, ..state }, stand.body.row, Vec3::ZERO, &start);
        let direct = Direct { index: 0, way, launch: state.direction().as_vec3() };
        if !self.is_clear(&start, CandidatePath::new(direct, state, from, end.time), memory) {
            return None;
        }
        let along = State { ray: end, ..state }.direction();
        let fan = TubeFan {
            stand,
            smooth,
            place: stand.middle - along * end.path,
            from,
            turn: Quat::from_rotation_arc(along.as_vec3(), direct.launch),
            time: self.clock.as_ref().map_or(0.0, |clock| clock.of(end.time)),
            normals: cofactors(&stand.linear).as_mat3(),
        };
        let outline = stand.outline(along);
        let [columns, rows] = grid(outline.map(DVec3::length));
        memory.tubes.clear();
        for index in 0..columns * rows {
            let part = |index: usize, of: usize| (2 * index + 1) as f64 / of as f64 - 1.0;
            let aside = outline[0] * part(index % columns, columns) + outline[1] * part(index / columns, rows);
            memory.tubes.push(fan.tube(aside, outline.map(DVec3::as_vec3), [columns, rows]));
            if memory.tubes.len() == LANES {
                self.follow_tubes(&fan, memory, found);
            }
        }
        self.follow_tubes(&fan, memory, found);
        Some(direct)
    }

    /// Whether nothing blocks a path.
    fn is_clear(&self, start: &Start, candidate: CandidatePath, memory: &mut TracerMemory) -> bool {
        let TracerMemory { rays, hits, direct, ways, .. } = memory;
        direct.clear();
        ways.clear();
        direct.push(candidate);
        self.look(start, |_| false, rays, hits, direct, ways);
        !ways.is_empty()
    }

    /// Traces the tubes of one block until they hit no more of the body.
    fn follow_tubes(&self, fan: &TubeFan, memory: &mut TracerMemory, found: &mut Vec<TubeHit>) {
        let TracerMemory { rays, hits, tubes, .. } = memory;
        for order in 0..MOST_FACETS {
            if tubes.is_empty() {
                return;
            }
            for (lane, tube) in tubes.iter().enumerate() {
                set(rays, lane, tube.from, tube.along, tube.reach, fan.time);
            }
            hits.trace(self.scene, rays, tubes.len(), order == 0, self.sight);
            let first = found.len();
            let mut kept = 0;
            for lane in 0..tubes.len() {
                let Some((hit, mirrored)) = self.tube_hit(fan, &tubes[lane], (rays, hits), lane, order) else {
                    continue;
                };
                found.push(hit);
                if let Some(mirrored) = mirrored {
                    tubes[kept] = mirrored;
                    kept += 1;
                }
            }
            tubes.truncate(kept);
            if order > 0 {
                self.keep_seen(fan, (rays, hits), first, found);
            }
        }
        tubes.clear();
    }

    /// The hit of a tube, if it is on the body, and the tube that is reflected specularly there.
    fn tube_hit(
        &self,
        fan: &TubeFan,
        tube: &Tube,
        (rays, hits): (&RayBatch, &HitBatch),
        lane: usize,
        order: usize,
    ) -> Option<(TubeHit, Option<Tube>)> {
        let (surface, triangle, corner) = (hits.surface[lane], hits.triangle[lane], [hits.u[lane], hits.v[lane]]);
        let row = self.scene.surfaces.rows.get(surface as usize)?;
        if row.object != fan.stand.body.object {
            return None;
        }
        let flat = self.scene.world_normal(surface, hits.normal(lane), rays.time[lane]);
        let bulge = self.scene.surfaces.bulge(row, triangle, corner, &fan.normals, &fan.stand.linear.as_mat3());
        let normal = self.smooth_normal((rays, hits), lane, tube.along, flat);
        let bulge_at = bulge.unwrap_or(Vec3::ZERO);
        let place = tube.from + tube.along * hits.range[lane] + bulge_at;
        let path = tube.path + f64::from(hits.range[lane]) + f64::from(bulge_at.dot(tube.along));
        let way = place.as_dvec3() - fan.place;
        let length = way.length();
        let (straight, back) = match order {
            0 => (tube.along, tube.launch),
            _ => ((way / length).as_vec3(), fan.turn * (way / length).as_vec3()),
        };
        // Tubes widen on the way to the body.
        let wider = if order == 0 { (path / (fan.stand.middle - fan.place).length()) as f32 } else { 1.0 };
        let hit = TubeHit {
            surface,
            triangle,
            corner,
            place,
            normal,
            along: tube.along,
            straight,
            launch: tube.launch,
            back,
            path: if order == 0 { path } else { 0.5 * (path + length) },
            sides: tube.sides.map(|side| side * wider),
            loss: tube.loss,
            order: order as u8,
        };
        // A curved mirror makes sound diverge: what it reflects onto other facets is neglected.
        let mirrors = fan.stand.body.mirrors && bulge.is_none() && order + 1 < MOST_FACETS;
        Some((hit, if mirrors { self.mirrored(fan, tube, &hit, path) } else { None }))
    }

    /// The tube reflected by a facet that was hit after `path` m.
    fn mirrored(&self, fan: &TubeFan, tube: &Tube, hit: &TubeHit, path: f64) -> Option<Tube> {
        let normal = hit.normal.normalize_or_zero();
        let sine = tube.along.dot(normal).abs();
        if sine == 0.0 || !(fan.smooth)(hit.surface) {
            return None;
        }
        let facing = if tube.along.dot(normal) > 0.0 { -normal } else { normal };
        let turned = |vector: Vec3| vector - 2.0 * vector.dot(normal) * normal;
        let along = turned(tube.along).normalize();
        let [back, up] = boundary::clearance(rounding(hit.place).max(1e-5), sine);
        let clear = facing * up - tube.along * back;
        Some(Tube {
            from: hit.place + clear,
            along,
            path: path + f64::from(clear.dot(along)),
            reach: 4.0 * fan.stand.radius() as f32,
            sides: hit.sides.map(turned),
            loss: tube.loss + (self.reflection_loss)(hit.surface, sine.into()) as f32,
            ..*tube
        })
    }

    /// Of `found`, from `first` on, keeps what is visible from the sonar.
    fn keep_seen(
        &self,
        fan: &TubeFan,
        (rays, hits): (&mut RayBatch, &mut HitBatch),
        first: usize,
        found: &mut Vec<TubeHit>,
    ) {
        let count = found.len() - first;
        for (lane, hit) in found[first..].iter().enumerate() {
            let facing = hit.normal * -hit.normal.dot(hit.straight).signum() / hit.normal.length();
            let from = hit.place + facing * rounding(hit.place).max(1e-5);
            let length = (from.as_dvec3() - fan.place).length() - fan.from;
            set(rays, lane, from, -hit.straight, length as f32, fan.time);
        }
        hits.trace(self.scene, rays, count, false, self.sight);
        let mut lane = 0;
        found.retain(|_| {
            let is_new = lane >= first;
            lane += 1;
            !is_new || hits.surface[lane - 1 - first] == MISS
        });
    }
}

impl TubeFan<'_> {
    /// The tube through the point at the offset `aside` from the body's middle, one of `columns` and `rows` in the
    /// rectangle with these half `sides`.
    fn tube(&self, aside: DVec3, sides: [Vec3; 2], [columns, rows]: [usize; 2]) -> Tube {
        let to = self.stand.middle + aside - self.place;
        let along = to.normalize();
        let reach = to.length() - self.from + 2.0 * self.stand.radius();
        Tube {
            from: (self.place + along * self.from).as_vec3(),
            along: along.as_vec3(),
            launch: self.turn * along.as_vec3(),
            path: self.from,
            reach: reach as f32,
            sides: [sides[0] * (2.0 / columns as f32), sides[1] * (2.0 / rows as f32)],
            loss: 0.0,
        }
    }
}

fn set(rays: &mut RayBatch, lane: usize, from: Vec3, along: Vec3, reach: f32, time: f32) {
    (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = from.into();
    (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = along.into();
    (rays.range_max[lane], rays.time[lane]) = (reach, time);
}
