//! Sound that beams receive: sums over range bins, levels.

use crate::level::kernels;
use crate::math::{LOG2_PER_DB, log2};

/// Range bins of a block.
pub const BLOCK: usize = 4;

/// Beams that receive a block together: their sums fill the vector registers.
pub const BEAMS: usize = 16;

/// A block that beams receive.
#[derive(Clone, Copy, Debug)]
pub struct ReceivedBlock {
    /// Its index among the blocks given.
    pub block: u32,
    /// Where the beams' gains begin in the table of all gains (`beam_gain`).
    pub beam_gain: u32,
}

/// Arrivals in [`BLOCK`] range bins: a cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct BinBlock {
    /// Sums of amplitudes, or of energies.
    pub re: [f32; BLOCK],
    /// Their imaginary parts.
    pub im: [f32; BLOCK],
    /// Energy of the strongest arrival.
    pub most: [f32; BLOCK],
    /// Its number.
    pub who: [u32; BLOCK],
}

/// The greatest energy and its contributor, given those of another arrival and of the strongest so far.
#[inline(always)]
#[must_use]
pub fn greater(received: f32, who: u32, most: f32, is: u32) -> (f32, u32) {
    let stronger = received > most;
    (if stronger { received } else { most }, if stronger { who } else { is })
}

/// The numbers of [`BEAMS`] beams from `at` on.
#[inline(always)]
fn row(numbers: &[f32], at: u32) -> &[f32; BEAMS] {
    numbers[at as usize..at as usize + BEAMS].try_into().expect("as many as there are beams")
}

/// The rows of a block.
#[inline(always)]
fn rows<T>(cells: &mut [T]) -> &mut [[T; BEAMS]; BLOCK] {
    cells.as_chunks_mut().0.try_into().expect("as many rows as a block has bins")
}

/// [`receive_blocks`], of amplitudes or of energies.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn receive<const COHERENT: bool>(
    blocks: &[BinBlock],
    received: &[ReceivedBlock],
    beam_gain: &[f32],
    first: u32,
    [sum_re, sum_im]: [&mut [f32]; 2],
    most: &mut [f32],
    is: &mut [u32],
) {
    let mut no_imaginary = [[0.0; BEAMS]; BLOCK];
    let sum_im = if COHERENT { rows(sum_im) } else { &mut no_imaginary };
    let (sum_re, most, is) = (rows(sum_re), rows(most), rows(is));
    let (mut re, mut im, mut best, mut whose) = (*sum_re, *sum_im, *most, *is);
    for received in received {
        let (loud, block) = (row(beam_gain, received.beam_gain), &blocks[received.block as usize]);
        for beam in 0..BEAMS {
            let loud = loud[beam];
            let square = loud * loud;
            for bin in 0..BLOCK {
                if COHERENT {
                    re[bin][beam] += loud * block.re[bin];
                    im[bin][beam] += loud * block.im[bin];
                } else {
                    re[bin][beam] += square * block.re[bin];
                }
                let (energy, who) = (square * block.most[bin], first + block.who[bin]);
                (best[bin][beam], whose[bin][beam]) = greater(energy, who, best[bin][beam], whose[bin][beam]);
            }
        }
    }
    (*sum_re, *sum_im, *most, *is) = (re, im, best, whose);
}

/// Cells that are convolved at a time: their sums stay in registers.
pub const CELLS: usize = 64;

/// The [`CELLS`] from `at` on.
#[inline(always)]
fn some<T>(cells: &[T], at: usize) -> &[T; CELLS] {
    cells[at..at + CELLS].try_into().expect("as many")
}

/// A power as a level, dB.
#[inline(always)]
fn db(power: f32) -> f32 {
    log2(power.max(1e-30)) * (1.0 / LOG2_PER_DB)
}

/// [`CELLS`] of the convolution with `taps`, or their squares, from `start` on.
#[inline(always)]
fn convolved(taps: &[(u32, f32)], squared: bool, cells: &[f32], start: usize, sums: &mut [f32; CELLS]) {
    *sums = [0.0; CELLS];
    for &(shift, tap) in taps {
        let from = some(cells, start + shift as usize);
        let tap = if squared { tap * tap } else { tap };
        for cell in 0..CELLS {
            sums[cell] += tap * from[cell];
        }
    }
}

/// [`convolve_to_db`] in the cells from `start` on.
#[inline(always)]
fn some_levels(taps: &[(u32, f32)], re: &[f32], im: &[f32], start: usize, levels: &mut [f32; CELLS]) {
    let [mut sums, mut others] = [[0.0; CELLS]; 2];
    convolved(taps, false, re, start, &mut sums);
    convolved(taps, false, im, start, &mut others);
    for cell in 0..CELLS {
        levels[cell] = db(sums[cell] * sums[cell] + others[cell] * others[cell]);
    }
}

kernels! {
    /// `to += from`.
    pub fn add(from: &[f32], to: &mut [f32]) {
        for (sum, x) in to.iter_mut().zip(from) {
            *sum += x;
        }
    }

    /// Adds the parts of an arrival to as many cells: amplitudes, or, without imaginary parts, energies; and keeps the
    /// greatest energy of each cell and its contributor.
    pub fn receive_parts(
        loud: f32,
        amplitudes: [&[f32]; 2],
        energy: &[f32],
        who: u32,
        sums: [&mut [f32]; 2],
        most: &mut [f32],
        is: &mut [u32],
    ) {
        let ([re, im], [sum_re, sum_im]) = (amplitudes, sums);
        let square = loud * loud;
        let scale = if sum_im.is_empty() { square } else { loud };
        sum_re.iter_mut().zip(re).for_each(|(sum, x)| *sum += scale * x);
        sum_im.iter_mut().zip(im).for_each(|(sum, y)| *sum += loud * y);
        for ((most, is), energy) in most.iter_mut().zip(is).zip(energy) {
            (*most, *is) = greater(square * energy, who, *most, *is);
        }
    }

    /// Adds those of `blocks`, all of the same [`BLOCK`] bins, that beams receive to as many rows of [`BEAMS`] cells:
    /// amplitudes, or, without imaginary parts, energies, scaled by the square; and keeps the greatest energy of every
    /// cell and its contributor. Arrivals are numbered from `first` on. Amplitudes are finite: beams that do not
    /// receive a block add it times zero.
    pub fn receive_blocks(
        blocks: &[BinBlock],
        received: &[ReceivedBlock],
        beam_gain: &[f32],
        first: u32,
        sums: [&mut [f32]; 2],
        most: &mut [f32],
        is: &mut [u32],
    ) {
        if sums[1].is_empty() {
            receive::<false>(blocks, received, beam_gain, first, sums, most, is);
        } else {
            receive::<true>(blocks, received, beam_gain, first, sums, most, is);
        }
    }

    /// Adds energies, and energies times the angle off axis (`beside`) of each cell's beam, to rows like those of
    /// [`receive_blocks`].
    pub fn add_moments(
        energies: &[[f32; BLOCK]],
        received: &[ReceivedBlock],
        beam_gain: &[f32],
        beside: &[f32],
        moment: &mut [f32],
        total: &mut [f32],
    ) {
        let (moment, total) = (rows(moment), rows(total));
        let (mut moments, mut totals) = (*moment, *total);
        for received in received {
            let (loud, aside) = (row(beam_gain, received.beam_gain), row(beside, received.beam_gain));
            let energies = &energies[received.block as usize];
            for beam in 0..BEAMS {
                let square = loud[beam] * loud[beam];
                for bin in 0..BLOCK {
                    let energy = square * energies[bin];
                    moments[bin][beam] += energy * aside[beam];
                    totals[bin][beam] += energy;
                }
            }
        }
        (*moment, *total) = (moments, totals);
    }

    /// Levels, dB re 1 uPa, of amplitudes convolved with the `taps` of a response: each weighs the cell that many
    /// further on. Amplitudes extend beyond those of `levels`, up to whole [`CELLS`], by the shift of the last tap.
    pub fn convolve_to_db(taps: &[(u32, f32)], re: &[f32], im: &[f32], levels: &mut [f32]) {
        let (whole, rest) = levels.as_chunks_mut();
        let after = whole.len() * CELLS;
        for (start, levels) in (0..).step_by(CELLS).zip(whole) {
            some_levels(taps, re, im, start, levels);
        }
        if !rest.is_empty() {
            let mut levels = [0.0; CELLS];
            some_levels(taps, re, im, after, &mut levels);
            rest.copy_from_slice(&levels[..rest.len()]);
        }
    }

    /// [`convolve_to_db`] of energies, with the squares of the taps, and with noise, to which the response is not
    /// applied: `(sqrt(energy) + re a)^2 + (im a)^2`, where the `powers` of the noise are `a^2`, uPa^2.
    pub fn convolve_energies_to_db(
        taps: &[(u32, f32)],
        energy: &[f32],
        noise: [&[f32]; 2],
        powers: &[f32],
        levels: &mut [f32],
    ) {
        let mut sums = [0.0; CELLS];
        for (start, levels) in (0..).step_by(CELLS).zip(levels.chunks_mut(CELLS)) {
            convolved(taps, true, energy, start, &mut sums);
            let (re, im, powers) = (some(noise[0], start), some(noise[1], start), some(powers, start));
            for cell in 0..CELLS {
                let amplitude = powers[cell].sqrt();
                let (re, im) = (re[cell] * amplitude, im[cell] * amplitude);
                let sum = sums[cell].sqrt() + re;
                sums[cell] = db(sum * sum + im * im);
            }
            levels.copy_from_slice(&sums[..levels.len()]);
        }
    }

    /// `to = from + noise sqrt(power)`, of real and imaginary parts.
    pub fn add_noise(
        power: &[f32],
        re: &[f32],
        im: &[f32],
        noise_re: &[f32],
        noise_im: &[f32],
        to_re: &mut [f32],
        to_im: &mut [f32],
    ) {
        let noise = noise_re.iter().zip(noise_im).zip(power);
        let to = to_re.iter_mut().zip(to_im);
        for (((to_re, to_im), (re, im)), ((noise_re, noise_im), power)) in to.zip(re.iter().zip(im)).zip(noise) {
            let amplitude = power.sqrt();
            *to_re = re + noise_re * amplitude;
            *to_im = im + noise_im * amplitude;
        }
    }
}
