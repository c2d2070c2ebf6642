//! The nodes, flattened: every node with its world transform.

use super::animation::FbxTracks;
use super::names::{named, place};
use super::{FbxDocument, affine, user, vector};
use crate::hierarchy::PlacedNode;
use crate::notes::Notes;
use crate::properties;
use glam::{DAffine3, DQuat, DVec3};
use ground::error::Result;
use model::motion::{Node, Rest};
use model::{Ancestor, MOST_ANCESTORS};
use std::collections::HashMap;
use std::sync::Arc;
use ufbx::ElementType;

/// `categoryID` and `partID` of a node, if it has them.
pub(super) type Label = [Option<String>; 2];

/// A node with its world transform.
pub(super) type FbxPlaced<'a> = PlacedNode<'a, &'a ufbx::Node>;

/// The nodes of a file.
pub(super) struct FbxTree<'a> {
    /// Parents before their children, otherwise in the file's order.
    pub placed: Vec<FbxPlaced<'a>>,
    /// For every node of the file, its number in `placed`.
    numbers: Vec<usize>,
    /// Axes and units of the file.
    pub world_from_file: DAffine3,
}

/// The file's parent of a node of the file; `None` if it has none.
fn above(node: &ufbx::Node) -> Option<&ufbx::Node> {
    node.parent.as_deref().map(named).filter(|parent| !parent.is_root)
}

/// The labels of every node.
pub(super) fn labels(document: &FbxDocument<'_>) -> Vec<Label> {
    let text = |node: &ufbx::Node, key| user::get(&node.element.props, key).and_then(properties::text);
    document.file.nodes.iter().map(|node| ["categoryID", "partID"].map(|key| text(node, key))).collect()
}

/// `node` by itself, with its animations, without a parent.
pub(super) fn local(tracks: &FbxTracks, node: &ufbx::Node) -> Node {
    let place = node.local_transform;
    let rotation = DQuat::from_xyzw(place.rotation.x, place.rotation.y, place.rotation.z, place.rotation.w);
    let (mut translation, mut rotation, mut scale) = (vector(place.translation), rotation, vector(place.scale));
    let mut local = Node::default();
    if let Some(courses) = tracks.of_node(node) {
        let still;
        (still, local.translation) = courses.translation.split();
        translation = still.map_or(translation, DVec3::from_array);
        let still;
        (still, local.rotation) = courses.rotation.split();
        rotation = still.map_or(rotation, DQuat::from_array);
        let still;
        (still, local.scale) = courses.scale.split();
        scale = still.map_or(scale, DVec3::from_array);
        (_, local.visible) = courses.visible.split::<1>();
    }
    local.rest = Rest::Parts { translation, rotation, scale };
    local
}

/// Whether a node by itself is never visible.
fn is_hidden(tracks: &FbxTracks, node: &ufbx::Node) -> bool {
    match tracks.of_node(node).map(|courses| courses.visible.split::<1>()) {
        Some((_, Some(_))) => false,
        Some((Some([still]), None)) => still == 0.0,
        _ => !node.visible,
    }
}

impl<'a> FbxTree<'a> {
    /// Computes the world transforms of all nodes.
    pub fn read(
        document: &FbxDocument<'a>,
        labels: &'a [Label],
        tracks: &FbxTracks,
        notes: &mut Notes,
    ) -> Result<FbxTree<'a>> {
        let file = document.file;
        let root: &'a ufbx::Node = &file.root_node;
        let world_from_file = affine(&root.node_to_world);
        let numbers = vec![usize::MAX; file.nodes.len()];
        let mut tree = FbxTree { placed: Vec::new(), numbers, world_from_file };
        let mut stack: Vec<FbxPlaced<'a>> = root
            .children
            .as_ref()
            .iter()
            .rev()
            .map(|node| {
                let node: &'a ufbx::Node = node;
                PlacedNode::top(node, world_from_file)
            })
            .collect();
        // On the stack a node still has the values of its parent.
        while let Some(mut placed) = stack.pop() {
            let node = placed.node;
            let number = node.element.typed_id as usize;
            placed
                .add_own(&local(tracks, node), is_hidden(tracks, node), &labels[number])
                .map_err(|message| document.error(place(node), message))?;
            let levels = node.attrib_type == ElementType::LodGroup;
            if levels && node.children.len() > 1 {
                notes.add("of several levels of detail the first is read", || place(node));
            }
            for (level, child) in node.children.as_ref().iter().enumerate().rev() {
                stack.push(FbxPlaced { node: child, hidden: placed.hidden || levels && level > 0, ..placed });
            }
            tree.numbers[number] = tree.placed.len();
            tree.placed.push(placed);
        }
        Ok(tree)
    }

    /// Node `number` of the file.
    pub fn get(&self, number: usize) -> &FbxPlaced<'a> {
        &self.placed[self.numbers[number]]
    }
}

/// The ancestors of objects, each node once.
pub(super) struct FbxAncestry<'a> {
    labels: &'a [Label],
    /// For every node of the file, whether it only groups others.
    groups: Vec<bool>,
    known: HashMap<u32, Ancestor>,
}

impl<'a> FbxAncestry<'a> {
    pub fn new(labels: &'a [Label], tree: &FbxTree<'_>) -> Self {
        FbxAncestry { labels, groups: groups(labels, tree), known: HashMap::new() }
    }

    /// `node` and its ancestors, see `Object::ancestors`.
    pub fn of(&mut self, node: &ufbx::Node) -> Arc<[Ancestor]> {
        let mut line: Vec<Ancestor> = std::iter::successors(Some(named(node)), |node| above(node))
            .take(MOST_ANCESTORS)
            .map(|node| {
                let number = node.element.typed_id;
                let made = || {
                    let (category, is_group) = (&self.labels[number as usize][0], self.groups[number as usize]);
                    Ancestor::new(number, node.element.name.as_ref(), category.as_deref(), is_group)
                };
                self.known.entry(number).or_insert_with(made).clone()
            })
            .collect();
        line.reverse();
        line.into()
    }
}

/// For every node of the file, whether it only groups others, see [`Ancestor::is_group`].
fn groups(labels: &[Label], tree: &FbxTree<'_>) -> Vec<bool> {
    /// A node with more pieces is taken for a group of things.
    const MOST_PIECES: usize = 64;
    let mut groups = vec![false; labels.len()];
    let mut has_mesh = vec![false; labels.len()];
    // The number of children with a mesh on or below them, and the last of these.
    let mut pieces = vec![(0, 0); labels.len()];
    // Children before their parents.
    for placed in tree.placed.iter().rev() {
        let number = placed.node.element.typed_id as usize;
        if placed.node.is_scale_helper {
            continue;
        }
        let helper = placed.node.scale_helper.as_deref();
        let own_mesh = placed.node.mesh.is_some() || helper.is_some_and(|helper| helper.mesh.is_some());
        let (count, only) = pieces[number];
        has_mesh[number] = own_mesh || count > 0;
        groups[number] = !own_mesh
            && labels[number][0].is_none()
            && (placed.at_origin || count > MOST_PIECES || count == 1 && groups[only]);
        if let Some(parent) = above(placed.node).filter(|_| has_mesh[number]) {
            let of_parent = &mut pieces[parent.element.typed_id as usize];
            *of_parent = (of_parent.0 + 1, number);
        }
    }
    groups
}
