//! Beams all of whose rays hit one plane of one surface: their signal is one echo, found for all beams of a block side
//! by side.
//!
//! Rays that span more than the pulse sample a surface that is hit all over its span: a few of them, pulse by pulse,
//! would look like a row of echoes. With a spread `sigma_R` of the ranges the echo has the width `hypot(sigma,
//! sigma_R)`, and its peak falls as much as it widens.

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

    /// Merges the beam at `lane`, whose `rays` are packed, into one echo if they all hit one place of one surface.
    pub fn join(&mut self, rays: &BeamRays, lane: usize, sigma: f32) {
        let mut rays = rays.of_beam(lane);
        let Some(first) = rays.next().filter(|first| first.power() > 0.0) else { return };
        let (mut power, mut moments, mut span) = (first.power(), [0.0; 2], [0.0f32; 2]);
        for met in rays {
            if met.power() <= 0.0 || !met.is_beside(&first, OFF_SURFACE * sigma) {
                return;
            }
            let beyond = met.range() - first.range();
            power += met.power();
            moments[0] += met.power() * beyond;
            moments[1] += met.power() * beyond * beyond;
            span = [span[0].min(beyond), span[1].max(beyond)];
        }
        let mean = moments[0] / power;
        let variance = (moments[1] / power - mean * mean).max(0.0);
        // As in `finish`; between the two the signal is searched.
        let span = span[1] - span[0];
        let wide = span > Waveform::NARROW * sigma;
        if wide || span <= FINE * sigma {
            self.0.is[lane] = true;
            self.0.range[lane] = first.range() + mean;
            self.0.power[lane] = if wide { widened(power, sigma, variance) } else { power };
        }
    }
}
