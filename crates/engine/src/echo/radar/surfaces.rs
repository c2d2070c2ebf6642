//! The materials of a scene at the frequency of a radar.

use crate::trace::Surfaces;
use ground::error::{Error, Result};
use model::material::{Material, Polarised, RadioSurface};
use std::sync::Arc;

/// How each material of a scene reflects and scatters at one frequency.
#[derive(Debug)]
pub(crate) struct RadarSurfaces {
    frequency_hz: f64,
    materials: Vec<RadioSurface>,
    /// Of each material, [`RadarSurfaces::mirrored`] between steps of the cosine.
    mirrored: Vec<[f32; STEPS]>,
    /// Whether waves pass through each of them, and through any.
    panes: Vec<bool>,
    pub has_panes: bool,
}

/// Least part of the power that a pane lets through.
const LEAST_THROUGH: f32 = 1e-4;

/// Steps of the cosine between which the greatest reflection is kept.
const STEPS: usize = 32;

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
        let panes: Vec<bool> = materials.iter().map(|surface| surface.transmit(1.0).power() > LEAST_THROUGH).collect();
        let has_panes = panes.contains(&true);
        let mirrored = materials.iter().map(greatest).collect();
        Ok(RadarSurfaces { frequency_hz, materials, mirrored, panes, has_panes })
    }

    /// Whether it was made for this frequency.
    pub fn is_for(&self, frequency_hz: f64) -> bool {
        self.frequency_hz == frequency_hz
    }

    /// The surface of a row.
    pub fn of(&self, surfaces: &Surfaces, row: u32) -> &RadioSurface {
        &self.materials[surfaces.rows[row as usize].material as usize]
    }

    /// Fraction of the amplitude that a row mirrors at a cosine of incidence, of either polarisation, at most.
    pub fn mirrored(&self, surfaces: &Surfaces, row: u32, cos: f32) -> f32 {
        let steps = &self.mirrored[surfaces.rows[row as usize].material as usize];
        steps[((cos.clamp(0.0, 1.0) * STEPS as f32) as usize).min(STEPS - 1)]
    }

    /// Whether waves pass through a row.
    pub fn is_pane(&self, surfaces: &Surfaces, row: u32) -> bool {
        self.panes[surfaces.rows[row as usize].material as usize]
    }

    /// Fraction of the amplitude that passes a row met at a cosine of incidence: the mean of both polarisations.
    pub fn through(&self, surfaces: &Surfaces, row: u32, cos: f32) -> f32 {
        if self.is_pane(surfaces, row) { self.of(surfaces, row).transmit(cos).power().sqrt() } else { 0.0 }
    }
}

/// What a surface mirrors at most within each step of the cosine.
fn greatest(surface: &RadioSurface) -> [f32; STEPS] {
    /// Places in a step.
    const PLACES: usize = 4;
    let at = |place: usize| {
        let cos = place as f32 / (STEPS * PLACES) as f32;
        let Polarised { s, p } = surface.reflect(cos);
        s.norm().max(p.norm()) * surface.coherent(cos)
    };
    std::array::from_fn(|step| (step * PLACES..=(step + 1) * PLACES).map(at).fold(0.0, f32::max))
}
