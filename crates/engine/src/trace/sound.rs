//! Sound rays through layered water and a scene: refracted, reflected, and arriving at what they hit.

mod block;
mod direct;
mod tubes;

pub(crate) use direct::{Direct, Goal};
pub(crate) use tubes::TubeHit;

use super::{Clock, HitBatch, Sight, Tables, seen_normal};
use crate::medium::{End, RefractedRay, Slab, WaterColumn, slab_at};
use echocast_kernels::boundary;
use echocast_kernels::water::{Limits, Turn, farther};
use glam::{DVec3, Mat3, Vec3};
use ground::lanes::{LANES, MEDIUM, MISS, RayBatch};
use std::ops::Range;

/// Greatest distance of an arc from the chord that is traced in its place, m.
const SAGITTA: f64 = 1e-3;

/// Steps (one chord of every ray each) after which the rays of a block are abandoned; for a direct path also the most
/// steps between two on which something can be hit. A ray that oscillates in a thin duct takes that many.
const MOST_STEPS: usize = 100_000;

/// Reflection loss, dB, of a surface row (or [`MEDIUM`]) as a function of the sine of the grazing angle.
pub(crate) type ReflectionLoss<'a> = &'a (dyn Fn(u32, f64) -> f64 + Sync);

/// Traces rays from one point through one scene and one water column.
pub(crate) struct SoundTracer<'a> {
    scene: &'a Tables,
    /// The column, cut at the top and bottom of the scene, and the step limits of rays in each slab.
    slabs: Vec<Slab>,
    limits: Vec<Limits>,
    /// The column, uncut.
    column: &'a WaterColumn,
    /// Whether all rays are straight.
    uniform: bool,
    /// z of the sea surface, m, relative to the scene's origin.
    surface_z: f64,
    /// The scene's bounding box, m, relative to its origin.
    bounds: [[f32; 3]; 2],
    sight: Sight,
    /// Sound speed that the sonar assumes when it reports ranges, m/s.
    believed: f64,
    /// Maximum reported range, m.
    reach: f64,
    /// Reported range per metre of path where sound is fastest.
    least_range: f64,
    /// Reflections that are traced.
    bounces: u8,
    reflection_loss: ReflectionLoss<'a>,
    /// In a moving scene, the scene time for each travel time.
    clock: Option<Clock>,
}

/// What a ray hits, where, and along which path.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Number of the ray.
    pub ray: u32,
    /// Row of the scene's surfaces, or [`MEDIUM`].
    pub surface: u32,
    /// Triangle of the part.
    pub triangle: u32,
    /// Barycentric weights of its second and third corner.
    pub corner: [f32; 2],
    /// Range that the sonar reports, m: one-way travel time times the sound speed that it assumes.
    pub range: f32,
    /// Length along the ray, m.
    pub path: f32,
    /// One-way loss by absorption, boundaries and reflections, dB.
    pub loss: f32,
    /// Widths of the ray tube per radian at the source, m: in the vertical plane, and across it.
    pub tube: [f32; 2],
    /// Sound speed there relative to that at the source.
    pub speed: f32,
    /// Position relative to the scene's origin, m.
    pub place: Vec3,
    /// Unit vector along the ray.
    pub direction: Vec3,
    /// Normal of the surface, of any length and sign: interpolated for smooth parts, otherwise that of the triangle.
    pub normal: Vec3,
    /// Reflections on the path.
    pub order: u8,
}

/// A ray on its path through the scene.
#[derive(Clone, Copy, Debug)]
struct State {
    number: u32,
    /// Where its vertical plane starts, relative to the scene's origin, m, and the heading of that plane, a unit
    /// vector.
    start: [f64; 2],
    heading: [f64; 2],
    ray: RefractedRay,
    order: u8,
}

/// The source of the rays.
#[derive(Clone, Copy)]
struct Start {
    /// Relative to the scene's origin, m.
    place: DVec3,
    /// Sound speed there, m/s.
    speed: f64,
}

/// The next part of a ray: an arc within one slab.
#[derive(Clone, Copy, Debug)]
struct Step {
    length: f64,
    end: End,
    /// The chord traced in its place, where it can hit something in the scene.
    chord: Option<Chord>,
}

/// The straight line between the ends of an arc, relative to the scene's origin, m.
#[derive(Clone, Copy, Debug)]
struct Chord {
    from: Vec3,
    along: Vec3,
    length: f32,
}

impl State {
    /// Ray `number` from `place` (relative to the scene's origin) in the unit `direction`, at `depth` in `slabs[slab]`.
    fn launch(number: u32, place: DVec3, direction: DVec3, depth: f64, slabs: &[Slab], slab: usize) -> State {
        let (heading, level) = heading(direction);
        let ray = RefractedRay::launch(depth, [-direction.z, level], slabs, slab);
        State { number, start: [place.x, place.y], heading, ray, order: 0 }
    }

    /// Horizontal position, m.
    fn level(&self) -> [f64; 2] {
        let distance = self.ray.distance;
        [self.start[0] + self.heading[0] * distance, self.start[1] + self.heading[1] * distance]
    }

    /// Unit vector along the ray.
    fn direction(&self) -> DVec3 {
        let sine = self.ray.sine;
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        DVec3::new(self.heading[0] * cosine, self.heading[1] * cosine, -sine)
    }
}

/// Horizontal unit vector along `direction`, and the length of its horizontal part.
fn heading(direction: DVec3) -> ([f64; 2], f64) {
    let level = (direction.x * direction.x + direction.y * direction.y).sqrt();
    // Straight up or down, any will do.
    let heading = if level > 1e-12 { [direction.x / level, direction.y / level] } else { [1.0, 0.0] };
    (heading, level)
}

/// Rays from one point, in the directions of a sensor.
pub(crate) struct Launch<'a> {
    /// Unit directions in the sensor's frame.
    pub directions: [&'a [f32]; 3],
    /// Rotation to the world frame.
    pub rotation: Mat3,
    /// Relative to the scene's origin, m.
    pub place: DVec3,
}

/// Buffers of [`SoundTracer::trace`].
pub(crate) struct TracerMemory {
    rays: Box<RayBatch>,
    hits: Box<HitBatch>,
    states: Vec<State>,
    block: Box<block::RayBlock>,
    direct: Vec<direct::CandidatePath>,
    ways: Vec<Direct>,
    tubes: Vec<tubes::Tube>,
}

impl Default for TracerMemory {
    fn default() -> Self {
        TracerMemory {
            rays: Box::new(RayBatch::default()),
            hits: Box::new(HitBatch::new()),
            states: Vec::new(),
            block: Box::new(block::RayBlock::new()),
            direct: Vec::new(),
            ways: Vec::new(),
            tubes: Vec::new(),
        }
    }
}

/// What [`SoundTracer::new`] needs in addition to scene and water.
pub(crate) struct SoundLimits<'a> {
    pub mask: u32,
    /// Sound speed that the sonar assumes when it reports ranges, m/s.
    pub believed: f64,
    /// Maximum reported range, m.
    pub reach: f64,
    /// Reflections that are traced.
    pub bounces: u8,
    pub reflection_loss: ReflectionLoss<'a>,
    /// In a moving scene, the scene time for each travel time.
    pub clock: Option<Clock>,
}

impl<'a> SoundTracer<'a> {
    pub fn new(scene: &'a Tables, column: &'a WaterColumn, sound: SoundLimits<'a>) -> SoundTracer<'a> {
        let bounds = scene.structure.bounds();
        let surface_z = column.surface_z - scene.origin.z;
        let [top, bottom] = [bounds[1][2], bounds[0][2]].map(|z| surface_z - f64::from(z));
        let mut slabs = Vec::with_capacity(column.slabs.len() + 2);
        for slab in &column.slabs {
            let mut rest = *slab;
            for cut in [top - SAGITTA, bottom + SAGITTA] {
                if cut > rest.top && cut < rest.bottom {
                    let (above, below) = rest.split(cut);
                    slabs.push(above);
                    rest = below;
                }
            }
            slabs.push(rest);
        }
        let is_empty = |slab: &Slab| !(slab.bottom > top - SAGITTA && slab.top < bottom + SAGITTA);
        let limits = slabs.iter().map(|slab| Limits::new(slab, SAGITTA, is_empty(slab))).collect();
        let uniform = column.is_uniform();
        let fastest = column.end_speeds().fold(0.0, f64::max);
        let SoundLimits { mask, believed, reach, bounces, reflection_loss, clock } = sound;
        SoundTracer {
            scene,
            slabs,
            limits,
            column,
            uniform,
            surface_z,
            bounds,
            sight: Sight::of_shapes(mask),
            believed,
            reach,
            least_range: believed / fastest,
            bounces,
            reflection_loss,
            clock,
        }
    }

    /// Appends what the rays `which` of `launch` hit to `arrivals`, block by block: in uniform water the first hit of
    /// each ray, in ray order, then the hits after reflections; in other water in the order of the chords that reach
    /// them. After reflections this includes hits that are out of range back along the path but may be in range along
    /// the direct path back.
    pub fn trace(&self, launch: &Launch, which: Range<usize>, memory: &mut TracerMemory, arrivals: &mut Vec<Arrival>) {
        let depth = self.surface_z - launch.place.z;
        let slab = self.slab_at(depth);
        let start = Start { place: launch.place, speed: self.slabs[slab].speed_at(depth) };
        for first in which.clone().step_by(LANES) {
            let count = LANES.min(which.end - first);
            memory.states.clear();
            if self.uniform {
                self.straight(launch, first..first + count, memory, arrivals);
            } else {
                memory.states.extend((first..first + count).map(|ray| {
                    let direction = launch.direction(ray).as_dvec3().normalize();
                    State::launch(ray as u32, launch.place, direction, depth, &self.slabs, slab)
                }));
            }
            self.follow(memory, &start, arrivals);
        }
    }

    fn slab_at(&self, depth: f64) -> usize {
        slab_at(&self.slabs, depth)
    }

    /// Traces the rays of one block through uniform water; those that are reflected go to `memory.states`.
    fn straight(&self, launch: &Launch, block: Range<usize>, memory: &mut TracerMemory, arrivals: &mut Vec<Arrival>) {
        let TracerMemory { rays, hits, states, .. } = memory;
        let depth = self.surface_z - launch.place.z;
        let water = &self.column.slabs[self.column.slab_at(depth)];
        // The reported range per metre of path.
        let scale = (self.believed / water.speed) as f32;
        let reach = (self.reach * water.speed / self.believed) as f32;
        let place = launch.place.as_vec3();
        rays.org_x.fill(place.x);
        rays.org_y.fill(place.y);
        rays.org_z.fill(place.z);
        let shallow = depth as f32;
        for (lane, ray) in block.clone().enumerate() {
            let direction = launch.direction(ray);
            (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = direction.into();
            let to_surface = if direction.z > 0.0 { shallow / direction.z } else { f32::INFINITY };
            rays.range_max[lane] = reach.min(to_surface);
        }
        let per_metre = 1.0 / water.speed;
        self.meet(rays, hits, block.len(), true, |_| [0.0, per_metre]);
        let absorption = water.absorption_at(depth) as f32;
        let half_slope = 0.5 * water.absorption_slope as f32;
        // Depths below the sonar where this slab begins and ends.
        let (rise, fall) = ((water.top - depth) as f32, (water.bottom - depth) as f32);
        for (lane, ray) in block.enumerate() {
            let direction = rays.direction(lane);
            let (range, surface, normal) = if hits.surface[lane] != MISS {
                let normal = self.scene.world_normal(hits.surface[lane], hits.normal(lane), rays.time[lane]);
                (hits.range[lane], hits.surface[lane], normal)
            } else if rays.range_max[lane] < reach {
                (rays.range_max[lane], MEDIUM, Vec3::NEG_Z)
            } else {
                continue;
            };
            let below = -direction.z * range;
            let loss = if below >= rise && below <= fall {
                range * (absorption + half_slope * below)
            } else {
                range * self.column.mean_absorption(depth, (depth + f64::from(below)).max(0.0)) as f32
            };
            arrivals.push(Arrival {
                ray: ray as u32,
                surface,
                triangle: hits.triangle[lane],
                corner: [hits.u[lane], hits.v[lane]],
                range: range * scale,
                path: range,
                loss,
                tube: [range; 2],
                speed: 1.0,
                place: place + direction * range,
                direction,
                normal: if surface == MEDIUM {
                    normal
                } else {
                    self.smooth_normal((rays, hits), lane, direction, normal)
                },
                order: 0,
            });
            if self.bounces > 0 {
                let direction = direction.as_dvec3().normalize();
                let here = self.slab_at(depth);
                let mut state = State::launch(ray as u32, launch.place, direction, depth, &self.slabs, here);
                state.ray = state.ray.advanced(water, f64::from(range));
                state.ray.lose(f64::from(loss) - state.ray.loss());
                state.ray.slab = self.slab_at(state.ray.depth);
                if self.reflect(&mut state, surface, normal) {
                    states.push(state);
                }
            }
        }
    }

    /// Traces `count` sound rays; moving objects are hit where they are when the sound gets there. `passing` gives, for
    /// a lane, the time at which its ray starts, s after the ping, and the travel time per metre, s.
    fn meet(
        &self,
        rays: &mut RayBatch,
        hits: &mut HitBatch,
        count: usize,
        coherent: bool,
        passing: impl Fn(usize) -> [f64; 2],
    ) {
        /// Objects move at no more than a hundredth of the speed of sound: each pass improves the position a
        /// hundredfold.
        const PASSES: usize = 4;
        let Some(clock) = &self.clock else { return hits.trace(self.scene, rays, count, coherent, self.sight) };
        for pass in 0..PASSES {
            let mut changed = false;
            for lane in 0..count {
                let length = match hits.surface[lane] {
                    _ if pass == 0 => 0.0,
                    MISS => rays.range_max[lane],
                    _ => hits.range[lane],
                };
                let [start, per_metre] = passing(lane);
                let length = if length.is_finite() { f64::from(length) } else { 0.0 };
                let before = std::mem::replace(&mut rays.time[lane], clock.of(start + length * per_metre));
                changed |= (rays.time[lane] - before).abs() > 1e-6;
            }
            if changed || pass == 0 {
                hits.trace(self.scene, rays, count, coherent, self.sight);
            }
        }
    }

    /// Reflects a ray at the surface that it has hit; returns whether it continues.
    fn reflect(&self, state: &mut State, surface: u32, normal: Vec3) -> bool {
        /// Rays that have lost more than this, dB, are dropped.
        const MOST_LOSS: f64 = 80.0;
        if state.order >= self.bounces {
            return false;
        }
        state.order += 1;
        if surface == MEDIUM {
            let ray = &mut state.ray;
            ray.lose((self.reflection_loss)(MEDIUM, ray.sine.abs()));
            // Mirroring points it down again.
            (ray.depth, ray.sine) = (0.0, -ray.sine.abs());
            ray.mirror(&self.slabs[ray.slab]);
            return ray.loss() < MOST_LOSS;
        }
        let normal = normal.as_dvec3().normalize_or_zero();
        let direction = state.direction();
        let along = direction.dot(normal);
        let facing = if along > 0.0 { -normal } else { normal };
        // Clear of the surface, so that the next step does not hit it again, and of adjacent surfaces.
        let off = rounding(self.place(state)).max(1e-4);
        let [back, up] = boundary::clearance(off, along.abs() as f32).map(f64::from);
        let clear = facing * up - direction * back;
        let [x, y] = state.level();
        let turned = (direction - 2.0 * direction.dot(facing) * facing).normalize();
        let skipped = clear.dot(turned);
        let (heading, level) = heading(turned);
        (state.start, state.heading) = ([x + clear.x, y + clear.y], heading);
        let ray = &mut state.ray;
        ray.lose((self.reflection_loss)(surface, along.abs()));
        (ray.distance, ray.depth) = (0.0, (ray.depth - clear.z).max(0.0));
        ray.slab = self.slab_at(ray.depth);
        let slab = &self.slabs[ray.slab];
        ray.speed = slab.speed_at(ray.depth);
        (ray.path, ray.time) = (ray.path + skipped, ray.time + skipped / ray.speed);
        (ray.sine, ray.snell, ray.level) = (-turned.z, level / ray.speed, false);
        // A facet is a mirror: the tube keeps widening as before.
        ray.turn = ray.widening * ray.sine + slab.gradient * ray.snell * ray.snell * ray.tube;
        ray.loss() < MOST_LOSS
    }

    /// Time at which a ray ends, s: echoes back along its path are received until then; after a reflection also those
    /// back along a shorter path.
    fn latest(&self, state: &State) -> f64 {
        let reach = if state.order == 0 { self.reach } else { 2.0 * self.reach };
        reach / self.believed
    }

    /// Whether an echo from the current position of a ray can be received: back along its path or, after a reflection,
    /// along the direct path.
    fn is_in_reach(&self, state: &State, start: &Start) -> bool {
        let range = self.believed * state.ray.time;
        if state.order == 0 || range <= self.reach {
            return range <= self.reach;
        }
        let [x, y] = state.level();
        let straight = DVec3::new(x, y, self.surface_z - state.ray.depth).distance(start.place);
        range + self.least_range * straight <= 2.0 * self.reach
    }

    /// The next step of a ray: to the end of its slab, but only as far as its arc stays near its chord where that is
    /// traced.
    fn step(&self, state: &State, latest: f64) -> Step {
        let slab = &self.slabs[state.ray.slab];
        let (mut length, mut end) = state.ray.exit(slab);
        let limits = &self.limits[state.ray.slab];
        let most = farther(limits.fastest, latest - state.ray.time);
        if length > most {
            (length, end) = (most, End::Inside);
        }
        if limits.empty {
            return Step { length, end, chord: None };
        }
        let near = limits.chord / state.ray.snell.sqrt();
        if !state.ray.level && length > near {
            (length, end) = (near, End::Inside);
        }
        let chord = self.chord(state, length);
        let (from, to) = (chord.from, chord.from + chord.along * chord.length);
        let [low, high] = self.bounds.map(Vec3::from);
        // A hit on the box itself is one on the scene.
        let margin = Vec3::splat(2.0 * SAGITTA as f32);
        let apart = from.max(to).cmplt(low - margin).any() || from.min(to).cmpgt(high + margin).any();
        Step { length, end, chord: (!apart).then_some(chord) }
    }

    /// Takes a ray at a boundary of its slab through it, or reflects it; returns whether it continues.
    fn pass(&self, state: &mut State, end: End, start: &Start, arrivals: &mut Vec<Arrival>) -> bool {
        if end != End::Top || state.ray.slab > 0 {
            state.ray.cross(&self.slabs, end);
            return true;
        }
        state.ray.depth = 0.0;
        if !self.is_in_reach(state, start) {
            return false;
        }
        arrivals.push(self.arrival(state, MEDIUM, Vec3::NEG_Z, start));
        self.reflect(state, MEDIUM, Vec3::NEG_Z)
    }

    /// The arrival at the current position of a ray.
    fn arrival(&self, state: &State, surface: u32, normal: Vec3, start: &Start) -> Arrival {
        let RefractedRay { path, tube, speed_path, speed, time, .. } = state.ray;
        Arrival {
            ray: state.number,
            surface,
            triangle: 0,
            corner: [0.0; 2],
            range: (self.believed * time) as f32,
            path: path as f32,
            loss: state.ray.loss() as f32,
            tube: [tube.abs() as f32, (speed_path / start.speed) as f32],
            speed: (speed / start.speed) as f32,
            place: self.place(state),
            direction: state.direction().as_vec3(),
            normal,
            order: state.order,
        }
    }

    /// The normal for the echo of a `lane`'s hit, met along `direction`; that of its triangle is `flat`. Reflections
    /// use the triangle's, lest a ray continue behind it.
    fn smooth_normal(&self, (rays, hits): (&RayBatch, &HitBatch), lane: usize, direction: Vec3, flat: Vec3) -> Vec3 {
        let (corner, time) = ([hits.u[lane], hits.v[lane]], rays.time[lane]);
        let smooth = self.scene.shading_normal(hits.surface[lane], hits.triangle[lane], corner, time);
        let (Some(smooth), Some(facet)) = (smooth, flat.try_normalize()) else {
            return flat;
        };
        let along = facet.dot(direction);
        let facing = if along > 0.0 { -facet } else { facet };
        seen_normal(smooth, facing, along.abs(), direction).0
    }

    fn place(&self, state: &State) -> Vec3 {
        let [x, y] = state.level();
        DVec3::new(x, y, self.surface_z - state.ray.depth).as_vec3()
    }

    /// The chord of the next `length` m of a ray.
    fn chord(&self, state: &State, length: f64) -> Chord {
        let RefractedRay { snell, speed, sine, slab, .. } = state.ray;
        let half = 0.5 * state.ray.gradient(&self.slabs[slab]) * snell * length;
        let Turn { sin, cos, sinc } = Turn::of(half);
        let cosine = snell * speed;
        let level = cosine * cos + sine * sin;
        let along = DVec3::new(state.heading[0] * level, state.heading[1] * level, cosine * sin - sine * cos);
        Chord { from: self.place(state), along: along.as_vec3(), length: (length * sinc) as f32 }
    }
}

impl Launch<'_> {
    /// Unit direction of a ray in the world's frame.
    fn direction(&self, ray: usize) -> Vec3 {
        let [x, y, z] = self.directions;
        self.rotation * Vec3::new(x[ray], y[ray], z[ray])
    }
}

/// How far, m, rounding may displace a hit at `place`, m.
fn rounding(place: Vec3) -> f32 {
    4.0 * f32::EPSILON * place.abs().max_element()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::Environment;
    use crate::scene::{Mesh, Object, Part};
    use crate::trace::BuiltScene;
    use crate::trace::Engine;
    use crate::trace::LiveScene;
    use std::sync::Arc;

    /// A sheet with these four `corners`, and their normals if it is smooth.
    fn sheet(corners: [DVec3; 4], normals: Option<[DVec3; 4]>) -> BuiltScene {
        let array = |vectors: [DVec3; 4]| vectors.map(|it| it.as_vec3().to_array()).to_vec();
        let part = Part::default()
            .positions(array(corners).into())
            .normals(normals.map(|normals| array(normals).into()))
            .triangles(vec![[0, 1, 2], [0, 2, 3]].into());
        let mut scene = LiveScene::new(&Engine::new().unwrap());
        scene.set_origin(DVec3::ZERO).unwrap();
        scene.add(Object::new("sheet", Arc::new(Mesh::new("sheet", vec![part]).unwrap()))).unwrap();
        scene.commit().unwrap()
    }

    /// Arrivals of rays along `directions` from `place` within `reach` m.
    fn arrivals(scene: &BuiltScene, profile: &str, place: DVec3, directions: &[DVec3], reach: f64) -> Vec<Arrival> {
        let yaml = format!("water: {{allow_unphysical: true, profile: {profile}}}");
        let water = Environment::from_yaml(&yaml).unwrap().water.unwrap();
        let (column, _) = WaterColumn::new(&water, 100e3, -place.z).unwrap();
        let believed = column.speed_at(-place.z);
        let reflection_loss = |_: u32, _: f64| 0.0;
        let limits =
            SoundLimits { mask: u32::MAX, believed, reach, bounces: 3, reflection_loss: &reflection_loss, clock: None };
        let tracer = SoundTracer::new(&scene.0, &column, limits);
        let [x, y, z] = [0, 1, 2].map(|axis| directions.iter().map(|it| it[axis] as f32).collect::<Vec<f32>>());
        let launch = Launch { directions: [&x, &y, &z], rotation: Mat3::IDENTITY, place };
        let mut found = Vec::new();
        tracer.trace(&launch, 0..directions.len(), &mut TracerMemory::default(), &mut found);
        found
    }

    const STRAIGHT: &str = "{constant: {speed_m_s: 1500}}";
    const BENT: &str = "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 1000, speed_m_s: 1480}]}";

    /// Far from the scene's origin positions are rounded to millimetres.
    #[test]
    fn reflected_rays_do_not_hit_their_mirror_again() {
        let middle = DVec3::new(31_000.0, -47_000.0, -500.0);
        let (u, v) = (DVec3::new(40.0, 3.0, 29.0), DVec3::new(-4.0, 40.0, 2.0));
        let plate = sheet([middle - u - v, middle + u - v, middle + u + v, middle - u + v], None);
        let normal = u.cross(v).normalize();
        let place = middle + 30.0 * normal + 4.0 * u.normalize();
        let to = |index: u32| {
            let (a, b) = (f64::from(index % 32) / 16.0 - 1.0, f64::from(index / 32) / 16.0 - 1.0);
            (middle + 0.9 * (a * u + b * v) - place).normalize()
        };
        let directions: Vec<DVec3> = (0..1024).map(to).collect();
        for profile in [STRAIGHT, BENT] {
            let found = arrivals(&plate, profile, place, &directions, 200.0);
            assert_eq!(found.iter().filter(|it| it.order == 0).count(), 1024);
            let again = found.iter().filter(|it| it.order > 0 && it.surface != MEDIUM).count();
            assert_eq!(again, 0, "{profile}");
        }
    }

    /// Rows of a table of surface and bottom bounces, launch by launch: angle, number of the bounce, range by BELLHOP,
    /// time by another solver.
    fn touches(table: &str) -> Vec<(f64, usize, f64, f64)> {
        let mut lines = table.lines();
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        let column = |name: &str| header.iter().position(|it| *it == name).unwrap();
        let columns = ["launch_angle_deg", "event", "range_bellhop_m", "time_pelagic_s"].map(column);
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let [angle, event, range, time] = columns.map(|index| cells[index].parse::<f64>().unwrap());
            (angle, event as usize, range, time)
        };
        lines.map(row).collect()
    }

    /// Chords over arcs and ramps, mirrors by surface and scene: within 2 mm and 1 us of the tables.
    #[test]
    fn bottom_hits_agree_with_other_solvers() {
        let gradient = "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 1000, speed_m_s: 1000}]}".to_owned();
        let layers = [(0.0, 1520.0), (10.0, 1500.0), (25.0, 1487.0), (45.0, 1475.0), (70.0, 1490.0), (95.0, 1510.0)];
        // Ramps of 0.2 m instead of jumps.
        let ramp = |pair: &[(f64, f64)]| [(pair[1].0 - 0.1, pair[0].1), (pair[1].0 + 0.1, pair[1].1)];
        let rows = std::iter::once(layers[0]).chain(layers.windows(2).flat_map(ramp)).chain([(200.0, 1510.0)]);
        let rows: Vec<String> = rows.map(|(z, c)| format!("{{depth_m: {z}, speed_m_s: {c}}}")).collect();
        let ramps = format!("{{cast: [{}]}}", rows.join(", "));
        for (table, profile, start, bottom) in [
            (include_str!("../../tests/data/sonar/grad_neg_events.csv"), gradient, 50.0, 200.0),
            (include_str!("../../tests/data/sonar/layers6_events.csv"), ramps, 55.0, 120.0),
        ] {
            let corner = |x: f64, y: f64| DVec3::new(x, y, -bottom);
            let bed = [corner(-10.0, -50.0), corner(1500.0, -50.0), corner(1500.0, 50.0), corner(-10.0, 50.0)];
            let table = touches(table);
            let mut angles: Vec<f64> = table.iter().map(|row| row.0).collect();
            angles.dedup();
            let directions: Vec<DVec3> = angles
                .iter()
                .map(|angle| DVec3::new(angle.to_radians().cos(), 0.0, -angle.to_radians().sin()))
                .collect();
            let found = arrivals(&sheet(bed, None), &profile, DVec3::new(0.0, 0.0, -start), &directions, 900.0);
            let speed = {
                let water = Environment::from_yaml(&format!("water: {{allow_unphysical: true, profile: {profile}}}"));
                WaterColumn::new(&water.unwrap().water.unwrap(), 100e3, start).unwrap().0.speed_at(start)
            };
            let mut met = [0; 4];
            for arrival in &found {
                let angle = angles[arrival.ray as usize];
                let expected = table.iter().find(|row| row.0 == angle && row.1 == usize::from(arrival.order) + 1);
                let Some(&(_, event, range, time)) = expected else { continue };
                let off = [f64::from(arrival.place.x) - range, f64::from(arrival.range) / speed - time];
                assert!(off[0].abs() < 2e-3 && off[1].abs() < 1e-6, "{angle} deg, touch {event}: {off:?}");
                met[event - 1] += 1;
            }
            assert!(met[..2].iter().all(|&met| met > 15) && met[2] > 8, "{met:?} of {}", angles.len());
        }
    }

    /// A bed at a boundary between water layers is hit from above, whichever of the two rounding puts first.
    #[test]
    fn a_bed_at_a_boundary_is_hit_before_it() {
        let corners = [[-90.0, -90.0], [90.0, -90.0], [90.0, 90.0], [-90.0, 90.0]];
        let bed = corners.map(|[x, y]| DVec3::new(x, y, -10.3));
        let profile = "{layers: [{depth_m: 0, speed_m_s: 1480}, {depth_m: 10.3, speed_m_s: 1530}]}";
        let direction = |index: u32| {
            let (angle, around) = ((5.0 + 0.3 * f64::from(index)).to_radians(), f64::from(index));
            DVec3::new(angle.cos() * around.cos(), angle.cos() * around.sin(), -angle.sin())
        };
        let directions: Vec<DVec3> = (0..280).map(direction).collect();
        let found = arrivals(&sheet(bed, None), profile, DVec3::new(0.3, -0.2, -4.1), &directions, 80.0);
        let first: Vec<&Arrival> = found.iter().filter(|it| it.order == 0).collect();
        assert_eq!(first.len(), 280);
        for it in first {
            let down = directions[it.ray as usize].z as f32;
            assert!((it.place.z + 10.3).abs() < 1e-4 && (it.direction.z - down).abs() < 1e-6, "{it:?}");
            assert!(it.speed == 1.0 && it.surface != MEDIUM, "{it:?}");
        }
        // Mirrored, all go up.
        assert!(found.iter().filter(|it| it.order == 1).all(|it| it.surface == MEDIUM && it.direction.z > 0.0));
        assert_eq!(found.iter().filter(|it| it.place.z < -10.4).count(), 0);
    }

    /// Hits on a slope are on the arc as well as on the slope.
    #[test]
    fn slopes_are_hit_on_the_arc() {
        let profile = "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 1000, speed_m_s: 1000}]}";
        let normal = DVec3::new(20f64.to_radians().sin(), 0.0, 20f64.to_radians().cos());
        let (middle, along) = (DVec3::new(300.0, 0.0, -200.0), DVec3::new(normal.z, 0.0, -normal.x) * 250.0);
        let aside = DVec3::Y * 20.0;
        let corners = [middle - along - aside, middle + along - aside, middle + along + aside, middle - along + aside];
        let angles: Vec<f64> = (5..60).map(f64::from).collect();
        let direction = |angle: &f64| DVec3::new(angle.to_radians().cos(), 0.0, -angle.to_radians().sin());
        let directions: Vec<DVec3> = angles.iter().map(direction).collect();
        let found = arrivals(&sheet(corners, None), profile, DVec3::new(0.0, 0.0, -50.0), &directions, 900.0);
        let first: Vec<&Arrival> = found.iter().filter(|it| it.order == 0 && it.surface != MEDIUM).collect();
        assert!(first.len() > 20, "{}", first.len());
        let water = Environment::from_yaml(&format!("water: {{allow_unphysical: true, profile: {profile}}}"));
        let water = water.unwrap().water.unwrap();
        for arrival in first {
            let place = arrival.place.as_dvec3();
            assert!((place - middle).dot(normal).abs() < 1e-3, "{arrival:?}");
            let ray = crate::medium::SoundRay::new(&water, 100e3, 50.0, angles[arrival.ray as usize], 900.0).unwrap();
            let arc = ray.point_at(place.x).unwrap();
            assert!((arc.depth_m + place.z).abs() < 1e-3, "{arrival:?} {arc:?}");
            assert!((f64::from(arrival.range) / 1475.0 - arc.time_s).abs() < 1e-6, "{arrival:?} {arc:?}");
        }
    }

    /// At the depth where sound is slowest a level ray is straight, and so is the direct path to a wall there.
    #[test]
    fn level_rays_on_the_axis_of_a_duct_arrive() {
        let wall = [[-9.0, -120.0], [9.0, -120.0], [9.0, -80.0], [-9.0, -80.0]].map(|[y, z]| DVec3::new(40.0, y, z));
        let profile = "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 100, speed_m_s: 1480}, {depth_m: 300, speed_m_s: \
                       1500}]}";
        let place = DVec3::new(0.0, 0.0, -100.0);
        let found = arrivals(&sheet(wall, None), profile, place, &[DVec3::X, DVec3::new(0.8, 0.6, 0.0)], 60.0);
        let first: Vec<&Arrival> = found.iter().filter(|it| it.order == 0).collect();
        assert_eq!(first.len(), 1, "{found:?}");
        assert!((first[0].range - 40.0).abs() < 1e-4 && (first[0].place.z + 100.0).abs() < 1e-4, "{first:?}");
        // The wall reflects it back past its source.
        assert!(found.iter().all(|it| it.order == 0), "{found:?}");
    }

    /// A flat face that approximates a quarter of a cylinder has the normals of the cylinder.
    #[test]
    fn echoes_of_smooth_parts_use_the_smooth_normal() {
        let corners = [[-1.0, -7.0], [1.0, -7.0], [1.0, -5.0], [-1.0, -5.0]].map(|[y, z]| DVec3::new(5.0, y, z));
        let normals = corners.map(|it| DVec3::new(-1.0, it.y, 0.0).normalize());
        let place = DVec3::new(0.0, 0.0, -6.0);
        let directions: Vec<DVec3> = [-0.15, 0.0, 0.1].map(|y| DVec3::new(1.0, y, 0.01).normalize()).to_vec();
        for profile in [STRAIGHT, BENT] {
            let flat = arrivals(&sheet(corners, None), profile, place, &directions, 20.0);
            let smooth = arrivals(&sheet(corners, Some(normals)), profile, place, &directions, 20.0);
            assert_eq!((flat.len(), smooth.len()), (3, 3));
            for (flat, smooth) in flat.iter().zip(&smooth) {
                assert!(flat.normal.normalize().x.abs() > 0.999_99);
                // The normals at both ends of an edge are tilted by 45 degrees: linear interpolation gives (-1, y)
                // times sqrt(1/2).
                let expected = Vec3::new(-1.0, smooth.place.y, 0.0).normalize();
                assert!((smooth.normal.normalize() - expected).length() < 1e-3, "{smooth:?}");
                assert_eq!(flat.place, smooth.place);
            }
        }
    }
}
