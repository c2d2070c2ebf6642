//! Depth cameras: where pixels look, how much light they get, which range they make of it.

use crate::level::kernels;
use crate::math::{acos, sin_cos_turns};
use crate::{LANES, Lanes};
use std::f64::consts::TAU;

/// Most frequencies that light is modulated at.
pub const MOST_FREQUENCIES: usize = 3;

/// Modulated light of one camera.
#[derive(Clone, Copy, Debug)]
pub struct Modulated {
    /// Range at which the phase of each frequency wraps, m, rising.
    pub wraps: [f64; MOST_FREQUENCIES],
    /// Number of frequencies.
    pub count: usize,
    /// Turns of the first until all are where they began.
    pub turns: u32,
    /// Part of the [`wiggle`] that calibration leaves.
    pub residual: f64,
    /// Electrons that an echo of power 1 1/m^2 is modulated by, and electrons of background light; 0 and 0: no noise.
    pub electrons: [f64; 2],
}

/// Error of a phase of `turns` that four taps make of the correlation of two square waves, rad.
///
/// That correlation is a triangle, `cos p + cos(3 p) / 9 + cos(5 p) / 25 + ...`; four taps take its third and fifth
/// harmonic for the phasor `1 + e^(-4jp) / 9 + e^(4jp) / 25` along that of the first.
#[inline(always)]
pub fn wiggle(turns: f64) -> f64 {
    const THIRD: f64 = 1.0 / 9.0;
    const FIFTH: f64 = 1.0 / 25.0;
    let (sin, cos) = sin_cos_turns(4.0 * turns);
    // The arctangent of 0.084 at most by its power series: the first term left out is below 1e-15.
    let t = (FIFTH - THIRD) * sin / (1.0 + (THIRD + FIFTH) * cos);
    let q = t * t;
    t * (1.0 - q * (1.0 / 3.0 - q * (1.0 / 5.0 - q * (1.0 / 7.0 - q * (1.0 / 9.0 - q * (1.0 / 11.0 - q / 13.0))))))
}

/// `turns` less the whole number next to it; exact below 2^51.
#[inline(always)]
pub fn fraction(turns: f64) -> f64 {
    const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
    turns - ((turns + WHOLE) - WHOLE)
}

/// Pixels at a time: what they need stays in registers.
const N: usize = 16;

kernels! {
    /// Where pixels that should look along `from` do look: off by `normals` times `across` and `down`, in units of the
    /// focal length. Unit vectors.
    pub fn look_aside(from: [&[f32]; 3], across: f32, down: f32, normals: [&[f32]; 2], to: &mut [Lanes; 3]) {
        let count = from[0].len();
        let [x, y, z] = from.map(|axis| &axis[..count]);
        let [left, up] = normals.map(|normals| &normals[..count]);
        let [to_x, to_y, to_z] = to.each_mut().map(|axis| &mut axis[..count]);
        for lane in 0..count {
            let y = y[lane] + x[lane] * (across * left[lane]);
            let z = z[lane] + x[lane] * (down * up[lane]);
            let scale = 1.0 / (x[lane] * x[lane] + y * y + z * z).sqrt();
            (to_x[lane], to_y[lane], to_z[lane]) = (x[lane] * scale, y * scale, z * scale);
        }
    }

    /// Lets rays at `from` look at the places at `range` m along rays from `origin`, up to a part `free` of the way
    /// there.
    pub fn look_at(
        origin: [&Lanes; 3],
        direction: [&Lanes; 3],
        range: &Lanes,
        free: f32,
        from: [&Lanes; 3],
        to: [&mut Lanes; 3],
        range_max: &mut Lanes,
    ) {
        let [to_x, to_y, to_z] = to;
        for lane in 0..LANES {
            let x = origin[0][lane] + direction[0][lane] * range[lane] - from[0][lane];
            let y = origin[1][lane] + direction[1][lane] * range[lane] - from[1][lane];
            let z = origin[2][lane] + direction[2][lane] * range[lane] - from[2][lane];
            let length = (x * x + y * y + z * z).sqrt();
            let scale = 1.0 / length;
            (to_x[lane], to_y[lane], to_z[lane]) = (x * scale, y * scale, z * scale);
            range_max[lane] = length * free;
        }
    }

    /// Cosines of the angles between directions and an `axis`.
    pub fn off_axis(axis: [f32; 3], direction: [&Lanes; 3], to: &mut Lanes) {
        let [x, y, z] = direction;
        for lane in 0..LANES {
            to[lane] = axis[0] * x[lane] + axis[1] * y[lane] + axis[2] * z[lane];
        }
    }

    /// Multiplies with the fourth power of cosines.
    pub fn vignette(cos: &Lanes, values: &mut Lanes) {
        for lane in 0..LANES {
            let square = cos[lane].max(0.0) * cos[lane].max(0.0);
            values[lane] *= square * square;
        }
    }

    /// Multiplies with the light at angles of these cosines, from a table of angles, rad, rising, and light.
    pub fn illuminate(table: &[[f32; 2]], cos: &Lanes, values: &mut Lanes) {
        let ([_, first], [_, last]) = match table {
            [] => return,
            [first, .., last] => (*first, *last),
            [only] => (*only, *only),
        };
        let (mut angles, mut light) = ([0.0; LANES], [first; LANES]);
        for lane in 0..LANES {
            angles[lane] = acos(cos[lane].clamp(-1.0, 1.0));
        }
        for pair in table.windows(2) {
            let ([from, low], [to, high]) = (pair[0], pair[1]);
            for lane in 0..LANES {
                let angle = angles[lane];
                let between = low + (high - low) * (angle - from) / (to - from);
                let beyond = if angle > to { last } else { between };
                light[lane] = if angle > from { beyond } else { light[lane] };
            }
        }
        for lane in 0..LANES {
            values[lane] *= light[lane];
        }
    }

    /// Ranges that pixels make of the phases of one echo each, m, from 0 to where all phases wrap together, and the
    /// greatest difference between what two frequencies say, m. `noise` has a standard normal number for each
    /// frequency.
    ///
    /// Every whole number of turns of the highest frequency is tried; the one that leaves least of the others' phases,
    /// in squares, counts. Then all count with the weight of their precision, `f^2`.
    pub fn form(
        modulated: &Modulated,
        range: &Lanes,
        power: &Lanes,
        noise: &[Lanes; MOST_FREQUENCIES],
        formed: &mut Lanes,
        disagreement: &mut Lanes,
    ) {
        let Modulated { wraps, count, turns, residual, electrons: [gain, background] } = *modulated;
        let finest = wraps[0];
        let ambiguity = finest * f64::from(turns);
        let weights: f64 = wraps[..count].iter().map(|wrap| 1.0 / (wrap * wrap)).sum();
        for chunk in (0..LANES).step_by(N) {
            let mut phases = [[0.0; N]; MOST_FREQUENCIES];
            for index in 0..count {
                for lane in 0..N {
                    let turns = f64::from(range[chunk + lane]) / wraps[index];
                    let mut error = if residual > 0.0 { residual * wiggle(turns) } else { 0.0 };
                    if gain > 0.0 {
                        let power = f64::from(power[chunk + lane]);
                        let sigma = (0.5 * (gain * power + background)).sqrt() / (gain * power);
                        error += sigma * f64::from(noise[index][chunk + lane]);
                    }
                    phases[index][lane] = turns + error / TAU;
                }
            }
            let (mut first, mut best, mut least) = ([0.0; N], [0.0; N], [f64::INFINITY; N]);
            for lane in 0..N {
                first[lane] = phases[0][lane] - phases[0][lane].floor();
            }
            for turn in 0..turns {
                let turn = f64::from(turn);
                let mut left = [0.0; N];
                for index in 1..count {
                    let per_turn = finest / wraps[index];
                    for lane in 0..N {
                        let rest = fraction((turn + first[lane]) * per_turn - phases[index][lane]);
                        left[lane] += rest * rest;
                    }
                }
                for lane in 0..N {
                    let better = left[lane] < least[lane];
                    best[lane] = if better { turn + first[lane] } else { best[lane] };
                    least[lane] = if better { left[lane] } else { least[lane] };
                }
            }
            // How far each says the range is beyond that.
            let (mut sum, mut nearest, mut farthest) = ([0.0; N], [0.0f64; N], [0.0f64; N]);
            for index in 1..count {
                let (wrap, per_turn) = (wraps[index], finest / wraps[index]);
                for lane in 0..N {
                    let beyond = -fraction(best[lane] * per_turn - phases[index][lane]) * wrap;
                    sum[lane] += beyond / (wrap * wrap);
                    nearest[lane] = nearest[lane].min(beyond);
                    farthest[lane] = farthest[lane].max(beyond);
                }
            }
            for lane in 0..N {
                let range = best[lane] * finest + sum[lane] / weights;
                // A wrap at most to either side.
                let range = if range < 0.0 { range + ambiguity } else { range };
                let range = if range >= ambiguity { range - ambiguity } else { range };
                formed[chunk + lane] = range as f32;
                disagreement[chunk + lane] = (farthest[lane] - nearest[lane]) as f32;
            }
        }
    }

    /// Measured depths along rays `axis` (cosines) off the optical axis, m of range: errors of the deviation `a + b z +
    /// c z^2` with the `terms` a, b, c, and on surfaces met at cosines of incidence `cos` of `slanted.0 z^slanted.1 t^2
    /// / (pi/2 - t)^2` more; in even steps of the disparity where `step`, that of depth over its square, 1/m, is above
    /// 0.
    pub fn err(
        terms: [f32; 3],
        slanted: (f32, f32),
        step: f32,
        axis: &Lanes,
        cos: &Lanes,
        normal: &Lanes,
        range: &mut Lanes,
    ) {
        for lane in 0..LANES {
            let depth = range[lane] * axis[lane];
            range[lane] = measured_depth(terms, slanted, step, depth, cos[lane], normal[lane]) / axis[lane];
        }
    }
}

/// Standard deviation of a depth, m. From 85 degrees on it is that at 85 degrees: at 90 the laws are infinite, and
/// nobody measured so far.
#[inline(always)]
pub fn depth_sigma([a, b, c]: [f32; 3], (factor, power): (f32, f32), depth: f32, cos: f32) -> f32 {
    const STEEPEST: f32 = 85.0 / 180.0 * std::f32::consts::PI;
    let mut sigma = a + depth * (b + depth * c);
    if factor > 0.0 {
        let incidence = acos(cos.clamp(0.0, 1.0)).min(STEEPEST);
        let grazing = std::f32::consts::FRAC_PI_2 - incidence;
        let ratio = incidence / grazing;
        // The powers that there are: 3/2 and -1/2.
        let root = depth.max(0.0).sqrt();
        let powered = if power > 0.0 { depth * root } else { 1.0 / root };
        sigma += factor * powered * ratio * ratio;
    }
    sigma.max(0.0)
}

/// A measured depth, m, where `depth` is true and `normal` a standard normal number. Sigma is that of what is reported:
/// the steps' own part of its variance, a twelfth of their square, is left to them.
#[inline(always)]
pub fn measured_depth(terms: [f32; 3], slanted: (f32, f32), per_square: f32, depth: f32, cos: f32, normal: f32) -> f32 {
    let step = per_square * depth * depth;
    let sigma = depth_sigma(terms, slanted, depth, cos);
    let noisy = depth + (sigma * sigma - step * step / 12.0).max(0.0).sqrt() * normal;
    // Disparities are even steps, so that inverse depths are.
    let steps = (1.0 / (noisy * per_square)).round_ties_even().max(1.0);
    if per_square > 0.0 && noisy > 0.0 { 1.0 / (steps * per_square) } else { noisy.max(0.0) }
}
