//! Visuals and collisions of SDF.

use crate::folders::ModelFolders;
use crate::robot::{GeometryUse, LinkShape};
use crate::shapes::{SIZES, checked_scale, colored, is_size};
use glam::{DAffine3, DQuat, DVec3};
use ground::error::Result;
use ground::read::xml::Xml;
use ground::report::Report;
use model::material::Material;
use std::sync::Arc;

/// Edge of planes that stop everything, metres: they are infinite in Gazebo.
const ENDLESS_M: f64 = 2000.0;

/// The shape of a visual or a collision and its pose in the frame of that; `None`, with a warning: it cannot be read.
pub(super) fn shape_of(
    part: Xml<'_>,
    folders: ModelFolders<'_>,
    geometry: GeometryUse,
    report: &mut Report,
) -> Result<Option<(DAffine3, LinkShape)>> {
    let Some(shape) = part.child("geometry").and_then(|geometry| geometry.elements().next()) else {
        return Err(part.error("has no geometry"));
    };
    let size = |name: &str, missing: f64| -> Result<f64> {
        match shape.number_of(name)? {
            None => Ok(missing),
            Some(size) if is_size(size) => Ok(size),
            Some(size) => Err(shape.error(format_args!("has the {name} {size}; allowed: {SIZES}"))),
        }
    };
    let sizes = |name: &str, missing: f64| -> Result<DVec3> {
        let Some(holder) = shape.child(name) else { return Ok(DVec3::splat(missing)) };
        let sizes = holder.content_numbers::<3>()?;
        if sizes.iter().all(|size| is_size(*size)) {
            return Ok(DVec3::from(sizes));
        }
        Err(shape.error(format_args!("has the {name} {sizes:?}; allowed: {SIZES}")))
    };
    let mut turned = DAffine3::IDENTITY;
    let made = match shape.name() {
        "box" => LinkShape::Box { size: sizes("size", 1.0)? },
        "sphere" => LinkShape::Sphere { radius: size("radius", 1.0)? },
        "cylinder" => LinkShape::Cylinder { radius: size("radius", 1.0)?, length: size("length", 1.0)? },
        "capsule" => LinkShape::Capsule { radius: size("radius", 0.5)?, length: size("length", 1.0)? },
        "ellipsoid" => LinkShape::Ellipsoid { radii: sizes("radii", 1.0)? },
        "plane" => {
            let normal =
                shape.child("normal").map(Xml::content_numbers::<3>).transpose()?.map_or(DVec3::Z, DVec3::from);
            let Some(normal) = normal.try_normalize() else {
                return Err(shape.error("has a normal of length 0; allowed: a direction"));
            };
            turned = DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::Z, normal));
            let size = match shape.child("size").filter(|_| geometry == GeometryUse::Visual) {
                None if geometry == GeometryUse::Visual => [1.0, 1.0],
                None => [ENDLESS_M; 2],
                Some(size) => size.content_numbers::<2>()?,
            };
            if !size.iter().all(|edge| is_size(*edge)) {
                return Err(shape.error(format_args!("has the size {size:?}; allowed: {SIZES}")));
            }
            LinkShape::Plane { size }
        }
        "mesh" => {
            let Some(uri) = shape.child("uri") else { return Err(shape.error("has no uri")) };
            let path = folders.find(shape.path(), uri.content()).map_err(|why| uri.error(why))?;
            let scale = shape.child("scale").map(Xml::content_numbers::<3>).transpose()?.map(DVec3::from);
            let submesh = shape.child("submesh");
            if submesh
                .and_then(|submesh| submesh.content_of("center"))
                .is_some_and(|center| ["true", "1"].contains(&center))
            {
                report.warn(shape.told("has a submesh to be centred: it stays where it is in its file"));
            }
            LinkShape::Mesh {
                path,
                scale: checked_scale(shape, scale)?,
                from_mesh: DAffine3::IDENTITY,
                only: submesh.and_then(|submesh| submesh.content_of("name")).map(str::to_owned),
            }
        }
        "empty" => return Ok(None),
        other => {
            report.warn(part.told(format_args!("is left out: geometry of the kind {:?}", ground::shown::name(other))));
            return Ok(None);
        }
    };
    Ok(Some((turned, made)))
}

/// What a visual is made of, if it says so: its diffuse colour, with its transparency.
pub(super) fn material_of(part: Xml<'_>, name: &str) -> Result<Option<Arc<Material>>> {
    let diffuse = part.child("material").and_then(|material| material.child("diffuse"));
    let Some(diffuse) = diffuse else { return Ok(None) };
    let mut rgba = match diffuse.content().split_ascii_whitespace().count() {
        3 => {
            let [red, green, blue] = diffuse.content_numbers::<3>()?;
            [red, green, blue, 1.0]
        }
        _ => diffuse.content_numbers::<4>()?,
    };
    if let Some(transparency) = part.number_of("transparency")? {
        rgba[3] *= 1.0 - transparency.clamp(0.0, 1.0);
    }
    Ok(Some(colored(name, rgba)))
}
