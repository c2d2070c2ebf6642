//! What is emitted, when and from where.
#![forbid(unsafe_code)]

mod aim;
mod aperture;
mod beams;
mod drift;
mod footprint;
mod image_grid;
mod inertial;
pub mod lobe;
mod motion;
mod navigation;
pub mod pattern;
pub mod trajectory;
mod transducer;

pub use aim::{Aim, scatter};
pub use aperture::FAINT;
pub use beams::{BeamTable, FiringOrder, RayColumns};
pub use footprint::{Across, Footprint, ROUND, SubRayFan};
pub use ground::pose::Pose;
pub use image_grid::Outline;
pub use image_grid::{ImageGrid, Intrinsics};
pub use inertial::{Imu, ImuModel, ImuSample, InertialNoise, OdometrySample, STANDARD_GRAVITY};
pub use lobe::Lobe;
use motion::PlatformMotion;
pub use navigation::{AttitudeError, Navigation, NavigationSolution, PositionError};
pub use pattern::Pattern;
pub use trajectory::Trajectory;
pub use transducer::{FLANK_PARTS, ReceivingBeams, Transducer};
