//! One scan: what is the same for all its beams, and their chunks side by side on threads.

use super::block::{Lanes, Task, with_block};
use super::halo::Halos;
use crate::cloud::{Columns, Field, Frame, PointCloud, Slices};
use crate::detect::{AzimuthError, FalseAlarms, Noise, RangeError, ReturnMode, Threshold, WeakDropout};
use crate::echo::{Air, IntensityModel, PathLimits, Surroundings, Wanted};
use crate::emitter::{Aim, BeamTable, Trajectory};
use crate::ground::error::{Error, Result};
use crate::ground::lanes::{CHUNK, LANES};
use crate::ground::parallel;
use crate::ground::rng::Rng;
use crate::ground::units::seconds_from_us;
use crate::material::{Mirrors, Optics, ReflectanceSource, Reflectances};
use crate::medium::Weather;
use crate::scan::{Order, Profile, Progress, ScanOptions};
use crate::sensor::{Camera, Sensor, Signals};
use crate::trace::Tables;
use echocast_kernels::measure;
use std::ops::Range;
use std::sync::Arc;

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

/// Everything that is the same for all beams of one scan.
pub(super) struct Scan<'a> {
    pub scene: &'a Tables,
    pub beams: &'a BeamTable,
    pub options: &'a ScanOptions,
    pub trajectory: &'a Trajectory,
    pub aim: Aim<'a>,
    pub reflectances: Arc<Reflectances>,
    pub threshold: Threshold,
    /// Noise that looks like echoes, if there is any.
    pub alarms: Option<FalseAlarms>,
    /// Part of the light that each channel makes use of; empty where all are alike.
    pub efficiency: Vec<f32>,
    /// `rho_eff / R^2` beyond which intensity does not rise, 1/m^2.
    pub saturation: Option<f32>,
    pub intensity: IntensityModel,
    pub range_error: RangeError,
    pub rng: Rng,
    pub azimuth_error: Option<AzimuthError>,
    /// Where beams point beside what is reported, rad.
    pub pointing_sigma: f32,
    /// Of the reported time, s.
    pub time_sigma: f64,
    pub dropout: f32,
    pub dropout_weak: Option<WeakDropout>,
    pub range_min: f32,
    pub range_max: f32,
    /// How far rays go, m: beyond the greatest range where what is measured wraps.
    pub reach: f32,
    pub coherent: bool,
    /// Whether normals or what depends on them are asked for.
    pub wants_normals: bool,
    /// Whether incidence follows the interpolated shading normal rather than the triangle's.
    pub smooth: bool,
    /// Whether labels, colours or reflectances are asked for.
    pub wants_surfaces: bool,
    pub wanted: Wanted,
    /// Undetected echoes stay, with intensity 0.
    pub keeps_undetected: bool,
    /// Whether the range limits hold for what is measured too; the paper's program adds its errors afterwards.
    pub limits_measured: bool,
    /// What is in the air, if anything.
    pub air: Option<Air>,
    /// How far light is followed over mirrors and through glass; `None` where nothing depends on it.
    pub paths: Option<PathLimits>,
    pub mode: ReturnMode,
    /// How beams of several rays or returns are made; `None` where beams are a ray and a return each.
    pub signals: Option<Signals>,
    /// What a depth camera makes of light, if it says so.
    pub camera: Option<&'a Camera>,
    /// Bright surfaces whose light gets into beams beside them; see [`Scan::find_halos`].
    pub halos: Option<Halos>,
}

impl<'a> Scan<'a> {
    /// With the `beams` that `sensor` has when the scan starts.
    pub fn new(
        scene: &'a Tables,
        sensor: &'a Sensor,
        beams: &'a BeamTable,
        trajectory: &'a Trajectory,
        options: &'a ScanOptions,
    ) -> Self {
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
        let threshold = sensor.threshold(blainder);
        // The paper's program knows one ray and one return.
        let as_the_paper = options.profile != Profile::Physical;
        // Without what makes it a camera, a pixel of several rays is none.
        let one_ray = blainder || as_the_paper && sensor.camera.is_some();
        let blooms = sensor.detection.blooming.is_some();
        let signals = Some(sensor.signals());
        let signals = signals.filter(|signals| !one_ray && (blooms || !signals.are_simple()));
        let weather = Weather::new(&options.environment, sensor.wavelength_nm, as_the_paper, scene.origin);
        // Signals hear of all echoes.
        let mode = if signals.is_some() { ReturnMode::All } else { sensor.return_mode() };
        let air = Air::new(weather, sensor.receiver(threshold.clone()), mode, !blainder);
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
            glint: sensor.glint().filter(|_| !as_the_paper),
            glass_of_the_program: blainder,
        });
        let camera = sensor.camera.as_ref().filter(|_| !as_the_paper);
        let range_max = sensor.range_max_m as f32;
        let depends = threshold != Threshold::Open || sensor.noise.dropout_weak.is_some() || camera.is_some();
        let wants_echo =
            signals.is_some() || air.is_some() || paths.is_some() || depends || fields.contains(Field::Intensity);
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
            range_error: sensor.range_error(threshold.clone()),
            efficiency: sensor.detection.channel_efficiency.iter().map(|&part| part as f32).collect(),
            saturation: threshold.power().zip(sensor.detection.saturation).map(|(power, most)| power * most as f32),
            alarms: FalseAlarms::new(&sensor.detection.model, &threshold),
            threshold,
            intensity,
            rng: Rng::new(options.seed, options.frame),
            azimuth_error: AzimuthError::new(&sensor.noise),
            pointing_sigma: sensor.noise.pointing_sigma_deg.to_radians() as f32,
            time_sigma: seconds_from_us(sensor.noise.time_sigma_us),
            dropout: sensor.noise.dropout as f32,
            dropout_weak: sensor.noise.dropout_weak,
            range_min: sensor.range_min_m as f32,
            range_max,
            reach: if camera.is_some_and(Camera::wraps) { f32::INFINITY } else { range_max },
            coherent: beams.is_coherent(),
            wants_normals,
            smooth: !blainder && scene.surfaces.has_shading_normals,
            wants_surfaces,
            wanted: Wanted { colors, reflectance: wants_echo },
            keeps_undetected: blainder,
            limits_measured: options.profile == Profile::Physical
                && (sensor.noise != Noise::default()
                    || camera.is_some()
                    || air.as_ref().is_some_and(|air| air.range_noise() > 0.0)),
            air,
            paths,
            mode,
            signals,
            camera,
            halos: None,
        }
    }

    /// Finds what blooms, if `sensor` does; before anything is scanned.
    pub fn find_halos(&mut self, sensor: &Sensor) {
        // Where the profile has one ray a beam there are no signals, and nothing blooms.
        if let (Some(blooming), Some(signals)) = (sensor.detection.blooming, &self.signals) {
            self.halos = Some(Halos::new(self, blooming, signals.sigma));
        }
    }

    /// Greatest number of returns of a beam.
    pub fn most_returns(&self) -> usize {
        self.signals.as_ref().map_or(1, |signals| signals.rule.most())
    }

    /// Fills `cloud`: windows of chunks in parallel, each chunk into its own rows, then the gaps of
    /// misses are closed in order.
    pub fn run(&self, cloud: &mut PointCloud, progress: Option<Progress>) -> Result<()> {
        let options = self.options;
        let beams = self.beams.len();
        let sorted = options.order == Order::Time;
        let computed = if sorted { options.fields.with(Field::Time) } else { options.fields };
        let columns = &mut cloud.columns;
        columns.make_room(computed, beams * self.most_returns())?;
        let engine = &self.scene.engine;
        // Who wants to hear of the scan hears of it often.
        let chunks_per_thread = if progress.is_some() { 1 } else { CHUNKS_PER_THREAD };
        let window = CHUNK * (chunks_per_thread * engine.threads()).min(MOST_CHUNKS);
        let windows = (0..beams).step_by(window).map(|first| first..(first + window).min(beams));
        let mut next = |beams: Range<usize>, rows: usize| {
            // No further than this window may fill: memory of an earlier scan is not cleared beyond the rows there will be.
            columns.lengthen(computed, rows + beams.len() * self.most_returns());
            self.window(beams, rows, columns)
        };
        let rows = match progress {
            None => engine.install(|| windows.fold(0, |rows, beams| next(beams, rows))),
            Some(progress) => {
                let mut rows = 0;
                for window in windows {
                    let done = window.end;
                    rows = engine.install(|| next(window, rows));
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
    pub fn window(&self, beams: Range<usize>, mut rows: usize, columns: &mut Columns) -> usize {
        // Right after the rows there are: memory beyond the last return is never touched.
        let free = columns.slices(rows, rows + beams.len() * self.most_returns());
        let mut found = [0; MOST_CHUNKS];
        let found = &mut found[..beams.len().div_ceil(CHUNK)];
        let tasks = self.tasks(beams, free).zip(&mut *found);
        parallel::for_each_of(tasks, |(task, found)| {
            *found = with_block(|block| task.run(block));
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

    /// Chunks of `beams`, each with the part of `rows` that it may fill.
    fn tasks<'b>(&'b self, beams: Range<usize>, rows: Slices<'b>) -> impl Iterator<Item = Task<'b>> {
        let chunks = beams.clone().step_by(CHUNK).map(move |first| (first, CHUNK.min(beams.end - first)));
        let parts = rows.parts(chunks.clone().map(|(_, count)| count * self.most_returns()));
        chunks.zip(parts).map(|((first, count), rows)| Task { scan: self, first, count, rows })
    }
}

impl Scan<'_> {
    /// Nearest and farthest range that is reported of `beam`, m.
    pub fn limits_of(&self, beam: usize) -> [f32; 2] {
        let low = self.beams.range_min.get(beam).copied().unwrap_or(self.range_min);
        [low, self.beams.range_max.get(beam).copied().unwrap_or(self.range_max)]
    }

    /// Whether rays go elsewhere than their beams are reported to.
    pub fn points_elsewhere(&self) -> bool {
        self.pointing_sigma > 0.0 || self.camera.is_some_and(|camera| camera.aside.is_some())
    }

    /// Part of the light that the channel of `beam` makes use of.
    pub fn efficiency_of(&self, beam: u32) -> f32 {
        let channel = usize::from(self.beams.channel[beam as usize]);
        self.efficiency.get(channel).copied().unwrap_or(1.0)
    }

    /// Whether light goes on from `surface`, a row or [`MISS`]: mirrors and glass.
    pub fn goes_on(&self, surface: u32) -> bool {
        self.scene.surfaces.optics(&self.reflectances, surface).is_some_and(Optics::goes_on)
    }

    /// What light is followed through up to `range_max` m, with the weather of `air` on its way.
    pub fn surroundings<'b>(
        &'b self,
        air: Option<&'b Air>,
        limits: PathLimits,
        wanted: Wanted,
        range_max: &'b [f32; LANES],
    ) -> Surroundings<'b> {
        Surroundings {
            scene: self.scene,
            reflectances: &self.reflectances,
            mask: self.options.mask,
            smooth: self.smooth,
            wanted,
            limits,
            range_max,
            air,
        }
    }

    /// Takes away the hits whose range is none that the instrument reports.
    pub fn limit(&self, surface: &mut [u32; LANES], ranges: &[f32; LANES], lanes: &Lanes, count: usize) {
        let (low, high) = (&self.beams.range_min, &self.beams.range_max);
        if low.is_empty() && high.is_empty() {
            return measure::limit(ranges, self.range_min, self.range_max, surface);
        }
        let low = if low.is_empty() { [self.range_min; LANES] } else { lanes.take(low, count) };
        let high = if high.is_empty() { [self.range_max; LANES] } else { lanes.take(high, count) };
        measure::limit_each(ranges, &low, &high, surface);
    }
}
