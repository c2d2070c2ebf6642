//! Scans that must end in time: how many rays a beam may have, from what a few blocks of beams take.

use super::block::with_block;
use super::plan::ScanPlan;
use cloud::Columns;
use ground::error::Result;
use ground::lanes::{CHUNK, LANES};
use ground::parallel;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Rays of a beam whose cost is measured. The first step is the highest: from two rays on, it is looked for beams that
/// cover more than one surface.
const STEPS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Of this many blocks one is scanned to measure, but at least [`LEAST_BLOCKS`], if there are as many.
const SAMPLED: usize = 32;
const LEAST_BLOCKS: usize = 16;

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
        let unlimited = self.signals;
        // Rays and the time that the whole scan takes with them, s.
        let mut known = (1, 0.0);
        let mut found = most;
        for step in STEPS.into_iter().filter(|&step| step < most).chain([most]) {
            self.signals = unlimited;
            self.limit(step);
            let needed = self.estimate(columns)?;
            let left = PLANNED * budget - start.elapsed().as_secs_f64();
            if needed > left {
                let (fewer, time) = known;
                let part = ((left - time) / (needed - time)).max(0.0);
                found = fewer + (f64::from(step - fewer) * part) as u32;
                break;
            }
            known = (step, needed);
        }
        self.signals = unlimited;
        self.limit(found);
        self.rays.store(0, Ordering::Relaxed);
        Ok(())
    }

    /// The time that the scan takes, s, from that of some of its blocks.
    fn estimate(&self, columns: &mut Columns) -> Result<f64> {
        let beams = self.aim.beams.len();
        let blocks = beams.div_ceil(LANES);
        let step = (blocks / LEAST_BLOCKS).clamp(1, SAMPLED);
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
