//! One scan: what is the same for all its beams, and their chunks, side by side on threads.

use super::block::{BeamLanes, Task, with_block};
use super::deskew::Deskew;
use super::halo::Halos;
use crate::cloud::{Columns, Driver, FLOW, Field, Frame, MOVING, PointCloud, Slices};
use crate::detect::{Errors, FalseAlarms, ReturnMode, Threshold};
use crate::echo::{Air, IntensityModel, PathLimits, RequestedQuantities, Surroundings};
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
pub(super) struct ScanPlan<'a> {
    pub options: &'a ScanOptions,
    pub rng: Rng,
    pub aim: Aiming<'a>,
    pub world: World<'a>,
    pub detect: Detecting<'a>,
    pub measure: Measuring<'a>,
    /// The driver that publishes such clouds, if known.
    pub driver: Option<Driver>,
    /// How a depth camera forms ranges from light, if the sensor is one.
    pub camera: Option<&'a DepthCamera>,
    /// Time from one frame to the next, s.
    pub frame_period: f64,
    /// What transforms points to the start, if requested.
    pub deskew: Option<Deskew>,
    /// How beams of several rays or returns are formed; `None` where beams have one ray and one return each.
    pub signals: Option<&'a Arc<Signals>>,
    /// Whether this applies to all beams, or only to those that hit more than one place, which also have one return
    /// each.
    pub has_signals: bool,
    /// Rays that have been traced.
    pub rays: AtomicU64,
}

/// The beams and their poses.
pub(super) struct Aiming<'a> {
    pub beams: &'a BeamTable,
    /// The ring of each channel.
    pub rings: &'a [u16],
    pub trajectory: &'a Trajectory,
    pub pose: Aim<'a>,
    /// Length of rays, m: beyond the maximum range where measured ranges wrap.
    pub reach: f32,
    pub coherent: bool,
    /// In a moving scene, the scene time for each beam.
    pub clock: Option<Clock>,
}

/// What light passes through and hits, and which of its properties are looked up.
pub(super) struct World<'a> {
    pub scene: &'a Tables,
    /// What rays see of it.
    pub sight: Sight,
    pub reflectances: Arc<Reflectances>,
    /// What is in the air, if anything.
    pub air: Option<&'a Air>,
    /// How far light is traced by mirrors and through glass; `None` where nothing depends on it.
    pub paths: Option<PathLimits>,
    /// Whether incidence follows the interpolated shading normal rather than the triangle's.
    pub smooth: bool,
    /// Whether normals or what depends on them are requested.
    pub needs_normals: bool,
    /// Whether labels, colours or reflectances are requested.
    pub needs_lookup: bool,
    pub requested: RequestedQuantities,
    /// Poses of objects one frame later, if they move and flow is requested.
    pub later: Option<Later>,
    /// Whether anything moves and motion is requested.
    pub motion: bool,
}

/// Which echoes are detected.
pub(super) struct Detecting<'a> {
    pub threshold: &'a Threshold,
    /// Noise that looks like echoes, if there is any.
    pub alarms: Option<FalseAlarms>,
    /// Fraction of the light that each channel uses; empty if all are alike.
    pub efficiency: &'a [f32],
    pub mode: ReturnMode,
    /// Nearest and farthest range that is reported, m.
    pub range: [f32; 2],
    /// Undetected echoes are kept, with intensity 0.
    pub keeps_undetected: bool,
    /// Bright surfaces whose light leaks into neighbouring beams; see [`ScanPlan::find_halos`].
    pub halos: Option<Halos>,
}

/// What is measured of these echoes.
pub(super) struct Measuring<'a> {
    pub errors: &'a Errors,
    pub intensity: IntensityModel,
    /// `rho_eff / R^2` beyond which intensity does not rise, 1/m^2.
    pub saturation: Option<f32>,
    /// Whether the range limits also apply to measured ranges; the paper's program adds its errors afterwards.
    pub limited: bool,
    /// Whether intensities have errors, are requested, and none of them marks an echo as not detected.
    pub flickers: bool,
}

/// Differences between the profiles.
struct Rules {
    /// Source of reflectances that neither the material nor the caller specifies.
    source: ReflectanceSource,
    mirrors: Mirrors,
    /// As printed (paper profile), in place of our equations: rain, glass by lengths, no instrument that sees its own
    /// reflection, no camera.
    as_printed: bool,
    /// As computed by the paper's program: its limits, one ray and one return per beam, no echoes of the air,
    /// undetected echoes are kept.
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
                Profile::Blainder => Mirrors::PaperProgram,
            },
            as_printed: !physical,
            as_computed: blainder,
        }
    }

    /// How a scan computes intensity for an instrument with the intensity `own`.
    fn intensity(self, own: IntensitySpec) -> IntensityModel {
        match self {
            Profile::Physical => IntensityModel::Encoded(own.encoding, own.white_count.into()),
            Profile::Paper => IntensityModel::PaperEq5,
            Profile::Blainder => IntensityModel::Blainder,
        }
    }
}

impl ScanOptions {
    /// Source of reflectances that materials do not specify.
    fn light_from(&self) -> ReflectanceSource {
        self.reflectance_source.unwrap_or(self.profile.rules().source)
    }

    /// What light sees of a scene.
    pub(in crate::scan) fn sight(&self) -> Sight {
        let rng = Rng::new(self.seed, self.frame);
        Sight { mask: self.mask, cover: Cover::of_light(self.light_from(), rng) }
    }
}

/// Whether beams have one ray and one return each, whatever the sensor specifies.
fn one_ray(sensor: &Sensor, profile: Profile) -> bool {
    let Rules { as_printed, as_computed, .. } = profile.rules();
    // Without the camera model, a pixel of several rays is meaningless.
    as_computed || as_printed && sensor.camera.is_some()
}

/// Whether all beams are formed as signals.
fn has_signals(sensor: &Sensor, profile: Profile) -> bool {
    !one_ray(sensor, profile) && (sensor.detection.blooming.is_some() || !sensor.signals.are_simple())
}

/// Which echoes are searched for.
fn mode(sensor: &Sensor, profile: Profile) -> ReturnMode {
    // Signals are formed from all echoes.
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

impl<'a> ScanPlan<'a> {
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
        let needs_echo =
            signals.is_some() || air.is_some() || paths.is_some() || depends || fields.contains(Field::Intensity);
        let normals = [Field::NormalX, Field::NormalY, Field::NormalZ, Field::CosIncidence];
        let colors = fields.contains_any(&[Field::Red, Field::Green, Field::Blue]);
        let range_max = sensor.range_max_m as f32;
        let errs = errors.any || camera.is_some() || air.as_ref().is_some_and(|air| air.range_noise() > 0.0);
        let moves = fields.contains_any(&MOVING) || options.deskew;
        let scan = ScanPlan {
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
                needs_normals: needs_echo || fields.contains_any(&normals),
                needs_lookup: needs_echo || fields.contains_any(&LABELS) || colors,
                requested: RequestedQuantities { colors, reflectance: needs_echo },
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
        Ok(ScanPlan { deskew: Deskew::new(&scan), ..scan })
    }

    /// Finds the surfaces that bloom, if `sensor` has blooming; before anything is scanned.
    pub fn find_halos(&mut self, sensor: &Sensor) {
        // Where the profile has one ray per beam there are no signals, and nothing blooms.
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

    /// Chunks of `beams`, each with the part of `rows` that it may fill.
    fn tasks<'b>(&'b self, beams: Range<usize>, rows: Slices<'b>) -> impl Iterator<Item = Task<'b>> {
        let chunks = beams.clone().step_by(CHUNK).map(move |first| (first, CHUNK.min(beams.end - first)));
        let parts = rows.parts(chunks.clone().map(|(_, count)| count * self.most_returns()));
        chunks.zip(parts).map(|((first, count), rows)| Task { scan: self, first, count, rows })
    }
}

impl ScanPlan<'_> {
    /// Nearest and farthest range that is reported for `beam`, m.
    pub fn limits_of(&self, beam: usize) -> [f32; 2] {
        let low = self.aim.beams.range_min.get(beam).copied().unwrap_or(self.detect.range[0]);
        [low, self.aim.beams.range_max.get(beam).copied().unwrap_or(self.detect.range[1])]
    }

    /// Whether the directions of rays differ from those reported for their beams.
    pub fn points_elsewhere(&self) -> bool {
        self.measure.errors.pointing_sigma > 0.0 || self.camera.is_some_and(|camera| camera.aside.is_some())
    }

    /// Fraction of the light that the channel of `beam` uses.
    pub fn efficiency_of(&self, beam: u32) -> f32 {
        let channel = usize::from(self.aim.beams.channel[beam as usize]);
        self.detect.efficiency.get(channel).copied().unwrap_or(1.0)
    }

    /// Sets the vectors across the beam with the number `beam`, which points in `direction`, and the rotation of its
    /// `footprint`, as a fraction of a circle.
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

    /// Fraction of an echo's light in `beam` that is divided out of its intensity: the channel's efficiency if it is
    /// calibrated.
    pub fn shown_of(&self, beam: u32) -> f32 {
        if self.measure.intensity.is_calibrated() { self.efficiency_of(beam).max(1e-6) } else { 1.0 }
    }

    /// Whether light continues from `surface`, a row or [`MISS`]: mirrors and glass.
    pub fn goes_on(&self, surface: u32) -> bool {
        self.world.scene.surfaces.optics(&self.world.reflectances, surface).is_some_and(Optics::goes_on)
    }

    /// Finds those of the first `count` lanes from whose `surface` light continues; returns how many.
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

    /// What the light of `beams` is traced through, with the weather of `air` along its path.
    pub fn surroundings<'b>(
        &'b self,
        air: Option<&'b Air>,
        limits: PathLimits,
        requested: RequestedQuantities,
        beams: &'b RayBatch,
    ) -> Surroundings<'b> {
        Surroundings {
            scene: self.world.scene,
            reflectances: &self.world.reflectances,
            sight: self.world.sight,
            smooth: self.world.smooth,
            requested,
            motion: self.world.motion,
            limits,
            beams,
            air,
        }
    }

    /// Removes the hits at ranges that the instrument does not report.
    pub fn limit(&self, surface: &mut [u32; LANES], ranges: &[f32; LANES], lanes: &BeamLanes, count: usize) {
        let (low, high) = (&self.aim.beams.range_min, &self.aim.beams.range_max);
        if low.is_empty() && high.is_empty() {
            return measure::limit(ranges, self.detect.range[0], self.detect.range[1], surface);
        }
        let low = if low.is_empty() { [self.detect.range[0]; LANES] } else { lanes.take(low, count) };
        let high = if high.is_empty() { [self.detect.range[1]; LANES] } else { lanes.take(high, count) };
        measure::limit_each(ranges, &low, &high, surface);
    }
}
