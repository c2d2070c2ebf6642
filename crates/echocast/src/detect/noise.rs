//! Errors of what is measured.

use super::Threshold;
use crate::rng::{Draw, Rng};
use serde::{Deserialize, Serialize};

/// Errors of an instrument; all zero is an ideal one.
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
    /// Standard deviation at the detection threshold, m, at least 0; it falls as 1/SNR (the Cramer-Rao bound of a
    /// Gaussian pulse, `sigma_R = (c/2) sqrt(2) sigma_p / SNR`) and adds in squares to `range_sigma_m`. Needs
    /// `detection.model: radar_equation`.
    pub range_snr_sigma_m: f64,
    /// Standard deviation of the reported azimuth, degrees, 0 to 10: points are reported turned about the sensor's z.
    pub azimuth_sigma_deg: f64,
    /// Part of the returns that gets lost at random, 0 to 1.
    pub dropout: f64,
}

/// The range errors of one scan, in the units of the lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RangeError {
    bias: f32,
    gain: f32,
    sigma: f32,
    snr_sigma: f32,
    step: f32,
    threshold: Threshold,
}

impl RangeError {
    /// `step`: the instrument's range resolution, m, 0 = none.
    pub(crate) fn new(noise: &Noise, step: f64, threshold: Threshold) -> Self {
        RangeError {
            bias: (noise.range_offset_m + noise.range_mean_m) as f32,
            gain: (1.0 + noise.range_offset_percent / 100.0) as f32,
            sigma: noise.range_sigma_m as f32,
            snr_sigma: noise.range_snr_sigma_m as f32,
            step: step as f32,
            threshold,
        }
    }

    /// Measured ranges of returns from their true ranges and effective reflectances, not rounded yet; `beams` and `numbers`
    /// are what draws depend on: which beam it is, and which return of it.
    #[inline(always)]
    pub(crate) fn measure(
        &self,
        rng: &Rng,
        [beams, numbers]: [&[u32]; 2],
        rho_eff: &[f32],
        truth: &[f32],
        measured: &mut [f32],
    ) {
        if self.sigma > 0.0 || self.snr_sigma > 0.0 {
            rng.normals(beams, numbers, Draw::RangeJitter, measured);
            if self.snr_sigma > 0.0 {
                for ((value, &rho_eff), &range) in measured.iter_mut().zip(rho_eff).zip(truth) {
                    let timing =
                        self.threshold.relative_snr(rho_eff, range).map_or(0.0, |snr| self.snr_sigma / snr.max(1.0));
                    *value *= (self.sigma * self.sigma + timing * timing).sqrt();
                }
            } else {
                measured.iter_mut().for_each(|value| *value *= self.sigma);
            }
        } else {
            measured.fill(0.0);
        }
        for (value, &range) in measured.iter_mut().zip(truth) {
            *value = (range * self.gain + self.bias + *value).max(0.0);
        }
    }

    /// Rounds what is measured to the instrument's range step.
    #[inline(always)]
    pub(crate) fn round(&self, measured: &mut [f32]) {
        if self.step > 0.0 {
            let per_step = 1.0 / self.step;
            measured.iter_mut().for_each(|value| *value = (*value * per_step).round_ties_even() * self.step);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Detection;
    use super::*;

    fn measure(noise: Noise, step: f64, detection: Detection, rho_eff: f32, truth: f32, count: usize) -> Vec<f64> {
        let error = RangeError::new(&noise, step, Threshold::new(detection, false));
        let mut measured = vec![0.0; count];
        let beams: Vec<u32> = (0..count as u32).collect();
        let draws = [&beams[..], &vec![0; count]];
        error.measure(&Rng::new(5, 0), draws, &vec![rho_eff; count], &vec![truth; count], &mut measured);
        error.round(&mut measured);
        measured.into_iter().map(f64::from).collect()
    }

    fn mean_and_sigma(sample: &[f64]) -> (f64, f64) {
        let n = sample.len() as f64;
        let mean = sample.iter().sum::<f64>() / n;
        (mean, (sample.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt())
    }

    #[test]
    fn offsets_are_exact() {
        let noise = Noise { range_offset_m: 0.25, range_offset_percent: 2.0, range_mean_m: 0.05, ..Noise::default() };
        let measured = measure(noise, 0.0, Detection::None, 0.5, 10.0, 3);
        assert!(measured.iter().all(|r| (r - 10.5).abs() < 1e-6), "{measured:?}");
    }

    #[test]
    fn gaussian_noise_has_its_mean_and_sigma() {
        let noise = Noise { range_mean_m: 0.1, range_sigma_m: 0.03, ..Noise::default() };
        let sample = measure(noise, 0.0, Detection::None, 0.5, 20.0, 100_000);
        let (mean, sigma) = mean_and_sigma(&sample);
        let error = 0.03 / (sample.len() as f64).sqrt();
        assert!((mean - 20.1).abs() < 5.0 * error, "mean {mean}");
        assert!((sigma - 0.03).abs() < 5.0 * error / 2f64.sqrt(), "sigma {sigma}");
    }

    #[test]
    fn timing_noise_falls_with_the_signal() {
        let noise = Noise { range_snr_sigma_m: 0.08, ..Noise::default() };
        let radar = Detection::RadarEquation { reflectance: 0.8, at_m: 100.0 };
        // At the threshold itself, and at a quarter of the range: 16 times the signal.
        for (range, expected) in [(100.0, 0.08), (25.0, 0.005)] {
            let (_, sigma) = mean_and_sigma(&measure(noise, 0.0, radar, 0.8, range, 100_000));
            assert!((sigma / expected - 1.0).abs() < 0.012, "{sigma} at {range} m");
        }
    }

    #[test]
    fn ranges_are_rounded_to_the_step() {
        let noise = Noise { range_sigma_m: 0.03, ..Noise::default() };
        for r in measure(noise, 0.004, Detection::None, 0.5, 20.0, 1000) {
            assert!((r / 0.004 - (r / 0.004).round()).abs() < 1e-3, "{r}");
        }
        assert_eq!(measure(Noise::default(), 0.5, Detection::None, 0.5, 20.2, 1), [20.0]);
    }

    #[test]
    fn no_range_is_negative() {
        let noise = Noise { range_offset_m: -3.0, ..Noise::default() };
        assert_eq!(measure(noise, 0.0, Detection::None, 0.5, 1.0, 1), [0.0]);
    }
}
