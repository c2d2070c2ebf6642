//! From signals to returns: thresholds first, then measurement noise.

mod alarms;
mod blooming;
mod curve;
mod depth;
mod doppler;
mod errors;
mod noise;
mod returns;
mod soundings;
mod statistical;
mod threshold;
mod velocity_log;

use curve::RangeCurve;

pub(crate) use alarms::FalseAlarms;
pub use blooming::Blooming;
pub(crate) use depth::DepthError;
pub use depth::DepthNoise;
pub use doppler::Doppler;
pub(crate) use errors::{Errors, Returns};
use noise::AzimuthError;
pub(crate) use noise::{IntensityError, RangeError};
pub use noise::{Noise, RangePoint, WeakDropout};
pub use returns::ReturnMode;
pub(crate) use returns::{Peak, ReturnRule};
pub(crate) use soundings::{BeamLevels, Beside, SoundingMemory, bins_about, sounding};
pub use statistical::{Statistical, Sunlight};
pub(crate) use threshold::Threshold;
pub use threshold::{Detection, DetectionSpec, LimitPoint, Timing};
pub(crate) use velocity_log::{BeamRate, Tracked};
pub use velocity_log::{VelocityLog, WaterLayer};
