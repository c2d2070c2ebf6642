//! FBX, binary or text.
//!
//! The `ufbx` library parses it and converts its axes and units to ours; polygons, curves and properties become what
//! they become in other formats: parts, tracks of the timeline, labels.

mod animation;
mod bake;
mod budget;
mod deform;
mod hierarchy;
mod material;
mod mesh;
mod names;
mod nodes;
mod object;
mod skeleton;
mod user;

use super::FileOptions;
use super::notes::Notes;
use crate::hierarchy::TimelineNodes;
use animation::FbxTracks;
use budget::Budget;
use glam::{DAffine3, DMat3, DVec3};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::read::{self, Limit};
use ground::report::Report;
use ground::shown;
use hierarchy::{FbxAncestry, FbxPlaced, FbxTree};
use material::FbxMaterials;
use mesh::FbxMeshes;
use model::material::TextureBudget;
use model::motion::{Node, Rest};
use model::{Camera, RawScene};
use nodes::FbxNodes;
use object::FbxObjects;
use std::path::Path;
use ufbx::{AllocatorOpts, CoordinateAxes, ErrorType, FileFormat, LoadOpts, WarningType};

/// Reads an `.fbx` file.
///
/// # Errors
/// A file that cannot be read, is damaged, or takes far more memory than on disk; a transform that is not finite.
pub(super) fn read(path: &Path, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    let bytes = read::bytes(path, Limit::SCENE)?;
    let budget = Budget::new(bytes.len());
    let file = load(&bytes, &budget).map_err(|message| Error::parse(path, "", message))?;
    drop(bytes);
    let document = FbxDocument { origin: path, file: &file, budget: &budget };

    let mut notes = Notes::default();
    let tracks = FbxTracks::read(&document, options, &mut notes)?;
    let labels = hierarchy::labels(&document);
    let tree = FbxTree::read(&document, &labels, &tracks, &mut notes)?;
    let materials = FbxMaterials::new(&document, options, images);
    let meshes = FbxMeshes::new(&document, materials, notes);
    let nodes = TimelineNodes::new(FbxNodes { document: &document, tracks: &tracks, tree: &tree });
    let mut objects = FbxObjects::new(meshes, nodes, FbxAncestry::new(&labels, &tree), &tracks);
    let mut cameras = Vec::new();
    for placed in &tree.placed {
        objects.add(placed)?;
        cameras.extend(camera_of(placed, &document, &mut objects.nodes)?);
    }

    let FbxObjects { meshes, nodes: TimelineNodes { timeline, .. }, list, .. } = objects;
    let FbxMeshes { materials, notes, degenerate_triangles, .. } = meshes;
    let mut report = Report::default();
    notes.report_to(path, &mut report);
    document.warn(&mut report);
    if degenerate_triangles > 0 {
        let triangles = shown::count(degenerate_triangles, "triangle");
        report.warn(format!("{}: {triangles} without area left out", shown::path(path)));
    }
    Ok(RawScene {
        joints: Vec::new(),
        objects: object::upright(list),
        materials: materials.list,
        cameras,
        animations: tracks.names,
        animation_lengths: tracks.lengths,
        timeline,
        degenerate_triangles,
        report,
    })
}

/// Parses the bytes of a file with `ufbx`.
fn load(bytes: &[u8], budget: &Budget) -> Result<ufbx::SceneRoot, String> {
    let allocator = || AllocatorOpts { memory_limit: budget.limit, ..AllocatorOpts::default() };
    let options = LoadOpts {
        temp_allocator: allocator(),
        result_allocator: allocator(),
        clean_skin_weights: true,
        use_blender_pbr_material: true,
        // Only then is the transform of a node that of its parent times its own.
        inherit_mode_handling: ufbx::InheritModeHandling::HelperNodes,
        target_axes: CoordinateAxes::right_handed_z_up(),
        target_unit_meters: 1.0,
        ..LoadOpts::default()
    };
    const OTHER: &str = "it is not an FBX file";
    let file = ufbx::load_memory(bytes, options).map_err(|error| match error.type_ {
        ErrorType::EmptyFile => "it is empty".into(),
        ErrorType::UnrecognizedFileFormat => OTHER.into(),
        ErrorType::TruncatedFile => "it is cut off".into(),
        ErrorType::MemoryLimit | ErrorType::AllocationLimit => format!("it {}", budget.exceeded()),
        ErrorType::OutOfMemory => "there is not enough memory to read it".into(),
        ErrorType::UnsupportedVersion => "its FBX version is not supported; allowed: 3000 and later".into(),
        ErrorType::Unknown if error.description.as_ref() == "Failed to load" => {
            "it is damaged: lists or numbers in it do not fit together".into()
        }
        // Words of the library, not quoted from the file.
        _ => format!("it is damaged: {}", error.description.to_lowercase()),
    })?;
    // `ufbx` reads OBJ files too.
    if file.metadata.file_format == FileFormat::Fbx { Ok(file) } else { Err(OTHER.into()) }
}

/// A parsed file.
struct FbxDocument<'a> {
    /// Path, for messages.
    origin: &'a Path,
    file: &'a ufbx::Scene,
    budget: &'a Budget,
}

impl FbxDocument<'_> {
    fn error(&self, place: impl Into<String>, message: impl Into<String>) -> Error {
        Error::parse(self.origin, place, message)
    }

    /// Warns about what the library had to guess.
    fn warn(&self, report: &mut Report) {
        for warning in &self.file.metadata.warnings {
            let what = match warning.type_ {
                WarningType::TruncatedArray => "lists that are cut off",
                WarningType::MissingGeometryData => "geometry without data",
                WarningType::MissingPolygonMapping => "lists without a known mapping to polygons",
                WarningType::IndexClamped => "indices beyond the end of their list, replaced by its last",
                WarningType::BadUnicode => "names that are not UTF-8",
                WarningType::BadBase64Content => "images whose base64 is damaged",
                WarningType::DuplicateObjectId => "objects with duplicate numbers",
                WarningType::EmptyFaceRemoved => "faces without corners, left out",
                _ => continue,
            };
            let times = if warning.count > 1 { format!(", {} times", warning.count) } else { String::new() };
            report.warn(format!("{}: it has {what}{times}", shown::path(self.origin)));
        }
    }
}

/// The camera at a node, if there is one.
fn camera_of(
    placed: &FbxPlaced<'_>,
    document: &FbxDocument<'_>,
    nodes: &mut TimelineNodes<FbxNodes<'_>>,
) -> Result<Option<Camera>> {
    let Some(camera) = &placed.node.camera else { return Ok(None) };
    // FBX cameras look along x, y up; those at glTF nodes along -z, y up.
    let turned = DAffine3::from_mat3(DMat3::from_cols(DVec3::Z, DVec3::Y, DVec3::NEG_X));
    let node_from_camera = affine(&placed.node.geometry_to_node) * turned;
    let name = [&names::named(placed.node).element.name, &camera.element.name];
    let name = name.into_iter().find(|name| !name.is_empty()).map(|name| name.to_string());
    let fault = |message| document.error(names::place(placed.node), message);
    let mut fixed = || {
        let parent = Some(nodes.number(nodes::number(placed.node))?);
        nodes.add(Node { parent, rest: Rest::Whole(node_from_camera), ..Node::default() })
    };
    Ok(Some(Camera {
        name: name.unwrap_or_else(|| format!("camera_{}", camera.element.typed_id)),
        pose: Pose::from_camera_node(&(placed.world_from_node * node_from_camera)),
        node: if placed.moves { Some(fixed().map_err(fault)?) } else { None },
    }))
}

fn affine(matrix: &ufbx::Matrix) -> DAffine3 {
    DAffine3::from_cols(
        DVec3::new(matrix.m00, matrix.m10, matrix.m20),
        DVec3::new(matrix.m01, matrix.m11, matrix.m21),
        DVec3::new(matrix.m02, matrix.m12, matrix.m22),
        DVec3::new(matrix.m03, matrix.m13, matrix.m23),
    )
}

fn vector(vector: ufbx::Vec3) -> DVec3 {
    DVec3::new(vector.x, vector.y, vector.z)
}
