//! What laser scanners report beside positions: angles, lines, strips, radiometry, the shape of echoes.

use super::{scan_at, target};
use echocast::{FieldSet, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

/// A scanner of 40 lines of 100 pulses within 60 degrees to both sides, without errors.
const SCANNER: &str = "
name: scanner
kind: lidar
pattern:
  {type: line_scan, pulse_rate_hz: 30e3, lines_hz: 100, lines: 10, mechanism: {type: rotating, window_deg: [-60, 60]}}
beam: {wavelength_nm: 1550, pulse_ns: 4}
range: {min_m: 1, max_m: 1000}
detection: {model: radar_equation, reflectance: 0.2, at_m: 500}
";

fn scanner(changes: &[(&str, &str)]) -> Sensor {
    let mut sensor = Sensor::from_yaml(SCANNER, ".").unwrap();
    changes.iter().for_each(|(key, value)| sensor.set(key, value).unwrap());
    sensor
}

/// Flat ground of a reflectance of 60 % to `half` m on all sides.
fn ground(half: f64) -> echocast::BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.6);
    let corner = DVec3::new(-half, -half, 0.0);
    scene.stand(Shape::quad(corner, 2.0 * half * DVec3::X, 2.0 * half * DVec3::Y), Some(paint));
    scene.finish().build().unwrap()
}

fn flown(pose: Pose, sensor: &Sensor) -> PointCloud {
    scan_at(&ground(1000.0), sensor, pose, ScanOptions::default().strip(7))
}

/// LAS counts from nadir to the right, roll of the aircraft included, whatever its heading.
#[test]
fn scan_angles_count_from_nadir_to_the_right() {
    let sensor = scanner(&[]);
    for (heading, roll, pitch) in [(0.0, 0.0, 0.0), (130.0, 0.0, 0.0), (-60.0, 5.0, 0.0), (200.0, -8.0, 3.0)] {
        let pose = Pose::at(0.0, 0.0, 100.0).with_rpy_deg(roll, pitch, heading);
        let cloud = flown(pose, &sensor);
        let c = cloud.columns();
        let (sin, cos) = f64::to_radians(heading).sin_cos();
        let right = DVec3::new(sin, -cos, 0.0);
        for row in 0..cloud.len() {
            let place =
                DVec3::new(c.true_x()[row].into(), c.true_y()[row].into(), c.true_z()[row].into()) + cloud.origin;
            let across = (place - pose.position).dot(right);
            let expected = across.atan2(pose.position.z - place.z);
            assert!((f64::from(c.scan_angle()[row]) - expected).abs() < 1e-5, "{row} of {heading}: {expected}");
        }
        // Forward, left, up: a positive roll lowers the right side, and what looked down looks to the left.
        let middle = c.scan_angle().iter().map(|angle| f64::from(*angle)).sum::<f64>() / cloud.len() as f64;
        assert!((middle.to_degrees() + roll).abs() < 1.0, "{middle}");
        assert!(c.strip().iter().all(|&strip| strip == 7));
    }
}

/// The last point of each line is its edge, also where the pulses after it have no return.
#[test]
fn each_line_has_one_edge() {
    let pose = Pose::at(0.0, 0.0, 100.0);
    for half in [1000.0, 40.0] {
        let cloud = scan_at(&ground(half), &scanner(&[]), pose, ScanOptions::default());
        let c = cloud.columns();
        let last = |row: usize| row + 1 == cloud.len() || c.beam()[row] / 100 != c.beam()[row + 1] / 100;
        assert_eq!(c.edge_of_line().iter().filter(|&&edge| edge == 1).count(), 10);
        assert!((0..cloud.len()).all(|row| (c.edge_of_line()[row] == 1) == last(row)), "{half}");
    }
    // With a row for each pulse, too.
    let cloud = scan_at(&ground(40.0), &scanner(&[]), pose, ScanOptions::default().organised(true));
    let c = cloud.columns();
    let edges: Vec<usize> = (0..cloud.len()).filter(|&row| c.edge_of_line()[row] == 1).collect();
    assert_eq!(edges.len(), 10);
    assert!(edges.iter().all(|&row| c.range()[row].is_finite() && c.range()[row + 1].is_nan()));
}

/// A mirror that turns sweeps one way, one that swings both.
#[test]
fn mirrors_that_swing_change_their_direction() {
    let pose = Pose::at(0.0, 0.0, 100.0);
    for (mechanism, both) in
        [("{type: rotating, window_deg: [-60, 60]}", false), ("{type: oscillating, half_deg: 30, law: triangle}", true)]
    {
        let cloud = flown(pose, &scanner(&[("pattern.mechanism", mechanism)]));
        let c = cloud.columns();
        let columns = c.beam().iter().zip(c.edge_of_line()).find(|(_, edge)| **edge == 1).unwrap().0 + 1;
        for row in 1..cloud.len() {
            if c.beam()[row] / columns != c.beam()[row - 1] / columns {
                let changed = c.scan_direction()[row] != c.scan_direction()[row - 1];
                assert_eq!(changed, both, "{mechanism}");
            } else {
                let right = c.scan_angle()[row] > c.scan_angle()[row - 1];
                assert_eq!(c.scan_direction()[row - 1] == 1, right, "{row} {mechanism}");
            }
        }
    }
}

/// RIEGL's scale: a white plate is 0 dB, 60 % are -2.218487, 20 % -6.989700; the threshold is 0 dB of amplitude, and twice
/// the range four times less.
#[test]
fn reflectances_are_those_of_a_white_plate() {
    let sensor =
        scanner(&[("pattern.plane", "upright"), ("pattern.mechanism", "{type: rotating, window_deg: [-1, 1]}")]);
    for (rho, decibels) in [(1.0, 0.0), (0.8, -0.969_100), (0.6, -2.218_487), (0.2, -6.989_700), (0.05, -13.010_30)] {
        let cloud = scan_at(&target(rho, 100.0, 0.0), &sensor, Pose::IDENTITY, ScanOptions::default());
        let middle = nearest(&cloud);
        let c = cloud.columns();
        assert!(
            (f64::from(c.reflectance_db()[middle]) - decibels).abs() < 2e-3,
            "{rho}: {}",
            c.reflectance_db()[middle]
        );
        // The threshold is 20 % at 500 m: 13.979400 dB at 100 m.
        let expected = decibels + 6.989_700 + 13.979_400;
        assert!((f64::from(c.amplitude_db()[middle]) - expected).abs() < 2e-3, "{rho}: {}", c.amplitude_db()[middle]);
        assert!((c.pulse_width()[middle] - 4e-9).abs() < 1e-14 && c.deviation()[middle] == 0.0);
    }
}

/// The row whose range is the shortest: that of the pulse that is nearest to head-on.
fn nearest(cloud: &PointCloud) -> usize {
    let ranges = cloud.columns().range();
    (0..cloud.len()).min_by(|&a, &b| ranges[a].total_cmp(&ranges[b])).unwrap()
}

/// A plate at an angle widens the echo: 0.5 mrad at 80 m and 45 degrees spread the light over 40 mm of range between the
/// 1/e^2 points, a Gaussian of 10 mm, 23.548 mm wide at half height; with a pulse of 0.2 ns, 29.979 mm, that is a width of
/// 38.122 mm, 0.25432 ns.
#[test]
fn plates_at_an_angle_widen_the_echo() {
    let changes = [
        ("pattern.plane", "upright"),
        ("pattern.mechanism", "{type: rotating, window_deg: [-0.02, 0.02]}"),
        ("beam.divergence_mrad", "[0.5, 0.5]"),
        ("beam.pulse_ns", "0.2"),
    ];
    let mut sensor = scanner(&changes);
    let options = ScanOptions::default();
    for rays in ["64", "adaptive"] {
        sensor.set("beam.sub_rays", rays).unwrap();
        let cloud = scan_at(&target(0.5, 80.0, 45.0), &sensor, Pose::IDENTITY, options.clone());
        let widths = cloud.columns().pulse_width();
        let mean = widths.iter().map(|width| f64::from(*width)).sum::<f64>() / widths.len() as f64;
        assert!((mean / 0.254_32e-9 - 1.0).abs() < 0.05, "{rays}: {mean}");
        let deviation = cloud.columns().deviation()[0];
        // Two Gaussians of one height differ by the ratio of their widths less 1.
        assert!((f64::from(deviation) - (38.122 / 29.979 - 1.0)).abs() < 0.08, "{rays}: {deviation}");
        let flat = scan_at(&target(0.5, 80.0, 0.0), &sensor, Pose::IDENTITY, options.clone());
        assert!(flat.columns().pulse_width().iter().all(|width| (width / 0.2e-9 - 1.0).abs() < 1e-3));
        assert!(flat.columns().deviation().iter().all(|deviation| *deviation < 1e-3));
    }
}

/// Scanners that fly write what strips need; those on a tripod have no scan angle.
#[test]
fn default_columns_are_those_of_the_trade() {
    let flying = Sensor::preset("riegl_vux1uav22").unwrap().default_fields();
    let standing = Sensor::preset("riegl_vz400").unwrap().default_fields();
    let names = |fields: FieldSet| fields.iter().map(|info| info.name).collect::<Vec<_>>();
    for name in ["scan_angle", "scan_direction", "edge_of_line", "strip", "reflectance_db", "amplitude_db", "deviation"]
    {
        assert!(names(flying).contains(&name), "{name}");
    }
    assert!(!names(standing).contains(&"scan_angle") && names(standing).contains(&"strip"));
    assert!(!names(Sensor::preset("velodyne_vlp16").unwrap().default_fields()).contains(&"strip"));
    // Other sensors have them if asked.
    let cloud = ground(50.0)
        .scan(
            &Sensor::preset("velodyne_vlp16").unwrap(),
            &Trajectory::fixed(Pose::at(0.0, 0.0, 2.0)),
            &ScanOptions::default().fields(FieldSet::parse("x,y,z,scan_angle,edge_of_line,strip").unwrap()).strip(3),
        )
        .unwrap();
    assert!(cloud.columns().strip().iter().all(|&strip| strip == 3));
    assert!(cloud.columns().edge_of_line().iter().all(|&edge| edge == 0));
}

/// survey.md 5, computed by hand: from 1000 m at 1 MHz six pulses are in the air, and the echo is folded to 100.6226 m; at
/// 300 kHz it arrives 0.691807 m after a pulse.
#[test]
fn echoes_fold_into_the_range_between_two_pulses() {
    let wall = target(0.5, 1000.0, 0.0);
    let measure = |rate: &str, mode: &str, blind: &str| {
        let sensor = scanner(&[
            ("pattern.plane", "upright"),
            ("pattern.mechanism", "{type: rotating, window_deg: [-0.5, 0.5]}"),
            ("pattern.pulse_rate_hz", rate),
            ("range.blind_m", blind),
            ("range.max_m", "2000"),
            ("detection.at_m", "2000"),
            ("range.multiple_time_around", mode),
        ]);
        scan_at(&wall, &sensor, Pose::IDENTITY, ScanOptions::default())
    };
    // 27 pulses within the degree of a line; the mirror takes them in turn, and echoes reach the sixth one after.
    let folded = measure("1e6", "folded", "1");
    let c = folded.columns();
    for row in 0..folded.len() {
        let pulses = f64::from(c.true_range()[row] - c.range()[row]) / 149.896_229;
        assert!((pulses - pulses.round()).abs() < 1e-4 && pulses < 6.5, "{pulses}");
        // It is placed in the direction of the pulse that it is ascribed to.
        let place = DVec3::new(c.x()[row].into(), c.y()[row].into(), c.z()[row].into()) + folded.origin;
        let elevation = (place.z / place.truncate().length()).atan();
        assert!((elevation - f64::from(c.elevation()[row])).abs() < 1e-5, "{row}");
    }
    let full = (0..folded.len()).filter(|&row| (c.range()[row] - 100.6226).abs() < 0.1).count();
    assert!(full > folded.len() / 2, "{full} of {}", folded.len());
    let truth = measure("1e6", "truth", "1");
    let resolved = measure("1e6", "resolved", "1");
    assert_eq!((resolved.len(), resolved.columns().range()), (truth.len(), truth.columns().range()));
    // Three pulses, the first of which is too early: all others are blind to it within 1 m after theirs.
    let [blind, seen] = ["1.5", "0.5"].map(|min| measure("300e3", "resolved", min).len());
    assert!(blind < seen / 2, "{blind} {seen}");
    let message = Sensor::preset("velodyne_vlp16").unwrap().set("range.multiple_time_around", "folded").unwrap_err();
    assert!(message.to_string().contains("line_scan"), "{message}");
}
