//! The objects of a scene that is edited, and their places in its list.

use crate::scene::Object;
use crate::trace::deforming::Known;
use glam::{DAffine3, DVec3};
use ground::error::{Error, Result};
use model::motion::{Deformation, Motion, Timeline};
use model::{Mesh, corners, within_reach};
use std::sync::Arc;

/// Identifies an object of a [`LiveScene`](super::LiveScene); never reused, even after the object has been removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectId {
    pub(super) slot: u32,
    pub(super) generation: u32,
}

impl ObjectId {
    /// As one number, never 0.
    pub fn to_u64(self) -> u64 {
        u64::from(self.generation) << 32 | u64::from(self.slot)
    }

    /// The id that [`ObjectId::to_u64`] turned into this number; a number that belongs to no object is detected on use.
    pub fn from_u64(number: u64) -> ObjectId {
        ObjectId { slot: number as u32, generation: (number >> 32) as u32 }
    }
}

/// The place of an object in the list.
#[derive(Clone, Default)]
pub(super) struct Slot {
    /// Counted from 1, incremented with every object.
    pub generation: u32,
    pub live: Option<Arc<Live>>,
}

/// An object and its state.
#[derive(Clone)]
pub(super) struct Live {
    pub object: Object,
    /// The timeline that moves it, if it moves by itself.
    pub timeline: Option<Arc<Timeline>>,
    /// Bounding box of its mesh.
    pub bounds: Option<[[f32; 3]; 2]>,
    pub place: Attachment,
    /// Whether it has been placed or moved since the last commit.
    pub moved: bool,
    /// Its shape in the last scans.
    pub known: Known,
}

/// How an object appears in Embree's structure.
#[derive(Clone)]
pub(super) enum Attachment {
    /// Together with the other fixed objects, if possible; known once those are built.
    Fixed { together: bool },
    /// By itself.
    Free,
}

impl Attachment {
    pub fn is_together(&self) -> bool {
        matches!(self, Attachment::Fixed { together: true })
    }
}

impl Live {
    /// The deformation that it keeps at any pose: all but a skin, whose joints are in the world.
    pub fn own_shape(&self) -> Option<Arc<Deformation>> {
        self.object.motion.as_ref()?.shape.clone().filter(|shape| shape.skin.is_none())
    }

    /// Attaches it to the only node of `timeline`.
    pub fn hang(&mut self, timeline: Timeline, shape: Option<Arc<Deformation>>) {
        self.object.motion = Some(Motion { node: 0, node_from_object: DAffine3::IDENTITY, shape });
        self.timeline = Some(Arc::new(timeline));
    }

    /// Sets the pose at `time`, s, of an object that moves by itself.
    pub fn follow(&mut self, time: f64) {
        if let (Some(timeline), Some(motion)) = (&self.timeline, &self.object.motion) {
            self.object.world_from_object = timeline.world_from_node(motion.node, time) * motion.node_from_object;
        }
    }
}

/// The objects, each with the number of its slot.
pub(super) fn lives(slots: &[Slot]) -> impl Iterator<Item = (u32, &Live)> {
    (0..).zip(slots).filter_map(|(slot, entry)| Some((slot, entry.live.as_deref()?)))
}

/// Objects that have a box, and its corners in the world.
pub(super) fn boxes(slots: &[Slot]) -> impl Iterator<Item = (&Live, [DVec3; 8])> {
    lives(slots).filter_map(|(_, live)| Some((live, corners(live.bounds?, &live.object.world_from_object))))
}

/// Attaches an object whose mesh is one of a sequence to a node, even if that does not move.
pub(super) fn staged(object: Object, timeline: Option<Arc<Timeline>>) -> (Object, Option<Arc<Timeline>>) {
    if object.sequence.is_none() || timeline.is_some() {
        return (object, timeline);
    }
    let timeline = Timeline::standing(object.world_from_object);
    let motion = Motion { node: 0, node_from_object: DAffine3::IDENTITY, shape: None };
    (Object { motion: Some(motion), ..object }, Some(Arc::new(timeline)))
}

/// The error for an object that does not exist.
pub(super) fn gone(id: ObjectId) -> Error {
    Error::invalid("object", format!("{:#x}", id.to_u64()), "objects of this scene that have not been removed")
}

/// Checks that an object with these bounds can be placed.
pub(super) fn check_pose(name: &str, bounds: Option<[[f32; 3]; 2]>, world_from_object: &DAffine3) -> Result<()> {
    let corners = corners(bounds.unwrap_or_default(), world_from_object);
    match corners.iter().find(|corner| !within_reach(corner)) {
        None if world_from_object.is_finite() => Ok(()),
        corner => Err(Error::invalid(
            format!("pose of object {name:?}"),
            corner.map_or("not finite".into(), |corner| format!("such that it reaches to {:?} m", corner.to_array())),
            "finite numbers, positions from -1e18 to 1e18 m",
        )),
    }
}

/// Checks that there is a number for each part of `mesh`.
pub(super) fn check_parts(mesh: &Mesh, part_ids: &[u32]) -> Result<()> {
    match mesh.parts.len() {
        parts if parts == part_ids.len() => Ok(()),
        parts => Err(Error::invalid("part numbers", part_ids.len(), format!("one for each part of the mesh, {parts}"))),
    }
}
