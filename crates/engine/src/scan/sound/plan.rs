//! What is the same for all rays of a ping: the water, the array, the layout of its cells and the motion of the sonar.

use super::layout::{LayoutInputs, RangeBins, layout, volume};
use crate::detect::VelocityLog;
use crate::echo::{Coupling, Drift, Echoes, Insonification, Response, Scatterers};
use crate::medium::{Water, WaterColumn};
use crate::scan::ScanOptions;
use crate::scan::check_flat;
use crate::sensor::{AcousticsSpec, Sensor, Speckle};
use crate::trace::{Arrival, Backscatter, Clock, Later, Movement, Tables};
use cloud::FLOW;
use cloud::cells::Layout;
use emitter::{Pattern, Trajectory, Transducer};
use glam::{DQuat, DVec3, EulerRot, Mat3, Vec3};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::rng::Rng;
use model::material::Mirrors;
use std::sync::{Arc, LazyLock};

/// Arrivals have numbers of 32 bits: each ray has 25 at most, with eight reflections and two mixed paths for each.
const MOST_RAYS: usize = 1 << 27;

/// Side of a cell of the texture, in resolutions: several range cells.
const TEXTURE: f64 = 16.0 / 3.0;

/// What is the same for all rays of a ping.
pub(super) struct PingPlan<'a> {
    pub scene: &'a Tables,
    pub acoustics: &'a AcousticsSpec,
    pub transducer: Arc<Transducer>,
    pub backscatter: Arc<Backscatter>,
    pub water: &'a Water,
    pub column: Arc<WaterColumn>,
    pub layout: Arc<Layout>,
    /// Power that a steradian of open water returns from each bin; empty: none.
    pub volume: Vec<f32>,
    pub response: Response,
    pub pose: Pose,
    drift: Option<Drift>,
    /// Velocity of the sonar, world, m/s.
    pub own: Vec3,
    pub speckle: Option<Scatterers>,
    pub rng: Rng,
    /// Ranges from which echoes come, m.
    pub reach: f64,
    pub fold: f64,
    pub mask: u32,
    pub time: f64,
    /// In a moving scene, the scene time for each travel time.
    pub clock: Option<Clock>,
    /// Source of the motion columns, if requested.
    pub motion: Option<MotionSource>,
    /// The water that depths are corrected with, for sonars that report depths.
    pub assumed: Option<Arc<WaterColumn>>,
    /// What a Doppler velocity log adds.
    pub log: Option<Log>,
}

/// What the columns of motion are made from.
pub(super) struct MotionSource {
    /// Poses of objects one frame later, if they move and flow is requested.
    pub later: Option<Later>,
}

/// A Doppler velocity log in moving water.
pub(super) struct Log {
    pub spec: VelocityLog,
    /// Velocity of the water, world, m/s.
    pub current: Vec3,
}

/// What is kept from one plan to the next.
#[derive(Default)]
pub(super) struct PlanMemory {
    water: Option<PreparedWater>,
    /// The layout of the last ping, and what it was made from.
    layout: Option<(LayoutInputs, Arc<Layout>)>,
}

/// Water, prepared for a frequency and a depth.
struct PreparedWater {
    of: (Water, f64, f64),
    column: Arc<WaterColumn>,
    /// The water that a survey assumes.
    assumed: Arc<WaterColumn>,
}

impl PreparedWater {
    fn new(water: &Water, frequency: f64, depth: f64) -> Result<PreparedWater> {
        let column = Arc::new(WaterColumn::new(water, frequency, depth)?.0);
        let assumed = WaterColumn::assumed(water, frequency, depth)?.map_or_else(|| column.clone(), Arc::new);
        Ok(PreparedWater { of: (water.clone(), frequency, depth), column, assumed })
    }

    fn is_of(&self, water: &Water, frequency: f64, depth: f64) -> bool {
        let (of_water, of_frequency, of_depth) = &self.of;
        (of_water, *of_frequency, *of_depth) == (water, frequency, depth)
    }
}

impl PlanMemory {
    /// The water at `frequency`, Hz, for a sonar that starts at `depth`, m: the column, and the one that a survey
    /// assumes.
    fn water(&mut self, water: &Water, frequency: f64, depth: f64) -> Result<[Arc<WaterColumn>; 2]> {
        let prepared = match self.water.take().filter(|known| known.is_of(water, frequency, depth)) {
            Some(known) => known,
            None => PreparedWater::new(water, frequency, depth)?,
        };
        let PreparedWater { column, assumed, .. } = self.water.insert(prepared);
        Ok([column.clone(), assumed.clone()])
    }

    /// The layout of a ping whose open water returns `volume`.
    fn layout(&mut self, inputs: LayoutInputs, transducer: &Transducer, bin_m: f64, volume: &[f32]) -> Arc<Layout> {
        let layout = match self.layout.take() {
            Some((made_of, layout)) if made_of == inputs && layout.axes == transducer.axes => layout,
            _ => Arc::new(layout(&inputs, transducer, bin_m, volume)),
        };
        self.layout = Some((inputs, layout.clone()));
        layout
    }
}

impl<'a> PingPlan<'a> {
    /// # Errors
    /// As [`BuiltScene::ping`](crate::trace::BuiltScene::ping).
    pub fn new(
        scene: &'a Tables,
        sensor: &'a Sensor,
        trajectory: &Trajectory,
        options: &'a ScanOptions,
        memory: &mut PlanMemory,
    ) -> Result<PingPlan<'a>> {
        static WATER: LazyLock<Water> = LazyLock::new(Water::default);
        let acoustics = sensor.acoustics()?;
        check_flat(options.profile, sensor)?;
        let pose = sensor.turned(trajectory.at(options.start_on_trajectory()), options.frame);
        let water = options.environment.water.as_ref().unwrap_or(&WATER);
        let frequency = acoustics.frequency();
        // The sound speed that the instrument assumes is set when it starts: all pings along a trajectory have one
        // layout, however deep it goes.
        let start_depth = water.surface_z_m - trajectory.at(trajectory.span().0).position.z;
        let [column, assumed] = memory.water(water, frequency, start_depth)?;
        let depth = water.surface_z_m - pose.position.z;
        WaterColumn::check_depth(water, depth)?;
        let (speed, start_speed) = (column.speed_at(depth), column.speed_at(start_depth));
        let believed = water.assumed_speed_m_s.unwrap_or(start_speed);

        let array_ratio = acoustics.array_speed_m_s.map_or(1.0, |array| speed / array);
        let transducer = transducer(sensor, start_speed / frequency, array_ratio)?;
        let backscatter = backscatter(scene, sensor, options, frequency, water, speed);
        let reach = sensor.range_max_m;
        scene.check_time(options.start_time, reach / believed)?;
        let fold = fold(acoustics, reach, 0.5 * believed * sensor.beams.period)?;

        let bins = RangeBins::new(acoustics, transducer.beams(), reach.min(fold), believed)?;
        let response = bins.response(acoustics)?;
        let absorption = column.mean_absorption(start_depth, start_depth);
        let inputs = LayoutInputs::new(sensor, acoustics, water, &transducer, &bins, [believed, absorption]);
        let volume = volume(&inputs, bins.length, bins.resolution * acoustics.taper.resolutions());
        let layout = memory.layout(inputs, &transducer, bins.length, &volume);

        Ok(PingPlan {
            scene,
            acoustics,
            backscatter,
            water,
            column,
            layout,
            volume,
            response,
            pose,
            drift: drift(acoustics, sensor, trajectory, options, believed),
            own: trajectory.velocity(options.start_on_trajectory()).as_vec3(),
            speckle: speckle(acoustics, sensor, &transducer, &pose, options.seed, (start_speed, bins.resolution)),
            rng: Rng::new(options.seed, options.frame),
            reach,
            fold,
            mask: options.mask,
            time: options.start_time,
            clock: scene.clock(options.start_time, options.freeze),
            motion: motion(scene, sensor, options)?,
            assumed: sensor.sonar_view().reports_depths().then_some(assumed),
            log: log(sensor, water),
            transducer,
        })
    }

    /// What all rays share; the objects that are `covered` have tubes of their own.
    pub fn insonification<'b>(&'b self, covered: &'b [bool]) -> Insonification<'b> {
        Insonification {
            transducer: &self.transducer,
            backscatter: &self.backscatter,
            surfaces: &self.scene.surfaces,
            rotation: self.rotation(),
            source_level: self.acoustics.source_level_db as f32,
            spreading: self.water.spreading,
            spreading_from: self.water.spreading_from(),
            straight: self.column.is_uniform(),
            farthest: self.reach as f32,
            bins: self.layout.bins,
            bin_m: self.layout.bin_m as f32,
            fold: self.fold as f32,
            turns: (2.0 * self.acoustics.frequency() / self.layout.believed_speed) as f32,
            speckle: self.speckle.clone(),
            drift: self.drift,
            coupling: self.coupling(),
            response: &self.response,
            covered,
        }
    }

    /// Effect of motion on ranges, if anything moves and the pulse sweeps its frequency: that of a Doppler velocity log
    /// is coded.
    fn coupling(&self) -> Option<Coupling<'_>> {
        let lead = self.acoustics.lead() as f32;
        let own = if self.acoustics.stop_and_hop { Vec3::ZERO } else { self.own };
        let moving = self.clock.map(|clock| (self.scene, clock));
        let moves = own != Vec3::ZERO || moving.is_some();
        let sweeps = lead != 0.0 && self.log.is_none();
        (moves && sweeps).then_some(Coupling { lead, own, moving, believed: self.layout.believed_speed })
    }

    pub fn rotation(&self) -> Mat3 {
        self.pose.rotation().as_mat3()
    }

    /// Wavelength at the sonar, m.
    pub fn wavelength(&self) -> f64 {
        self.column.speed_at(self.column.surface_z - self.pose.position.z) / self.acoustics.frequency()
    }

    /// Position of the sonar, relative to the scene's origin, m.
    pub fn place(&self) -> DVec3 {
        self.pose.position - self.scene.origin
    }

    /// Position of a sounding that a beam reports at `range`, m, corrected with the water that the survey assumes.
    pub fn corrected(&self, beam: usize, range: f32) -> Vec3 {
        let place = self.place();
        let axis = self.pose.rotation() * self.layout.axis(beam);
        let level = axis.truncate().length();
        let depth = self.column.surface_z - self.pose.position.z;
        let here = self.acoustics.array_speed_m_s.unwrap_or_else(|| self.column.speed_at(depth));
        let time = f64::from(range) / self.layout.believed_speed;
        let found = self.assumed.as_ref().and_then(|water| water.place_after(time, depth, [-axis.z, level], here));
        found.map_or(Vec3::NAN, |[away, deep]| {
            let aside = axis.truncate().normalize_or_zero() * away;
            (place + aside.extend(depth - deep)).as_vec3()
        })
    }

    /// Direction in which the sound of arrival `index` left or, where that differs, from which it returned; sensor
    /// frame.
    pub fn launched(&self, echoes: &Echoes, index: usize) -> Vec3 {
        match echoes.launch(index) {
            Some(launch) => self.rotation().transpose() * launch,
            None => self.transducer.direction.each_ref().map(|axis| axis[echoes.arrivals[index].ray as usize]).into(),
        }
    }

    /// Motion of what an arrival hits, when sound is there.
    pub fn movement(&self, arrival: &Arrival, later: Option<&Later>) -> Movement {
        let met = f64::from(arrival.range) / self.layout.believed_speed;
        let time = self.clock.as_ref().map_or(0.0, |clock| clock.of(met));
        let movement = self.scene.movement(later, arrival.surface, arrival.triangle, arrival.corner, time);
        movement.unwrap_or_default()
    }
}

/// The array at a `wavelength`, m, where sound is `array_ratio` times as fast as the array is steered for.
///
/// # Errors
/// More rays than arrivals have numbers for.
fn transducer(sensor: &Sensor, wavelength: f64, array_ratio: f64) -> Result<Arc<Transducer>> {
    let transducer = sensor.transducer(wavelength, array_ratio);
    if transducer.rays() > MOST_RAYS {
        let allowed = format!("at most {MOST_RAYS} rays in a ping");
        return Err(Error::invalid("pattern.rays", transducer.rays(), allowed));
    }
    Ok(transducer)
}

/// What surfaces return at `frequency`, Hz, in `water` with a sound speed of `speed`, m/s.
fn backscatter(
    scene: &Tables,
    sensor: &Sensor,
    options: &ScanOptions,
    frequency: f64,
    water: &Water,
    speed: f64,
) -> Arc<Backscatter> {
    let source = options.reflectance_source.unwrap_or_default().of_sound();
    let reflectances = scene.surfaces.reflectances(sensor.wavelength_nm, source, Mirrors::Real);
    scene.surfaces.backscatter(&reflectances, frequency, water.sea(), speed)
}

/// The range from which on echoes, up to `reach`, appear nearer by the `interval`, the distance that sound travels out
/// and back between two pings; all in m.
///
/// # Errors
/// A range beyond the interval, unless the sonar allows ambiguous ranges; one beyond twice the interval.
fn fold(acoustics: &AcousticsSpec, reach: f64, interval: f64) -> Result<f64> {
    let allowed = |most: f64, how: &str| {
        let found = format!("{reach} m, beyond the {interval:.2} m that sound travels out and back between two pings");
        Error::invalid("range.max_m", found, format!("up to {most:.2} m, a lower pattern.rate_hz{how}"))
    };
    let is_beyond = reach > interval * (1.0 + 1e-9);
    match acoustics.allow_ambiguity {
        false if is_beyond => Err(allowed(interval, ", or acoustics.allow_ambiguity: true")),
        true if reach > 2.0 * interval => Err(allowed(2.0 * interval, "")),
        _ => Ok(if is_beyond { interval } else { f64::INFINITY }),
    }
}

/// Motion of the sonar during the travel time; `None`: it does not move, or moves only between pings.
fn drift(
    acoustics: &AcousticsSpec,
    sensor: &Sensor,
    trajectory: &Trajectory,
    options: &ScanOptions,
    believed: f64,
) -> Option<Drift> {
    if acoustics.stop_and_hop || trajectory.constant().is_some() {
        return None;
    }
    let time = options.start_on_trajectory();
    // The motion during the travel time of the farthest echo; at the end of the trajectory, that shortly before.
    let wait = 2.0 * sensor.range_max_m / believed;
    let (start, end) = trajectory.span();
    let before = time.min(end - wait).max(start);
    let after = (before + wait).min(end);
    let [first, last] = [before, after].map(|time| sensor.turned(trajectory.at(time), options.frame));
    let moved = last.position - first.position;
    let turn = first.orientation.inverse() * last.orientation;
    // The shorter rotation; the path is twice the one-way range.
    let turned = if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis();
    let way = (after - before) * believed;
    // Before and after the trajectory it is at rest.
    let moves = (start..=end).contains(&time) && way > 0.0;
    moves.then(|| Drift { moved: (moved / way).as_vec3(), turned: (2.0 * turned / way).as_vec3() })
}

/// Source of the motion columns, if they are requested.
fn motion(scene: &Tables, sensor: &Sensor, options: &ScanOptions) -> Result<Option<MotionSource>> {
    if !options.fields.has_motion() {
        return Ok(None);
    }
    let period = options.frame_period.unwrap_or(sensor.beams.period);
    let later = if options.fields.contains_any(&FLOW) { scene.later(period)? } else { None };
    Ok(Some(MotionSource { later }))
}

/// What a Doppler velocity log adds.
fn log(sensor: &Sensor, water: &Water) -> Option<Log> {
    matches!(sensor.spec().pattern, Pattern::Dvl(_))
        .then(|| Log { spec: sensor.spec().dvl.unwrap_or_default(), current: DVec3::from(water.current_m_s).as_vec3() })
}

/// The random scatterers that a sonar at `pose` receives, where sound travels at `speed`, m/s, with this range
/// `resolution`, m; `None`: the mean level.
fn speckle(
    acoustics: &AcousticsSpec,
    sensor: &Sensor,
    transducer: &Transducer,
    pose: &Pose,
    seed: u64,
    (speed, resolution): (f64, f64),
) -> Option<Scatterers> {
    (acoustics.speckle == Speckle::Frozen).then(|| {
        let (station, along) = station(transducer, pose, speed / acoustics.frequency(), resolution);
        // From the seed alone: a surface looks the same in every ping.
        let rng = Rng::new(seed, 0);
        Scatterers { rng, station, along, patch: (TEXTURE * resolution) as f32, texture: sensor.texture.clone() }
    })
}

/// The scatterers that a sonar at `pose` receives, as a number, and its array in the world, 1/m, whose product with a
/// position counts coherence lengths (see [`Transducer::coherence`]) along it. The number stays the same while the
/// sonar moves only along its array, and changes when it turns by about its beam width, or moves sideways by about its
/// `resolution`, m.
fn station(transducer: &Transducer, pose: &Pose, wavelength: f64, resolution: f64) -> (u32, Vec3) {
    /// Offset of the steps of positions, as a fraction of a step: round positions are not between two, where rounding
    /// would decide.
    const OFF: f64 = 0.37;
    let step = transducer.array_width;
    let (yaw, pitch, roll) = pose.orientation.to_euler(EulerRot::ZYX);
    let angles = [yaw, pitch, roll].map(|angle| (angle / step).round());
    let [yaw, pitch, roll] = angles.map(|angle| angle * step);
    let near = DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll);
    let own = near.inverse() * pose.position;
    let aside = own - own.project_onto(transducer.array.as_dvec3());
    let places = aside.to_array().map(|place| (place / resolution + OFF).floor());
    let mix = |number: u32, word: &f64| (number ^ *word as i64 as u32).wrapping_mul(0x85EB_CA6B).rotate_left(13);
    let number = angles.iter().chain(&places).fold(0, mix);
    let array = near * transducer.array.as_dvec3();
    (number, (array / transducer.coherence(wavelength)).as_vec3())
}
