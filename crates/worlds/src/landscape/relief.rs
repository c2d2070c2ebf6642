//! The shape of generated land: a valley between ridges, eroded by water.

use super::drainage::{HeightField, rank};
use super::terrain::Terrain;
use crate::noise::GradientNoise;

/// Points along the longer side of the field that water erodes.
const WORN_POINTS: f64 = 200.0;
/// Rounds of erosion.
const ROUNDS: usize = 12;
/// Octaves of the ridges.
const OCTAVES: usize = 7;
/// Noise fields of the landscape, numbered after those of a lake bed.
const RIDGES: u32 = 16;
const HILLS: u32 = 32;
const VALLEY: u32 = 33;
const DETAIL: u32 = 34;

/// A grid of `cells` over `size`, its heights from 0 to `relief`; the valley descends towards -x.
pub(super) fn terrain(size: [f64; 2], cells: [usize; 2], relief: f64, seed: u64) -> Terrain {
    let field = worn(size, cells, seed);
    let [low, high] = field
        .heights
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &height| [low.min(height), high.max(height)]);
    let scale = relief / (high - low).max(f64::MIN_POSITIVE);
    // Detail too fine for the eroded field.
    let step: [f64; 2] = std::array::from_fn(|axis| size[axis] / cells[axis] as f64);
    let finest = 2.5 * step[0].max(step[1]);
    let wavelength = (4.0 * field.step[0].max(field.step[1])).max(finest).min(12.0_f64.max(finest));
    let detail = GradientNoise::new(seed, DETAIL, size, [wavelength, finest], 6, 0.5);
    let rough = (0.012 * wavelength).min(0.02 * relief);
    let mut terrain = Terrain::from_heights(size, cells, |x, y| {
        let at = [x + size[0] / 2.0, y + size[1] / 2.0];
        field.smooth(at) * scale + rough * detail.at(at[0], at[1])
    });
    let [low, high] = terrain.height_range().map(f64::from);
    let scale = relief / (high - low).max(f64::MIN_POSITIVE);
    terrain.heights.iter_mut().for_each(|height| *height = ((f64::from(*height) - low) * scale) as f32);
    terrain
}

/// The eroded land, in arbitrary units of height.
fn worn(size: [f64; 2], cells: [usize; 2], seed: u64) -> HeightField {
    let (longer, shorter) = (size[0].max(size[1]), size[0].min(size[1]));
    let points: [usize; 2] = std::array::from_fn(|axis| {
        let target = (WORN_POINTS * size[axis] / longer).ceil().max(8.0) as usize;
        target.min(cells[axis].max(2)) + 1
    });
    let step = std::array::from_fn(|axis| size[axis] / (points[axis] - 1) as f64);
    let noise = |field: u32, wavelength: f64, most: usize| {
        GradientNoise::new(seed, field, size, [wavelength, 2.0 * f64::max(step[0], step[1])], most, 0.5)
    };
    let wavelength = 0.6 * shorter;
    let ridges: Vec<GradientNoise> = (0..OCTAVES)
        .map(|octave| noise(RIDGES + octave as u32, wavelength / f64::powi(2.0, octave as i32), 1))
        .collect();
    let (hills, valley) = (noise(HILLS, 0.8 * shorter, 5), noise(VALLEY, 0.7 * shorter, 2));
    let heights = (0..points[0] * points[1]).map(|point| {
        let (x, y) = ((point % points[0]) as f64 * step[0], (point / points[0]) as f64 * step[1]);
        let middle = (0.5 + 0.22 * valley.at(x, size[1] / 2.0)) * size[1];
        let side = ((y - middle).abs() / (0.5 * size[1])).min(1.0);
        let side = side * side * (3.0 - 2.0 * side);
        // Ridges belong to the sides of the valley.
        0.25 * x / size[0] + 0.45 * side + 0.3 * hills.at(x, y) + (0.1 + 0.5 * side) * ridged(&ridges, x, y)
    });
    let mut field = HeightField { columns: points[0], step, heights: heights.collect() };
    let low_end = (0..points[1]).map(|row| row * points[0]);
    let outlet = low_end.min_by_key(|&point| rank(field.heights[point])).unwrap_or(0);
    field.erode(ROUNDS, outlet);
    field
}

/// Ridged multifractal noise (Musgrave, in Ebert et al., "Texturing and Modeling: A Procedural Approach", 1994): each
/// octave is folded into ridges and has more weight where those before it are high. About 0 to 1.
fn ridged(octaves: &[GradientNoise], x: f64, y: f64) -> f64 {
    const GAIN: f64 = 2.0;
    let (mut sum, mut weight, mut height) = (0.0, 1.0, 1.0);
    for octave in octaves {
        let ridge = (1.0 - octave.at(x, y).abs()).powi(2) * weight;
        sum += ridge * height;
        weight = (ridge * GAIN).clamp(0.0, 1.0);
        height *= 0.5;
    }
    sum / 2.0
}

impl HeightField {
    /// Its height at a position, m from its first point, by cubic splines through the points (Catmull & Rom 1974).
    fn smooth(&self, at: [f64; 2]) -> f64 {
        let last = [self.columns - 1, self.rows() - 1];
        let split = |axis: usize| {
            let along = (at[axis] / self.step[axis]).clamp(0.0, last[axis] as f64);
            let first = (along as usize).min(last[axis] - 1);
            (first, weights(along - first as f64))
        };
        let ((column, across), (row, up)) = (split(0), split(1));
        let index = |first: usize, i: usize, last: usize| (first + i).saturating_sub(1).min(last);
        (0..4)
            .map(|j| {
                let start = index(row, j, last[1]) * self.columns;
                let value = |i: usize| self.heights[start + index(column, i, last[0])];
                up[j] * (0..4).map(|i| across[i] * value(i)).sum::<f64>()
            })
            .sum()
    }
}

/// Weights of the four points around a position `t` of the way from the second to the third.
fn weights(t: f64) -> [f64; 4] {
    let (square, cube) = (t * t, t * t * t);
    [
        0.5 * (-cube + 2.0 * square - t),
        0.5 * (3.0 * cube - 5.0 * square + 2.0),
        0.5 * (-3.0 * cube + 4.0 * square + t),
        0.5 * (cube - square),
    ]
}
