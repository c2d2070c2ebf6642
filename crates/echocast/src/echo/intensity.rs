//! What an instrument reports as intensity.

use serde::{Deserialize, Serialize};

/// How received energy becomes the `intensity` column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntensityEncoding {
    /// Range-corrected reflectivity `rho cos(theta)`, 0..1.
    #[default]
    Reflectivity,
    /// The same in 8 bits: 0..100 diffuse percent, 101..255 retro-reflectors.
    Reflectivity8,
    /// Relative received energy of the hard-target radar equation, `rho cos(theta) / (pi R^2)`, 1/(m^2 sr).
    Power,
}

impl IntensityEncoding {
    /// Value that means full scale.
    pub fn full_scale(self) -> f32 {
        match self {
            IntensityEncoding::Reflectivity | IntensityEncoding::Power => 1.0,
            IntensityEncoding::Reflectivity8 => 255.0,
        }
    }
}
