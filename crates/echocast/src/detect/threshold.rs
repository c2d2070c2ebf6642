//! Which echoes are strong enough to be reported.

use crate::yaml;
use serde::{Deserialize, Deserializer, Serialize, de};

/// A point of the linear reflectivity limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitPoint {
    /// Reflectivity that is just not seen, 0..1.
    pub reflectance: f64,
    /// Range, m.
    pub at_m: f64,
}

/// Detection model of an instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "model", rename_all = "snake_case")]
pub enum Detection {
    /// Every echo is reported.
    #[default]
    None,
    /// Hard-target radar equation, calibrated by one data-sheet line: a head-on Lambert target of
    /// `reflectance` that fills the beam is just seen at `at_m` in clear air.
    RadarEquation {
        /// Reflectance of the data-sheet target, 0..1.
        reflectance: f64,
        /// Its greatest range, m.
        at_m: f64,
    },
    /// The linear limit of the paper's system: between the two points the reflectivity that is
    /// just not seen rises linearly with range; nearer than `lower` everything is seen.
    ReflectivityLimit {
        /// Near point.
        lower: LimitPoint,
        /// Far point.
        upper: LimitPoint,
    },
}

impl<'de> Deserialize<'de> for Detection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Nothing {}
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Limits {
            lower: LimitPoint,
            upper: LimitPoint,
        }
        let (word, section) = yaml::split_tag(deserializer, "model")?;
        Ok(match word.as_str() {
            "none" => {
                let Nothing {} = section.read()?;
                Detection::None
            }
            "radar_equation" => {
                let LimitPoint { reflectance, at_m } = section.read()?;
                Detection::RadarEquation { reflectance, at_m }
            }
            "reflectivity_limit" => {
                let Limits { lower, upper } = section.read()?;
                Detection::ReflectivityLimit { lower, upper }
            }
            _ => return Err(de::Error::unknown_variant(&word, &["none", "radar_equation", "reflectivity_limit"])),
        })
    }
}
