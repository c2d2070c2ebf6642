//! Errors of the measured range.

use serde::{Deserialize, Serialize};

/// Range errors of an instrument; all zero is an ideal one.
///
/// `R_out = Q[R + offset + R percent/100 + N(mean, sigma)]` along the beam, Q = rounding to the
/// instrument's range step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// Constant offset, m.
    pub range_offset_m: f64,
    /// Offset in percent of the range.
    pub range_offset_percent: f64,
    /// Mean of the Gaussian error, m.
    pub range_mean_m: f64,
    /// Standard deviation of the Gaussian error, m, at least 0.
    pub range_sigma_m: f64,
    /// Standard deviation at the detection threshold, m, at least 0; it falls as 1/SNR and adds in
    /// squares to `range_sigma_m`. Needs `detection.model: radar_equation`.
    pub range_snr_sigma_m: f64,
}
