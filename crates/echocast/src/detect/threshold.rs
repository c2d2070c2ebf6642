//! Which echoes are strong enough to be reported.

use crate::yaml;
use serde::{Deserialize, Deserializer, Serialize};

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
            _ => return Err(section.unknown(&word, &["none", "radar_equation", "reflectivity_limit"])),
        })
    }
}

/// A detection model made ready for one scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Threshold {
    /// Every echo.
    Open,
    /// Echoes with `rho_eff / R^2 >= k`, 1/m^2.
    Calibrated { k: f32 },
    /// Echoes with `rho_eff > limit + slope (R - from)` where `R >= from`, all nearer ones.
    Linear { from: f32, limit: f32, slope: f32 },
    /// The paper's program: `rho_eff > limit + slope R` where `R >= from`, `rho_eff > 0` nearer (it leaves out
    /// the `- from` of the model it cites).
    LinearBlainder { from: f32, limit: f32, slope: f32 },
}

impl Threshold {
    /// `blainder`: as the paper's program computes the linear limit.
    pub(crate) fn new(detection: Detection, blainder: bool) -> Self {
        match detection {
            Detection::None => Threshold::Open,
            Detection::RadarEquation { reflectance, at_m } => {
                Threshold::Calibrated { k: (reflectance / (at_m * at_m)) as f32 }
            }
            Detection::ReflectivityLimit { lower, upper } => {
                let slope = ((upper.reflectance - lower.reflectance) / (upper.at_m - lower.at_m)) as f32;
                let (from, limit) = (lower.at_m as f32, lower.reflectance as f32);
                if blainder {
                    Threshold::LinearBlainder { from, limit, slope }
                } else {
                    Threshold::Linear { from, limit, slope }
                }
            }
        }
    }

    /// Whether an echo of effective reflectance `rho_eff` from `range` m is detected.
    #[inline(always)]
    pub(crate) fn detects(self, rho_eff: f32, range: f32) -> bool {
        match self {
            Threshold::Open => true,
            Threshold::Calibrated { k } => rho_eff >= k * range * range,
            Threshold::Linear { from, limit, slope } => range < from || rho_eff > limit + slope * (range - from),
            Threshold::LinearBlainder { .. } => rho_eff > self.limit_of_the_program(range),
        }
    }

    /// What the effective reflectance of an echo from `range` m must exceed in the paper's program.
    #[inline(always)]
    pub(crate) fn limit_of_the_program(self, range: f32) -> f32 {
        match self {
            Threshold::LinearBlainder { from, limit, slope } if range >= from => limit + slope * range,
            Threshold::Calibrated { k } => k * range * range,
            _ => 0.0,
        }
    }

    /// Least `rho_eff / R^2` that is detected at every range, 1/m^2, where the model knows one.
    pub(crate) fn least_power(self) -> Option<f64> {
        match self {
            Threshold::Calibrated { k } => Some(k.into()),
            _ => None,
        }
    }

    /// Signal-to-noise ratio relative to the threshold's, where the model knows it.
    #[inline(always)]
    pub(crate) fn relative_snr(self, rho_eff: f32, range: f32) -> Option<f32> {
        match self {
            Threshold::Calibrated { k } => Some(rho_eff / (k * range * range)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit(r_min: f64, d_min: f64, r_max: f64, d_max: f64) -> Detection {
        Detection::ReflectivityLimit {
            lower: LimitPoint { reflectance: r_min, at_m: d_min },
            upper: LimitPoint { reflectance: r_max, at_m: d_max },
        }
    }

    /// Least reflectivity that `threshold` sees at `range`, by bisection.
    fn least(threshold: Threshold, range: f32) -> f64 {
        let (mut low, mut high) = (-0.1f32, 2.0f32);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            if threshold.detects(middle, range) { high = middle } else { low = middle }
        }
        f64::from(high)
    }

    /// Maximum ranges of a calibrated threshold in clear air (0.8 at 200 m): sqrt(rho / K).
    #[test]
    fn the_radar_equation_sees_as_far_as_the_data_sheet_line_says() {
        let threshold = Threshold::new(Detection::RadarEquation { reflectance: 0.8, at_m: 200.0 }, false);
        for (rho, range) in [(0.1f32, 70.711f32), (0.8, 200.0)] {
            assert!(threshold.detects(rho, range * 0.9999));
            assert!(!threshold.detects(rho, range * 1.0001));
        }
        assert_eq!(threshold.relative_snr(0.8, 100.0).map(f32::round), Some(4.0));
    }

    /// The preset 0.5 at 50 m to 0.9 at 120 m, and what the paper's program makes of it.
    #[test]
    fn linear_limits_follow_their_tables() {
        let generic = limit(0.5, 50.0, 0.9, 120.0);
        let (right, blainder) = (Threshold::new(generic, false), Threshold::new(generic, true));
        for (range, expected, program) in
            [(50.0, 0.5, 0.785_714_286), (60.0, 0.557_142_857, 0.842_857_143), (120.0, 0.9, 1.185_714_29)]
        {
            assert!((least(right, range) - expected).abs() < 1e-6);
            assert!((least(blainder, range) - program).abs() < 1e-6);
        }
        assert!(right.detects(0.0, 49.9), "nearer than the lower point all is seen");
        assert!(!blainder.detects(0.0, 49.9) && blainder.detects(1e-3, 49.9));
    }
}
