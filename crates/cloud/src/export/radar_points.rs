//! Detections of a radar in the files of data sets: nuScenes and View-of-Delft.
//!
//! Velocities of both are rates of the range: negative where target and radar approach each other. That of a detection
//! is its column `doppler`; compensated it is what a radar at rest at the same place would measure.

use crate::{Field, FieldSet, PointCloud};
use glam::Vec3;
use ground::error::{Error, Result};
use ground::named;
use ground::read::ending;
use ground::shown;
use ground::write::{self, Pending};
use serde::Deserialize;
use std::path::Path;

/// A data set in whose layout detections of a radar are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RadarPoints {
    /// nuScenes: PCD with 18 fields, as of the ARS 408-21 (`RadarPointCloud.from_file` of its development kit).
    Nuscenes,
    /// View-of-Delft (Palffy et al. 2022): seven f32 each, `x`, `y`, `z`, RCS, dBsm, velocity, compensated velocity,
    /// m/s, and 0, the number of the scan; velocities are NaN where there are none.
    ViewOfDelft,
}

named! { RadarPoints: Nuscenes "nuscenes", ViewOfDelft "view_of_delft" }

/// The fields of nuScenes with their sizes and types.
const NUSCENES: [(&str, usize, char); 18] = [
    ("x", 4, 'F'),
    ("y", 4, 'F'),
    ("z", 4, 'F'),
    ("dyn_prop", 1, 'I'),
    ("id", 2, 'I'),
    ("rcs", 4, 'F'),
    ("vx", 4, 'F'),
    ("vy", 4, 'F'),
    ("vx_comp", 4, 'F'),
    ("vy_comp", 4, 'F'),
    ("is_quality_valid", 1, 'I'),
    ("ambig_state", 1, 'I'),
    ("x_rms", 1, 'I'),
    ("y_rms", 1, 'I'),
    ("invalid_state", 1, 'I'),
    ("pdh0", 1, 'I'),
    ("vx_rms", 1, 'I'),
    ("vy_rms", 1, 'I'),
];

/// What the radar says of the motion of a target (`dyn_prop`).
const MOVING: u8 = 0;
const STATIONARY: u8 = 1;
const ONCOMING: u8 = 2;
const UNKNOWN: u8 = 4;

/// Targets that are slower are stationary, m/s: below it, errors of velocities would decide.
const SLOW_M_S: f32 = 0.5;

/// Upper ends of the classes of standard errors, m and m/s (Continental, ARS 40X technical documentation, table of
/// signal values).
const CLASSES: [f32; 31] = [
    0.005, 0.006, 0.008, 0.011, 0.014, 0.018, 0.023, 0.029, 0.038, 0.049, 0.063, 0.081, 0.105, 0.135, 0.174, 0.224,
    0.288, 0.371, 0.478, 0.616, 0.794, 1.023, 1.317, 1.697, 2.187, 2.817, 3.63, 4.676, 6.025, 7.762, 10.0,
];

/// The class of unknown errors.
const NO_CLASS: u8 = 31;

/// What stands for an unknown RCS: the least that an ARS 408 reports, dBsm.
const LEAST_RCS: f32 = -64.0;

/// Checks, before a long scan, whether detections of a radar can be written to `path` in the layout of its ending.
///
/// # Errors
/// As [`RadarPoints::of`]; a missing folder or one that cannot be written to.
pub fn check_radar_points(path: &Path) -> Result<()> {
    RadarPoints::of(path)?;
    Pending::create(path).map(drop)
}

impl RadarPoints {
    /// The layout that the ending of `path` stands for: `.pcd` of nuScenes, `.bin` of View-of-Delft.
    ///
    /// # Errors
    /// Another ending.
    pub fn of(path: &Path) -> Result<RadarPoints> {
        match ending(path).as_str() {
            "pcd" => Ok(RadarPoints::Nuscenes),
            "bin" => Ok(RadarPoints::ViewOfDelft),
            _ => Err(Error::Unsupported {
                what: format!("the ending of the output file {}", shown::path(path)),
                instead: "detections of radars are written as .pcd of nuScenes or .bin of View-of-Delft".to_owned(),
            }),
        }
    }

    /// The columns that a cloud must have: positions, `rcs` and `doppler`. `range_sigma`, `azimuth_sigma` and
    /// `velocity_sigma` are used if it has them.
    pub fn fields() -> FieldSet {
        [Field::X, Field::Y, Field::Z, Field::Rcs, Field::Doppler].into_iter().collect()
    }
}

impl PointCloud {
    /// Writes the detections of a radar, relative to its pose at the start of the scan, in the layout of a data set.
    /// `velocity` is that of the radar over ground at that time, m/s, in its own axes: compensated velocities are
    /// without it. The file appears under its name only when it is complete.
    ///
    /// # Errors
    /// A column that is missing ([`RadarPoints::fields`]); a velocity that is not finite; a full disk.
    pub fn write_radar(&self, path: impl AsRef<Path>, layout: RadarPoints, velocity: [f32; 3]) -> Result<()> {
        let velocity = Vec3::from(velocity);
        if !velocity.is_finite() {
            return Err(Error::invalid("velocity of the radar", velocity, "finite numbers"));
        }
        if let Some(missing) = RadarPoints::fields().iter().find(|info| self.column(info.field).len() != self.len) {
            let found = format!("without {}", missing.name);
            return Err(Error::invalid("columns of radar detections", found, "x, y, z, rcs and doppler"));
        }
        let targets = targets(self, velocity);
        let bytes = match layout {
            RadarPoints::Nuscenes => nuscenes(&targets),
            RadarPoints::ViewOfDelft => view_of_delft(&targets),
        };
        write::whole(path.as_ref(), &bytes)
    }
}

/// A detection relative to the radar.
struct RadarTarget {
    /// Its row.
    row: usize,
    place: Vec3,
    /// dBsm.
    rcs: f32,
    /// Rates of the range, m/s, as measured and compensated; NaN if unknown.
    rates: [f32; 2],
    /// Standard errors of x and y, m, and of the rate, m/s; NaN if unknown.
    errors: [f32; 3],
}

fn targets(cloud: &PointCloud, velocity: Vec3) -> Vec<RadarTarget> {
    let (c, to_sensor) = (&cloud.columns, cloud.to_frame(&cloud.sensor_pose));
    let known = |column: &[f32], row: usize| column.get(row).copied().unwrap_or(f32::NAN);
    let target = |row: usize| {
        let place = Vec3::from(to_sensor([c.x[row], c.y[row], c.z[row]]));
        let own = velocity.dot(place.normalize_or_zero());
        let [along, across] = [known(&c.range_sigma, row), known(&c.azimuth_sigma, row) * place.truncate().length()];
        let ahead = place.truncate().normalize_or_zero();
        RadarTarget {
            row,
            place,
            rcs: if c.rcs[row].is_finite() { c.rcs[row] } else { LEAST_RCS },
            rates: [c.doppler[row], c.doppler[row] + own],
            errors: [
                (ahead.x * along).hypot(ahead.y * across),
                (ahead.y * along).hypot(ahead.x * across),
                known(&c.velocity_sigma, row),
            ],
        }
    };
    (0..cloud.len).map(target).filter(|target| target.place.is_finite()).collect()
}

fn view_of_delft(targets: &[RadarTarget]) -> Vec<u8> {
    let numbers = targets
        .iter()
        .flat_map(|RadarTarget { place, rcs, rates, .. }| [place.x, place.y, place.z, *rcs, rates[0], rates[1], 0.0]);
    numbers.flat_map(f32::to_le_bytes).collect()
}

/// The only comment that readers allow is the first line.
fn nuscenes(targets: &[RadarTarget]) -> Vec<u8> {
    let line = |key: &str, of: fn(&(&str, usize, char)) -> String| {
        let words: Vec<String> = NUSCENES.iter().map(of).collect();
        format!("{key} {}\n", words.join(" "))
    };
    // The development kit refuses files without points, and takes a NaN in the first one as such.
    let none = RadarTarget { row: 0, place: Vec3::NAN, rcs: f32::NAN, rates: [f32::NAN; 2], errors: [f32::NAN; 3] };
    let targets = if targets.is_empty() { std::slice::from_ref(&none) } else { targets };
    let count = targets.len();
    let head = [
        "# .PCD v0.7 - Point Cloud Data file format; vx, vy: rate of the range along the line of sight, away positive\n",
        "VERSION 0.7\n",
        &line("FIELDS", |(name, ..)| (*name).to_owned()),
        &line("SIZE", |(_, size, _)| size.to_string()),
        &line("TYPE", |(.., kind)| kind.to_string()),
        &line("COUNT", |_| "1".to_owned()),
        &format!("WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"),
    ];
    let mut bytes = head.concat().into_bytes();
    targets.iter().for_each(|target| put_nuscenes(&mut bytes, target));
    // It also wants a byte behind the last point.
    bytes.push(b'\n');
    bytes
}

fn put_nuscenes(bytes: &mut Vec<u8>, &RadarTarget { row, place, rcs, rates, errors }: &RadarTarget) {
    let is_known = rates[0].is_finite();
    let moves = match rates[1] {
        _ if !is_known => UNKNOWN,
        rate if rate.abs() <= SLOW_M_S => STATIONARY,
        rate if rate < 0.0 => ONCOMING,
        _ => MOVING,
    };
    let towards = place.normalize_or_zero();
    let [measured, compensated] = rates.map(|rate| if is_known { rate * towards } else { Vec3::ZERO });
    place.to_array().iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes.push(moves);
    bytes.extend(((row & 0x7fff) as i16).to_le_bytes());
    let numbers = [rcs, measured.x, measured.y, compensated.x, compensated.y];
    bytes.extend(numbers.map(f32::to_le_bytes).as_flattened());
    let [x, y, rate] = errors.map(class);
    // Whether errors are valid; the velocity is unambiguous (3), or there is none (0); the detection is valid (0), and
    // with a probability below 25 % an artefact (1).
    bytes.extend([u8::from(x != NO_CLASS), if is_known { 3 } else { 0 }, x, y, 0, 1, rate, rate]);
}

/// The class of a standard error.
fn class(error: f32) -> u8 {
    if error.is_nan() { NO_CLASS } else { CLASSES.iter().position(|end| error < *end).map_or(NO_CLASS, |at| at as u8) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::pose::Pose;

    /// A car that comes towards the radar at 20 m/s, which itself drives at 10, and a wall 90 degrees to the left.
    fn cloud() -> PointCloud {
        let mut cloud = PointCloud::new(RadarPoints::fields().with(Field::RangeSigma), 2).unwrap();
        cloud.frame = crate::Frame::Sensor;
        let c = cloud.columns_mut();
        c.x.copy_from_slice(&[60.0, 0.0]);
        c.y.copy_from_slice(&[0.0, 5.0]);
        c.rcs.copy_from_slice(&[12.0, f32::NAN]);
        c.doppler.copy_from_slice(&[-30.0, 0.0]);
        c.range_sigma.copy_from_slice(&[0.1, 0.0049]);
        cloud
    }

    #[test]
    fn what_approaches_has_negative_velocities() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        cloud().write_radar(&path, RadarPoints::ViewOfDelft, [10.0, 0.0, 0.0]).unwrap();
        let numbers: Vec<f32> =
            std::fs::read(&path).unwrap().chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect();
        assert_eq!(numbers, [60.0, 0.0, 0.0, 12.0, -30.0, -20.0, 0.0, 0.0, 5.0, 0.0, LEAST_RCS, 0.0, 0.0, 0.0]);

        cloud().write_radar(&path, RadarPoints::Nuscenes, [10.0, 0.0, 0.0]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let start = bytes.windows(7).position(|seven| seven == b"binary\n").unwrap() + 7;
        assert_eq!(bytes.len(), start + 2 * NUSCENES.iter().map(|(_, size, _)| size).sum::<usize>() + 1);
        let number = |at: usize| f32::from_le_bytes(bytes[start + at..][..4].try_into().unwrap());
        assert_eq!([0, 15, 19, 23, 27, 31].map(|at| number(at).abs()), [60.0, 12.0, 30.0, 0.0, 20.0, 0.0]);
        assert!(number(19) < 0.0 && number(27) < 0.0);
        assert_eq!([bytes[start + 12], bytes[start + 43 + 12]], [ONCOMING, STATIONARY]);
    }

    #[test]
    fn detections_are_relative_to_the_radar() {
        let mut world = cloud();
        world.frame = crate::Frame::World;
        world.origin = glam::DVec3::new(5e5, 5e6, 0.0);
        world.sensor_pose = Pose::at(5e5, 5e6, 0.0).with_quaternion(0.0, 0.0, 1.0, 1.0);
        let found = targets(&world, Vec3::ZERO);
        // What is ahead in the world is on the right of a radar that looks to the left.
        assert!(found[0].place.distance(Vec3::new(0.0, -60.0, 0.0)) < 1e-3, "{}", found[0].place);
    }

    #[test]
    fn errors_are_in_their_classes() {
        assert_eq!([0.0, 0.005, 0.0059, 0.5, 9.99, 10.0, f32::NAN].map(class), [0, 1, 1, 19, 30, NO_CLASS, NO_CLASS]);
    }

    #[test]
    fn clouds_without_the_columns_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pcd");
        let refused = |cloud: &PointCloud, velocity| {
            cloud.write_radar(&path, RadarPoints::Nuscenes, velocity).unwrap_err().to_string()
        };
        assert!(refused(&cloud(), [f32::NAN, 0.0, 0.0]).starts_with("velocity of the radar is"));
        let mut bare = cloud();
        bare.columns.doppler.clear();
        let expected = "columns of radar detections is without doppler; allowed: x, y, z, rcs and doppler";
        assert_eq!(refused(&bare, [0.0; 3]), expected);
        assert!(!path.exists());
    }
}
