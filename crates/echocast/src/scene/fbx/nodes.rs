//! The timeline of a file: the nodes that something moving hangs on.

use super::Document;
use super::animation::Tracks;
use super::hierarchy::{Tree, local};
use crate::motion::{Node, Rest, Timeline};
use glam::DAffine3;
use std::collections::HashMap;

/// A timeline to which nodes are added when something needs them, each with what it hangs on.
pub(super) struct Nodes<'a> {
    document: &'a Document<'a>,
    tracks: &'a Tracks,
    pub tree: &'a Tree<'a>,
    pub timeline: Timeline,
    /// Numbers in the timeline of nodes of the file; `None`: the file's own frame.
    numbers: HashMap<Option<u32>, usize>,
    /// Numbers in the timeline of nodes at the world's origin that can be seen when a node of the file can; `None`:
    /// always.
    watched: HashMap<u32, Option<usize>>,
}

impl<'a> Nodes<'a> {
    pub fn new(document: &'a Document<'a>, tracks: &'a Tracks, tree: &'a Tree<'a>) -> Self {
        let (numbers, watched) = (HashMap::new(), HashMap::new());
        Nodes { document, tracks, tree, timeline: Timeline::default(), numbers, watched }
    }

    /// The number in the timeline of `node`. Above the highest node that is animated, one node stands for all.
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
                    if placed.moves || placed.blinks {
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

    /// A new node that stays where it is on `node` of the file.
    pub fn fixed(&mut self, node: &ufbx::Node, node_from_fixed: DAffine3) -> Result<usize, String> {
        let parent = Some(self.number(node)?);
        self.add(Node { parent, rest: Rest::Whole(node_from_fixed), ..Node::default() })
    }

    /// A new node that never moves and can be seen when `node` of the file can.
    pub fn frame(&mut self, world_from_frame: DAffine3, node: &ufbx::Node) -> Result<usize, String> {
        let parent = self.watch(node)?;
        self.add(Node { parent, rest: Rest::Whole(world_from_frame), ..Node::default() })
    }

    fn watch(&mut self, node: &ufbx::Node) -> Result<Option<usize>, String> {
        let mut below = Vec::new();
        let mut next = Some(node);
        let mut number = loop {
            let Some(node) = next.filter(|node| !node.is_root && self.tree.get(node).blinks) else { break None };
            if let Some(&known) = self.watched.get(&node.element.typed_id) {
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
            self.watched.insert(node.element.typed_id, number);
        }
        Ok(number)
    }

    fn add(&mut self, node: Node) -> Result<usize, String> {
        self.document.budget.charge(size_of::<Node>())?;
        self.timeline.nodes.push(node);
        Ok(self.timeline.nodes.len() - 1)
    }
}
