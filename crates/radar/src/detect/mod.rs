//! From a cube to detections: thresholds, maxima, directions, and which path each detection is of.

mod law;

pub use law::{CfarLaw, ReferenceLevel};
