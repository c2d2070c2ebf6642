//! Directivity indices: by how much an aperture rejects isotropic noise.

use super::BeamPattern;
use super::bessel::jinc;
use super::integral::{integral, integral_over};
use std::f64::consts::{FRAC_PI_2, PI};

/// Above this many wavelengths (or ka) the first terms of the asymptotic expansion are accurate to 1e-4 dB.
const LONG: f64 = 1000.0;

/// Directivity index of a uniform line, dB, that receives from all round itself: `10 log(4 pi / integral of b over the
/// sphere)`, `10 log(2 L / lambda)` if it is long. `length_in_wavelengths` is above 0.
pub fn line_directivity(length_in_wavelengths: f64) -> f64 {
    let length = length_in_wavelengths;
    // The integral of sinc(x)^2 over 0..length; the cosine turns the integral over angle into one over u.
    let area = if length > LONG {
        0.5 - 0.5 / (PI * PI * length)
    } else {
        let line = BeamPattern::line(1.0);
        integral(&|x| line.amplitude(x).powi(2), [0.0, length], 1 + (4.0 * length) as usize, 1e-9)
    };
    10.0 * (length / area).log10()
}

/// Directivity index of a rectangular face of `length` x `height` wavelengths in a baffle, dB: `10 log(4 pi L H /
/// lambda^2)`, valid where both are several wavelengths (to 0.01 dB for 180 x 6); [`directivity`] of two lines is valid
/// for all.
pub fn rectangle_directivity(length: f64, height: f64) -> f64 {
    10.0 * (4.0 * PI * length * height).log10()
}

/// Directivity index of a round piston in a baffle, dB, `ka` (its circumference in wavelengths) above 0: nothing is
/// received from the half sphere behind the baffle; `20 log(ka)` if it is wide.
pub fn piston_directivity(ka: f64) -> f64 {
    if ka > LONG {
        return 20.0 * ka.log10();
    }
    let power = |theta: f64| jinc(ka * theta.sin()).powi(2) * theta.sin();
    let half = integral(&power, [0.0, FRAC_PI_2], 8 + (2.0 * ka) as usize, 1e-9 / (1.0 + ka * ka));
    10.0 * (2.0 / half).log10()
}

/// Directivity index of a round aperture in a baffle with the pattern `lobe` all round its axis, dB: `10 log(4 pi /
/// integral of b over the half sphere in front of it)`.
pub fn round_directivity(lobe: &BeamPattern) -> f64 {
    let power = |theta: f64| lobe.amplitude(theta.sin()).powi(2) * theta.sin();
    let edges = lobe.panels().into_iter().filter(|&u| u >= 0.0).map(f64::asin);
    10.0 * (2.0 / integral_over(&power, edges, 1e-9 * lobe.detail().powi(2))).log10()
}

/// Directivity index of a line array in a baffle that receives from all round itself, dB: `10 log(4 / integral of b
/// over u)`, as `d(solid angle) = pi d(u)` in front of the baffle.
pub fn wall_directivity(lobe: &BeamPattern) -> f64 {
    10.0 * (4.0 / over_sines(lobe)).log10()
}

/// Integral of the power of a pattern over u, -1 to 1.
fn over_sines(lobe: &BeamPattern) -> f64 {
    integral_over(&|u| lobe.amplitude(u).powi(2), lobe.panels(), 1e-6 * lobe.detail())
}

/// Directivity index of an aperture in a baffle with the pattern `across` in one plane and `up` in the other, dB: `10
/// log(4 pi / integral of b over the half sphere in front of it)`; nothing is received from the half sphere behind. The
/// patterns multiply, each at the direction cosine along its edge. Accurate to 0.01 dB, even for lobes of a thousandth
/// of a degree; to 2 dB for arrays with impractically many grating lobes (a pitch of more than 8 wavelengths).
pub fn directivity(across: &BeamPattern, up: &BeamPattern) -> f64 {
    const PRECISION: f64 = 1e-6;
    let (fine_across, fine_up) = (across.detail(), up.detail());
    if across.is_sparse() || up.is_sparse() {
        // The work would grow with the product of their lobes.
        return 10.0 * (4.0 * PI / (over_sines(across) * over_sines(up))).log10();
    }
    let (across_panels, up_panels) = (across.panels(), up.panels());
    let ring = |elevation: f64| {
        let (sin, cos) = elevation.sin_cos();
        let power = |azimuth: f64| across.amplitude(cos * azimuth.sin()).powi(2);
        let edges = across_panels.iter().map(|u| (u / cos).clamp(-1.0, 1.0).asin());
        up.amplitude(sin).powi(2) * cos * integral_over(&power, edges, PRECISION * fine_across)
    };
    let all = integral_over(&ring, up_panels.iter().map(|u| u.asin()), PRECISION * fine_across * fine_up);
    10.0 * (4.0 * PI / all).log10()
}
