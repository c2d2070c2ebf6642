//! Triangles whose corners move: a tree of boxes that is built once, for the mesh at rest, and fitted to the positions
//! of its vertices at the steps between which rays are traced.

mod build;
mod fit;
mod trace;

#[cfg(test)]
mod tests;

pub use trace::{Accept, RAYS, RayPacket, intersect, occluded};

/// Children of a node: as many numbers as fit in the widest register.
const CHILDREN: usize = 16;

/// Bounds of boxes are within it, and so is the origin of any ray that hits something: nothing becomes infinite.
const FARTHEST: f32 = 1e18;

/// Which triangles are in which box; the bounds of the boxes are in a [`MeshStep`].
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// The root first, every other after its parent.
    nodes: Vec<TreeNode>,
    /// Corners and number of every triangle, those of a leaf one after the other.
    triangles: Vec<[u32; 4]>,
    /// Corners of the triangles of each leaf, each of them once; those of the leaves of a node one after the other.
    corners: Vec<u32>,
    /// One more than the greatest corner.
    vertices: usize,
    /// Length, width and height at rest together.
    size: f32,
}

#[derive(Clone, Copy, Debug)]
struct TreeNode {
    /// First triangle of each child that is a leaf, the index of any other.
    first: [u32; CHILDREN],
    /// Triangles of each child that is a leaf, [`NODE`] of any other, 0 where there is none.
    count: [u8; CHILDREN],
    /// Where the corners of its leaves begin.
    first_corner: u32,
    /// Number of corners of each child that is a leaf.
    corners: [u8; CHILDREN],
}

const NODE: u8 = u8::MAX;

/// Boxes of the children of a node: lower and upper bounds along each axis; where there is no child, the lower are
/// above the upper ones.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct ChildBoxes {
    bounds: [[[f32; CHILDREN]; 3]; 2],
}

const NOTHING: ChildBoxes = ChildBoxes { bounds: [[[FARTHEST; CHILDREN]; 3], [[-FARTHEST; CHILDREN]; 3]] };

/// A mesh at one moment.
#[derive(Clone, Debug, Default)]
pub struct MeshStep {
    /// Positions of its vertices; the fourth number, of any value, pads each to a whole register.
    pub positions: Vec<[f32; 4]>,
    /// Boxes fitted to them by [`Tree::fit`].
    pub boxes: Vec<ChildBoxes>,
}

impl Tree {
    /// Fits `boxes` to the vertices at these `positions`; allocates memory the first time only. With fewer positions
    /// than the triangles need, rays hit nothing.
    pub fn fit(&self, positions: &[[f32; 4]], boxes: &mut Vec<ChildBoxes>) {
        boxes.resize(self.nodes.len(), NOTHING);
        if positions.len() < self.vertices {
            boxes.fill(NOTHING);
        } else {
            fit::fit(&self.nodes, &self.corners, positions, boxes);
        }
    }

    /// Memory of the boxes of a step.
    pub fn box_bytes(&self) -> usize {
        self.nodes.len() * size_of::<ChildBoxes>()
    }

    /// Lower and upper corner of a box around the mesh at this step; the lower is above the upper if it is empty.
    pub fn bounds(&self, step: &MeshStep) -> [[f32; 3]; 2] {
        let ChildBoxes { bounds: [lower, upper] } = step.boxes.first().unwrap_or(&NOTHING);
        [
            lower.map(|axis| axis.into_iter().fold(FARTHEST, f32::min)),
            upper.map(|axis| axis.into_iter().fold(-FARTHEST, f32::max)),
        ]
    }

    /// Whether this step has been fitted to this tree.
    fn fits(&self, step: &MeshStep) -> bool {
        step.boxes.len() == self.nodes.len() && step.positions.len() >= self.vertices
    }
}

/// The lesser number; `b` if one is NaN. A single instruction, which [`f32::min`] is not.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater number; `b` if one is NaN.
#[inline(always)]
fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
