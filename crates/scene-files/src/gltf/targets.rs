//! How many morph targets meshes have.

use super::GltfDocument;
use gltf::json::mesh::Mesh;

/// How many morph targets the primitives of a mesh have: the number of the first, and another primitive's that differs,
/// if any.
pub(super) fn target_counts(mesh: &Mesh) -> [usize; 2] {
    let mut counts = mesh.primitives.iter().map(|primitive| primitive.targets.as_ref().map_or(0, Vec::len));
    let first = counts.next().unwrap_or(0);
    [first, counts.find(|&count| count != first).unwrap_or(first)]
}

/// How many morph targets mesh `index` has.
pub(super) fn targets(document: &GltfDocument<'_>, index: usize) -> Result<usize, String> {
    let [first, other] = document.targets[index];
    if first == other {
        return Ok(first);
    }
    Err(format!("its mesh {index} has primitives with {first} and {other} morph targets; allowed: one number"))
}

/// How many morph targets the mesh of a node has, at least one.
pub(super) fn targets_of_node(document: &GltfDocument<'_>, node: usize) -> Result<usize, String> {
    let mesh = document.json.nodes[node].mesh.map(|mesh| mesh.value()).filter(|&mesh| mesh < document.targets.len());
    match mesh.map(|mesh| targets(document, mesh)) {
        Some(Ok(0)) | None => {
            let node = document.node_place(node);
            Err(format!("{node} has no mesh with morph targets, so it cannot have animated weights"))
        }
        Some(count) => count,
    }
}
