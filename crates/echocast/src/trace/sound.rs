//! Rays of sound through layered water: bent, reflected and, where they meet something, arrived.
//!
//! The ocean is stratified: in a slab sound speed is linear in depth, so a ray is a circular arc (a straight line without
//! gradient) in a vertical plane, and `xi = cos(grazing angle) / speed` stays the same from slab to slab (Snell). Slabs,
//! arcs and the equations below: Jensen, Kuperman, Porter, Schmidt, "Computational Ocean Acoustics", 2nd ed., chapter 3.

use super::{HitBatch, LANES, MISS, RayBatch, Tables};
use crate::medium::{Column, Slab};
use glam::{DVec3, Mat3, Vec3};
use std::ops::Range;

/// Greatest distance of an arc from the chord that is traced in its place, m.
const SAGITTA: f64 = 1e-3;

/// Row of an arrival at the sea surface, in place of one of the scene's surfaces.
pub(crate) const SEA: u32 = MISS - 1;

/// Steps after which a ray is given up: one that is trapped in a thin duct.
const MOST_STEPS: usize = 100_000;

/// What a reflection takes away, dB: of a surface's row (or [`SEA`]) at the sine of a grazing angle.
pub(crate) type ReflectionLoss<'a> = &'a (dyn Fn(u32, f64) -> f64 + Sync);

/// Follows rays through one scene and one water column, from one place.
pub(crate) struct SoundTracer<'a> {
    scene: &'a Tables,
    /// The column, cut where the scene begins and ends.
    slabs: Vec<Layer>,
    /// The column as it is.
    column: &'a Column,
    /// Whether all rays are straight.
    uniform: bool,
    /// z of the sea surface, m, relative to the scene's origin.
    surface_z: f64,
    /// The scene's box, m, relative to its origin.
    bounds: [[f32; 3]; 2],
    mask: u32,
    /// Speed that ranges are reported with, m/s.
    believed: f64,
    /// Farthest range that is reported, m.
    reach: f64,
    /// Reflections that are followed.
    bounces: u8,
    reflection_loss: ReflectionLoss<'a>,
}

/// A [`Slab`], and whether anything of the scene can be in it.
#[derive(Clone, Copy)]
struct Layer {
    slab: Slab,
    empty: bool,
}

/// What rays meet, a column each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Arrivals {
    /// Number of the ray.
    pub ray: Vec<u32>,
    /// Range that the sonar reports, m: one-way time times the speed that it believes.
    pub range: Vec<f32>,
    /// Way along the ray, m.
    pub path: Vec<f32>,
    /// One-way loss by absorption, boundaries and reflections, dB.
    pub loss: Vec<f32>,
    /// Widths of the tube around the ray per radian at the start, m: in the vertical plane, and across it.
    pub tube: Vec<[f32; 2]>,
    /// Sound speed there over that at the start.
    pub speed: Vec<f32>,
    /// Where it is, relative to the scene's origin, m.
    pub place: Vec<Vec3>,
    /// Unit vector along the ray.
    pub direction: Vec<Vec3>,
    /// Normal of the triangle, of any length and sign.
    pub normal: Vec<Vec3>,
    /// Row of the scene's surfaces, or [`SEA`].
    pub surface: Vec<u32>,
    /// Triangle of the part.
    pub triangle: Vec<u32>,
    /// Barycentric weights of its second and third corner.
    pub corner: Vec<[f32; 2]>,
    /// Reflections on the way.
    pub order: Vec<u8>,
}

impl Arrivals {
    pub fn len(&self) -> usize {
        self.ray.len()
    }

    pub fn clear(&mut self) {
        let Arrivals { ray, range, path, loss, tube, speed, place, direction, normal, surface, triangle, corner, order } =
            self;
        (ray.clear(), range.clear(), path.clear(), loss.clear(), tube.clear(), speed.clear(), place.clear());
        (direction.clear(), normal.clear(), surface.clear(), triangle.clear(), corner.clear(), order.clear());
    }

    fn push(&mut self, ray: u32, range: f64, state: &State, at: Met, start_speed: f64) {
        self.ray.push(ray);
        self.range.push(range as f32);
        self.path.push(state.path as f32);
        self.loss.push(state.loss as f32);
        self.tube.push([state.tube.abs() as f32, (state.speed_path / start_speed) as f32]);
        self.speed.push((state.speed / start_speed) as f32);
        self.place.push(at.place);
        self.direction.push(at.direction);
        self.normal.push(at.normal);
        self.surface.push(at.surface);
        self.triangle.push(at.triangle);
        self.corner.push(at.corner);
        self.order.push(state.order);
    }
}

/// What is met.
struct Met {
    place: Vec3,
    direction: Vec3,
    normal: Vec3,
    surface: u32,
    triangle: u32,
    corner: [f32; 2],
}

/// A ray on its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    ray: u32,
    /// Where its vertical plane starts, relative to the scene's origin, m, and where it goes, a unit vector.
    start: [f64; 2],
    heading: [f64; 2],
    /// Horizontal distance from there, m.
    pub distance: f64,
    /// m below the sea surface.
    pub depth: f64,
    /// Sine of the grazing angle, positive downwards.
    pub sine: f64,
    /// Cosine of the grazing angle over sound speed, s/m.
    pub snell: f64,
    /// Index of the slab.
    pub slab: usize,
    /// Sound speed here, m/s.
    pub speed: f64,
    /// s since the start.
    pub time: f64,
    /// m since the start.
    pub path: f64,
    /// Absorption, boundaries and reflections since the start, dB.
    pub loss: f64,
    /// Integral of speed over the way, m^2/s: over the speed at the start it is the width of the tube across the plane.
    pub speed_path: f64,
    /// Width of the tube within the vertical plane per radian at the start, m; negative beyond a caustic.
    pub tube: f64,
    /// What the tube widens by with each m^2/s of `speed_path`, s/m: constant within a slab.
    widening: f64,
    /// Derivative of `snell` by the angle at the start, with its sign turned by every reflection, s/m.
    turn: f64,
    pub order: u8,
}

/// How a step ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// Within the slab.
    Inside,
    /// At its upper or lower boundary.
    Top,
    Bottom,
}

/// The next part of a ray: an arc within one slab.
#[derive(Clone, Copy, Debug)]
struct Step {
    length: f64,
    end: End,
    /// Whether something of the scene can be met on it.
    traced: bool,
}

impl State {
    /// A ray that starts at `place` (relative to the scene's origin) in the unit `direction`.
    fn launch(ray: u32, place: DVec3, direction: DVec3, depth: f64, slab: &Slab) -> State {
        let speed = slab.speed_at(depth);
        let mut state = State {
            ray,
            start: [place.x, place.y],
            heading: [1.0, 0.0],
            distance: 0.0,
            depth,
            sine: 0.0,
            snell: 0.0,
            slab: 0,
            speed,
            time: 0.0,
            path: 0.0,
            loss: 0.0,
            speed_path: 0.0,
            tube: 0.0,
            widening: 1.0 / speed,
            turn: -direction.z / speed,
            order: 0,
        };
        state.turn_to(direction);
        state
    }

    fn turn_to(&mut self, direction: DVec3) {
        let level = direction.x.hypot(direction.y);
        if level > 1e-12 {
            self.heading = [direction.x / level, direction.y / level];
        }
        self.sine = -direction.z;
        self.snell = level / self.speed;
    }

    /// The state `length` m on along the arc within `slab`.
    fn advanced(&self, slab: &Slab, length: f64) -> State {
        let mut next = *self;
        let (c, s) = (self.speed, self.sine);
        next.path += length;
        if slab.gradient == 0.0 {
            let fall = length * s;
            next.distance += length * self.snell * c;
            next.depth += fall;
            next.time += length / c;
            next.loss += length * slab.absorption_at(self.depth + 0.5 * fall);
            next.speed_path += length * c;
            next.tube += self.widening * length * c;
            return next;
        }
        // The grazing angle falls evenly with the length; a chord is `length sinc(half)` long, in the direction of the
        // middle of the arc.
        let half = 0.5 * slab.gradient * self.snell * length;
        let (sin, cos) = small_sin_cos(half);
        let sinc = if half == 0.0 { 1.0 } else { sin / half };
        let cosine = self.snell * c;
        let (middle_sine, middle_cosine) = (s * cos - cosine * sin, cosine * cos + s * sin);
        let (level, fall) = (length * middle_cosine * sinc, length * middle_sine * sinc);
        next.distance += level;
        next.depth += fall;
        next.sine = middle_sine * cos - middle_cosine * sin;
        next.speed = slab.speed_at(next.depth);
        // Depth in the middle of the arc, by half the arc.
        let (quarter_sin, quarter_cos) = small_sin_cos(0.5 * half);
        let quarter = if half == 0.0 { 1.0 } else { quarter_sin / (0.5 * half) };
        let middle_depth = self.depth + 0.5 * length * (s * quarter_cos - cosine * quarter_sin) * quarter;
        let middle = slab.speed_at(middle_depth);
        if half.abs() < 0.02 {
            // Simpson's rule; what it leaves out is below 1e-10 of the time on arcs that short.
            next.time += length / 6.0 * (1.0 / c + 4.0 / middle + 1.0 / next.speed);
            let speed_path = length / 6.0 * (c + 4.0 * middle + next.speed);
            next.speed_path += speed_path;
            next.tube += self.widening * speed_path;
        } else {
            let ratio = next.speed / c * (1.0 + s) / (1.0 + next.sine);
            next.time += (ratio.ln() / slab.gradient).abs();
            next.speed_path += level / self.snell;
            next.tube += self.widening * level / self.snell;
        }
        next.loss += length / 6.0
            * (slab.absorption_at(self.depth) + 4.0 * slab.absorption_at(middle_depth) + slab.absorption_at(next.depth));
        next
    }

    /// Length of the arc to where it leaves `slab`, and where that is.
    fn exit(&self, slab: &Slab) -> (f64, End) {
        let to = |end: End| match end {
            End::Bottom => slab.bottom - self.depth,
            _ => slab.top - self.depth,
        };
        let ahead = if self.sine > 0.0 { End::Bottom } else { End::Top };
        if slab.gradient == 0.0 {
            return if self.sine == 0.0 { (f64::INFINITY, End::Inside) } else { ((to(ahead) / self.sine).max(0.0), ahead) };
        }
        // Rays bend away from the side where sound is faster.
        let faster = if slab.gradient > 0.0 { End::Bottom } else { End::Top };
        let slower = if slab.gradient > 0.0 { End::Top } else { End::Bottom };
        let speed_at = |end: End| slab.speed_at(if end == End::Bottom { slab.bottom } else { slab.top });
        let towards = self.sine * slab.gradient.signum();
        let curvature = slab.gradient.abs() * self.snell;
        let end = if towards > 0.0 && self.snell * speed_at(faster) < 1.0 { faster } else { slower };
        let cosine = (self.snell * speed_at(end)).min(1.0);
        let sine = (1.0 - cosine * cosine).sqrt();
        if towards > 0.0 && end == slower {
            // Over its vertex and back.
            let angle = towards.atan2(self.snell * self.speed) + sine.atan2(cosine);
            return (angle / curvature, end);
        }
        let sum = self.sine.abs() + sine;
        let fall = to(end).abs();
        let half = curvature * fall / sum;
        let length = if half < 0.05 {
            // half / tan(half), to 1e-9.
            let square = half * half;
            2.0 * fall / sum * (1.0 - square / 3.0 * (1.0 + square / 15.0))
        } else {
            let (from, to) = (self.sine.abs().atan2(self.snell * self.speed), sine.atan2(cosine));
            (from - to).abs() / curvature
        };
        (length, end)
    }

    /// Goes over into the next slab, or back into this one where the boundary reflects everything.
    fn cross(&mut self, layers: &[Layer], end: End) {
        let here = &layers[self.slab].slab;
        let (there, depth) = match end {
            End::Bottom => (self.slab + 1, here.bottom),
            _ => (self.slab - 1, here.top),
        };
        self.depth = depth;
        let next = &layers[there].slab;
        let (from, to) = (here.speed_at(depth), next.speed_at(depth));
        let down = if end == End::Bottom { 1.0 } else { -1.0 };
        if from != to || here.density != next.density {
            let cosine = self.snell * to;
            if cosine >= 1.0 {
                self.speed = from;
                return self.mirror(here);
            }
            let (sine, sine_on) = (self.sine.abs().max(1e-9), (1.0 - cosine * cosine).sqrt().max(1e-9));
            // Reflection coefficient of two fluids; what is not reflected goes on.
            let (a, b) = (next.density * to * sine, here.density * from * sine_on);
            let reflected = (a - b) / (a + b);
            self.loss -= 10.0 * (1.0 - reflected * reflected).max(1e-30).log10();
            self.tube *= sine_on / sine;
            self.sine = down * sine_on;
        } else {
            self.sine = down * self.sine.abs();
        }
        self.speed = to;
        self.slab = there;
        self.widen(next);
    }

    /// Reflection by a horizontal boundary of the slab.
    fn mirror(&mut self, slab: &Slab) {
        self.sine = -self.sine;
        self.turn = -self.turn;
        self.widen(slab);
    }

    /// How the tube widens from here on: in a slab its width over the sine of the ray is the derivative of the horizontal
    /// distance by `snell` at this depth, times `turn`; from one slab to the next that derivative is continuous.
    fn widen(&mut self, slab: &Slab) {
        let sine = if self.sine.abs() < 1e-6 { 1e-6f64.copysign(self.sine) } else { self.sine };
        self.widening = (self.turn - slab.gradient * self.snell * self.snell * self.tube) / sine;
    }

    /// Horizontal place, m.
    fn level(&self) -> [f64; 2] {
        [self.start[0] + self.heading[0] * self.distance, self.start[1] + self.heading[1] * self.distance]
    }

    /// Unit vector along the ray.
    fn direction(&self) -> DVec3 {
        let cosine = (1.0 - self.sine * self.sine).max(0.0).sqrt();
        DVec3::new(self.heading[0] * cosine, self.heading[1] * cosine, -self.sine)
    }
}

/// Sine and cosine, by their series where those are exact.
fn small_sin_cos(x: f64) -> (f64, f64) {
    if x.abs() > 0.02 {
        return x.sin_cos();
    }
    let q = x * x;
    (x * (1.0 - q / 6.0 * (1.0 - q / 20.0)), 1.0 - q / 2.0 * (1.0 - q / 12.0 * (1.0 - q / 30.0)))
}

/// Rays from one place, in the directions of a sensor.
pub(crate) struct Launch<'a> {
    /// Unit directions in the sensor's frame.
    pub directions: [&'a [f32]; 3],
    /// To the world's frame.
    pub rotation: Mat3,
    /// Relative to the scene's origin, m.
    pub place: DVec3,
}

/// Memory of [`SoundTracer::trace`].
pub(crate) struct TracerMemory {
    rays: Box<RayBatch>,
    hits: Box<HitBatch>,
    states: Vec<State>,
    steps: Vec<Step>,
}

impl Default for TracerMemory {
    fn default() -> Self {
        TracerMemory {
            rays: Box::new(RayBatch::new()),
            hits: Box::new(HitBatch::new()),
            states: Vec::new(),
            steps: Vec::new(),
        }
    }
}

/// What [`SoundTracer::new`] needs beside scene and water.
pub(crate) struct SoundLimits<'a> {
    pub mask: u32,
    /// Speed that ranges are reported with, m/s.
    pub believed: f64,
    /// Farthest range that is reported, m.
    pub reach: f64,
    /// Reflections that are followed.
    pub bounces: u8,
    pub reflection_loss: ReflectionLoss<'a>,
}

impl<'a> SoundTracer<'a> {
    pub fn new(scene: &'a Tables, column: &'a Column, limits: SoundLimits<'a>) -> SoundTracer<'a> {
        let bounds = scene.committed.bounds();
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
        let layer = |slab: Slab| {
            let empty = !(slab.bottom > top - SAGITTA && slab.top < bottom + SAGITTA);
            Layer { slab, empty }
        };
        let slabs = slabs.into_iter().map(layer).collect();
        let uniform = column.is_uniform();
        let SoundLimits { mask, believed, reach, bounces, reflection_loss } = limits;
        SoundTracer { scene, slabs, column, uniform, surface_z, bounds, mask, believed, reach, bounces, reflection_loss }
    }

    /// Adds what the rays `which` of `launch` meet to `arrivals`: first what they meet at first, in their order, block by
    /// block; after each block what they meet over reflections.
    pub fn trace(&self, launch: &Launch, which: Range<usize>, memory: &mut TracerMemory, arrivals: &mut Arrivals) {
        let depth = self.surface_z - launch.place.z;
        let slab = self.slab_at(depth);
        let start_speed = self.slabs[slab].slab.speed_at(depth);
        for first in which.clone().step_by(LANES) {
            let count = LANES.min(which.end - first);
            memory.states.clear();
            if self.uniform {
                self.straight(launch, first..first + count, memory, arrivals);
            } else {
                memory.states.extend((first..first + count).map(|ray| {
                    let direction = launch.direction(ray).as_dvec3().normalize();
                    let state = State::launch(ray as u32, launch.place, direction, depth, &self.slabs[slab].slab);
                    State { slab, ..state }
                }));
            }
            self.follow(memory, start_speed, arrivals);
        }
    }

    fn slab_at(&self, depth: f64) -> usize {
        self.slabs.partition_point(|layer| layer.slab.bottom <= depth).min(self.slabs.len() - 1)
    }

    /// Rays of one block through water that is the same everywhere; those that are reflected go to `memory.states`.
    fn straight(
        &self,
        launch: &Launch,
        block: Range<usize>,
        memory: &mut TracerMemory,
        arrivals: &mut Arrivals,
    ) {
        let TracerMemory { rays, hits, states, .. } = memory;
        let depth = self.surface_z - launch.place.z;
        let water = &self.column.slabs[self.column.slab_at(depth)];
        // The reported range for a metre of way.
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
        hits.trace(self.scene, rays, block.len(), true, self.mask);
        let absorption = water.absorption_at(depth) as f32;
        let half_slope = 0.5 * water.absorption_slope as f32;
        // Depths below the sonar where this slab begins and ends.
        let (rise, fall) = ((water.top - depth) as f32, (water.bottom - depth) as f32);
        for (lane, ray) in block.enumerate() {
            let direction = rays.direction(lane);
            let (range, surface, normal) = if hits.surface[lane] != MISS {
                (hits.range[lane], hits.surface[lane], self.world_normal(hits.surface[lane], hits.normal(lane)))
            } else if rays.range_max[lane] < reach {
                (rays.range_max[lane], SEA, Vec3::NEG_Z)
            } else {
                continue;
            };
            arrivals.ray.push(ray as u32);
            arrivals.range.push(range * scale);
            arrivals.path.push(range);
            let below = -direction.z * range;
            arrivals.loss.push(if below >= rise && below <= fall {
                range * (absorption + half_slope * below)
            } else {
                range * self.column.mean_absorption(depth, (depth + f64::from(below)).max(0.0)) as f32
            });
            arrivals.tube.push([range; 2]);
            arrivals.speed.push(1.0);
            arrivals.place.push(place + direction * range);
            arrivals.direction.push(direction);
            arrivals.normal.push(normal);
            arrivals.surface.push(surface);
            arrivals.triangle.push(hits.triangle[lane]);
            arrivals.corner.push([hits.u[lane], hits.v[lane]]);
            arrivals.order.push(0);
            if self.bounces > 0 {
                let direction = direction.as_dvec3().normalize();
                let start = State::launch(ray as u32, launch.place, direction, depth, water);
                let mut state = start.advanced(water, f64::from(range));
                state.loss = (*arrivals.loss.last().expect("it has just been added")).into();
                state.slab = self.slab_at(state.depth);
                if self.reflect(&mut state, surface, normal) {
                    states.push(state);
                }
            }
        }
    }

    /// Turns a ray at the surface that it has met; whether it goes on.
    fn reflect(&self, state: &mut State, surface: u32, normal: Vec3) -> bool {
        /// What is weaker by this, dB, is not followed.
        const MOST_LOSS: f64 = 80.0;
        if state.order >= self.bounces {
            return false;
        }
        state.order += 1;
        let slab = &self.slabs[state.slab].slab;
        if surface == SEA {
            state.loss += (self.reflection_loss)(SEA, state.sine.abs());
            (state.depth, state.sine) = (0.0, -state.sine.abs());
            state.mirror(slab);
            return state.loss < MOST_LOSS;
        }
        let normal = normal.as_dvec3().normalize_or_zero();
        let direction = state.direction();
        let along = direction.dot(normal);
        let facing = if along > 0.0 { -normal } else { normal };
        state.loss += (self.reflection_loss)(surface, along.abs());
        // Clear of the surface, so that the next step does not meet it again.
        let clear = facing * 1e-4;
        let [x, y] = state.level();
        (state.start, state.distance) = ([x + clear.x, y + clear.y], 0.0);
        state.depth = (state.depth - clear.z).max(0.0);
        state.slab = self.slab_at(state.depth);
        let slab = &self.slabs[state.slab].slab;
        state.speed = slab.speed_at(state.depth);
        state.turn_to((direction - 2.0 * direction.dot(facing) * facing).normalize());
        // A facet is a mirror: the tube widens on as it did.
        state.turn = state.widening * state.sine + slab.gradient * state.snell * state.snell * state.tube;
        state.loss < MOST_LOSS
    }

    /// Follows all states until they have met something and are not reflected, or are out of reach.
    fn follow(&self, memory: &mut TracerMemory, start_speed: f64, arrivals: &mut Arrivals) {
        let TracerMemory { rays, hits, states, steps } = memory;
        let latest = self.reach / self.believed;
        for _ in 0..MOST_STEPS {
            steps.clear();
            // Every ray goes on to where something could be in its way.
            let mut kept = 0;
            for index in 0..states.len() {
                let mut state = states[index];
                if let Some(step) = self.next_traced(&mut state, latest, start_speed, arrivals) {
                    states[kept] = state;
                    steps.push(step);
                    kept += 1;
                }
            }
            states.truncate(kept);
            if states.is_empty() {
                return;
            }
            for (lane, (state, step)) in states.iter().zip(steps.iter()).enumerate() {
                let (from, along, length) = self.chord(state, step);
                (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = from.into();
                (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = along.into();
                rays.range_max[lane] = length * (1.0 + 1e-6) + 1e-5;
            }
            hits.trace(self.scene, rays, states.len(), false, self.mask);
            kept = 0;
            for lane in 0..states.len() {
                let (mut state, step) = (states[lane], steps[lane]);
                let goes_on = if hits.surface[lane] == MISS {
                    self.finish(&mut state, &step, start_speed, arrivals)
                } else {
                    let slab = &self.slabs[state.slab].slab;
                    let surface = hits.surface[lane];
                    let normal = self.world_normal(surface, hits.normal(lane));
                    let length = arc_to(&state, slab, &step, hits.range[lane], rays.direction(lane), normal);
                    state = state.advanced(slab, length);
                    let met = Met {
                        place: self.place(&state),
                        direction: state.direction().as_vec3(),
                        normal,
                        surface,
                        triangle: hits.triangle[lane],
                        corner: [hits.u[lane], hits.v[lane]],
                    };
                    let range = self.believed * state.time;
                    if range <= self.reach {
                        arrivals.push(state.ray, range, &state, met, start_speed);
                    }
                    range <= self.reach && self.reflect(&mut state, surface, normal)
                };
                if goes_on {
                    states[kept] = state;
                    kept += 1;
                }
            }
            states.truncate(kept);
        }
    }

    /// Takes a ray on, through water where nothing is, up to its next step on which something can be met; `None`: it ends.
    fn next_traced(&self, state: &mut State, latest: f64, start_speed: f64, arrivals: &mut Arrivals) -> Option<Step> {
        for _ in 0..MOST_STEPS {
            if state.time >= latest {
                return None;
            }
            let step = self.step(state, latest);
            if step.traced {
                return Some(step);
            }
            if !self.finish(state, &step, start_speed, arrivals) {
                return None;
            }
        }
        None
    }

    /// The next step of a ray: to the end of its slab, and no farther than its arc is near its chord where that is traced.
    fn step(&self, state: &State, latest: f64) -> Step {
        let Layer { slab, empty } = &self.slabs[state.slab];
        let (mut length, mut end) = state.exit(slab);
        let fastest = slab.speed_at(slab.top).max(if slab.gradient > 0.0 { slab.speed_at(slab.bottom) } else { 0.0 });
        let most = (latest - state.time) * fastest + 1e-3;
        if length > most {
            (length, end) = (most, End::Inside);
        }
        if *empty {
            return Step { length, end, traced: false };
        }
        if slab.gradient != 0.0 {
            // Arc and chord are length^2 / (8 radius) apart.
            let radius = 1.0 / (slab.gradient.abs() * state.snell).max(1e-12);
            let most = (8.0 * radius * SAGITTA).sqrt();
            if length > most {
                (length, end) = (most, End::Inside);
            }
        }
        let step = Step { length, end, traced: true };
        let (from, along, length) = self.chord(state, &step);
        let to = from + along * length;
        let [low, high] = self.bounds.map(Vec3::from);
        // A hit on the box itself is one on the scene.
        let margin = Vec3::splat(2.0 * SAGITTA as f32);
        let apart = from.max(to).cmplt(low - margin).any() || from.min(to).cmpgt(high + margin).any();
        Step { traced: !apart, ..step }
    }

    /// Takes a ray to the end of a step on which it meets nothing; whether it goes on.
    fn finish(&self, state: &mut State, step: &Step, start_speed: f64, arrivals: &mut Arrivals) -> bool {
        *state = state.advanced(&self.slabs[state.slab].slab, step.length);
        match step.end {
            End::Inside => {}
            End::Top if state.slab == 0 => {
                state.depth = 0.0;
                let range = self.believed * state.time;
                if range > self.reach {
                    return false;
                }
                let met = Met {
                    place: self.place(state),
                    direction: state.direction().as_vec3(),
                    normal: Vec3::NEG_Z,
                    surface: SEA,
                    triangle: 0,
                    corner: [0.0; 2],
                };
                arrivals.push(state.ray, range, state, met, start_speed);
                return self.reflect(state, SEA, Vec3::NEG_Z);
            }
            end => state.cross(&self.slabs, end),
        }
        true
    }

    fn place(&self, state: &State) -> Vec3 {
        let [x, y] = state.level();
        DVec3::new(x, y, self.surface_z - state.depth).as_vec3()
    }

    /// Start, direction and length of the chord of a step.
    fn chord(&self, state: &State, step: &Step) -> (Vec3, Vec3, f32) {
        let slab = &self.slabs[state.slab].slab;
        let half = 0.5 * slab.gradient * state.snell * step.length;
        let (sin, cos) = small_sin_cos(half);
        let cosine = state.snell * state.speed;
        let sine = state.sine * cos - cosine * sin;
        let level = cosine * cos + state.sine * sin;
        let along = DVec3::new(state.heading[0] * level, state.heading[1] * level, -sine);
        let sinc = if half == 0.0 { 1.0 } else { sin / half };
        (self.place(state), along.normalize().as_vec3(), (step.length * sinc) as f32)
    }

    /// The normal of a row's triangle in the world.
    fn world_normal(&self, surface: u32, normal: Vec3) -> Vec3 {
        match self.scene.surfaces.rows.get(surface as usize) {
            Some(row) if row.instanced => self.scene.normal_matrices[row.object as usize] * normal,
            _ => normal,
        }
    }
}

impl Launch<'_> {
    /// Unit direction of a ray in the world's frame.
    #[inline(always)]
    fn direction(&self, ray: usize) -> Vec3 {
        let [x, y, z] = self.directions;
        self.rotation * Vec3::new(x[ray], y[ray], z[ray])
    }
}

/// Length of the arc to the facet that its chord meets at `range`: one step of Newton's method from there.
fn arc_to(state: &State, slab: &Slab, step: &Step, range: f32, along: Vec3, normal: Vec3) -> f64 {
    let part = (f64::from(range) / step.length).min(1.0);
    let curvature = slab.gradient * state.snell;
    if curvature == 0.0 {
        return f64::from(range);
    }
    // Below the chord where sound is faster below, for then the arc bends upwards.
    let below = 0.5 * curvature * step.length * step.length * part * (1.0 - part);
    let (along, normal) = (along.as_dvec3(), normal.as_dvec3());
    let level = along.x.hypot(along.y);
    let down = DVec3::new(state.heading[0] * along.z, state.heading[1] * along.z, -level);
    let across = down.dot(normal) * below;
    let towards = along.dot(normal);
    let correction = if towards.abs() > 1e-3 * normal.length() { -across / towards } else { 0.0 };
    (part * step.length + correction).clamp(0.0, step.length)
}
