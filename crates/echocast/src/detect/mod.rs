//! Signal to returns: thresholds first, then measurement noise.

mod noise;
mod returns;
mod threshold;

pub use noise::Noise;
pub(crate) use noise::RangeError;
pub use returns::ReturnMode;
pub(crate) use returns::ReturnRule;
pub(crate) use threshold::Threshold;
pub use threshold::{Detection, LimitPoint};
