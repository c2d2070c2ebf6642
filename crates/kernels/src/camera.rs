//! Depth cameras: directions of pixels, how much light they receive, which range they derive from it.

use crate::level::kernels;
use crate::math::acos;
use crate::{LANES, Lanes};
use std::f64::consts::TAU;

/// Greatest number of modulation frequencies.
pub const MOST_FREQUENCIES: usize = 3;

/// The modulation frequencies of a camera's light, used one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frequencies {
    /// Range at which the phase of each frequency wraps, m, rising.
    wraps: [f64; MOST_FREQUENCIES],
    /// Number of frequencies.
    count: usize,
    /// Turns of the first until all phases are back at their start.
    turns: u32,
    /// Part of the [`wiggle`] that calibration leaves.
    residual: f32,
}

/// Shot noise of four taps, in electrons per tap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShotNoise {
    /// Modulation amplitude of an echo of power 1 1/m^2, in electrons, and its mean.
    pub gain: f64,
    /// Electrons of background light.
    pub background: f64,
}

impl ShotNoise {
    /// Noise of `phase` rad on an echo of `power` 1/m^2, where background light gives `ambient` times the electrons of
    /// the echo.
    pub fn new(phase: f64, power: f64, ambient: f64) -> ShotNoise {
        // `sigma` solved for the amplitude; an echo of fully modulated light has the same mean.
        let amplitude = (1.0 + ambient) / (2.0 * phase * phase);
        ShotNoise { gain: amplitude / power, background: amplitude * ambient }
    }

    /// Standard deviation of the phase, rad, of echoes whose powers sum to `offset` and whose phasors sum to the length
    /// `amplitude`, 1/m^2: `sqrt(B / 2) / A`; that of the range is `c sqrt(B) / (4 sqrt(2) pi f A)`.
    #[inline(always)]
    pub fn sigma(&self, amplitude: f64, offset: f64) -> f64 {
        (0.5 * (self.gain * offset + self.background)).sqrt() / (self.gain * amplitude)
    }
}

impl Frequencies {
    /// `wraps`: ranges, m, rising, at which the phases of the frequencies wrap, 1 to [`MOST_FREQUENCIES`] of them.
    /// `turns`: of the first until all phases are back at their start. `residual`: part of the [`wiggle`] that
    /// calibration leaves, 0 to 1.
    pub fn new(wraps: &[f64], turns: u32, residual: f64) -> Frequencies {
        let mut all = [f64::INFINITY; MOST_FREQUENCIES];
        all[..wraps.len()].copy_from_slice(wraps);
        Frequencies { wraps: all, count: wraps.len(), turns, residual: residual as f32 }
    }

    /// Range at which the phase of each frequency wraps, m, rising.
    pub fn wraps(&self) -> &[f64] {
        &self.wraps[..self.count]
    }

    /// Range at which the measurement wraps, m: where all phases wrap together.
    #[inline]
    pub fn ambiguity_range(&self) -> f64 {
        self.wraps[0] * f64::from(self.turns)
    }

    /// Phases in turns of echoes `turns` away, each with an `error`, rad.
    #[inline(always)]
    pub fn phases<const N: usize>(&self, turns: &[f64; N], error: &[f64; N]) -> [f64; N] {
        let (mut parts, mut phases) = ([0.0; N], [0.0; N]);
        for lane in 0..N {
            parts[lane] = fraction(4.0 * turns[lane]) as f32;
        }
        for lane in 0..N {
            parts[lane] = self.residual * wiggle(parts[lane]);
        }
        for lane in 0..N {
            phases[lane] = turns[lane] + (f64::from(parts[lane]) + error[lane]) * (1.0 / TAU);
        }
        phases
    }

    /// Ranges, m, on which the `phases` of the frequencies, in turns, agree best, and the greatest differences between
    /// any two of them, m.
    ///
    /// Tries every whole number of turns of the highest frequency; the one with the least squared residuals of the
    /// other phases is chosen. Then all are weighted by their precision, `f^2`.
    #[inline(always)]
    pub fn unwrap<const N: usize>(&self, phases: &[[f64; N]; MOST_FREQUENCIES]) -> ([f64; N], [f64; N]) {
        let (count, finest) = (self.count, self.wraps[0]);
        let per_turn = self.wraps.map(|wrap| finest / wrap);
        let mut first = [0.0; N];
        for lane in 0..N {
            first[lane] = phases[0][lane] - phases[0][lane].floor();
        }
        // Residuals of the other phases before any whole turn. In units of 2^-32, whole turns overflow away.
        let mut rests = [[0u32; N]; MOST_FREQUENCIES];
        for index in 1..count {
            for lane in 0..N {
                rests[index][lane] = fixed(first[lane] * per_turn[index] - phases[index][lane]);
            }
        }
        // The residual after a turn, as bits, with the turn in the lowest of them: one minimum finds both.
        let low = self.turns.next_power_of_two() - 1;
        let mut least = [u32::MAX; N];
        for turn in 0..self.turns {
            let mut left = [0.0f32; N];
            for index in 1..count {
                let more = fixed(f64::from(turn) * per_turn[index]);
                for lane in 0..N {
                    let rest = rests[index][lane].wrapping_add(more) as i32 as f32;
                    left[lane] += rest * rest;
                }
            }
            for lane in 0..N {
                least[lane] = least[lane].min((left[lane].to_bits() & !low) | turn);
            }
        }
        // How far beyond that each phase places the range.
        let weights = self.wraps.map(|wrap| 1.0 / (wrap * wrap));
        let (mut best, mut sum, mut nearest, mut farthest) = ([0.0; N], [0.0; N], [0.0f64; N], [0.0f64; N]);
        for lane in 0..N {
            best[lane] = f64::from(least[lane] & low) + first[lane];
        }
        for index in 1..count {
            let (wrap, weight) = (self.wraps[index], weights[index]);
            for lane in 0..N {
                let beyond = -fraction(best[lane] * per_turn[index] - phases[index][lane]) * wrap;
                sum[lane] += beyond * weight;
                nearest[lane] = nearest[lane].min(beyond);
                farthest[lane] = farthest[lane].max(beyond);
            }
        }
        let (ambiguity, scale) = (self.ambiguity_range(), 1.0 / weights[..count].iter().sum::<f64>());
        let (mut ranges, mut disagreements) = ([0.0; N], [0.0; N]);
        for lane in 0..N {
            let range = best[lane] * finest + sum[lane] * scale;
            // At most one wrap either way.
            let range = if range < 0.0 { range + ambiguity } else { range };
            ranges[lane] = if range >= ambiguity { range - ambiguity } else { range };
            disagreements[lane] = farthest[lane] - nearest[lane];
        }
        (ranges, disagreements)
    }
}

/// Error of the phase that four taps derive from the correlation of two square waves, rad, to 1e-7, where four times
/// the phase is `turns`, -1/2 to 1/2.
///
/// That correlation is a triangle, `cos p + cos(3 p) / 9 + cos(5 p) / 25 + ...`; four taps alias its third and fifth
/// harmonics, which gives the phasor `1 + e^(-4jp) / 9 + e^(4jp) / 25` relative to that of the first. Its angle is an
/// odd function that is 0 at both ends: a least-squares polynomial at 4000 Chebyshev nodes.
#[inline(always)]
pub fn wiggle(turns: f32) -> f32 {
    const TERMS: [f32; 7] = [-0.388_151_94, 0.015_280_537, 2.092_470_2, 2.353_244, -10.328_791, -20.083_952, 55.647_77];
    let q = turns * turns;
    let mut sum = TERMS[6];
    for term in (0..6).rev() {
        sum = sum * q + TERMS[term];
    }
    turns * (1.0 - 4.0 * q) * sum
}

/// `turns` minus the nearest whole number; exact below 2^51.
#[inline(always)]
pub fn fraction(turns: f64) -> f64 {
    const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
    turns - ((turns + WHOLE) - WHOLE)
}

/// [`fraction`] in units of 2^-32, as a signed number.
#[inline(always)]
fn fixed(turns: f64) -> u32 {
    // The lower bits of the sum hold it.
    const UNIT: f64 = 1.5 * (1u64 << 20) as f64;
    (fraction(turns) + UNIT).to_bits() as u32
}

kernels! {
    /// Actual directions of pixels with the nominal directions `from`: displaced by `normals` times `across` and
    /// `down`, in units of the focal length. Unit vectors.
    pub fn jitter_directions(from: [&[f32]; 3], across: f32, down: f32, normals: [&[f32]; 2], to: &mut [Lanes; 3]) {
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

    /// Aims rays from `from` at the points at `range` m along rays from `origin`, up to a fraction `free` of the
    /// distance.
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

    /// Multiplies by the fourth power of cosines.
    pub fn vignette(cos: &Lanes, values: &mut Lanes) {
        for lane in 0..LANES {
            let square = cos[lane].max(0.0) * cos[lane].max(0.0);
            values[lane] *= square * square;
        }
    }

    /// Multiplies by the [`light`] at angles of these cosines.
    pub fn illuminate(table: &[[f32; 2]], cos: &Lanes, values: &mut Lanes) {
        for (cos, values) in cos.as_chunks::<N>().0.iter().zip(values.as_chunks_mut::<N>().0) {
            let light = light(table, cos);
            for lane in 0..N {
                values[lane] *= light[lane];
            }
        }
    }

    /// Ranges that pixels derive from the phases of one echo each, m, from 0 to where all phases wrap together, and the
    /// greatest difference between two frequencies, m. The shot `noise`, if any, comes with a standard normal number
    /// for each frequency.
    pub fn form(
        frequencies: &Frequencies,
        noise: Option<(ShotNoise, &[Lanes; MOST_FREQUENCIES])>,
        range: &Lanes,
        power: &Lanes,
        formed: &mut Lanes,
        disagreement: &mut Lanes,
    ) {
        let per_m = frequencies.wraps.map(|wrap| 1.0 / wrap);
        for chunk in (0..LANES).step_by(N) {
            let mut sigmas = [0.0; N];
            if let Some((noise, _)) = noise {
                for lane in 0..N {
                    let power = f64::from(power[chunk + lane]);
                    sigmas[lane] = noise.sigma(power, power);
                }
            }
            let mut phases = [[0.0; N]; MOST_FREQUENCIES];
            for index in 0..frequencies.count {
                let (mut turns, mut errors) = ([0.0; N], [0.0; N]);
                for lane in 0..N {
                    turns[lane] = f64::from(range[chunk + lane]) * per_m[index];
                }
                if let Some((_, normals)) = noise {
                    for lane in 0..N {
                        errors[lane] = sigmas[lane] * f64::from(normals[index][chunk + lane]);
                    }
                }
                phases[index] = frequencies.phases(&turns, &errors);
            }
            let (ranges, disagreements) = frequencies.unwrap(&phases);
            for lane in 0..N {
                formed[chunk + lane] = ranges[lane] as f32;
                disagreement[chunk + lane] = disagreements[lane] as f32;
            }
        }
    }

    /// Measured depths along rays `axis` (cosines) off the optical axis, m of range: errors have the deviation
    /// `a + b z + c z^2` with the `terms` a, b, c, plus `slanted.0 z^slanted.1 t^2 / (pi/2 - t)^2` on surfaces at
    /// cosines of incidence `cos`; in equal steps of the disparity where `step`, the step of the depth over its square,
    /// 1/m, is above 0.
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

/// Light at angles of these cosines from a `table` of angles, rad, rising, and light: linear in between, constant
/// outside, 1 if empty.
#[inline(always)]
pub fn light<const N: usize>(table: &[[f32; 2]], cos: &[f32; N]) -> [f32; N] {
    let (Some(&[_, first]), Some(&[end, last])) = (table.first(), table.last()) else { return [1.0; N] };
    let mut angles = [0.0; N];
    for lane in 0..N {
        angles[lane] = acos(cos[lane].clamp(-1.0, 1.0));
    }
    // The ends of the table segment that each angle is in; below all, one without slope.
    let (mut from, mut step, mut light, mut rise) = ([0.0; N], [1.0; N], [first; N], [0.0; N]);
    for pair in table.windows(2) {
        let [[low, low_light], [high, high_light]] = [pair[0], pair[1]];
        for lane in 0..N {
            let above = angles[lane] > low;
            from[lane] = if above { low } else { from[lane] };
            step[lane] = if above { high - low } else { step[lane] };
            light[lane] = if above { low_light } else { light[lane] };
            rise[lane] = if above { high_light - low_light } else { rise[lane] };
        }
    }
    for lane in 0..N {
        let between = light[lane] + rise[lane] * (angles[lane] - from[lane]) / step[lane];
        light[lane] = if angles[lane] > end { last } else { between };
    }
    light
}

/// Standard deviation of a depth, m. From 85 degrees on it is that at 85 degrees: at 90 the laws are infinite, and
/// there are no measurements that far.
#[inline(always)]
pub fn depth_sigma([a, b, c]: [f32; 3], (factor, power): (f32, f32), depth: f32, cos: f32) -> f32 {
    const STEEPEST: f32 = 85.0 / 180.0 * std::f32::consts::PI;
    let mut sigma = a + depth * (b + depth * c);
    if factor > 0.0 {
        let incidence = acos(cos.clamp(0.0, 1.0)).min(STEEPEST);
        let grazing = std::f32::consts::FRAC_PI_2 - incidence;
        let ratio = incidence / grazing;
        // The only powers in use: 3/2 and -1/2.
        let root = depth.max(0.0).sqrt();
        let powered = if power > 0.0 { depth * root } else { 1.0 / root };
        sigma += factor * powered * ratio * ratio;
    }
    sigma.max(0.0)
}

/// Measured depth, m, where `depth` is true and `normal` a standard normal number. Sigma is that of the reported depth:
/// the steps themselves contribute a twelfth of their square to its variance.
#[inline(always)]
pub fn measured_depth(terms: [f32; 3], slanted: (f32, f32), per_square: f32, depth: f32, cos: f32, normal: f32) -> f32 {
    let step = per_square * depth * depth;
    let sigma = depth_sigma(terms, slanted, depth, cos);
    let noisy = depth + (sigma * sigma - step * step / 12.0).max(0.0).sqrt() * normal;
    // Disparities have equal steps, so inverse depths do too.
    let steps = (1.0 / (noisy * per_square)).round_ties_even().max(1.0);
    if per_square > 0.0 && noisy > 0.0 { 1.0 / (steps * per_square) } else { noisy.max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wiggling_is_the_angle_of_the_harmonics() {
        for i in -5000..=5000 {
            let turns = i as f32 / 10_000.0;
            let (sin, cos) = (TAU * f64::from(turns)).sin_cos();
            let exact = ((1.0 / 25.0 - 1.0 / 9.0) * sin).atan2(1.0 + (1.0 / 9.0 + 1.0 / 25.0) * cos);
            assert!((f64::from(wiggle(turns)) - exact).abs() < 1e-7, "{turns}");
        }
    }

    /// Vectors of many phases give what each phase gives by itself; many turns cost no precision.
    #[test]
    fn whole_turns_are_found() {
        // 299 and 300 MHz: 300 turns.
        let frequencies = Frequencies::new(&[0.499_654, 0.499_654 * 300.0 / 299.0], 300, 0.0);
        for step in 0..1000 {
            let range = 0.149 * f64::from(step);
            let phases = [[range / 0.499_654], [range / 0.499_654 * 299.0 / 300.0], [0.0]];
            let ([formed], [disagreement]) = frequencies.unwrap(&phases);
            assert!((formed - range).abs() < 1e-9 && disagreement < 1e-9, "{range}: {formed}");
        }
    }
}
