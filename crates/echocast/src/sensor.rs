//! Sensors: a scan pattern, a beam and a receiver, read from YAML or taken from a preset.

use crate::detect::{Detection, Noise};
use crate::echo::IntensityEncoding;
use crate::emitter::BeamTable;
use crate::error::Result;
use std::path::Path;
use std::sync::Arc;

/// A depth sensor, ready to scan.
#[derive(Clone, Debug)]
pub struct Sensor {
    pub(crate) name: String,
    pub(crate) beams: Arc<BeamTable>,
    pub(crate) wavelength_nm: f64,
    pub(crate) range_min_m: f64,
    pub(crate) range_max_m: f64,
    pub(crate) range_resolution_m: f64,
    pub(crate) detection: Detection,
    pub(crate) noise: Noise,
    pub(crate) intensity: IntensityEncoding,
}

impl Sensor {
    /// The preset called `name`.
    ///
    /// # Errors
    /// [`crate::Error::Missing`] with near names.
    pub fn preset(_name: &str) -> Result<Sensor> {
        todo!()
    }

    /// Reads a sensor file.
    ///
    /// # Errors
    /// File, line and key of what is wrong, with the nearest known key.
    pub fn load(_path: impl AsRef<Path>) -> Result<Sensor> {
        todo!()
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The beams of one scan.
    pub fn beams(&self) -> &BeamTable {
        &self.beams
    }
}
