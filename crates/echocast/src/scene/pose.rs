//! Meshes that change their shape, as they are at time 0.

use super::mesh::{beyond_reach, is_degenerate};
use super::{Mesh, Part};
use crate::motion::Shape;
use glam::DAffine3;

/// `mesh` as `shape` has it at time 0, where `palette` brings the vertices of its skin, and how many triangles without
/// area were left out: those of one that `stays` so. `None`: all were. `charge` asks for bytes of memory.
///
/// # Errors
/// What `charge` says; a vertex that is too far away.
pub(super) fn pose(
    mesh: &Mesh,
    shape: &Shape,
    palette: &[DAffine3],
    stays: bool,
    charge: impl Fn(usize) -> Result<(), String>,
) -> Result<(Option<Mesh>, usize), String> {
    let (mut parts, mut degenerate) = (Vec::new(), 0);
    for (part, vertices) in mesh.parts.iter().zip(&shape.vertices.parts) {
        let normals = vertices.normals.as_ref().map_or(0, |normals| normals.len());
        charge((vertices.positions.len() + normals) * size_of::<[f32; 3]>())?;
        // They take time, not memory; but targets that share their numbers could take for ever.
        let working = shape.weights.iter().filter(|&&weight| weight != 0.0).count();
        charge(working.saturating_mul(vertices.positions.len()))?;
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        vertices.pose(&shape.weights, palette, &mut positions);
        vertices.turn(&shape.weights, palette, &mut normals);
        if let Some(vertex) = beyond_reach(&positions) {
            let found = positions[vertex];
            return Err(format!("its vertex {vertex} comes to {found:?}; allowed: -1e18 to 1e18"));
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
            parts.push(Part { positions: positions.into(), normals, triangles, ..part.clone() });
        }
    }
    Ok(((!parts.is_empty()).then(|| Mesh::trusted(mesh.name.clone(), parts)), degenerate))
}
