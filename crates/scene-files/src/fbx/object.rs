//! Objects made from the meshes of nodes: still, moving or deforming.

use super::affine;
use super::animation::FbxTracks;
use super::bake::FbxCourse;
use super::deform::{self, FbxForm};
use super::hierarchy::{FbxAncestry, FbxPlaced};
use super::mesh::{FbxMeshes, FbxModelled};
use super::names::{named, place};
use super::nodes::{FbxNodes, number};
use super::skeleton::FbxSkeleton;
use crate::hierarchy::TimelineNodes;
use glam::{DAffine3, DMat3};
use ground::error::Result;
use ground::math::cofactors;
use model::motion::{AnimationTrack, Deformation, Motion};
use model::{Ancestor, Mesh, RawObject, UpAxis, pose};
use std::sync::Arc;

/// Turns nodes into objects.
pub(super) struct FbxObjects<'a> {
    pub meshes: FbxMeshes<'a>,
    pub nodes: TimelineNodes<FbxNodes<'a>>,
    pub list: Vec<RawObject>,
    ancestry: FbxAncestry<'a>,
    tracks: &'a FbxTracks,
}

/// The mesh of a node, as it is at time 0.
struct FbxPosed {
    mesh: Arc<Mesh>,
    /// How its shape changes over time.
    shape: Option<Arc<Deformation>>,
    /// Transform relative to its node.
    node_from_object: DAffine3,
    /// World transform, if its skeleton determines it.
    world_from_object: Option<DAffine3>,
}

impl<'a> FbxObjects<'a> {
    pub fn new(
        meshes: FbxMeshes<'a>,
        nodes: TimelineNodes<FbxNodes<'a>>,
        ancestry: FbxAncestry<'a>,
        tracks: &'a FbxTracks,
    ) -> Self {
        FbxObjects { meshes, nodes, list: Vec::new(), ancestry, tracks }
    }

    /// Adds the object that a node represents, if any.
    pub fn add(&mut self, placed: &FbxPlaced<'a>) -> Result<()> {
        let document = self.meshes.document;
        let node = placed.node;
        let Some(mesh) = node.mesh.as_deref().filter(|_| !placed.hidden) else {
            if node.attrib_type == ufbx::ElementType::NurbsSurface {
                self.meshes.notes.add("NURBS surfaces are skipped", || place(node));
            }
            return Ok(());
        };
        let fault = |message: String| document.error(place(node), message);
        let Some(posed) = self.posed(placed, mesh)? else { return Ok(()) };
        let world_from_object = posed.world_from_object.unwrap_or(placed.world_from_node * posed.node_from_object);
        if !world_from_object.is_finite() {
            return Err(fault("the world transform of its mesh is not finite".into()));
        }
        // Objects scaled flat are still visible.
        if cofactors(&world_from_object.matrix3) == DMat3::ZERO && !placed.scales {
            self.meshes.notes.add("objects scaled to a line or a point are left out", || place(node));
            return Ok(());
        }
        let ancestors = self.ancestry.of(node);
        let name = [&named(node).element.name, &mesh.element.name].into_iter().find(|name| !name.is_empty());
        let name = name.map_or_else(|| format!("object_{}", node.element.typed_id), |name| name.to_string());
        let text = name.len() + placed.category.map_or(0, str::len) + placed.part.map_or(0, str::len);
        let bytes = size_of::<RawObject>() + text + ancestors.len() * size_of::<Ancestor>();
        document.budget.charge(bytes).map_err(fault)?;
        let up = if posed.world_from_object.is_some() { UpAxis::Z } else { UpAxis::Y };
        let object = RawObject {
            name,
            motion: self.motion(placed, &posed, &world_from_object).map_err(fault)?,
            mesh: posed.mesh,
            world_from_object,
            up,
            category: placed.category.map(str::to_owned),
            part: placed.part.map(str::to_owned),
            ancestors,
            has_node: true,
        };
        self.list.push(object);
        Ok(())
    }

    /// How the object of a node follows the timeline.
    fn motion(
        &mut self,
        placed: &FbxPlaced<'_>,
        posed: &FbxPosed,
        world_from_object: &DAffine3,
    ) -> Result<Option<Motion>, String> {
        let skinned = posed.world_from_object.is_some();
        if posed.shape.is_none() && !placed.visibility_changes && (skinned || !placed.moves) {
            return Ok(None);
        }
        let shape = posed.shape.clone();
        if skinned {
            let node = self.nodes.frame(*world_from_object, placed.node.element.typed_id as usize)?;
            return Ok(Some(Motion { node, node_from_object: DAffine3::IDENTITY, shape }));
        }
        let node = self.nodes.number(number(placed.node))?;
        Ok(Some(Motion { node, node_from_object: posed.node_from_object, shape }))
    }

    /// The mesh of a node; `None` if it has nothing to scan.
    fn posed(&mut self, placed: &FbxPlaced<'a>, source: &'a ufbx::Mesh) -> Result<Option<FbxPosed>> {
        let document = self.meshes.document;
        let fault = |message: String| document.error(place(placed.node), message);
        let (weights, track) = self.weights(source).map_err(fault)?;
        let bones = deform::skin(source);
        let form = FbxForm { skinned: bones.is_some(), morphed: track.is_some() || weights.iter().any(|&w| w != 0.0) };
        let Some(FbxModelled { mesh, vertices, middle }) = self.meshes.get(placed.node, source, form)? else {
            return Ok(None);
        };
        let node_from_object = affine(&placed.node.geometry_to_node) * DAffine3::from_translation(middle);
        if !form.deforms() {
            return Ok(Some(FbxPosed { mesh, shape: None, node_from_object, world_from_object: None }));
        }
        let skeleton = bones.map(|bones| {
            if bones.skinning_method == ufbx::SkinningMethod::DualQuaternion {
                self.meshes.notes.add("dual-quaternion skins are read as linear ones", || place(placed.node));
            }
            FbxSkeleton::read(bones, placed.node, middle, track.is_some(), &mut self.nodes, document.budget)
        });
        let skeleton = skeleton.transpose().map_err(fault)?;
        let stays = track.is_none() && skeleton.as_ref().is_none_or(|skeleton| !skeleton.moves);
        // A frame with the world's axes at the first bone, so that single precision suffices in survey coordinates.
        let frame = |skeleton: &FbxSkeleton| DAffine3::from_translation(skeleton.world_from_bones[0].translation);
        let world_from_object = skeleton.as_ref().map(frame);
        let shape = Deformation {
            vertices,
            weights: if form.morphed { weights } else { Vec::new() },
            weights_track: track,
            skin: skeleton.as_ref().map(|skeleton| skeleton.skin.clone()),
            cache: None,
        };
        let mut palette = Vec::new();
        if let (Some(skeleton), Some(world_from_object)) = (&skeleton, &world_from_object) {
            let bones = skeleton.world_from_bones.iter().copied();
            palette.extend(skeleton.skin.palette_of(bones, world_from_object));
        }
        let charge = |bytes| document.budget.charge(bytes);
        let (mesh, degenerate) = pose(&mesh, &shape, &palette, stays, charge).map_err(fault)?;
        self.meshes.degenerate_triangles += degenerate;
        let shape = (!stays).then(|| Arc::new(shape));
        Ok(mesh.map(|mesh| FbxPosed { mesh: Arc::new(mesh), shape, node_from_object, world_from_object }))
    }

    /// Weights of the blend shapes of a mesh, at time 0 and over time.
    fn weights(&self, mesh: &ufbx::Mesh) -> Result<(Vec<f64>, Option<AnimationTrack>), String> {
        let (now, track) = match self.tracks.of_mesh(mesh) {
            None | Some(FbxCourse::NotAnimated) => (deform::weights(mesh, |channel| channel.weight), None),
            Some(FbxCourse::Still(weights)) => (weights.clone(), None),
            Some(FbxCourse::Moving(track)) => {
                let mut now = vec![0.0; track.curve.width];
                track.at(0.0, &mut now);
                (now, Some(track.clone()))
            }
        };
        match now.iter().find(|weight| !weight.is_finite()) {
            Some(bad) => Err(format!("a blend shape has the weight {bad}; allowed: finite numbers")),
            None => Ok((now, track)),
        }
    }
}

/// Sets which axis of `objects` points up: y or z, whichever does for most of them, as files do not specify it. Models
/// made in a z-up program keep their own axes in a y-up file.
pub(super) fn upright(mut objects: Vec<RawObject>) -> Vec<RawObject> {
    let is_own = |object: &&RawObject| object.up == UpAxis::Y;
    let (mut y, mut z) = (0.0, 0.0);
    for DMat3 { y_axis, z_axis, .. } in objects.iter().filter(is_own).map(|object| object.world_from_object.matrix3) {
        y += y_axis.normalize_or_zero().z.abs();
        z += z_axis.normalize_or_zero().z.abs();
    }
    if z > y {
        objects.iter_mut().for_each(|object| object.up = UpAxis::Z);
    }
    objects
}
