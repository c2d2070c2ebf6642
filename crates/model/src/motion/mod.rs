//! How things move: values over time, hierarchies of nodes, and deformation.
//!
//! A [`Timeline`] belongs to a scene and can be evaluated at any time. What a scan needs of it is prepared for the time
//! span of the scan only.

mod cache;
mod curve;
mod path;
mod shape;
mod timeline;

pub use cache::{Cache, FPS};
pub use curve::{AnimationTrack, Curve, Interpolation, MOST_BENDS};
pub use path::{Path, Span};
pub use shape::{Deformation, MeshLayout, MorphTarget, PartVertices, Pull, Skin, Vertices};
pub use timeline::Timeline;
pub use timeline::{Node, Rest};

use glam::DAffine3;
use std::sync::Arc;

/// Shortest animation or cache that can be repeated, s: all of its repetitions within a scan are visited.
pub const SHORTEST_ROUND_S: f64 = 1e-3;

/// How an object follows the timeline of its scene.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The node that it is attached to.
    #[doc(hidden)]
    pub node: usize,
    /// Its constant pose on its node.
    #[doc(hidden)]
    pub node_from_object: DAffine3,
    /// How its mesh deforms, if it does.
    #[doc(hidden)]
    pub shape: Option<Arc<Deformation>>,
}

impl Motion {
    /// Whether an object that follows `timeline` in this way neither moves nor deforms from `from` to `to`, s.
    #[doc(hidden)]
    pub fn stays(&self, timeline: &Timeline, from: f64, to: f64) -> bool {
        timeline.stays(self.node, from, to) && self.shape.as_ref().is_none_or(|shape| shape.stays(timeline, from, to))
    }

    /// The same on a timeline whose nodes have numbers `shift` higher.
    #[doc(hidden)]
    pub fn shifted(self, shift: usize) -> Motion {
        let shape = self.shape.map(|shape| Arc::new(Arc::unwrap_or_clone(shape).shifted(shift)));
        Motion { node: self.node + shift, shape, ..self }
    }
}
