//! The materials of a scene as one wavelength sees them.

use super::{Material, MaterialEntry, ReflectanceSource};
use std::sync::Arc;

/// Reflectance of every material at one wavelength.
pub(crate) struct Reflectances {
    /// In the order of the materials; NaN where only the image of the surface knows.
    pub by_material: Vec<f32>,
    wavelength_nm: f64,
    pub source: ReflectanceSource,
}

impl Reflectances {
    /// In this order: the material's own word, the material library, the base colour as `source` says.
    pub fn new(materials: &[Arc<Material>], wavelength_nm: f64, source: ReflectanceSource) -> Self {
        let of = |material: &Arc<Material>| {
            if let Some(value) = material.reflectance {
                value
            } else if let Some(entry) = MaterialEntry::find(&material.name) {
                entry.reflectance_at(wavelength_nm)
            } else if material.base_color_texture.is_some() {
                f32::NAN
            } else {
                source.of(material.base_color)
            }
        };
        Reflectances { by_material: materials.iter().map(of).collect(), wavelength_nm, source }
    }

    /// Whether they hold at this wavelength, for this source.
    pub fn are_for(&self, wavelength_nm: f64, source: ReflectanceSource) -> bool {
        (self.wavelength_nm, self.source) == (wavelength_nm, source)
    }
}
