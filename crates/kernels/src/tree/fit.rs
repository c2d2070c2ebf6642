//! Boxes around triangles where they are.

use super::{Boxes, CHILDREN, FARTHEST, NODE, Node, greatest, least};

/// By more than what rounding makes of a coordinate between two steps and seen from a ray.
const SLACK: f32 = 1.0 / (1 << 21) as f32;

/// Fits the boxes of all `nodes`, children before their parents. What takes time is to gather corners, for which wide
/// vectors are of no use.
pub fn fit(nodes: &[Node], triangles: &[[u32; 4]], positions: &[[f32; 3]], boxes: &mut [Boxes]) {
    for (index, node) in nodes.iter().enumerate().rev() {
        let mut lowers = [[FARTHEST; CHILDREN]; 3];
        let mut uppers = [[-FARTHEST; CHILDREN]; 3];
        for child in 0..CHILDREN {
            let (first, count) = (node.first[child] as usize, node.count[child]);
            if count == NODE {
                let [of_lower, of_upper] = &boxes[first].bounds;
                for axis in 0..3 {
                    lowers[axis][child] = extreme(&of_lower[axis], least);
                    uppers[axis][child] = extreme(&of_upper[axis], greatest);
                }
                continue;
            }
            if count == 0 {
                break;
            }
            let (mut lower, mut upper) = ([FARTHEST; 3], [-FARTHEST; 3]);
            for &[a, b, c, _] in &triangles[first..first + usize::from(count)] {
                let (a, b, c) = (&positions[a as usize], &positions[b as usize], &positions[c as usize]);
                for axis in 0..3 {
                    let (a, b, c) = (a[axis], b[axis], c[axis]);
                    lower[axis] = least(a, least(b, least(c, lower[axis])));
                    upper[axis] = greatest(a, greatest(b, greatest(c, upper[axis])));
                }
            }
            for axis in 0..3 {
                lowers[axis][child] = lower[axis];
                uppers[axis][child] = upper[axis];
            }
        }
        let fitted = &mut boxes[index].bounds;
        for axis in 0..3 {
            for child in 0..CHILDREN {
                let (lower, upper) = (lowers[axis][child], uppers[axis][child]);
                let slack = (lower.abs() + upper.abs()) * SLACK;
                fitted[0][axis][child] = greatest(lower - slack, -FARTHEST);
                fitted[1][axis][child] = least(upper + slack, FARTHEST);
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
