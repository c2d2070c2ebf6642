//! What beams hear from far beside their axes: each sidelobe hears little, but the bottom below is so loud that it stands in
//! the water column of all beams (the nadir arc of swaths), and what shines in one beam of an imaging sonar in the others.
//!
//! Beams hear single arrivals within their [`Hearing`]. Farther aside there are so many sidelobes, and so many scatterers
//! in each of them, that only powers matter: they add up by range bin and part of the directions, and each beam hears each
//! part with its mean power there. As for any sum of many scatterers the amplitude is normally distributed.

use super::ping::Echoes;
use super::tile::{NOBODY, widen};
use crate::emitter::{FLANK_PARTS, Hearing, Transducer};
use echocast_kernels::sound::{self, BEAMS, BLOCK, Block};
use echocast_kernels::tile::{self, Aside, ROWS, Rows};
use std::ops::Range;

/// Energies of a ping by part of the directions and range bin.
#[derive(Clone, Default)]
pub(crate) struct Flanks {
    /// Cells of a part: all bins, up to whole [`ROWS`], and a cache line: if it were a power of two, what all parts have in one bin
    /// would compete for the same places of the cache.
    width: usize,
    /// Bins of each part from which something comes; empty: none.
    spans: Vec<Range<usize>>,
    /// Part by part: energies, 1 for a beam that looks there.
    energy: Vec<f32>,
    /// Energy of the strongest arrival, and its number: see [`Echoes::first`]. Empty: nobody asks.
    most: Vec<f32>,
    who: Vec<u32>,
}

/// A part of the directions that beams of a tile hear.
pub(crate) struct Audible {
    part: usize,
    /// How loudly each beam hears it, as a factor of power.
    loud: [f32; BEAMS],
}

impl Flanks {
    /// Empties it for `bins`; without a `transducer` whose beams hear beside their axes it stays empty. `who`: whether to
    /// find whose the strongest are.
    pub fn clear(&mut self, transducer: &Transducer, bins: usize, who: bool) {
        /// Numbers of a cache line.
        const LINE: usize = 16;
        self.width = bins.next_multiple_of(ROWS) + LINE;
        let parts = if transducer.flanks.is_empty() { 0 } else { FLANK_PARTS };
        let (cells, asked) = (parts * self.width, if who { parts * self.width } else { 0 });
        self.spans.clear();
        self.spans.resize(parts, Range { start: bins, end: 0 });
        self.energy.clear();
        self.energy.resize(cells, 0.0);
        self.most.clear();
        self.most.resize(asked, 0.0);
        self.who.clear();
        self.who.resize(asked, NOBODY);
    }

    /// Adds what comes from a chunk.
    pub fn add(&mut self, transducer: &Transducer, echoes: &Echoes) {
        if self.spans.is_empty() {
            return;
        }
        let Echoes { gathered, first, .. } = echoes;
        for (Hearing { part, .. }, bins, block) in gathered.each(transducer) {
            widen(&mut self.spans[part as usize], &bins);
            // Whole blocks: beyond the last bin nothing is heard.
            let from = part as usize * self.width + bins.start;
            let cells = from..from + BLOCK;
            for (sum, energy) in self.energy[cells.clone()].iter_mut().zip(&gathered.energy[block]) {
                *sum += energy;
            }
            if self.who.is_empty() {
                continue;
            }
            let Block { most: parts, who: whose, .. } = &gathered.blocks[block];
            let best = self.most[cells.clone()].iter_mut().zip(&mut self.who[cells]);
            for ((most, who), (&energy, index)) in best.zip(parts.iter().zip(whose)) {
                (*most, *who) = sound::greater(energy, first + index, *most, *who);
            }
        }
    }

    /// Which parts of the directions any of the `beams` of a tile hears, and how loudly each of them.
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

    /// Powers of what beams hear of `parts` in the rows from `start` on, a multiple of [`ROWS`]. `near` becomes those from which
    /// there is anything.
    pub fn hear(&self, parts: &[Audible], start: usize, near: &mut Vec<Aside>, powers: &mut Rows) {
        near.clear();
        let is_near = |span: &Range<usize>| span.start < start + ROWS && start < span.end;
        let heard = parts.iter().filter(|heard| is_near(&self.spans[heard.part]));
        near.extend(heard.map(|&Audible { part, loud }| Aside { at: part * self.width + start, loud }));
        tile::hear_aside(near, &self.energy, powers);
    }

    /// Cells that tell of nobody, but hear more than the `noise` (powers, uPa^2) from what is `near`, tell of the strongest of that.
    pub fn tell(&self, near: &[Aside], powers: &Rows, noise: f32, told: &mut Rows<u32>) {
        if !near.is_empty() && !self.who.is_empty() {
            tile::tell_aside(near, &self.most, &self.who, powers, noise, NOBODY, told);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beams hear the parts by their powers, and only cells that tell of nobody and hear more than the noise tell of the
    /// strongest.
    #[test]
    fn beams_hear_the_sums_of_what_is_far_aside() {
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
            let before: Rows<u32> =
                std::array::from_fn(|cell| if (cell / BEAMS).is_multiple_of(3) { 1_000_000 } else { NOBODY });
            let (mut powers, mut told) = ([0.0; ROWS * BEAMS], before);
            flanks.hear(&parts, start, &mut near, &mut powers);
            flanks.tell(&near, &powers, noise, &mut told);
            for (beam, row) in (0..2).flat_map(|beam| (0..ROWS.min(BINS - start)).map(move |row| (beam, row))) {
                let scale = |part: usize| transducer.flanks[beam * FLANK_PARTS + part];
                let parts = [3, 17, 20].map(|part| (part * width + start + row, scale(part)));
                let expected: f32 = parts.iter().map(|&(cell, scale)| scale * flanks.energy[cell]).sum();
                let found = powers[row * BEAMS + beam];
                assert!((found - expected).abs() <= 1e-6 * expected, "beam {beam}, bin {}", start + row);
                let (mut most, mut who) = (0.0, NOBODY);
                for (cell, scale) in parts {
                    (most, who) = sound::greater(scale * flanks.most[cell], flanks.who[cell], most, who);
                }
                let known = before[row * BEAMS + beam] != NOBODY || found <= noise;
                let expected = if known { before[row * BEAMS + beam] } else { who };
                assert_eq!(told[row * BEAMS + beam], expected, "beam {beam}, bin {}", start + row);
            }
        }
    }
}
