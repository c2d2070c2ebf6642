//! Ray tracing, from rays to hits: the only module that uses Embree.

mod backscatter;
mod bare;
mod below;
mod bodies;
mod clock;
mod deforming;
mod driving;
mod enclosure;
mod engine;
mod hits;
mod instances;
mod live;
mod movement;
mod mover;
mod quadrics;
mod radar;
mod shared_surfaces;
mod sound;
mod structure;
mod surface;

pub(crate) use backscatter::Backscatter;
pub use bare::BareLoop;
pub use below::{Below, MapRaster};
pub(crate) use bodies::{Body, Stand};
pub(crate) use clock::Clock;
pub use enclosure::Enclosure;
pub use engine::Engine;
pub(crate) use hits::{Cover, HitBatch, IsPane, Sight, traced};
pub(crate) use instances::{Crossings, LabelledInstance};
pub use live::{LiveRobot, LiveScene, ObjectId};
pub(crate) use movement::{Later, Movement, Return};
pub(crate) use mover::Mover;
pub(crate) use radar::{
    ImageTarget, MOST_MIRRORS, Mirror, MirrorChain, RadarRow, RowFacets, Search, SearchLimits, SightMemory, Sighted,
    Sightlines,
};
pub(crate) use shared_surfaces::SharedSurfaces;
pub(crate) use sound::{
    Arrival, Direct, Goal, Launch, ReflectionLoss, SoundLimits, SoundTracer, TracerMemory, TubeHit,
};
pub(crate) use surface::{Holes, Surface, Surfaces, seen_normal};

use crate::scene::Labels;
use driving::DrivingMotion;
use glam::{DVec3, Mat3};
use ground::report::Report;
use instances::ObjectExtent;
use model::material::Material;
use model::motion::Span;
use std::sync::{Arc, OnceLock};
use structure::TracedScenes;

/// A scene with its ray-tracing structure, immutable and shared by threads and clones.
#[derive(Clone)]
pub struct BuiltScene(pub(crate) Arc<Tables>);

/// What a [`BuiltScene`] holds: Embree's structure, and what its ids mean.
pub struct Tables {
    /// The device and the worker threads that it was built with.
    pub engine: Engine,
    /// Embree's structure of all objects, ready to be traced.
    pub structure: TracedScenes,
    /// Widest ray packet that runs natively here: 16, 8 or 4.
    pub packet_width: usize,
    /// World position of Embree's (0, 0, 0).
    pub origin: DVec3,
    /// World-from-object matrices for normals (cofactors of the linear part), by `Surface::object`.
    pub normal_matrices: Vec<Mat3>,
    /// Pose and extent of objects while nothing moves, by `Surface::object`.
    pub extents: Vec<ObjectExtent>,
    /// Objects that move, by `Surface::object`; empty if none does.
    pub movers: Vec<Option<Arc<Mover>>>,
    /// Objects that are at rest during this span but may move at other times, by `Surface::object`; empty if there
    /// are none.
    pub resting: Vec<Option<Arc<DrivingMotion>>>,
    /// The time span that those are prepared for; `None`: nothing ever moves, or time is frozen.
    pub span: Option<Span>,
    /// The parts of all objects by Embree's ids, with their materials and labels.
    pub surfaces: Arc<SharedSurfaces>,
    /// What was noticed during the build.
    pub report: Report,
    /// Computed on first use.
    bodies: OnceLock<Vec<Body>>,
}

impl BuiltScene {
    /// Names of the label numbers.
    pub fn labels(&self) -> &Labels {
        &self.0.surfaces.labels
    }

    /// Materials of its surfaces.
    pub fn materials(&self) -> &[Arc<Material>] {
        &self.0.surfaces.materials
    }

    /// What was noticed during the build.
    pub fn report(&self) -> &Report {
        &self.0.report
    }

    /// World position that single-precision coordinates are relative to, metres; the origin of clouds in world
    /// coordinates.
    pub fn origin(&self) -> DVec3 {
        self.0.origin
    }
}
