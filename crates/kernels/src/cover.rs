//! Which rays of a beam a triangle stops, without tracing them.

use crate::level::kernels;
use crate::math::{halves, sum};

/// Most rays of a beam.
pub const FAN: usize = 64;

/// Rays whose bits are found together.
const ROWS: usize = 16;

/// The rays of one beam, axis by axis.
pub type RayAxes<'a> = [&'a [f32; FAN]; 3];

kernels! {
    /// Shortens those rays among the bits of `free` that hit a triangle: where its range is less than that in `range`,
    /// m, this becomes it. Returns the bits of these rays. Rays start at `origin` and have unit directions; corners are
    /// in the same frame. From either side (Moeller and Trumbore 1997, without their test of the side).
    pub fn cover(corners: [[f32; 3]; 3], origin: RayAxes, direction: RayAxes, free: u64, range: &mut [f32; FAN]) -> u64 {
        let ([ox, oy, oz], [dx, dy, dz]) = (origin, direction);
        let [a, b, c] = corners;
        let e = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let f = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
        let mut covered = 0;
        for start in (0..FAN).step_by(ROWS) {
            let free = (free >> start) as u32;
            let mut bits = 0;
            for row in 0..ROWS {
                let ray = start + row;
                let d = [dx[ray], dy[ray], dz[ray]];
                let s = [ox[ray] - a[0], oy[ray] - a[1], oz[ray] - a[2]];
                let p = [d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]];
                let q = [s[1] * e[2] - s[2] * e[1], s[2] * e[0] - s[0] * e[2], s[0] * e[1] - s[1] * e[0]];
                let scale = 1.0 / (e[0] * p[0] + e[1] * p[1] + e[2] * p[2]);
                let u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) * scale;
                let v = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) * scale;
                let far = (f[0] * q[0] + f[1] * q[1] + f[2] * q[2]) * scale;
                let hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (far > 0.0) & (far < range[ray]);
                let hit = hit & (free & 1 << row != 0);
                range[ray] = if hit { far } else { range[ray] };
                bits |= if hit { 1 << row } else { 0u32 };
            }
            covered |= u64::from(bits) << start;
        }
        covered
    }

    /// Of the rays among the bits of `of`, which end at `range`: the sum of their ranges and of the places where they
    /// end, axis by axis, and the least and greatest range.
    pub fn measure(of: u64, range: &[f32; FAN], origin: RayAxes, direction: RayAxes) -> [f32; 6] {
        let ([ox, oy, oz], [dx, dy, dz]) = (origin, direction);
        let (mut one, mut far) = ([0.0; FAN], [0.0; FAN]);
        for ray in 0..FAN {
            let is = of >> ray & 1 != 0;
            one[ray] = if is { 1.0 } else { 0.0 };
            far[ray] = if is { range[ray] } else { 0.0 };
        }
        let mut along = [[0.0; FAN]; 3];
        for ray in 0..FAN {
            along[0][ray] = one[ray] * ox[ray] + far[ray] * dx[ray];
            along[1][ray] = one[ray] * oy[ray] + far[ray] * dy[ray];
            along[2][ray] = one[ray] * oz[ray] + far[ray] * dz[ray];
            one[ray] = if one[ray] > 0.0 { far[ray] } else { f32::INFINITY };
        }
        let [x, y, z] = along.map(sum);
        let low = halves(one, |a, b| if a < b { a } else { b });
        let high = halves(far, |a, b| if a > b { a } else { b });
        [sum(far), x, y, z, low, high]
    }

    /// How many of the rays among the bits of `of`, which end at `range`, do so more than `off` m off the `plane`
    /// through a place with a unit normal.
    pub fn count_off(
        of: u64,
        range: &[f32; FAN],
        origin: RayAxes,
        direction: RayAxes,
        plane: [[f32; 3]; 2],
        off: f32,
    ) -> u32 {
        let ([place, normal], [ox, oy, oz], [dx, dy, dz]) = (plane, origin, direction);
        let mut count = [0; FAN];
        for ray in 0..FAN {
            let far = range[ray];
            let way = [
                ox[ray] + far * dx[ray] - place[0],
                oy[ray] + far * dy[ray] - place[1],
                oz[ray] + far * dz[ray] - place[2],
            ];
            let along = way[0] * normal[0] + way[1] * normal[1] + way[2] * normal[2];
            count[ray] = u32::from((along.abs() > off) & (of >> ray & 1 != 0));
        }
        count.iter().sum()
    }

    /// Adds to `moments`, second, third and fourth, the powers of what the `range`s of the rays among the bits of `of`
    /// are beyond `mean`, each times `weight`.
    pub fn add_moments(of: u64, mean: f32, weight: f32, range: &[f32; FAN], moments: &mut [f32; 3]) {
        let (mut squares, mut cubes, mut fourths) = ([0.0; FAN], [0.0; FAN], [0.0; FAN]);
        for ray in 0..FAN {
            let beyond = if of >> ray & 1 != 0 { range[ray] - mean } else { 0.0 };
            let square = beyond * beyond;
            squares[ray] = square;
            cubes[ray] = square * beyond;
            fourths[ray] = square * square;
        }
        moments[0] += weight * sum(squares);
        moments[1] += weight * sum(cubes);
        moments[2] += weight * sum(fourths);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays along x at places across it: only those inside the triangle end at it, wherever its corners start, and only
    /// if they are free and nothing nearer stops them.
    #[test]
    fn rays_inside_a_triangle_end_there() {
        let corners = [[5.0, -1.0, -1.0], [5.0, 2.0, -1.0], [6.0, -1.0, 2.0]];
        let (zeros, ones) = ([0.0; FAN], [1.0; FAN]);
        let y: [f32; FAN] = std::array::from_fn(|i| -1.45 + 0.5 * (i % 8) as f32);
        let z: [f32; FAN] = std::array::from_fn(|i| -1.45 + 0.5 * (i / 8) as f32);
        for turn in 0..6 {
            let mut order = [corners[turn % 3], corners[(turn + 1) % 3], corners[(turn + 2) % 3]];
            if turn >= 3 {
                order.swap(0, 1);
            }
            let mut range: [f32; FAN] = std::array::from_fn(|i| if i % 7 == 0 { 4.0 } else { 100.0 });
            let bits = cover(order, [&zeros, &y, &z], [&ones, &zeros, &zeros], !(1 << 20), &mut range);
            assert!(bits.count_ones() > 5 && 1 << 20 & bits == 0);
            for i in 0..FAN {
                let inside = y[i] > -1.0 && z[i] > -1.0 && (y[i] + 1.0) / 3.0 + (z[i] + 1.0) / 3.0 < 1.0;
                let is = inside && i % 7 != 0 && i != 20;
                assert_eq!(bits & 1 << i != 0, is, "{i}");
                match is {
                    true => assert!((range[i] - 5.0 - (z[i] + 1.0) / 3.0).abs() < 1e-5, "{i}: {}", range[i]),
                    false => assert!(range[i] == 4.0 || range[i] == 100.0, "{i}"),
                }
            }
        }
    }

    /// A triangle that is seen edge-on or has no area stops nothing.
    #[test]
    fn flat_triangles_stop_nothing() {
        let (zeros, ones) = ([0.0; FAN], [1.0; FAN]);
        let z: [f32; FAN] = std::array::from_fn(|i| 0.1 * i as f32);
        for corners in [[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]; 3]] {
            let mut range = [f32::INFINITY; FAN];
            assert_eq!(cover(corners, [&zeros, &zeros, &z], [&ones, &zeros, &zeros], u64::MAX, &mut range), 0);
        }
    }

    /// Sums over some rays are those of a plain loop.
    #[test]
    fn sums_are_over_the_rays_asked_for() {
        let ray = |i: usize| ((i * 37) % 64) as f32;
        let range: [f32; FAN] = std::array::from_fn(|i| 3.0 + ray(i) / 64.0);
        let x: [f32; FAN] = std::array::from_fn(|i| ray(i + 5));
        let (zeros, ones, of) = ([0.0; FAN], [1.0; FAN], 0x8421_0f0f_1234_5679u64);
        let some = || (0..FAN).filter(|i| of & 1 << i != 0);
        let [sum, along, y, _, low, high] = measure(of, &range, [&x, &ones, &zeros], [&ones, &zeros, &ones]);
        let near = |is: f32, expected: f32| assert!((is / expected - 1.0).abs() < 1e-5, "{is} is not {expected}");
        near(sum, some().map(|i| range[i]).sum());
        near(along, some().map(|i| x[i] + range[i]).sum());
        near(y, some().count() as f32);
        near(low, some().map(|i| range[i]).fold(9.0, f32::min));
        near(high, some().map(|i| range[i]).fold(0.0, f32::max));
        let plane = [[2.5, 1.0, 0.0], [1.0, 0.0, 0.0]];
        let beyond = some().filter(|&i| (range[i] - 2.5).abs() > 1.2).count() as u32;
        assert_eq!(count_off(of, &range, [&zeros; 3], [&ones, &zeros, &ones], plane, 1.2), beyond);
        assert!(beyond > 3 && beyond < of.count_ones());
        let mut moments = [1.0; 3];
        add_moments(of, 3.25, 0.5, &range, &mut moments);
        for (power, moment) in (2..).zip(moments) {
            near(moment, 1.0 + 0.5 * some().map(|i| (range[i] - 3.25).powi(power)).sum::<f32>());
        }
    }
}
