//! Weather by flag or file.

use anyhow::Result;
use clap::Args;
use echocast::Environment;
use echocast::medium::{Dust, Fog, Placed, Rain, Region, Snow};
use std::path::PathBuf;

/// What is between sensor and surfaces.
#[derive(Args)]
pub struct WeatherArgs {
    /// Weather from a YAML file: the section `environment` of a scenario, or its keys alone
    #[arg(long, value_name = "FILE", help_heading = "Weather")]
    env: Option<PathBuf>,
    /// Rain, mm/h (10 is a shower, 50 a cloudburst)
    #[arg(long, value_name = "MM_H", help_heading = "Weather")]
    rain: Option<f64>,
    /// Snow, mm/h of melted water (1 is a moderate snowfall)
    #[arg(long, value_name = "MM_H", help_heading = "Weather")]
    snow: Option<f64>,
    /// Fog: how far one sees, metres
    #[arg(long, value_name = "VISIBILITY_M", help_heading = "Weather")]
    fog: Option<f64>,
    /// A cloud of dust around the sensor, from START_M on, LENGTH_M thick: `50,1e5,5,12.5`; repeatable
    #[arg(long, value_name = "RADIUS_UM,PER_M3,START_M,LENGTH_M", value_parser = dust, help_heading = "Weather")]
    dust: Vec<Placed<Dust>>,
}

impl WeatherArgs {
    /// The file's weather, in which each kind that a flag names is as the flag says.
    pub fn load(&self) -> Result<Environment> {
        let mut environment = self.env.as_ref().map(Environment::load).transpose()?.unwrap_or_default();
        if let Some(rate) = self.rain {
            environment.rain = vec![Rain::new(rate).into()];
        }
        if let Some(rate) = self.snow {
            environment.snow = vec![Snow::new(rate).into()];
        }
        if let Some(visibility) = self.fog {
            environment.fog = vec![Fog { visibility_m: Some(visibility), ..Fog::default() }.into()];
        }
        if !self.dust.is_empty() {
            environment.dust.clone_from(&self.dust);
        }
        environment.check().map_err(|error| anyhow::anyhow!("--{error}"))?;
        Ok(environment)
    }
}

fn dust(text: &str) -> Result<Placed<Dust>, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[radius_um, per_m3, start_m, length_m]) => {
            Ok(Placed { what: Dust { radius_um, per_m3, q_ext: 1.0 }, region: Region::Shell { start_m, length_m } })
        }
        _ => Err("expected four numbers: RADIUS_UM,PER_M3,START_M,LENGTH_M".into()),
    }
}
