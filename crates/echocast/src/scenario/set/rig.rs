//! Which sensors of a rig a style takes, and pinhole sensors as cameras.

use crate::emitter::pattern::Pattern;
use crate::emitter::{ImageGrid, Intrinsics};
use crate::ground::error::{Error, Result};
use crate::scenario::{Sample, Scan};
use crate::sensor::SensorKind;

/// The kinds of sensors that styles take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Lidar,
    /// Pinhole sensors, whatever they measure ranges with.
    Camera,
    Sonar,
}

/// What `scan` is made with.
pub(super) fn kind(scan: &Scan) -> Kind {
    match (scan.sensor().kind(), &scan.sensor().spec().pattern) {
        (SensorKind::Sonar, _) => Kind::Sonar,
        (_, Pattern::Pinhole(_)) => Kind::Camera,
        _ => Kind::Lidar,
    }
}

/// Number of the scan of `sample` with the sensor called `asked`, which is of this kind; without a name, of the only one.
///
/// # Errors
/// There is none, with what could be added; several.
pub(super) fn find(sample: &Sample, key: &str, asked: Option<&str>, wanted: Kind) -> Result<usize> {
    let scans = sample.scans();
    let fitting: Vec<usize> = (0..scans.len()).filter(|&scan| kind(&scans[scan]) == wanted).collect();
    let names = |which: &[usize]| which.iter().map(|&scan| scans[scan].name()).collect::<Vec<_>>().join(", ");
    let add = match wanted {
        Kind::Lidar => {
            "a LiDAR in `sensors`, such as {sensor: velodyne_hdl64e}; sonars are written by plain, webdataset"
        }
        Kind::Camera => {
            "a camera in `sensors`, such as {name: camera, sensor: {name: camera, kind: lidar, pattern: {type: pinhole, \
             resolution: [1242, 375], fov_deg: [81, 29]}}}"
        }
        Kind::Sonar => "a sonar in `sensors`",
    };
    let allowed = || if fitting.is_empty() { add.to_owned() } else { names(&fitting) };
    let all: Vec<usize> = (0..scans.len()).collect();
    match (asked, fitting.as_slice()) {
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

/// The image of `scan` and its intrinsics, if it is of a camera.
pub(super) fn camera(scan: &Scan) -> Option<(ImageGrid, Intrinsics)> {
    let grid = scan.sensor().image_grid().ok()?;
    let intrinsics = grid.intrinsics?;
    Some((grid, intrinsics))
}
