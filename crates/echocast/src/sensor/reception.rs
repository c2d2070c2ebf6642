//! How a sensor receives light in an environment, prepared once for all similar scans.

use super::Sensor;
use crate::detect::{Errors, FalseAlarms, ReturnMode, Threshold};
use crate::echo::Air;
use crate::ground::error::Result;
use crate::ground::kept::try_kept;
use crate::medium::{Environment, Weather};
use glam::DVec3;
use std::sync::Arc;

/// How a sensor receives light in an environment.
#[derive(Debug)]
pub(crate) struct Reception {
    environment: Environment,
    /// World position of the rays' (0, 0, 0), m.
    origin: DVec3,
    /// Whether the paper's equations replace ours, and whether those of its program do.
    of_the_paper: [bool; 2],
    /// Which echoes are searched for.
    pub mode: ReturnMode,
    pub threshold: Threshold,
    pub errors: Errors,
    /// Noise that passes for echoes, if there is any.
    pub alarms: Option<FalseAlarms>,
    /// What is in the air, if anything.
    pub air: Option<Air>,
    /// Fraction of the light that each channel uses; empty if all are alike.
    pub efficiency: Vec<f32>,
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
        of_the_paper: [bool; 2],
        mode: ReturnMode,
    ) -> Result<Arc<Reception>> {
        let fits = |known: &Reception| {
            (known.origin, known.of_the_paper, known.mode) == (origin, of_the_paper, mode)
                && known.environment == *environment
        };
        try_kept(&self.receptions, fits, || {
            environment.check()?;
            let [as_printed, as_computed] = of_the_paper;
            let threshold = self.threshold(as_computed);
            let weather = Weather::new(environment, self.wavelength_nm, as_printed, origin);
            let range = self.range_error(threshold.clone());
            Ok(Reception {
                environment: environment.clone(),
                origin,
                of_the_paper,
                mode,
                errors: Errors::new(&self.noise, range, &threshold, self.doppler),
                alarms: FalseAlarms::new(&self.detection.model, &threshold),
                air: Air::new(weather, self.receiver(threshold.clone()), mode, !as_computed),
                efficiency: self.detection.channel_efficiency.iter().map(|&part| part as f32).collect(),
                threshold,
            })
        })
    }
}
