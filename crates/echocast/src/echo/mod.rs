//! From hits to echoes: how much light comes back, and what the instrument reports of it.

mod intensity;

pub use intensity::IntensityEncoding;
