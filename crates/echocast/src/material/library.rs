//! The material library: reflectance by material name and wavelength, and what surfaces do with sound, one YAML per
//! material in `presets/material`.

use super::{Alpha, Material, Reflectance, Sound};
use crate::ground::error::{Error, Result};
use crate::read::presets;
use crate::read::yaml::Document;
use std::sync::OnceLock;

impl Material {
    /// The library material called `name`; case and the suffix of a copy (`concrete.001`) are ignored.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn library(name: &str) -> Result<Material> {
        let known = || materials().iter().map(|material| &material.name);
        find(name).cloned().ok_or_else(|| Error::missing("library material", name, known()))
    }
}

/// What the library knows of a scene material called `name`.
fn find(name: &str) -> Option<&'static Material> {
    let stem = match name.rsplit_once('.') {
        Some((stem, digits)) if digits.len() == 3 && digits.bytes().all(|b| b.is_ascii_digit()) => stem,
        _ => name,
    };
    materials().iter().find(|material| material.name.eq_ignore_ascii_case(stem))
}

/// The reflectance of a material, from itself or from the library; none where its alpha gives it.
pub(super) fn reflectance(material: &Material) -> Option<&Reflectance> {
    let by_name = || find(&material.name).filter(|_| material.alpha != Alpha::Reflectance)?.reflectance.as_ref();
    material.reflectance.as_ref().or_else(by_name)
}

/// What a material does with sound, from itself or from the library.
pub(super) fn sound(material: &Material) -> Option<&Sound> {
    material.sound.as_ref().or_else(|| find(&material.name)?.sound.as_ref())
}

/// All of them; the files are embedded in this crate and a test reads every one.
fn materials() -> &'static [Material] {
    static MATERIALS: OnceLock<Vec<Material>> = OnceLock::new();
    MATERIALS.get_or_init(|| {
        presets::embedded("material/")
            .map(|(path, text)| read(path, text).expect("presets that are compiled in can be read"))
            .collect()
    })
}

fn read(path: &str, text: &str) -> Result<Material> {
    Material::read(&Document::parse(path, text)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_library_is_sound() {
        let mut count = 0;
        for (path, text) in presets::embedded("material/") {
            let material = read(path, text).unwrap();
            assert_eq!(path, format!("material/{}.yaml", material.name));
            assert!(material.reflectance.is_some() || material.sound.is_some(), "{path}");
            assert!(!material.source.is_empty(), "{path}");
            count += 1;
        }
        assert_eq!(count, materials().len());
        assert!(count > 0);
    }

    /// Typical reflectances at 905 nm, and of snow at 1550 nm.
    #[test]
    fn reflectances_are_typical() {
        for (name, wavelength_nm, least, most) in [
            ("asphalt_dry", 905.0, 0.15, 0.2),
            ("asphalt_wet", 905.0, 0.05, 0.1),
            ("concrete", 905.0, 0.35, 0.5),
            ("vegetation", 905.0, 0.4, 0.6),
            ("black_car_paint", 905.0, 0.05, 0.1),
            ("white_paint", 905.0, 0.8, 0.8),
            ("snow", 905.0, 0.8, 0.9),
            ("snow", 1550.0, 0.0, 0.1),
        ] {
            let found = Material::library(name).unwrap().reflectance.unwrap().at(wavelength_nm);
            assert!((least..=most).contains(&found), "{name} at {wavelength_nm} nm: {found}");
        }
    }

    /// The seabeds say nothing of light, so scenes whose materials have their names keep their reflectance.
    #[test]
    fn seabeds_have_sound_alone() {
        use super::super::Sediment;
        for (name, sediment) in [
            ("rock", Sediment::Rock),
            ("gravel", Sediment::SandyGravel),
            ("sand", Sediment::MediumSand),
            ("mud", Sediment::Silt),
        ] {
            let scene = Material { name: format!("{name}.001"), ..Material::default() };
            assert_eq!(scene.sound_law(), Some(&Sound::Sediment { name: sediment }));
            assert_eq!(reflectance(&scene), None);
            let own = Material { sound: Some(Sound::Lambert { mu_db: -20.0 }), ..scene };
            assert_eq!(own.sound_law(), own.sound.as_ref());
        }
        assert_eq!(Material::default().sound_law(), None);
    }

    #[test]
    fn names_match_without_case_and_copy_suffix() {
        assert_eq!(find("Concrete.012").unwrap().name, "concrete");
        assert!(find("concrete.wall").is_none());
        assert_eq!(Material::library("Concrete").unwrap(), *find("concrete").unwrap());
        let error = Material::library("concret").unwrap_err().to_string();
        assert_eq!(error, "there is no library material named \"concret\"; near: concrete");
    }
}
