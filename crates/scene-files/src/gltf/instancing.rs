//! `EXT_mesh_gpu_instancing`: the mesh of one node, placed many times.

use super::accessor::Accessors;
use glam::{DAffine3, DQuat, DVec3};
use gltf::json::{Index, Node};
use ground::read::yaml;
use serde::Deserialize;

pub(super) const EXTENSION: &str = "EXT_mesh_gpu_instancing";

#[derive(Deserialize)]
struct Extension {
    attributes: Attributes,
}

/// Accessor indices; other attributes are application-specific.
#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "TRANSLATION")]
    translation: Option<u32>,
    #[serde(rename = "ROTATION")]
    rotation: Option<u32>,
    #[serde(rename = "SCALE")]
    scale: Option<u32>,
}

/// Placements of the node's mesh in the frame of the node, `None` for a node without the extension. `each`: additional
/// bytes per instance.
pub(super) fn node_from_instances(
    accessors: &Accessors<'_>,
    node: &Node,
    each: usize,
) -> Result<Option<Vec<DAffine3>>, String> {
    let Some(value) = node.extensions.as_ref().and_then(|all| all.others.get(EXTENSION)) else { return Ok(None) };
    let Extension { attributes } = Deserialize::deserialize(value)
        .map_err(|error: serde_json::Error| format!("{EXTENSION}: {}", yaml::plain(&error.to_string())))?;
    let all = [attributes.translation, attributes.rotation, attributes.scale];
    let mut count = None;
    for index in all.into_iter().flatten() {
        let described = accessors.describe(Index::new(index))?.count.0;
        if count.replace(described).is_some_and(|other| other != described) {
            return Err(format!("{EXTENSION}: its accessors have {described} and other counts; allowed: one count"));
        }
    }
    let Some(count) = count else { return Err(format!("{EXTENSION}: it has no attributes")) };
    // Compressed, a thousand of them take a few bytes of the file.
    let bytes = usize::try_from(count).unwrap_or(usize::MAX).saturating_mul(size_of::<DAffine3>() + each);
    accessors.charge(bytes).map_err(|message| format!("{EXTENSION}: its number of instances, {count}, {message}"))?;
    let translations = attributes.translation.map(|index| accessors.vectors::<3>(Index::new(index))).transpose()?;
    let rotations = attributes.rotation.map(|index| accessors.vectors::<4>(Index::new(index))).transpose()?;
    let scales = attributes.scale.map(|index| accessors.vectors::<3>(Index::new(index))).transpose()?;
    // At least one accessor was read, so the count has been checked against the data.
    let instances: Vec<DAffine3> = (0..count as usize)
        .map(|i| {
            let vector =
                |of: &Option<Vec<[f32; 3]>>, default| of.as_ref().map_or(default, |v| DVec3::from(v[i].map(f64::from)));
            let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |q| DQuat::from_array(q[i].map(f64::from)));
            let (scale, translation) = (vector(&scales, DVec3::ONE), vector(&translations, DVec3::ZERO));
            DAffine3::from_scale_rotation_translation(scale, rotation.normalize(), translation)
        })
        .collect();
    match instances.iter().position(|instance| !instance.is_finite()) {
        Some(bad) => Err(format!("{EXTENSION}: instance {bad} has a transform that is not finite")),
        None => Ok(Some(instances)),
    }
}
