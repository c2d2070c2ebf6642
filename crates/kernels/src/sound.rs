//! Sound that beams hear: sums over range bins, levels.

use crate::level::kernels;
use crate::math::{LOG2_PER_DB, log2};
use std::ops::Range;

/// Range bins of a block.
pub const BLOCK: usize = 4;

/// Beams that hear a block together: their sums fill the vector registers.
pub const BEAMS: usize = 16;

/// Of blocks that none of the beams hears.
pub const UNHEARD: u32 = u32::MAX;

/// What arrives in [`BLOCK`] range bins: a cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Block {
    /// Sums of amplitudes, or of energies.
    pub re: [f32; BLOCK],
    /// Their imaginary parts.
    pub im: [f32; BLOCK],
    /// Energy of the strongest arrival.
    pub most: [f32; BLOCK],
    /// Its number.
    pub who: [u32; BLOCK],
}

/// The numbers of [`BEAMS`] beams from `at` on.
#[inline(always)]
fn row(numbers: &[f32], at: u32) -> &[f32; BEAMS] {
    numbers[at as usize..at as usize + BEAMS].try_into().expect("as many as there are beams")
}

/// [`hear_blocks`], of amplitudes or of energies.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn hear<const COHERENT: bool>(
    blocks: &[Block],
    of: &[u32],
    heard_by: &[u32],
    loudness: &[f32],
    first: u32,
    [sum_re, sum_im]: [&mut [f32]; 2],
    most: &mut [f32],
    is: &mut [u32],
) {
    let rows = most.as_chunks_mut::<BEAMS>().0.iter_mut().zip(is.as_chunks_mut::<BEAMS>().0);
    for (bin, (most, is)) in rows.enumerate() {
        let sum_re = &mut sum_re.as_chunks_mut::<BEAMS>().0[bin];
        let (mut re, mut im, mut best, mut whose) = (*sum_re, [0.0; BEAMS], *most, *is);
        if COHERENT {
            im = sum_im.as_chunks_mut::<BEAMS>().0[bin];
        }
        for (block, &of) in blocks.iter().zip(of) {
            let at = heard_by[of as usize];
            if at == UNHEARD {
                continue;
            }
            let loud = row(loudness, at);
            let (x, y, energy, who) = (block.re[bin], block.im[bin], block.most[bin], first + block.who[bin]);
            for beam in 0..BEAMS {
                let loud = loud[beam];
                if COHERENT {
                    re[beam] += loud * x;
                    im[beam] += loud * y;
                } else {
                    re[beam] += loud * loud * x;
                }
                let heard = loud * loud * energy;
                whose[beam] = if heard > best[beam] { who } else { whose[beam] };
                best[beam] = if heard > best[beam] { heard } else { best[beam] };
            }
        }
        (*sum_re, *most, *is) = (re, best, whose);
        if COHERENT {
            sum_im.as_chunks_mut::<BEAMS>().0[bin] = im;
        }
    }
}

/// What a beam hears from far aside: each of the `rows` as loud as it says. They are of `width` numbers: sums of energies, the
/// greatest of them, and whose it is.
#[derive(Clone, Copy, Debug)]
pub struct Aside<'a> {
    /// Which rows, and how loudly they are heard.
    pub rows: &'a [(u32, f32)],
    /// Cells of a row.
    pub width: usize,
    /// Sums.
    pub energy: &'a [f32],
    /// The greatest.
    pub most: &'a [f32],
    /// Whose that is.
    pub who: &'a [u32],
}

/// [`hear_aside`] in the `CELLS` from `first` on: their sums stay in registers while all rows pass.
#[inline(always)]
fn hear_some<const CELLS: usize>(aside: Aside, first: usize, powers: &mut [f32]) {
    let mut sum = [0.0; CELLS];
    for &(number, scale) in aside.rows {
        let at = number as usize * aside.width + first;
        let energy: &[f32; CELLS] = aside.energy[at..at + CELLS].try_into().expect("as many");
        for cell in 0..CELLS {
            sum[cell] += scale * energy[cell];
        }
    }
    powers[first..first + CELLS].copy_from_slice(&sum);
}

/// [`tell_aside`] in the `CELLS` from `first` on.
#[inline(always)]
fn tell_some<const CELLS: usize>(
    aside: Aside,
    first: usize,
    powers: &[f32],
    nobody: u32,
    noise: f32,
    told: &mut [u32],
) {
    let powers: &[f32; CELLS] = powers[first..first + CELLS].try_into().expect("as many");
    let told: &mut [u32; CELLS] = (&mut told[first..first + CELLS]).try_into().expect("as many");
    let mut unknown = 0;
    for cell in 0..CELLS {
        unknown |= u32::from(told[cell] == nobody) & u32::from(powers[cell] > noise);
    }
    if unknown == 0 {
        return;
    }
    let (mut best, mut who) = ([0.0; CELLS], [nobody; CELLS]);
    for &(number, scale) in aside.rows {
        let at = number as usize * aside.width + first;
        let most: &[f32; CELLS] = aside.most[at..at + CELLS].try_into().expect("as many");
        let whose: &[u32; CELLS] = aside.who[at..at + CELLS].try_into().expect("as many");
        for cell in 0..CELLS {
            let heard = scale * most[cell];
            // Not a condition, which would keep this from becoming vector instructions.
            let stronger = 0u32.wrapping_sub((heard > best[cell]).into());
            who[cell] = whose[cell] & stronger | who[cell] & !stronger;
            best[cell] = if heard > best[cell] { heard } else { best[cell] };
        }
    }
    for cell in 0..CELLS {
        let unknown = (told[cell] == nobody) & (powers[cell] > noise);
        told[cell] = if unknown { who[cell] } else { told[cell] };
    }
}

/// Cells at a time, from far aside.
const CELLS: usize = 32;

/// A power as a level, dB.
#[inline(always)]
fn db(power: f32) -> f32 {
    log2(power.max(1e-30)) * (1.0 / LOG2_PER_DB)
}

/// [`columns`] of anything.
#[inline(always)]
fn transpose<T: Copy>(width: usize, rows: &[T], first: usize, count: usize, columns: &mut [T]) {
    /// Rows at a time: they stay in the first cache.
    const BLOCK: usize = 16;
    if rows.is_empty() {
        return;
    }
    if width == 1 {
        return columns[first..first + rows.len()].copy_from_slice(rows);
    }
    for (start, block) in (first..).step_by(BLOCK).zip(rows.chunks(BLOCK * width)) {
        let rows = block.len() / width;
        for column in 0..width {
            let from = column * count + start;
            for (to, row) in columns[from..from + rows].iter_mut().zip(block.chunks_exact(width)) {
                *to = row[column];
            }
        }
    }
}

kernels! {
    /// `to += scale from`.
    pub fn add(scale: f32, from: &[f32], to: &mut [f32]) {
        for (sum, x) in to.iter_mut().zip(from) {
            *sum += scale * x;
        }
    }

    /// Keeps for every cell the greatest energy, `loud^2 energy`, and whose it is.
    pub fn prefer_parts(loud: f32, energy: &[f32], who: u32, most: &mut [f32], is: &mut [u32]) {
        for ((most, is), energy) in most.iter_mut().zip(is).zip(energy) {
            let heard = loud * loud * energy;
            *is = if heard > *most { who } else { *is };
            *most = if heard > *most { heard } else { *most };
        }
    }

    /// Adds `blocks` of the same [`BLOCK`] bins, or fewer at the end, to as many rows of [`BEAMS`] cells: amplitudes, and for
    /// every cell the greatest energy and whose it is. `heard_by` says of what each block is `of` from where on in `loudness`
    /// stands how loudly these beams hear it, or [`UNHEARD`]; the numbers of arrivals are those from `first` on.
    pub fn hear_blocks(
        blocks: &[Block],
        of: &[u32],
        heard_by: &[u32],
        loudness: &[f32],
        first: u32,
        sums: [&mut [f32]; 2],
        most: &mut [f32],
        is: &mut [u32],
    ) {
        hear::<true>(blocks, of, heard_by, loudness, first, sums, most, is);
    }

    /// [`hear_blocks`] of energies, in the place of real parts: scaled by the square, as there are no imaginary ones.
    pub fn hear_blocks_squared(
        blocks: &[Block],
        of: &[u32],
        heard_by: &[u32],
        loudness: &[f32],
        first: u32,
        sum: &mut [f32],
        most: &mut [f32],
        is: &mut [u32],
    ) {
        hear::<false>(blocks, of, heard_by, loudness, first, [sum, &mut []], most, is);
    }

    /// Adds energies, and energies times the angle `beside` the axis of each cell's beam, to rows like those of
    /// [`hear_blocks`].
    pub fn lean_blocks(
        energies: &[[f32; BLOCK]],
        of: &[u32],
        heard_by: &[u32],
        loudness: &[f32],
        beside: &[f32],
        lean: &mut [f32],
        total: &mut [f32],
    ) {
        let rows = lean.as_chunks_mut::<BEAMS>().0.iter_mut().zip(total.as_chunks_mut::<BEAMS>().0);
        for (bin, (lean, total)) in rows.enumerate() {
            let (mut leans, mut totals) = (*lean, *total);
            for (energy, &of) in energies.iter().zip(of) {
                let at = heard_by[of as usize];
                if at == UNHEARD {
                    continue;
                }
                let (loud, aside, energy) = (row(loudness, at), row(beside, at), energy[bin]);
                for beam in 0..BEAMS {
                    let heard = loud[beam] * loud[beam] * energy;
                    leans[beam] += heard * aside[beam];
                    totals[beam] += heard;
                }
            }
            (*lean, *total) = (leans, totals);
        }
    }

    /// Powers of what is heard from far aside in the cells of `span`.
    pub fn hear_aside(aside: Aside, span: Range<usize>, powers: &mut [f32]) {
        let whole = span.end - span.len() % CELLS;
        (span.start..whole).step_by(CELLS).for_each(|cell| hear_some::<CELLS>(aside, cell, powers));
        (whole..span.end).for_each(|cell| hear_some::<1>(aside, cell, powers));
    }

    /// In the cells of `span`, those in which `nobody` is heard become whose is the greatest from far aside, where the `powers`
    /// of that are above the `noise`.
    pub fn tell_aside(
        aside: Aside,
        span: Range<usize>,
        powers: &[f32],
        nobody: u32,
        noise: f32,
        told: &mut [u32],
    ) {
        let whole = span.end - span.len() % CELLS;
        for cell in (span.start..whole).step_by(CELLS) {
            tell_some::<CELLS>(aside, cell, powers, nobody, noise, told);
        }
        for cell in whole..span.end {
            tell_some::<1>(aside, cell, powers, nobody, noise, told);
        }
    }

    /// Convolves a line with a symmetric response of `taps`, given from the middle on; `padded` is the line with as
    /// many zeros on either side as there are taps beside the middle.
    pub fn convolve(taps: &[f32], squared: bool, padded: &[f32], out: &mut [f32]) {
        /// Sums that stay in registers while all taps pass: so many that none waits for the one before.
        const BLOCK: usize = 64;
        let half = taps.len() - 1;
        let tap = |shift: usize| {
            let tap = taps[shift.abs_diff(half)];
            if squared { tap * tap } else { tap }
        };
        let whole = out.len() - out.len() % BLOCK;
        for (start, out) in (0..).step_by(BLOCK).zip(out[..whole].chunks_exact_mut(BLOCK)) {
            let mut sums = [0.0; BLOCK];
            for shift in 0..=2 * half {
                let tap = tap(shift);
                if tap == 0.0 {
                    continue;
                }
                for (sum, value) in sums.iter_mut().zip(&padded[start + shift..start + shift + BLOCK]) {
                    *sum += tap * value;
                }
            }
            out.copy_from_slice(&sums);
        }
        for (at, out) in (whole..).zip(&mut out[whole..]) {
            *out = 0.0;
            for shift in 0..=2 * half {
                *out += tap(shift) * padded[at + shift];
            }
        }
    }

    /// The columns of rows of `width` numbers, one after the other, each `count` long: the rows are those from `first` on.
    pub fn columns(width: usize, rows: &[f32], first: usize, count: usize, columns: &mut [f32]) {
        transpose(width, rows, first, count, columns);
    }

    /// [`columns`] of whole numbers.
    pub fn columns_of_numbers(width: usize, rows: &[u32], first: usize, count: usize, columns: &mut [u32]) {
        transpose(width, rows, first, count, columns);
    }

    /// `a += b c`.
    pub fn add_product(a: &mut [f32], b: &[f32], c: &[f32]) {
        for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
            *a += b * c;
        }
    }

    /// `a = sqrt(a^2 + power)`.
    pub fn add_to_square(power: &[f32], a: &mut [f32]) {
        for (a, power) in a.iter_mut().zip(power) {
            *a = (*a * *a + power).sqrt();
        }
    }

    /// Levels, dB, of what has these amplitudes.
    pub fn amplitudes_to_db(re: &[f32], im: &[f32], levels: &mut [f32]) {
        for ((level, re), im) in levels.iter_mut().zip(re).zip(im) {
            *level = db(re * re + im * im);
        }
    }

    /// `to = (sqrt(energy) + re a)^2 + (im a)^2`, with noise of the amplitudes `a`.
    pub fn with_noise(energy: &[f32], re: &[f32], im: &[f32], a: &[f32], to: &mut [f32]) {
        for ((((to, energy), re), im), a) in to.iter_mut().zip(energy).zip(re).zip(im).zip(a) {
            let (re, im) = (re * a, im * a);
            let amplitude = energy.sqrt() + re;
            *to = amplitude * amplitude + im * im;
        }
    }

    /// Powers as levels, dB.
    pub fn to_db(powers: &mut [f32]) {
        for level in powers {
            *level = db(*level);
        }
    }
}
