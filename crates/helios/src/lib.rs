//! Imports surveys of HELIOS++ (<https://github.com/3dgeo-heidelberg/helios>): reads the XML of survey, scanner, platform
//! and scene with their templates, converts them to a scenario, sensors and a trajectory, and says of every element and
//! attribute what became of it.
//!
//! How HELIOS++ understands its files is taken from its source, at the commit that the comments name.

mod assets;
mod beams;
mod convert;
mod flight;
mod ground_height;
mod import;
mod notes;
mod pattern;
mod platform;
mod scanner;
mod scene;
mod settings;
mod surfaces;
mod survey;
mod track;
mod turning;
mod xml;

pub use convert::Converted;
pub use import::Import;
pub use notes::{ImportNote, ImportOutcome};
pub use platform::{HeliosMovement, HeliosPlatform, HeliosRotors};
pub use scanner::{HeliosChannel, HeliosOptics, HeliosPrism, HeliosSampling, HeliosScanner};
pub use scene::{HeliosPart, HeliosScene};
pub use settings::HeliosSettings;
pub use survey::{HeliosLeg, HeliosSurvey};
pub use track::HeliosTrack;
pub use turning::Fitting;

#[cfg(test)]
mod tests;
