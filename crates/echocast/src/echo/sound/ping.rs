//! From what rays of sound meet to what the beams of a sonar hear in each range bin.
//!
//! Each ray represents a cell of directions; the patch of surface that it covers returns energy over a stretch of
//! range, which is divided among bins as it lies. So a bin's energy depends neither on the mesh nor on the number of
//! rays.

use super::coupling::Coupling;
use super::response::Response;
use crate::emitter::{FAINT, Hearing, Transducer};
use crate::ground::lanes::MEDIUM;
use crate::ground::math::{LOG2_PER_DB, exp2, log2};
use crate::ground::rng::{Draw, Rng};
use crate::medium::Spreading;
use crate::trace::{Arrival, Backscatter, Direct, Surfaces};
use echocast_kernels::sound;
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

/// Most bins that the cell of one ray is divided among.
pub(super) const MOST_BINS: f32 = 256.0;

/// Where the lattice of the texture begins, in its cells: flat surfaces at round heights, 0 above all, lie inside its cells,
/// not between two of them, where rounding would decide.
const OFF_LATTICE: f32 = 0.34;

/// What all rays of a ping share.
pub(crate) struct Insonification<'a> {
    pub transducer: &'a Transducer,
    pub backscatter: &'a Backscatter,
    pub surfaces: &'a Surfaces,
    /// World from sensor.
    pub rotation: Mat3,
    /// Source level, dB.
    pub source_level: f32,
    pub spreading: Spreading,
    /// Where hybrid spreading becomes cylindrical, m.
    pub spreading_from: f32,
    /// Whether rays are straight.
    pub straight: bool,
    /// Greatest range from which echoes come, m.
    pub farthest: f32,
    pub bins: usize,
    pub bin_m: f32,
    /// Range after which the next ping is sent, m: echoes from beyond appear that much nearer.
    pub fold: f32,
    /// 2 / wavelength, 1/m: turns of the phase per metre of range.
    pub turns: f32,
    /// Random scatterers; `None`: the mean level.
    pub speckle: Option<Scatterers>,
    /// How the sonar moves while sound travels.
    pub drift: Option<Drift>,
    /// What pulse and receiver make of an echo.
    pub response: &'a Response,
    /// Which objects have tubes of their own; empty: none.
    pub covered: &'a [bool],
    /// What motion does to ranges; `None`: nothing, as nothing moves, or no frequency is swept.
    pub coupling: Option<Coupling<'a>>,
}

/// The scatterers of the surfaces.
#[derive(Clone)]
pub(crate) struct Scatterers {
    pub rng: Rng,
    /// Where the sonar is, as a number: with another it hears others.
    pub station: u32,
    /// Along the array, world, 1/m: its product with a place counts the lengths over which the same are heard.
    pub along: Vec3,
    /// Side of the places of one texture, m.
    pub patch: f32,
    /// Quantiles of the texture, rising, of mean 1; empty: no texture.
    pub texture: Arc<[f32]>,
}

/// How the sonar moves while sound travels, per metre of one-way range.
#[derive(Clone, Copy)]
pub(crate) struct Drift {
    /// Displacement, world, m/m.
    pub moved: Vec3,
    /// Rotation about its own axes, rad/m; zero: none.
    pub turned: Vec3,
}

impl Drift {
    /// Reported range of an echo from the unit `direction` (world): the return path ends where the sonar is by then.
    fn range(&self, range: f32, direction: Vec3) -> f32 {
        range - range * self.moved.dot(direction)
    }

    /// The unit `direction` (sensor frame, as it was) from which an echo of a one-way range comes.
    fn seen(&self, range: f32, direction: Vec3) -> Vec3 {
        // Seen from the sonar, the world turns the other way.
        Quat::from_scaled_axis(-range * self.turned) * direction
    }
}

/// What a chunk of rays returns: arrivals in order, and their parts in bins.
#[derive(Clone, Default)]
pub(crate) struct Echoes {
    pub arrivals: Vec<Arrival>,
    /// Number of the first of them among those of the ping, from 1.
    pub first: u32,
    /// Direct paths to the places of arrivals, for each of which two more arrivals come with the answers; or to targets.
    pub direct: Vec<Direct>,
    /// Directions (unit, world) in which arrivals left that did not leave, or do not come back, along their ray: each with
    /// the index of its arrival, rising.
    pub launches: Vec<(u32, Vec3)>,
    /// For each arrival, in order.
    pub answers: Vec<PingEcho>,
    /// Beams that hear any of it: from the first to before the second.
    pub beams: (usize, usize),
    /// Parts: energies, and amplitudes with random phases, or energies again.
    pub energy: Vec<f32>,
    pub re: Vec<f32>,
    pub im: Vec<f32>,
}

/// What returns from an arrival.
#[derive(Clone, Copy)]
pub(crate) struct PingEcho {
    /// Its parts: from this one on, `parts` of them.
    pub first: u32,
    pub parts: u32,
    /// Bin of the first.
    pub bin: u32,
    /// Reported range, m, folded.
    pub range: f32,
    /// Range covered by its surface, m.
    pub reach: f32,
    /// How far along the surface a metre of range is.
    pub slide: Vec3,
    /// Who hears it: index of the [`Hearing`].
    pub hearing: u32,
}

/// How and when an echo is heard.
#[derive(Clone, Copy)]
pub(super) struct Heard {
    /// Reported range, m.
    pub at: f32,
    /// log2 of how much louder than in the direction of the ray that found it.
    pub louder: f32,
    /// Index of the [`Hearing`].
    pub hearing: u32,
}

/// An echo to be divided among bins.
pub(super) struct Echo {
    /// Energy; `None`: not heard.
    pub power: Option<f32>,
    pub heard: Heard,
    /// Stretch of range, m, and how far along the surface a metre of it is.
    pub reach: f32,
    pub slide: Vec3,
    /// 0: back the way it went; others: other ways.
    pub way: u32,
}

/// Parts of echoes, and those waiting for random amplitudes.
pub(super) struct Parts<'a> {
    energy: &'a mut Vec<f32>,
    re: &'a mut Vec<f32>,
    im: &'a mut Vec<f32>,
    batch: Batch,
}

/// Parts waiting for random amplitudes, as many as are drawn at once.
struct Batch {
    /// In lengths along the array over which scatterers stay the same.
    along: [f32; BATCH],
    bin: [u32; BATCH],
    object: [u32; BATCH],
    energy: [f32; BATCH],
    count: usize,
}

const BATCH: usize = 64;

impl Insonification<'_> {
    /// Finds what `echoes.arrivals` send back, also straight back where `echoes.direct` says so.
    pub fn answer(&self, echoes: &mut Echoes) {
        let Echoes { arrivals, direct, launches, answers, energy, re, im, .. } = echoes;
        answers.clear();
        launches.clear();
        [&mut *energy, re, im].into_iter().for_each(Vec::clear);
        let mut parts = Parts::new(energy, re, im);
        for arrival in &*arrivals {
            let ray = arrival.ray as usize;
            let sine = sine(arrival.direction, arrival.normal);
            let mut loudness = self.source_level * LOG2_PER_DB
                + self.transducer.weight[ray]
                + self.backscatter.log2(self.surfaces, arrival, sine)
                + self.spread(arrival)
                - 2.0 * LOG2_PER_DB * arrival.loss;
            let mut heard = Heard { at: arrival.range, louder: 0.0, hearing: self.transducer.hearing[ray] };
            if let Some(drift) = &self.drift {
                heard = self.heard_later(drift, ray, arrival.range, self.launch(ray));
                loudness += heard.louder;
            }
            if let Some(coupling) = &self.coupling {
                heard.at += coupling.shift(arrival, self.launch(ray));
            }
            let (reach, slide) = self.reach(arrival, arrival.direction);
            // After reflections also what is only heard straight back has arrived.
            let in_reach = arrival.order == 0 || arrival.range <= self.farthest;
            let power = if in_reach && !self.is_heard_otherwise(arrival) { Some(exp2(loudness)) } else { None };
            answers.push(self.divide(arrival, Echo { power, heard, reach, slide, way: 0 }, &mut parts));
        }
        self.answer_mixed(arrivals, direct, launches, answers, &mut parts);
        parts.finish(self.speckle.as_ref());
    }

    /// Finds what the targets send back to which `echoes.direct` leads, each as a point of its target strength (sonar
    /// equation for point targets, Urick 1983, section 2.1): no ray has to meet it.
    pub fn answer_targets(&self, echoes: &mut Echoes) {
        echoes.clear();
        let Echoes { arrivals, direct, launches, answers, energy, re, im, .. } = echoes;
        let sensor_from_world = self.rotation.transpose();
        for Direct { way, launch, .. } in &*direct {
            let sent = sensor_from_world * *launch;
            let (mut at, heard) = self.seen(way.range, *launch);
            if let Some(coupling) = &self.coupling {
                at += coupling.shift(way, *launch);
            }
            let unaimed = self.source_level * LOG2_PER_DB
                + self.backscatter.target_strength(self.surfaces, way.surface)
                + self.spread_twice(way)
                - 2.0 * LOG2_PER_DB * way.loss;
            for (loud, hearing) in self.transducer.towards(sent, heard) {
                if loud <= FAINT {
                    continue;
                }
                launches.push((arrivals.len() as u32, *launch));
                arrivals.push(Arrival { ray: NO_RAY, ..*way });
                let range = self.folded(at);
                let bin = range.max(0.0) / self.bin_m;
                let is_heard = bin < self.bins as f32;
                let first = energy.len() as u32;
                answers.push(PingEcho {
                    first,
                    parts: is_heard.into(),
                    bin: bin as u32,
                    range,
                    reach: 0.0,
                    slide: Vec3::ZERO,
                    hearing,
                });
                if is_heard {
                    let power = exp2(unaimed + loud);
                    energy.push(power);
                    if self.speckle.is_some() {
                        // A point has a phase, but no speckle.
                        let (sin, cos) = (TAU * (way.path * self.turns).fract()).sin_cos();
                        re.push(power.sqrt() * cos);
                        im.push(power.sqrt() * sin);
                    } else {
                        re.push(power);
                    }
                }
            }
        }
    }

    /// Whether what a ray meets is a target, or has tubes of its own: see [`Insonification::answer_targets`] and
    /// [`Insonification::answer_body`].
    fn is_heard_otherwise(&self, arrival: &Arrival) -> bool {
        let Some(row) = self.surfaces.rows.get(arrival.surface as usize).filter(|_| arrival.order == 0) else {
            return false;
        };
        !self.surfaces.targets.is_empty() && self.backscatter.is_whole(self.surfaces, arrival.surface)
            || self.covered.get(row.object as usize).is_some_and(|&covered| covered)
    }

    /// How the echo that came back along its ray is heard, given `drift`.
    pub(super) fn heard_later(&self, drift: &Drift, ray: usize, range: f32, direction: Vec3) -> Heard {
        if drift.turned == Vec3::ZERO {
            let hearing = self.transducer.hearing[ray];
            return Heard { at: drift.range(range, direction), louder: 0.0, hearing };
        }
        self.heard_from(ray, range, direction)
    }

    /// How an echo of a one-way range from the unit `direction` (world), found by a ray, is heard.
    pub(super) fn heard_from(&self, ray: usize, range: f32, direction: Vec3) -> Heard {
        let (at, seen) = self.seen(range, direction);
        let (louder, hearing) = self.transducer.heard_beside(ray, seen);
        Heard { at, louder, hearing }
    }

    /// Where an echo of a one-way range from the unit `direction` (world) appears: its range, m, and direction, sensor frame.
    pub(super) fn seen(&self, range: f32, direction: Vec3) -> (f32, Vec3) {
        let own = self.rotation.transpose() * direction;
        self.drift.map_or((range, own), |drift| (drift.range(range, direction), drift.seen(range, own)))
    }

    /// The range at which what is heard after the next ping appears, m.
    pub(super) fn folded(&self, at: f32) -> f32 {
        if at >= self.fold { at - self.fold } else { at }
    }

    /// How much the range of an echo that leaves back along the unit `back` changes over a ray's cell, m, and how far
    /// along the surface a metre of range is.
    pub(super) fn reach(&self, arrival: &Arrival, back: Vec3) -> (f32, Vec3) {
        let (direction, normal) = (arrival.direction, arrival.normal);
        let towards = towards(direction, normal);
        // From one side of the cell to the other, along the surface: the change of range, and the displacement.
        let side = |across: Vec3| {
            let farther = -across.dot(normal) / towards;
            let way = across + direction * farther;
            (0.5 * (farther + way.dot(back)), way)
        };
        let ray = arrival.ray as usize;
        let tangent = self.tangent(ray);
        let (reach, way) = side(self.across(ray, arrival, tangent * self.transducer.cell[ray]));
        let Some(&aside) = self.transducer.aside.get(ray) else {
            return (reach, if reach.abs() > 1e-6 { way / reach } else { Vec3::ZERO });
        };
        // The cell's sides combined: length by the spread of both, direction as both have it on average.
        let (reach_aside, way_aside) = side(self.across(ray, arrival, tangent.cross(self.launch(ray)) * aside));
        let square = reach * reach + reach_aside * reach_aside;
        let way = way * reach + way_aside * reach_aside;
        (square.sqrt(), if square > 1e-12 { way / square } else { Vec3::ZERO })
    }

    /// Divides an echo among bins.
    pub(super) fn divide(&self, arrival: &Arrival, echo: Echo, parts: &mut Parts) -> PingEcho {
        let Echo { power, heard: Heard { at, hearing, .. }, reach, slide, way } = echo;
        let first = parts.len();
        let at = self.folded(at);
        let per_bin = 1.0 / self.bin_m;
        let reach = reach.abs().min(MOST_BINS * self.bin_m);
        let low = (at - 0.5 * reach) * per_bin;
        let high = (at + 0.5 * reach) * per_bin;
        let from = low.max(0.0) as usize;
        let silent = PingEcho { first, parts: 0, bin: 0, range: at, reach, slide, hearing };
        let Some(power) = power.filter(|_| from < self.bins && high > 0.0) else { return silent };
        let to = (high as usize).min(self.bins - 1);
        let answer = PingEcho { parts: (to - from + 1) as u32, bin: from as u32, ..silent };
        let share = power / (high - low).max(1e-3);
        let whole = from == to && low >= from as f32 && high <= to as f32 + 1.0;
        let Some(scatterers) = &self.speckle else {
            for part in from..=to {
                let covered = (high.min(part as f32 + 1.0) - low.max(part as f32)).max(0.0);
                let share = if whole { power } else { share * covered };
                parts.add(share, [share, 0.0]);
            }
            return answer;
        };
        let object = self.scatterer(arrival.surface, arrival.ray, arrival.order, way);
        let along = arrival.place.dot(scatterers.along);
        let along_per_m = slide.dot(scatterers.along);
        let (place, textured) = (arrival.place, !scatterers.texture.is_empty());
        let part = |bin: u32| {
            let (low, high) = (low.max(bin as f32), high.min(bin as f32 + 1.0));
            // The middle of what lies in the bin.
            let beside = 0.5 * (low + high) * self.bin_m - at;
            let energy = if whole { power } else { share * (high - low).max(0.0) };
            let rough = if textured { scatterers.roughness(place + slide * beside) } else { 1.0 };
            (along + along_per_m * beside, energy * rough)
        };
        parts.scatter(scatterers, object, from as u32..to as u32 + 1, part);
        answer
    }

    /// Whose scatterers a ray meets on a surface, after reflections, by one of the ways back: each ray and each path has its
    /// own in each bin. If several shared those of one place, their echoes would be in phase where the surface is met
    /// head-on, and the more rays, the louder.
    pub(super) fn scatterer(&self, surface: u32, ray: u32, order: u8, way: u32) -> u32 {
        let instance = self.surfaces.rows.get(surface as usize).map_or(MEDIUM, |row| row.instance_id);
        let ray = ray.wrapping_mul(0x85EB_CA6B).rotate_left(16);
        let path = way << 24 | u32::from(order) << 26;
        instance.wrapping_mul(0x9E37_79B9).wrapping_add(ray) ^ Draw::Speckle as u32 ^ path
    }

    /// Direction in which a ray started, world.
    pub(super) fn launch(&self, ray: usize) -> Vec3 {
        let [x, y, z] = &self.transducer.direction;
        self.rotation * Vec3::new(x[ray], y[ray], z[ray])
    }

    /// Unit vector across a ray where it starts, world.
    fn tangent(&self, ray: usize) -> Vec3 {
        let [x, y, z] = &self.transducer.tangent;
        self.rotation * Vec3::new(x[ray], y[ray], z[ray])
    }

    /// Length of `tangent` (rad) from one side of a ray's cell to the other, where the ray arrives, m.
    fn across(&self, ray: usize, arrival: &Arrival, tangent: Vec3) -> Vec3 {
        let [upright, level] = arrival.tube;
        if self.straight && arrival.order == 0 {
            return tangent * level;
        }
        // The tube turns with the ray, in its vertical plane, and is wider or thinner there than across it.
        let frame = |direction: Vec3| {
            let aside = Vec3::new(-direction.y, direction.x, 0.0).normalize_or(Vec3::Y);
            (aside, direction.cross(aside))
        };
        let (aside, above) = frame(self.launch(ray));
        let (aside_now, above_now) = frame(arrival.direction);
        aside_now * (level * tangent.dot(aside)) + above_now * (upright * tangent.dot(above))
    }

    /// log2 of what spreading leaves of an echo that returns the way it went.
    fn spread(&self, arrival: &Arrival) -> f32 {
        self.spread_between(arrival, arrival)
    }

    /// log2 of what spreading leaves of an echo of a point that returns the way it went: of both ways.
    pub(super) fn spread_twice(&self, way: &Arrival) -> f32 {
        if self.spreading == Spreading::RayTube {
            return 2.0 * self.tube_spread(way, way.speed);
        }
        -2.0 * self.spreading.one_way(log2(way.path.max(1e-3)), self.spreading_from)
    }

    /// log2 of `speed` (pressure follows from intensity by the impedance) over the area of the tube of a ray.
    fn tube_spread(&self, way: &Arrival, speed: f32) -> f32 {
        let [upright, level] = way.tube;
        // At a caustic the tube is as wide as diffraction leaves it.
        let length = way.path;
        let least = length.min((2.0 * length / self.turns).sqrt());
        log2(speed) - log2((upright.max(least) * level).max(1e-6)).abs()
    }

    /// log2 of what spreading leaves of an echo that went `out` and comes `back`: of the return path alone, as the
    /// outward path makes the footprint that the ray represents. Levels do not rise within a metre of the sonar.
    pub(super) fn spread_between(&self, out: &Arrival, back: &Arrival) -> f32 {
        if self.spreading == Spreading::RayTube {
            return self.tube_spread(back, out.speed * back.speed);
        }
        let [out, back] = [out, back].map(|way| log2(way.path.max(1e-3)));
        let one_way = |path| self.spreading.one_way(path, self.spreading_from);
        2.0 * out - one_way(out) - one_way(back)
    }
}

impl Echoes {
    /// Empties all but the direct paths.
    pub fn clear(&mut self) {
        let Echoes { arrivals, launches, answers, energy, re, im, .. } = self;
        arrivals.clear();
        launches.clear();
        answers.clear();
        [energy, re, im].into_iter().for_each(Vec::clear);
    }

    /// Determines which beams hear any of it, or lose water to it.
    pub fn find_beams(&mut self, transducer: &Transducer) {
        let of_rays = self.arrivals.iter().filter(|arrival| arrival.order == 0);
        let of_rays = of_rays.filter_map(|arrival| transducer.hearing.get(arrival.ray as usize));
        let all = of_rays.copied().chain(self.answers.iter().map(|answer| answer.hearing));
        self.beams = all.fold((usize::MAX, 0), |(least, most), hearing| {
            let Hearing { first, from, to, .. } = transducer.hearings[hearing as usize];
            (least.min(first as usize), most.max((first + to - from) as usize))
        });
    }
}

/// Sine of the grazing angle between a unit vector and a surface.
pub(super) fn sine(direction: Vec3, normal: Vec3) -> f32 {
    (direction.dot(normal).abs() / normal.length()).clamp(1e-3, 1.0)
}

/// Part of the unit `direction` along a normal of any length, times that, for the extent of what is met: not less than at a
/// grazing angle of 0.6 degrees, as at the rim of a round object that would reach far behind it.
pub(super) fn towards(direction: Vec3, normal: Vec3) -> f32 {
    const LEAST: f32 = 1e-2;
    let along = direction.dot(normal);
    let least = LEAST * normal.length();
    if along.abs() > least { along } else { least.copysign(along) }
}

impl<'a> Parts<'a> {
    /// None yet, into empty columns.
    pub fn new(energy: &'a mut Vec<f32>, re: &'a mut Vec<f32>, im: &'a mut Vec<f32>) -> Parts<'a> {
        Parts { energy, re, im, batch: Batch::new() }
    }

    /// How many there are.
    pub fn len(&self) -> u32 {
        (self.energy.len() + self.batch.count) as u32
    }

    /// Adds one of a known amplitude, or again its energy; none may wait.
    pub fn add(&mut self, energy: f32, [re, im]: [f32; 2]) {
        self.energy.push(energy);
        self.re.push(re);
        self.im.push(im);
    }

    /// Adds one of a random amplitude: that of the scatterers of an object in a bin, at a place along the array.
    pub fn scatter_at(&mut self, scatterers: &Scatterers, [object, bin]: [u32; 2], along: f32, energy: f32) {
        self.scatter(scatterers, object, bin..bin + 1, |_| (along, energy));
    }

    /// Adds one for each of `bins`, whose places along the array and energies are those that `part` says.
    fn scatter(
        &mut self,
        scatterers: &Scatterers,
        object: u32,
        mut bins: Range<u32>,
        part: impl Fn(u32) -> (f32, f32),
    ) {
        let batch = &mut self.batch;
        while !bins.is_empty() {
            let lanes = batch.count..BATCH.min(batch.count + bins.len());
            let places = batch.along[lanes.clone()].iter_mut().zip(&mut batch.energy[lanes.clone()]);
            for (((along, energy), number), bin) in places.zip(&mut batch.bin[lanes.clone()]).zip(bins.clone()) {
                // Not all of them change at once.
                let shift = object.wrapping_add(bin.wrapping_mul(0x9E37_79B9));
                let at;
                (at, *energy) = part(bin);
                *along = at + (shift >> 8) as f32 / (1 << 24) as f32;
                *number = bin;
            }
            batch.object[lanes.clone()].fill(object);
            bins.start += lanes.len() as u32;
            batch.count = lanes.end;
            if batch.count == BATCH {
                batch.scatter(scatterers, self.energy, self.re, self.im);
            }
        }
    }

    /// Gives those that wait their amplitudes.
    pub fn finish(&mut self, scatterers: Option<&Scatterers>) {
        if let Some(scatterers) = scatterers.filter(|_| self.batch.count > 0) {
            self.batch.scatter(scatterers, self.energy, self.re, self.im);
        }
    }
}

impl Batch {
    fn new() -> Batch {
        Batch { along: [0.0; BATCH], bin: [0; BATCH], object: [0; BATCH], energy: [0.0; BATCH], count: 0 }
    }

    /// Gives the parts random amplitudes and adds them to the others.
    fn scatter(&mut self, scatterers: &Scatterers, energy: &mut Vec<f32>, re: &mut Vec<f32>, im: &mut Vec<f32>) {
        let (mut x, mut y) = ([0.0; BATCH], [0.0; BATCH]);
        let mut along = [0; BATCH];
        // All lanes, including those still empty: loops of fixed length compile to vector instructions.
        sound::cells(&self.along, &mut along);
        let address = [&along[..], &self.bin, &[scatterers.station; BATCH], &self.object];
        scatterers.rng.phasors(address, &mut x, &mut y);
        for lane in 0..BATCH {
            let amplitude = self.energy[lane].sqrt();
            x[lane] *= amplitude;
            y[lane] *= amplitude;
        }
        energy.extend_from_slice(&self.energy[..self.count]);
        re.extend_from_slice(&x[..self.count]);
        im.extend_from_slice(&y[..self.count]);
        self.count = 0;
    }
}

impl Scatterers {
    /// Part of the mean energy that a place sends back, by its texture, or all of it.
    #[inline(never)]
    pub(super) fn roughness(&self, place: Vec3) -> f32 {
        if self.texture.is_empty() {
            return 1.0;
        }
        let address = (place / self.patch + OFF_LATTICE).floor().to_array().map(|cell| cell as i32 as u32);
        self.texture[(self.rng.uniform_at(address, Draw::Texture) * self.texture.len() as f32) as usize]
    }
}

/// A gamma distribution of mean 1 and this shape, cut into equally probable parts: the mean of each, rising.
pub(crate) fn texture(shape: f64) -> Arc<[f32]> {
    const PARTS: usize = 4096;
    const STEPS: usize = 400_000;
    // The density over the logarithm t of the number is e^(shape t - e^t): smooth, and negligible outside these ends.
    let (low, high) = (-40.0 / shape, (shape + 12.0 * shape.sqrt() + 40.0).ln());
    let step = (high - low) / STEPS as f64;
    let densities = (0..STEPS).map(|index| {
        let t = low + (index as f64 + 0.5) * step;
        let value = t.exp();
        (value, (shape * (t - shape.ln()) - value + shape).exp())
    });
    let whole: f64 = densities.clone().map(|(_, density)| density).sum();
    let mut parts = vec![[0.0; 2]; PARTS];
    let mut sum = 0.0;
    for (value, density) in densities {
        let part = (((sum + 0.5 * density) / whole * PARTS as f64) as usize).min(PARTS - 1);
        parts[part][0] += density;
        parts[part][1] += density * value;
        sum += density;
    }
    parts.iter().map(|[weight, sum]| (sum / weight.max(1e-300) / shape) as f32).collect()
}

/// Adjacent beams that are heard together.
#[derive(Clone, Default)]
pub(crate) struct Tile {
    /// Beams of this tile: from `beams.0` to before `beams.1`.
    pub beams: (usize, usize),
    /// Bins in which anything but zeros may be.
    pub heard: Range<usize>,
    /// Sums by bin and beam: of amplitudes, or in `re` of energies without speckle.
    pub re: Vec<f32>,
    pub im: Vec<f32>,
    /// Energy of the strongest arrival of each cell, and its number.
    pub most: Vec<f32>,
    pub who: Vec<u32>,
    /// Whom each cell tells of, beam by beam: see [`Tile::levels`].
    pub told: Vec<u32>,
    /// Energy times the angle from the beam's axis, and energy; for swaths.
    pub lean: Vec<f32>,
    pub total: Vec<f32>,
    /// Solid angle still open at each bin, sr, minus what is closed there.
    pub open: Vec<f32>,
}

/// No arrival: their numbers are from 1. It is 0, as memory is when nothing was heard.
pub(crate) const NOBODY: u32 = 0;

/// In place of a ray's number: what was not found by any, and takes no water from view.
pub(crate) const NO_RAY: u32 = u32::MAX;

/// What a tile determines.
#[derive(Clone, Copy)]
pub(crate) struct Wants {
    /// The strongest arrival of each cell.
    pub who: bool,
    /// Where in its beam an echo lies.
    pub lean: bool,
    /// How much of the water is still in view.
    pub open: bool,
    /// Amplitudes with phases, not energies.
    pub speckle: bool,
}

impl Tile {
    pub fn width(&self) -> usize {
        self.beams.1 - self.beams.0
    }

    /// Empties it for `beams` and `bins`.
    pub fn clear(&mut self, beams: (usize, usize), bins: usize, wants: Wants) {
        let before = self.width();
        self.beams = beams;
        let width = self.width();
        let cells = bins * width;
        // Most of a ping is silence, and was.
        let heard = self.heard.start * width..self.heard.end * width;
        self.heard = bins..0;
        let reset = |column: &mut Vec<f32>, wanted: bool| {
            if wanted && column.len() == cells && before == width {
                return column.get_mut(heard.clone()).unwrap_or_default().fill(0.0);
            }
            column.clear();
            column.resize(if wanted { cells } else { 0 }, 0.0);
        };
        reset(&mut self.re, true);
        reset(&mut self.im, wants.speckle);
        reset(&mut self.most, wants.who);
        reset(&mut self.lean, wants.lean);
        reset(&mut self.total, wants.lean);
        reset(&mut self.open, wants.open);
        if wants.who && self.who.len() == cells && before == width {
            self.who.get_mut(heard).unwrap_or_default().fill(NOBODY);
        } else {
            self.who.clear();
            self.who.resize(if wants.who { cells } else { 0 }, NOBODY);
        }
    }

    /// Notes that something is heard in `parts` bins from `bin` on.
    fn note(&mut self, bin: usize, parts: usize) {
        if parts > 0 {
            self.heard = self.heard.start.min(bin)..self.heard.end.max(bin + parts);
        }
    }

    /// Adds the parts of an arrival heard by one beam whose bins are consecutive.
    fn hear_alone(&mut self, echoes: &Echoes, answer: &PingEcho, loud: f32, who: u32, wants: Wants) {
        let parts = answer.first as usize..(answer.first + answer.parts) as usize;
        let cells = answer.bin as usize..(answer.bin + answer.parts) as usize;
        let scale = if wants.speckle { loud } else { loud * loud };
        sound::add(scale, &echoes.re[parts.clone()], &mut self.re[cells.clone()]);
        if wants.speckle {
            sound::add(loud, &echoes.im[parts.clone()], &mut self.im[cells.clone()]);
        }
        if wants.who {
            let (most, is) = (&mut self.most[cells.clone()], &mut self.who[cells]);
            sound::prefer_parts(loud, &echoes.energy[parts], who, most, is);
        }
    }

    /// Adds the parts of an arrival heard by adjacent beams, from the tile's beam `first` on, as loud as `loudness`
    /// says.
    fn hear_together(
        &mut self,
        echoes: &Echoes,
        answer: &PingEcho,
        (first, loudness): (usize, &[f32]),
        who: u32,
        wants: Wants,
    ) {
        let width = self.width();
        let parts = answer.first as usize..(answer.first + answer.parts) as usize;
        let start = answer.bin as usize * width + first;
        if wants.speckle && wants.who {
            let (amplitudes, energy) = ([&echoes.re[parts.clone()], &echoes.im[parts.clone()]], &echoes.energy[parts]);
            let Tile { re, im, most, who: is, .. } = self;
            return sound::hear_rows(start, width, loudness, amplitudes, energy, who, [re, im], most, is);
        }
        if wants.speckle {
            sound::add_rows(start, width, loudness, &echoes.re[parts.clone()], &mut self.re);
            sound::add_rows(start, width, loudness, &echoes.im[parts.clone()], &mut self.im);
        } else {
            sound::add_rows_squared(start, width, loudness, &echoes.re[parts.clone()], &mut self.re);
        }
        if wants.who {
            let (most, is) = (&mut self.most, &mut self.who);
            sound::prefer_rows(start, width, loudness, &echoes.energy[parts], who, most, is);
        }
    }

    /// Accumulates where in the beams the energy of an arrival comes from.
    fn lean(&mut self, echoes: &Echoes, answer: &PingEcho, first: usize, [loudness, beside]: [&[f32]; 2]) {
        let width = self.width();
        let parts = answer.first as usize..(answer.first + answer.parts) as usize;
        let start = answer.bin as usize * width + first;
        let (lean, total) = (&mut self.lean, &mut self.total);
        sound::lean_rows(start, width, loudness, beside, &echoes.energy[parts], lean, total);
    }

    /// Adds what the beams hear of a chunk.
    pub fn hear(&mut self, transducer: &Transducer, echoes: &Echoes, bin_m: f32, wants: Wants) {
        let width = self.width();
        if echoes.beams.1 <= self.beams.0 || self.beams.1 <= echoes.beams.0 {
            return;
        }
        for (who, (arrival, answer)) in (echoes.first..).zip(echoes.arrivals.iter().zip(&echoes.answers)) {
            if wants.open && arrival.order == 0 && arrival.ray != NO_RAY {
                self.close(transducer, arrival.ray as usize, (answer.range / bin_m) as usize);
            }
            let Hearing { first, from, to, .. } = transducer.hearings[answer.hearing as usize];
            let (first, last) = (first as usize, (first + to - from) as usize);
            let (low, high) = (first.max(self.beams.0), last.min(self.beams.1));
            if low >= high {
                continue;
            }
            let loudness = &transducer.loudness[from as usize + low - first..from as usize + high - first];
            self.note(answer.bin as usize, answer.parts as usize);
            if width == 1 {
                self.hear_alone(echoes, answer, loudness[0], who, wants);
            } else {
                self.hear_together(echoes, answer, (low - self.beams.0, loudness), who, wants);
            }
            if wants.lean {
                let beside = &transducer.beside[from as usize + low - first..from as usize + high - first];
                self.lean(echoes, answer, low - self.beams.0, [loudness, beside]);
            }
        }
    }

    /// Closes the water of a bin, and behind it, to beams by the cell of a ray that meets something there.
    fn close(&mut self, transducer: &Transducer, ray: usize, bin: usize) {
        let width = self.width();
        // Uses the beams at the start, which define the open water.
        let Hearing { first, from, to, .. } = transducer.hearings[transducer.hearing[ray] as usize];
        let (first, last) = (first as usize, (first + to - from) as usize);
        let (low, high) = (first.max(self.beams.0), last.min(self.beams.1));
        if low >= high || bin * width >= self.open.len() {
            return;
        }
        self.note(bin, 1);
        let loudness = &transducer.loudness[from as usize + low - first..from as usize + high - first];
        let weight = exp2(transducer.weight[ray]);
        let start = bin * width + low - self.beams.0;
        for (open, &loud) in self.open[start..start + loudness.len()].iter_mut().zip(loudness) {
            *open -= weight * loud * loud;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A texture times an exponential is K-distributed: compared with quantiles and moments from another library.
    #[test]
    fn textures_make_k_distributions() {
        let table = include_str!("../../../../../tests/data/sonar/speckle_statistics.json");
        let table: serde_json::Value = serde_json::from_str(table).unwrap();
        for (shape, expected) in table["K_intensity_shape"].as_object().unwrap() {
            let texture = texture(shape.parse().unwrap());
            let mean = |of: &dyn Fn(f64) -> f64| {
                texture.iter().map(|&part| of(part.into())).sum::<f64>() / texture.len() as f64
            };
            assert!((mean(&|t| t) - 1.0).abs() < 1e-4, "{shape}");
            let index = 2.0 * mean(&|t| t * t) - 1.0;
            let known = expected["SI"].as_f64().unwrap();
            assert!((index / known - 1.0).abs() < 0.01, "scintillation index with {shape}: {index} {known}");
            let third = 6.0 * mean(&|t| t * t * t);
            let known = expected["m3"].as_f64().unwrap();
            assert!((third / known - 1.0).abs() < 0.05, "third moment with {shape}: {third} {known}");
            for (part, quantile) in expected["quantiles"].as_object().unwrap() {
                let (part, quantile) = (part.parse::<f64>().unwrap(), quantile.as_f64().unwrap());
                let below = mean(&|t| 1.0 - (-quantile / t).exp());
                assert!((below - part).abs() < 2e-4, "{shape}: {below} instead of {part}");
            }
        }
    }
}
