//! Rays to hits: the only user of Embree.

mod bare;
mod batch;
mod build;

pub use bare::BareLoop;
pub(crate) use batch::{HitBatch, LANES, MISS, RayBatch};
pub(crate) use build::Surface;

use crate::error::Result;
use crate::material::Material;
use crate::report::Report;
use crate::scene::{Labels, Part, Scene, Texture};
use embree4::CommittedScene;
use glam::{DVec3, Mat3};
use std::sync::Arc;

/// Beams per task. A constant, so that results cannot depend on the number of threads; traced rays
/// lose nothing at this size.
pub(crate) const CHUNK: usize = 2048;

/// A scene with its ray-tracing structure, immutable and shared by threads; clones share it.
#[derive(Clone)]
pub struct BuiltScene(pub(crate) Arc<Tables>);

/// What a [`BuiltScene`] holds: Embree's structure, and what its ids mean.
pub(crate) struct Tables {
    pub committed: CommittedScene,
    /// Widest ray packet that runs natively here: 16, 8 or 4.
    pub packet_width: usize,
    /// World position of Embree's (0, 0, 0).
    pub origin: DVec3,
    /// First surface of each top-level geometry id: of a mesh part placed once, or of an instance.
    pub first_surface: Vec<u32>,
    /// Whether hits can lie in instances; otherwise normals come in world space.
    pub has_instances: bool,
    /// Whether any part has shading normals.
    pub has_shading_normals: bool,
    /// One row for each part of each object.
    pub surfaces: Vec<Surface>,
    /// World-from-object matrices for normals (cofactors of the linear part), by [`Surface::object`].
    pub normal_matrices: Vec<Mat3>,
    /// Mesh parts, by [`Surface::part`].
    pub parts: Vec<Part>,
    /// Materials, by [`Surface::material`]; the last is the default material.
    pub materials: Vec<Material>,
    pub textures: Vec<Arc<Texture>>,
    pub labels: Arc<Labels>,
    pub report: Report,
}

impl BuiltScene {
    pub(crate) fn new(scene: &Scene) -> Result<BuiltScene> {
        build::build(scene).map(|tables| BuiltScene(Arc::new(tables)))
    }

    /// Names of the label numbers.
    pub fn labels(&self) -> &Labels {
        &self.0.labels
    }

    /// What building noticed.
    pub fn report(&self) -> &Report {
        &self.0.report
    }

    /// World position that single-precision coordinates are relative to, metres; the origin of
    /// clouds in world coordinates.
    pub fn origin(&self) -> DVec3 {
        self.0.origin
    }
}
