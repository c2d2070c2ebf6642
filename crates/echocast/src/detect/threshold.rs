//! Which echoes are strong enough to be reported.

use serde::{Deserialize, Serialize};

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "snake_case", deny_unknown_fields)]
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
