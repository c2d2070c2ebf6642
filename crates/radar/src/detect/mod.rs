//! From a cube to detections: thresholds, maxima, directions, and which path each detection is of.

mod angle;
mod cfar;
mod law;
mod response;

pub use angle::{DirectionFinder, PlaneWave};
pub use cfar::{Cfar, CfarAxis, CfarMethod, CfarShape};
pub use law::{CfarLaw, ReferenceLevel};
pub use response::{CellPeak, WindowResponse};
