//! From signals to returns: thresholds first, then measurement noise.

#[doc(inline)]
pub use engine::detect::{
    Blooming, DepthNoise, Detection, DetectionSpec, Doppler, LimitPoint, MultipleTimeAround, Noise, RangePoint,
    Statistical, Sunlight, Timing, VelocityLog, WaterLayer, WeakDropout,
};
