//! The sensors that ship with the library.

use super::{Sensor, SensorKind};
use ground::error::{Error, Result};
use ground::read::presets::{self, SensorFile};
use ground::read::yaml::{self, Document};
use ground::shown;
use serde::Deserialize;
use std::fs;
use std::path::Path;

/// A preset that ships with the library.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PresetInfo {
    /// Name for [`Sensor::preset`].
    pub name: String,
    /// Name for display.
    pub title: String,
    /// What it measures with.
    pub kind: SensorKind,
    /// Group: `lidar`, `tof`, `sonar`, `radar`, `paper`.
    pub folder: String,
}

impl Sensor {
    /// The preset called `name` (or `FOLDER/NAME`). If there is none, the only one that matches: case, `-`, `_` and
    /// blanks are ignored, the maker's name may be missing, or a part of the name that no other preset has is enough.
    /// So `VLP-16` and `Velodyne VLP16` are `velodyne_vlp16`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names; [`Error::InvalidParameter`] with the presets that `name`
    /// matches, if there are several.
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
        // A path that is not a regular file is reported as such, rather than as a missing preset.
        let is_file = fs::metadata(path).is_ok_and(|found| !found.is_dir());
        if is_yaml || is_file {
            return Sensor::load(path);
        }
        Sensor::preset(&shown::path(path))
    }

    /// All presets, by folder and name.
    pub fn presets() -> Vec<PresetInfo> {
        /// The keys that a list needs; the others are not read.
        #[derive(Deserialize)]
        struct PresetHead {
            title: String,
            kind: SensorKind,
        }
        presets::sensors()
            .map(|preset| {
                let PresetHead { title, kind } =
                    yaml::from_str(preset.path, preset.text).expect("presets that are compiled in can be read");
                PresetInfo { name: preset.name.to_owned(), title, kind, folder: preset.folder.to_owned() }
            })
            .collect()
    }
}

/// The preset that `name` identifies.
fn find(name: &str) -> Result<SensorFile> {
    /// Fewer letters match a single preset by chance.
    const FEWEST: usize = 3;
    let (folder, given) = name.split_once('/').map_or((None, name), |(folder, given)| (Some(folder), given));
    let normalized = plain(given);
    let model = |preset: &SensorFile| preset.name.split_once('_').is_some_and(|(_, model)| plain(model) == normalized);
    // The closest match to the name as written wins.
    let rules: [&dyn Fn(&SensorFile) -> bool; 4] = [
        &|preset| preset.name == given,
        &|preset| plain(preset.name) == normalized,
        &|preset| normalized.len() >= FEWEST && model(preset),
        &|preset| normalized.len() >= FEWEST && plain(preset.name).contains(&normalized),
    ];
    for rule in rules {
        let of_folder = presets::sensors().filter(|preset| folder.is_none_or(|folder| folder == preset.folder));
        let mut fitting: Vec<SensorFile> = of_folder.filter(rule).collect();
        match fitting.len() {
            0 => {}
            1 => return Ok(fitting.remove(0)),
            _ => {
                let names: Vec<_> = fitting.iter().map(|preset| preset.name).collect();
                let value = format!("{:?}, which matches several", shown::name(name));
                return Err(Error::invalid("the sensor preset", value, names.join(", ")));
            }
        }
    }
    Err(Error::missing("sensor preset", name, presets::sensors().map(|preset| preset.name)))
}

/// `name` without differences of spelling.
fn plain(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, '-' | '_') && !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Azimuths, degrees, of channels of a preset in its first column.
    fn azimuths<const N: usize>(name: &str, channels: [usize; N]) -> [f64; N] {
        let sensor = Sensor::preset(name).unwrap();
        let beams = sensor.beams();
        channels.map(|channel| {
            let beam = channel * beams.columns as usize;
            f64::from(beams.dir_y[beam]).atan2(beams.dir_x[beam].into()).to_degrees()
        })
    }

    /// Layers of 0.125 degrees are rows of their own: eighths of the step of 1 degree, clockwise.
    #[test]
    fn fine_layers_of_the_multiscan_divide_its_step() {
        for layer in [[5, 16, 17, 18, 19, 20, 21, 22], [13, 23, 24, 25, 26, 27, 28, 29]] {
            let found = azimuths("sick_multiscan136", layer);
            for step in found.windows(2) {
                assert!(((step[0] - step[1]).rem_euclid(360.0) - 0.125).abs() < 1e-4, "{found:?}");
            }
        }
    }

    /// The second loop measures 0.4 degrees after the first, half of the cycle of 0.8 degrees.
    #[test]
    fn both_loops_of_the_qt128_fire_channels_65_to_128() {
        for channel in 64..128 {
            let [first, second] = azimuths("hesai_qt128", [channel, channel + 64]);
            // Neighbours of a pair change places from loop to loop, 0.856 us or 0.003 degrees.
            assert!(((first - second).rem_euclid(360.0) - 0.4).abs() < 0.0032, "{channel}: {first}, {second}");
        }
        let sensor = Sensor::preset("hesai_qt128").unwrap();
        assert_eq!((sensor.beams().rows, sensor.beams().columns), (192, 450));
    }
}
