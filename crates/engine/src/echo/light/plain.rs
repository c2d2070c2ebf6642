//! Beams all of whose rays hit one plane of one surface: their signal is one echo, found for all beams of a block side
//! by side.
//!
//! Rays that span more than the pulse sample a surface that is hit all over its span: a few of them, pulse by pulse,
//! would look like a row of echoes. With a spread `sigma_R` of the ranges the echo has the width `hypot(sigma,
//! sigma_R)`, and its peak falls as much as it widens.

use super::patchwork::Light;
use super::{Batch, BeamRays, OFF_SURFACE, Peak, Waveform};
use echocast_kernels::signal::{self, PlainSignal};
use ground::lanes::LANES;

/// Ranges that span less than this, in sigmas of the pulse, count as one.
const FINE: f32 = 1e-2;

/// The echoes of a block's plain beams.
#[derive(Default)]
pub(crate) struct PlainEchoes(PlainSignal);

/// Peak of an echo of the power `power` whose ranges have a `variance`, m^2, in addition to the pulse's `sigma`, m.
fn widened(power: f32, sigma: f32, variance: f32) -> f32 {
    power * sigma / (sigma * sigma + variance).sqrt()
}

impl PlainEchoes {
    /// The echo of the beam at `lane`, if it is plain.
    pub fn of(&self, lane: usize) -> Option<Peak> {
        self.0.is[lane].then(|| Peak { range: self.0.range[lane], power: self.0.power[lane] })
    }

    /// Reduces the echoes by `factors`.
    pub fn dim(&mut self, factors: &[f32; LANES]) {
        echocast_kernels::light::dim(&mut self.0.power, factors);
    }

    /// Declares all beams not to be plain, until they are joined.
    pub fn clear(&mut self) {
        self.0.is = [false; LANES];
    }

    /// Adds the last of `batches`, which holds the next ray of every beam, to the signals.
    pub fn add(&mut self, batches: &[Batch], origin: [&[f32; LANES]; 3], direction: [&[f32; LANES]; 3], sigma: f32) {
        let Some((Batch { hits, power, .. }, before)) = batches.split_last() else { return };
        match before {
            [] => {
                let normal = [&hits.normal_x, &hits.normal_y, &hits.normal_z];
                signal::start(&mut self.0, normal, origin, direction, &hits.range, power);
            }
            [first, ..] => {
                let (first, off) = (&first.hits.surface, OFF_SURFACE * sigma);
                signal::meet(&mut self.0, origin, direction, &hits.range, power, &hits.surface, first, off);
            }
        }
    }

    /// Finds the echoes of the beams whose rays, in `batches`, have all been added.
    pub fn finish(&mut self, batches: &[Batch], waveform: &Waveform) {
        let plain = &mut self.0;
        let sigma = waveform.sigma();
        let mut wide = [false; LANES];
        let narrow = signal::middle(plain, Waveform::NARROW * sigma, FINE * sigma, &mut wide);
        let (middle, whole) = (plain.range, plain.power);
        if narrow {
            let signals = batches.iter().map(|ray| [&ray.hits.range, &ray.power]);
            waveform.refine_narrow(signals, [&mut plain.range, &mut plain.power]);
        }
        for lane in 0..LANES {
            if wide[lane] {
                let mean = plain.moments[0][lane] / whole[lane];
                let variance = (plain.moments[1][lane] / whole[lane] - mean * mean).max(0.0);
                plain.range[lane] = middle[lane];
                plain.power[lane] = widened(whole[lane], sigma, variance);
            }
        }
    }

    /// Merges the beam at `lane`, a patchwork of `rays`, into one echo if that is all it can be: on one plane of one
    /// surface, or within a pulse.
    ///
    /// Where ranges span no more than a pulse the signal has one maximum. With the central moments `v`, `m3`, `m4` of
    /// its light over range in sigmas, it is `m3 / (2 - 3 v)` before the mean, where `E[(x - d) exp(-(x - d)^2/2)]` is 0
    /// to third order, and its height is `1 - v/2 + m4/8`, to fourth; the errors are below 2e-3 sigma and 1e-3.
    pub fn join(&mut self, rays: &BeamRays, lane: usize, sigma: f32) {
        let patchwork = &rays.patchworks[lane];
        let Some(light) = patchwork.light() else { return };
        let Light { power, mean, span } = light;
        if span <= Waveform::NARROW * sigma {
            let scale = if sigma > 0.0 { 1.0 / (sigma * sigma) } else { 0.0 };
            let [square, cube, fourth] = patchwork.moments(&light);
            let v = square * scale;
            self.0.is[lane] = true;
            self.0.range[lane] = mean - cube * scale / (2.0 - 3.0 * v);
            self.0.power[lane] = power * (1.0 - 0.5 * v + 0.125 * fourth * scale * scale);
        } else if patchwork.is_one_plane(OFF_SURFACE * sigma) {
            self.0.is[lane] = true;
            let [square, ..] = patchwork.moments(&light);
            (self.0.range[lane], self.0.power[lane]) = (mean, widened(power, sigma, square));
        }
    }
}
