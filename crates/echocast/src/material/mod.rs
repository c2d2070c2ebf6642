//! What surfaces are made of, and how much light and sound they send back.

mod change;
mod decode;
mod file;
pub(crate) mod fresnel;
mod infrared;
mod library;
mod optics;
mod reflectance;
mod scattering;
mod sound;
mod texture;
mod words;

pub use change::Changes;
use infrared::Estimate;
pub(crate) use optics::{Mirrors, Optics};
pub(crate) use reflectance::Reflectances;
pub use reflectance::{Reflectance, ReflectanceSample, Returned, Why};
pub use scattering::{RetroSample, Scattering};
pub use sound::{Sediment, Sound};
pub use texture::{Filter, Texture, TextureRef, Wrap};
pub(crate) use texture::{TextureBudget, linear_from_srgb, srgb_byte};

use crate::ground::named::named;
use serde::Deserialize;
use std::sync::Arc;

/// Where the reflectance of a surface comes from when its material does not give it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReflectanceSource {
    /// Luminance of the linear base colour (Rec. 709 weights), whatever the wavelength.
    Luminance,
    /// Alpha of the base colour, as in the paper's system.
    Alpha,
    /// The library material that its name speaks of; else what its base colour suggests for the wavelength.
    #[default]
    Library,
}

named! { ReflectanceSource: Luminance "luminance", Alpha "alpha", Library "library" }

/// What the alpha of a surface's base colour means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Alpha {
    /// Nothing, unless the scan uses it as the reflectance ([`ReflectanceSource::Alpha`]).
    #[default]
    Ignore,
    /// Its reflectance, where the material gives no other, whatever the scan uses.
    Reflectance,
    /// Where there is a surface at all: light passes where alpha is below [`Material::alpha_cutoff`].
    Cutout,
}

/// A surface material as given by a file; colours are linear.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Material {
    /// Name in the file.
    pub name: String,
    /// Where the numbers come from; may be empty.
    pub source: String,
    /// Linear base colour and alpha, 0..1.
    #[serde(deserialize_with = "file::color_and_alpha")]
    pub base_color: [f32; 4],
    /// Image that multiplies the base colour.
    #[serde(skip)]
    pub base_color_texture: Option<TextureRef>,
    /// What alpha means (in glTF `alphaMode: MASK` or `extras.alpha`).
    pub alpha: Alpha,
    /// Least alpha of a cut-out that stops light, 0..1.
    pub alpha_cutoff: f32,
    /// Reflectance, where the file gives it (in glTF `extras.reflectance` or `blainder_rgba`'s fourth number).
    pub reflectance: Option<Reflectance>,
    /// How returned light is distributed over directions.
    pub scattering: Scattering,
    /// glTF metallic factor, 0..1; 1 with roughness 0 is a mirror.
    pub metallic: f32,
    /// glTF roughness factor, 0..1.
    pub roughness: f32,
    /// Index of refraction (`KHR_materials_ior`, `blainder_ior`), 1 at least; of a metal, whose `extinction_index` is not 0,
    /// above 0.
    pub ior: f32,
    /// Fraction of light that passes the surface (`KHR_materials_transmission`), 0..1.
    pub transmission: f32,
    /// Thickness of the volume behind the surface (`KHR_materials_volume`), metres; 0 = a thin sheet.
    pub thickness_m: f32,
    /// Distance after which light has the attenuation colour (`KHR_materials_volume`), metres, infinite = clear.
    pub attenuation_distance_m: f32,
    /// Linear colour of white light after the attenuation distance (`KHR_materials_volume`).
    pub attenuation_color: [f32; 3],
    /// Thickness of a pane that the scene models as a single sheet, metres; none is a body with an inside, or, where
    /// `thickness_m` is 0, an infinitely thin pane.
    pub pane_m: Option<f32>,
    /// Index of refraction for the travel time of pulses, at least 1; none is `ior`.
    pub group_index: Option<f32>,
    /// Imaginary part of a metal's index of refraction, whose real part is `ior`: with it a mirror's loss depends on
    /// the angle; without it (0) the mirror leaves its reflectance.
    pub extinction_index: f32,
    /// Reflectance of the dirt on a mirror, glass or water, 0..1; it is diffuse, and what lies behind gets the rest.
    pub dirt: f32,
    /// What it does with sound (in glTF `extras.sound`); see [`Material::sound_law`].
    pub sound: Option<Sound>,
    /// Whether the file wants the surface drawn without lighting (`KHR_materials_unlit`).
    pub unlit: bool,
    /// Whether both sides of the surface are seen (in glTF `doubleSided`). Beams see both in any case; this only tells
    /// rooms from bodies, see [`BuiltScene::enclosure`](crate::BuiltScene::enclosure).
    #[serde(skip)]
    pub double_sided: bool,
    /// How it changes over time; none: it stays as it is. The other fields are what it is at time 0.
    #[serde(skip)]
    pub changes: Option<Arc<Changes>>,
}

impl Default for Material {
    /// glTF's default material: white, fully rough, but not metallic here (a scanner sees no mirrors where none are
    /// specified).
    fn default() -> Self {
        Material {
            name: String::new(),
            source: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            alpha: Alpha::Ignore,
            alpha_cutoff: 0.5,
            reflectance: None,
            scattering: Scattering::Lambert,
            metallic: 0.0,
            roughness: 1.0,
            ior: 1.5,
            transmission: 0.0,
            thickness_m: 0.0,
            attenuation_distance_m: f32::INFINITY,
            attenuation_color: [1.0; 3],
            pane_m: None,
            group_index: None,
            extinction_index: 0.0,
            dirt: 0.0,
            sound: None,
            unlit: false,
            double_sided: false,
            changes: None,
        }
    }
}

impl Material {
    /// What it does with sound, from itself or from the library material of its name; if neither gives it, its
    /// reflectance may: [`Sound::of_reflectance`].
    pub fn sound_law(&self) -> Option<&Sound> {
        library::sound(self)
    }

    /// This material reflecting light and sound as `other` does; `source` is where that comes from.
    pub(crate) fn made_of(&self, other: &Material, source: String) -> Material {
        let alpha = if self.alpha == Alpha::Reflectance { Alpha::Ignore } else { self.alpha };
        Material {
            source,
            alpha,
            reflectance: other.reflectance.clone(),
            scattering: other.scattering.clone(),
            sound: other.sound.clone().or_else(|| self.sound.clone()),
            changes: None,
            ..self.clone()
        }
    }

    /// What its colour says of its reflectance at `wavelength_nm` in a scan that uses `source`.
    pub(crate) fn by_color(&self, source: ReflectanceSource, wavelength_nm: f64) -> ByColor {
        match source {
            _ if self.alpha == Alpha::Reflectance => ByColor::Alpha,
            ReflectanceSource::Alpha => ByColor::Alpha,
            ReflectanceSource::Luminance => ByColor::Luminance,
            // The colour of a metal is its reflectance, and hardly changes beyond red.
            ReflectanceSource::Library if self.metallic > 0.5 => ByColor::Luminance,
            ReflectanceSource::Library => ByColor::Infrared(Estimate::at(wavelength_nm)),
        }
    }
}

impl ReflectanceSource {
    /// The one that stands for it where surfaces reflect sound: the names and the infrared say nothing of that.
    pub(crate) fn of_sound(self) -> ReflectanceSource {
        if self == ReflectanceSource::Library { ReflectanceSource::Luminance } else { self }
    }
}

/// What a base colour says of reflectance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ByColor {
    Luminance,
    Alpha,
    Infrared(Estimate),
}

impl ByColor {
    /// Reflectance, 0..1, of a linear base colour and alpha.
    pub fn of(&self, rgba: [f32; 4]) -> f32 {
        let [r, g, b, alpha] = rgba;
        match self {
            ByColor::Luminance => luminance([r, g, b]),
            ByColor::Alpha => alpha,
            ByColor::Infrared(estimate) => estimate.of([r, g, b]),
        }
    }
}

/// Luminance of a linear colour: Rec. ITU-R BT.709 luma coefficients on linear light.
fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
