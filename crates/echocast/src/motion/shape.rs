//! Meshes that change their shape: skins, morph targets, caches.

use super::{Cache, Track};
use crate::ground::array::Array;
use glam::DAffine3;
use std::sync::Arc;

/// How an object's mesh changes its shape over time.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    /// What its vertices are before they move; shared by all objects with this mesh.
    pub vertices: Arc<Vertices>,
    /// Weights of the morph targets, where no track says otherwise.
    pub weights: Vec<f64>,
    /// Weights of the morph targets over time.
    pub weights_track: Option<Track>,
    pub skin: Option<Arc<Skin>>,
    pub cache: Option<Arc<Cache>>,
}

/// The vertices of a mesh as they were modelled, part by part.
#[derive(Clone, Debug, Default)]
pub(crate) struct Vertices {
    pub parts: Vec<PartVertices>,
}

/// The vertices of a part, in the order of [`crate::scene::Part::positions`].
#[derive(Clone, Debug, Default)]
pub(crate) struct PartVertices {
    /// As modelled, m.
    pub positions: Array<[f32; 3]>,
    /// Unit normals, where the surface is smooth.
    pub normals: Option<Array<[f32; 3]>>,
    /// Morph targets.
    pub targets: Vec<Target>,
    /// Sets of four joints that move each vertex, numbers in [`Skin::joints`]; one or two sets, or none without skin.
    pub joints: Vec<Array<[u16; 4]>>,
    /// How much each joint does, all sets together 1.
    pub weights: Vec<Array<[f32; 4]>>,
}

/// Where a morph target moves the vertices of a part at weight 1.
#[derive(Clone, Debug, Default)]
pub(crate) struct Target {
    /// m; `None`: nowhere.
    pub positions: Option<Array<[f32; 3]>>,
    /// What it adds to the normals.
    pub normals: Option<Array<[f32; 3]>>,
}

/// A skeleton that moves vertices.
#[derive(Clone, Debug)]
pub(crate) struct Skin {
    /// Nodes of the timeline.
    pub joints: Vec<usize>,
    /// From the mesh as modelled to each joint's own frame.
    pub joint_from_mesh: Vec<DAffine3>,
}

impl Shape {
    /// The same on a timeline whose nodes have numbers `shift` higher.
    pub(super) fn shifted(self, shift: usize) -> Shape {
        let skin = self.skin.map(|skin| {
            let Skin { joints, joint_from_mesh } = Arc::unwrap_or_clone(skin);
            Arc::new(Skin { joints: joints.into_iter().map(|joint| joint + shift).collect(), joint_from_mesh })
        });
        Shape { skin, ..self }
    }
}
