//! SDF, as <http://sdformat.org/spec> specifies it: worlds, models, what they include, links, joints, frames, sensors.

mod frames;
pub(crate) mod pose;
mod shape;

use crate::folders::{ModelFolders, model_file};
use crate::robot::{GeometryUse, JointKind, JointMimic, LinkGeometry, Robot, RobotJoint, RobotLink, RobotSite};
use crate::shapes::checked_axis;
use crate::spec;
use frames::{FilePlace, FrameRef, NamedThing, SdfFrame, SdfFrames};
use glam::{DAffine3, DVec3};
use ground::error::{Error, Result};
use ground::read::Limit;
use ground::read::xml::{Xml, XmlText};
use ground::shown;
use pose::pose_of;
use std::path::Path;

/// Deepest nesting of models.
const DEEPEST: usize = 32;

/// Most links, those of models counted as often as these are included.
const MOST_LINKS: usize = 100_000;

/// Reads the SDF whose outermost element is `root`.
///
/// # Errors
/// What is missing, not a number or not allowed, with its line; a file or a frame that is not there; frames or joints in
/// a circle.
pub(crate) fn read(root: Xml<'_>, folders: ModelFolders<'_>, geometry: GeometryUse) -> Result<Robot> {
    let mut reader = SdfReader::new(folders, geometry);
    let world = SdfScope { scope: 0, frame: 0, prefix: String::new(), version: version(root), depth: 0 };
    let place = root.child("world").unwrap_or(root);
    if place.name() != "world" && place.child("model").is_none() && place.child("include").is_none() {
        return Err(root.error("has neither a world nor a model"));
    }
    reader.robot.name = place
        .attribute("name")
        .or(place.child("model").and_then(|model| model.attribute("name")))
        .unwrap_or_default()
        .to_owned();
    reader.contents(place, &world)?;
    if root.children("world").count() > 1 {
        reader.robot.report.warn(root.told("has several worlds: the first is read"));
    }
    reader.finished(root.path())
}

/// The version of a file: meanings changed between them.
fn version(root: Xml<'_>) -> f64 {
    root.attribute("version").and_then(|version| version.trim().parse().ok()).unwrap_or(1.7)
}

/// A model, or the world, whose contents are read.
#[derive(Clone)]
struct SdfScope {
    scope: usize,
    /// What poses are relative to that say nothing.
    frame: usize,
    /// Before the names of its links: `house::`.
    prefix: String,
    version: f64,
    depth: usize,
}

impl SdfScope {
    /// The frame called `name` at `element`, or else `missing`.
    fn reference(&self, name: Option<&str>, missing: usize, element: Xml<'_>) -> FrameRef {
        match name.filter(|name| !name.is_empty()) {
            Some(name) => FrameRef::Named { scope: self.scope, name: name.to_owned(), place: FilePlace::of(element) },
            None => FrameRef::Known(missing),
        }
    }
}

/// The name of the joint that another follows, the multiplier and the offset.
type SdfMimic = (String, f64, f64);

/// A joint whose links and frames are found once all are known.
struct OpenJoint {
    joint: RobotJoint,
    place: FilePlace,
    parent: FrameRef,
    child: FrameRef,
    frame: usize,
    /// The frame in which its axis is.
    expressed_in: FrameRef,
    /// The name of the joint that it follows.
    mimics: Option<SdfMimic>,
}

/// Something on a link whose pose may be relative to any frame.
struct OpenPose {
    link: usize,
    /// Index of its geometry, or of its site.
    index: usize,
    relative_to: FrameRef,
    pose: DAffine3,
    is_site: bool,
}

struct SdfReader<'o> {
    folders: ModelFolders<'o>,
    geometry: GeometryUse,
    robot: Robot,
    frames: SdfFrames,
    /// The frames of links.
    link_frames: Vec<usize>,
    joints: Vec<OpenJoint>,
    poses: Vec<OpenPose>,
}

impl<'o> SdfReader<'o> {
    fn new(folders: ModelFolders<'o>, geometry: GeometryUse) -> Self {
        let mut frames = SdfFrames::default();
        let world = frames.add(SdfFrame { relative_to: None, pose: DAffine3::IDENTITY, placement: None, thing: None });
        frames.add_scope(world);
        let (link_frames, joints, poses) = (Vec::new(), Vec::new(), Vec::new());
        SdfReader { folders, geometry, robot: Robot::default(), frames, link_frames, joints, poses }
    }

    /// Reads what is in a world or a model.
    fn contents(&mut self, holder: Xml<'_>, scope: &SdfScope) -> Result<()> {
        if scope.depth > DEEPEST {
            return Err(
                holder.error(format_args!("is nested more than {DEEPEST} deep; allowed: less, and no model in itself"))
            );
        }
        for element in holder.elements() {
            match element.name() {
                "model" => self.model(element, element, scope)?,
                "include" => self.include(element, scope)?,
                "link" => self.link(element, scope)?,
                "joint" => self.joint(element, scope)?,
                "frame" => self.frame(element, scope)?,
                "actor" | "population" | "road" | "heightmap" => {
                    self.robot.report.warn(element.told("is left out: only models are read"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Reads a model; `placed` is the element that places it: itself, or an `<include>`.
    fn model(&mut self, model: Xml<'_>, placed: Xml<'_>, scope: &SdfScope) -> Result<()> {
        let name = placed.content_of("name").filter(|_| placed.name() == "include").or(model.attribute("name"));
        let name = name.ok_or_else(|| model.error("has no attribute name"))?;
        // What an `<include>` says replaces what the model says.
        let of_pose = if placed.child("pose").is_some() { placed } else { model };
        let (pose, relative_to) = pose_of(of_pose)?;
        // Names of a file that is included do not count outside of it.
        let relative_to = relative_to.filter(|_| of_pose.node == placed.node);
        let frame = self.frames.add(SdfFrame {
            relative_to: Some(scope.reference(relative_to, scope.frame, of_pose)),
            pose,
            placement: None,
            thing: None,
        });
        let own = SdfScope {
            scope: self.frames.add_scope(frame),
            frame,
            prefix: format!("{}{name}::", scope.prefix),
            version: scope.version,
            depth: scope.depth + 1,
        };
        let placement = placed.content_of("placement_frame").or(placed.attribute("placement_frame"));
        let placement = placement.or(model.attribute("placement_frame")).filter(|name| !name.is_empty());
        let canonical = model.attribute("canonical_link").filter(|name| !name.is_empty());
        let first = model.child("link").and_then(|link| link.attribute("name"));
        let nested = model.child("model").and_then(|model| model.attribute("name"));
        let canonical = canonical.or(first).or(nested).map(|name| own.reference(Some(name), frame, model));
        self.frames.set(
            frame,
            placement.map(|name| own.reference(Some(name), frame, placed)),
            NamedThing::Model { scope: own.scope, canonical },
        );
        self.frames.name(scope.scope, name, frame, placed)?;
        self.contents(model, &own)
    }

    fn include(&mut self, include: Xml<'_>, scope: &SdfScope) -> Result<()> {
        let Some(uri) = include.child("uri") else { return Err(include.error("has no uri")) };
        let found = self.folders.find(include.path(), uri.content()).map_err(|why| uri.error(why))?;
        // Gazebo names the folder of a model, others its file.
        let path = if found.is_dir() { model_file(&found) } else { found };
        let text = XmlText::load(&path, Limit::XML)?;
        let document = text.parse()?;
        let root = Xml::root(&document, &text);
        let Some(model) = root.child("model").filter(|_| root.name() == "sdf") else {
            return Err(root.error("has no model to include; allowed: sdf with a model"));
        };
        if include.attribute("merge").is_some_and(|merge| ["true", "1"].contains(&merge)) {
            self.robot.report.warn(include.told("is not merged: its names are behind that of its model"));
        }
        self.model(model, include, &SdfScope { version: version(root), ..scope.clone() })
    }

    fn frame(&mut self, element: Xml<'_>, scope: &SdfScope) -> Result<()> {
        let (pose, relative_to) = pose_of(element)?;
        let attached = scope.reference(element.attribute("attached_to"), scope.frame, element);
        let relative_to = match relative_to {
            Some(name) => scope.reference(Some(name), scope.frame, element),
            None => attached.clone(),
        };
        let thing = Some(NamedThing::Frame { attached });
        let frame = self.frames.add(SdfFrame { relative_to: Some(relative_to), pose, placement: None, thing });
        self.frames.name(scope.scope, element.required("name")?, frame, element)
    }

    fn link(&mut self, element: Xml<'_>, scope: &SdfScope) -> Result<()> {
        let name = element.required("name")?;
        let (pose, relative_to) = pose_of(element)?;
        let index = self.robot.links.len();
        if index == MOST_LINKS {
            return Err(element.error(format_args!("is one of more than {MOST_LINKS} links, the most allowed")));
        }
        let frame = self.frames.add(SdfFrame {
            relative_to: Some(scope.reference(relative_to, scope.frame, element)),
            pose,
            placement: None,
            thing: Some(NamedThing::Link(index)),
        });
        self.frames.name(scope.scope, name, frame, element)?;
        self.link_frames.push(frame);
        let model = scope.prefix.strip_suffix("::").unwrap_or_default();
        self.robot.links.push(RobotLink::new(format!("{}{name}", scope.prefix), model));
        let kind = match self.geometry {
            GeometryUse::Visual => "visual",
            GeometryUse::Collision => "collision",
        };
        for part in element.children(kind) {
            let (pose, relative_to) = pose_of(part)?;
            let found = shape::shape_of(part, self.folders, self.geometry, &mut self.robot.report)?;
            let Some((turned, shape)) = found else { continue };
            let named = format!("{}{name}::{}", scope.prefix, part.attribute("name").unwrap_or_default());
            let material = shape::material_of(part, &named)?;
            let replaces = material.is_some();
            let geometry = &mut self.robot.links[index].geometry;
            if let Some(frame) = relative_to {
                let relative_to = scope.reference(Some(frame), scope.frame, part);
                self.poses.push(OpenPose {
                    link: index,
                    index: geometry.len(),
                    relative_to,
                    pose: pose * turned,
                    is_site: false,
                });
            }
            geometry.push(LinkGeometry { link_from_geometry: pose * turned, shape, material, replaces });
        }
        for sensor in element.children("sensor") {
            self.sensor(sensor, index, scope)?;
        }
        Ok(())
    }

    fn sensor(&mut self, sensor: Xml<'_>, link: usize, scope: &SdfScope) -> Result<()> {
        let kind = sensor.attribute("type").unwrap_or_default();
        let name = format!("{}::{}", self.robot.links[link].name, sensor.required("name")?);
        if !spec::is_lidar(kind) {
            self.robot.report.warn(
                sensor.told(format_args!("is left out: sensors of the type {:?} are not read", shown::name(kind))),
            );
            return Ok(());
        }
        let made = spec::lidar(sensor, &name)?;
        let (pose, relative_to) = pose_of(sensor)?;
        if let Some(frame) = relative_to {
            let relative_to = scope.reference(Some(frame), scope.frame, sensor);
            let index = self.robot.sites.len();
            self.poses.push(OpenPose { link, index, relative_to, pose, is_site: true });
        }
        self.robot.sites.push(RobotSite { name, link: Some(link), link_from_site: pose, sensor: Some(made) });
        Ok(())
    }

    fn joint(&mut self, element: Xml<'_>, scope: &SdfScope) -> Result<()> {
        let name = element.required("name")?;
        let end = |which: &str| -> Result<FrameRef> {
            // Before 1.7 the name may be the text of an element in it.
            let link = element.content_of(which).filter(|link| !link.is_empty());
            let link = link.ok_or_else(|| element.error(format_args!("has no {which}")))?;
            Ok(scope.reference(Some(link), scope.frame, element))
        };
        let (parent, child) = (end("parent")?, end("child")?);
        let (pose, relative_to) = pose_of(element)?;
        let relative_to = match relative_to {
            Some(name) => scope.reference(Some(name), scope.frame, element),
            None => child.clone(),
        };
        let thing = Some(NamedThing::Joint { child: child.clone() });
        let frame = self.frames.add(SdfFrame { relative_to: Some(relative_to), pose, placement: None, thing });
        self.frames.name(scope.scope, name, frame, element)?;
        let kinds: &[(&str, JointKind)] = match element.required("type")? {
            "fixed" => &[("", JointKind::Fixed)],
            "revolute" => &[("axis", JointKind::Revolute)],
            "continuous" => &[("axis", JointKind::Continuous)],
            "prismatic" => &[("axis", JointKind::Prismatic)],
            "ball" => &[("", JointKind::Ball)],
            "universal" | "revolute2" => &[("axis", JointKind::Revolute), ("axis2", JointKind::Revolute)],
            "screw" | "gearbox" => {
                self.robot.report.warn(element.told("is a screw or a gearbox: it stays where it is"));
                &[("", JointKind::Fixed)]
            }
            _ => {
                return Err(element.wrong(
                    "type",
                    "fixed, revolute, continuous, prismatic, ball, universal, revolute2, screw, gearbox",
                ));
            }
        };
        for &(which, kind) in kinds {
            // The second axis of a joint is a joint of its own.
            let suffix = if which == "axis2" { "::axis2" } else { "" };
            let mut joint = RobotJoint::new(format!("{}{name}{suffix}", scope.prefix), kind, 0);
            let (mut expressed_in, mut mimics) = (FrameRef::Known(frame), None);
            if let Some(axis) = element.child(which) {
                (expressed_in, mimics) = self.axis(axis, &mut joint, frame, scope)?;
            } else if !which.is_empty() {
                joint.axis = DVec3::Z;
            }
            let place = FilePlace::of(element);
            let (parent, child) = (parent.clone(), child.clone());
            self.joints.push(OpenJoint { joint, place, parent, child, frame, expressed_in, mimics });
        }
        Ok(())
    }

    /// Reads the axis of a joint: returns the frame in which it is, and what the joint follows.
    fn axis(
        &mut self,
        axis: Xml<'_>,
        joint: &mut RobotJoint,
        frame: usize,
        scope: &SdfScope,
    ) -> Result<(FrameRef, Option<SdfMimic>)> {
        let xyz = axis.child("xyz");
        let given = xyz.map(Xml::content_numbers::<3>).transpose()?.map_or(DVec3::Z, DVec3::from);
        joint.axis = checked_axis(axis, "xyz", given)?;
        let by_model = axis.content_of("use_parent_model_frame").is_some_and(|by| ["true", "1"].contains(&by));
        // Until 1.4 axes were in the frame of the model, without a word.
        let by_model = by_model || scope.version < 1.5 - 1e-9;
        let named = xyz.and_then(|xyz| xyz.attribute("expressed_in"));
        let expressed_in = scope.reference(named, if by_model { scope.frame } else { frame }, axis);
        if let Some(limit) = axis.child("limit") {
            let low = limit.child("lower").map(number_or_endless).transpose()?.unwrap_or(f64::NEG_INFINITY);
            let high = limit.child("upper").map(number_or_endless).transpose()?.unwrap_or(f64::INFINITY);
            // So wide is without limits: 1e16 is the default.
            joint.limits = (low > -1e15 && high < 1e15).then_some([low, high]);
            if low > high {
                return Err(limit.error(format_args!("has lower {low} and upper {high}; allowed: lower first")));
            }
        }
        let mimics = match axis.child("mimic") {
            None => None,
            Some(mimic) => {
                let number = |name: &str, missing: f64| Ok::<f64, Error>(mimic.number_of(name)?.unwrap_or(missing));
                let (multiplier, offset) = (number("multiplier", 1.0)?, number("offset", 0.0)?);
                // multiplier * (position - reference) + offset.
                let offset = offset - multiplier * number("reference", 0.0)?;
                Some((format!("{}{}", scope.prefix, mimic.required("joint")?), multiplier, offset))
            }
        };
        Ok((expressed_in, mimics))
    }

    /// The robot, with all frames found.
    fn finished(mut self, path: &Path) -> Result<Robot> {
        let mut world_from_links = Vec::with_capacity(self.link_frames.len());
        for &frame in &self.link_frames {
            world_from_links.push(self.frames.pose(&FrameRef::Known(frame)).map_err(|error| in_file(path, error))?);
        }
        for (link, pose) in self.robot.links.iter_mut().zip(&world_from_links) {
            link.parent_from_link = *pose;
        }
        let names: Vec<String> = self.joints.iter().map(|open| open.joint.name.clone()).collect();
        for OpenJoint { mut joint, place, parent, child, frame, expressed_in, mimics } in
            std::mem::take(&mut self.joints)
        {
            let child_link = self.frames.link_of(&child)?;
            let Some(child_link) = child_link else {
                return Err(place.error("a joint has the world as its child; allowed: links"));
            };
            let parent_link = self.frames.link_of(&parent)?;
            let link_from_world = world_from_links[child_link].inverse();
            joint.link = child_link;
            joint.anchor = (link_from_world * self.frames.pose(&FrameRef::Known(frame))?).translation;
            let turned = link_from_world * self.frames.pose(&expressed_in)?;
            joint.axis = turned.transform_vector3(joint.axis).normalize_or(DVec3::Z);
            if let Some((other, multiplier, offset)) = mimics {
                let found = names.iter().position(|name| *name == other);
                let found = found.ok_or_else(|| {
                    place.error(format!(
                        "the joint mimics {:?}, which is no joint; allowed: names of joints",
                        shown::name(&other)
                    ))
                })?;
                joint.mimic = Some(JointMimic { joint: found, multiplier, offset });
            }
            let link = &mut self.robot.links[child_link];
            let is_second = link
                .joints
                .last()
                .is_some_and(|&last| joint.name == format!("{}::axis2", self.robot.joints[last].name));
            if !link.joints.is_empty() && !is_second {
                return Err(place.error(format!(
                    "a joint moves link {:?}, which another joint moves already; allowed: one joint for each link",
                    shown::name(&link.name)
                )));
            }
            link.parent = parent_link;
            let parent_from_world = parent_link.map_or(DAffine3::IDENTITY, |parent| world_from_links[parent].inverse());
            link.parent_from_link = parent_from_world * world_from_links[child_link];
            link.joints.push(self.robot.joints.len());
            self.robot.joints.push(joint);
        }
        for OpenPose { link, index, relative_to, pose, is_site } in std::mem::take(&mut self.poses) {
            let link_from_frame = world_from_links[link].inverse() * self.frames.pose(&relative_to)?;
            match is_site {
                true => self.robot.sites[index].link_from_site = link_from_frame * pose,
                false => self.robot.links[link].geometry[index].link_from_geometry = link_from_frame * pose,
            }
        }
        self.robot.finished(path)
    }
}

/// A number that may be infinite.
fn number_or_endless(holder: Xml<'_>) -> Result<f64> {
    match holder.content().trim_start_matches(['-', '+']) {
        "inf" | "INF" | "Inf" if holder.content().starts_with('-') => Ok(f64::NEG_INFINITY),
        "inf" | "INF" | "Inf" => Ok(f64::INFINITY),
        _ => holder.content_numbers::<1>().map(|[number]| number),
    }
}

/// An error about frames as one of the file.
fn in_file(path: &Path, error: Error) -> Error {
    match error {
        Error::InvalidParameter { name, value, allowed } => {
            Error::parse(path, "", format!("{name} is {value}; allowed: {allowed}"))
        }
        other => other,
    }
}
