//! glTF 2.0, binary (`.glb`) or text (`.gltf`).
//!
//! The `gltf` crate parses the JSON; buffers, accessors and the node tree are ours, because every
//! length and index in a file may be wrong and survey coordinates need double precision.

mod accessor;
mod animation;
mod container;
mod deform;
mod draco;
mod extras;
mod hierarchy;
mod instancing;
mod material;
mod meshopt;
mod morph;
mod nodes;
mod object;
mod primitive;
mod sampler;
mod skin;
mod targets;
mod uri;

use super::FileOptions;
use super::notes::Notes;
use crate::hierarchy::TimelineNodes;
use accessor::Accessors;
use animation::Animation;
use gltf::json::Root;
use gltf::json::extras::RawValue;
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::read::{self, Limit, yaml};
use ground::report::Report;
use ground::shown;
use hierarchy::{GltfAncestry, GltfPlaced, GltfTransform, GltfTree};
use material::GltfMaterials;
use model::material::TextureBudget;
use model::{Camera, RawScene};
use nodes::GltfNodes;
use object::GltfObjects;
use primitive::GltfMeshes;
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;
use uri::UriBase;
pub(super) use uri::percent_decoded;

/// Extensions that a file may require. Those of materials are accepted by prefix: they affect shading, and what
/// echocast supports of them is read.
const EXTENSIONS: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    animation::POINTER,
    draco::EXTENSION,
    hierarchy::VISIBILITY,
    instancing::EXTENSION,
    meshopt::EXTENSIONS[0],
    meshopt::EXTENSIONS[1],
];
const MATERIAL_EXTENSIONS: &str = "KHR_materials_";

/// Material extensions that have an effect.
const MATERIAL_EXTENSIONS_READ: &[&str] = &[
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
];

/// Other extensions that a file may require, although what they add is not read: the shapes are the same without.
const EXTENSIONS_WITHOUT_EFFECT: &[&str] = &[
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_audio_emitter",
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_texture_basisu",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

/// Reads a `.glb` or `.gltf` file.
pub(super) fn read(path: &Path, options: &FileOptions, images: &mut TextureBudget) -> Result<RawScene> {
    let bytes = read::bytes(path, Limit::SCENE)?;
    // The parent of a bare file name is the empty path, which joins as the working folder.
    read_bytes(&bytes, path, path.parent(), options, images)
}

/// Reads the bytes of a file; `folder` is the base of its URIs, `None` if it may not refer to files.
pub fn read_bytes(
    bytes: &[u8],
    origin: &Path,
    folder: Option<&Path>,
    options: &FileOptions,
    images: &mut TextureBudget,
) -> Result<RawScene> {
    let container = container::split(bytes).map_err(|message| Error::parse(origin, "", message))?;
    let files = UriBase { folder, allow_outside: options.allow_outside_paths };
    let document = GltfDocument::parse(container.json, origin, files)?;
    let external = external_buffers(&document)?;
    let buffers = buffers(&document, container.bin, &external)?;
    let file_bytes = buffers.iter().fold(container.json.len(), |sum, buffer| sum.saturating_add(buffer.len()));
    let decoded = meshopt::decode(&document, &buffers, file_bytes)?;
    let mut accessors = Accessors::new(&document.json, &buffers, &decoded, file_bytes);
    accessors.unpack(draco::decode(&document, &accessors, file_bytes)?);

    let mut notes = Notes::default();
    let (tracks, lengths) = animation::read(&document, &accessors, options, &mut notes)?;
    let materials = GltfMaterials::read(&document, &accessors, &tracks, images, &mut notes)?;
    let labels = hierarchy::label_extras(&document);
    let tree = GltfTree::read(&document, &labels, &tracks)?;
    let meshes = GltfMeshes::new(&document, &accessors, materials, notes);
    let nodes = GltfNodes { document: &document, accessors: &accessors, tracks: &tracks, tree: &tree };
    let nodes = TimelineNodes::new(nodes);
    let mut objects = GltfObjects::new(meshes, nodes, GltfAncestry::new(&document, &labels, &tree), &tracks);
    let mut cameras = Vec::new();
    for placed in tree.scene() {
        objects.add(placed)?;
        cameras.extend(camera_of(placed, &document, &mut objects.nodes)?);
    }

    let GltfObjects { meshes, nodes, list: objects, .. } = objects;
    let GltfMeshes { materials, notes, degenerate_triangles, .. } = meshes;
    let mut report = Report::default();
    notes.report_to(origin, &mut report);
    tracks.report_to(origin, &mut report);
    if !document.without_effect.is_empty() {
        let names = shown::some_of(&document.without_effect);
        report.warn(format!("{}: extensions that the file requires have no effect: {names}", shown::path(origin)));
    }
    if degenerate_triangles > 0 {
        let triangles = shown::count(degenerate_triangles, "triangle");
        report.warn(format!("{}: {triangles} without area left out", shown::path(origin)));
    }
    Ok(RawScene {
        joints: Vec::new(),
        objects,
        materials: materials.finish(),
        cameras,
        animations: document.animation_names(),
        animation_lengths: lengths,
        timeline: nodes.timeline,
        degenerate_triangles,
        report,
    })
}

/// The camera at a node, if there is one.
fn camera_of(
    placed: &GltfPlaced<'_>,
    document: &GltfDocument<'_>,
    nodes: &mut TimelineNodes<GltfNodes<'_>>,
) -> Result<Option<Camera>> {
    let node = &document.json.nodes[placed.node];
    let Some(index) = node.camera.map(|camera| camera.value()) else { return Ok(None) };
    let fault = |message: String| document.error(document.node_place(placed.node), message);
    let known = &document.json.cameras;
    let Some(camera) = known.get(index) else {
        return Err(fault(format!("its camera {index} does not exist: the file has {}", known.len())));
    };
    let name = node.name.as_ref().or(camera.name.as_ref());
    Ok(Some(Camera {
        name: name.cloned().unwrap_or_else(|| format!("camera_{index}")),
        pose: Pose::from_camera_node(&placed.world_from_node),
        node: if placed.moves { Some(nodes.number(Some(placed.node)).map_err(fault)?) } else { None },
    }))
}

/// A parsed file, without its buffers.
struct GltfDocument<'a> {
    /// Path, or a name for data in memory; for messages.
    origin: &'a Path,
    /// Base of URIs.
    files: UriBase<'a>,
    json: Root,
    /// Local transforms, for every node of `json`.
    transforms: Vec<GltfTransform>,
    /// `json` is parsed without them: the `gltf` crate does not know what extensions animate.
    animations: Vec<Animation>,
    /// Numbers of morph targets, for every mesh of `json`, see [`targets::target_counts`].
    targets: Vec<[usize; 2]>,
    /// Extensions that the file requires, although what they add is not read.
    without_effect: Vec<String>,
}

/// What must be known before the rest can be interpreted.
#[derive(Deserialize)]
struct GltfHeader<'a> {
    asset: Asset,
    #[serde(default, rename = "extensionsRequired")]
    extensions_required: Vec<String>,
    #[serde(borrow)]
    nodes: Option<&'a RawValue>,
    #[serde(borrow)]
    animations: Option<&'a RawValue>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

impl<'a> GltfDocument<'a> {
    fn parse(json: &[u8], origin: &'a Path, files: UriBase<'a>) -> Result<Self> {
        let broken = |error: serde_json::Error| {
            let full_message = error.to_string();
            let message = full_message.rsplit_once(" at line ").map_or(full_message.as_str(), |(message, _)| message);
            let place = format!("line {} column {}", error.line(), error.column());
            Error::parse(origin, place, format!("not a glTF file: {}", yaml::plain(message)))
        };
        let header: GltfHeader<'_> = serde_json::from_slice(json).map_err(broken)?;
        if header.asset.version.split('.').next() != Some("2") {
            return Err(Error::parse(origin, "asset", format!("glTF version {}; allowed: 2.0", header.asset.version)));
        }
        let mut without_effect = Vec::new();
        for name in &header.extensions_required {
            if EXTENSIONS.contains(&name.as_str()) || MATERIAL_EXTENSIONS_READ.contains(&name.as_str()) {
                continue;
            }
            if EXTENSIONS_WITHOUT_EFFECT.contains(&name.as_str()) || name.starts_with(MATERIAL_EXTENSIONS) {
                without_effect.push(name.clone());
                continue;
            }
            return Err(Error::Unsupported {
                what: format!("{}: the extension {}, which the file requires,", shown::path(origin), shown::name(name)),
                instead: "convert the file with another tool first, such as gltf-transform".into(),
            });
        }
        let transforms = match header.nodes {
            Some(nodes) => serde_json::from_str(nodes.get()).map_err(broken)?,
            None => Vec::new(),
        };
        let animations = match header.animations {
            Some(animations) => parse_animations(animations).map_err(|(place, error)| {
                let full_message = error.to_string();
                let message =
                    full_message.rsplit_once(" at line ").map_or(full_message.as_str(), |(message, _)| message);
                Error::parse(origin, place, format!("not a glTF file: {}", yaml::plain(message)))
            })?,
            None => Vec::new(),
        };
        // Compiled once, in the crate of the type; calling `serde_json` here would compile it again.
        let json = Root::from_slice(&without(json, header.animations)).map_err(broken)?;
        let targets = json.meshes.iter().map(targets::target_counts).collect();
        Ok(GltfDocument { origin, files, json, transforms, animations, targets, without_effect })
    }

    fn animation_names(&self) -> Vec<String> {
        self.animations.iter().enumerate().map(|(index, animation)| animation.name(index)).collect()
    }

    fn error(&self, place: impl Into<String>, message: impl Into<String>) -> Error {
        Error::parse(self.origin, place, message)
    }

    fn node_place(&self, node: usize) -> String {
        place("node", node, self.json.nodes[node].name.as_deref())
    }
}

/// The animations, or the error in them and its place.
fn parse_animations(text: &RawValue) -> Result<Vec<Animation>, (String, serde_json::Error)> {
    let mut parser = serde_json::Deserializer::from_str(text.get());
    serde_path_to_error::deserialize(&mut parser)
        .map_err(|error| (format!("animations{}", error.path()).trim_end_matches('.').to_owned(), error.into_inner()))
}

/// `json` with an empty list instead of `part`, with unchanged lines and columns.
fn without<'j>(json: &'j [u8], part: Option<&RawValue>) -> Cow<'j, [u8]> {
    let Some(part) = part.map(RawValue::get).filter(|part| part.len() > 1) else { return Cow::Borrowed(json) };
    // The part was borrowed from the text.
    let start = part.as_ptr() as usize - json.as_ptr() as usize;
    let mut json = json.to_owned();
    let blank = &mut json[start..start + part.len()];
    blank.iter_mut().filter(|byte| **byte != b'\n').for_each(|byte| *byte = b' ');
    blank[0] = b'[';
    blank[part.len() - 1] = b']';
    Cow::Owned(json)
}

/// `mesh 3 "Chair"`.
fn place(kind: &str, index: usize, name: Option<&str>) -> String {
    name.map_or_else(|| format!("{kind} {index}"), |name| format!("{kind} {index} {:?}", shown::name(name)))
}

/// Contents of the buffers in separate files or in data URIs, each URI once.
fn external_buffers<'a>(document: &'a GltfDocument<'_>) -> Result<HashMap<&'a str, Vec<u8>>> {
    let mut contents = HashMap::new();
    for (index, buffer) in document.json.buffers.iter().enumerate() {
        let uri = buffer.uri.as_deref().filter(|_| !meshopt::is_fallback(buffer));
        let Some(uri) = uri.filter(|uri| !contents.contains_key(uri)) else { continue };
        let loaded = document
            .files
            .load(uri, Limit::SCENE)
            .map_err(|message| document.error(place("buffer", index, buffer.name.as_deref()), message))?;
        contents.insert(uri, loaded);
    }
    Ok(contents)
}

/// The bytes of every buffer, exactly as many as it declares.
fn buffers<'a>(
    document: &GltfDocument<'_>,
    bin: Option<&'a [u8]>,
    external: &'a HashMap<&str, Vec<u8>>,
) -> Result<Vec<&'a [u8]>> {
    let compressed = document.json.extensions_required.iter().any(|name| meshopt::EXTENSIONS.contains(&name.as_str()));
    let buffers = document.json.buffers.iter().enumerate();
    buffers
        .map(|(index, buffer)| {
            let fault = |message| document.error(place("buffer", index, buffer.name.as_deref()), message);
            // A fallback for compressed data may have no data of its own.
            if meshopt::is_fallback(buffer) || compressed && index > 0 && buffer.uri.is_none() {
                return Ok(&[][..]);
            }
            let bytes = match &buffer.uri {
                Some(uri) => external[uri.as_str()].as_slice(),
                // Only the first buffer may be the GLB's binary chunk (glTF 2.0, 4.4.3.3).
                None => bin.filter(|_| index == 0).ok_or_else(|| fault("it has neither uri nor GLB chunk".into()))?,
            };
            let declared = buffer.byte_length.0;
            usize::try_from(declared)
                .ok()
                .and_then(|length| bytes.get(..length))
                .ok_or_else(|| fault(format!("it is cut off: {} bytes, its byteLength is {declared}", bytes.len())))
        })
        .collect()
}
