//! One ping of a sonar, step by step: rays through the water, what they hit, what the beams receive of it, levels,
//! soundings.

use super::contributors::{Accounts, CellRun, strongest};
use super::goals::Goals;
use super::track::Log;
use crate::cells::{Layout, SonarView, Sounding};
use crate::cloud::{CELL_FIELDS, FLOW, Field, FieldSet, MOVING, Ping, Slices};
use crate::detect::{BeamLevels, Beside, SoundingMemory, sounding};
use crate::echo::{
    Background, Coupling, Drift, Echoes, Flanks, Insonification, LevelMemory, NO_CONTRIBUTOR, Response, Scatterers,
    Tile, TileQuantities, TubeShare, grid,
};
use crate::emitter::{Pattern, Trajectory, Transducer};
use crate::ground::error::{Error, Result};
use crate::ground::math::{LOG2_PER_DB, log2};
use crate::ground::parallel;
use crate::ground::pose::Pose;
use crate::ground::report::Report;
use crate::ground::rng::Rng;
use crate::material::Mirrors;
use crate::medium::{Spreading, Water, WaterColumn};
use crate::scan::printed::printed_water;
use crate::scan::{Profile, ScanOptions};
use crate::sensor::{AcousticsSpec, Sensor, Speckle};
use crate::trace::{
    Arrival, Backscatter, BuiltScene, Clock, Goal, Later, Launch, Movement, SoundLimits, SoundTracer, Stand, Tables,
    TracerMemory, TubeHit,
};
use echocast_kernels::sound::BEAMS;
use glam::{DQuat, DVec3, EulerRot, Mat3, Vec3};
use std::sync::Arc;

/// Rays per task: a constant, so that results cannot depend on the number of threads.
const CHUNK: usize = 2048;

/// Arrivals have numbers of 32 bits: each ray has 25 at most, with eight reflections and two mixed paths for each.
const MOST_RAYS: usize = 1 << 27;

/// Side of a cell of the texture, in resolutions: several range cells.
const TEXTURE: f64 = 16.0 / 3.0;

/// Targets per task, each with an arrival for each face.
const GOALS: usize = 4096;

/// Buffers of a ping, kept from one to the next.
#[derive(Default)]
pub(crate) struct PingMemory {
    chunks: Vec<RayChunk>,
    /// One for each thread that works at the same time, like `receivers`.
    tracers: Vec<TracerMemory>,
    receivers: Vec<TileReceiver>,
    flanks: Flanks,
    accounts: Accounts,
    /// The strongest contributor of each cell.
    contributors: Vec<u32>,
    /// What each beam reports, for sonars that report depths.
    soundings: Vec<Option<Sounding>>,
    /// The layout of the last ping, and what it was made from.
    layout: Option<(LayoutInputs, Arc<Layout>)>,
    water: Option<Prepared>,
    goals: Goals,
}

impl PingMemory {
    /// The strongest arrival in a cell: see [`strongest`].
    pub(super) fn strongest(&self, cell: usize) -> Option<(&Echoes, usize)> {
        strongest(&self.chunks, self.contributors[cell])
    }

    /// Echoes of all rays.
    pub(super) fn all_echoes(&self) -> impl Iterator<Item = &Echoes> {
        self.chunks.iter().map(|chunk| &chunk.echoes)
    }
}

#[derive(Default)]
pub(super) struct RayChunk {
    pub echoes: Echoes,
    hits: Vec<TubeHit>,
    shares: Vec<TubeShare>,
}

/// Buffers to receive one tile after the other.
#[derive(Default)]
struct TileReceiver {
    tile: Tile,
    levels: LevelMemory,
    /// For the echo of the current beam.
    stretch: SoundingMemory,
    runs: Vec<CellRun>,
}

/// The water of the last ping, prepared for a frequency and a depth.
struct Prepared {
    of: (Water, f64, f64),
    column: Arc<WaterColumn>,
    assumed: Arc<WaterColumn>,
}

impl Prepared {
    fn new(water: &Water, frequency: f64, depth: f64) -> Result<Prepared> {
        let column = Arc::new(WaterColumn::new(water, frequency, depth)?.0);
        let assumed = WaterColumn::assumed(water, frequency, depth)?.map_or_else(|| column.clone(), Arc::new);
        Ok(Prepared { of: (water.clone(), frequency, depth), column, assumed })
    }

    fn is_of(&self, water: &Water, frequency: f64, depth: f64) -> bool {
        let (of_water, of_frequency, of_depth) = &self.of;
        (of_water, *of_frequency, *of_depth) == (water, frequency, depth)
    }
}

/// What a [`Layout`] depends on, apart from the sensor.
#[derive(Clone, PartialEq)]
struct LayoutInputs {
    sensor: AcousticsSpec,
    view: SonarView,
    bins: usize,
    first_bin: usize,
    directivity: f64,
    /// Greatest solid angle of a beam, sr.
    widest: f32,
    believed: f64,
    surface_z: f64,
    absorption: f64,
    ambient: f64,
    volume: Option<f64>,
    spreading: Spreading,
    /// Where hybrid spreading becomes cylindrical, m.
    spreading_from: f32,
}

/// Cells of a ping that are labelled: those for which all columns are filled.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum LabelledCells {
    All,
    /// Those of soundings; the others are not filled.
    Soundings,
}

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
    speckle: Option<Scatterers>,
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
    assumed: Option<Arc<WaterColumn>>,
    /// What a Doppler velocity log adds.
    log: Option<Log>,
}

/// What the columns of motion are made from.
pub(super) struct MotionSource {
    /// Poses of objects one frame later, if they move and flow is requested.
    pub later: Option<Later>,
}

impl BuiltScene {
    /// One ping of a sonar at `trajectory`, sent when the scan of `options` starts; `options.frame` is its number. It
    /// holds those of `options.fields` that are [`CELL_FIELDS`], and always the level (`intensity`).
    ///
    /// # Errors
    /// A sensor that is not a sonar; a sonar above the water or outside its profile; a profile other than
    /// [`Profile::Physical`], as the others produce only clouds; as [`BuiltScene::scan`].
    pub fn ping(&self, sensor: &Sensor, trajectory: &Trajectory, options: &ScanOptions) -> Result<Ping> {
        let mut ping = Ping::default();
        self.ping_into(sensor, trajectory, options, &mut ping)?;
        Ok(ping)
    }

    /// [`BuiltScene::ping`] into the memory of `ping`.
    ///
    /// # Errors
    /// As [`BuiltScene::ping`]. `ping` is unchanged if sensor, pose or options are wrong; if there is no memory, it is
    /// empty.
    pub fn ping_into(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        ping: &mut Ping,
    ) -> Result<()> {
        self.ping_labelled(sensor, trajectory, options, ping, LabelledCells::All)
    }

    /// [`BuiltScene::ping_into`] that fills columns other than the level only for the `labelled` cells.
    pub(super) fn ping_labelled(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        ping: &mut Ping,
        labelled: LabelledCells,
    ) -> Result<()> {
        options.check(trajectory)?;
        options.environment.check()?;
        options
            .profile
            .check_physical("physical; the paper and its program produce only points, which a scan returns")?;
        let mut memory = ping.memory.take::<PingMemory>();
        let plan = PingPlan::new(&self.0, sensor, trajectory, options, &mut memory)?;
        let size = plan.transducer.rays() as u64;
        let done = self.0.engine.install_sized(size, || plan.run(options, labelled, &mut memory, ping));
        if done.is_err() {
            *ping = Ping::default();
        }
        ping.memory.keep(memory);
        done
    }

    /// Warnings about the water of `options` for a sonar at `trajectory`: formulas outside their ranges of validity,
    /// speeds that no water has, sediments at frequencies without measurements; in the profiles of the paper and its
    /// program, about the water as these use it.
    ///
    /// # Errors
    /// As [`BuiltScene::ping`].
    pub fn check_water(&self, sensor: &Sensor, trajectory: &Trajectory, options: &ScanOptions) -> Result<Report> {
        let acoustics = sensor.acoustics()?;
        let start = trajectory.at(options.trajectory_time());
        let water = options.environment.water.clone().unwrap_or_default();
        let physical = options.profile == Profile::Physical;
        let water = if physical { water } else { printed_water(water) };
        let (_, warnings) = WaterColumn::new(&water, acoustics.frequency(), water.surface_z_m - start.position.z)?;
        let mut report = Report::default();
        warnings.into_iter().for_each(|warning| report.warn(warning));
        if sensor.spec().dvl.is_some_and(|log| log.water.is_some()) && water.volume_backscatter_db.is_none() {
            report.warn(
                "dvl.water: nothing scatters in the layer, so that no velocity through water is measured; \
                 environment.water.volume_backscatter_db, such as -80, adds scatterers that drift in it",
            );
        }
        if !physical {
            // Paper and program use reflectances in place of laws.
            return Ok(report);
        }
        let laws = self.0.surfaces.materials.iter().filter_map(|material| material.sound_law());
        let mut odd: Vec<String> = laws.filter_map(|law| law.warning(acoustics.frequency())).collect();
        odd.sort();
        odd.dedup();
        odd.into_iter().for_each(|warning| report.warn(warning));
        Ok(report)
    }
}

impl<'a> PingPlan<'a> {
    pub fn new(
        scene: &'a Tables,
        sensor: &'a Sensor,
        trajectory: &Trajectory,
        options: &'a ScanOptions,
        memory: &mut PingMemory,
    ) -> Result<PingPlan<'a>> {
        static WATER: std::sync::LazyLock<Water> = std::sync::LazyLock::new(Water::default);
        let acoustics = sensor.acoustics()?;
        options.profile.check_flat(sensor)?;
        let time = options.trajectory_time();
        let pose = sensor.turned(trajectory.at(time), options.frame);
        let water = options.environment.water.as_ref().unwrap_or(&WATER);
        let frequency = acoustics.frequency();
        let depth = water.surface_z_m - pose.position.z;
        // The sound speed that the instrument assumes is set when it starts: all pings along a trajectory have one
        // layout, however deep it goes.
        let start_depth = water.surface_z_m - trajectory.at(trajectory.span().0).position.z;
        let prepared = match memory.water.take().filter(|known| known.is_of(water, frequency, start_depth)) {
            Some(known) => known,
            None => Prepared::new(water, frequency, start_depth)?,
        };
        let (column, assumed) = (prepared.column.clone(), prepared.assumed.clone());
        memory.water = Some(prepared);
        WaterColumn::check_depth(water, depth)?;
        let assumed = sensor.sonar_view().reports_depths().then_some(assumed);
        let speed = column.speed_at(depth);
        let (start_speed, absorption) =
            (column.speed_at(start_depth), column.mean_absorption(start_depth, start_depth));
        let believed = water.assumed_speed_m_s.unwrap_or(start_speed);
        let ratio = acoustics.array_speed_m_s.map_or(1.0, |array| speed / array);
        let transducer = sensor.transducer(start_speed / frequency, ratio);
        if transducer.rays() > MOST_RAYS {
            return Err(Error::invalid(
                "pattern.rays",
                transducer.rays(),
                format!("at most {MOST_RAYS} rays in a ping"),
            ));
        }
        let sea = water.sea();
        let source = options.reflectance_source.unwrap_or_default().of_sound();
        let reflectances = scene.surfaces.reflectances(sensor.wavelength_nm, source, Mirrors::Real);
        let backscatter = scene.surfaces.backscatter(&reflectances, frequency, sea, speed);

        let interval = 0.5 * believed * sensor.beams.period;
        let reach = sensor.range_max_m;
        scene.check_time(options.start_time, reach / believed)?;
        let allowed = |most: f64, how: &str| {
            let found =
                format!("{reach} m, beyond the {interval:.2} m that sound travels out and back between two pings");
            Error::invalid("range.max_m", found, format!("up to {most:.2} m, a lower pattern.rate_hz{how}"))
        };
        match acoustics.allow_ambiguity {
            false if reach > interval * (1.0 + 1e-9) => {
                return Err(allowed(interval, ", or acoustics.allow_ambiguity: true"));
            }
            true if reach > 2.0 * interval => return Err(allowed(2.0 * interval, "")),
            _ => {}
        }
        let fold = if reach > interval * (1.0 + 1e-9) { interval } else { f64::INFINITY };
        let resolution = acoustics.resolution(believed);
        let bin_m = acoustics.bin_m.unwrap_or(0.5 * resolution);
        let bins = (reach.min(fold) / bin_m).ceil();
        let cells = bins * transducer.beams() as f64;
        /// A size that fits into memory many times over.
        const MOST_CELLS: f64 = 2e7;
        if cells > MOST_CELLS {
            let found = format!("{bin_m} m: {bins} bins of {} beams", transducer.beams());
            return Err(Error::invalid("acoustics.bin_m", found, format!("at most {MOST_CELLS} cells in a ping")));
        }
        let response = Response::new(bin_m / resolution, acoustics.bandwidth_khz.is_some(), acoustics.taper);
        let response = response.map_err(|least| {
            let allowed = format!("at least {} m for a resolution of {resolution} m", least * resolution);
            Error::invalid("acoustics.bin_m", format!("{bin_m} m"), allowed)
        })?;
        let ambient = || water.noise().level_db(frequency) + 10.0 * acoustics.bandwidth().log10();
        let inputs = LayoutInputs {
            sensor: acoustics.clone(),
            view: sensor.sonar_view(),
            bins: bins as usize,
            first_bin: (sensor.range_min_m / bin_m).floor() as usize,
            directivity: acoustics.directivity_index_db.unwrap_or(transducer.directivity_db),
            widest: transducer.solid_angles.iter().copied().fold(0.0, f32::max),
            believed,
            surface_z: water.surface_z_m,
            absorption,
            ambient: acoustics.noise_level_db.unwrap_or_else(ambient),
            volume: water.volume_backscatter_db,
            spreading: water.spreading,
            spreading_from: water.spreading_from(),
        };
        let volume = volume(&inputs, bin_m, resolution * acoustics.taper.resolutions());
        let layout = match memory.layout.take() {
            Some((made_of, layout)) if made_of == inputs && layout.axes == transducer.axes => layout,
            _ => Arc::new(layout(&inputs, &transducer, bin_m, &volume)),
        };
        memory.layout = Some((inputs, layout.clone()));

        let drift = match (acoustics.stop_and_hop, trajectory.constant()) {
            (false, None) => {
                // The motion during the travel time of the farthest echo; at the end of the trajectory, that shortly
                // before.
                let wait = 2.0 * reach / believed;
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
            _ => None,
        };
        let own = trajectory.velocity(time).as_vec3();
        let motion = match options.fields.contains_any(&MOVING) {
            false => None,
            true => {
                let period = options.frame_period.unwrap_or(sensor.beams.period);
                let later = if options.fields.contains_any(&FLOW) { scene.later(period)? } else { None };
                Some(MotionSource { later })
            }
        };
        let log = matches!(sensor.spec().pattern, Pattern::Dvl(_)).then(|| Log {
            spec: sensor.spec().dvl.unwrap_or_default(),
            current: DVec3::from(water.current_m_s).as_vec3(),
        });
        let rng = Rng::new(options.seed, options.frame);
        let speckle = (acoustics.speckle == Speckle::Frozen).then(|| {
            let (station, along) = station(&transducer, &pose, start_speed / frequency, resolution);
            // From the seed alone: a surface looks the same in every ping.
            let rng = Rng::new(options.seed, 0);
            Scatterers { rng, station, along, patch: (TEXTURE * resolution) as f32, texture: sensor.texture.clone() }
        });
        let plan = PingPlan {
            scene,
            acoustics,
            backscatter,
            water,
            column,
            layout,
            volume,
            response,
            pose,
            drift,
            own,
            speckle,
            rng,
            reach,
            fold,
            mask: options.mask,
            time: options.start_time,
            clock: scene.clock(options.start_time, options.freeze),
            motion,
            assumed,
            log,
            transducer,
        };
        plan.find_goals(&mut memory.goals)?;
        Ok(plan)
    }

    /// Fills `ping`.
    pub fn run(
        &self,
        options: &ScanOptions,
        labelled: LabelledCells,
        memory: &mut PingMemory,
        ping: &mut Ping,
    ) -> Result<()> {
        let requested: FieldSet = CELL_FIELDS.into_iter().filter(|&field| options.fields.contains(field)).collect();
        let fields = requested.with(Field::Intensity);
        let Layout { bins, view, .. } = *self.layout;
        let beams = self.transducer.beams();
        ping.number = options.frame;
        ping.time = self.time;
        ping.pose = self.pose;
        ping.layout = self.layout.clone();
        ping.origin = self.scene.origin;
        ping.fields = fields;
        ping.labels = self.scene.surfaces.labels.clone();
        ping.cells.resize(fields, beams * bins)?;

        let of_rays = self.transducer.rays().div_ceil(CHUNK);
        let PingMemory { chunks, tracers, goals, flanks, receivers, accounts, contributors, soundings, .. } = memory;
        let of_targets = goals.targets.chunks(GOALS);
        chunks.resize_with(of_rays + of_targets.len() + goals.bodies.len(), RayChunk::default);
        let (sound, surfaces) = (&self.backscatter, &self.scene.surfaces);
        let loss = |row: u32, sine: f64| sound.reflection_loss(surfaces, row, sine);
        let limits = SoundLimits {
            mask: self.mask,
            believed: self.layout.believed_speed,
            reach: self.reach,
            bounces: self.acoustics.bounces,
            reflection_loss: &loss,
            clock: self.clock,
        };
        let tracer = SoundTracer::new(self.scene, &self.column, limits);
        let insonification = self.insonification(&goals.covered);
        parallel::for_each_with(tracers, chunks.iter_mut().enumerate(), |memory, (number, chunk)| {
            let insonification = &insonification;
            let task = RayTask { plan: self, tracer: &tracer, insonification, number, chunk, memory };
            match number.checked_sub(of_rays).map(|part| (part, part.checked_sub(of_targets.len()))) {
                None => task.run(),
                Some((part, None)) => task.look_at(of_targets.clone().nth(part).unwrap_or_default()),
                Some((_, Some(body))) => task.cover(&goals.bodies[body]),
            }
        });

        let mut first = NO_CONTRIBUTOR + 1;
        for RayChunk { echoes, .. } in &mut *chunks {
            echoes.first = first;
            first += echoes.arrivals.len() as u32;
        }
        let labelled = (fields.without(Field::Intensity) != FieldSet::EMPTY).then_some(labelled);
        let quantities = TileQuantities {
            moment: view == SonarView::Swath,
            open: !self.volume.is_empty(),
            speckle: self.speckle.is_some(),
        };
        flanks.clear(&self.transducer, bins, labelled == Some(LabelledCells::All));
        for chunk in &*chunks {
            flanks.add(&self.transducer, &chunk.echoes);
        }
        if labelled == Some(LabelledCells::All) {
            self.account(chunks, fields, accounts)?;
        }
        let width = if self.transducer.beams_are_apart() { 1 } else { BEAMS };
        contributors.resize(beams * bins, NO_CONTRIBUTOR);
        soundings.clear();
        soundings.resize(beams, None);
        let rows = ping.cells.slices(0, beams * bins);
        let task = TileInput { plan: self, chunks, flanks, accounts, quantities, labelled, width };
        task.tiles(receivers, rows, contributors, soundings);
        ping.soundings.clear();
        ping.soundings.extend(soundings.iter().flatten());
        let tracks = self.log.as_ref().map(|log| self.tracks(log, memory, &ping.soundings));
        (ping.bottom_track, ping.water_track) = tracks.map_or((None, None), |(bottom, water)| (Some(bottom), water));
        Ok(())
    }

    fn insonification<'b>(&'b self, covered: &'b [bool]) -> Insonification<'b> {
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
}

impl TileReceiver {
    /// Computes the `soundings` of beams from the levels of all cells, for sonars that report them.
    fn sound_out(&mut self, plan: &PingPlan, levels: &[f32], soundings: &mut [Option<Sounding>]) {
        let TileReceiver { tile, stretch, .. } = self;
        let Layout { bins, bin_m, believed_speed, .. } = *plan.layout;
        let resolution = (plan.acoustics.resolution(believed_speed) / bin_m) as f32;
        if plan.assumed.is_none() {
            return;
        }
        for ((beam, levels), to) in (tile.beams.0..).zip(levels.chunks_exact(bins)).zip(soundings) {
            let (moment, total) = (&tile.moment[..], &tile.total[..]);
            let received = (tile.received.start, tile.received.end);
            let beside = Beside { moment, total, width: tile.width, beam: beam - tile.beams.0, received };
            let width = plan.transducer.widths[beam];
            let received = BeamLevels { beam, levels, beside, width, resolution, rng: &plan.rng };
            *to = sounding(&plan.layout, &received, stretch).map(|found| Sounding {
                cell: (beam * bins + plan.source_bin(tile, beam, found.cell as usize - beam * bins)) as u32,
                corrected: plan.corrected(beam, found.range),
                ..found
            });
        }
    }
}

impl PingPlan<'_> {
    /// Position of a sounding that a beam reports at `range`, m, corrected with the water that the survey assumes.
    fn corrected(&self, beam: usize, range: f32) -> Vec3 {
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

    /// The bin nearest to `bin` that has energy which the response spreads to there; itself if there is none.
    fn source_bin(&self, tile: &Tile, beam: usize, bin: usize) -> usize {
        let has_energy = |bin: usize| {
            let cell = bin * tile.width + beam - tile.beams.0;
            tile.re.get(cell).is_some_and(|&re| re != 0.0) || tile.im.get(cell).is_some_and(|&im| im != 0.0)
        };
        let beside = |step: usize| [bin.checked_sub(step), Some(bin + step)].into_iter().flatten();
        (0..=self.response.reach()).flat_map(beside).find(|&bin| has_energy(bin)).unwrap_or(bin)
    }
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

/// Power that a steradian of open water returns from each bin, uPa^2: volume backscatter from a resolution cell,
/// spreading along straight rays and absorption as at the sonar (sonar equation, Urick 1983, section 8.3).
fn volume(inputs: &LayoutInputs, bin_m: f64, resolution: f64) -> Vec<f32> {
    let Some(strength) = inputs.volume else { return Vec::new() };
    let of_bin = |bin: usize| {
        let range = (bin as f64 + 0.5) * bin_m;
        let path = log2(range as f32);
        let spread = 2.0 * (path - inputs.spreading.one_way(path, inputs.spreading_from)) / LOG2_PER_DB;
        let level = inputs.sensor.source_level_db + strength + 10.0 * resolution.log10() + f64::from(spread);
        10f64.powf((level - 2.0 * inputs.absorption * range) / 10.0) as f32
    };
    (0..inputs.bins).map(of_bin).collect()
}

fn layout(inputs: &LayoutInputs, transducer: &Transducer, bin_m: f64, volume: &[f32]) -> Layout {
    let acoustics = &inputs.sensor;
    // A tapered filter passes more noise.
    let taper = 10.0 * acoustics.taper.resolutions().log10();
    let noise_db = inputs.ambient - inputs.directivity - acoustics.processing_gain() + taper;
    let noise = 10f64.powf(noise_db / 10.0);
    let threshold = |bin: usize| {
        let background = noise + f64::from(volume.get(bin).copied().unwrap_or(0.0) * inputs.widest);
        (10.0 * background.log10() + acoustics.detection_threshold_db) as f32
    };
    let tvg = |bin: usize| {
        let range = (bin as f64 + 0.5) * bin_m;
        let absorption = acoustics.tvg.absorption_db_m.unwrap_or(inputs.absorption);
        (acoustics.tvg.spreading * range.max(1.0).log10() + 2.0 * absorption * range + acoustics.tvg.gain_db) as f32
    };
    Layout {
        view: inputs.view,
        axes: transducer.axes.clone(),
        bins: inputs.bins,
        bin_m,
        first_bin: inputs.first_bin,
        believed_speed: inputs.believed,
        frequency: acoustics.frequency(),
        surface_z: inputs.surface_z,
        noise_db: noise_db as f32,
        threshold_db: (0..inputs.bins).map(threshold).collect(),
        tvg_db: (0..inputs.bins).map(tvg).collect(),
    }
}

/// Rays of one chunk and their echoes, compiled for the vector instructions of this machine.
struct RayTask<'a, 'p> {
    plan: &'a PingPlan<'p>,
    tracer: &'a SoundTracer<'a>,
    insonification: &'a Insonification<'a>,
    number: usize,
    chunk: &'a mut RayChunk,
    memory: &'a mut TracerMemory,
}

impl RayTask<'_, '_> {
    fn run(self) {
        let RayTask { plan, tracer, insonification, number, chunk, memory } = self;
        let transducer = &*plan.transducer;
        let launch = Launch {
            directions: transducer.direction.each_ref().map(|axis| &axis[..]),
            rotation: plan.rotation(),
            place: plan.place(),
        };
        let rays = number * CHUNK..((number + 1) * CHUNK).min(transducer.rays());
        chunk.echoes.arrivals.clear();
        let Echoes { arrivals, direct, .. } = &mut chunk.echoes;
        tracer.trace(&launch, rays, memory, arrivals);
        direct.clear();
        if plan.acoustics.bounces > 0 {
            let (sound, surfaces) = (&plan.backscatter, &plan.scene.surfaces);
            let whole = |row: u32| sound.is_whole(surfaces, row);
            tracer.direct(&launch, whole, memory, arrivals, direct);
        }
        insonification.answer(&mut chunk.echoes);
        chunk.echoes.gather(transducer, plan.layout.bins);
    }
}

impl RayTask<'_, '_> {
    /// Computes the echoes of `goals` rather than rays.
    fn look_at(self, goals: &[Goal]) {
        let RayTask { plan, tracer, insonification, chunk, memory, .. } = self;
        let (sound, surfaces) = (&plan.backscatter, &plan.scene.surfaces);
        let direct = &mut chunk.echoes.direct;
        direct.clear();
        tracer.sight(plan.place(), goals, |row| sound.is_whole(surfaces, row), memory, direct);
        insonification.answer_targets(&mut chunk.echoes);
        chunk.echoes.gather(&plan.transducer, plan.layout.bins);
    }

    /// Computes the echo of a body by tubes of its own.
    fn cover(self, stand: &Stand) {
        let RayTask { plan, tracer, insonification, chunk, memory, .. } = self;
        let RayChunk { echoes, hits, shares } = chunk;
        let grid = |sides| grid(stand, plan.wavelength(), sides);
        let smooth = |row| plan.backscatter.smooth(&plan.scene.surfaces, row).is_some();
        match tracer.cover(plan.place(), stand, grid, &smooth, memory, hits) {
            Some(way) => insonification.answer_body(&way, hits, shares, echoes),
            None => echoes.clear(),
        }
        echoes.gather(&plan.transducer, plan.layout.bins);
    }
}

/// What all tiles receive.
#[derive(Clone, Copy)]
struct TileInput<'a, 'p> {
    plan: &'a PingPlan<'p>,
    chunks: &'a [RayChunk],
    flanks: &'a Flanks,
    accounts: &'a Accounts,
    quantities: TileQuantities,
    labelled: Option<LabelledCells>,
    /// Beams per tile.
    width: usize,
}

/// One tile: its columns, the strongest contributors of its cells, and what its beams report.
struct TileTask<'a, 'p> {
    input: TileInput<'a, 'p>,
    first: usize,
    rows: Slices<'a>,
    contributors: &'a mut [u32],
    soundings: &'a mut [Option<Sounding>],
}

impl TileInput<'_, '_> {
    /// Fills the `rows` of all cells, their strongest `contributors`, and the `soundings` of beams, tile by tile.
    fn tiles(
        self,
        receivers: &mut Vec<TileReceiver>,
        rows: Slices,
        contributors: &mut [u32],
        soundings: &mut [Option<Sounding>],
    ) {
        let TileInput { width, plan, .. } = self;
        let (bins, beams) = (plan.layout.bins, soundings.len());
        let firsts = (0..beams).step_by(width);
        let rows = rows.parts(firsts.clone().map(|first| width.min(beams - first) * bins));
        let cells = contributors.chunks_mut(width * bins).zip(rows);
        let tasks = firsts.zip(soundings.chunks_mut(width)).zip(cells);
        parallel::for_each_with(receivers, tasks, |receiver, ((first, soundings), (contributors, rows))| {
            TileTask { input: self, first, rows, contributors, soundings }.run(receiver);
        });
    }
}

impl TileTask<'_, '_> {
    fn run(self, receiver: &mut TileReceiver) {
        let TileTask { input, first, rows, contributors, soundings } = self;
        let TileInput { plan, chunks, flanks, accounts, quantities, labelled, width } = input;
        let TileReceiver { tile, levels, .. } = receiver;
        let Layout { bins, bin_m, .. } = *plan.layout;
        tile.clear((first, first + soundings.len()), width, bins, quantities);
        for chunk in chunks {
            tile.receive(&plan.transducer, &chunk.echoes, bin_m as f32);
        }
        let background = Background {
            rng: plan.rng,
            noise: (plan.layout.noise_db * LOG2_PER_DB).exp2(),
            volume: &plan.volume,
            flanks,
            transducer: &plan.transducer,
        };
        tile.levels(&plan.response, &background, levels, rows.intensity, contributors);
        receiver.sound_out(plan, rows.intensity, soundings);
        match labelled {
            None => {}
            Some(LabelledCells::All) => plan.label_cells(contributors, accounts, &mut receiver.runs, rows),
            Some(LabelledCells::Soundings) => plan.label_soundings(first, contributors, chunks, rows, soundings),
        }
    }
}

impl PingPlan<'_> {
    /// Direction in which the sound of arrival `index` left or, where that differs, from which it returned; sensor
    /// frame.
    pub fn launched(&self, echoes: &Echoes, index: usize) -> Vec3 {
        match echoes.launch(index) {
            Some(launch) => self.rotation().transpose() * launch,
            None => self.transducer.direction.each_ref().map(|axis| axis[echoes.arrivals[index].ray as usize]).into(),
        }
    }

    /// Motion of what an arrival hits, when sound is there.
    pub(super) fn movement(&self, arrival: &Arrival, later: Option<&Later>) -> Movement {
        let met = f64::from(arrival.range) / self.layout.believed_speed;
        let time = self.clock.as_ref().map_or(0.0, |clock| clock.of(met));
        let movement = self.scene.movement(later, arrival.surface, arrival.triangle, arrival.corner, time);
        movement.unwrap_or_default()
    }
}
