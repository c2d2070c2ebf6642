//! Weather and water as YAML: the section `environment` of a scenario, or a file of its own.

use super::{ClearAir, Dust, Fog, Placed, Rain, Snow, Spray, Water};
use ground::builder;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml;
use ground::read::yaml::Document;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

builder! {
    /// What is between sensor and surfaces. The default is nothing: no air, no weather.
    ///
    /// Each kind is one section of keys or a list of them, and each section may give a region, see [`super::Region`].
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Environment {
        /// Air and haze.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub clear_air: Option<ClearAir>,
        /// Rain.
        #[serde(deserialize_with = "yaml::one_or_more", skip_serializing_if = "Vec::is_empty")]
        pub rain: Vec<Placed<Rain>>,
        /// Fog.
        #[serde(deserialize_with = "yaml::one_or_more", skip_serializing_if = "Vec::is_empty")]
        pub fog: Vec<Placed<Fog>>,
        /// Snow.
        #[serde(deserialize_with = "yaml::one_or_more", skip_serializing_if = "Vec::is_empty")]
        pub snow: Vec<Placed<Snow>>,
        /// Dust.
        #[serde(deserialize_with = "yaml::one_or_more", skip_serializing_if = "Vec::is_empty")]
        pub dust: Vec<Placed<Dust>>,
        /// Spray.
        #[serde(deserialize_with = "yaml::one_or_more", skip_serializing_if = "Vec::is_empty")]
        pub spray: Vec<Placed<Spray>>,
        /// Water, for sonar; it has no effect on light.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub water: Option<Water>,
    }
}

impl Environment {
    /// Keys of the weather that it has: of all its sections but water.
    pub fn weather(&self) -> impl Iterator<Item = &'static str> {
        let Environment { clear_air, rain, fog, snow, dust, spray, water: _ } = self;
        let sections = [
            ("clear_air", clear_air.is_some()),
            ("rain", !rain.is_empty()),
            ("fog", !fog.is_empty()),
            ("snow", !snow.is_empty()),
            ("dust", !dust.is_empty()),
            ("spray", !spray.is_empty()),
        ];
        sections.into_iter().filter_map(|(key, present)| present.then_some(key))
    }

    /// Reads the file at `path`: these keys, or a section `environment` that holds them; an empty file means no
    /// weather.
    ///
    /// # Errors
    /// A missing file, or a fault in it, with its line and key.
    pub fn load(path: impl AsRef<Path>) -> Result<Environment> {
        let path = path.as_ref();
        Environment::read(&Document::load(path)?, path.parent().unwrap_or(Path::new("")))
    }

    /// [`Environment::load`] from `text`; names of other files in it are relative to the current folder.
    ///
    /// # Errors
    /// A fault in the text, with its line and key.
    pub fn from_yaml(text: &str) -> Result<Environment> {
        Environment::read(&Document::parse("YAML text", text)?, Path::new(""))
    }

    fn read(document: &Document, folder: &Path) -> Result<Environment> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct EnvironmentFile {
            environment: Environment,
        }
        match document.value() {
            Value::Null => return Ok(Environment::default()),
            Value::Object(_) => {}
            _ => return Err(document.error("", "is not a section of keys")),
        }
        if document.value().get("environment").is_some() {
            let EnvironmentFile { mut environment } = document.read()?;
            environment.read_files(folder)?;
            let inside = |error| match error {
                Error::InvalidParameter { name, value, allowed } => {
                    Error::InvalidParameter { name: format!("environment.{name}"), value, allowed }
                }
                other => other,
            };
            environment.check().map_err(|error| document.locate(inside(error)))?;
            return Ok(environment);
        }
        let mut environment: Environment = document.read()?;
        environment.read_files(folder)?;
        environment.check().map_err(|error| document.locate(error))?;
        Ok(environment)
    }

    /// Reads what is kept in separate files; relative names are resolved against `folder`.
    #[doc(hidden)]
    pub fn read_files(&mut self, folder: &Path) -> Result<()> {
        self.water.as_mut().map_or(Ok(()), |water| water.read_files(folder))
    }

    /// Checks that all values are within their allowed ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the key.
    pub fn check(&self) -> Result<()> {
        /// More are a mistake; every beam would have to check all of them.
        const MOST: usize = 100;
        let count = self.rain.len() + self.fog.len() + self.snow.len() + self.dust.len() + self.spray.len();
        if count > MOST {
            return Err(Error::invalid("rain, fog, snow, dust and spray", count, format!("at most {MOST} in all")));
        }
        let bounds = &mut Bounds::none();
        if let Some(air) = &self.clear_air {
            air.check("clear_air", bounds)?;
        }
        check_all("rain", &self.rain, bounds, Rain::check)?;
        check_all("fog", &self.fog, bounds, Fog::check)?;
        check_all("snow", &self.snow, bounds, Snow::check)?;
        check_all("dust", &self.dust, bounds, Dust::check)?;
        check_all("spray", &self.spray, bounds, Spray::check)?;
        self.water.as_ref().map_or(Ok(()), |water| water.check("water", bounds))
    }

    /// Text that [`Environment::from_yaml`] reads back as this.
    ///
    /// # Errors
    /// None known.
    pub fn to_yaml(&self) -> Result<String> {
        yaml::to_string(self)
    }

    /// Whether there is nothing at all.
    pub fn is_empty(&self) -> bool {
        *self == Environment::default()
    }
}

fn check_all<T>(
    kind: &str,
    all: &[Placed<T>],
    bounds: &mut Bounds,
    check: impl Fn(&T, &str, &mut Bounds) -> Result<()>,
) -> Result<()> {
    all.iter().enumerate().try_for_each(|(index, placed)| {
        let key = if all.len() == 1 { kind.to_owned() } else { format!("{kind}[{index}]") };
        check(&placed.what, &key, bounds)?;
        placed.region.check(&key, bounds)
    })
}
