//! What a radar does with the paths that waves take: waveforms, arrays, cubes of range x Doppler x channel, noise, and
//! detection. Independent of scenes.

mod cube;
mod detect;
mod paths;

pub use cube::{Axis, CubeAxes, RadarCube};
pub use detect::*;
pub use paths::Paths;

/// Speed of light, m/s.
pub const LIGHT_SPEED: f64 = 299_792_458.0;
