//! How an instrument measures a range: errors, steps, limits.

use crate::level::kernels;
use crate::math::ln;
use crate::{LANES, Lanes, MISS};

kernels! {
    /// `values *= factor`.
    pub fn scale(values: &mut [f32], factor: f32) {
        for value in values {
            *value *= factor;
        }
    }

    /// Turns standard normal numbers into range errors with the deviation `sigma + sigma_per_m R`, combined with
    /// `timing` over the signal-to-noise ratio `rho_eff / (unit R^2)`, at least 1.
    pub fn spread(
        values: &mut [f32],
        rho_eff: &[f32],
        range: &[f32],
        sigma: f32,
        sigma_per_m: f32,
        timing: f32,
        unit: f32,
    ) {
        for ((value, &rho_eff), &range) in values.iter_mut().zip(rho_eff).zip(range) {
            *value *= variance(rho_eff, range, [sigma, sigma_per_m, timing, unit]).sqrt();
        }
    }

    /// Subtracts the distance, m, from the peak of a Gaussian echo of this `sigma`, m, to where its leading edge
    /// crosses the threshold, an effective reflectance of `unit R^2`: `sigma sqrt(2 ln(A/T))`, where sigma is half the
    /// distance that light travels in that of the pulse.
    pub fn walk(values: &mut [f32], rho_eff: &[f32], range: &[f32], sigma: f32, unit: f32) {
        for ((value, &rho_eff), &range) in values.iter_mut().zip(rho_eff).zip(range) {
            let over = rho_eff / (unit * range * range);
            *value -= sigma * (2.0 * ln(over.clamp(1.0, f32::MAX))).sqrt();
        }
    }

    /// Turns errors into measured ranges: `R gain + bias + error`, at least 0.
    pub fn measure(values: &mut [f32], range: &[f32], gain: f32, bias: f32) {
        for (value, &range) in values.iter_mut().zip(range) {
            *value = (range * gain + bias + *value).max(0.0);
        }
    }

    /// Adds noise proportional to the range; at least 0.
    pub fn add_in_proportion(values: &mut [f32], range: &[f32], noise: &[f32], sigma: f32) {
        for ((value, &range), &noise) in values.iter_mut().zip(range).zip(noise) {
            *value = (*value + sigma * range * noise).max(0.0);
        }
    }

    /// Rounds to whole steps.
    pub fn round(values: &mut [f32], step: f32) {
        let per_step = 1.0 / step;
        for value in values {
            *value = (*value * per_step).round_ties_even() * step;
        }
    }

    /// Removes the surfaces whose range is not above 0 and within `low` to `high`.
    pub fn limit(range: &Lanes, low: f32, high: f32, surface: &mut Lanes<u32>) {
        for lane in 0..LANES {
            // Written so that a miss, whose range is infinite or NaN, stays one.
            let within = (range[lane] > 0.0) & (range[lane] >= low) & (range[lane] <= high);
            surface[lane] = if within { surface[lane] } else { MISS };
        }
    }

    /// [`limit`] with bounds for each lane.
    pub fn limit_each(range: &Lanes, low: &Lanes, high: &Lanes, surface: &mut Lanes<u32>) {
        for lane in 0..LANES {
            let within = (range[lane] > 0.0) & (range[lane] >= low[lane]) & (range[lane] <= high[lane]);
            surface[lane] = if within { surface[lane] } else { MISS };
        }
    }

    /// Removes the surfaces whose chance is below `probability`.
    pub fn lose(chance: &[f32], probability: f32, surface: &mut Lanes<u32>) {
        for (surface, &chance) in surface.iter_mut().zip(chance) {
            *surface = if chance < probability { MISS } else { *surface };
        }
    }

    /// `to = origin + direction range`.
    pub fn place(origin: &[f32], direction: &[f32], range: &[f32], to: &mut [f32]) {
        for (((to, origin), direction), range) in to.iter_mut().zip(origin).zip(direction).zip(range) {
            *to = origin + direction * range;
        }
    }
}

/// Variance of a range, m^2, as in [`spread`].
#[inline(always)]
pub fn variance(rho_eff: f32, range: f32, [sigma, sigma_per_m, timing, unit]: [f32; 4]) -> f32 {
    let timing = if timing > 0.0 { timing / (rho_eff / (unit * range * range)).max(1.0) } else { 0.0 };
    let sigma = sigma + sigma_per_m * range;
    sigma * sigma + timing * timing
}
