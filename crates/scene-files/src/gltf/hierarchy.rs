//! The node tree, flattened: every node of the scene with its world transform.

use super::animation::{GltfProperty, GltfTracks};
use super::extras::text;
use super::{GltfDocument, instancing};
use crate::hierarchy::PlacedNode;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use gltf::json;
use ground::error::Result;
use model::motion::{Node, Rest};
use model::{Ancestor, MOST_ANCESTORS};
use serde::Deserialize;
use std::collections::HashMap;
use std::sync::Arc;

pub(super) const VISIBILITY: &str = "KHR_node_visibility";

/// World from glTF: y up becomes z up, (x, y, z) -> (x, -z, y).
pub(super) const Z_UP_FROM_Y_UP: DAffine3 =
    DAffine3 { matrix3: DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y), translation: DVec3::ZERO };

/// Placement of a node in its parent, in double precision: survey coordinates need it, and the `gltf` crate reads
/// single precision.
#[derive(Deserialize)]
pub(super) struct GltfTransform {
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

impl GltfTransform {
    /// Whether it is a matrix, which cannot be animated.
    pub fn has_matrix(&self) -> bool {
        self.matrix.is_some()
    }

    fn rest(&self) -> Result<Rest, String> {
        if let Some(matrix) = &self.matrix {
            let matrix = DMat4::from_cols_array(matrix);
            let last_row = matrix.row(3);
            if !last_row.abs_diff_eq(glam::DVec4::W, 1e-6) {
                return Err(format!("the last row of its matrix is {last_row}; allowed: [0, 0, 0, 1]"));
            }
            return Ok(Rest::Whole(DAffine3::from_mat4(matrix)));
        }
        let rotation = match self.rotation.map(DQuat::from_array) {
            None => DQuat::IDENTITY,
            // Quaternions in files are rounded.
            Some(q) if q.length().is_normal() => q.normalize(),
            Some(q) => return Err(format!("its rotation {q} has no direction; allowed: a unit quaternion")),
        };
        let scale = self.scale.map_or(DVec3::ONE, DVec3::from);
        let translation = self.translation.map_or(DVec3::ZERO, DVec3::from);
        Ok(Rest::Parts { translation, rotation, scale })
    }
}

/// The index of a node, with its world transform.
pub(super) type GltfPlaced<'a> = PlacedNode<'a, usize>;

/// The nodes of a file that are used.
pub(super) struct GltfTree<'a> {
    /// Those of the scene, then those needed only for joints; parents before their children.
    placed: Vec<GltfPlaced<'a>>,
    /// How many are in the scene.
    in_scene: usize,
    /// For every node of the file, its number in `placed`.
    numbers: Vec<Option<u32>>,
    /// For every node of the file.
    pub parents: Vec<Option<usize>>,
}

impl<'a> GltfTree<'a> {
    /// The nodes of the default scene, else of the first, else all, in the file's order.
    pub fn scene(&self) -> &[GltfPlaced<'a>] {
        &self.placed[..self.in_scene]
    }

    /// A node of the scene, a joint, or an ancestor of these.
    pub fn get(&self, node: usize) -> &GltfPlaced<'a> {
        &self.placed[self.numbers[node].unwrap_or_default() as usize]
    }

    /// Computes the world transforms of the nodes of the scene; of other nodes only if joints are among them.
    pub fn read(
        document: &GltfDocument<'_>,
        labels: &'a [[Option<String>; 2]],
        tracks: &GltfTracks,
    ) -> Result<GltfTree<'a>> {
        let parents = parents(document)?;
        let numbers = vec![None; parents.len()];
        let mut tree = GltfTree { placed: Vec::new(), in_scene: 0, numbers, parents };
        let roots = roots(document, &tree.parents)?;
        tree.walk(roots, document, labels, tracks)?;
        tree.in_scene = tree.placed.len();
        let mut joints = document.json.skins.iter().flat_map(|skin| &skin.joints);
        if joints.any(|joint| tree.numbers.get(joint.value()).is_some_and(Option::is_none)) {
            let other = |&node: &usize| tree.parents[node].is_none() && tree.numbers[node].is_none();
            let others = (0..tree.parents.len()).filter(other).collect();
            tree.walk(others, document, labels, tracks)?;
        }
        Ok(tree)
    }

    /// Adds `roots` and their descendants to `placed`.
    fn walk(
        &mut self,
        roots: Vec<usize>,
        document: &GltfDocument<'_>,
        labels: &'a [[Option<String>; 2]],
        tracks: &GltfTracks,
    ) -> Result<()> {
        let nodes = &document.json.nodes;
        let root = |node| PlacedNode::top(node, Z_UP_FROM_Y_UP);
        let mut stack: Vec<GltfPlaced<'a>> = roots.into_iter().rev().map(root).collect();
        // On the stack a node still has the values of its parent.
        while let Some(mut placed) = stack.pop() {
            let node = placed.node;
            let fault = |message| document.error(document.node_place(node), message);
            let Local { node: local, hidden } = Local::read(document, tracks, node).map_err(fault)?;
            placed.add_own(&local, hidden, &labels[node]).map_err(fault)?;
            for child in nodes[node].children.iter().flatten().rev() {
                stack.push(GltfPlaced { node: child.value(), ..placed });
            }
            self.numbers[node] = u32::try_from(self.placed.len()).ok();
            self.placed.push(placed);
        }
        Ok(())
    }
}

/// The ancestors of objects, each node once.
pub(super) struct GltfAncestry<'a> {
    document: &'a GltfDocument<'a>,
    labels: &'a [[Option<String>; 2]],
    parents: &'a [Option<usize>],
    /// For every node of the file, whether it only groups others.
    groups: Vec<bool>,
    known: HashMap<usize, Ancestor>,
}

impl<'a> GltfAncestry<'a> {
    pub fn new(document: &'a GltfDocument<'a>, labels: &'a [[Option<String>; 2]], tree: &'a GltfTree<'a>) -> Self {
        let groups = groups(document, labels, tree);
        GltfAncestry { document, labels, parents: &tree.parents, groups, known: HashMap::new() }
    }

    /// The ancestors of an object at `node`, including `node` if `with_itself`, see
    /// `Object::ancestors`.
    pub fn of(&mut self, node: usize, with_itself: bool) -> Arc<[Ancestor]> {
        let first = if with_itself { Some(node) } else { self.parents[node] };
        let mut line: Vec<Ancestor> = std::iter::successors(first, |&node| self.parents[node])
            .take(MOST_ANCESTORS)
            .map(|node| {
                let made = || {
                    let name = self.document.json.nodes[node].name.as_deref().unwrap_or_default();
                    Ancestor::new(node as u32, name, self.labels[node][0].as_deref(), self.groups[node])
                };
                self.known.entry(node).or_insert_with(made).clone()
            })
            .collect();
        line.reverse();
        line.into()
    }
}

/// For every node of the file, whether it only groups others, see [`Ancestor::is_group`].
fn groups(document: &GltfDocument<'_>, labels: &[[Option<String>; 2]], tree: &GltfTree<'_>) -> Vec<bool> {
    /// A node with more pieces is taken for a group of things.
    const MOST_PIECES: usize = 64;
    let nodes = &document.json.nodes;
    let mut groups = vec![false; nodes.len()];
    let mut has_mesh = vec![false; nodes.len()];
    // Children before their parents.
    for placed in tree.placed.iter().rev() {
        let node = &nodes[placed.node];
        let children = node.children.iter().flatten().map(|child| child.value());
        let pieces: Vec<usize> = children.filter(|&child| has_mesh[child]).collect();
        has_mesh[placed.node] = node.mesh.is_some() || !pieces.is_empty();
        let instanced = |&child: &usize| {
            nodes[child].extensions.as_ref().is_some_and(|all| all.others.contains_key(instancing::EXTENSION))
        };
        groups[placed.node] = node.mesh.is_none()
            && labels[placed.node][0].is_none()
            && (placed.at_origin
                || pieces.len() > MOST_PIECES
                || pieces.iter().any(instanced)
                || matches!(pieces[..], [only] if groups[only]));
    }
    groups
}

/// A node by itself, with its animations.
pub(super) struct Local {
    /// Has no parent.
    pub node: Node,
    /// Whether it is never visible.
    pub hidden: bool,
}

impl Local {
    /// Node `index` of the file.
    pub fn read(document: &GltfDocument<'_>, tracks: &GltfTracks, index: usize) -> Result<Local, String> {
        let mut node = Node { rest: document.transforms[index].rest()?, ..Node::default() };
        let mut hidden = !is_visible(&document.json.nodes[index])?;
        if tracks.is_empty() {
            return Ok(Local { node, hidden });
        }
        if let Rest::Parts { translation, rotation, scale } = &mut node.rest {
            let (still, track) = tracks.split(GltfProperty::Translation(index));
            (*translation, node.translation) = (still.map_or(*translation, DVec3::from_array), track);
            let (still, track) = tracks.split(GltfProperty::Rotation(index));
            let still = still.map(|q| DQuat::from_array(q).normalize());
            (*rotation, node.rotation) = (still.unwrap_or(*rotation), track);
            let (still, track) = tracks.split(GltfProperty::Scale(index));
            (*scale, node.scale) = (still.map_or(*scale, DVec3::from_array), track);
        }
        let (still, track) = tracks.split(GltfProperty::Visible(index));
        hidden = track.is_none() && still.map_or(hidden, |[visible]| visible == 0.0);
        node.visible = track;
        Ok(Local { node, hidden })
    }
}

/// Visibility by `KHR_node_visibility`, without animations.
fn is_visible(node: &json::Node) -> Result<bool, String> {
    match node.extensions.as_ref().and_then(|all| all.others.get(VISIBILITY)?.get("visible")) {
        None => Ok(true),
        Some(value) => {
            value.as_bool().ok_or_else(|| format!("{VISIBILITY}: visible is not a boolean; allowed: true, false"))
        }
    }
}

/// `categoryID` and `partID` of every node that has them.
pub(super) fn label_extras(document: &GltfDocument<'_>) -> Vec<[Option<String>; 2]> {
    let nodes = document.json.nodes.iter();
    nodes.map(|node| ["categoryID", "partID"].map(|key| text(&node.extras, key))).collect()
}

/// Parent of every node; an error if the nodes do not form a forest.
fn parents(document: &GltfDocument<'_>) -> Result<Vec<Option<usize>>> {
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

/// Root nodes of the scene to be read.
fn roots(document: &GltfDocument<'_>, parents: &[Option<usize>]) -> Result<Vec<usize>> {
    let scenes = &document.json.scenes;
    let default_scene = document.json.scene.map(|scene| scene.value());
    if let Some(missing) = default_scene.filter(|&scene| scene >= scenes.len()) {
        return Err(document.error("", format!("its scene {missing} does not exist: the file has {}", scenes.len())));
    }
    let index = default_scene.unwrap_or(0);
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
