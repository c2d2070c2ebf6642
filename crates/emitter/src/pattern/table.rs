//! Beams listed in a CSV file.

use super::fan::check_above_zero;
use crate::beams::{FARTHEST_ORIGIN_M, MAX_BEAMS, direction};
use crate::{BeamTable, FiringOrder};
use ground::error::Result;
use ground::read::bounds::Bounds;
use ground::read::csv::CsvReader;
use ground::shown;
use ground::units::seconds_from_us;
use serde::{Deserialize, Serialize, Serializer};
use std::path::{Path, PathBuf};

/// Beams listed in a CSV file with the header `azimuth_deg,elevation_deg` and optionally
/// `time_us,channel,range_min_m,range_max_m,origin_x_m,origin_y_m,origin_z_m`, in any order; one row per beam.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Table {
    /// The file; a relative name is relative to the folder of the sensor file. A name that is not UTF-8 is written
    /// escaped.
    #[serde(serialize_with = "escaped")]
    pub file: PathBuf,
    /// Scans per second, above 0; 10 when not given.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

fn escaped<S: Serializer>(file: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    match file.to_str() {
        Some(name) => serializer.serialize_str(name),
        None => serializer.serialize_str(&shown::path(file)),
    }
}

impl Table {
    /// Keeps the file of `before` where this one was written from it.
    pub(super) fn keep_file(&mut self, before: &Table) {
        if self.file == Path::new(&shown::path(&before.file)) {
            self.file.clone_from(&before.file);
        }
    }

    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        const REQUIRED: [&str; 2] = ["azimuth_deg", "elevation_deg"];
        const ORIGIN: [&str; 3] = ["origin_x_m", "origin_y_m", "origin_z_m"];
        const OPTIONAL: [&str; 4] = ["time_us", "channel", "range_min_m", "range_max_m"];
        let mut csv = CsvReader::open(&self.file)?;
        let [azimuth, elevation] = csv.required(REQUIRED)?;
        let [time, channel, range_min, range_max] = csv.optional(OPTIONAL);
        let origin = csv.optional(ORIGIN);
        csv.only(&[&REQUIRED[..], &OPTIONAL, &ORIGIN].concat())?;
        let mut table = BeamTable::with_size(1, 0, FiringOrder::Beams, 1.0 / self.rate_hz)?;
        while let Some(row) = csv.next_row()? {
            let number = |column: Option<usize>, absent: f64| column.map_or(absent, |column| row[column]);
            let (az, el) = (row[azimuth], row[elevation]);
            let (us, emitter) = (number(time, 0.0), number(channel, 0.0));
            let start = origin.map(|column| number(column, 0.0));
            let far_off = start.iter().position(|place| place.abs() > FARTHEST_ORIGIN_M);
            let (near, far) = (number(range_min, 0.0), number(range_max, f64::INFINITY));
            if table.len() as u64 == MAX_BEAMS {
                return Err(csv.error(format!("row {} is one too many; allowed: {MAX_BEAMS} beams", MAX_BEAMS + 1)));
            }
            let fault = if !(-360.0..=360.0).contains(&az) {
                Some(("azimuth_deg", az, "-360 to 360"))
            } else if !(-90.0..=90.0).contains(&el) {
                Some(("elevation_deg", el, "-90 to 90"))
            } else if us.abs() > 1e12 {
                Some(("time_us", us, "-1e12 to 1e12"))
            } else if !(0.0..=65535.0).contains(&emitter) || emitter.fract() != 0.0 {
                Some(("channel", emitter, "whole numbers from 0 to 65535"))
            } else if near < 0.0 {
                Some(("range_min_m", near, "0 or more"))
            } else if far <= near {
                Some(("range_max_m", far, "above range_min_m"))
            } else {
                far_off.map(|axis| (ORIGIN[axis], start[axis], "-1e6 to 1e6"))
            };
            if let Some((name, value, allowed)) = fault {
                return Err(csv.error(format!("{name} is {value}; allowed: {allowed}")));
            }
            table.push(direction(az, el.to_radians().sin_cos()), seconds_from_us(us), emitter as u16);
            if origin.iter().any(Option::is_some) {
                table.origin.iter_mut().zip(start).for_each(|(axis, place)| axis.push(place as f32));
            }
            if range_min.is_some() {
                table.range_min.push(near as f32);
            }
            if range_max.is_some() {
                table.range_max.push(far as f32);
            }
        }
        if table.is_empty() {
            return Err(csv.error_at_all("has no beams; expected a row for each below the header"));
        }
        table.columns = table.len() as u32;
        Ok(table)
    }
}
