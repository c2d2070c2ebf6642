//! Sound that beams hear: sums over range bins, levels.

use crate::level::kernels;
use crate::math::{LOG2_PER_DB, log2};

/// If `heard` is more than the `most` so far, takes it and whose it is.
#[inline(always)]
fn prefer(heard: f32, who: u32, most: &mut f32, is: &mut u32) {
    let stronger = heard > *most;
    *most = if stronger { heard } else { *most };
    *is = if stronger { who } else { *is };
}

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
    /// Whole numbers next below `places`, which are less than 2^31, as the words of an address.
    pub fn cells(places: &[f32], words: &mut [u32]) {
        /// Beside it the lower half of a number's bits is a whole number.
        const UNIT: f64 = 1.5 * (1u64 << 52) as f64;
        for (word, place) in words.iter_mut().zip(places) {
            *word = (f64::from(place.floor()) + UNIT).to_bits() as u32;
        }
    }

    /// `to += scale from`.
    pub fn add(scale: f32, from: &[f32], to: &mut [f32]) {
        for (sum, x) in to.iter_mut().zip(from) {
            *sum += scale * x;
        }
    }

    /// Keeps for every cell the greatest energy, `loud^2 energy`, and whose it is.
    pub fn prefer_parts(loud: f32, energy: &[f32], who: u32, most: &mut [f32], is: &mut [u32]) {
        for ((most, is), energy) in most.iter_mut().zip(is).zip(energy) {
            prefer(loud * loud * energy, who, most, is);
        }
    }

    /// Adds the `parts` of an arrival to consecutive rows of `width` cells, from cell `start` on, scaled cell by cell
    /// by `loudness`.
    pub fn add_rows(start: usize, width: usize, loudness: &[f32], parts: &[f32], to: &mut [f32]) {
        for (bin, &x) in parts.iter().enumerate() {
            let start = start + bin * width;
            for (sum, &loud) in to[start..start + loudness.len()].iter_mut().zip(loudness) {
                *sum += loud * x;
            }
        }
    }

    /// Adds the amplitudes of an arrival to rows like those of [`add_rows`], and keeps for every cell the greatest energy and
    /// whose it is, all at once.
    pub fn hear_rows(
        start: usize,
        width: usize,
        loudness: &[f32],
        amplitudes: [&[f32]; 2],
        energy: &[f32],
        who: u32,
        sums: [&mut [f32]; 2],
        most: &mut [f32],
        is: &mut [u32],
    ) {
        let ([re, im], [sum_re, sum_im]) = (amplitudes, sums);
        for (bin, ((&x, &y), &energy)) in re.iter().zip(im).zip(energy).enumerate() {
            let cells = start + bin * width..start + bin * width + loudness.len();
            let sums = sum_re[cells.clone()].iter_mut().zip(&mut sum_im[cells.clone()]);
            let best = most[cells.clone()].iter_mut().zip(&mut is[cells]);
            for (((re, im), (most, is)), &loud) in sums.zip(best).zip(loudness) {
                *re += loud * x;
                *im += loud * y;
                prefer(loud * loud * energy, who, most, is);
            }
        }
    }

    /// Adds `scale from` to sums, and keeps for each the greatest part and whose it is.
    pub fn add_and_prefer(
        scale: f32,
        from: &[f32],
        parts: &[f32],
        whose: &[u32],
        to: &mut [f32],
        most: &mut [f32],
        is: &mut [u32],
    ) {
        let best = most.iter_mut().zip(is);
        for (((sum, x), (part, who)), (most, is)) in to.iter_mut().zip(from).zip(parts.iter().zip(whose)).zip(best) {
            *sum += scale * x;
            prefer(scale * part, *who, most, is);
        }
    }

    /// [`add_rows`] of energies: scaled by the square.
    pub fn add_rows_squared(start: usize, width: usize, loudness: &[f32], parts: &[f32], to: &mut [f32]) {
        for (bin, &x) in parts.iter().enumerate() {
            let start = start + bin * width;
            for (sum, &loud) in to[start..start + loudness.len()].iter_mut().zip(loudness) {
                *sum += loud * loud * x;
            }
        }
    }

    /// [`prefer_parts`] for rows like those of [`add_rows`].
    pub fn prefer_rows(
        start: usize,
        width: usize,
        loudness: &[f32],
        energy: &[f32],
        who: u32,
        most: &mut [f32],
        is: &mut [u32],
    ) {
        for (bin, &energy) in energy.iter().enumerate() {
            let cells = start + bin * width..start + bin * width + loudness.len();
            for ((most, is), &loud) in most[cells.clone()].iter_mut().zip(&mut is[cells]).zip(loudness) {
                prefer(loud * loud * energy, who, most, is);
            }
        }
    }

    /// Adds energies, and energies times the angle `beside` the axis of each cell's beam, to rows like those of
    /// [`add_rows`].
    pub fn lean_rows(
        start: usize,
        width: usize,
        loudness: &[f32],
        beside: &[f32],
        energy: &[f32],
        lean: &mut [f32],
        total: &mut [f32],
    ) {
        for (bin, &energy) in energy.iter().enumerate() {
            let cells = start + bin * width..start + bin * width + loudness.len();
            let sums = lean[cells.clone()].iter_mut().zip(&mut total[cells]);
            for ((lean, total), (&loud, &beside)) in sums.zip(loudness.iter().zip(beside)) {
                let heard = loud * loud * energy;
                *lean += heard * beside;
                *total += heard;
            }
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

    /// Those in which nobody is heard become the strongest aside where `powers` are above the `noise`.
    pub fn tell_of_louder(nobody: u32, noise: f32, powers: &[f32], strongest: &[u32], told: &mut [u32]) {
        for ((who, &power), &strongest) in told.iter_mut().zip(powers).zip(strongest) {
            *who = if (*who == nobody) & (power > noise) { strongest } else { *who };
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
