//! How much light materials return: one at every wavelength, all of a scene at one.

use super::{ByColor, Material, Mirrors, Optics, Reflectance, ReflectanceSource, Scattering, library};
use std::fmt;
use std::sync::Arc;

/// How much light of one wavelength a material returns, and why.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Returned {
    /// Reflectance, 0..1; with an image, that of the colour which multiplies it.
    pub value: f32,
    /// Standard deviation of the true reflectance about the value, where known.
    pub spread: Option<f32>,
    /// Whether it differs from place to place with the image of the base colour.
    pub by_image: bool,
    /// Where the value comes from.
    pub why: Why,
}

/// Where the reflectance of a material comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Why {
    /// The material specifies it.
    Given,
    /// The name of the material indicates a library material.
    Named {
        /// The library material.
        material: &'static str,
        /// The words of its name that indicate it.
        words: &'static str,
    },
    /// Its colour suggests it.
    Estimated,
    /// It has no colour of its own, only white or Blender's grey, as in files where no colour was chosen, or none that
    /// the exporter could write; the reflectance is what that colour suggests.
    Assumed,
    /// The luminance of its base colour, as requested or because it is a metal.
    Luminance,
    /// The alpha of its base colour, as requested or as the material itself specifies.
    Alpha,
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Why::Given => f.write_str("given"),
            Why::Named { material, words } if material == words => write!(f, "library material {material}"),
            Why::Named { material, words } => write!(f, "library material {material}, for \"{words}\" in its name"),
            Why::Estimated => f.write_str("estimated from the colour"),
            Why::Assumed => f.write_str("assumed: no colour is given except the default"),
            Why::Luminance => f.write_str("luminance of the colour"),
            Why::Alpha => f.write_str("alpha of the colour"),
        }
    }
}

impl Material {
    /// How much light of `wavelength_nm` it returns: as the material itself specifies, else as `source` selects.
    pub fn returned(&self, wavelength_nm: f64, source: ReflectanceSource) -> Returned {
        if let Some(own) = &self.reflectance {
            return Returned { value: own.at(wavelength_nm), spread: None, by_image: false, why: Why::Given };
        }
        let by_color = self.by_color(source, wavelength_nm);
        if source == ReflectanceSource::Library
            && let Some((reflectance, found)) = library::reflectance(self)
        {
            let library::LibraryMaterial { material, names } = found.entry;
            let why = Why::Named { material: &material.name, words: found.phrase };
            return Returned { value: reflectance.at(wavelength_nm), spread: names.spread, by_image: false, why };
        }
        let (why, spread) = match by_color {
            ByColor::Infrared(estimate) if self.has_default_color() => (Why::Assumed, Some(estimate.sigma)),
            ByColor::Infrared(estimate) => (Why::Estimated, Some(estimate.sigma)),
            ByColor::Luminance => (Why::Luminance, None),
            ByColor::Alpha => (Why::Alpha, None),
        };
        let by_image = self.base_color_texture.is_some();
        Returned { value: by_color.of(self.base_color), spread, by_image, why }
    }

    /// Whether its colour is what files have where none was chosen: white, which glTF omits, as do exporters that
    /// cannot write a procedural colour, or the 0.8 of new materials in Blender.
    fn has_default_color(&self) -> bool {
        let [r, g, b, _] = self.base_color;
        let plain = |value: f32| (r - value).abs() < 1e-6 && r == g && g == b;
        self.base_color_texture.is_none() && (plain(1.0) || plain(0.8))
    }

    /// Its own reflectance, or the library's for its name.
    #[doc(hidden)]
    pub fn known_reflectance(&self) -> Option<&Reflectance> {
        self.reflectance.as_ref().or_else(|| Some(library::reflectance(self)?.0))
    }
}

/// Reflectance of every material at one wavelength.
pub struct Reflectances {
    /// In the order of the materials; NaN where only the surface's image gives it.
    pub by_material: Vec<f32>,
    /// The greatest effective reflectance of any of them at any angle.
    pub greatest: f32,
    /// Whether any of them scatters differently from a Lambert surface, where that is modelled.
    pub scatter: bool,
    /// What smooth surfaces do with light, in the same order.
    pub optics: Vec<Optics>,
    /// How colours give the reflectance where an image does, in the same order.
    pub by_color: Vec<ByColor>,
    /// Whether any of them mirrors or transmits light.
    pub go_on: bool,
    /// The wavelength that all of these are for, nm.
    pub wavelength_nm: f64,
    /// Where the reflectance of a material comes from that does not specify its own.
    pub source: ReflectanceSource,
    mirrors: Mirrors,
}

impl Reflectances {
    /// Reflectances as by [`Material::returned`]. `mirrors`: what mirrors absorb.
    pub fn new(materials: &[Arc<Material>], wavelength_nm: f64, source: ReflectanceSource, mirrors: Mirrors) -> Self {
        let of = |material: &Arc<Material>| {
            let returned = material.returned(wavelength_nm, source);
            if returned.by_image { f32::NAN } else { returned.value }
        };
        let optics: Vec<Optics> =
            materials.iter().map(|material| Optics::new(material, wavelength_nm, source, mirrors)).collect();
        let by_material: Vec<f32> = materials.iter().map(of).collect();
        // The paper uses Lambert surfaces only.
        let scatter =
            mirrors == Mirrors::Real && materials.iter().any(|material| material.scattering != Scattering::Lambert);
        let greatest = |(material, &value): (&Arc<Material>, &f32)| {
            let value = if value.is_nan() { 1.0 } else { value };
            if scatter { material.scattering.greatest(value) } else { value }
        };
        let own = materials.iter().zip(&by_material).map(greatest);
        Reflectances {
            // Dirt adds to what the surface itself returns.
            greatest: own.zip(&optics).map(|(own, optics)| own * optics.diffuse + optics.dirt).fold(0.0, f32::max),
            by_material,
            scatter,
            by_color: materials.iter().map(|material| material.by_color(source, wavelength_nm)).collect(),
            go_on: optics.iter().any(Optics::goes_on),
            optics,
            wavelength_nm,
            source,
            mirrors,
        }
    }

    /// Whether they are what [`Reflectances::new`] would compute for these parameters.
    pub fn are_for(&self, wavelength_nm: f64, source: ReflectanceSource, mirrors: Mirrors) -> bool {
        (self.wavelength_nm, self.source, self.mirrors) == (wavelength_nm, source, mirrors)
    }
}
