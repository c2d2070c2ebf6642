//! The material library: reflectance by material name and wavelength, one YAML per material in `presets/material`.

use crate::presets;
use crate::yaml;
use serde::Deserialize;
use std::sync::OnceLock;

/// A material of the library.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialEntry {
    /// Name that scene materials are matched against.
    pub name: String,
    /// Where the numbers come from.
    pub source: String,
    /// Reflectance at wavelengths, rising.
    pub reflectance: Vec<ReflectanceSample>,
}

/// Reflectance at one wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReflectanceSample {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Hemispherical reflectance, 0..1.
    pub value: f64,
}

impl MaterialEntry {
    /// The entry for a scene material called `name`; a copy's suffix (`concrete.001`) and case do not matter.
    pub fn find(name: &str) -> Option<&'static MaterialEntry> {
        let stem = match name.rsplit_once('.') {
            Some((stem, digits)) if digits.len() == 3 && digits.bytes().all(|b| b.is_ascii_digit()) => stem,
            _ => name,
        };
        entries().iter().find(|entry| entry.name.eq_ignore_ascii_case(stem))
    }

    /// Reflectance at `wavelength_nm`: linear between samples, constant outside them.
    pub fn reflectance_at(&self, wavelength_nm: f64) -> f32 {
        let samples = &self.reflectance;
        let above = samples.partition_point(|sample| sample.wavelength_nm < wavelength_nm);
        let value = if above == 0 {
            samples[0].value
        } else if above == samples.len() {
            samples[above - 1].value
        } else {
            let (low, high) = (samples[above - 1], samples[above]);
            let t = (wavelength_nm - low.wavelength_nm) / (high.wavelength_nm - low.wavelength_nm);
            low.value + (high.value - low.value) * t
        };
        value as f32
    }
}

/// All entries; the files are part of this crate and a test reads every one.
fn entries() -> &'static [MaterialEntry] {
    static ENTRIES: OnceLock<Vec<MaterialEntry>> = OnceLock::new();
    ENTRIES.get_or_init(|| {
        presets::embedded("material/")
            .map(|(path, text)| {
                yaml::from_str::<MaterialEntry>(path, text).expect("presets that are compiled in can be read")
            })
            .filter(|entry| !entry.reflectance.is_empty())
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_library_is_sound() {
        let mut count = 0;
        for (path, text) in presets::embedded("material/") {
            let entry: MaterialEntry = yaml::from_str(path, text).unwrap();
            assert_eq!(path, format!("material/{}.yaml", entry.name));
            assert!(!entry.reflectance.is_empty(), "{path}");
            assert!(entry.reflectance.is_sorted_by(|a, b| a.wavelength_nm < b.wavelength_nm), "{path}");
            assert!(entry.reflectance.iter().all(|s| (0.0..=1.0).contains(&s.value)), "{path}");
            count += 1;
        }
        assert_eq!(count, entries().len());
        assert!(count > 0);
    }

    #[test]
    fn names_match_without_case_and_copy_suffix() {
        assert_eq!(MaterialEntry::find("Concrete.012").unwrap().name, "concrete");
        assert!(MaterialEntry::find("concrete.wall").is_none());
    }

    #[test]
    fn reflectance_is_linear_between_samples() {
        let sample = |wavelength_nm, value| ReflectanceSample { wavelength_nm, value };
        let entry = MaterialEntry {
            name: "m".into(),
            source: String::new(),
            reflectance: vec![sample(800.0, 0.2), sample(1000.0, 0.6)],
        };
        assert_eq!(entry.reflectance_at(500.0), 0.2);
        assert_eq!(entry.reflectance_at(900.0), 0.4);
        assert_eq!(entry.reflectance_at(1550.0), 0.6);
    }
}
