//! From hits to echoes: how much light comes back, and what the instrument reports of it.

mod contribution;
mod intensity;
mod particles;
mod path;
mod phasor;
mod pulse;
mod weather;

pub(crate) use contribution::{Contribution, Wanted};
pub use intensity::IntensityEncoding;
pub(crate) use intensity::IntensityModel;
pub(crate) use particles::Cone;
pub(crate) use path::{Chosen, Follower, PathEcho, PathLimits, Surroundings};
pub(crate) use phasor::{MOST_FREQUENCIES, Modulation, ShotNoise, natural_vignetting, turns};
pub(crate) use pulse::Pulse;
pub use pulse::PulseShape;
pub(crate) use weather::{AIR, Air, Answer, Receiver};
