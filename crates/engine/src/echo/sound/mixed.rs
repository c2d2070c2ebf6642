//! Echoes that return along a different path: out directly and back by reflections, or vice versa.

use super::echo::{Echo, PingEcho, Received};
use super::parts::WaitingParts;
use super::ping::{Insonification, reach};
use crate::trace::{Arrival, Direct};
use echocast_kernels::echo::{WAYS, Ways};
use glam::Vec3;
use ground::math::{exp2, log2};

/// Number of both paths of a mixed echo while they have the same scatterers, and of the second one otherwise.
const MIXED: u32 = 1;
const SENT_STRAIGHT: u32 = 3;

impl Insonification<'_> {
    /// Adds two more arrivals and their echoes for each direct path to the position of an arrival: what returns
    /// directly from there, then what was sent directly and returns along the path of the arrival. By reciprocity both
    /// have the same loss, and both arrive at the mean of the two one-way times, in phase: in a beam that receives both
    /// alike they have four times the power of one. If the sonar moves meanwhile, so that one path becomes longer than
    /// the other by a fraction of the wavelength, they add up as energies.
    pub(super) fn answer_mixed(
        &self,
        arrivals: &mut Vec<Arrival>,
        direct: &[Direct],
        launches: &mut Vec<(u32, Vec3)>,
        answers: &mut Vec<PingEcho>,
        (ways, parts): (&mut Ways, &mut WaitingParts),
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

    /// Adds the two arrivals of one direct path, whose lane in `ways` has been weighed.
    fn answer_both(
        &self,
        arrivals: &mut Vec<Arrival>,
        Direct { index, way, launch }: &Direct,
        launches: &mut Vec<(u32, Vec3)>,
        answers: &mut Vec<PingEcho>,
        (ways, lane, parts): (&Ways, usize, &mut WaitingParts),
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
        let mut beam_gain = ways.beam_gain[lane] + self.backscatter.constant_log2(self.surfaces, &far);
        if self.backscatter.is_whole(self.surfaces, far.surface) {
            // It scatters alike in all directions.
            beam_gain -= 0.5 * log2(ways.sines[1][lane] / ways.sines[0][lane]);
        }
        let (reach, slide) = reach(ways, lane);

        let mut back = self.received_from(ray, mixed.range, *launch);
        let mut there = Received { at: mixed.range, gain_log2: 0.0, receiving: self.transducer.receiving[ray] };
        if let Some(drift) = &self.drift {
            there = self.received_later(drift, ray, mixed.range, self.launch(ray));
        }
        if let Some(coupling) = &self.coupling {
            // The mean of both paths, as for their times.
            let shift = 0.5 * (coupling.shift(&far, self.launch(ray)) + coupling.shift(way, *launch));
            back.at += shift;
            there.at += shift;
        }
        there.gain_log2 += self.transducer.sent_beside(ray, sensor_from_world * *launch);
        let powers = [back, there].map(|received| exp2(beam_gain + received.gain_log2));
        /// Phase difference in turns up to which two paths count as in phase.
        const IN_PHASE: f32 = 0.25;
        let in_phase = ((back.at - there.at) * self.turns).abs() < IN_PHASE;
        // The interference term, which energies lack: half of it with each.
        let both = match self.speckle {
            None if in_phase => {
                self.transducer.overlap(back.receiving, there.receiving) * (powers[0] * powers[1]).sqrt()
            }
            _ => 0.0,
        };
        // The direction of the first differs from that of its ray.
        launches.push((arrivals.len() as u32, *launch));
        let second = if in_phase { MIXED } else { SENT_STRAIGHT };
        for (received, power, way) in [(back, powers[0], MIXED), (there, powers[1], second)] {
            let power = Some(power + both);
            arrivals.push(mixed);
            answers.push(self.divide(&mixed, Echo { power, received, reach, slide, way }, parts));
        }
    }
}
