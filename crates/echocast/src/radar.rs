//! What a radar records beside its detections: the cube of a frame, the samples of its converters, and the polar image
//! of a rotating one.

#[doc(inline)]
pub use ::radar::{Axis, CubeAxes, RadarCube};
#[doc(inline)]
pub use cloud::{PolarImage, RadarFrame, RawSamples};
