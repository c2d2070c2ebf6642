//! Direct paths from the sonar: to what rays have hit after reflections, and to targets that scatter as a whole.

use super::{
    Arrival, Chord, End, HitBatch, Launch, MOST_STEPS, SAGITTA, SoundTracer, Start, State, Step, TracerMemory, rounding,
};
use crate::medium::RefractedRay;
use glam::{DVec3, Vec3};
use ground::lanes::{LANES, MISS, RayBatch};

/// A direct path to the position of an arrival, or to a [`Goal`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direct {
    /// Index of the arrival or goal.
    pub index: u32,
    /// The arrival of a ray along this path.
    pub way: Arrival,
    /// Unit vector along the path where it leaves the sonar, world.
    pub launch: Vec3,
}

/// A target that scatters as a whole: its row, and its middle, m, relative to the scene's origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Goal {
    pub row: u32,
    pub middle: DVec3,
}

/// A direct path that may be blocked.
pub(super) struct CandidatePath {
    direct: Direct,
    /// Whether it ends where it hits the body that it leads into.
    inside: bool,
    /// The ray so far, and the length that it has to reach, m.
    state: State,
    length: f64,
    /// When it arrives at its end, s.
    time: f64,
    /// Its next step, once tracing has begun.
    step: Step,
}

impl CandidatePath {
    /// A path along the ray of `state` as far as `length` m, which takes at most `time` s.
    pub fn new(direct: Direct, state: State, length: f64, time: f64) -> CandidatePath {
        let step = Step { length: 0.0, end: End::Inside, chord: None };
        CandidatePath { direct, inside: false, state, length, time, step }
    }
}

/// How near to its target a ray must pass, m.
const NEAR: f64 = 1e-3;

impl SoundTracer<'_> {
    /// Adds to `ways` the direct paths to those of `arrivals` that came by reflections, where such a path is
    /// unobstructed and echoes are within range. What scatters as a `whole` (by row) is visible from all sides.
    pub fn direct(
        &self,
        launch: &Launch,
        whole: impl Fn(u32) -> bool,
        memory: &mut TracerMemory,
        arrivals: &[Arrival],
        ways: &mut Vec<Direct>,
    ) {
        let depth = self.surface_z - launch.place.z;
        let start = Start { place: launch.place, speed: self.slabs[self.slab_at(depth)].speed_at(depth) };
        let TracerMemory { rays, hits, direct, .. } = memory;
        direct.clear();
        for (index, arrival) in (0..).zip(arrivals) {
            if arrival.order > 0 {
                direct.extend(self.candidate(&start, index, arrival, whole(arrival.surface)));
            }
            if direct.len() == LANES {
                self.look(&start, &whole, rays, hits, direct, ways);
            }
        }
        self.look(&start, &whole, rays, hits, direct, ways);
    }

    /// Adds to `ways` the direct paths to those of `goals` that are blocked by nothing but their own bodies and whose
    /// echoes are within range: up to where they hit these bodies.
    pub fn sight(
        &self,
        place: DVec3,
        goals: &[Goal],
        whole: impl Fn(u32) -> bool,
        memory: &mut TracerMemory,
        ways: &mut Vec<Direct>,
    ) {
        let depth = self.surface_z - place.z;
        let start = Start { place, speed: self.slabs[self.slab_at(depth)].speed_at(depth) };
        let TracerMemory { rays, hits, direct, .. } = memory;
        direct.clear();
        for (index, goal) in (0..).zip(goals) {
            direct.extend(
                self.way_to(&start, goal.middle).filter(|(_, end)| self.believed * end.time <= self.reach).map(
                    |(state, end)| {
                        let met = self.arrival(&State { ray: end, ..state }, goal.row, Vec3::ZERO, &start);
                        let way = Arrival { normal: -met.direction, ..met };
                        let direct = Direct { index, way, launch: state.direction().as_vec3() };
                        CandidatePath { inside: true, ..CandidatePath::new(direct, state, end.path, end.time) }
                    },
                ),
            );
            if direct.len() == LANES {
                self.look(&start, &whole, rays, hits, direct, ways);
            }
        }
        self.look(&start, &whole, rays, hits, direct, ways);
    }

    /// The ray from the source to a position, at its start and at its end.
    pub(super) fn way_to(&self, start: &Start, place: DVec3) -> Option<(State, RefractedRay)> {
        let to = place - start.place;
        if to.length() < NEAR {
            return None;
        }
        if self.uniform { Some(self.straight_way(start, to)) } else { self.bent_way(start, to) }
    }

    /// The direct path to an arrival's position, if it leads to the side of the surface that the arrival hits.
    fn candidate(&self, start: &Start, index: u32, arrival: &Arrival, whole: bool) -> Option<CandidatePath> {
        let straight = (arrival.place.as_dvec3() - start.place).length();
        if f64::from(arrival.range) + self.least_range * straight > 2.0 * self.reach {
            return None;
        }
        let (state, end) = self.way_to(start, arrival.place.as_dvec3())?;
        let Arrival { surface, triangle, corner, normal, .. } = *arrival;
        let met = self.arrival(&State { ray: end, ..state }, surface, normal, start);
        let way = Arrival { ray: arrival.ray, triangle, corner, order: 0, place: arrival.place, ..met };
        let along = way.direction.dot(normal);
        if f64::from(arrival.range + way.range) > 2.0 * self.reach
            || !whole && along * arrival.direction.dot(normal) <= 0.0
        {
            return None;
        }
        // Clear of the surface itself.
        let sine = f64::from(along.abs() / normal.length()).max(1e-3);
        let clear = SAGITTA.max(rounding(arrival.place).into());
        let length = end.path - (clear / sine).min(0.1 * end.path);
        let direct = Direct { index, way, launch: state.direction().as_vec3() };
        Some(CandidatePath::new(direct, state, length, end.time))
    }

    /// The ray along `to`, at its start and at its end, in uniform water.
    fn straight_way(&self, start: &Start, to: DVec3) -> (State, RefractedRay) {
        let depth = self.surface_z - start.place.z;
        let path = to.length();
        let state = State::launch(0, start.place, to / path, depth, &self.slabs, self.slab_at(depth));
        let mut end = state.ray.advanced(&self.slabs[state.ray.slab], path);
        end.lose(path * self.column.mean_absorption(depth, (depth - to.z).max(0.0)) - end.loss());
        (state, end)
    }

    /// The ray that passes through `to`, at its start and there: its tube gives the first correction of the launch
    /// angle, then secants refine it.
    fn bent_way(&self, start: &Start, to: DVec3) -> Option<(State, RefractedRay)> {
        const MOST: usize = 12;
        let depth = self.surface_z - start.place.z;
        let slab = self.slab_at(depth);
        let (heading, level) = super::heading(to);
        let target = [level, depth - to.z];
        let mut angle = (-to.z).atan2(level);
        let mut before: Option<[f64; 2]> = None;
        for _ in 0..MOST {
            let (sine, cosine) = angle.sin_cos();
            let direction = DVec3::new(heading[0] * cosine, heading[1] * cosine, -sine);
            let state = State::launch(0, start.place, direction, depth, &self.slabs, slab);
            let end = self.nearest(state.ray, target)?;
            let cosine = (end.snell * end.speed).min(1.0);
            // Offset of the target from the ray, downwards.
            let miss = (target[1] - end.depth) * cosine - (target[0] - end.distance) * end.sine;
            if miss.abs() < NEAR {
                return Some((state, end));
            }
            let step = match before {
                Some([angle_before, miss_before]) => miss * (angle_before - angle) / (miss - miss_before),
                None => miss / end.tube,
            };
            if step.is_nan() || step.abs() >= 1.0 {
                return None;
            }
            before = Some([angle, miss]);
            angle += step;
        }
        None
    }

    /// A ray where it passes a target (horizontal distance and depth) along its path.
    fn nearest(&self, mut ray: RefractedRay, target: [f64; 2]) -> Option<RefractedRay> {
        // Enough to go down and up again several times.
        let most = 10_000 + 8 * self.slabs.len();
        let ahead = |ray: &RefractedRay| {
            let cosine = (ray.snell * ray.speed).min(1.0);
            (target[0] - ray.distance) * cosine + (target[1] - ray.depth) * ray.sine
        };
        for _ in 0..most {
            let slab = &self.slabs[ray.slab];
            let (length, end) = ray.exit(slab);
            // The slab is extended up to the surface and beyond it: a ray that gets there is not the one sought, but
            // leads to it.
            let is_last = !length.is_finite() || end == End::Inside || end == End::Top && ray.slab == 0;
            if !is_last {
                let next = ray.advanced(slab, length);
                if ahead(&next) > 0.0 {
                    ray = next;
                    ray.cross(&self.slabs, end);
                    continue;
                }
            }
            let mut length = 0.0;
            let mut near = ray;
            for _ in 0..20 {
                let rest = ahead(&near);
                if rest.abs() < 1e-3 * NEAR {
                    break;
                }
                length += rest;
                near = ray.advanced(slab, length);
            }
            return (ahead(&near).abs() < NEAR).then_some(near);
        }
        None
    }

    /// Moves the unobstructed `candidates` to `ways`.
    pub(super) fn look(
        &self,
        start: &Start,
        whole: impl Fn(u32) -> bool,
        rays: &mut RayBatch,
        hits: &mut HitBatch,
        candidates: &mut Vec<CandidatePath>,
        ways: &mut Vec<Direct>,
    ) {
        for _ in 0..MOST_STEPS {
            if candidates.is_empty() {
                return;
            }
            // Every ray advances to where something could block it, or arrives.
            candidates.retain_mut(|it| match self.clear_way(it) {
                Some(arrived) => {
                    if arrived {
                        ways.push(it.direct);
                    }
                    false
                }
                None => true,
            });
            for (lane, it) in candidates.iter().enumerate() {
                let Some(Chord { from, along, length }) = it.step.chord else { continue };
                (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = from.into();
                (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = along.into();
                rays.range_max[lane] = length;
            }
            self.meet(rays, hits, candidates.len(), false, |lane| {
                let ray = &candidates[lane].state.ray;
                [ray.time, 1.0 / ray.speed]
            });
            let mut lane = 0;
            candidates.retain_mut(|it| {
                let surface = hits.surface[lane];
                lane += 1;
                if surface == MISS {
                    return self.go_on(it);
                }
                // What scatters as a whole is not hidden by its own body.
                if whole(surface) && self.scene.is_of_one_object(surface, it.direct.way.surface) {
                    if it.inside {
                        let met = self.at_body(it, (rays, hits), lane - 1, start);
                        it.direct.way = met;
                    }
                    ways.push(it.direct);
                }
                false
            });
        }
        candidates.clear();
    }

    /// The arrival of a ray at the body that it leads into, hit in a `lane`.
    fn at_body(&self, it: &CandidatePath, (rays, hits): (&RayBatch, &HitBatch), lane: usize, start: &Start) -> Arrival {
        let mut state = it.state;
        let normal = self.scene.world_normal(hits.surface[lane], hits.normal(lane), rays.time[lane]);
        let end = state.ray.advanced(&self.slabs[state.ray.slab], it.step.length);
        state.ray = self.at_facet(&state, &end, hits.range[lane].into(), normal);
        let met = self.arrival(&state, it.direct.way.surface, normal, start);
        Arrival { triangle: hits.triangle[lane], corner: [hits.u[lane], hits.v[lane]], ..met }
    }

    /// Advances a ray through empty water; returns whether it has arrived, or `None` if it has to be traced.
    fn clear_way(&self, it: &mut CandidatePath) -> Option<bool> {
        for _ in 0..MOST_STEPS {
            if it.length - it.state.ray.path <= 1e-6 {
                return Some(true);
            }
            it.step = self.direct_step(it);
            if it.step.chord.is_some() {
                return None;
            }
            if !self.go_on(it) {
                return Some(false);
            }
        }
        Some(false)
    }

    /// The next step of a direct path, which ends at the target at the latest.
    fn direct_step(&self, it: &CandidatePath) -> Step {
        let step = self.step(&it.state, it.time);
        let rest = it.length - it.state.ray.path;
        if step.length < rest {
            return step;
        }
        Step { length: rest, end: End::Inside, chord: step.chord.map(|_| self.chord(&it.state, rest)) }
    }

    /// Advances a ray to the end of its step; returns whether it continues from there.
    fn go_on(&self, it: &mut CandidatePath) -> bool {
        let CandidatePath { state: State { ray, .. }, step, .. } = it;
        *ray = ray.advanced(&self.slabs[ray.slab], step.length);
        match step.end {
            End::Inside => {}
            End::Top if ray.slab == 0 => return false,
            end => {
                ray.cross(&self.slabs, end);
            }
        }
        true
    }
}
