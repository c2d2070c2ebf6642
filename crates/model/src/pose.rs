//! Meshes that change their shape, as they are at time 0.

use super::{Mesh, Part, beyond_reach, is_degenerate};
use crate::motion::Deformation;
use glam::DAffine3;

/// `mesh` as deformed by `shape` at time 0, with the joint matrices `palette` of its skin, and how many triangles
/// without area were left out, as is done only for a mesh that `stays` so. `None`: all were. `charge` reserves bytes of
/// memory.
///
/// # Errors
/// The error of `charge`; a vertex that is too far away.
pub fn pose(
    mesh: &Mesh,
    shape: &Deformation,
    palette: &[DAffine3],
    stays: bool,
    charge: impl Fn(usize) -> Result<(), String>,
) -> Result<(Option<Mesh>, usize), String> {
    let (mut parts, mut degenerate) = (Vec::new(), 0);
    for (part, vertices) in mesh.parts.iter().zip(&shape.vertices.parts) {
        let normals = vertices.normals.as_ref().map_or(0, |normals| normals.len());
        charge((vertices.positions.len() + normals) * size_of::<[f32; 3]>())?;
        // Morph targets take time, not memory; but those that share their numbers could take for ever.
        let working = shape.weights.iter().filter(|&&weight| weight != 0.0).count();
        charge(working.saturating_mul(vertices.positions.len()))?;
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        vertices.pose(&shape.weights, palette, &mut positions);
        vertices.turn(&shape.weights, palette, &mut normals);
        if let Some(vertex) = beyond_reach(&positions) {
            let found = positions[vertex];
            return Err(format!("its vertex {vertex} moves to {found:?}; allowed: -1e18 to 1e18"));
        }
        let mut triangles = part.triangles.clone();
        let has_area = |&&[a, b, c]: &&[u32; 3]| {
            !is_degenerate(positions[a as usize], positions[b as usize], positions[c as usize])
        };
        if stays && !triangles.iter().all(|triangle| has_area(&triangle)) {
            let kept: Vec<[u32; 3]> = triangles.iter().filter(has_area).copied().collect();
            degenerate += triangles.len() - kept.len();
            triangles = kept.into();
        }
        if !triangles.is_empty() {
            let normals = vertices.normals.is_some().then(|| normals.into());
            let positions = positions.into();
            parts.push(Part { positions, normals, triangles, quadrics: Vec::new(), ..part.clone() });
        }
    }
    Ok(((!parts.is_empty()).then(|| Mesh::trusted(mesh.name.clone(), parts)), degenerate))
}
