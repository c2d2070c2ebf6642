//! Parts of echoes in range bins, and the scatterers that give them random amplitudes.

use echocast_kernels::echo::{self, PARTS, RUN};
use glam::Vec3;
use ground::rng::{Draw, Rng};
use std::sync::Arc;

/// Offset of the texture lattice, in cells: flat surfaces at round heights, 0 above all, are inside its cells, not
/// between two of them, where rounding would decide.
const OFF_LATTICE: f32 = 0.34;

/// The scatterers of the surfaces.
#[derive(Clone)]
pub(crate) struct Scatterers {
    pub rng: Rng,
    /// Position of the sonar, as a number: at another position it receives other scatterers.
    pub station: u32,
    /// Along the array, world, 1/m: its product with a position counts the lengths over which the same scatterers are
    /// received.
    pub along: Vec3,
    /// Side of a cell of the texture, m.
    pub patch: f32,
    /// Quantiles of the texture, ascending, with mean 1; empty: no texture.
    pub texture: Arc<[f32]>,
}

/// Parts of echoes, and those waiting for random amplitudes.
pub(super) struct WaitingParts<'a> {
    energy: &'a mut Vec<f32>,
    re: &'a mut Vec<f32>,
    im: &'a mut Vec<f32>,
    /// The waiting ones, `count` of them.
    waiting: echo::Parts,
    count: usize,
}

/// An echo whose parts get random amplitudes.
pub(super) struct Scatter {
    /// Its bins: from the first to the last.
    pub bins: [u32; 2],
    /// Where it begins and ends, in bins.
    pub ends: [f32; 2],
    /// Energy in a bin that it fills, and the least of each part.
    pub share: f32,
    pub least: f32,
    /// Position of its middle along the array, the change of that per bin (see [`Scatterers::along`]), and the bin of
    /// the middle.
    pub along: f32,
    pub slope: f32,
    pub middle: f32,
    /// Number that identifies its scatterers.
    pub object: u32,
}

impl<'a> WaitingParts<'a> {
    /// No parts yet, with empty columns.
    pub fn new(energy: &'a mut Vec<f32>, re: &'a mut Vec<f32>, im: &'a mut Vec<f32>) -> WaitingParts<'a> {
        WaitingParts { energy, re, im, waiting: echo::Parts::default(), count: 0 }
    }

    /// Number of parts.
    pub fn len(&self) -> u32 {
        (self.energy.len() + self.count) as u32
    }

    /// Adds a part with a known amplitude, or its energy again; none may be waiting.
    pub fn add(&mut self, energy: f32, [re, im]: [f32; 2]) {
        self.energy.push(energy);
        self.re.push(re);
        self.im.push(im);
    }

    /// Adds the parts of an echo with random amplitudes; `rough`: what the texture leaves of the energy in a bin, if
    /// there is a texture.
    #[inline]
    pub fn scatter(&mut self, scatterers: &Scatterers, echo: &Scatter, rough: Option<&dyn Fn(u32) -> f32>) {
        let [first, last] = echo.bins;
        for bin in (first..=last).step_by(RUN) {
            let (begin, count) = (self.count, RUN.min((last - bin + 1) as usize));
            let waiting = &mut self.waiting;
            // Runs of a fixed length are vectors; the next one overwrites the excess.
            let fill = |row: &mut echo::PartRow, value: f32| row[begin..begin + RUN].fill(value);
            fill(&mut waiting.low, echo.ends[0]);
            fill(&mut waiting.high, echo.ends[1]);
            fill(&mut waiting.share, echo.share);
            fill(&mut waiting.least, echo.least);
            fill(&mut waiting.along, echo.along);
            fill(&mut waiting.slope, echo.slope);
            fill(&mut waiting.middle, echo.middle);
            waiting.object[begin..begin + RUN].fill(echo.object);
            waiting.bin[begin..begin + RUN].iter_mut().zip(bin..).for_each(|(to, bin)| *to = bin);
            fill(&mut waiting.rough, 1.0);
            if let Some(rough) = rough {
                waiting.rough[begin..begin + count].iter_mut().zip(bin..).for_each(|(to, bin)| *to = rough(bin));
            }
            self.count += count;
            if self.count >= PARTS {
                self.give_amplitudes(scatterers, PARTS);
            }
        }
    }

    /// Gives the waiting parts their amplitudes.
    pub fn finish(&mut self, scatterers: Option<&Scatterers>) {
        if let Some(scatterers) = scatterers.filter(|_| self.count > 0) {
            self.give_amplitudes(scatterers, self.count);
        }
    }

    /// Gives the first `count` waiting parts random amplitudes, and appends them to the others.
    fn give_amplitudes(&mut self, scatterers: &Scatterers, count: usize) {
        let [mut energy, mut amplitude, mut x, mut y] = [[0.0; PARTS]; 4];
        let mut place = [0; PARTS];
        // All lanes, including those still empty: loops of fixed length compile to vector instructions.
        echo::divide(&self.waiting, &mut energy, &mut amplitude, &mut place);
        let address =
            [&place[..], &self.waiting.bin[..PARTS], &[scatterers.station; PARTS], &self.waiting.object[..PARTS]];
        scatterers.rng.phasors(address, &mut x, &mut y);
        echo::scale(&amplitude, &mut x, &mut y);
        self.energy.extend_from_slice(&energy[..count]);
        self.re.extend_from_slice(&x[..count]);
        self.im.extend_from_slice(&y[..count]);
        self.count -= count;
        let echo::Parts { bin, low, high, share, least, rough, along, slope, middle, object } = &mut self.waiting;
        for row in [low, high, share, least, rough, along, slope, middle] {
            row.copy_within(PARTS.., 0);
        }
        bin.copy_within(PARTS.., 0);
        object.copy_within(PARTS.., 0);
    }
}

impl Scatterers {
    /// Energy that a position returns relative to the mean, by its texture; 1 without one.
    #[inline(never)]
    pub(super) fn roughness(&self, place: Vec3) -> f32 {
        if self.texture.is_empty() {
            return 1.0;
        }
        let address = (place / self.patch + OFF_LATTICE).floor().to_array().map(|cell| cell as i32 as u32);
        self.texture[(self.rng.uniform_at(address, Draw::Texture) * self.texture.len() as f32) as usize]
    }
}

/// A gamma distribution of mean 1 and this shape, cut into equally probable parts: the mean of each, ascending.
pub fn texture(shape: f64) -> Arc<[f32]> {
    const PARTS: usize = 4096;
    const STEPS: usize = 400_000;
    // The density over the logarithm t of the number is e^(shape t - e^t): smooth, and negligible outside these ends.
    let (low, high) = (-40.0 / shape, (shape + 12.0 * shape.sqrt() + 40.0).ln());
    let step = (high - low) / STEPS as f64;
    let densities = (0..STEPS).map(|index| {
        let t = low + (index as f64 + 0.5) * step;
        let value = t.exp();
        (value, (shape * (t - shape.ln()) - value + shape).exp())
    });
    let whole: f64 = densities.clone().map(|(_, density)| density).sum();
    let mut parts = vec![[0.0; 2]; PARTS];
    let mut sum = 0.0;
    for (value, density) in densities {
        let part = (((sum + 0.5 * density) / whole * PARTS as f64) as usize).min(PARTS - 1);
        parts[part][0] += density;
        parts[part][1] += density * value;
        sum += density;
    }
    parts.iter().map(|[weight, sum]| (sum / weight.max(1e-300) / shape) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Echoes of any length, one by one and all together: their parts are the same, and their energies are those of the
    /// part of the echo in each bin.
    #[test]
    fn parts_do_not_depend_on_what_waits_with_them() {
        let rng = Rng::new(3, 0);
        let along = Vec3::X;
        let scatterers = Scatterers { rng, station: 5, along, patch: 1.0, texture: Arc::default() };
        let echoes: Vec<Scatter> = [1, 8, 9, 64, 3, 200, 1, 7, 130]
            .into_iter()
            .enumerate()
            .map(|(index, bins)| {
                let first = 11 * index as u32;
                let ends = [first as f32 + 0.3, (first + bins) as f32 - 0.4];
                let (along, slope) = (0.7 * index as f32, 0.01);
                let middle = 0.5 * (ends[0] + ends[1]);
                Scatter {
                    bins: [first, first + bins - 1],
                    ends,
                    share: 2.0,
                    least: 0.0,
                    along,
                    slope,
                    middle,
                    object: index as u32,
                }
            })
            .collect();
        let columns = |echoes: &[Scatter], rough: Option<&dyn Fn(u32) -> f32>| {
            let [mut energy, mut re, mut im] = [const { Vec::new() }; 3];
            let mut parts = WaitingParts::new(&mut energy, &mut re, &mut im);
            for echo in echoes {
                let before = parts.len();
                parts.scatter(&scatterers, echo, rough);
                assert_eq!(parts.len() - before, echo.bins[1] - echo.bins[0] + 1);
            }
            parts.finish(Some(&scatterers));
            [energy, re, im]
        };
        let together = columns(&echoes, None);
        let alone: Vec<_> = echoes.chunks(1).map(|echo| columns(echo, None)).collect();
        for (index, column) in together.iter().enumerate() {
            assert_eq!(*column, alone.iter().flat_map(|alone| alone[index].clone()).collect::<Vec<f32>>());
        }
        let expected = echoes.iter().flat_map(|echo| {
            (echo.bins[0]..=echo.bins[1])
                .map(|bin| 2.0 * (echo.ends[1].min(bin as f32 + 1.0) - echo.ends[0].max(bin as f32)))
        });
        assert!(together[0].iter().copied().eq(expected));
        let powers = together[1].iter().zip(&together[2]).map(|(re, im)| re * re + im * im);
        let ratio = powers.sum::<f32>() / together[0].iter().sum::<f32>();
        assert!((ratio - 1.0).abs() < 0.2, "amplitudes have their energies on average: {ratio}");
        let rough = columns(&echoes, Some(&|bin| bin as f32));
        let bins = echoes.iter().flat_map(|echo| echo.bins[0]..=echo.bins[1]);
        assert!(rough[0].iter().copied().eq(together[0].iter().zip(bins).map(|(energy, bin)| energy * bin as f32)));
    }

    /// A texture times an exponential is K-distributed: compared with quantiles and moments from another library.
    #[test]
    fn textures_make_k_distributions() {
        let table = include_str!("../../../tests/data/sonar/speckle_statistics.json");
        let table: serde_json::Value = serde_json::from_str(table).unwrap();
        for (shape, expected) in table["K_intensity_shape"].as_object().unwrap() {
            let texture = texture(shape.parse().unwrap());
            let mean = |of: &dyn Fn(f64) -> f64| {
                texture.iter().map(|&part| of(part.into())).sum::<f64>() / texture.len() as f64
            };
            assert!((mean(&|t| t) - 1.0).abs() < 1e-4, "{shape}");
            let index = 2.0 * mean(&|t| t * t) - 1.0;
            let known = expected["SI"].as_f64().unwrap();
            assert!((index / known - 1.0).abs() < 0.01, "scintillation index with {shape}: {index} {known}");
            let third = 6.0 * mean(&|t| t * t * t);
            let known = expected["m3"].as_f64().unwrap();
            assert!((third / known - 1.0).abs() < 0.05, "third moment with {shape}: {third} {known}");
            for (part, quantile) in expected["quantiles"].as_object().unwrap() {
                let (part, quantile) = (part.parse::<f64>().unwrap(), quantile.as_f64().unwrap());
                let below = mean(&|t| 1.0 - (-quantile / t).exp());
                assert!((below - part).abs() < 2e-4, "{shape}: {below} instead of {part}");
            }
        }
    }
}
