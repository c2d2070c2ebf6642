//! Sensor poses.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Position and orientation of a sensor: `world_from_sensor`, sensor x forward, y left, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position in the world, metres.
    pub position: DVec3,
    /// Rotation from the sensor frame to the world frame, unit.
    pub orientation: DQuat,
}

impl Default for Pose {
    fn default() -> Self {
        Pose::IDENTITY
    }
}

impl Pose {
    /// At the world's origin, axes parallel to the world's.
    pub const IDENTITY: Pose = Pose { position: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// At `x`, `y`, `z` metres, axes parallel to the world's.
    pub fn at(x: f64, y: f64, z: f64) -> Pose {
        Pose { position: DVec3::new(x, y, z), orientation: DQuat::IDENTITY }
    }

    /// Same position, with the orientation of the quaternion `x`, `y`, `z`, `w`: the real part last, the order of ROS
    /// and of TUM files. It is normalised; one of length 0 is refused by whatever takes the pose.
    #[must_use]
    pub fn with_quaternion(self, x: f64, y: f64, z: f64, w: f64) -> Pose {
        Pose { orientation: DQuat::from_xyzw(x, y, z, w).normalize(), ..self }
    }

    /// Same position, rotated by roll (about x), then pitch (about y), then yaw (about z), degrees, each about the
    /// world's fixed axes (ROS: `Rz(yaw) Ry(pitch) Rx(roll)`).
    #[must_use]
    pub fn with_rpy_deg(self, roll: f64, pitch: f64, yaw: f64) -> Pose {
        let orientation = DQuat::from_rotation_z(yaw.to_radians())
            * DQuat::from_rotation_y(pitch.to_radians())
            * DQuat::from_rotation_x(roll.to_radians());
        Pose { orientation, ..self }
    }

    /// Pose of a camera from its node transform; the camera looks along its own -z with +y up.
    ///
    /// Scale and shear of the node are ignored.
    pub fn from_camera_node(world_from_node: &DAffine3) -> Pose {
        let back = world_from_node.matrix3.z_axis.normalize_or(DVec3::Z);
        let up = world_from_node.matrix3.y_axis;
        let x = -back;
        let z = (up - x * up.dot(x)).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
        let orientation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
        Pose { position: world_from_node.translation, orientation }
    }

    /// Rotation matrix from the sensor frame to the world frame.
    pub fn rotation(&self) -> DMat3 {
        DMat3::from_quat(self.orientation)
    }

    /// Heading clockwise from y (north), 0 to 360, pitch (nose up) and roll (to starboard), degrees: a ship's angles,
    /// each about the axis as rotated by the previous one.
    #[doc(hidden)]
    pub fn ship_angles(&self) -> [f64; 3] {
        let [ahead, port, up] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| self.orientation * axis);
        let heading = ahead.x.atan2(ahead.y).to_degrees().rem_euclid(360.0);
        [heading, ahead.z.clamp(-1.0, 1.0).asin().to_degrees(), port.z.atan2(up.z).to_degrees()]
    }
}

/// World pose of what is mounted at `mount` on a carrier that is at `carrier`.
pub fn on(carrier: &Pose, mount: &Pose) -> Pose {
    Pose {
        position: carrier.position + carrier.orientation * mount.position,
        orientation: (carrier.orientation * mount.orientation).normalize(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DVec3, b: DVec3) {
        assert!((a - b).length() < 1e-12, "{a} is not {b}");
    }

    #[test]
    fn angles_turn_about_fixed_axes() {
        let pose = Pose::IDENTITY.with_rpy_deg(0.0, 0.0, 90.0);
        close(pose.orientation * DVec3::X, DVec3::Y);
        let pose = Pose::IDENTITY.with_rpy_deg(0.0, 30.0, 0.0);
        // Positive pitch, about +y (left), is nose down.
        close(pose.orientation * DVec3::X, DVec3::new(30f64.to_radians().cos(), 0.0, -0.5));
        let pose = Pose::IDENTITY.with_rpy_deg(90.0, 0.0, 90.0);
        close(pose.orientation * DVec3::Z, DVec3::X);
    }

    #[test]
    fn ship_angles_are_clockwise_from_north_nose_up_and_to_starboard() {
        let ship = Pose::IDENTITY.with_rpy_deg(4.0, -3.0, 90.0 - 350.0);
        let found = ship.ship_angles();
        assert!(found.iter().zip([350.0, 3.0, 4.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert_eq!(Pose::IDENTITY.ship_angles(), [90.0, 0.0, 0.0]);
    }

    #[test]
    fn quaternions_have_their_real_part_last() {
        let half = 2.0 * 0.5f64.sqrt();
        let pose = Pose::at(1.0, 2.0, 3.0).with_quaternion(0.0, 0.0, half, half);
        close(pose.orientation * DVec3::X, DVec3::Y);
        close(pose.position, DVec3::new(1.0, 2.0, 3.0));
        assert!(pose.orientation.is_normalized());
        assert!(!Pose::IDENTITY.with_quaternion(0.0, 0.0, 0.0, 0.0).orientation.is_finite());
    }

    #[test]
    fn cameras_look_along_their_negative_z() {
        let pose = Pose::from_camera_node(&DAffine3::IDENTITY);
        close(pose.orientation * DVec3::X, DVec3::NEG_Z);
        close(pose.orientation * DVec3::Z, DVec3::Y);
        close(pose.orientation * DVec3::Y, DVec3::NEG_X);
    }
}
