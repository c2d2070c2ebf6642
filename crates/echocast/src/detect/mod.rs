//! Signal to returns: thresholds first, then measurement noise.

mod noise;
mod threshold;

pub use noise::Noise;
pub(crate) use noise::RangeError;
pub(crate) use threshold::Threshold;
pub use threshold::{Detection, LimitPoint};
