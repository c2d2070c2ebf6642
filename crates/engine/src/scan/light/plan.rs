//! The plan of a scan: what is the same for all its beams.

use super::halo::Halos;
use crate::detect::{Errors, PulseAssignment, Receiver};
use crate::echo::{Air, IntensityModel, PathLimits, RequestedQuantities, Surroundings};
use crate::scan::ScanOptions;
use crate::sensor::{Adaptive, IntensitySpec, Reception, Sensor, Signals};
use crate::trace::{Clock, Cover, Later, Sight, Tables};
use cloud::{Driver, FLOW, Field, Frame, ScanLine};
use emitter::pattern::Pattern;
use emitter::{Across, Aim, BeamTable, Footprint, Trajectory};
use glam::{Mat3, Vec3};
use ground::error::Result;
use ground::lanes::{LANES, MISS, RayBatch};
use ground::rng::Rng;
use model::material::{Mirrors, Optics, ReflectanceSource, Reflectances};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

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

/// Columns of how strong an echo is, against what is known beforehand.
pub(super) const RADIOMETRY: [Field; 2] = [Field::ReflectanceDb, Field::AmplitudeDb];

/// Columns of its shape.
pub(super) const SHAPE: [Field; 2] = [Field::PulseWidth, Field::Deviation];

/// The plan of one scan: everything that is the same for all its beams, a part for each step.
pub(super) struct ScanPlan<'a> {
    pub options: &'a ScanOptions,
    pub rng: Rng,
    pub aim: Aiming<'a>,
    pub world: World<'a>,
    pub receiver: Receiver<'a>,
    /// Bright surfaces whose light leaks into neighbouring beams; see [`ScanPlan::find_halos`].
    pub halos: Option<Halos>,
    pub measure: Measuring<'a>,
    /// The driver that publishes such clouds, if known.
    pub driver: Option<Driver>,
    pub scan_line: Option<ScanLine>,
    /// Time from one frame to the next, s.
    pub frame_period: f64,
    /// What transforms points to the start, if requested.
    pub deskew: Option<Deskew>,
    /// How beams of several rays or returns are formed; `None` where beams have one ray and one return each.
    pub signals: Option<&'a Arc<Signals>>,
    /// Whether this applies to all beams, or only to those that hit more than one place, which also have one return
    /// each.
    pub has_signals: bool,
    /// Most rays of a beam that has as many as it takes.
    pub most_adaptive: u32,
    /// Whether echoes may have causes other than the surfaces that rays hit directly.
    pub several_causes: bool,
    /// Rays that have been traced.
    pub rays: AtomicU64,
}

/// The beams and their poses.
pub(super) struct Aiming<'a> {
    pub beams: &'a BeamTable,
    /// The ring of each channel.
    pub rings: &'a [u16],
    pub trajectory: &'a Trajectory,
    /// Where the sensor is taken to be, if that differs and points are in the world.
    pub estimated: Option<&'a Trajectory>,
    pub pose: Aim<'a>,
    /// Length of rays, m: beyond the maximum range where measured ranges wrap.
    pub reach: f32,
    pub coherent: bool,
    /// Whether the rows of `beams` are lines of a mechanism that sweeps.
    pub has_lines: bool,
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

/// What transforms points to the start of a scan.
pub(super) struct Deskew {
    /// Time of the start, 0 to 1 of the scene's time span, and the length of that span, s, where anything moves.
    pub start: Option<(f32, f32)>,
    /// Rotation and position of the sensor at the start, as for a beam, where points are in its frame.
    pub sensor: Option<(Mat3, Vec3)>,
}

impl Deskew {
    /// For a scan along `scan.aim`, if deskew is requested.
    pub fn new(scan: &ScanPlan) -> Option<Deskew> {
        if !scan.options.deskew {
            return None;
        }
        let start = scan.aim.clock.zip(scan.world.scene.span).filter(|_| !scan.options.freeze);
        Some(Deskew {
            start: start.map(|(clock, span)| (clock.of(0.0), span.length as f32)),
            sensor: (scan.options.coordinates == Frame::Sensor).then(|| scan.aim.pose.start()),
        })
    }
}

/// What is measured of these echoes.
pub(super) struct Measuring<'a> {
    pub errors: &'a Errors,
    pub intensity: IntensityModel,
    /// `rho_eff / R^2` beyond which intensity does not rise, 1/m^2.
    pub saturation: Option<f32>,
    /// Standard deviation of ranges over range, due to rain.
    pub rain: f32,
    /// Whether the range limits also apply to measured ranges; the paper's program adds its errors afterwards.
    pub limited: bool,
    /// Whether powers have errors, are requested, and none of them marks an echo as not detected.
    pub flickers: bool,
    /// Whether [`RADIOMETRY`] and [`SHAPE`] are requested.
    pub radiometry: bool,
    pub shapes: bool,
    /// Full width of the pulse at half its peak power, s; NaN: it has none.
    pub pulse_s: f32,
    /// How echoes are assigned to pulses, where that plays a part.
    pub assignment: Option<PulseAssignment>,
}

impl ScanOptions {
    /// Source of reflectances that materials do not specify.
    fn light_from(&self) -> ReflectanceSource {
        self.reflectance_source.unwrap_or(ReflectanceSource::of(self.profile))
    }

    /// What light sees of a scene.
    pub(in crate::scan) fn sight(&self) -> Sight {
        let rng = Rng::new(self.seed, self.frame);
        Sight { mask: self.mask, cover: Cover::of_light(self.light_from(), rng) }
    }
}

impl<'a> ScanPlan<'a> {
    /// With the `beams` that `sensor` has when the scan starts, and its `reception` there.
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
        let profile = options.profile;
        let rng = Rng::new(options.seed, options.frame);
        let receiver = reception.receiver(sensor, beams, rng);
        let Reception { errors, air, .. } = reception;
        let reflectances =
            scene.surfaces.reflectances(sensor.wavelength_nm, options.light_from(), Mirrors::of(profile));
        let limits = || PathLimits::new(profile, options.specular_depth, sensor.glint());
        let paths = reflectances.go_on.then(limits);
        // A beam of one ray has one echo where neither mirrors nor the air return others.
        let is_alone = air.is_none() && paths.is_none() && receiver.alarms.is_none() && sensor.has_single_beams();
        let has_signals = sensor.has_signals(profile) && !is_alone;
        let is_adaptive = !sensor.has_one_ray(profile) && sensor.signals.adaptive.is_some();
        let signals = Some(&sensor.signals).filter(|_| has_signals || is_adaptive);
        let fields = options.fields;
        let frame_period = options.frame_period.unwrap_or(beams.period);
        let depends = receiver.depends_on_light() || errors.depend_on_light();
        let has_power = fields.contains(Field::Intensity) || fields.contains_any(&RADIOMETRY);
        let needs_echo = signals.is_some() || air.is_some() || paths.is_some() || depends || has_power;
        let normals = [Field::NormalX, Field::NormalY, Field::NormalZ, Field::CosIncidence];
        let colors = fields.contains_any(&[Field::Red, Field::Green, Field::Blue]);
        let rain = air.as_ref().map_or(0.0, Air::range_noise);
        let moves = fields.has_motion() || options.deskew;
        let threshold = receiver.gate.threshold;
        let scan = ScanPlan {
            options,
            rng,
            aim: Aiming {
                beams,
                rings: &sensor.rings,
                trajectory,
                estimated: options.estimated_trajectory.as_deref().filter(|_| options.coordinates == Frame::World),
                pose: Aim::new(trajectory, options.start_on_trajectory(), scene.origin),
                reach: if receiver.wraps() { f32::INFINITY } else { sensor.range_max_m as f32 },
                coherent: beams.is_coherent(),
                has_lines: matches!(sensor.spec().pattern, Pattern::LineScan(_)),
                clock: scene.clock(options.start_time, options.freeze),
            },
            world: World {
                scene,
                sight: options.sight(),
                reflectances,
                air: air.as_ref(),
                paths,
                smooth: !profile.is_program() && scene.surfaces.has_shading_normals,
                needs_normals: needs_echo || fields.contains_any(&normals),
                needs_lookup: needs_echo || fields.contains_any(&LABELS) || colors,
                requested: RequestedQuantities { colors, reflectance: needs_echo },
                later: if fields.contains_any(&FLOW) { scene.later(frame_period)? } else { None },
                motion: scene.span.is_some() && moves,
            },
            measure: Measuring {
                flickers: !receiver.reports_undetected() && errors.flicker() && has_power,
                radiometry: fields.contains_any(&RADIOMETRY),
                shapes: fields.contains_any(&SHAPE),
                pulse_s: sensor.pulse_s(),
                assignment: sensor.assignment(),
                errors,
                rain,
                intensity: {
                    let IntensitySpec { encoding, white_count, .. } = sensor.intensity;
                    IntensityModel::new(profile, encoding, white_count.into())
                },
                saturation: threshold.power().zip(sensor.detection.saturation).map(|(power, most)| power * most as f32),
                limited: !profile.is_paper() && (errors.any || receiver.camera().is_some() || rain > 0.0),
            },
            several_causes: paths.is_some()
                || air.is_some()
                || receiver.alarms.is_some()
                || receiver.camera().is_some()
                || signals.is_some(),
            receiver,
            halos: None,
            driver: sensor.driver(),
            scan_line: sensor.scan_line(),
            frame_period,
            deskew: None,
            most_adaptive: sensor.signals.adaptive.as_ref().map_or(1, |adaptive| adaptive.most),
            signals,
            has_signals,
            rays: AtomicU64::new(0),
        };
        Ok(ScanPlan { deskew: Deskew::new(&scan), ..scan })
    }

    /// Most rays of a beam.
    pub fn most_rays(&self) -> u32 {
        match self.signals {
            None => 1,
            Some(signals) if signals.adaptive.is_some() => self.most_adaptive,
            Some(signals) => signals.rays() as u32,
        }
    }

    /// Gives beams of as many rays as it takes no more than `most`.
    pub fn limit(&mut self, most: u32) {
        self.most_adaptive = most;
        if let Some(Adaptive { one_ray, .. }) = self.signals.and_then(|signals| signals.adaptive.as_ref())
            && most == 1
        {
            self.signals = Some(one_ray).filter(|_| self.has_signals);
        }
    }

    /// Greatest number of returns of a beam.
    pub fn most_returns(&self) -> usize {
        self.signals.map_or(1, |signals| signals.rule.most())
    }
}

impl ScanPlan<'_> {
    /// What is in the air where it changes echoes one by one: not for the paper's program, which applies it only to the
    /// whole path.
    pub fn air_on_the_way(&self) -> Option<&Air> {
        self.world.air.filter(|_| !self.receiver.reports_undetected())
    }

    /// Whether the directions of rays differ from those reported for their beams.
    pub fn points_elsewhere(&self) -> bool {
        let Errors { pointing_sigma, encoder, .. } = self.measure.errors;
        let folds = self.measure.assignment.is_some_and(|assignment| assignment.folds);
        folds || *pointing_sigma > 0.0 || encoder.is_some() || self.receiver.jittering().is_some()
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
        if self.measure.intensity.is_calibrated() { self.receiver.efficiency_of(beam).max(1e-6) } else { 1.0 }
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

    /// Light below which paths by mirrors and through glass are not followed, 1/m^2: a hundredth of what is just detected
    /// adds nothing to what is detected.
    pub fn least_power_of_paths(&self) -> f32 {
        0.01 * self.receiver.gate.least_power()
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
}
