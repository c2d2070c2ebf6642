//! The driver: chunks of beams, side by side on threads, each into its own rows.

use super::block::{Block, with_block};
use super::plan::ScanPlan;
use super::survey::mark_edges;
use crate::scan::{Order, Progress, ScanOptions};
use cloud::{Columns, Field, FieldSet, Frame, PointCloud, Slices};
use ground::error::{Error, Result};
use ground::lanes::{CHUNK, LANES};
use ground::parallel;
use std::ops::Range;
use std::sync::atomic::Ordering;

/// Chunks per thread between two passes that close the gaps of misses: few enough that their rows are
/// still in the cache, enough to keep the thread busy.
const CHUNKS_PER_THREAD: usize = 8;

/// Most chunks between two such passes.
const MOST_CHUNKS: usize = 512;

impl ScanPlan<'_> {
    /// Fills `cloud`: windows of chunks in parallel, each chunk into its own rows, then the gaps of
    /// misses are closed in order.
    pub fn run(&self, cloud: &mut PointCloud, progress: Option<Progress>) -> Result<()> {
        let options = self.options;
        let beams = self.aim.beams.len();
        let sorted = options.order == Order::Time;
        let computed = self.computed();
        let columns = &mut cloud.columns;
        columns.make_room(computed, beams * self.most_returns())?;
        let engine = &self.world.scene.engine;
        // Progress is reported often to a caller that requests it.
        let chunks_per_thread = if progress.is_some() { 1 } else { CHUNKS_PER_THREAD };
        let size = (beams * self.most_returns()) as u64;
        let window = CHUNK * (chunks_per_thread * engine.threads()).min(MOST_CHUNKS);
        let windows = (0..beams).step_by(window).map(|first| first..(first + window).min(beams));
        let mut next = |beams: Range<usize>, rows: usize| {
            // No further than this window may fill: memory of an earlier scan is not cleared beyond the rows that will
            // exist.
            columns.lengthen(computed, rows + beams.len() * self.most_returns());
            self.window(beams, rows, columns)
        };
        let rows = match progress {
            None => engine.install_sized(size, || windows.fold(0, |rows, beams| next(beams, rows))),
            Some(progress) => {
                let mut rows = 0;
                for window in windows {
                    let done = window.end;
                    rows = engine.install_sized(size, || next(window, rows));
                    // A finished scan is not discarded.
                    if progress(done as f64 / beams as f64).is_break() && done < beams {
                        return Err(Error::Cancelled);
                    }
                }
                rows
            }
        };
        cloud.columns.resize(computed, rows)?;
        mark_edges(&mut cloud.columns);
        cloud.len = rows;
        if sorted {
            cloud.sort_by_time()?;
            cloud.columns.resize(options.fields, rows)?;
        }
        cloud.fields = options.fields;
        cloud.frame = options.coordinates;
        cloud.origin = match options.coordinates {
            Frame::World => self.world.scene.origin,
            Frame::Sensor => glam::DVec3::ZERO,
        };
        cloud.organised = options.organised.then_some([self.aim.beams.rows, self.aim.beams.columns]);
        let trajectory = self.aim.estimated.unwrap_or(self.aim.trajectory);
        let late = self.aim.estimated.map_or(0.0, |_| options.clock_offset);
        cloud.sensor_pose = trajectory.at(options.start_on_trajectory() + late);
        cloud.start_time = Some(options.start_time);
        cloud.rays = self.rays.load(Ordering::Relaxed);
        cloud.most_rays = self.most_rays();
        cloud.intensity_full_scale = self.measure.intensity.full_scale();
        cloud.driver = self.driver;
        cloud.scan_line = self.scan_line;
        cloud.labels = self.world.scene.surfaces.labels.clone();
        Ok(())
    }

    /// The columns to compute: rows are sorted by their times.
    pub fn computed(&self) -> FieldSet {
        let ScanOptions { fields, order, .. } = *self.options;
        if order == Order::Time { fields.with(Field::Time) } else { fields }
    }

    /// Scans some beams into the rows after the first `rows`; returns how many rows there are then.
    pub fn window(&self, beams: Range<usize>, mut rows: usize, columns: &mut Columns) -> usize {
        // Right after the existing rows: memory beyond the last return is never touched.
        let free = columns.slices(rows, rows + beams.len() * self.most_returns());
        let mut found = [0; MOST_CHUNKS];
        let found = &mut found[..beams.len().div_ceil(CHUNK)];
        let tasks = self.tasks(beams, free).zip(&mut *found);
        parallel::for_each_of(tasks, |(task, found)| {
            *found = with_block(self, |block| task.run(block));
        });
        let mut from = rows;
        for &mut count in found {
            if rows != from {
                columns.move_rows(from, rows, count);
            }
            rows += count;
            from += CHUNK * self.most_returns();
        }
        rows
    }

    /// Scans beams `first .. first + count`, at most [`LANES`], and fills the first of `rows`; returns how many.
    pub fn scan_block(&self, block: &mut Block, first: usize, count: usize, rows: Slices) -> usize {
        match self.signals {
            Some(signals) if self.has_signals => block.scan_signals(self, signals, first, count, rows),
            splits => block.scan(self, splits, first, count, rows),
        }
    }

    /// Chunks of `beams`, each with the part of `rows` that it may fill.
    fn tasks<'b>(&'b self, beams: Range<usize>, rows: Slices<'b>) -> impl Iterator<Item = Task<'b>> {
        let chunks = beams.clone().step_by(CHUNK).map(move |first| (first, CHUNK.min(beams.end - first)));
        let parts = rows.parts(chunks.clone().map(|(_, count)| count * self.most_returns()));
        chunks.zip(parts).map(|((first, count), rows)| Task { scan: self, first, count, rows })
    }
}

/// Beams `first .. first + count` and the rows they may fill.
struct Task<'a> {
    scan: &'a ScanPlan<'a>,
    first: usize,
    count: usize,
    rows: Slices<'a>,
}

impl Task<'_> {
    /// Fills rows, working in `block`; returns how many.
    fn run(mut self, block: &mut Block) -> usize {
        let mut filled = 0;
        for start in (0..self.count).step_by(LANES) {
            let beam = self.first + start;
            let (count, rows) = (LANES.min(self.count - start), self.rows.rows_after(filled));
            filled += self.scan.scan_block(block, beam, count, rows);
        }
        filled
    }
}
