//! A scan of a sonar: one ping.

mod cloud;
mod explain;
mod ping;
mod track;

pub(in crate::scan) use ping::Told;
