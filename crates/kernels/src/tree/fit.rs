//! Fits boxes around triangles at their current positions.

use super::{CHILDREN, ChildBoxes, FARTHEST, NODE, TreeNode, greatest, least};
use crate::level::kernels;

/// More than the rounding error of a coordinate between two steps and relative to a ray.
const SLACK: f32 = 1.0 / (1 << 21) as f32;

kernels! {
    /// Fits the boxes of all `nodes`, children before their parents.
    pub fn fit(nodes: &[TreeNode], corners: &[u32], positions: &[[f32; 4]], boxes: &mut [ChildBoxes]) {
        for (index, node) in nodes.iter().enumerate().rev() {
            // Corners with a fourth number: one register each.
            let mut lowers = [[FARTHEST; 4]; CHILDREN];
            let mut uppers = [[-FARTHEST; 4]; CHILDREN];
            let mut first_corner = node.first_corner as usize;
            for child in 0..CHILDREN {
                let (first, count) = (node.first[child] as usize, node.count[child]);
                if count == NODE {
                    let [of_lower, of_upper] = &boxes[first].bounds;
                    for axis in 0..3 {
                        lowers[child][axis] = extreme(&of_lower[axis], least);
                        uppers[child][axis] = extreme(&of_upper[axis], greatest);
                    }
                    continue;
                }
                if count == 0 {
                    break;
                }
                let (mut lower, mut upper) = ([FARTHEST; 4], [-FARTHEST; 4]);
                let end = first_corner + usize::from(node.corners[child]);
                for &corner in &corners[first_corner..end] {
                    let place = &positions[corner as usize];
                    for axis in 0..4 {
                        lower[axis] = least(place[axis], lower[axis]);
                        upper[axis] = greatest(place[axis], upper[axis]);
                    }
                }
                first_corner = end;
                (lowers[child], uppers[child]) = (lower, upper);
            }
            let fitted = &mut boxes[index].bounds;
            for axis in 0..3 {
                for child in 0..CHILDREN {
                    let (lower, upper) = (lowers[child][axis], uppers[child][axis]);
                    let slack = (lower.abs() + upper.abs()) * SLACK;
                    fitted[0][axis][child] = greatest(lower - slack, -FARTHEST);
                    fitted[1][axis][child] = least(upper + slack, FARTHEST);
                }
            }
        }
    }
}

/// The least or greatest of the numbers.
#[inline(always)]
fn extreme(values: &[f32; CHILDREN], of: fn(f32, f32) -> f32) -> f32 {
    // By halves, as vector instructions do it.
    let mut left = *values;
    for half in [8, 4, 2, 1] {
        for at in 0..half {
            left[at] = of(left[at], left[at + half]);
        }
    }
    left[0]
}
