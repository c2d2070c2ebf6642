//! One scan: what is the same for all its beams, and their chunks, side by side on threads.

use super::block::{Lanes, Task, with_block};
use super::deskew::Deskew;
use super::halo::Halos;
use crate::cloud::{Columns, Driver, FLOW, Field, Frame, MOVING, PointCloud, Slices};
use crate::detect::{Errors, FalseAlarms, ReturnMode, Threshold};
use crate::echo::{Air, IntensityModel, PathLimits, Surroundings, Wanted};
use crate::emitter::{Across, Aim, BeamTable, Footprint, Trajectory};
use crate::ground::error::{Error, Result};
use crate::ground::lanes::{CHUNK, LANES, MISS, RayBatch};
use crate::ground::parallel;
use crate::ground::rng::Rng;
use crate::material::{Mirrors, Optics, ReflectanceSource, Reflectances};
use crate::scan::{Order, Profile, Progress, ScanOptions};
use crate::sensor::{DepthCamera, IntensitySpec, Reception, Sensor, Signals};
use crate::trace::{Clock, Cover, Later, Sight, Tables};
use echocast_kernels::measure;
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Columns that identify the surface.
const LABELS: [Field; 7] = [
    Field::CategoryId,
    Field::PartId,
    Field::InstanceId,
    Field::MaterialId,
    Field::FirstCategoryId,
    Field::FirstInstanceId,
    Field::TrackId,
];

/// Chunks per thread between two passes that close the gaps of misses: few enough that their rows are
/// still in the cache, enough to keep the thread busy.
const CHUNKS_PER_THREAD: usize = 8;

/// Most chunks between two such passes.
const MOST_CHUNKS: usize = 512;

/// The plan of one scan: everything that is the same for all its beams, a part for each step.
pub(super) struct Scan<'a> {
    pub options: &'a ScanOptions,
    pub rng: Rng,
    pub aim: Aiming<'a>,
    pub world: World<'a>,
    pub detect: Detecting<'a>,
    pub measure: Measuring<'a>,
    /// Whose driver publishes such clouds, if that is known.
    pub driver: Option<Driver>,
    /// What a depth camera makes of light, if the sensor is one.
    pub camera: Option<&'a DepthCamera>,
    /// Time from one frame to the next, s.
    pub frame_period: f64,
    /// What brings points back to the start, if that is asked for.
    pub deskew: Option<Deskew>,
    /// How beams of several rays or returns are made; `None` where beams are a ray and a return each.
    pub signals: Option<&'a Arc<Signals>>,
    /// Whether all beams are, or just those that meet more than one place, of which each has a return too.
    pub has_signals: bool,
    /// Rays that have been traced.
    pub rays: AtomicU64,
}

/// Where beams go.
pub(super) struct Aiming<'a> {
    pub beams: &'a BeamTable,
    /// The ring of each channel.
    pub rings: &'a [u16],
    pub trajectory: &'a Trajectory,
    pub pose: Aim<'a>,
    /// How far rays go, m: beyond the greatest range where what is measured wraps.
    pub reach: f32,
    pub coherent: bool,
    /// Where the scene moves, beam by beam.
    pub clock: Option<Clock>,
}

/// What light goes through and meets, and what of it is looked up.
pub(super) struct World<'a> {
    pub scene: &'a Tables,
    /// What rays see of it.
    pub sight: Sight,
    pub reflectances: Arc<Reflectances>,
    /// What is in the air, if anything.
    pub air: Option<&'a Air>,
    /// How far light is followed over mirrors and through glass; `None` where nothing depends on it.
    pub paths: Option<PathLimits>,
    /// Whether incidence follows the interpolated shading normal rather than the triangle's.
    pub smooth: bool,
    /// Whether normals or what depends on them are asked for.
    pub wants_normals: bool,
    /// Whether labels, colours or reflectances are asked for.
    pub wants_surfaces: bool,
    pub wanted: Wanted,
    /// Where things are one frame later, if they move and that is asked for.
    pub later: Option<Later>,
    /// Whether anything moves and that is asked for.
    pub motion: bool,
}

/// Which echoes are seen.
pub(super) struct Detecting<'a> {
    pub threshold: &'a Threshold,
    /// Noise that looks like echoes, if there is any.
    pub alarms: Option<FalseAlarms>,
    /// Fraction of the light that each channel uses; empty if all are alike.
    pub efficiency: &'a [f32],
    pub mode: ReturnMode,
    /// Nearest and farthest range that is reported, m.
    pub range: [f32; 2],
    /// Undetected echoes stay, with intensity 0.
    pub keeps_undetected: bool,
    /// Bright surfaces whose light gets into beams beside them; see [`Scan::find_halos`].
    pub halos: Option<Halos>,
}

/// What is measured of them.
pub(super) struct Measuring<'a> {
    pub errors: &'a Errors,
    pub intensity: IntensityModel,
    /// `rho_eff / R^2` beyond which intensity does not rise, 1/m^2.
    pub saturation: Option<f32>,
    /// Whether the range limits hold for what is measured too; the paper's program adds its errors afterwards.
    pub limited: bool,
    /// Whether intensities err, somebody wants them, and none of them means that an echo is not detected.
    pub flickers: bool,
}

/// What the profiles differ in.
struct Rules {
    /// Where reflectance comes from when neither the material nor the caller says.
    source: ReflectanceSource,
    mirrors: Mirrors,
    /// The paper's equations in place of ours: rain, glass by lengths, no instrument that sees itself, no camera.
    as_printed: bool,
    /// The paper's program: its limits, one ray and one return a beam, no echoes of the air, undetected echoes stay.
    as_computed: bool,
}

impl Profile {
    fn rules(self) -> Rules {
        let [physical, blainder] = [Profile::Physical, Profile::Blainder].map(|profile| self == profile);
        Rules {
            source: match self {
                Profile::Physical => ReflectanceSource::Library,
                Profile::Paper => ReflectanceSource::Luminance,
                Profile::Blainder => ReflectanceSource::Alpha,
            },
            mirrors: match self {
                Profile::Physical => Mirrors::Real,
                Profile::Paper => Mirrors::Lossless,
                Profile::Blainder => Mirrors::OfTheProgram,
            },
            as_printed: !physical,
            as_computed: blainder,
        }
    }

    /// How a scan computes intensity where the instrument's own is `own`.
    fn intensity(self, own: IntensitySpec) -> IntensityModel {
        match self {
            Profile::Physical => IntensityModel::Encoded(own.encoding, own.white_count.into()),
            Profile::Paper => IntensityModel::PaperEq5,
            Profile::Blainder => IntensityModel::Blainder,
        }
    }
}

impl ScanOptions {
    /// Where reflectances come from that materials do not give.
    fn light_from(&self) -> ReflectanceSource {
        self.reflectance_source.unwrap_or(self.profile.rules().source)
    }

    /// What light meets.
    pub(in crate::scan) fn sight(&self) -> Sight {
        let rng = Rng::new(self.seed, self.frame);
        Sight { mask: self.mask, cover: Cover::of_light(self.light_from(), rng) }
    }
}

/// Whether beams are one ray and one return each, whatever the sensor says.
fn one_ray(sensor: &Sensor, profile: Profile) -> bool {
    let Rules { as_printed, as_computed, .. } = profile.rules();
    // Without what makes it a camera, a pixel of several rays is none.
    as_computed || as_printed && sensor.camera.is_some()
}

/// Whether all beams are signals.
fn has_signals(sensor: &Sensor, profile: Profile) -> bool {
    !one_ray(sensor, profile) && (sensor.detection.blooming.is_some() || !sensor.signals.are_simple())
}

/// Which echoes are sought.
fn mode(sensor: &Sensor, profile: Profile) -> ReturnMode {
    // Signals are made of all echoes.
    if has_signals(sensor, profile) { ReturnMode::All } else { sensor.return_mode() }
}

/// How `sensor` receives light in a scan of `scene`.
///
/// # Errors
/// An environment that is not valid.
pub(super) fn reception(scene: &Tables, sensor: &Sensor, options: &ScanOptions) -> Result<Arc<Reception>> {
    let Rules { as_printed, as_computed, .. } = options.profile.rules();
    sensor.reception(&options.environment, scene.origin, [as_printed, as_computed], mode(sensor, options.profile))
}

impl<'a> Scan<'a> {
    /// With the `beams` that `sensor` has when the scan starts, and its [`reception`] there.
    ///
    /// # Errors
    /// A vertex cache that can no longer be read.
    pub fn new(
        scene: &'a Tables,
        sensor: &'a Sensor,
        beams: &'a BeamTable,
        reception: &'a Reception,
        trajectory: &'a Trajectory,
        options: &'a ScanOptions,
    ) -> Result<Self> {
        let Rules { mirrors, as_printed, as_computed, .. } = options.profile.rules();
        let Reception { threshold, errors, alarms, air, efficiency, .. } = reception;
        let has_signals = has_signals(sensor, options.profile);
        let one_ray = one_ray(sensor, options.profile);
        let signals = Some(&sensor.signals).filter(|signals| has_signals || !one_ray && signals.adaptive.is_some());
        let camera = sensor.camera.as_ref().filter(|_| !as_printed);
        let source = options.light_from();
        let reflectances = scene.surfaces.reflectances(sensor.wavelength_nm, source, mirrors);
        let paths = reflectances.go_on.then_some(PathLimits {
            depth: options.specular_depth,
            least: 1e-6,
            geometric: as_printed,
            cosine_after: !as_computed,
            glint: sensor.glint().filter(|_| !as_printed),
            glass_of_the_program: as_computed,
        });

        let fields = options.fields;
        let frame_period = options.frame_period.unwrap_or(beams.period);
        let depends = *threshold != Threshold::Open || errors.depend_on_light() || camera.is_some();
        let wants_echo =
            signals.is_some() || air.is_some() || paths.is_some() || depends || fields.contains(Field::Intensity);
        let normals = [Field::NormalX, Field::NormalY, Field::NormalZ, Field::CosIncidence];
        let colors = fields.contains_any(&[Field::Red, Field::Green, Field::Blue]);
        let range_max = sensor.range_max_m as f32;
        let errs = errors.any || camera.is_some() || air.as_ref().is_some_and(|air| air.range_noise() > 0.0);
        let moves = fields.contains_any(&MOVING) || options.deskew;
        let scan = Scan {
            options,
            rng: Rng::new(options.seed, options.frame),
            aim: Aiming {
                beams,
                rings: &sensor.rings,
                trajectory,
                pose: Aim::new(trajectory, options.trajectory_time(), scene.origin),
                reach: if camera.is_some_and(DepthCamera::wraps) { f32::INFINITY } else { range_max },
                coherent: beams.is_coherent(),
                clock: scene.clock(options.start_time, options.freeze),
            },
            world: World {
                scene,
                sight: options.sight(),
                reflectances,
                air: air.as_ref(),
                paths,
                smooth: !as_computed && scene.surfaces.has_shading_normals,
                wants_normals: wants_echo || fields.contains_any(&normals),
                wants_surfaces: wants_echo || fields.contains_any(&LABELS) || colors,
                wanted: Wanted { colors, reflectance: wants_echo },
                later: if fields.contains_any(&FLOW) { scene.later(frame_period)? } else { None },
                motion: scene.span.is_some() && moves,
            },
            measure: Measuring {
                flickers: !as_computed && errors.flicker() && fields.contains(Field::Intensity),
                errors,
                intensity: options.profile.intensity(sensor.intensity),
                saturation: threshold.power().zip(sensor.detection.saturation).map(|(power, most)| power * most as f32),
                limited: !as_printed && errs,
            },
            detect: Detecting {
                alarms: *alarms,
                threshold,
                efficiency,
                mode: reception.mode,
                range: [sensor.range_min_m as f32, range_max],
                keeps_undetected: as_computed,
                halos: None,
            },
            driver: sensor.driver(),
            camera,
            frame_period,
            deskew: None,
            signals,
            has_signals,
            rays: AtomicU64::new(0),
        };
        Ok(Scan { deskew: Deskew::new(&scan), ..scan })
    }

    /// Finds what blooms, if `sensor` does; before anything is scanned.
    pub fn find_halos(&mut self, sensor: &Sensor) {
        // Where the profile has one ray a beam there are no signals, and nothing blooms.
        if let (Some(blooming), Some(signals)) = (sensor.detection.blooming, &self.signals) {
            self.detect.halos = Some(Halos::new(self, blooming, signals.sigma));
        }
    }

    /// Greatest number of returns of a beam.
    pub fn most_returns(&self) -> usize {
        self.signals.map_or(1, |signals| signals.rule.most())
    }

    /// Fills `cloud`: windows of chunks in parallel, each chunk into its own rows, then the gaps of
    /// misses are closed in order.
    pub fn run(&self, cloud: &mut PointCloud, progress: Option<Progress>) -> Result<()> {
        let options = self.options;
        let beams = self.aim.beams.len();
        let sorted = options.order == Order::Time;
        let computed = if sorted { options.fields.with(Field::Time) } else { options.fields };
        let columns = &mut cloud.columns;
        columns.make_room(computed, beams * self.most_returns())?;
        let engine = &self.world.scene.engine;
        // A caller who wants to know how far the scan is, is told often.
        let chunks_per_thread = if progress.is_some() { 1 } else { CHUNKS_PER_THREAD };
        let size = (beams * self.most_returns()) as u64;
        let window = CHUNK * (chunks_per_thread * engine.threads()).min(MOST_CHUNKS);
        let windows = (0..beams).step_by(window).map(|first| first..(first + window).min(beams));
        let mut next = |beams: Range<usize>, rows: usize| {
            // No further than this window may fill: memory of an earlier scan is not cleared beyond the rows there will
            // be.
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
            Frame::World => self.world.scene.origin,
            Frame::Sensor => glam::DVec3::ZERO,
        };
        cloud.organised = options.organised.then_some([self.aim.beams.rows, self.aim.beams.columns]);
        cloud.sensor_pose = self.aim.trajectory.at(options.trajectory_time());
        cloud.start_time = Some(options.start_time);
        cloud.rays = self.rays.load(Ordering::Relaxed);
        cloud.intensity_full_scale = self.measure.intensity.full_scale();
        cloud.driver = self.driver;
        cloud.labels = self.world.scene.surfaces.labels.clone();
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
        let low = self.aim.beams.range_min.get(beam).copied().unwrap_or(self.detect.range[0]);
        [low, self.aim.beams.range_max.get(beam).copied().unwrap_or(self.detect.range[1])]
    }

    /// Whether rays go elsewhere than their beams are reported to.
    pub fn points_elsewhere(&self) -> bool {
        self.measure.errors.pointing_sigma > 0.0 || self.camera.is_some_and(|camera| camera.aside.is_some())
    }

    /// Fraction of the light that the channel of `beam` uses.
    pub fn efficiency_of(&self, beam: u32) -> f32 {
        let channel = usize::from(self.aim.beams.channel[beam as usize]);
        self.detect.efficiency.get(channel).copied().unwrap_or(1.0)
    }

    /// Sets the vectors across the beam with the number `beam`, which goes in `direction`, and the rotation of its
    /// `footprint`, as a part of a circle.
    pub fn set_across(
        &self,
        across: &mut Across,
        footprint: &Footprint,
        lane: usize,
        beam: usize,
        direction: Vec3,
        turn: f32,
    ) {
        let (rotation, _) = self.aim.pose.pose(self.aim.beams, beam);
        if footprint.turns {
            across.set(lane, direction, rotation.z_axis, turn);
        } else {
            // The image plane at the distance 1 along the ray.
            let off_axis = self.aim.beams.direction(beam).x;
            across.set_axes(lane, [rotation.y_axis * off_axis, rotation.z_axis * off_axis], 0.0);
        }
    }

    /// Part of an echo's light in `beam` that its intensity lacks: a calibrated one lacks none.
    pub fn shown_of(&self, beam: u32) -> f32 {
        if self.measure.intensity.is_calibrated() { self.efficiency_of(beam).max(1e-6) } else { 1.0 }
    }

    /// Whether light goes on from `surface`, a row or [`MISS`]: mirrors and glass.
    pub fn goes_on(&self, surface: u32) -> bool {
        self.world.scene.surfaces.optics(&self.world.reflectances, surface).is_some_and(Optics::goes_on)
    }

    /// Of the first `count` lanes, those on whose `surface` light goes on; returns how many.
    pub fn going_on(&self, surface: &[u32; LANES], count: usize, lanes: &mut [u8; LANES]) -> usize {
        let (mut known, mut goes_on, mut found) = (MISS, false, 0);
        for lane in 0..count {
            if surface[lane] != known {
                known = surface[lane];
                goes_on = self.goes_on(known);
            }
            if goes_on {
                lanes[found] = lane as u8;
                found += 1;
            }
        }
        found
    }

    /// What the light of `beams` is followed through, with the weather of `air` on its way.
    pub fn surroundings<'b>(
        &'b self,
        air: Option<&'b Air>,
        limits: PathLimits,
        wanted: Wanted,
        beams: &'b RayBatch,
    ) -> Surroundings<'b> {
        Surroundings {
            scene: self.world.scene,
            reflectances: &self.world.reflectances,
            sight: self.world.sight,
            smooth: self.world.smooth,
            wanted,
            motion: self.world.motion,
            limits,
            beams,
            air,
        }
    }

    /// Removes the hits at ranges that the instrument does not report.
    pub fn limit(&self, surface: &mut [u32; LANES], ranges: &[f32; LANES], lanes: &Lanes, count: usize) {
        let (low, high) = (&self.aim.beams.range_min, &self.aim.beams.range_max);
        if low.is_empty() && high.is_empty() {
            return measure::limit(ranges, self.detect.range[0], self.detect.range[1], surface);
        }
        let low = if low.is_empty() { [self.detect.range[0]; LANES] } else { lanes.take(low, count) };
        let high = if high.is_empty() { [self.detect.range[1]; LANES] } else { lanes.take(high, count) };
        measure::limit_each(ranges, &low, &high, surface);
    }
}
