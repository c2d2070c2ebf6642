//! Weather and water from flags or a file.

use crate::{input, usage};
use anyhow::{Result, bail, ensure};
use clap::Args;
use echocast::medium::{Dust, Fog, Placed, Rain, Region, Snow};
use echocast::{Environment, Error, SensorKind, shown};
use std::path::{Path, PathBuf};

/// Weather, and water for sonars.
#[derive(Args)]
pub struct WeatherArgs {
    /// Weather, and water for sonars, from a YAML file: the section `environment` of a scenario, or only its keys;
    /// `-` for standard input
    #[arg(long, value_name = "FILE", help_heading = "Weather")]
    env: Option<PathBuf>,
    /// Rain, mm/h (10 is a shower, 50 a cloudburst); sensors with a detection threshold
    /// (`detection.model: radar_equation` or `statistical`) detect single drops; for others, rain only attenuates the
    /// echoes from behind it
    #[arg(long, value_name = "MM_H", allow_negative_numbers = true, help_heading = "Weather")]
    rain: Option<f64>,
    /// Snow, mm/h of melted water (1 is a moderate snowfall); flakes are detected like drops
    #[arg(long, value_name = "MM_H", allow_negative_numbers = true, help_heading = "Weather")]
    snow: Option<f64>,
    /// Fog: visibility, metres
    #[arg(long, value_name = "VISIBILITY_M", allow_negative_numbers = true, help_heading = "Weather")]
    fog: Option<f64>,
    /// Cloud of dust around the sensor, from START_M on, LENGTH_M thick: `50,1e5,5,12.5`; repeatable
    #[arg(
        long,
        value_name = "RADIUS_UM,PER_M3,START_M,LENGTH_M",
        value_parser = dust,
        allow_hyphen_values = true,
        help_heading = "Weather"
    )]
    dust: Vec<Placed<Dust>>,
}

impl WeatherArgs {
    /// The file's weather for a sensor of `kind`; a flag replaces the file's weather of its kind.
    pub fn load(&self, kind: SensorKind) -> Result<Environment> {
        let mut environment = match &self.env {
            Some(file) => input::file_or_stdin("--env", file, read, Environment::from_yaml)?,
            None => Environment::default(),
        };
        if kind.is_under_water() {
            self.check_for_sonar(&environment).map_err(usage::wrong)?;
        }
        let fog = |visibility| Fog::default().visibility_m(visibility);
        let flags = Environment::default()
            .rain(self.rain.map(|rate| Rain::new(rate).into()).into_iter().collect())
            .snow(self.snow.map(|rate| Snow::new(rate).into()).into_iter().collect())
            .fog(self.fog.map(|visibility| fog(visibility).into()).into_iter().collect())
            .dust(self.dust.clone());
        flags.check().map_err(|error| usage::wrong(name_flag(error)))?;
        replace(&mut environment.rain, flags.rain);
        replace(&mut environment.snow, flags.snow);
        replace(&mut environment.fog, flags.fog);
        replace(&mut environment.dust, flags.dust);
        environment.check().map_err(usage::wrong)?;
        Ok(environment)
    }

    /// Checks that there is no weather but water, in `environment` of the file or as flags.
    fn check_for_sonar(&self, environment: &Environment) -> Result<()> {
        let flags = [
            ("--rain", self.rain.is_some()),
            ("--snow", self.snow.is_some()),
            ("--fog", self.fog.is_some()),
            ("--dust", !self.dust.is_empty()),
        ];
        for (option, given) in flags {
            ensure!(
                !given,
                "{option}: the sensor is a sonar, and in water there is no weather; allowed: with other sensors"
            );
        }
        let Some(key) = environment.weather().next() else { return Ok(()) };
        let file = shown::path(self.env.as_deref().unwrap_or(Path::new("")));
        bail!("--env {file}: {key}: the sensor is a sonar, and in water there is no weather; allowed: water");
    }
}

/// Reads the environment in `file`. An error in another file that it refers to includes the key.
fn read(file: &Path) -> Result<Environment> {
    let own = shown::path(file);
    Environment::load(file).map_err(|error| {
        let of_other = match &error {
            Error::Io { path, .. } => path != file,
            Error::Parse { origin, .. } => *origin != own,
            _ => false,
        };
        let error = anyhow::Error::new(error);
        if of_other { error.context(format!("{own}: water.profile.file")) } else { error }
    })
}

fn replace<T>(kind: &mut Vec<T>, by: Vec<T>) {
    if !by.is_empty() {
        *kind = by;
    }
}

/// Names the flag in place of the key that it sets.
fn name_flag(error: Error) -> Error {
    match error {
        Error::InvalidParameter { name, value, allowed } => {
            let name = match name.split_once('.') {
                // Dust has several numbers.
                Some((flag, number)) if flag.starts_with("dust") => format!("--{flag}: {number}"),
                Some((flag, _)) => format!("--{flag}"),
                None => name,
            };
            Error::InvalidParameter { name, value, allowed }
        }
        other => other,
    }
}

fn dust(text: &str) -> Result<Placed<Dust>, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[radius_um, per_m3, start_m, length_m]) => {
            Ok(Placed { what: Dust::new(radius_um, per_m3), region: Region::Shell { start_m, length_m } })
        }
        _ => Err("expected four numbers: RADIUS_UM,PER_M3,START_M,LENGTH_M".into()),
    }
}
