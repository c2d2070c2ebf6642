//! How things move: values over time, the nodes that hang on each other, and what deforms.
//!
//! A [`Timeline`] belongs to a scene and can be asked for any time. What a scan needs of it is prepared for the time of
//! the scan alone.

mod cache;
mod curve;
mod path;
mod shape;
mod timeline;

pub(crate) use cache::{Cache, FPS};
pub(crate) use curve::{Curve, Interpolation, MOST_BENDS, Track};
pub(crate) use path::{Path, Span};
pub(crate) use shape::{Layout, PartVertices, Pull, Shape, Skin, Target, Vertices};
pub use timeline::Timeline;
pub(crate) use timeline::{Node, Rest};

use glam::DAffine3;
use std::sync::Arc;

/// How an object follows the timeline of its scene.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The node that it hangs on.
    pub(crate) node: usize,
    /// Where it is on its node, always.
    pub(crate) node_from_object: DAffine3,
    /// How its mesh changes, if it does.
    pub(crate) shape: Option<Arc<Shape>>,
}

impl Motion {
    /// Whether an object that follows `timeline` in this way stays as and where it is from `from` to `to`, s.
    pub(crate) fn stays(&self, timeline: &Timeline, from: f64, to: f64) -> bool {
        timeline.stays(self.node, from, to) && self.shape.as_ref().is_none_or(|shape| shape.stays(timeline, from, to))
    }

    /// The same on a timeline whose nodes have numbers `shift` higher.
    pub(crate) fn shifted(self, shift: usize) -> Motion {
        let shape = self.shape.map(|shape| Arc::new(Arc::unwrap_or_clone(shape).shifted(shift)));
        Motion { node: self.node + shift, shape, ..self }
    }
}
