//! Functions that compile to vector instructions, for loops over many values.

use std::f32::consts::{LN_2, PI};

/// Natural logarithm of a normal positive number, to 1e-6 absolute.
///
/// x = 2^e m with m in [sqrt(1/2), sqrt(2)); ln m = 2 artanh(s), s = (m - 1)/(m + 1), by its power
/// series: the first term left out is 2 s^11 / 11 < 1e-9.
#[inline(always)]
pub(crate) fn ln(x: f32) -> f32 {
    /// Bits of sqrt(1/2), so that the subtraction below carries into the exponent exactly from sqrt(2) on.
    const SQRT_HALF: i32 = 0x3f35_04f3;
    let bits = x.to_bits() as i32;
    let exponent = (bits - SQRT_HALF) >> 23;
    let m = f32::from_bits((bits - (exponent << 23)) as u32);
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let series = 2.0 * s * (1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0)))));
    exponent as f32 * LN_2 + series
}

/// log2(10) / 10: logarithms to base 2 of powers from dB.
pub(crate) const LOG2_PER_DB: f32 = 0.332_192_8;

/// Logarithm to base 2 of a positive number, to 2e-6.
#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    ln(x) * (1.0 / LN_2)
}

/// 2 to the power of `x`, to 2e-7 of it; 0 below -126, at most 2^127.
#[inline(always)]
pub(crate) fn exp2(x: f32) -> f32 {
    // Rounds to the nearest whole number.
    const ROUND: f32 = 12_582_912.0;
    let clamped = x.clamp(-126.0, 127.0);
    let whole = (clamped + ROUND) - ROUND;
    let q = (clamped - whole) * LN_2;
    // e^q for |q| <= ln(2) / 2 by its power series: the first term left out is below 1e-7.
    let part =
        1.0 + q * (1.0 + q * (1.0 / 2.0 + q * (1.0 / 6.0 + q * (1.0 / 24.0 + q * (1.0 / 120.0 + q * (1.0 / 720.0))))));
    let scale = f32::from_bits(((whole as i32 + 127) as u32) << 23);
    if x < -126.0 { 0.0 } else { part * scale }
}

/// sin(pi t) for |t| <= 1/2 by its power series, to 2e-7.
#[inline(always)]
pub(crate) fn sin_pi(t: f32) -> f32 {
    let x = t * PI;
    let q = x * x;
    x * (1.0
        - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0 - q * (1.0 / 362_880.0 - q * (1.0 / 39_916_800.0))))))
}

/// cos(pi t) for |t| <= 1/2 by its power series, to 3e-7.
#[inline(always)]
pub(crate) fn cos_pi(t: f32) -> f32 {
    let x = t * PI;
    let q = x * x;
    1.0 - q
        * (1.0 / 2.0
            - q * (1.0 / 24.0 - q * (1.0 / 720.0 - q * (1.0 / 40_320.0 - q * (1.0 / 3_628_800.0 - q / 479_001_600.0)))))
}

/// The error function by its power series, to 1e-12 for |z| < 5.
pub(crate) fn erf(z: f64) -> f64 {
    if z.abs() > 5.0 {
        return z.signum();
    }
    let (mut term, mut sum) = (z, z);
    for n in 1..200 {
        term *= -z * z / f64::from(n);
        let before = sum;
        sum += term / f64::from(2 * n + 1);
        if sum == before {
            break;
        }
    }
    sum * 2.0 / std::f64::consts::PI.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_follow_the_functions() {
        for i in 0..=1 << 16 {
            let u = (i as f32 + 1.0) / (1 << 16) as f32;
            assert!((f64::from(ln(u)) - f64::from(u).ln()).abs() < 1e-6, "ln({u})");
            let t = i as f32 / (1 << 16) as f32 - 0.5;
            let x = f64::from(t) * std::f64::consts::PI;
            assert!((f64::from(sin_pi(t)) - x.sin()).abs() < 2e-7, "sin_pi({t})");
            assert!((f64::from(cos_pi(t)) - x.cos()).abs() < 3e-7, "cos_pi({t})");
        }
        assert_eq!(ln(1.0), 0.0);
        for i in -1260..1270 {
            let x = i as f32 * 0.1 + 0.013;
            let exact = f64::from(x).exp2();
            assert!((f64::from(exp2(x)) / exact - 1.0).abs() < 3e-7, "exp2({x})");
            assert!((log2(exact as f32) - x).abs() < 2e-6 * x.abs().max(1.0), "log2(2^{x})");
        }
        assert_eq!((exp2(-200.0), exp2(0.0), log2(1.0)), (0.0, 1.0, 0.0));
        assert!(exp2(300.0).is_finite());
    }
}
