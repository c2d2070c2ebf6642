//! Scans that must end in time: how many rays a beam may have, from what a few blocks of beams take.

use super::block::with_block;
use super::plan::ScanPlan;
use cloud::Columns;
use ground::error::Result;
use ground::lanes::{CHUNK, LANES};
use ground::parallel;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Numbers of rays per beam that may be timed, by bisection. Cost rises most from one to two: only then are beams that
/// cover more than one surface searched for.
const STEPS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Of so many blocks one is scanned to measure: of more where that leaves at least [`BLOCKS`] of them.
const SAMPLED: [usize; 2] = [16, 32];
const BLOCKS: usize = 16;

/// Part of the time that is planned with: what is measured is a sample, and machines do other things, too.
const PLANNED: f64 = 0.85;

impl ScanPlan<'_> {
    /// Limits the rays of beams so that the scan, which began at `start`, ends within a time `budget`, s. `columns` are
    /// working memory.
    pub fn keep_to(&mut self, budget: f64, start: Instant, columns: &mut Columns) -> Result<()> {
        let most = self.most_rays();
        if most == 1 || self.signals.is_none_or(|signals| signals.adaptive.is_none()) {
            return Ok(());
        }
        let (unlimited, traced) = (self.signals, self.rays.load(Ordering::Relaxed));
        let steps = STEPS.map(|step| step.min(most));
        // Rays and the time that the whole scan takes with them, s: the most that fit, and the fewest that do not.
        let (mut fits, mut fails) = ((1, 0.0), None);
        let [mut low, mut high] = [0, 1 + STEPS.iter().take_while(|&&step| step < most).count()];
        while low < high {
            let middle = (low + high) / 2;
            self.signals = unlimited;
            self.limit(steps[middle]);
            let measured = (steps[middle], self.estimate(columns)?);
            if measured.1 <= PLANNED * budget - start.elapsed().as_secs_f64() {
                (fits, low) = (measured, middle + 1);
            } else {
                (fails, high) = (Some(measured), middle);
            }
        }
        let found = fails.map_or(fits.0, |(more, longer)| {
            let left = PLANNED * budget - start.elapsed().as_secs_f64();
            let part = ((left - fits.1) / (longer - fits.1)).clamp(0.0, 1.0);
            (fits.0 + (f64::from(more - fits.0) * part) as u32).min(most)
        });
        self.signals = unlimited;
        self.limit(found);
        self.rays.store(traced, Ordering::Relaxed);
        Ok(())
    }

    /// The time that the scan takes, s, from that of some of its blocks.
    fn estimate(&self, columns: &mut Columns) -> Result<f64> {
        let beams = self.aim.beams.len();
        let blocks = beams.div_ceil(LANES);
        let step = (blocks / BLOCKS).clamp(SAMPLED[0], SAMPLED[1]).min(blocks);
        let most = LANES * self.most_returns();
        // In the middle of their strides.
        let firsts = (step / 2..blocks).step_by(step).map(|block| block * LANES);
        let (count, fields) = (firsts.len(), self.computed());
        columns.make_room(fields, beams * self.most_returns())?;
        columns.lengthen(fields, count * most);
        let rows = columns.slices(0, count * most);
        let taken = AtomicU64::new(0);
        let parts = rows.parts(std::iter::repeat_n(most, count));
        let engine = &self.world.scene.engine;
        engine.install_sized((count * most) as u64, || {
            parallel::for_each_of(firsts.zip(parts), |(first, rows)| {
                with_block(self, |block| {
                    let start = Instant::now();
                    self.scan_block(block, first, LANES.min(beams - first), rows);
                    taken.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
                });
            });
        });
        let taken = Duration::from_nanos(taken.load(Ordering::Relaxed)).as_secs_f64();
        let side_by_side = engine.threads().min(beams.div_ceil(CHUNK));
        Ok(taken * blocks as f64 / count as f64 / side_by_side as f64)
    }
}
