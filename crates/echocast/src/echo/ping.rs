//! From what rays of sound meet to what the beams of a sonar hear in each range bin.
//!
//! Each ray stands for a cell of directions; what that cell covers of a surface sends energy back over a stretch of range,
//! which is divided among bins as it lies. So a bin's energy depends neither on the mesh nor on the number of rays.

use super::backscatter::Backscatter;
use crate::emitter::{Hearing, Transducer};
use crate::math::{exp2, log2};
use crate::medium::Spreading;
use crate::rng::{Draw, Rng};
use crate::trace::{Arrivals, SEA, Surfaces};
use glam::{Mat3, Vec3};
use std::sync::Arc;

/// Bins that the cell of one ray is divided among at most.
const MOST_BINS: f32 = 256.0;

/// log2(10) / 10: powers from dB.
pub(crate) const LOG2_PER_DB: f32 = 0.332_192_8;

/// What is the same for all rays of a ping.
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
    pub bins: usize,
    pub bin_m: f32,
    /// Range after which the next ping is sent, m: echoes from beyond come that much nearer.
    pub fold: f32,
    /// 2 / wavelength, 1/m: turns of the phase for a metre of range.
    pub turns: f32,
    /// Random scatterers; `None`: the mean level.
    pub speckle: Option<Scatterers>,
    /// How the sonar moves while sound is on its way.
    pub drift: Option<Drift>,
}

/// The scatterers of the surfaces.
#[derive(Clone)]
pub(crate) struct Scatterers {
    pub rng: Rng,
    /// Side of the places that scatter as one, m.
    pub lattice: f32,
    /// Quantiles of the texture, from the least on, of mean 1; empty: no texture.
    pub texture: Arc<[f32]>,
}

/// How the sonar moves while sound is on its way, per metre of one-way range.
#[derive(Clone, Copy)]
pub(crate) struct Drift {
    /// Displacement, world, m/m.
    pub moved: Vec3,
}

/// What a chunk of rays sends back: arrivals in their order, and their parts in bins.
#[derive(Clone, Default)]
pub(crate) struct Echoes {
    pub arrivals: Arrivals,
    /// First part of each arrival, and one more at the end.
    pub first: Vec<u32>,
    /// Bin of the first part of each arrival.
    pub bin: Vec<u32>,
    /// Reported range of each, m, folded.
    pub range: Vec<f32>,
    /// How far along the surface a metre of range is.
    pub slide: Vec<Vec3>,
    /// Parts: energies, and amplitudes with random phases.
    pub energy: Vec<f32>,
    pub re: Vec<f32>,
    pub im: Vec<f32>,
    /// Addresses of the random numbers, and phases, of the parts.
    place: [Vec<u32>; 3],
    object: Vec<u32>,
    turn: Vec<f32>,
}

impl Insonification<'_> {
    /// Finds what `echoes.arrivals` send back.
    #[inline(always)]
    pub fn answer(&self, echoes: &mut Echoes) {
        let Echoes { arrivals, first, bin, range, slide, energy, re, im, place, object, turn } = echoes;
        (first.clear(), bin.clear(), range.clear(), slide.clear());
        (energy.clear(), re.clear(), im.clear(), object.clear(), turn.clear());
        place.iter_mut().for_each(Vec::clear);
        let per_bin = 1.0 / self.bin_m;
        for index in 0..arrivals.len() {
            first.push(energy.len() as u32);
            let ray = arrivals.ray[index] as usize;
            let (direction, normal) = (arrivals.direction[index], arrivals.normal[index]);
            let along = direction.dot(normal);
            let length = normal.length();
            let sine = (along.abs() / length).clamp(1e-3, 1.0);
            let loudness = self.source_level * LOG2_PER_DB
                + self.transducer.weight[ray]
                + self.backscatter.log2(self.surfaces, arrivals, index, sine)
                + self.spread(arrivals, index)
                - 2.0 * LOG2_PER_DB * arrivals.loss[index];
            let power = exp2(loudness);
            let mut at = arrivals.range[index];
            if let Some(drift) = &self.drift {
                // The way back ends where the sonar is by then.
                at -= at * drift.moved.dot(self.launch(ray));
            }
            if at >= self.fold {
                at -= self.fold;
            }
            // Along the surface, from one side of the ray's cell to the other.
            let across = self.across(ray, arrivals, index);
            let rise = across.dot(normal);
            let towards = if along.abs() > 1e-3 * length { along } else { (1e-3 * length).copysign(along) };
            let reach = -rise / towards;
            let most = MOST_BINS * self.bin_m;
            let (reach, slide_by) = if reach.abs() > 1e-6 {
                let surface = (across + direction * reach) / reach;
                (reach.abs().min(most), surface)
            } else {
                (reach.abs(), Vec3::ZERO)
            };
            range.push(at);
            slide.push(slide_by);
            let low = (at - 0.5 * reach) * per_bin;
            let high = (at + 0.5 * reach) * per_bin;
            let from = low.max(0.0) as usize;
            let to = (high.max(0.0) as usize).min(self.bins.saturating_sub(1));
            bin.push(from as u32);
            if from >= self.bins || high <= 0.0 {
                continue;
            }
            let share = power / (high - low).max(1e-3);
            let owner = arrivals.surface[index];
            let instance = if owner == SEA { SEA } else { self.surfaces.rows[owner as usize].instance_id };
            for part in from..=to {
                let covered = (high.min(part as f32 + 1.0) - low.max(part as f32)).max(0.0);
                let share = if from == to { power } else { share * covered };
                energy.push(share);
                if let Some(scatterers) = &self.speckle {
                    // The middle of what lies in the bin.
                    let middle = 0.5 * (high.min(part as f32 + 1.0) + low.max(part as f32)) * self.bin_m;
                    let beside = middle - at;
                    let scatterer = (arrivals.place[index] + slide_by * beside) / scatterers.lattice;
                    for (axis, value) in place.iter_mut().zip(scatterer.to_array()) {
                        axis.push(value.floor() as i32 as u32);
                    }
                    object.push(instance.wrapping_mul(0x9E37_79B9) ^ Draw::Speckle as u32);
                    turn.push((arrivals.path[index] + beside) * self.turns);
                }
            }
        }
        first.push(energy.len() as u32);
        let parts = energy.len();
        re.resize(parts, 0.0);
        im.resize(parts, 0.0);
        match &self.speckle {
            None => re.copy_from_slice(energy),
            Some(scatterers) => {
                let [x, y, z] = place.each_ref().map(|axis| &axis[..]);
                scatterers.rng.phasors([x, y, z, object], turn, re, im);
                if !scatterers.texture.is_empty() {
                    scatterers.roughen([x, y, z], energy);
                }
                for part in 0..parts {
                    let amplitude = energy[part].sqrt();
                    re[part] *= amplitude;
                    im[part] *= amplitude;
                }
            }
        }
    }

    /// Direction in which a ray started, world.
    #[inline(always)]
    fn launch(&self, ray: usize) -> Vec3 {
        let [x, y, z] = &self.transducer.direction;
        self.rotation * Vec3::new(x[ray], y[ray], z[ray])
    }

    /// From one side of a ray's cell to the other, where it arrives, m.
    #[inline(always)]
    fn across(&self, ray: usize, arrivals: &Arrivals, index: usize) -> Vec3 {
        let [x, y, z] = &self.transducer.tangent;
        let tangent = self.rotation * Vec3::new(x[ray], y[ray], z[ray]) * self.transducer.cell[ray];
        let [upright, level] = arrivals.tube[index];
        if self.straight && arrivals.order[index] == 0 {
            return tangent * level;
        }
        // The tube turns with the ray, in its vertical plane, and is wider or thinner there than across it.
        let frame = |direction: Vec3| {
            let aside = Vec3::new(-direction.y, direction.x, 0.0).normalize_or(Vec3::Y);
            (aside, direction.cross(aside))
        };
        let (aside, above) = frame(self.launch(ray));
        let (aside_now, above_now) = frame(arrivals.direction[index]);
        aside_now * (level * tangent.dot(aside)) + above_now * (upright * tangent.dot(above))
    }

    /// log2 of what spreading leaves of the echo: of the way back alone, as the way there makes the footprint that the ray
    /// stands for. Levels do not rise within a metre of the sonar.
    #[inline(always)]
    fn spread(&self, arrivals: &Arrivals, index: usize) -> f32 {
        let path = log2(arrivals.path[index].max(1e-3));
        match self.spreading {
            Spreading::RayTube => {
                let [upright, level] = arrivals.tube[index];
                // At a caustic the tube is as wide as diffraction leaves it.
                let length = arrivals.path[index];
                let least = length.min((2.0 * length / self.turns).sqrt());
                log2(arrivals.speed[index]) - log2((upright.max(least) * level).max(1e-6)).abs()
            }
            Spreading::Spherical => -2.0 * path.abs(),
            Spreading::Practical => 2.0 * path - 3.0 * path.max(0.0),
            Spreading::Cylindrical => 2.0 * path - 2.0 * path.max(0.0),
            Spreading::Hybrid => {
                let from = log2(self.spreading_from);
                2.0 * path - 4.0 * path.clamp(0.0, from.max(0.0)) - 2.0 * (path - from.max(0.0)).max(0.0)
            }
        }
    }
}

impl Scatterers {
    /// Makes places some lattice cells wide louder or fainter.
    #[inline(never)]
    fn roughen(&self, place: [&[u32]; 3], energy: &mut [f32]) {
        /// Lattice cells, as a power of 2, along a side of a place of one texture: some range cells.
        const WIDE: u32 = 4;
        for part in 0..energy.len() {
            let address = place.map(|axis| ((axis[part] as i32) >> WIDE) as u32);
            let at = self.rng.uniform_at(address, Draw::Texture) * self.texture.len() as f32;
            energy[part] *= self.texture[at as usize];
        }
    }
}

/// A gamma distribution of mean 1 and this shape, cut into parts of even probability: the mean of each, rising.
pub(crate) fn texture(shape: f64) -> Arc<[f32]> {
    const PARTS: usize = 4096;
    const STEPS: usize = 400_000;
    // The density over the logarithm t of the number is e^(shape t - e^t): smooth, and nothing outside these ends.
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

/// Beams side by side that are heard together.
#[derive(Clone, Default)]
pub(crate) struct Tile {
    /// Beams of this tile: from `beams.0` to before `beams.1`.
    pub beams: (usize, usize),
    /// Sums by bin and beam: of amplitudes, or in `re` of energies without speckle.
    pub re: Vec<f32>,
    pub im: Vec<f32>,
    /// Energy of the strongest arrival of each cell, and which that is: see [`Tile::hear`].
    pub most: Vec<f32>,
    pub who: Vec<u32>,
    /// Energy times the angle beside the beam's axis, and energy; of swaths.
    pub lean: Vec<f32>,
    pub total: Vec<f32>,
    /// Solid angle that is still open at each bin, sr, less what is closed there.
    pub open: Vec<f32>,
}

/// No arrival.
pub(crate) const NOBODY: u32 = u32::MAX;

/// Arrivals of a chunk at most: their number goes into the lower bits of [`Tile::who`].
pub(crate) const CHUNK_BITS: u32 = 16;

/// What a tile finds out.
#[derive(Clone, Copy)]
pub(crate) struct Wants {
    /// Which arrival is the strongest of each cell.
    pub who: bool,
    /// Where in its beam an echo lies.
    pub lean: bool,
    /// How much of the water is still in sight.
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

    /// Adds what the beams hear of chunk number `chunk`.
    #[inline(always)]
    pub fn hear(&mut self, transducer: &Transducer, chunk: u32, echoes: &Echoes, bin_m: f32, wants: Wants) {
        let width = self.width();
        let bins = self.re.len() / width;
        for index in 0..echoes.arrivals.len() {
            let ray = echoes.arrivals.ray[index] as usize;
            let Hearing { first, from, to } = transducer.hearings[transducer.hearing[ray] as usize];
            let (first, last) = (first as usize, (first + to - from) as usize);
            let (low, high) = (first.max(self.beams.0), last.min(self.beams.1));
            if low >= high {
                continue;
            }
            let loudness = &transducer.loudness[from as usize + low - first..from as usize + high - first];
            let parts = echoes.first[index] as usize..echoes.first[index + 1] as usize;
            let who = chunk << CHUNK_BITS | index as u32;
            for (bin, part) in (echoes.bin[index] as usize..).zip(parts) {
                let start = bin * width + low - self.beams.0;
                let cells = start..start + loudness.len();
                if wants.speckle {
                    let (x, y) = (echoes.re[part], echoes.im[part]);
                    for (sum, &loud) in self.re[cells.clone()].iter_mut().zip(loudness) {
                        *sum += loud * x;
                    }
                    for (sum, &loud) in self.im[cells.clone()].iter_mut().zip(loudness) {
                        *sum += loud * y;
                    }
                } else {
                    let x = echoes.re[part];
                    for (sum, &loud) in self.re[cells.clone()].iter_mut().zip(loudness) {
                        *sum += loud * loud * x;
                    }
                }
                let energy = echoes.energy[part];
                if wants.who {
                    let most = &mut self.most[cells.clone()];
                    for ((most, is), &loud) in most.iter_mut().zip(&mut self.who[cells.clone()]).zip(loudness) {
                        let heard = loud * loud * energy;
                        let stronger = heard > *most;
                        *most = if stronger { heard } else { *most };
                        *is = if stronger { who } else { *is };
                    }
                }
                if wants.lean {
                    let beside = &transducer.beside[from as usize + low - first..from as usize + high - first];
                    let lean = self.lean[cells.clone()].iter_mut().zip(&mut self.total[cells]);
                    for ((lean, total), (&loud, &beside)) in lean.zip(loudness.iter().zip(beside)) {
                        let heard = loud * loud * energy;
                        *lean += heard * beside;
                        *total += heard;
                    }
                }
            }
            if wants.open && echoes.arrivals.order[index] == 0 {
                let bin = (echoes.range[index] / bin_m) as usize;
                if bin < bins {
                    let weight = exp2(transducer.weight[ray]);
                    let start = bin * width + low - self.beams.0;
                    for (open, &loud) in self.open[start..start + loudness.len()].iter_mut().zip(loudness) {
                        *open -= weight * loud * loud;
                    }
                }
            }
        }
    }
}
