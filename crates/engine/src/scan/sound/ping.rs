//! One ping of a sonar, step by step: rays through the water, what they hit, what the beams receive of it, levels,
//! soundings.

use super::contributors::{Accounts, LabelledCells, strongest};
use super::goals::Goals;
use super::plan::{PingPlan, PlanMemory};
use super::rays::{CHUNK, RayChunk, RayTask};
use super::tiles::{TileInput, TileReceiver};
use crate::echo::{Echoes, Flanks, NO_CONTRIBUTOR, TileQuantities};
use crate::medium::WaterColumn;
use crate::scan::check_physical;
use crate::scan::printed::printed_water;
use crate::scan::{Profile, ScanOptions};
use crate::sensor::Sensor;
use crate::trace::{BuiltScene, SoundLimits, SoundTracer, Tables, TracerMemory};
use cloud::cells::{Layout, SonarView, Sounding};
use cloud::{CELL_FIELDS, Field, FieldSet, Ping};
use echocast_kernels::sound::BEAMS;
use emitter::Trajectory;
use ground::error::Result;
use ground::parallel;
use ground::report::Report;

/// Targets per task, each with an arrival for each face.
const GOALS: usize = 4096;

/// Buffers of a ping, kept from one to the next.
#[derive(Default)]
pub(super) struct PingMemory {
    plan: PlanMemory,
    goals: Goals,
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
}

impl PingMemory {
    /// Plans a ping, and finds what it samples with dedicated rays.
    ///
    /// # Errors
    /// As [`BuiltScene::ping`].
    pub fn plan<'a>(
        &mut self,
        scene: &'a Tables,
        sensor: &'a Sensor,
        trajectory: &Trajectory,
        options: &'a ScanOptions,
    ) -> Result<PingPlan<'a>> {
        let plan = PingPlan::new(scene, sensor, trajectory, options, &mut self.plan)?;
        plan.find_goals(&mut self.goals)?;
        Ok(plan)
    }

    /// The strongest arrival in a cell: see [`strongest`].
    pub fn strongest(&self, cell: usize) -> Option<(&Echoes, usize)> {
        strongest(&self.chunks, self.contributors[cell])
    }

    /// Echoes of all rays.
    pub fn all_echoes(&self) -> impl Iterator<Item = &Echoes> {
        self.chunks.iter().map(|chunk| &chunk.echoes)
    }
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
        check_physical(
            options.profile,
            "physical; the paper and its program produce only points, which a scan returns",
        )?;
        let mut memory = ping.memory.take::<PingMemory>();
        let plan = memory.plan(&self.0, sensor, trajectory, options)?;
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
        let start = trajectory.at(options.start_on_trajectory());
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

impl PingPlan<'_> {
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
        let tracks = self.log.as_ref().map(|log| self.tracks(log, memory.all_echoes(), &ping.soundings));
        (ping.bottom_track, ping.water_track) = tracks.map_or((None, None), |(bottom, water)| (Some(bottom), water));
        Ok(())
    }
}
