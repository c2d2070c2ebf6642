//! Rays to hits: the only user of Embree.

use crate::error::Result;
use crate::scene::{Labels, Scene};
use std::sync::Arc;

/// A scene with its ray-tracing structure, immutable and shared by threads.
#[derive(Clone)]
pub struct BuiltScene {
    pub(crate) labels: Arc<Labels>,
}

impl BuiltScene {
    pub(crate) fn new(_scene: &Scene) -> Result<BuiltScene> {
        todo!()
    }

    /// Names of the label numbers.
    pub fn labels(&self) -> &Labels {
        &self.labels
    }
}
