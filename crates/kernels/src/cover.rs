//! Which rays of a beam a triangle stops, without tracing them.

use crate::level::kernels;

/// Most rays of a beam.
pub const FAN: usize = 64;

/// Sums are formed in this many rows.
const ROWS: usize = 16;

kernels! {
    /// Shortens the rays that hit a triangle: where its range is less than that in `range`, m, this becomes it, and `by`
    /// becomes `number`. All slices have the same length. Rays start at `origin` and have unit directions; corners are
    /// in the same frame. From either side (Moeller and Trumbore 1997, without their test of the side).
    pub fn cover(
        corners: [[f32; 3]; 3],
        origin: [&[f32]; 3],
        direction: [&[f32]; 3],
        number: u32,
        range: &mut [f32],
        by: &mut [u32],
    ) {
        let count = range.len();
        let by = &mut by[..count];
        let [ox, oy, oz] = origin.map(|axis| &axis[..count]);
        let [dx, dy, dz] = direction.map(|axis| &axis[..count]);
        let [a, b, c] = corners;
        let e = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let f = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
        for lane in 0..count {
            let d = [dx[lane], dy[lane], dz[lane]];
            let s = [ox[lane] - a[0], oy[lane] - a[1], oz[lane] - a[2]];
            let p = [d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]];
            let q = [s[1] * e[2] - s[2] * e[1], s[2] * e[0] - s[0] * e[2], s[0] * e[1] - s[1] * e[0]];
            let scale = 1.0 / (e[0] * p[0] + e[1] * p[1] + e[2] * p[2]);
            let u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) * scale;
            let v = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) * scale;
            let far = (f[0] * q[0] + f[1] * q[1] + f[2] * q[2]) * scale;
            let hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (far > 0.0) & (far < range[lane]);
            range[lane] = if hit { far } else { range[lane] };
            by[lane] = if hit { number } else { by[lane] };
        }
    }

    /// Of the rays that end `by` a triangle with this `number`: how many they are, the sum of their `range`s and of the
    /// places where they end, axis by axis, and the least and greatest range.
    pub fn measure(
        number: u32,
        by: &[u32; FAN],
        range: &[f32; FAN],
        origin: [&[f32; FAN]; 3],
        direction: [&[f32; FAN]; 3],
    ) -> [f32; 7] {
        let ([ox, oy, oz], [dx, dy, dz]) = (origin, direction);
        // Sums in as many rows at every level: the order of additions does not depend on it.
        let mut sums = [[0.0; ROWS]; 5];
        let (mut low, mut high) = ([f32::INFINITY; ROWS], [0.0; ROWS]);
        for start in (0..FAN).step_by(ROWS) {
            for row in 0..ROWS {
                let ray = start + row;
                let is = by[ray] == number;
                let far = if is { range[ray] } else { 0.0 };
                let one = if is { 1.0 } else { 0.0 };
                sums[0][row] += one;
                sums[1][row] += far;
                sums[2][row] += one * ox[ray] + far * dx[ray];
                sums[3][row] += one * oy[ray] + far * dy[ray];
                sums[4][row] += one * oz[ray] + far * dz[ray];
                let least = if is { far } else { f32::INFINITY };
                low[row] = if least < low[row] { least } else { low[row] };
                high[row] = if far > high[row] { far } else { high[row] };
            }
        }
        let [count, range, x, y, z] = sums.map(|rows| rows.iter().sum::<f32>());
        let (low, high) = (low.iter().copied().fold(f32::INFINITY, f32::min), high.iter().copied().fold(0.0, f32::max));
        [count, range, x, y, z, low, high]
    }

    /// Sums of the second, third and fourth powers of what `range`s are beyond `mean`, each times its `weight`.
    pub fn moments(mean: f32, range: &[f32; FAN], weight: &[f32; FAN]) -> [f32; 3] {
        let mut sums = [[0.0; ROWS]; 3];
        for start in (0..FAN).step_by(ROWS) {
            for row in 0..ROWS {
                let beyond = range[start + row] - mean;
                let square = beyond * beyond;
                let first = weight[start + row] * square;
                sums[0][row] += first;
                sums[1][row] += first * beyond;
                sums[2][row] += first * square;
            }
        }
        sums.map(|rows| rows.iter().sum::<f32>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays along x at places across it: only those inside the triangle end at it, wherever its corners start, and only
    /// if nothing nearer stops them.
    #[test]
    fn rays_inside_a_triangle_end_there() {
        let corners = [[5.0, -1.0, -1.0], [5.0, 2.0, -1.0], [6.0, -1.0, 2.0]];
        for turn in 0..6 {
            let mut order = [corners[turn % 3], corners[(turn + 1) % 3], corners[(turn + 2) % 3]];
            if turn >= 3 {
                order.swap(0, 1);
            }
            let y: Vec<f32> = (0..100).map(|i| -1.45 + 0.4 * (i % 10) as f32).collect();
            let z: Vec<f32> = (0..100).map(|i| -1.45 + 0.4 * (i / 10) as f32).collect();
            let (zeros, ones) = (vec![0.0; 100], vec![1.0; 100]);
            let mut range: Vec<f32> = (0..100).map(|i| if i % 7 == 0 { 4.0 } else { 100.0 }).collect();
            let mut by = vec![9; 100];
            cover(order, [&zeros, &y, &z], [&ones, &zeros, &zeros], 3, &mut range, &mut by);
            for i in 0..100 {
                let inside = y[i] > -1.0 && z[i] > -1.0 && (y[i] + 1.0) / 3.0 + (z[i] + 1.0) / 3.0 < 1.0;
                let expected = 5.0 + (z[i] + 1.0) / 3.0;
                match inside && i % 7 != 0 {
                    true => assert!((range[i] - expected).abs() < 1e-5 && by[i] == 3, "{i}: {}", range[i]),
                    false => assert!(by[i] == 9 && (range[i] == 4.0 || range[i] == 100.0), "{i}"),
                }
            }
        }
    }

    /// A triangle that is seen edge-on or has no area stops nothing.
    #[test]
    fn flat_triangles_stop_nothing() {
        for corners in [[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]; 3]] {
            let (mut range, mut by) = ([f32::INFINITY; 3], [0; 3]);
            let (zeros, ones) = ([0.0; 3], [1.0; 3]);
            cover(corners, [&zeros, &zeros, &[0.0, 0.5, 2.0]], [&ones, &zeros, &zeros], 1, &mut range, &mut by);
            assert_eq!(by, [0; 3]);
        }
    }
}
