//! What a radar does with the paths that waves take: waveforms, arrays, cubes of range x Doppler x channel, noise, and
//! detection. Independent of scenes.

mod adc;
mod array;
mod correlation;
mod cube;
mod cube_view;
mod decode;
mod deposit;
mod detect;
mod disturb;
mod noise;
pub mod optics;
mod paths;
mod pattern;
mod plan;
mod response;
mod waveform;
pub mod window;

pub use adc::{AdcSamples, AdcSpec};
pub use array::{ArrayElements, ArrayRow, ArraySpec, ElementGrid, Polarisation, VirtualArray};
pub use cube::{Axis, CubeAxes, RadarCube};
pub use cube_view::AzimuthMap;
pub use detect::*;
pub use disturb::{Interferer, PhaseNoise, check_interferers, range_correlation};
pub use noise::Leakage;
pub use paths::Paths;
pub use pattern::{ElementPattern, LobeShape, LobeTable};
pub use plan::{RadarPlan, noise_density};
pub use waveform::{Fmcw, MOST_CELLS, Multiplex, RadarPulse, RadarWaveform};
pub use window::FftWindow;

/// Speed of light, m/s.
pub const LIGHT_SPEED: f64 = 299_792_458.0;
