//! Measurement errors.

use super::{RangeCurve, Threshold};
use echocast_kernels::measure;
use ground::error::{Error, Result};
use ground::read::bounds::{ABOVE_ZERO, Bounds, FARTHEST_M, check_rows, rising_rows};
use ground::rng::{Draw, Rng};
use serde::{Deserialize, Serialize};

/// Errors of an instrument; with all zero it is ideal.
///
/// `R_out = Q[(1 + percent/100 + g_ch) R + offset + b_ch + k_T dT + N(mean, sigma)]` along the beam, Q = rounding to
/// the instrument's range step. Variances add: that of `range_sigma_m + range_sigma_per_m R`, of `range_snr_sigma_m`
/// and of the table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Noise {
    /// Constant offset, m.
    pub range_offset_m: f64,
    /// Offset in percent of the range.
    pub range_offset_percent: f64,
    /// Mean of the Gaussian error, m.
    pub range_mean_m: f64,
    /// Standard deviation of the Gaussian error, m, at least 0.
    pub range_sigma_m: f64,
    /// Growth of that with every metre of range, at least 0.
    pub range_sigma_per_m: f64,
    /// Standard deviation at the detection threshold, m, at least 0; it falls as 1/SNR (the Cramer-Rao bound of a
    /// Gaussian pulse, `sigma_R = (c/2) sqrt(2) sigma_p / SNR`) and adds in quadrature to `range_sigma_m`. Needs
    /// `detection.model: radar_equation` or `statistical`.
    pub range_snr_sigma_m: f64,
    /// Mean and standard deviation by ascending range, linear between points and constant outside; at most 1000 points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub range_table: Vec<RangePoint>,
    /// Standard deviation of the intensity in percent of it, before it is encoded, 0 to 1000.
    pub intensity_percent: f64,
    /// The same at the detection threshold, percent, 0 to 1000; it falls as 1/SNR and adds in quadrature to
    /// `intensity_percent`: an amplitude of SNR times the noise is known to a relative error of 1/SNR. Without
    /// `detection.model: radar_equation` or `statistical` there is no SNR, and no such error.
    pub intensity_snr_percent: f64,
    /// Standard deviation, over the channels, of a constant error of each, m, at least 0.
    pub channel_bias_sigma_m: f64,
    /// Likewise for an error proportional to range, 0 to 1.
    pub channel_gain_sigma: f64,
    /// Which of many instruments of its kind this is: each has channel errors of its own, the same in all its scans.
    pub instrument: u32,
    /// Error for each kelvin by which the instrument is warmer than at calibration, m/K.
    pub temperature_m_per_k: f64,
    /// By how much it is warmer, K.
    pub temperature_offset_k: f64,
    /// Standard deviation of the reported azimuth, degrees, 0 to 10: points are reported rotated about the sensor's z
    /// axis.
    pub azimuth_sigma_deg: f64,
    /// Step of the encoder, degrees, 1e-4 to 10: azimuths, and points with them, are reported at the nearest multiple
    /// of it; 0 for none.
    pub azimuth_step_deg: f64,
    /// Scale error of the encoder of scan angles, parts per million, -100000 to 100000: it reports them larger by this than
    /// they are. Line scanners across the flight count them from straight down, all others azimuths from x.
    pub encoder_scale_ppm: f64,
    /// Standard deviation, in each of the two directions across a beam, of its true direction from the reported one,
    /// degrees, 0 to 10.
    pub pointing_sigma_deg: f64,
    /// Standard deviation of the reported time of a firing, us, at least 0.
    pub time_sigma_us: f64,
    /// Fraction of the returns lost at random, 0 to 1.
    pub dropout: f64,
    /// Weak returns lost in addition.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropout_weak: Option<WeakDropout>,
}

/// Range error at a range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangePoint {
    /// Range, m.
    pub at_m: f64,
    /// Mean, m.
    #[serde(default)]
    pub mean_m: f64,
    /// Standard deviation, m, at least 0.
    pub sigma_m: f64,
}

/// Loss of weak returns, as in the simulator CARLA: `p = at_zero (1 - I / below)` where I is less than `below`. I is
/// the range-corrected reflectivity `rho cos(theta)` after weather and the channel, 1 = a white surface head-on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct WeakDropout {
    /// Reflectivity from which on no return is lost, above 0, at most 1000.
    pub below: f64,
    /// Fraction of the weakest returns that is lost, 0 to 1.
    pub at_zero: f64,
}

impl WeakDropout {
    /// Probability that a return of effective reflectance `rho_eff` is lost.
    #[doc(hidden)]
    pub fn probability(&self, rho_eff: f32) -> f32 {
        (self.at_zero as f32 * (1.0 - rho_eff / self.below as f32)).max(0.0)
    }
}

/// The range errors of one scan, in the units of the lanes.
#[derive(Clone, Debug)]
pub(crate) struct RangeError {
    bias: f32,
    gain: f32,
    sigma: f32,
    sigma_per_m: f32,
    snr_sigma: f32,
    /// Mean and standard deviation of the table.
    table: [RangeCurve; 2],
    /// Bias, m, and gain of each channel; empty where all are equal.
    channels: Vec<[f32; 2]>,
    step: f32,
    /// Standard deviation, m of range, of pulses timed at their leading edge; 0 if timed at their peak.
    edge_sigma: f32,
    threshold: Threshold,
}

/// The errors of intensity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IntensityError {
    /// Relative standard deviation.
    sigma: f32,
    /// The same where the signal-to-noise ratio is that of the threshold, at `unit`, 1/m^2.
    snr_sigma: f32,
    unit: f32,
}

impl IntensityError {
    /// None where intensities are exact.
    pub fn new(noise: &Noise, threshold: &Threshold) -> Option<IntensityError> {
        let [sigma, snr_sigma] = [noise.intensity_percent, noise.intensity_snr_percent].map(|it| (it / 100.0) as f32);
        let unit = threshold.unit();
        let snr_sigma = unit.map_or(0.0, |_| snr_sigma);
        (sigma > 0.0 || snr_sigma > 0.0).then_some(IntensityError { sigma, snr_sigma, unit: unit.unwrap_or(1.0) })
    }

    /// Turns standard normal numbers into factors on the light of returns, at least 0.
    pub fn factors(self, rho_eff: &[f32], range: &[f32], factors: &mut [f32]) {
        measure::spread(factors, rho_eff, range, self.sigma, 0.0, self.snr_sigma, self.unit);
        factors.iter_mut().for_each(|factor| *factor = (1.0 + *factor).max(0.0));
    }
}

impl RangeError {
    /// `step`: the instrument's range resolution, m, 0 = none; `channels`: how many it has; `edge_sigma`: standard
    /// deviation of pulses timed at their leading edge, m of range, 0 if at their peak.
    pub fn new(noise: &Noise, step: f64, channels: usize, edge_sigma: f64, threshold: Threshold) -> Self {
        let bias = noise.range_offset_m + noise.range_mean_m + noise.temperature_m_per_k * noise.temperature_offset_k;
        let (bias, gain) = (bias as f32, (1.0 + noise.range_offset_percent / 100.0) as f32);
        let point = |value: fn(&RangePoint) -> f64| {
            RangeCurve::new(noise.range_table.iter().map(move |point| (point.at_m, value(point))))
        };
        let differ = noise.channel_bias_sigma_m > 0.0 || noise.channel_gain_sigma > 0.0;
        let (instrument, sigmas) =
            (Rng::new(noise.instrument.into(), 0), [noise.channel_bias_sigma_m, noise.channel_gain_sigma]);
        let of_channel = |channel: u32| {
            let error = |draw, sigma| instrument.normal(channel, draw, 0) * sigma as f32;
            [bias + error(Draw::ChannelBias, sigmas[0]), gain + error(Draw::ChannelGain, sigmas[1])]
        };
        RangeError {
            bias,
            gain,
            sigma: noise.range_sigma_m as f32,
            sigma_per_m: noise.range_sigma_per_m as f32,
            snr_sigma: noise.range_snr_sigma_m as f32,
            table: [point(|point| point.mean_m), point(|point| point.sigma_m)],
            channels: if differ { (0..channels as u32).map(of_channel).collect() } else { Vec::new() },
            step: step as f32,
            edge_sigma: edge_sigma as f32,
            threshold,
        }
    }

    /// Whether ranges have a Gaussian error, drawn by [`Draw::RangeJitter`].
    pub fn draws(&self) -> bool {
        let [_, sigma] = &self.table;
        self.sigma > 0.0 || self.sigma_per_m > 0.0 || self.snr_sigma > 0.0 || !sigma.is_empty()
    }

    /// Measured ranges, not yet rounded, from the channels, effective reflectances and true ranges of some echoes.
    /// `measured` holds a standard normal number for each, if [`RangeError::draws`] is true.
    pub fn measure(&self, channel: &[u16], rho_eff: &[f32], truth: &[f32], measured: &mut [f32]) {
        let [mean_at, sigma_at] = &self.table;
        if !sigma_at.is_empty() {
            for ((value, &rho_eff), &range) in measured.iter_mut().zip(rho_eff).zip(truth) {
                let sigma = sigma_at.at(range);
                *value = *value * (self.variance(rho_eff, range) + sigma * sigma).sqrt() + mean_at.at(range);
            }
        } else if self.snr_sigma > 0.0 || self.sigma_per_m > 0.0 {
            let [sigma, sigma_per_m, timing, unit] = self.deviation();
            measure::spread(measured, rho_eff, truth, sigma, sigma_per_m, timing, unit);
        } else if self.sigma > 0.0 {
            measure::scale(measured, self.sigma);
        } else {
            measured.fill(0.0);
        }
        if self.edge_sigma > 0.0
            && let Some(unit) = self.threshold.unit()
        {
            measure::walk(measured, rho_eff, truth, self.edge_sigma, unit);
        }
        if self.channels.is_empty() {
            measure::measure(measured, truth, self.gain, self.bias);
        } else {
            for ((value, &range), &channel) in measured.iter_mut().zip(truth).zip(channel) {
                let [bias, gain] = self.channels[usize::from(channel)];
                *value = (range * gain + bias + *value).max(0.0);
            }
        }
    }

    /// Variance, m^2, without that of the table.
    fn variance(&self, rho_eff: f32, range: f32) -> f32 {
        measure::variance(rho_eff, range, self.deviation())
    }

    /// What [`measure::variance`] needs.
    fn deviation(&self) -> [f32; 4] {
        match self.threshold.unit() {
            Some(unit) => [self.sigma, self.sigma_per_m, self.snr_sigma, unit],
            None => [self.sigma, self.sigma_per_m, 0.0, 1.0],
        }
    }

    /// Rounds measurements to the instrument's range step.
    pub fn round(&self, measured: &mut [f32]) {
        if self.step > 0.0 {
            measure::round(measured, self.step);
        }
    }
}

/// The errors of the reported azimuth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AzimuthError {
    sigma: f32,
    step: f32,
}

impl AzimuthError {
    /// None where azimuths are reported exactly.
    pub fn new(noise: &Noise) -> Option<AzimuthError> {
        let (sigma, step) = (noise.azimuth_sigma_deg.to_radians(), noise.azimuth_step_deg.to_radians());
        (sigma > 0.0 || step > 0.0).then_some(AzimuthError { sigma: sigma as f32, step: step as f32 })
    }

    /// By how much, rad, counter-clockwise, beams in the directions `x`, `y` (sensor frame) are reported off their true
    /// azimuth. `turn` holds a standard normal number for each, those of [`Draw::AzimuthJitter`].
    pub fn turn(&self, x: &[f32], y: &[f32], turn: &mut [f32]) {
        measure::scale(turn, self.sigma);
        if self.step > 0.0 {
            for ((angle, x), y) in turn.iter_mut().zip(x).zip(y) {
                let azimuth = y.atan2(*x);
                *angle = ((azimuth + *angle) / self.step).round_ties_even() * self.step - azimuth;
            }
        }
    }
}

impl Noise {
    /// Checks that all values are within their allowed ranges, and that the ranges of its table rise.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        for (name, value, least, most) in [
            ("range_offset_m", self.range_offset_m, -FARTHEST_M, FARTHEST_M),
            ("range_offset_percent", self.range_offset_percent, -100.0, 1000.0),
            ("range_mean_m", self.range_mean_m, -FARTHEST_M, FARTHEST_M),
            ("range_sigma_m", self.range_sigma_m, 0.0, FARTHEST_M),
            ("range_sigma_per_m", self.range_sigma_per_m, 0.0, 1.0),
            ("range_snr_sigma_m", self.range_snr_sigma_m, 0.0, FARTHEST_M),
            ("intensity_percent", self.intensity_percent, 0.0, 1000.0),
            ("intensity_snr_percent", self.intensity_snr_percent, 0.0, 1000.0),
            ("channel_bias_sigma_m", self.channel_bias_sigma_m, 0.0, FARTHEST_M),
            ("channel_gain_sigma", self.channel_gain_sigma, 0.0, 1.0),
            ("instrument", self.instrument.into(), 0.0, u32::MAX.into()),
            ("temperature_m_per_k", self.temperature_m_per_k, -1000.0, 1000.0),
            ("temperature_offset_k", self.temperature_offset_k, -1000.0, 1000.0),
            ("azimuth_sigma_deg", self.azimuth_sigma_deg, 0.0, 10.0),
            ("encoder_scale_ppm", self.encoder_scale_ppm, -1e5, 1e5),
            ("pointing_sigma_deg", self.pointing_sigma_deg, 0.0, 10.0),
            ("time_sigma_us", self.time_sigma_us, 0.0, 1e9),
            ("dropout", self.dropout, 0.0, 1.0),
        ] {
            bounds.within(format_args!("noise.{name}"), value, least, most)?;
        }
        let (finest, steps) = (1e-4, "0, or 0.0001 to 10");
        bounds.number("noise.azimuth_step_deg", self.azimuth_step_deg, [0.0, 10.0], steps)?;
        if self.azimuth_step_deg > 0.0 && self.azimuth_step_deg < finest {
            return Err(Error::invalid("noise.azimuth_step_deg", self.azimuth_step_deg, steps));
        }
        if !self.range_table.is_empty() {
            check_rows("noise.range_table", self.range_table.len())?;
        }
        for (index, point) in self.range_table.iter().enumerate() {
            let key = |name: &str| format!("noise.range_table[{index}].{name}");
            bounds.within(key("at_m"), point.at_m, 0.0, FARTHEST_M)?;
            bounds.within(key("mean_m"), point.mean_m, -FARTHEST_M, FARTHEST_M)?;
            bounds.within(key("sigma_m"), point.sigma_m, 0.0, FARTHEST_M)?;
        }
        rising_rows(bounds, "noise.range_table", self.range_table.iter().map(|point| point.at_m))?;
        if let Some(WeakDropout { below, at_zero }) = self.dropout_weak {
            bounds.number("noise.dropout_weak.below", below, [ABOVE_ZERO, 1000.0], "above 0, at most 1000")?;
            bounds.within("noise.dropout_weak.at_zero", at_zero, 0.0, 1.0)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Detection;
    use super::*;
    use crate::echo::{Pulse, PulseShape};
    use ground::units::SPEED_OF_LIGHT;

    fn measure(noise: &Noise, step: f64, detection: &Detection, rho_eff: f32, truth: f32, count: usize) -> Vec<f64> {
        let error = RangeError::new(noise, step, 1, 0.0, Threshold::new(detection, (905.0, 5.0), false));
        let mut measured = vec![0.0; count];
        let beams: Vec<u32> = (0..count as u32).collect();
        Rng::new(5, 0).normals(&beams, &vec![0; count], Draw::RangeJitter, &mut measured);
        error.measure(&vec![0; count], &vec![rho_eff; count], &vec![truth; count], &mut measured);
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
        let measured = measure(&noise, 0.0, &Detection::None, 0.5, 10.0, 3);
        assert!(measured.iter().all(|r| (r - 10.5).abs() < 1e-6), "{measured:?}");
    }

    #[test]
    fn gaussian_noise_has_its_mean_and_sigma() {
        let noise = Noise { range_mean_m: 0.1, range_sigma_m: 0.03, ..Noise::default() };
        let sample = measure(&noise, 0.0, &Detection::None, 0.5, 20.0, 100_000);
        let (mean, sigma) = mean_and_sigma(&sample);
        let error = 0.03 / (sample.len() as f64).sqrt();
        // Three standard errors.
        assert!((mean - 20.1).abs() < 3.0 * error, "mean {mean}");
        assert!((sigma - 0.03).abs() < 3.0 * error / 2f64.sqrt(), "sigma {sigma}");
    }

    #[test]
    fn timing_noise_falls_with_the_signal() {
        let noise = Noise { range_snr_sigma_m: 0.08, ..Noise::default() };
        let radar = Detection::RadarEquation { reflectance: 0.8, at_m: 100.0 };
        // At the threshold itself, and at a quarter of the range: 16 times the signal.
        for (range, expected) in [(100.0, 0.08), (25.0, 0.005)] {
            let (_, sigma) = mean_and_sigma(&measure(&noise, 0.0, &radar, 0.8, range, 100_000));
            assert!((sigma / expected - 1.0).abs() < 3.0 / 2e5f64.sqrt(), "{sigma} at {range} m");
        }
    }

    #[test]
    fn ranges_are_rounded_to_the_step() {
        let noise = Noise { range_sigma_m: 0.03, ..Noise::default() };
        for r in measure(&noise, 0.004, &Detection::None, 0.5, 20.0, 1000) {
            assert!((r / 0.004 - (r / 0.004).round()).abs() < 1e-3, "{r}");
        }
        assert_eq!(measure(&Noise::default(), 0.5, &Detection::None, 0.5, 20.2, 1), [20.0]);
    }

    #[test]
    fn no_range_is_negative() {
        let noise = Noise { range_offset_m: -3.0, ..Noise::default() };
        assert_eq!(measure(&noise, 0.0, &Detection::None, 0.5, 1.0, 1), [0.0]);
    }
    /// UTM-30LX after Friedman 2013, as in Blensor: range, mean, three sigma, m.
    #[test]
    fn a_table_has_mean_and_sigma_by_range() {
        let rows = [(2.0, 0.0114, 0.028), (10.5, 0.007_35, 0.0525), (30.0, 0.0009, 0.195)];
        let point = |(at_m, mean_m, three)| RangePoint { at_m, mean_m, sigma_m: three / 3.0 };
        let noise = Noise { range_table: rows.map(point).to_vec(), ..Noise::default() };
        let between = (20.25, (0.007_35 + 0.0009) / 2.0, (0.0525 + 0.195) / 2.0);
        for (range, mean, three) in rows.into_iter().chain([between, (1.0, 0.0114, 0.028), (50.0, 0.0009, 0.195)]) {
            let sample = measure(&noise, 0.0, &Detection::None, 0.5, range as f32, 100_000);
            let (found, sigma) = mean_and_sigma(&sample);
            // Three standard errors, plus the rounding of ranges in single precision.
            let error = 3.0 * three / 3.0 / (sample.len() as f64).sqrt() + 1e-6;
            assert!((found - range - mean).abs() < error, "{found} at {range} m");
            assert!((sigma - three / 3.0).abs() < error, "{sigma} at {range} m");
        }
    }

    /// RGL's form: base + rise R; added in quadrature to the error that depends on the signal.
    #[test]
    fn noise_may_grow_with_range() {
        let noise =
            Noise { range_sigma_m: 0.01, range_sigma_per_m: 0.002, range_snr_sigma_m: 0.03, ..Noise::default() };
        let radar = Detection::RadarEquation { reflectance: 0.5, at_m: 20.0 };
        for (detection, range, expected) in
            [(&Detection::None, 20.0, 0.05), (&Detection::None, 5.0, 0.02), (&radar, 20.0, 0.05f64.hypot(0.03))]
        {
            let (_, sigma) = mean_and_sigma(&measure(&noise, 0.0, detection, 0.5, range, 100_000));
            assert!((sigma / expected - 1.0).abs() < 3.0 / 2e5f64.sqrt(), "{sigma} {expected}");
        }
    }

    /// The Cramer-Rao bound of a Gaussian pulse of 5 ns, computed with numpy: 0.0450109 m at SNR 10, a tenth of it at
    /// 100.
    #[test]
    fn the_timing_of_a_pulse_has_a_bound() {
        let bound = |snr: f64| 2f64.sqrt() * Pulse::new(PulseShape::Gaussian, 5.0).sigma() / snr;
        assert!((bound(10.0) - 0.045_010_9).abs() < 5e-8 && (bound(100.0) - 4.501_10e-3).abs() < 1e-8);
        // An instrument whose threshold is at SNR 10.
        let noise = Noise { range_snr_sigma_m: bound(10.0), ..Noise::default() };
        let radar = Detection::RadarEquation { reflectance: 0.05, at_m: 20.0 };
        let (_, sigma) = mean_and_sigma(&measure(&noise, 0.0, &radar, 0.5, 20.0, 100_000));
        assert!((sigma / 4.501_10e-3 - 1.0).abs() < 3.0 / 2e5f64.sqrt(), "{sigma}");
    }

    /// Echoes of 5 ns at 2, 10 and 100 times the threshold: how much earlier their leading edge is, m. Computed with
    /// numpy.
    #[test]
    fn edges_walk_with_the_strength_of_an_echo() {
        let sigma = Pulse::new(PulseShape::Gaussian, 5.0).sigma();
        let radar = Detection::RadarEquation { reflectance: 0.005, at_m: 2.0 };
        let error = RangeError::new(&Noise::default(), 0.0, 1, sigma, Threshold::new(&radar, (905.0, 5.0), false));
        for (over, expected) in [(0.5, 0.0), (1.0, 0.0), (2.0, 0.374_741), (10.0, 0.683_008), (100.0, 0.965_919)] {
            let mut measured = [0.0];
            error.measure(&[0], &[over * 0.005], &[2.0], &mut measured);
            assert!((measured[0] - (2.0 - expected)).abs() < 1e-6, "{over}: {measured:?}");
        }
    }

    /// c/2 x 6.8 ns = 1.01929 m over 40 K, as in Gao et al. 2018.
    #[test]
    fn a_warm_instrument_measures_more() {
        assert!((SPEED_OF_LIGHT / 2.0 * 6.8e-9 - 1.019_29).abs() < 5e-6);
        let noise = Noise { temperature_m_per_k: 0.0255, temperature_offset_k: 40.0, ..Noise::default() };
        assert!((measure(&noise, 0.0, &Detection::None, 0.5, 10.0, 1)[0] - 11.02).abs() < 1e-6);
        let noise = Noise { temperature_offset_k: 40.0, ..Noise::default() };
        assert_eq!(measure(&noise, 0.0, &Detection::None, 0.5, 10.0, 1), [10.0]);
    }

    /// Drawn once: the same channel errors in all scans of an instrument, different ones in another.
    #[test]
    fn channels_have_errors_of_their_own() {
        let channels = 4096;
        let all: Vec<u16> = (0..channels as u16).collect();
        let error = |instrument| {
            let noise = Noise {
                range_offset_m: 0.5,
                channel_bias_sigma_m: 0.04,
                channel_gain_sigma: 0.002,
                instrument,
                ..Noise::default()
            };
            let error = RangeError::new(&noise, 0.0, channels, 0.0, Threshold::Open);
            assert!(!error.draws());
            [0.0, 50.0].map(|range| {
                let mut measured = vec![7.0; channels];
                error.measure(&all, &vec![0.5; channels], &vec![range; channels], &mut measured);
                measured.into_iter().map(|measured| f64::from(measured - range)).collect::<Vec<_>>()
            })
        };
        let [near, far] = error(1);
        for (sample, expected) in [(&near, 0.04), (&far, 0.04f64.hypot(0.1))] {
            let (mean, sigma) = mean_and_sigma(sample);
            let limit = 3.0 * expected / (channels as f64).sqrt();
            assert!((mean - 0.5).abs() < limit && (sigma - expected).abs() < limit / 2f64.sqrt(), "{mean} {sigma}");
        }
        assert_eq!(error(1), [near.clone(), far]);
        let other = &error(2)[0];
        let product: f64 = near.iter().zip(other).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum::<f64>() / channels as f64;
        assert!(product.abs() < 3.0 * 0.04 * 0.04 / (channels as f64).sqrt(), "{product}");
    }

    /// The simulator's defaults: 0.4 of the weakest, none from 0.8 on.
    #[test]
    fn weak_returns_get_lost() {
        let weak = WeakDropout { below: 0.8, at_zero: 0.4 };
        for (rho_eff, expected) in [(0.0, 0.4), (0.2, 0.3), (0.4, 0.2), (0.8, 0.0), (5.0, 0.0)] {
            assert!((weak.probability(rho_eff) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn azimuths_are_steps_of_the_encoder() {
        let noise = Noise { azimuth_step_deg: 0.25, ..Noise::default() };
        let azimuths = [0.1f32, 0.2, -0.1, 179.9, -179.9, 90.13].map(f32::to_radians);
        let mut turn = [3.0; 6];
        AzimuthError::new(&noise).unwrap().turn(&azimuths.map(f32::cos), &azimuths.map(f32::sin), &mut turn);
        for ((azimuth, turn), expected) in azimuths.into_iter().zip(turn).zip([0.0, 0.25, 0.0, 180.0, -180.0, 90.25]) {
            assert!(((azimuth + turn).to_degrees() - expected).abs() < 1e-4, "{azimuth} {turn}");
        }
        assert!(AzimuthError::new(&Noise::default()).is_none());
    }
}
