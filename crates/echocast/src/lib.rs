//! echocast simulates depth sensors: it casts the beams of LiDAR, ToF and sonar instruments over a
//! 3D scene through Embree and returns what the instrument would have reported, every point labelled.
//!
//! The module list, read top to bottom, is the path of one scan: a [`scene`] is read and resolved,
//! [`BuiltScene`] traces it, the [`emitter`] of a [`Sensor`] says which beams go out when and from
//! where, hits become [`echo`]es, echoes are [`detect`]ed and collected in a [`PointCloud`], which
//! [`export`] writes to files.
#![forbid(unsafe_code)]

pub mod cloud;
pub mod detect;
pub mod echo;
pub mod emitter;
pub mod error;
pub mod export;
pub mod material;
mod presets;
mod rng;
pub mod report;
mod scan;
pub mod scene;
mod sensor;
mod trace;
pub mod units;
mod yaml;

pub use cloud::{Field, FieldSet, Frame, PointCloud};
pub use emitter::{Pose, Trajectory};
pub use error::{Error, Result};
pub use material::ReflectanceSource;
pub use report::Report;
pub use scan::{Order, Profile, ScanOptions};
pub use scene::{LabelRules, LoadOptions, Scene};
pub use sensor::{
    BeamSpec, Expectations, IntensitySpec, PresetInfo, RangeSpec, ReturnMode, ReturnsSpec, Sensor, SensorKind, SensorSpec,
};
pub use trace::{BareLoop, BuiltScene};
