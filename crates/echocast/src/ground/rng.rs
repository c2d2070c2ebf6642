//! Random numbers that are a pure function of their address: no state, so results do not depend on
//! threads or on the order of work.
//!
//! Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as 1, 2, 3"):
//! key = seed, counter = (beam, frame, sub-ray, [`Draw`]). The per-beam draws are made for many lanes
//! at once; one lane computes what [`Rng`] computes.

use crate::ground::math::{cos_pi, ln, sin_pi};

/// What a random number is for. Numbers are written out and never reused, so that a new purpose leaves
/// the draws of the others as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Draw {
    /// Gaussian error of the measured range.
    RangeJitter = 1,
    /// Gaussian error of the reported azimuth.
    AzimuthJitter = 2,
    /// Whether a return gets lost.
    Dropout = 3,
    /// How many rain drops a beam meets, where, how large.
    Drops = 4,
    /// Likewise flakes of snow.
    Flakes = 5,
    /// Gaussian error of the range from rain.
    RainRange = 6,
    /// By how much the sub-rays of a beam are turned about it.
    Footprint = 7,
    /// Noise that an echo is detected in: sub-ray 0 for the surface that a beam meets, the bits of the range for others.
    Detection = 20,
    /// Noise that looks like an echo.
    FalseAlarm = 21,
    /// Error of the range of a channel, once for an instrument: seed = its number, counter = (channel, 0, 0).
    ChannelBias = 22,
    /// Likewise relative error of the range.
    ChannelGain = 23,
    /// Where a beam points beside what is reported: sub-rays 0 and 1 for the two directions across it.
    Pointing = 24,
    /// Error of the reported time, by firing.
    TimeJitter = 25,
    /// Whether a weak return gets lost.
    WeakDropout = 26,
    /// Gaussian errors of the phases of modulated light, by frequency.
    Phase = 30,
    /// Gaussian error of the measured depth.
    DepthJitter = 31,
    /// By how much a pixel looks beside its place.
    LookAside = 32,
    /// Where light that comes to a pixel over two surfaces met the first.
    SecondBounce = 33,
    /// Phase and amplitude of what a small place of a surface scatters of sound: counter = (place, what it belongs to).
    Speckle = 40,
    /// How rough a larger place of a surface is.
    Texture = 41,
    /// Noise of a sonar's receiver, by cell.
    PingNoise = 42,
    /// Shape of generated ground.
    Terrain = 100,
    /// Shape, size and place of generated boulders.
    Boulder = 101,
    /// Likewise wrecks.
    Wreck = 102,
    /// Likewise fish.
    Fish = 103,
}

const MULTIPLIER: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;

/// One block of Philox4x32-10 for each of `N` counters under one key.
#[inline(always)]
fn philox<const N: usize>(mut counter: [[u32; N]; 4], mut key: [u32; 2]) -> [[u32; N]; 4] {
    for _ in 0..ROUNDS {
        let [c0, c1, c2, c3] = counter;
        let mut next = [[0u32; N]; 4];
        for lane in 0..N {
            let product0 = u64::from(MULTIPLIER[0]) * u64::from(c0[lane]);
            let product1 = u64::from(MULTIPLIER[1]) * u64::from(c2[lane]);
            next[0][lane] = (product1 >> 32) as u32 ^ c1[lane] ^ key[0];
            next[1][lane] = product1 as u32;
            next[2][lane] = (product0 >> 32) as u32 ^ c3[lane] ^ key[1];
            next[3][lane] = product0 as u32;
        }
        counter = next;
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    counter
}

/// Random numbers of one scan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rng {
    key: [u32; 2],
    frame: u32,
}

impl Rng {
    pub(crate) fn new(seed: u64, frame: u32) -> Self {
        Rng { key: [seed as u32, (seed >> 32) as u32], frame }
    }

    /// Standard normal numbers of `beams` at their `sub_rays`, one for each element of `out`.
    #[inline(always)]
    pub(crate) fn normals(&self, beams: &[u32], sub_rays: &[u32], draw: Draw, out: &mut [f32]) {
        /// Lanes per block: two AVX2 registers hide the latency of the multiplications.
        const N: usize = 16;
        for ((out, beams), sub_rays) in out.chunks_mut(N).zip(beams.chunks(N)).zip(sub_rays.chunks(N)) {
            // Plain loops: closures would be compiled apart, without the vector instructions of the caller.
            let words = self.words::<N>(beams, sub_rays, draw);
            let mut values = [0.0; N];
            for lane in 0..N {
                values[lane] = normal(words[0][lane], words[1][lane]);
            }
            out.copy_from_slice(&values[..out.len()]);
        }
    }

    /// Numbers in [0, 1) of `beams` at their `sub_rays`, one for each element of `out`.
    #[inline(always)]
    pub(crate) fn uniforms(&self, beams: &[u32], sub_rays: &[u32], draw: Draw, out: &mut [f32]) {
        const N: usize = 16;
        for ((out, beams), sub_rays) in out.chunks_mut(N).zip(beams.chunks(N)).zip(sub_rays.chunks(N)) {
            let [words, ..] = self.words::<N>(beams, sub_rays, draw);
            let mut values = [0.0; N];
            for lane in 0..N {
                values[lane] = unit(words[lane]);
            }
            out.copy_from_slice(&values[..out.len()]);
        }
    }

    /// Random words of up to `N` beams.
    #[inline(always)]
    fn words<const N: usize>(&self, beams: &[u32], sub_rays: &[u32], draw: Draw) -> [[u32; N]; 4] {
        let (mut beam, mut sub_ray) = ([0; N], [0; N]);
        beam[..beams.len()].copy_from_slice(beams);
        sub_ray[..sub_rays.len()].copy_from_slice(sub_rays);
        philox([beam, [self.frame; N], sub_ray, [draw as u32; N]], self.key)
    }

    /// Complex numbers whose squared magnitude is exponentially distributed with mean 1 and whose phase is even, turned by
    /// `turns` of a circle: the sum of many small echoes. Each at its own address of four words.
    #[inline(always)]
    pub(crate) fn phasors(&self, address: [&[u32]; 4], turns: &[f32], re: &mut [f32], im: &mut [f32]) {
        const N: usize = 16;
        let count = re.len();
        for first in (0..count).step_by(N) {
            let lanes = first..(first + N).min(count);
            let mut counter = [[0u32; N]; 4];
            for (word, from) in counter.iter_mut().zip(address) {
                word[..lanes.len()].copy_from_slice(&from[lanes.clone()]);
            }
            let mut turn = [0.0f32; N];
            turn[..lanes.len()].copy_from_slice(&turns[lanes.clone()]);
            let [a, b, ..] = philox(counter, self.key);
            let (mut x, mut y) = ([0.0; N], [0.0; N]);
            for lane in 0..N {
                (x[lane], y[lane]) = phasor(a[lane], b[lane], turn[lane]);
            }
            re[lanes.clone()].copy_from_slice(&x[..lanes.len()]);
            im[lanes.clone()].copy_from_slice(&y[..lanes.len()]);
        }
    }

    /// [`Rng::phasors`] of the cells of `beam`, in their order.
    #[inline(always)]
    pub(crate) fn cell_phasors(&self, beam: u32, draw: Draw, re: &mut [f32], im: &mut [f32]) {
        /// Addresses at a time; each has the numbers of two cells.
        const N: usize = 16;
        for (index, (re, im)) in (0..).zip(re.chunks_mut(2 * N).zip(im.chunks_mut(2 * N))) {
            let mut cells = [0; N];
            for lane in 0..N {
                cells[lane] = index * N as u32 + lane as u32;
            }
            let [a, b, c, d] = philox([cells, [self.frame; N], [beam; N], [draw as u32; N]], self.key);
            let (mut x, mut y) = ([0.0; 2 * N], [0.0; 2 * N]);
            for lane in 0..N {
                (x[lane], y[lane]) = phasor(a[lane], b[lane], 0.0);
                (x[lane + N], y[lane + N]) = phasor(c[lane], d[lane], 0.0);
            }
            re.copy_from_slice(&x[..re.len()]);
            im.copy_from_slice(&y[..im.len()]);
        }
    }

    /// A number in [0, 1) at an address of three words and its purpose.
    #[inline(always)]
    pub(crate) fn uniform_at(&self, [a, b, c]: [u32; 3], draw: Draw) -> f32 {
        let [[word], ..] = philox([[a], [b], [c], [draw as u32]], self.key);
        unit(word)
    }

    /// A standard normal number of one beam at `sub_ray`, that of [`Rng::normals`].
    pub(crate) fn normal(&self, beam: u32, draw: Draw, sub_ray: u32) -> f32 {
        self.normal_pair(beam, draw, sub_ray)[0]
    }

    /// Two standard normal numbers of one beam at `sub_ray`; the first is that of [`Rng::normals`].
    #[inline(always)]
    pub(crate) fn normal_pair(&self, beam: u32, draw: Draw, sub_ray: u32) -> [f32; 2] {
        let [[a], [b], [c], [d]] = philox([[beam], [self.frame], [sub_ray], [draw as u32]], self.key);
        [normal(a, b), normal(c, d)]
    }

    /// Four numbers in [0, 1) of one beam at `sub_ray`; the first is that of [`Rng::uniforms`].
    pub(crate) fn four(&self, beam: u32, draw: Draw, sub_ray: u32) -> [f32; 4] {
        philox([[beam], [self.frame], [sub_ray], [draw as u32]], self.key).map(|[word]| unit(word))
    }
}

/// A number in [0, 1) from 24 random bits.
#[inline(always)]
fn unit(word: u32) -> f32 {
    (word >> 8) as i32 as f32 / (1 << 24) as f32
}

/// A standard normal number from 48 random bits (Box and Muller 1958); its greatest value is
/// sqrt(2 ln 2^24) = 5.77.
#[inline(always)]
fn normal(a: u32, b: u32) -> f32 {
    const UNIT: f32 = 1.0 / (1 << 24) as f32;
    // In (0, 1], so that the logarithm is finite; the conversions go through i32 because SIMD units have no other.
    let u = ((a >> 8) as i32 + 1) as f32 * UNIT;
    let turn = (b >> 8) as i32 as f32 * UNIT - 0.5;
    let radius = (-2.0 * ln(u)).sqrt();
    // -cos(2 pi t) = 2 sin^2(pi t) - 1
    let sine = sin_pi(turn);
    radius * (2.0 * sine * sine - 1.0)
}

/// A complex number of mean power 1 whose power is exponential, from 48 random bits, turned by `turns` of a circle.
#[inline(always)]
fn phasor(a: u32, b: u32, turns: f32) -> (f32, f32) {
    const UNIT: f32 = 1.0 / (1 << 24) as f32;
    let u = ((a >> 8) as i32 + 1) as f32 * UNIT;
    let turn = (b >> 8) as i32 as f32 * UNIT + turns;
    // In [-1/2, 1/2]; the addition rounds to the nearest whole number.
    const ROUND: f32 = 12_582_912.0;
    let turn = turn - ((turn + ROUND) - ROUND);
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
    fn a_number_depends_on_its_address_only() {
        let rng = Rng::new(7, 3);
        let beams: [u32; 100] = std::array::from_fn(|lane| 1000 + lane as u32);
        let mut long = [0.0; 100];
        rng.normals(&beams, &[0; 100], Draw::RangeJitter, &mut long);
        for start in [0, 1, 15, 16, 37] {
            let mut short = [0.0; 21];
            rng.normals(&beams[start..start + 21], &[0; 21], Draw::RangeJitter, &mut short);
            assert_eq!(short, long[start..start + 21]);
        }
        assert_eq!(rng.normal(1042, Draw::RangeJitter, 0), long[42]);
        for (rng, sub_ray) in [(Rng::new(7, 4), 0), (rng, 1)] {
            let mut other = [0.0; 100];
            rng.normals(&beams, &[sub_ray; 100], Draw::RangeJitter, &mut other);
            assert_ne!(long, other);
            assert_eq!(rng.normal(1039, Draw::RangeJitter, sub_ray), other[39]);
        }
    }

    #[test]
    fn phasors_have_exponential_power_and_any_phase() {
        let n = 200_000;
        let words: Vec<u32> = (0..n).collect();
        let (zeros, turns) = (vec![0; n as usize], vec![0.0; n as usize]);
        let (mut re, mut im) = (vec![0.0f32; n as usize], vec![0.0f32; n as usize]);
        let rng = Rng::new(5, 0);
        rng.phasors([&words, &zeros, &zeros, &zeros], &turns, &mut re, &mut im);
        let mean = |value: &dyn Fn(f64, f64) -> f64| {
            re.iter().zip(&im).map(|(&x, &y)| value(x.into(), y.into())).sum::<f64>() / f64::from(n)
        };
        let tolerance = 5.0 / f64::from(n).sqrt();
        assert!((mean(&|x, y| x * x + y * y) - 1.0).abs() < tolerance);
        assert!((mean(&|x, y| (x * x + y * y).powi(2)) - 2.0).abs() < 5.0 * tolerance);
        assert!(mean(&|x, _| x).abs() < tolerance && mean(&|_, y| y).abs() < tolerance);
        assert!(mean(&|x, y| x * y).abs() < tolerance && mean(&|x, y| x * x - y * y).abs() < 2.0 * tolerance);
        // A quarter of a turn, and many whole ones, on.
        let (mut turned_re, mut turned_im) = (re.clone(), im.clone());
        rng.phasors([&words, &zeros, &zeros, &zeros], &vec![1000.25; n as usize], &mut turned_re, &mut turned_im);
        for lane in 0..n as usize {
            assert!((turned_re[lane] + im[lane]).abs() < 1e-3 && (turned_im[lane] - re[lane]).abs() < 1e-3);
        }
        let (mut short_re, mut short_im) = (vec![0.0; 41], vec![0.0; 41]);
        rng.cell_phasors(7, Draw::PingNoise, &mut short_re, &mut short_im);
        let (mut long_re, mut long_im) = (vec![0.0; 100], vec![0.0; 100]);
        rng.cell_phasors(7, Draw::PingNoise, &mut long_re, &mut long_im);
        assert_eq!((&short_re[..], &short_im[..]), (&long_re[..41], &long_im[..41]));
        assert!(long_re.iter().enumerate().all(|(cell, value)| !long_re[..cell].contains(value)));
        rng.cell_phasors(8, Draw::PingNoise, &mut short_re, &mut short_im);
        assert!(short_re.iter().zip(&long_re).all(|(one, other)| one != other));
    }

    #[test]
    fn moments_are_those_of_a_normal() {
        let mut sample = vec![0.0f32; 1_000_000];
        let beams: Vec<u32> = (0..1_000_000).collect();
        Rng::new(1, 0).normals(&beams, &vec![0; beams.len()], Draw::RangeJitter, &mut sample);
        let n = sample.len() as f64;
        let moment = |power: i32| sample.iter().map(|&x| f64::from(x).powi(power)).sum::<f64>() / n;
        // Standard errors of the first four moments of N(0, 1): 1, sqrt 2, sqrt 15, sqrt 96 over sqrt n.
        for (power, expected, spread) in
            [(1, 0.0, 1.0), (2, 1.0, 2f64.sqrt()), (3, 0.0, 15f64.sqrt()), (4, 3.0, 96f64.sqrt())]
        {
            let error = (moment(power) - expected).abs() / (spread / n.sqrt());
            assert!(error < 5.0, "moment {power} is off by {error} standard errors");
        }
    }
}
