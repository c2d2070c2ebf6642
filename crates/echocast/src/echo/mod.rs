//! From hits to echoes: how much light comes back, and what the instrument reports of it.

mod backscatter;
mod contribution;
mod glint;
mod intensity;
mod mixed;
mod particles;
mod path;
mod phasor;
mod ping;
mod pulse;
mod response;
mod waveform;
mod weather;

pub(crate) use backscatter::Backscatter;
pub(crate) use contribution::{Contribution, Wanted};
pub(crate) use glint::Glint;
pub use intensity::IntensityEncoding;
pub(crate) use intensity::IntensityModel;
pub(crate) use particles::Cone;
pub(crate) use path::{Chosen, Follower, Meeting, PathEcho, PathEchoes, PathLimits, Preferred, Surroundings};
pub(crate) use phasor::{MOST_FREQUENCIES, Modulation, ShotNoise, natural_vignetting, turns};
pub(crate) use ping::{CHUNK_BITS, Drift, Echoes, Insonification, NOBODY, PingEcho, Scatterers, Tile, Wants, texture};
pub use pulse::PulseShape;
pub(crate) use pulse::{Pulse, erf};
pub(crate) use response::{Background, Lines, Response};
pub(crate) use waveform::{Part, Peak, Waveform};
pub(crate) use weather::{AIR, Air, AirEcho, AirEchoes, Answer, Foremost, Receiver};
