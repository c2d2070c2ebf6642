//! Paths straight to cubes: each adds the transforms of the windows, without samples and without Fourier transforms.
//!
//! A path adds to the cells around it the product of a response along range and one along velocity, times the
//! amplitude of the wave at each pair of elements. Two things keep this from being a product. An echo moves on along the
//! range during a frame: the response along range is then expanded in Chebyshev polynomials of time, and the windows along
//! velocity are multiplied with these. And its range is another one at every pair of elements: responses are made for a
//! few ranges, nodes, and channels interpolate between them. How many orders and nodes it takes depends on how exact the
//! path has to be.

use crate::LIGHT_SPEED;
use crate::cube::RadarCube;
use crate::paths::Paths;
use crate::plan::{MOST_ORDERS, RadarPlan, StreamPart};
use crate::waveform::RadarWaveform;
use echocast_kernels::math::sin_cos_turns;
use echocast_kernels::radar::{self, CellPatch, PATHS, PatchRun, PathLanes};
use ground::math::floor;
use ground::parallel;
use num_complex::Complex32;
use rustfft::FftPlannerScalar;
use std::f32::consts::FRAC_PI_4;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Most nodes between which channels interpolate: enough for an array that spans 8 cells of range.
const MOST_NODES: usize = 24;

/// No part of a path is left out or inexact that is stronger than this, relative to its amplitude.
const WEAKEST: f32 = 1e-5;

/// However weak a path is, what is stronger than this, relative to its amplitude, is not left out: sums of many weak
/// paths are right.
const STRONGEST: f32 = 0.1;

/// What expansions and interpolation may err by, relative to the amplitude of a path, however strong it is: -70 dB.
const TOLERANCE: f32 = 3e-4;

/// Runs are rounded up to so many cells, which kernels add at once.
const RUN_CELLS: i64 = 8;

/// Paths are handled in groups of [`PATHS`], of which so many are worked on at a time: their patches stay in the cache.
const GROUPS: usize = 32;

/// More cells than this are not worked on at a time, unless a single group has them.
const MOST_CELLS_AT_ONCE: usize = 1 << 20;

/// A path ready to be added.
#[derive(Clone, Copy, Debug, Default)]
struct PathStamp {
    path: u32,
    /// Where it is in the cube, in cells, folded.
    place: f64,
    row: f64,
    /// Amplitude at the reference point, with the gains of elements.
    amplitude: Complex32,
    /// By how many cells its range moves on during the frame.
    migration: f32,
    /// Down to which level, relative to its amplitude, it is added.
    relative: f32,
    /// Cells that it may take, about.
    cells: u32,
}

/// Stamps that are worked on together, with what they share.
#[derive(Default)]
struct PathGroup {
    /// For each launch, and after them for each receiver: real and imaginary part of the wave, and range, cells.
    waves: Vec<[PathLanes; 3]>,
    /// Nodes of each stamp: their middle and half of their span, cells.
    nodes: [[f32; 2]; PATHS],
    /// How many there are.
    counts: [usize; PATHS],
    /// Real and imaginary parts of the amplitudes.
    amplitudes: [PathLanes; 2],
    patches: Vec<CellPatch>,
    runs: Vec<PatchRun>,
    numbers: Vec<f32>,
}

/// What filling a patch needs.
#[derive(Default)]
struct PatchMemory {
    places: Vec<(u32, f32)>,
    responses: Vec<f32>,
    ranges: Vec<f32>,
    columns: Vec<f32>,
    rows: Vec<f32>,
    runs: Vec<PatchRun>,
}

/// For each number of nodes; those of none stand in.
static NODES: LazyLock<Vec<Nodes>> = LazyLock::new(|| (0..=MOST_NODES).map(|count| Nodes::new(count.max(1))).collect());

/// Interpolation between Chebyshev nodes, `cos(pi (i + 1/2) / n)`, on -1 to 1.
struct Nodes {
    at: Vec<f32>,
    /// Inverse of the products of the distances of each from all others.
    scale: Vec<f32>,
    /// Matrix that turns values at them into coefficients of Chebyshev polynomials.
    matrix: Vec<f32>,
}

impl Nodes {
    fn new(count: usize) -> Self {
        let angle = |i: usize| PI * (i as f64 + 0.5) / count as f64;
        let at: Vec<f64> = (0..count).map(|i| angle(i).cos()).collect();
        let scale = |i: usize| {
            let others = (0..count).filter(|&other| other != i);
            (1.0 / others.map(|other| at[i] - at[other]).product::<f64>()) as f32
        };
        let coefficient = |order: usize| {
            let factor = if order == 0 { 1.0 } else { 2.0 } / count as f64;
            (0..count).map(move |i| (factor * (order as f64 * angle(i)).cos()) as f32)
        };
        Nodes {
            scale: (0..count).map(scale).collect(),
            matrix: (0..count).flat_map(coefficient).collect(),
            at: at.into_iter().map(|at| at as f32).collect(),
        }
    }

    /// How many are needed for a function that is limited to one turn per cell, over `span` cells, to within `error`:
    /// its interpolation errs by up to `2 (W h / 2)^n / n!`, with `W = pi` and `h` half the span.
    fn needed(span: f32, error: f32, most: usize) -> usize {
        let x = FRAC_PI_4 * span;
        let mut bound = 2.0;
        (1..most)
            .find(|&count| {
                bound *= x / count as f32;
                bound <= error
            })
            .unwrap_or(most)
    }

    /// Weights of the nodes at `t`.
    fn weights(&self, t: f32, weights: &mut [f32]) {
        if let [first, second] = weights {
            *first = (t - self.at[1]) * self.scale[0];
            *second = 1.0 - *first;
            return;
        }
        for (i, weight) in weights.iter_mut().enumerate() {
            let others = self.at.iter().enumerate().filter(|(other, _)| *other != i);
            *weight = others.fold(self.scale[i], |product, (_, at)| product * (t - at));
        }
    }
}

impl RadarPlan {
    /// Adds `paths` to `streams`. Of each path, what is below `floor` W in a cell may be left out, unless it is less
    /// than 20 dB below the path; a floor 30 dB below the noise leaves no traces. Paths that are not finite are ignored.
    /// The result does not depend on the number of threads.
    ///
    /// # Panics
    /// If the streams are not those of [`RadarPlan::silent_streams`].
    pub fn deposit(&self, paths: &Paths, floor: f64, streams: &mut RadarCube) {
        let slab = self.range.cells * self.velocity.cells;
        assert_eq!(streams.cells.len(), slab * self.streams.len(), "the streams are of another radar");
        let depositor = Depositor { plan: self, paths };
        for mirrored in [false, true] {
            let real = matches!(&self.waveform, RadarWaveform::Fmcw(fmcw) if !fmcw.complex);
            if mirrored && !real {
                continue;
            }
            let stamps = depositor.stamps(floor.max(0.0).sqrt(), mirrored);
            depositor.add(&stamps, mirrored, slab, bytemuck::cast_slice_mut(&mut streams.cells));
        }
    }

    /// Phase of what an echo from `range` m is multiplied by so that, from the amplitude that [`Paths`] states for the
    /// carrier, it has that in the middle of what is sampled, turns: `(f_c - f) t + S t^2 / 2`.
    pub(crate) fn middle_turns(&self, range: f64) -> f64 {
        let delay = 2.0 * range / LIGHT_SPEED;
        (self.waveform.frequency() - self.frequency) * delay + 0.5 * self.slope * delay * delay
    }

    /// Frequency that echoes from `range` m have been mixed to as carrier, Hz.
    pub(crate) fn mixed_frequency(&self, range: f64) -> f64 {
        self.frequency - 2.0 * self.slope * range / LIGHT_SPEED
    }

    /// Gain of the elements on a path, as a factor of amplitude.
    ///
    /// # Panics
    /// If there is no path of that number.
    pub fn element_gain(&self, paths: &Paths, path: usize) -> f32 {
        self.patterns[0].amplitude(paths.tx_direction[path]) * self.patterns[1].amplitude(paths.rx_direction[path])
    }

    /// Attenuation of a beat that appears at `place` cells of range, as a factor of amplitude.
    pub(crate) fn filter_gain(&self, place: f64) -> f32 {
        let RadarWaveform::Fmcw(fmcw) = &self.waveform else { return 1.0 };
        let samples = f64::from(fmcw.samples);
        let band = if fmcw.complex { -0.5..samples - 0.5 } else { -0.5 * samples..0.5 * samples };
        if band.contains(&place) { 1.0 } else { 10f64.powf(-fmcw.anti_alias_db / 20.0) as f32 }
    }
}

struct Depositor<'a> {
    plan: &'a RadarPlan,
    paths: &'a Paths,
}

impl Depositor<'_> {
    /// The stamps of all paths, those of a row together, so that neighbours add to the same memory.
    fn stamps(&self, floor: f64, mirrored: bool) -> Vec<PathStamp> {
        let mut stamps: Vec<PathStamp> = vec![PathStamp::default(); self.paths.len()];
        const CHUNK: usize = 1024;
        parallel::for_each_chunk(&mut stamps, CHUNK, |chunk, stamps| {
            for (lane, stamp) in stamps.iter_mut().enumerate() {
                *stamp = self.stamp(chunk * CHUNK + lane, floor as f32, mirrored).unwrap_or_default();
            }
        });
        // Counted by row, in the order of paths.
        let rows = self.plan.velocity.cells;
        let mut starts = vec![0; rows + 1];
        let row = |stamp: &PathStamp| (stamp.row as usize).min(rows - 1);
        for stamp in stamps.iter().filter(|stamp| stamp.cells > 0) {
            starts[row(stamp) + 1] += 1;
        }
        for row in 0..rows {
            starts[row + 1] += starts[row];
        }
        let mut sorted = vec![PathStamp::default(); starts[rows]];
        for stamp in stamps.iter().filter(|stamp| stamp.cells > 0) {
            let next = &mut starts[row(stamp)];
            sorted[*next] = *stamp;
            *next += 1;
        }
        sorted
    }

    fn stamp(&self, path: usize, floor: f32, mirrored: bool) -> Option<PathStamp> {
        let (plan, paths) = (self.plan, self.paths);
        let (range, rate) = (paths.range[path], f64::from(paths.range_rate[path]));
        let place = plan.range_of(range, rate);
        let (sine, cosine) = sin_cos_turns(plan.middle_turns(range));
        let gain = plan.element_gain(paths, path) * plan.filter_gain(place);
        let mut amplitude = paths.amplitude[path] * Complex32::new(cosine as f32, sine as f32) * gain;
        let shift = 2.0 * rate * plan.mixed_frequency(range) / LIGHT_SPEED;
        let migration = match plan.slope > 0.0 || plan.velocity.cells > 1 {
            true => (rate * plan.repetition * plan.velocity.cells as f64 / plan.axes.range.step) as f32,
            false => 0.0,
        };
        let size = amplitude.norm();
        // Beyond any instrument, numbers would overflow.
        let sane = place.abs() < 1e12 && shift.abs() < 1e15 && migration.abs() < 1e9 && size > 0.0 && size < 1e15;
        if !sane || !range.is_finite() {
            return None;
        }
        let sign = if mirrored { -1.0 } else { 1.0 };
        if mirrored {
            amplitude = amplitude.conj();
        }
        let (place, place_sign) = plan.range.fold(sign * place);
        let centre = (plan.velocity.cells / 2) as f64;
        let (row, row_sign) = plan.velocity.fold(centre + sign * (plan.row_of(shift) - centre));
        let relative = (floor / size).clamp(WEAKEST, STRONGEST);
        let across = plan.velocity.response.reach(relative).min(0.5 * plan.velocity.cells as f32);
        let aside = plan.range.response.reach(relative) + 0.5 * migration.abs();
        let cells = (2.0 * across + 2.0) * (2.0 * aside + 2.0);
        Some(PathStamp {
            path: path as u32,
            place,
            row,
            amplitude: amplitude * (place_sign * row_sign),
            migration: sign as f32 * migration,
            relative,
            cells: (cells as u32).max(1),
        })
    }

    /// Adds `stamps` to the cells of streams, `slab` complex numbers each.
    fn add(&self, stamps: &[PathStamp], mirrored: bool, slab: usize, cells: &mut [f32]) {
        let mut groups: Vec<PathGroup> = Vec::new();
        groups.resize_with(GROUPS, PathGroup::default);
        let mut memories: Vec<PatchMemory> = Vec::new();
        let mut rest = stamps;
        while !rest.is_empty() {
            let (mut count, mut total) = (0, 0);
            for group in rest.chunks(PATHS).take(GROUPS) {
                total += group.iter().map(|stamp| stamp.cells as usize).sum::<usize>();
                if count > 0 && total > MOST_CELLS_AT_ONCE {
                    break;
                }
                count += 1;
            }
            let (now, later) = rest.split_at((count * PATHS).min(rest.len()));
            rest = later;
            let work: Vec<_> = groups.iter_mut().zip(now.chunks(PATHS)).collect();
            parallel::for_each_with(&mut memories, work.into_iter(), |memory, (group, stamps)| {
                self.fill(stamps, mirrored, group, memory);
            });
            let groups = &groups[..count];
            parallel::for_each_chunk(cells, 2 * slab, |stream, cells| {
                let mut factors = Vec::new();
                for group in groups {
                    for part in &self.plan.streams[stream] {
                        self.factors(*part, group, mirrored, &mut factors);
                        self.add_group(*part, group, mirrored, &factors, cells);
                    }
                }
            });
        }
    }

    fn add_group(&self, part: StreamPart, group: &PathGroup, mirrored: bool, factors: &[[f32; 2]], cells: &mut [f32]) {
        let (width, height) = (self.plan.range.cells, self.plan.velocity.cells);
        let shift = self.plan.launches[part.launch].shift % height;
        // Backwards is forwards by the rest of a turn.
        let shift = if mirrored { (height - shift) % height } else { shift };
        let wrap = self.plan.velocity.wrap;
        radar::add_patches(cells, width, height, shift, wrap, &group.patches, &group.runs, &group.numbers, factors);
    }

    /// Factors of the layers of all patches of a group in one part of a stream.
    fn factors(&self, part: StreamPart, group: &PathGroup, mirrored: bool, factors: &mut Vec<[f32; 2]>) {
        factors.clear();
        let plan = self.plan;
        let launch = &plan.launches[part.launch];
        let error = plan.errors[launch.transmitter * plan.receivers.len() + part.receiver] * part.code;
        // The turn that a shift by a negative number of rows lacks.
        let turned = mirrored && !launch.shift.is_multiple_of(plan.velocity.cells);
        let error = if turned { error * plan.velocity.wrap } else { error };
        let (sent, received) = (&group.waves[part.launch], &group.waves[plan.launches.len() + part.receiver]);
        let (mut re, mut im, mut at) = ([0.0; PATHS], [0.0; PATHS], [0.0; PATHS]);
        let sign = if mirrored { -1.0 } else { 1.0 };
        for lane in 0..PATHS {
            let product = [
                sent[0][lane] * received[0][lane] - sent[1][lane] * received[1][lane],
                sent[0][lane] * received[1][lane] + sent[1][lane] * received[0][lane],
            ];
            let product =
                [product[0] * error.re - product[1] * error.im, product[0] * error.im + product[1] * error.re];
            let (a, b) = (group.amplitudes[0][lane], sign * group.amplitudes[1][lane]);
            (re[lane], im[lane]) = (product[0] * a - product[1] * b, sign * (product[0] * b + product[1] * a));
            let [middle, half] = group.nodes[lane];
            at[lane] = (sign * (sent[2][lane] + received[2][lane]) - middle) / half;
        }
        for (lane, patch) in group.patches.iter().enumerate().filter(|(_, patch)| patch.layers > 0) {
            let (first, count) = (factors.len(), group.counts[lane]);
            let (re, im) = (re[lane], im[lane]);
            if count == 1 {
                factors.push([re, im]);
            } else {
                let mut weights = [0.0; MOST_NODES];
                NODES[count].weights(at[lane], &mut weights[..count]);
                factors.extend(weights[..count].iter().map(|weight| [re * weight, im * weight]));
            }
            if patch.layers as usize > count {
                for node in first..first + count {
                    let [re, im] = factors[node];
                    factors.push([-im, re]);
                }
            }
        }
    }

    /// Fills a group with the patches of its stamps.
    fn fill(&self, stamps: &[PathStamp], mirrored: bool, group: &mut PathGroup, memory: &mut PatchMemory) {
        let plan = self.plan;
        self.waves(stamps, group);
        group.patches.clear();
        group.runs.clear();
        group.numbers.clear();
        let (launches, receivers) = group.waves.split_at(plan.launches.len());
        let span = |waves: &[[PathLanes; 3]], lane: usize| {
            let ranges = waves.iter().map(|wave| wave[2][lane]);
            [ranges.clone().fold(f32::INFINITY, f32::min), ranges.fold(f32::NEG_INFINITY, f32::max)]
        };
        for (lane, _) in stamps.iter().enumerate() {
            let ([low, high], [least, most]) = (span(launches, lane), span(receivers, lane));
            let (low, high) = if mirrored { (-high - most, -low - least) } else { (low + least, high + most) };
            // A span of 0 would divide by it.
            group.nodes[lane] = [0.5 * (low + high), (0.5 * (high - low)).max(1e-6)];
        }
        for (lane, stamp) in stamps.iter().enumerate() {
            (group.amplitudes[0][lane], group.amplitudes[1][lane]) = (stamp.amplitude.re, stamp.amplitude.im);
            let error = stamp.relative.max(TOLERANCE);
            group.counts[lane] = Nodes::needed(2.0 * group.nodes[lane][1], error, MOST_NODES);
            let nodes = (group.nodes[lane], group.counts[lane]);
            let patch = self.patch(stamp, nodes, memory, &mut group.runs, &mut group.numbers);
            group.patches.push(patch);
        }
    }

    /// The waves of stamps at all elements.
    fn waves(&self, stamps: &[PathStamp], group: &mut PathGroup) {
        let plan = self.plan;
        let (mut turns, mut shifts, mut drift) = ([0.0; PATHS], [0.0; PATHS], [0.0; PATHS]);
        let (mut sent, mut received) = ([[0.0; PATHS]; 4], [[0.0; PATHS]; 4]);
        for (lane, stamp) in stamps.iter().enumerate() {
            let path = stamp.path as usize;
            let (range, rate) = (self.paths.range[path], f64::from(self.paths.range_rate[path]));
            let frequency = plan.mixed_frequency(range);
            turns[lane] = (frequency / LIGHT_SPEED) as f32;
            shifts[lane] = (2.0 * rate * frequency / LIGHT_SPEED) as f32;
            drift[lane] = (rate / plan.axes.range.step) as f32;
            for (ends, distance, direction) in [
                (&mut sent, self.paths.tx_distance[path], self.paths.tx_direction[path]),
                (&mut received, self.paths.rx_distance[path], self.paths.rx_direction[path]),
            ] {
                // The squares of distances must not overflow; beyond, wavefronts are plane.
                ends[0][lane] = distance.clamp(0.0, 1e12);
                (ends[1][lane], ends[2][lane], ends[3][lane]) = (direction[0], direction[1], direction[2]);
            }
        }
        let half_cells = (0.5 / plan.axes.range.step) as f32;
        group.waves.resize(plan.launches.len() + plan.receivers.len(), [[0.0; PATHS]; 3]);
        let (launches, receivers) = group.waves.split_at_mut(plan.launches.len());
        for (launch, [re, im, farther]) in plan.launches.iter().zip(launches) {
            let time = launch.time as f32;
            let more = shifts.map(|shift| shift * time);
            let place = plan.transmitters[launch.transmitter];
            radar::waves_at(place, sent.each_ref(), &turns, &more, re, im, farther);
            for lane in 0..PATHS {
                farther[lane] = farther[lane] * half_cells + drift[lane] * time;
            }
        }
        for (place, [re, im, farther]) in plan.receivers.iter().zip(receivers) {
            radar::waves_at(*place, received.each_ref(), &turns, &[0.0; PATHS], re, im, farther);
            farther.iter_mut().for_each(|farther| *farther *= half_cells);
        }
    }

    /// Adds the runs and the layers of a stamp to `runs` and `numbers`. Ranges of channels are within `half` of
    /// `middle`, cells from its own.
    fn patch(
        &self,
        stamp: &PathStamp,
        ([middle, half], count): ([f32; 2], usize),
        memory: &mut PatchMemory,
        runs: &mut Vec<PatchRun>,
        numbers: &mut Vec<f32>,
    ) -> CellPatch {
        let (range, velocity) = (&self.plan.range, &self.plan.velocity);
        let orders = stamp_orders(stamp);
        let spread = half + 0.5 * stamp.migration.abs();
        // In a cell that it only passes through, its spectrum is wider.
        let wider = if orders > 1 { 1.0 + stamp.migration.abs() } else { 0.0 };
        // Rows: those in which the response is strong enough, at most all, each once.
        let across = velocity.response.reach(stamp.relative) + wider;
        let lowest = (stamp.row - 0.5 * velocity.cells as f64).ceil() as i32;
        let first_row = ((stamp.row - f64::from(across)).ceil() as i32).max(lowest);
        let last_row = ((stamp.row + f64::from(across)).floor() as i32).min(lowest + velocity.cells as i32 - 1);
        // Cells likewise, and no farther than a response is tabulated for all nodes at every moment.
        let centre = stamp.place + f64::from(middle);
        let limit = match orders > MOST_ORDERS {
            true => f32::INFINITY,
            false => range.response.limit() - spread,
        };
        let (first, last) = self.cells(centre, range.response.reach(stamp.relative) + spread, limit);
        let from = runs.len();
        memory.runs.clear();
        for row in first_row..=last_row {
            let off = (f64::from(row) - stamp.row).abs() as f32 - wider;
            let level = stamp.relative / velocity.response.envelope(off).max(1e-9);
            let (low, high) = self.cells(centre, range.response.reach(level) + spread, limit);
            self.split(row, low.max(first), high.min(last), first, &mut memory.runs);
        }
        let none = CellPatch { first: from as u32, runs: 0, layers: 0, from: numbers.len() as u32 };
        if memory.runs.is_empty() || first > last {
            return none;
        }
        let len = (last - first + 1) as usize;
        let halves = if orders > 1 { 2 } else { 1 };
        let (layers, start) = (count * halves, numbers.len());
        let cells: usize = memory.runs.iter().map(|run| run.len as usize).sum();
        numbers.resize(start + 2 * cells * layers, 0.0);
        let shifts = (0..count).map(|node| match count {
            1 => f64::from(middle),
            _ => f64::from(middle) + f64::from(half) * f64::from(NODES[count].at[node]),
        });
        if orders > MOST_ORDERS {
            let shifts: Vec<f64> = shifts.collect();
            self.fill_exactly(stamp, &shifts, (first_row, last_row), (first, len), memory, &mut numbers[start..]);
        } else {
            self.rows(stamp, orders, (first_row, last_row), memory);
            // For each node, the range at the nodes of time.
            memory.places.clear();
            for shift in shifts {
                let moments = NODES[orders].at.iter().take(orders);
                memory.places.extend(moments.map(|moment| {
                    let moved = if orders == 1 { 0.0 } else { 0.5 * f64::from(stamp.migration) * f64::from(*moment) };
                    range.response.find(first as i32, stamp.place + shift + moved)
                }));
            }
            self.ranges(orders, len, memory);
            radar::fill_patch(&memory.runs, &memory.rows, &memory.ranges, len, orders, &mut numbers[start..]);
        }
        let rows = velocity.cells as i32;
        runs.extend(memory.runs.iter().map(|run| PatchRun { row: (run.row as i32).rem_euclid(rows) as u32, ..*run }));
        CellPatch { first: from as u32, runs: (runs.len() - from) as u32, layers: layers as u32, from: start as u32 }
    }

    /// The first and the last cell up to `aside` from `centre`, and a few more on either side, so that there is a
    /// multiple of [`RUN_CELLS`], but none twice, and none farther than `limit`.
    fn cells(&self, centre: f64, aside: f32, limit: f32) -> (i64, i64) {
        let range = &self.plan.range;
        let (first, last) = (-floor(f64::from(aside) - centre), floor(centre + f64::from(aside)));
        let more = (first - last - 1).rem_euclid(RUN_CELLS);
        let (first, last) = (first - more / 2, last + (more + 1) / 2);
        let first = first.max(-floor(f64::from(limit) - centre));
        let last = last.min(floor(centre + f64::from(limit)));
        match range.period as i64 {
            0 => (first.max(0), last.min(range.cells as i64 - 1)),
            period => {
                let first = first.max(-floor(0.5 * period as f64 - centre));
                (first, last.min(first + period - 1))
            }
        }
    }

    /// Adds the parts of the cells from `low` to `high` of an unfolded `row` that are in the cube to `runs`, which still
    /// have the unfolded row.
    fn split(&self, row: i32, low: i64, high: i64, first: i64, runs: &mut Vec<PatchRun>) {
        let (range, velocity) = (&self.plan.range, &self.plan.velocity);
        let over = row.div_euclid(velocity.cells as i32);
        let row_sign = if over.rem_euclid(2) == 0 { 1.0 } else { velocity.wrap };
        let turns = if range.period == 0 { 0..=0 } else { -1..=1 };
        for turn in turns {
            let start = turn * range.period as i64;
            let (from, to) = (low.max(start), high.min(start + range.cells as i64 - 1));
            if from <= to {
                runs.push(PatchRun {
                    row: row as u32,
                    cell: (from - start) as u32,
                    len: (to - from + 1) as u32,
                    skip: (from - first) as u32,
                    sign: row_sign * if turn == 0 { 1.0 } else { range.wrap },
                });
            }
        }
    }

    /// Responses across the rows, of all orders, for each run.
    fn rows(&self, stamp: &PathStamp, orders: usize, (first, last): (i32, i32), memory: &mut PatchMemory) {
        let (response, count) = (&self.plan.velocity.response, (last - first + 1) as usize);
        memory.columns.resize(count * orders, 0.0);
        let place = response.find(first, stamp.row);
        for (order, column) in memory.columns.chunks_exact_mut(count).enumerate() {
            radar::table_rows(response.table(order), response.width, &[place], count, column);
        }
        memory.rows.clear();
        for run in &memory.runs {
            let at = (run.row as i32 - first) as usize;
            memory.rows.extend((0..orders).map(|order| memory.columns[order * count + at]));
        }
    }

    /// Responses along the row, of all orders, for each node.
    fn ranges(&self, orders: usize, len: usize, memory: &mut PatchMemory) {
        let response = &self.plan.range.response;
        memory.ranges.resize(memory.places.len() * len, 0.0);
        if orders == 1 {
            radar::table_rows(response.table(0), response.width, &memory.places, len, &mut memory.ranges);
            return;
        }
        memory.responses.resize(memory.places.len() * len, 0.0);
        radar::table_rows(response.table(0), response.width, &memory.places, len, &mut memory.responses);
        let per_node = orders * len;
        for (responses, ranges) in memory.responses.chunks_exact(per_node).zip(memory.ranges.chunks_exact_mut(per_node))
        {
            radar::products(&NODES[orders].matrix, responses, len, ranges);
        }
    }

    /// The layers of a path that crosses so many cells that no polynomials follow it: the Fourier transform over the
    /// chirps, cell by cell.
    fn fill_exactly(
        &self,
        stamp: &PathStamp,
        shifts: &[f64],
        (first_row, last_row): (i32, i32),
        (first, len): (i64, usize),
        memory: &mut PatchMemory,
        numbers: &mut [f32],
    ) {
        let (range, velocity) = (&self.plan.range, &self.plan.velocity);
        let (count, rows) = (velocity.cells, (last_row - first_row + 1) as usize);
        let centre = 0.5 * (count as f64 - 1.0);
        let fft = FftPlannerScalar::new().plan_fft_inverse(count);
        let turn = |turns: f64| {
            let (sine, cosine) = sin_cos_turns(turns);
            Complex32::new(cosine as f32, sine as f32)
        };
        let mut bins = vec![Complex32::ZERO; count];
        // [node][row][cell]
        let mut values = vec![Complex32::ZERO; shifts.len() * rows * len];
        for (node, shift) in shifts.iter().enumerate() {
            for cell in 0..len {
                for (chirp, bin) in bins.iter_mut().enumerate() {
                    let moment = (chirp as f64 - centre) / count as f64;
                    let place = stamp.place + shift + f64::from(stamp.migration) * moment;
                    let at = first as f64 + cell as f64;
                    let response = match (at - place).abs() <= f64::from(range.response.limit()) {
                        true => {
                            let (from, part) = range.response.find(at as i32, place);
                            let (table, from) = (range.response.table(0), from as usize);
                            table[from] + (table[from + range.response.width] - table[from]) * part
                        }
                        false => 0.0,
                    };
                    let weight = velocity.window[chirp] as f32 * response;
                    *bin = turn((f64::from(first_row) - stamp.row) * moment) * weight;
                }
                fft.process(&mut bins);
                for row in 0..rows {
                    let value = bins[row % count] * turn(-(row as f64) * centre / count as f64);
                    values[(node * rows + row) * len + cell] = value;
                }
            }
        }
        let mut at = 0;
        for run in &memory.runs {
            let row = (run.row as i32 - first_row) as usize;
            for half in 0..2 {
                for node in 0..shifts.len() {
                    for cell in 0..run.len as usize {
                        let value = values[(node * rows + row) * len + run.skip as usize + cell] * run.sign;
                        let value = if half == 0 { value.re } else { value.im };
                        (numbers[at], numbers[at + 1]) = (value, value);
                        at += 2;
                    }
                }
            }
        }
    }
}

/// How many orders of polynomials of time a stamp takes; more than [`MOST_ORDERS`] if these do not do.
fn stamp_orders(stamp: &PathStamp) -> usize {
    Nodes::needed(stamp.migration.abs(), stamp.relative.max(TOLERANCE), MOST_ORDERS + 1)
}
