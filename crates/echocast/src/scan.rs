//! The driver: one scan, step by step.

use crate::cause::Cause;
use crate::cloud::{Columns, Field, FieldSet, Frame, Kept, PointCloud, Slices};
use crate::detect::{Noise, RangeError, Threshold};
use crate::echo::{
    AIR, Air, Answer, Chosen, Contribution, Follower, IntensityModel, PathEcho, PathLimits, Surroundings, Wanted,
};
use crate::emitter::{Aim, BeamTable, Trajectory};
use crate::error::{Error, Result};
use crate::material::{Mirrors, Optics, ReflectanceSource, Reflectances};
use crate::medium::{Environment, Weather};
use crate::parallel;
use crate::rng::{Draw, Rng};
use crate::sensor::{ReturnMode, Sensor};
use crate::trace::{BuiltScene, CHUNK, HitBatch, LANES, MISS, RayBatch, Tables};
use pulp::{Arch, Simd, WithSimd};
use std::f32::consts::PI;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

/// Which model set a scan follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Physics as we know it.
    #[default]
    Physical,
    /// The equations of the paper as printed; glass is physical.
    Paper,
    /// What the paper's program computes; glass is physical.
    Blainder,
}

/// Order of the points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Rising frame, beam, return.
    #[default]
    Beam,
    /// Rising time, as drivers publish.
    Time,
}

/// How to scan; every setting has a working default.
#[derive(Clone, Debug)]
pub struct ScanOptions {
    /// Columns to compute.
    pub fields: FieldSet,
    /// Seed of all random draws.
    pub seed: u64,
    /// Frame index; it changes the random draws and fills the `frame` column.
    pub frame: u32,
    /// Time at which the scan starts, s since the start of the run.
    pub start_time: f64,
    /// Time of the trajectory at which the scan starts, s; `None`: `start_time`.
    pub trajectory_time: Option<f64>,
    /// Keep misses, so that every beam has its row.
    pub organised: bool,
    /// Coordinates of the output points.
    pub coordinates: Frame,
    /// Order of the points.
    pub order: Order,
    /// Model set.
    pub profile: Profile,
    /// Where reflectance comes from when the material does not say; `None`: as the profile has it
    /// (`blainder`: alpha, the others: luminance).
    pub reflectance_source: Option<ReflectanceSource>,
    /// Objects are seen whose mask shares a bit with this.
    pub mask: u32,
    /// Most mirrors and faces of glass that a path of light is followed over and through.
    pub specular_depth: u8,
    /// What is between sensor and surfaces; it must be sound, see [`Environment::check`].
    pub environment: Environment,
}

impl Default for ScanOptions {
    fn default() -> Self {
        ScanOptions {
            fields: FieldSet::default(),
            seed: 0,
            frame: 0,
            start_time: 0.0,
            trajectory_time: None,
            organised: false,
            coordinates: Frame::World,
            order: Order::Beam,
            profile: Profile::Physical,
            reflectance_source: None,
            mask: u32::MAX,
            specular_depth: 10,
            environment: Environment::default(),
        }
    }
}

impl ScanOptions {
    /// The same with `seed`.
    #[must_use]
    pub fn seed(self, seed: u64) -> Self {
        ScanOptions { seed, ..self }
    }

    fn trajectory_time(&self) -> f64 {
        self.trajectory_time.unwrap_or(self.start_time)
    }

    /// The same with `fields`.
    #[must_use]
    pub fn fields(self, fields: FieldSet) -> Self {
        ScanOptions { fields, ..self }
    }
}

/// Columns that say which surface it is.
const LABELS: [Field; 6] = [
    Field::CategoryId,
    Field::PartId,
    Field::InstanceId,
    Field::MaterialId,
    Field::FirstCategoryId,
    Field::FirstInstanceId,
];

/// Chunks per thread between two passes that close the gaps of misses: few enough that their rows are
/// still in the cache, enough to keep the thread busy.
const CHUNKS_PER_THREAD: usize = 8;

/// Most chunks between two such passes.
const MOST_CHUNKS: usize = 512;

/// Hears how much of the work is done, 0 to 1, and says whether to go on.
pub type Progress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

impl BuiltScene {
    /// Scans once with `sensor` along `trajectory`.
    ///
    /// # Errors
    /// A pose that is not finite, an organised cloud ordered by time, no memory for the columns.
    pub fn scan(&self, sensor: &Sensor, trajectory: &Trajectory, options: &ScanOptions) -> Result<PointCloud> {
        let mut cloud = PointCloud::default();
        self.scan_into(sensor, trajectory, options, &mut cloud)?;
        Ok(cloud)
    }

    /// [`BuiltScene::scan`] into the memory of `cloud`: a scan like the one before it, in the order of beams and in a
    /// scene without weather, mirrors and glass, allocates nothing.
    ///
    /// # Errors
    /// As [`BuiltScene::scan`]. `cloud` stays as it was when pose or options are at fault; without memory it is empty.
    pub fn scan_into(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
    ) -> Result<()> {
        self.scan_watched(sensor, trajectory, options, cloud, None)
    }

    /// [`BuiltScene::scan_into`] that tells `progress`, on this thread, how far it is, some times in a long scan.
    ///
    /// # Errors
    /// As [`BuiltScene::scan_into`], and [`Error::Cancelled`] when `progress` wants no more; then `cloud` is empty.
    pub fn scan_with_progress(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
        progress: Progress,
    ) -> Result<()> {
        self.scan_watched(sensor, trajectory, options, cloud, Some(progress))
    }

    fn scan_watched(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
        progress: Option<Progress>,
    ) -> Result<()> {
        let start = trajectory.at(options.trajectory_time());
        if !(start.position.is_finite() && start.orientation.is_finite()) {
            return Err(Error::invalid("pose", format!("{start:?}"), "finite numbers, a quaternion that is not 0"));
        }
        options.environment.check()?;
        if options.organised && options.order == Order::Time {
            return Err(Error::invalid(
                "order",
                "time",
                "beam for an organised cloud, whose rows and columns are beams",
            ));
        }
        let scanned = Scan::new(&self.0, sensor, trajectory, options).run(cloud, progress);
        if scanned.is_err() {
            *cloud = PointCloud::default();
        }
        scanned
    }
}

/// Everything that is the same for all beams of one scan.
struct Scan<'a> {
    scene: &'a Tables,
    beams: &'a BeamTable,
    options: &'a ScanOptions,
    trajectory: &'a Trajectory,
    aim: Aim<'a>,
    reflectances: Arc<Reflectances>,
    threshold: Threshold,
    intensity: IntensityModel,
    range_error: RangeError,
    rng: Rng,
    azimuth_sigma: f32,
    dropout: f32,
    range_min: f32,
    range_max: f32,
    coherent: bool,
    /// Whether normals or what depends on them are asked for.
    wants_normals: bool,
    /// Whether incidence follows the interpolated shading normal rather than the triangle's.
    smooth: bool,
    /// Whether labels, colours or reflectances are asked for.
    wants_surfaces: bool,
    wanted: Wanted,
    /// Undetected echoes stay, with intensity 0.
    keeps_undetected: bool,
    /// Whether the range limits hold for what is measured too; the paper's program adds its errors afterwards.
    limits_measured: bool,
    /// What is in the air, if anything.
    air: Option<Air>,
    /// How far light is followed over mirrors and through glass; `None` where nothing depends on it.
    paths: Option<PathLimits>,
    mode: ReturnMode,
}

impl<'a> Scan<'a> {
    fn new(scene: &'a Tables, sensor: &'a Sensor, trajectory: &'a Trajectory, options: &'a ScanOptions) -> Self {
        let fields = options.fields;
        let blainder = options.profile == Profile::Blainder;
        let intensity = match options.profile {
            Profile::Physical => IntensityModel::Encoded(sensor.intensity),
            Profile::Paper => IntensityModel::PaperEq5,
            Profile::Blainder => IntensityModel::Blainder,
        };
        let source = options.reflectance_source.unwrap_or(if blainder {
            ReflectanceSource::Alpha
        } else {
            ReflectanceSource::Luminance
        });
        let threshold = Threshold::new(sensor.detection, blainder);
        let beams = sensor.beams();
        let as_the_paper = options.profile != Profile::Physical;
        let weather = Weather::new(&options.environment, sensor.wavelength_nm, as_the_paper, scene.origin);
        let air = Air::new(weather, sensor.receiver(threshold), sensor.return_mode(), !blainder);
        let mirrors = match options.profile {
            Profile::Physical => Mirrors::Real,
            Profile::Paper => Mirrors::Lossless,
            Profile::Blainder => Mirrors::OfTheProgram,
        };
        let reflectances = scene.surfaces.reflectances(sensor.wavelength_nm, source, mirrors);
        let paths = reflectances.go_on.then_some(PathLimits {
            depth: options.specular_depth,
            least: 1e-6,
            geometric: as_the_paper,
            cosine_after: !blainder,
        });
        let wants_echo =
            air.is_some() || paths.is_some() || threshold != Threshold::Open || fields.contains(Field::Intensity);
        let wants_normals =
            wants_echo || fields.contains_any(&[Field::NormalX, Field::NormalY, Field::NormalZ, Field::CosIncidence]);
        let colors = fields.contains_any(&[Field::Red, Field::Green, Field::Blue]);
        let wants_surfaces = wants_echo || fields.contains_any(&LABELS) || colors;
        Scan {
            scene,
            beams,
            options,
            trajectory,
            aim: Aim::new(trajectory, options.trajectory_time(), scene.origin),
            reflectances,
            threshold,
            intensity,
            range_error: RangeError::new(&sensor.noise, sensor.range_resolution_m, threshold),
            rng: Rng::new(options.seed, options.frame),
            azimuth_sigma: sensor.noise.azimuth_sigma_deg.to_radians() as f32,
            dropout: sensor.noise.dropout as f32,
            range_min: sensor.range_min_m as f32,
            range_max: sensor.range_max_m as f32,
            coherent: beams.is_coherent(),
            wants_normals,
            smooth: !blainder && scene.surfaces.has_shading_normals,
            wants_surfaces,
            wanted: Wanted { colors, reflectance: wants_echo },
            keeps_undetected: blainder,
            limits_measured: options.profile == Profile::Physical
                && (sensor.noise != Noise::default() || air.as_ref().is_some_and(|air| air.range_noise() > 0.0)),
            air,
            paths,
            mode: sensor.return_mode(),
        }
    }

    /// Fills `cloud`: windows of chunks in parallel, each chunk into its own rows, then the gaps of
    /// misses are closed in order.
    fn run(&self, cloud: &mut PointCloud, progress: Option<Progress>) -> Result<()> {
        let options = self.options;
        let beams = self.beams.len();
        let sorted = options.order == Order::Time;
        let computed = if sorted { options.fields.with(Field::Time) } else { options.fields };
        let columns = &mut cloud.columns;
        columns.resize(computed, beams)?;
        let engine = &self.scene.engine;
        // Who wants to hear of the scan hears of it often.
        let chunks_per_thread = if progress.is_some() { 1 } else { CHUNKS_PER_THREAD };
        let window = CHUNK * (chunks_per_thread * engine.threads()).min(MOST_CHUNKS);
        let windows = (0..beams).step_by(window).map(|first| first..(first + window).min(beams));
        let rows = match progress {
            None => engine.install(|| windows.fold(0, |rows, beams| self.window(beams, rows, columns))),
            Some(progress) => {
                let mut rows = 0;
                for window in windows {
                    let done = window.end;
                    rows = engine.install(|| self.window(window, rows, columns));
                    // What is finished is not thrown away.
                    if progress(done as f64 / beams as f64).is_break() && done < beams {
                        return Err(Error::Cancelled);
                    }
                }
                rows
            }
        };
        cloud.columns.resize(computed, rows)?;
        cloud.len = rows;
        if sorted {
            cloud.sort_by_time()?;
            cloud.columns.resize(options.fields, rows)?;
        }
        cloud.fields = options.fields;
        cloud.frame = options.coordinates;
        cloud.origin = match options.coordinates {
            Frame::World => self.scene.origin,
            Frame::Sensor => glam::DVec3::ZERO,
        };
        cloud.organised = options.organised.then_some([self.beams.rows, self.beams.columns]);
        cloud.sensor_pose = self.trajectory.at(options.trajectory_time());
        cloud.intensity_full_scale = self.intensity.full_scale();
        cloud.labels = self.scene.surfaces.labels.clone();
        Ok(())
    }

    /// Scans some beams into the rows after the first `rows`; returns how many rows there are then.
    fn window(&self, beams: Range<usize>, mut rows: usize, columns: &mut Columns) -> usize {
        // Right after the rows there are: memory beyond the last return is never touched.
        let free = columns.slices(rows, rows + beams.len());
        let mut found = [0; MOST_CHUNKS];
        let found = &mut found[..beams.len().div_ceil(CHUNK)];
        self.chunks(Arch::new(), beams, free, found);
        let mut from = rows;
        for &mut count in found {
            if rows != from {
                columns.move_rows(from, rows, count);
            }
            rows += count;
            from += CHUNK;
        }
        rows
    }

    /// Scans chunks of beams, each into its own of `rows`, and counts in `found` those that it fills.
    fn chunks(&self, arch: Arch, beams: Range<usize>, rows: Slices, found: &mut [usize]) {
        if let [found] = found {
            let task = Task { scan: self, first: beams.start, count: beams.len(), rows };
            *found = arch.dispatch(TaskOn { task, block: &mut Block::new() });
            return;
        }
        let half = found.len() / 2;
        let middle = beams.start + half * CHUNK;
        let (left_rows, right_rows) = rows.split_at(half * CHUNK);
        let (left, right) = found.split_at_mut(half);
        parallel::join(
            || self.chunks(arch, beams.start..middle, left_rows, left),
            || self.chunks(arch, middle..beams.end, right_rows, right),
        );
    }
}

impl Scan<'_> {
    /// Takes away the hits whose range is none that the instrument reports.
    #[inline(always)]
    fn limit(&self, surface: &mut [u32; LANES], ranges: &[f32; LANES], first: usize, count: usize) {
        let span = first..first + count;
        match (self.beams.range_min.get(span.clone()), self.beams.range_max.get(span)) {
            (None, None) => {
                for lane in 0..LANES {
                    // Written so that a miss, at an infinite range or none, stays one.
                    if !(ranges[lane] > 0.0 && ranges[lane] >= self.range_min && ranges[lane] <= self.range_max) {
                        surface[lane] = MISS;
                    }
                }
            }
            (low, high) => {
                for lane in 0..count {
                    let low = low.map_or(self.range_min, |limits| limits[lane]);
                    let high = high.map_or(self.range_max, |limits| limits[lane]);
                    if !(ranges[lane] > 0.0 && ranges[lane] >= low && ranges[lane] <= high) {
                        surface[lane] = MISS;
                    }
                }
            }
        }
    }
}

/// Beams `first .. first + count` and the rows they may fill.
struct Task<'a> {
    scan: &'a Scan<'a>,
    first: usize,
    count: usize,
    rows: Slices<'a>,
}

/// A task with the memory it works in, to be run with the widest vector instructions of this machine.
struct TaskOn<'a, 'b> {
    task: Task<'a>,
    block: &'b mut Block,
}

impl WithSimd for TaskOn<'_, '_> {
    type Output = usize;

    /// The rows filled.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        let Task { scan, first, count, mut rows } = self.task;
        let mut filled = 0;
        for start in (0..count).step_by(LANES) {
            let beam = first + start;
            filled += self.block.scan(scan, beam, LANES.min(count - start), rows.rows_after(filled));
        }
        filled
    }
}

/// The intermediate results of one block of beams: the table in the crate's documentation, column by column.
struct Block {
    rays: RayBatch,
    hits: HitBatch,
    surfaces: Contribution,
    rho_eff: [f32; LANES],
    measured: [f32; LANES],
    intensity: [f32; LANES],
    /// Angle by which a beam is reported turned to the left, rad.
    turn: [f32; LANES],
    kept: Kept,
    scratch: [f32; LANES],
    answer: Answer,
    /// Memory to follow light in, where a scene has mirrors or glass.
    paths: Option<Box<(Follower, Chosen)>>,
}

impl Block {
    fn new() -> Self {
        Block {
            rays: RayBatch::new(),
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
            rho_eff: [0.0; LANES],
            measured: [0.0; LANES],
            intensity: [0.0; LANES],
            turn: [0.0; LANES],
            kept: Kept::new(),
            scratch: [0.0; LANES],
            answer: Answer::new(),
            paths: None,
        }
    }

    /// Scans beams `first .. first + count` (at most [`LANES`]) and fills the first of `rows`; returns how many.
    #[inline(always)]
    fn scan(&mut self, scan: &Scan, first: usize, count: usize, rows: Slices) -> usize {
        self.aim(scan, first, count);
        self.trace(scan, count);
        if scan.paths.is_some() || scan.air.is_some() {
            self.answer.reset();
            self.answer.end = self.hits.range;
        }
        if let Some(limits) = scan.paths {
            self.follow(scan, limits, first, count);
        }
        let needs_surfaces = !scan.options.organised && !scan.air.as_ref().is_some_and(Air::answers);
        if needs_surfaces && self.hits.surface[..count].iter().all(|&surface| surface == MISS) {
            return 0;
        }
        self.detect(scan, first, count);
        self.collect(scan, first, count, rows)
    }

    /// Steps 4 and 5: every beam at the pose of its own time.
    #[inline(always)]
    fn aim(&mut self, scan: &Scan, first: usize, count: usize) {
        scan.aim.rays(scan.beams, first, count, scan.range_max, &mut self.rays);
    }

    /// Steps 6 and 8: what the rays hit and what it is like.
    #[inline(always)]
    fn trace(&mut self, scan: &Scan, count: usize) {
        let Block { rays, hits, surfaces, .. } = self;
        hits.trace(scan.scene, rays, count, scan.coherent, scan.options.mask);
        if scan.wants_normals {
            surfaces.face(scan.scene, rays, hits, count, scan.smooth);
        }
        if scan.wants_surfaces {
            surfaces.look_up(&scan.scene.surfaces, &scan.reflectances, hits, count, scan.wanted);
        }
    }

    /// Step 7: beams that meet a mirror or glass see what is behind it. Of all echoes of a beam the one that the return
    /// mode prefers takes the place of the surface.
    #[inline(never)]
    fn follow(&mut self, scan: &Scan, limits: PathLimits, first: usize, count: usize) {
        let Block { rays, hits, surfaces, answer, paths, .. } = self;
        (answer.first_category, answer.first_instance) = (surfaces.category_id, surfaces.instance_id);
        let goes_on = |surface| scan.scene.surfaces.optics(&scan.reflectances, surface).is_some_and(Optics::goes_on);
        if !hits.surface[..count].iter().any(|&surface| goes_on(surface)) {
            return;
        }
        let (follower, chosen) = &mut **paths.get_or_insert_with(|| Box::new((Follower::new(), Chosen::new())));
        let depth = |from, direction, travelled, length| {
            // The paper's program knows weather on the whole of the way alone.
            let air = scan.air.as_ref().filter(|_| !scan.keeps_undetected);
            air.map_or(0.0, |air| air.depth(from, direction, travelled, length))
        };
        let around = Surroundings {
            scene: scan.scene,
            reflectances: &scan.reflectances,
            mask: scan.options.mask,
            smooth: scan.smooth,
            wanted: scan.wanted,
            limits,
            range_max: &rays.range_max,
            least_power: scan.threshold.least_power().filter(|_| !scan.keeps_undetected).unwrap_or(0.0) as f32,
            strongest: !scan.keeps_undetected && !matches!(scan.mode, ReturnMode::First | ReturnMode::Last),
            depth: &depth,
        };
        follower.follow(&around, rays, hits, surfaces, count, chosen, |echo: &PathEcho| {
            let rho_eff = echo.reflectance * echo.cos_incidence;
            let seen = scan.keeps_undetected || scan.threshold.detects(rho_eff, echo.range);
            let least = scan.beams.range_min.get(first + echo.lane).copied().unwrap_or(scan.range_min);
            let within = echo.range >= least && echo.range <= rays.range_max[echo.lane];
            (seen && within).then(|| match scan.mode {
                // The brighter one, whatever its range.
                _ if scan.keeps_undetected => rho_eff,
                ReturnMode::First => -echo.range,
                ReturnMode::Last => echo.range,
                _ => rho_eff / (echo.range * echo.range),
            })
        });
        for lane in 0..count {
            if !goes_on(hits.surface[lane]) {
                continue;
            }
            if chosen.strength[lane] == f32::NEG_INFINITY {
                hits.surface[lane] = MISS;
                continue;
            }
            hits.take(lane, &chosen.hits, lane);
            surfaces.take(lane, &chosen.surfaces, lane);
            (answer.cause[lane], answer.bounces[lane]) = (chosen.cause[lane], chosen.bounces[lane]);
            answer.dimmed[lane] = true;
        }
    }

    /// Steps 9 and 10: what the instrument makes of it.
    #[inline(always)]
    fn detect(&mut self, scan: &Scan, first: usize, count: usize) {
        let beams = first as u32;
        if let Some(air) = scan.air.as_ref().filter(|_| !scan.keeps_undetected) {
            air.dim(&self.rays, &self.hits.range, count, &mut self.scratch);
            for lane in 0..LANES {
                if self.answer.dimmed[lane] {
                    self.scratch[lane] = 1.0;
                }
            }
            for lane in 0..LANES {
                self.surfaces.reflectance[lane] *= self.scratch[lane];
            }
        }
        let Block { hits, surfaces, rho_eff, intensity, .. } = self;
        for lane in 0..LANES {
            rho_eff[lane] = surfaces.reflectance[lane] * surfaces.cos_incidence[lane];
            let (rho, cos) = (surfaces.reflectance[lane], surfaces.cos_incidence[lane]);
            intensity[lane] = scan.intensity.of(rho, cos, hits.range[lane]);
        }
        if let Some(air) = scan.air.as_ref().filter(|_| scan.keeps_undetected) {
            self.weather_of_the_program(scan, air, count);
        } else if scan.threshold != Threshold::Open {
            for lane in 0..LANES {
                if !scan.threshold.detects(rho_eff[lane], hits.range[lane]) {
                    intensity[lane] = 0.0;
                    if !scan.keeps_undetected {
                        hits.surface[lane] = MISS;
                    }
                }
            }
        }
        scan.limit(&mut self.hits.surface, &self.hits.range, first, count);
        if let Some(air) = scan.air.as_ref().filter(|air| air.answers()) {
            self.answer(scan, air, first, count);
        }
        let Block { hits, rho_eff, measured, turn, scratch, .. } = self;
        scan.range_error.measure(&scan.rng, beams, &rho_eff[..count], &hits.range[..count], &mut measured[..count]);
        if let Some(sigma) = scan.air.as_ref().map(Air::range_noise).filter(|&sigma| sigma > 0.0) {
            scan.rng.normals(beams, Draw::RainRange, &mut scratch[..count]);
            for lane in 0..count {
                measured[lane] = (measured[lane] + sigma * hits.range[lane] * scratch[lane]).max(0.0);
            }
        }
        scan.range_error.round(&mut measured[..count]);
        if scan.limits_measured {
            scan.limit(&mut hits.surface, measured, first, count);
        }
        if scan.dropout > 0.0 {
            scan.rng.uniforms(beams, Draw::Dropout, 0, &mut scratch[..count]);
            for lane in 0..count {
                if scratch[lane] < scan.dropout {
                    hits.surface[lane] = MISS;
                }
            }
        }
        if scan.azimuth_sigma > 0.0 {
            scan.rng.normals(beams, Draw::AzimuthJitter, &mut turn[..count]);
            turn.iter_mut().for_each(|angle| *angle *= scan.azimuth_sigma);
        }
    }

    /// Rain and dust as the paper's program has them: intensity is as without, or 0 where nothing is seen.
    #[inline(never)]
    fn weather_of_the_program(&mut self, scan: &Scan, air: &Air, count: usize) {
        let Block { hits, rho_eff, intensity, answer, .. } = self;
        for lane in 0..count {
            let limit = scan.threshold.limit_of_the_program(hits.range[lane]);
            let (tested, cloud) = air.as_the_program(hits.range[lane], rho_eff[lane], limit);
            if let Some((range, backscatter)) = cloud {
                (hits.range[lane], intensity[lane]) = (range, backscatter);
                answer.cause[lane] = Cause::Dust as u8;
            }
            if scan.threshold != Threshold::Open && tested <= limit {
                intensity[lane] = 0.0;
            }
        }
    }

    /// Echoes of the air in place of surfaces, where the instrument prefers them.
    #[inline(always)]
    fn answer(&mut self, scan: &Scan, air: &Air, first: usize, count: usize) {
        let Block { rays, hits, surfaces, rho_eff, intensity, answer, .. } = self;
        (answer.range, answer.rho_eff) = (hits.range, *rho_eff);
        air.answer(rays, &scan.rng, first as u32, count, &mut hits.surface, answer);
        (hits.range, *rho_eff) = (answer.range, answer.rho_eff);
        for lane in 0..count {
            if hits.surface[lane] == AIR {
                surfaces.clear(lane);
                (answer.first_category[lane], answer.first_instance[lane], answer.bounces[lane]) = (0, 0, 0);
                (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = (f32::NAN, f32::NAN, f32::NAN);
                intensity[lane] = scan.intensity.of(rho_eff[lane], 1.0, hits.range[lane]);
            }
        }
    }

    /// Step 11: the columns that were asked for, row by row.
    #[inline(always)]
    fn collect(&mut self, scan: &Scan, first: usize, count: usize, rows: Slices) -> usize {
        let Block { rays, hits, surfaces, measured, intensity, turn, kept, scratch, answer, .. } = self;
        let surface = &hits.surface;
        let filled = kept.choose(surface, count, scan.options.organised);

        // Positions along the beam: in the world from where the beam starts, in the sensor frame from 0.
        let world = scan.options.coordinates == Frame::World;
        let beams = scan.beams;
        let range = first..first + count;
        if !world {
            (rays.org_x, rays.org_y, rays.org_z) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            rays.dir_x[..count].copy_from_slice(&beams.dir_x[range.clone()]);
            rays.dir_y[..count].copy_from_slice(&beams.dir_y[range.clone()]);
            rays.dir_z[..count].copy_from_slice(&beams.dir_z[range.clone()]);
        }
        for (org, dir, to) in [
            (&rays.org_x, &rays.dir_x, rows.true_x),
            (&rays.org_y, &rays.dir_y, rows.true_y),
            (&rays.org_z, &rays.dir_z, rows.true_z),
        ] {
            put_positions(kept, surface, [org, dir, &hits.range], scratch, to);
        }
        if scan.azimuth_sigma > 0.0 {
            for lane in 0..count {
                let up = if world { scan.aim.pose(beams, first + lane).0.z_axis } else { glam::Vec3::Z };
                let dir = glam::Vec3::new(rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]);
                let turned = glam::Quat::from_axis_angle(up, turn[lane]) * dir;
                (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = turned.into();
            }
        }
        for (org, dir, to) in
            [(&rays.org_x, &rays.dir_x, rows.x), (&rays.org_y, &rays.dir_y, rows.y), (&rays.org_z, &rays.dir_z, rows.z)]
        {
            put_positions(kept, surface, [org, dir, measured], scratch, to);
        }
        kept.put(surface, measured, rows.range);
        kept.put(surface, &hits.range, rows.true_range);
        kept.put(surface, intensity, rows.intensity);
        kept.put(surface, &surfaces.cos_incidence, rows.cos_incidence);
        if !rows.depth.is_empty() {
            for ((value, dir), range) in scratch.iter_mut().zip(&beams.dir_x[range.clone()]).zip(measured) {
                *value = dir * *range;
            }
            kept.put(surface, scratch, rows.depth);
        }
        if !world && scan.options.fields.contains_any(&[Field::NormalX, Field::NormalY, Field::NormalZ]) {
            for lane in 0..count {
                let (rotation, _) = scan.aim.pose(beams, first + lane);
                let normal = glam::Vec3::new(hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]);
                let normal = rotation.transpose() * normal;
                (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = normal.into();
            }
        }
        let surface = &hits.surface;
        kept.put(surface, &hits.normal_x, rows.normal_x);
        kept.put(surface, &hits.normal_y, rows.normal_y);
        kept.put(surface, &hits.normal_z, rows.normal_z);

        kept.put(surface, &surfaces.category_id, rows.category_id);
        kept.put(surface, &surfaces.part_id, rows.part_id);
        kept.put(surface, &surfaces.instance_id, rows.instance_id);
        kept.put(surface, &surfaces.material_id, rows.material_id);
        kept.put(surface, &surfaces.red, rows.red);
        kept.put(surface, &surfaces.green, rows.green);
        kept.put(surface, &surfaces.blue, rows.blue);
        kept.put(surface, &[1; LANES], rows.return_number);
        kept.put(surface, &[1; LANES], rows.return_count);
        kept.put(surface, &answer.cause, rows.cause);
        kept.put(surface, &answer.bounces, rows.bounces);
        if scan.paths.is_some() {
            kept.put(surface, &answer.first_category, rows.first_category_id);
            kept.put(surface, &answer.first_instance, rows.first_instance_id);
        } else {
            kept.put(surface, &surfaces.category_id, rows.first_category_id);
            kept.put(surface, &surfaces.instance_id, rows.first_instance_id);
        }

        // What is known of every beam, return or not.
        if !rows.channel.is_empty() {
            let mut channel = [0; LANES];
            channel[..count].copy_from_slice(&beams.channel[range.clone()]);
            kept.put_beam(&channel, rows.channel);
        }
        if !rows.time.is_empty() {
            let mut time = [0.0; LANES];
            for (value, offset) in time.iter_mut().zip(&beams.time[range.clone()]) {
                *value = scan.options.start_time + offset;
            }
            kept.put_beam(&time, rows.time);
        }
        if !rows.frame.is_empty() {
            kept.put_beam(&[scan.options.frame; LANES], rows.frame);
        }
        if !rows.beam.is_empty() || !rows.firing.is_empty() {
            let (mut beam, mut firing) = ([0; LANES], [0; LANES]);
            for lane in 0..LANES {
                beam[lane] = (first + lane) as u32;
                firing[lane] = beams.firing(beam[lane]);
            }
            kept.put_beam(&beam, rows.beam);
            kept.put_beam(&firing, rows.firing);
        }
        if !rows.azimuth.is_empty() || !rows.elevation.is_empty() {
            let (x, y, z) = (&beams.dir_x[range.clone()], &beams.dir_y[range.clone()], &beams.dir_z[range]);
            let (mut azimuth, mut elevation) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..count {
                let reported = y[lane].atan2(x[lane]) + turn[lane];
                // Straight back is -pi, whichever way it is rounded.
                azimuth[lane] = match reported {
                    PI.. => reported - 2.0 * PI,
                    _ if reported < -PI => reported + 2.0 * PI,
                    _ => reported,
                };
                elevation[lane] = z[lane].atan2(x[lane].hypot(y[lane]));
            }
            kept.put_beam(&azimuth, rows.azimuth);
            kept.put_beam(&elevation, rows.elevation);
        }
        filled
    }
}

/// Writes one coordinate of the points at `ranges` along rays from `org` in the direction `dir`.
#[inline(always)]
fn put_positions(
    kept: &Kept,
    surface: &[u32; LANES],
    [org, dir, ranges]: [&[f32; LANES]; 3],
    scratch: &mut [f32; LANES],
    to: &mut [f32],
) {
    if to.is_empty() {
        return;
    }
    for lane in 0..LANES {
        scratch[lane] = org[lane] + dir[lane] * ranges[lane];
    }
    kept.put(surface, scratch, to);
}
