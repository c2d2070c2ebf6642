//! Camera nodes: places in the scene for a sensor.

use super::Scene;
use emitter::Trajectory;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use ground::error::{Error, Result};
use ground::pose::Pose;

/// Half of what [`Scene::camera_path`] guarantees, since it is checked at some times only.
const TOLERANCE_RAD: f64 = 0.5e-4;
const TOLERANCE_M: f64 = 0.05e-3;

/// Where an interval between two keys is checked, as fractions of its length: unevenly spaced, so that no rotation or
/// oscillation escapes all of them.
const CHECKED: [f64; 5] = [0.11, 0.29, 0.5, 0.73, 0.9];

/// How long a jump takes, s: a trajectory has one pose at a time.
const JUMP_S: f64 = 1e-6;

/// Maximum number of poses of a trajectory.
const MOST_KEYS: usize = 1_000_000;

impl Scene {
    /// The trajectory of the camera node called `name` from time `from` to `to`, s, as the animations move it; poses
    /// between its keys are accurate to 0.1 mrad and 0.1 mm. A jump takes a microsecond, and ends at the time of the
    /// jump.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names; times that are not finite or decrease; more than a million keys.
    pub fn camera_path(&self, name: &str, from: f64, to: f64) -> Result<Trajectory> {
        let camera = self.camera(name)?;
        let pose = |world_from_node: &DAffine3| Pose::from_camera_node(world_from_node);
        match camera.node {
            None => Ok(Trajectory::fixed(camera.pose)),
            Some(node) => self.path_of(node, from, to, pose),
        }
    }

    /// The trajectory of the first object called `name`, likewise: the x axis of the pose is that of the object, its z
    /// axis the object's up direction.
    ///
    /// # Errors
    /// As [`Scene::camera_path`].
    pub fn object_path(&self, name: &str, from: f64, to: f64) -> Result<Trajectory> {
        let object = self.objects.iter().find(|object| object.name == name);
        let object =
            object.ok_or_else(|| Error::missing("object", name, self.objects.iter().map(|object| &object.name)))?;
        let pose = |world_from_object: &DAffine3| {
            let DMat3 { x_axis, z_axis: up, .. } = object.up.upright(&world_from_object.matrix3);
            let x = x_axis.normalize_or(DVec3::X);
            let z = (up - x * up.dot(x)).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
            let orientation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
            Pose { position: world_from_object.translation, orientation }
        };
        match &object.motion {
            None => Ok(Trajectory::fixed(pose(&object.world_from_object))),
            Some(motion) => self.path_of(motion.node, from, to, |node| pose(&(*node * motion.node_from_object))),
        }
    }

    /// The trajectory of the pose that `pose_on` derives from a node of the timeline.
    fn path_of(&self, node: usize, from: f64, to: f64, pose_on: impl Fn(&DAffine3) -> Pose) -> Result<Trajectory> {
        if !(from.is_finite() && to.is_finite() && from <= to) {
            return Err(Error::invalid("times of the camera path", format!("{from} to {to} s"), "rising finite times"));
        }
        let pose = |time: f64| pose_on(&self.timeline.world_from_node(node, time));
        let too_many = || {
            let found = format!("{from} to {to} s, which takes more than {MOST_KEYS} poses");
            Error::invalid("times of the camera path", found, "a shorter time")
        };
        // NaN fails this comparison, too.
        let few = self.timeline.most_bends(node, from, to) <= 4.0 * MOST_KEYS as f64;
        if !few {
            return Err(too_many());
        }
        let mut bends = vec![from, to];
        self.timeline.bends(node, from, to, &mut bends);
        bends.sort_by(f64::total_cmp);
        bends.dedup();

        let mut keys = vec![(from, pose(from))];
        let mut stretches = Vec::new();
        for ends in bends.windows(2) {
            let (start, end) = (ends[0], ends[1]);
            let before = end - JUMP_S;
            if before > start && !near(&pose(before), &pose(end)) {
                stretches.push((before, end));
                stretches.push((start, before));
            } else {
                stretches.push((start, end));
            }
            while let Some((start, end)) = stretches.pop() {
                let (first, last) = (pose(start), pose(end));
                let straight = Trajectory::new(vec![(start, first), (end, last)])?;
                let times = CHECKED.map(|part| start + part * (end - start));
                if end - start <= 2.0 * JUMP_S || times.iter().all(|&time| near(&straight.at(time), &pose(time))) {
                    keys.push((end, last));
                } else {
                    let middle = 0.5 * (start + end);
                    stretches.push((middle, end));
                    stretches.push((start, middle));
                }
                if keys.len() > MOST_KEYS {
                    return Err(too_many());
                }
            }
        }
        Trajectory::new(keys)
    }
}

fn near(a: &Pose, b: &Pose) -> bool {
    a.position.distance(b.position) <= TOLERANCE_M && a.orientation.angle_between(b.orientation) <= TOLERANCE_RAD
}
