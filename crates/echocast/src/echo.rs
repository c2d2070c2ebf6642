//! From hits to echoes: how much light or sound returns.

#[doc(inline)]
pub use engine::echo::{IntensityEncoding, PulseShape};
