//! Returning light: incidence, intensity, detection.

use crate::level::kernels;
use crate::math::{exp_negative, ln};
use crate::{LANES, Lanes, MISS};
use std::f32::consts::PI;

/// Natural logarithm of the effective reflectance that gives 255 in [`eight_bits`].
const LN_1000: f32 = 6.907_755;

/// Least cosine of incidence.
const LEAST_COS: f32 = 1e-7;

/// Reflectance in equal steps up to `white` for 1, and above it in equal steps of the logarithm, 255 for 1000 and more.
#[inline(always)]
pub fn eight_bits(rho: f32, cos: f32, white: f32) -> f32 {
    let diffuse = white * rho * cos;
    let retro = white + 1.0 + ((254.0 - white) / LN_1000 * ln((rho * cos).max(1.0))).round_ties_even();
    if diffuse > white { retro.min(255.0) } else { diffuse.round_ties_even() }
}

/// Reflectance in percent, 255 at most.
#[inline(always)]
pub fn percent(rho: f32, cos: f32) -> f32 {
    let percent = (100.0 * rho * cos).round_ties_even();
    if percent > 255.0 { 255.0 } else { percent }
}

/// `value / (pi R^2)`.
#[inline(always)]
pub fn power(value: f32, range: f32) -> f32 {
    value / (PI * range * range)
}

kernels! {
    /// Turns normals of any length into unit vectors that face rays in the directions `rays`, and computes the cosines
    /// of incidence, never 0: a surface is always hit from one side.
    pub fn face(normals: [&mut Lanes; 3], rays: [&Lanes; 3], cos: &mut Lanes) {
        let [nx, ny, nz] = normals;
        let [dx, dy, dz] = rays;
        for lane in 0..LANES {
            let n = [nx[lane], ny[lane], nz[lane]];
            let along = n[0] * dx[lane] + n[1] * dy[lane] + n[2] * dz[lane];
            let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
            let scale = if along > 0.0 { -1.0 } else { 1.0 } / length;
            nx[lane] = n[0] * scale;
            ny[lane] = n[1] * scale;
            nz[lane] = n[2] * scale;
            let cosine = (-along * scale).min(1.0);
            cos[lane] = if cosine > LEAST_COS { cosine } else { LEAST_COS };
        }
    }

    /// `to = a b`.
    pub fn product(a: &Lanes, b: &Lanes, to: &mut Lanes) {
        for lane in 0..LANES {
            to[lane] = a[lane] * b[lane];
        }
    }

    /// `to = a / b^2`.
    pub fn over_squares(a: &Lanes, b: &Lanes, to: &mut Lanes) {
        for lane in 0..LANES {
            to[lane] = a[lane] / (b[lane] * b[lane]);
        }
    }

    /// `values *= factors`.
    pub fn dim(values: &mut Lanes, factors: &Lanes) {
        for lane in 0..LANES {
            values[lane] *= factors[lane];
        }
    }

    /// [`eight_bits`] of each lane.
    pub fn to_eight_bits(rho: &Lanes, cos: &Lanes, white: f32, to: &mut Lanes) {
        for lane in 0..LANES {
            to[lane] = eight_bits(rho[lane], cos[lane], white);
        }
    }

    /// [`percent`] of each lane.
    pub fn to_percent(rho: &Lanes, cos: &Lanes, to: &mut Lanes) {
        for lane in 0..LANES {
            to[lane] = percent(rho[lane], cos[lane]);
        }
    }

    /// [`power`] of `rho cos`.
    pub fn to_power(rho: &Lanes, cos: &Lanes, range: &Lanes, to: &mut Lanes) {
        for lane in 0..LANES {
            to[lane] = power(rho[lane] * cos[lane], range[lane]);
        }
    }

    /// [`power`] of `rho`.
    pub fn to_power_without_cosine(rho: &Lanes, range: &Lanes, to: &mut Lanes) {
        for lane in 0..LANES {
            to[lane] = power(rho[lane], range[lane]);
        }
    }

    /// What an echo must exceed to be stronger than a surface, of which a channel uses the fraction `efficiency` of the
    /// light, and than `faintest`: `rho_eff / R^2`, 1/m^2.
    pub fn least(
        surface: &Lanes<u32>,
        rho_eff: &Lanes,
        range: &Lanes,
        efficiency: &Lanes,
        faintest: f32,
        least: &mut Lanes,
    ) {
        for lane in 0..LANES {
            let own = rho_eff[lane] / (range[lane] * range[lane] * efficiency[lane]);
            least[lane] = if (surface[lane] != MISS) & (own > faintest) { own } else { faintest };
        }
    }

    /// Whether an effective reflectance reaches `k R^2`.
    pub fn over_square(k: f32, rho_eff: &Lanes, range: &Lanes, seen: &mut Lanes<bool>) {
        for lane in 0..LANES {
            seen[lane] = rho_eff[lane] >= k * range[lane] * range[lane];
        }
    }

    /// Whether an effective reflectance exceeds `limit + slope (R - from)`; nearer than `from` all do.
    pub fn over_line(from: f32, limit: f32, slope: f32, rho_eff: &Lanes, range: &Lanes, seen: &mut Lanes<bool>) {
        for lane in 0..LANES {
            seen[lane] = (range[lane] < from) | (rho_eff[lane] > limit + slope * (range[lane] - from));
        }
    }

    /// Whether an effective reflectance reaches `unit R^2 (level - sigma noise)`, and `unit R^2 least` at least.
    pub fn over_noise(
        unit: f32,
        level: f32,
        sigma: f32,
        least: f32,
        rho_eff: &Lanes,
        range: &Lanes,
        noise: &Lanes,
        seen: &mut Lanes<bool>,
    ) {
        for lane in 0..LANES {
            let needed = (level - sigma * noise[lane]).max(least);
            seen[lane] = rho_eff[lane] >= unit * needed * range[lane] * range[lane];
        }
    }

    /// Removes the surfaces that are not `seen`, and their intensities.
    pub fn forget(seen: &Lanes<bool>, surface: &mut Lanes<u32>, intensity: &mut Lanes) {
        for lane in 0..LANES {
            intensity[lane] = if seen[lane] { intensity[lane] } else { 0.0 };
            surface[lane] = if seen[lane] { surface[lane] } else { MISS };
        }
    }

    /// Removes the surfaces that are not `valid`.
    pub fn keep(valid: &Lanes<bool>, surface: &mut Lanes<u32>) {
        for lane in 0..LANES {
            surface[lane] = if valid[lane] { surface[lane] } else { MISS };
        }
    }

    /// `depth += extinction max(min(length, end) - start, 0)`.
    pub fn add_depth(extinction: f32, start: f32, end: f32, length: &Lanes, depth: &mut Lanes) {
        for lane in 0..LANES {
            depth[lane] += extinction * (length[lane].min(end) - start).max(0.0);
        }
    }

    /// `depth += extinction length`.
    pub fn add_depth_all_over(extinction: f32, length: &Lanes, depth: &mut Lanes) {
        for lane in 0..LANES {
            depth[lane] += extinction * length[lane];
        }
    }

    /// `depth += extinction max(to - from, 0)`.
    pub fn add_depth_between(extinction: f32, from: &Lanes, to: &Lanes, depth: &mut Lanes) {
        for lane in 0..LANES {
            depth[lane] += extinction * (to[lane] - from[lane]).max(0.0);
        }
    }

    /// Turns one-way optical depths into two-way transmittances.
    pub fn transmit(depth: &mut Lanes) {
        for value in depth {
            *value = exp_negative(2.0 * *value);
        }
    }

    /// Where rays enter and leave a box, within `0 .. to`; they miss it where `from >= to`.
    pub fn cross_box(
        min: [f32; 3],
        max: [f32; 3],
        origin: [&Lanes; 3],
        direction: [&Lanes; 3],
        from: &mut Lanes,
        to: &mut Lanes,
    ) {
        for axis in 0..3 {
            for lane in 0..LANES {
                let (place, slope) = (origin[axis][lane], direction[axis][lane]);
                let a = (min[axis] - place) / slope;
                let b = (max[axis] - place) / slope;
                // Parallel to a pair of faces, which count as inside.
                let within = (place >= min[axis]) & (place <= max[axis]);
                let never = if within { f32::NEG_INFINITY } else { f32::INFINITY };
                let (near, far) = if slope == 0.0 { (never, f32::INFINITY) } else { (a.min(b), a.max(b)) };
                from[lane] = from[lane].max(near);
                to[lane] = to[lane].min(far);
            }
        }
    }

    /// What a ray adds to the signal of its beam: replaces `power`, its share of the beam, by `power rho cos / R^2`; 0
    /// where it hits nothing.
    pub fn contribute(
        surface: &Lanes<u32>,
        range: &Lanes,
        reflectance: &Lanes,
        cos: &Lanes,
        efficiency: &Lanes,
        power: &mut Lanes,
    ) {
        for lane in 0..LANES {
            let value = power[lane] * reflectance[lane] * cos[lane] / (range[lane] * range[lane]);
            // A miss has no incidence; rays that start on a surface have no range.
            let met = (surface[lane] != MISS) & value.is_finite();
            power[lane] = if met { value * efficiency[lane] } else { 0.0 };
        }
    }

    /// One step of Newton's method towards the maxima of signals side by side: adds the terms of parts at `ranges` with
    /// `powers`, in sigmas from the positions `at`, `scale` = 1/sigma.
    pub fn add_terms(
        scale: f32,
        ranges: &Lanes,
        powers: &Lanes,
        at: &Lanes,
        sum: &mut Lanes,
        first: &mut Lanes,
        second: &mut Lanes,
    ) {
        for lane in 0..LANES {
            let x = (ranges[lane] - at[lane]) * scale;
            // No farther than in the lanes that count; the others are not used.
            let weight = powers[lane] * exp_negative(0.5 * (x * x).min(8.0));
            sum[lane] += weight;
            first[lane] += weight * x;
            second[lane] += weight * x * x;
        }
    }

    /// The step itself, from the sums of [`add_terms`].
    pub fn step(sigma: f32, sum: &Lanes, first: &Lanes, second: &Lanes, at: &mut Lanes) {
        for lane in 0..LANES {
            let mean = first[lane] / sum[lane];
            let bend = 1.0 - (second[lane] / sum[lane] - mean * mean);
            at[lane] += mean / bend.max(0.1) * sigma;
        }
    }
}
