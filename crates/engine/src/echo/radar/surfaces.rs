//! The materials of a scene at the frequency of a radar.

use crate::trace::Surfaces;
use ground::error::{Error, Result};
use model::material::{Material, RadioSurface};
use std::sync::Arc;

/// How each material of a scene reflects and scatters at one frequency.
#[derive(Debug)]
pub(crate) struct RadarSurfaces {
    frequency_hz: f64,
    materials: Vec<RadioSurface>,
    /// Whether waves pass through any of them.
    pub has_panes: bool,
}

impl RadarSurfaces {
    /// # Errors
    /// A law that does not hold at this frequency; names the material.
    pub fn new(surfaces: &Surfaces, frequency_hz: f64) -> Result<RadarSurfaces> {
        let at = |material: &Arc<Material>| {
            let surface = material.radar_law().at(frequency_hz);
            surface.map_err(|error| match error {
                Error::InvalidParameter { name, value, allowed } => {
                    Error::invalid(format!("{name} of the material {:?}", material.name), value, allowed)
                }
                other => other,
            })
        };
        let materials = surfaces.materials.iter().map(at).collect::<Result<Vec<_>>>()?;
        let has_panes = materials.iter().any(|surface| surface.transmit(1.0).power() > 0.0);
        Ok(RadarSurfaces { frequency_hz, materials, has_panes })
    }

    /// Whether it was made for this frequency.
    pub fn is_for(&self, frequency_hz: f64) -> bool {
        self.frequency_hz == frequency_hz
    }

    /// The surface of a row.
    pub fn of(&self, surfaces: &Surfaces, row: u32) -> &RadioSurface {
        &self.materials[surfaces.rows[row as usize].material as usize]
    }

    /// Fraction of the amplitude that passes a row met at a cosine of incidence: the mean of both polarisations.
    pub fn through(&self, surfaces: &Surfaces, row: u32, cos: f32) -> f32 {
        self.of(surfaces, row).transmit(cos).power().sqrt()
    }
}
