//! Skins: the joints that move vertices (glTF 2.0, 3.7.3).

use super::accessor::Accessors;
use super::nodes::GltfNodes;
use super::{GltfDocument, place};
use crate::hierarchy::TimelineNodes;
use glam::{DAffine3, DMat4};
use ground::error::Result;
use model::motion::{PartVertices, Skin};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

/// Joint numbers have 16 bits.
const MOST_JOINTS: usize = 65535;

/// A skeleton of the file.
#[derive(Clone)]
pub(super) struct GltfSkeleton {
    /// Its joints are nodes of the timeline if something moves; otherwise it has none.
    pub skin: Arc<Skin>,
    /// Joints, as nodes of the file.
    joints: Arc<Vec<usize>>,
    /// World transforms of its joints at time 0.
    pub world_from_joints: Arc<Vec<DAffine3>>,
    /// Whether any of its joints moves.
    pub moves: bool,
}

/// Reads the skins that nodes use, each once.
pub(super) struct Skins<'a> {
    document: &'a GltfDocument<'a>,
    accessors: &'a Accessors<'a>,
    known: HashMap<usize, GltfSkeleton>,
}

impl<'a> Skins<'a> {
    pub fn new(document: &'a GltfDocument<'a>, accessors: &'a Accessors<'a>) -> Self {
        Skins { document, accessors, known: HashMap::new() }
    }

    /// The file's skin `index`, which exists. `morphs`: its mesh changes even if its joints do not.
    pub fn get(
        &mut self,
        index: usize,
        morphs: bool,
        nodes: &mut TimelineNodes<GltfNodes<'_>>,
    ) -> Result<GltfSkeleton> {
        let document = self.document;
        let here = || place("skin", index, document.json.skins[index].name.as_deref());
        let fault = |message: String| document.error(here(), message);
        let skeleton = match self.known.entry(index) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => {
                new.insert(GltfSkeleton::read(document, self.accessors, index, nodes).map_err(fault)?)
            }
        };
        if (morphs || skeleton.moves) && skeleton.skin.joints.is_empty() {
            let numbers = skeleton.joints.iter().map(|&joint| nodes.number(Some(joint)));
            Arc::make_mut(&mut skeleton.skin).joints = numbers.collect::<Result<_, _>>().map_err(fault)?;
        }
        Ok(skeleton.clone())
    }
}

impl GltfSkeleton {
    /// Memory of one pose of its joints.
    pub fn palette_bytes(&self) -> usize {
        self.world_from_joints.len() * size_of::<DAffine3>()
    }

    fn read(
        document: &GltfDocument<'_>,
        accessors: &Accessors<'_>,
        index: usize,
        nodes: &TimelineNodes<GltfNodes<'_>>,
    ) -> Result<GltfSkeleton, String> {
        let json = &document.json;
        let source = &json.skins[index];
        let count = source.joints.len();
        if !(1..=MOST_JOINTS).contains(&count) {
            return Err(format!("it has {count} joints; allowed: 1 to {MOST_JOINTS}"));
        }
        accessors.charge(count * (2 * size_of::<DAffine3>() + 2 * size_of::<usize>()))?;
        let joints: Vec<usize> = source.joints.iter().map(|joint| joint.value()).collect();
        if let Some(missing) = joints.iter().find(|&&joint| joint >= json.nodes.len()) {
            return Err(format!("its joint {missing} does not exist: the file has {} nodes", json.nodes.len()));
        }
        let joint_from_mesh = match source.inverse_bind_matrices {
            None => vec![DAffine3::IDENTITY; count],
            Some(accessor) => {
                let fault = |message: String| format!("inverseBindMatrices: {message}");
                let found = accessors.describe(accessor).map_err(fault)?.count.0;
                if found < count as u64 {
                    return Err(fault(format!("{found} for {count} joints; allowed: one for each")));
                }
                let matrices = accessors.matrices(accessor).map_err(fault)?;
                let read = matrices.iter().take(count).enumerate();
                read.map(|(joint, matrix)| affine(joint, matrix).map_err(fault)).collect::<Result<_, _>>()?
            }
        };
        let moves = joints.iter().any(|&joint| nodes.file.tree.get(joint).moves);
        let world_from_joints =
            Arc::new(joints.iter().map(|&joint| nodes.file.tree.get(joint).world_from_node).collect());
        let skin = Arc::new(Skin::new(Vec::new(), joint_from_mesh));
        Ok(GltfSkeleton { skin, joints: Arc::new(joints), world_from_joints, moves })
    }
}

/// The inverse bind matrix of a joint; it may be singular, so that all vertices of the joint collapse.
fn affine(joint: usize, matrix: &[f32; 16]) -> Result<DAffine3, String> {
    let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
    if !matrix.is_finite() {
        return Err(format!("that of joint {joint} has a number that is not finite"));
    }
    let last_row = matrix.row(3);
    if !last_row.abs_diff_eq(glam::DVec4::W, 1e-3) {
        return Err(format!("the last row of that of joint {joint} is {last_row}; allowed: [0, 0, 0, 1]"));
    }
    Ok(DAffine3::from_mat4(matrix))
}

/// Checks that all joint numbers of a part are below `count`.
pub(super) fn check_joints(vertices: &PartVertices, count: usize) -> Result<(), String> {
    for joints in &vertices.joints {
        if let Some(vertex) = joints.iter().position(|joints| joints.iter().any(|&joint| usize::from(joint) >= count)) {
            let found = joints[vertex].iter().max().unwrap_or(&0);
            return Err(format!("vertex {vertex} has the joint {found}: its skin has {count} joints"));
        }
    }
    Ok(())
}
