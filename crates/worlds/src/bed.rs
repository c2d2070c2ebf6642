//! The ground of a lake: a grid of heights, and the kind of ground at each point.

use super::noise::{Dice, GradientNoise};
use glam::DVec3;
use ground::builder;
use ground::parallel;
use ground::rng::Draw;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Kinds of ground, in the order of [`Bed::triangles`].
pub(super) const SOILS: [&str; 3] = ["sand", "gravel", "mud"];
/// Fraction of the bed that is gravel, and of the rest that is mud.
const GRAVEL: f64 = 0.15;
const MUD: f64 = 0.2;
/// Maximum height of hills, and maximum rise from the middle to a corner ([`SLOPE`]), both over the depth.
const HILLS: f64 = 0.15;
const SLOPE: f64 = 0.1;
/// Noise fields of the hills, gravel, mud, and the meandering of ripples.
const FIELDS: [u32; 4] = [0, 1, 2, 3];

builder! {
    /// Sand ripples: waves with parallel crests that wander a little.
    #[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Ripples {
        /// From crest to crest, 0.01 to 100 m and at least three cells.
        pub wavelength_m: f64 = 0.6,
        /// From trough to crest, 0 (none) to half the wavelength and a twentieth of the depth.
        pub height_m: f64 = 0.05,
        /// Direction across the crests, counter-clockwise from x, -360 to 360 degrees. `None`: random, by the seed.
        pub direction_deg: Option<f64> = None,
    }
}

/// What the bed is generated from.
pub(super) struct Ground {
    pub size: [f64; 2],
    pub depth: f64,
    /// Squares of the grid along x and y.
    pub cells: [usize; 2],
    pub ripples: Option<Ripples>,
}

/// A sheet over the rectangle of `ground` about the z axis.
pub(super) struct Bed {
    pub ground: Ground,
    /// Heights of the grid points, row by row along x.
    heights: Vec<f64>,
    /// Amount of gravel and mud at the grid points, less the threshold: positive where present.
    soils: Vec<[f32; 2]>,
}

impl Bed {
    pub fn new(ground: Ground, seed: u64) -> Self {
        let Ground { size, depth, cells, ripples } = &ground;
        let [columns, rows] = cells.map(|cells| cells + 1);
        let shorter = size[0].min(size[1]);
        let step: [f64; 2] = std::array::from_fn(|axis| size[axis] / cells[axis] as f64);
        // Shorter waves would only show as spikes of single grid points.
        let finest = 2.5 * step[0].max(step[1]);
        // Hills are long and flat: at most a tenth as high as they are long.
        let wavelength = (shorter / 2.5).min(60.0);
        let hill_height = (0.1 * wavelength).min(HILLS * depth);
        let noise = |field: usize, wavelength: f64, most, gain| {
            GradientNoise::new(seed, FIELDS[field], *size, [wavelength, finest], most, gain)
        };

        let (gravel, mud) = (noise(1, 0.8 * wavelength, 4, 0.5), noise(2, 0.8 * wavelength, 4, 0.5));
        let mut soils = vec![[0.0; 2]; columns * rows];
        let place = |column: usize, row: usize| [column as f64 * step[0], row as f64 * step[1]];
        parallel::for_each_chunk(&mut soils, columns, |row, soils| {
            for (column, soil) in soils.iter_mut().enumerate() {
                let [x, y] = place(column, row);
                *soil = [gravel.at(x, y) as f32, mud.at(x, y) as f32];
            }
        });
        for (soil, part) in [GRAVEL, MUD].into_iter().enumerate() {
            let mut sorted: Vec<f32> = soils.iter().map(|soils| soils[soil]).collect();
            let rank = ((1.0 - part) * (sorted.len() - 1) as f64) as usize;
            let (_, &mut limit, _) = sorted.select_nth_unstable_by(rank, f32::total_cmp);
            soils.iter_mut().for_each(|soils| soils[soil] -= limit);
        }

        let mut dice = Dice::new(seed, Draw::Terrain, u32::MAX);
        let (hills, slope) = (noise(0, wavelength, 6, 0.45), slope(&mut dice, *size, SLOPE * depth));
        let waves = ripples.map(|ripples| {
            let any = dice.between(0.0, TAU);
            let (sin, cos) = ripples.direction_deg.map_or(any, f64::to_radians).sin_cos();
            let wander = noise(3, 8.0 * ripples.wavelength_m, 2, 0.5);
            let wave = TAU / ripples.wavelength_m;
            move |[x, y]: [f64; 2]| ripples.height_m / 2.0 * (wave * (cos * x + sin * y) + 3.0 * wander.at(x, y)).sin()
        });
        let mut heights = vec![0.0; columns * rows];
        parallel::for_each_chunk(&mut heights, columns, |row, heights| {
            for (column, height) in heights.iter_mut().enumerate() {
                let at = place(column, row);
                *height = hill_height * hills.at(at[0], at[1])
                    + slope[0] * (at[0] - size[0] / 2.0)
                    + slope[1] * (at[1] - size[1] / 2.0);
                if let Some(waves) = &waves {
                    // Sand has ripples that fade towards gravel and mud.
                    let sand = soils[row * columns + column].map(|other| (-other / 0.15).clamp(0.0, 1.0));
                    *height += f64::from(sand[0] * sand[1]) * waves(at);
                }
            }
        });
        let lift = -depth - heights.iter().sum::<f64>() / heights.len() as f64;
        heights.iter_mut().for_each(|height| *height += lift);
        Bed { ground, heights, soils }
    }

    /// Position of the grid point `column`, `row`.
    fn vertex(&self, column: usize, row: usize) -> DVec3 {
        let Ground { size, cells, .. } = &self.ground;
        let along = |axis: usize, index: usize| size[axis] * (index as f64 / cells[axis] as f64 - 0.5);
        DVec3::new(along(0, column), along(1, row), self.heights[self.index(column, row) as usize])
    }

    fn index(&self, column: usize, row: usize) -> u32 {
        (row * (self.ground.cells[0] + 1) + column) as u32
    }

    /// Positions and unit normals of all grid points.
    pub fn vertices(&self) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let [columns, rows] = self.ground.cells;
        let points = || (0..=rows).flat_map(move |row| (0..=columns).map(move |column| (column, row)));
        let normal = |(column, row): (usize, usize)| {
            let along = |a: DVec3, b: DVec3| b - a;
            let x = along(self.vertex(column.saturating_sub(1), row), self.vertex((column + 1).min(columns), row));
            let y = along(self.vertex(column, row.saturating_sub(1)), self.vertex(column, (row + 1).min(rows)));
            x.cross(y).normalize().as_vec3().to_array()
        };
        let position = |(column, row)| self.vertex(column, row).as_vec3().to_array();
        (points().map(position).collect(), points().map(normal).collect())
    }

    /// Lowest and highest point.
    pub fn height_range(&self) -> [f64; 2] {
        let all = self.heights.iter();
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &height| [low.min(height), high.max(height)])
    }

    /// The triangles of each of [`SOILS`], normals up.
    pub fn triangles(&self) -> [Vec<[u32; 3]>; SOILS.len()] {
        let mut of_soil = [const { Vec::new() }; SOILS.len()];
        let [columns, rows] = self.ground.cells;
        for row in 0..rows {
            for column in 0..columns {
                let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| self.index(column + i, row + j));
                let both = if falls(column, row) { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
                for triangle in both {
                    let sum = |soil: usize| triangle.iter().map(|&v| self.soils[v as usize][soil]).sum::<f32>();
                    let soil = if sum(0) > 0.0 {
                        1
                    } else if sum(1) > 0.0 {
                        2
                    } else {
                        0
                    };
                    of_soil[soil].push(triangle);
                }
            }
        }
        of_soil
    }

    /// Height of the ground at a position; outside the bed, that of the nearest edge.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let Ground { size, cells, .. } = &self.ground;
        let split = |axis: usize, at: f64| {
            let along = ((at / size[axis] + 0.5) * cells[axis] as f64).clamp(0.0, cells[axis] as f64);
            let cell = (along as usize).min(cells[axis] - 1);
            (cell, along - cell as f64)
        };
        let ((column, fx), (row, fy)) = (split(0, x), split(1, y));
        let [a, b, c, d] =
            [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| self.heights[self.index(column + i, row + j) as usize]);
        match (falls(column, row), fx >= fy, fx + fy <= 1.0) {
            (false, true, _) => a + fx * (b - a) + fy * (c - b),
            (false, false, _) => a + fy * (d - a) + fx * (c - d),
            (true, _, true) => a + fx * (b - a) + fy * (d - a),
            (true, _, false) => c + (1.0 - fx) * (d - c) + (1.0 - fy) * (b - c),
        }
    }

    /// Unit normal of the ground averaged over `reach` m, as for an object of that length resting on it.
    pub fn normal(&self, x: f64, y: f64, reach: f64) -> DVec3 {
        let half = reach / 2.0;
        let rise_x = self.height(x + half, y) - self.height(x - half, y);
        let rise_y = self.height(x, y + half) - self.height(x, y - half);
        DVec3::new(-rise_x / reach, -rise_y / reach, 1.0).normalize()
    }
}

/// Whether the diagonal of a square falls from the upper left to the lower right corner: squares alternate, so that no
/// direction stands out.
fn falls(column: usize, row: usize) -> bool {
    (column + row) % 2 == 1
}

/// Rise per metre along x and y: about 2 degrees in some direction, less where that would change the height by more
/// than `most` m from the middle to a corner.
fn slope(dice: &mut Dice, size: [f64; 2], most: f64) -> [f64; 2] {
    let (sin, cos) = dice.between(0.0, TAU).sin_cos();
    let reach = (size[0] * cos.abs() + size[1] * sin.abs()) / 2.0;
    let rise = (most / reach).min(0.03);
    [rise * cos, rise * sin]
}
