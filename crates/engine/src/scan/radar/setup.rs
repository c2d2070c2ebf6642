//! What is the same for all moments of a scan of a radar, and how the paths of one moment are found.

use super::paths::{FrameLimits, FramePaths};
use super::precipitation::add_precipitation;
use crate::echo::radar::{CentreGrid, ClutterGrid, RadarEchoes, WaveField};
use crate::medium::{RadioAir, wet_radome_db};
use crate::scan::ScanOptions;
use crate::sensor::{RadarSpec, Sensor};
use crate::trace::BuiltScene;
use ::radar::{LobeTable, Paths, Polarisation, RadarPlan, RadarWaveform};
use emitter::Trajectory;
use emitter::pattern::Pattern;
use glam::{DQuat, DVec3};
use ground::error::Result;
use ground::pose::Pose;
use ground::rng::Rng;
use std::borrow::Cow;

/// A radar at one moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct RadarMoment {
    /// Pose of its antenna, and of what carries it.
    pub pose: Pose,
    pub carrier: Pose,
    /// m/s, world.
    pub velocity: DVec3,
    /// s since the start of the run, and the part of the scene's time span.
    pub time: f64,
    pub part: f32,
}

/// What is the same for all moments of a scan.
pub(super) struct RadarSetup<'a> {
    pub scene: &'a BuiltScene,
    pub sensor: &'a Sensor,
    pub spec: &'a RadarSpec,
    pub options: &'a ScanOptions,
    pub trajectory: &'a Trajectory,
    pub rng: Rng,
    air: RadioAir,
    pub plan: &'a RadarPlan,
    /// Gains of elements, transmitter and receiver, where paths are found: all around for antennas that rotate.
    searched: Cow<'a, [LobeTable; 2]>,
    /// Power of a transmitter less all losses, W.
    pub power: f64,
    /// Thermal noise in a cell of a channel, W.
    pub noise: f64,
    /// Range resolution, m, steps in velocity, m/s, and widths of a beam to the left and up, rad.
    resolution: f64,
    rate: f64,
    beam: [f64; 2],
    /// Ranges that it receives, m.
    reach: f64,
}

impl<'a> RadarSetup<'a> {
    pub fn new(
        scene: &'a BuiltScene,
        sensor: &'a Sensor,
        trajectory: &'a Trajectory,
        options: &'a ScanOptions,
    ) -> Result<RadarSetup<'a>> {
        let (spec, parts) = sensor.radar()?;
        let frequency = spec.frequency();
        let tilt = if spec.array.polarisation == Polarisation::Vertical { 90.0 } else { 0.0 };
        let air = RadioAir::new(&options.environment, frequency, tilt, scene.origin());
        let wet = if spec.wet_radome_mm > 0.0 { wet_radome_db(spec.wet_radome_mm, frequency)? } else { 0.0 };
        let plan = &parts.plan;
        let axes = plan.axes();
        let positions = &plan.array().places;
        let width = |axis: usize| {
            let ends = positions.iter().map(|place| f64::from(place[axis]));
            ends.clone().fold(f64::NEG_INFINITY, f64::max) - ends.fold(f64::INFINITY, f64::min)
        };
        let wavelength = spec.waveform.wavelength();
        // Of the array, or of the element.
        let of_array = [1, 2].map(|axis| wavelength / (width(axis) + 0.5 * wavelength));
        let element = &spec.array.rx_pattern;
        let of_element = [element.azimuth_deg, element.elevation_deg].map(|width| width.map_or(1.0, f64::to_radians));
        let farthest = match &spec.waveform {
            RadarWaveform::Fmcw(fmcw) => fmcw.greatest_range(),
            _ => axes.range.at(axes.range.len as f64),
        };
        let searched = match sensor.spec().pattern {
            Pattern::RadarRotor(_) => Cow::Owned([&spec.array.tx_pattern, &spec.array.rx_pattern].map(|pattern| {
                let mut pattern = pattern.clone();
                (pattern.azimuth_deg, pattern.azimuth_table) = Default::default();
                pattern.table()
            })),
            _ => Cow::Borrowed(&plan.patterns),
        };
        Ok(RadarSetup {
            scene,
            sensor,
            spec,
            options,
            trajectory,
            rng: Rng::new(options.seed, options.frame),
            air,
            plan,
            searched,
            power: 1e-3 * 10f64.powf(0.1 * (spec.power_dbm - spec.loss_db - 2.0 * wet)),
            noise: plan.channel_noise(spec.noise_figure_db),
            resolution: axes.range.step,
            rate: axes.velocity.step,
            beam: [0, 1].map(|axis| of_array[axis].min(of_element[axis])),
            reach: farthest.min(sensor.spec().range.max_m.unwrap_or(f64::INFINITY)),
        })
    }

    /// The radar `after` s after the start of the scan, in a frame of the axes of `turned` radians to the left.
    pub fn moment(&self, after: f64, turned: f64) -> RadarMoment {
        let on_trajectory = self.options.start_on_trajectory() + after;
        let pose = self.trajectory.at(on_trajectory);
        let turn = DQuat::from_rotation_z(turned);
        let clock = self.scene.0.clock(self.options.start_time, self.options.freeze);
        RadarMoment {
            pose: Pose { orientation: pose.orientation * turn, ..pose },
            carrier: pose,
            velocity: self.trajectory.velocity(on_trajectory),
            time: self.options.start_time + after,
            part: clock.map_or(0.0, |clock| clock.of(after)),
        }
    }

    /// Finds the paths of a moment within a sector of azimuths and elevations, rad.
    pub fn find(&self, moment: &RadarMoment, sector: [[f64; 2]; 2], paths: &mut FramePaths) -> Result<()> {
        let (_, parts) = self.sensor.radar()?;
        let tables = &self.scene.0;
        let surfaces = parts.surfaces(&tables.surfaces, self.spec.frequency())?;
        let channels = self.plan.array().places.len() as f64;
        let field = WaveField {
            scene: tables,
            surfaces: &surfaces,
            place: moment.pose.position - tables.origin,
            axes: moment.pose.rotation(),
            velocity: moment.velocity,
            time: moment.part,
            wavelength: self.spec.waveform.wavelength(),
            polarisation: self.spec.array.polarisation,
            tx: &self.searched[0],
            rx: &self.searched[1],
            power: self.power,
            air: &self.air,
            reach: self.reach,
            sector,
            // 10 dB below the noise of all channels together.
            floor: (0.1 * self.noise / channels).sqrt(),
        };
        let limits = FrameLimits {
            time: if self.options.freeze { self.options.start_time } else { moment.time },
            mask: self.options.mask,
            mirrors: usize::from(self.spec.mirrors),
            resolution: self.resolution,
            centres: CentreGrid::new(self.resolution, self.rate, self.beam),
            clutter: self.spec.clutter.then(|| self.clutter_grid(sector[0])),
        };
        paths.find(&field, &limits);
        add_precipitation(&field, sector, self.resolution, &self.rng, paths);
        Ok(())
    }

    /// What the radar receives: echoes, and what leaks from its transmitters.
    pub fn received<'e>(&self, echoes: &'e RadarEchoes) -> Cow<'e, Paths> {
        let mut received = Cow::Borrowed(&echoes.paths);
        if let Some(leakage) = &self.spec.leakage {
            self.plan.add_leakage(leakage, received.to_mut());
        }
        received
    }

    /// Width of a beam in azimuth, rad.
    pub fn beam(&self) -> f64 {
        self.beam[0]
    }

    /// Patches of clutter as large as cells; of a radar with very many cells, no more than memory can hold.
    fn clutter_grid(&self, [left, right]: [f64; 2]) -> ClutterGrid {
        /// Most patches of level ground in the field of view.
        const MOST: f64 = 2e6;
        let (range, angle) = (self.resolution, 0.5 * self.beam());
        let patches = self.reach / range * (right - left) / angle;
        let coarser = (patches / MOST).sqrt().max(1.0);
        ClutterGrid { rng: self.rng, range: coarser * range, angle: coarser * angle }
    }

    /// Received amplitude per strength of an echo, sqrt(W) m, without gains.
    pub fn scale(&self) -> f64 {
        self.power.sqrt() * self.spec.waveform.wavelength() / (4.0 * std::f64::consts::PI)
    }

    /// The sector that a radar looks into, rad: a little more than it reports.
    pub fn sector(&self) -> [[f64; 2]; 2] {
        const MORE: f64 = 10.0;
        let Pattern::Radar(view) = &self.sensor.spec().pattern else { return [[-1.0, 1.0]; 2] };
        let [[left, right], [low, high]] = [view.azimuth_deg, view.elevation_deg];
        let azimuth = [(left - MORE).max(-180.0), (right + MORE).min(180.0)];
        let elevation = [(low - MORE).max(-90.0), (high + MORE).min(90.0)];
        [azimuth, elevation].map(|ends| ends.map(f64::to_radians))
    }
}
