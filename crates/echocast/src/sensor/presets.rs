//! The sensors that ship with the library.

use super::{Sensor, SensorKind};
use crate::ground::error::{Error, Result};
use crate::ground::shown;
use crate::read::presets::{self, SensorFile};
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
    /// The preset called `name` (or `FOLDER/NAME`). If there is none, the only one that is meant: case, `-`, `_` and
    /// blanks do not count, the maker's name may be missing, or a part of the name is enough that no other preset has.
    /// So `VLP-16` and `Velodyne VLP16` are `velodyne_vlp16`.
    ///
    /// # Errors
    /// [`crate::Error::Missing`] with similar names; [`crate::Error::InvalidParameter`] with those that `name` fits, if
    /// there are several.
    pub fn preset(name: &str) -> Result<Sensor> {
        let preset = find(name)?;
        Sensor::from_section(&Document::parse(preset.path, preset.text)?, Path::new(""))
    }

    /// The preset that [`Sensor::preset`] finds for `name`, or the sensor file of that name.
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
        Sensor::preset(&shown::path(path))
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

/// The preset that `name` stands for.
fn find(name: &str) -> Result<SensorFile> {
    /// Fewer letters fit a single preset by chance.
    const FEWEST: usize = 3;
    let (folder, given) = name.split_once('/').map_or((None, name), |(folder, given)| (Some(folder), given));
    let wanted = plain(given);
    let model = |preset: &SensorFile| preset.name.split_once('_').is_some_and(|(_, model)| plain(model) == wanted);
    // What is nearer to the name as it is written wins.
    let rules: [&dyn Fn(&SensorFile) -> bool; 4] = [
        &|preset| preset.name == given,
        &|preset| plain(preset.name) == wanted,
        &|preset| wanted.len() >= FEWEST && model(preset),
        &|preset| wanted.len() >= FEWEST && plain(preset.name).contains(&wanted),
    ];
    for rule in rules {
        let of_folder = presets::sensors().filter(|preset| folder.is_none_or(|folder| folder == preset.folder));
        let mut fitting: Vec<SensorFile> = of_folder.filter(rule).collect();
        match fitting.len() {
            0 => {}
            1 => return Ok(fitting.remove(0)),
            _ => {
                let names: Vec<_> = fitting.iter().map(|preset| preset.name).collect();
                let value = format!("{:?}, which fits several", shown::name(name));
                return Err(Error::invalid("the sensor preset", value, names.join(", ")));
            }
        }
    }
    Err(Error::missing("sensor preset", name, presets::sensors().map(|preset| preset.name)))
}

/// `name` without what people write differently.
fn plain(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, '-' | '_') && !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}
