//! Scenarios: a scene, a rig of sensors, and what varies from sample to sample, read from one file.
//!
//! ```no_run
//! use echocast::Scenario;
//!
//! let scenario = Scenario::load("drive.yaml")?;
//! for index in 0..scenario.samples() {
//!     let mut sample = scenario.sample(index)?;
//!     for scan in 0..sample.scans().len() {
//!         for frame in 0..sample.scans()[scan].frames().len() {
//!             let cloud = sample.cloud(scan, frame)?;
//!             cloud.write(format!("{index}_{scan}_{frame}.las"))?;
//!         }
//!     }
//! }
//! # Ok::<(), echocast::Error>(())
//! ```

mod assets;
mod draw;
pub(crate) mod file;
mod random;
mod room;
mod sample;
pub mod set;
mod shared;
mod spec;
mod splits;
mod stage;
#[cfg(test)]
mod tests;
mod variation;

pub(crate) use file::Scenario;
pub use sample::{FrameTime, Sample, Scan};
use shared::lock;
