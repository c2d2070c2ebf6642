//! Scenarios: a scene, a rig of sensors, and what varies from sample to sample, read from one file.
#![forbid(unsafe_code)]

mod assets;
mod draw;
mod file;
mod frames;
mod random;
mod room;
mod sample;
pub mod set;
mod shared;
mod spec;
mod splits;
mod stage;
mod strips;
#[cfg(test)]
mod tests;
mod variation;

pub use file::Scenario;
pub use frames::FrameTime;
pub use sample::{Sample, Scan};
use shared::lock;
pub use strips::ScanPiece;
