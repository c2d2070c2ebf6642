//! Points to pixels: a depth buffer that keeps the nearest point of each pixel, and its shading.

use super::canvas::{Color, Picture};
use super::paint::Paint;
use super::points::CHUNK;
use glam::Vec2;
use ground::parallel;
use std::sync::atomic::{AtomicU64, Ordering};

/// Samples per pixel in each direction; averaging them smooths the edges.
pub(super) const SAMPLES: u32 = 2;

/// Nearest point of each sample: depth in the upper bits, row in the lower, so that the smaller number is the nearer
/// point and, at equal depth, the earlier row, whatever the order of writing.
pub(super) struct Splats {
    /// Samples in a row.
    width: u32,
    /// Rows of samples.
    height: u32,
    cells: Vec<AtomicU64>,
}

const EMPTY: u64 = u64::MAX;

impl Splats {
    /// No points, for a picture of `width` x `height` pixels.
    pub(super) fn new(width: u32, height: u32) -> Splats {
        let (width, height) = (width * SAMPLES, height * SAMPLES);
        let cells = (0..width as usize * height as usize).map(|_| AtomicU64::new(EMPTY)).collect();
        Splats { width, height, cells }
    }

    /// Puts a point at `at` (pixels from the top left corner), clipped to the picture; the one with the smallest
    /// `depth` stays.
    pub(super) fn put(&self, at: Vec2, stamp: &SplatStamp, depth: f32, row: u32) {
        if !(at.is_finite() && depth.is_finite()) {
            return;
        }
        let key = key(depth, row);
        // Casts saturate, far below and above any picture.
        let corner = (at * SAMPLES as f32 - stamp.shift).floor();
        let (left, top) = (corner.x as i32, corner.y as i32);
        for &(dy, first, last) in &stamp.spans {
            let y = top.saturating_add(dy);
            if y < 0 || y >= self.height as i32 {
                continue;
            }
            let from = left.saturating_add(first).max(0);
            let to = left.saturating_add(last).min(self.width as i32 - 1);
            for x in from..=to {
                let cell = &self.cells[y as usize * self.width as usize + x as usize];
                if cell.load(Ordering::Relaxed) > key {
                    cell.fetch_min(key, Ordering::Relaxed);
                }
            }
        }
    }

    /// Calls `point` for the depth and row of every sample from its column, its row and the size in samples.
    pub(super) fn fill(&self, point: impl Fn(u32, u32, [u32; 2]) -> Option<(f32, u32)> + Sync) {
        parallel::for_each_range(self.cells.len(), CHUNK, |indices| {
            for index in indices {
                let (x, y) = (index % self.width as usize, index / self.width as usize);
                if let Some((depth, row)) = point(x as u32, y as u32, [self.width, self.height]) {
                    self.cells[index].fetch_min(key(depth, row), Ordering::Relaxed);
                }
            }
        });
    }

    /// Draws the points over `picture`, which has the size requested.
    ///
    /// Shape is shown by eye-dome lighting (Boucheny, "Visualisation scientifique de grands volumes de données", 2009):
    /// a sample is darker the nearer its neighbours are, measured in `level` of the depth.
    pub(super) fn draw(&self, picture: &mut Picture, paint: &Paint<'_>, level: impl Fn(f32) -> f32 + Sync) {
        let mut levels = vec![f32::INFINITY; self.cells.len()];
        parallel::for_each_chunk(&mut levels, CHUNK, |chunk, levels| {
            for (to, cell) in levels.iter_mut().zip(&self.cells[chunk * CHUNK..]) {
                let key = cell.load(Ordering::Relaxed);
                if key != EMPTY {
                    *to = level(unordered((key >> 32) as u32));
                }
            }
        });
        let stride = 3 * picture.width as usize;
        parallel::for_each_chunk(&mut picture.pixels, stride, |row, line| {
            for (column, pixel) in line.chunks_exact_mut(3).enumerate() {
                self.pixel(pixel, column as u32, row as u32, paint, &levels);
            }
        });
    }

    fn pixel(&self, pixel: &mut [u8], column: u32, row: u32, paint: &Paint<'_>, levels: &[f32]) {
        let ground: Color = [pixel[0], pixel[1], pixel[2]];
        let mut sum = [0.0; 3];
        for y in row * SAMPLES..(row + 1) * SAMPLES {
            for x in column * SAMPLES..(column + 1) * SAMPLES {
                let (color, light) = match self.cells[self.index(x, y)].load(Ordering::Relaxed) {
                    EMPTY => (ground, 1.0),
                    key => (paint.color(key as u32), self.light(x, y, levels)),
                };
                for (sum, value) in sum.iter_mut().zip(color) {
                    *sum += f32::from(value) * light;
                }
            }
        }
        for (value, sum) in pixel.iter_mut().zip(sum) {
            *value = (sum / (SAMPLES * SAMPLES) as f32).round() as u8;
        }
    }

    fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }

    /// Brightness of a sample, 0 to 1.
    fn light(&self, x: u32, y: u32, levels: &[f32]) -> f32 {
        const AROUND: [(i32, i32); 8] = [(-3, 0), (3, 0), (0, -3), (0, 3), (-2, -2), (2, -2), (-2, 2), (2, 2)];
        let own = levels[self.index(x, y)];
        let occlusion: f32 = AROUND
            .iter()
            .filter_map(|&(dx, dy)| {
                let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
                let near = x < self.width && y < self.height;
                // A single neighbour never makes a sample black.
                near.then(|| (own - levels[self.index(x, y)]).clamp(0.0, 1.0))
            })
            .sum();
        (-2.0 * occlusion / AROUND.len() as f32).exp()
    }
}

fn key(depth: f32, row: u32) -> u64 {
    u64::from(ordered(depth)) << 32 | u64::from(row)
}

/// A number that sorts like finite floats.
fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if value.is_sign_negative() { !bits } else { bits | 1 << 31 }
}

/// The float from which [`ordered`] made `number`.
fn unordered(number: u32) -> f32 {
    f32::from_bits(if number >> 31 == 1 { number & !(1 << 31) } else { !number })
}

/// The samples that a point covers.
pub(super) struct SplatStamp {
    /// Row and first and last column of samples, from the top left one.
    spans: Vec<(i32, i32, i32)>,
    /// From the upper left sample to the point.
    shift: Vec2,
}

impl SplatStamp {
    /// A disc of about `diameter` pixels, at least one sample.
    pub(super) fn disc(diameter: f32) -> SplatStamp {
        let size = samples(diameter);
        let radius = size as f32 / 2.0;
        let spans = (0..size)
            .map(|dy| {
                let up = dy as f32 + 0.5 - radius;
                // Slightly more than the circle, so that small discs keep their sides.
                let half = (radius * radius + 0.3 - up * up).max(0.25).sqrt();
                let first = (radius - half).round().max(0.0) as i32;
                (dy, first, size - 1 - first)
            })
            .collect();
        SplatStamp { spans, shift: Vec2::splat((size - 1) as f32 / 2.0) }
    }

    /// A rectangle of about `width` x `height` pixels, at least one sample each.
    pub(super) fn rectangle(width: f32, height: f32) -> SplatStamp {
        let (width, height) = (samples(width), samples(height));
        let spans = (0..height).map(|dy| (dy, 0, width - 1)).collect();
        SplatStamp { spans, shift: Vec2::new((width - 1) as f32, (height - 1) as f32) / 2.0 }
    }
}

fn samples(pixels: f32) -> i32 {
    ((pixels * SAMPLES as f32).round() as i32).clamp(1, 4096)
}

/// Diameter of splats, pixels, with which `count` points in `picture` form closed surfaces where dense and remain
/// visible dots, no larger than `thickest`, where sparse.
pub(super) fn diameter(count: usize, picture: &Picture, thickest: f32) -> f32 {
    let area = picture.width as f32 * picture.height as f32;
    (1.5 * (area / count.max(1) as f32).sqrt()).max(1.5).min(thickest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_order_depths() {
        let depths = [-1e15, -2.0, -1e-20, 0.0, 1e-20, 3.5, 1e15];
        assert!(depths.windows(2).all(|pair| ordered(pair[0]) < ordered(pair[1])));
        assert!(depths.iter().all(|&depth| unordered(ordered(depth)) == depth));
    }

    #[test]
    fn the_nearest_point_stays_and_the_edges_clip() {
        let splats = Splats::new(4, 3);
        let at = |x, y| splats.cells[splats.index(x, y)].load(Ordering::Relaxed);
        let stamp = SplatStamp::disc(1.0);
        splats.put(Vec2::new(1.5, 1.5), &stamp, 2.0, 7);
        splats.put(Vec2::new(1.5, 1.5), &stamp, -1.0, 8);
        splats.put(Vec2::new(1.5, 1.5), &stamp, -1.0, 9);
        assert_eq!((at(2, 2) as u32, at(3, 3) as u32), (8, 8));
        assert_eq!((at(1, 2), at(4, 3), at(2, 4)), (EMPTY, EMPTY, EMPTY));
        let stamp = SplatStamp::rectangle(2.0, 1.0);
        assert_eq!(stamp.spans, [(0, 0, 3), (1, 0, 3)]);
        for place in [-0.2, 1e20, -1e20, f32::NAN] {
            splats.put(Vec2::splat(place), &stamp, 0.0, 1);
        }
        assert_eq!(splats.cells.iter().filter(|cell| cell.load(Ordering::Relaxed) as u32 == 1).count(), 2);
    }
}
