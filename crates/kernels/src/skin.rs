//! Vertices of meshes that deform: morph targets and linear blend skinning.

use crate::level::kernels;

/// Columns of a 4x4 matrix: the x, y and z axis and the translation, each padded to four numbers.
pub type JointMatrix = [f32; 16];

/// Up to four joints that move each vertex.
#[derive(Clone, Copy, Debug)]
pub struct Influences<'a> {
    /// Indices of the joints in the palette.
    pub joints: &'a [[u16; 4]],
    /// Weight of each; those of all influences of a vertex sum to 1.
    pub weights: &'a [[f32; 4]],
}

kernels! {
    /// Moves `rest` by the joints of the `palette`: every vertex by the sum of the matrices of its influences, of which
    /// there may be several sets of four. Moves as many vertices as the shortest of the slices has; the fourth number
    /// of each results from the fourth numbers of the columns.
    ///
    /// Panics on a joint that the palette does not have.
    pub fn skin(rest: &[[f32; 3]], sets: &[Influences], palette: &[JointMatrix], out: &mut [[f32; 4]]) {
        // Nearly all meshes have one set; with AVX-512 a loop over it would cost a fifth.
        if let &[Influences { joints, weights }] = sets {
            for (((out, rest), joints), weights) in out.iter_mut().zip(rest).zip(joints).zip(weights) {
                let mut matrix = [0.0; 16];
                blend(&mut matrix, joints, weights, palette);
                *out = transform(&matrix, rest);
            }
            return;
        }
        let count = sets.iter().map(|set| set.joints.len().min(set.weights.len())).min().unwrap_or(0);
        for (vertex, (out, rest)) in out.iter_mut().zip(rest).enumerate().take(count) {
            let mut matrix = [0.0; 16];
            for set in sets {
                blend(&mut matrix, &set.joints[vertex], &set.weights[vertex], palette);
            }
            *out = transform(&matrix, rest);
        }
    }

    /// `out += weight delta`: adds a morph target.
    pub fn add_scaled(out: &mut [[f32; 3]], delta: &[[f32; 3]], weight: f32) {
        for (out, delta) in out.as_flattened_mut().iter_mut().zip(delta.as_flattened()) {
            *out += weight * delta;
        }
    }
}

/// Adds the matrices of `joints`, times their `weights`.
#[inline(always)]
fn blend(matrix: &mut JointMatrix, joints: &[u16; 4], weights: &[f32; 4], palette: &[JointMatrix]) {
    for (&joint, &weight) in joints.iter().zip(weights) {
        let joint = &palette[usize::from(joint)];
        for element in 0..16 {
            matrix[element] += weight * joint[element];
        }
    }
}

#[inline(always)]
fn transform(matrix: &JointMatrix, point: &[f32; 3]) -> [f32; 4] {
    let mut moved = [0.0; 4];
    for axis in 0..4 {
        moved[axis] =
            point[0] * matrix[axis] + point[1] * matrix[4 + axis] + (point[2] * matrix[8 + axis] + matrix[12 + axis]);
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{block, unit};
    use crate::{Level, limit_level};

    fn numbers<const N: usize>(count: usize, stream: u32) -> Vec<[f32; N]> {
        let number = |index: usize, of: usize| unit(block([index as u32, of as u32, stream, 0], [1, 2])[0]);
        (0..count).map(|index| std::array::from_fn(|of| 2.0 * number(index, of) - 1.0)).collect()
    }

    #[test]
    fn follows_plain_sums_and_is_the_same_at_every_level() {
        const VERTICES: usize = 1001;
        let (rest, palette) = (numbers::<3>(VERTICES, 0), numbers::<16>(37, 1));
        let joints: Vec<[u16; 4]> =
            (0..2 * VERTICES).map(|of| block([of as u32, 0, 0, 0], [3, 4]).map(|word| (word % 37) as u16)).collect();
        let weights = numbers::<4>(2 * VERTICES, 2);
        let set = |from: usize| Influences { joints: &joints[from..], weights: &weights[from..][..VERTICES] };
        let sets = [set(0), set(VERTICES)];
        for sets in [&sets[..1], &sets] {
            let mut first = Vec::new();
            for level in [Level::Plain, Level::Avx2, Level::Avx512] {
                limit_level(level);
                let mut out = vec![[0.0; 4]; VERTICES];
                skin(&rest, sets, &palette, &mut out);
                for vertex in 0..VERTICES {
                    for axis in 0..3 {
                        let mut sum = 0.0;
                        for set in sets {
                            for (joint, weight) in set.joints[vertex].iter().zip(set.weights[vertex]) {
                                let matrix = palette[usize::from(*joint)].map(f64::from);
                                let [x, y, z] = rest[vertex].map(f64::from);
                                let moved = x * matrix[axis] + y * matrix[4 + axis] + z * matrix[8 + axis];
                                sum += f64::from(weight) * (moved + matrix[12 + axis]);
                            }
                        }
                        assert!((f64::from(out[vertex][axis]) - sum).abs() < 3e-6, "{vertex}");
                    }
                }
                if first.is_empty() {
                    first = out;
                } else {
                    assert_eq!(out, first, "{level:?}");
                }
            }
        }
        limit_level(Level::Avx512);
    }

    #[test]
    fn as_many_as_the_shortest_has() {
        let palette = [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0]];
        let set = Influences { joints: &[[0; 4]; 2], weights: &[[1.0, 0.0, 0.0, 0.0]; 5] };
        for sets in [&[set][..], &[set, set]] {
            let mut out = [[0.0; 4]; 3];
            skin(&[[9.0; 3]; 4], sets, &palette, &mut out);
            let all = sets.len() as f32;
            assert_eq!(out, [[all, 2.0 * all, 3.0 * all, 0.0], [all, 2.0 * all, 3.0 * all, 0.0], [0.0; 4]]);
        }
        let mut out = [[7.0; 4]];
        skin(&[[9.0; 3]], &[], &palette, &mut out);
        assert_eq!(out, [[7.0; 4]]);
    }

    #[test]
    fn morph_targets_add_up() {
        let (rest, delta) = (numbers::<3>(77, 5), numbers::<3>(77, 6));
        let mut out = rest.clone();
        add_scaled(&mut out, &delta, 0.25);
        add_scaled(&mut out, &delta, -0.5);
        for ((out, rest), delta) in out.iter().zip(&rest).zip(&delta) {
            for axis in 0..3 {
                assert!((out[axis] - (rest[axis] - 0.25 * delta[axis])).abs() < 1e-6);
            }
        }
    }
}
