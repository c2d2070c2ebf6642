//! The rays of one block side by side: advanced chord by chord, traced together, and handled one by one where they hit
//! something or do what few of them do.

use super::{Arrival, Chord, MOST_STEPS, SAGITTA, SoundTracer, Start, State, TracerMemory, rounding};
use crate::medium::{End, RefractedRay};
use crate::trace::HitBatch;
use echocast_kernels::water::{Chords, Eight, Stop, Through, WIDTH, WaterRays, lead};
use glam::Vec3;
use ground::lanes::{LANES, MISS, RayBatch};

const GROUPS: usize = LANES / WIDTH;

/// Buffers for the rays of one block.
pub(super) struct RayBlock {
    /// Number of rays.
    count: usize,
    rays: [WaterRays; GROUPS],
    /// The rays where their chords start.
    starts: [WaterRays; GROUPS],
    chords: [Chords; GROUPS],
    stops: [Eight<Stop>; GROUPS],
    /// When they end, s.
    latest: [Eight; GROUPS],
    /// As in [`State`] and [`RefractedRay`].
    numbers: [u32; LANES],
    orders: [u8; LANES],
    levels: [bool; LANES],
    /// The rays that are traced, by lane of the batch.
    traced: Vec<u32>,
}

impl RayBlock {
    pub fn new() -> RayBlock {
        RayBlock {
            count: 0,
            rays: [WaterRays::default(); GROUPS],
            starts: [WaterRays::default(); GROUPS],
            chords: [Chords::default(); GROUPS],
            stops: [[Stop::Ended; WIDTH]; GROUPS],
            latest: [[0.0; WIDTH]; GROUPS],
            numbers: [0; LANES],
            orders: [0; LANES],
            levels: [false; LANES],
            traced: Vec::with_capacity(LANES),
        }
    }

    /// The state of a ray in `rays`.
    fn state(&self, rays: &[WaterRays; GROUPS], ray: usize) -> State {
        let (group, i) = (&rays[ray / WIDTH], ray % WIDTH);
        State {
            number: self.numbers[ray],
            start: group.start.map(|axis| axis[i]),
            heading: group.heading.map(|axis| axis[i]),
            ray: RefractedRay {
                distance: group.distance[i],
                depth: group.depth[i],
                sine: group.sine[i],
                snell: group.snell[i],
                slab: group.slab[i] as usize,
                speed: group.speed[i],
                time: group.time[i],
                path: group.path[i],
                level: self.levels[ray],
                absorbed: group.absorbed[i],
                transmitted: group.transmitted[i],
                speed_path: group.speed_path[i],
                tube: group.tube[i],
                widening: group.widening[i],
                turn: group.turn[i],
            },
            order: self.orders[ray],
        }
    }

    fn set(&mut self, ray: usize, state: &State, latest: f64) {
        let (group, i) = (&mut self.rays[ray / WIDTH], ray % WIDTH);
        for axis in 0..2 {
            (group.start[axis][i], group.heading[axis][i]) = (state.start[axis], state.heading[axis]);
        }
        let it = &state.ray;
        (group.distance[i], group.depth[i], group.sine[i]) = (it.distance, it.depth, it.sine);
        (group.snell[i], group.slab[i], group.speed[i]) = (it.snell, it.slab as u32, it.speed);
        (group.time[i], group.path[i]) = (it.time, it.path);
        (group.absorbed[i], group.transmitted[i], group.speed_path[i]) = (it.absorbed, it.transmitted, it.speed_path);
        (group.tube[i], group.widening[i], group.turn[i]) = (it.tube, it.widening, it.turn);
        (self.numbers[ray], self.orders[ray], self.levels[ray]) = (state.number, state.order, it.level);
        self.latest[ray / WIDTH][i] = latest;
    }

    fn stop(&mut self, ray: usize) -> &mut Stop {
        &mut self.stops[ray / WIDTH][ray % WIDTH]
    }

    fn set_chord(&mut self, ray: usize, chord: Option<Chord>) {
        let (chords, i) = (&mut self.chords[ray / WIDTH], ray % WIDTH);
        chords.traced[i] = chord.is_some();
        if let Some(chord) = chord {
            for axis in 0..3 {
                (chords.from[axis][i], chords.along[axis][i]) = (chord.from[axis], chord.along[axis]);
            }
            chords.length[i] = chord.length;
        }
    }
}

impl SoundTracer<'_> {
    /// Traces all states until they have hit something without being reflected, or are out of range.
    pub(super) fn follow(&self, memory: &mut TracerMemory, start: &Start, arrivals: &mut Vec<Arrival>) {
        let TracerMemory { rays, hits, states, block, .. } = memory;
        block.count = states.len();
        block.stops = [[Stop::Ended; WIDTH]; GROUPS];
        for (ray, state) in states.iter().enumerate() {
            self.put(block, ray, state, start);
        }
        let through = Through {
            slabs: &self.slabs,
            limits: &self.limits,
            sagitta: SAGITTA,
            surface_z: self.surface_z,
            bounds: self.bounds.map(|corner| corner.map(f64::from)),
        };
        for _ in 0..MOST_STEPS {
            let groups = ..block.count.div_ceil(WIDTH);
            lead(
                &through,
                &block.latest[groups],
                &mut block.rays[groups],
                &mut block.starts[groups],
                &mut block.chords[groups],
                &mut block.stops[groups],
            );
            let Some(coherent) = self.gather(block, rays) else { return };
            let RayBlock { traced, starts, .. } = &**block;
            self.meet(rays, hits, traced.len(), coherent, |lane| {
                let (group, i) = (&starts[traced[lane] as usize / WIDTH], traced[lane] as usize % WIDTH);
                [group.time[i], 1.0 / group.speed[i]]
            });
            let mut lane = 0;
            for ray in 0..block.count {
                if *block.stop(ray) == Stop::Ended {
                    continue;
                }
                let is_traced = block.traced.get(lane) == Some(&(ray as u32));
                lane += usize::from(is_traced);
                if is_traced && hits.surface[lane - 1] != MISS {
                    self.met(block, ray, (rays, hits), lane - 1, start, arrivals);
                } else {
                    self.missed(block, ray, start, arrivals);
                }
            }
        }
    }

    /// Continues a ray from `state`, provided that echoes from beyond can still be received.
    fn put(&self, block: &mut RayBlock, ray: usize, state: &State, start: &Start) {
        let latest = self.latest(state);
        block.set(ray, state, latest);
        let is_receivable = state.ray.time < latest && self.is_in_reach(state, start);
        *block.stop(ray) = if is_receivable { Stop::Onward } else { Stop::Ended };
    }

    /// Collects the chords to be traced; returns whether their rays are still neighbours, or `None` if no ray
    /// continues.
    fn gather(&self, block: &mut RayBlock, rays: &mut RayBatch) -> Option<bool> {
        let (mut any, mut coherent) = (false, true);
        block.traced.clear();
        for group in 0..block.count.div_ceil(WIDTH) {
            for i in 0..WIDTH {
                let (ray, stop) = (group * WIDTH + i, block.stops[group][i]);
                if stop == Stop::Ended {
                    continue;
                }
                any = true;
                if stop == Stop::Level && block.chords[group].length[i] == 0.0 {
                    self.step_alone(block, ray);
                }
                let Chords { from: [x, y, z], along, length, traced } = &block.chords[group];
                if !traced[i] {
                    continue;
                }
                let lane = block.traced.len();
                (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = (x[i], y[i], z[i]);
                (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = (along[0][i], along[1][i], along[2][i]);
                rays.range_max[lane] = length[i] + self.overlap(length[i]);
                block.traced.push(ray as u32);
                // Rays that have not been reflected are still neighbours.
                coherent &= block.orders[ray] == 0;
            }
        }
        any.then_some(coherent)
    }

    /// How much farther than its `length`, m, a chord is traced, so that there is no gap between one and the next.
    fn overlap(&self, length: f32) -> f32 {
        let [low, high] = self.bounds.map(Vec3::from);
        1e-6 * length + rounding(low.abs().max(high.abs())).max(1e-5)
    }

    /// Advances a ray that is level, or at its turning point, by one step.
    fn step_alone(&self, block: &mut RayBlock, ray: usize) {
        let mut state = block.state(&block.rays, ray);
        let latest = self.latest(&state);
        let step = self.step(&state, latest);
        state.ray = state.ray.advanced(&self.slabs[state.ray.slab], step.length);
        block.set(ray, &state, latest);
        block.set_chord(ray, step.chord);
        *block.stop(ray) = match step.end {
            End::Inside => Stop::Onward,
            End::Top => Stop::Top,
            End::Bottom => Stop::Bottom,
        };
    }

    /// Continues or ends a ray whose chord has hit nothing.
    fn missed(&self, block: &mut RayBlock, ray: usize, start: &Start, arrivals: &mut Vec<Arrival>) {
        let end = match *block.stop(ray) {
            Stop::Ended => return,
            Stop::Top => End::Top,
            Stop::Bottom => End::Bottom,
            Stop::Onward | Stop::Level => {
                let early = block.rays[ray / WIDTH].time[ray % WIDTH] < block.latest[ray / WIDTH][ray % WIDTH];
                let near = || self.is_in_reach(&block.state(&block.rays, ray), start);
                if !early || block.orders[ray] > 0 && !near() {
                    *block.stop(ray) = Stop::Ended;
                }
                return;
            }
        };
        let mut state = block.state(&block.rays, ray);
        if self.pass(&mut state, end, start, arrivals) {
            self.put(block, ray, &state, start);
        } else {
            *block.stop(ray) = Stop::Ended;
        }
    }

    /// Records what the chord of a ray has hit, in a `lane`, and reflects the ray there.
    fn met(
        &self,
        block: &mut RayBlock,
        ray: usize,
        (rays, hits): (&RayBatch, &HitBatch),
        lane: usize,
        start: &Start,
        arrivals: &mut Vec<Arrival>,
    ) {
        let surface = hits.surface[lane];
        let normal = self.scene.world_normal(surface, hits.normal(lane), rays.time[lane]);
        let mut state = block.state(&block.starts, ray);
        let end = block.state(&block.rays, ray).ray;
        state.ray = self.at_facet(&state, &end, hits.range[lane].into(), normal);
        *block.stop(ray) = Stop::Ended;
        if !self.is_in_reach(&state, start) {
            return;
        }
        let smooth = self.smooth_normal((rays, hits), lane, state.direction().as_vec3(), normal);
        let (triangle, corner) = (hits.triangle[lane], [hits.u[lane], hits.v[lane]]);
        let arrival = self.arrival(&state, surface, smooth, start);
        arrivals.push(Arrival { triangle, corner, ..arrival });
        if self.reflect(&mut state, surface, normal) {
            self.put(block, ray, &state, start);
        }
    }

    /// A ray at the facet with a `normal` that its chord hits after `range` m; `end` is the ray at the end of the
    /// chord.
    pub(super) fn at_facet(&self, state: &State, end: &RefractedRay, range: f64, normal: Vec3) -> RefractedRay {
        let mut ray = state.ray;
        let from = [ray.distance, ray.depth];
        let chord = [end.distance - from[0], end.depth - from[1]];
        let whole = (chord[0] * chord[0] + chord[1] * chord[1]).sqrt();
        if whole == 0.0 {
            return ray;
        }
        let along = chord.map(|it| it / whole);
        let mut slab = &self.slabs[ray.slab];
        let mut rest = range;
        // A facet that is at a boundary, but for rounding, is hit before it.
        let close = f64::from(self.overlap(range as f32));
        for _ in 0..MOST_STEPS {
            let (length, end) = ray.exit(slab);
            if end == End::Inside || end == End::Top && ray.slab == 0 || length >= rest - 2.0 * close {
                break;
            }
            ray = ray.advanced(slab, length);
            ray.cross(&self.slabs, end);
            slab = &self.slabs[ray.slab];
            rest = range - (ray.distance - from[0]) * along[0] - (ray.depth - from[1]) * along[1];
        }
        let near = ray.advanced(slab, rest);
        // From there to the facet by one step of Newton's method, within the vertical plane of the ray.
        let normal = normal.as_dvec3();
        let across = [state.heading[0] * normal.x + state.heading[1] * normal.y, -normal.z];
        let miss = (near.distance - from[0] - range * along[0]) * across[0]
            + (near.depth - from[1] - range * along[1]) * across[1];
        let towards = near.snell * near.speed * across[0] + near.sine * across[1];
        let further = if towards.abs() > 1e-3 * normal.length() { -miss / towards } else { 0.0 };
        if further.abs() < 1e-9 { near } else { ray.advanced(slab, (rest + further).clamp(0.0, rest + whole)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::Slab;
    use echocast_kernels::water::Limits;

    fn slab(top: f64, bottom: f64, speed: f64, gradient: f64) -> Slab {
        Slab { top, bottom, speed, gradient, density: 1025.0, absorption: 0.02, absorption_slope: 1e-4 }
    }

    /// Slabs with continuous sound speed: a thermocline, a duct, and increasing gradients.
    fn cast() -> Vec<Slab> {
        let rows = [
            (0.0, 1500.0),
            (3.0, 1499.0),
            (3.3, 1497.0),
            (8.0, 1450.0),
            (12.0, 1448.0),
            (30.0, 1455.0),
            (90.0, 1470.0),
        ];
        let mut slabs: Vec<Slab> = rows
            .windows(2)
            .map(|it| slab(it[0].0, it[1].0, it[0].1, (it[1].1 - it[0].1) / (it[1].0 - it[0].0)))
            .collect();
        slabs.push(slab(90.0, f64::INFINITY, 1470.0, 0.0));
        slabs
    }

    fn layers() -> Vec<Slab> {
        let speeds = [1490.0, 1488.0, 1486.0, 1500.0, 1470.0, 1468.0];
        let tops = [0.0, 1.5, 4.0, 7.0, 7.5, 20.0, f64::INFINITY];
        (0..6).map(|i| Slab { density: 1025.0 + i as f64, ..slab(tops[i], tops[i + 1], speeds[i], 0.0) }).collect()
    }

    /// `ray` when it is `path` m long, passed from slab to slab; `None`: it reaches the surface before.
    fn alone(mut ray: RefractedRay, slabs: &[Slab], path: f64) -> Option<RefractedRay> {
        loop {
            let (length, end) = ray.exit(&slabs[ray.slab]);
            // A ray at a boundary counts as beyond it.
            if length > path - ray.path + 1e-9 {
                return Some(ray.advanced(&slabs[ray.slab], path - ray.path));
            }
            ray = ray.advanced(&slabs[ray.slab], length);
            if end == End::Top && ray.slab == 0 {
                return None;
            }
            ray.cross(slabs, end);
        }
    }

    /// Rays traced side by side get where a single ray does, and chords are within the sagitta of their arcs.
    #[test]
    fn rays_side_by_side_are_rays() {
        for (slabs, depth) in [(cast(), 2.0), (cast(), 9.0), (cast(), 40.0), (layers(), 2.0), (layers(), 8.0)] {
            let limits: Vec<Limits> = slabs.iter().map(|slab| Limits::new(slab, SAGITTA, false)).collect();
            let bounds = [[-1e3; 3], [1e3; 3]];
            let water = Through { slabs: &slabs, limits: &limits, sagitta: SAGITTA, surface_z: 0.0, bounds };
            let first = crate::medium::slab_at(&slabs, depth);
            let mut block = RayBlock::new();
            block.count = LANES;
            for ray in 0..LANES {
                let angle = (ray as f64 + 0.5) / LANES as f64 * std::f64::consts::PI - std::f64::consts::FRAC_PI_2;
                let it = RefractedRay::launch(depth, [angle.sin(), angle.cos()], &slabs, first);
                let state = State { number: ray as u32, start: [0.0; 2], heading: [0.6, 0.8], ray: it, order: 0 };
                block.set(ray, &state, 0.1);
                *block.stop(ray) = Stop::Onward;
            }
            let starts: Vec<RefractedRay> = (0..LANES).map(|ray| block.state(&block.rays, ray).ray).collect();
            let mut compared = 0;
            for _ in 0..60 {
                let RayBlock { latest, rays, starts: from, chords, stops, .. } = &mut block;
                lead(&water, latest, rays, from, chords, stops);
                for ray in 0..LANES {
                    let found = block.state(&block.rays, ray).ray;
                    let before = block.state(&block.starts, ray).ray;
                    if *block.stop(ray) != Stop::Onward || found.path == before.path {
                        *block.stop(ray) = Stop::Ended;
                        continue;
                    }
                    let Some(expected) = alone(starts[ray], &slabs, found.path) else { panic!("{ray}: {found:?}") };
                    let pairs = [
                        (found.distance, expected.distance, 1e-9),
                        (found.depth, expected.depth, 1e-9),
                        (found.time, expected.time, 1e-8 * expected.time),
                        (found.sine, expected.sine, 1e-9),
                        (found.loss(), expected.loss(), 1e-4),
                        (found.speed_path, expected.speed_path, 1e-8 * expected.speed_path),
                        (found.tube, expected.tube, 1e-6 * (1.0 + expected.tube.abs())),
                    ];
                    for (found, expected, tolerance) in pairs {
                        assert!((found - expected).abs() < tolerance, "{ray} from {depth}: {found} {expected}");
                    }
                    compared += 1;
                    // The middle of the arc, and its distance from the chord.
                    let middle = alone(starts[ray], &slabs, 0.5 * (before.path + found.path)).unwrap();
                    let [level, fall] = [found.distance - before.distance, found.depth - before.depth];
                    let [right, below] = [middle.distance - before.distance, middle.depth - before.depth];
                    let apart = (level * below - fall * right).abs() / level.hypot(fall);
                    assert!(apart <= SAGITTA * 1.001, "{ray} from {depth}: {apart}");
                }
            }
            assert!(compared > 2 * LANES, "{compared}");
        }
    }
}
