//! Windows that samples are weighted with before the Fourier transform.

use ground::error::Result;
use ground::read::bounds::Bounds;
use num_complex::Complex64;
use rustfft::FftPlannerScalar;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::fmt::Display;

/// A window, as written in a file: a word, or `chebyshev` or `taylor` with their keys. Symmetric: `w[n] = w[N - 1 - n]`,
/// as SciPy's with `sym=True`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum FftWindow {
    /// All samples alike.
    Rect,
    /// Highest side lobe -31.5 dB, falling by 18 dB per octave.
    #[default]
    Hann,
    /// Highest side lobe -42.7 dB, falling by 6 dB per octave.
    Hamming,
    /// Highest side lobe -58.1 dB, falling by 18 dB per octave.
    Blackman,
    /// Highest side lobe -92 dB.
    BlackmanHarris,
    /// All side lobes alike (Dolph 1946).
    Chebyshev {
        /// By how much they are below the main lobe, dB, 20 to 120.
        sidelobe_db: f64,
    },
    /// The nearest side lobes alike, the others falling (Taylor 1955).
    Taylor {
        /// How many side lobes, the main lobe included, are alike, 2 to 20.
        nbar: u32,
        /// By how much they are below the main lobe, dB, 20 to 80.
        sidelobe_db: f64,
    },
}

impl FftWindow {
    /// Checks that its numbers, at `key`, are within their allowed ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn check(&self, key: impl Display, bounds: &mut Bounds) -> Result<()> {
        match *self {
            FftWindow::Chebyshev { sidelobe_db } => {
                bounds.within(format_args!("{key}.chebyshev.sidelobe_db"), sidelobe_db, 20.0, 120.0)
            }
            FftWindow::Taylor { nbar, sidelobe_db } => {
                bounds.within(format_args!("{key}.taylor.nbar"), f64::from(nbar), 2.0, 20.0)?;
                bounds.within(format_args!("{key}.taylor.sidelobe_db"), sidelobe_db, 20.0, 80.0)
            }
            _ => Ok(()),
        }
    }

    /// Its `count` samples; the greatest is 1 if `count` is odd.
    pub fn samples(&self, count: usize) -> Vec<f64> {
        match *self {
            _ if count < 2 => vec![1.0; count],
            FftWindow::Rect => vec![1.0; count],
            FftWindow::Hann => cosines(count, &[0.5, 0.5]),
            FftWindow::Hamming => cosines(count, &[0.54, 0.46]),
            FftWindow::Blackman => cosines(count, &[0.42, 0.5, 0.08]),
            FftWindow::BlackmanHarris => cosines(count, &[0.358_75, 0.488_29, 0.141_28, 0.011_68]),
            FftWindow::Chebyshev { sidelobe_db } => chebyshev(count, sidelobe_db),
            FftWindow::Taylor { nbar, sidelobe_db } => taylor(count, nbar, sidelobe_db),
        }
    }
}

/// Sum of `(-1)^i a_i cos(2 pi i n / (N - 1))` (Harris 1978, equation 31).
fn cosines(count: usize, terms: &[f64]) -> Vec<f64> {
    let value = |n: usize| {
        let angle = TAU * n as f64 / (count - 1) as f64;
        let signed = |(i, term): (usize, &f64)| if i % 2 == 0 { *term } else { -term } * (i as f64 * angle).cos();
        terms.iter().enumerate().map(signed).sum::<f64>()
    };
    // Rounding must not turn the zeros at the ends into negative numbers.
    (0..count).map(|n| value(n).max(0.0)).collect()
}

/// `w[n]` is the transform of `T(beta cos(pi k / N))`, where `T` is the Chebyshev polynomial of the order `N - 1`, and
/// `beta = cosh(arcosh(10^(dB / 20)) / (N - 1))` (Dolph 1946).
fn chebyshev(count: usize, sidelobe_db: f64) -> Vec<f64> {
    let order = (count - 1) as f64;
    let beta = (10f64.powf(sidelobe_db / 20.0).acosh() / order).cosh();
    let polynomial = |x: f64| {
        let odd = if count.is_multiple_of(2) { -1.0 } else { 1.0 };
        match x {
            _ if x > 1.0 => (order * x.acosh()).cosh(),
            _ if x < -1.0 => odd * (order * (-x).acosh()).cosh(),
            _ => (order * x.acos()).cos(),
        }
    };
    // About the middle of the samples: k counts from there on, too.
    let middle = 0.5 * order;
    let mut bins: Vec<Complex64> = (0..count)
        .map(|k| {
            let step = k as f64 / count as f64;
            Complex64::from_polar(polynomial(beta * (PI * step).cos()), -TAU * step * middle)
        })
        .collect();
    FftPlannerScalar::new().plan_fft_inverse(count).process(&mut bins);
    let greatest = bins.iter().map(|bin| bin.re).fold(f64::MIN_POSITIVE, f64::max);
    bins.iter().map(|bin| bin.re / greatest).collect()
}

/// `w[n] = 1 + 2 sum of F_m cos(2 pi m (n - (N - 1) / 2) / N)` (Carrara, Goodman, Majewski 1995, appendix D.2).
fn taylor(count: usize, nbar: u32, sidelobe_db: f64) -> Vec<f64> {
    let a = 10f64.powf(sidelobe_db / 20.0).acosh() / PI;
    let n = f64::from(nbar);
    let spread = n * n / (a * a + (n - 0.5) * (n - 0.5));
    let factor = |m: f64| {
        let (mut above, mut below) = (if m % 2.0 == 1.0 { 1.0 } else { -1.0 }, 2.0);
        for i in (1..nbar).map(f64::from) {
            above *= 1.0 - m * m / spread / (a * a + (i - 0.5) * (i - 0.5));
            below *= if i == m { 1.0 } else { 1.0 - m * m / (i * i) };
        }
        above / below
    };
    let factors: Vec<f64> = (1..nbar).map(|m| factor(f64::from(m))).collect();
    let at = |place: f64| {
        let terms = factors.iter().zip(1..).map(|(f, m)| f * (TAU * f64::from(m) * place / count as f64).cos());
        1.0 + 2.0 * terms.sum::<f64>()
    };
    let middle = 0.5 * (count - 1) as f64;
    (0..count).map(|n| at(n as f64 - middle) / at(0.0)).collect()
}

/// Mean of the samples: how much of the amplitude of a wave remains.
pub fn coherent_gain(samples: &[f64]) -> f64 {
    samples.iter().sum::<f64>() / samples.len() as f64
}

/// Equivalent noise bandwidth in cells, `N sum of w^2 / (sum of w)^2` (Harris 1978, equation 11).
pub fn noise_bandwidth(samples: &[f64]) -> f64 {
    let sum = samples.iter().sum::<f64>();
    samples.len() as f64 * samples.iter().map(|w| w * w).sum::<f64>() / (sum * sum)
}

/// The transform `offset` cells from its middle, relative to there, about the middle of the samples, which makes it
/// real: `sum of w[n] cos(2 pi offset (n - (N - 1) / 2) / N) / sum of w`.
pub fn transform(samples: &[f64], offset: f64) -> f64 {
    let (count, middle) = (samples.len() as f64, 0.5 * (samples.len() as f64 - 1.0));
    let part = |(n, w): (usize, &f64)| w * (TAU * offset * (n as f64 - middle) / count).cos();
    samples.iter().enumerate().map(part).sum::<f64>() / samples.iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHEBYSHEV_60: FftWindow = FftWindow::Chebyshev { sidelobe_db: 60.0 };
    const TAYLOR: FftWindow = FftWindow::Taylor { nbar: 4, sidelobe_db: 35.0 };
    const ALL: [FftWindow; 7] = [
        FftWindow::Rect,
        FftWindow::Hann,
        FftWindow::Hamming,
        FftWindow::Blackman,
        FftWindow::BlackmanHarris,
        CHEBYSHEV_60,
        TAYLOR,
    ];

    /// `scipy.signal.get_window(name, 8 or 9, fftbins=False)` of SciPy 1.16, the first half.
    #[test]
    fn samples_are_those_of_scipy() {
        let cases: [(FftWindow, &[f64], &[f64]); 6] = [
            (FftWindow::Hann, &[0.0, 0.1882551, 0.61126047, 0.95048443], &[0.0, 0.14644661, 0.5, 0.85355339, 1.0]),
            (
                FftWindow::Hamming,
                &[0.08, 0.25319469, 0.64235963, 0.95444568],
                &[0.08, 0.21473088, 0.54, 0.86526912, 1.0],
            ),
            (
                FftWindow::Blackman,
                &[0.0, 0.09045342, 0.45918296, 0.92036362],
                &[0.0, 0.06644661, 0.34, 0.77355339, 1.0],
            ),
            (
                FftWindow::BlackmanHarris,
                &[6e-05, 0.03339172, 0.3328335, 0.88936977],
                &[6e-05, 0.02173584, 0.21747, 0.69576416, 1.0],
            ),
            (
                CHEBYSHEV_60,
                &[0.06847555, 0.30321916, 0.68684662, 1.0],
                &[0.05186856, 0.22712393, 0.5379172, 0.86048444, 1.0],
            ),
            (
                TAYLOR,
                &[0.20718851, 0.46134978, 0.76808862, 0.97118449],
                &[0.19908889, 0.40966343, 0.68814935, 0.91188616, 1.0],
            ),
        ];
        for (window, even, odd) in cases {
            for (count, expected) in [(8, even), (9, odd)] {
                let samples = window.samples(count);
                for (n, expected) in expected.iter().enumerate() {
                    assert!((samples[n] - expected).abs() < 2e-8, "{window:?}[{n}] of {count}: {}", samples[n]);
                    assert!((samples[count - 1 - n] - expected).abs() < 2e-8, "{window:?} is not symmetric");
                }
            }
        }
    }

    /// Mean, noise bandwidth and transform at offsets of 0.5, 1.3, 4.7 and 100.25 cells, of 256 samples, by NumPy 2.3.
    #[test]
    fn figures_are_those_of_numpy() {
        let cases: [(FftWindow, f64, f64, [f64; 4]); 7] = [
            (
                FftWindow::Hann,
                0.498_046_875,
                1.505_882_352_9,
                [0.849_930_016_2, 0.290_382_459_7, -0.002_735_388_9, 1.021_7e-7],
            ),
            (
                FftWindow::Hamming,
                0.538_203_125,
                1.366_668_155,
                [0.818_223_585_8, 0.217_773_187_6, 0.005_820_022_8, 4.356_727_9e-4],
            ),
            (
                FftWindow::Blackman,
                0.418_359_375,
                1.733_528_967_1,
                [0.882_039_150_2, 0.410_149_441_5, -0.000_823_364, 4.376e-8],
            ),
            (
                FftWindow::BlackmanHarris,
                0.357_348_867_2,
                2.012_210_506_4,
                [0.910_005_968_4, 0.520_601_940_5, 1.856_73e-5, 5.000_5e-7],
            ),
            (
                CHEBYSHEV_60,
                0.477_581_911_3,
                1.522_094_439_9,
                [0.849_730_515_9, 0.307_070_207_9, 0.000_999_617_1, 8.846_750_5e-4],
            ),
            (
                FftWindow::Chebyshev { sidelobe_db: 80.0 },
                0.413_012_832_8,
                1.747_713_898_4,
                [0.882_986_803_4, 0.417_037_091_3, -1.164_621e-5, 8.712_703e-5],
            ),
            (
                TAYLOR,
                0.601_952_851_1,
                1.234_265_068_8,
                [0.783_135_185_6, 0.128_981_329_4, 0.012_860_923_1, 8.166_271_8e-4],
            ),
        ];
        for (window, gain, bandwidth, values) in cases {
            let samples = window.samples(256);
            assert!((coherent_gain(&samples) - gain).abs() < 1e-9, "{window:?}");
            assert!((noise_bandwidth(&samples) - bandwidth).abs() < 1e-9, "{window:?}");
            for (offset, expected) in [0.5, 1.3, 4.7, 100.25].into_iter().zip(values) {
                let found = transform(&samples, offset);
                assert!((found - expected).abs() < 1e-9, "{window:?} at {offset}: {found}");
            }
        }
    }

    /// What textbooks print for many samples (Harris 1978, table I): noise bandwidth, scalloping loss and highest side
    /// lobe, dB.
    #[test]
    fn figures_are_those_of_textbooks() {
        let cases = [
            (FftWindow::Rect, 1.0, -3.92, -13.26),
            (FftWindow::Hann, 1.5, -1.42, -31.5),
            (FftWindow::Hamming, 1.3628, -1.75, -42.7),
            (FftWindow::Blackman, 1.727, -1.10, -58.1),
            (FftWindow::BlackmanHarris, 2.0044, -0.83, -92.0),
            (CHEBYSHEV_60, 1.51, -1.44, -60.0),
        ];
        for (window, bandwidth, scalloping, lobe) in cases {
            let samples = window.samples(512);
            let level = |offset: f64| 20.0 * transform(&samples, offset).abs().max(1e-9).log10();
            assert!((noise_bandwidth(&samples) - bandwidth).abs() < 0.02, "{window:?}");
            assert!((level(0.5) - scalloping).abs() < 0.03, "{window:?}: {}", level(0.5));
            // Past the first null, where the response rises for the first time.
            let levels: Vec<f64> = (0..600).map(|step| level(0.02 * f64::from(step))).collect();
            let null = (1..599).find(|&at| levels[at + 1] > levels[at]).unwrap();
            let highest = levels[null..].iter().copied().fold(f64::MIN, f64::max);
            assert!((highest - lobe).abs() < 0.2, "{window:?}: {highest}");
        }
    }

    #[test]
    fn short_windows_are_finite() {
        for window in ALL {
            for count in [0, 1, 2, 3, 5] {
                let samples = window.samples(count);
                assert_eq!(samples.len(), count);
                assert!(samples.iter().all(|w| w.is_finite()), "{window:?} of {count}: {samples:?}");
            }
        }
    }

    #[test]
    fn files_name_windows() {
        let read =
            |text: &str| ground::read::yaml::from_str::<FftWindow>("text", text).map_err(|error| error.to_string());
        assert_eq!(read("blackman_harris"), Ok(FftWindow::BlackmanHarris));
        assert_eq!(read("chebyshev: {sidelobe_db: 60}"), Ok(CHEBYSHEV_60));
        assert!(read("chebyshev: {db: 60}").is_err() && read("hanning").is_err());
        let check = |window: FftWindow| window.check("window", &mut Bounds::none()).map_err(|error| error.to_string());
        assert_eq!(
            check(FftWindow::Taylor { nbar: 1, sidelobe_db: 30.0 }),
            Err("window.taylor.nbar is 1; allowed: 2 to 20".into())
        );
        assert!(check(FftWindow::Chebyshev { sidelobe_db: f64::NAN }).is_err());
    }
}
