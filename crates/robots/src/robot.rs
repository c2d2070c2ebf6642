//! A robot, or a world of them, as plain structures: links, the joints that move them, their geometry, their sensors.

use glam::{DAffine3, DVec3};
use ground::error::{Error, Result};
use ground::named;
use ground::report::Report;
use ground::shown;
use model::material::Material;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Which geometry of links is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum GeometryUse {
    /// What is to be seen: `<visual>`; of MJCF the geoms of the groups 0 to 2, which its viewer shows by default.
    #[default]
    Visual,
    /// What may be touched: `<collision>`; of MJCF the geoms whose `contype` or `conaffinity` is not 0.
    Collision,
}

named! { GeometryUse: Visual "visual", Collision "collision" }

/// What a joint lets its link do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum JointKind {
    /// Nothing; it has no position.
    Fixed,
    /// Turn about the axis; one position, radians.
    Revolute,
    /// Turn about the axis without end; one position, radians.
    Continuous,
    /// Slide along the axis; one position, metres.
    Prismatic,
    /// Turn about the anchor; four positions, a quaternion w, x, y, z, which is normalised.
    Ball,
    /// Be anywhere in its parent; seven positions, x, y, z in metres and a quaternion w, x, y, z.
    Free,
}

impl JointKind {
    /// How many positions a joint has.
    pub fn positions(self) -> usize {
        match self {
            JointKind::Fixed => 0,
            JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => 1,
            JointKind::Ball => 4,
            JointKind::Free => 7,
        }
    }
}

/// A joint whose position is another's: `multiplier * position + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMimic {
    /// Index of the other joint, which is no mimic itself.
    pub joint: usize,
    /// Factor.
    pub multiplier: f64,
    /// Added, radians or metres.
    pub offset: f64,
}

/// What moves a link in its parent.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RobotJoint {
    /// Its name; of SDF, and of several models in a world, behind the name of its model, `cart::wheel_joint`.
    pub name: String,
    /// What it lets the link do.
    pub kind: JointKind,
    /// Index of the link that it moves.
    pub link: usize,
    /// Point of the axis in the frame of the link, metres.
    pub anchor: DVec3,
    /// Unit axis in the frame of the link.
    pub axis: DVec3,
    /// Lowest and highest position that the file allows, radians or metres; poses beyond them are computed as well.
    pub limits: Option<[f64; 2]>,
    /// The position at which the link is where [`RobotLink::parent_from_link`] says, radians or metres.
    pub rest: f64,
    /// Whose position it follows; it has none of its own then.
    pub mimic: Option<JointMimic>,
    /// Index of its first position in the vector of all.
    pub first: usize,
}

impl RobotJoint {
    /// A joint of `link` whose axis is x through the origin of the link.
    pub(crate) fn new(name: impl Into<String>, kind: JointKind, link: usize) -> RobotJoint {
        let name = name.into();
        let (anchor, axis) = (DVec3::ZERO, DVec3::X);
        RobotJoint { name, kind, link, anchor, axis, limits: None, rest: 0.0, mimic: None, first: 0 }
    }

    /// How many positions it has in the vector of all.
    pub fn positions(&self) -> usize {
        if self.mimic.is_some() { 0 } else { self.kind.positions() }
    }
}

/// The shape of a piece of geometry, in a frame of its own.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LinkShape {
    /// A mesh of a file.
    Mesh {
        /// Where it is.
        path: PathBuf,
        /// Factors along its axes, none 0; a negative one mirrors.
        scale: DVec3,
        /// Frame of the geometry from that of the scaled mesh.
        from_mesh: DAffine3,
        /// The only object of the file that counts; `None`: all.
        only: Option<String>,
    },
    /// A box around the origin.
    Box {
        /// Its edges, metres.
        size: DVec3,
    },
    /// A ball around the origin.
    Sphere {
        /// Metres.
        radius: f64,
    },
    /// A closed cylinder around the origin, along z.
    Cylinder {
        /// Metres.
        radius: f64,
        /// Metres.
        length: f64,
    },
    /// A cylinder around the origin, along z, with half balls at its ends.
    Capsule {
        /// Metres.
        radius: f64,
        /// Of the cylinder alone, metres.
        length: f64,
    },
    /// An ellipsoid around the origin.
    Ellipsoid {
        /// Half its extent along each axis, metres.
        radii: DVec3,
    },
    /// A rectangle around the origin, z up.
    Plane {
        /// Its edges, metres.
        size: [f64; 2],
    },
}

/// A piece of geometry of a link.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LinkGeometry {
    /// Where it is in the link.
    pub link_from_geometry: DAffine3,
    /// What it is.
    pub shape: LinkShape,
    /// What it is made of.
    pub material: Option<Arc<Material>>,
    /// Whether that also replaces what the file of a mesh says.
    pub replaces: bool,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RobotLink {
    /// Its name; of SDF, and of several models in a world, behind the names of its models, `house::door`.
    pub name: String,
    /// The model that it belongs to.
    pub model: String,
    /// Index of the link that it hangs on, which comes before it; `None`: the world.
    pub parent: Option<usize>,
    /// Its pose in its parent while its joints are at rest.
    pub parent_from_link: DAffine3,
    /// Indices of the joints that move it, in the order in which they do.
    pub joints: Vec<usize>,
    /// Its geometry.
    pub geometry: Vec<LinkGeometry>,
}

impl RobotLink {
    /// A link without parent, joint or geometry.
    pub(crate) fn new(name: impl Into<String>, model: impl Into<String>) -> RobotLink {
        RobotLink {
            name: name.into(),
            model: model.into(),
            parent: None,
            parent_from_link: DAffine3::IDENTITY,
            joints: Vec::new(),
            geometry: Vec::new(),
        }
    }
}

/// A place on a link for a sensor.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RobotSite {
    /// Its name, as that of a link.
    pub name: String,
    /// Index of its link; `None`: the world.
    pub link: Option<usize>,
    /// Its pose in the link: x ahead, z up.
    pub link_from_site: DAffine3,
    /// The sensor that the file declares there, as a sensor file in JSON; `None`: a place alone (a `site` of MJCF).
    pub sensor: Option<Value>,
}

/// A robot, or all models of a world.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Its links, each after the one it hangs on.
    pub links: Vec<RobotLink>,
    /// Its joints, in the order of the file.
    pub joints: Vec<RobotJoint>,
    /// Places for sensors, and the sensors that the file declares.
    pub sites: Vec<RobotSite>,
    /// How long the vector of all joint positions is.
    pub positions: usize,
    /// What was left out.
    pub report: Report,
}

impl Robot {
    /// The index of the link called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn link(&self, name: &str) -> Result<usize> {
        let found = self.links.iter().position(|link| link.name == name);
        found.ok_or_else(|| Error::missing("link", name, self.links.iter().map(|link| &link.name)))
    }

    /// The index of the joint called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn joint(&self, name: &str) -> Result<usize> {
        let found = self.joints.iter().position(|joint| joint.name == name);
        found.ok_or_else(|| Error::missing("joint", name, self.joints.iter().map(|joint| &joint.name)))
    }

    /// Checks and orders what a reader of `path` has found: links before those that hang on them, positions numbered in
    /// the order of the joints, mimics that follow mimics resolved.
    ///
    /// # Errors
    /// Two links or joints of one name, links that hang on each other, joints that mimic each other.
    pub(crate) fn finished(mut self, path: &Path) -> Result<Robot> {
        let of_links = self.links.iter().map(|link| link.name.as_str());
        let of_joints = self.joints.iter().map(|joint| joint.name.as_str());
        for (what, twice) in [("link", twice(of_links)), ("joint", twice(of_joints))] {
            if let Some(name) = twice {
                let message = format!("there are two {what}s named {:?}; allowed: one of each name", shown::name(name));
                return Err(Error::parse(path, "", message));
            }
        }
        self.order(path)?;
        self.resolve_mimics(path)?;
        for joint in &mut self.joints {
            joint.first = self.positions;
            self.positions += joint.positions();
        }
        Ok(self)
    }

    /// Sorts the links so that each is after the one it hangs on, and otherwise as they were.
    fn order(&mut self, path: &Path) -> Result<()> {
        let mut below = vec![Vec::new(); self.links.len()];
        let mut open = Vec::new();
        for (index, link) in self.links.iter().enumerate() {
            match link.parent {
                Some(parent) => below[parent].push(index),
                None => open.push(index),
            }
        }
        let mut place = vec![usize::MAX; self.links.len()];
        open.reverse();
        let mut count = 0;
        while let Some(index) = open.pop() {
            place[index] = count;
            count += 1;
            open.extend(below[index].iter().rev());
        }
        if let Some(index) = place.iter().position(|&place| place == usize::MAX) {
            // Above a link without a place there is a circle.
            let mut on_circle = index;
            for _ in 0..self.links.len() {
                on_circle = self.links[on_circle].parent.unwrap_or(on_circle);
            }
            let name = shown::name(&self.links[on_circle].name).to_string();
            let message = format!("link {name:?} hangs on itself by a circle of joints; allowed: a tree");
            return Err(Error::parse(path, "", message));
        }
        let mut sorted: Vec<(usize, RobotLink)> = place.iter().copied().zip(self.links.drain(..)).collect();
        sorted.sort_by_key(|(place, _)| *place);
        self.links = sorted.into_iter().map(|(_, link)| link).collect();
        self.links.iter_mut().for_each(|link| link.parent = link.parent.map(|parent| place[parent]));
        self.joints.iter_mut().for_each(|joint| joint.link = place[joint.link]);
        self.sites.iter_mut().for_each(|site| site.link = site.link.map(|link| place[link]));
        Ok(())
    }

    /// Lets every mimic follow a joint that is none.
    fn resolve_mimics(&mut self, path: &Path) -> Result<()> {
        for index in 0..self.joints.len() {
            let Some(mut mimic) = self.joints[index].mimic else { continue };
            let mut steps = 0;
            while let Some(next) = self.joints[mimic.joint].mimic {
                // q = m (m' q' + o') + o.
                let offset = mimic.multiplier * next.offset + mimic.offset;
                mimic = JointMimic { joint: next.joint, multiplier: mimic.multiplier * next.multiplier, offset };
                steps += 1;
                if steps > self.joints.len() {
                    let name = shown::name(&self.joints[index].name).to_string();
                    let message = format!("joint {name:?} mimics itself; allowed: to mimic a joint with a position");
                    return Err(Error::parse(path, "", message));
                }
            }
            if self.joints[mimic.joint].kind.positions() != 1 || self.joints[index].kind.positions() != 1 {
                let name = shown::name(&self.joints[index].name).to_string();
                let message = format!(
                    "joint {name:?} mimics {:?}; allowed: joints that turn or slide",
                    shown::name(&self.joints[mimic.joint].name)
                );
                return Err(Error::parse(path, "", message));
            }
            self.joints[index].mimic = Some(mimic);
        }
        Ok(())
    }
}

/// The first name that comes twice; names that are empty do not count.
fn twice<'n>(names: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let mut known = HashMap::new();
    names.filter(|name| !name.is_empty()).find(|name| known.insert(*name, ()).is_some())
}
