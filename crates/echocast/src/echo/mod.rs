//! From hits to echoes: how much light or sound returns.

mod light;
mod sound;

pub(crate) use light::{
    Air, AirEcho, AirEchoes, Answer, Cone, Contribution, Follower, Foremost, Glint, IntensityModel, MOST_FREQUENCIES,
    Meeting, MirrorImage, Modulation, PathEcho, PathEchoes, PathLimits, Preferred, Pulse, Pulselet, Receiver,
    RequestedQuantities, ShotNoise, Surroundings, Waveform, natural_vignetting, turns,
};
pub use light::{IntensityEncoding, PulseShape};
pub use sound::Taper;
pub(crate) use sound::{
    Background, Coupling, Drift, Echoes, Flanks, Insonification, LevelMemory, NO_CONTRIBUTOR, NO_RAY, PingEcho,
    Response, Scatterers, Tile, TileQuantities, TubeShare, grid, has_coherent_echo, texture,
};
