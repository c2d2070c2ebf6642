//! Beams with several rays or several returns each, block by block: their echoes become returns.

use super::block::{Block, no_images};
use super::gather::{Found, Gatherer};
use super::plan::{ScanPlan, World};
use super::split::Splitter;
use crate::sensor::{Adaptive, Signals};
use cloud::Slices;
use ground::cause::Cause;
use ground::lanes::{LANES, MEDIUM, MISS, boxed};
use std::ops::Range;
use std::sync::Arc;

impl Block {
    /// [`Block::scan`] for beams of several rays or returns.
    pub fn scan_signals(
        &mut self,
        scan: &ScanPlan,
        signals: &Arc<Signals>,
        first: usize,
        count: usize,
        mut rows: Slices,
    ) -> usize {
        let mut gatherer = self.gatherer.take().unwrap_or_else(boxed);
        self.lanes.start_at(first);
        self.aim(scan, first, count);
        gatherer.beams = self.rays.clone();
        if scan.points_elsewhere() {
            gatherer.reported.clone_from(&self.reported);
        }
        let beams = &self.lanes.beam[..count];
        let filled = if let Some(Adaptive { one_ray, .. }) = &signals.adaptive {
            gatherer.fit(one_ray);
            gatherer.gather(scan, &mut self.rays, beams, &[]);
            let mut splitter = self.splitter.take().unwrap_or_else(boxed);
            splitter.find(scan, signals, gatherer.axes(first, count));
            gatherer.lower(&splitter.oblique);
            let mut parts = self.parts.take().unwrap_or_else(boxed);
            parts.split_up(scan, signals, &mut splitter, first, [&gatherer.beams, gatherer.reported_beams()]);
            let filled = self.report(scan, &mut gatherer, Some((&mut parts, &splitter.found)), first, count, &mut rows);
            (self.parts, self.splitter) = (Some(parts), Some(splitter));
            filled
        } else {
            gatherer.fit(signals);
            gatherer.gather(scan, &mut self.rays, beams, &[]);
            self.report(scan, &mut gatherer, None, first, count, &mut rows)
        };
        self.gatherer = Some(gatherer);
        filled
    }

    /// Replaces what the beams that `splitter` found would report as one ray by what they report as several.
    pub fn replace(&mut self, scan: &ScanPlan, signals: &Arc<Signals>, splitter: &mut Splitter, first: usize) {
        let mut parts = self.parts.take().unwrap_or_else(boxed);
        let reported = self.reported.as_deref().unwrap_or(&self.rays);
        parts.split_up(scan, signals, splitter, first, [&self.rays, reported]);
        for (from, lane) in splitter.found.iter().map(|&lane| usize::from(lane)).enumerate() {
            let beam = first + lane;
            parts.form(scan, from, beam);
            let Some(&chosen) = parts.found.chosen.first() else {
                self.hits.surface[lane] = MISS;
                continue;
            };
            let echo = parts.trace_back(scan, from, beam, parts.found.peaks[chosen]);
            self.put(scan, &parts, from, lane, &echo);
            self.name(scan, lane..lane + 1);
        }
        self.parts = Some(parts);
    }

    /// Steps 9 and 10: signal, echoes and returns of beam after beam. For the lanes of `split`, those of its gatherer.
    fn report(
        &mut self,
        scan: &ScanPlan,
        gatherer: &mut Gatherer,
        mut split: Option<(&mut Gatherer, &[u8])>,
        first: usize,
        count: usize,
        rows: &mut Slices,
    ) -> usize {
        let (mut filled, mut lanes, mut next) = (0, 0, 0);
        self.lanes.first = None;
        self.reset_causes();
        for lane in 0..count {
            let beam = first + lane;
            let (gatherer, lane) = match &mut split {
                Some((parts, found)) if found.get(next) == Some(&(lane as u8)) => {
                    next += 1;
                    (&mut **parts, next - 1)
                }
                _ => (&mut *gatherer, lane),
            };
            gatherer.form(scan, lane, beam);
            // A beam is kept in one piece, so that its returns can be counted.
            if lanes + gatherer.found.chosen.len().max(1) > LANES {
                filled += self.flush(scan, lanes, rows.rows_after(filled));
                lanes = 0;
            }
            for number in 0..gatherer.found.chosen.len() {
                let chosen = &gatherer.found.chosen;
                // An echo that is reported twice has the same errors twice.
                let draws = if number > 0 && chosen[number] == chosen[number - 1] { number - 1 } else { number };
                let echo = gatherer.trace_back(scan, lane, beam, gatherer.found.peaks[chosen[number]]);
                self.put(scan, gatherer, lane, lanes, &echo);
                (self.lanes.beam[lanes], self.lanes.number[lanes]) = (beam as u32, draws as u32);
                lanes += 1;
            }
            if gatherer.found.chosen.is_empty() && scan.options.organised {
                self.hits.surface[lanes] = MISS;
                (self.lanes.beam[lanes], self.lanes.number[lanes]) = (beam as u32, 0);
                lanes += 1;
            }
        }
        filled + self.flush(scan, lanes, rows.rows_after(filled))
    }

    /// Writes `found`, an echo of the beam at `lane`, to lane `to` as a return.
    fn put(&mut self, scan: &ScanPlan, gatherer: &Gatherer, lane: usize, to: usize, found: &Found) {
        let Block { rays, reported, hits, surfaces, rho_eff, formed, images, widened, deviation, .. } = self;
        let Found { peak, provenance: from, shape, .. } = found;
        formed[to] = found.formed;
        (widened[to], deviation[to]) = (shape.width, shape.deviation);
        rays.take(to, &gatherer.beams, lane);
        if scan.points_elsewhere()
            && let (Some(reported), Some(beams)) = (reported, &gatherer.reported)
        {
            reported.take(to, beams, lane);
        }
        hits.range[to] = peak.range;
        (hits.normal_x[to], hits.normal_y[to], hits.normal_z[to]) = from.normal.into();
        [hits.u[to], hits.v[to]] = from.uv;
        (hits.triangle[to], hits.surface[to]) = (from.triangle, from.surface);
        surfaces.cos_incidence[to] = from.cos_incidence;
        rho_eff[to] = peak.power * peak.range * peak.range;
        if scan.world.motion
            && let Some(image) = gatherer.image(from)
        {
            images.get_or_insert_with(no_images)[to] = image;
        }
        self.cause[to] = if found.mixed { Cause::Mixed } else { from.cause } as u8;
        self.bounces[to] = from.bounces;
        let row = scan.world.scene.surfaces.rows.get(from.first as usize);
        (self.first_category[to], self.first_instance[to]) =
            row.map_or((0, 0), |row| (row.category_id, row.instance_id));
    }

    /// Step 11 of the first `count` lanes, and the errors before it.
    fn flush(&mut self, scan: &ScanPlan, count: usize, rows: Slices) -> usize {
        self.name(scan, 0..count);
        self.measure(scan, count);
        self.number_returns(count);
        self.collect(scan, count, rows)
    }

    /// Labels and intensity of what has been put in `lanes`.
    fn name(&mut self, scan: &ScanPlan, lanes: Range<usize>) {
        let Block { lanes: numbers, hits, surfaces, rho_eff, intensity, .. } = self;
        // The air has no labels to look up.
        let mut air = [false; LANES];
        for lane in lanes.clone() {
            air[lane] = hits.surface[lane] == MEDIUM;
            if air[lane] {
                hits.surface[lane] = MISS;
            }
        }
        let World { scene, reflectances, requested, .. } = &scan.world;
        surfaces.look_up(&scene.surfaces, reflectances, hits, lanes.clone(), *requested);
        for lane in lanes {
            // The reflectance that the surface would need to return as much.
            let cos = surfaces.cos_incidence[lane];
            let shown = rho_eff[lane] / cos / scan.shown_of(numbers.beam[lane]);
            intensity[lane] = scan.measure.intensity.of(shown, cos, hits.range[lane]);
            if air[lane] {
                surfaces.clear(lane);
                hits.surface[lane] = MEDIUM;
            }
        }
    }

    /// Numbers and counts the returns of each beam that are left.
    fn number_returns(&mut self, count: usize) {
        let Block { lanes, hits, .. } = self;
        let mut start = 0;
        while start < count {
            let same = lanes.beam[start..count].iter().take_while(|&&beam| beam == lanes.beam[start]).count();
            let beam = start..start + same;
            let left = beam.clone().filter(|&lane| hits.surface[lane] != MISS).count();
            let mut number = 0;
            for lane in beam {
                number += u8::from(hits.surface[lane] != MISS);
                (lanes.return_number[lane], lanes.return_count[lane]) = (number, left as u8);
            }
            start += same;
        }
    }
}
