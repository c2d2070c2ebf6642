//! How a sensor receives light in an environment, prepared once for all similar scans.

use super::Sensor;
use crate::detect::{Errors, FalseAlarms, Gate, Method, Receiver, ReturnMode, Threshold};
use crate::echo::{Air, Cone, ParticleOrder, Pulse, ReceiverOptics};
use crate::medium::{Environment, Weather};
use emitter::BeamTable;
use emitter::pattern::{LinePlane, Pattern};
use glam::DVec3;
use ground::error::Result;
use ground::kept::try_kept;
use ground::profile::Profile;
use ground::rng::Rng;
use std::sync::Arc;

/// How a sensor receives light in an environment.
#[derive(Debug)]
pub(crate) struct Reception {
    environment: Environment,
    /// World position of the rays' (0, 0, 0), m.
    origin: DVec3,
    profile: Profile,
    threshold: Threshold,
    pub errors: Errors,
    alarms: Option<FalseAlarms>,
    /// What is in the air, if anything.
    pub air: Option<Air>,
    efficiency: Vec<f32>,
}

impl Reception {
    /// The receiver of `sensor`, whose reception this is, for a scan with `beams`.
    pub(crate) fn receiver<'a>(&'a self, sensor: &'a Sensor, beams: &'a BeamTable, rng: Rng) -> Receiver<'a> {
        let method = match &sensor.camera {
            _ if self.profile.is_program() => Method::Paper(self.air.as_ref()),
            Some(camera) if !self.profile.is_paper() => Method::Amcw(camera),
            _ => Method::Pulsed,
        };
        let range = [sensor.range_min_m as f32, sensor.range_max_m as f32];
        Receiver {
            method,
            gate: Gate { threshold: &self.threshold, rng, range, beams },
            alarms: self.alarms,
            efficiency: &self.efficiency,
            mode: sensor.searched_mode(self.profile),
        }
    }
}

impl Sensor {
    /// How it receives light in `environment`; reuses what was prepared for an equal one.
    ///
    /// # Errors
    /// An environment that is not valid.
    pub(crate) fn reception(
        &self,
        environment: &Environment,
        origin: DVec3,
        profile: Profile,
    ) -> Result<Arc<Reception>> {
        let fits =
            |known: &Reception| (known.origin, known.profile) == (origin, profile) && known.environment == *environment;
        try_kept(&self.receptions, fits, || {
            environment.check()?;
            let threshold = self.threshold(profile);
            let weather = Weather::new(environment, self.wavelength_nm, profile.is_paper(), origin);
            let range = self.range_error(threshold.clone());
            let order = match self.searched_mode(profile) {
                ReturnMode::First => ParticleOrder::FirstOnly,
                ReturnMode::Last => ParticleOrder::Range,
                _ => ParticleOrder::Strength,
            };
            Ok(Reception {
                environment: environment.clone(),
                origin,
                profile,
                errors: Errors::new(&self.noise, range, &threshold, self.doppler, self.scans_across()),
                alarms: FalseAlarms::new(&self.detection.model, &threshold),
                air: Air::new(weather, self.optics(&threshold), order, !profile.is_program()),
                efficiency: self.detection.channel_efficiency.iter().map(|&part| part as f32).collect(),
                threshold,
            })
        })
    }

    /// Whether it counts scan angles from straight down: a line scanner without a head, across the flight.
    fn scans_across(&self) -> bool {
        matches!(&self.spec.pattern, Pattern::LineScan(scan) if scan.plane == LinePlane::Across && scan.head.is_none())
    }

    /// Whether beams have one ray and one return each in `profile`, whatever their description says.
    pub(crate) fn has_one_ray(&self, profile: Profile) -> bool {
        // Without the camera model, a pixel of several rays is meaningless.
        profile.is_program() || profile.is_paper() && self.camera.is_some()
    }

    /// Whether all beams are formed as signals in `profile`.
    pub(crate) fn has_signals(&self, profile: Profile) -> bool {
        !self.has_one_ray(profile) && (self.detection.blooming.is_some() || !self.signals.are_simple())
    }

    /// Whether its beams are one ray each, all of whose echoes are reported, and no light spills from one to the other.
    pub(crate) fn has_single_beams(&self) -> bool {
        let is_one = self.signals.rays() == 1 && self.signals.adaptive.is_none();
        is_one && self.spec.returns.mode == ReturnMode::All && self.detection.blooming.is_none()
    }

    /// Which echoes are searched for in `profile`.
    fn searched_mode(&self, profile: Profile) -> ReturnMode {
        // Signals are formed from all echoes.
        if self.has_signals(profile) { ReturnMode::All } else { self.spec.returns.mode }
    }

    /// Its detection model, ready to use in `profile`.
    #[doc(hidden)]
    pub fn threshold(&self, profile: Profile) -> Threshold {
        Threshold::new(&self.detection.model, (self.wavelength_nm, self.spec.beam.pulse_ns), profile.is_program())
    }

    /// Its optics, for light that its receiver detects above `threshold`.
    pub(crate) fn optics(&self, threshold: &Threshold) -> ReceiverOptics {
        let beam = &self.spec.beam;
        ReceiverOptics {
            pulse: Pulse::new(beam.pulse_shape, beam.pulse_ns),
            overlap: beam.overlap_m,
            near_range: beam.near_range_m,
            coherent: self.doppler.is_some(),
            cone: Cone {
                start: beam.exit_diameter_mm * 1e-3,
                divergence: beam.divergence_mrad.map(|mrad| mrad * 1e-3),
            },
            least_power: threshold.least_power(),
            noise_power: threshold.noise_power(),
            detects_in_noise: matches!(threshold, Threshold::Statistical { .. }),
            range_min: self.range_min_m,
            range_max: match &*self.beams.range_max {
                [] => self.range_max_m,
                limits => limits.iter().copied().fold(0.0, f32::max).into(),
            },
        }
    }
}
