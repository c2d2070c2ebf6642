//! The nodes of a file, as its timeline needs them.

use super::FbxDocument;
use super::animation::FbxTracks;
use super::hierarchy::{FbxPlaced, FbxTree, local};
use crate::hierarchy::NodeTree;
use glam::DAffine3;
use model::motion::Node;

/// The nodes of a file with their animations.
pub(super) struct FbxNodes<'a> {
    pub document: &'a FbxDocument<'a>,
    pub tracks: &'a FbxTracks,
    pub tree: &'a FbxTree<'a>,
}

/// Number of `node` in its file; `None`: the root, which is the file's own frame.
pub(super) fn number(node: &ufbx::Node) -> Option<usize> {
    (!node.is_root).then_some(node.element.typed_id as usize)
}

impl<'a> NodeTree for FbxNodes<'a> {
    type Node = &'a ufbx::Node;

    fn above(&self, node: usize) -> Option<usize> {
        self.tree.get(node).node.parent.as_deref().and_then(number)
    }

    fn placed(&self, node: usize) -> &FbxPlaced<'a> {
        self.tree.get(node)
    }

    fn local(&self, node: usize) -> Result<Node, String> {
        Ok(local(self.tracks, self.tree.get(node).node))
    }

    fn world_from_file(&self) -> DAffine3 {
        self.tree.world_from_file
    }

    fn charge(&self, bytes: usize) -> Result<(), String> {
        self.document.budget.charge(bytes)
    }
}
