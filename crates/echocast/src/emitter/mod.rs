//! What is sent, when and from where.

mod beams;
mod csv;
pub mod pattern;
mod pose;
mod trajectory;

pub use beams::{BeamTable, FiringOrder};
pub use pattern::Pattern;
pub use pose::Pose;
pub use trajectory::Trajectory;
