//! The engine: scenes, what traces them, what arrives, what receives it, and scans of sensors.
#![forbid(unsafe_code)]

pub mod detect;
pub mod echo;
pub mod medium;
pub mod scan;
pub mod scene;
pub mod sensor;
pub mod trace;
