//! What moves an object.

use crate::scene::Sequence;
use glam::{DAffine3, DVec3};
use ground::error::{Error, Result};
use model::Mesh;
use model::motion::{MOST_BENDS, Motion, Path, Span, Timeline};
use std::sync::Arc;

/// The motion of an object, and its tolerance.
#[derive(Clone)]
pub struct DrivingMotion {
    pub name: String,
    pub timeline: Arc<Timeline>,
    pub motion: Motion,
    pub mesh: Arc<Mesh>,
    /// Meshes that replace its own over time.
    pub sequence: Option<Arc<Sequence>>,
    /// Tolerance on the position of deforming surfaces, m.
    pub tolerance: f64,
    /// The scene's origin.
    pub origin: DVec3,
}

/// Most memory for the moving objects of one scene, bytes.
pub(super) const MOST_BYTES: usize = 4 << 30;

impl DrivingMotion {
    /// Its path through `span`, given the `bounds` of its mesh, in no more than `most_bytes`.
    pub(super) fn path(&self, span: Span, bounds: [[f32; 3]; 2], most_bytes: usize) -> Result<Path> {
        let DrivingMotion { timeline, motion, origin, .. } = self;
        if span.length == 0.0 {
            let place = DAffine3::from_translation(-*origin) * self.world_from_object(span.start);
            return Ok(Path::standing(&place, timeline.is_visible(motion.node, span.start)));
        }
        let end = span.start + span.length;
        let most = timeline.most_bends(motion.node, span.start, end);
        if most > MOST_BENDS {
            return Err(self.too_much(span));
        }
        let mut bends = Vec::with_capacity(most as usize + 2);
        timeline.bends(motion.node, span.start, end, &mut bends);
        let visible = |time: f64| timeline.is_visible(motion.node, time);
        let path = Path::new(span, bends, bounds, *origin, |time| self.world_from_object(time), visible, most_bytes);
        path.ok_or_else(|| self.too_much(span))
    }

    /// Its pose at `time`, s.
    pub(super) fn world_from_object(&self, time: f64) -> DAffine3 {
        self.timeline.world_from_node(self.motion.node, time) * self.motion.node_from_object
    }

    /// The error for motion that takes too much memory.
    pub(super) fn too_much(&self, span: Span) -> Error {
        let gib = MOST_BYTES >> 30;
        let allowed = format!(
            "a time short enough for moving objects to fit into {gib} GiB, which object {:?} does not",
            self.name
        );
        Error::invalid("time of a scan", format!("{} s", span.length), allowed)
    }
}
