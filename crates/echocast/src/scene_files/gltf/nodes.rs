//! The timeline of a file: the nodes that something moving is attached to.

use super::GltfDocument;
use super::accessor::Accessors;
use super::animation::GltfTracks;
use super::hierarchy::{GltfTree, Local, Z_UP_FROM_Y_UP};
use crate::motion::{Node, Rest, Timeline};
use glam::DAffine3;
use std::collections::HashMap;

/// A timeline to which nodes are added on demand, each with its ancestors.
pub(super) struct GltfNodes<'a> {
    document: &'a GltfDocument<'a>,
    accessors: &'a Accessors<'a>,
    tracks: &'a GltfTracks,
    pub tree: &'a GltfTree<'a>,
    pub timeline: Timeline,
    /// Timeline numbers of the file's nodes; key `None`: the file's own frame.
    numbers: HashMap<Option<usize>, usize>,
    /// Timeline numbers of nodes at the world's origin that are visible whenever a node of the file is; `None`: always.
    visibility_nodes: HashMap<usize, Option<usize>>,
}

impl<'a> GltfNodes<'a> {
    pub fn new(
        document: &'a GltfDocument<'a>,
        accessors: &'a Accessors<'a>,
        tracks: &'a GltfTracks,
        tree: &'a GltfTree<'a>,
    ) -> Self {
        let (numbers, visibility_nodes) = (HashMap::new(), HashMap::new());
        GltfNodes { document, accessors, tracks, tree, timeline: Timeline::default(), numbers, visibility_nodes }
    }

    /// The timeline number of `node`. All nodes above the topmost animated one are combined into one.
    pub fn number(&mut self, node: usize) -> Result<usize, String> {
        let mut below = Vec::new();
        let mut next = Some(node);
        let mut number = loop {
            if let Some(&known) = self.numbers.get(&next) {
                break known;
            }
            let still = match next {
                None => Z_UP_FROM_Y_UP,
                Some(node) => {
                    let placed = self.tree.get(node);
                    if placed.moves || placed.visibility_changes {
                        below.push(node);
                        next = self.tree.parents[node];
                        continue;
                    }
                    placed.world_from_node
                }
            };
            let number = self.add(Node { rest: Rest::Whole(still), ..Node::default() })?;
            self.numbers.insert(next, number);
            break number;
        };
        for node in below.into_iter().rev() {
            let local = Local::read(self.document, self.tracks, node)?;
            number = self.add(Node { parent: Some(number), ..local.node })?;
            self.numbers.insert(Some(node), number);
        }
        Ok(number)
    }

    /// A new node that never moves and is visible whenever `node` of the file is.
    pub fn frame(&mut self, world_from_frame: DAffine3, node: usize) -> Result<usize, String> {
        let parent = self.visibility_parent(node)?;
        self.add(Node { parent, rest: Rest::Whole(world_from_frame), ..Node::default() })
    }

    fn visibility_parent(&mut self, node: usize) -> Result<Option<usize>, String> {
        let mut below = Vec::new();
        let mut next = Some(node);
        let mut number = loop {
            let Some(node) = next.filter(|&node| self.tree.get(node).visibility_changes) else { break None };
            if let Some(&known) = self.visibility_nodes.get(&node) {
                break known;
            }
            below.push(node);
            next = self.tree.parents[node];
        };
        for node in below.into_iter().rev() {
            let Local { node: Node { visible, .. }, .. } = Local::read(self.document, self.tracks, node)?;
            if visible.is_some() {
                let rest = Rest::Whole(DAffine3::IDENTITY);
                number = Some(self.add(Node { parent: number, rest, visible, ..Node::default() })?);
            }
            self.visibility_nodes.insert(node, number);
        }
        Ok(number)
    }

    fn add(&mut self, node: Node) -> Result<usize, String> {
        self.accessors.charge(size_of::<Node>())?;
        self.timeline.nodes.push(node);
        Ok(self.timeline.nodes.len() - 1)
    }
}
