//! The sensors of a rig that a style uses, and pinhole sensors as cameras.

use crate::{Sample, Scan};
use cloud::export::RadarPoints;
use cloud::{Field, FieldSet};
use emitter::pattern::Pattern;
use emitter::{ImageGrid, Intrinsics};
use ground::error::{Error, Result};

/// The kinds of sensors that styles distinguish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SensorClass {
    Lidar,
    /// Pinhole sensors, however they measure ranges.
    Camera,
    Sonar,
    Radar,
}

/// The kind of sensor of `scan`.
pub(super) fn kind(scan: &Scan) -> SensorClass {
    match scan.sensor().spec().pattern {
        _ if scan.sensor().kind().makes_pings() => SensorClass::Sonar,
        _ if scan.sensor().default_fields().contains(Field::Rcs) => SensorClass::Radar,
        Pattern::Pinhole(_) => SensorClass::Camera,
        _ => SensorClass::Lidar,
    }
}

/// Index of the scan of `sample` whose sensor has this kind and the requested name; without a name, of the only one of
/// this kind.
///
/// # Errors
/// No such sensor, with what could be added; several.
pub(super) fn find(sample: &Sample, key: &str, sensor_name: Option<&str>, class_needed: SensorClass) -> Result<usize> {
    let scans = sample.scans();
    let fitting: Vec<usize> = (0..scans.len()).filter(|&scan| kind(&scans[scan]) == class_needed).collect();
    let names = |which: &[usize]| which.iter().map(|&scan| scans[scan].name()).collect::<Vec<_>>().join(", ");
    let add = match class_needed {
        SensorClass::Lidar => {
            "a LiDAR in `sensors`, such as {sensor: velodyne_hdl64e}; sonars are written by plain, webdataset"
        }
        SensorClass::Camera => {
            "a camera in `sensors`, such as {name: camera, sensor: {name: camera, kind: lidar, pattern: {type: pinhole, \
             resolution: [1242, 375], fov_deg: [81, 29]}}}"
        }
        SensorClass::Sonar => "a sonar in `sensors`",
        SensorClass::Radar => "a radar in `sensors`",
    };
    let allowed = || if fitting.is_empty() { add.to_owned() } else { names(&fitting) };
    let all: Vec<usize> = (0..scans.len()).collect();
    match (sensor_name, fitting.as_slice()) {
        (Some(name), _) => {
            let found = fitting.iter().find(|&&scan| scans[scan].name() == name);
            found.copied().ok_or_else(|| Error::invalid(key, format!("{name:?}"), allowed()))
        }
        (None, [only]) => Ok(*only),
        (None, []) => Err(Error::invalid(key, format!("missing among the sensors {}", names(&all)), add)),
        (None, several) => {
            let found = format!("missing, and there are {} such sensors", several.len());
            Err(Error::invalid(key, found, format!("one of {}", names(several))))
        }
    }
}

/// The columns that detections of radars are written from, if `sample` has a radar.
pub(super) fn radar_fields(sample: &Sample) -> FieldSet {
    if !sample.scans().iter().any(|scan| kind(scan) == SensorClass::Radar) {
        return FieldSet::EMPTY;
    }
    let errors = [Field::RangeSigma, Field::AzimuthSigma, Field::VelocitySigma];
    RadarPoints::fields().union(errors.into_iter().collect())
}

/// Velocity of the sensor of `scan` over ground in its own axes when its `frame`th frame starts, m/s.
pub(super) fn own_velocity(scan: &Scan, frame: usize) -> [f32; 3] {
    let (trajectory, start) = (scan.trajectory(), scan.frames()[frame].start);
    (trajectory.at(start).orientation.inverse() * trajectory.velocity(start)).as_vec3().to_array()
}

/// The image grid and intrinsics of `scan`, if its sensor is a camera.
pub(super) fn camera(scan: &Scan) -> Option<(ImageGrid, Intrinsics)> {
    let grid = scan.sensor().image_grid().ok()?;
    let intrinsics = grid.intrinsics?;
    Some((grid, intrinsics))
}
