//! What nodes are called.

use ground::shown;

/// The node of the file that `node` belongs to: the parent of a node that `ufbx` adds for its scale.
pub(super) fn named(node: &ufbx::Node) -> &ufbx::Node {
    match &node.parent {
        Some(parent) if node.is_scale_helper => parent,
        _ => node,
    }
}

/// `node "Chair"`.
pub(super) fn place(node: &ufbx::Node) -> String {
    format!("node {:?}", shown::name(&named(node).element.name))
}
