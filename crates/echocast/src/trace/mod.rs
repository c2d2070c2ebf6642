//! Rays to hits: the only user of Embree.

mod backscatter;
mod bare;
mod below;
mod bending;
mod bodies;
mod enclosure;
mod engine;
mod hits;
mod instances;
mod live;
mod mover;
mod sound;
mod surface;

pub(crate) use backscatter::Backscatter;
pub use bare::BareLoop;
pub(crate) use below::{Below, Raster};
pub(crate) use bodies::{Body, Stand};
pub use enclosure::Enclosure;
pub use engine::Engine;
pub(crate) use hits::{Cover, HitBatch, Sight, traced};
pub(crate) use instances::{Crossings, Instance};
pub use live::{LiveScene, ObjectId};
pub(crate) use mover::{Clock, Follows, Later, Movement, Mover, Return};
pub(crate) use sound::{
    Arrival, Direct, Goal, Launch, ReflectionLoss, SoundLimits, SoundTracer, TracerMemory, TubeHit,
};
pub(crate) use surface::{Surface, Surfaces, seen_normal};

use crate::ground::report::Report;
use crate::motion::Span;
use crate::scene::Labels;
use embree4::CommittedScene;
use glam::{DVec3, Mat3};
use instances::Extent;
use std::sync::{Arc, OnceLock};

/// A scene with its ray-tracing structure, immutable and shared by threads and clones.
#[derive(Clone)]
pub struct BuiltScene(pub(crate) Arc<Tables>);

/// What a [`BuiltScene`] holds: Embree's structure, and what its ids mean.
pub(crate) struct Tables {
    pub engine: Engine,
    pub committed: CommittedScene,
    /// Widest ray packet that runs natively here: 16, 8 or 4.
    pub packet_width: usize,
    /// World position of Embree's (0, 0, 0).
    pub origin: DVec3,
    /// World-from-object matrices for normals (cofactors of the linear part), by [`Surface::object`].
    pub normal_matrices: Vec<Mat3>,
    /// Where objects are while nothing moves, and how far they reach, by [`Surface::object`].
    pub extents: Vec<Extent>,
    /// Objects that move, by [`Surface::object`]; empty if none does.
    pub movers: Vec<Option<Arc<Mover>>>,
    /// Objects that stand in this time but may move at others, by [`Surface::object`]; empty if there are none.
    pub resting: Vec<Option<Arc<Follows>>>,
    /// The time of the scans that those are prepared for; `None`: nothing ever moves, or time stands still.
    pub span: Option<Span>,
    pub surfaces: Arc<Surfaces>,
    pub report: Report,
    /// Computed when first asked for.
    bodies: OnceLock<Vec<Body>>,
}

impl BuiltScene {
    /// Names of the label numbers.
    pub fn labels(&self) -> &Labels {
        &self.0.surfaces.labels
    }

    /// What building noticed.
    pub fn report(&self) -> &Report {
        &self.0.report
    }

    /// World position that single-precision coordinates are relative to, metres; the origin of clouds in world
    /// coordinates.
    pub fn origin(&self) -> DVec3 {
        self.0.origin
    }
}
