//! From hits to echoes: how much light, sound or radar waves return.

mod light;
pub(crate) mod radar;
pub mod sound;

pub(crate) use light::{
    Air, AirArrivals, AirEcho, AirEchoes, Arrivals, Batch, BeamRays, BeamSignal, Cone, Contribution, Contributor,
    EchoShape, Follower, Glint, HitTriangle, IntensityModel, LIGHT_ROUNDING, MOST_EXPECTED, MOST_FREQUENCIES, Meeting,
    Met, MirrorImage, Modulation, OFF_SURFACE, ParticleOrder, PathArrivals, PathEcho, PathEchoes, PathLimits, Peak,
    PieceOrigin, PieceSource, PlainEchoes, Provenance, Pulse, ReceiverOptics, RequestedQuantities, Share, ShotNoise,
    SurfacePlane, Surroundings, TracedRay, Waveform, natural_vignetting, strongest_contributor, turns,
};
pub use light::{IntensityEncoding, PulseShape};
pub use sound::Taper;
pub(crate) use sound::{
    Background, Coupling, Drift, Echoes, Flanks, Insonification, LevelMemory, NO_CONTRIBUTOR, NO_RAY, PingEcho,
    Response, Scatterers, Tile, TileQuantities, TubeShare, grid, has_coherent_echo, texture,
};
