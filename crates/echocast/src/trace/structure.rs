//! Meshes as Embree's structures.

use super::Engine;
use crate::ground::error::{Error, Result};
use crate::model::Mesh;
use embree4::{CommittedScene, Pace, Quality};
use glam::{DAffine3, DVec3};
use std::sync::PoisonError;

impl Mesh {
    /// Builds what objects with this mesh need to be traced, which otherwise happens when the first of them is
    /// committed. This can be done on any thread while scenes are edited, and leaves a core free for committing them.
    ///
    /// # Errors
    /// Embree's: out of memory.
    pub fn prepare(&self, engine: &Engine) -> Result<()> {
        self.structure_by(engine, Pace::Aside).map(drop)
    }

    /// Its ray-tracing structure, built now if the engine does not have it yet.
    pub(super) fn structure_by(&self, engine: &Engine, pace: Pace) -> Result<CommittedScene> {
        let mut built = self.structure.built.lock().unwrap_or_else(PoisonError::into_inner);
        match &*built {
            Some(scene) if scene.is_of(engine.device()) => Ok(scene.clone()),
            _ => {
                let quality = if self.structure.changing { Quality::Low } else { Quality::Medium };
                let scene = mesh_scene(engine, self, quality, None, pace)?;
                Ok(built.insert(scene).clone())
            }
        }
    }
}

/// The structure of `mesh`, whose vertices are moved by `transform`.
pub(super) fn mesh_scene(
    engine: &Engine,
    mesh: &Mesh,
    quality: Quality,
    transform: Option<&DAffine3>,
    pace: Pace,
) -> Result<CommittedScene> {
    let mut scene = embree4::Scene::new(engine.device(), quality).map_err(Error::embree)?;
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
                embree4::Mesh::new(device, part.positions.iter().copied(), triangles, mask).map_err(Error::embree)?
            }
            Some(transform) => {
                let positions = part
                    .positions
                    .iter()
                    .map(|p| transform.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array());
                embree4::Mesh::new(device, positions, triangles, mask).map_err(Error::embree)?
            }
        };
        scene.attach_mesh(&mesh).map_err(Error::embree)?;
    }
    Ok(())
}

/// A transform in Embree's form: column by column, single precision.
pub(super) fn columns(m: &DAffine3) -> [f32; 12] {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    std::array::from_fn(|k| columns[k / 3][k % 3] as f32)
}
