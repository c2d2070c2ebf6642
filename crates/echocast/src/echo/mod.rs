//! From hits to echoes: how much light comes back, and what the instrument reports of it.

mod contribution;
mod intensity;

pub(crate) use contribution::{Contribution, Wanted};
pub use intensity::IntensityEncoding;
pub(crate) use intensity::IntensityModel;
