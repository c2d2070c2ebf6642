//! The keys of the section `radar` of a sensor file; and what a radar records beside its detections: the cube of a frame,
//! the samples of its converters, and the polar image of a rotating one.

#[doc(inline)]
pub use ::radar::{
    ArrayElements, ArrayRow, ArraySpec, Axis, AzimuthMap, CfarDims, CfarMethod, CubeAxes, DetectionLimits,
    DetectionSteps, ElementGrid, ElementPattern, FftWindow, Fmcw, Leakage, LobeShape, Multiplex, Polarisation,
    RadarCube, RadarDetectionSpec, RadarPulse, RadarWaveform, VirtualArray,
};
#[doc(inline)]
pub use cloud::{PolarImage, RadarFrame, RawSamples};
#[doc(inline)]
pub use engine::scan::RadarRecord;
#[doc(inline)]
pub use engine::sensor::{RadarSpec, RadarWindows};
