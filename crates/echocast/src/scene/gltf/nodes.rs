//! The timeline of a file: the nodes that something moving hangs on.

use super::Document;
use super::accessor::Accessors;
use super::animation::Tracks;
use super::hierarchy::{Local, Tree, Z_UP_FROM_Y_UP};
use crate::motion::{Node, Rest, Timeline};
use glam::DAffine3;
use std::collections::HashMap;

/// A timeline to which nodes are added when something needs them, each with what it hangs on.
pub(super) struct Nodes<'a> {
    document: &'a Document<'a>,
    accessors: &'a Accessors<'a>,
    tracks: &'a Tracks,
    pub tree: &'a Tree<'a>,
    pub timeline: Timeline,
    /// Numbers in the timeline of nodes of the file; `None`: the file's own frame.
    numbers: HashMap<Option<usize>, usize>,
    /// Numbers in the timeline of nodes at the world's origin that can be seen when a node of the file can; `None`:
    /// always.
    watched: HashMap<usize, Option<usize>>,
}

impl<'a> Nodes<'a> {
    pub fn new(
        document: &'a Document<'a>,
        accessors: &'a Accessors<'a>,
        tracks: &'a Tracks,
        tree: &'a Tree<'a>,
    ) -> Self {
        let (numbers, watched) = (HashMap::new(), HashMap::new());
        Nodes { document, accessors, tracks, tree, timeline: Timeline::default(), numbers, watched }
    }

    /// The number in the timeline of `node`. Above the highest node that is animated, one node stands for all.
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
                    if placed.moves || placed.blinks {
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

    /// A new node that never moves and can be seen when `node` of the file can.
    pub fn frame(&mut self, world_from_frame: DAffine3, node: usize) -> Result<usize, String> {
        let parent = self.watch(node)?;
        self.add(Node { parent, rest: Rest::Whole(world_from_frame), ..Node::default() })
    }

    fn watch(&mut self, node: usize) -> Result<Option<usize>, String> {
        let mut below = Vec::new();
        let mut next = Some(node);
        let mut number = loop {
            let Some(node) = next.filter(|&node| self.tree.get(node).blinks) else { break None };
            if let Some(&known) = self.watched.get(&node) {
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
            self.watched.insert(node, number);
        }
        Ok(number)
    }

    fn add(&mut self, node: Node) -> Result<usize, String> {
        self.accessors.charge(size_of::<Node>())?;
        self.timeline.nodes.push(node);
        Ok(self.timeline.nodes.len() - 1)
    }
}
