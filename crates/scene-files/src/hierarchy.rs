//! The hierarchy of nodes of a scene file, in the formats that have one: what nodes take over from those above them,
//! and the timeline of those that something moving is attached to.

use glam::{DAffine3, DVec3};
use model::motion::{Node, Rest, Timeline};
use std::collections::HashMap;

/// A node `N` of a file with its world transform.
#[derive(Clone, Copy)]
pub(super) struct PlacedNode<'a, N> {
    pub node: N,
    /// At time 0.
    pub world_from_node: DAffine3,
    /// Whether it or a node above it is animated.
    pub moves: bool,
    /// Whether the scale of one of them is animated.
    pub scales: bool,
    /// Whether the visibility of one of them is animated.
    pub visibility_changes: bool,
    /// Whether it is never visible.
    pub hidden: bool,
    /// Whether it stays at the origin of its parent.
    pub at_origin: bool,
    /// `categoryID` of the node or its nearest ancestor.
    pub category: Option<&'a str>,
    /// `partID` of the node or its nearest ancestor.
    pub part: Option<&'a str>,
}

impl<'a, N> PlacedNode<'a, N> {
    /// `node` with what it takes over from the file if no node is above it.
    pub fn top(node: N, world_from_file: DAffine3) -> Self {
        PlacedNode {
            node,
            world_from_node: world_from_file,
            moves: false,
            scales: false,
            visibility_changes: false,
            hidden: false,
            at_origin: true,
            category: None,
            part: None,
        }
    }

    /// Adds what it is by itself, `local`, whether it is then never visible, and its `categoryID` and `partID`, to what
    /// it takes over.
    pub fn add_own(
        &mut self,
        local: &Node,
        hidden: bool,
        [category, part]: &'a [Option<String>; 2],
    ) -> Result<(), String> {
        let parent_from_node = local.parent_from_node(0.0);
        self.at_origin = local.translation.is_none() && parent_from_node.translation == DVec3::ZERO;
        self.world_from_node *= parent_from_node;
        if !self.world_from_node.is_finite() {
            return Err("its world transform is not finite".into());
        }
        self.scales |= local.scale.is_some();
        self.moves |= self.scales || local.translation.is_some() || local.rotation.is_some();
        self.visibility_changes |= local.visible.is_some();
        self.hidden |= hidden;
        self.category = category.as_deref().or(self.category);
        self.part = part.as_deref().or(self.part);
        Ok(())
    }
}

/// The nodes of a file, by their numbers in it.
pub(super) trait NodeTree {
    /// A node.
    type Node;
    /// The number of the node above node `number`.
    fn above(&self, number: usize) -> Option<usize>;
    /// Node `number` with its world transform.
    fn placed(&self, number: usize) -> &PlacedNode<'_, Self::Node>;
    /// Node `number` by itself, with its animations, without a parent.
    fn local(&self, number: usize) -> Result<Node, String>;
    /// Axes and units of the file.
    fn world_from_file(&self) -> DAffine3;
    /// Takes `bytes` of memory from the file's budget.
    fn charge(&self, bytes: usize) -> Result<(), String>;
}

/// A timeline to which nodes are added on demand, each with its ancestors.
pub(super) struct TimelineNodes<T> {
    pub file: T,
    pub timeline: Timeline,
    /// Timeline numbers of the file's nodes; key `None`: the file's own frame.
    numbers: HashMap<Option<usize>, usize>,
    /// Timeline numbers of nodes at the world's origin that are visible whenever a node of the file is; `None`: always.
    visibility_nodes: HashMap<usize, Option<usize>>,
}

impl<T: NodeTree> TimelineNodes<T> {
    pub fn new(file: T) -> Self {
        let (numbers, visibility_nodes) = (HashMap::new(), HashMap::new());
        TimelineNodes { file, timeline: Timeline::default(), numbers, visibility_nodes }
    }

    /// The timeline number of `node` of the file; `None`: the file's own frame. All nodes above the topmost animated one
    /// are combined into one.
    pub fn number(&mut self, node: Option<usize>) -> Result<usize, String> {
        let mut below = Vec::new();
        let mut next = node;
        let mut number = loop {
            if let Some(&known) = self.numbers.get(&next) {
                break known;
            }
            let still = match next {
                None => self.file.world_from_file(),
                Some(node) => {
                    let placed = self.file.placed(node);
                    if placed.moves || placed.visibility_changes {
                        below.push(node);
                        next = self.file.above(node);
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
            number = self.add(Node { parent: Some(number), ..self.file.local(node)? })?;
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
            let Some(node) = next.filter(|&node| self.file.placed(node).visibility_changes) else { break None };
            if let Some(&known) = self.visibility_nodes.get(&node) {
                break known;
            }
            below.push(node);
            next = self.file.above(node);
        };
        for node in below.into_iter().rev() {
            let visible = self.file.local(node)?.visible;
            if visible.is_some() {
                let rest = Rest::Whole(DAffine3::IDENTITY);
                number = Some(self.add(Node { parent: number, rest, visible, ..Node::default() })?);
            }
            self.visibility_nodes.insert(node, number);
        }
        Ok(number)
    }

    /// Adds a node to the timeline; returns its number.
    pub fn add(&mut self, node: Node) -> Result<usize, String> {
        self.file.charge(size_of::<Node>())?;
        self.timeline.nodes.push(node);
        Ok(self.timeline.nodes.len() - 1)
    }
}
