//! Light of modulated power: from the echoes at a pixel to the single range that its phases give.
//!
//! The light of an echo from `R` m returns with the phase `4 pi f R / c`, and the phasors of all echoes at a pixel add:
//! at an edge the range is between those of the two surfaces, or beyond either. Phases are counted in turns.

use echocast_kernels::camera::Frequencies;
pub(crate) use echocast_kernels::camera::{MOST_FREQUENCIES, ShotNoise};
use ground::units::SPEED_OF_LIGHT;
use std::f64::consts::TAU;

/// Range at which the phase of light modulated at `frequency` Hz wraps, m: `c / (2 f)`.
pub(crate) fn ambiguity_range(frequency: f64) -> f64 {
    SPEED_OF_LIGHT / (2.0 * frequency)
}

/// The sum of phasors of echoes from `ranges` m with the amplitudes `powers`, where the phase wraps at `wrap` m: its
/// real and imaginary part, in the unit of the powers.
pub fn sum(wrap: f64, ranges: &[f32], powers: &[f32]) -> [f64; 2] {
    ranges.iter().zip(powers).fold([0.0; 2], |[re, im], (&range, &power)| {
        let (sin, cos) = (TAU * f64::from(range) / wrap).sin_cos();
        [re + f64::from(power) * cos, im + f64::from(power) * sin]
    })
}

/// Result of the phases of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Formed {
    /// One-way range, m, from 0 to the ambiguity range of all frequencies together.
    pub range: f32,
    /// Amplitude of the sum of echoes, 1/m^2, averaged over the frequencies.
    pub power: f32,
    /// Greatest difference between the ranges given by two frequencies, m.
    pub disagreement: f32,
}

/// The frequencies at which a camera's light is modulated, one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulation(pub Frequencies);

impl Modulation {
    /// `frequencies_khz`: 1 to [`MOST_FREQUENCIES`] of them, each above 0. `residual`: fraction of the error of four
    /// taps that calibration leaves, 0 to 1.
    pub fn new(frequencies_khz: &[u32], residual: f64) -> Modulation {
        let mut wraps: Vec<f64> = frequencies_khz.iter().map(|&khz| ambiguity_range(1e3 * f64::from(khz))).collect();
        wraps.sort_unstable_by(f64::total_cmp);
        Modulation(Frequencies::new(&wraps, turns(frequencies_khz), residual))
    }

    /// Standard deviation of a phase, rad, where that of the range is `sigma` m.
    pub(crate) fn phase_sigma(&self, sigma: f64) -> f64 {
        // Ranges of variance (wrap / (2 pi))^2, weighted by its inverse.
        let weights: f64 = self.0.wraps().iter().map(|wrap| wrap.powi(-2)).sum();
        TAU * sigma * weights.sqrt()
    }

    /// Result at one pixel for echoes from `ranges` m with `powers`, `rho_eff / R^2` in 1/m^2. `noise` gives the error
    /// of the phase, rad, for the index of the frequency (0 is the highest), the amplitude and the sum of the powers.
    pub fn form(&self, ranges: &[f32], powers: &[f32], noise: impl Fn(usize, f64, f64) -> f64) -> Formed {
        let offset = powers.iter().map(|&power| f64::from(power)).sum();
        let (mut phases, mut amplitudes) = ([[0.0]; MOST_FREQUENCIES], 0.0);
        for (index, &wrap) in self.0.wraps().iter().enumerate() {
            let (turns, amplitude) = match ranges {
                // A single echo keeps its range to the last bit of f64.
                [range] => (f64::from(*range) / wrap, offset),
                _ => {
                    let [re, im] = sum(wrap, ranges, powers);
                    (im.atan2(re) / TAU, re.hypot(im))
                }
            };
            phases[index] = self.0.phases(&[turns], &[noise(index, amplitude, offset)]);
            amplitudes += amplitude;
        }
        let ([range], [disagreement]) = self.0.unwrap(&phases);
        let power = (amplitudes / self.0.wraps().len() as f64) as f32;
        Formed { range: range as f32, power, disagreement: disagreement as f32 }
    }
}

/// Turns of the highest of `frequencies` until all are in phase again: that frequency over the greatest common divisor.
pub fn turns(frequencies: &[u32]) -> u32 {
    fn divisor(a: u32, b: u32) -> u32 {
        if b == 0 { a } else { divisor(b, a % b) }
    }
    let highest = frequencies.iter().copied().max().unwrap_or(1);
    highest / frequencies.iter().copied().fold(0, divisor).max(1)
}

/// Cosine to the fourth: how a lens dims the image at an angle with the cosine `cos` from its axis.
pub(crate) fn natural_vignetting(cos: f32) -> f32 {
    let square = cos * cos;
    square * square
}

#[cfg(test)]
mod tests {
    use super::*;
    use echocast_kernels::camera::wiggle;
    use ground::rng::{Draw, Rng};

    #[track_caller]
    fn assert_near(is: f64, expected: f64, tolerance: f64) {
        assert!((is - expected).abs() <= tolerance, "{is} is not {expected} +- {tolerance:e}");
    }

    fn one(khz: u32) -> Modulation {
        Modulation::new(&[khz], 0.0)
    }

    fn noiseless(_: usize, _: f64, _: f64) -> f64 {
        0.0
    }

    fn range(modulation: Modulation, ranges: &[f32], powers: &[f32]) -> f64 {
        modulation.form(ranges, powers, noiseless).range.into()
    }

    /// c / (2 f), computed with numpy; three frequencies together reach as far as their greatest common divisor, 8 MHz.
    #[test]
    fn ambiguity_ranges_are_half_a_wavelength() {
        for (mhz, expected) in [(16, 9.36851), (20, 7.49481), (80, 1.87370), (100, 1.49896), (120, 1.24914)] {
            assert_near(one(mhz * 1000).0.ambiguity_range(), expected, 5e-6);
        }
        assert_near(Modulation::new(&[16_000, 80_000, 120_000], 0.0).0.ambiguity_range(), 18.7370, 5e-5);
        assert_eq!((turns(&[16_000, 80_000, 120_000]), turns(&[20_000]), turns(&[])), (15, 1, 1));
    }

    /// Depth modulo the ambiguity range of 80 MHz, computed with numpy.
    #[test]
    fn phases_wrap() {
        assert_near(range(one(80_000), &[2.0], &[1.0]), 0.126_297, 1e-6);
        assert_near(range(one(80_000), &[5.0], &[1.0]), 1.252_594, 1e-6);
        let wrap = one(20_000).0.ambiguity_range() as f32;
        assert_near(range(one(20_000), &[wrap * 1.5], &[1.0]), f64::from(wrap) * 0.5, 1e-6);
    }

    #[test]
    fn several_frequencies_see_beyond_the_wrap_of_each() {
        let kinect = Modulation::new(&[16_000, 80_000, 120_000], 0.0);
        for step in 0..1800 {
            let truth = 0.005 + 0.0104 * step as f32;
            let formed = kinect.form(&[truth], &[0.3], noiseless);
            assert_near(formed.range.into(), truth.into(), 2e-6);
            assert_eq!(formed.power, 0.3);
            assert!(formed.disagreement < 1e-9);
        }
        // In any order.
        assert_eq!(Modulation::new(&[80_000, 16_000, 120_000], 0.0), kinect);
        assert_near(range(kinect, &[20.0], &[1.0]), 20.0 - kinect.0.ambiguity_range(), 2e-6);
    }

    /// Phase errors below about a fifteenth of a turn never select the wrong turn; then the range error is their
    /// weighted mean.
    #[test]
    fn noisy_phases_choose_the_same_turn() {
        let kinect = Modulation::new(&[16_000, 80_000, 120_000], 0.0);
        let rng = Rng::new(3, 0);
        let sigma = 0.06;
        let count = 20_000;
        let errors: Vec<f64> = (0..count)
            .map(|beam| {
                let draw = |index: usize, _: f64, _: f64| {
                    sigma * f64::from(rng.normal_pair(beam, Draw::Phase, index as u32)[0])
                };
                f64::from(kinect.form(&[4.2], &[1.0], draw).range) - f64::from(4.2f32)
            })
            .collect();
        let variance = errors.iter().map(|error| error * error).sum::<f64>() / f64::from(count);
        // The weighted mean of three independent ranges: 1 / sigma^2 = sum of 1 / (wrap sigma_phi / (2 pi))^2. A
        // variance of n normal numbers has the relative standard error sqrt(2 / n).
        let expected = sigma / kinect.phase_sigma(1.0);
        assert_near(variance.sqrt() / expected, 1.0, 3.0 / (2.0 * f64::from(count)).sqrt());
        assert!(errors.iter().all(|error| error.abs() < 6.0 * expected));
    }

    /// Sums of phasors, computed with numpy: light that also took a longer path, and pixels on an edge.
    #[test]
    fn phasors_of_echoes_add() {
        assert_near(range(one(20_000), &[2.0, 3.0], &[1.0, 0.2]), 2.155_570, 1e-6);
        assert_near(one(20_000).form(&[2.0, 3.0], &[1.0, 0.2], noiseless).power.into(), 1.143_451, 1e-6);
        assert_near(range(one(16_000), &[2.0, 3.0], &[1.0, 0.2]), 2.159_622, 1e-6);
        assert_near(range(one(16_000), &[1.0, 4.0], &[0.5, 0.5]), 2.5, 1e-6);
        assert_near(range(one(16_000), &[1.0, 4.0], &[0.5, 0.5 / 16.0]), 1.086_479, 1e-6);
        assert_near(range(one(16_000), &[1.0, 4.0], &[0.05, 0.95 / 16.0]), 2.700_480, 1e-6);
        // Several echoes at one range are one.
        assert_near(range(one(16_000), &[3.0; 4], &[0.1, 0.2, 0.3, 0.4]), 3.0, 1e-6);
    }

    #[test]
    fn frequencies_disagree_on_edges() {
        let kinect = Modulation::new(&[16_000, 80_000, 120_000], 0.0);
        assert!(kinect.form(&[1.0, 4.0], &[0.3, 0.7], noiseless).disagreement > 0.05);
        assert_eq!(one(16_000).form(&[1.0, 4.0], &[0.5, 0.5], noiseless).disagreement, 0.0);
    }

    /// Four taps of a triangle's harmonics, computed with numpy: greatest error, and at two ranges of 20 MHz light.
    #[test]
    fn wiggling_follows_the_harmonics() {
        let steps = 100_000;
        let greatest = (0..steps).map(|i| wiggle(i as f32 / steps as f32 - 0.5).abs()).fold(0.0, f32::max).into();
        assert_near(greatest, 0.071_813_5, 1e-7);
        let wrap = ambiguity_range(20e6);
        assert_near(greatest * wrap / TAU, 0.085_661_7, 1e-7);
        assert_near(wrap / 4.0, 1.873_703, 1e-6);
        let raw = Modulation::new(&[20_000], 1.0);
        assert_near(range(raw, &[0.5], &[1.0]) - 0.5, -0.085_570_6, 1e-6);
        assert_near(range(raw, &[3.3], &[1.0]) - f64::from(3.3f32), 0.083_584_8, 1e-6);
        // The error recurs every quarter of the ambiguity range, and calibration leaves a fraction of it.
        let error = |turns: f64| raw.0.phases(&[turns], &[0.0])[0] - turns;
        assert_near(error(0.07), error(0.32), 1e-12);
        let calibrated = Modulation::new(&[20_000], 0.1);
        assert_near(range(calibrated, &[0.5], &[1.0]) - 0.5, -0.008_557_06, 1e-6);
    }

    /// Shot noise of four taps with A = 1000 and B = 4000 electrons at 20 MHz, A = 1000 and B = 20,000 at 80 MHz,
    /// computed with numpy (and a simulation of the taps: 0.05337 m).
    #[test]
    fn shot_noise_is_that_of_four_taps() {
        for (mhz, background, expected) in [(20.0, 3000.0, 0.053_345_3), (80.0, 19_000.0, 0.029_820_9)] {
            let noise = ShotNoise { gain: 1000.0, background };
            assert_near(noise.sigma(1.0, 1.0) * ambiguity_range(mhz * 1e6) / TAU, expected, 1e-7);
        }
    }

    #[test]
    fn shot_noise_is_calibrated_by_one_target() {
        let noise = ShotNoise::new(0.02, 0.2, 3.0);
        assert_near(noise.sigma(0.2, 0.2), 0.02, 1e-12);
        // Without background light four times the light halves the noise; with much of it, the noise drops to a
        // quarter.
        let dark = ShotNoise::new(0.02, 0.2, 0.0);
        assert_near(dark.sigma(0.8, 0.8), 0.01, 1e-12);
        assert_near(ShotNoise::new(0.02, 0.2, 1e9).sigma(0.8, 0.8), 0.005, 1e-9);
        // Light whose phase is lost still makes noise.
        assert_near(dark.sigma(0.2, 0.8), 0.04, 1e-12);
        let modulation = one(20_000);
        assert_near(modulation.phase_sigma(0.1), 0.1 * 2.0 * TAU * 20e6 / SPEED_OF_LIGHT, 1e-12);
    }

    /// cos^4 computed with numpy; the corner of a field of view of 70 by 60 degrees, 42.2249 degrees off, is (1 + tan^2
    /// 35 + tan^2 30)^-2.
    #[test]
    fn lenses_dim_with_the_fourth_power_of_the_cosine() {
        for (angle, expected) in [(30.0f64, 0.562_5), (35.0, 0.450_255), (42.224_9, 0.300_697)] {
            assert_near(natural_vignetting(angle.to_radians().cos() as f32).into(), expected, 5e-5);
        }
    }
}
