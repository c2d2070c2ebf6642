//! Morph targets: their weights and numbers (glTF 2.0, 3.7.2.2).

use super::GltfDocument;
use super::accessor::Accessors;
use super::animation::{GltfCourse, GltfProperty, GltfTracks};
use crate::motion::AnimationTrack;
use gltf::json::mesh::Mesh;

/// Weights of the morph targets of a node's mesh.
pub(super) struct MorphWeights {
    /// At time 0.
    pub now: Vec<f64>,
    /// Over time.
    pub track: Option<AnimationTrack>,
}

impl MorphWeights {
    /// The weights of `node`, whose mesh is `mesh`.
    pub fn read(
        document: &GltfDocument<'_>,
        accessors: &Accessors<'_>,
        tracks: &GltfTracks,
        node: usize,
        mesh: usize,
    ) -> Result<MorphWeights, String> {
        let mut track = None;
        let now = match tracks.get(GltfProperty::Weights(node)) {
            Some(GltfCourse::Still(weights)) => weights.clone(),
            Some(GltfCourse::Moving(moving)) => {
                let mut now = vec![0.0; moving.curve.width];
                moving.at(0.0, &mut now);
                track = Some(moving.clone());
                now
            }
            None => {
                let json = &document.json;
                let own = json.nodes[node].weights.as_ref().or(json.meshes[mesh].weights.as_ref());
                accessors.charge(own.map_or(0, Vec::len) * size_of::<f64>())?;
                own.into_iter().flatten().map(|&weight| f64::from(weight)).collect()
            }
        };
        if let Some(bad) = now.iter().position(|weight| !weight.is_finite()) {
            return Err(format!("its weight {bad} is {}; allowed: finite numbers", now[bad]));
        }
        let weights = MorphWeights { now, track };
        // Meshes that stay as modelled are read as if they had no targets.
        if weights.have_effect() {
            let (found, expected) = (weights.now.len(), targets(document, mesh)?);
            if found != expected {
                return Err(format!("it has {found} weights for {expected} morph targets"));
            }
        }
        Ok(weights)
    }

    /// Whether they ever change the mesh.
    pub fn have_effect(&self) -> bool {
        self.track.is_some() || self.now.iter().any(|&weight| weight != 0.0)
    }
}

/// How many morph targets the primitives of a mesh have: the number of the first, and another primitive's that differs,
/// if any.
pub(super) fn target_counts(mesh: &Mesh) -> [usize; 2] {
    let mut counts = mesh.primitives.iter().map(|primitive| primitive.targets.as_ref().map_or(0, Vec::len));
    let first = counts.next().unwrap_or(0);
    [first, counts.find(|&count| count != first).unwrap_or(first)]
}

/// How many morph targets mesh `index` has.
fn targets(document: &GltfDocument<'_>, index: usize) -> Result<usize, String> {
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
