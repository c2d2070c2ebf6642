//! Rays from beams: the direction of each beam at the pose of its own time.

use super::{BeamTable, Pose, Trajectory};
use crate::trace::{LANES, RayBatch};
use glam::{DVec3, Mat3, Vec3};

/// How the beams of one scan are put into the world.
pub(crate) enum Aim<'a> {
    /// The sensor stands: one rotation and origin for all beams.
    Fixed { rotation: Mat3, origin: Vec3 },
    /// The sensor moves: the pose is taken from the trajectory at each beam's time.
    Moving { trajectory: &'a Trajectory, start_time: f64, local_origin: DVec3 },
}

impl<'a> Aim<'a> {
    /// `local_origin`: world position of the rays' (0, 0, 0), metres.
    pub(crate) fn new(trajectory: &'a Trajectory, start_time: f64, local_origin: DVec3) -> Self {
        match trajectory.constant() {
            Some(pose) => {
                let (rotation, origin) = local(&pose, local_origin);
                Aim::Fixed { rotation, origin }
            }
            None => Aim::Moving { trajectory, start_time, local_origin },
        }
    }

    /// Rotation from the sensor frame to the world and local origin of the sensor for beam `beam`.
    #[inline(always)]
    pub(crate) fn pose(&self, beams: &BeamTable, beam: usize) -> (Mat3, Vec3) {
        match *self {
            Aim::Fixed { rotation, origin } => (rotation, origin),
            Aim::Moving { trajectory, start_time, local_origin } => {
                local(&trajectory.at(start_time + beams.time[beam]), local_origin)
            }
        }
    }

    /// Origins, directions and farthest ranges of beams `first .. first + count`; `range_max`, m, where the table has
    /// none.
    #[inline(always)]
    pub(crate) fn rays(&self, beams: &BeamTable, first: usize, count: usize, range_max: f32, rays: &mut RayBatch) {
        let range = first..first + count;
        match beams.range_max.get(range.clone()) {
            Some(limits) => rays.range_max[..count].copy_from_slice(limits),
            None => rays.range_max = [range_max; LANES],
        }
        let (x, y, z) = (&beams.dir_x[range.clone()], &beams.dir_y[range.clone()], &beams.dir_z[range]);
        match self {
            Aim::Fixed { rotation, origin } => {
                rays.org_x = [origin.x; LANES];
                rays.org_y = [origin.y; LANES];
                rays.org_z = [origin.z; LANES];
                let [cx, cy, cz] = [rotation.x_axis, rotation.y_axis, rotation.z_axis];
                for lane in 0..count {
                    rays.dir_x[lane] = cx.x * x[lane] + cy.x * y[lane] + cz.x * z[lane];
                    rays.dir_y[lane] = cx.y * x[lane] + cy.y * y[lane] + cz.y * z[lane];
                    rays.dir_z[lane] = cx.z * x[lane] + cy.z * y[lane] + cz.z * z[lane];
                }
            }
            Aim::Moving { trajectory, start_time, local_origin } => {
                let mut lane = 0;
                while lane < count {
                    let Some(motion) = trajectory.motion(start_time + beams.time[first + lane]) else {
                        let (rotation, origin) = self.pose(beams, first + lane);
                        let direction = rotation * Vec3::new(x[lane], y[lane], z[lane]);
                        (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = origin.into();
                        (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = direction.into();
                        lane += 1;
                        continue;
                    };
                    // Neighbours mostly fire during the same motion.
                    let times = &beams.time[first + lane..first + count];
                    let lanes = times.iter().take_while(|&time| motion.covers(start_time + time)).count();
                    let beams = [&x[lane..], &y[lane..], &z[lane..]];
                    motion.aim(*start_time, &times[..lanes], beams, *local_origin, lane, rays);
                    lane += lanes;
                }
            }
        }
    }
}

fn local(pose: &Pose, local_origin: DVec3) -> (Mat3, Vec3) {
    (pose.rotation().as_mat3(), (pose.position - local_origin).as_vec3())
}
