//! Plane waves on the elements of an array: sums and differences with their phases.
//!
//! Phases are in turns, positions of elements in wavelengths: a wave from the direction whose sine along the array is
//! `sine` has the phase `position x sine` at an element.

use crate::level::kernels;
use crate::math::{cos_pi, sin_pi, sum};

/// Sums are formed in this many rows.
const ROWS: usize = 16;

/// Cosine and sine of a phase of up to 2^21 turns, to 1e-6 and the rounding of the phase itself.
#[inline(always)]
pub fn phasor(turns: f32) -> [f32; 2] {
    // The nearest whole number is in the lower bits of the sum.
    const UNIT: f32 = 1.5 * (1 << 23) as f32;
    let part = turns - ((turns + UNIT) - UNIT);
    let (sine, cosine) = (sin_pi(part), cos_pi(part));
    [1.0 - 2.0 * sine * sine, 2.0 * sine * cosine]
}

kernels! {
    /// Sum of the amplitudes `re + i im` of the elements at `positions`, each turned back by the phase of a wave from
    /// `sine`. All slices have the same length.
    pub fn sum_towards(positions: &[f32], sine: f32, re: &[f32], im: &[f32]) -> [f32; 2] {
        // As many rows at every level: the order of additions does not depend on it.
        let mut sums = [[0.0; ROWS]; 2];
        let mut add = |positions: &[f32; ROWS], re: &[f32; ROWS], im: &[f32; ROWS]| {
            for row in 0..ROWS {
                let [cosine, sine] = phasor(positions[row] * sine);
                sums[0][row] += re[row] * cosine + im[row] * sine;
                sums[1][row] += im[row] * cosine - re[row] * sine;
            }
        };
        let ((positions, last), (re, last_re), (im, last_im)) = (positions.as_chunks(), re.as_chunks(), im.as_chunks());
        for (positions, (re, im)) in positions.iter().zip(re.iter().zip(im)) {
            add(positions, re, im);
        }
        if !last.is_empty() {
            let [mut positions, mut re, mut im] = [[0.0; ROWS]; 3];
            positions[..last.len()].copy_from_slice(last);
            re[..last.len()].copy_from_slice(last_re);
            im[..last.len()].copy_from_slice(last_im);
            add(&positions, &re, &im);
        }
        sums.map(sum)
    }

    /// Squared magnitudes of sums over rows: of `re + i im` of the rows, each as long as `power`, times the conjugates
    /// of `phasors`, one for each row.
    pub fn add_rows(re: &[f32], im: &[f32], phasors: &[[f32; 2]], power: &mut [f32]) {
        let len = power.len();
        for (chunk, power) in power.chunks_mut(N).enumerate() {
            let first = chunk * N;
            let (mut real, mut imaginary) = ([0.0; N], [0.0; N]);
            for (row, [cosine, sine]) in phasors.iter().enumerate() {
                let cells = row * len + first..row * len + first + power.len();
                for (lane, (re, im)) in re[cells.clone()].iter().zip(&im[cells]).enumerate() {
                    real[lane] += re * cosine + im * sine;
                    imaginary[lane] += im * cosine - re * sine;
                }
            }
            for (lane, power) in power.iter_mut().enumerate() {
                *power = real[lane] * real[lane] + imaginary[lane] * imaginary[lane];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::level::{Level, limit_level};

    #[test]
    fn phasors_are_on_the_unit_circle_at_their_phase() {
        for step in -2000..2000 {
            let turns = 0.0171 * step as f32;
            let [cosine, sine] = phasor(turns);
            let phase = std::f64::consts::TAU * f64::from(turns);
            assert!((f64::from(cosine) - phase.cos()).abs() < 2e-6 && (f64::from(sine) - phase.sin()).abs() < 2e-6);
        }
    }

    #[test]
    fn a_wave_adds_up_in_its_own_direction_at_every_level() {
        let positions: Vec<f32> = (0..37).map(|element| 0.5 * element as f32).collect();
        let wave: Vec<_> = positions.iter().map(|at| phasor(at * 0.3)).collect();
        let (re, im): (Vec<_>, Vec<_>) = wave.iter().map(|[re, im]| (*re, *im)).unzip();
        let mut before = None;
        for level in Level::here() {
            limit_level(level);
            let towards = sum_towards(&positions, 0.3, &re, &im);
            assert!((towards[0] - 37.0).abs() < 1e-3 && towards[1].abs() < 1e-3, "{towards:?}");
            let beside = sum_towards(&positions, 0.3 + 2.0 / 37.0, &re, &im);
            assert!(beside[0].hypot(beside[1]) < 1e-3, "{beside:?}");
            let mut power = [0.0; 18];
            add_rows(&re[..36], &im[..36], &[[0.6, 0.8], [1.0, 0.0]], &mut power);
            for cell in 0..18 {
                let real = re[cell] * 0.6 + im[cell] * 0.8 + re[18 + cell];
                let imaginary = im[cell] * 0.6 - re[cell] * 0.8 + im[18 + cell];
                assert!((power[cell] - (real * real + imaginary * imaginary)).abs() < 1e-6);
            }
            let bits = (towards.map(f32::to_bits), beside.map(f32::to_bits), power.map(f32::to_bits));
            assert_eq!(*before.get_or_insert(bits), bits, "{level:?}");
        }
        limit_level(Level::Avx512);
    }
}
