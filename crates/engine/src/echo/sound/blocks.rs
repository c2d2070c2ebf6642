//! Arrivals that beams receive alike, summed before they are distributed to beams.
//!
//! An imaging sonar has a hundred rays at each angle to its array, and forty beams receive each of them: arrivals from
//! one angle are summed by range once, and the beams receive the sums.

use super::echo::PingEcho;
use echocast_kernels::sound::{BLOCK, BinBlock, greater};
use emitter::{ReceivingBeams, Transducer};
use std::ops::Range;

/// Sums of the echoes of a chunk, in blocks of [`BLOCK`] range bins: by stretch of range, then by [`ReceivingBeams`].
#[derive(Clone, Default)]
pub(crate) struct Gathered {
    /// The [`ReceivingBeams`]s of any of these echoes.
    pub receiving_beams: Vec<u32>,
    /// Amplitudes, and the strongest arrival by its index.
    pub blocks: Vec<BinBlock>,
    /// Energies.
    pub energy: Vec<[f32; BLOCK]>,
    /// Index into `receiving_beams` for each block.
    pub of: Vec<u32>,
    /// First block of each stretch, from the first of the `span` on.
    starts: Vec<u32>,
    /// Stretches that contain echoes.
    span: Range<usize>,
    memory: GatherMemory,
}

/// Buffers of [`Gathered::gather`].
#[derive(Clone, Default)]
struct GatherMemory {
    /// Arrivals in the order of their hearings.
    order: Vec<u32>,
    /// The stretch of each block and the index of its hearing, as they are found.
    found: Vec<[u32; 2]>,
    /// Index of each block after sorting.
    place: Vec<u32>,
    /// The last block found for each stretch.
    last: Vec<u32>,
    /// For each arrival, the blocks of the stretches that it touches.
    touched: Vec<u32>,
}

impl Gathered {
    /// Sums the parts of the `answers` in `bins`: `amplitudes` and energies.
    pub fn gather(&mut self, answers: &[PingEcho], amplitudes: [&[f32]; 2], energy: &[f32], bins: usize) {
        let GatherMemory { order, found, last, touched, .. } = &mut self.memory;
        [&mut *order, touched, &mut self.receiving_beams, &mut self.starts].into_iter().for_each(Vec::clear);
        found.clear();
        last.resize(bins.div_ceil(BLOCK), 0);
        order.extend((0..).zip(answers).filter(|(_, answer)| answer.parts > 0).map(|(index, _)| index));
        let receiving = |&index: &u32| (answers[index as usize].receiving, index);
        if !order.is_sorted_by_key(receiving) {
            order.sort_unstable_by_key(receiving);
        }
        self.span = Range { start: usize::MAX, end: 0 };
        // First block of this hearing.
        let mut first = 0;
        for &index in &*order {
            let answer = &answers[index as usize];
            if self.receiving_beams.last() != Some(&answer.receiving) {
                self.receiving_beams.push(answer.receiving);
                first = found.len();
            }
            let stretches = stretches(answer);
            widen(&mut self.span, &stretches);
            for stretch in stretches {
                let block = &mut last[stretch];
                let known = found.get(*block as usize).is_some_and(|known| known[0] == stretch as u32);
                if !known || (*block as usize) < first {
                    *block = found.len() as u32;
                    found.push([stretch as u32, self.receiving_beams.len() as u32 - 1]);
                }
                touched.push(*block);
            }
        }
        self.sort();
        self.add(answers, amplitudes, energy);
    }

    /// Sorts the blocks by stretch, with a counting sort.
    fn sort(&mut self) {
        let Gathered { starts, span, of, memory: GatherMemory { found, place, .. }, .. } = self;
        starts.resize(span.len() + 2, 0);
        found.iter().for_each(|[stretch, _]| starts[*stretch as usize - span.start + 2] += 1);
        (2..starts.len()).for_each(|index| starts[index] += starts[index - 1]);
        of.resize(found.len(), 0);
        place.clear();
        place.extend(found.iter().map(|&[stretch, receiving]| {
            let next = &mut starts[stretch as usize - span.start + 1];
            of[*next as usize] = receiving;
            *next += 1;
            *next - 1
        }));
    }

    /// Adds all parts to their blocks.
    fn add(&mut self, answers: &[PingEcho], [re, im]: [&[f32]; 2], energy: &[f32]) {
        let Gathered { blocks, energy: sums, of, memory: GatherMemory { order, place, touched, .. }, .. } = self;
        blocks.clear();
        blocks.resize(of.len(), BinBlock::default());
        sums.clear();
        sums.resize(of.len(), [0.0; BLOCK]);
        let mut touched = touched.iter();
        for &index in &*order {
            let answer = &answers[index as usize];
            let parts = answer.first as usize..(answer.first + answer.parts) as usize;
            let (mut re, mut energy) = (re[parts.clone()].iter(), energy[parts.clone()].iter());
            let mut im = im.get(parts).unwrap_or_default().iter();
            let mut bin = answer.bin as usize;
            for &block in touched.by_ref().take(stretches(answer).len()) {
                let place = place[block as usize] as usize;
                let (block, sums) = (&mut blocks[place], &mut sums[place]);
                for at in bin % BLOCK..BLOCK {
                    let (Some(&energy), Some(&re)) = (energy.next(), re.next()) else { break };
                    block.re[at] += re;
                    block.im[at] += im.next().unwrap_or(&0.0);
                    sums[at] += energy;
                    (block.most[at], block.who[at]) = greater(energy, index, block.most[at], block.who[at]);
                }
                bin = 0;
            }
        }
    }

    /// The stretches of [`BLOCK`] bins that contain echoes, and the blocks of each. The last may extend beyond the last
    /// bin, where all is zero.
    pub fn stretches(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        self.span.clone().zip(self.starts.windows(2)).map(move |(stretch, ends)| {
            let cells = stretch * BLOCK..(stretch + 1) * BLOCK;
            (cells, ends[0] as usize..ends[1] as usize)
        })
    }

    /// Each block: its hearing, its bins, and its number.
    pub fn each<'a>(
        &'a self,
        transducer: &'a Transducer,
    ) -> impl Iterator<Item = (ReceivingBeams, Range<usize>, usize)> + 'a {
        let receiving =
            |block: usize| transducer.receiving_beams[self.receiving_beams[self.of[block] as usize] as usize];
        self.stretches()
            .flat_map(move |(bins, blocks)| blocks.map(move |block| (receiving(block), bins.clone(), block)))
    }
}

/// Stretches of range in which an echo has parts.
fn stretches(answer: &PingEcho) -> Range<usize> {
    let (bin, parts) = (answer.bin as usize, answer.parts as usize);
    bin / BLOCK..(bin + parts).div_ceil(BLOCK)
}

/// Extends a range to include another, and what is between them.
pub(super) fn widen(range: &mut Range<usize>, by: &Range<usize>) {
    *range = range.start.min(by.start)..range.end.max(by.end);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Arrivals of two hearings, in no particular order: each bin of each has their sums, and the strongest.
    #[test]
    fn blocks_hold_the_sums_of_arrivals_received_alike() {
        const BINS: usize = 42;
        /// Rounded up to whole blocks.
        const CELLS: usize = BINS.next_multiple_of(BLOCK);
        // Hearing, first bin, parts.
        let of = [(7, 3, 6), (2, 38, 4), (7, 5, 1), (2, 0, 3), (7, 41, 1), (7, 6, 5)];
        let mut first = 0;
        let answers = of.map(|(receiving, bin, parts)| {
            first += parts;
            let zero = Vec3::ZERO;
            PingEcho { first: first - parts, parts, bin, range: 0.0, reach: 0.0, slide: zero, receiving }
        });
        let energy: Vec<f32> = (0..first).map(|part| 1.0 + (part * 7 % 5) as f32).collect();
        let [re, im] = [0.5, -0.25].map(|scale| energy.iter().map(|energy| scale * energy).collect::<Vec<f32>>());
        let mut gathered = Gathered::default();
        for _ in 0..2 {
            gathered.gather(&answers, [&re, &im], &energy, BINS);
            assert_eq!(gathered.receiving_beams, [2, 7]);
            let mut found = [[(0.0, 0.0, 0.0, 0.0, 0); CELLS]; 2];
            for (cells, blocks) in gathered.stretches() {
                for block in blocks {
                    let it = &gathered.blocks[block];
                    for (at, bin) in cells.clone().enumerate() {
                        let sums = (it.re[at], it.im[at], gathered.energy[block][at]);
                        let before = &mut found[gathered.of[block] as usize][bin];
                        assert_eq!(*before, (0.0, 0.0, 0.0, 0.0, 0), "a stretch has one block of each hearing");
                        *before = (sums.0, sums.1, sums.2, it.most[at], it.who[at]);
                    }
                }
            }
            for (of, receiving) in [2, 7].into_iter().enumerate() {
                for bin in 0..CELLS as u32 {
                    let parts = (0..).zip(&answers).filter(|(_, it)| it.receiving == receiving);
                    let parts = parts.filter(|(_, it)| (it.bin..it.bin + it.parts).contains(&bin));
                    let mut expected = (0.0, 0.0, 0.0, 0.0, 0);
                    for (index, answer) in parts {
                        let part = energy[(answer.first + bin - answer.bin) as usize];
                        expected.0 += 0.5 * part;
                        expected.1 -= 0.25 * part;
                        expected.2 += part;
                        if part > expected.3 {
                            (expected.3, expected.4) = (part, index);
                        }
                    }
                    assert_eq!(found[of][bin as usize], expected, "receiving {receiving}, bin {bin}");
                }
            }
        }
        gathered.gather(&[], [&[], &[]], &[], BINS);
        assert_eq!(gathered.stretches().count(), 0);
    }
}
