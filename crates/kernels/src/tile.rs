//! Levels of beams that are heard together, row by row: a row has a number of each beam in one range bin, and begins at a cache
//! line.

use crate::level::kernels;
use crate::sound::{BEAMS, db, noisy};

/// Rows that are worked on at a time, which stay in the first cache.
pub const ROWS: usize = 32;

/// Numbers of so many rows.
pub type Rows<T = f32> = [T; ROWS * BEAMS];

/// Numbers of rows whose sums stay in registers.
const SOME: usize = 4 * BEAMS;

/// What beams hear from one part of the directions far aside.
#[derive(Clone, Copy, Debug)]
pub struct Aside {
    /// Where the numbers of the first row are in columns of all parts.
    pub at: usize,
    /// How loudly each beam hears that, as a factor of power.
    pub loud: [f32; BEAMS],
}

/// The [`SOME`] numbers from `at` on.
#[inline(always)]
fn some(numbers: &[f32], at: usize) -> &[f32; SOME] {
    numbers[at..at + SOME].try_into().expect("as many")
}

/// Sums of rows, each times its tap, or the square of that, where the first begins at `start`.
#[inline(always)]
fn convolved(taps: &[(u32, f32)], squared: bool, rows: &[f32], start: usize, sums: &mut [f32; SOME]) {
    *sums = [0.0; SOME];
    for &(shift, tap) in taps {
        let from = some(rows, start + shift as usize * BEAMS);
        let tap = if squared { tap * tap } else { tap };
        for cell in 0..SOME {
            sums[cell] += tap * from[cell];
        }
    }
}

kernels! {
    /// Powers of what is heard from far aside, by the columns of `energy`.
    pub fn hear_aside(parts: &[Aside], energy: &[f32], powers: &mut Rows) {
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

    /// Where `nobody` is heard, but the `powers` from far aside are above the `noise`: whose is the strongest of that, by the
    /// columns of the greatest energies (`most`) and whose they are (`who`).
    pub fn tell_aside(
        parts: &[Aside],
        most: &[f32],
        who: &[u32],
        powers: &Rows,
        noise: f32,
        nobody: u32,
        told: &mut Rows<u32>,
    ) {
        let rows = powers.as_chunks::<BEAMS>().0.iter().zip(told.as_chunks_mut::<BEAMS>().0);
        for (row, (powers, told)) in rows.enumerate() {
            let (mut unknown, mut any) = ([0u32; BEAMS], 0);
            for beam in 0..BEAMS {
                // Not a condition, which would keep this from becoming vector instructions.
                let is = u32::from(told[beam] == nobody) & u32::from(powers[beam] > noise);
                unknown[beam] = 0u32.wrapping_sub(is);
                any |= is;
            }
            if any == 0 {
                continue;
            }
            let (mut best, mut whose) = ([0.0; BEAMS], [nobody; BEAMS]);
            for part in parts {
                let (most, who) = (most[part.at + row], who[part.at + row]);
                for beam in 0..BEAMS {
                    let heard = part.loud[beam] * most;
                    let stronger = 0u32.wrapping_sub((heard > best[beam]).into());
                    whose[beam] = who & stronger | whose[beam] & !stronger;
                    best[beam] = if heard > best[beam] { heard } else { best[beam] };
                }
            }
            for beam in 0..BEAMS {
                told[beam] = whose[beam] & unknown[beam] | told[beam] & !unknown[beam];
            }
        }
    }

    /// Levels, dB, of amplitudes convolved with the `taps` of a response: each counts the row that it says.
    pub fn convolve_to_db(taps: &[(u32, f32)], re: &[f32], im: &[f32], levels: &mut Rows) {
        let [mut sums, mut others] = [[0.0; SOME]; 2];
        for (start, levels) in (0..).step_by(SOME).zip(levels.as_chunks_mut::<SOME>().0) {
            convolved(taps, false, re, start, &mut sums);
            convolved(taps, false, im, start, &mut others);
            for cell in 0..SOME {
                levels[cell] = db(sums[cell] * sums[cell] + others[cell] * others[cell]);
            }
        }
    }

    /// Levels, dB, of energies convolved with the squares of the `taps` of a response, likewise, with noise of the `powers`.
    pub fn convolve_energies_to_db(
        taps: &[(u32, f32)],
        energy: &[f32],
        noise: [&[f32]; 2],
        powers: &[f32],
        levels: &mut Rows,
    ) {
        let mut sums = [0.0; SOME];
        for (start, levels) in (0..).step_by(SOME).zip(levels.as_chunks_mut::<SOME>().0) {
            convolved(taps, true, energy, start, &mut sums);
            let (re, im, powers) = (some(noise[0], start), some(noise[1], start), some(powers, start));
            for cell in 0..SOME {
                levels[cell] = db(noisy(sums[cell], re[cell], im[cell], powers[cell].sqrt()));
            }
        }
    }

    /// Puts the bits of rows into the lines of the first beams, each `bins` long, from the bin `first` on.
    pub fn put_columns(rows: &[u32], first: usize, bins: usize, lines: &mut [u32]) {
        /// Rows at a time.
        const EIGHT: usize = 8;
        let (blocks, rest) = rows.as_chunks::<{ EIGHT * BEAMS }>();
        let mut pairs = [[0; BEAMS]; EIGHT / 2];
        for (start, block) in (first..).step_by(EIGHT).zip(blocks) {
            // Two bins of all beams at once, then of one beam after the other.
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
