//! What one path leaves in the cells along one axis of a cube: the transform of the window.

use super::cfar::LAGS;
use rustfft::{FftPlannerScalar, num_complex::Complex64};

/// Steps of the tables per cell.
const STEPS: usize = 32;

/// Least power of a table, relative to the peak: below what single precision holds beside it.
const LEAST: f32 = 1e-20;

/// Response along one axis of a cube to a path, as powers relative to a path in the middle of the cell.
#[derive(Clone, Debug)]
pub struct WindowResponse {
    /// By distance from the path, in steps of a cell, up to half the period.
    table: Vec<f32>,
    /// Cells after which it repeats.
    period: f32,
    /// Distance of the first minimum, cells.
    null: f32,
    /// Standard error of the place of a path in a cell whose signal-to-noise ratio is 1, cells.
    error: f32,
    /// How much alike the noise of cells is, by distance.
    alike: [f32; LAGS],
    /// Where three cells have their maximum by a parabola, for paths in steps from the middle of a cell outwards.
    parabola: Vec<f32>,
}

/// The place and the power of a maximum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellPeak {
    /// From the middle of its cell, cells, -0.5 to 0.5.
    pub offset: f32,
    /// Power of the path over that of the cell, 1 or more.
    pub gain: f32,
}

impl WindowResponse {
    /// Of samples or chirps with the window `weights`, transformed to `transform` cells, of which an axis may have
    /// fewer. Without weights, of one cell that tells nothing about place.
    pub fn new(weights: &[f64], transform: usize) -> Self {
        let transform = transform.max(weights.len()).max(1);
        let mut spectrum = vec![Complex64::default(); transform * STEPS];
        spectrum.iter_mut().zip(weights).for_each(|(bin, &weight)| bin.re = weight);
        FftPlannerScalar::new().plan_fft_forward(spectrum.len()).process(&mut spectrum);
        let peak = spectrum[0].norm_sqr();
        let half = transform * STEPS / 2;
        let relative = |bin: &Complex64| if peak > 0.0 { ((bin.norm_sqr() / peak) as f32).max(LEAST) } else { 1.0 };
        let table: Vec<f32> = spectrum[..=half].iter().map(relative).collect();
        let null = table.windows(2).position(|pair| pair[1] > pair[0]).unwrap_or(half);
        let mut response = WindowResponse {
            table,
            period: transform as f32,
            null: null as f32 / STEPS as f32,
            error: error(weights) * transform as f32 / weights.len().max(1) as f32,
            alike: alike(weights, transform),
            parabola: Vec::new(),
        };
        response.parabola = (0..=STEPS / 2)
            .map(|step| {
                let at = step as f32 / STEPS as f32;
                vertex([-1.0, 0.0, 1.0].map(|cell: f32| response.power(cell - at)), 0.5)
            })
            .collect();
        response
    }

    /// Cells after which the response repeats: the length of the transform.
    pub fn period(&self) -> f32 {
        self.period
    }

    /// The distance `cells` from a path, or from the nearest of its images.
    pub fn nearest(&self, cells: f32) -> f32 {
        /// The nearest whole number is in the lower bits of a sum with it.
        const UNIT: f32 = 1.5 * (1 << 23) as f32;
        let periods = (cells / self.period).clamp(-1e6, 1e6);
        (cells - self.period * ((periods + UNIT) - UNIT)).abs()
    }

    /// Power at a distance of `cells` from the path.
    pub fn power(&self, cells: f32) -> f32 {
        let place = self.nearest(cells) * STEPS as f32;
        let step = (place as usize).min(self.table.len() - 1);
        let next = (step + 1).min(self.table.len() - 1);
        self.table[step] + (place - step as f32) * (self.table[next] - self.table[step])
    }

    /// Distance from a path to the edge of its main lobe, cells.
    pub fn null(&self) -> f32 {
        self.null
    }

    /// Standard error, in cells, of the place of a path in a cell of signal-to-noise ratio `snr` (a ratio of powers):
    /// the least that is possible with this window, for samples without one 0.38985 / sqrt(snr) of a bin.
    pub fn error(&self, snr: f32) -> f32 {
        self.error / snr.sqrt()
    }

    /// How much alike white noise is in cells 1, 2, 3... apart: see [`CfarAxis::alike`](super::CfarAxis::alike).
    pub fn alike(&self) -> [f32; LAGS] {
        self.alike
    }

    /// The maximum of three neighbouring cells of which the one in the middle is the strongest: a parabola through their
    /// logarithms, corrected by what it does with this window. If
    /// noise makes another one stronger, the maximum is between them.
    pub fn peak(&self, powers: [f32; 3]) -> CellPeak {
        let found = vertex(powers, 0.5);
        let next = self.parabola.partition_point(|&at| at < found.abs()).clamp(1, self.parabola.len() - 1);
        let (low, high) = (self.parabola[next - 1], self.parabola[next]);
        let part = if high > low { (found.abs() - low) / (high - low) } else { 0.0 };
        let offset = (((next - 1) as f32 + part) / STEPS as f32).clamp(0.0, 0.5) * found.signum();
        CellPeak { offset, gain: 1.0 / self.power(offset) }
    }
}

/// Standard error, in bins, of the frequency of a sinusoid in noise at a signal-to-noise ratio of 1 in its bin, found as
/// the maximum of the windowed transform.
///
/// The phase error of each sample, weighted by its distance t from the middle, gives (Rife and Boorstyn 1974,
/// "Single-tone parameter estimation from discrete-time observations", for windows; w: weights)
///
/// ```text
/// variance = (sum w)^2 / sum w^2 * sum w^2 t^2 / (sum w t^2)^2 / (2 SNR)   rad^2 per sample^2,
/// ```
///
/// without a window sqrt(6) / (2 pi) bins.
fn error(weights: &[f64]) -> f32 {
    let middle = 0.5 * (weights.len() as f64 - 1.0);
    let sum = |value: &dyn Fn(f64, f64) -> f64| -> f64 {
        weights.iter().enumerate().map(|(n, &w)| value(w, n as f64 - middle)).sum()
    };
    let spread = sum(&|w, t| w * t * t);
    if spread <= 0.0 {
        return f32::INFINITY;
    }
    let variance = 0.5 * sum(&|w, _| w).powi(2) / sum(&|w, _| w * w) * sum(&|w, t| w * w * t * t) / spread.powi(2);
    (variance.sqrt() * weights.len() as f64 / std::f64::consts::TAU) as f32
}

/// Squared magnitudes of the correlation of the noise of cells: `|sum w^2 e^(-2 pi i k n / N)|^2 / (sum w^2)^2`, k cells
/// apart.
fn alike(weights: &[f64], transform: usize) -> [f32; LAGS] {
    let sum = |cells: usize| -> Complex64 {
        let turn = -std::f64::consts::TAU * cells as f64 / transform as f64;
        weights.iter().enumerate().map(|(n, weight)| Complex64::from_polar(weight * weight, turn * n as f64)).sum()
    };
    let whole = sum(0).norm_sqr();
    // A rounding error is no likeness.
    let part = |cells: usize| if whole > 0.0 { (sum(cells).norm_sqr() / whole) as f32 } else { 0.0 };
    std::array::from_fn(|cells| part(cells + 1)).map(|part| if part > 1e-6 { part } else { 0.0 })
}

/// Where a parabola through the logarithms of three powers has its maximum, steps from the middle one, at most `most`.
pub(super) fn vertex(powers: [f32; 3], most: f32) -> f32 {
    let least = (powers[1] * LEAST).max(f32::MIN_POSITIVE);
    let [before, at, after] = powers.map(|power| power.max(least).ln());
    let bend = before - 2.0 * at + after;
    if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-most, most) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::rng::{Draw, Rng};
    use std::f64::consts::TAU;

    fn hann(len: usize) -> Vec<f64> {
        (0..len).map(|n| 0.5 - 0.5 * (TAU * n as f64 / len as f64).cos()).collect()
    }

    /// Powers of the cells around that of a path at `at` cells from the middle of cell 0.
    fn cells(weights: &[f64], transform: usize, at: f64, noise: &[[f32; 2]]) -> [f32; 3] {
        [-1.0, 0.0, 1.0].map(|cell| {
            let mut sum = Complex64::default();
            for (n, &weight) in weights.iter().enumerate() {
                let turns = |place: f64| Complex64::from_polar(1.0, TAU * place * n as f64 / transform as f64);
                let [re, im] = noise.get(n).copied().unwrap_or_default();
                sum += weight * (turns(at) + Complex64::new(re.into(), im.into())) * turns(-cell);
            }
            sum.norm_sqr() as f32
        })
    }

    #[test]
    fn responses_are_those_of_textbooks() {
        // Harris 1978, "On the use of windows for harmonic analysis": scalloping loss -3.92 and -1.42 dB, main lobes 1
        // and 2 bins to the null.
        for (weights, scallop, null) in [(vec![1.0; 256], -3.92, 1.0), (hann(256), -1.42, 2.0)] {
            let response = WindowResponse::new(&weights, 256);
            assert_eq!(response.power(0.0), 1.0);
            assert!((10.0 * response.power(0.5).log10() - scallop).abs() < 0.006);
            assert_eq!(response.null(), null);
            assert!((response.power(-3.4) - response.power(256.0 - 3.4)).abs() < 1e-5);
        }
        let bound = WindowResponse::new(&[1.0; 256], 256).error(1.0);
        assert!((bound - 0.38985).abs() < 1e-5);
        let alike = WindowResponse::new(&hann(256), 256).alike();
        assert!((alike[0] - 4.0 / 9.0).abs() < 1e-6 && (alike[1] - 1.0 / 36.0).abs() < 1e-6 && alike[2] == 0.0);
        let padded = WindowResponse::new(&[1.0; 256], 512).error(1.0);
        assert!((padded - 2.0 * bound).abs() < 1e-6);
    }

    #[test]
    fn peaks_are_unbiased_and_have_the_power_of_the_path() {
        for (weights, transform) in [(vec![1.0; 64], 64), (hann(64), 64), (hann(50), 64), (vec![1.0; 40], 64)] {
            let response = WindowResponse::new(&weights, transform);
            let whole = weights.iter().sum::<f64>().powi(2) as f32;
            for step in -10..=10 {
                let at = 0.05 * f64::from(step);
                let powers = cells(&weights, transform, at, &[]);
                let peak = response.peak(powers);
                assert!((f64::from(peak.offset) - at).abs() < 2e-3, "{peak:?} at {at}");
                assert!((peak.gain * powers[1] / whole - 1.0).abs() < 5e-3, "{peak:?} at {at}");
            }
        }
    }

    /// Three cells know nearly as much as all: within 1.3 times the bound of the window.
    #[test]
    fn errors_of_peaks_are_near_the_bound() {
        let weights = hann(64);
        let response = WindowResponse::new(&weights, 64);
        let snr = 100.0;
        // White noise that has this ratio to a path in the middle of a cell.
        let power: f64 = weights.iter().map(|weight| weight * weight).sum();
        let scale = (weights.iter().sum::<f64>().powi(2) / power / f64::from(snr)).sqrt() as f32;
        let (mut re, mut im) = ([0.0; 64], [0.0; 64]);
        let (mut sum, mut gain, draws) = (0.0, 0.0, 2000);
        for draw in 0..draws {
            let rng = Rng::new(5, draw);
            rng.cell_phasors(0, Draw::RadarNoise, &mut re, &mut im);
            let noise: Vec<_> = re.iter().zip(im).map(|(re, im)| [scale * re, scale * im]).collect();
            let at = rng.uniform_at([draw, 0, 0], Draw::RadarJitter) - 0.5;
            let peak = response.peak(cells(&weights, 64, at.into(), &noise));
            sum += (peak.offset - at).powi(2);
            gain += 1.0 / peak.gain;
        }
        let (found, bound) = ((sum / draws as f32).sqrt(), response.error(snr));
        println!("Hann, 20 dB: {:.2} times the bound", found / bound);
        assert!(found > bound && found < 1.35 * bound, "{found}, bound {bound}, mean loss {}", gain / draws as f32);
    }

    #[test]
    fn nothing_is_refused_that_a_cube_may_have() {
        for weights in [&[][..], &[1.0], &[0.0; 8], &[1.0, 1.0]] {
            let response = WindowResponse::new(weights, weights.len());
            for powers in [[0.0; 3], [1.0; 3], [f32::INFINITY; 3], [0.0, 1.0, 0.0], [1e-30, 1e-30, 0.0]] {
                let peak = response.peak(powers);
                assert!(peak.offset.abs() <= 0.5 && peak.gain >= 1.0, "{weights:?}: {powers:?} gives {peak:?}");
            }
        }
    }
}
