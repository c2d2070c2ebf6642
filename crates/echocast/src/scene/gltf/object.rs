//! Objects: what the meshes of nodes become, still, moving or changing their shape.

use super::animation::Tracks;
use super::deform::{Form, Modelled};
use super::hierarchy::{Ancestry, Placed};
use super::instancing;
use super::morph::Weights;
use super::nodes::Nodes;
use super::primitive::Meshes;
use super::skin::{Skeleton, Skins, check_joints};
use crate::ground::error::Result;
use crate::motion::{Motion, Shape};
use crate::scene::pose::pose;
use crate::scene::{Ancestor, Mesh, RawObject, UpAxis, cofactors};
use glam::{DAffine3, DMat3};
use std::collections::HashMap;
use std::sync::Arc;

/// Turns nodes into objects.
pub(super) struct Objects<'a> {
    pub meshes: Meshes<'a>,
    pub nodes: Nodes<'a>,
    pub list: Vec<RawObject>,
    ancestry: Ancestry<'a>,
    tracks: &'a Tracks,
    skins: Skins<'a>,
    /// Meshes that stay as morph targets make them, by mesh and bits of the weights; `None`: nothing is left of it.
    morphed: HashMap<(usize, Vec<u64>), Option<Arc<Mesh>>>,
}

/// The mesh of a node, as it is at time 0.
struct Posed {
    mesh: Arc<Mesh>,
    /// How it changes over time.
    shape: Option<Arc<Shape>>,
    /// Where it is, if its skeleton decides.
    world_from_object: Option<DAffine3>,
}

impl<'a> Objects<'a> {
    pub fn new(meshes: Meshes<'a>, nodes: Nodes<'a>, ancestry: Ancestry<'a>, tracks: &'a Tracks) -> Self {
        let skins = Skins::new(meshes.document, meshes.accessors);
        Objects { meshes, nodes, list: Vec::new(), ancestry, tracks, skins, morphed: HashMap::new() }
    }

    /// Adds the objects that a node represents: none, one, or all its instances.
    pub fn add(&mut self, placed: &Placed<'_>) -> Result<()> {
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
        let Some(Posed { mesh, shape, world_from_object }) = self.posed(placed, index)? else { return Ok(()) };
        let name =
            node.name.clone().or_else(|| source.name.clone()).unwrap_or_else(|| format!("object_{}", placed.node));
        let text = name.len() + placed.category.map_or(0, str::len) + placed.part.map_or(0, str::len);
        let each = size_of::<RawObject>() + text;
        let mut instances = instancing::node_from_instances(self.meshes.accessors, node, each).map_err(fault)?;
        if world_from_object.is_some() && instances.take().is_some() {
            self.meshes.notes.add("instances of meshes with a skin are left out but for one", here);
        }
        let has_node = instances.is_none();
        if has_node {
            self.meshes.accessors.charge(each).map_err(fault)?;
        }
        let ancestors = self.ancestry.of(placed.node, has_node);
        self.meshes.accessors.charge(ancestors.len() * size_of::<Ancestor>()).map_err(fault)?;
        for node_from_object in instances.unwrap_or_else(|| vec![DAffine3::IDENTITY]) {
            let world_from_object = world_from_object.unwrap_or(placed.world_from_node * node_from_object);
            // Objects squeezed flat can still be seen.
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
        placed: &Placed<'_>,
        shape: Option<Arc<Shape>>,
        node_from_object: DAffine3,
        world_from_object: &DAffine3,
    ) -> Result<Option<Motion>, String> {
        let skinned = self.meshes.document.json.nodes[placed.node].skin.is_some();
        if shape.is_none() && !placed.blinks && (skinned || !placed.moves) {
            return Ok(None);
        }
        if skinned {
            let node = self.nodes.frame(*world_from_object, placed.node)?;
            return Ok(Some(Motion { node, node_from_object: DAffine3::IDENTITY, shape }));
        }
        Ok(Some(Motion { node: self.nodes.number(placed.node)?, node_from_object, shape }))
    }

    /// The mesh of a node, which is the file's mesh `index`; `None` if it has nothing to scan.
    fn posed(&mut self, placed: &Placed<'_>, index: usize) -> Result<Option<Posed>> {
        let document = self.meshes.document;
        let node = &document.json.nodes[placed.node];
        let fault = |message: String| document.error(document.node_place(placed.node), message);
        let weights = Weights::read(document, self.meshes.accessors, self.tracks, placed.node, index).map_err(fault)?;
        let form = Form { skinned: node.skin.is_some(), morphed: weights.work() };
        if !form.deforms() {
            let modelled = self.meshes.get(index, form)?;
            return Ok(modelled.map(|Modelled { mesh, .. }| Posed { mesh, shape: None, world_from_object: None }));
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
            return Ok(known.clone().map(|mesh| Posed { mesh, shape: None, world_from_object: None }));
        }
        let Some(modelled) = self.meshes.get(index, form)? else { return Ok(None) };
        // In the world's directions at the first joint, so that single precision suffices in survey coordinates.
        let frame = |skeleton: &Skeleton| DAffine3::from_translation(skeleton.world_from_joints[0].translation);
        let world_from_object = skeleton.as_ref().map(frame);
        let shape = Shape {
            vertices: modelled.vertices,
            weights: if form.morphed { weights.now } else { Vec::new() },
            weights_track: weights.track,
            skin: skeleton.as_ref().map(|skeleton| skeleton.skin.clone()),
            cache: None,
        };
        let mut palette = Vec::new();
        self.meshes.accessors.charge(skeleton.as_ref().map_or(0, Skeleton::palette_bytes)).map_err(fault)?;
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
        Ok(mesh.map(|mesh| Posed { mesh, shape, world_from_object }))
    }
}
