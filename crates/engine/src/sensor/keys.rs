//! Parameters of a sensor by key.

use super::{Sensor, SensorSpec};
use ground::error::{Error, Result};
use ground::read::bounds::{Bounds, Parameter};
use ground::read::yaml::{self, Document};
use serde_json::Value;
use std::collections::BTreeSet;
use std::sync::Arc;

impl Sensor {
    /// Changes one parameter: `key` is its path in the YAML (`noise.range_sigma_m`, `pattern.resolution[0]`), `value`
    /// is YAML too, a number, a word, a list or a whole section; `null` removes an optional key. On an error the sensor
    /// is unchanged.
    ///
    /// # Errors
    /// An unknown key (with similar ones), a wrong type, a value out of range, a pattern that cannot be generated.
    pub fn set(&mut self, key: &str, value: &str) -> Result<()> {
        let mut tree = self.tree()?;
        yaml::set(&mut tree, key, value, &yaml::TAGS)?;
        let document = Document::from_value(yaml::assignment(key, value), tree);
        let mut spec = SensorSpec::read(&document)?;
        spec.pattern.resolve(&self.folder, Some(&self.spec.pattern));
        let beams = if spec.pattern == self.spec.pattern {
            self.beams.clone()
        } else {
            let beams = spec.pattern.beams(0.0);
            Arc::new(beams.map_err(|error| document.locate(document.asks("pattern.file", error)))?)
        };
        *self = Sensor::new(spec, self.folder.clone(), beams).map_err(|error| document.locate(error))?;
        Ok(())
    }

    /// A numeric parameter by its path in the YAML, as [`Sensor::set`] takes it, and the bounds of its key. Within them
    /// `set` may still refuse a value where several keys must fit together: too many beams, steps that two keys specify
    /// differently, a `range.resolution_m` between 0 and a micrometre.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar keys; [`Error::InvalidParameter`] for the key of a word, a list or a section.
    pub fn parameter(&self, key: &str) -> Result<Parameter> {
        let tree = self.tree()?;
        let mut bounds = Bounds::of(key);
        self.spec.check_with(&mut bounds)?;
        let value = match yaml::lookup(&tree, key) {
            Some(Value::Number(number)) => number.as_f64().unwrap_or(f64::NAN),
            Some(other) => {
                let found = match other {
                    Value::Array(_) => "a list",
                    Value::Object(_) => "a section of keys",
                    _ => "a word",
                };
                return Err(Error::invalid(
                    key,
                    found,
                    "the keys of numbers, such as range.min_m or pattern.fov_deg[0]",
                ));
            }
            None if yaml::same_path(key, "range.max_m") => f64::INFINITY,
            None if (self.kind().is_optical() || !is_of_light(key)) && takes_numbers(tree.clone(), key) => f64::NAN,
            None => {
                let known: BTreeSet<String> = yaml::numbers(&tree).into_iter().chain(bounds.keys).collect();
                return Err(Error::missing("numeric parameter", key, known));
            }
        };
        Ok(Parameter { value, min: bounds.min, max: bounds.max })
    }

    /// Its description as a tree of values.
    pub(super) fn tree(&self) -> Result<Value> {
        serde_json::to_value(&self.spec).map_err(|error| Error::Internal(error.to_string()))
    }
}

/// Whether the section of `key` is for light only.
fn is_of_light(key: &str) -> bool {
    let section = key.split(['.', '[']).next().unwrap_or_default();
    ["beam", "detection", "returns", "noise", "intensity", "doppler", "tof"].contains(&section)
}

/// Whether a sensor file could have a number at `key`, where `tree` has no value.
fn takes_numbers(mut tree: Value, key: &str) -> bool {
    yaml::set(&mut tree, key, "1", &yaml::TAGS).is_ok() && Document::from_value(key, tree).read::<SensorSpec>().is_ok()
}
