//! Sequences of random numbers, and smooth noise over a plane.

use ground::rng::{Draw, Rng};
use std::f64::consts::{SQRT_2, TAU};

/// A sequence of random numbers for one generated object.
pub(super) struct Dice {
    rng: Rng,
    draw: Draw,
    item: u32,
    /// Numbers taken so far.
    taken: u32,
    four: [f32; 4],
}

impl Dice {
    pub fn new(seed: u64, draw: Draw, item: u32) -> Self {
        Dice { rng: Rng::new(seed, 0), draw, item, taken: 0, four: [0.0; 4] }
    }

    /// The next number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        let place = self.taken % 4;
        if place == 0 {
            self.four = self.rng.four(self.item, self.draw, self.taken / 4);
        }
        self.taken += 1;
        f64::from(self.four[place as usize])
    }

    /// The next number, in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// The next whole number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.unit() * end as f64) as usize
    }
}

/// Gradient noise (Perlin 1985, "An image synthesizer"; the smooth step of Perlin 2002, "Improving noise") in several
/// octaves over the rectangle from the origin to `size`.
pub(super) struct GradientNoise {
    octaves: Vec<Octave>,
}

struct Octave {
    /// Grid points per metre.
    frequency: f64,
    columns: usize,
    /// Gradients at the grid points, row by row.
    gradients: Vec<[f64; 2]>,
    /// Its weight in the sum.
    weight: f64,
}

impl GradientNoise {
    /// Octaves of `wavelength` m, half of it and so on down to `finest` m, at most `most` of them; each has `gain`
    /// times the amplitude of the previous one. `field` distinguishes the noises of one seed.
    pub fn new(seed: u64, field: u32, size: [f64; 2], [wavelength, finest]: [f64; 2], most: usize, gain: f64) -> Self {
        let all = (0..most).map(|octave| wavelength / f64::powi(2.0, octave as i32));
        let wavelengths: Vec<f64> = all.enumerate().filter(|&(i, w)| i == 0 || w >= finest).map(|(_, w)| w).collect();
        let weights = |octave: usize| gain.powi(octave as i32);
        let sum: f64 = (0..wavelengths.len()).map(weights).sum();
        let octaves = wavelengths.iter().enumerate().map(|(octave, wavelength)| {
            let [columns, rows] = size.map(|length| (length / wavelength) as usize + 2);
            let rng = Rng::new(seed, field << 8 | octave as u32);
            let gradient = |place: usize| {
                let [turn, ..] = rng.four(place as u32, Draw::Terrain, 0);
                let (sin, cos) = (f64::from(turn) * TAU).sin_cos();
                [cos, sin]
            };
            Octave {
                frequency: 1.0 / wavelength,
                columns,
                gradients: (0..columns * rows).map(gradient).collect(),
                weight: weights(octave) / sum,
            }
        });
        GradientNoise { octaves: octaves.collect() }
    }

    /// The noise at a point inside the rectangle, -1 to 1.
    pub fn at(&self, x: f64, y: f64) -> f64 {
        // A sum of four unit gradients reaches sqrt(1/2) in the middle of a square.
        self.octaves.iter().map(|octave| octave.at(x, y) * octave.weight).sum::<f64>() * SQRT_2
    }
}

impl Octave {
    fn at(&self, x: f64, y: f64) -> f64 {
        let (x, y) = (x * self.frequency, y * self.frequency);
        let last = [self.columns - 2, self.gradients.len() / self.columns - 2];
        // At the far edges rounding may end one square too far.
        let (column, row) = ((x as usize).min(last[0]), (y as usize).min(last[1]));
        let (fx, fy) = (x - column as f64, y - row as f64);
        let corner = |right: usize, up: usize| {
            let [gx, gy] = self.gradients[(row + up) * self.columns + column + right];
            gx * (fx - right as f64) + gy * (fy - up as f64)
        };
        let (sx, sy) = (smooth(fx), smooth(fy));
        let low = corner(0, 0) + sx * (corner(1, 0) - corner(0, 0));
        let high = corner(0, 1) + sx * (corner(1, 1) - corner(0, 1));
        low + sy * (high - low)
    }
}

/// From 0 to 1 with zero slope and curvature at both ends: 6 t^5 - 15 t^4 + 10 t^3.
fn smooth(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_bounded_and_without_bias() {
        let noise = GradientNoise::new(3, 1, [200.0, 100.0], [5.0, 0.5], 4, 0.5);
        assert_eq!(noise.octaves.len(), 4);
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for i in 0..=500 {
            for j in 0..=250 {
                let (x, y) = (f64::from(i) * 0.4, f64::from(j) * 0.4);
                let value = noise.at(x, y);
                assert!(value.abs() <= 1.0, "{value}");
                assert!((noise.at((x - 1e-6).max(0.0), y) - value).abs() < 1e-5, "a step at {x}, {y}");
                sum += value;
                squares += value * value;
                count += 1.0;
            }
        }
        let rms = f64::sqrt(squares / count);
        assert!((sum / count).abs() < 0.03 && (0.15..0.5).contains(&rms), "mean {}, rms {rms}", sum / count);
        assert_ne!(noise.at(3.0, 4.0), GradientNoise::new(4, 1, [200.0, 100.0], [5.0, 0.5], 4, 0.5).at(3.0, 4.0));
    }

    #[test]
    fn dice_are_uniform_and_their_own() {
        let mut dice = Dice::new(1, Draw::Boulder, 2);
        let sample: Vec<f64> = (0..4000).map(|_| dice.between(2.0, 4.0)).collect();
        assert!(sample.iter().all(|value| (2.0..4.0).contains(value)));
        let mean = sample.iter().sum::<f64>() / 4000.0;
        // Standard error: 2 / sqrt(12) / sqrt(4000) = 0.009.
        assert!((mean - 3.0).abs() < 0.045, "{mean}");
        assert_ne!(Dice::new(1, Draw::Boulder, 3).unit(), Dice::new(1, Draw::Boulder, 2).unit());
        assert_ne!(Dice::new(1, Draw::Fish, 2).unit(), Dice::new(1, Draw::Boulder, 2).unit());
    }
}
