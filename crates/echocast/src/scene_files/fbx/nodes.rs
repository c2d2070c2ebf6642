//! The timeline of a file: the nodes that something moving is attached to.

use super::FbxDocument;
use super::animation::FbxTracks;
use super::hierarchy::{FbxTree, local};
use crate::motion::{Node, Rest, Timeline};
use glam::DAffine3;
use std::collections::HashMap;

/// A timeline to which nodes are added on demand, each with its ancestors.
pub(super) struct FbxNodes<'a> {
    document: &'a FbxDocument<'a>,
    tracks: &'a FbxTracks,
    pub tree: &'a FbxTree<'a>,
    pub timeline: Timeline,
    /// Timeline numbers of the file's nodes; key `None`: the file's own frame.
    numbers: HashMap<Option<u32>, usize>,
    /// Timeline numbers of nodes at the world's origin that are visible whenever a node of the file is; `None`: always.
    visibility_nodes: HashMap<u32, Option<usize>>,
}

impl<'a> FbxNodes<'a> {
    pub fn new(document: &'a FbxDocument<'a>, tracks: &'a FbxTracks, tree: &'a FbxTree<'a>) -> Self {
        let (numbers, visibility_nodes) = (HashMap::new(), HashMap::new());
        FbxNodes { document, tracks, tree, timeline: Timeline::default(), numbers, visibility_nodes }
    }

    /// The timeline number of `node`. All nodes above the topmost animated one are combined into one.
    pub fn number(&mut self, node: &ufbx::Node) -> Result<usize, String> {
        let mut below = Vec::new();
        let mut next = Some(node).filter(|node| !node.is_root);
        let mut number = loop {
            let key = next.map(|node| node.element.typed_id);
            if let Some(&known) = self.numbers.get(&key) {
                break known;
            }
            let still = match next {
                None => self.tree.world_from_file,
                Some(node) => {
                    let placed = self.tree.get(node);
                    if placed.moves || placed.visibility_changes {
                        below.push(node);
                        next = node.parent.as_deref().filter(|parent| !parent.is_root);
                        continue;
                    }
                    placed.world_from_node
                }
            };
            let number = self.add(Node { rest: Rest::Whole(still), ..Node::default() })?;
            self.numbers.insert(key, number);
            break number;
        };
        for node in below.into_iter().rev() {
            number = self.add(Node { parent: Some(number), ..local(self.tracks, node) })?;
            self.numbers.insert(Some(node.element.typed_id), number);
        }
        Ok(number)
    }

    /// A new node that is fixed to `node` of the file.
    pub fn fixed(&mut self, node: &ufbx::Node, node_from_fixed: DAffine3) -> Result<usize, String> {
        let parent = Some(self.number(node)?);
        self.add(Node { parent, rest: Rest::Whole(node_from_fixed), ..Node::default() })
    }

    /// A new node that never moves and is visible whenever `node` of the file is.
    pub fn frame(&mut self, world_from_frame: DAffine3, node: &ufbx::Node) -> Result<usize, String> {
        let parent = self.visibility_parent(node)?;
        self.add(Node { parent, rest: Rest::Whole(world_from_frame), ..Node::default() })
    }

    fn visibility_parent(&mut self, node: &ufbx::Node) -> Result<Option<usize>, String> {
        let mut below = Vec::new();
        let mut next = Some(node);
        let mut number = loop {
            let Some(node) = next.filter(|node| !node.is_root && self.tree.get(node).visibility_changes) else {
                break None;
            };
            if let Some(&known) = self.visibility_nodes.get(&node.element.typed_id) {
                break known;
            }
            below.push(node);
            next = node.parent.as_deref();
        };
        for node in below.into_iter().rev() {
            let visible = local(self.tracks, node).visible;
            if visible.is_some() {
                let rest = Rest::Whole(DAffine3::IDENTITY);
                number = Some(self.add(Node { parent: number, rest, visible, ..Node::default() })?);
            }
            self.visibility_nodes.insert(node.element.typed_id, number);
        }
        Ok(number)
    }

    fn add(&mut self, node: Node) -> Result<usize, String> {
        self.document.budget.charge(size_of::<Node>())?;
        self.timeline.nodes.push(node);
        Ok(self.timeline.nodes.len() - 1)
    }
}
