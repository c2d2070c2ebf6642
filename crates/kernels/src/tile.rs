//! What the beams of a tile receive in addition to blocks, row by row: a row has one number per beam for one range bin,
//! as many as fit in a cache line. Powers are uPa^2.

use crate::level::kernels;
use crate::sound::{BEAMS, greater};

/// Rows that are processed at a time, which stay in the first-level cache.
pub const ROWS: usize = 32;

/// Numbers of [`ROWS`] rows.
pub type TileRows<T = f32> = [T; ROWS * BEAMS];

/// Side-lobe reception of beams from one part of the directions far off axis.
#[derive(Clone, Copy, Debug)]
pub struct SideLobePart {
    /// Index of its number for the first row in the columns of all parts, which continue bin by bin.
    pub at: usize,
    /// Gain of each beam towards that part, as a factor of power.
    pub loud: [f32; BEAMS],
}

kernels! {
    /// Side-lobe powers from far off axis, by the columns of `energy`.
    pub fn side_lobe_powers(parts: &[SideLobePart], energy: &[f32], powers: &mut TileRows) {
        for (row, powers) in powers.as_chunks_mut::<BEAMS>().0.iter_mut().enumerate() {
            let mut sums = [0.0; BEAMS];
            for part in parts {
                let energy = energy[part.at + row];
                for beam in 0..BEAMS {
                    sums[beam] += part.loud[beam] * energy;
                }
            }
            *powers = sums;
        }
    }

    /// Labels cells that have no contributor, but side-lobe `powers` above the `noise`, with the strongest contributor
    /// to these, by the columns of the greatest energies (`most`) and their contributors.
    pub fn label_side_lobes(
        parts: &[SideLobePart],
        most: &[f32],
        contributors: &[u32],
        powers: &TileRows,
        noise: f32,
        unlabelled: u32,
        labels: &mut TileRows<u32>,
    ) {
        let rows = powers.as_chunks::<BEAMS>().0.iter().zip(labels.as_chunks_mut::<BEAMS>().0);
        for (row, (powers, labels)) in rows.enumerate() {
            let (mut unknown, mut any) = ([0u32; BEAMS], 0);
            for beam in 0..BEAMS {
                // Not a condition, which would prevent vectorisation.
                let is = u32::from(labels[beam] == unlabelled) & u32::from(powers[beam] > noise);
                unknown[beam] = 0u32.wrapping_sub(is);
                any |= is;
            }
            if any == 0 {
                continue;
            }
            let (mut best, mut strongest) = ([0.0; BEAMS], [unlabelled; BEAMS]);
            for part in parts {
                let (most, contributors) = (most[part.at + row], contributors[part.at + row]);
                for beam in 0..BEAMS {
                    (best[beam], strongest[beam]) = greater(part.loud[beam] * most, contributors, best[beam], strongest[beam]);
                }
            }
            for beam in 0..BEAMS {
                labels[beam] = strongest[beam] & unknown[beam] | labels[beam] & !unknown[beam];
            }
        }
    }

    /// Transposes rows from the bin `first` on into `lines`, one of `bins` numbers for each of the first beams. Numbers
    /// of any type, as their bits.
    pub fn put_columns(rows: &[u32], first: usize, bins: usize, lines: &mut [u32]) {
        /// Rows at a time.
        const EIGHT: usize = 8;
        let (blocks, rest) = rows.as_chunks::<{ EIGHT * BEAMS }>();
        let mut pairs = [[0; BEAMS]; EIGHT / 2];
        for (start, block) in (first..).step_by(EIGHT).zip(blocks) {
            // Pairs of bins as words of 64 bits: half as many numbers to move.
            for (pair, rows) in pairs.iter_mut().zip(block.as_chunks::<{ 2 * BEAMS }>().0) {
                for beam in 0..BEAMS {
                    pair[beam] = u64::from(rows[beam]) | u64::from(rows[BEAMS + beam]) << 32;
                }
            }
            for (beam, line) in lines.chunks_exact_mut(bins).enumerate() {
                let line: &mut [u32; EIGHT] = (&mut line[start..start + EIGHT]).try_into().expect("as many");
                for pair in 0..EIGHT / 2 {
                    line[2 * pair] = pairs[pair][beam] as u32;
                    line[2 * pair + 1] = (pairs[pair][beam] >> 32) as u32;
                }
            }
        }
        for (bin, row) in (first + blocks.len() * EIGHT..).zip(rest.as_chunks::<BEAMS>().0) {
            for (line, number) in lines.chunks_exact_mut(bins).zip(row) {
                line[bin] = *number;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any numbers of rows and beams, from any bin on; all other cells are unchanged.
    #[test]
    fn columns_are_those_of_rows() {
        const BINS: usize = 50;
        for (beams, first, rows) in [(16, 0, 32), (1, 3, 17), (5, 0, 7), (16, 41, 9), (2, 10, 0)] {
            let numbers: Vec<u32> = (1..).take(rows * BEAMS).collect();
            let mut lines = vec![0; beams * BINS];
            put_columns(&numbers, first, BINS, &mut lines);
            for (cell, &found) in lines.iter().enumerate() {
                let (beam, bin) = (cell / BINS, cell % BINS);
                let row = bin.checked_sub(first).filter(|row| *row < rows);
                assert_eq!(found, row.map_or(0, |row| numbers[row * BEAMS + beam]), "beam {beam}, bin {bin}");
            }
        }
    }
}
