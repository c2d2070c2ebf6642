//! From what beams hear to levels: noise, pulse and receiver.

use super::flanks::Flanks;
use super::response::Response;
use super::tile::{NOBODY, Tile};
use crate::emitter::Transducer;
use crate::ground::rng::{Draw, Rng};
use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use echocast_kernels::sound::{self, BEAMS, CELLS};
use echocast_kernels::tile::{self, Aside, ROWS};
use std::ops::Range;

/// What is heard besides echoes of surfaces.
pub(crate) struct Background<'a> {
    pub rng: Rng,
    /// Power of the noise in a cell, uPa^2.
    pub noise: f32,
    /// Power that a steradian of open water returns from each bin, uPa^2; empty: none.
    pub volume: &'a [f32],
    /// What comes from far beside the beams; it may say whom cells tell of that hear only that.
    pub flanks: &'a Flanks,
    pub transducer: &'a Transducer,
}

/// Memory of [`Tile::levels`].
#[derive(Clone, Default)]
pub(crate) struct LevelMemory {
    line: Line,
    rows: Rows,
}

/// Of one beam, bin by bin.
#[derive(Clone, Default)]
struct Line {
    noise_re: Vec<f32>,
    noise_im: Vec<f32>,
    /// Powers of the noise.
    hiss: Vec<f32>,
    /// Energies after the response.
    sum: Vec<f32>,
    /// What is heard, with silence on either side.
    padded: [Vec<f32>; 2],
}

/// A number of each beam of a tile in one range bin.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C, align(64))]
struct Row([f32; BEAMS]);

/// Of the beams of a tile: the last rows, as many as the response reaches to both sides, and [`ROWS`] more.
#[derive(Clone, Default)]
struct Rows {
    /// Amplitudes with noise, or energies.
    re: Vec<Row>,
    im: Vec<Row>,
    /// With energies: noise of mean power 1, and its power.
    noise_re: Vec<Row>,
    noise_im: Vec<Row>,
    hiss: Vec<Row>,
    /// Parts of the directions that the beams hear far aside, and those of them from which something comes in the rows at hand.
    parts: Vec<(usize, [f32; BEAMS])>,
    near: Vec<Aside>,
}

impl Tile {
    /// Levels of all cells, dB re 1 uPa, into `levels`, beam by beam; and whom they tell of, into `told`.
    pub fn levels(
        &self,
        response: &Response,
        background: &Background,
        memory: &mut LevelMemory,
        levels: &mut [f32],
        told: &mut [u32],
    ) {
        if self.width == 1 {
            self.levels_alone(response, background, &mut memory.line, levels);
            told.copy_from_slice(&self.who[..self.bins]);
        } else {
            self.levels_together(response, background, &mut memory.rows, levels, told);
        }
    }

    /// Levels of the only beam. It hears nothing from far aside.
    fn levels_alone(&self, response: &Response, background: &Background, line: &mut Line, levels: &mut [f32]) {
        let (bins, is_coherent) = (levels.len(), !self.im.is_empty());
        let Line { noise_re, noise_im, hiss, sum, padded: [re, im] } = line;
        for line in [&mut *noise_re, noise_im, hiss, sum] {
            line.resize(bins, 0.0);
        }
        background.rng.cell_phasors(self.beams.0 as u32, Draw::PingNoise, noise_re, noise_im);
        let mut open = [background.transducer.solid_angles[self.beams.0]];
        self.hiss(background, self.share(response), 0..bins, &mut open, hiss);
        let to_re = pad(response, bins, re);
        if is_coherent {
            let to_im = pad(response, bins, im);
            sound::add_noise(hiss, &self.re[..bins], &self.im[..bins], noise_re, noise_im, to_re, to_im);
            sound::convolve_to_db(&response.shifted, re, im, levels);
        } else {
            to_re.copy_from_slice(&self.re[..bins]);
            sound::convolve_squared(&response.shifted, re, sum);
            sound::with_noise(sum, noise_re, noise_im, hiss, levels);
            sound::to_db(levels);
        }
    }

    /// Levels of all its beams, some rows after the other.
    fn levels_together(
        &self,
        response: &Response,
        background: &Background,
        rows: &mut Rows,
        levels: &mut [f32],
        told: &mut [u32],
    ) {
        let (bins, beside) = (self.bins, response.reach());
        rows.clear(2 * beside + ROWS, !self.im.is_empty());
        background.flanks.audible(background.transducer, self.beams.0..self.beams.1, &mut rows.parts);
        let mut open = [0.0; BEAMS];
        let angles = &background.transducer.solid_angles[self.beams.0..self.beams.1];
        open[..angles.len()].copy_from_slice(angles);
        let mut out = [0.0; ROWS * BEAMS];
        // What the last rows hear is known when as many more as the response reaches have been taken in.
        for start in (0..bins + beside).step_by(ROWS) {
            rows.shift();
            self.take_in(start, background, self.share(response), &mut open, rows, told);
            let first = start.saturating_sub(beside);
            let last = (start + ROWS).saturating_sub(beside).min(bins);
            if first >= last {
                continue;
            }
            let Rows { re, im, noise_re, noise_im, hiss, .. } = &*rows;
            if im.is_empty() {
                let [noise_re, noise_im, hiss] = [noise_re, noise_im, hiss].map(|rows| cast_slice(&rows[beside..]));
                let noise = [noise_re, noise_im];
                tile::convolve_energies_to_db(&response.shifted, cast_slice(re), noise, hiss, &mut out);
            } else {
                tile::convolve_to_db(&response.shifted, cast_slice(re), cast_slice(im), &mut out);
            }
            // The first of them may lie before the first bin.
            let skipped = first + beside - start;
            let out = cast_slice(&out[skipped * BEAMS..(skipped + last - first) * BEAMS]);
            tile::put_columns(out, first, bins, cast_slice_mut(levels));
        }
    }

    /// Takes in what beams hear in the rows from `start` on, a multiple of [`ROWS`], into the last of `rows`.
    fn take_in(
        &self,
        start: usize,
        background: &Background,
        share: f32,
        open: &mut [f32; BEAMS],
        rows: &mut Rows,
        told: &mut [u32],
    ) {
        let Rows { re, im, noise_re, noise_im, hiss, parts, near } = rows;
        let last = re.len() - ROWS;
        let (bins, is_coherent) = (self.bins, !self.im.is_empty());
        let count = bins.saturating_sub(start).min(ROWS);
        for column in [&mut *re, im] {
            column.get_mut(last + count..).unwrap_or_default().fill(Row::default());
        }
        if count == 0 {
            return;
        }
        let cells = start * BEAMS..(start + count) * BEAMS;
        let mut aside = [0.0; ROWS * BEAMS];
        background.flanks.hear(parts, start, near, &mut aside);
        let mut whose = [NOBODY; ROWS * BEAMS];
        whose[..cells.len()].copy_from_slice(&self.who[cells.clone()]);
        background.flanks.tell(near, &aside, background.noise, &mut whose);
        tile::put_columns(&whose[..cells.len()], start, bins, told);

        let [mut first, mut second] = [[0.0; ROWS * BEAMS]; 2];
        background.rng.tile_phasors(self.beams.0 as u32, Draw::PingNoise, start, [&mut first, &mut second]);
        let mut powers = [0.0; ROWS * BEAMS];
        self.hiss(background, share, start..start + count, open, &mut powers);
        let (sum, to) = (&self.re[cells.clone()], cast_slice_mut(&mut re[last..]));
        if is_coherent {
            // Many scatterers are as noise.
            sound::add(1.0, &aside, &mut powers);
            sound::add_noise(&powers, sum, &self.im[cells], &first, &second, to, cast_slice_mut(&mut im[last..]));
        } else {
            to[..sum.len()].copy_from_slice(sum);
            sound::add(1.0, &aside, to);
            for (to, from) in [(noise_re, &first), (noise_im, &second), (hiss, &powers)] {
                cast_slice_mut(&mut to[last..]).copy_from_slice(from);
            }
        }
    }

    /// Powers of noise and volume backscatter in `bins` of all beams, uPa^2, and more noise up to the end of `powers`. `share`: what
    /// part of a power stands before the response. `open`: solid angle of each beam that is not closed before, sr.
    fn hiss(&self, background: &Background, share: f32, bins: Range<usize>, open: &mut [f32], powers: &mut [f32]) {
        powers.fill(background.noise * share);
        if background.volume.is_empty() {
            return;
        }
        for (bin, powers) in bins.zip(powers.chunks_exact_mut(self.width)) {
            let closed = &self.open[bin * self.width..(bin + 1) * self.width];
            for ((power, open), closed) in powers.iter_mut().zip(&mut *open).zip(closed) {
                *open += closed;
                *power += background.volume[bin] * open.max(0.0) * share;
            }
        }
    }

    /// What part of a power stands before the response.
    fn share(&self, response: &Response) -> f32 {
        let is_coherent = !self.im.is_empty();
        if is_coherent { 1.0 / response.power } else { 1.0 }
    }
}

impl Rows {
    /// Empties so many, for amplitudes or for energies.
    fn clear(&mut self, count: usize, is_coherent: bool) {
        let Rows { re, im, noise_re, noise_im, hiss, .. } = self;
        for (column, wanted) in
            [(re, true), (im, is_coherent), (noise_re, !is_coherent), (noise_im, !is_coherent), (hiss, !is_coherent)]
        {
            column.clear();
            column.resize(if wanted { count } else { 0 }, Row::default());
        }
    }

    /// Makes room for the next [`ROWS`].
    fn shift(&mut self) {
        let Rows { re, im, noise_re, noise_im, hiss, .. } = self;
        for column in [re, im, noise_re, noise_im, hiss] {
            let from = ROWS.min(column.len());
            column.copy_within(from.., 0);
        }
    }
}

/// Where a line of `bins` goes, with silence on either side, as [`sound::convolve_to_db`] wants it.
fn pad<'a>(response: &Response, bins: usize, padded: &'a mut Vec<f32>) -> &'a mut [f32] {
    let beside = response.reach();
    padded.resize(bins + 2 * beside + CELLS, 0.0);
    padded[..beside].fill(0.0);
    padded[beside + bins..].fill(0.0);
    &mut padded[beside..beside + bins]
}
