//! Drainage of a grid of heights, and its erosion.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Heights on a grid without a position: `heights` row by row, `step` m from point to point along rows and columns.
pub(super) struct HeightField {
    pub columns: usize,
    pub step: [f64; 2],
    pub heights: Vec<f64>,
}

/// How water drains from every point of a field.
pub(super) struct Drainage {
    /// All points, each after the one it flows to.
    pub order: Vec<u32>,
    /// The point that each flows to; outlets flow to themselves.
    pub to: Vec<u32>,
    /// How many points drain through each, itself included.
    pub area: Vec<u32>,
}

impl HeightField {
    pub fn rows(&self) -> usize {
        self.heights.len() / self.columns
    }

    /// The neighbours of a point, and their distances.
    pub fn around(&self, point: usize) -> impl Iterator<Item = (usize, f64)> + use<> {
        let (columns, rows, [width, height]) = (self.columns, self.rows(), self.step);
        let (column, row) = (point % columns, point / columns);
        (0..9).filter(|&side| side != 4).filter_map(move |side| {
            let (i, j) = (column + side % 3, row + side / 3);
            let inside = (1..=columns).contains(&i) && (1..=rows).contains(&j);
            let distance = f64::hypot(((side % 3) as f64 - 1.0) * width, ((side / 3) as f64 - 1.0) * height);
            inside.then(|| ((j - 1) * columns + i - 1, distance))
        })
    }

    pub fn is_edge(&self, point: usize) -> bool {
        let (column, row) = (point % self.columns, point / self.columns);
        column == 0 || row == 0 || column + 1 == self.columns || row + 1 == self.rows()
    }

    /// Routes water to `outlets` by flooding upwards from them, always from the lowest shore (priority flood: Barnes,
    /// Lehman & Mulla 2014, Computers & Geosciences 62): water in a hollow also finds its way out.
    pub fn drainage(&self, outlets: impl Iterator<Item = usize>) -> Drainage {
        let points = self.heights.len();
        let mut to = vec![u32::MAX; points];
        let mut order = Vec::with_capacity(points);
        let mut shore = BinaryHeap::new();
        for outlet in outlets {
            to[outlet] = outlet as u32;
            shore.push(Reverse((rank(self.heights[outlet]), outlet as u32)));
        }
        while let Some(Reverse((level, point))) = shore.pop() {
            order.push(point);
            for (next, _) in self.around(point as usize) {
                if to[next] == u32::MAX {
                    to[next] = point;
                    shore.push(Reverse((rank(self.heights[next]).max(level), next as u32)));
                }
            }
        }
        let mut area = vec![1; points];
        for &point in order.iter().rev() {
            let below = to[point as usize];
            if below != point {
                area[below as usize] += area[point as usize];
            }
        }
        Drainage { order, to, area }
    }

    /// Erodes the land in `rounds` rounds: streams incise according to their stream power, and soil creeps downhill.
    ///
    /// Stream power: dh/dt = -K A^(1/2) S, A the area that drains through a point, S the slope to the next, solved
    /// implicitly from the outlet upwards (Braun & Willett 2013, Geomorphology 180-181). Creep is diffusion (Culling
    /// 1960, J. Geol. 68). Hollows are filled to the level at which they overflow.
    pub fn erode(&mut self, rounds: usize, outlet: usize) {
        /// K dt of a round, for areas as fractions of the whole and lengths as fractions of the field's.
        const POWER: f64 = 0.02;
        /// Slope of filled hollows, so that water flows on.
        const LEAST_SLOPE: f64 = 1e-3;
        let whole = self.heights.len() as f64;
        let length = (self.columns as f64 * self.step[0]).max(self.rows() as f64 * self.step[1]);
        for _ in 0..rounds {
            let Drainage { order, to, area } = self.drainage(std::iter::once(outlet));
            for &point in &order {
                let (point, below) = (point as usize, to[point as usize] as usize);
                if point == below {
                    continue;
                }
                let run = self.between(point, below);
                let (height, low) = (self.heights[point], self.heights[below]);
                let cut = POWER * (f64::from(area[point]) / whole).sqrt() * length / run;
                let worn = (height + cut * low) / (1.0 + cut);
                self.heights[point] = worn.max(low + LEAST_SLOPE * run);
            }
            self.creep(outlet);
        }
        // Gullies as narrow as a grid cell would be jagged.
        self.creep(outlet);
        self.creep(outlet);
    }

    fn creep(&mut self, outlet: usize) {
        /// Fraction of its height above its neighbours' mean that a point loses.
        const CREEP: f64 = 0.3;
        let before = self.heights.clone();
        for point in (0..before.len()).filter(|&point| point != outlet) {
            let around = self.around(point);
            let (sum, count) = around.fold((0.0, 0.0), |(sum, count), (next, _)| (sum + before[next], count + 1.0));
            self.heights[point] += CREEP * (sum / count - before[point]);
        }
    }

    fn between(&self, a: usize, b: usize) -> f64 {
        let apart = |x: usize, y: usize| x.abs_diff(y) as f64;
        let [width, height] = self.step;
        let along = apart(a % self.columns, b % self.columns) * width;
        along.hypot(apart(a / self.columns, b / self.columns) * height)
    }
}

impl Drainage {
    /// The points of the main stream, from its spring to its outlet: upstream from the outlet that drains most, always
    /// along the larger tributary, as long as at least `least` points drain through it.
    pub fn main_stream(&self, least: u32) -> Vec<u32> {
        let mut largest = vec![u32::MAX; self.to.len()];
        for &point in &self.order {
            let below = self.to[point as usize];
            if below != point {
                let known = &mut largest[below as usize];
                if *known == u32::MAX || self.area[*known as usize] < self.area[point as usize] {
                    *known = point;
                }
            }
        }
        let outlets = self.order.iter().copied().filter(|&point| self.to[point as usize] == point);
        let mut stream: Vec<u32> = outlets.max_by_key(|&outlet| self.area[outlet as usize]).into_iter().collect();
        while let Some(&last) = stream.last() {
            let next = largest[last as usize];
            if next == u32::MAX || self.area[next as usize] < least {
                break;
            }
            stream.push(next);
        }
        stream.reverse();
        stream
    }
}

/// An integer with the same order as `height`.
pub(super) fn rank(height: f64) -> i64 {
    let bits = height.to_bits() as i64;
    // As f64::total_cmp does: all bits of negative numbers but the sign are flipped.
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field() -> HeightField {
        // A slope down to the left with a pit in it.
        let (columns, rows) = (12, 9);
        let height = |point: usize| (point % columns) as f64 + ((point / columns) as f64 - 4.0).abs() * 0.3;
        let mut heights: Vec<f64> = (0..columns * rows).map(height).collect();
        heights[4 * columns + 6] = -2.0;
        HeightField { columns, step: [1.0, 2.0], heights }
    }

    #[test]
    fn all_water_leaves() {
        let field = field();
        let edge = (0..field.heights.len()).filter(|&point| field.is_edge(point));
        let drainage = field.drainage(edge);
        assert_eq!(drainage.order.len(), field.heights.len());
        let mut done = vec![false; field.heights.len()];
        for &point in &drainage.order {
            let below = drainage.to[point as usize];
            assert!(below == point || done[below as usize]);
            assert!(below != point || field.is_edge(point as usize));
            done[point as usize] = true;
        }
        let outlets = drainage.order.iter().filter(|&&point| drainage.to[point as usize] == point);
        let drained: u32 = outlets.map(|&outlet| drainage.area[outlet as usize]).sum();
        assert_eq!(drained as usize, field.heights.len());
        let stream = drainage.main_stream(1);
        // Along the bottom of the valley, out at the left.
        assert_eq!(stream.last(), Some(&(4 * 12)));
        assert!(stream.windows(2).all(|pair| drainage.to[pair[0] as usize] == pair[1]));
    }

    #[test]
    fn erosion_fills_hollows_and_lowers_what_water_runs_over() {
        let mut field = field();
        let before = field.heights.clone();
        let outlet = 4 * 12;
        field.erode(6, outlet);
        assert_eq!(field.heights[outlet], before[outlet]);
        let far = 4 * 12 + 9;
        assert!(field.heights[far] < before[far] && field.heights[4 * 12 + 6] > -2.0);
        let Drainage { order, to, .. } = field.drainage(std::iter::once(outlet));
        let uphill = |&&point: &&u32| field.heights[point as usize] < field.heights[to[point as usize] as usize];
        assert!(order.iter().filter(uphill).count() * 20 < order.len());
    }

    #[test]
    fn ranks_are_ordered_as_heights() {
        let heights = [f64::NEG_INFINITY, -2.0, -1.0, -0.0, 0.0, 1e-300, 1.0, 7.5];
        assert!(heights.windows(2).all(|pair| rank(pair[0]) < rank(pair[1])));
    }
}
