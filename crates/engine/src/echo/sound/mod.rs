//! Echoes of sound: what surfaces and water return to the beams of a sonar, and the resulting levels.

mod blocks;
mod bodies;
mod coupling;
mod echo;
mod echoes;
mod flanks;
mod levels;
mod mixed;
mod parts;
mod ping;
mod response;
mod tile;

pub(crate) use bodies::{TubeShare, grid, has_coherent_echo};
pub(crate) use coupling::Coupling;
pub(crate) use echo::{NO_RAY, PingEcho};
pub(crate) use echoes::Echoes;
pub(crate) use flanks::Flanks;
pub(crate) use levels::{Background, LevelMemory};
pub(crate) use parts::{Scatterers, texture};
pub(crate) use ping::{Drift, Insonification};
pub(crate) use response::Response;
pub use response::Taper;
pub(crate) use tile::{NO_CONTRIBUTOR, Tile, TileQuantities};
