//! A uniform motion, for many times at once.

use super::Pose;
use echocast_kernels::aim;
use glam::{DQuat, DVec3};
use ground::lanes::RayBatch;

/// How a sensor moves between two poses: in a straight line, and uniformly about one axis.
pub(super) struct PlatformMotion {
    end: f64,
    inner: aim::UniformMotion,
}

impl PlatformMotion {
    /// Between two poses and their times, s, turning the shorter way.
    pub fn new((start, a): (f64, Pose), (end, b): (f64, Pose)) -> PlatformMotion {
        let turn = a.orientation.conjugate() * b.orientation;
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let DQuat { x, y, z, w } = turn;
        let sine = DVec3::new(x, y, z);
        let inner = aim::UniformMotion {
            start,
            per_second: 1.0 / (end - start),
            from: a.position.to_array(),
            way: (b.position - a.position).to_array(),
            rotation: a.rotation().as_mat3().to_cols_array_2d(),
            axis: sine.try_normalize().unwrap_or(DVec3::Z).as_vec3().to_array(),
            half_angle: sine.length().atan2(w),
        };
        PlatformMotion { end, inner }
    }

    /// Whether it includes `time`, s.
    pub fn covers(&self, time: f64) -> bool {
        self.inner.start <= time && time <= self.end
    }

    /// Origins and directions of rays from lane `first` on, one for each of `times`, s after `start_time`; `beams` are
    /// the x, y and z of their directions in the sensor frame, `local_origin` is the world position of the rays' (0, 0,
    /// 0).
    pub fn aim(
        &self,
        start_time: f64,
        times: &[f64],
        beams: [&[f32]; 3],
        local_origin: DVec3,
        first: usize,
        rays: &mut RayBatch,
    ) {
        let RayBatch { org_x, org_y, org_z, dir_x, dir_y, dir_z, .. } = rays;
        let (origin, to) = ([org_x, org_y, org_z], [dir_x, dir_y, dir_z]);
        aim::rotate_moving(&self.inner, start_time, times, beams, local_origin.to_array(), first, origin, to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Trajectory;
    use glam::Vec3;

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
                    // glam's slerp uses a straight line for the smallest turns.
                    assert!((direction - pose.orientation * axis).length() < 4e-6, "{roll} {yaw} {time}");
                }
            }
        }
    }
}
