//! Echoes of sound: what surfaces and water send back to the beams of a sonar, and the resulting levels.

mod bodies;
mod coupling;
mod flanks;
mod mixed;
mod ping;
mod response;

pub(crate) use bodies::{Share, answers_in_phase, grid};
pub(crate) use coupling::Coupling;
pub(crate) use flanks::Flanks;
pub(crate) use ping::{Drift, Echoes, Insonification, NO_RAY, NOBODY, PingEcho, Scatterers, Tile, Wants, texture};
pub use response::Taper;
pub(crate) use response::{Background, Lines, Response};
