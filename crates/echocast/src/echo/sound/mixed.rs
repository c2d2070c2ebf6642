//! Echoes that return by another path than they went: out directly and back over reflections, or vice versa.

use super::parts::Parts;
use super::ping::{Echo, Echoes, Heard, Insonification, PingEcho, reach};
use crate::ground::math::{exp2, log2};
use crate::trace::{Arrival, Direct};
use echocast_kernels::echo::{WAYS, Ways};
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
        (ways, parts): (&mut Ways, &mut Parts),
    ) {
        for direct in direct.chunks(WAYS) {
            for (lane, Direct { index, way, .. }) in direct.iter().enumerate() {
                let far = &arrivals[*index as usize];
                self.take(ways, lane, [far, way], 0.5 * (far.loss + way.loss));
            }
            // Across the cell each path lengthens by its own amount.
            self.weigh(ways, false, false);
            for (lane, direct) in direct.iter().enumerate() {
                self.answer_both(arrivals, direct, launches, answers, (ways, lane, parts));
            }
        }
    }

    /// The two arrivals of one direct path, whose lane in `ways` has been weighed.
    fn answer_both(
        &self,
        arrivals: &mut Vec<Arrival>,
        Direct { index, way, launch }: &Direct,
        launches: &mut Vec<(u32, Vec3)>,
        answers: &mut Vec<PingEcho>,
        (ways, lane, parts): (&Ways, usize, &mut Parts),
    ) {
        let sensor_from_world = self.rotation.transpose();
        let far = arrivals[*index as usize];
        let ray = far.ray as usize;
        let mixed = Arrival {
            range: 0.5 * (far.range + way.range),
            path: 0.5 * (far.path + way.path),
            loss: 0.5 * (far.loss + way.loss),
            ..far
        };
        let mut loudness = ways.loudness[lane] + self.backscatter.besides(self.surfaces, &far);
        if self.backscatter.is_whole(self.surfaces, far.surface) {
            // It answers alike in all directions.
            loudness -= 0.5 * log2(ways.sines[1][lane] / ways.sines[0][lane]);
        }
        let (reach, slide) = reach(ways, lane);

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
            None if in_phase => self.transducer.overlap(back.hearing, there.hearing) * (powers[0] * powers[1]).sqrt(),
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

impl Echoes {
    /// Direction (unit, world) in which arrival `index` left or comes back, if that is not along its ray.
    pub fn launch(&self, index: usize) -> Option<Vec3> {
        let place = self.launches.binary_search_by_key(&(index as u32), |(arrival, _)| *arrival);
        Some(self.launches[place.ok()?].1)
    }
}
