//! Water, as sonar needs it: how fast sound is in it, what it swallows, and what happens where it ends.

mod absorption;
mod column;
mod fluid;
mod noise;
mod profile;
mod sea;
mod speed;
mod validity;

pub use absorption::Absorption;
pub(crate) use column::{Column, Slab};
pub use fluid::Fluid;
pub use noise::AmbientNoise;
pub use profile::{Layer, Profile, SpeedRow, WaterRow};
pub use sea::Sea;
pub use speed::{SoundSpeed, pressure_bar, unesco_speed};
pub use validity::Outside;

use crate::bounds::{ABOVE_ZERO, Bounds};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How sound gets weaker on its way because it spreads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Spreading {
    /// As the rays of the profile spread; without one as a sphere.
    #[default]
    RayTube,
    /// `20 log r` dB one way.
    Spherical,
    /// `15 log r`.
    Practical,
    /// `10 log r`.
    Cylindrical,
    /// `20 log r` up to `spreading_from_m`, and cylindrical from there.
    Hybrid,
}

/// The water below a level of the world: the section `environment.water`. Only sonar meets it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Water {
    /// Height of the mean surface in the world, m; depths count down from it. 0.
    pub surface_z_m: f64,
    /// Temperature where `profile` does not say it, degrees Celsius; 10.
    pub temperature_c: f64,
    /// Practical salinity where `profile` does not say it, PSU; 35.
    pub salinity_psu: f64,
    /// Acidity; 8.
    pub ph: f64,
    /// Latitude, degrees, by which pressure depends on depth; 45.
    pub latitude_deg: f64,
    /// The formula that makes speeds of temperature and salinity.
    pub sound_speed: SoundSpeed,
    /// The law of absorption.
    pub absorption: Absorption,
    /// The law of spreading.
    pub spreading: Spreading,
    /// Distance from which on `hybrid` spreading is cylindrical, m, above 0; only with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spreading_from_m: Option<f64>,
    /// How speeds change with depth; without it there is one speed, by temperature, salinity and the depth of the sonar.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile: Option<Profile>,
    /// Speed of sound that the instrument believes in, m/s; that at its own depth when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assumed_speed_m_s: Option<f64>,
    /// Whether speeds and densities may be anything above 0, as in files whose numbers are in other units.
    pub allow_unphysical: bool,
    /// Wind over the water, m/s: it makes waves and noise; 5.
    pub wind_m_s: f64,
    /// How much traffic of ships there is to hear, 0 to 1; 0.5.
    pub shipping: f64,
    /// Backscatter of what floats in the water, dB re 1/m; none when not given. Open sea has -95 to -70.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_backscatter_db: Option<f64>,
}

impl Default for Water {
    fn default() -> Self {
        Water {
            surface_z_m: 0.0,
            temperature_c: 10.0,
            salinity_psu: 35.0,
            ph: 8.0,
            latitude_deg: 45.0,
            sound_speed: SoundSpeed::default(),
            absorption: Absorption::default(),
            spreading: Spreading::default(),
            spreading_from_m: None,
            profile: None,
            assumed_speed_m_s: None,
            allow_unphysical: false,
            wind_m_s: 5.0,
            shipping: 0.5,
            volume_backscatter_db: None,
        }
    }
}

impl Water {
    pub(super) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        let mut within = |name: &str, value: Option<f64>, [least, most]: [f64; 2]| {
            bounds.within(format_args!("{key}.{name}"), value, least, most)
        };
        within("surface_z_m", Some(self.surface_z_m), [-1e5, 1e5])?;
        within("temperature_c", Some(self.temperature_c), profile::TEMPERATURES)?;
        within("salinity_psu", Some(self.salinity_psu), profile::SALINITIES)?;
        within("ph", Some(self.ph), [6.0, 9.0])?;
        within("latitude_deg", Some(self.latitude_deg), [-90.0, 90.0])?;
        within("wind_m_s", Some(self.wind_m_s), [0.0, 60.0])?;
        within("shipping", Some(self.shipping), [0.0, 1.0])?;
        within("volume_backscatter_db", self.volume_backscatter_db, [-200.0, 0.0])?;
        let from = format!("{key}.spreading_from_m");
        match (self.spreading, self.spreading_from_m) {
            (Spreading::Hybrid, None) => {
                return Err(Error::invalid(format!("{key}.spreading"), "hybrid", "it with spreading_from_m beside it"));
            }
            (Spreading::Hybrid, Some(_)) => {}
            (_, Some(found)) => return Err(Error::invalid(from, found, "none but with spreading: hybrid")),
            (_, None) => {}
        }
        bounds.number(from, self.spreading_from_m, [ABOVE_ZERO, 1e7], "above 0, to 1e7")?;
        if let Some(speed) = self.assumed_speed_m_s {
            profile::check_speed(&format!("{key}.assumed_speed_m_s"), speed, self.allow_unphysical)?;
        }
        match &self.profile {
            Some(profile) => profile.check(&format!("{key}.profile"), self.allow_unphysical),
            None => Ok(()),
        }
    }

    /// Reads the file that the profile may name; a relative name starts at `folder`.
    pub(super) fn read_file(&mut self, folder: &Path) -> Result<()> {
        match &mut self.profile {
            Some(profile) => profile.read_file(folder, self.allow_unphysical),
            None => Ok(()),
        }
    }

    /// Its surface.
    pub fn sea(&self) -> Sea {
        Sea { wind_m_s: self.wind_m_s }
    }

    /// What is to be heard in it.
    pub fn noise(&self) -> AmbientNoise {
        AmbientNoise { wind_m_s: self.wind_m_s, shipping: self.shipping }
    }
}
