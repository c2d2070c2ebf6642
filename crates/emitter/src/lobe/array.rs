//! The array factor of elements in a row.

use super::{Array, Shading};
use std::f64::consts::PI;

/// The array factor, `sum of w_n e^(i k d n u) / sum of w_n` about its middle, in closed form.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Factor {
    elements: f64,
    /// From element to element, wavelengths.
    pitch: f64,
    weights: Weights,
}

#[derive(Clone, Debug, PartialEq)]
enum Weights {
    Uniform,
    /// `share`: the sum of the weights over N.
    Hamming {
        share: f64,
    },
    /// `x0`: where the polynomial reaches the height 1 / `lowest`.
    Chebyshev {
        x0: f64,
        lowest: f64,
    },
}

impl Factor {
    pub fn new(array: &Array, wavelength_m: f64) -> Factor {
        let elements = f64::from(array.elements);
        let weights = match array.shading {
            Shading::Uniform => Weights::Uniform,
            Shading::Hamming => Weights::Hamming { share: hamming(elements, 0.0) },
            Shading::Chebyshev { sidelobe_db } => {
                let ratio = 10f64.powf(sidelobe_db / 20.0);
                Weights::Chebyshev { x0: (ratio.acosh() / (elements - 1.0)).cosh(), lowest: ratio.recip() }
            }
        };
        Factor { elements, pitch: array.pitch_m / wavelength_m, weights }
    }

    /// Length, wavelengths.
    pub fn length(&self) -> f64 {
        self.elements * self.pitch
    }

    /// u from one main lobe to the next.
    pub fn spacing(&self) -> f64 {
        self.pitch.recip()
    }

    /// Signed amplitude at u, 1 at 0.
    pub fn amplitude(&self, u: f64) -> f64 {
        let phase = 2.0 * PI * self.pitch * u;
        match self.weights {
            Weights::Uniform => dirichlet(self.elements, phase),
            Weights::Hamming { share } => hamming(self.elements, phase) / share,
            // Dolph, Proc. IRE 34, 335 (1946): T_(N-1)(x0 cos(phase / 2)) / T_(N-1)(x0).
            Weights::Chebyshev { x0, lowest } => chebyshev(self.elements - 1.0, x0 * (0.5 * phase).cos()) * lowest,
        }
    }
}

/// `sin(N phase / 2) / (N sin(phase / 2))`.
fn dirichlet(elements: f64, phase: f64) -> f64 {
    let turns = (phase / (2.0 * PI)).round();
    let half = 0.5 * phase - PI * turns;
    // Whole turns change the sign if the middle is between two elements.
    let sign = if (turns * (elements - 1.0)) % 2.0 == 0.0 { 1.0 } else { -1.0 };
    if half.abs() < 1e-10 { sign } else { sign * (elements * half).sin() / (elements * half.sin()) }
}

/// The sum of elements with weights `0.54 - 0.46 cos(2 pi n / (N - 1))`, over N: three sums with uniform weights, as
/// the cosine is two waves.
fn hamming(elements: f64, phase: f64) -> f64 {
    let step = 2.0 * PI / (elements - 1.0);
    0.54 * dirichlet(elements, phase) + 0.23 * (dirichlet(elements, phase - step) + dirichlet(elements, phase + step))
}

/// Chebyshev's polynomial of degree `n` at x.
fn chebyshev(n: f64, x: f64) -> f64 {
    if x.abs() <= 1.0 {
        return (n * x.acos()).cos();
    }
    let height = (n * x.abs().acosh()).cosh();
    if x < 0.0 && n % 2.0 == 1.0 { -height } else { height }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(elements: u32, shading: Shading) -> Factor {
        Factor::new(&Array { elements, pitch_m: 0.5, shading, element_m: None }, 1.0)
    }

    /// The sum over the elements by definition.
    #[test]
    fn closed_forms_are_the_sums() {
        for elements in [2, 3, 8, 33] {
            let middle = 0.5 * f64::from(elements - 1);
            for (shading, weight) in [(Shading::Uniform, [1.0, 0.0]), (Shading::Hamming, [0.54, 0.46])] {
                let factor = factor(elements, shading);
                for step in -150..=150 {
                    let u = 0.02 * f64::from(step);
                    let (mut sum, mut all) = (0.0, 0.0);
                    for n in 0..elements {
                        let turn = 2.0 * PI * f64::from(n) / f64::from(elements - 1);
                        let w = weight[0] - weight[1] * turn.cos();
                        sum += w * (PI * u * (f64::from(n) - middle)).cos();
                        all += w;
                    }
                    let found = factor.amplitude(u);
                    assert!((found - sum / all).abs() < 1e-9, "{elements} {shading:?} {u}: {found} {}", sum / all);
                }
            }
        }
    }

    /// Weights of N elements produce it: those that fit its values at N angles fit the others too.
    #[test]
    fn chebyshev_is_a_sum_over_the_elements() {
        for elements in [2u32, 7, 16] {
            let (n, factor) = (f64::from(elements), factor(elements, Shading::Chebyshev { sidelobe_db: 30.0 }));
            let middle = 0.5 * (n - 1.0);
            let weights: Vec<f64> = (0..elements)
                .map(|m| {
                    let at = |k: u32| {
                        let phase = 2.0 * PI * f64::from(k) / n;
                        factor.amplitude(phase / PI) * (phase * (f64::from(m) - middle)).cos()
                    };
                    (0..elements).map(at).sum::<f64>() / n
                })
                .collect();
            assert!(weights.iter().all(|&weight| weight > 0.0), "{weights:?}");
            for step in 0..100 {
                let u = 0.017 * f64::from(step);
                let wave = |(m, w): (usize, &f64)| w * (PI * u * (m as f64 - middle)).cos();
                let sum: f64 = weights.iter().enumerate().map(wave).sum();
                assert!((sum - factor.amplitude(u)).abs() < 1e-9, "{elements} {u}");
            }
        }
    }
}
