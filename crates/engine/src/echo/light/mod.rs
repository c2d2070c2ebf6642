//! Echoes of light: what surfaces, mirrors, glass and the air return, and the resulting signal.

mod arrivals;
mod contribution;
mod glint;
mod images;
mod intensity;
mod particles;
mod patchwork;
mod path;
mod phasor;
mod picked;
mod plain;
mod pulse;
mod rays;
mod signal;
mod strongest;
mod waveform;
mod weather;

pub(crate) use arrivals::{AirArrivals, Arrivals, PathArrivals, PieceSource, Provenance};
pub(crate) use contribution::{Contribution, RequestedQuantities};
pub(crate) use glint::Glint;
pub(crate) use images::MirrorImage;
pub use intensity::IntensityEncoding;
pub(crate) use intensity::IntensityModel;
pub(crate) use particles::Cone;
pub(crate) use patchwork::{HitTriangle, MOST_EXPECTED, TracedRay};
pub(crate) use path::{Follower, Meeting, PathEcho, PathEchoes, PathLimits, Surroundings};
pub(crate) use phasor::{MOST_FREQUENCIES, Modulation, ShotNoise, natural_vignetting, turns};
pub(crate) use plain::PlainEchoes;
pub(crate) use pulse::Pulse;
pub use pulse::PulseShape;
pub(crate) use rays::{Batch, BeamRays, Met, OFF_SURFACE};
pub(crate) use signal::BeamSignal;
pub(crate) use strongest::{Contributor, PieceOrigin, Share, SurfacePlane, strongest_contributor};
pub(crate) use waveform::{EchoShape, Peak, Waveform};
pub(crate) use weather::{Air, AirEcho, AirEchoes, LIGHT_ROUNDING, ParticleOrder, ReceiverOptics};
