//! COLLADA 1.4 and 1.5, as the specifications of the Khronos Group define them ("COLLADA - Digital Asset Schema
//! Release", 1.4.1 of 2008 and 1.5.0 of 2008): meshes of polygons, nodes, instances, materials of the common profile.

mod library;
mod material;
mod mesh;
mod node;
#[cfg(test)]
mod tests;

use super::FileOptions;
use super::notes::Notes;
use glam::DAffine3;
use ground::error::{Error, Result};
use ground::read::Limit;
use ground::read::xml::{Xml, XmlText};
use library::ColladaLibrary;
use material::ColladaMaterials;
use mesh::ColladaMeshes;
use model::material::TextureBudget;
use model::{RawScene, UpAxis};
use node::ColladaNodes;
use std::path::Path;

/// Reads the COLLADA file at `path`. Its unit is applied, and its up axis unless `options` say otherwise.
///
/// # Errors
/// A file that cannot be read; what is missing, not a number or not allowed, with its line.
pub(super) fn read(path: &Path, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    let text = XmlText::load(path, Limit::COLLADA)?;
    let document = text.parse()?;
    let root = Xml::root(&document, &text);
    if root.name() != "COLLADA" {
        let message = format!("the outermost element is {:?}; allowed: COLLADA", ground::shown::name(root.name()));
        return Err(Error::parse(path, format!("line {}", root.line()), message));
    }
    let library = ColladaLibrary::new(root);
    let world_from_file = world_from_file(root, options)?;
    let mut notes = Notes::default();
    let materials = ColladaMaterials::new(&library, options, images);
    let meshes = ColladaMeshes::new(&library, options, materials);
    let mut nodes = ColladaNodes::new(&library, path, meshes, world_from_file);
    nodes.read(root, &mut notes)?;
    let mut scene = nodes.finished();
    if scene.degenerate_triangles > 0 {
        let triangles = ground::shown::count(scene.degenerate_triangles, "triangle");
        scene.report.warn(format!("{}: {triangles} without area left out", ground::shown::path(path)));
    }
    notes.report_to(path, &mut scene.report);
    Ok(scene)
}

/// Axes and unit of a file: y is up and a unit is a metre where it says nothing.
fn world_from_file(root: Xml<'_>, options: &FileOptions) -> Result<DAffine3> {
    let asset = root.child("asset");
    let unit = asset.and_then(|asset| asset.child("unit"));
    let metres = unit.map(|unit| unit.number("meter")).transpose()?.flatten().unwrap_or(1.0);
    if let Some(unit) = unit.filter(|_| metres <= 0.0) {
        return Err(unit.wrong("meter", "metres above 0"));
    }
    let up = match asset.and_then(|asset| asset.child("up_axis")) {
        _ if options.ignores_axes => UpAxis::Z,
        None => UpAxis::Y,
        Some(axis) => match axis.content() {
            "X_UP" => UpAxis::X,
            "Y_UP" => UpAxis::Y,
            "Z_UP" => UpAxis::Z,
            other => {
                let other = ground::shown::name(other).to_string();
                return Err(axis.error(format_args!("is {other:?}; allowed: X_UP, Y_UP, Z_UP")));
            }
        },
    };
    Ok(DAffine3::from_mat3(up.world_from_file() * metres))
}
