//! How weather affects the beams of one scan: it dims what is behind it, and returns echoes of its own.

use super::particles::{Cone, Detectable};
use super::picked::Picked;
use super::pulse::{FaceEcho, Pulse};
use crate::medium::{Extent, Medium, Weather};
use echocast_kernels::math::exp_negative;
use echocast_kernels::random::GREATEST_NORMAL;
use echocast_kernels::{air, light};
use glam::Vec3;
use ground::cause::Cause;
use ground::lanes::{LANES, RayBatch};
use ground::rng::{Draw, Rng};
use std::f64::consts::PI;

/// Most particles drawn for one beam and medium.
const MOST_PARTICLES: u32 = 64;

/// One number in 30,000 is beyond this many standard deviations.
const MOST_SIGMAS: f32 = 4.0;

/// What rounding may add to the light of an echo, relative to it.
pub(crate) const LIGHT_ROUNDING: f32 = 1e-5;

/// `<r^4> / <r^2>` of the radii of droplets, m^2: the fluctuation of an echo of many particles at random positions is
/// `sqrt(<r^4> / <r^2>^2 / N)`, N = their mean number in the pulse. That of strong and moderate advection fog (17 and
/// 22 um squared; a gamma distribution has `(a + 4) (a + 3) r_mode^2 / a^2`), used for all droplets and dust.
const GRAIN_M2: f64 = 20e-6 * 20e-6;

/// What determines how weather affects an instrument.
#[derive(Clone, Debug)]
pub(crate) struct ReceiverOptics {
    pub pulse: Pulse,
    /// Range below which the receiver does not see its own beam, and range from which it sees all of it, m.
    pub overlap: [f64; 2],
    /// Range at which half of the light that reaches the aperture falls onto the detector, m; 0: all of it at any
    /// range.
    pub near_range: f64,
    /// Whether it mixes the echo with its own light, so that the echoes of many particles interfere.
    pub coherent: bool,
    pub cone: Cone,
    /// Least light that it ever detects, and its noise, where they are known, as `rho_eff / R^2` in 1/m^2.
    pub least_power: Option<f64>,
    pub noise_power: Option<f64>,
    /// Whether detection itself draws the noise, so that echoes do not vary with it.
    pub detects_in_noise: bool,
    pub range_min: f64,
    pub range_max: f64,
}

impl ReceiverOptics {
    /// Fraction of the light from `range` m that the receiver uses, 0..1: what it sees of the beam, and what falls onto
    /// the detector. Optics with the aperture D that are focused far away image a near point as a disc; seen from the
    /// aperture it is `D / R` wide, of which the detector covers its field of view `theta`: `(theta R / D)^2` when
    /// near, all when far, `1 / (1 + (R0 / R)^2)` with `R0 = D / theta` in between (near-range effect: Hoefle and
    /// Pfeifer 2007; telescope effect: Fang et al. 2014).
    ///
    /// It dims only the air: surfaces that near are far above every threshold, and calibrated intensities compensate
    /// for it.
    fn sees(&self, range: f64) -> f64 {
        let [from, to] = self.overlap;
        let overlap = if range >= to { 1.0 } else { ((range - from) / (to - from)).max(0.0) };
        overlap * range * range / self.spread(range)
    }

    /// Light falls with range as one over this, m^2, where the receiver sees all of its beam.
    fn spread(&self, range: f64) -> f64 {
        (range * range + self.near_range * self.near_range).max(1e-12)
    }

    /// How an echo from `range` m with the mean `power`, 1/m^2, of droplets with an `extinction`, 1/m, varies from beam
    /// to beam: with their number and sizes, `GRAIN_M2`, where each has an extinction cross-section of 2 pi r^2, and
    /// with the receiver's noise. A coherent receiver has speckle in addition; with a laser diode, whose light is
    /// coherent over less than a millimetre, it averages out over thousands of speckles in a pulse.
    fn fluctuation(&self, extinction: f64, range: f64, power: f64) -> Fluctuation {
        let droplets = self.graininess(extinction, range);
        let noise = self.noise_power.map_or(0.0, |noise| noise / power.max(1e-30));
        let speckle = if self.coherent { 1.0 } else { 0.0 };
        Fluctuation {
            strength: if self.detects_in_noise { droplets } else { (droplets * droplets + noise * noise).sqrt() }
                as f32,
            all: (droplets * droplets + noise * noise + speckle).sqrt(),
        }
    }

    /// The share of the droplets in that, relative to the mean, 1 at most; it falls with range.
    fn graininess(&self, extinction: f64, range: f64) -> f64 {
        let volume = PI / 4.0 * self.cone.square(range) * self.pulse.width;
        (2.0 * PI * GRAIN_M2 / (extinction * volume).max(1e-30)).min(1.0).sqrt()
    }
}

/// How a soft echo varies from beam to beam: standard deviations relative to its mean strength.
struct Fluctuation {
    /// Of its strength, without speckle and without noise that detection already includes.
    strength: f32,
    /// Of all contributions together.
    all: f64,
}

/// A soft echo of all beams that reach beyond it, slightly different for each.
#[derive(Clone, Copy, Debug)]
struct SoftEcho {
    /// Mean range, m.
    range: f32,
    /// Mean strength, as `rho_eff / R^2` in 1/m^2.
    power: f32,
    cause: Cause,
    /// Range at which its medium begins, m.
    from: f32,
    /// Relative standard deviation of its strength.
    fluctuation: f32,
    /// Standard deviation of its range, m.
    wandering: f32,
}

/// An echo of the air.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AirEcho {
    /// Range, m.
    pub range: f32,
    /// Its strength, as the effective reflectance of a surface there that fills the beam.
    pub rho_eff: f32,
}

/// A sink for the echoes of the air.
pub(crate) trait AirEchoes {
    /// Range at which surfaces end the view of the air, m, lane by lane.
    fn end(&self) -> &[f32; LANES];

    /// Light, as `rho_eff / R^2` in 1/m^2, that an echo must exceed to matter, lane by lane; infinite where none does.
    fn least(&self) -> &[f32; LANES];

    /// Takes `echo`; returns whether the instrument detects it.
    fn take(&mut self, lane: usize, echo: AirEcho, cause: Cause) -> bool;
}

/// In which order the particles in a beam are drawn, so that those that do not matter need not be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ParticleOrder {
    /// The strongest first.
    Strength,
    /// The nearest first.
    Range,
    /// The nearest first, until one is detected.
    FirstOnly,
}

/// A medium with an extent in the world.
#[derive(Debug)]
struct MediumInPlace {
    /// Its index among the media of the weather.
    index: usize,
    extent: Extent,
    extinction: f32,
    backscatter: f32,
    cause: Cause,
    /// Distance of the peak behind a face in [`Air::near`], m, and its height `J`, 1/m.
    near: [[f32; 2]; NEAR],
}

/// Number of faces in a table of those near the sensor.
const NEAR: usize = 9;

/// Drops or flakes.
#[derive(Debug)]
struct Flying {
    extent: Extent,
    cause: Cause,
    draw: Draw,
    /// First sub-ray number of its draws.
    address: u32,
    seen: Detectable,
    /// Probability that a beam hits one or more.
    some: f32,
}

/// Weather prepared for scans.
#[derive(Debug)]
pub(crate) struct Air {
    weather: Weather,
    around: Vec<SoftEcho>,
    placed: Vec<MediumInPlace>,
    flying: Vec<Flying>,
    receiver: ReceiverOptics,
    order: ParticleOrder,
    /// Least and greatest range of faces too near to be treated as distant, m.
    near: [f64; 2],
    /// Whether any weather has an extent in the world.
    in_places: bool,
}

impl Air {
    /// None if there is nothing in the air. `has_echoes`: whether to find echoes of the air.
    pub fn new(weather: Weather, receiver: ReceiverOptics, order: ParticleOrder, has_echoes: bool) -> Option<Air> {
        if weather.media.is_empty() {
            return None;
        }
        let [from, to] = receiver.overlap;
        let near = [from.max(1e-2), to + 4.0 * receiver.pulse.width];
        let in_places = weather.media.iter().any(|medium| !medium.extent.is_around_the_sensor());
        let (around, placed, flying) = Default::default();
        let mut air = Air { weather, around, placed, flying, receiver, order, near, in_places };
        if has_echoes {
            air.find_echoes();
        }
        Some(air)
    }

    fn find_echoes(&mut self) {
        let receiver = self.receiver.clone();
        let ReceiverOptics { pulse, cone, range_max, .. } = receiver;
        let transmittance = |range: f64| (-2.0 * self.weather.depth_around_the_sensor(range)).exp();
        let farthest = range_max.min(1e4);
        // Media that are everywhere return one echo; the strongest of them is its cause.
        let everywhere = || self.weather.media.iter().filter(|medium| matches!(medium.extent, Extent::Everywhere));
        let strongest = everywhere().max_by(|a, b| a.backscatter.total_cmp(&b.backscatter)).map(|medium| medium.cause);
        let together = everywhere()
            .filter(|medium| medium.backscatter > 0.0)
            .fold([0.0; 2], |sum, medium| [sum[0] + medium.extinction, sum[1] + medium.backscatter]);
        let around = (strongest.map(|cause| ([receiver.overlap[0], farthest], together, cause)).into_iter()).chain(
            self.weather.media.iter().filter_map(|medium| match medium.extent {
                Extent::Shell { start, end } => {
                    let both = [medium.extinction, medium.backscatter];
                    Some(([start.into(), f64::from(end).min(farthest)], both, medium.cause))
                }
                _ => None,
            }),
        );
        for ([from, to], [extinction, backscatter], cause) in around {
            if backscatter > 0.0 && pulse.width > 0.0 && from < to {
                let density = |r: f64| receiver.sees(r) * transmittance(r) / (r * r).max(1e-12);
                let falls_from = from.max(receiver.overlap[1]);
                let peak = pulse.peak([from, to], falls_from, density);
                let power = PI * backscatter * peak.height;
                let Fluctuation { strength, all } = receiver.fluctuation(extinction, peak.range, power);
                self.around.push(SoftEcho {
                    range: peak.range as f32,
                    power: power as f32,
                    cause,
                    from: from as f32,
                    fluctuation: strength,
                    wandering: peak.wandering(all, pulse.sigma()) as f32,
                });
            }
        }
        for (index, medium) in self.weather.media.iter().enumerate() {
            if medium.backscatter > 0.0 && pulse.width > 0.0 && !medium.extent.is_around_the_sensor() {
                let [first, last] = self.near;
                let near = std::array::from_fn(|row| {
                    let from = first + (last - first) * row as f64 / (NEAR - 1) as f64;
                    let density = |r: f64| receiver.sees(r) * (-2.0 * medium.extinction * (r - from)).exp() / (r * r);
                    let peak = pulse.peak([from, from + 1e3], from.max(receiver.overlap[1]), density);
                    [(peak.range - from) as f32, peak.height as f32]
                });
                self.placed.push(MediumInPlace {
                    index,
                    extent: medium.extent,
                    extinction: medium.extinction as f32,
                    backscatter: medium.backscatter as f32,
                    cause: medium.cause,
                    near,
                });
            }
            // Without a threshold every particle would be detected, and the nearest would hide everything else.
            let (Some(particles), Some(k)) = (&medium.particles, receiver.least_power) else { continue };
            let [from, to] = match medium.extent {
                Extent::Shell { start, end } => [start.into(), f64::from(end).min(farthest)],
                _ => [0.0, farthest],
            };
            let from = from.max(receiver.overlap[0]).max(receiver.range_min);
            if from < to {
                let gain = |range: f64| receiver.sees(range) * transmittance(range);
                let seen = Detectable::new(particles, cone, [from, to], gain, k);
                let draw = if medium.cause == Cause::Snow { Draw::Flakes } else { Draw::Drops };
                // Counted within the kind, so that other weather does not shift it.
                let before = self.flying.iter().filter(|flying| flying.draw == draw).count();
                let address = before as u32 * MOST_PARTICLES;
                let some = 1.0 - (-seen.mean()).exp();
                self.flying.push(Flying { extent: medium.extent, cause: medium.cause, draw, address, seen, some });
            }
        }
    }

    /// Whether beams may have echoes where there is no surface.
    pub(crate) fn has_echoes(&self) -> bool {
        !(self.around.is_empty() && self.placed.is_empty() && self.flying.is_empty())
    }

    /// Standard deviation of ranges relative to range, due to rain.
    pub(crate) fn range_noise(&self) -> f32 {
        self.weather.range_noise
    }

    /// Optical depth, one way, of `length` m from `origin` on; `travelled`: the beam's path up to there, m.
    pub fn depth(&self, origin: Vec3, direction: Vec3, travelled: f32, length: f32) -> f32 {
        self.weather.media.iter().map(|medium| medium.depth(origin, direction, travelled, length)).sum()
    }

    /// Optical depth, one way, of the first `length` m of a beam in media with an extent in the world.
    fn depth_in_places(&self, origin: Vec3, direction: Vec3, length: f32) -> f32 {
        let placed = self.weather.media.iter().filter(|medium| !medium.extent.is_around_the_sensor());
        placed.map(|medium| medium.depth(origin, direction, 0.0, length)).sum()
    }

    /// Two-way transmittance of the first `length` m of the first `count` rays, which start at the sensor.
    pub fn dim(&self, rays: &RayBatch, length: &[f32; LANES], count: usize, two_way: &mut [f32; LANES]) {
        self.depths(rays, length, count, None, two_way);
        light::transmit(two_way);
    }

    /// Optical depth, one way, of the first `length` m of the first `count` rays, which start at the sensor. `within`:
    /// the medium that they are in at the end of that, and where they enter it, m, if that is known; of other rays the
    /// depth is meaningless then.
    fn depths(
        &self,
        rays: &RayBatch,
        length: &[f32; LANES],
        count: usize,
        within: Option<(usize, &[f32; LANES])>,
        depth: &mut [f32; LANES],
    ) {
        depth.fill(0.0);
        for (index, medium) in self.weather.media.iter().enumerate() {
            let extinction = medium.extinction as f32;
            match medium.extent {
                _ if let Some((own, from)) = within
                    && own == index =>
                {
                    light::add_depth_between(extinction, from, length, depth);
                }
                Extent::Everywhere => light::add_depth_all_over(extinction, length, depth),
                Extent::Shell { start, end } => light::add_depth(extinction, start, end, length, depth),
                _ => {
                    let [from, to] = intervals(&medium.extent, rays, length, count);
                    light::add_depth_between(extinction, &from, &to, depth);
                }
            }
        }
    }

    /// Passes the echoes of the air along `rays`, one ray for each of `beams`, to `echoes`.
    pub fn echoes(&self, rays: &RayBatch, rng: &Rng, beams: &[u32], echoes: &mut impl AirEchoes) {
        let merging = self.receiver.pulse.merging_distance() as f32;
        let least_power = self.receiver.least_power.unwrap_or(0.0) as f32;
        for (index, soft) in self.around.iter().enumerate() {
            if soft.power * (1.0 + MOST_SIGMAS * soft.fluctuation) * self.most_speckle() < least_power {
                continue;
            }
            let most = soft.power * (1.0 + GREATEST_NORMAL * soft.fluctuation) * self.greatest_speckle();
            let picked = Picked::exceeding(&[most * (1.0 + LIGHT_ROUNDING); LANES], echoes.least(), beams.len());
            let [stronger, farther, speckle] = self.differ(rng, picked.take(beams, &mut [0; LANES]), index);
            for (place, lane) in picked.lanes() {
                // Never from in front of the medium.
                let range = soft.from + (soft.range + soft.wandering * farther[place] - soft.from).abs();
                let strength = speckle[place] * (1.0 + soft.fluctuation * stronger[place]);
                let rho_eff = soft.power * strength * range * range;
                // A surface within the pulse hides it, and nothing is seen behind a surface.
                if rho_eff > 0.0 && range + merging <= echoes.end()[lane] {
                    echoes.take(lane, AirEcho { range, rho_eff }, soft.cause);
                }
            }
        }
        for index in 0..self.placed.len() {
            self.echoes_of_faces(index, rays, rng, beams, echoes);
        }
        for flying in &self.flying {
            self.echoes_of_particles(flying, rays, rng, beams, echoes);
        }
    }

    /// A surface at `range` m whose reflectivity is `rho_eff` and must exceed `limit`, as computed by the paper's
    /// program: the reflectivity that it tests, and the range and intensity of a dust cloud that it reports instead. It
    /// adds for rain where it should multiply, and compares the backscatter of dust with a reflectivity.
    pub(crate) fn as_the_program(&self, range: f32, rho_eff: f32, limit: f32) -> (f32, Option<(f32, f32)>) {
        let depth = |medium: &Medium, length: f32| 2.0 * medium.extinction as f32 * length;
        let rain = |medium: &&Medium| medium.cause == Cause::Rain;
        let wet: f32 = self.weather.media.iter().filter(rain).map(|medium| depth(medium, range)).sum();
        let left = rho_eff + exp_negative(wet) - 1.0;
        let mut dry = 0.0;
        for medium in self.weather.media.iter().filter(|medium| !rain(medium)) {
            match medium.extent {
                Extent::Shell { start, end } if range >= start => {
                    if medium.cause == Cause::Dust && medium.backscatter as f32 > limit {
                        return (left, Some((start, medium.backscatter as f32)));
                    }
                    dry += depth(medium, range.min(end) - start);
                }
                Extent::Everywhere => dry += depth(medium, range),
                // The program has no other regions.
                _ => {}
            }
        }
        (left * exp_negative(dry), None)
    }

    /// How soft echo `index` of each of `beams` differs from its mean: two standard normal numbers, for its strength
    /// and its range, and its speckle, with mean 1.
    fn differ(&self, rng: &Rng, beams: &[u32], index: usize) -> [[f32; LANES]; 3] {
        let count = beams.len();
        let [mut stronger, mut farther, mut speckle] = [[0.0; LANES], [0.0; LANES], [1.0; LANES]];
        let address = |number: u32| [2 * index as u32 + number; LANES];
        rng.normal_pairs(beams, &address(0)[..count], Draw::SoftEcho, &mut stronger[..count], &mut farther[..count]);
        if self.receiver.coherent {
            // The sum of many echoes of random phases.
            rng.uniforms(beams, &address(1)[..count], Draw::SoftEcho, &mut speckle[..count]);
            speckle[..count].iter_mut().for_each(|chance| *chance = exponential(*chance));
        }
        [stronger, farther, speckle]
    }

    /// Ratio to the mean that one speckle in 30,000 exceeds.
    fn most_speckle(&self) -> f32 {
        if self.receiver.coherent { 10.3 } else { 1.0 }
    }

    /// Ratio to the mean that none exceeds: an exponential number from 24 bits is at most ln 2^24 = 16.6356.
    fn greatest_speckle(&self) -> f32 {
        if self.receiver.coherent { 16.636 } else { 1.0 }
    }

    /// Echoes of the face of the medium with an extent in the world that is number `index` of them.
    fn echoes_of_faces(&self, index: usize, rays: &RayBatch, rng: &Rng, beams: &[u32], echoes: &mut impl AirEchoes) {
        let medium = &self.placed[index];
        let sigma = self.receiver.pulse.sigma() as f32;
        let merging = self.receiver.pulse.merging_distance() as f32;
        let [entered, mut to] = intervals(&medium.extent, rays, echoes.end(), beams.len());
        let mut from = entered.map(|from| from.max(self.near[0] as f32));
        let mut picked = Picked::exceeding(&to, &from, beams.len());
        if picked.count == 0 {
            return;
        }
        let (mut depth, mut end, mut least) = ([0.0; LANES], *echoes.end(), *echoes.least());
        self.depths(rays, &from, beams.len(), Some((medium.index, &entered)), &mut depth);
        for column in [&mut from, &mut to, &mut depth, &mut end, &mut least] {
            picked.compact(column);
        }
        let (mut behind, mut height) = ([0.0; LANES], [0.0; LANES]);
        self.peaks(medium, &from, picked.count, [&mut behind, &mut height]);
        let (mut range, mut rho_eff) = ([0.0; LANES], [0.0; LANES]);
        let scale = PI as f32 * medium.backscatter;
        air::face_echoes(scale, &from, &to, &depth, &behind, &height, picked.count, &mut range, &mut rho_eff);

        // Most echoes are weaker than the surface behind them, however they vary.
        let nearest = range[..picked.count].iter().copied().fold(f32::INFINITY, f32::min);
        let grain = 1.0 + GREATEST_NORMAL * self.receiver.graininess(medium.extinction.into(), nearest.into()) as f32;
        let noise = GREATEST_NORMAL * self.receiver.noise_power.unwrap_or(0.0) as f32;
        let most_speckle = self.greatest_speckle() * (1.0 + LIGHT_ROUNDING);
        let mut most = [0.0; LANES];
        for place in 0..LANES {
            let square = range[place] * range[place];
            let foremost = (range[place] - behind[place].abs()).max(0.0);
            let power = (rho_eff[place] * grain + noise * square) / (foremost * foremost) * most_speckle;
            let is_seen = height[place] > 0.0 && range[place] + merging <= end[place];
            most[place] = if is_seen { power } else { 0.0 };
        }
        let strong = picked.narrow(&most, &least);
        for column in [&mut range, &mut rho_eff, &mut behind, &mut end] {
            strong.compact(column);
        }

        // The face is sharp, so the range of an echo fluctuates as much as its strength, in sigmas of the pulse.
        let mut numbers = [0; LANES];
        let beams = picked.take(beams, &mut numbers);
        let [stronger, farther, speckle] = self.differ(rng, beams, self.around.len() + index);
        for (place, lane) in picked.lanes() {
            let power = f64::from(rho_eff[place] / (range[place] * range[place]));
            let Fluctuation { strength, all } =
                self.receiver.fluctuation(medium.extinction.into(), range[place].into(), power);
            // Not far in front of the face.
            let most = behind[place].abs();
            let wandering = ((all as f32).min(1.0) * sigma * farther[place]).max(-most).min(most);
            let rho_eff = rho_eff[place] * speckle[place] * (1.0 + strength * stronger[place]);
            let range = range[place] + wandering;
            if rho_eff > 0.0 && range + merging <= end[place] {
                echoes.take(lane, AirEcho { range, rho_eff }, medium.cause);
            }
        }
    }

    /// How far behind the first `count` faces of `medium`, which are at `from` m, the peaks of their echoes are, m, and
    /// their height, 1/m.
    fn peaks(
        &self,
        medium: &MediumInPlace,
        from: &[f32; LANES],
        count: usize,
        [behind, height]: [&mut [f32; LANES]; 2],
    ) {
        let near_range_2 = (self.receiver.near_range * self.receiver.near_range) as f32;
        let sigma = self.receiver.pulse.sigma() as f32;
        FaceEcho::get().peaks([sigma, medium.extinction, near_range_2], from, count, [behind, height]);
        let [first, last] = self.near.map(|range| range as f32);
        for place in 0..count {
            if from[place] < last {
                let at = (from[place] - first) / (last - first) * (NEAR - 1) as f32;
                let row = (at as usize).min(NEAR - 2);
                let part = at - row as f32;
                let [a, b] = [medium.near[row], medium.near[row + 1]];
                [behind[place], height[place]] = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * part);
            }
        }
    }

    /// Echoes of drops or flakes: particle after particle, side by side in all beams that more may matter to.
    fn echoes_of_particles(
        &self,
        flying: &Flying,
        rays: &RayBatch,
        rng: &Rng,
        beams: &[u32],
        echoes: &mut impl AirEchoes,
    ) {
        let count = beams.len();
        let by_range = self.order != ParticleOrder::Strength;
        // In each beam, the mean number up to its last particle, and the chance of the next one, from which the number
        // between both is drawn.
        let (mut number, mut chance) = ([0.0; LANES], [0.0; LANES]);
        rng.uniforms(beams, &[flying.address; LANES][..count], flying.draw, &mut chance[..count]);
        let mut picked = Picked::exceeding(&[flying.some; LANES], &chance, count);
        if picked.count == 0 {
            return;
        }
        picked.compact(&mut chance);
        let [from, to] = intervals(&flying.extent, rays, echoes.end(), count);
        let mut most = [flying.seen.mean(); LANES];
        let [mut least, mut low, mut place, mut range, mut rho_eff] = [[0.0; LANES]; 5];
        let mut strength = [f32::MAX; LANES];
        for particle in 1..MOST_PARTICLES {
            if !by_range {
                picked.take(echoes.least(), &mut least);
                flying.seen.stronger(&least, picked.count, &mut most);
            }
            // An exponential number is greater than the chance that it is drawn from.
            for index in 0..LANES {
                low[index] = number[index] + chance[index];
            }
            let kept = picked.narrow(&most, &low);
            let count = picked.count;
            if count == 0 {
                break;
            }
            kept.compact(&mut number);
            kept.compact(&mut chance);
            for index in 0..count {
                number[index] += exponential(chance[index]);
            }
            let mut numbers = [0; LANES];
            let beams = picked.take(beams, &mut numbers);
            let address = [flying.address + particle; LANES];
            rng.uniform_pairs(beams, &address[..count], flying.draw, &mut place[..count], &mut chance[..count]);
            if by_range {
                for index in 0..count {
                    range[index] = flying.seen.nearest(number[index]);
                    rho_eff[index] = flying.seen.brightness(range[index], place[index]);
                }
            } else {
                flying.seen.strongest(&number, count, &mut strength);
                flying.seen.places(&strength, &place, count, &mut range);
                for index in 0..count {
                    rho_eff[index] = strength[index] * range[index] * range[index];
                }
            }
            for (index, lane) in picked.lanes() {
                let mut echo = AirEcho { range: range[index], rho_eff: rho_eff[index] };
                // In order of strength all subsequent ones are weaker, and in order of range farther.
                let mut ends = number[index] >= flying.seen.mean()
                    || strength[index] <= echoes.least()[lane]
                    || by_range && echo.range >= to[lane];
                if !ends && (from[lane]..to[lane]).contains(&echo.range) {
                    // Weather with an extent in the world is not in the table: it removes some of the particles again.
                    if self.in_places {
                        let depth = self.depth_in_places(rays.origin(lane), rays.direction(lane), echo.range);
                        echo.rho_eff *= exp_negative(2.0 * depth);
                    }
                    let is_detected = echoes.take(lane, echo, flying.cause);
                    ends = is_detected && self.order == ParticleOrder::FirstOnly;
                }
                if ends {
                    number[index] = f32::INFINITY;
                }
            }
        }
    }
}

/// [`Extent::interval`] of each of the first `count` rays, which start at the sensor, up to its `length` m; boxes side
/// by side.
fn intervals(extent: &Extent, rays: &RayBatch, length: &[f32; LANES], count: usize) -> [[f32; LANES]; 2] {
    let (mut from, mut to) = ([0.0f32; LANES], *length);
    match extent {
        Extent::Everywhere => {}
        Extent::Box { min, max } => {
            light::cross_box(min.to_array(), max.to_array(), rays.origins(), rays.directions(), &mut from, &mut to);
        }
        _ => {
            for lane in 0..count {
                (from[lane], to[lane]) = extent.interval(rays.origin(lane), rays.direction(lane), 0.0, length[lane]);
            }
        }
    }
    [from, to]
}

/// An exponential number of mean 1 from one in [0, 1).
fn exponential(uniform: f32) -> f32 {
    -(1.0 - uniform).ln()
}

#[cfg(test)]
mod tests {
    use super::super::PulseShape;
    use super::*;
    use crate::medium::Environment;
    use glam::DVec3;
    use std::collections::BTreeSet;

    /// Takes all echoes: lane, cause, and the bits of range and strength.
    struct TakenEchoes {
        end: [f32; LANES],
        least: [f32; LANES],
        taken: BTreeSet<(usize, u8, [u32; 2])>,
    }

    impl AirEchoes for TakenEchoes {
        fn end(&self) -> &[f32; LANES] {
            &self.end
        }

        fn least(&self) -> &[f32; LANES] {
            &self.least
        }

        fn take(&mut self, lane: usize, echo: AirEcho, cause: Cause) -> bool {
            assert!((0.0..self.end[lane]).contains(&echo.range));
            self.taken.insert((lane, cause as u8, [echo.range, echo.rho_eff].map(f32::to_bits)));
            true
        }
    }

    impl TakenEchoes {
        /// The echoes that `air` returns along rays in all directions, of which all but `matters` are left out.
        fn of(air: &Air, beams: &[u32], matters: bool) -> TakenEchoes {
            let mut rays = RayBatch::default();
            let (mut end, mut least) = ([f32::INFINITY; LANES], [0.0; LANES]);
            for lane in 0..beams.len() {
                let turn = lane as f32 * 0.77;
                let direction = Vec3::new(turn.cos(), (1.7 * turn).sin(), 0.5 * (0.3 * turn).sin()).normalize();
                (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = direction.into();
                if lane % 3 > 0 {
                    end[lane] = 3.0 + 0.4 * lane as f32;
                    least[lane] = if matters { 1e-7 * 1.06f32.powi(lane as i32) } else { 0.0 };
                }
            }
            let mut log = TakenEchoes { end, least, taken: BTreeSet::new() };
            air.echoes(&rays, &Rng::new(5, 1), beams, &mut log);
            log
        }

        fn power([range, rho_eff]: [u32; 2]) -> f32 {
            f32::from_bits(rho_eff) / f32::from_bits(range).powi(2)
        }
    }

    fn air(yaml: &str, order: ParticleOrder, coherent: bool) -> Air {
        let weather = Weather::new(&Environment::from_yaml(yaml).unwrap(), 905.0, false, DVec3::ZERO);
        let receiver = ReceiverOptics {
            pulse: Pulse::new(PulseShape::Gaussian, 5.0),
            overlap: [0.5, 2.0],
            near_range: 3.0,
            coherent,
            cone: Cone { start: 0.012, divergence: [3e-3, 1.5e-3] },
            least_power: Some(2e-7),
            noise_power: Some(4e-8),
            detects_in_noise: false,
            range_min: 0.5,
            range_max: 200.0,
        };
        Air::new(weather, receiver, order, true).unwrap()
    }

    /// What is not drawn because a surface outshines it: the echoes that matter are those of beams without surfaces, bit
    /// for bit.
    #[test]
    fn what_matters_does_not_depend_on_what_is_left_out() {
        let yaml = "{snow: [{rate_mm_h: 2}, {rate_mm_h: 5, box: {min_m: [3, -9, -9], max_m: [9, 9, 9]}}], fog: \
                    {visibility_m: 300, half_space: {point_m: [0, 0, 1], normal: [0, 0, -1]}}, dust: [{radius_um: 50, \
                    per_m3: 1e6, start_m: 4, length_m: 5}, {radius_um: 50, per_m3: 1e6, box: {min_m: [-9, -9, -9], \
                    max_m: [-2, 9, 9]}}]}";
        let beams: Vec<u32> = (1000..1250).collect();
        for coherent in [false, true] {
            for order in [ParticleOrder::Strength, ParticleOrder::Range, ParticleOrder::FirstOnly] {
                let air = air(yaml, order, coherent);
                let [all, some] = [false, true].map(|matters| TakenEchoes::of(&air, &beams, matters));
                assert!(some.taken.is_subset(&all.taken));
                for &(lane, cause, echo) in all.taken.difference(&some.taken) {
                    assert!(TakenEchoes::power(echo) <= some.least[lane], "{order:?} {lane} {cause}");
                }
                for cause in [Cause::Snow, Cause::Fog, Cause::Dust].map(|cause| cause as u8) {
                    let count = |log: &TakenEchoes| log.taken.iter().filter(|echo| echo.1 == cause).count();
                    let fewer = cause != Cause::Snow as u8 || order == ParticleOrder::Strength;
                    assert!(count(&some) > 10 && (count(&some) < count(&all)) == fewer, "{order:?} {cause}");
                }
            }
        }
    }

    /// Particles side by side, those that matter, are the ones that are drawn beam by beam and one by one.
    #[test]
    fn particles_are_those_drawn_one_by_one() {
        let beams: Vec<u32> = (0..200).map(|lane| 7 * lane).collect();
        let air = air("{snow: {rate_mm_h: 2}}", ParticleOrder::Strength, false);
        let found = TakenEchoes::of(&air, &beams, true);
        let (seen, rng) = (&air.flying[0].seen, Rng::new(5, 1));
        let mut expected = BTreeSet::new();
        for (lane, &beam) in beams.iter().enumerate() {
            let mut number = exponential(rng.four(beam, Draw::Flakes, 0)[0]);
            for particle in 1..MOST_PARTICLES {
                let [place, next, ..] = rng.four(beam, Draw::Flakes, particle);
                let (mut strength, mut range) = ([0.0; LANES], [0.0; LANES]);
                seen.strongest(&[number; LANES], 1, &mut strength);
                seen.places(&strength, &[place; LANES], 1, &mut range);
                if number >= seen.mean() || strength[0] <= found.least[lane] {
                    break;
                }
                if range[0] < found.end[lane] {
                    let echo = [range[0], strength[0] * range[0] * range[0]];
                    expected.insert((lane, Cause::Snow as u8, echo.map(f32::to_bits)));
                }
                number += exponential(next);
            }
        }
        assert!(expected.len() > 200, "{}", expected.len());
        assert_eq!(found.taken, expected);
    }

    /// Boxes side by side give the same as one by one: inside, outside and along their faces.
    #[test]
    fn boxes_are_intersected_side_by_side() {
        let extent = Extent::Box { min: Vec3::new(1.0, -2.0, 0.5), max: Vec3::new(4.0, 3.0, 2.0) };
        let mut rays = RayBatch::default();
        let length = std::array::from_fn(|lane| [3.0, f32::INFINITY][lane % 2]);
        for lane in 0..LANES {
            let turn = lane as f32 * 0.77;
            rays.org_x[lane] = if lane % 16 == 1 { 4.0 } else { 5.0 * turn.sin() };
            (rays.org_y[lane], rays.org_z[lane]) = (4.0 * (1.3 * turn).cos(), 1.0 + (2.1 * turn).sin());
            let direction = match lane % 8 {
                0 => Vec3::X,
                1 => -Vec3::Y,
                2 => Vec3::new(0.6, 0.0, -0.8),
                _ => Vec3::new(turn.cos(), (3.0 * turn).sin(), (0.7 * turn).cos()).normalize(),
            };
            (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = direction.into();
        }
        let [from, to] = intervals(&extent, &rays, &length, LANES);
        let mut within = 0;
        for lane in 0..LANES {
            let (near, far) = extent.interval(rays.origin(lane), rays.direction(lane), 0.0, length[lane]);
            assert_eq!(from[lane] < to[lane], near < far, "{lane}");
            if near < far {
                within += 1;
                assert!((from[lane] - near).abs() < 1e-5 && (to[lane] - far).abs() < 1e-5, "{lane}");
            }
        }
        assert!((20..236).contains(&within), "{within}");
    }

    #[test]
    fn the_exponential_follows_its_function() {
        for i in 0..100_000 {
            let x = i as f32 * 1e-3;
            let (found, expected) = (f64::from(exp_negative(x)), (-f64::from(x)).exp());
            let close = (found / expected - 1.0).abs() < 3e-7 || (x >= 87.0 && found == 0.0);
            assert!(close, "{x}: {found} {expected}");
        }
        assert_eq!(exp_negative(f32::INFINITY), 0.0);
    }
}
