//! Echoes that arrive after the next pulse has been fired.

use super::block::Block;
use super::plan::ScanPlan;
use crate::detect::PulseAssignment;
use ground::lanes::MISS;

impl Block {
    /// Loses what arrives too close to a pulse, and takes what arrives after later pulses for their echoes, if the
    /// instrument does. Pulses end with the line, if the laser pauses then, or with the scan.
    pub(super) fn assign(&mut self, scan: &ScanPlan, assignment: PulseAssignment, count: usize) {
        let beams = scan.aim.beams;
        let Block { lanes, hits, measured, reported, .. } = self;
        for lane in 0..count {
            if hits.surface[lane] == MISS {
                continue;
            }
            let beam = lanes.beam[lane];
            let end = if assignment.pauses { beams.columns - beam % beams.columns } else { beams.len() as u32 - beam };
            match assignment.assign(measured[lane], end - 1) {
                None => hits.surface[lane] = MISS,
                Some((pulses, after)) if assignment.folds && pulses > 0 => {
                    measured[lane] = after;
                    lanes.beam[lane] = beam + pulses;
                    lanes.first = None;
                    if let Some(reported) = reported {
                        scan.aim.pose.ray(beams, lanes.beam[lane] as usize, lane, reported);
                    }
                }
                Some(_) => {}
            }
        }
    }
}
