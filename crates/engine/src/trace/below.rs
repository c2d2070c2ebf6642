//! A scene seen from straight above: what a map of it shows.

use super::{BuiltScene, HitBatch, Sight};
use glam::Vec3;
use ground::lanes::{LANES, MISS, RayBatch};
use ground::parallel;

/// Points of a map, row by row from north to south.
#[derive(Clone, Copy, Debug)]
pub struct MapRaster {
    /// The first point, relative to the scene's origin, m.
    pub corner: [f32; 2],
    /// Spacing of the points, m.
    pub step: f32,
    /// Points per row, from west to east.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

/// What is seen below a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Below {
    /// Height, relative to the scene's origin, m; NaN: nothing.
    pub z: f32,
    /// Category of the surface; 0 = unlabelled, or nothing.
    pub category_id: u32,
    /// Whether the point above is inside of a body.
    pub cut: bool,
}

impl MapRaster {
    /// Position of a point, relative to the scene's origin, m.
    pub fn place(&self, index: usize) -> [f32; 2] {
        let (column, row) = (index % self.width, index / self.width);
        [self.corner[0] + column as f32 * self.step, self.corner[1] - row as f32 * self.step]
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.width * self.height
    }
}

impl BuiltScene {
    /// What is straight below each point of `raster` at the height `from`, at the start of the time span that the scene
    /// is built for.
    #[doc(hidden)]
    pub fn below(&self, raster: &MapRaster, from: f32) -> Vec<Below> {
        let mut found = vec![Below { z: f32::NAN, category_id: 0, cut: false }; raster.points()];
        parallel::for_each_chunk(&mut found, LANES, |chunk, found| {
            let mut rays = RayBatch::default();
            for lane in 0..found.len() {
                [rays.org_x[lane], rays.org_y[lane]] = raster.place(chunk * LANES + lane);
            }
            rays.org_z = [from; LANES];
            rays.dir_z = [-1.0; LANES];
            rays.range_max = [f32::INFINITY; LANES];
            let mut hits = HitBatch::new();
            hits.trace(&self.0, &rays, found.len(), true, Sight::of_shapes(u32::MAX));
            for (lane, below) in found.iter_mut().enumerate() {
                let Some(surface) = self.0.surfaces.rows.get(hits.surface[lane] as usize) else { continue };
                let cut = self.0.shows_back(hits.surface[lane], hits.normal(lane), Vec3::NEG_Z, 0.0);
                *below = Below { z: from - hits.range[lane], category_id: surface.category_id, cut };
            }
        });
        found
    }

    /// Height of the ground at `x` and `y` of the world, m, below the height `from`, at the start of the time span that the
    /// scene is built for: of the lowest surface that faces up, such as the ground under trees, roofs and bridges, or of the
    /// highest surface if none does; `None`: nothing is there.
    #[doc(hidden)]
    pub fn ground_at(&self, x: f64, y: f64, from: f64) -> Option<f64> {
        /// Most surfaces above each other.
        const MOST: usize = 64;
        /// From one surface to where the next may be, m.
        const STEP: f32 = 1e-3;
        let origin = self.origin();
        let mut rays = RayBatch::default();
        (rays.org_x[0], rays.org_y[0]) = ((x - origin.x) as f32, (y - origin.y) as f32);
        (rays.dir_z[0], rays.range_max[0]) = (-1.0, f32::INFINITY);
        let mut start = (from - origin.z) as f32;
        let mut hits = HitBatch::new();
        let (mut lowest, mut highest) = (None, None);
        for _ in 0..MOST {
            rays.org_z[0] = start;
            hits.trace(&self.0, &rays, 1, true, Sight::of_shapes(u32::MAX));
            if self.0.surfaces.rows.get(hits.surface[0] as usize).is_none() {
                break;
            }
            let z = start - hits.range[0];
            highest = highest.or(Some(z));
            if !self.0.shows_back(hits.surface[0], hits.normal(0), Vec3::NEG_Z, 0.0) {
                lowest = Some(z);
            }
            // As far below as single precision can tell.
            start = z - STEP.max(4.0 * f32::EPSILON * z.abs());
        }
        lowest.or(highest).map(|z| f64::from(z) + origin.z)
    }

    /// Whether each point of `raster` at the height `at` is within a wall, or a sheet is between it and the next:
    /// within a wall, the surfaces on both sides along x or y show their back faces.
    #[doc(hidden)]
    pub fn walls(&self, raster: &MapRaster, at: f32) -> Vec<bool> {
        /// Half of the thickness of the thickest wall, m.
        const HALF: f32 = 0.6;
        let mut found = vec![false; raster.points()];
        parallel::for_each_chunk(&mut found, LANES, |chunk, found| {
            let mut rays = RayBatch::default();
            for lane in 0..found.len() {
                [rays.org_x[lane], rays.org_y[lane]] = raster.place(chunk * LANES + lane);
            }
            rays.org_z = [at; LANES];
            rays.range_max = [HALF.max(raster.step); LANES];
            let mut hits = HitBatch::new();
            for axis in [Vec3::X, Vec3::Y] {
                let mut within = [true; LANES];
                for direction in [axis, -axis] {
                    rays.dir_x = [direction.x; LANES];
                    rays.dir_y = [direction.y; LANES];
                    hits.trace(&self.0, &rays, found.len(), true, Sight::of_shapes(u32::MAX));
                    for (lane, found) in found.iter_mut().enumerate() {
                        let surface = hits.surface[lane];
                        let met = surface != MISS;
                        within[lane] &= met && self.0.shows_back(surface, hits.normal(lane), direction, 0.0);
                        *found |= met && hits.range[lane] < 0.5 * raster.step;
                    }
                }
                found.iter_mut().zip(within).for_each(|(found, within)| *found |= within);
            }
        });
        found
    }
}
