//! Where the links are for given positions of the joints.

use crate::robot::{JointKind, Robot, RobotJoint};
use glam::{DAffine3, DQuat, DVec3};
use ground::error::{Error, Result};
use ground::shown;

impl Robot {
    /// The joint positions at which every link is where the file draws it: 0, the `ref` of MJCF's joints, quaternions
    /// without rotation, free links at their poses.
    pub fn rest_positions(&self) -> Vec<f64> {
        let mut all = vec![0.0; self.positions];
        for joint in self.joints.iter().filter(|joint| joint.mimic.is_none()) {
            let own = &mut all[joint.first..][..joint.kind.positions()];
            match joint.kind {
                JointKind::Fixed => {}
                JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => own[0] = joint.rest,
                JointKind::Ball => own[0] = 1.0,
                JointKind::Free => {
                    let (_, turned, place) = self.links[joint.link].parent_from_link.to_scale_rotation_translation();
                    own[..3].copy_from_slice(&place.to_array());
                    own[3..].copy_from_slice(&[turned.w, turned.x, turned.y, turned.z]);
                }
            }
        }
        all
    }

    /// The poses of all links in the frame of the robot, in their order, for all joint positions: radians, metres and
    /// quaternions, as [`JointKind`] says, those of each joint from its index [`RobotJoint::first`] on.
    ///
    /// # Errors
    /// Another number of positions than [`Robot::positions`]; one that is not finite; a quaternion of length 0.
    pub fn link_poses(&self, positions: &[f64]) -> Result<Vec<DAffine3>> {
        let mut poses = Vec::new();
        self.link_poses_into(positions, &mut poses)?;
        Ok(poses)
    }

    /// [`Robot::link_poses`] into the memory of `poses`, whose contents are replaced.
    ///
    /// # Errors
    /// As [`Robot::link_poses`]; `poses` are then as before.
    pub fn link_poses_into(&self, positions: &[f64], poses: &mut Vec<DAffine3>) -> Result<()> {
        self.check_positions(positions)?;
        poses.clear();
        poses.reserve(self.links.len());
        for link in &self.links {
            let mut parent_from_link = link.parent_from_link;
            for joint in link.joints.iter().map(|&joint| &self.joints[joint]) {
                parent_from_link = self.moved(joint, positions, parent_from_link);
            }
            let world_from_parent = link.parent.map_or(DAffine3::IDENTITY, |parent| poses[parent]);
            poses.push(world_from_parent * parent_from_link);
        }
        Ok(())
    }

    /// Checks a vector of all joint positions.
    ///
    /// # Errors
    /// As [`Robot::link_poses`].
    pub fn check_positions(&self, positions: &[f64]) -> Result<()> {
        if positions.len() != self.positions {
            let allowed = format!("{}, those of all joints", self.positions);
            return Err(Error::invalid("the number of joint positions", positions.len(), allowed));
        }
        for joint in self.joints.iter().filter(|joint| joint.positions() > 0) {
            let own = &positions[joint.first..][..joint.positions()];
            let name = || format!("the position of joint {:?}", shown::name(&joint.name));
            if let Some(wrong) = own.iter().find(|number| !number.is_finite()) {
                return Err(Error::invalid(name(), wrong, "finite numbers"));
            }
            let quaternion = match joint.kind {
                JointKind::Ball => own,
                JointKind::Free => &own[3..],
                _ => continue,
            };
            if quaternion.iter().all(|number| *number == 0.0) {
                return Err(Error::invalid(name(), "a quaternion of length 0", "rotations, w first"));
            }
        }
        Ok(())
    }

    /// `parent_from_link` after `joint` has moved the link.
    fn moved(&self, joint: &RobotJoint, positions: &[f64], parent_from_link: DAffine3) -> DAffine3 {
        let own = |index: usize| positions[joint.first + index];
        // How far from rest.
        let by = || match joint.mimic {
            Some(mimic) => mimic.multiplier * positions[self.joints[mimic.joint].first] + mimic.offset - joint.rest,
            None => own(0) - joint.rest,
        };
        let quaternion = |from: usize| {
            let [w, x, y, z] = std::array::from_fn(|k| own(from + k));
            // Scaled first: squares of very small or large numbers would vanish or overflow.
            let largest = [w, x, y, z].into_iter().fold(0.0, |largest: f64, number| largest.max(number.abs()));
            DQuat::from_xyzw(x / largest, y / largest, z / largest, w / largest).normalize()
        };
        let about_anchor =
            |turned: DQuat| DAffine3::from_rotation_translation(turned, joint.anchor - turned * joint.anchor);
        match joint.kind {
            JointKind::Fixed => parent_from_link,
            JointKind::Revolute | JointKind::Continuous => {
                parent_from_link * about_anchor(DQuat::from_axis_angle(joint.axis, by()))
            }
            JointKind::Prismatic => parent_from_link * DAffine3::from_translation(joint.axis * by()),
            JointKind::Ball => parent_from_link * about_anchor(quaternion(0)),
            JointKind::Free => DAffine3::from_rotation_translation(quaternion(3), DVec3::new(own(0), own(1), own(2))),
        }
    }
}
