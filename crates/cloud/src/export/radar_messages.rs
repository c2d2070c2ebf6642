//! Detections of a radar as messages of ROS 2, in the frame of the radar.
//!
//! Definitions: `radar_msgs` of ros-perception; `continental_msgs` of Nebula (TIER IV), whose driver for the ARS 548
//! makes a `RadarScan` of its detections with the range rate as `doppler_velocity` and the RCS as `amplitude`, as here.
//! Both velocities are rates of the range: negative where target and radar approach each other.

use crate::messages::cdr::{CdrWriter, Stamp};
use crate::{Field, PointCloud};
use glam::Vec3;
use ground::angle::azimuth_elevation;
use std::io;

pub(super) const SCAN: &str = "radar_msgs/RadarScan";
pub(super) const DETECTIONS: &str = "continental_msgs/ContinentalArs548DetectionList";

/// A clock that is synchronised.
const SYNCHRONISED: u8 = 1;

/// Of something that is certain, %.
const CERTAIN: u8 = 100;

/// Whether `cloud` holds detections of a radar.
pub(super) fn is_radar(cloud: &PointCloud) -> bool {
    cloud.fields.contains_any(&[Field::Rcs, Field::Snr])
}

/// A detection as the radar reports it; NaN where it does not.
struct RadarReport {
    row: usize,
    range: f32,
    azimuth: f32,
    elevation: f32,
    rate: f32,
    rcs: f32,
}

/// The rows of `cloud` that have a position; directions and ranges are found from it where they were not computed.
fn reports(cloud: &PointCloud) -> Vec<RadarReport> {
    let (c, to_sensor) = (&cloud.columns, cloud.to_frame(&cloud.sensor_pose));
    let or =
        |column: &[f32], row: usize, other: f32| column.get(row).copied().filter(|x| x.is_finite()).unwrap_or(other);
    let report = |row: usize| {
        let place = to_sensor([c.x[row], c.y[row], c.z[row]]);
        let [azimuth, elevation] = azimuth_elevation(place);
        RadarReport {
            row,
            range: or(&c.range, row, Vec3::from(place).length()),
            azimuth: or(&c.azimuth, row, azimuth),
            elevation: or(&c.elevation, row, elevation),
            rate: or(&c.doppler, row, f32::NAN),
            rcs: or(&c.rcs, row, f32::NAN),
        }
    };
    (0..cloud.len).filter(|&row| (c.x[row] + c.y[row] + c.z[row]).is_finite()).map(report).collect()
}

/// [`SCAN`].
pub(super) fn scan(message: &mut CdrWriter, cloud: &PointCloud, frame: &str, stamp: Stamp) -> io::Result<()> {
    let reports = reports(cloud);
    message.header(stamp, frame)?;
    message.count(reports.len())?;
    for RadarReport { range, azimuth, elevation, rate, rcs, .. } in reports {
        message.f32s(&[range, azimuth, elevation, rate, rcs]);
    }
    Ok(())
}

/// [`DETECTIONS`]. The cloud does not say where the radar is on its vehicle, nor which velocities it tells apart: these
/// are 0 and NaN.
pub(super) fn detections(message: &mut CdrWriter, cloud: &PointCloud, frame: &str, stamp: Stamp) -> io::Result<()> {
    let (reports, c) = (reports(cloud), &cloud.columns);
    message.header(stamp, frame)?;
    message.u8(SYNCHRONISED);
    message.f64s(&[0.0; 3]);
    message.f32s(&[0.0, 0.0, 0.0, 0.0, f32::NAN, f32::NAN, 0.0, 0.0]);
    message.u8(0);
    message.count(reports.len())?;
    for RadarReport { row, range, azimuth, elevation, rate, rcs } in reports {
        let error = |column: &[f32]| column.get(row).copied().unwrap_or(f32::NAN);
        let errors =
            [&c.range_sigma, &c.azimuth_sigma, &c.elevation_sigma, &c.velocity_sigma].map(|column| error(column));
        message.f32s(&[azimuth, errors[1]]);
        // Whether distance, azimuth, elevation and rate, each followed by its error, are invalid.
        for (value, error) in [range, azimuth, elevation, rate].into_iter().zip(errors) {
            message.u8(value.is_nan().into());
            message.u8(error.is_nan().into());
        }
        message.f32s(&[elevation, errors[2], range, errors[0], rate, errors[3]]);
        // A cast of a float saturates, and makes 0 of NaN.
        message.i8(rcs.round() as i8);
        message.u16(row as u16);
        message.u8(CERTAIN);
        // No class, one target, no object; the ambiguity of the velocity counts as resolved.
        message.u8(0);
        message.u8(0);
        message.u16(0);
        message.u8(CERTAIN);
    }
    Ok(())
}
