//! Skeletons: the bones that move a mesh at a node.

use super::affine;
use super::budget::Budget;
use super::nodes::{FbxNodes, number};
use crate::hierarchy::TimelineNodes;
use glam::{DAffine3, DVec3};
use model::motion::Skin;
use std::sync::Arc;
use ufbx::{Node, SkinDeformer};

/// Bone numbers have 16 bits, and there may be one additional bone, see [`FbxSkeleton`].
const MOST_BONES: usize = 65534;

/// The bones of a mesh at a node: those of its skin, and as an additional bone the node itself.
pub(super) struct FbxSkeleton {
    pub skin: Arc<Skin>,
    /// World transforms of its bones at time 0.
    pub world_from_bones: Vec<DAffine3>,
    /// Whether any of them moves.
    pub moves: bool,
}

impl FbxSkeleton {
    /// The bones of `skin` for the mesh of `node`, whose origin is `middle`. They are nodes of the timeline if any of
    /// them moves, or if the mesh `morphs`.
    pub fn read(
        skin: &SkinDeformer,
        node: &Node,
        middle: DVec3,
        morphs: bool,
        nodes: &mut TimelineNodes<FbxNodes<'_>>,
        budget: &Budget,
    ) -> Result<FbxSkeleton, String> {
        let count = skin.clusters.len();
        if count > MOST_BONES {
            return Err(format!("its skin has {count} bones; allowed: {MOST_BONES}"));
        }
        budget.charge(count * (3 * size_of::<DAffine3>()))?;
        let origin = DAffine3::from_translation(middle);
        let of_skin = skin.clusters.into_iter().filter_map(|cluster| {
            let bone: &Node = cluster.bone_node.as_deref()?;
            Some((bone, affine(&cluster.geometry_to_bone) * origin))
        });
        let (bones, joint_from_mesh): (Vec<&Node>, Vec<DAffine3>) =
            of_skin.chain([(node, affine(&node.geometry_to_node) * origin)]).unzip();
        if bones.len() != count + 1 {
            return Err("its skin has a bone that is not a node".into());
        }
        if let Some(bad) = joint_from_mesh.iter().position(|matrix| !matrix.is_finite()) {
            return Err(format!("bone {bad} of its skin is bound by a matrix that is not finite"));
        }
        let placed = |bone: &&Node| nodes.file.tree.get(bone.element.typed_id as usize);
        let moves = bones.iter().any(|bone| placed(bone).moves);
        let world_from_bones = bones.iter().map(|bone| placed(bone).world_from_node).collect();
        let mut read = Skin::new(Vec::new(), joint_from_mesh);
        if moves || morphs {
            read.joints = bones.into_iter().map(|bone| nodes.number(number(bone))).collect::<Result<_, _>>()?;
        }
        Ok(FbxSkeleton { skin: Arc::new(read), world_from_bones, moves })
    }
}
