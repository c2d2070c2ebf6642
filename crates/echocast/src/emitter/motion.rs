//! An even motion, for many times at once.

use super::Pose;
use crate::ground::lanes::{LANES, RayBatch};
use glam::{DQuat, DVec3, Mat3, Vec3};

/// How a sensor moves between two poses: straight on, and evenly about one axis.
pub(super) struct Motion {
    start: f64,
    end: f64,
    per_second: f64,
    from: DVec3,
    way: DVec3,
    /// To the world from the sensor frame at the start.
    rotation: Mat3,
    /// What it turns about, in the sensor frame, of length 1.
    axis: Vec3,
    /// Half of what it turns by, rad, 0 to pi/2.
    half_angle: f64,
}

impl Motion {
    /// Between two poses and their times, s, turning the shorter way.
    pub fn new((start, a): (f64, Pose), (end, b): (f64, Pose)) -> Motion {
        let turn = a.orientation.conjugate() * b.orientation;
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let DQuat { x, y, z, w } = turn;
        let sine = DVec3::new(x, y, z);
        Motion {
            start,
            end,
            per_second: 1.0 / (end - start),
            from: a.position,
            way: b.position - a.position,
            rotation: a.rotation().as_mat3(),
            axis: sine.try_normalize().unwrap_or(DVec3::Z).as_vec3(),
            half_angle: sine.length().atan2(w),
        }
    }

    /// Whether it is going on at `time`, s.
    #[inline(always)]
    pub fn covers(&self, time: f64) -> bool {
        self.start <= time && time <= self.end
    }

    /// Origins and directions of rays from lane `first` on, one for each of `times`, s after `start_time`; `beams` are
    /// the x, y and z of their directions in the sensor frame, `local_origin` is the world position of the rays' (0, 0,
    /// 0).
    #[inline(always)]
    pub fn aim(
        &self,
        start_time: f64,
        times: &[f64],
        beams: [&[f32]; 3],
        local_origin: DVec3,
        first: usize,
        rays: &mut RayBatch,
    ) {
        let count = times.len().min(LANES - first);
        let mut part = [0.0; LANES];
        for (part, time) in part.iter_mut().zip(&times[..count]) {
            *part = (start_time + time - self.start) * self.per_second;
        }
        let (mut sine, mut versine) = ([0.0; LANES], [0.0; LANES]);
        if self.half_angle > 0.0 {
            for lane in 0..LANES {
                // Of the whole angle, from its half: the difference of 1 and a cosine would lose digits.
                let (s, c) = sin_cos(part[lane] * self.half_angle);
                (sine[lane], versine[lane]) = ((2.0 * s * c) as f32, (2.0 * s * s) as f32);
            }
        }
        let from = self.from - local_origin;
        let lanes = first..first + count;
        for (to, from, way) in [
            (&mut rays.org_x, from.x, self.way.x),
            (&mut rays.org_y, from.y, self.way.y),
            (&mut rays.org_z, from.z, self.way.z),
        ] {
            for (to, part) in to[lanes.clone()].iter_mut().zip(&part) {
                *to = (from + way * part) as f32;
            }
        }
        // Rodrigues' formula: d + sin (k x d) + (1 - cos) k x (k x d).
        let Vec3 { x: kx, y: ky, z: kz } = self.axis;
        let Mat3 { x_axis, y_axis, z_axis } = self.rotation;
        let [x, y, z] = beams.map(|beams| &beams[..count]);
        let (to_x, to_y, to_z) =
            (&mut rays.dir_x[lanes.clone()], &mut rays.dir_y[lanes.clone()], &mut rays.dir_z[lanes]);
        for lane in 0..count {
            let (dx, dy, dz) = (x[lane], y[lane], z[lane]);
            let (ax, ay, az) = (ky * dz - kz * dy, kz * dx - kx * dz, kx * dy - ky * dx);
            let (bx, by, bz) = (ky * az - kz * ay, kz * ax - kx * az, kx * ay - ky * ax);
            let tx = dx + ax * sine[lane] + bx * versine[lane];
            let ty = dy + ay * sine[lane] + by * versine[lane];
            let tz = dz + az * sine[lane] + bz * versine[lane];
            to_x[lane] = x_axis.x * tx + y_axis.x * ty + z_axis.x * tz;
            to_y[lane] = x_axis.y * tx + y_axis.y * ty + z_axis.y * tz;
            to_z[lane] = x_axis.z * tx + y_axis.z * ty + z_axis.z * tz;
        }
    }
}

/// Sine and cosine of 0 to pi/2 by their power series, to 1e-12.
#[inline(always)]
fn sin_cos(x: f64) -> (f64, f64) {
    /// 1 / ((2n)(2n + 1)) and 1 / ((2n)(2n - 1)) for n = 1 to 8: terms up to x^17 and x^16.
    const SINE: [f64; 8] = ratios(1);
    const COSINE: [f64; 8] = ratios(-1);
    let q = x * x;
    let (mut sine, mut cosine) = (1.0, 1.0);
    for n in (0..8).rev() {
        sine = 1.0 - q * SINE[n] * sine;
        cosine = 1.0 - q * COSINE[n] * cosine;
    }
    (x * sine, cosine)
}

const fn ratios(step: i32) -> [f64; 8] {
    let mut ratios = [0.0; 8];
    let mut n = 0;
    while n < 8 {
        let even = 2 * (n as i32 + 1);
        ratios[n] = 1.0 / (even * (even + step)) as f64;
        n += 1;
    }
    ratios
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emitter::Trajectory;

    #[test]
    fn series_follow_the_functions() {
        for i in 0..=1000 {
            let x = std::f64::consts::FRAC_PI_2 * f64::from(i) / 1000.0;
            let (sine, cosine) = sin_cos(x);
            assert!((sine - x.sin()).abs() < 1e-12 && (cosine - x.cos()).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn a_motion_passes_the_poses_of_its_trajectory() {
        let a = Pose::at(1.0, 2.0, 3.0).with_rpy_deg(10.0, 20.0, 30.0);
        for (roll, yaw) in [(10.0, 30.0), (10.0, 31.0), (-100.0, 120.0), (40.0, -140.0), (170.0, 29.0)] {
            let mut b = Pose::at(2.0, -4.0, 3.5).with_rpy_deg(roll, 20.0, yaw);
            b.orientation = -b.orientation;
            let path = Trajectory::new(vec![(1.0, a), (3.0, b)]).unwrap();
            assert!(path.motion(0.9).is_none() && path.motion(3.1).is_none());
            let motion = path.motion(1.0).unwrap();
            assert!(motion.covers(3.0) && !motion.covers(3.1));
            for i in 0..=20 {
                let time = 1.0 + f64::from(i) / 10.0;
                let pose = path.at(time);
                let mut rays = RayBatch::default();
                let local_origin = DVec3::new(1.0, -1.0, 2.0);
                let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                motion.aim(0.5, &[time - 0.5; 3], axes.each_ref().map(|a| &a[..]), local_origin, 7, &mut rays);
                for (lane, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
                    let lane = 7 + lane;
                    let origin = Vec3::new(rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]).as_dvec3();
                    assert!((origin + local_origin - pose.position).length() < 1e-6);
                    let direction = Vec3::new(rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]).as_dvec3();
                    // glam's slerp takes a straight line for the smallest turns.
                    assert!((direction - pose.orientation * axis).length() < 4e-6, "{roll} {yaw} {time}");
                }
            }
        }
    }
}
