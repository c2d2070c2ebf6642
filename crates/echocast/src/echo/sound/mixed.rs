//! Echoes that return by another path than they went: out directly and back over reflections, or vice versa.

use super::ping::{Echo, Echoes, Heard, Insonification, Parts, PingEcho, sine};
use crate::ground::math::{LOG2_PER_DB, exp2};
use crate::trace::{Arrival, Direct};
use glam::Vec3;

/// Paths of a mixed echo, by its number.
const HEARD_STRAIGHT: u32 = 1;
const SENT_STRAIGHT: u32 = 2;

impl Insonification<'_> {
    /// For each direct path to the place of an arrival two more arrivals and their answers: what comes straight back
    /// from the arrival, then what was sent straight and returns along its path. By reciprocity both have the same
    /// loss, and both arrive at the mean of the two one-way times; they add up as energies.
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
            for (heard, way) in [(back, HEARD_STRAIGHT), (there, SENT_STRAIGHT)] {
                if way == HEARD_STRAIGHT {
                    launches.push((arrivals.len() as u32, *launch));
                }
                let power = exp2(loudness + heard.louder);
                arrivals.push(mixed);
                answers.push(self.divide(&mixed, Echo { power: Some(power), heard, reach, slide, way }, parts));
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
