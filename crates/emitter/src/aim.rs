//! Rays from beams: the direction of each beam at the pose of its own time.

use super::{BeamTable, Pose, Trajectory};
use echocast_kernels::aim;
use glam::{DVec3, Mat3, Vec3};
use ground::lanes::{LANES, RayBatch};
use ground::rng::{Draw, Rng};

/// How the beams of one scan are placed in the world.
pub enum Aim<'a> {
    /// The sensor is stationary: one rotation and origin for all beams.
    Fixed {
        /// From the sensor frame to the world.
        rotation: Mat3,
        /// Position of the sensor, relative to the rays' (0, 0, 0), m.
        origin: Vec3,
    },
    /// The sensor moves: the pose is taken from the trajectory at each beam's time.
    Moving {
        /// Where the sensor is over time.
        trajectory: &'a Trajectory,
        /// Time of the trajectory at which the scan starts, s.
        start_time: f64,
        /// World position of the rays' (0, 0, 0), m.
        local_origin: DVec3,
    },
}

impl<'a> Aim<'a> {
    /// `local_origin`: world position of the rays' (0, 0, 0), metres.
    pub fn new(trajectory: &'a Trajectory, start_time: f64, local_origin: DVec3) -> Self {
        match trajectory.constant() {
            Some(pose) => {
                let (rotation, origin) = local(&pose, local_origin);
                Aim::Fixed { rotation, origin }
            }
            None => Aim::Moving { trajectory, start_time, local_origin },
        }
    }

    /// Rotation from the sensor frame to the world and local origin of the sensor for beam `beam`.
    pub fn pose(&self, beams: &BeamTable, beam: usize) -> (Mat3, Vec3) {
        match *self {
            Aim::Fixed { rotation, origin } => (rotation, origin),
            Aim::Moving { trajectory, start_time, local_origin } => {
                local(&trajectory.at(start_time + beams.time[beam]), local_origin)
            }
        }
    }

    /// [`Aim::pose`] at the start of the scan.
    pub fn start(&self) -> (Mat3, Vec3) {
        match *self {
            Aim::Fixed { rotation, origin } => (rotation, origin),
            Aim::Moving { trajectory, start_time, local_origin } => local(&trajectory.at(start_time), local_origin),
        }
    }

    /// Whether the sensor moves.
    pub fn moves(&self) -> bool {
        matches!(self, Aim::Moving { .. })
    }

    /// Velocity of the origin of beam `beam` when it fires, m/s.
    pub fn velocity(&self, beams: &BeamTable, beam: usize) -> Vec3 {
        match *self {
            Aim::Fixed { .. } => Vec3::ZERO,
            Aim::Moving { trajectory, start_time, .. } => {
                let time = start_time + beams.time[beam];
                let mut velocity = trajectory.velocity(time);
                if beams.has_origins() {
                    let arm = trajectory.at(time).orientation * beams.origin(beam).as_dvec3();
                    velocity += trajectory.turning(time).cross(arm);
                }
                velocity.as_vec3()
            }
        }
    }

    /// Origins, directions and farthest ranges of beams `first ..` along `directions` (x, y, z in the sensor frame);
    /// `range_max`, m, where the table has none.
    pub fn rays(&self, beams: &BeamTable, first: usize, directions: [&[f32]; 3], range_max: f32, rays: &mut RayBatch) {
        let count = directions[0].len();
        match beams.range_max.get(first..first + count) {
            Some(limits) => rays.range_max[..count].copy_from_slice(limits),
            None => rays.range_max = [range_max; LANES],
        }
        for (beam, number) in rays.beam[..count].iter_mut().zip(first..) {
            *beam = number as u32;
        }
        self.turn(beams, first, directions, rays);
        if beams.has_origins() {
            // Origins are rotated as directions are.
            let mut arms = RayBatch::default();
            self.turn(beams, first, beams.origin.each_ref().map(|axis| &axis[first..first + count]), &mut arms);
            let starts = [&mut rays.org_x, &mut rays.org_y, &mut rays.org_z];
            for (start, arm) in starts.into_iter().zip(arms.directions()) {
                start[..count].iter_mut().zip(arm).for_each(|(start, arm)| *start += arm);
            }
        }
    }

    /// Sets the origin and direction of `lane` of `rays` to those of the beam `beam`.
    pub fn ray(&self, beams: &BeamTable, beam: usize, lane: usize, rays: &mut RayBatch) {
        let (rotation, mut origin) = self.pose(beams, beam);
        if beams.has_origins() {
            origin += rotation * beams.origin(beam);
        }
        (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = origin.into();
        (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = (rotation * beams.direction(beam)).into();
    }

    /// Origins of the sensor, and vectors `x`, `y`, `z` of its frame rotated into the world as directions, when beams
    /// `first ..` fire.
    fn turn(&self, beams: &BeamTable, first: usize, [x, y, z]: [&[f32]; 3], rays: &mut RayBatch) {
        let count = x.len();
        match self {
            Aim::Fixed { rotation, origin } => {
                rays.org_x = [origin.x; LANES];
                rays.org_y = [origin.y; LANES];
                rays.org_z = [origin.z; LANES];
                let to = [&mut rays.dir_x, &mut rays.dir_y, &mut rays.dir_z];
                aim::rotate(&rotation.to_cols_array_2d(), [x, y, z], to);
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
                    // Neighbours mostly fire within the same motion.
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

/// True directions of `beams` whose reported directions are `nominal` (sensor frame): off by a small Gaussian angle of
/// `sigma` rad in each of the two directions across.
pub fn scatter(rng: &Rng, beams: &[u32], sigma: f32, nominal: [&[f32]; 3], pointed: &mut [[f32; LANES]; 3]) {
    let count = beams.len();
    let mut angles = [[0.0; LANES]; 2];
    for (sub_ray, angles) in (0..).zip(&mut angles) {
        rng.normals(beams, &[sub_ray; LANES][..count], Draw::Pointing, &mut angles[..count]);
    }
    for lane in 0..count {
        let along = Vec3::from(nominal.map(|axis| axis[lane]));
        // Straight up or down, left is not defined: any direction across will do.
        let left = Vec3::Z.cross(along).try_normalize().unwrap_or(Vec3::Y);
        let across = left * angles[0][lane] + along.cross(left) * angles[1][lane];
        let direction = (along + sigma * across).normalize();
        for axis in 0..3 {
            pointed[axis][lane] = direction[axis];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ahead, slanting, straight up: Gaussian in both directions across, with one sigma each, and of length 1.
    #[test]
    fn beams_scatter_around_where_they_point() {
        let sigma = 2e-3;
        for along in [Vec3::X, Vec3::new(-0.6, 0.0, 0.8), Vec3::Z] {
            let columns = along.to_array().map(|value| vec![value; LANES]);
            let (mut pointed, mut sums, blocks) = ([[0.0; LANES]; 3], [0.0; 4], 200);
            for block in 0..blocks {
                let nominal = columns.each_ref().map(|axis| &axis[..]);
                let beams: [u32; LANES] = std::array::from_fn(|lane| block * LANES as u32 + lane as u32);
                scatter(&Rng::new(3, 0), &beams, sigma, nominal, &mut pointed);
                for lane in 0..LANES {
                    let direction = Vec3::from(pointed.map(|axis| axis[lane]));
                    assert!((direction.length() - 1.0).abs() < 2e-7);
                    let left = Vec3::Z.cross(along).try_normalize().unwrap_or(Vec3::Y);
                    let (a, b) = (direction.dot(left) / sigma, direction.dot(along.cross(left)) / sigma);
                    for (sum, value) in sums.iter_mut().zip([a, a * a, b * b, a * b]) {
                        *sum += f64::from(value);
                    }
                }
            }
            // Three standard errors of mean, variances and covariance of normal numbers.
            let n = f64::from(blocks) * LANES as f64;
            for (sum, (expected, spread)) in
                sums.iter().zip([(0.0, 1.0), (1.0, 2f64.sqrt()), (1.0, 2f64.sqrt()), (0.0, 1.0)])
            {
                assert!((sum / n - expected).abs() < 3.0 * spread / n.sqrt(), "{along}: {sums:?}");
            }
        }
    }
}
