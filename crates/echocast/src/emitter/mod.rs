//! What is emitted, when and from where.

mod aim;
mod aperture;
mod beams;
mod footprint;
mod image_grid;
pub mod lobe;
mod motion;
pub mod pattern;
pub(crate) mod trajectory;
mod transducer;

pub(crate) use crate::ground::pose::Pose;
pub(crate) use aim::{Aim, scatter};
pub(crate) use aperture::FAINT;
pub use beams::{BeamTable, FiringOrder, RayColumns};
pub(crate) use footprint::{Across, Footprint};
pub(crate) use image_grid::Outline;
pub use image_grid::{ImageGrid, Intrinsics};
pub(crate) use lobe::Lobe;
use motion::PlatformMotion;
pub(crate) use pattern::Pattern;
pub(crate) use trajectory::Trajectory;
pub(crate) use transducer::{FLANK_PARTS, ReceivingBeams, Transducer};
