//! From a cube to detections: thresholds, maxima, directions, and which path each detection is of.

mod cfar;
mod law;

pub use cfar::{Cfar, CfarAxis, CfarMethod, CfarShape};
pub use law::{CfarLaw, ReferenceLevel};
