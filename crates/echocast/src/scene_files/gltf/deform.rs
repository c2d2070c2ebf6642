//! Deformation of meshes: morph targets, and the joints of their vertices.

use super::primitive::{GltfMeshes, SharedVectors, Triangles, same_count};
use super::skin::{influence_key, influences};
use crate::model::{Mesh, beyond_reach};
use crate::motion::{MorphTarget, PartVertices, Vertices};
use gltf::json::mesh::Primitive;
use gltf::json::{Accessor, Index};
use std::sync::Arc;

/// What changes the shape of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct GltfForm {
    pub skinned: bool,
    pub morphed: bool,
}

impl GltfForm {
    /// Whether anything deforms the mesh.
    pub fn deforms(self) -> bool {
        self.skinned || self.morphed
    }
}

/// A mesh as modelled.
#[derive(Clone)]
pub(super) struct GltfModelled {
    pub mesh: Arc<Mesh>,
    /// The deforming vertices, part by part; empty for a mesh that does not deform.
    pub vertices: Arc<Vertices>,
}

impl GltfMeshes<'_> {
    /// Adds morph targets and joint influences to the vertices of a part.
    pub fn deforming(
        &mut self,
        part: &mut PartVertices,
        primitive: &Primitive,
        form: GltfForm,
        triangles: &Triangles,
        here: &str,
    ) -> Result<(), String> {
        let (used, vertices) = (triangles.used.as_deref(), triangles.vertices);
        if form.morphed {
            let targets = primitive.targets.as_ref().map_or(0, Vec::len);
            self.accessors.charge(targets * size_of::<MorphTarget>())?;
            for (number, target) in primitive.targets.iter().flatten().enumerate() {
                let fault = |message: String| format!("morph target {number} {message}");
                let with_normals = target.normals.filter(|_| part.normals.is_some());
                let mut read = |name: &str, index: Option<Index<Accessor>>| {
                    let Some(index) = index else { return Ok(None) };
                    let deltas = self.deltas(name, index, vertices)?;
                    deltas.map(|deltas| self.pick(&deltas, used)).transpose()
                };
                let positions = read("POSITION", target.positions).map_err(fault)?;
                let normals = read("NORMAL", with_normals).map_err(fault)?;
                part.targets.push(MorphTarget { positions, normals });
            }
        }
        if form.skinned {
            let key = influence_key(primitive);
            let all = match self.cache.influences.get(&key) {
                Some(known) => known.clone(),
                None => influences(self.accessors, primitive, vertices, &mut self.notes, here)?,
            };
            let joints = all.joints.iter().map(|set| self.pick(set, used));
            part.joints = joints.collect::<Result<_, _>>()?;
            let weights = all.weights.iter().map(|set| self.pick(set, used));
            part.weights = weights.collect::<Result<_, _>>()?;
            self.cache.influences.insert(key, all);
        }
        Ok(())
    }

    /// The deltas of a morph target for `vertices` vertices; `None`: all are zero.
    fn deltas(
        &mut self,
        name: &str,
        index: Index<Accessor>,
        vertices: usize,
    ) -> Result<Option<SharedVectors<3>>, String> {
        let fault = |message: String| format!("{name}: {message}");
        same_count(name, self.accessors.describe(index).map_err(fault)?, vertices)?;
        if let Some(known) = self.cache.deltas.get(&index.value()) {
            return Ok(known.clone());
        }
        let deltas = self.accessors.vectors::<3>(index).map_err(fault)?;
        if let Some(vertex) = beyond_reach(&deltas) {
            return Err(fault(format!("vertex {vertex} has {:?}; allowed: -1e18 to 1e18", deltas[vertex])));
        }
        let deltas = deltas.iter().any(|delta| *delta != [0.0; 3]).then(|| SharedVectors::from(deltas));
        self.cache.deltas.insert(index.value(), deltas.clone());
        Ok(deltas)
    }
}
