//! Which scenario the folder of a set belongs to.

use super::files::replace;
use super::manifest;
use crate::Scenario;
use crate::spec::Spec;
use ground::error::{Error, Result};
use ground::read::yaml::Document;
use ground::read::{self, Limit};
use ground::shown;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// `scenario.json`: the origin of a set.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Origin {
    /// Version of the program.
    pub echocast: String,
    /// Number of samples of the whole set.
    pub samples: u64,
    /// Names of the folders of its styles.
    pub roots: Vec<String>,
    /// Its sensors.
    #[serde(default)]
    pub sensors: Vec<SensorNote>,
    /// SHA-256 of the scenario, independent of its number of samples.
    pub digest: String,
    /// SHA-256 of each file that the scenario names and of each model of a folder, by name; files that these name in
    /// turn are not included.
    pub inputs: BTreeMap<String, String>,
    /// The scenario, as it was written.
    pub scenario: Value,
}

/// What `README.md` says of a sensor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SensorNote {
    /// Its name in the rig.
    pub name: String,
    /// Its title.
    pub title: String,
    /// Columns of its clouds.
    pub columns: Vec<String>,
}

const ORIGIN: &str = "scenario.json";

impl Origin {
    /// # Errors
    /// I/O errors.
    pub fn of(scenario: &Scenario, roots: Vec<String>) -> Result<Origin> {
        // A set may grow, and may be moved.
        let mut same = scenario.value().clone();
        if let Some(keys) = same.as_object_mut() {
            keys.retain(|key, _| !["samples", "set"].contains(&key.as_str()));
        }
        let folder = scenario.folder();
        let stage = scenario.stage()?;
        let models =
            stage.models.iter().flatten().map(|(path, _)| path.strip_prefix(folder).unwrap_or(path).to_owned());
        let mut files = models.collect();
        named_files(&same, folder, &mut files);
        let digest = |file: &PathBuf| Ok((shown::path(file), manifest::digest(&folder.join(file))?.1));
        let inputs = files.iter().map(digest).collect::<Result<_>>()?;
        let sensors = scenario.spec.sensors.iter().enumerate().map(|(index, entry)| {
            let sensor = stage.sensor(entry, &format!("sensors[{index}]"), folder)?;
            let fields = scenario.spec.fields(&sensor)?;
            Ok(SensorNote {
                name: entry.name.clone().unwrap_or_else(|| sensor.name().to_owned()),
                title: sensor.title().to_owned(),
                columns: fields.iter().map(|info| info.name.to_owned()).collect(),
            })
        });
        let sensors = sensors.collect::<Result<_>>()?;
        Ok(Origin {
            echocast: env!("CARGO_PKG_VERSION").into(),
            samples: scenario.samples(),
            roots,
            sensors,
            digest: manifest::digest_of(same.to_string().as_bytes()),
            inputs,
            scenario: scenario.value().clone(),
        })
    }

    /// The origin of the set in `root`; `None` if there is no set.
    ///
    /// # Errors
    /// An invalid `scenario.json`.
    pub fn read(root: &Path) -> Result<Option<Origin>> {
        let path = root.join(ORIGIN);
        if !path.exists() {
            return Ok(None);
        }
        let bytes = read::bytes(&path, Limit::YAML)?;
        let origin = serde_json::from_slice(&bytes).map_err(|error| Error::parse(&path, "", error.to_string()))?;
        Ok(Some(origin))
    }

    /// The origin of the set in `root`, which must be this set; `None` if there is none yet.
    ///
    /// # Errors
    /// The folder belongs to another set, or holds other files; I/O errors.
    pub fn known(&self, root: &Path) -> Result<Option<Origin>> {
        match Origin::read(root)? {
            Some(known) if known.digest != self.digest => {
                let found = format!("{}, which holds a set of another scenario", shown::path(root));
                Err(Error::invalid("set.folder", found, "another folder, or the scenario of its scenario.json"))
            }
            Some(known) if known.inputs != self.inputs => {
                let named = known.inputs.keys().chain(self.inputs.keys());
                let mut changed = named.filter(|&name| known.inputs.get(name) != self.inputs.get(name));
                let name = changed.next().map_or("", String::as_str);
                let found = format!("{}, for which {name} had other contents", shown::path(root));
                Err(Error::invalid("set.folder", found, "another folder, or the files as they were"))
            }
            Some(known) => Ok(Some(known)),
            None => {
                let entries = match fs::read_dir(root) {
                    Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
                    entries => entries.map_err(|source| Error::Io { path: root.to_owned(), source })?,
                };
                // Another shard may have started at this moment.
                let others = entries.filter_map(Result::ok).any(|entry| {
                    let name = entry.file_name();
                    name != ORIGIN && !name.to_string_lossy().starts_with('.')
                });
                if others && Origin::read(root)?.is_none() {
                    let found = format!("{}, which holds other files", shown::path(root));
                    return Err(Error::invalid("set.folder", found, "an empty or a new folder"));
                }
                Ok(None)
            }
        }
    }

    /// Makes `root` the folder of this set; `known` is what [`Origin::known`] found there.
    ///
    /// # Errors
    /// I/O errors.
    pub fn claim(&self, root: &Path, known: Option<Origin>) -> Result<()> {
        match known {
            Some(known) if known.samples >= self.samples && known.set() == self.set() => {}
            Some(known) => Origin { samples: self.samples.max(known.samples), ..self.clone() }.write(root)?,
            None => self.write(root)?,
        }
        for name in self.roots.iter().map(String::as_str).chain(["samples", "pictures"]) {
            let folder = root.join(name);
            fs::create_dir_all(&folder).map_err(|source| Error::Io { path: folder, source })?;
        }
        Ok(())
    }

    /// The section `set` of the scenario.
    fn set(&self) -> Option<&Value> {
        self.scenario.get("set")
    }

    /// The sections of the scenario.
    ///
    /// # Errors
    /// An invalid `scenario.json`, which has been edited.
    pub fn spec(&self) -> Result<(Spec, Document)> {
        let document = Document::from_value(ORIGIN, self.scenario.clone());
        Ok((Spec::read(&document)?, document))
    }

    fn write(&self, root: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self).map_err(|error| Error::Internal(error.to_string()))? + "\n";
        replace(&root.join(ORIGIN), text.as_bytes())
    }
}

/// The files that `value` names, relative to `folder`.
fn named_files(value: &Value, folder: &Path, files: &mut BTreeSet<PathBuf>) {
    match value {
        Value::String(name) => files.extend(Some(PathBuf::from(name)).filter(|file| folder.join(file).is_file())),
        Value::Array(items) => items.iter().for_each(|item| named_files(item, folder, files)),
        Value::Object(keys) => keys.values().for_each(|item| named_files(item, folder, files)),
        _ => {}
    }
}

/// The origin of a set that must exist.
pub(super) fn need_origin(root: &Path) -> Result<Origin> {
    Origin::read(root)?.ok_or_else(|| {
        let found = format!("{}, in which there is no {ORIGIN}", shown::path(root));
        Error::invalid("the set's folder", found, "a folder that `echocast run` has written")
    })
}
