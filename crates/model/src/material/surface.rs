//! The material of a surface.

use super::infrared::Estimate;
use super::{Changes, Radio, RadioSource, Reflectance, Scattering, Sound, TextureRef, file, library};
use ground::builder;
use ground::named;
use ground::profile::Profile;
use serde::Deserialize;
use std::sync::Arc;

/// Where the reflectance of a surface comes from when its material does not give it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReflectanceSource {
    /// Luminance of the linear base colour (Rec. 709 weights), whatever the wavelength.
    Luminance,
    /// Alpha of the base colour, as in the paper's system.
    Alpha,
    /// The library material that its name indicates; else the estimate from its base colour for the wavelength.
    #[default]
    Library,
}

impl ReflectanceSource {
    /// What a scan in `profile` uses by default.
    #[doc(hidden)]
    pub fn of(profile: Profile) -> ReflectanceSource {
        profile.choose(ReflectanceSource::Library, ReflectanceSource::Luminance, ReflectanceSource::Alpha)
    }
}

named! { ReflectanceSource: Luminance "luminance", Alpha "alpha", Library "library" }

/// What the alpha of a surface means: that of its base colour, times those of its images and its vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Alpha {
    /// Nothing, unless the scan uses it as the reflectance ([`ReflectanceSource::Alpha`]): the surface is solid.
    #[default]
    #[serde(alias = "ignore")]
    Solid,
    /// The fraction of its area that the surface covers: a ray of light is stopped with this probability, drawn
    /// independently at every triangle, unless the scan uses alpha as the reflectance. To sound it is solid, unless
    /// alpha is 0.
    Coverage,
    /// Where there is a surface at all: light and sound pass where alpha is below [`Material::alpha_cutoff`].
    Cutout,
    /// Its reflectance, where the material gives no other, whatever the scan uses.
    Reflectance,
}

named! { Alpha: Solid "solid", Coverage "coverage", Cutout "cutout", Reflectance "reflectance" }

builder! {
    /// A surface material as given by a file; colours are linear. The default is glTF's: white, fully rough, but not
    /// metallic here (a scanner sees no mirrors where none are specified).
    #[derive(Clone, Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Material {
        /// Name in the file.
        pub name: String = String::new(),
        /// Where the numbers come from; may be empty.
        pub source: String = String::new(),
        /// Linear base colour and alpha, 0..1.
        #[serde(deserialize_with = "file::color_and_alpha")]
        pub base_color: [f32; 4] = [1.0; 4],
        /// Image that multiplies the base colour.
        #[serde(skip)]
        pub base_color_texture: Option<TextureRef> = None,
        /// Image whose alpha is used instead of that of the base colour's image.
        #[serde(skip)]
        pub alpha_texture: Option<TextureRef> = None,
        /// What alpha means (in glTF `alphaMode` or `extras.alpha`).
        pub alpha: Alpha = Alpha::Solid,
        /// Least alpha of a cut-out that stops light, 0..1.
        pub alpha_cutoff: f32 = 0.5,
        /// Reflectance, where the file gives it (in glTF `extras.reflectance` or `blainder_rgba`'s fourth number).
        pub reflectance: Option<Reflectance> = None,
        /// How returned light is distributed over directions.
        pub scattering: Scattering = Scattering::Lambert,
        /// glTF metallic factor, 0..1; 1 with roughness 0 is a mirror.
        pub metallic: f32 = 0.0,
        /// glTF roughness factor, 0..1.
        pub roughness: f32 = 1.0,
        /// Index of refraction (`KHR_materials_ior`, `blainder_ior`), at least 1; of a metal, whose `extinction_index`
        /// is not 0, above 0.
        pub ior: f32 = 1.5,
        /// Fraction of light that passes the surface (`KHR_materials_transmission`), 0..1.
        pub transmission: f32 = 0.0,
        /// Thickness of the volume behind the surface (`KHR_materials_volume`), metres; 0 = a thin sheet.
        pub thickness_m: f32 = 0.0,
        /// Distance after which light has the attenuation colour (`KHR_materials_volume`), metres, infinite = clear.
        pub attenuation_distance_m: f32 = f32::INFINITY,
        /// Linear colour of white light after the attenuation distance (`KHR_materials_volume`).
        pub attenuation_color: [f32; 3] = [1.0; 3],
        /// Thickness of a pane that the scene models as a single sheet, metres; `None`: a body with an inside, or,
        /// where `thickness_m` is 0, an infinitely thin pane.
        pub pane_m: Option<f32> = None,
        /// Index of refraction for the travel time of pulses, at least 1; `None`: `ior`.
        pub group_index: Option<f32> = None,
        /// Imaginary part of a metal's index of refraction, whose real part is `ior`: with it a mirror's loss depends
        /// on the angle; without it (0) the mirror has its reflectance at every angle.
        pub extinction_index: f32 = 0.0,
        /// Reflectance of the dirt on a mirror, glass or water, 0..1; it is diffuse, and the surface behind it gets the
        /// rest.
        pub dirt: f32 = 0.0,
        /// How it scatters and reflects sound (in glTF `extras.sound`); see [`Material::sound_law`].
        pub sound: Option<Sound> = None,
        /// How it reflects the waves of radars (in glTF `extras.radar`); see [`Material::radar_law`].
        pub radar: Option<Radio> = None,
        /// Whether the file specifies that the surface is drawn without lighting (`KHR_materials_unlit`).
        pub unlit: bool = false,
        /// Whether both sides of the surface are visible (in glTF `doubleSided`). Beams hit both in any case; this only
        /// distinguishes rooms from bodies, see `BuiltScene::enclosure`.
        #[serde(skip)]
        pub double_sided: bool = false,
        /// Which part of an object its faces are, where the file states it for the material (in glTF `extras.partID`).
        #[serde(skip)]
        pub part: Option<String> = None,
        /// How it changes over time; `None`: not at all. The other fields are its values at time 0.
        #[serde(skip)]
        pub changes: Option<Arc<Changes>> = None,
    }
}

impl Material {
    /// Whether its base colour's alpha lets every ray pass.
    #[doc(hidden)]
    pub fn is_clear(&self) -> bool {
        let alpha = self.base_color[3];
        match self.alpha {
            Alpha::Coverage => alpha == 0.0,
            Alpha::Cutout => alpha < self.alpha_cutoff,
            Alpha::Solid | Alpha::Reflectance => false,
        }
    }

    /// How it scatters and reflects sound, by itself or by the library material of its name; if neither specifies it,
    /// its reflectance may: [`Sound::of_reflectance`].
    pub fn sound_law(&self) -> Option<&Sound> {
        library::sound(self)
    }

    /// How it reflects, transmits and scatters the waves of radars: by itself, by the library material of its name, or,
    /// where neither says it, by its other properties. Those that are more than half metallic are metal; glass is a pane
    /// of `pane_m`, by default 4 mm; anything else is [`Radio::unknown`]. A pane of the library has the thickness `pane_m`,
    /// too, if that is given.
    pub fn radar_law(&self) -> Radio {
        self.radar_source().0
    }

    /// [`Material::radar_law`], and the library material that it comes from.
    #[doc(hidden)]
    pub fn radar_source(&self) -> (Radio, RadioSource) {
        library::radar(self)
    }

    /// This material, reflecting light, sound and radar waves as `other` does; `source` states where that comes from.
    #[doc(hidden)]
    pub fn made_of(&self, other: &Material, source: String) -> Material {
        let alpha = match self.alpha {
            Alpha::Reflectance => Alpha::Solid,
            Alpha::Coverage if library::is_glass(&other.name) => Alpha::Solid,
            own => own,
        };
        Material {
            source,
            alpha,
            reflectance: other.reflectance.clone(),
            scattering: other.scattering.clone(),
            sound: other.sound.clone().or_else(|| self.sound.clone()),
            radar: other.radar.clone().or_else(|| self.radar.clone()),
            changes: None,
            ..self.clone()
        }
    }

    /// Lets light through by its alpha, because its file declares it transparent; not if it is glass by its
    /// transmission or its name: the alpha of glass is its appearance, and [`Material::transmission`] what passes.
    #[doc(hidden)]
    pub fn blend(&mut self) {
        if !self.is_glass() {
            self.alpha = Alpha::Coverage;
        }
    }

    /// As [`Material::blend`], if its alpha factor lets anything through.
    #[doc(hidden)]
    pub fn let_through(&mut self) {
        if self.base_color[3] < 1.0 {
            self.blend();
        }
    }

    /// As [`Material::blend`], by an opacity image: a black-and-white one makes a cut-out.
    #[doc(hidden)]
    pub fn mask(&mut self, mask: TextureRef) {
        self.blend();
        if self.alpha == Alpha::Coverage && self.base_color[3] == 1.0 && mask.texture.is_black_or_white() {
            self.alpha = Alpha::Cutout;
        }
        self.alpha_texture = Some(mask);
    }

    /// Whether it is glass by its transmission or its name.
    pub fn is_glass(&self) -> bool {
        self.transmission > 0.0 && self.metallic < 1.0 || library::is_glass(&self.name)
    }

    /// Describes for users what its alpha does; `None`: nothing worth mentioning.
    pub fn told_alpha(&self) -> Option<String> {
        let alpha = self.base_color[3];
        let by_image = self.alpha_image().is_some_and(|image| !image.texture.opaque);
        match self.alpha {
            Alpha::Coverage if by_image => Some("alpha of its image is the fraction of the rays that it stops".into()),
            Alpha::Coverage if alpha < 1.0 => {
                Some(format!("alpha {alpha:.2}: {:.0} % of the rays pass", 100.0 * (1.0 - alpha)))
            }
            Alpha::Coverage => Some("rays pass where its vertices have an alpha below 1, and nowhere else".into()),
            Alpha::Cutout => Some(format!("cut out where alpha is below {}", self.alpha_cutoff)),
            Alpha::Solid if alpha < 1.0 && self.is_glass() => {
                Some(format!("glass, whose alpha {alpha:.2} is not used"))
            }
            Alpha::Solid if alpha < 1.0 => Some(format!("solid, whose alpha {alpha:.2} is not used")),
            _ => None,
        }
    }

    /// The image that gives its alpha.
    #[doc(hidden)]
    pub fn alpha_image(&self) -> Option<&TextureRef> {
        self.alpha_texture.as_ref().or(self.base_color_texture.as_ref())
    }

    /// The images of its colour and its alpha.
    #[doc(hidden)]
    pub fn images(&self) -> impl Iterator<Item = &TextureRef> {
        self.base_color_texture.iter().chain(&self.alpha_texture)
    }

    /// How its colour gives its reflectance at `wavelength_nm` in a scan that uses `source`.
    #[doc(hidden)]
    pub fn by_color(&self, source: ReflectanceSource, wavelength_nm: f64) -> ByColor {
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
    /// The source used instead where surfaces reflect sound: names and infrared estimates do not apply to sound.
    #[doc(hidden)]
    pub fn of_sound(self) -> ReflectanceSource {
        if self == ReflectanceSource::Library { ReflectanceSource::Luminance } else { self }
    }
}

/// How a base colour gives a reflectance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ByColor {
    /// By its luminance (Rec. 709 weights), whatever the wavelength.
    Luminance,
    /// By its alpha alone.
    Alpha,
    /// By what surfaces of similar colours return at the wavelength, on average.
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
pub(super) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
