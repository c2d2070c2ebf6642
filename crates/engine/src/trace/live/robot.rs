//! A robot in an edited scene.

use super::{LiveScene, ObjectId};
use crate::scene::{LoadOptions, Scene};
use glam::DAffine3;
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::shown;
use model::within_reach;
use robots::{Robot, RobotSite};
use std::collections::HashMap;
use std::path::Path;
use std::{fmt, mem};

/// A robot in a [`LiveScene`], whose joints a program sets: each link is an object that may move.
///
/// A clone goes with a clone of its scene.
#[derive(Clone)]
pub struct LiveRobot {
    robot: Robot,
    /// The object of each link that has geometry.
    objects: Vec<Option<ObjectId>>,
    positions: Vec<f64>,
    world_from_base: DAffine3,
    /// Of the links, in the frame of the robot.
    poses: Vec<DAffine3>,
    /// Reused from call to call.
    next_poses: Vec<DAffine3>,
}

impl fmt::Debug for LiveRobot {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("LiveRobot")
            .field("robot", &self.robot.name)
            .field("positions", &self.positions)
            .finish_non_exhaustive()
    }
}

impl LiveRobot {
    /// Reads the URDF, SDF or MJCF at `path` and adds it to `scene`, its frame at `world_from_base`; `options` say where
    /// its joints are and where its meshes may be.
    ///
    /// # Errors
    /// As [`Scene::load`]; a pose that is not finite. The scene is then as before.
    pub fn load(
        scene: &mut LiveScene,
        path: impl AsRef<Path>,
        world_from_base: DAffine3,
        options: &LoadOptions,
    ) -> Result<LiveRobot> {
        let path = path.as_ref();
        check_base(&world_from_base)?;
        let robot = Robot::load(path, &options.of_robots())?;
        let positions = robot.positions_with(&options.joints)?;
        let mut shown = Scene::of_robot(&robot, path, &positions, options)?;
        for object in &mut shown.objects {
            object.world_from_object = world_from_base * object.world_from_object;
        }
        for camera in &mut shown.cameras {
            camera.pose = ground::pose::on(&pose_of(&world_from_base), &camera.pose);
        }
        let links: HashMap<&str, usize> =
            robot.links.iter().enumerate().map(|(index, link)| (link.name.as_str(), index)).collect();
        let mut objects = vec![None; robot.links.len()];
        for (id, object) in scene.add_scene(&shown)?.into_iter().zip(&shown.objects) {
            scene.unfix(id)?;
            if let Some(&link) = links.get(object.name.as_str()) {
                objects[link] = Some(id);
            }
        }
        let poses = robot.link_poses(&positions)?;
        Ok(LiveRobot { robot, objects, positions, world_from_base, poses, next_poses: Vec::new() })
    }

    /// Its links, joints and sensors.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The positions of all joints, as [`Robot::link_poses`] takes them.
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// The object of a link; `None`: it has no geometry, or is hidden.
    pub fn object(&self, link: usize) -> Option<ObjectId> {
        self.objects.get(link).copied().flatten()
    }

    /// Sets the position of the joint called `name`, radians or metres.
    ///
    /// # Errors
    /// A joint that there is not, that follows another, or that takes other than one position; a position that is not
    /// finite; an object that is gone. The robot then stays as it is.
    pub fn set_joint(&mut self, scene: &mut LiveScene, name: &str, position: f64) -> Result<()> {
        let joint = &self.robot.joints[self.robot.joint(name)?];
        if joint.positions() != 1 {
            let what = format!("the position of joint {:?}", shown::name(name));
            let found = format!("one number, and it takes {}", joint.positions());
            return Err(Error::invalid(what, found, "joints that turn or slide; all others by set_joints"));
        }
        let mut positions = self.positions.clone();
        positions[joint.first] = position;
        self.set_joints(scene, &positions)
    }

    /// Sets the positions of all joints, in the order of [`Robot::link_poses`].
    ///
    /// # Errors
    /// As [`Robot::link_poses`]; an object that is gone. The robot then stays as it is.
    pub fn set_joints(&mut self, scene: &mut LiveScene, positions: &[f64]) -> Result<()> {
        let mut poses = mem::take(&mut self.next_poses);
        let result = self.robot.link_poses_into(positions, &mut poses);
        let result = result.and_then(|()| self.place(scene, &poses, self.world_from_base));
        if result.is_ok() {
            self.positions.copy_from_slice(positions);
            mem::swap(&mut self.poses, &mut poses);
        }
        self.next_poses = poses;
        result
    }

    /// Moves the frame of the robot.
    ///
    /// # Errors
    /// A pose that is not finite or reaches beyond 1e18 m; an object that is gone. The robot then stays as it is.
    pub fn set_base(&mut self, scene: &mut LiveScene, world_from_base: DAffine3) -> Result<()> {
        check_base(&world_from_base)?;
        self.place(scene, &self.poses, world_from_base)?;
        self.world_from_base = world_from_base;
        Ok(())
    }

    /// Where the site or sensor called `name` is now: x ahead, z up.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn site_pose(&self, name: &str) -> Result<Pose> {
        let sites = &self.robot.sites;
        let found = sites.iter().find(|site| site.name == name);
        let RobotSite { link, link_from_site, .. } =
            found.ok_or_else(|| Error::missing("site", name, sites.iter().map(|site| &site.name)))?;
        let base_from_link = link.map_or(DAffine3::IDENTITY, |link| self.poses[link]);
        Ok(pose_of(&(self.world_from_base * base_from_link * *link_from_site)))
    }

    /// Moves the objects of links whose poses have changed: all, or none after an error.
    fn place(&self, scene: &mut LiveScene, poses: &[DAffine3], world_from_base: DAffine3) -> Result<()> {
        let is_same_base = world_from_base == self.world_from_base;
        let changed = || {
            let moved = move |link: &usize| !is_same_base || poses[*link] != self.poses[*link];
            let of_link = |link: usize| Some((self.objects[link]?, world_from_base * poses[link]));
            (0..poses.len()).filter(moved).filter_map(of_link)
        };
        changed().try_for_each(|(id, pose)| scene.check_pose(id, &pose))?;
        changed().try_for_each(|(id, pose)| scene.set_pose(id, pose))
    }
}

/// Checks a pose of the frame of a robot.
fn check_base(world_from_base: &DAffine3) -> Result<()> {
    if world_from_base.is_finite() && within_reach(&world_from_base.translation) {
        return Ok(());
    }
    Err(Error::invalid("the pose of the robot", format!("{world_from_base:?}"), "finite numbers from -1e18 to 1e18"))
}

/// A transform without its scale.
fn pose_of(transform: &DAffine3) -> Pose {
    let (_, orientation, position) = transform.to_scale_rotation_translation();
    Pose { position, orientation: orientation.normalize() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::Sensor;
    use crate::trace::Engine;
    use glam::DVec3;
    use std::fs;

    /// Two boxes on a hinge about z at (1, 0, 0), with a LiDAR on the second, and a finger that follows the hinge.
    const DOOR: &str = "<robot name='door'>
        <link name='frame'><visual><geometry><box size='0.1 0.1 2'/></geometry></visual></link>
        <link name='leaf'><visual><origin xyz='0.5 0 0'/><geometry><box size='1 0.05 2'/></geometry></visual></link>
        <link name='knob'><visual><geometry><sphere radius='0.03'/></geometry></visual></link>
        <joint name='hinge' type='revolute'><parent link='frame'/><child link='leaf'/><origin xyz='1 0 0'/>
            <axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='1' velocity='1'/></joint>
        <joint name='slide' type='prismatic'><parent link='leaf'/><child link='knob'/><axis xyz='1 0 0'/>
            <limit lower='0' upper='1' effort='1' velocity='1'/><mimic joint='hinge' multiplier='2' offset='0.1'/></joint>
        <gazebo reference='leaf'><sensor name='lidar' type='gpu_lidar'><pose>1 0 0 0 0 0</pose><lidar>
            <scan><horizontal><samples>3</samples><min_angle>-0.5</min_angle><max_angle>0.5</max_angle></horizontal></scan>
            <range><min>0.1</min><max>30</max></range></lidar></sensor></gazebo>
        </robot>";

    fn door(scene: &mut LiveScene) -> LiveRobot {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("door.urdf");
        fs::write(&path, DOOR).unwrap();
        LiveRobot::load(scene, &path, DAffine3::from_translation(DVec3::Z), &LoadOptions::default()).unwrap()
    }

    fn place(scene: &LiveScene, name: &str) -> DVec3 {
        scene.object(scene.find(name).unwrap()).unwrap().world_from_object.translation
    }

    #[test]
    fn joints_move_links_and_what_is_mounted_on_them() {
        let mut scene = LiveScene::new(&Engine::new().unwrap());
        let mut robot = door(&mut scene);
        assert_eq!(place(&scene, "knob"), DVec3::new(1.1, 0.0, 1.0));
        robot.set_joint(&mut scene, "hinge", std::f64::consts::FRAC_PI_2).unwrap();
        let out = 0.1 + std::f64::consts::PI;
        assert!((place(&scene, "knob") - DVec3::new(1.0, out, 1.0)).length() < 1e-12);
        let lidar = robot.site_pose("lidar").unwrap();
        assert!((lidar.position - DVec3::new(1.0, 1.0, 1.0)).length() < 1e-12);
        assert!((lidar.orientation * DVec3::X - DVec3::Y).length() < 1e-12);
        // All at once, and the robot somewhere else.
        robot.set_joints(&mut scene, &[0.0]).unwrap();
        robot.set_base(&mut scene, DAffine3::from_translation(DVec3::X)).unwrap();
        assert_eq!(place(&scene, "leaf"), DVec3::new(2.0, 0.0, 0.0));
        assert_eq!(place(&scene, "frame"), DVec3::X);
    }

    #[test]
    fn after_an_error_the_robot_stays_as_it_is() {
        let mut scene = LiveScene::new(&Engine::new().unwrap());
        let mut robot = door(&mut scene);
        let before = ["frame", "leaf", "knob"].map(|name| place(&scene, name));
        let fault = robot.set_joint(&mut scene, "hinge", f64::NAN).unwrap_err().to_string();
        assert_eq!(fault, "the position of joint \"hinge\" is NaN; allowed: finite numbers");
        assert!(robot.set_joint(&mut scene, "hing", 0.0).unwrap_err().to_string().contains("near: hinge"));
        assert!(robot.set_joint(&mut scene, "slide", 0.0).unwrap_err().to_string().contains("takes 0"));
        assert!(robot.set_joints(&mut scene, &[0.0; 2]).is_err());
        assert!(robot.set_base(&mut scene, DAffine3::from_translation(DVec3::NAN)).is_err());
        scene.remove(scene.find("knob").unwrap()).unwrap();
        assert!(robot.set_joints(&mut scene, &[0.5]).is_err(), "an object is gone");
        assert_eq!(["frame", "leaf"].map(|name| place(&scene, name)), before[..2]);
        assert_eq!(robot.positions(), [0.0]);
    }

    #[test]
    fn declared_sensors_are_sensors() {
        let mut scene = LiveScene::new(&Engine::new().unwrap());
        let robot = door(&mut scene);
        let spec = robot.robot().sites[0].sensor.as_ref().unwrap().to_string();
        let sensor = Sensor::from_yaml(&spec, "").unwrap();
        assert_eq!(sensor.beams().len(), 3);
        assert_eq!((sensor.spec().range.min_m, sensor.spec().range.max_m), (0.1, Some(30.0)));
        assert_eq!(scene.camera("lidar").unwrap(), robot.site_pose("lidar").unwrap());
    }
}
