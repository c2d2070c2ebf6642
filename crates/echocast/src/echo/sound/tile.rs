//! What beams hear together: sums over range bins.

use super::ping::{Echoes, NO_RAY};
use crate::emitter::{Hearing, Transducer};
use crate::ground::math::exp2;
use echocast_kernels::sound::{self, BEAMS, BLOCK, HeardBlock};
use std::ops::Range;

/// No arrival: their numbers are from 1. It is 0, as memory is when nothing was heard.
pub(crate) const NOBODY: u32 = 0;

/// Adjacent beams that are heard together.
#[derive(Clone, Default)]
pub(crate) struct Tile {
    /// Beams of this tile: from `beams.0` to before `beams.1`.
    pub beams: (usize, usize),
    /// Cells of a bin: one, or [`BEAMS`], the last of which may be those of no beam.
    pub width: usize,
    /// Of a beam.
    pub bins: usize,
    /// Bins in which anything but zeros may be.
    pub heard: Range<usize>,
    /// Sums by bin, up to whole blocks of them, and beam: of amplitudes, or in `re` of energies without speckle.
    pub re: Vec<f32>,
    pub im: Vec<f32>,
    /// Energy of the strongest arrival of each cell, and its number.
    pub most: Vec<f32>,
    pub who: Vec<u32>,
    /// Energy times the angle from the beam's axis, and energy; for swaths.
    pub lean: Vec<f32>,
    pub total: Vec<f32>,
    /// Solid angle still open at each bin, sr, minus what is closed there.
    pub open: Vec<f32>,
    /// Memory: where the loudness of these beams begins for each of the hearings of a chunk; `None`: none of them hears it.
    loudness_of: Vec<Option<u32>>,
    /// Memory: the blocks of a stretch that they hear.
    audible: Vec<HeardBlock>,
}

/// What a tile determines.
#[derive(Clone, Copy)]
pub(crate) struct Wants {
    /// Where in its beam an echo lies.
    pub lean: bool,
    /// How much of the water is still in view.
    pub open: bool,
    /// Amplitudes with phases, not energies.
    pub speckle: bool,
}

impl Tile {
    /// Empties it for `beams`, in rows of `width` cells, and `bins`.
    pub fn clear(&mut self, beams: (usize, usize), width: usize, bins: usize, wants: Wants) {
        let (all, same) = (bins.next_multiple_of(BLOCK) * width, self.width == width);
        // Most of a ping is silence, and was.
        let heard = same.then_some(self.heard.start * width..self.heard.end * width);
        (self.beams, self.width, self.bins, self.heard) = (beams, width, bins, bins..0);
        let cells = |wanted: bool| if wanted { all } else { 0 };
        reset(&mut self.re, all, &heard);
        reset(&mut self.im, cells(wants.speckle), &heard);
        reset(&mut self.most, all, &heard);
        reset(&mut self.who, all, &heard);
        reset(&mut self.lean, cells(wants.lean), &heard);
        reset(&mut self.total, cells(wants.lean), &heard);
        reset(&mut self.open, cells(wants.open), &heard);
    }

    /// Whether it adds amplitudes, not energies.
    pub fn is_coherent(&self) -> bool {
        !self.im.is_empty()
    }

    /// Notes that something is heard in `bins`.
    fn note(&mut self, bins: Range<usize>) {
        widen(&mut self.heard, &bins);
    }

    /// Adds what the beams hear of a chunk.
    pub fn hear(&mut self, transducer: &Transducer, echoes: &Echoes, bin_m: f32) {
        if echoes.beams.1 <= self.beams.0 || self.beams.1 <= echoes.beams.0 {
            return;
        }
        if !self.open.is_empty() {
            for (arrival, answer) in echoes.arrivals.iter().zip(&echoes.answers) {
                if arrival.order == 0 && arrival.ray != NO_RAY {
                    self.close(transducer, arrival.ray as usize, (answer.range / bin_m) as usize);
                }
            }
        }
        if self.width == 1 { self.hear_alone(transducer, echoes) } else { self.hear_together(transducer, echoes) }
    }

    /// Adds what its only beam hears.
    fn hear_alone(&mut self, transducer: &Transducer, echoes: &Echoes) {
        for (who, answer) in (echoes.first..).zip(&echoes.answers).filter(|(_, answer)| answer.parts > 0) {
            let Hearing { first, from, .. } = transducer.hearings[answer.hearing as usize];
            if first as usize != self.beams.0 {
                continue;
            }
            let loud = transducer.loudness[from as usize];
            let parts = answer.first as usize..(answer.first + answer.parts) as usize;
            let cells = answer.bin as usize..(answer.bin + answer.parts) as usize;
            self.note(cells.clone());
            let amplitudes = [&echoes.re[parts.clone()], echoes.im.get(parts.clone()).unwrap_or_default()];
            let sums = [&mut self.re[cells.clone()], self.im.get_mut(cells.clone()).unwrap_or_default()];
            let (most, is) = (&mut self.most[cells.clone()], &mut self.who[cells]);
            sound::hear_parts(loud, amplitudes, &echoes.energy[parts], who, sums, most, is);
        }
    }

    /// Adds what its beams hear, block by block.
    fn hear_together(&mut self, transducer: &Transducer, echoes: &Echoes) {
        let Echoes { gathered, first, .. } = echoes;
        let (beams, loudness) = (self.beams, &transducer.loudness[..]);
        let Tile { re, im, most, who: is, lean, total, heard: all, loudness_of, audible, .. } = self;
        loudness_of.clear();
        loudness_of.extend(gathered.hearings.iter().map(|&hearing| {
            let Hearing { first, from, to, .. } = transducer.hearings[hearing as usize];
            let is_heard = from < to && (first as usize) < beams.1 && beams.0 < (first + to - from) as usize;
            is_heard.then(|| from + beams.0 as u32 - first)
        }));
        for (bins, which) in gathered.stretches() {
            audible.clear();
            let of = (0..).zip(&gathered.of[which.clone()]);
            audible
                .extend(of.filter_map(|(block, &of)| Some(HeardBlock { block, loudness: loudness_of[of as usize]? })));
            if audible.is_empty() {
                continue;
            }
            widen(all, &bins);
            let rows = bins.start * BEAMS..bins.end * BEAMS;
            let sums = [&mut re[rows.clone()], im.get_mut(rows.clone()).unwrap_or_default()];
            let (most, is) = (&mut most[rows.clone()], &mut is[rows.clone()]);
            sound::hear_blocks(&gathered.blocks[which.clone()], audible, loudness, *first, sums, most, is);
            if !lean.is_empty() {
                let (lean, total, energy) = (&mut lean[rows.clone()], &mut total[rows], &gathered.energy[which]);
                sound::lean_blocks(energy, audible, loudness, &transducer.beside, lean, total);
            }
        }
    }

    /// Closes the water of a bin, and behind it, to beams by the cell of a ray that meets something there.
    fn close(&mut self, transducer: &Transducer, ray: usize, bin: usize) {
        let width = self.width;
        // Uses the beams at the start, which define the open water.
        let Hearing { first, from, to, .. } = transducer.hearings[transducer.hearing[ray] as usize];
        let (first, last) = (first as usize, (first + to - from) as usize);
        let (low, high) = (first.max(self.beams.0), last.min(self.beams.1));
        if low >= high || bin >= self.bins {
            return;
        }
        self.note(bin..bin + 1);
        let loudness = &transducer.loudness[from as usize + low - first..from as usize + high - first];
        let weight = exp2(transducer.weight[ray]);
        let start = bin * width + low - self.beams.0;
        for (open, &loud) in self.open[start..start + loudness.len()].iter_mut().zip(loudness) {
            *open -= weight * loud * loud;
        }
    }
}

/// Makes a range hold another, too, and what is between them.
pub(super) fn widen(range: &mut Range<usize>, by: &Range<usize>) {
    *range = range.start.min(by.start)..range.end.max(by.end);
}

/// Makes a column of so many `cells`, all 0, as [`NOBODY`] is. If it has as many, only those `heard` are not 0 already; `None`:
/// any may be.
fn reset<T: Copy + Default>(column: &mut Vec<T>, cells: usize, heard: &Option<Range<usize>>) {
    match heard {
        Some(heard) if column.len() == cells => {
            column.get_mut(heard.clone()).unwrap_or_default().fill(T::default());
        }
        _ => {
            column.clear();
            column.resize(cells, T::default());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::echo::PingEcho;
    use crate::ground::rng::Rng;
    use glam::Vec3;

    /// Any numbers of beams and bins: what beams hear in blocks is what they hear arrival by arrival.
    #[test]
    fn beams_hear_the_sums_of_all_arrivals() {
        const ARRIVALS: usize = 300;
        for (beams, bins) in [(2, 9), (15, 64), (16, 31), (17, 50), (33, 130)] {
            let rng = Rng::new(beams as u64, 0);
            let draw =
                |index: usize, what: u32| rng.uniform_at([index as u32, what, 0], crate::ground::rng::Draw::Texture);
            let whole = |index: usize, what: u32, below: usize| (draw(index, what) * below as f32) as usize;
            // Hearings of some beams each, with silence between them.
            let mut transducer = Transducer::default();
            transducer.loudness.resize(BEAMS, 0.0);
            for hearing in 0..40 {
                let first = whole(hearing, 0, beams);
                let heard = 1 + whole(hearing, 1, beams - first);
                let from = transducer.loudness.len();
                transducer.loudness.extend((0..heard).map(|beam| draw(hearing, 100 + beam as u32) - 0.3));
                let (from, to) = (from as u32, transducer.loudness.len() as u32);
                transducer.hearings.push(Hearing { first: first as u32, from, to, part: 0 });
                transducer.loudness.resize(to as usize + BEAMS, 0.0);
            }
            // Those of line arrays are not heard by one beam each.
            transducer.flanks.push(0.0);
            transducer.beside = transducer.loudness.iter().map(|loud| 0.5 * loud).collect();
            for speckle in [true, false] {
                let mut echoes = Echoes { first: 7, ..Echoes::default() };
                for index in 0..ARRIVALS {
                    let bin = whole(index, 2, bins);
                    let parts = whole(index, 3, 12.min(bins - bin + 1));
                    let (first, hearing) = (echoes.energy.len() as u32, whole(index, 4, 40) as u32);
                    let (bin, zero) = (bin as u32, Vec3::ZERO);
                    let parts = parts as u32;
                    echoes.answers.push(PingEcho { first, parts, bin, range: 0.0, reach: 0.0, slide: zero, hearing });
                    for part in 0..parts {
                        let energy = draw(index, 200 + part);
                        echoes.energy.push(energy);
                        echoes.re.push(if speckle { energy.sqrt() - 0.4 } else { energy });
                        echoes.im.push(0.7 - energy);
                    }
                }
                let mut tile = Tile::default();
                let wants = Wants { lean: true, open: false, speckle };
                echoes.gather(&transducer, bins);
                for first in (0..beams).step_by(BEAMS) {
                    tile.clear((first, beams.min(first + BEAMS)), BEAMS, bins, wants);
                    tile.hear(&transducer, &echoes, 1.0);
                    for beam in tile.beams.0..tile.beams.1 {
                        let mut expected = vec![([0.0f64; 4], 0.0, NOBODY); bins];
                        for (index, it) in echoes.answers.iter().enumerate() {
                            let Hearing { first, from, to, .. } = transducer.hearings[it.hearing as usize];
                            if !(first..first + to - from).contains(&(beam as u32)) {
                                continue;
                            }
                            let loud = f64::from(transducer.loudness[(from + beam as u32 - first) as usize]);
                            for part in 0..it.parts {
                                let [re, im, energy] = [&echoes.re, &echoes.im, &echoes.energy]
                                    .map(|column| f64::from(column[(it.first + part) as usize]));
                                let (sums, most, who) = &mut expected[(it.bin + part) as usize];
                                let (heard, scale) = (loud * loud * energy, if speckle { loud } else { loud * loud });
                                let parts = [re * scale, im * scale, heard * 0.5 * loud, heard];
                                sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
                                if heard > *most {
                                    (*most, *who) = (heard, 7 + index as u32);
                                }
                            }
                        }
                        for (bin, (sums, most, who)) in expected.into_iter().enumerate() {
                            let cell = bin * BEAMS + beam - first;
                            let im = tile.im.get(cell).copied().unwrap_or(sums[1] as f32);
                            let found = [tile.re[cell], im, tile.lean[cell], tile.total[cell]].map(f64::from);
                            for (found, expected) in found.into_iter().zip(sums) {
                                assert!((found - expected).abs() < 1e-5, "beam {beam}, bin {bin}: {found} {expected}");
                            }
                            assert!((f64::from(tile.most[cell]) - most).abs() < 1e-6);
                            assert_eq!(tile.who[cell], who, "beam {beam} of {beams}, bin {bin}");
                        }
                    }
                }
            }
        }
    }
}
