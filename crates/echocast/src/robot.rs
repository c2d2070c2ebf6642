//! Robots from URDF, SDF and MJCF: links, the joints that move them, and robots in scenes that are edited.
//!
//! ```no_run
//! use echocast::glam::DAffine3;
//! use echocast::robot::LiveRobot;
//! use echocast::{Engine, LiveScene, LoadOptions, ScanOptions, Sensor, Trajectory};
//!
//! let mut scene = LiveScene::new(&Engine::new()?);
//! let mut robot = LiveRobot::load(&mut scene, "walker.urdf", DAffine3::IDENTITY, &LoadOptions::default())?;
//! let sensor = Sensor::preset("livox_mid360")?;
//! let mut positions = robot.positions().to_vec();
//! for step in 0..100 {
//!     positions.fill(0.01 * f64::from(step));
//!     robot.set_joints(&mut scene, &positions)?;
//!     let place = Trajectory::fixed(robot.site_pose("lidar")?);
//!     let cloud = scene.commit()?.scan(&sensor, &place, &ScanOptions::default().frame(step))?;
//! }
//! # Ok::<(), echocast::Error>(())
//! ```

#[doc(inline)]
pub use engine::trace::LiveRobot;
#[doc(inline)]
pub use robots::{
    GeometryUse, JointKind, JointMimic, LinkGeometry, LinkShape, Robot, RobotJoint, RobotLink, RobotOptions, RobotSite,
    primitive_mesh,
};
