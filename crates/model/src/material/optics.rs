//! What smooth surfaces do with light, by material.

use super::surface::luminance;
use super::{Material, ReflectanceSource, fresnel};
use ground::profile::Profile;

/// How a material divides incident light, at one wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Part scattered diffusely, to be multiplied by the reflectance, 0..1.
    pub diffuse: f32,
    /// Reflectance of the dirt on it, 0..1; the other parts are already reduced by it.
    pub dirt: f32,
    /// Part that is mirrored, 0..1; excludes what a metal absorbs, unless that depends on the angle.
    pub mirrored: f32,
    /// Index and extinction index of a metal whose reflectance depends on the angle.
    pub metal: Option<[f32; 2]>,
    /// Part that obeys Fresnel's equations, 0..1: glass and water.
    pub clear: f32,
    /// Index of refraction, at least 1.
    pub index: f32,
    /// Index for the travel time of pulses.
    pub group_index: f32,
    /// Absorption inside, 1/m.
    pub absorption: f32,
    /// Thickness of a pane that the scene models as a single sheet, m; `None`: a body with an inside.
    pub sheet: Option<f32>,
}

/// What mirrors absorb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mirrors {
    /// All that their material does not reflect.
    Real,
    /// Nothing, as in the paper's equations.
    Lossless,
    /// Nothing, and a metallic factor of exactly 1 makes a mirror, however rough, as computed by the paper's program.
    PaperProgram,
}

impl Mirrors {
    /// What mirrors absorb in scans of `profile`.
    pub fn of(profile: Profile) -> Mirrors {
        profile.choose(Mirrors::Real, Mirrors::Lossless, Mirrors::PaperProgram)
    }
}

impl Optics {
    const DIFFUSE: Optics = Optics {
        diffuse: 1.0,
        dirt: 0.0,
        mirrored: 0.0,
        metal: None,
        clear: 0.0,
        index: 1.0,
        group_index: 1.0,
        absorption: 0.0,
        sheet: None,
    };

    /// Whether the surface mirrors or transmits light in a specific direction.
    pub fn goes_on(&self) -> bool {
        self.mirrored > 0.0 || self.clear > 0.0
    }

    /// A rough surface is a mirror or a pane only for the part `(1 - roughness)^4` of the light (our choice: a half at
    /// 0.16, a sixteenth at 0.5); a metal scatters the rest like a diffuse surface, and glass returns nothing of it.
    pub fn new(material: &Material, wavelength_nm: f64, source: ReflectanceSource, mirrors: Mirrors) -> Optics {
        if mirrors == Mirrors::PaperProgram {
            match material.metallic {
                1.0 => return Optics { diffuse: 0.0, mirrored: 1.0, ..Optics::DIFFUSE },
                _ if material.transmission == 0.0 => return Optics::DIFFUSE,
                _ => {}
            }
        }
        let smooth = (1.0 - material.roughness).powi(4);
        let metallic = material.metallic * smooth;
        let transmission = material.transmission * (1.0 - material.metallic);
        if metallic == 0.0 && transmission == 0.0 {
            return Optics::DIFFUSE;
        }
        let lossless = mirrors != Mirrors::Real;
        let metal = (material.extinction_index > 0.0).then_some([material.ior, material.extinction_index]);
        let mirror = material.returned(wavelength_nm, source).value;
        // KHR_materials_volume: white light has the colour c after the distance d, so e^(-a d) = c.
        let absorption = -luminance(material.attenuation_color).clamp(1e-6, 1.0).ln() / material.attenuation_distance_m;
        let clean = 1.0 - material.dirt;
        Optics {
            diffuse: (1.0 - metallic - transmission).max(0.0) * clean,
            dirt: material.dirt,
            mirrored: if lossless || metal.is_some() { metallic } else { metallic * mirror } * clean,
            metal: metal.filter(|_| !lossless),
            clear: transmission * smooth * clean,
            index: material.ior,
            group_index: material.group_index.unwrap_or(material.ior),
            absorption,
            // KHR_materials_volume: without a thickness the surface is thin-walled, an infinitely thin pane. The
            // paper's program has no panes: each face is one boundary.
            sheet: match mirrors {
                Mirrors::PaperProgram => None,
                _ => material.pane_m.or((material.thickness_m == 0.0).then_some(0.0)),
            },
        }
    }

    /// Part that is mirrored at an incidence angle of cosine `cos`, 0..1.
    pub fn mirrored_at(&self, cos: f32) -> f32 {
        match self.metal {
            Some([n, k]) => self.mirrored * fresnel::conductor(cos, n, k),
            None => self.mirrored,
        }
    }
}
