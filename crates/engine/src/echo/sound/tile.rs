//! What adjacent beams receive: sums by range bin.

use super::blocks::widen;
use super::echo::NO_RAY;
use super::echoes::Echoes;
use echocast_kernels::sound::{self, BEAMS, BLOCK, ReceivedBlock};
use emitter::{ReceivingBeams, Transducer};
use ground::math::exp2;
use std::ops::Range;

/// No arrival: arrivals are numbered from 1. It is 0, like the memory of cells that receive nothing.
pub(crate) const NO_CONTRIBUTOR: u32 = 0;

/// Adjacent beams that are processed together.
#[derive(Clone, Default)]
pub(crate) struct Tile {
    /// Beams of this tile: from `beams.0` to before `beams.1`.
    pub beams: (usize, usize),
    /// Cells per bin: one, or [`BEAMS`], the last of which may be those of no beam.
    pub width: usize,
    /// Bins per beam.
    pub bins: usize,
    /// Bins that may contain anything but zeros.
    pub received: Range<usize>,
    /// Sums by bin, up to whole blocks of them, and beam: of amplitudes, or in `re` of energies without speckle.
    pub re: Vec<f32>,
    pub im: Vec<f32>,
    /// Energy of the strongest arrival of each cell, and its number.
    pub most: Vec<f32>,
    pub who: Vec<u32>,
    /// Energy times the angle from the beam's axis, and energy; for swaths.
    pub moment: Vec<f32>,
    pub total: Vec<f32>,
    /// Change of the unobstructed solid angle at each bin, sr: minus what is blocked there.
    pub open: Vec<f32>,
    /// Buffer: where the gains of these beams begin for each of the hearings of a chunk; `None`: none of them receives
    /// it.
    loudness_of: Vec<Option<u32>>,
    /// Buffer: the blocks of a stretch that they receive.
    audible: Vec<ReceivedBlock>,
}

/// Which quantities a tile determines.
#[derive(Clone, Copy)]
pub(crate) struct TileQuantities {
    /// Where in its beam an echo is.
    pub moment: bool,
    /// How much of the water is still in view.
    pub open: bool,
    /// Amplitudes with phases, not energies.
    pub speckle: bool,
}

impl Tile {
    /// Clears it for `beams`, in rows of `width` cells, and `bins`.
    pub fn clear(&mut self, beams: (usize, usize), width: usize, bins: usize, quantities: TileQuantities) {
        let (all, same) = (bins.next_multiple_of(BLOCK) * width, self.width == width);
        // Most cells of a ping are zero, and were before.
        let received = same.then_some(self.received.start * width..self.received.end * width);
        (self.beams, self.width, self.bins, self.received) = (beams, width, bins, bins..0);
        let cells = |needed: bool| if needed { all } else { 0 };
        reset(&mut self.re, all, &received);
        reset(&mut self.im, cells(quantities.speckle), &received);
        reset(&mut self.most, all, &received);
        reset(&mut self.who, all, &received);
        reset(&mut self.moment, cells(quantities.moment), &received);
        reset(&mut self.total, cells(quantities.moment), &received);
        reset(&mut self.open, cells(quantities.open), &received);
    }

    /// Whether it adds amplitudes, not energies.
    pub fn is_coherent(&self) -> bool {
        !self.im.is_empty()
    }

    /// Records that something is received in `bins`.
    fn note(&mut self, bins: Range<usize>) {
        widen(&mut self.received, &bins);
    }

    /// Adds what the beams receive from a chunk.
    pub fn receive(&mut self, transducer: &Transducer, echoes: &Echoes, bin_m: f32) {
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
        if self.width == 1 { self.receive_alone(transducer, echoes) } else { self.receive_together(transducer, echoes) }
    }

    /// Adds what its only beam receives.
    fn receive_alone(&mut self, transducer: &Transducer, echoes: &Echoes) {
        for (who, answer) in (echoes.first..).zip(&echoes.answers).filter(|(_, answer)| answer.parts > 0) {
            let ReceivingBeams { first, from, .. } = transducer.receiving_beams[answer.receiving as usize];
            if first as usize != self.beams.0 {
                continue;
            }
            let loud = transducer.beam_gain[from as usize];
            let parts = answer.first as usize..(answer.first + answer.parts) as usize;
            let cells = answer.bin as usize..(answer.bin + answer.parts) as usize;
            self.note(cells.clone());
            let amplitudes = [&echoes.re[parts.clone()], echoes.im.get(parts.clone()).unwrap_or_default()];
            let sums = [&mut self.re[cells.clone()], self.im.get_mut(cells.clone()).unwrap_or_default()];
            let (most, is) = (&mut self.most[cells.clone()], &mut self.who[cells]);
            sound::receive_parts(loud, amplitudes, &echoes.energy[parts], who, sums, most, is);
        }
    }

    /// Adds what its beams receive, block by block.
    fn receive_together(&mut self, transducer: &Transducer, echoes: &Echoes) {
        let Echoes { gathered, first, .. } = echoes;
        let (beams, beam_gain) = (self.beams, &transducer.beam_gain[..]);
        let Tile { re, im, most, who: is, moment, total, received: all, loudness_of, audible, .. } = self;
        loudness_of.clear();
        loudness_of.extend(gathered.receiving_beams.iter().map(|&receiving| {
            let ReceivingBeams { first, from, to, .. } = transducer.receiving_beams[receiving as usize];
            let is_received = from < to && (first as usize) < beams.1 && beams.0 < (first + to - from) as usize;
            is_received.then(|| from + beams.0 as u32 - first)
        }));
        for (bins, which) in gathered.stretches() {
            audible.clear();
            let of = (0..).zip(&gathered.of[which.clone()]);
            audible.extend(
                of.filter_map(|(block, &of)| Some(ReceivedBlock { block, beam_gain: loudness_of[of as usize]? })),
            );
            if audible.is_empty() {
                continue;
            }
            widen(all, &bins);
            let rows = bins.start * BEAMS..bins.end * BEAMS;
            let sums = [&mut re[rows.clone()], im.get_mut(rows.clone()).unwrap_or_default()];
            let (most, is) = (&mut most[rows.clone()], &mut is[rows.clone()]);
            sound::receive_blocks(&gathered.blocks[which.clone()], audible, beam_gain, *first, sums, most, is);
            if !moment.is_empty() {
                let (moment, total, energy) = (&mut moment[rows.clone()], &mut total[rows], &gathered.energy[which]);
                sound::add_moments(energy, audible, beam_gain, &transducer.beside, moment, total);
            }
        }
    }

    /// Blocks the water of a bin, and behind it, from the view of beams, by the cell of a ray that hits something
    /// there.
    fn close(&mut self, transducer: &Transducer, ray: usize, bin: usize) {
        let width = self.width;
        // Uses the beams at the start of the ping, which define the open water.
        let ReceivingBeams { first, from, to, .. } = transducer.receiving_beams[transducer.receiving[ray] as usize];
        let (first, last) = (first as usize, (first + to - from) as usize);
        let (low, high) = (first.max(self.beams.0), last.min(self.beams.1));
        if low >= high || bin >= self.bins {
            return;
        }
        self.note(bin..bin + 1);
        let beam_gain = &transducer.beam_gain[from as usize + low - first..from as usize + high - first];
        let weight = exp2(transducer.weight[ray]);
        let start = bin * width + low - self.beams.0;
        for (open, &loud) in self.open[start..start + beam_gain.len()].iter_mut().zip(beam_gain) {
            *open -= weight * loud * loud;
        }
    }
}

/// Makes a column of `cells` zeros, each of which is [`NO_CONTRIBUTOR`]. If it has that size already, only the cells
/// `received` can differ from 0; `None`: any can.
fn reset<T: Copy + Default>(column: &mut Vec<T>, cells: usize, received: &Option<Range<usize>>) {
    match received {
        Some(received) if column.len() == cells => {
            column.get_mut(received.clone()).unwrap_or_default().fill(T::default());
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
    use glam::Vec3;
    use ground::rng::Rng;

    /// For any numbers of beams and bins, what beams receive in blocks is what they receive arrival by arrival.
    #[test]
    fn beams_receive_the_sums_of_all_arrivals() {
        const ARRIVALS: usize = 300;
        for (beams, bins) in [(2, 9), (15, 64), (16, 31), (17, 50), (33, 130)] {
            let rng = Rng::new(beams as u64, 0);
            let draw = |index: usize, what: u32| rng.uniform_at([index as u32, what, 0], ground::rng::Draw::Texture);
            let whole = |index: usize, what: u32, below: usize| (draw(index, what) * below as f32) as usize;
            // Hearings of some beams each, with zeros between them.
            let mut transducer = Transducer::default();
            transducer.beam_gain.resize(BEAMS, 0.0);
            for receiving in 0..40 {
                let first = whole(receiving, 0, beams);
                let received = 1 + whole(receiving, 1, beams - first);
                let from = transducer.beam_gain.len();
                transducer.beam_gain.extend((0..received).map(|beam| draw(receiving, 100 + beam as u32) - 0.3));
                let (from, to) = (from as u32, transducer.beam_gain.len() as u32);
                transducer.receiving_beams.push(ReceivingBeams { first: first as u32, from, to, part: 0 });
                transducer.beam_gain.resize(to as usize + BEAMS, 0.0);
            }
            // As for line arrays, arrivals are not received by one beam each.
            transducer.flanks.push(0.0);
            transducer.beside = transducer.beam_gain.iter().map(|loud| 0.5 * loud).collect();
            for speckle in [true, false] {
                let mut echoes = Echoes { first: 7, ..Echoes::default() };
                for index in 0..ARRIVALS {
                    let bin = whole(index, 2, bins);
                    let parts = whole(index, 3, 12.min(bins - bin + 1));
                    let (first, receiving) = (echoes.energy.len() as u32, whole(index, 4, 40) as u32);
                    let (bin, zero) = (bin as u32, Vec3::ZERO);
                    let parts = parts as u32;
                    echoes.answers.push(PingEcho { first, parts, bin, range: 0.0, reach: 0.0, slide: zero, receiving });
                    for part in 0..parts {
                        let energy = draw(index, 200 + part);
                        echoes.energy.push(energy);
                        echoes.re.push(if speckle { energy.sqrt() - 0.4 } else { energy });
                        echoes.im.push(0.7 - energy);
                    }
                }
                let mut tile = Tile::default();
                let quantities = TileQuantities { moment: true, open: false, speckle };
                echoes.gather(&transducer, bins);
                for first in (0..beams).step_by(BEAMS) {
                    tile.clear((first, beams.min(first + BEAMS)), BEAMS, bins, quantities);
                    tile.receive(&transducer, &echoes, 1.0);
                    for beam in tile.beams.0..tile.beams.1 {
                        let mut expected = vec![([0.0f64; 4], 0.0, NO_CONTRIBUTOR); bins];
                        for (index, it) in echoes.answers.iter().enumerate() {
                            let ReceivingBeams { first, from, to, .. } =
                                transducer.receiving_beams[it.receiving as usize];
                            if !(first..first + to - from).contains(&(beam as u32)) {
                                continue;
                            }
                            let loud = f64::from(transducer.beam_gain[(from + beam as u32 - first) as usize]);
                            for part in 0..it.parts {
                                let [re, im, energy] = [&echoes.re, &echoes.im, &echoes.energy]
                                    .map(|column| f64::from(column[(it.first + part) as usize]));
                                let (sums, most, who) = &mut expected[(it.bin + part) as usize];
                                let (received, scale) =
                                    (loud * loud * energy, if speckle { loud } else { loud * loud });
                                let parts = [re * scale, im * scale, received * 0.5 * loud, received];
                                sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
                                if received > *most {
                                    (*most, *who) = (received, 7 + index as u32);
                                }
                            }
                        }
                        for (bin, (sums, most, who)) in expected.into_iter().enumerate() {
                            let cell = bin * BEAMS + beam - first;
                            let im = tile.im.get(cell).copied().unwrap_or(sums[1] as f32);
                            let found = [tile.re[cell], im, tile.moment[cell], tile.total[cell]].map(f64::from);
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
