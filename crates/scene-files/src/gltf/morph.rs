//! Weights of morph targets (glTF 2.0, 3.7.2.2).

use super::GltfDocument;
use super::accessor::Accessors;
use super::animation::{GltfCourse, GltfProperty, GltfTracks};
use super::targets::targets;
use model::motion::AnimationTrack;

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
