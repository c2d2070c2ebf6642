//! Meshes as Embree's structures.

use super::Engine;
use crate::trace::engine::embree_error;
use embree4::{CommittedScene, Pace, Quality};
use glam::{DAffine3, DVec3};
use ground::error::Result;
use model::Mesh;
use std::sync::PoisonError;

impl Engine {
    /// Builds what objects with `mesh` need to be traced, which otherwise happens when the first of them is committed.
    /// This can be done on any thread while scenes are edited, and leaves a core free for committing them.
    ///
    /// # Errors
    /// Embree's: out of memory.
    pub fn prepare(&self, mesh: &Mesh) -> Result<()> {
        structure_of(mesh, self, Pace::Aside).map(drop)
    }
}

/// The ray-tracing structure of `mesh`, built now if the engine does not have it yet.
pub(super) fn structure_of(mesh: &Mesh, engine: &Engine, pace: Pace) -> Result<CommittedScene> {
    let mut built = mesh.structure.built.lock().unwrap_or_else(PoisonError::into_inner);
    let known = built.as_ref().and_then(|known| known.downcast_ref::<CommittedScene>());
    if let Some(scene) = known.filter(|scene| scene.is_of(engine.device())) {
        return Ok(scene.clone());
    }
    let quality = if mesh.structure.changing { Quality::Low } else { Quality::Medium };
    let scene = mesh_scene(engine, mesh, quality, None, pace)?;
    *built = Some(Box::new(scene.clone()));
    Ok(scene)
}

/// The structure of `mesh`, whose vertices are moved by `transform`.
pub(super) fn mesh_scene(
    engine: &Engine,
    mesh: &Mesh,
    quality: Quality,
    transform: Option<&DAffine3>,
    pace: Pace,
) -> Result<CommittedScene> {
    let mut scene = embree4::Scene::new(engine.device(), quality).map_err(embree_error)?;
    attach(&mut scene, engine, mesh, u32::MAX, transform)?;
    engine.commit(scene, mesh.triangle_count(), pace)
}

/// Adds the parts of `mesh` to `scene`, one geometry each.
pub(super) fn attach(
    scene: &mut embree4::Scene,
    engine: &Engine,
    mesh: &Mesh,
    mask: u32,
    transform: Option<&DAffine3>,
) -> Result<()> {
    for part in &mesh.parts {
        let device = engine.device();
        let triangles = &part.triangles;
        let mesh = match transform {
            None => {
                embree4::Mesh::new(device, part.positions.iter().copied(), triangles, mask).map_err(embree_error)?
            }
            Some(transform) => {
                let positions = part
                    .positions
                    .iter()
                    .map(|p| transform.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array());
                embree4::Mesh::new(device, positions, triangles, mask).map_err(embree_error)?
            }
        };
        scene.attach_mesh(&mesh).map_err(embree_error)?;
    }
    Ok(())
}

/// A transform in Embree's form: column by column, single precision.
pub(super) fn columns(m: &DAffine3) -> [f32; 12] {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    std::array::from_fn(|k| columns[k / 3][k % 3] as f32)
}
