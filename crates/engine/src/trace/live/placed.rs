//! Objects that Embree's structure holds one by one.

use super::object::Live;
use crate::trace::Engine;
use crate::trace::driving::DrivingMotion;
use crate::trace::engine::embree_error;
use crate::trace::mover::Mover;
use crate::trace::structure::{columns, mesh_scene, structure_of};
use embree4::{Custom, Instance, Pace, Quality};
use glam::{DAffine3, DVec3};
use ground::error::Result;
use model::motion::Span;
use std::sync::Arc;

/// An object that is placed by itself.
#[derive(Clone)]
pub(super) struct PlacedObject {
    pub thing: EmbreeObject,
    /// Whether its normals come in the mesh's frame.
    pub turned: bool,
}

impl PlacedObject {
    /// Memory used by its motion.
    pub fn bytes(&self) -> usize {
        match &self.thing {
            EmbreeObject::Still(_) | EmbreeObject::Resting(..) => 0,
            EmbreeObject::Moving(_, mover) => mover.bytes(),
        }
    }
}

/// An object in Embree's structure.
#[derive(Clone)]
pub(super) enum EmbreeObject {
    Still(Instance),
    /// At rest during the current time span.
    Resting(Instance, Arc<DrivingMotion>),
    /// Moving, or hidden.
    Moving(Custom, Arc<Mover>),
}

impl Live {
    /// Keeps the shapes known from `placed`, which is being replaced.
    pub fn remember(&mut self, placed: &PlacedObject) {
        if let EmbreeObject::Moving(_, mover) = &placed.thing {
            self.known.moments.extend_from_slice(mover.moments());
        }
    }

    /// Places it individually for the span `time`, with its motion in at most `most_bytes`.
    pub fn place(
        &mut self,
        engine: &Engine,
        origin: DVec3,
        time: Span,
        tolerance: f64,
        most_bytes: usize,
    ) -> Result<PlacedObject> {
        let object = &self.object;
        let [start, end] = [time.start, time.start + time.length];
        let mut resting = None;
        if let (Some(timeline), Some(motion)) = (&self.timeline, &object.motion) {
            let rests = motion.shape.is_none()
                && object.sequence.is_none()
                && timeline.stays(motion.node, start, end)
                && timeline.is_visible(motion.node, start);
            let (timeline, motion, mesh) = (timeline.clone(), motion.clone(), object.mesh.clone());
            let (name, sequence) = (object.name.clone(), object.sequence.clone());
            let driving = DrivingMotion { name, timeline, motion, mesh, sequence, tolerance, origin };
            if !rests {
                let mover = Arc::new(Mover::new(engine, driving, time, &mut self.known, most_bytes)?);
                let custom = Custom::new(engine.device(), mover.clone(), object.mask).map_err(embree_error)?;
                return Ok(PlacedObject { thing: EmbreeObject::Moving(custom, mover), turned: true });
            }
            resting = Some(Arc::new(driving));
        }
        let thing = |instance| match resting {
            Some(driving) => EmbreeObject::Resting(instance, driving),
            None => EmbreeObject::Still(instance),
        };
        let local_from_object = DAffine3::from_translation(-origin) * object.world_from_object;
        let matrix = columns(&local_from_object);
        if embree4::is_invertible(&matrix) {
            let of = structure_of(&object.mesh, engine, Pace::Now)?;
            let instance = Instance::new(&of, matrix, object.mask).map_err(embree_error)?;
            return Ok(PlacedObject { thing: thing(instance), turned: true });
        }
        // Scaled flat, it gets a mesh of its own in world coordinates.
        let of = mesh_scene(engine, &object.mesh, Quality::Low, Some(&local_from_object), Pace::Now)?;
        let instance = Instance::new(&of, columns(&DAffine3::IDENTITY), object.mask).map_err(embree_error)?;
        Ok(PlacedObject { thing: thing(instance), turned: false })
    }
}
