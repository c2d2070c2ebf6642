//! What beams hear from far beside their axes: each sidelobe hears little, but the bottom below is so loud that it stands in
//! the water column of all beams (the nadir arc of swaths), and what shines in one beam of an imaging sonar in the others.
//!
//! Beams hear single arrivals within their [`Hearing`]. Farther aside there are so many sidelobes, and so many scatterers
//! in each of them, that only powers matter: they add up by range bin and part of the directions, and each beam hears each
//! part with its mean power there. As for any sum of many scatterers the amplitude is normally distributed.

use super::ping::Echoes;
use super::tile::NOBODY;
use crate::emitter::{FLANK_PARTS, Hearing, Transducer};
use echocast_kernels::sound::{self, Aside, Block, CELLS};
use std::ops::Range;

/// Energies of a ping by part of the directions and range bin.
#[derive(Clone, Default)]
pub(crate) struct Flanks {
    bins: usize,
    /// Cells of a part: all bins, and up to whole [`CELLS`].
    width: usize,
    /// Bins of each part from which something comes; empty: none.
    spans: Vec<Range<usize>>,
    /// Part by part: energies, 1 for a beam that looks there.
    energy: Vec<f32>,
    /// Energy of the strongest arrival, and its number: see [`Echoes::first`]. Empty: nobody asks.
    most: Vec<f32>,
    who: Vec<u32>,
}

impl Flanks {
    /// Empties it for `bins`; without a `transducer` whose beams hear beside their axes it stays empty.
    pub fn clear(&mut self, transducer: &Transducer, bins: usize, who: bool) {
        (self.bins, self.width) = (bins, bins.next_multiple_of(CELLS));
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
        for (Hearing { part, .. }, bins, block) in gathered.each(transducer, self.bins) {
            let span = &mut self.spans[part as usize];
            (span.start, span.end) = (span.start.min(bins.start), span.end.max(bins.end));
            let from = part as usize * self.width;
            let cells = from + bins.start..from + bins.end;
            let sums = self.energy[cells.clone()].iter_mut();
            sums.zip(&gathered.energy[block]).for_each(|(sum, energy)| *sum += energy);
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

    /// What a beam hears of it in each bin, into `powers`; and if `told` is not empty, whom each cell tells of that tells of
    /// nobody, where it hears more than the `noise`. `rows` is memory.
    pub fn heard(
        &self,
        (transducer, beam): (&Transducer, usize),
        rows: &mut Vec<(u32, f32)>,
        powers: &mut Vec<f32>,
        noise: f32,
        told: &mut [u32],
    ) {
        rows.clear();
        rows.extend(self.audible(transducer, beam));
        let spans = rows.iter().map(|(part, _)| &self.spans[*part as usize]);
        let span = spans.fold(self.bins..0, |all, span| all.start.min(span.start)..all.end.max(span.end));
        let start = span.start / CELLS * CELLS;
        let span = start..span.end.next_multiple_of(CELLS).max(start);
        powers.resize(self.width, 0.0);
        powers[..span.start].fill(0.0);
        powers[span.end..].fill(0.0);
        let Flanks { width, energy, most, who, .. } = self;
        let aside = Aside { rows, width: *width, energy, most, who };
        sound::hear_aside(aside, span.clone(), powers);
        if !told.is_empty() {
            sound::tell_aside(aside, span, powers, NOBODY, noise, told);
        }
    }

    /// The parts of the directions that a beam hears, and how loudly.
    fn audible(&self, transducer: &Transducer, beam: usize) -> impl Iterator<Item = (u32, f32)> {
        let flanks = &transducer.flanks[beam * FLANK_PARTS..(beam + 1) * FLANK_PARTS];
        let parts = (0..).zip(self.spans.iter().zip(flanks));
        parts.filter(|(_, (span, flank))| !span.is_empty() && **flank > 0.0).map(|(part, (_, &flank))| (part, flank))
    }

    /// Whether there is nothing to be heard from far aside.
    pub fn is_empty(&self) -> bool {
        self.spans.is_empty()
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
        let width = BINS.next_multiple_of(CELLS);
        let value = |seed: usize| (seed * 7919 % 101) as f32;
        let mut transducer = Transducer::default();
        transducer.flanks.extend((0..2 * FLANK_PARTS).map(value));
        let mut flanks = Flanks::default();
        flanks.clear(&transducer, BINS, true);
        for part in [3, 17, 20] {
            flanks.spans[part] = part..BINS - 5;
            for cell in part * width + part..part * width + BINS - 5 {
                (flanks.energy[cell], flanks.most[cell], flanks.who[cell]) =
                    (value(cell), value(cell + 1), cell as u32);
            }
        }
        for beam in 0..2 {
            let scale = |part: usize| transducer.flanks[beam * FLANK_PARTS + part];
            let before: Vec<u32> = (0..BINS as u32).map(|bin| if bin % 3 == 0 { 1_000_000 } else { NOBODY }).collect();
            let (mut powers, mut told) = (Vec::new(), before.clone());
            let noise = 9000.0;
            flanks.heard((&transducer, beam), &mut Vec::new(), &mut powers, noise, &mut told);
            for bin in 0..BINS {
                let parts = [3, 17, 20].map(|part| (part * width + bin, scale(part)));
                let expected: f32 = parts.iter().map(|&(cell, scale)| scale * flanks.energy[cell]).sum();
                assert!((powers[bin] - expected).abs() <= 1e-6 * expected, "beam {beam}, bin {bin}");
                let (mut most, mut who) = (0.0, NOBODY);
                for (cell, scale) in parts {
                    (most, who) = sound::greater(scale * flanks.most[cell], flanks.who[cell], most, who);
                }
                let known = before[bin] != NOBODY || powers[bin] <= noise;
                assert_eq!(told[bin], if known { before[bin] } else { who }, "beam {beam}, bin {bin}");
            }
        }
    }
}
