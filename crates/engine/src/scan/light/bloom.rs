//! The search for surfaces that bloom, before anything is scanned.

use super::block::{Block, with_block};
use super::halo::{Bright, Halos};
use super::plan::ScanPlan;
use crate::echo::Provenance;
use crate::sensor::Sensor;
use ground::cause::Cause;
use ground::lanes::{CHUNK, LANES, MISS};
use ground::parallel;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Effective reflectance above which a surface is bright: brighter than white.
const BRIGHT: f32 = 1.0;

impl ScanPlan<'_> {
    /// Finds the surfaces that bloom, if `sensor` has blooming: traces the centres of all beams. What is bright only in
    /// a mirror or through glass does not bloom.
    pub fn find_halos(&mut self, sensor: &Sensor) {
        // Where the profile has one ray per beam there are no signals, and nothing blooms.
        let (Some(blooming), Some(signals)) = (sensor.detection.blooming, &self.signals) else { return };
        let (scan, all) = (&*self, Mutex::new(Halos::none()));
        scan.world.scene.engine.install(|| {
            parallel::for_each_range(scan.aim.beams.len(), CHUNK, |beams| {
                with_block(scan, |block| find(scan, block, beams, &all));
            });
        });
        let bright = all.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.halos = Some(Halos::new(bright, blooming, scan.receiver.gate.least_power(), signals.sigma));
    }
}

/// Adds the bright surfaces that `beams` hit to `all`.
fn find(scan: &ScanPlan, block: &mut Block, beams: Range<usize>, all: &Mutex<Vec<Bright>>) {
    for first in beams.clone().step_by(LANES) {
        let count = LANES.min(beams.end - first);
        block.lanes.start_at(first);
        block.aim(scan, first, count);
        block.trace(scan, count);
        let Block { rays, hits, surfaces, scratch, .. } = &mut *block;
        scratch.fill(1.0);
        if let Some(air) = scan.world.air {
            air.dim(rays, &hits.range, count, scratch);
        }
        let mut found = None;
        for lane in 0..count {
            let (surface, range) = (hits.surface[lane], hits.range[lane]);
            let rho_eff = surfaces.reflectance[lane] * surfaces.cos_incidence[lane];
            let power = rho_eff * scratch[lane] / (range * range);
            if surface != MISS && rho_eff > BRIGHT && power.is_finite() && !scan.goes_on(surface) {
                // One thread at a time, for the rest of the block.
                let all = found.get_or_insert_with(|| all.lock().unwrap_or_else(PoisonError::into_inner));
                all.push(Bright {
                    beam: (first + lane) as u32,
                    direction: scan.aim.beams.direction(first + lane),
                    range,
                    power,
                    provenance: Provenance {
                        cause: Cause::Multipath,
                        ..Provenance::of_hit(hits, lane, surfaces.cos_incidence[lane])
                    },
                });
            }
        }
    }
}
