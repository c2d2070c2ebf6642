//! Signal to returns: thresholds first, then measurement noise.

mod noise;
mod threshold;

pub use noise::Noise;
pub use threshold::{Detection, LimitPoint};
