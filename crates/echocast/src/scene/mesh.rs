//! Triangle meshes, split into parts of one material each.

use std::sync::Arc;

/// Triangles with one material.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Vertex positions, metres, mesh frame. Shared where several parts use the same vertices.
    pub positions: Arc<Vec<[f32; 3]>>,
    /// Unit shading normals per vertex; `None`: the surface is flat-shaded.
    pub normals: Option<Arc<Vec<[f32; 3]>>>,
    /// Texture coordinates per vertex, of the set the material's base colour texture uses.
    pub uvs: Option<Arc<Vec<[f32; 2]>>>,
    /// Vertex indices, three per triangle, all in range.
    pub triangles: Arc<Vec<[u32; 3]>>,
    /// Index into [`super::Scene::materials`]; `None`: the default material.
    pub material: Option<usize>,
}

/// A mesh: one or more parts.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file.
    pub name: String,
    /// Its parts, none empty.
    pub parts: Vec<Part>,
}

impl Mesh {
    /// Triangles of all parts.
    pub fn triangle_count(&self) -> usize {
        self.parts.iter().map(|part| part.triangles.len()).sum()
    }

    /// Lowest and highest corner of the box around the vertices that triangles use; `None` without triangles.
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let mut bounds: Option<[[f32; 3]; 2]> = None;
        for part in &self.parts {
            for &index in part.triangles.iter().flatten() {
                let p = part.positions[index as usize];
                let [low, high] = bounds.get_or_insert([p, p]);
                for axis in 0..3 {
                    low[axis] = low[axis].min(p[axis]);
                    high[axis] = high[axis].max(p[axis]);
                }
            }
        }
        bounds
    }
}

/// Whether a triangle has no area: two corners equal, or all three on one line to the last bit.
pub(crate) fn is_degenerate(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> bool {
    // In f64 the products of f32 differences are exact enough that only true slivers vanish.
    let edge = |p: [f32; 3], q: [f32; 3]| glam::DVec3::from(q.map(f64::from)) - glam::DVec3::from(p.map(f64::from));
    edge(a, b).cross(edge(a, c)).length_squared() == 0.0
}

/// Whether the vertex normals say no more than the triangles do: then they are not kept, and rays
/// that hit the part skip the interpolation.
pub(crate) fn normals_are_flat(positions: &[[f32; 3]], normals: &[[f32; 3]], triangles: &[[u32; 3]]) -> bool {
    /// About 0.08 degrees: exporters round normals to 8 bits or more.
    const COS_TOLERANCE: f32 = 1.0 - 1e-6;
    triangles.iter().all(|&[a, b, c]| {
        let [pa, pb, pc] = [a, b, c].map(|i| glam::Vec3::from(positions[i as usize]));
        let face = (pb - pa).cross(pc - pa).normalize_or_zero();
        [a, b, c].iter().all(|&i| glam::Vec3::from(normals[i as usize]).dot(face).abs() >= COS_TOLERANCE)
    })
}
