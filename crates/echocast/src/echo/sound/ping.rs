//! From what rays of sound meet to what the beams of a sonar hear in each range bin.
//!
//! Each ray represents a cell of directions; the patch of surface that it covers returns energy over a stretch of
//! range, which is divided among bins as it lies. So a bin's energy depends neither on the mesh nor on the number of
//! rays.

use super::coupling::Coupling;
use crate::emitter::{FAINT, Hearing, Transducer};
use crate::ground::lanes::MEDIUM;
use crate::ground::math::{LOG2_PER_DB, exp2, log2};
use crate::ground::rng::{Draw, Rng};
use crate::medium::Spreading;
use crate::trace::{Arrival, Backscatter, Direct, Surfaces};
use echocast_kernels::sound;
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::TAU;
use std::sync::Arc;

/// Most bins that the cell of one ray is divided among.
const MOST_BINS: f32 = 256.0;

/// Where the lattice of scatterers begins, in its cells: flat surfaces at round heights, 0 above all, lie inside its
/// cells and the wider ones of the texture, not between two of them, where rounding would decide.
const OFF_LATTICE: f32 = 5.37;

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
    /// What motion does to ranges; `None`: nothing, as nothing moves, or no frequency is swept.
    pub coupling: Option<Coupling<'a>>,
}

/// The scatterers of the surfaces.
#[derive(Clone)]
pub(crate) struct Scatterers {
    pub rng: Rng,
    /// Side of the places that scatter as one, m.
    pub lattice: f32,
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
    /// Direct paths to the places of arrivals, for each of which two more arrivals come with the answers; or to targets.
    pub direct: Vec<Direct>,
    /// Directions (unit, world) in which arrivals left that did not leave, or do not come back, along their ray: each with
    /// the index of its arrival, rising.
    pub launches: Vec<(u32, Vec3)>,
    /// For each arrival, in order.
    pub answers: Vec<PingEcho>,
    /// Azimuth and elevation in which the sound of each arrival left, or came back, sensor frame, rad; empty: not found.
    pub aims: Vec<[f32; 2]>,
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
    /// 0: back the way it went; 1 and 2: others.
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
    /// In cells of the lattice.
    place: [[f32; BATCH]; 3],
    object: [u32; BATCH],
    turn: [f32; BATCH],
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
        let mut parts = Parts { energy, re, im, batch: Batch::new() };
        let has_targets = !self.surfaces.targets.is_empty();
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
            // What a ray meets of a target is heard otherwise: see [`Insonification::answer_targets`].
            let is_target =
                has_targets && arrival.order == 0 && self.backscatter.is_whole(self.surfaces, arrival.surface);
            let power = if in_reach && !is_target { Some(exp2(loudness)) } else { None };
            answers.push(self.divide(arrival, Echo { power, heard, reach, slide, way: 0 }, &mut parts));
        }
        self.answer_mixed(arrivals, direct, launches, answers, &mut parts);
        if let Some(scatterers) = &self.speckle {
            parts.scatter(scatterers);
        }
    }

    /// Finds what the targets send back to which `echoes.direct` leads, each as a point of its target strength (sonar
    /// equation for point targets, Urick 1983, section 2.1): no ray has to meet it.
    pub fn answer_targets(&self, echoes: &mut Echoes) {
        let Echoes { arrivals, direct, launches, answers, aims, energy, re, im, .. } = echoes;
        arrivals.clear();
        launches.clear();
        answers.clear();
        aims.clear();
        [&mut *energy, re, im].into_iter().for_each(Vec::clear);
        let sensor_from_world = self.rotation.transpose();
        for Direct { way, launch, .. } in &*direct {
            let sent = sensor_from_world * *launch;
            let (mut at, mut heard) = (way.range, sent);
            if let Some(drift) = &self.drift {
                at = drift.range(way.range, *launch);
                heard = drift.seen(way.range, sent);
            }
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
                let range = if at >= self.fold { at - self.fold } else { at };
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
        let mut at = range;
        let mut seen = self.rotation.transpose() * direction;
        if let Some(drift) = &self.drift {
            at = drift.range(range, direction);
            seen = drift.seen(range, seen);
        }
        let (louder, hearing) = self.transducer.heard_beside(ray, seen);
        Heard { at, louder, hearing }
    }

    /// How much the range of an echo that leaves back along the unit `back` changes over a ray's cell, m, and how far
    /// along the surface a metre of range is.
    pub(super) fn reach(&self, arrival: &Arrival, back: Vec3) -> (f32, Vec3) {
        /// Sine of the least grazing angle, 0.6 degrees, for the extent of cells: at the rim of a round object they
        /// would reach far behind it.
        const LEAST: f32 = 1e-2;
        let (direction, normal) = (arrival.direction, arrival.normal);
        let along = direction.dot(normal);
        let least = LEAST * normal.length();
        let towards = if along.abs() > least { along } else { least.copysign(along) };
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
        let Echo { power, heard: Heard { mut at, hearing, .. }, reach, slide, way } = echo;
        let Parts { energy, re, im, batch } = parts;
        let first = energy.len() as u32 + batch.count as u32;
        if at >= self.fold {
            at -= self.fold;
        }
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
                energy.push(share);
                re.push(share);
            }
            return answer;
        };
        let instance = self.surfaces.rows.get(arrival.surface as usize).map_or(MEDIUM, |row| row.instance_id);
        // Each ray and each path has its own scatterers: if several shared those of one place, their echoes would be in
        // phase where the surface is met head-on, and the more rays, the louder.
        let ray = arrival.ray.wrapping_mul(0x85EB_CA6B).rotate_left(16);
        let object = instance.wrapping_mul(0x9E37_79B9).wrapping_add(ray) ^ Draw::Speckle as u32 ^ (way << 24);
        let per_lattice = 1.0 / scatterers.lattice;
        for part in from..=to {
            let (low, high) = (low.max(part as f32), high.min(part as f32 + 1.0));
            // The middle of what lies in the bin.
            let beside = 0.5 * (low + high) * self.bin_m - at;
            let scatterer = (arrival.place + slide * beside) * per_lattice + OFF_LATTICE;
            let lane = batch.count;
            for (place, scatterer) in batch.place.iter_mut().zip(scatterer.to_array()) {
                place[lane] = scatterer;
            }
            batch.object[lane] = object;
            batch.turn[lane] = (arrival.path + beside) * self.turns;
            batch.energy[lane] = if whole { power } else { share * (high - low).max(0.0) };
            batch.count += 1;
            if batch.count == BATCH {
                batch.scatter(scatterers, energy, re, im);
            }
        }
        answer
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
    fn spread_twice(&self, way: &Arrival) -> f32 {
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

impl Parts<'_> {
    /// [`Batch::scatter`] of what is waiting for it.
    fn scatter(&mut self, scatterers: &Scatterers) {
        self.batch.scatter(scatterers, self.energy, self.re, self.im);
    }
}

impl Batch {
    fn new() -> Batch {
        Batch { place: [[0.0; BATCH]; 3], object: [0; BATCH], turn: [0.0; BATCH], energy: [0.0; BATCH], count: 0 }
    }

    /// Gives the parts random amplitudes and adds them to the others.
    fn scatter(&mut self, scatterers: &Scatterers, energy: &mut Vec<f32>, re: &mut Vec<f32>, im: &mut Vec<f32>) {
        let (mut x, mut y) = ([0.0; BATCH], [0.0; BATCH]);
        let mut cells = [[0; BATCH]; 3];
        for (place, cells) in self.place.iter().zip(&mut cells) {
            sound::cells(place, cells);
        }
        // All lanes, including those still empty: loops of fixed length compile to vector instructions.
        let [a, b, c] = &cells;
        scatterers.rng.phasors([a, b, c, &self.object], &self.turn, &mut x, &mut y);
        if !scatterers.texture.is_empty() {
            self.roughen(scatterers, &cells);
        }
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

    /// Makes places several lattice cells wide louder or fainter.
    #[inline(never)]
    fn roughen(&mut self, scatterers: &Scatterers, cells: &[[u32; BATCH]; 3]) {
        /// Lattice cells, as a power of 2, along a side of a place of one texture: several range cells.
        const WIDE: u32 = 4;
        for part in 0..self.count {
            let address = cells.each_ref().map(|axis| ((axis[part] as i32) >> WIDE) as u32);
            let at = scatterers.rng.uniform_at(address, Draw::Texture) * scatterers.texture.len() as f32;
            self.energy[part] *= scatterers.texture[at as usize];
        }
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
    /// Sums by bin and beam: of amplitudes, or in `re` of energies without speckle.
    pub re: Vec<f32>,
    pub im: Vec<f32>,
    /// Energy of the strongest arrival of each cell, and its number: see [`Tile::hear`].
    pub most: Vec<f32>,
    pub who: Vec<u32>,
    /// Energy times the angle from the beam's axis, and energy; for swaths.
    pub lean: Vec<f32>,
    pub total: Vec<f32>,
    /// Solid angle still open at each bin, sr, minus what is closed there.
    pub open: Vec<f32>,
}

/// No arrival.
pub(crate) const NOBODY: u32 = u32::MAX;

/// In place of a ray's number: what was not found by any, and takes no water from view.
const NO_RAY: u32 = u32::MAX;

/// Most arrivals of a chunk: their number goes into the lower bits of [`Tile::who`].
pub(crate) const CHUNK_BITS: u32 = 16;

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
        self.beams = beams;
        let cells = bins * self.width();
        let reset = |column: &mut Vec<f32>, wanted: bool| {
            column.clear();
            column.resize(if wanted { cells } else { 0 }, 0.0);
        };
        reset(&mut self.re, true);
        reset(&mut self.im, wants.speckle);
        reset(&mut self.most, wants.who);
        reset(&mut self.lean, wants.lean);
        reset(&mut self.total, wants.lean);
        reset(&mut self.open, wants.open);
        self.who.clear();
        self.who.resize(if wants.who { cells } else { 0 }, NOBODY);
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

    /// Adds what the beams hear of chunk number `chunk`.
    pub fn hear(&mut self, transducer: &Transducer, chunk: u32, echoes: &Echoes, bin_m: f32, wants: Wants) {
        let width = self.width();
        if echoes.beams.1 <= self.beams.0 || self.beams.1 <= echoes.beams.0 {
            return;
        }
        for (index, (arrival, answer)) in (0..).zip(echoes.arrivals.iter().zip(&echoes.answers)) {
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
            let who = chunk << CHUNK_BITS | index;
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
