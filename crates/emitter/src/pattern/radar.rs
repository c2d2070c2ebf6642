//! Where radars look.

use super::fan::check_above_zero;
use crate::BeamTable;
use crate::beams::{FiringOrder, direction};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};

/// A radar that looks in all directions of its field of view at once: one frame of chirps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RadarView {
    /// Least and greatest azimuth in which it detects, degrees, -180 to 180, to the left.
    #[serde(default = "azimuths")]
    pub azimuth_deg: [f64; 2],
    /// Least and greatest elevation, degrees, -90 to 90.
    #[serde(default = "elevations")]
    pub elevation_deg: [f64; 2],
    /// Frames per second.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

/// A radar whose antenna rotates about the z axis: an image of azimuths and ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RadarRotor {
    /// Azimuths of a turn, 8 to 100000.
    pub azimuths: u32,
    /// Turns per second.
    #[serde(default = "four")]
    pub rate_hz: f64,
    /// Whether it turns clockwise, seen from above.
    #[serde(default = "yes")]
    pub clockwise: bool,
}

fn azimuths() -> [f64; 2] {
    [-60.0, 60.0]
}

fn elevations() -> [f64; 2] {
    [-15.0, 15.0]
}

fn four() -> f64 {
    4.0
}

fn yes() -> bool {
    true
}

impl RadarView {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        for (name, [least, most], limit) in
            [("azimuth_deg", self.azimuth_deg, 180.0), ("elevation_deg", self.elevation_deg, 90.0)]
        {
            bounds.within(format_args!("pattern.{name}[0]"), least, -limit, limit)?;
            bounds.within(format_args!("pattern.{name}[1]"), most, -limit, limit)?;
            if least >= most {
                return Err(Error::invalid(format!("pattern.{name}"), format!("[{least}, {most}]"), "rising"));
            }
        }
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        let mut table = BeamTable::with_size(1, 1, FiringOrder::Frame, 1.0 / self.rate_hz)?;
        table.push([1.0, 0.0, 0.0], 0.0, 0);
        Ok(table)
    }
}

impl RadarRotor {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("pattern.azimuths", f64::from(self.azimuths), 8.0, 1e5)?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)
    }

    /// Azimuth of a row, degrees, counter-clockwise from ahead.
    #[doc(hidden)]
    pub fn azimuth_deg(&self, row: u32) -> f64 {
        let turned = 360.0 * f64::from(row) / f64::from(self.azimuths);
        if self.clockwise { -turned } else { turned }
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        let (count, period) = (self.azimuths, 1.0 / self.rate_hz);
        let mut table = BeamTable::with_size(1, count as usize, FiringOrder::Beams, period)?;
        for row in 0..count {
            let time = period * f64::from(row) / f64::from(count);
            table.push(direction(self.azimuth_deg(row), (0.0, 1.0)), time, 0);
        }
        Ok(table)
    }
}
