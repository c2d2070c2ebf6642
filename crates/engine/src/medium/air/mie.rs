//! Scattering of light by single water spheres: Mie theory.

use num_complex::Complex64;
use std::f64::consts::PI;

/// Wavelength, nm, and the real and imaginary part of the refractive index of water at 20 to 25 degrees C (Hale and
/// Querry 1973, Applied Optics 12, 555).
const WATER: [[f64; 3]; 5] = [
    [400.0, 1.339, 1.9e-9],
    [532.0, 1.334, 1.5e-9],
    [905.0, 1.328, 4.9e-7],
    [1064.0, 1.326, 1.3e-6],
    [1550.0, 1.318, 1.0e-4],
];

/// Refractive index of water: linear between the wavelengths of the table, its imaginary part in the logarithm,
/// constant outside them.
pub(super) fn water(wavelength_nm: f64) -> Complex64 {
    let above = WATER.partition_point(|row| row[0] < wavelength_nm).clamp(1, WATER.len() - 1);
    let [[low, n, k], [high, m, l]] = [WATER[above - 1], WATER[above]];
    let part = ((wavelength_nm - low) / (high - low)).clamp(0.0, 1.0);
    Complex64::new(n + (m - n) * part, (k.ln() + (l.ln() - k.ln()) * part).exp())
}

/// Cross-sections of a sphere over its area `pi r^2`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Efficiencies {
    /// Extinction.
    pub extinction: f64,
    /// Backscatter, as if the sphere scattered in all directions as it does straight back: `4 pi` times the
    /// differential cross-section at 180 degrees.
    pub backscatter: f64,
}

/// Efficiencies of a sphere of the size parameter `x = 2 pi r / lambda` and the refractive index `m` in air: the series
/// of Bohren and Huffman 1983, eq. 4.53, 4.61, 4.88 and 4.89, with `x + 4 x^(1/3) + 2` terms (Wiscombe 1980). `logs` is
/// scratch memory.
pub(super) fn sphere(x: f64, m: Complex64, logs: &mut Vec<Complex64>) -> Efficiencies {
    let terms = (x + 4.0 * x.cbrt() + 2.0) as usize;
    let inside = m * x;
    // The logarithmic derivative of psi inside, by downward recurrence, which is stable.
    let start = terms.max(inside.norm() as usize) + 15;
    logs.clear();
    logs.resize(start + 1, Complex64::ZERO);
    for n in (1..=start).rev() {
        let ratio = n as f64 / inside;
        logs[n - 1] = ratio - 1.0 / (logs[n] + ratio);
    }
    let (mut psi, mut chi) = ([x.cos(), x.sin()], [-x.sin(), x.cos()]);
    let (mut extinction, mut back, mut sign) = (0.0, Complex64::ZERO, 1.0);
    for n in 1..=terms {
        let order = n as f64;
        let factor = (2.0 * order - 1.0) / x;
        (psi, chi) = ([psi[1], factor * psi[1] - psi[0]], [chi[1], factor * chi[1] - chi[0]]);
        let [before, now] = [0, 1].map(|k| Complex64::new(psi[k], -chi[k]));
        let of = |log: Complex64| {
            let log = log + order / x;
            (log * psi[1] - psi[0]) / (log * now - before)
        };
        let (a, b) = (of(logs[n] / m), of(logs[n] * m));
        let weight = 2.0 * order + 1.0;
        sign = -sign;
        extinction += weight * (a + b).re;
        back += weight * sign * (a - b);
    }
    Efficiencies { extinction: 2.0 * extinction / (x * x), backscatter: back.norm_sqr() / (x * x) }
}

/// Size parameter of a radius, m.
pub(super) fn size(radius: f64, wavelength_nm: f64) -> f64 {
    2.0 * PI * radius / (wavelength_nm * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bohren and Huffman 1983, appendix A: x = 3, m = 1.33 + 1e-8 i; and the examples of BHMIE: radius 0.525 um, 632.8
    /// nm, m = 1.55: Q_ext 3.10543, Q_back 2.92534.
    #[test]
    fn spheres_scatter_as_published() {
        let mut logs = Vec::new();
        let x = size(0.525e-6, 632.8);
        let found = sphere(x, Complex64::new(1.55, 0.0), &mut logs);
        assert!((found.extinction - 3.105_43).abs() < 1e-4, "{found:?}");
        assert!((found.backscatter - 2.925_34).abs() < 1e-4, "{found:?}");
        // Small spheres: Rayleigh's law, Q_ext = 8/3 x^4 |(m^2 - 1) / (m^2 + 2)|^2, of which 3/2 goes straight back.
        let (x, m) = (0.01, Complex64::new(1.33, 0.0));
        let polarity = ((m * m - 1.0) / (m * m + 2.0)).norm_sqr();
        let found = sphere(x, m, &mut logs);
        let expected = 8.0 / 3.0 * x.powi(4) * polarity;
        assert!((found.extinction / expected - 1.0).abs() < 1e-3, "{found:?} {expected}");
        assert!((found.backscatter / (1.5 * expected) - 1.0).abs() < 1e-3, "{found:?} {expected}");
        // Large spheres remove twice their area, plus the edge term of Nussenzveig and Wiscombe 1980.
        let mean = |first: f64| {
            let all = (0..400).map(|k| sphere(first + 0.25 * f64::from(k), m, &mut Vec::new()).extinction);
            all.sum::<f64>() / 400.0
        };
        assert!((mean(1000.0) - 2.0 - 1.992_386 * 1050f64.powf(-2.0 / 3.0)).abs() < 1e-3, "{}", mean(1000.0));
    }

    #[test]
    fn water_follows_its_table() {
        assert!((water(905.0) - Complex64::new(1.328, 4.9e-7)).norm() < 1e-15);
        assert!((water(1550.0).im - 1e-4).abs() < 1e-12 && water(3000.0) == water(1550.0));
        assert!(water(903.0).re > 1.328 && water(200.0).re == 1.339);
    }
}
