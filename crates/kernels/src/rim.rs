//! The footprints of a block's beams, compared with the hits of their axes.

use crate::level::kernels;
use crate::{LANES, Lanes, MISS};

kernels! {
    /// Unit vectors perpendicular to beams, to the left and up, where the sensors' z axes are `z`; zeros where a beam
    /// is parallel to its z, and so has no left.
    pub fn across(z: [&Lanes; 3], direction: [&Lanes; 3], left: [&mut Lanes; 3], up: [&mut Lanes; 3]) {
        let ([zx, zy, zz], [x, y, z]) = (z, direction);
        let ([left_x, left_y, left_z], [up_x, up_y, up_z]) = (left, up);
        for lane in 0..LANES {
            let a = zy[lane] * z[lane] - zz[lane] * y[lane];
            let b = zz[lane] * x[lane] - zx[lane] * z[lane];
            let c = zx[lane] * y[lane] - zy[lane] * x[lane];
            let square = a * a + b * b + c * c;
            let scale = if square > 1e-12 { 1.0 / square.sqrt() } else { 0.0 };
            let (a, b, c) = (a * scale, b * scale, c * scale);
            (left_x[lane], left_y[lane], left_z[lane]) = (a, b, c);
            up_x[lane] = y[lane] * c - z[lane] * b;
            up_y[lane] = z[lane] * a - x[lane] * c;
            up_z[lane] = x[lane] * b - y[lane] * a;
        }
    }

    /// Peak of the echo of an oblique surface relative to that at normal incidence: its pulse of the standard deviation
    /// `sigma` m spreads by `s`, and so its peak falls by `sigma / hypot(sigma, s)`.
    ///
    /// Across a Gaussian beam of the radii `w = hypot(start, angle R)` at 1/e^2, positions have the standard deviations
    /// `w / 2`; on a plane, depths vary by that times `tan` of its slope:
    /// `s^2 = (w_h^2 n_left^2 + w_v^2 n_up^2) / (4 cos^2)`.
    pub fn obliqueness(
        sigma: f32,
        start: f32,
        angles: [f32; 2],
        normal: [&Lanes; 3],
        left: [&Lanes; 3],
        cos: &Lanes,
        range: &Lanes,
        factor: &mut Lanes,
    ) {
        let [horizontal, vertical] = angles;
        for lane in 0..LANES {
            let to_left = normal[0][lane] * left[0][lane] + normal[1][lane] * left[1][lane]
                + normal[2][lane] * left[2][lane];
            let along = cos[lane] * cos[lane];
            let left = to_left * to_left;
            let up = (1.0 - along - left).max(0.0);
            let square = range[lane] * range[lane];
            let across = (start * start + horizontal * horizontal * square) * left
                + (start * start + vertical * vertical * square) * up;
            factor[lane] = sigma * cos[lane] / (sigma * sigma * along + 0.25 * across).sqrt();
        }
    }

    /// Adds `mark` to the marks of lanes where the hit at `other`, on the surface `other_surface`, is on another
    /// surface than that at `place` or more than `off` m off its plane. All slices have the same length.
    pub fn compare(
        normal: [&[f32]; 3],
        place: [&[f32]; 3],
        surface: &[u32],
        other: [&[f32]; 3],
        other_surface: &[u32],
        off: f32,
        mark: u8,
        marks: &mut [u8],
    ) {
        let count = marks.len();
        let [nx, ny, nz] = normal.map(|axis| &axis[..count]);
        let [x, y, z] = place.map(|axis| &axis[..count]);
        let [ox, oy, oz] = other.map(|axis| &axis[..count]);
        let (surface, other_surface) = (&surface[..count], &other_surface[..count]);
        for lane in 0..count {
            let beyond = nx[lane] * (ox[lane] - x[lane]) + ny[lane] * (oy[lane] - y[lane])
                + nz[lane] * (oz[lane] - z[lane]);
            let apart = (surface[lane] != other_surface[lane]) | ((surface[lane] != MISS) & (beyond.abs() > off));
            marks[lane] |= if apart { mark } else { 0 };
        }
    }
}
