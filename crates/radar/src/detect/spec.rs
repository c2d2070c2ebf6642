//! Keys of a radar's detector.

use super::cfar::{CfarAxis, CfarMethod, CfarShape};
use super::response::WindowResponse;
use ground::error::{Error, Result};
use ground::read::bounds::{Bounds, FARTHEST_M};
use serde::{Deserialize, Serialize};

/// How a radar finds detections in a cube. Pairs of numbers of cells are those along range and along velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct RadarDetectionSpec {
    /// How the noise is estimated from the cells around.
    pub method: CfarMethod,
    /// Probability that the noise of a cell exceeds its threshold, 1e-12 to 0.5.
    pub pfa: f64,
    /// Which cells are compared with a cell.
    pub dims: CfarDims,
    /// Cells on each side that are not compared with a cell, 0 to 1000.
    pub guard_cells: [u32; 2],
    /// Cells on each side beyond these that are, 1 to 1000; those along an axis that `dims` does not use count for
    /// nothing.
    pub reference_cells: [u32; 2],
    /// Which part of the reference cells is below the level of `os`, above 0 to 1.
    pub os_rank: f64,
    /// Whether only cells that are stronger than their neighbours are detected; otherwise all that exceed their
    /// thresholds, side lobes and flanks of a strong target too.
    pub local_maxima: bool,
    /// Most targets in different directions that one cell can hold, 1 to 8.
    pub targets_per_cell: u32,
    /// Power of the weakest of them relative to the strongest, above 0 to 1.
    pub second_target: f64,
    /// Least signal-to-noise ratio after the sum over channels, dB, -100 to 200; without it, the threshold decides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_snr_db: Option<f64>,
    /// Whether the phases between transmitters that take turns tell velocities that differ by the unambiguous span.
    pub unfold: bool,
    /// What is reported.
    pub limits: DetectionLimits,
    /// In which steps it is reported.
    pub steps: DetectionSteps,
    /// Most detections in a frame, 1 to 10000000: the strongest. Without it, all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_detections: Option<u32>,
}

impl Default for RadarDetectionSpec {
    fn default() -> Self {
        RadarDetectionSpec {
            method: CfarMethod::Ca,
            pfa: 1e-5,
            dims: CfarDims::RangeThenDoppler,
            guard_cells: [2, 2],
            reference_cells: [12, 8],
            os_rank: 0.75,
            local_maxima: true,
            targets_per_cell: 1,
            second_target: 0.5,
            min_snr_db: None,
            unfold: false,
            limits: DetectionLimits::default(),
            steps: DetectionSteps::default(),
            max_detections: None,
        }
    }
}

/// Which cells of a map of range and velocity are compared with a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CfarDims {
    /// Those of the same velocity.
    Range,
    /// Those at the same range.
    Doppler,
    /// Both, and it must exceed each of the two levels.
    #[default]
    RangeThenDoppler,
    /// Both, which give one level.
    Cross,
    /// Those of a rectangle.
    Box,
}

/// `limits` of detections; without a pair, none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct DetectionLimits {
    /// Least and greatest range, m, 0 to 1e9.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_m: Option<[f64; 2]>,
    /// Least and greatest range rate, m/s, -1e6 to 1e6.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_m_s: Option<[f64; 2]>,
    /// Least and greatest azimuth, degrees, -90 to 90.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<[f64; 2]>,
    /// Least and greatest elevation, degrees, -90 to 90.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<[f64; 2]>,
}

/// `steps` in which an instrument reports what it measures, to the nearest; without one, exactly.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct DetectionSteps {
    /// Range, m, 1e-6 to 1000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_m: Option<f64>,
    /// Range rate, m/s, 1e-6 to 1000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_m_s: Option<f64>,
    /// Azimuth, degrees, 1e-6 to 90.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Elevation, degrees, 1e-6 to 90.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<f64>,
}

impl RadarDetectionSpec {
    /// Checks that all values are within their allowed ranges. `key`: that of this section, which errors name.
    ///
    /// # Errors
    /// A value that is not.
    pub fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        let of = |name: &str| format!("{key}.{name}");
        bounds.number(of("pfa"), self.pfa, [1e-12, 0.5], "1e-12 to 0.5")?;
        for axis in 0..2 {
            bounds.within(of(&format!("guard_cells[{axis}]")), f64::from(self.guard_cells[axis]), 0.0, 1000.0)?;
            bounds.within(
                of(&format!("reference_cells[{axis}]")),
                f64::from(self.reference_cells[axis]),
                1.0,
                1000.0,
            )?;
        }
        if self.dims == CfarDims::Box && matches!(self.method, CfarMethod::Go | CfarMethod::So) {
            return Err(Error::invalid(of("method"), "go or so", "ca or os with dims box, whose cells have no sides"));
        }
        bounds.number(of("os_rank"), self.os_rank, [f64::MIN_POSITIVE, 1.0], "above 0 to 1")?;
        bounds.within(of("targets_per_cell"), f64::from(self.targets_per_cell), 1.0, 8.0)?;
        bounds.number(of("second_target"), self.second_target, [1e-6, 1.0], "1e-6 to 1")?;
        bounds.within(of("min_snr_db"), self.min_snr_db, -100.0, 200.0)?;
        let DetectionLimits { range_m, velocity_m_s, azimuth_deg, elevation_deg } = self.limits;
        for (name, limits, [min, max]) in [
            ("range_m", range_m, [0.0, FARTHEST_M]),
            ("velocity_m_s", velocity_m_s, [-1e6, 1e6]),
            ("azimuth_deg", azimuth_deg, [-90.0, 90.0]),
            ("elevation_deg", elevation_deg, [-90.0, 90.0]),
        ] {
            let key = |index: usize| format!("{key}.limits.{name}[{index}]");
            if let Some([least, greatest]) = limits {
                bounds.within(key(0), least, min, max)?;
                bounds.within(key(1), greatest, min, max)?;
                bounds.rising((key(0), least), (key(1), greatest))?;
            }
        }
        let DetectionSteps { range_m, velocity_m_s, azimuth_deg, elevation_deg } = self.steps;
        for (name, step, most) in [
            ("range_m", range_m, 1000.0),
            ("velocity_m_s", velocity_m_s, 1000.0),
            ("azimuth_deg", azimuth_deg, 90.0),
            ("elevation_deg", elevation_deg, 90.0),
        ] {
            bounds.number(format!("{key}.steps.{name}"), step, [1e-6, most], format_args!("1e-6 to {most}"))?;
        }
        bounds.within(of("max_detections"), self.max_detections.map(f64::from), 1.0, 1e7)
    }

    /// The axes of a map of `[velocities][ranges]` cells, and how cells are compared; `responses` along range and along
    /// velocity.
    pub(super) fn axes(
        &self,
        [velocities, ranges]: [usize; 2],
        responses: [&WindowResponse; 2],
    ) -> ([CfarAxis; 2], CfarShape) {
        let [range, doppler] = match self.dims {
            CfarDims::Range => [true, false],
            CfarDims::Doppler => [false, true],
            CfarDims::RangeThenDoppler | CfarDims::Cross | CfarDims::Box => [true, true],
        };
        let axis = |len: usize, wraps: bool, which: usize, used: bool| {
            let [guard, reference] = [self.guard_cells, self.reference_cells].map(|cells| cells[which] as usize);
            let alike = responses[which].alike();
            let [guard, reference] = if used { [guard, reference] } else { [0; 2] };
            CfarAxis { len, wraps, guard, reference, alike }
        };
        let shape = match self.dims {
            CfarDims::Range | CfarDims::Doppler | CfarDims::RangeThenDoppler => CfarShape::Each,
            CfarDims::Cross => CfarShape::Cross,
            CfarDims::Box => CfarShape::Box,
        };
        ([axis(velocities, true, 1, doppler), axis(ranges, false, 0, range)], shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        let spec: RadarDetectionSpec = serde_json::from_str(text).unwrap();
        spec.check("detection", &mut Bounds::none()).unwrap_err().to_string()
    }

    #[test]
    fn defaults_are_allowed_and_are_what_is_read_from_nothing() {
        let spec: RadarDetectionSpec = serde_json::from_str("{}").unwrap();
        assert_eq!(spec, RadarDetectionSpec::default());
        spec.check("detection", &mut Bounds::none()).unwrap();
        let written = serde_json::to_string(&spec).unwrap();
        assert_eq!(serde_json::from_str::<RadarDetectionSpec>(&written).unwrap(), spec);
        assert!(serde_json::from_str::<RadarDetectionSpec>(r#"{"threshold": 1}"#).is_err());
    }

    #[test]
    fn errors_say_what_is_allowed() {
        for (text, message) in [
            (r#"{"pfa": 0}"#, "detection.pfa is 0; allowed: 1e-12 to 0.5"),
            (r#"{"reference_cells": [0, 8]}"#, "detection.reference_cells[0] is 0; allowed: 1 to 1000"),
            (r#"{"guard_cells": [2, 4000000000]}"#, "detection.guard_cells[1] is 4000000000; allowed: 0 to 1000"),
            (r#"{"os_rank": 0}"#, "detection.os_rank is 0; allowed: above 0 to 1"),
            (r#"{"targets_per_cell": 9}"#, "detection.targets_per_cell is 9; allowed: 1 to 8"),
            (r#"{"second_target": 2}"#, "detection.second_target is 2; allowed: 1e-6 to 1"),
            (
                r#"{"limits": {"range_m": [9, 3]}}"#,
                "detection.limits.range_m[1] is 3; allowed: above detection.limits.range_m[0] (9)",
            ),
            (r#"{"steps": {"azimuth_deg": 0}}"#, "detection.steps.azimuth_deg is 0; allowed: 1e-6 to 90"),
            (r#"{"max_detections": 0}"#, "detection.max_detections is 0; allowed: 1 to 10000000"),
            (
                r#"{"method": "go", "dims": "box"}"#,
                "detection.method is go or so; allowed: ca or os with dims box, whose cells have no sides",
            ),
        ] {
            assert_eq!(refused(text), message);
        }
    }
}
