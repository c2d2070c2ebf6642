//! `livox_ros_driver2/CustomMsg`: points in the layout of Livox's instruments.

use super::cdr::{CdrWriter, Stamp};
use crate::{Field, FieldSet, PointCloud};
use ground::error::{Error, Result};
use std::io;

/// Bytes of a point in the message: it starts at a multiple of 4, so that all but the last are followed by a free byte.
const POINT: usize = 20;

/// What a point is made of.
pub(super) const COLUMNS: [Field; 7] =
    [Field::X, Field::Y, Field::Z, Field::Intensity, Field::ReturnNumber, Field::Ring, Field::Time];

/// Writes the points of `cloud` with their times, ns since `stamp`; times that do not fit are those nearest to them that do.
///
/// As the driver does (src/lddc.cpp, `FillPointsToCustomMsg`), points come in the order of their times, beams without a
/// return are at 0, 0, 0, and the number of the LiDAR is 0 for the first. Tags: "Livox HAP user manual", point cloud data:
/// number of the return in bits 4 and 5.
pub(super) fn write(message: &mut CdrWriter, cloud: &PointCloud, stamp: Stamp, frame: &str) -> io::Result<()> {
    let c = &cloud.columns;
    let to_sensor = cloud.to_frame(&cloud.sensor_pose);
    let scale = cloud.intensity_full_scale.map_or(1.0, |full| 255.0 / full);
    message.header(stamp, frame)?;
    message.u64(stamp.log_time());
    message.u32(u32::try_from(cloud.len).unwrap_or(u32::MAX));
    // The LiDAR, and three reserved bytes.
    message.raw(&[0; 4]);
    message.count(cloud.len)?;
    let mut order: Vec<usize> = (0..cloud.len).collect();
    if !c.time.is_sorted() {
        order.sort_by(|&a, &b| c.time[a].total_cmp(&c.time[b]));
    }
    for (at, row) in order.into_iter().enumerate() {
        let mut point = [0; POINT];
        // Casts of floats saturate and turn NaN into 0.
        let since = ((c.time[row] - stamp.seconds()) * 1e9).round() as u32;
        let place = to_sensor([c.x[row], c.y[row], c.z[row]]).map(|axis| if axis.is_finite() { axis } else { 0.0 });
        let numbers = [since.to_le_bytes(), place[0].to_le_bytes(), place[1].to_le_bytes(), place[2].to_le_bytes()];
        point[..16].copy_from_slice(numbers.as_flattened());
        point[16] = (c.intensity[row] * scale).round_ties_even() as u8;
        point[17] = c.return_number[row].min(3) << 4;
        point[18] = c.ring[row].min(u8::MAX.into()) as u8;
        message.raw(if at + 1 == cloud.len { &point[..POINT - 1] } else { &point });
    }
    Ok(())
}

/// Time, s after `stamp`, of a point that has no place in the message, if there is one.
pub(super) fn beyond(cloud: &PointCloud, stamp: Stamp) -> Option<f64> {
    let fits = |after: f64| (-0.5..f64::from(u32::MAX) + 0.5).contains(&(after * 1e9));
    let after = cloud.columns.time.iter().map(|time| time - stamp.seconds());
    after.into_iter().find(|after| after.is_finite() && !fits(*after))
}

/// Checks that `cloud` has the columns, and times that fit.
pub(super) fn check(cloud: &PointCloud, stamp: Stamp) -> Result<()> {
    let needed: FieldSet = COLUMNS.into_iter().collect();
    if let Some(missing) = needed.iter().find(|info| cloud.column(info.field).len() != cloud.len) {
        let names: Vec<&str> = needed.iter().map(|info| info.name).collect();
        let allowed = format!("clouds with {}", names.join(", "));
        return Err(Error::invalid("the cloud", format!("without the column {}", missing.name), allowed));
    }
    match beyond(cloud, stamp) {
        Some(after) => {
            let allowed = "0 to 4.294967 s, as the message counts nanoseconds in 32 bits";
            Err(Error::invalid("the cloud", format!("with a point {after} s after its start"), allowed))
        }
        None => Ok(()),
    }
}
