//! Echoes that return by another path than they went: out directly and back over reflections, or vice versa.

use super::ping::{Echo, Echoes, Heard, Insonification, Parts, PingEcho, sine};
use crate::ground::math::{LOG2_PER_DB, exp2};
use crate::trace::{Arrival, Direct};
use glam::Vec3;

/// Number of both ways of a mixed echo while they have the same scatterers, and of the second one otherwise.
const MIXED: u32 = 1;
const SENT_STRAIGHT: u32 = 3;

impl Insonification<'_> {
    /// For each direct path to the place of an arrival two more arrivals and their answers: what comes straight back
    /// from the arrival, then what was sent straight and returns along its path. By reciprocity both have the same
    /// loss, and both arrive at the mean of the two one-way times, in phase: to a beam that hears both alike they are four
    /// times as loud as one. Where the sonar moves meanwhile, so that one path gets longer than the other by a part of the
    /// wavelength, they add up as energies.
    pub(super) fn answer_mixed(
        &self,
        arrivals: &mut Vec<Arrival>,
        direct: &[Direct],
        launches: &mut Vec<(u32, Vec3)>,
        answers: &mut Vec<PingEcho>,
        parts: &mut Parts,
    ) {
        let sensor_from_world = self.rotation.transpose();
        for Direct { index, way, launch } in direct {
            let far = arrivals[*index as usize];
            let ray = far.ray as usize;
            let mixed = Arrival {
                range: 0.5 * (far.range + way.range),
                path: 0.5 * (far.path + way.path),
                loss: 0.5 * (far.loss + way.loss),
                ..far
            };
            let sines = [far.direction, way.direction].map(|direction| sine(direction, far.normal));
            let loudness = self.source_level * LOG2_PER_DB
                + self.transducer.weight[ray]
                + self.backscatter.log2_between(self.surfaces, &far, sines)
                + self.spread_between(&far, way)
                - 2.0 * LOG2_PER_DB * mixed.loss;
            // Across the cell each path lengthens by its own amount.
            let (reach, slide) = self.reach(&far, way.direction);

            let mut back = self.heard_from(ray, mixed.range, *launch);
            let mut there = Heard { at: mixed.range, louder: 0.0, hearing: self.transducer.hearing[ray] };
            if let Some(drift) = &self.drift {
                there = self.heard_later(drift, ray, mixed.range, self.launch(ray));
            }
            if let Some(coupling) = &self.coupling {
                // The mean of both ways, as of their times.
                let shift = 0.5 * (coupling.shift(&far, self.launch(ray)) + coupling.shift(way, *launch));
                back.at += shift;
                there.at += shift;
            }
            there.louder += self.transducer.sent_beside(ray, sensor_from_world * *launch);
            let powers = [back, there].map(|heard| exp2(loudness + heard.louder));
            /// Turns of the phase that two ways may differ by and count as in phase.
            const IN_PHASE: f32 = 0.25;
            let in_phase = ((back.at - there.at) * self.turns).abs() < IN_PHASE;
            // What amplitudes have together that energies have not: half of it with each.
            let both = match self.speckle {
                None if in_phase => {
                    self.transducer.overlap(back.hearing, there.hearing) * (powers[0] * powers[1]).sqrt()
                }
                _ => 0.0,
            };
            // Of the first the direction is another than its ray's.
            launches.push((arrivals.len() as u32, *launch));
            let second = if in_phase { MIXED } else { SENT_STRAIGHT };
            for (heard, power, way) in [(back, powers[0], MIXED), (there, powers[1], second)] {
                let power = Some(power + both);
                arrivals.push(mixed);
                answers.push(self.divide(&mixed, Echo { power, heard, reach, slide, way }, parts));
            }
        }
    }
}

impl Echoes {
    /// Direction (unit, world) in which arrival `index` left or comes back, if that is not along its ray.
    pub fn launch(&self, index: usize) -> Option<Vec3> {
        let place = self.launches.binary_search_by_key(&(index as u32), |(arrival, _)| *arrival);
        Some(self.launches[place.ok()?].1)
    }
}
