//! The Bessel function of round apertures.

use std::f64::consts::{FRAC_PI_4, PI};

/// `2 J1(x) / x`, 1 at 0, to 1e-10.
///
/// Up to 12 the power series (Abramowitz & Stegun 9.1.10), beyond it Hankel's asymptotic expansion (9.2.5, 9.2.9 and
/// 9.2.10; 9.4 gives polynomials of 1e-7 instead).
pub(super) fn jinc(x: f64) -> f64 {
    let x = x.abs();
    if x < 12.0 {
        // Its terms cancel to 1e-12.
        let step = -0.25 * x * x;
        let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
        while f64::abs(term) > 1e-17 {
            term *= step / (k * (k + 1.0));
            sum += term;
            k += 1.0;
        }
        return sum;
    }
    // Terms (mu - 1)(mu - 9) ... (mu - (2k-1)^2) / (k! (8x)^k), mu = 4, even ones to P, odd ones to Q, in pairs of
    // alternating sign; at 12 those of the order of 16 are 1e-11.
    let (mut p, mut q, mut term, mut sign) = (1.0, 0.0, 1.0, 1.0);
    for k in 1..=16 {
        let odd = f64::from(2 * k - 1);
        term *= (4.0 - odd * odd) / (f64::from(k) * 8.0 * x);
        if k % 2 == 1 {
            q += sign * term;
            sign = -sign;
        } else {
            p += sign * term;
        }
        if f64::abs(term) < 1e-17 {
            break;
        }
    }
    let (sin, cos) = (x - 3.0 * FRAC_PI_4).sin_cos();
    2.0 / x * (2.0 / (PI * x)).sqrt() * (p * cos - q * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bessel's integral, `J1(x) = 1/pi integral of cos(t - x sin t) over 0..pi`, for which the trapezoidal rule
    /// converges faster than any power; and zeros from Abramowitz & Stegun, table 9.5.
    #[test]
    fn jinc_is_bessels_integral() {
        const STEPS: usize = 400;
        for tenth in 1..=2000 {
            let x = 0.1 * f64::from(tenth);
            let value = |i: usize| {
                let t = PI * i as f64 / STEPS as f64;
                (t - x * t.sin()).cos()
            };
            let j1 = ((1..STEPS).map(value).sum::<f64>() + 0.5 * (value(0) + value(STEPS))) / STEPS as f64;
            assert!((jinc(x) - 2.0 * j1 / x).abs() < 1e-10, "{x}: {} {}", jinc(x), 2.0 * j1 / x);
            assert_eq!(jinc(-x), jinc(x));
        }
        for zero in [3.831_705_970_207_512, 7.015_586_669_815_613, 10.173_468_135_062_722, 13.323_691_936_314_223] {
            assert!(jinc(zero).abs() < 1e-11, "{zero}: {}", jinc(zero));
        }
        assert_eq!(jinc(0.0), 1.0);
    }
}
