//! From the hits of sound rays to what the beams of a sonar receive in each range bin.
//!
//! Each ray represents a cell of directions; the patch of surface that it covers returns energy over a stretch of
//! range, which is divided among the bins that it overlaps. So a bin's energy depends neither on the mesh nor on the
//! number of rays.

use super::coupling::Coupling;
use super::echo::{Echo, NO_RAY, PingEcho, Received};
use super::echoes::Echoes;
use super::parts::{Scatter, Scatterers, WaitingParts};
use super::response::Response;
use crate::medium::Spreading;
use crate::trace::{Arrival, Backscatter, Direct, Surfaces};
use echocast_kernels::echo::{self, WAYS, Ways};
use emitter::{FAINT, Transducer};
use glam::{Mat3, Quat, Vec3};
use ground::lanes::MEDIUM;
use ground::math::{LOG2_PER_DB, exp2, log2};
use ground::rng::Draw;
use std::f32::consts::TAU;

/// Most bins that the cell of one ray is divided among.
pub(super) const MOST_BINS: f32 = 256.0;

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
    /// Motion of the sonar during the travel time.
    pub drift: Option<Drift>,
    /// Response of pulse and receiver to an echo.
    pub response: &'a Response,
    /// Which objects have tubes of their own; empty: none.
    pub covered: &'a [bool],
    /// Effect of motion on ranges; `None`: none, as nothing moves, or no frequency is swept.
    pub coupling: Option<Coupling<'a>>,
}

/// Motion of the sonar during the travel time, per metre of one-way range.
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

    /// Direction from which an echo of a one-way range returns, given its unit `direction` in the sensor frame at
    /// transmission.
    fn seen(&self, range: f32, direction: Vec3) -> Vec3 {
        // Seen from the sonar, the world turns the other way.
        Quat::from_scaled_axis(-range * self.turned) * direction
    }
}

impl Insonification<'_> {
    /// Computes the echoes of `echoes.arrivals`, also those along the paths of `echoes.direct`.
    pub fn answer(&self, echoes: &mut Echoes) {
        let Echoes { arrivals, direct, launches, answers, energy, re, im, .. } = echoes;
        answers.clear();
        launches.clear();
        [&mut *energy, re, im].into_iter().for_each(Vec::clear);
        let mut parts = WaitingParts::new(energy, re, im);
        let mut ways = Ways::default();
        for block in arrivals.chunks(WAYS) {
            for (lane, arrival) in block.iter().enumerate() {
                self.take(&mut ways, lane, [arrival, arrival], arrival.loss);
            }
            self.weigh(&mut ways, block.iter().all(|arrival| arrival.order == 0), true);
            let mut received = [Received { at: 0.0, gain_log2: 0.0, receiving: 0 }; WAYS];
            for (lane, (arrival, received)) in block.iter().zip(&mut received).enumerate() {
                let ray = arrival.ray as usize;
                *received = Received { at: arrival.range, gain_log2: 0.0, receiving: self.transducer.receiving[ray] };
                if let Some(drift) = &self.drift {
                    *received = self.received_later(drift, ray, arrival.range, self.launch(ray));
                }
                if let Some(coupling) = &self.coupling {
                    received.at += coupling.shift(arrival, self.launch(ray));
                }
                ways.beam_gain[lane] += received.gain_log2 + self.backscatter.constant_log2(self.surfaces, arrival);
            }
            let mut powers = ways.beam_gain;
            echo::powers(&mut powers);
            for (lane, (arrival, &received)) in block.iter().zip(&received).enumerate() {
                // After reflections the arrivals include those that are in range only along the direct path back.
                let in_reach = arrival.order == 0 || arrival.range <= self.farthest;
                let is_received = in_reach && !self.is_traced_separately(arrival);
                let power = is_received.then_some(powers[lane]);
                let (reach, slide) = reach(&ways, lane);
                answers.push(self.divide(arrival, Echo { power, received, reach, slide, way: 0 }, &mut parts));
            }
        }
        self.answer_mixed(arrivals, direct, launches, answers, (&mut ways, &mut parts));
        parts.finish(self.speckle.as_ref());
    }

    /// Writes an arrival along the path `out`, whose echo returns along `back`, with a `loss` each way, dB, into a
    /// lane. Its `beam_gain` does not yet include the law of the surface and spreading.
    pub(super) fn take(&self, ways: &mut Ways, lane: usize, [out, back]: [&Arrival; 2], loss: f32) {
        let Transducer { direction, tangent, cell, aside, weight, .. } = self.transducer;
        let ray = out.ray as usize;
        for axis in 0..3 {
            ways.direction[axis][lane] = out.direction[axis];
            ways.back[axis][lane] = back.direction[axis];
            ways.normal[axis][lane] = out.normal[axis];
            ways.launch[axis][lane] = direction[axis][ray];
            ways.tangent[axis][lane] = tangent[axis][ray];
        }
        for axis in 0..2 {
            ways.tube[axis][lane] = out.tube[axis];
            ways.back_tube[axis][lane] = back.tube[axis];
        }
        ways.cell[lane] = cell[ray];
        ways.aside[lane] = aside.get(ray).copied().unwrap_or_default();
        (ways.path[0][lane], ways.path[1][lane]) = (out.path, back.path);
        ways.speed[lane] = out.speed * back.speed;
        ways.law[lane] = self.backscatter.law(self.surfaces, out.surface);
        ways.beam_gain[lane] = self.source_level * LOG2_PER_DB + weight[ray] - 2.0 * LOG2_PER_DB * loss;
    }

    /// Adds the laws of the surfaces and spreading to the `beam_gain` of `ways`, and finds how far their cells reach.
    /// `first`: none is reflected; `same`: all return along the path out.
    pub(super) fn weigh(&self, ways: &mut Ways, first: bool, same: bool) {
        echo::weigh(&self.backscatter.laws, same, ways);
        match self.spreading.law(self.spreading_from) {
            None => echo::spread_tubes(self.turns, ways),
            Some(law) => echo::spread_by(law, ways),
        }
        let rotation = self.rotation.to_cols_array_2d();
        echo::reaches(rotation, !(self.straight && first), !self.transducer.aside.is_empty(), ways);
    }

    /// Computes the echoes of the targets that `echoes.direct` leads to, each as a point with its target strength
    /// (sonar equation for point targets, Urick 1983, section 2.1): no ray has to hit it.
    pub fn answer_targets(&self, echoes: &mut Echoes) {
        echoes.clear();
        let Echoes { arrivals, direct, launches, answers, energy, re, im, .. } = echoes;
        let sensor_from_world = self.rotation.transpose();
        for Direct { way, launch, .. } in &*direct {
            let sent = sensor_from_world * *launch;
            let (mut at, received) = self.seen(way.range, *launch);
            if let Some(coupling) = &self.coupling {
                at += coupling.shift(way, *launch);
            }
            let unaimed = self.source_level * LOG2_PER_DB
                + self.backscatter.target_strength(self.surfaces, way.surface)
                + self.spread_twice(way)
                - 2.0 * LOG2_PER_DB * way.loss;
            for (loud, receiving) in self.transducer.towards(sent, received) {
                if loud <= FAINT {
                    continue;
                }
                launches.push((arrivals.len() as u32, *launch));
                arrivals.push(Arrival { ray: NO_RAY, ..*way });
                let range = self.folded(at);
                let bin = range.max(0.0) / self.bin_m;
                let is_received = bin < self.bins as f32;
                let first = energy.len() as u32;
                answers.push(PingEcho {
                    first,
                    parts: is_received.into(),
                    bin: bin as u32,
                    range,
                    reach: 0.0,
                    slide: Vec3::ZERO,
                    receiving,
                });
                if is_received {
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

    /// Whether a ray has hit a target, or a body with tubes of its own: see [`Insonification::answer_targets`] and
    /// [`Insonification::answer_body`].
    fn is_traced_separately(&self, arrival: &Arrival) -> bool {
        let Some(row) = self.surfaces.rows.get(arrival.surface as usize).filter(|_| arrival.order == 0) else {
            return false;
        };
        !self.surfaces.targets.is_empty() && self.backscatter.is_whole(self.surfaces, arrival.surface)
            || self.covered.get(row.object as usize).is_some_and(|&covered| covered)
    }

    /// How an echo back along its ray is received, given `drift`.
    pub(super) fn received_later(&self, drift: &Drift, ray: usize, range: f32, direction: Vec3) -> Received {
        if drift.turned == Vec3::ZERO {
            let receiving = self.transducer.receiving[ray];
            return Received { at: drift.range(range, direction), gain_log2: 0.0, receiving };
        }
        self.received_from(ray, range, direction)
    }

    /// How an echo of a one-way range from the unit `direction` (world), found by a ray, is received.
    pub(super) fn received_from(&self, ray: usize, range: f32, direction: Vec3) -> Received {
        let (at, seen) = self.seen(range, direction);
        let (gain_log2, receiving) = self.transducer.received_beside(ray, seen);
        Received { at, gain_log2, receiving }
    }

    /// Where an echo of a one-way range from the unit `direction` (world) appears: its range, m, and direction, sensor
    /// frame.
    pub(super) fn seen(&self, range: f32, direction: Vec3) -> (f32, Vec3) {
        let own = self.rotation.transpose() * direction;
        self.drift.map_or((range, own), |drift| (drift.range(range, direction), drift.seen(range, own)))
    }

    /// The range at which an echo received after the next ping appears, m.
    pub(super) fn folded(&self, at: f32) -> f32 {
        if at >= self.fold { at - self.fold } else { at }
    }

    /// Divides an echo among bins.
    #[inline]
    pub(super) fn divide(&self, arrival: &Arrival, echo: Echo, parts: &mut WaitingParts) -> PingEcho {
        let Echo { power, received: Received { at, receiving, .. }, reach, slide, way } = echo;
        let first = parts.len();
        let at = self.folded(at);
        let per_bin = 1.0 / self.bin_m;
        let reach = reach.abs().min(MOST_BINS * self.bin_m);
        let low = (at - 0.5 * reach) * per_bin;
        let high = (at + 0.5 * reach) * per_bin;
        let from = low.max(0.0) as usize;
        let without_parts = PingEcho { first, parts: 0, bin: 0, range: at, reach, slide, receiving };
        let Some(power) = power.filter(|_| from < self.bins && high > 0.0) else { return without_parts };
        let to = (high as usize).min(self.bins - 1);
        let answer = PingEcho { parts: (to - from + 1) as u32, bin: from as u32, ..without_parts };
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
        let (place, along) = (arrival.place, scatterers.along);
        let echo = Scatter {
            bins: [from as u32, to as u32],
            ends: [low, high],
            share,
            least: if whole { power } else { 0.0 },
            along: place.dot(along),
            slope: slide.dot(along) * self.bin_m,
            middle: at * per_bin,
            object: self.scatterer(arrival.surface, arrival.ray, arrival.order, way),
        };
        let rough = |bin: u32| {
            let middle = 0.5 * (low.max(bin as f32) + high.min(bin as f32 + 1.0));
            scatterers.roughness(place + slide * (middle * self.bin_m - at))
        };
        let textured = !scatterers.texture.is_empty();
        parts.scatter(scatterers, &echo, if textured { Some(&rough) } else { None });
        answer
    }

    /// Identifies the scatterers that a ray hits on a surface, after `order` reflections, for one of the paths back:
    /// each ray and each path has its own in each bin. If several shared those of one position, their echoes would be
    /// in phase where the surface is hit at normal incidence, and the level would rise with the number of rays.
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

    /// log2 of what two-way spreading leaves of the echo of a point that returns along the path out.
    pub(super) fn spread_twice(&self, way: &Arrival) -> f32 {
        match self.spreading.law(self.spreading_from) {
            None => 2.0 * echo::tube_spread(way.tube, way.path, way.speed, self.turns),
            Some(law) => -2.0 * echo::one_way(log2(way.path.max(1e-3)), law),
        }
    }
}

/// Change of the range of an echo over its ray's cell, m, and displacement along the surface per metre of that.
pub(super) fn reach(ways: &Ways, lane: usize) -> (f32, Vec3) {
    (ways.reach[lane], ways.slide.each_ref().map(|axis| axis[lane]).into())
}
