//! MJCF, as the documentation of MuJoCo defines it (<https://mujoco.readthedocs.io/en/stable/XMLreference.html>).

mod compiler;
mod defaults;
mod files;
mod geom;

use crate::folders::ModelFolders;
use crate::robot::{GeometryUse, JointKind, Robot, RobotJoint, RobotLink, RobotSite};
use crate::shapes::checked_axis;
use crate::spec;
use compiler::MjcfCompiler;
use defaults::{Classed, MjcfDefaults};
use files::{IncludedTexts, MjcfTree};
use geom::GeomReader;
use glam::{DAffine3, DQuat, DVec3};
use ground::error::{Error, Result};
use ground::read::xml::Xml;
use ground::shown;
use std::f64::consts::FRAC_PI_2;

/// Deepest hierarchy of bodies: each takes some of the caller's stack.
const DEEPEST: usize = 100;

/// Reads the MJCF whose outermost element is `root`.
///
/// # Errors
/// What is missing, not a number or not allowed, with its line; a file that is not there.
pub(crate) fn read(root: Xml<'_>, folders: ModelFolders<'_>, geometry: GeometryUse) -> Result<Robot> {
    let included = IncludedTexts::load(root, folders)?;
    let documents = included.texts().map(|(path, text)| Ok((path, text, text.parse()?))).collect::<Result<Vec<_>>>()?;
    let roots = documents.iter().map(|(path, text, document)| (*path, Xml::root(document, text))).collect();
    let tree = MjcfTree { roots, main: root.path(), folders };
    let sections = tree.children(root);
    let of = |name: &'static str| sections.iter().copied().filter(move |section| section.name() == name);
    let mut compiler = MjcfCompiler::default();
    of("compiler").try_for_each(|section| compiler.read(section))?;
    let mut defaults = MjcfDefaults::default();
    of("default").try_for_each(|section| defaults.add(section, &|element| tree.children(element)))?;
    let mut geoms = GeomReader::new(&compiler, &defaults, folders, root.path(), geometry);
    for asset in of("asset").flat_map(|section| tree.children(section)) {
        geoms.asset(asset)?;
    }
    let name = root.attribute("model").unwrap_or("MuJoCo Model");
    let robot = Robot { name: name.to_owned(), ..Robot::default() };
    let mut bodies = BodyReader { tree: &tree, compiler: &compiler, defaults: &defaults, geoms, robot };
    bodies.robot.links.push(RobotLink::new("world", name));
    for section in of("worldbody") {
        bodies.contents(section, BodyPlace { link: 0, link_from_frame: DAffine3::IDENTITY, class: None, depth: 0 })?;
    }
    for sensor in of("sensor").flat_map(|section| tree.children(section)) {
        bodies.sensor(sensor)?;
    }
    bodies.robot.finished(root.path())
}

/// Reads bodies and what is in them.
struct BodyReader<'d, 'm> {
    tree: &'m MjcfTree<'d, 'm>,
    compiler: &'m MjcfCompiler,
    defaults: &'m MjcfDefaults<'d>,
    geoms: GeomReader<'d, 'm>,
    robot: Robot,
}

/// Where the elements of a body or of a `<frame>` are.
#[derive(Clone, Copy)]
struct BodyPlace<'d> {
    link: usize,
    link_from_frame: DAffine3,
    /// The class that `childclass` gives to elements without one.
    class: Option<&'d str>,
    depth: usize,
}

impl<'d, 'm> BodyReader<'d, 'm> {
    fn contents(&mut self, holder: Xml<'d>, place: BodyPlace<'d>) -> Result<()> {
        if place.depth > DEEPEST {
            return Err(holder.error(format_args!("is below more than {DEEPEST} bodies, the most allowed")));
        }
        for element in self.tree.children(holder) {
            match element.name() {
                "body" => self.body(element, place)?,
                "frame" => {
                    let own = Classed::new(element, place.class, self.defaults)?;
                    let link_from_frame = place.link_from_frame * self.compiler.pose(own)?;
                    let class = element.attribute("childclass").or(place.class);
                    self.contents(element, BodyPlace { link_from_frame, class, depth: place.depth + 1, ..place })?;
                }
                "geom" => {
                    let own = Classed::new(element, place.class, self.defaults)?;
                    let made = self.geoms.geom(own, &mut self.robot.report)?;
                    if let Some(mut geometry) = made {
                        geometry.link_from_geometry = place.link_from_frame * geometry.link_from_geometry;
                        self.robot.links[place.link].geometry.push(geometry);
                    }
                }
                "joint" | "freejoint" => self.joint(element, place)?,
                "site" => {
                    let own = Classed::new(element, place.class, self.defaults)?;
                    let link_from_site = place.link_from_frame * self.compiler.pose(own)?;
                    let name = element.attribute("name").unwrap_or_default().to_owned();
                    self.robot.sites.push(RobotSite { name, link: Some(place.link), link_from_site, sensor: None });
                }
                "replicate" | "composite" | "flexcomp" | "attach" => {
                    self.robot
                        .report
                        .warn(element.told("is left out: MuJoCo expands it, and can save what it becomes"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn body(&mut self, body: Xml<'d>, place: BodyPlace<'d>) -> Result<()> {
        let index = self.robot.links.len();
        let name = body.attribute("name").map_or_else(|| format!("body{index}"), str::to_owned);
        let mut link = RobotLink::new(name, self.robot.name.clone());
        link.parent = Some(place.link);
        // Bodies have no class of their own.
        let own = Classed::new(body, None, self.defaults)?;
        link.parent_from_link = place.link_from_frame * self.compiler.pose(own)?;
        self.robot.links.push(link);
        let class = body.attribute("childclass").or(place.class);
        self.contents(
            body,
            BodyPlace { link: index, link_from_frame: DAffine3::IDENTITY, class, depth: place.depth + 1 },
        )
    }

    fn joint(&mut self, element: Xml<'d>, place: BodyPlace<'d>) -> Result<()> {
        let own = Classed::new(element, place.class, self.defaults)?;
        let is_free = element.name() == "freejoint";
        let kind = match own.attribute("type").filter(|_| !is_free) {
            _ if is_free => JointKind::Free,
            None | Some("hinge") => JointKind::Revolute,
            Some("slide") => JointKind::Prismatic,
            Some("ball") => JointKind::Ball,
            Some("free") => JointKind::Free,
            Some(_) => return Err(own.wrong("type", "hinge, slide, ball, free")),
        };
        if place.link == 0 {
            return Err(element.error("is in the world, which does not move; allowed: joints in bodies"));
        }
        if kind == JointKind::Free && self.robot.links[place.link].parent != Some(0) {
            return Err(element.error("is free in a body that hangs on another; allowed: in bodies of the world"));
        }
        let mut joint = RobotJoint::new(element.attribute("name").unwrap_or_default(), kind, place.link);
        if matches!(kind, JointKind::Revolute | JointKind::Prismatic) {
            let axis = own.numbers::<3>("axis")?.map_or(DVec3::Z, DVec3::from);
            joint.axis = place.link_from_frame.matrix3 * checked_axis(element, "axis", axis)?;
            let turned = |value: f64| if kind == JointKind::Revolute { self.compiler.radians(value) } else { value };
            let reference = own.number("ref")?.unwrap_or(0.0);
            joint.rest = if kind == JointKind::Revolute { self.compiler.radians(reference) } else { reference };
            let limited = match own.attribute("limited") {
                None | Some("auto") => self.compiler.auto_limits,
                other => other == Some("true"),
            };
            joint.limits = own.numbers::<2>("range")?.filter(|_| limited).map(|range| range.map(turned));
            if joint.limits.is_none() && kind == JointKind::Revolute {
                joint.kind = JointKind::Continuous;
            }
        }
        if kind != JointKind::Free {
            let anchor = own.numbers::<3>("pos")?.map_or(DVec3::ZERO, DVec3::from);
            joint.anchor = place.link_from_frame.transform_point3(anchor);
        }
        self.robot.links[place.link].joints.push(self.robot.joints.len());
        self.robot.joints.push(joint);
        Ok(())
    }

    /// Adds the sensor of a `<rangefinder>`: a ray along the z axis of its site.
    fn sensor(&mut self, sensor: Xml<'d>) -> Result<()> {
        if sensor.name() != "rangefinder" {
            return Ok(());
        }
        let Some(site) = sensor.attribute("site") else {
            self.robot.report.warn(sensor.told("is left out: it is not on a site"));
            return Ok(());
        };
        let found = self.robot.sites.iter().find(|known| known.name == site);
        let found = found.ok_or_else(|| {
            let missing = Error::missing("site", site, self.robot.sites.iter().map(|site| &site.name));
            sensor.error(format_args!("is on a site that is not defined: {missing}"))
        })?;
        let own = Classed::new(sensor, None, self.defaults)?;
        let cutoff = own.number("cutoff")?.unwrap_or(0.0);
        let noise = own.number("noise")?.unwrap_or(0.0);
        if cutoff < 0.0 || noise < 0.0 {
            return Err(sensor.error("has a negative cutoff or noise; allowed: 0 and more"));
        }
        let name = sensor.attribute("name").map_or_else(|| format!("rangefinder {}", shown::name(site)), str::to_owned);
        // Sensors here look along x: x goes to z, z to -x.
        let along_z = DAffine3::from_quat(DQuat::from_rotation_y(-FRAC_PI_2));
        let mount = RobotSite {
            sensor: Some(spec::rangefinder(&name, cutoff, noise)),
            name,
            link: found.link,
            link_from_site: found.link_from_site * along_z,
        };
        self.robot.sites.push(mount);
        Ok(())
    }
}
