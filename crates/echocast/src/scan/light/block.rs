//! One block of beams with one ray and one return each, step by step.

use super::camera::LookMemory;
use super::returns::Gatherer;
use super::run::{Measuring, ScanPlan};
use super::split::{Axes, Splitter};
use crate::cloud::{Kept, Slices};
use crate::detect::{ReturnMode, Returns, Threshold};
use crate::echo::{
    Air, AirEcho, Answer, Contribution, Follower, Foremost, MirrorImage, PathEcho, PathLimits, Preferred,
};
use crate::emitter;
use crate::ground::cause::Cause;
use crate::ground::lanes::{LANES, MEDIUM, MISS, RayBatch};
use crate::sensor::{DepthCamera, Signals};
use crate::trace::{HitBatch, traced};
use echocast_kernels::light;
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Beams `first .. first + count` and the rows they may fill.
pub(super) struct Task<'a> {
    pub scan: &'a ScanPlan<'a>,
    pub first: usize,
    pub count: usize,
    pub rows: Slices<'a>,
}

impl Task<'_> {
    /// Fills rows, working in `block`; returns how many.
    pub fn run(mut self, block: &mut Block) -> usize {
        let mut filled = 0;
        for start in (0..self.count).step_by(LANES) {
            let beam = self.first + start;
            let (count, rows) = (LANES.min(self.count - start), self.rows.rows_after(filled));
            filled += match self.scan.signals {
                Some(signals) if self.scan.has_signals => block.scan_signals(self.scan, signals, beam, count, rows),
                splits => block.scan(self.scan, splits, beam, count, rows),
            };
        }
        filled
    }
}

/// The beam, and which of its returns, of each lane of a block.
#[repr(C, align(64))]
pub(super) struct BeamLanes {
    pub beam: [u32; LANES],
    /// Counted from 0; random draws of a return depend on it.
    pub number: [u32; LANES],
    pub return_number: [u8; LANES],
    pub return_count: [u8; LANES],
    /// The first beam, where lanes are consecutive beams with one return each.
    pub first: Option<usize>,
}

impl BeamLanes {
    fn new() -> Self {
        BeamLanes {
            beam: [0; LANES],
            number: [0; LANES],
            return_number: [1; LANES],
            return_count: [1; LANES],
            first: None,
        }
    }

    /// Sets the lanes to the beams from `first` on, one return each.
    pub fn start_at(&mut self, first: usize) {
        self.first = Some(first);
        for lane in 0..LANES {
            self.beam[lane] = (first + lane) as u32;
        }
    }

    /// The values that the first `count` lanes have in a `column` of the table of beams.
    pub fn take<T: Copy + Default>(&self, column: &[T], count: usize) -> [T; LANES] {
        let mut values = [T::default(); LANES];
        match self.first {
            Some(first) => values[..count].copy_from_slice(&column[first..first + count]),
            None => {
                for lane in 0..count {
                    values[lane] = column[self.beam[lane] as usize];
                }
            }
        }
        values
    }
}

thread_local! {
    /// Working memory of this thread, kept from chunk to chunk and from scan to scan.
    static BLOCK: Cell<Option<Box<Block>>> = const { Cell::new(None) };
}

/// Runs `work`, a chunk of `scan`, in the working memory of this thread.
pub(super) fn with_block<R>(scan: &ScanPlan, work: impl FnOnce(&mut Block) -> R) -> R {
    // A thread that is ending has none any more.
    let mut block = BLOCK.try_with(Cell::take).ok().flatten().unwrap_or_else(boxed);
    block.renew();
    let before = traced();
    let result = work(&mut block);
    scan.rays.fetch_add(traced() - before, Ordering::Relaxed);
    let _ = BLOCK.try_with(|own| own.set(Some(block)));
    result
}

/// Heap memory for what is too large for the stacks of host programs, made here so that the stack used to make it is
/// free again.
#[cold]
#[inline(never)]
pub(super) fn boxed<T: Default>() -> Box<T> {
    Box::default()
}

/// As `boxed`, for what is seen directly.
#[cold]
#[inline(never)]
pub(super) fn no_images() -> Box<[MirrorImage; LANES]> {
    Box::new([MirrorImage::DIRECT; LANES])
}

/// The intermediate results of one block of beams: the table in the crate's documentation, column by column.
#[repr(C, align(64))]
pub(super) struct Block {
    pub rays: RayBatch,
    pub hits: HitBatch,
    pub surfaces: Contribution,
    pub answer: Answer,
    pub rho_eff: [f32; LANES],
    /// Ranges that a depth camera forms from its light, before errors, m.
    pub formed: [f32; LANES],
    pub measured: [f32; LANES],
    pub intensity: [f32; LANES],
    /// Angle by which a beam is reported rotated counter-clockwise, rad.
    pub turn: [f32; LANES],
    pub scratch: [f32; LANES],
    pub lanes: BeamLanes,
    pub kept: Kept,
    /// The rays of the beams as reported, where they differ from `rays`.
    pub reported: Option<Box<RayBatch>>,
    /// Apparent motion of what lanes see, where mirrors or glass are on the path, if requested.
    pub images: Option<Box<[MirrorImage; LANES]>>,
    /// Buffers to trace light, where a scene has mirrors or glass.
    pub paths: Option<Box<Follower>>,
    /// Buffers for beams of several rays or returns.
    pub gatherer: Option<Box<Gatherer>>,
    /// Buffers for beams that are several rays where others are one.
    pub parts: Option<Box<Gatherer>>,
    pub splitter: Option<Box<Splitter>>,
    /// Buffers of a depth camera for rays from other points.
    pub looks: Option<Box<LookMemory>>,
}

impl Default for Block {
    fn default() -> Self {
        Block {
            lanes: BeamLanes::new(),
            rays: RayBatch::default(),
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
            rho_eff: [0.0; LANES],
            formed: [0.0; LANES],
            measured: [0.0; LANES],
            intensity: [0.0; LANES],
            turn: [0.0; LANES],
            kept: Kept::new(),
            scratch: [0.0; LANES],
            answer: Answer::new(),
            reported: None,
            images: None,
            paths: None,
            gatherer: None,
            parts: None,
            splitter: None,
            looks: None,
        }
    }
}

impl Block {
    /// Resets all that a scan does not set itself, whatever scan the block was used for.
    #[inline(never)]
    fn renew(&mut self) {
        self.lanes = BeamLanes::new();
        self.surfaces = Contribution::new();
        self.turn = [0.0; LANES];
        self.answer = Answer::new();
    }

    /// Scans beams `first .. first + count` (at most [`LANES`]) and fills the first of `rows`; returns how many.
    /// `splits`: how beams that hit more than one place are formed, if these are several rays.
    fn scan(
        &mut self,
        scan: &ScanPlan,
        splits: Option<&Arc<Signals>>,
        first: usize,
        count: usize,
        rows: Slices,
    ) -> usize {
        self.lanes.start_at(first);
        self.aim(scan, first, count);
        self.trace(scan, count);
        let mut splitter = splits.map(|signals| {
            let mut splitter = self.splitter.take().unwrap_or_else(boxed);
            self.split(scan, signals, &mut splitter, first, count);
            splitter
        });
        if scan.world.paths.is_some()
            || scan.world.air.is_some()
            || scan.detect.alarms.is_some()
            || scan.camera.is_some()
            || splits.is_some()
        {
            self.answer.reset();
            self.answer.end = self.hits.range;
        }
        if !scan.detect.efficiency.is_empty() {
            for lane in 0..count {
                self.answer.efficiency[lane] = scan.efficiency_of(self.lanes.beam[lane]);
            }
        }
        if let Some(limits) = scan.world.paths {
            self.follow(scan, limits, first, count);
        }
        if let Some(eye) = scan.camera.and_then(|camera| camera.second_eye) {
            self.shadow(scan, eye, count);
        }
        let answers = scan.world.air.is_some_and(Air::answers) || scan.detect.alarms.is_some();
        let is_split = splitter.as_ref().is_some_and(|splitter| !splitter.found.is_empty());
        let needs_surfaces = !scan.options.organised && !answers && !is_split;
        if needs_surfaces && self.hits.surface[..count].iter().all(|&surface| surface == MISS) {
            self.splitter = splitter;
            return 0;
        }
        self.detect(scan, count);
        if let (Some(signals), Some(splitter)) = (splits, &mut splitter) {
            self.replace(scan, signals, splitter, first);
        }
        self.splitter = splitter;
        self.measure(scan, count);
        self.collect(scan, count, rows)
    }

    /// Finds the beams that are several rays, and dims the light of oblique surfaces for all others.
    fn split(&mut self, scan: &ScanPlan, signals: &Signals, splitter: &mut Splitter, first: usize, count: usize) {
        let Block { rays, hits, surfaces, scratch: power, .. } = self;
        power.fill(1.0);
        light::contribute(
            &hits.surface,
            &hits.range,
            &surfaces.reflectance,
            &surfaces.cos_incidence,
            &[1.0; LANES],
            power,
        );
        let cos_incidence = &surfaces.cos_incidence;
        splitter.find(scan, signals, Axes { first, count, rays, hits, cos_incidence, power });
        light::dim(&mut surfaces.reflectance, &splitter.oblique);
    }

    /// Steps 4 and 5: every beam at the pose of its own time.
    pub fn aim(&mut self, scan: &ScanPlan, first: usize, count: usize) {
        let nominal = scan.aim.beams.directions(first, count);
        let rays = |directions, rays: &mut RayBatch| {
            scan.aim.pose.rays(scan.aim.beams, first, directions, scan.aim.reach, rays);
        };
        if let Some(clock) = &scan.aim.clock {
            clock.set(&scan.aim.beams.time[first..first + count], &mut self.rays.time);
        }
        if !scan.points_elsewhere() {
            return rays(nominal, &mut self.rays);
        }
        rays(nominal, self.reported.get_or_insert_with(boxed));
        let (mut pointed, beams) = ([[0.0; LANES]; 3], &self.lanes.beam[..count]);
        match scan.camera.filter(|camera| camera.aside.is_some()) {
            Some(camera) => camera.jitter_directions(&scan.rng, beams, nominal, &mut pointed),
            None => emitter::scatter(&scan.rng, beams, scan.measure.errors.pointing_sigma, nominal, &mut pointed),
        }
        rays(pointed.each_ref().map(|axis| &axis[..count]), &mut self.rays);
    }

    /// Steps 6 and 8: what the rays hit, and its properties.
    pub fn trace(&mut self, scan: &ScanPlan, count: usize) {
        let Block { rays, hits, surfaces, .. } = self;
        hits.trace(scan.world.scene, rays, count, scan.aim.coherent, scan.world.sight);
        if scan.world.needs_normals {
            surfaces.face(scan.world.scene, rays, hits, count, scan.world.smooth);
        }
        if scan.world.needs_lookup {
            surfaces.look_up(
                &scan.world.scene.surfaces,
                &scan.world.reflectances,
                hits,
                0..count,
                scan.world.requested,
            );
        }
    }

    /// Step 7: beams that hit a mirror or glass see what is behind it. Of all echoes of a beam the one that the return
    /// mode prefers replaces that of the surface.
    #[inline(never)]
    fn follow(&mut self, scan: &ScanPlan, limits: PathLimits, first: usize, count: usize) {
        let Block { rays, hits, surfaces, answer, paths, images, .. } = self;
        (answer.first_category, answer.first_instance) = (surfaces.category_id, surfaces.instance_id);
        let mut lanes = [0; LANES];
        let found = scan.going_on(&hits.surface, count, &mut lanes);
        let lanes = &lanes[..found];
        if lanes.is_empty() {
            return;
        }
        let follower = paths.get_or_insert_with(boxed);
        follower.forget_images();
        follower.begin(rays, hits, surfaces, lanes);
        // The paper's program applies weather only to the whole path.
        let air = scan.world.air.filter(|_| !scan.detect.keeps_undetected);
        let around = scan.surroundings(air, limits, scan.world.requested, rays);
        let Answer { efficiency, cause, bounces, dimmed, .. } = answer;
        let (mut strength, mut image) = ([f32::NEG_INFINITY; LANES], [0; LANES]);
        let prefer = |echo: &PathEcho| {
            let rho_eff = echo.reflectance * echo.cos_incidence * efficiency[echo.lane];
            let seen = scan.detect.keeps_undetected || {
                let beam = (first + echo.lane) as u32;
                let noise = scan.detect.threshold.noise(&scan.rng, beam, echo.range.to_bits());
                scan.detect.threshold.detects(rho_eff, echo.range, noise)
            };
            let [least, _] = scan.limits_of(first + echo.lane);
            let within = echo.range >= least && echo.range <= rays.range_max[echo.lane];
            (seen && within).then(|| match scan.detect.mode {
                // The stronger one, whatever its range.
                _ if scan.detect.keeps_undetected => rho_eff,
                ReturnMode::First => -echo.range,
                ReturnMode::Last => echo.range,
                _ => rho_eff / (echo.range * echo.range),
            })
        };
        let mut preferred = Preferred {
            strength: &mut strength,
            hits,
            surfaces,
            cause,
            bounces,
            image: &mut image,
            prefer,
            least_power: if scan.detect.keeps_undetected { 0.0 } else { scan.detect.threshold.faintest() },
            strongest: !scan.detect.keeps_undetected
                && !matches!(scan.detect.mode, ReturnMode::First | ReturnMode::Last),
        };
        follower.follow(&around, &mut preferred);
        if scan.world.motion {
            let images = images.get_or_insert_with(no_images);
            lanes.iter().map(|&lane| usize::from(lane)).for_each(|lane| images[lane] = *follower.image(image[lane]));
        }
        for lane in lanes.iter().map(|&lane| usize::from(lane)) {
            if strength[lane] == f32::NEG_INFINITY {
                hits.surface[lane] = MISS;
            } else {
                dimmed[lane] = true;
            }
        }
    }

    /// Steps 9 and 10: which echo the instrument reports.
    fn detect(&mut self, scan: &ScanPlan, count: usize) {
        if let Some(air) = scan.world.air.filter(|_| !scan.detect.keeps_undetected) {
            air.dim(&self.rays, &self.hits.range, count, &mut self.scratch);
            for lane in 0..LANES {
                if self.answer.dimmed[lane] {
                    self.scratch[lane] = 1.0;
                }
            }
            light::dim(&mut self.surfaces.reflectance, &self.scratch);
        }
        if !scan.detect.efficiency.is_empty() {
            light::dim(&mut self.surfaces.reflectance, &self.answer.efficiency);
        }
        if let Some(camera) = scan.camera.filter(|camera| camera.dims()) {
            self.dim(scan, camera, count);
        }
        let Block { lanes, hits, surfaces, rho_eff, intensity, scratch, .. } = self;
        light::product(&surfaces.reflectance, &surfaces.cos_incidence, rho_eff);
        let mut shown = &surfaces.reflectance;
        if !scan.detect.efficiency.is_empty() {
            for lane in 0..count {
                scratch[lane] = shown[lane] / scan.shown_of(lanes.beam[lane]);
            }
            shown = scratch;
        }
        scan.measure.intensity.of_all(shown, &surfaces.cos_incidence, &hits.range, intensity);
        if let Some(air) = scan.world.air.filter(|_| scan.detect.keeps_undetected) {
            self.weather_of_the_program(scan, air, count);
        } else if *scan.detect.threshold != Threshold::Open {
            let mut noise = [0.0; LANES];
            scan.detect.threshold.noises(&scan.rng, &self.lanes.beam[..count], &mut noise[..count]);
            if scan.world.paths.is_some() {
                // What is seen in mirrors and through glass has been detected already.
                for lane in 0..LANES {
                    if self.answer.dimmed[lane] {
                        noise[lane] = f32::INFINITY;
                    }
                }
            }
            let mut seen = [true; LANES];
            scan.detect.threshold.detect(rho_eff, &hits.range, &noise, &mut seen);
            if scan.detect.keeps_undetected {
                for lane in 0..LANES {
                    intensity[lane] = if seen[lane] { intensity[lane] } else { 0.0 };
                }
            } else {
                light::forget(&seen, &mut hits.surface, intensity);
            }
        }
        if !scan.camera.is_some_and(DepthCamera::wraps) {
            scan.limit(&mut self.hits.surface, &self.hits.range, &self.lanes, count);
        }
        if scan.detect.alarms.is_some() || scan.world.air.is_some_and(Air::answers) {
            self.answer(scan, count);
        }
        if let Some(camera) = scan.camera {
            self.form(scan, camera, count);
        }
    }

    /// Step 10: measurement errors.
    pub fn measure(&mut self, scan: &ScanPlan, count: usize) {
        let Block { lanes, hits, rho_eff, formed, measured, intensity, turn, scratch, .. } = self;
        let Measuring { errors, saturation, limited, flickers, intensity: model } = &scan.measure;
        let channels = lanes.take(&scan.aim.beams.channel, count);
        let returns = Returns {
            beams: &lanes.beam[..count],
            numbers: &lanes.number[..count],
            channels: &channels[..count],
            rho_eff,
            range: &hits.range,
        };
        let formed = if scan.camera.is_some() { &*formed } else { &hits.range };
        let rain = scan.world.air.map_or(0.0, Air::range_noise);
        errors.measure(&scan.rng, &returns, formed, rain, measured, flickers.then_some(&mut *scratch));
        if *flickers {
            for lane in 0..LANES {
                let most = saturation.map_or(f32::INFINITY, |most| most * hits.range[lane] * hits.range[lane]);
                scratch[lane] *= rho_eff[lane].min(most);
            }
            if !scan.detect.efficiency.is_empty() {
                for lane in 0..count {
                    scratch[lane] /= scan.shown_of(lanes.beam[lane]);
                }
            }
            model.of_all(scratch, &[1.0; LANES], &hits.range, intensity);
        } else if let Some(most) = saturation {
            for lane in 0..LANES {
                let most = most * hits.range[lane] * hits.range[lane];
                if rho_eff[lane] > most {
                    let shown = most / scan.shown_of(lanes.beam[lane]);
                    intensity[lane] = model.of(shown, 1.0, hits.range[lane]);
                }
            }
        }
        if *limited {
            scan.limit(&mut hits.surface, measured, lanes, count);
        }
        errors.lose(&scan.rng, &returns, &mut hits.surface);
        if errors.turn_beams() {
            let [x, y] = [&scan.aim.beams.dir_x, &scan.aim.beams.dir_y].map(|axis| lanes.take(axis, count));
            errors.turn(&scan.rng, &lanes.beam[..count], [&x[..count], &y[..count]], &mut turn[..count]);
        }
    }

    /// Rain and dust as computed by the paper's program: intensity is as without them, or 0 where nothing is detected.
    #[inline(never)]
    fn weather_of_the_program(&mut self, scan: &ScanPlan, air: &Air, count: usize) {
        let Block { hits, rho_eff, intensity, answer, .. } = self;
        for lane in 0..count {
            let limit = scan.detect.threshold.limit_of_the_program(hits.range[lane]);
            let (tested, cloud) = air.as_the_program(hits.range[lane], rho_eff[lane], limit);
            if let Some((range, backscatter)) = cloud {
                (hits.range[lane], intensity[lane]) = (range, backscatter);
                answer.cause[lane] = Cause::Dust as u8;
            }
            if *scan.detect.threshold != Threshold::Open && tested <= limit {
                intensity[lane] = 0.0;
            }
        }
    }

    /// Echoes of the air and noise in place of surfaces, where the instrument prefers them.
    fn answer(&mut self, scan: &ScanPlan, count: usize) {
        let Block { lanes, rays, hits, surfaces, rho_eff, intensity, answer, .. } = self;
        (answer.range, answer.rho_eff) = (hits.range, *rho_eff);
        let beams = &lanes.beam[..count];
        if let Some(air) = scan.world.air.filter(|air| air.answers()) {
            let mut foremost = Foremost {
                answer,
                surface: &mut hits.surface,
                mode: scan.detect.mode,
                threshold: scan.detect.threshold,
                limits: &|lane| scan.limits_of(beams[lane] as usize),
                rng: &scan.rng,
                beams,
            };
            air.answer(rays, &scan.rng, beams, &mut foremost);
        }
        if let Some(alarms) = &scan.detect.alarms {
            alarms.of_beams(
                &scan.rng,
                beams,
                scan.detect.range[1],
                |beam| scan.limits_of(beam as usize),
                |lane, range, rho_eff| {
                    let echo = AirEcho { range, rho_eff };
                    answer.offer(scan.detect.mode, &mut hits.surface, lane, echo, Cause::FalseAlarm);
                },
            );
        }
        (hits.range, *rho_eff) = (answer.range, answer.rho_eff);
        for lane in 0..count {
            if hits.surface[lane] == MEDIUM {
                surfaces.clear(lane);
                (answer.first_category[lane], answer.first_instance[lane], answer.bounces[lane]) = (0, 0, 0);
                (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = (f32::NAN, f32::NAN, f32::NAN);
                let shown = rho_eff[lane] / scan.shown_of(lanes.beam[lane]);
                intensity[lane] = scan.measure.intensity.of(shown, 1.0, hits.range[lane]);
            }
        }
    }
}
