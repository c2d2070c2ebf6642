//! What a scan needs: scene and sensor.

use crate::choice;
use anyhow::{Context as _, Result, ensure};
use clap::Args;
use echocast::scene::UpAxis;
use echocast::{Error, LabelRules, LoadOptions, ReturnMode, Scene, Sensor, SensorKind};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Scene files and how to read them.
#[derive(Args)]
pub struct SceneArgs {
    /// Scene files; several are put together as they stand (`echocast formats` lists the kinds)
    #[arg(required = true, value_name = "SCENE")]
    pub files: Vec<PathBuf>,
    /// Label file (YAML): names to numbers, object and material name patterns to names
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    labels: Option<PathBuf>,
    /// Up axis of scene formats that do not say (OBJ)
    #[arg(long, default_value = "z", value_parser = choice::of(choice::UP), help_heading = "Scene")]
    up: UpAxis,
    /// Metres per unit of scene formats that do not say (OBJ)
    #[arg(long, value_name = "F", default_value = "1", value_parser = positive, help_heading = "Scene")]
    scale: f64,
}

impl SceneArgs {
    /// Reads all files, one scene.
    pub fn load(&self) -> Result<Scene> {
        let labels = self.labels.as_ref().map(LabelRules::load).transpose()?.unwrap_or_default();
        let options = LoadOptions { up: self.up, scale: self.scale, labels };
        let told = self.up != UpAxis::Z || self.scale != 1.0;
        let is_obj = |file: &PathBuf| file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"));
        ensure!(
            !told || self.files.iter().any(is_obj),
            "--up, --scale: {} says itself which axis is up and what its unit is",
            self.names()
        );
        Ok(Scene::load_all(&self.files, &options)?)
    }

    /// The files that it is made of.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().chain(&self.labels).map(PathBuf::as_path)
    }

    /// File names, for people.
    pub fn names(&self) -> String {
        self.files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(" + ")
    }

    /// For the report.
    pub fn to_json(&self) -> Value {
        json!({
            "files": self.files,
            "labels": self.labels,
            "up": choice::name(choice::UP, self.up),
            "scale": self.scale,
        })
    }
}

/// A sensor and changes to it.
#[derive(Args)]
pub struct SensorArgs {
    /// Preset (`echocast sensors` lists them) or a sensor file (.yaml)
    #[arg(long, value_name = "NAME|FILE", help_heading = "Sensor")]
    sensor: String,
    /// Change one parameter by its path in the sensor's YAML; repeatable
    #[arg(long, value_name = "KEY=VALUE", value_parser = key_value, help_heading = "Sensor")]
    set: Vec<(String, String)>,
    /// Which echo of a beam is reported [default: as the sensor has it]
    #[arg(long, value_name = "MODE", value_parser = choice::of(choice::RETURNS), help_heading = "Sensor")]
    returns: Option<ReturnMode>,
}

impl SensorArgs {
    /// Its file, unless it is a preset.
    pub fn input(&self) -> Option<&Path> {
        Some(Path::new(&self.sensor)).filter(|file| file.is_file())
    }

    /// The sensor, changed.
    pub fn load(&self) -> Result<Sensor> {
        let mut sensor = load_sensor(&self.sensor).context("--sensor")?;
        for (key, value) in &self.set {
            sensor.set(key, value).context("--set")?;
        }
        if let Some(mode) = self.returns {
            ensure!(
                sensor.kind() != SensorKind::Sonar,
                "--returns: the sensor is a sonar, which reports the depth of each beam, or all range bins above its threshold; \
                 allowed: with other sensors"
            );
            sensor.set("returns.mode", choice::name(choice::RETURNS, mode)).context("--returns")?;
        }
        Ok(sensor)
    }
}

/// A preset (`NAME` or `FOLDER/NAME`), or the file where `name` is one's.
pub fn load_sensor(name: &str) -> Result<Sensor> {
    Sensor::open(name).map_err(|error| match error {
        missing @ Error::Missing { .. } => {
            anyhow::Error::new(missing).context(format!("{name} is neither a preset nor a file"))
        }
        other => other.into(),
    })
}

fn key_value(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.is_empty() => Ok((key.to_owned(), value.to_owned())),
        _ => Err("expected KEY=VALUE, such as noise.range_sigma_m=0".into()),
    }
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|number: &f64| *number > 0.0 && number.is_finite())
        .ok_or("expected a number above 0".into())
}

/// Uses `threads` threads for all parallel work; all cores without a number.
pub fn set_threads(threads: Option<u16>) -> Result<usize> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global()
            .with_context(|| format!("--threads {threads}: cannot start the threads"))?;
    }
    Ok(rayon::current_num_threads())
}
