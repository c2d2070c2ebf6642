//! Objects made from the meshes of nodes: still, moving or deforming.

use super::animation::GltfTracks;
use super::deform::GltfForm;
use super::hierarchy::{GltfAncestry, GltfPlaced};
use super::instancing;
use super::morph::MorphWeights;
use super::nodes::GltfNodes;
use super::primitive::{GltfMeshes, GltfModelled};
use super::skin::{GltfSkeleton, Skins, check_joints};
use crate::hierarchy::TimelineNodes;
use glam::{DAffine3, DMat3};
use ground::error::Result;
use ground::math::cofactors;
use model::motion::{Deformation, Motion};
use model::{Ancestor, Mesh, RawObject, UpAxis, pose};
use std::collections::HashMap;
use std::sync::Arc;

/// Turns nodes into objects.
pub(super) struct GltfObjects<'a> {
    pub meshes: GltfMeshes<'a>,
    pub nodes: TimelineNodes<GltfNodes<'a>>,
    pub list: Vec<RawObject>,
    ancestry: GltfAncestry<'a>,
    tracks: &'a GltfTracks,
    skins: Skins<'a>,
    /// Meshes with constant morph weights, by mesh and bits of the weights; `None`: nothing is left of the mesh.
    morphed: HashMap<(usize, Vec<u64>), Option<Arc<Mesh>>>,
}

/// The mesh of a node, as it is at time 0.
struct GltfPosed {
    mesh: Arc<Mesh>,
    /// How its shape changes over time.
    shape: Option<Arc<Deformation>>,
    /// World transform, if its skeleton determines it.
    world_from_object: Option<DAffine3>,
}

impl<'a> GltfObjects<'a> {
    pub fn new(
        meshes: GltfMeshes<'a>,
        nodes: TimelineNodes<GltfNodes<'a>>,
        ancestry: GltfAncestry<'a>,
        tracks: &'a GltfTracks,
    ) -> Self {
        let skins = Skins::new(meshes.document, meshes.accessors);
        GltfObjects { meshes, nodes, list: Vec::new(), ancestry, tracks, skins, morphed: HashMap::new() }
    }

    /// Adds the objects that a node represents: none, one, or all its instances.
    pub fn add(&mut self, placed: &GltfPlaced<'_>) -> Result<()> {
        let document = self.meshes.document;
        let node = &document.json.nodes[placed.node];
        let Some(index) = node.mesh.map(|mesh| mesh.value()) else { return Ok(()) };
        let here = || document.node_place(placed.node);
        let fault = |message: String| document.error(here(), message);
        let Some(source) = document.json.meshes.get(index) else {
            return Err(fault(format!("its mesh {index} does not exist: the file has {}", document.json.meshes.len())));
        };
        if placed.hidden {
            return Ok(());
        }
        let Some(GltfPosed { mesh, shape, world_from_object }) = self.posed(placed, index)? else { return Ok(()) };
        let name =
            node.name.clone().or_else(|| source.name.clone()).unwrap_or_else(|| format!("object_{}", placed.node));
        let text = name.len() + placed.category.map_or(0, str::len) + placed.part.map_or(0, str::len);
        let each = size_of::<RawObject>() + text;
        let mut instances = instancing::node_from_instances(self.meshes.accessors, node, each).map_err(fault)?;
        if world_from_object.is_some() && instances.take().is_some() {
            self.meshes.notes.add("of the instances of a mesh with a skin, all but one are left out", here);
        }
        let has_node = instances.is_none();
        if has_node {
            self.meshes.accessors.charge(each).map_err(fault)?;
        }
        let ancestors = self.ancestry.of(placed.node, has_node);
        self.meshes.accessors.charge(ancestors.len() * size_of::<Ancestor>()).map_err(fault)?;
        for node_from_object in instances.unwrap_or_else(|| vec![DAffine3::IDENTITY]) {
            let world_from_object = world_from_object.unwrap_or(placed.world_from_node * node_from_object);
            // Objects scaled flat are still visible.
            if cofactors(&world_from_object.matrix3) == DMat3::ZERO && !placed.scales {
                self.meshes.notes.add("objects scaled to a line or a point are left out", here);
                continue;
            }
            let motion = self.motion(placed, shape.clone(), node_from_object, &world_from_object).map_err(fault)?;
            let object = RawObject {
                name: name.clone(),
                mesh: mesh.clone(),
                world_from_object,
                up: UpAxis::Y,
                category: placed.category.map(str::to_owned),
                part: placed.part.map(str::to_owned),
                motion,
                ancestors: ancestors.clone(),
                has_node,
            };
            self.list.push(object);
        }
        Ok(())
    }

    /// How an object of a node follows the timeline.
    fn motion(
        &mut self,
        placed: &GltfPlaced<'_>,
        shape: Option<Arc<Deformation>>,
        node_from_object: DAffine3,
        world_from_object: &DAffine3,
    ) -> Result<Option<Motion>, String> {
        let skinned = self.meshes.document.json.nodes[placed.node].skin.is_some();
        if shape.is_none() && !placed.visibility_changes && (skinned || !placed.moves) {
            return Ok(None);
        }
        if skinned {
            let node = self.nodes.frame(*world_from_object, placed.node)?;
            return Ok(Some(Motion { node, node_from_object: DAffine3::IDENTITY, shape }));
        }
        Ok(Some(Motion { node: self.nodes.number(Some(placed.node))?, node_from_object, shape }))
    }

    /// The mesh of a node, which is the file's mesh `index`; `None` if it has nothing to scan.
    fn posed(&mut self, placed: &GltfPlaced<'_>, index: usize) -> Result<Option<GltfPosed>> {
        let document = self.meshes.document;
        let node = &document.json.nodes[placed.node];
        let fault = |message: String| document.error(document.node_place(placed.node), message);
        let weights =
            MorphWeights::read(document, self.meshes.accessors, self.tracks, placed.node, index).map_err(fault)?;
        let form = GltfForm { skinned: node.skin.is_some(), morphed: weights.have_effect() };
        if !form.deforms() {
            let modelled = self.meshes.get(index, form)?;
            return Ok(modelled.map(|GltfModelled { mesh, .. }| GltfPosed {
                mesh,
                shape: None,
                world_from_object: None,
            }));
        }
        let skeleton = match node.skin.map(|skin| skin.value()) {
            Some(missing) if missing >= document.json.skins.len() => {
                let known = document.json.skins.len();
                return Err(fault(format!("its skin {missing} does not exist: the file has {known}")));
            }
            Some(skin) => Some(self.skins.get(skin, weights.track.is_some(), &mut self.nodes)?),
            None => None,
        };
        let key = (index, weights.now.iter().map(|weight| weight.to_bits()).collect());
        let stays = weights.track.is_none() && skeleton.as_ref().is_none_or(|skeleton| !skeleton.moves);
        let shared = skeleton.is_none() && stays;
        if let Some(known) = self.morphed.get(&key).filter(|_| shared) {
            return Ok(known.clone().map(|mesh| GltfPosed { mesh, shape: None, world_from_object: None }));
        }
        let Some(modelled) = self.meshes.get(index, form)? else { return Ok(None) };
        // A frame with the world's axes at the first joint, so that single precision suffices in survey coordinates.
        let frame = |skeleton: &GltfSkeleton| DAffine3::from_translation(skeleton.world_from_joints[0].translation);
        let world_from_object = skeleton.as_ref().map(frame);
        let shape = Deformation {
            vertices: modelled.vertices,
            weights: if form.morphed { weights.now } else { Vec::new() },
            weights_track: weights.track,
            skin: skeleton.as_ref().map(|skeleton| skeleton.skin.clone()),
            cache: None,
        };
        let mut palette = Vec::new();
        self.meshes.accessors.charge(skeleton.as_ref().map_or(0, GltfSkeleton::palette_bytes)).map_err(fault)?;
        if let (Some(skeleton), Some(world_from_object)) = (&skeleton, &world_from_object) {
            let joints = skeleton.world_from_joints.iter().copied();
            palette.extend(skeleton.skin.palette_of(joints, world_from_object));
        }
        for vertices in shape.vertices.parts.iter().filter(|_| shape.skin.is_some()) {
            check_joints(vertices, palette.len()).map_err(fault)?;
        }
        let charge = |bytes| self.meshes.accessors.charge(bytes);
        let (mesh, degenerate) = pose(&modelled.mesh, &shape, &palette, stays, charge).map_err(fault)?;
        self.meshes.degenerate_triangles += degenerate;
        let mesh = mesh.map(Arc::new);
        if shared {
            self.morphed.insert(key, mesh.clone());
        }
        let shape = (!stays).then(|| Arc::new(shape));
        Ok(mesh.map(|mesh| GltfPosed { mesh, shape, world_from_object }))
    }
}
