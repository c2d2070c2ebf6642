//! Random numbers that are a pure function of their address: no state, so results do not depend on threads or on the
//! order of work.
//!
//! Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as 1, 2, 3"): a key of two words,
//! a counter of four. A lane computes the same number as a single call.

use crate::level::kernels;
use crate::math::{cos_pi, ln, sin_pi};
use crate::sound::BEAMS;
use crate::tile::{ROWS, TileRows};

const MULTIPLIER: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;

/// Cells that take the first two words of one counter each in [`phasor_row`]; the next ones take the other two. Not the
/// lanes of a vector, as results must not depend on the level.
const HALF: usize = 16;

/// One block of Philox4x32-10 for each of `N` counters under one key.
///
/// Words occupy the lower halves of 64 bits each, as vector multiplications take them and leave their products; the
/// upper halves are never read.
#[inline(always)]
fn philox<const N: usize>(counter: [[u32; N]; 4], mut key: [u32; 2]) -> [[u32; N]; 4] {
    const LOWER: u64 = u32::MAX as u64;
    let mut state = [[0u64; N]; 4];
    for word in 0..4 {
        for lane in 0..N {
            state[word][lane] = counter[word][lane].into();
        }
    }
    for _ in 0..ROUNDS {
        let [c0, c1, c2, c3] = state;
        for lane in 0..N {
            let product0 = u64::from(MULTIPLIER[0]) * (c0[lane] & LOWER);
            let product1 = u64::from(MULTIPLIER[1]) * (c2[lane] & LOWER);
            state[0][lane] = (product1 >> 32) ^ c1[lane] ^ u64::from(key[0]);
            state[1][lane] = product1;
            state[2][lane] = (product0 >> 32) ^ c3[lane] ^ u64::from(key[1]);
            state[3][lane] = product0;
        }
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    let mut words = [[0; N]; 4];
    for word in 0..4 {
        for lane in 0..N {
            words[word][lane] = state[word][lane] as u32;
        }
    }
    words
}

/// The blocks of up to [`N`] counters of which `first` and `third` vary.
#[inline(always)]
fn words<const N: usize>(key: [u32; 2], [first, third]: [&[u32]; 2], [second, fourth]: [u32; 2]) -> [[u32; N]; 4] {
    let (mut a, mut c) = ([0; N], [0; N]);
    a[..first.len()].copy_from_slice(first);
    c[..third.len()].copy_from_slice(third);
    philox([a, [second; N], c, [fourth; N]], key)
}

/// The block of one counter.
#[inline]
pub fn block(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    philox(counter.map(|word| [word]), key).map(|[word]| word)
}

kernels! {
    /// Standard normal numbers with the counters `first[i], second, third[i], fourth`, one for each element of `out`.
    pub fn normals(
        key: [u32; 2],
        first: &[u32],
        second: u32,
        third: &[u32],
        fourth: u32,
        out: &mut [f32],
    ) {
        for ((out, first), third) in out.chunks_mut(N).zip(first.chunks(N)).zip(third.chunks(N)) {
            // Plain loops: closures would be compiled separately, without the caller's vector instructions.
            let words = words::<N>(key, [first, third], [second, fourth]);
            let mut values = [0.0; N];
            for lane in 0..N {
                values[lane] = normal(words[0][lane], words[1][lane]);
            }
            out.copy_from_slice(&values[..out.len()]);
        }
    }

    /// Two standard normal numbers with the counters `first[i], second, third[i], fourth` for each element of `a` and
    /// `b`; those of `a` are the same as from [`normals`].
    pub fn normal_pairs(
        key: [u32; 2],
        first: &[u32],
        second: u32,
        third: &[u32],
        fourth: u32,
        a: &mut [f32],
        b: &mut [f32],
    ) {
        let counters = first.chunks(N).zip(third.chunks(N));
        for ((a, b), (first, third)) in a.chunks_mut(N).zip(b.chunks_mut(N)).zip(counters) {
            let words = words::<N>(key, [first, third], [second, fourth]);
            let (mut values, mut others) = ([0.0; N], [0.0; N]);
            for lane in 0..N {
                values[lane] = normal(words[0][lane], words[1][lane]);
                others[lane] = normal(words[2][lane], words[3][lane]);
            }
            a.copy_from_slice(&values[..a.len()]);
            b.copy_from_slice(&others[..b.len()]);
        }
    }

    /// Numbers in [0, 1) with the counters `first[i], second, third[i], fourth`, one for each element of `out`.
    pub fn uniforms(
        key: [u32; 2],
        first: &[u32],
        second: u32,
        third: &[u32],
        fourth: u32,
        out: &mut [f32],
    ) {
        for ((out, first), third) in out.chunks_mut(N).zip(first.chunks(N)).zip(third.chunks(N)) {
            let [words, ..] = words::<N>(key, [first, third], [second, fourth]);
            let mut values = [0.0; N];
            for lane in 0..N {
                values[lane] = unit(words[lane]);
            }
            out.copy_from_slice(&values[..out.len()]);
        }
    }

    /// Two numbers in [0, 1) with the counters `first[i], second, third[i], fourth` for each element of `a` and `b`;
    /// those of `a` are the same as from [`uniforms`].
    pub fn uniform_pairs(
        key: [u32; 2],
        first: &[u32],
        second: u32,
        third: &[u32],
        fourth: u32,
        a: &mut [f32],
        b: &mut [f32],
    ) {
        let counters = first.chunks(N).zip(third.chunks(N));
        for ((a, b), (first, third)) in a.chunks_mut(N).zip(b.chunks_mut(N)).zip(counters) {
            let [x, y, ..] = words::<N>(key, [first, third], [second, fourth]);
            let (mut values, mut others) = ([0.0; N], [0.0; N]);
            for lane in 0..N {
                values[lane] = unit(x[lane]);
                others[lane] = unit(y[lane]);
            }
            a.copy_from_slice(&values[..a.len()]);
            b.copy_from_slice(&others[..b.len()]);
        }
    }

    /// Complex numbers whose squared magnitude is exponentially distributed with mean 1 and whose phase is uniform: the
    /// sum of many small echoes. Each has its own counter.
    pub fn phasors(key: [u32; 2], counter: [&[u32]; 4], re: &mut [f32], im: &mut [f32]) {
        let count = re.len();
        for first in (0..count).step_by(N) {
            let lanes = first..(first + N).min(count);
            let mut words = [[0u32; N]; 4];
            for (word, from) in words.iter_mut().zip(counter) {
                word[..lanes.len()].copy_from_slice(&from[lanes.clone()]);
            }
            let [a, b, ..] = philox(words, key);
            let (mut x, mut y) = ([0.0; N], [0.0; N]);
            for lane in 0..N {
                (x[lane], y[lane]) = phasor(a[lane], b[lane]);
            }
            re[lanes.clone()].copy_from_slice(&x[..lanes.len()]);
            im[lanes.clone()].copy_from_slice(&y[..lanes.len()]);
        }
    }

    /// [`phasors`] of the counters that begin with `0 ..` and end with the three words `rest`; each counter gives two
    /// numbers.
    pub fn phasor_row(key: [u32; 2], rest: [u32; 3], re: &mut [f32], im: &mut [f32]) {
        for (index, (re, im)) in (0..).zip(re.chunks_mut(2 * HALF).zip(im.chunks_mut(2 * HALF))) {
            let mut first = [0; HALF];
            for lane in 0..HALF {
                first[lane] = index * HALF as u32 + lane as u32;
            }
            let [a, b, c, d] = philox([first, [rest[0]; HALF], [rest[1]; HALF], [rest[2]; HALF]], key);
            let (mut x, mut y) = ([[0.0; HALF]; 2], [[0.0; HALF]; 2]);
            for lane in 0..HALF {
                (x[0][lane], y[0][lane]) = phasor(a[lane], b[lane]);
                (x[1][lane], y[1][lane]) = phasor(c[lane], d[lane]);
            }
            re.copy_from_slice(&x.as_flattened()[..re.len()]);
            im.copy_from_slice(&y.as_flattened()[..im.len()]);
        }
    }

    /// [`phasor_row`]s of [`BEAMS`] beams, for the cells from `first` on, a multiple of [`ROWS`]. The middle one of the
    /// words `rest` is that of the first beam; it increases by one per beam.
    pub fn phasor_rows(key: [u32; 2], rest: [u32; 3], first: usize, re: &mut TileRows, im: &mut TileRows) {
        const { assert!(ROWS == 2 * HALF) };
        let mut beams = [rest[1]; BEAMS];
        for beam in 0..BEAMS {
            beams[beam] += beam as u32;
        }
        for row in 0..HALF {
            let counter = (first / 2 + row) as u32;
            let [a, b, c, d] = philox([[counter; BEAMS], [rest[0]; BEAMS], beams, [rest[2]; BEAMS]], key);
            let (mut x, mut y) = ([[0.0; BEAMS]; 2], [[0.0; BEAMS]; 2]);
            for beam in 0..BEAMS {
                (x[0][beam], y[0][beam]) = phasor(a[beam], b[beam]);
                (x[1][beam], y[1][beam]) = phasor(c[beam], d[beam]);
            }
            for (half, cells) in [row, row + HALF].into_iter().enumerate() {
                re[cells * BEAMS..(cells + 1) * BEAMS].copy_from_slice(&x[half]);
                im[cells * BEAMS..(cells + 1) * BEAMS].copy_from_slice(&y[half]);
            }
        }
    }
}

/// A number in [0, 1) from 24 random bits.
#[inline(always)]
pub fn unit(word: u32) -> f32 {
    (word >> 8) as i32 as f32 / (1 << 24) as f32
}

/// What no number from [`normal`] exceeds: sqrt(2 ln 2^24) = 5.7681.
pub const GREATEST_NORMAL: f32 = 5.7682;

/// A standard normal number from 48 random bits (Box and Muller 1958), at most [`GREATEST_NORMAL`].
#[inline(always)]
pub fn normal(a: u32, b: u32) -> f32 {
    const UNIT: f32 = 1.0 / (1 << 24) as f32;
    // In (0, 1], so that the logarithm is finite; the conversions go through i32 because SIMD units have no other.
    let u = ((a >> 8) as i32 + 1) as f32 * UNIT;
    let turn = (b >> 8) as i32 as f32 * UNIT - 0.5;
    let radius = (-2.0 * ln(u)).sqrt();
    // -cos(2 pi t) = 2 sin^2(pi t) - 1
    let sine = sin_pi(turn);
    radius * (2.0 * sine * sine - 1.0)
}

/// A complex number of mean power 1 whose power is exponential, from 48 random bits.
#[inline(always)]
fn phasor(a: u32, b: u32) -> (f32, f32) {
    const UNIT: f32 = 1.0 / (1 << 24) as f32;
    let u = ((a >> 8) as i32 + 1) as f32 * UNIT;
    let turn = (b >> 8) as i32 as f32 * UNIT - 0.5;
    let amplitude = (-ln(u)).max(0.0).sqrt();
    // By the half angle.
    let (sine, cosine) = (sin_pi(turn), cos_pi(turn));
    (amplitude * (1.0 - 2.0 * sine * sine), amplitude * 2.0 * sine * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known-answer vectors of Random123 1.14 (DEShawResearch, `tests/kat_vectors`, rows `philox4x32 10`).
    #[test]
    fn known_answers_of_random123() {
        let cases: [([u32; 4], [u32; 2], [u32; 4]); 3] = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, expected) in cases {
            assert_eq!(philox(counter.map(|word| [word]), key).map(|[word]| word), expected);
            assert_eq!(philox(counter.map(|word| [word; 16]), key).map(|lanes| lanes[15]), expected);
        }
    }

    #[test]
    fn no_normal_number_exceeds_the_greatest() {
        let greatest = normal(0, 0).max(normal(0, 1 << 31));
        assert!(greatest <= GREATEST_NORMAL && greatest > GREATEST_NORMAL - 1e-3, "{greatest}");
    }

    #[test]
    fn rows_are_those_of_one_beam_after_the_other() {
        for first in [0, 2 * ROWS] {
            let [mut re, mut im] = [[0.0; ROWS * BEAMS]; 2];
            phasor_rows([1, 2], [3, 40, 5], first, &mut re, &mut im);
            for beam in 0..BEAMS {
                let [mut x, mut y] = [[0.0; 3 * ROWS]; 2];
                phasor_row([1, 2], [3, 40 + beam as u32, 5], &mut x, &mut y);
                for row in 0..ROWS {
                    let cell = row * BEAMS + beam;
                    assert_eq!((re[cell], im[cell]), (x[first + row], y[first + row]), "beam {beam}, row {row}");
                }
            }
        }
    }
}
