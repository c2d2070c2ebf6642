//! The sensors that ship with the library.

use super::{Sensor, SensorKind};
use crate::ground::error::{Error, Result};
use crate::ground::shown;
use crate::read::presets;
use crate::read::yaml::{self, Document};
use serde::Deserialize;
use std::fs;
use std::path::Path;

/// A preset that ships with the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PresetInfo {
    /// Name for [`Sensor::preset`].
    pub name: String,
    /// Name for people.
    pub title: String,
    /// What it measures with.
    pub kind: SensorKind,
    /// Group: `lidar`, `tof`, `sonar`, `paper`.
    pub folder: String,
}

impl Sensor {
    /// The preset called `name`.
    ///
    /// # Errors
    /// [`crate::Error::Missing`] with similar names.
    pub fn preset(name: &str) -> Result<Sensor> {
        match presets::sensors().find(|preset| preset.name == name) {
            Some(preset) => Sensor::from_section(&Document::parse(preset.path, preset.text)?, Path::new("")),
            None => Err(Error::missing("sensor preset", name, presets::sensors().map(|preset| preset.name))),
        }
    }

    /// The preset called `name` (or `FOLDER/NAME`), or the sensor file of that name.
    ///
    /// # Errors
    /// As [`Sensor::preset`] and [`Sensor::load`].
    pub fn open(name: impl AsRef<Path>) -> Result<Sensor> {
        let path = name.as_ref();
        let is_yaml = path.extension().is_some_and(|ending| ending == "yaml" || ending == "yml");
        // What is no regular file is told, rather than that there is no such preset.
        let is_file = fs::metadata(path).is_ok_and(|found| !found.is_dir());
        if is_yaml || is_file {
            return Sensor::load(path);
        }
        let name = shown::path(path);
        let mut presets = presets::sensors();
        match name.split_once('/') {
            Some((folder, preset)) if presets.any(|p| p.folder == folder && p.name == preset) => Sensor::preset(preset),
            _ => Sensor::preset(&name),
        }
    }

    /// All presets, by folder and name.
    pub fn presets() -> Vec<PresetInfo> {
        /// The keys that a list shows; the others are not read.
        #[derive(Deserialize)]
        struct Head {
            title: String,
            kind: SensorKind,
        }
        presets::sensors()
            .map(|preset| {
                let Head { title, kind } =
                    yaml::from_str(preset.path, preset.text).expect("presets that are compiled in can be read");
                PresetInfo { name: preset.name.to_owned(), title, kind, folder: preset.folder.to_owned() }
            })
            .collect()
    }
}
