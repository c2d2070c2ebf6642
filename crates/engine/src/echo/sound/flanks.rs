//! Side-lobe energy from far off the axes of beams: each side lobe receives little, but the bottom below is so strong
//! that it appears in the water column of all beams (the nadir arc of swaths), and what is bright in one beam of an
//! imaging sonar appears in the others.
//!
//! Beams receive individual arrivals within their [`ReceivingBeams`]. Farther off axis there are so many side lobes, and
//! so many scatterers in each of them, that only powers matter: they are summed by range bin and sector of directions,
//! and each beam receives each sector with its mean power gain there. As for any sum of many scatterers, the amplitude
//! is normally distributed.

use super::blocks::widen;
use super::echoes::Echoes;
use super::tile::NO_CONTRIBUTOR;
use echocast_kernels::sound::{self, BEAMS, BLOCK, BinBlock};
use echocast_kernels::tile::{self, ROWS, SideLobePart, TileRows};
use emitter::{FLANK_PARTS, ReceivingBeams, Transducer};
use std::ops::Range;

/// Energies of a ping by sector of directions and range bin.
#[derive(Clone, Default)]
pub(crate) struct Flanks {
    /// Cells per sector: all bins, up to whole [`ROWS`], and a cache line: with a power of two, the cells of all
    /// sectors in one bin would compete for the same cache sets.
    width: usize,
    /// Bins of each sector that contain energy; empty: none.
    spans: Vec<Range<usize>>,
    /// Energies, sector by sector, for a beam with a gain of 1 there.
    energy: Vec<f32>,
    /// Energy of the strongest arrival, and its number: see [`Echoes::first`]. Empty: not requested.
    most: Vec<f32>,
    who: Vec<u32>,
}

/// A sector of directions that beams of a tile receive.
pub(crate) struct Audible {
    part: usize,
    /// Power gain of each beam there.
    loud: [f32; BEAMS],
}

impl Flanks {
    /// Clears it for `bins`; it stays empty unless the beams of `transducer` receive from beside their axes. `who`:
    /// whether to find the strongest contributors.
    pub fn clear(&mut self, transducer: &Transducer, bins: usize, who: bool) {
        /// Numbers per cache line.
        const LINE: usize = 16;
        self.width = bins.next_multiple_of(ROWS) + LINE;
        let parts = if transducer.flanks.is_empty() { 0 } else { FLANK_PARTS };
        let (cells, requested) = (parts * self.width, if who { parts * self.width } else { 0 });
        self.spans.clear();
        self.spans.resize(parts, Range { start: bins, end: 0 });
        self.energy.clear();
        self.energy.resize(cells, 0.0);
        self.most.clear();
        self.most.resize(requested, 0.0);
        self.who.clear();
        self.who.resize(requested, NO_CONTRIBUTOR);
    }

    /// Adds the echoes of a chunk.
    pub fn add(&mut self, transducer: &Transducer, echoes: &Echoes) {
        if self.spans.is_empty() {
            return;
        }
        let Echoes { gathered, first, .. } = echoes;
        for (ReceivingBeams { part, .. }, bins, block) in gathered.each(transducer) {
            widen(&mut self.spans[part as usize], &bins);
            // Whole blocks: beyond the last bin all is zero.
            let from = part as usize * self.width + bins.start;
            let cells = from..from + BLOCK;
            for (sum, energy) in self.energy[cells.clone()].iter_mut().zip(&gathered.energy[block]) {
                *sum += energy;
            }
            if self.who.is_empty() {
                continue;
            }
            let BinBlock { most: parts, who: strongest, .. } = &gathered.blocks[block];
            let best = self.most[cells.clone()].iter_mut().zip(&mut self.who[cells]);
            for ((most, who), (&energy, index)) in best.zip(parts.iter().zip(strongest)) {
                (*most, *who) = sound::greater(energy, first + index, *most, *who);
            }
        }
    }

    /// Which sectors of directions any of the `beams` of a tile receives, with the gain of each of them.
    pub fn audible(&self, transducer: &Transducer, beams: Range<usize>, parts: &mut Vec<Audible>) {
        parts.clear();
        for (part, _) in self.spans.iter().enumerate().filter(|(_, span)| !span.is_empty()) {
            let mut loud = [0.0; BEAMS];
            for (loud, beam) in loud.iter_mut().zip(beams.clone()) {
                *loud = transducer.flanks[beam * FLANK_PARTS + part];
            }
            if loud != [0.0; BEAMS] {
                parts.push(Audible { part, loud });
            }
        }
    }

    /// Powers that beams receive from the sectors `parts` in the rows from `start` on, a multiple of [`ROWS`]. `near`
    /// becomes those sectors that have energy there.
    pub fn receive(&self, parts: &[Audible], start: usize, near: &mut Vec<SideLobePart>, powers: &mut TileRows) {
        near.clear();
        let is_near = |span: &Range<usize>| span.start < start + ROWS && start < span.end;
        let received = parts.iter().filter(|received| is_near(&self.spans[received.part]));
        near.extend(received.map(|&Audible { part, loud }| SideLobePart { at: part * self.width + start, loud }));
        tile::side_lobe_powers(near, &self.energy, powers);
    }

    /// Labels cells that have no contributor, but receive more than the `noise` (powers, uPa^2) from the sectors
    /// `near`, with the strongest contributor of these.
    pub fn label(&self, near: &[SideLobePart], powers: &TileRows, noise: f32, labels: &mut TileRows<u32>) {
        if !near.is_empty() && !self.who.is_empty() {
            tile::label_side_lobes(near, &self.most, &self.who, powers, noise, NO_CONTRIBUTOR, labels);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beams receive the sectors by their power gains, and only cells that have no contributor and receive more than
    /// the noise get the strongest.
    #[test]
    fn beams_receive_the_sums_of_side_lobe_energy() {
        const BINS: usize = 150;
        let value = |seed: usize| (seed * 7919 % 101) as f32;
        let mut transducer = Transducer::default();
        transducer.flanks.extend((0..2 * FLANK_PARTS).map(value));
        let mut flanks = Flanks::default();
        flanks.clear(&transducer, BINS, true);
        let width = flanks.width;
        for part in [3, 17, 20] {
            flanks.spans[part] = 3 * part..BINS - 5 * part;
            for cell in part * width + 3 * part..part * width + BINS - 5 * part {
                (flanks.energy[cell], flanks.most[cell], flanks.who[cell]) =
                    (value(cell), value(cell + 1), cell as u32);
            }
        }
        let (mut parts, mut near) = (Vec::new(), Vec::new());
        flanks.audible(&transducer, 0..2, &mut parts);
        let noise = 9000.0;
        for start in (0..BINS).step_by(ROWS) {
            let before: TileRows<u32> =
                std::array::from_fn(|cell| if (cell / BEAMS).is_multiple_of(3) { 1_000_000 } else { NO_CONTRIBUTOR });
            let (mut powers, mut labels) = ([0.0; ROWS * BEAMS], before);
            flanks.receive(&parts, start, &mut near, &mut powers);
            flanks.label(&near, &powers, noise, &mut labels);
            for (beam, row) in (0..2).flat_map(|beam| (0..ROWS.min(BINS - start)).map(move |row| (beam, row))) {
                let scale = |part: usize| transducer.flanks[beam * FLANK_PARTS + part];
                let parts = [3, 17, 20].map(|part| (part * width + start + row, scale(part)));
                let expected: f32 = parts.iter().map(|&(cell, scale)| scale * flanks.energy[cell]).sum();
                let found = powers[row * BEAMS + beam];
                assert!((found - expected).abs() <= 1e-6 * expected, "beam {beam}, bin {}", start + row);
                let (mut most, mut who) = (0.0, NO_CONTRIBUTOR);
                for (cell, scale) in parts {
                    (most, who) = sound::greater(scale * flanks.most[cell], flanks.who[cell], most, who);
                }
                let known = before[row * BEAMS + beam] != NO_CONTRIBUTOR || found <= noise;
                let expected = if known { before[row * BEAMS + beam] } else { who };
                assert_eq!(labels[row * BEAMS + beam], expected, "beam {beam}, bin {}", start + row);
            }
        }
    }
}
