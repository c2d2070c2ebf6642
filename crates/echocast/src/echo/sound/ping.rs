//! From what rays of sound meet to what the beams of a sonar hear in each range bin.
//!
//! Each ray represents a cell of directions; the patch of surface that it covers returns energy over a stretch of
//! range, which is divided among bins as it lies. So a bin's energy depends neither on the mesh nor on the number of
//! rays.

use super::blocks::Gathered;
use super::coupling::Coupling;
use super::parts::{Parts, Scatter, Scatterers};
use super::response::Response;
use crate::emitter::{FAINT, Transducer};
use crate::ground::lanes::MEDIUM;
use crate::ground::math::{LOG2_PER_DB, exp2, log2};
use crate::ground::rng::Draw;
use crate::medium::Spreading;
use crate::trace::{Arrival, Backscatter, Direct, Surfaces};
use echocast_kernels::echo::{self, WAYS, Ways};
use glam::{Mat3, Quat, Vec3};
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
    /// How the sonar moves while sound travels.
    pub drift: Option<Drift>,
    /// What pulse and receiver make of an echo.
    pub response: &'a Response,
    /// Which objects have tubes of their own; empty: none.
    pub covered: &'a [bool],
    /// What motion does to ranges; `None`: nothing, as nothing moves, or no frequency is swept.
    pub coupling: Option<Coupling<'a>>,
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
    /// What of it is heard alike, added up.
    pub gathered: Gathered,
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

impl Insonification<'_> {
    /// Finds what `echoes.arrivals` send back, also straight back where `echoes.direct` says so.
    pub fn answer(&self, echoes: &mut Echoes) {
        let Echoes { arrivals, direct, launches, answers, energy, re, im, .. } = echoes;
        answers.clear();
        launches.clear();
        [&mut *energy, re, im].into_iter().for_each(Vec::clear);
        let mut parts = Parts::new(energy, re, im);
        let mut ways = Ways::default();
        for block in arrivals.chunks(WAYS) {
            for (lane, arrival) in block.iter().enumerate() {
                self.take(&mut ways, lane, [arrival, arrival], arrival.loss);
            }
            self.weigh(&mut ways, block.iter().all(|arrival| arrival.order == 0), true);
            let mut heard = [Heard { at: 0.0, louder: 0.0, hearing: 0 }; WAYS];
            for (lane, (arrival, heard)) in block.iter().zip(&mut heard).enumerate() {
                let ray = arrival.ray as usize;
                *heard = Heard { at: arrival.range, louder: 0.0, hearing: self.transducer.hearing[ray] };
                if let Some(drift) = &self.drift {
                    *heard = self.heard_later(drift, ray, arrival.range, self.launch(ray));
                }
                if let Some(coupling) = &self.coupling {
                    heard.at += coupling.shift(arrival, self.launch(ray));
                }
                ways.loudness[lane] += heard.louder + self.backscatter.besides(self.surfaces, arrival);
            }
            let mut powers = ways.loudness;
            echo::powers(&mut powers);
            for (lane, (arrival, &heard)) in block.iter().zip(&heard).enumerate() {
                // After reflections also what is only heard straight back has arrived.
                let in_reach = arrival.order == 0 || arrival.range <= self.farthest;
                let is_heard = in_reach && !self.is_heard_otherwise(arrival);
                let power = is_heard.then_some(powers[lane]);
                let (reach, slide) = reach(&ways, lane);
                answers.push(self.divide(arrival, Echo { power, heard, reach, slide, way: 0 }, &mut parts));
            }
        }
        self.answer_mixed(arrivals, direct, launches, answers, (&mut ways, &mut parts));
        parts.finish(self.speckle.as_ref());
    }

    /// Puts an arrival by the way `out`, whose echo comes `back` with a `loss` each way, dB, into a lane. Its loudness is that
    /// without the law of the surface and spreading.
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
        ways.loudness[lane] = self.source_level * LOG2_PER_DB + weight[ray] - 2.0 * LOG2_PER_DB * loss;
    }

    /// Adds the laws of the surfaces and spreading to the loudness of `ways`, and finds how far their cells reach. `first`:
    /// none is reflected; `same`: all come back the way they went.
    pub(super) fn weigh(&self, ways: &mut Ways, first: bool, same: bool) {
        echo::weigh(&self.backscatter.laws, same, ways);
        match self.spreading.law(self.spreading_from) {
            None => echo::spread_tubes(self.turns, ways),
            Some(law) => echo::spread_by(law, ways),
        }
        let rotation = self.rotation.to_cols_array_2d();
        echo::reaches(rotation, !(self.straight && first), !self.transducer.aside.is_empty(), ways);
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

    /// Divides an echo among bins.
    #[inline(always)]
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

    /// log2 of what spreading leaves of an echo of a point that returns the way it went: of both ways.
    pub(super) fn spread_twice(&self, way: &Arrival) -> f32 {
        match self.spreading.law(self.spreading_from) {
            None => 2.0 * echo::tube_spread(way.tube, way.path, way.speed, self.turns),
            Some(law) => -2.0 * echo::one_way(log2(way.path.max(1e-3)), law),
        }
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
}

/// How much the range of an echo changes over its ray's cell, m, and how far along the surface a metre of that is.
pub(super) fn reach(ways: &Ways, lane: usize) -> (f32, Vec3) {
    (ways.reach[lane], ways.slide.each_ref().map(|axis| axis[lane]).into())
}

/// In place of a ray's number: what was not found by any, and takes no water from view.
pub(crate) const NO_RAY: u32 = u32::MAX;
