//! From hits to echoes: how much light or sound comes back.

mod light;
mod sound;

pub(crate) use light::{
    Air, AirEcho, AirEchoes, Answer, Cone, Contribution, Follower, Foremost, Glint, Image, IntensityModel,
    MOST_FREQUENCIES, Meeting, Modulation, PathEcho, PathEchoes, PathLimits, Preferred, Pulse, Pulselet, Receiver,
    ShotNoise, Surroundings, Wanted, Waveform, natural_vignetting, turns,
};
pub use light::{IntensityEncoding, PulseShape};
pub use sound::Taper;
pub(crate) use sound::{
    Background, Coupling, Drift, Echoes, Flanks, Insonification, LevelMemory, NO_RAY, NOBODY, PingEcho, Response,
    Scatterers, Share, Tile, Wants, answers_in_phase, grid, texture,
};
