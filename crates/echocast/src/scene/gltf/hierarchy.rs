//! The node tree, flattened: every node of the scene with its place in the world.

use super::Document;
use super::extras::text;
use crate::ground::error::Result;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde::Deserialize;

/// World from glTF: y up becomes z up, (x, y, z) -> (x, -z, y).
const Z_UP_FROM_Y_UP: DAffine3 =
    DAffine3 { matrix3: DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y), translation: DVec3::ZERO };

/// Placement of a node in its parent, in double precision: survey coordinates need it, and the `gltf` crate reads
/// single precision.
#[derive(Deserialize)]
pub(super) struct Transform {
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

impl Transform {
    fn parent_from_node(&self) -> Result<DAffine3, String> {
        if let Some(matrix) = &self.matrix {
            let matrix = DMat4::from_cols_array(matrix);
            let last_row = matrix.row(3);
            if !last_row.abs_diff_eq(glam::DVec4::W, 1e-6) {
                return Err(format!("the last row of its matrix is {last_row}; allowed: [0, 0, 0, 1]"));
            }
            return Ok(DAffine3::from_mat4(matrix));
        }
        let rotation = match self.rotation.map(DQuat::from_array) {
            None => DQuat::IDENTITY,
            // Files hold rounded quaternions.
            Some(q) if q.length().is_normal() => q.normalize(),
            Some(q) => return Err(format!("its rotation {q} has no direction; allowed: a unit quaternion")),
        };
        let scale = self.scale.map_or(DVec3::ONE, DVec3::from);
        let translation = self.translation.map_or(DVec3::ZERO, DVec3::from);
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    }
}

/// A node of the scene.
pub(super) struct Placed<'a> {
    /// Index of the node.
    pub node: usize,
    pub world_from_node: DAffine3,
    /// `categoryID` of the node or its nearest ancestor.
    pub category: Option<&'a str>,
    /// `partID` of the node or its nearest ancestor.
    pub part: Option<&'a str>,
}

/// `categoryID` and `partID` of every node that has them.
pub(super) fn label_extras(document: &Document<'_>) -> Vec<[Option<String>; 2]> {
    let nodes = document.json.nodes.iter();
    nodes.map(|node| ["categoryID", "partID"].map(|key| text(&node.extras, key))).collect()
}

/// The nodes of the default scene, else of the first, else all, parents before children, in the file's order.
pub(super) fn walk<'a>(document: &Document<'_>, labels: &'a [[Option<String>; 2]]) -> Result<Vec<Placed<'a>>> {
    let nodes = &document.json.nodes;
    let parents = parents(document)?;
    let mut stack: Vec<Placed<'a>> = roots(document, &parents)?
        .into_iter()
        .rev()
        .map(|node| Placed { node, world_from_node: Z_UP_FROM_Y_UP, category: None, part: None })
        .collect();
    let mut placed = Vec::new();
    // On the stack a node still has its parent's transform and labels.
    while let Some(Placed { node, world_from_node: world_from_parent, category, part }) = stack.pop() {
        let fault = |message| document.error(document.node_place(node), message);
        let world_from_node = world_from_parent * document.transforms[node].parent_from_node().map_err(fault)?;
        if !world_from_node.is_finite() {
            return Err(fault("its place in the world is not finite".into()));
        }
        let [own_category, own_part] = &labels[node];
        let (category, part) = (own_category.as_deref().or(category), own_part.as_deref().or(part));
        for child in nodes[node].children.iter().flatten().rev() {
            stack.push(Placed { node: child.value(), world_from_node, category, part });
        }
        placed.push(Placed { node, world_from_node, category, part });
    }
    Ok(placed)
}

/// Parent of every node; an error if the nodes form no forest.
fn parents(document: &Document<'_>) -> Result<Vec<Option<usize>>> {
    let nodes = &document.json.nodes;
    let children = |node: usize| nodes[node].children.iter().flatten().map(|child| child.value());
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for node in 0..nodes.len() {
        for child in children(node) {
            let fault = |message| Err(document.error(document.node_place(node), message));
            match parents.get_mut(child) {
                Some(parent @ None) => *parent = Some(node),
                Some(Some(other)) => {
                    let other = document.node_place(*other);
                    return fault(format!("its child {child} is already a child of {other}; a node has one parent"));
                }
                None => return fault(format!("its child {child} does not exist: the file has {} nodes", nodes.len())),
            }
        }
    }
    // With one parent each, the nodes that no root reaches are those in and below cycles.
    let mut reached = vec![false; nodes.len()];
    let mut stack: Vec<usize> = (0..nodes.len()).filter(|&node| parents[node].is_none()).collect();
    while let Some(node) = stack.pop() {
        reached[node] = true;
        stack.extend(children(node));
    }
    match reached.iter().position(|&reached| !reached) {
        Some(node) => {
            Err(document.error(document.node_place(node), "it is, or lies below, its own ancestor (a cycle)"))
        }
        None => Ok(parents),
    }
}

/// Top nodes of the scene to be read.
fn roots(document: &Document<'_>, parents: &[Option<usize>]) -> Result<Vec<usize>> {
    let scenes = &document.json.scenes;
    let wanted = document.json.scene.map(|scene| scene.value());
    if let Some(missing) = wanted.filter(|&scene| scene >= scenes.len()) {
        return Err(document.error("", format!("its scene {missing} does not exist: the file has {}", scenes.len())));
    }
    let index = wanted.unwrap_or(0);
    let Some(scene) = scenes.get(index) else {
        return Ok((0..parents.len()).filter(|&node| parents[node].is_none()).collect());
    };
    let fault = |message| Err(document.error(super::place("scene", index, scene.name.as_deref()), message));
    let mut listed = vec![false; parents.len()];
    for node in scene.nodes.iter().map(|node| node.value()) {
        match parents.get(node) {
            None => return fault(format!("its node {node} does not exist: the file has {} nodes", parents.len())),
            Some(Some(parent)) => {
                return fault(format!("its node {node} is a child of node {parent}; allowed: nodes without a parent"));
            }
            Some(None) if listed[node] => return fault(format!("it lists node {node} twice")),
            Some(None) => listed[node] = true,
        }
    }
    Ok(scene.nodes.iter().map(|node| node.value()).collect())
}
