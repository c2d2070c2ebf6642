//! From a cube to detections: thresholds, maxima, directions, and which path each detection is of.

mod angle;
mod cfar;
mod detector;
mod law;
mod response;
mod sharing;
mod spec;
#[cfg(test)]
mod test_radar;

pub use angle::{DirectionFinder, PlaneWave};
pub use cfar::{Cfar, CfarAxis, CfarMethod, CfarShape};
pub use detector::{CubeGeometry, Detector, RadarDetections};
pub use law::{CfarLaw, ReferenceLevel};
pub use response::{CellPeak, WindowResponse};
pub use sharing::{DetectionTruth, PathPart, SeenBy, Sharing, TruthPaths};
pub use spec::{CfarDims, DetectionLimits, DetectionSteps, RadarDetectionSpec};
