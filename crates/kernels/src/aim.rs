//! Transforms beam directions in the sensor frame into rays in the world.

use crate::level::kernels;
use crate::math::{cos_pi, sin_cos, sin_pi};
use crate::{LANES, Lanes};

/// A uniform motion: along a straight line, and about one axis.
#[derive(Clone, Copy, Debug)]
pub struct UniformMotion {
    /// When it begins, s.
    pub start: f64,
    /// Fraction of the motion per second.
    pub per_second: f64,
    /// Position at its start, m.
    pub from: [f64; 3],
    /// Displacement from there to its end, m.
    pub way: [f64; 3],
    /// Columns of the matrix from the sensor frame at the start to the world.
    pub rotation: [[f32; 3]; 3],
    /// Axis of its rotation, in the sensor frame, of length 1.
    pub axis: [f32; 3],
    /// Half of its rotation angle, rad, 0 to pi/2.
    pub half_angle: f64,
}

/// A frame that moves: its origin and the matrix into it are `a + b t + c t^2` when the part `t` of a time has passed.
#[derive(Clone, Copy, Debug, Default)]
pub struct MovingFrame {
    /// When the time starts.
    pub start: f32,
    /// One over its length.
    pub rate: f32,
    /// `a`, `b` and `c` of the frame's origin.
    pub place: [[f32; 3]; 3],
    /// Those of the matrix into the frame, for directions, each as columns.
    pub into: [[[f32; 3]; 3]; 3],
}

/// Origin and unit direction of a sub-ray: what [`spread`] says of one lane.
#[inline(always)]
fn sub_ray(
    [cos, sin]: [f32; 2],
    start: f32,
    [horizontal, vertical]: [f32; 2],
    [left, up]: [[f32; 3]; 2],
    turn: [f32; 2],
    axis_origin: [f32; 3],
    axis: [f32; 3],
) -> [[f32; 3]; 2] {
    let c = cos * turn[0] - sin * turn[1];
    let s = sin * turn[0] + cos * turn[1];
    // Skewed: the position at the exit is a quarter turn from the direction of the angle.
    let (a, b) = (start * c, start * s);
    let (u, v) = (-horizontal * s, vertical * c);
    let [x, y, z] = [0, 1, 2].map(|k| axis[k] + u * left[k] + v * up[k]);
    // Unit length: without it Embree is a third slower.
    let scale = 1.0 / (x * x + y * y + z * z).sqrt();
    [[0, 1, 2].map(|k| axis_origin[k] + a * left[k] + b * up[k]), [x * scale, y * scale, z * scale]]
}

kernels! {
    /// Transforms rays, origins and directions axis by axis, into a frame, each at its own time.
    pub fn enter(frame: &MovingFrame, times: &[f32], from: [&[f32]; 6], to: [&mut [f32]; 6]) {
        let count = times.len();
        let [ox, oy, oz, dx, dy, dz] = from.map(|row| &row[..count]);
        let [to_ox, to_oy, to_oz, to_dx, to_dy, to_dz] = to.map(|row| &mut row[..count]);
        let MovingFrame { start, rate, place, into } = *frame;
        for lane in 0..count {
            let part = ((times[lane] - start) * rate).clamp(0.0, 1.0);
            let at = |axis: usize| place[0][axis] + (place[1][axis] + place[2][axis] * part) * part;
            let [x, y, z] = [ox[lane] - at(0), oy[lane] - at(1), oz[lane] - at(2)];
            let of = |k: usize, axis: usize| into[0][k][axis] + (into[1][k][axis] + into[2][k][axis] * part) * part;
            let [a, b, c] = [0, 1, 2].map(|k| [of(k, 0), of(k, 1), of(k, 2)]);
            to_ox[lane] = a[0] * x + b[0] * y + c[0] * z;
            to_oy[lane] = a[1] * x + b[1] * y + c[1] * z;
            to_oz[lane] = a[2] * x + b[2] * y + c[2] * z;
            to_dx[lane] = a[0] * dx[lane] + b[0] * dy[lane] + c[0] * dz[lane];
            to_dy[lane] = a[1] * dx[lane] + b[1] * dy[lane] + c[1] * dz[lane];
            to_dz[lane] = a[2] * dx[lane] + b[2] * dy[lane] + c[2] * dz[lane];
        }
    }

    /// Rotates directions `from` by the matrix with the columns `axes`, into the first lanes.
    pub fn rotate(axes: &[[f32; 3]; 3], from: [&[f32]; 3], to: [&mut Lanes; 3]) {
        let count = from[0].len();
        let [x, y, z] = from.map(|axis| &axis[..count]);
        let [a, b, c] = axes;
        let [to_x, to_y, to_z] = to.map(|axis| &mut axis[..count]);
        for lane in 0..count {
            to_x[lane] = a[0] * x[lane] + b[0] * y[lane] + c[0] * z[lane];
            to_y[lane] = a[1] * x[lane] + b[1] * y[lane] + c[1] * z[lane];
            to_z[lane] = a[2] * x[lane] + b[2] * y[lane] + c[2] * z[lane];
        }
    }

    /// Turns directions to the left about the axes `up`, unit vectors, by `angle` rad, -pi/2 to pi/2 (Rodrigues).
    pub fn turn(up: [&Lanes; 3], angle: &Lanes, direction: [&mut Lanes; 3]) {
        let [x, y, z] = direction;
        for lane in 0..LANES {
            let part = angle[lane] * (1.0 / std::f32::consts::PI);
            let (sin, cos) = (sin_pi(part), cos_pi(part));
            let [a, b, c] = [up[0][lane], up[1][lane], up[2][lane]];
            let along = (a * x[lane] + b * y[lane] + c * z[lane]) * (1.0 - cos);
            (x[lane], y[lane], z[lane]) = (
                x[lane] * cos + (b * z[lane] - c * y[lane]) * sin + a * along,
                y[lane] * cos + (c * x[lane] - a * z[lane]) * sin + b * along,
                z[lane] * cos + (a * y[lane] - b * x[lane]) * sin + c * along,
            );
        }
    }

    /// Origins and directions of rays from lane `first` on, one for each of `times`, s after `start_time`, of beams in
    /// the directions `from` of a moving sensor. Origins are relative to `local_origin`, m.
    pub fn rotate_moving(
        motion: &UniformMotion,
        start_time: f64,
        times: &[f64],
        from: [&[f32]; 3],
        local_origin: [f64; 3],
        first: usize,
        origin: [&mut Lanes; 3],
        to: [&mut Lanes; 3],
    ) {
        let count = times.len().min(LANES - first);
        let mut part = [0.0; LANES];
        for (part, time) in part.iter_mut().zip(&times[..count]) {
            *part = (start_time + time - motion.start) * motion.per_second;
        }
        let (mut sine, mut versine) = ([0.0; LANES], [0.0; LANES]);
        if motion.half_angle > 0.0 {
            for lane in 0..LANES {
                // Of the whole angle, from the half: the difference of 1 and a cosine would lose digits.
                let (s, c) = sin_cos(part[lane] * motion.half_angle);
                (sine[lane], versine[lane]) = ((2.0 * s * c) as f32, (2.0 * s * s) as f32);
            }
        }
        let lanes = first..first + count;
        for (axis, to) in origin.into_iter().enumerate() {
            let (from, way) = (motion.from[axis] - local_origin[axis], motion.way[axis]);
            for (to, part) in to[lanes.clone()].iter_mut().zip(&part) {
                *to = (from + way * part) as f32;
            }
        }
        // Rodrigues' formula: d + sin (k x d) + (1 - cos) k x (k x d).
        let [kx, ky, kz] = motion.axis;
        let [a, b, c] = motion.rotation;
        let [x, y, z] = from.map(|axis| &axis[..count]);
        let [to_x, to_y, to_z] = to.map(|axis| &mut axis[lanes.clone()]);
        for lane in 0..count {
            let (dx, dy, dz) = (x[lane], y[lane], z[lane]);
            let (ax, ay, az) = (ky * dz - kz * dy, kz * dx - kx * dz, kx * dy - ky * dx);
            let (bx, by, bz) = (ky * az - kz * ay, kz * ax - kx * az, kx * ay - ky * ax);
            let tx = dx + ax * sine[lane] + bx * versine[lane];
            let ty = dy + ay * sine[lane] + by * versine[lane];
            let tz = dz + az * sine[lane] + bz * versine[lane];
            to_x[lane] = a[0] * tx + b[0] * ty + c[0] * tz;
            to_y[lane] = a[1] * tx + b[1] * ty + c[1] * tz;
            to_z[lane] = a[2] * tx + b[2] * ty + c[2] * tz;
        }
    }

    /// Sub-rays off the axes of beams, one each: `place` is the ray's position in the beam (cosine and sine of its
    /// position on a spiral, times its distance from the axis over the beam's radius), `left` and `up` are unit vectors
    /// perpendicular to the beam, `turn` the cosine and sine of the spiral's rotation, `start` the radius at the exit,
    /// m, `half_angles` half the divergence, rad, horizontal and vertical.
    pub fn spread(
        place: [f32; 2],
        start: f32,
        half_angles: [f32; 2],
        left: &[Lanes; 3],
        up: &[Lanes; 3],
        turn: &[Lanes; 2],
        axis_origin: [&Lanes; 3],
        axis: [&Lanes; 3],
        origin: [&mut Lanes; 3],
        to: [&mut Lanes; 3],
    ) {
        let [org_x, org_y, org_z] = origin;
        let [dir_x, dir_y, dir_z] = to;
        for lane in 0..LANES {
            let at = |axes: [&Lanes; 3]| axes.map(|axis| axis[lane]);
            let across = [at(left.each_ref()), at(up.each_ref())];
            let turn = [turn[0][lane], turn[1][lane]];
            let [origin, direction] = sub_ray(place, start, half_angles, across, turn, at(axis_origin), at(axis));
            [org_x[lane], org_y[lane], org_z[lane]] = origin;
            [dir_x[lane], dir_y[lane], dir_z[lane]] = direction;
        }
    }

    /// Sub-rays of one beam from `axis_origin` along `axis`, one for each of `places` in it; otherwise as for
    /// [`spread`].
    pub fn fan(
        places: [&[f32]; 2],
        start: f32,
        half_angles: [f32; 2],
        left_up: [[f32; 3]; 2],
        turn: [f32; 2],
        axis_origin: [f32; 3],
        axis: [f32; 3],
        origin: [&mut [f32]; 3],
        to: [&mut [f32]; 3],
    ) {
        let count = places[0].len();
        let [cos, sin] = places.map(|places| &places[..count]);
        let [org_x, org_y, org_z] = origin.map(|axis| &mut axis[..count]);
        let [dir_x, dir_y, dir_z] = to.map(|axis| &mut axis[..count]);
        for ray in 0..count {
            let [origin, direction] =
                sub_ray([cos[ray], sin[ray]], start, half_angles, left_up, turn, axis_origin, axis);
            [org_x[ray], org_y[ray], org_z[ray]] = origin;
            [dir_x[ray], dir_y[ray], dir_z[ray]] = direction;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turned by 30 degrees to the left about z, and about x, where y goes to z.
    #[test]
    fn directions_turn() {
        let angle = [std::f32::consts::PI / 6.0; LANES];
        let constant = |axes: [f32; 3]| axes.map(|value| [value; LANES]);
        for (up, expected) in [
            ([0.0, 0.0, 1.0], [0.6 * 0.75f32.sqrt(), 0.3, 0.8]),
            ([1.0, 0.0, 0.0], [0.6, -0.4, 0.8 * 0.75f32.sqrt()]),
            ([0.6, 0.0, 0.8], [0.6, 0.0, 0.8]),
        ] {
            let (up, mut direction) = (constant(up), constant([0.6, 0.0, 0.8]));
            turn(up.each_ref(), &angle, direction.each_mut());
            for axis in 0..3 {
                assert!((direction[axis][77] - expected[axis]).abs() < 2e-7, "{expected:?}");
            }
        }
    }
}
