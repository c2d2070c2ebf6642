//! Poses of instances and sensors.

use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::text;
use echocast::Pose;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Points are in the world frame.
pub const ECHOCAST_COORDINATES_WORLD: i32 = 0;
/// Points are in the sensor frame at the time of their own firing, as a driver reports them.
pub const ECHOCAST_COORDINATES_SENSOR: i32 = 1;

/// A placement: the upper three rows of the 4x4 matrix, row after row, that takes points of the child (an instance, a
/// sensor) to the parent (the world); the fourth column is the position in metres. Instances may be scaled, sheared and
/// mirrored; sensors are only rotated and translated.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_pose {
    /// Row after row.
    pub m: [f64; 12],
}

/// A pose at a time.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_pose_key {
    /// Time, ns.
    pub t_ns: i64,
    /// Where the sensor or instance is at that time, in the world.
    pub pose: echocast_pose,
}

impl echocast_pose {
    pub(crate) const IDENTITY: echocast_pose =
        echocast_pose { m: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0] };

    fn affine(&self) -> DAffine3 {
        let column = |c: usize| DVec3::new(self.m[c], self.m[4 + c], self.m[8 + c]);
        DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
    }

    /// As the placement of an instance.
    pub(crate) fn placement(&self, name: &str) -> Outcome<DAffine3> {
        if self.m == [0.0; 12] {
            return Err(Failure::argument(name, "all 0", "a matrix, such as ECHOCAST_POSE_IDENTITY"));
        }
        Ok(self.affine())
    }

    /// As the pose of a sensor.
    pub(crate) fn rigid(&self, name: &str) -> Outcome<Pose> {
        /// Tolerance of the entries of the rotation: one made from a quaternion in single precision passes.
        const TOLERANCE: f64 = 1e-4;
        let DAffine3 { matrix3, translation } = self.placement(name)?;
        let product = matrix3.transpose() * matrix3;
        let is_rotation = product.abs_diff_eq(DMat3::IDENTITY, TOLERANCE) && matrix3.determinant() > 0.0;
        if !is_rotation || !translation.is_finite() {
            let allowed = "finite numbers, a rotation and a position: the axes of a sensor are of length 1, at right angles and right-handed";
            return Err(Failure::argument(name, format!("{:?}", self.m), allowed));
        }
        Ok(Pose { position: translation, orientation: DQuat::from_mat3(&matrix3).normalize() })
    }

    pub(crate) fn of(pose: &Pose) -> echocast_pose {
        echocast_pose::of_placement(&DAffine3 { matrix3: pose.rotation(), translation: pose.position })
    }

    pub(crate) fn of_placement(placement: &DAffine3) -> echocast_pose {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = placement.matrix3;
        let p = placement.translation;
        echocast_pose { m: [x.x, y.x, z.x, p.x, x.y, y.y, z.y, p.y, x.z, y.z, z.z, p.z] }
    }
}

/// Makes a pose from a position, metres, and a unit quaternion x, y, z, w: the real part last, as in ROS. The
/// quaternion is normalised.
///
/// Errors: ECHOCAST_E_ARGUMENT (numbers that are not finite, a quaternion whose length is not near 1). Any thread may
/// call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pose_from_quaternion(
    position: *const f64,
    xyzw: *const f64,
    pose: *mut echocast_pose,
) -> echocast_status {
    guard(|| {
        // SAFETY: `pose` is an output (see `text`).
        let pose = unsafe { text::output(pose, "pose") }?;
        // SAFETY: `position` and `xyzw` are arrays of three and four numbers (see `text`).
        let (p, q) = unsafe { (text::array(position, 3, "position")?, text::array(xyzw, 4, "xyzw")?) };
        if !p.iter().all(|x| x.is_finite()) {
            return Err(Failure::argument("position", format!("{p:?}"), "finite numbers"));
        }
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        // A quaternion that was rounded to single precision or averaged passes; one that was never filled in does not.
        if !(0.9..=1.1).contains(&length) {
            return Err(Failure::argument("xyzw", format!("{q:?}"), "x, y, z, w of a unit quaternion"));
        }
        pose.write(echocast_pose::of(&Pose::at(p[0], p[1], p[2]).with_quaternion(q[0], q[1], q[2], q[3])));
        Ok(())
    })
}
