//! Scan patterns: where each beam points and when it fires.

mod fan;
mod janus;
mod line_scan;
mod pinhole;
mod radar;
mod raster;
mod risley;
mod sonar;
mod spinning;
mod sweep;
mod table;

pub use fan::Fan;
pub use janus::{JANUS_BEAMS, Janus};
pub use line_scan::{LinePlane, LineScan, LineSettings, TurningHead};
pub use pinhole::{Pinhole, Rays};
pub use radar::{RadarRotor, RadarView};
pub use raster::Raster;
pub use risley::{Face, Prism, Risley};
pub use sonar::{Flat, Imaging, Multibeam, Sides, Sidescan, SingleBeam, Spacing};
pub use spinning::{Channels, Direction, Spinning, SpinningAzimuth};
pub use sweep::{
    ConeMirror, FibreLine, LineSweep, OscillatingMirror, PalmerMirror, RotatingMirror, SwingLaw, WideAxis,
};
pub use table::Table;

use super::BeamTable;
use super::beams::MAX_BEAMS;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml::{self, Document};
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;

/// A scan pattern, as written in the `pattern` section of a sensor file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Pattern {
    /// Emitters that rotate about the z axis.
    Spinning(Spinning),
    /// One beam that sweeps row by row.
    Raster(Raster),
    /// A camera: one exposure of all pixels.
    Pinhole(Pinhole),
    /// Beams through rotating prisms; no scan repeats another.
    Risley(Risley),
    /// One beam that a mirror sweeps line by line.
    LineScan(LineScan),
    /// Beams listed in a CSV file.
    Table(Table),
    /// Two fans of sound across the track.
    Sidescan(Sidescan),
    /// Beams of sound across the track, down.
    Multibeam(Multibeam),
    /// Beams of sound side by side, looking ahead.
    Imaging(Imaging),
    /// One beam of sound.
    SingleBeam(SingleBeam),
    /// Four beams of sound, down and outwards: those of a Doppler velocity log.
    Dvl(Janus),
    /// A radar that looks everywhere at once.
    Radar(RadarView),
    /// A radar whose antenna rotates.
    RadarRotor(RadarRotor),
    /// Beams given in code (`Sensor::from_beams`); files cannot express this.
    Custom,
}

/// Words for the patterns in files.
const WORDS: [&str; 13] = [
    "spinning",
    "raster",
    "pinhole",
    "risley",
    "line_scan",
    "table",
    "sidescan",
    "multibeam",
    "imaging",
    "single_beam",
    "dvl",
    "radar",
    "radar_rotor",
];

impl<'de> Deserialize<'de> for Pattern {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (word, section) = yaml::split_tag(deserializer, "type")?;
        Ok(match word.as_str() {
            "spinning" => Pattern::Spinning(section.read()?),
            "raster" => Pattern::Raster(section.read()?),
            "pinhole" => Pattern::Pinhole(section.read()?),
            "risley" => Pattern::Risley(section.read()?),
            "line_scan" => Pattern::LineScan(section.read()?),
            "table" => Pattern::Table(section.read()?),
            "sidescan" => Pattern::Sidescan(section.read()?),
            "multibeam" => Pattern::Multibeam(section.read()?),
            "imaging" => Pattern::Imaging(section.read()?),
            "single_beam" => Pattern::SingleBeam(section.read()?),
            "dvl" => Pattern::Dvl(section.read()?),
            "radar" => Pattern::Radar(section.read()?),
            "radar_rotor" => Pattern::RadarRotor(section.read()?),
            "custom" => Pattern::Custom,
            _ => return Err(section.unknown(&word, &WORDS)),
        })
    }
}

impl Pattern {
    /// Reads a pattern from YAML: the section `pattern` of a sensor file.
    ///
    /// # Errors
    /// The key of what is wrong, and what is allowed.
    pub fn from_yaml(text: &str) -> Result<Pattern> {
        let pattern: Pattern = Document::parse("YAML text", text)?.read()?;
        pattern.check()?;
        Ok(pattern)
    }

    /// Checks that all values are within what is allowed.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the key, from `pattern` on.
    pub fn check(&self) -> Result<()> {
        self.check_with(&mut Bounds::none())
    }

    /// [`Pattern::check`] that reports all bounded numbers to `bounds`.
    #[doc(hidden)]
    pub fn check_with(&self, bounds: &mut Bounds) -> Result<()> {
        match self {
            Pattern::Spinning(spinning) => spinning.check(bounds),
            Pattern::Raster(raster) => raster.check(bounds),
            Pattern::Pinhole(pinhole) => pinhole.check(bounds),
            Pattern::Risley(risley) => risley.check(bounds),
            Pattern::LineScan(scan) => scan.check(bounds),
            Pattern::Table(table) => table.check(bounds),
            Pattern::Sidescan(sidescan) => sidescan.check(bounds),
            Pattern::Multibeam(multibeam) => multibeam.check(bounds),
            Pattern::Imaging(imaging) => imaging.check(bounds),
            Pattern::SingleBeam(beam) => beam.check(bounds),
            Pattern::Dvl(janus) => janus.check(bounds),
            Pattern::Radar(view) => view.check(bounds),
            Pattern::RadarRotor(rotor) => rotor.check(bounds),
            Pattern::Custom => Ok(()),
        }
    }

    /// Makes file names absolute, relative to `folder`, so that the pattern means the same everywhere. Those kept from
    /// the pattern `before`, from which this one was made, stay the same, however they are written.
    #[doc(hidden)]
    pub fn resolve(&mut self, folder: &Path, before: Option<&Pattern>) {
        if let (Pattern::Table(table), Some(Pattern::Table(before))) = (&mut *self, before) {
            table.keep_file(before);
        }
        if let Pattern::Table(Table { file, .. }) = self {
            let path = folder.join(&*file);
            *file = std::path::absolute(&path).unwrap_or(path);
        }
    }

    /// Whether it is the pattern of a sonar.
    pub fn is_of_sound(&self) -> bool {
        matches!(
            self,
            Pattern::Sidescan(_)
                | Pattern::Multibeam(_)
                | Pattern::Imaging(_)
                | Pattern::SingleBeam(_)
                | Pattern::Dvl(_)
        )
    }

    /// Whether it is the pattern of a radar.
    pub fn is_of_radar(&self) -> bool {
        matches!(self, Pattern::Radar(_) | Pattern::RadarRotor(_))
    }

    /// Whether every scan has the same beams.
    pub fn repeats(&self) -> bool {
        match self {
            Pattern::Risley(_) => false,
            Pattern::LineScan(scan) => scan.repeats(),
            _ => true,
        }
    }

    /// The beams of the scan that starts at `start_time`, s, which matters only for patterns that do not repeat.
    ///
    /// # Errors
    /// Values out of range, naming the key; a beam table that cannot be read.
    pub fn beams(&self, start_time: f64) -> Result<BeamTable> {
        self.check()?;
        match self {
            Pattern::Spinning(spinning) => spinning.beams(),
            Pattern::Raster(raster) => raster.beams(),
            Pattern::Pinhole(pinhole) => pinhole.beams(),
            Pattern::Risley(risley) => risley.beams(start_time),
            Pattern::LineScan(scan) => scan.beams(start_time),
            Pattern::Table(table) => table.beams(),
            Pattern::Sidescan(sidescan) => sidescan.beams(),
            Pattern::Multibeam(multibeam) => multibeam.beams(),
            Pattern::Imaging(imaging) => imaging.beams(),
            Pattern::SingleBeam(beam) => beam.beams(),
            Pattern::Dvl(janus) => janus.beams(),
            Pattern::Radar(view) => view.beams(),
            Pattern::RadarRotor(rotor) => rotor.beams(),
            Pattern::Custom => Err(Error::invalid(
                "pattern.type",
                "custom",
                format!("{} (custom beams are given in code)", WORDS.join(", ")),
            )),
        }
    }
}

impl Pattern {
    /// [`Pattern::beams`] of a pattern that does not repeat, into `table`, which has those of another scan.
    ///
    /// # Errors
    /// As [`Pattern::beams`].
    #[doc(hidden)]
    pub fn redraw(&self, start_time: f64, table: &mut BeamTable) -> Result<()> {
        match self {
            Pattern::Risley(risley) => {
                table.clear();
                risley.draw(start_time, table)
            }
            Pattern::LineScan(scan) => {
                table.clear();
                scan.draw(start_time, table)
            }
            other => other.beams(start_time).map(|beams| *table = beams),
        }
    }
}

/// Scans per second of patterns that specify none.
fn ten() -> f64 {
    10.0
}

/// Checks that `rows` x `columns` beams are not too many; `keys` set how many there are.
fn check_count(keys: &str, rows: u64, columns: u64) -> Result<()> {
    if rows.checked_mul(columns).is_some_and(|beams| beams <= MAX_BEAMS) {
        return Ok(());
    }
    Err(Error::invalid(keys, format!("{rows} x {columns} beams"), format!("at most {MAX_BEAMS} beams in a scan")))
}
