//! Robots and their worlds from URDF, SDF and MJCF: links, the joints that move them, their geometry, and the sensors
//! that the files declare.
//!
//! All three formats become one [`Robot`]: a tree of links, each with the joints that move it in its parent, whose
//! poses follow from one vector of joint positions ([`Robot::link_poses`]). [`Robot::scene`] makes a scene of it, an
//! object for each link.
#![forbid(unsafe_code)]

mod folders;
mod kinematics;
mod mjcf;
mod primitive;
mod robot;
mod scene;
mod sdf;
mod shapes;
mod spec;
#[cfg(test)]
mod tests;
mod urdf;

pub use primitive::primitive_mesh;
pub use robot::{GeometryUse, JointKind, JointMimic, LinkGeometry, LinkShape, Robot, RobotJoint, RobotLink, RobotSite};

use folders::ModelFolders;
use ground::builder;
use ground::error::{Error, Result};
use ground::read::Limit;
use ground::read::xml::{Xml, XmlText};
use ground::shown;
use model::RawScene;
use model::material::TextureBudget;
use scene_files::{FileOptions, SceneFormat};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

builder! {
    /// How to read a robot.
    #[derive(Clone, Debug)]
    pub struct RobotOptions {
        /// Which geometry of links counts.
        pub geometry: GeometryUse = GeometryUse::Visual,
        /// Folders of packages and models, in which what robots name may be besides their own folder.
        pub model_paths: Vec<PathBuf> = Vec::new(),
        /// Whether what they name may be anywhere.
        pub allow_outside_paths: bool = false,
        /// Positions of joints by name, radians or metres, where they are not at rest.
        pub joints: BTreeMap<String, f64> = BTreeMap::new(),
    }
}

/// The kinds of files of robots. Which one a file is of, its outermost element says, not its name.
pub const ROBOT_FORMATS: &[SceneFormat] = &[
    SceneFormat {
        name: "urdf",
        extensions: &["urdf"],
        description: "URDF of robots: links with visual or collision geometry, joints, meshes by package://",
        read: read_at_rest,
    },
    SceneFormat {
        name: "sdf",
        extensions: &["sdf", "world"],
        description: "SDF of Gazebo: worlds and models, included ones, frames, joints, sensors, meshes by model://",
        read: read_at_rest,
    },
    SceneFormat {
        name: "mjcf",
        extensions: &["xml", "mjcf"],
        description: "MJCF of MuJoCo: bodies, geoms, joints, defaults, meshes, sites, rangefinders",
        read: read_at_rest,
    },
];

/// Whether the name of `path` is that of a robot.
pub fn is_robot(path: &Path) -> bool {
    ROBOT_FORMATS.iter().any(|format| format.reads(path))
}

/// Reads the robot at `path` as a scene, its joints at rest.
fn read_at_rest(path: &Path, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    let own = RobotOptions { allow_outside_paths: options.allow_outside_paths, ..RobotOptions::default() };
    read_scene(path, &own, images)
}

impl Robot {
    /// Reads the URDF, SDF or MJCF at `path`.
    ///
    /// # Errors
    /// A missing or damaged file; what is missing, not a number or not allowed, with its line; files that it names and
    /// that are not there, with the paths searched; two links of one name; joints in a circle.
    pub fn load(path: impl AsRef<Path>, options: &RobotOptions) -> Result<Robot> {
        let path = path.as_ref();
        let text = XmlText::load(path, Limit::XML)?;
        let document = text.parse()?;
        let root = Xml::root(&document, &text);
        let folders = ModelFolders { given: &options.model_paths, anywhere: options.allow_outside_paths };
        match root.name() {
            "robot" => urdf::read(root, folders, options.geometry),
            "sdf" => sdf::read(root, folders, options.geometry),
            "mujoco" => mjcf::read(root, folders, options.geometry),
            other => {
                let message = format!(
                    "the outermost element is {:?}; allowed: robot (URDF), sdf, mujoco (MJCF)",
                    shown::name(other)
                );
                Err(Error::parse(path, format!("line {}", root.line()), message))
            }
        }
    }
}

/// Reads the robot or the world at `path` as a scene.
///
/// # Errors
/// As [`Robot::load`] and [`Robot::scene`].
pub fn read_scene(path: &Path, options: &RobotOptions, images: &mut TextureBudget) -> Result<RawScene> {
    let robot = Robot::load(path, options)?;
    let positions = robot.positions_with(&options.joints)?;
    robot.scene(path, &positions, options, images)
}
