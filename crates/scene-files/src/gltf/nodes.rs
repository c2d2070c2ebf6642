//! The nodes of a file, as its timeline needs them.

use super::GltfDocument;
use super::accessor::Accessors;
use super::animation::GltfTracks;
use super::hierarchy::{GltfPlaced, GltfTree, Local, Z_UP_FROM_Y_UP};
use crate::hierarchy::NodeTree;
use glam::DAffine3;
use model::motion::Node;

/// The nodes of a file with their animations.
pub(super) struct GltfNodes<'a> {
    pub document: &'a GltfDocument<'a>,
    pub accessors: &'a Accessors<'a>,
    pub tracks: &'a GltfTracks,
    pub tree: &'a GltfTree<'a>,
}

impl<'a> NodeTree for GltfNodes<'a> {
    type Node = usize;

    fn above(&self, node: usize) -> Option<usize> {
        self.tree.parents[node]
    }

    fn placed(&self, node: usize) -> &GltfPlaced<'a> {
        self.tree.get(node)
    }

    fn local(&self, node: usize) -> Result<Node, String> {
        Ok(Local::read(self.document, self.tracks, node)?.node)
    }

    fn world_from_file(&self) -> DAffine3 {
        Z_UP_FROM_Y_UP
    }

    fn charge(&self, bytes: usize) -> Result<(), String> {
        self.accessors.charge(bytes)
    }
}
