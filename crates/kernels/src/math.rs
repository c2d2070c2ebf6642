//! Functions that compile to vector instructions, for loops over many values.

use std::f32::consts::{FRAC_PI_2, LN_2, PI};

/// Sum of `values`, as many as a power of two, in the same order at every level: see [`halves`].
#[inline(always)]
pub fn sum<const COUNT: usize>(values: [f32; COUNT]) -> f32 {
    halves(values, |a, b| a + b)
}

/// What is left of `values`, as many as a power of two, if the later half is put `together` with the earlier one until
/// one is left.
#[inline(always)]
pub fn halves<const COUNT: usize>(mut values: [f32; COUNT], together: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = COUNT / 2;
    while half > 0 {
        for place in 0..half {
            values[place] = together(values[place], values[place + half]);
        }
        half /= 2;
    }
    values[0]
}

/// Natural logarithm of a normal positive number, to 1e-6 absolute.
///
/// x = 2^e m with m in [sqrt(1/2), sqrt(2)); ln m = 2 artanh(s), s = (m - 1)/(m + 1), by its power
/// series: the first term left out is 2 s^11 / 11 < 1e-9.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
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
pub const LOG2_PER_DB: f32 = 0.332_192_8;

/// Logarithm to base 2 of a positive number, to 2e-6.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    ln(x) * (1.0 / LN_2)
}

/// 2 to the power of `x`, to 2e-7 of it; 0 below -126, at most 2^127.
#[inline(always)]
pub fn exp2(x: f32) -> f32 {
    let clamped = x.clamp(-126.0, 127.0);
    let (whole, power) = whole(clamped);
    let q = (clamped - whole) * LN_2;
    // e^q for |q| <= ln(2) / 2 by its power series: the first term left out is below 1e-7.
    let part =
        1.0 + q * (1.0 + q * (1.0 / 2.0 + q * (1.0 / 6.0 + q * (1.0 / 24.0 + q * (1.0 / 120.0 + q * (1.0 / 720.0))))));
    if x < -126.0 { 0.0 } else { part * power }
}

/// The nearest whole number to `x`, -126 to 127, and 2 to its power. Avoids conversion to an integer, which saturates
/// and so does not vectorise.
#[inline(always)]
fn whole(x: f32) -> (f32, f32) {
    // The lower bits of the sum hold it.
    const UNIT: f32 = 1.5 * (1 << 23) as f32;
    let sum = x + UNIT;
    let exponent = sum.to_bits().wrapping_sub(UNIT.to_bits()).wrapping_add(127);
    (sum - UNIT, f32::from_bits(exponent << 23))
}

/// The cell of a table that holds `x`, 0 to `last`, and the part of it before `x`: cells are 1 wide and begin at 0.
#[inline(always)]
pub fn cell(x: f32, last: usize) -> (usize, f32) {
    const UNIT: f32 = 1.5 * (1 << 23) as f32;
    let nearest = (x + UNIT) - UNIT;
    let below = if nearest > x { nearest - 1.0 } else { nearest };
    let first = below.max(0.0).min(last as f32);
    // The lower bits of the sum hold it, as in [`whole`]; the limit tells the compiler that no index needs a check.
    let index = (first + UNIT).to_bits().wrapping_sub(UNIT.to_bits()) as usize;
    (index.min(last), x - first)
}

/// sin(pi t) for |t| <= 1/2 by its power series, to 2e-7.
#[inline(always)]
pub fn sin_pi(t: f32) -> f32 {
    let x = t * PI;
    let q = x * x;
    x * (1.0
        - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0 - q * (1.0 / 362_880.0 - q * (1.0 / 39_916_800.0))))))
}

/// cos(pi t) for |t| <= 1/2 by its power series, to 3e-7.
#[inline(always)]
pub fn cos_pi(t: f32) -> f32 {
    let x = t * PI;
    let q = x * x;
    1.0 - q
        * (1.0 / 2.0
            - q * (1.0 / 24.0 - q * (1.0 / 720.0 - q * (1.0 / 40_320.0 - q * (1.0 / 3_628_800.0 - q / 479_001_600.0)))))
}

/// `e^-x` for x of 0 and more, to 2e-7 of itself, 0 beyond 87.
#[inline(always)]
pub fn exp_negative(x: f32) -> f32 {
    const LOG2_E: f32 = std::f32::consts::LOG2_E;
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = -x.min(87.0);
    // e^x = 2^n e^r, |r| <= ln 2 / 2, in two steps so that r is exact.
    let (n, power) = whole(x * LOG2_E);
    let r = x - n * LN_2_HIGH - n * LN_2_LOW;
    let series =
        1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    if x <= -87.0 { 0.0 } else { series * power }
}

/// Sine and cosine of 0 to pi/2 by their power series, to 1e-12.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    /// 1 / ((2n)(2n + 1)) and 1 / ((2n)(2n - 1)) for n = 1 to 8: terms up to x^17 and x^16.
    const SINE: [f64; 8] = ratios(1);
    const COSINE: [f64; 8] = ratios(-1);
    let q = x * x;
    let (mut sine, mut cosine) = (1.0, 1.0);
    for n in (0..8).rev() {
        sine = 1.0 - q * SINE[n] * sine;
        cosine = 1.0 - q * COSINE[n] * cosine;
    }
    (x * sine, cosine)
}

const fn ratios(step: i32) -> [f64; 8] {
    let mut ratios = [0.0; 8];
    let mut n = 0;
    while n < 8 {
        let even = 2 * (n as i32 + 1);
        ratios[n] = 1.0 / (even * (even + step)) as f64;
        n += 1;
    }
    ratios
}

/// Arccosine of -1 to 1, to 5e-7 (Abramowitz and Stegun 1964, 4.4.46).
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    let a = x.abs();
    let series = FRAC_PI_2
        + a * (-0.214_598_8
            + a * (0.088_978_99
                + a * (-0.050_174_304
                    + a * (0.030_891_88 + a * (-0.017_088_126 + a * (0.006_670_09 - a * 0.001_262_491_1))))));
    let angle = (1.0 - a).max(0.0).sqrt() * series;
    if x < 0.0 { PI - angle } else { angle }
}

/// Sine and cosine of `turns` of a circle, to 1e-12, for up to 2^50 of them.
#[inline(always)]
pub fn sin_cos_turns(turns: f64) -> (f64, f64) {
    const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
    let part = turns - ((turns + WHOLE) - WHOLE);
    // Of the half angle, 0 to pi/2.
    let (sine, cosine) = sin_cos(part.abs() * std::f64::consts::PI);
    ((2.0 * sine * cosine).copysign(part), 1.0 - 2.0 * sine * sine)
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

    #[test]
    fn numbers_are_in_the_cell_that_begins_at_or_below_them() {
        for (x, expected) in [
            (0.0, (0, 0.0)),
            (0.499_999_97, (0, 0.499_999_97)),
            (0.75, (0, 0.75)),
            (1.0, (1, 0.0)),
            (1.999_999_9, (1, 0.999_999_9)),
            (2.0, (2, 0.0)),
            (62.999_996, (62, 0.999_996)),
            (63.0, (63, 0.0)),
            (64.0, (63, 1.0)),
        ] {
            assert_eq!(cell(x, 63).0, expected.0, "{x}");
            assert!((cell(x, 63).1 - expected.1).abs() < 4e-6, "{x}");
        }
        assert!(cell(f32::NAN, 63).0 <= 63);
    }

    #[test]
    fn sines_and_cosines_follow_theirs() {
        for i in 0..=1000 {
            let x = std::f64::consts::FRAC_PI_2 * f64::from(i) / 1000.0;
            let (sine, cosine) = sin_cos(x);
            assert!((sine - x.sin()).abs() < 1e-12 && (cosine - x.cos()).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn angles_follow_theirs() {
        for i in -10_000..=10_000 {
            let x = i as f32 / 10_000.0;
            assert!((f64::from(acos(x)) - f64::from(x).acos()).abs() < 5e-7, "acos({x})");
            let turns = f64::from(i) * 0.000_37;
            let (sine, cosine) = sin_cos_turns(turns);
            let angle = turns * std::f64::consts::TAU;
            assert!((sine - angle.sin()).abs() < 1e-11 && (cosine - angle.cos()).abs() < 1e-11, "{turns}");
        }
    }
}
