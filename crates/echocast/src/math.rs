//! Functions that compile to vector instructions, for loops over many values.

use std::f32::consts::LN_2;

/// Logarithm to base 2 of a positive number, to 2e-6.
#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    crate::rng::ln(x) * (1.0 / LN_2)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_follow_the_functions() {
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
