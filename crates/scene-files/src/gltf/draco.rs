//! `KHR_draco_mesh_compression`: primitives whose triangles and vertices are one Draco stream.

use super::accessor::Accessors;
use super::{GltfDocument, place};
use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};
use gltf::json::accessor::ComponentType;
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};
use ground::error::Result;
use ground::read::yaml;
use serde::Deserialize;
use std::collections::HashMap;

pub(super) const EXTENSION: &str = "KHR_draco_mesh_compression";

/// Decoded bytes allowed per byte of a file; legitimate streams rarely hold more than 50.
const EXPANSION_LIMIT: u64 = 256;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct DracoCompression {
    buffer_view: u32,
    /// Numbers of the attributes in the stream.
    attributes: HashMap<String, u32>,
}

/// The contents of the accessors of compressed primitives, by their number.
///
/// # Errors
/// A stream that is damaged, or does not match the accessors; more than a file of this size should hold.
pub(super) fn decode(
    document: &GltfDocument<'_>,
    accessors: &Accessors<'_>,
    file_bytes: usize,
) -> Result<HashMap<usize, Vec<u8>>> {
    let mut contents = HashMap::new();
    let mut left = (file_bytes as u64).saturating_mul(EXPANSION_LIMIT).saturating_add(1 << 20);
    for (index, mesh) in document.json.meshes.iter().enumerate() {
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let others = primitive.extensions.as_ref().map(|all| &all.others);
            let Some(value) = others.and_then(|others| others.get(EXTENSION)) else { continue };
            let decoded = Deserialize::deserialize(value)
                .map_err(|error: serde_json::Error| yaml::plain(&error.to_string()))
                .and_then(|compression| read(&compression, primitive, accessors, &mut left));
            contents.extend(decoded.map_err(|message| {
                let here = place("mesh", index, mesh.name.as_deref());
                document.error(format!("{here} primitive {number}"), format!("{EXTENSION}: {message}"))
            })?);
        }
    }
    Ok(contents)
}

/// The contents of the accessors of `primitive`.
fn read(
    compression: &DracoCompression,
    primitive: &Primitive,
    accessors: &Accessors<'_>,
    left: &mut u64,
) -> Result<Vec<(usize, Vec<u8>)>, String> {
    if primitive.mode != Checked::Valid(Mode::Triangles) {
        return Err("its mode is not 4; allowed: triangles".into());
    }
    let stream = accessors.view(Index::new(compression.buffer_view))?;
    let limits = DecodeLimits::default().with_max_points(*left / 12).with_max_faces(*left / 12);
    let mut buffer = DecoderBuffer::new(stream).with_limits(limits.with_max_decoded_bytes(*left));
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut buffer, &mut mesh)
        .map_err(|error| format!("the compressed data is damaged or too much: {error}"))?;

    let mut contents = Vec::new();
    let indices = primitive.indices.ok_or("it has no indices; allowed: an accessor for them")?;
    let corners = mesh.faces().iter().flatten().map(|corner| corner.0);
    let bytes = match component(accessors.describe(indices)?)? {
        ComponentType::U32 => corners.flat_map(u32::to_le_bytes).collect(),
        ComponentType::U16 if mesh.num_points() <= 1 << 16 => corners.flat_map(|i| (i as u16).to_le_bytes()).collect(),
        ComponentType::U8 if mesh.num_points() <= 1 << 8 => corners.map(|i| i as u8).collect(),
        _ => return Err(format!("accessor {indices} cannot hold indices of {} vertices", mesh.num_points())),
    };
    contents.push((indices.value(), bytes));
    for (semantic, index) in &primitive.attributes {
        let name = semantic.to_string();
        let Some(&id) = compression.attributes.get(&name) else { continue };
        let attribute =
            mesh.attribute_by_unique_id(id).ok_or_else(|| format!("{name}: the stream has no attribute {id}"))?;
        let bytes = values(attribute, mesh.num_points(), accessors.describe(*index)?);
        contents.push((index.value(), bytes.map_err(|message| format!("{name}: {message}"))?));
    }
    let bytes: usize = contents.iter().map(|(_, bytes)| bytes.len()).sum();
    *left = left.saturating_sub(bytes as u64);
    Ok(contents)
}

/// The values of `attribute` at each of `points`, in the component type of `accessor`.
fn values(attribute: &PointAttribute, points: usize, accessor: &Accessor) -> Result<Vec<u8>, String> {
    let kind = component(accessor)?;
    let stored = match attribute.data_type() {
        DataType::Int8 => ComponentType::I8,
        DataType::Uint8 => ComponentType::U8,
        DataType::Int16 => ComponentType::I16,
        DataType::Uint16 => ComponentType::U16,
        DataType::Uint32 => ComponentType::U32,
        DataType::Float32 => ComponentType::F32,
        _ => {
            return Err(
                "the stream has numbers of 64 bits, or none; allowed: integers of 8 or 16 bits, unsigned integers of \
                 32 bits, floats of 32 bits"
                    .into(),
            );
        }
    };
    let Checked::Valid(shape) = accessor.type_ else { return Err("its accessor has an unknown type".into()) };
    let width = usize::from(attribute.num_components());
    if stored != kind || width != shape.multiplicity() {
        let (found, expected) = (stored.as_gl_enum(), kind.as_gl_enum());
        let allowed = format!("{} of componentType {expected}, as its accessor says", shape.multiplicity());
        return Err(format!(
            "the stream has {width} numbers of componentType {found} for a vertex; allowed: {allowed}"
        ));
    }
    let size = width * kind.size();
    let stride = usize::try_from(attribute.byte_stride()).unwrap_or(0).max(size);
    let data = attribute.buffer().data();
    let mut values = Vec::with_capacity(points * size);
    for point in 0..points as u32 {
        let at = (attribute.mapped_index(PointIndex(point)).0 as usize).saturating_mul(stride);
        let value = data.get(at..).and_then(|rest| rest.get(..size));
        values.extend_from_slice(value.ok_or("the stream has too few values")?);
    }
    Ok(values)
}

fn component(accessor: &Accessor) -> Result<ComponentType, String> {
    match accessor.component_type {
        Checked::Valid(component) => Ok(component.0),
        Checked::Invalid => Err("an accessor has an unknown componentType".into()),
    }
}
