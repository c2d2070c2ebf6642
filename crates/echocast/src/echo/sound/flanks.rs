//! What beams hear from far beside their axes: each sidelobe hears little, but the bottom below is so loud that it stands in
//! the water column of all beams (the nadir arc of swaths), and what shines in one beam of an imaging sonar in the others.
//!
//! Beams hear single arrivals within their [`Hearing`]. Farther aside there are so many sidelobes, and so many scatterers
//! in each of them, that only powers matter: they add up by range bin and part of the directions, and each beam hears each
//! part with its mean power there. As for any sum of many scatterers the amplitude is normally distributed.

use super::ping::{Echoes, NOBODY};
use crate::emitter::{FLANK_PARTS, Hearing, Transducer};
use echocast_kernels::sound;
use std::ops::Range;

/// Energies of a ping by part of the directions and range bin.
#[derive(Clone, Default)]
pub(crate) struct Flanks {
    bins: usize,
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
        self.bins = bins;
        let parts = if transducer.flanks.is_empty() { 0 } else { FLANK_PARTS };
        self.spans.clear();
        self.spans.resize(parts, Range { start: bins, end: 0 });
        self.energy.clear();
        self.energy.resize(parts * bins, 0.0);
        let asked = if who { parts * bins } else { 0 };
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
        for (number, answer) in (echoes.first..).zip(&echoes.answers).filter(|(_, answer)| answer.parts > 0) {
            let Hearing { part, .. } = transducer.hearings[answer.hearing as usize];
            let span = &mut self.spans[part as usize];
            let (from, to) = (answer.bin as usize, (answer.bin + answer.parts) as usize);
            (span.start, span.end) = (span.start.min(from), span.end.max(to));
            let parts = &echoes.energy[answer.first as usize..(answer.first + answer.parts) as usize];
            let cells = part as usize * self.bins + from..part as usize * self.bins + to;
            for (sum, energy) in self.energy[cells.clone()].iter_mut().zip(parts) {
                *sum += energy;
            }
            if self.who.is_empty() {
                continue;
            }
            for ((most, who), &energy) in self.most[cells.clone()].iter_mut().zip(&mut self.who[cells]).zip(parts) {
                if energy > *most {
                    (*most, *who) = (energy, number);
                }
            }
        }
    }

    /// What a beam hears of it in each bin.
    pub fn heard(&self, transducer: &Transducer, beam: usize, powers: &mut [f32]) {
        powers.fill(0.0);
        for (flank, cells, span) in self.audible(transducer, beam) {
            sound::add(flank, &self.energy[cells], &mut powers[span]);
        }
    }

    /// The same, and the power of the strongest in each bin and who that is.
    pub fn told(&self, transducer: &Transducer, beam: usize, powers: &mut [f32], most: &mut [f32], who: &mut [u32]) {
        powers.fill(0.0);
        most.fill(0.0);
        who.fill(NOBODY);
        for (flank, cells, span) in self.audible(transducer, beam) {
            let (from, parts, whose) = (&self.energy[cells.clone()], &self.most[cells.clone()], &self.who[cells]);
            let (most, who) = (&mut most[span.clone()], &mut who[span.clone()]);
            sound::add_and_prefer(flank, from, parts, whose, &mut powers[span], most, who);
        }
    }

    /// The parts of the directions that a beam hears: how loudly, their cells, and the bins of these.
    fn audible(&self, transducer: &Transducer, beam: usize) -> impl Iterator<Item = (f32, Range<usize>, Range<usize>)> {
        let flanks = &transducer.flanks[beam * FLANK_PARTS..(beam + 1) * FLANK_PARTS];
        let parts = self.spans.iter().zip(flanks).enumerate();
        parts.filter(|(_, (span, flank))| !span.is_empty() && **flank > 0.0).map(|(part, (span, &flank))| {
            let from = part * self.bins;
            (flank, from + span.start..from + span.end, span.clone())
        })
    }

    /// Whether there is nothing to be heard from far aside.
    pub fn is_empty(&self) -> bool {
        self.spans.is_empty()
    }
}
