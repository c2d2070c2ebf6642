//! From signals to returns: thresholds first, then measurement noise.

mod alarms;
mod amcw;
mod beamformer;
mod blooming;
mod curve;
mod depth;
mod detections;
mod doppler;
mod encoder;
mod errors;
mod foremost;
mod gate;
mod janus;
mod noise;
mod paper;
mod pulsed;
mod receiver;
pub mod returns;
mod statistical;
mod threshold;

use curve::RangeCurve;

pub(crate) use alarms::FalseAlarms;
pub(crate) use amcw::DepthCamera;
pub(crate) use beamformer::{BeamLevels, Beside, SoundingMemory, bins_about, sounding};
pub use blooming::Blooming;
pub(crate) use depth::DepthError;
pub use depth::DepthNoise;
pub(crate) use detections::{Detections, LaneEchoes, ReceivedBeam, Returns};
pub use doppler::Doppler;
use encoder::EncoderScale;
pub(crate) use errors::Errors;
pub(crate) use foremost::ForemostPaths;
pub(crate) use gate::Gate;
pub(crate) use janus::{BeamRate, Tracked};
pub use janus::{VelocityLog, WaterLayer};
use noise::AzimuthError;
pub(crate) use noise::{IntensityError, RangeError};
pub use noise::{Noise, RangePoint, WeakDropout};
pub(crate) use receiver::{Method, Receiver};
pub use returns::ReturnMode;
pub(crate) use returns::ReturnRule;
pub use statistical::{Statistical, Sunlight};
pub(crate) use threshold::Threshold;
pub use threshold::{Detection, DetectionSpec, LimitPoint, Timing};
