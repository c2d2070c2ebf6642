//! URDF, as <http://wiki.ros.org/urdf/XML> specifies it.

use crate::folders::ModelFolders;
use crate::robot::{
    GeometryUse, JointKind, JointMimic, LinkGeometry, LinkShape, Robot, RobotJoint, RobotLink, RobotSite,
};
use crate::sdf::pose::pose_of;
use crate::shapes::{checked_axis, checked_scale, colored, from_rpy, size_of_shape};
use crate::spec;
use glam::{DAffine3, DVec3};
use ground::error::Result;
use ground::read::xml::Xml;
use ground::shown;
use model::material::Material;
use std::collections::HashMap;
use std::sync::Arc;

/// A reader of one URDF.
struct UrdfReader<'d, 'o> {
    folders: ModelFolders<'o>,
    geometry: GeometryUse,
    /// The colours that names stand for.
    materials: HashMap<&'d str, Arc<Material>>,
    robot: Robot,
    /// Links by name.
    links: HashMap<&'d str, usize>,
}

/// Reads the URDF whose outermost element is `root`.
///
/// # Errors
/// What is missing, not a number or not allowed, with its line; a mesh that is not there.
pub(crate) fn read(root: Xml<'_>, folders: ModelFolders<'_>, geometry: GeometryUse) -> Result<Robot> {
    let name = root.attribute("name").unwrap_or_default();
    let robot = Robot { name: name.to_owned(), ..Robot::default() };
    let mut reader = UrdfReader { folders, geometry, materials: HashMap::new(), robot, links: HashMap::new() };
    if root.node.descendants().any(|node| node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))) {
        return Err(root.error("holds macros of xacro; allowed: plain URDF, as the program xacro writes it"));
    }
    for material in root.children("material") {
        if let (Some(name), Some(made)) = (material.attribute("name"), reader.color(material)?) {
            reader.materials.insert(name, made);
        }
    }
    for link in root.children("link") {
        reader.link(link)?;
    }
    let joints: Vec<Xml<'_>> = root.children("joint").collect();
    let numbers: HashMap<&str, usize> =
        joints.iter().enumerate().filter_map(|(number, joint)| Some((joint.attribute("name")?, number))).collect();
    for joint in joints {
        reader.joint(joint, &numbers)?;
    }
    for extension in root.children("gazebo") {
        reader.sensors(extension)?;
    }
    if reader.robot.links.is_empty() {
        return Err(root.error("has no link; allowed: at least one"));
    }
    reader.robot.finished(root.path())
}

/// The transform of the `<origin>` in `holder`: `xyz` in metres, and roll, pitch and yaw in radians about fixed axes.
fn origin(holder: Xml<'_>) -> Result<DAffine3> {
    let Some(origin) = holder.child("origin") else { return Ok(DAffine3::IDENTITY) };
    let at = origin.vector("xyz")?.unwrap_or(DVec3::ZERO);
    let rpy = origin.vector("rpy")?.unwrap_or(DVec3::ZERO);
    Ok(DAffine3::from_mat3_translation(from_rpy(rpy), at))
}

impl<'d> UrdfReader<'d, '_> {
    fn link(&mut self, link: Xml<'d>) -> Result<()> {
        let name = link.required("name")?;
        let index = self.robot.links.len();
        if self.links.insert(name, index).is_some() {
            return Err(link.error("comes twice; allowed: one link of each name"));
        }
        let mut made = RobotLink::new(name, self.robot.name.clone());
        let kind = match self.geometry {
            GeometryUse::Visual => "visual",
            GeometryUse::Collision => "collision",
        };
        for part in link.children(kind) {
            made.geometry.push(self.geometry(part)?);
        }
        self.robot.links.push(made);
        Ok(())
    }

    fn geometry(&mut self, part: Xml<'d>) -> Result<LinkGeometry> {
        let holder = part.child("geometry").ok_or_else(|| part.error("has no geometry"))?;
        let shape =
            holder.elements().next().ok_or_else(|| holder.error("is empty; allowed: box, cylinder, sphere, mesh"))?;
        let made = match shape.name() {
            "box" => LinkShape::Box { size: DVec3::from(size_of_shape::<3>(shape, "size")?) },
            "sphere" => LinkShape::Sphere { radius: size_of_shape::<1>(shape, "radius")?[0] },
            "cylinder" => LinkShape::Cylinder {
                radius: size_of_shape::<1>(shape, "radius")?[0],
                length: size_of_shape::<1>(shape, "length")?[0],
            },
            "capsule" => LinkShape::Capsule {
                radius: size_of_shape::<1>(shape, "radius")?[0],
                length: size_of_shape::<1>(shape, "length")?[0],
            },
            "mesh" => {
                let file = shape.required("filename")?;
                let path =
                    self.folders.find(shape.path(), file).map_err(|why| shape.error(format_args!("filename {why}")))?;
                let scale = checked_scale(shape, shape.vector("scale")?)?;
                LinkShape::Mesh { path, scale, from_mesh: DAffine3::IDENTITY, only: None }
            }
            _ => return Err(shape.error("is no geometry; allowed: box, cylinder, sphere, capsule, mesh")),
        };
        let material = match part.child("material") {
            None => None,
            Some(material) => match self.color(material)? {
                Some(made) => {
                    if let Some(name) = material.attribute("name") {
                        self.materials.entry(name).or_insert(made.clone());
                    }
                    Some(made)
                }
                None => material.attribute("name").and_then(|name| self.materials.get(name).cloned()),
            },
        };
        Ok(LinkGeometry { link_from_geometry: origin(part)?, shape: made, material, replaces: false })
    }

    /// The material that an element defines; `None`: it only names one.
    fn color(&mut self, material: Xml<'d>) -> Result<Option<Arc<Material>>> {
        if material.child("texture").is_some() {
            self.robot.report.warn(format!(
                "{}: textures of <material> have no coordinates on most geometry and are not used",
                shown::path(material.path())
            ));
        }
        let Some(color) = material.child("color") else { return Ok(None) };
        let rgba = color.numbers::<4>("rgba")?.ok_or_else(|| color.error("has no attribute rgba"))?;
        Ok(Some(colored(material.attribute("name").unwrap_or_default(), rgba)))
    }

    fn joint(&mut self, joint: Xml<'d>, numbers: &HashMap<&str, usize>) -> Result<()> {
        let name = joint.required("name")?;
        let end = |which: &str| {
            let end = joint.child(which).ok_or_else(|| joint.error(format_args!("has no {which}")))?;
            let link = end.required("link")?;
            let found = self.links.get(link).copied();
            found.ok_or_else(|| {
                let near = ground::error::nearest(link, self.links.keys());
                let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
                let link = shown::name(link).to_string();
                joint.error(format_args!("has the {which} {link:?}, which is no link; allowed: names of links{near}"))
            })
        };
        let (parent, child) = (end("parent")?, end("child")?);
        let kind = match joint.required("type")? {
            "fixed" => JointKind::Fixed,
            "revolute" => JointKind::Revolute,
            "continuous" => JointKind::Continuous,
            "prismatic" => JointKind::Prismatic,
            "floating" => JointKind::Free,
            "planar" => {
                self.robot.report.warn(joint.told("is planar: it stays where it is"));
                JointKind::Fixed
            }
            _ => {
                return Err(joint.wrong("type", "fixed, revolute, continuous, prismatic, floating, planar"));
            }
        };
        let mut made = RobotJoint::new(name, kind, child);
        if let Some(axis) = joint.child("axis") {
            let given = axis.vector("xyz")?.unwrap_or(DVec3::X);
            if !matches!(kind, JointKind::Fixed | JointKind::Free) {
                made.axis = checked_axis(axis, "xyz", given)?;
            }
        }
        if let Some(limit) = joint.child("limit").filter(|_| matches!(kind, JointKind::Revolute | JointKind::Prismatic))
        {
            // Both are 0 where they are not given.
            let [low, high] = [limit.number("lower")?.unwrap_or(0.0), limit.number("upper")?.unwrap_or(0.0)];
            if low > high {
                return Err(limit
                    .error(format_args!("of joint {name:?} has lower {low} and upper {high}; allowed: lower first")));
            }
            made.limits = Some([low, high]);
        }
        if let Some(mimic) = joint.child("mimic") {
            let other = mimic.required("joint")?;
            let Some(&number) = numbers.get(other) else {
                return Err(mimic.wrong("joint", "names of joints"));
            };
            let multiplier = mimic.number("multiplier")?.unwrap_or(1.0);
            made.mimic = Some(JointMimic { joint: number, multiplier, offset: mimic.number("offset")?.unwrap_or(0.0) });
        }
        let link = &mut self.robot.links[child];
        if link.parent.is_some() {
            return Err(joint.error(format_args!(
                "moves link {:?}, which another joint moves already; allowed: one joint for each link",
                shown::name(&link.name)
            )));
        }
        (link.parent, link.parent_from_link) = (Some(parent), origin(joint)?);
        link.joints.push(self.robot.joints.len());
        self.robot.joints.push(made);
        Ok(())
    }

    /// Adds the sensors that a `<gazebo>` gives to the link that it is about.
    fn sensors(&mut self, extension: Xml<'d>) -> Result<()> {
        for sensor in extension.children("sensor") {
            let kind = sensor.attribute("type").unwrap_or_default();
            let Some(&link) = extension.attribute("reference").and_then(|link| self.links.get(link)) else {
                return Err(extension.wrong("reference", "names of links"));
            };
            let name = sensor.required("name")?;
            if !spec::is_lidar(kind) {
                let kind = shown::name(kind).to_string();
                self.robot
                    .report
                    .warn(sensor.told(format_args!("is left out: sensors of the type {kind:?} are not read")));
                continue;
            }
            let made = spec::lidar(sensor, name)?;
            let (link_from_site, _) = pose_of(sensor)?;
            self.robot.sites.push(RobotSite {
                name: name.to_owned(),
                link: Some(link),
                link_from_site,
                sensor: Some(made),
            });
        }
        Ok(())
    }
}
