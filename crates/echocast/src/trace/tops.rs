//! How high a scene reaches, by squares of its plan: what is above is clear of it.

use super::Tables;
use glam::{DVec3, Vec3};
use std::sync::atomic::Ordering;

/// Squares along each side of the plan.
const SIDE: usize = 128;

/// The greatest heights of a scene that stands, relative to its origin, m.
pub(crate) struct Tops {
    corner: [f32; 2],
    /// Squares per metre.
    per_m: [f32; 2],
    highest: Vec<f32>,
}

impl Tops {
    /// Columns or rows of the squares from one place to another.
    fn span(&self, axis: usize, from: f32, to: f32) -> (usize, usize) {
        let square = |at: f32| (((at - self.corner[axis]) * self.per_m[axis]).max(0.0) as usize).min(SIDE - 1);
        (square(from.min(to)), square(from.max(to)))
    }

    /// Raises the squares below a triangle, and counts them.
    fn raise(&mut self, corners: [Vec3; 3]) -> usize {
        let [a, b, c] = corners;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let [(left, right), (front, back)] = [self.span(0, low.x, high.x), self.span(1, low.y, high.y)];
        for row in front..=back {
            for highest in &mut self.highest[row * SIDE + left..=row * SIDE + right] {
                *highest = highest.max(high.z);
            }
        }
        (right - left + 1) * (back - front + 1)
    }

    /// Whether a straight line from one place to another certainly stays above all, by `margin` m.
    pub fn are_below(&self, from: Vec3, to: Vec3, margin: f32) -> bool {
        /// Lines over more are better traced.
        const MOST: usize = 16;
        let lowest = from.z.min(to.z) - margin;
        let [(left, right), (front, back)] = [self.span(0, from.x, to.x), self.span(1, from.y, to.y)];
        (right - left + 1) * (back - front + 1) <= MOST
            && (front..=back)
                .all(|row| self.highest[row * SIDE + left..=row * SIDE + right].iter().all(|&height| height < lowest))
    }
}

impl Tables {
    /// Where the scene is high; `None` if something moves, if it is too tangled to tell soon, or if it has not been asked for
    /// often: scenes that change from ping to ping would be gone through each time.
    pub(crate) fn tops(&self) -> Option<&Tops> {
        const OFTEN: u32 = 8;
        if self.tops.get().is_none() && self.tops_asked.fetch_add(1, Ordering::Relaxed) < OFTEN {
            return None;
        }
        self.tops.get_or_init(|| self.find_tops()).as_ref()
    }

    fn find_tops(&self) -> Option<Tops> {
        /// Squares that all triangles may lie over together: a tenth of a second.
        const MOST: usize = 50_000_000;
        if !self.movers.is_empty() {
            return None;
        }
        let [low, high] = self.committed.bounds();
        let per_m = [0, 1].map(|axis| SIDE as f32 / (high[axis] - low[axis]).max(1e-3));
        let mut tops = Tops { corner: [low[0], low[1]], per_m, highest: vec![f32::NEG_INFINITY; SIDE * SIDE] };
        let mut left = MOST;
        for (object, extent) in (0..).zip(&self.extents) {
            let (mut corners, mut count) = ([Vec3::ZERO; 3], 0);
            self.each_corner(object, 0.0, &mut |corner: DVec3| {
                corners[count] = (extent.world_from_object.transform_point3(corner) - self.origin).as_vec3();
                count = (count + 1) % 3;
                if count == 0 {
                    left = left.saturating_sub(tops.raise(corners));
                }
            });
            if left == 0 {
                return None;
            }
        }
        Some(tops)
    }
}
