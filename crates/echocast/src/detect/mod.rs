//! Signal to returns: thresholds first, then measurement noise.

mod depth;
mod noise;
mod threshold;

pub(crate) use depth::DepthError;
pub use depth::DepthNoise;
pub use noise::Noise;
pub(crate) use noise::RangeError;
pub(crate) use threshold::Threshold;
pub use threshold::{Detection, LimitPoint};
