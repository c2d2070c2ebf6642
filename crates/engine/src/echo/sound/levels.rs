//! From what beams receive to levels: noise, pulse and receiver.

use super::flanks::{Audible, Flanks};
use super::response::Response;
use super::tile::{NO_CONTRIBUTOR, Tile};
use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use echocast_kernels::sound::{self, BEAMS, CELLS};
use echocast_kernels::tile::{self, ROWS, SideLobePart};
use emitter::Transducer;
use ground::rng::{Draw, Rng};
use std::ops::Range;

/// What is received in addition to echoes of surfaces.
pub struct Background<'a> {
    pub rng: Rng,
    /// Power of the noise in a cell, uPa^2.
    pub noise: f32,
    /// Power that a steradian of open water returns from each bin, uPa^2; empty: none.
    pub volume: &'a [f32],
    /// Energy from far beside the beams, and the contributors of cells that receive only that, if requested.
    pub flanks: &'a Flanks,
    pub transducer: &'a Transducer,
}

/// Buffers of [`Tile::levels`].
#[derive(Default)]
pub(crate) struct LevelMemory {
    line: BeamLine,
    window: Window,
}

/// Buffers of one beam, bin by bin.
#[derive(Default)]
struct BeamLine {
    noise_re: Vec<f32>,
    noise_im: Vec<f32>,
    /// Powers of the noise.
    hiss: Vec<f32>,
    /// What is received, padded with zeros on either side.
    padded: [Vec<f32>; 2],
}

/// One number per beam of a tile in one range bin; aligned to a cache line, so that no vector straddles two.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C, align(64))]
struct LevelRow([f32; BEAMS]);

/// The last rows of the beams of a tile: as many as the response reaches to both sides, and [`ROWS`] more.
#[derive(Default)]
struct Window {
    /// Taps of the response, by cell.
    taps: Vec<(u32, f32)>,
    /// Amplitudes with noise, or energies.
    re: Vec<LevelRow>,
    im: Vec<LevelRow>,
    /// With energies: noise of mean power 1, and its power.
    noise_re: Vec<LevelRow>,
    noise_im: Vec<LevelRow>,
    hiss: Vec<LevelRow>,
    /// Sectors of directions that the beams receive far off axis, and those of them that have energy in the current
    /// rows.
    parts: Vec<Audible>,
    near: Vec<SideLobePart>,
}

impl Tile {
    /// Levels of all cells in dB re 1 uPa, beam by beam, into `levels`; the strongest contributor of each cell into
    /// `contributors`.
    pub fn levels(
        &self,
        response: &Response,
        background: &Background,
        memory: &mut LevelMemory,
        levels: &mut [f32],
        contributors: &mut [u32],
    ) {
        if self.width == 1 {
            self.levels_alone(response, background, &mut memory.line, levels);
            contributors.copy_from_slice(&self.who[..self.bins]);
        } else {
            self.levels_together(response, background, &mut memory.window, levels, contributors);
        }
    }

    /// Levels of a tile of one beam: see [`Transducer::beams_are_apart`]. Such beams have no flanks.
    fn levels_alone(&self, response: &Response, background: &Background, line: &mut BeamLine, levels: &mut [f32]) {
        let bins = self.bins;
        let BeamLine { noise_re, noise_im, hiss, padded: [re, im] } = line;
        for line in [&mut *noise_re, noise_im, hiss] {
            line.resize(bins + CELLS, 0.0);
        }
        // The padding beyond the last bin needs none.
        let [to_re, to_im] = [&mut *noise_re, noise_im].map(|noise| &mut noise[..bins]);
        background.rng.cell_phasors(self.beams.0 as u32, Draw::PingNoise, to_re, to_im);
        let mut open = [background.transducer.solid_angles[self.beams.0]];
        self.hiss(background, self.share(response), 0..bins, &mut open, hiss);
        let to_re = pad(response, bins, re);
        let taps = &response.shifted;
        if self.is_coherent() {
            let to_im = pad(response, bins, im);
            sound::add_noise(hiss, &self.re[..bins], &self.im[..bins], noise_re, noise_im, to_re, to_im);
            sound::convolve_to_db(taps, re, im, levels);
        } else {
            to_re.copy_from_slice(&self.re[..bins]);
            sound::convolve_energies_to_db(taps, re, [noise_re, noise_im], hiss, levels);
        }
    }

    /// Levels of all its beams, a few rows at a time.
    fn levels_together(
        &self,
        response: &Response,
        background: &Background,
        window: &mut Window,
        levels: &mut [f32],
        contributors: &mut [u32],
    ) {
        let (bins, beside) = (self.bins, response.reach());
        window.clear(2 * beside + ROWS, self.is_coherent());
        window.taps.clear();
        window.taps.extend(response.shifted.iter().map(|&(bin, tap)| (bin * BEAMS as u32, tap)));
        background.flanks.audible(background.transducer, self.beams.0..self.beams.1, &mut window.parts);
        let mut open = [0.0; BEAMS];
        let angles = &background.transducer.solid_angles[self.beams.0..self.beams.1];
        open[..angles.len()].copy_from_slice(angles);
        let mut out = [0.0; ROWS * BEAMS];
        // The last rows are complete once as many more as the response reaches have been loaded.
        for start in (0..bins + beside).step_by(ROWS) {
            window.shift();
            self.load_rows(start, background, self.share(response), &mut open, window, contributors);
            let first = start.saturating_sub(beside);
            let last = (start + ROWS).saturating_sub(beside).min(bins);
            if first >= last {
                continue;
            }
            let Window { taps, re, im, noise_re, noise_im, hiss, .. } = &*window;
            if self.is_coherent() {
                sound::convolve_to_db(taps, cast_slice(re), cast_slice(im), &mut out);
            } else {
                let [noise_re, noise_im, hiss] = [noise_re, noise_im, hiss].map(|rows| cast_slice(&rows[beside..]));
                sound::convolve_energies_to_db(taps, cast_slice(re), [noise_re, noise_im], hiss, &mut out);
            }
            // The first of them may be before the first bin.
            let skipped = first + beside - start;
            let out = cast_slice(&out[skipped * BEAMS..(skipped + last - first) * BEAMS]);
            tile::put_columns(out, first, bins, cast_slice_mut(levels));
        }
    }

    /// Loads what beams receive in the rows from `start` on, a multiple of [`ROWS`], into the last rows of `window`,
    /// with zeros beyond the last bin; the strongest contributors of these cells into `contributors`.
    fn load_rows(
        &self,
        start: usize,
        background: &Background,
        share: f32,
        open: &mut [f32; BEAMS],
        window: &mut Window,
        contributors: &mut [u32],
    ) {
        let Window { re, im, noise_re, noise_im, hiss, parts, near, .. } = window;
        let last = re.len() - ROWS;
        let bins = self.bins;
        let count = bins.saturating_sub(start).min(ROWS);
        for column in [&mut *re, im] {
            column.get_mut(last + count..).unwrap_or_default().fill(LevelRow::default());
        }
        if count == 0 {
            return;
        }
        let cells = start * BEAMS..(start + count) * BEAMS;
        let mut aside = [0.0; ROWS * BEAMS];
        background.flanks.receive(parts, start, near, &mut aside);
        let mut tile_contributors = [NO_CONTRIBUTOR; ROWS * BEAMS];
        tile_contributors[..cells.len()].copy_from_slice(&self.who[cells.clone()]);
        background.flanks.label(near, &aside, background.noise, &mut tile_contributors);
        tile::put_columns(&tile_contributors[..cells.len()], start, bins, contributors);

        let [mut first, mut second] = [[0.0; ROWS * BEAMS]; 2];
        background.rng.tile_phasors(self.beams.0 as u32, Draw::PingNoise, start, [&mut first, &mut second]);
        let mut powers = [0.0; ROWS * BEAMS];
        self.hiss(background, share, start..start + count, open, &mut powers);
        let (sum, to) = (&self.re[cells.clone()], cast_slice_mut(&mut re[last..]));
        if self.is_coherent() {
            // Many scatterers are like noise.
            sound::add(&aside, &mut powers);
            sound::add_noise(&powers, sum, &self.im[cells], &first, &second, to, cast_slice_mut(&mut im[last..]));
        } else {
            to[..sum.len()].copy_from_slice(sum);
            sound::add(&aside, to);
            for (to, from) in [(noise_re, &first), (noise_im, &second), (hiss, &powers)] {
                cast_slice_mut(&mut to[last..]).copy_from_slice(from);
            }
        }
    }

    /// Powers of noise and volume backscatter in `bins` of all beams, uPa^2, times `share`; beyond them only noise.
    /// `open`: unobstructed solid angle of each beam before these bins, sr; becomes that after them.
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

    /// Scale of the noise: that of amplitudes is added before the response, which multiplies its power by
    /// [`Response::power`]; that of energies after it.
    fn share(&self, response: &Response) -> f32 {
        if self.is_coherent() { 1.0 / response.power } else { 1.0 }
    }
}

impl Window {
    /// Clears `count` rows, for amplitudes or for energies.
    fn clear(&mut self, count: usize, is_coherent: bool) {
        let Window { re, im, noise_re, noise_im, hiss, .. } = self;
        for (column, needed) in
            [(re, true), (im, is_coherent), (noise_re, !is_coherent), (noise_im, !is_coherent), (hiss, !is_coherent)]
        {
            column.clear();
            column.resize(if needed { count } else { 0 }, LevelRow::default());
        }
    }

    /// Makes room for the next [`ROWS`].
    fn shift(&mut self) {
        let Window { re, im, noise_re, noise_im, hiss, .. } = self;
        for column in [re, im, noise_re, noise_im, hiss] {
            let from = ROWS.min(column.len());
            column.copy_within(from.., 0);
        }
    }
}

/// The slice for a line of `bins`, padded with zeros on either side as [`sound::convolve_to_db`] requires.
fn pad<'a>(response: &Response, bins: usize, padded: &'a mut Vec<f32>) -> &'a mut [f32] {
    let beside = response.reach();
    padded.resize(bins + 2 * beside + CELLS, 0.0);
    padded[..beside].fill(0.0);
    padded[beside + bins..].fill(0.0);
    &mut padded[beside..beside + bins]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::echo::{Taper, TileQuantities};

    /// For any numbers of beams and bins, and any reach of the response.
    #[test]
    fn beams_have_together_the_levels_that_each_has_alone() {
        let rng = Rng::new(3, 1);
        let flanks = Flanks::default();
        // Reaches of 0, 17 and 85 bins.
        for (bin, modulated) in [(2.0, false), (0.5, true), (0.1, true)] {
            let response = Response::new(bin, modulated, Taper::None).unwrap();
            for (bins, beams) in [(1, 1), (3, 16), (31, 2), (33, 16), (64, 15), (100, 5)] {
                for speckle in [true, false] {
                    let mut transducer = Transducer::default();
                    transducer.solid_angles.resize(16 + beams, 0.1);
                    let volume: Vec<f32> = (0..bins).map(|bin| 3.0 + bin as f32).collect();
                    let (volume, transducer) = (&volume[..], &transducer);
                    let background = Background { rng, noise: 2.0, volume, flanks: &flanks, transducer };
                    let quantities = TileQuantities { moment: false, open: true, speckle };
                    let mut tile = Tile::default();
                    tile.clear((16, 16 + beams), BEAMS, bins, quantities);
                    for cell in 0..bins * BEAMS {
                        let value = (cell * 7919 % 101) as f32;
                        (tile.re[cell], tile.who[cell], tile.open[cell]) = (value, cell as u32, -1e-5 * value);
                        if speckle {
                            tile.im[cell] = 50.0 - value;
                        }
                    }
                    let (mut levels, mut found_contributors) = (vec![0.0; beams * bins], vec![0; beams * bins]);
                    let mut memory = LevelMemory::default();
                    // Twice: the buffers have served another tile before.
                    for _ in 0..2 {
                        tile.levels(&response, &background, &mut memory, &mut levels, &mut found_contributors);
                    }
                    for beam in 0..beams {
                        let mut alone = Tile::default();
                        alone.clear((16 + beam, 17 + beam), 1, bins, quantities);
                        for bin in 0..bins {
                            let cell = bin * BEAMS + beam;
                            (alone.re[bin], alone.who[bin], alone.open[bin]) =
                                (tile.re[cell], tile.who[cell], tile.open[cell]);
                            if speckle {
                                alone.im[bin] = tile.im[cell];
                            }
                        }
                        let (mut line, mut who) = (vec![0.0; bins], vec![0; bins]);
                        alone.levels(&response, &background, &mut memory, &mut line, &mut who);
                        let cells = beam * bins..(beam + 1) * bins;
                        assert_eq!(levels[cells.clone()], line, "beam {beam} of {beams}, {bins} bins");
                        assert_eq!(found_contributors[cells], who, "beam {beam} of {beams}, {bins} bins");
                    }
                }
            }
        }
    }
}
