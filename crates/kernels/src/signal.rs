//! Signals of beams whose sub-rays all hit one place of one surface.

use crate::level::kernels;
use crate::math::{exp_negative, sum};
use crate::{LANES, Lanes};

/// Sums are formed in this many rows.
const ROWS: usize = 16;

/// Hits of the sub-rays of each beam, accumulated ray by ray.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct PlainSignal {
    /// Range of the first ray, m; finally that of the echo.
    pub range: Lanes,
    /// Sum of the powers, 1/m^2; finally that of the echo.
    pub power: Lanes,
    /// Sums of range and its square, times power, relative to the range of the first ray.
    pub moments: [Lanes; 2],
    nearest: Lanes,
    farthest: Lanes,
    /// Plane of the surface that the first ray hits: `normal . place = offset`.
    normal: [Lanes; 3],
    offset: Lanes,
    /// Whether a lane is such a beam.
    pub is: Lanes<bool>,
}

impl Default for PlainSignal {
    fn default() -> Self {
        PlainSignal {
            range: [0.0; LANES],
            power: [0.0; LANES],
            moments: [[0.0; LANES]; 2],
            nearest: [0.0; LANES],
            farthest: [0.0; LANES],
            normal: [[0.0; LANES]; 3],
            offset: [0.0; LANES],
            is: [false; LANES],
        }
    }
}

impl PlainSignal {
    /// Position along the normal of a ray from `origin` at its range, m.
    #[inline(always)]
    fn along(&self, lane: usize, origin: [&Lanes; 3], direction: [&Lanes; 3], range: f32) -> f32 {
        self.normal[0][lane] * (origin[0][lane] + direction[0][lane] * range)
            + self.normal[1][lane] * (origin[1][lane] + direction[1][lane] * range)
            + self.normal[2][lane] * (origin[2][lane] + direction[2][lane] * range)
    }
}

kernels! {
    /// Starts with the first ray of every beam.
    pub fn start(
        plain: &mut PlainSignal,
        normal: [&Lanes; 3],
        origin: [&Lanes; 3],
        direction: [&Lanes; 3],
        range: &Lanes,
        power: &Lanes,
    ) {
        plain.normal = normal.map(|axis| *axis);
        (plain.range, plain.nearest, plain.farthest, plain.power) = (*range, *range, *range, *power);
        plain.moments = [[0.0; LANES]; 2];
        for lane in 0..LANES {
            plain.offset[lane] = plain.along(lane, origin, direction, range[lane]);
            plain.is[lane] = power[lane] > 0.0;
        }
    }

    /// Adds the hit of one more ray, with its `surface`; `first` is that of the first ray. A hit more than `off` m off
    /// its plane is at another place.
    pub fn meet(
        plain: &mut PlainSignal,
        origin: [&Lanes; 3],
        direction: [&Lanes; 3],
        range: &Lanes,
        power: &Lanes,
        surface: &Lanes<u32>,
        first: &Lanes<u32>,
        off: f32,
    ) {
        for lane in 0..LANES {
            let along = plain.along(lane, origin, direction, range[lane]);
            let (range, power) = (range[lane], power[lane]);
            let same = surface[lane] == first[lane];
            let near = (along - plain.offset[lane]).abs() <= off;
            plain.is[lane] &= same & near & (power > 0.0);
            plain.power[lane] += power;
            let beyond = range - plain.range[lane];
            plain.moments[0][lane] += power * beyond;
            plain.moments[1][lane] += power * beyond * beyond;
            plain.nearest[lane] = plain.nearest[lane].min(range);
            plain.farthest[lane] = plain.farthest[lane].max(range);
        }
    }

    /// Replaces the range of the first ray by the mean range. `wide`: the rays span more than `narrow` m. Returns
    /// whether any beam spans more than `fine` m.
    pub fn middle(plain: &mut PlainSignal, narrow: f32, fine: f32, wide: &mut Lanes<bool>) -> bool {
        let mut any = false;
        for lane in 0..LANES {
            let span = plain.farthest[lane] - plain.nearest[lane];
            // Closer together there is nothing to refine: the echo is at their mean.
            any |= plain.is[lane] & (span > fine);
            wide[lane] = span > narrow;
            if span > 0.0 {
                plain.range[lane] += plain.moments[0][lane] / plain.power[lane];
            }
        }
        any
    }

    /// Sum over the pulses at `ranges`, with the peak `powers`, of what they contribute at the range `at`, and of that
    /// times `x` and `x^2`, where `x` is how far behind it a pulse is, times `scale`, one over the pulse's standard
    /// deviation. Both slices have the same length.
    pub fn pull(ranges: &[f32], powers: &[f32], at: f32, scale: f32) -> [f32; 3] {
        // Sums in as many rows at every level: the order of additions does not depend on it.
        let mut sums = [[0.0; ROWS]; 3];
        let mut add = |ranges: &[f32; ROWS], powers: &[f32; ROWS]| {
            for row in 0..ROWS {
                let x = (ranges[row] - at) * scale;
                let weight = powers[row] * exp_negative(0.5 * x * x);
                sums[0][row] += weight;
                sums[1][row] += weight * x;
                sums[2][row] += weight * x * x;
            }
        };
        let ((ranges, last), (powers, last_powers)) = (ranges.as_chunks(), powers.as_chunks());
        ranges.iter().zip(powers).for_each(|(ranges, powers)| add(ranges, powers));
        if !last.is_empty() {
            let (mut ranges, mut powers) = ([at; ROWS], [0.0; ROWS]);
            ranges[..last.len()].copy_from_slice(last);
            powers[..last.len()].copy_from_slice(&last_powers[..last.len()]);
            add(&ranges, &powers);
        }
        sums.map(sum)
    }

    /// Fills `bins` with `parts` convolved with `pulse`, whose middle is that many parts before the first bin's: bin `i`
    /// is the sum of `pulse[k] parts[i + k]`. There are as many parts as bins, and one less than the pulse is long.
    pub fn convolve(parts: &[f32], pulse: &[f32], bins: &mut [f32]) {
        let count = bins.len();
        bins.fill(0.0);
        for (shift, &height) in pulse.iter().enumerate() {
            for (bin, part) in bins.iter_mut().zip(&parts[shift..shift + count]) {
                *bin += height * part;
            }
        }
    }
}
