//! Errors of navigation in scans, and trajectories as independent readers find them.

use echocast::emitter::{Accuracy, Crs, Navigation, NavigationSolution, TrajectoryOptions};
use echocast::glam::DVec3;
use echocast::scene::{Mesh, Object, Part};
use echocast::{
    BuiltScene, Engine, Field, FieldSet, Frame, LiveScene, PointCloud, Pose, Report, ScanOptions, Sensor, Trajectory,
};
use echocast_tests::{python, root};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::sync::Arc;

const FIELDS: &str = "x,y,z,true_x,true_y,true_z,time,beam";

/// Ground of this height, m, on a square grid of `step` m out to `reach` m.
fn ground(reach: f64, step: f64, height: impl Fn(f64, f64) -> f64) -> BuiltScene {
    let side = (2.0 * reach / step).round() as u32;
    let at = |index: u32| -reach + step * f64::from(index);
    let corners = (0..=side).flat_map(|row| (0..=side).map(move |column| (column, row)));
    let positions: Vec<[f32; 3]> =
        corners.map(|(x, y)| [at(x) as f32, at(y) as f32, height(at(x), at(y)) as f32]).collect();
    let cells = (0..side).flat_map(|row| (0..side).map(move |column| row * (side + 1) + column));
    let triangles: Vec<[u32; 3]> =
        cells.flat_map(|a| [[a, a + 1, a + side + 2], [a, a + side + 2, a + side + 1]]).collect();
    let part = Part::default().positions(positions.into()).triangles(triangles.into());
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    scene.add(Object::new("ground", Arc::new(Mesh::new("ground", vec![part]).unwrap()))).unwrap();
    scene.commit().unwrap()
}

/// Straight down, and 30 degrees to port of that.
fn two_beams() -> Sensor {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("beams.csv"), "azimuth_deg,elevation_deg\n0,-90\n90,-60\n").unwrap();
    Sensor::from_yaml("{name: two, kind: lidar, pattern: {type: table, file: beams.csv}}", folder.path()).unwrap()
}

/// To the north at 60 m/s over the origin at time 10.
fn flight(height: f64) -> Trajectory {
    let pose = |y: f64| Pose::at(0.0, y, height).with_rpy_deg(0.0, 0.0, 90.0);
    Trajectory::new(vec![(0.0, pose(-600.0)), (20.0, pose(600.0))]).unwrap()
}

fn solve(errors: &str, path: &Trajectory) -> NavigationSolution {
    Navigation::from_yaml(errors).unwrap().solve(5, path, &Pose::IDENTITY, [0.0, 20.0]).unwrap()
}

/// Options of a scan that is placed with these errors.
fn placed(solution: &NavigationSolution) -> ScanOptions {
    ScanOptions::default()
        .fields(FieldSet::parse(FIELDS).unwrap())
        .estimated_trajectory(solution.sensor.clone())
        .clock_offset(solution.clock_offset)
}

/// By how much the points of two beams are off the truth with these errors, m to the east, to the north and up.
fn off(height: f64, errors: &str) -> [DVec3; 2] {
    let path = flight(height);
    let options = placed(&solve(errors, &path)).start_time(10.0);
    let cloud = ground(2100.0, 1000.0, |_, _| 0.0).scan(&two_beams(), &path, &options).unwrap();
    assert_eq!(cloud.len(), 2);
    [0, 1].map(|row| cloud.position(row) - truth(&cloud, row))
}

fn truth(cloud: &PointCloud, row: usize) -> DVec3 {
    let columns = cloud.columns();
    cloud.origin + DVec3::new(columns.true_x()[row].into(), columns.true_y()[row].into(), columns.true_z()[row].into())
}

/// Sizes of errors by the geometry of a flight: a small angle d moves a point at nadir by h d; one at the angle a off nadir by h d
/// across and h tan(a) d in height, so that its beam meets the ground h (1 + tan^2 a) d away.
#[test]
fn errors_have_the_sizes_of_their_geometry() {
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-4, "{found}, not {expected}");
    // Starboard down: what is at nadir appears to port, which is west.
    let [nadir, port] = off(1000.0, "boresight_deg: [0.01, 0, 0]");
    near(-nadir.x, 0.174533);
    near(port.z.abs(), 0.100767);
    near((port.x - port.z * 30f64.to_radians().tan()).abs(), 0.232711);
    let [nadir, _] = off(1000.0, "boresight_deg: [0, 0.01, 0]");
    near(nadir.y, 0.174533);
    // Clockwise: 577.350 m to the west appears farther north.
    let [nadir, port] = off(1000.0, "boresight_deg: [0, 0, 0.02]");
    near(nadir.length(), 0.0);
    near(port.y, 0.201533);
    let [nadir, port] = off(1000.0, "time_offset_s: 0.001");
    near(nadir.y, 0.06);
    near(port.y, 0.06);
    let [nadir, _] = off(80.0, "boresight_deg: [0.025, 0, 0]");
    near(-nadir.x, 0.0349066);
    let [nadir, port] = off(80.0, "lever_arm_m: [0.3, 0.2, -0.1]");
    for point in [nadir, port] {
        assert!((point - DVec3::new(-0.2, 0.3, -0.1)).length() < 1e-4, "{point}");
    }
}

/// Every point is where the estimated pose at its own time sees it, and nothing else changes.
#[test]
fn points_are_placed_by_the_pose_at_their_time() {
    let scene = ground(1500.0, 100.0, |x, y| 5.0 * (0.02 * x).sin() + 3.0 * (0.03 * y).cos());
    let path = flight(150.0);
    let errors = "{position: {horizontal_m: 2, vertical_m: 1, tau_s: 0.5}, attitude: {roll_pitch_deg: 0.5, heading_deg: 1, \
        tau_s: 0.5}, boresight_deg: [1, -2, 3], lever_arm_m: [1, 2, 3], time_offset_s: 0.25}";
    let solution = solve(errors, &path);
    let sensor = Sensor::preset("riegl_vux1uav22").unwrap().clone();
    let options = placed(&solution).start_time(9.0);
    let cloud = scene.scan(&sensor, &path, &options).unwrap();
    let exact = scene.scan(&sensor, &path, &options.clone().estimated_trajectory(None).clock_offset(0.0)).unwrap();
    assert!(cloud.len() > 5000 && cloud.len() == exact.len());
    let measured = |row: usize| exact.position(row);
    for row in (0..cloud.len()).step_by(7) {
        // Stamped a quarter of a second late.
        let time = cloud.columns().time()[row];
        assert!((time - exact.columns().time()[row] - 0.25).abs() < 1e-9);
        let (before, after) = (path.at(time - 0.25), solution.sensor.at(time));
        let seen = before.orientation.inverse() * (measured(row) - before.position);
        let expected = after.position + after.orientation * seen;
        assert!((cloud.position(row) - expected).length() < 2e-3, "{row}: {} is not {expected}", cloud.position(row));
        assert!((cloud.position(row) - measured(row)).length() > 1.0);
        assert_eq!(truth(&cloud, row), truth(&exact, row));
    }
    let in_sensor =
        |options: &ScanOptions| scene.scan(&sensor, &path, &options.clone().coordinates(Frame::Sensor)).unwrap();
    let (one, other) = (in_sensor(&options), in_sensor(&options.clone().estimated_trajectory(None)));
    assert!((0..one.len()).all(|row| one.position(row) == other.position(row)));
}

#[test]
fn sonars_and_radars_have_no_estimated_trajectory() {
    let scene = ground(100.0, 100.0, |_, _| 0.0);
    let still = Trajectory::fixed(Pose::at(0.0, 0.0, 5.0));
    let options = ScanOptions::default().estimated_trajectory(Arc::new(still.clone()));
    for name in ["ti_awr1843", "sss_450"] {
        let message = scene.scan(&Sensor::preset(name).unwrap(), &still, &options).unwrap_err().to_string();
        assert!(message.starts_with("estimated_trajectory is given for a "), "{message}");
    }
}

/// What `tests/readers/trajectories.py` says.
fn read_by_others(arguments: &[&str]) -> Value {
    let script = root().join("tests/readers/trajectories.py");
    let output = python().arg(script).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn numbers(found: &Value) -> Vec<f64> {
    found.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn independent_readers_find_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let (offset, crs) = (DVec3::new(512_000.0, 5_300_000.0, 250.0), Crs::parse("EPSG:25833").unwrap());
    let pose = |step: f64| Pose::at(300.0 * step, 40.0 * step, 20.0 * step).with_rpy_deg(3.0 * step, -2.0, 80.0 - step);
    let keys = (0..20).map(|step| (f64::from(step), pose(f64::from(step)))).collect();
    let place = TrajectoryOptions::default().crs(crs).offset(offset);
    let path = Trajectory::new(keys).unwrap().on_earth(&place).unwrap();
    let file = folder.path().join("flight.sbet");
    path.save(&file).unwrap();
    let found = read_by_others(&["sbet", file.to_str().unwrap(), "25833"]);
    assert_eq!(found["bytes"], 136 * 20);
    let columns = ["time", "easting", "northing", "height", "roll_deg", "pitch_deg", "grid_heading_deg"];
    let columns = columns.map(|name| numbers(&found[name]));
    for step in 0..20 {
        let s = step as f64;
        let expected = [s, 512_000.0 + 300.0 * s, 5_300_000.0 + 40.0 * s, 250.0 + 20.0 * s, 3.0 * s, 2.0, 10.0 + s];
        for (column, expected) in columns.iter().zip(expected) {
            assert!((column[step] - expected).abs() < 1e-6, "{step}: {}, not {expected}", column[step]);
        }
    }
    // Over ground, a grid of scale 0.9996 is shorter.
    let speed = numbers(&found["speed"])[10];
    assert!((speed * 0.9996 / 300f64.hypot(40.0) - 1.0).abs() < 2e-5, "{speed}");
    let record = Accuracy {
        time: 2.0,
        position_m: [0.1, 0.2, 0.3],
        velocity_m_s: [0.4, 0.5, 0.6],
        attitude_arcmin: [0.7, 0.8, 0.9],
    };
    let file = folder.path().join("smrmsg_flight.out");
    Accuracy::save(&[record], &file).unwrap();
    let rows = read_by_others(&["smrmsg", file.to_str().unwrap()]);
    assert_eq!(numbers(&rows[0]), [2.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]);
}

/// Strips across each other, at 40 m/s and 120 m above the ground, and when each is flown.
fn strips() -> (Trajectory, Vec<[f64; 2]>) {
    let lines = [
        (90.0, -40.0),
        (-90.0, 40.0),
        (0.0, -40.0),
        (180.0, 40.0),
        (90.0, 40.0),
        (-90.0, -40.0),
        (0.0, 40.0),
        (180.0, -40.0),
    ];
    let (mut keys, mut times): (Vec<(f64, Pose)>, Vec<[f64; 2]>) = Default::default();
    for (number, (heading, aside)) in (0..).zip(lines) {
        let start = f64::from(number) * 40.0;
        let pose = |along: f64| {
            let turned = Pose::IDENTITY.with_rpy_deg(0.0, 0.0, heading);
            let position = turned.orientation * DVec3::new(along, aside, 0.0) + DVec3::new(0.0, 0.0, 120.0);
            Pose { position, ..turned }
        };
        keys.extend([(start, pose(-120.0)), (start + 6.0, pose(120.0))]);
        times.push([start, start + 6.0]);
    }
    (Trajectory::new(keys).unwrap(), times)
}

/// A surveyor gets noisy strips and an estimated trajectory: their adjustment finds the boresight angles that were set, within
/// three of its standard errors.
#[test]
fn strips_are_adjusted_to_the_boresight_that_was_set() {
    let (path, times) = strips();
    let boresight = [0.2, -0.3, 0.5];
    let errors = format!(
        "{{position: {{horizontal_m: 0.01, vertical_m: 0.01, tau_s: 60}}, attitude: {{roll_pitch_deg: 0.003, heading_deg: 0.006, \
         tau_s: 60}}, boresight_deg: {boresight:?}}}"
    );
    let span = [0.0, path.span().1];
    let solution = Navigation::from_yaml(&errors).unwrap().solve(2, &path, &Pose::IDENTITY, span).unwrap();
    let scene = ground(300.0, 2.0, |x, y| 6.0 * (0.03 * x).sin() * (0.025 * y).cos() + 0.05 * x);
    let yaml = "{name: s, kind: lidar, pattern: {type: line_scan, pulse_rate_hz: 30000, lines_hz: 50, lines: 50, mechanism: \
        {type: rotating, window_deg: [-35, 35]}}, noise: {range_sigma_m: 0.01}}";
    let sensor = Sensor::from_yaml(yaml, "").unwrap();
    let mut points = Vec::new();
    for (strip, [start, end]) in (0..).zip(times) {
        for second in 0..(end - start) as u32 {
            let options = placed(&solution).start_time(start + f64::from(second)).frame(strip * 100 + second);
            let cloud = scene.scan(&sensor, &path, &options).unwrap();
            for row in 0..cloud.len() {
                let at = cloud.position(row);
                points.extend([cloud.columns().time()[row], at.x, at.y, at.z, f64::from(strip)]);
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let bytes: Vec<u8> = points.iter().flat_map(|value| value.to_le_bytes()).collect();
    fs::write(folder.path().join("points.bin"), bytes).unwrap();
    solution.carrier.save(folder.path().join("path.csv")).unwrap();
    let found = read_by_others(&["adjust", as_text(folder.path())]);
    let (angles, errors) = (numbers(&found["boresight_deg"]), numbers(&found["error_deg"]));
    for axis in 0..3 {
        // The adjustment takes away what was added.
        let miss = angles[axis] + boresight[axis];
        assert!(miss.abs() < 3.0 * errors[axis], "{axis}: {angles:?} +- {errors:?} for {boresight:?}");
        assert!(errors[axis] < 0.1 * boresight[axis].abs(), "{axis}: {angles:?} +- {errors:?} for {boresight:?}");
    }
}

/// Of a flight in UTM zone 32 whose scene is near its own origin, in GPS week 2300, which starts at 391040000 s of adjusted
/// standard time.
#[test]
fn las_files_are_in_the_coordinate_system_of_the_flight() {
    let offset = DVec3::new(478_000.0, 5_471_000.0, 100.0);
    let text = "gps_time,easting,northing,height,roll_deg,pitch_deg,heading_deg\n\
                388800,478000,5471000,180,0,0,90\n388801,478008,5471000,180,0,0,90\n";
    let options = TrajectoryOptions::default().crs(Some(Crs::parse("EPSG:25832").unwrap())).offset(offset);
    let read = Trajectory::from_text_with(text, &options.gps_week(Some(2300)), &mut Report::default()).unwrap();
    let path = read.shifted_to_zero();
    let mut sensor = Sensor::preset("riegl_vux1uav22").unwrap();
    for (key, value) in [("beam.sub_rays", "1"), ("pattern.lines", "3"), ("noise", "{}")] {
        sensor.set(key, value).unwrap();
    }
    let fields =
        sensor.default_fields().with(Field::TrueX).without(Field::Red).without(Field::Green).without(Field::Blue);
    let cloud = ground(300.0, 100.0, |_, _| 0.0);
    let cloud = cloud.scan(&sensor, &path, &ScanOptions::default().fields(fields).strip(12)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("strip.las");
    cloud.write(&file).unwrap();
    let found = read_by_others(&["las", as_text(&file)]);
    assert_eq!((&found["epsg"], &found["standard_time"]), (&25832.into(), &true.into()));
    assert_eq!((&found["wkt"], &found["point_format"]), (&true.into(), &6.into()));
    let column = |name: &str| numbers(&found[name]);
    let (easting, northing, height) = (column("x"), column("y"), column("z"));
    let (time, angle) = (column("gps_time"), column("scan_angle_deg"));
    assert!(cloud.len() > 1000 && time.len() == cloud.len());
    let c = cloud.columns();
    for row in 0..cloud.len() {
        let place = cloud.position(row) + offset;
        let read = DVec3::new(easting[row], northing[row], height[row]);
        assert!((read - place).abs().max_element() < 1e-4, "{read} {place}");
        assert!((time[row] - (391_040_000.0 + 388_800.0 + c.time()[row])).abs() < 1e-6);
        assert!((angle[row].to_radians() - f64::from(c.scan_angle()[row])).abs() < 6e-5);
        // 80 m above level ground, to the south of an eastward flight is right.
        assert!((angle[row].to_radians().tan() * 80.0 + northing[row] - 5_471_000.0).abs() < 0.1, "{row}");
    }
    assert!(column("true_x").iter().zip(&easting).all(|(truth, read)| (truth - read).abs() < 1e-4));
    assert!(column("point_source_id").iter().all(|&strip| strip == 12.0));
    assert_eq!(column("edge_of_flight_line").iter().sum::<f64>(), 3.0);
    // Read again, they are coordinates of the system.
    let again = PointCloud::read(&file).unwrap();
    assert!((again.position(7) - cloud.position(7) - offset).abs().max_element() < 1e-4);
    assert_eq!(again.records.system().as_deref(), Some("ETRS89 / UTM zone 32N"));
}

fn as_text(path: &Path) -> &str {
    path.to_str().unwrap()
}
