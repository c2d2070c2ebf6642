use super::{assert_near, vector};
use echocast::{BuiltScene, FieldSet, Frame, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DQuat, DVec3};

/// A spinning sensor of 16 channels that fire one after the other, 10 turns a second.
fn spinner() -> Sensor {
    let yaml = "
name: spinner
kind: lidar
pattern:
  type: spinning
  azimuth: {fov_deg: 360, rate_hz: 10}
  cycle_us: 200
  channels:
    elevation_deg: [-15, -13, -11, -9, -7, -5, -3, -1, 1, 3, 5, 7, 9, 11, 13, 15]
    fire_time_us: [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30]
";
    Sensor::from_yaml(yaml, "").unwrap()
}

/// A wall along x at y = 5.
fn wall() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::plate(DVec3::new(10.0, 5.0, 0.0), DVec3::Y, 900.0), None);
    scene.finish().build().unwrap()
}

/// Checks that each point lies where the beam from the pose at its own time meets the wall; returns how many points.
fn check(cloud: &PointCloud, sensor: &Sensor, start_time: f64, pose_at: impl Fn(f64) -> Pose) -> usize {
    let (c, beams) = (cloud.columns(), sensor.beams());
    for row in 0..cloud.len() {
        let beam = c.beam()[row] as usize;
        // A column every 200 us, its channels 2 us apart.
        let (channel, column) = (beam as u32 / beams.columns, beam as u32 % beams.columns);
        let fired = f64::from(column) * 200e-6 + f64::from(channel) * 2e-6;
        assert_near("time", c.time()[row], start_time + fired, 1e-12);
        let pose = pose_at(c.time()[row]);
        let own = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, beam);
        let along = pose.orientation * own;
        let range = (5.0 - pose.position.y) / along.y;
        assert!(range > 0.0);
        if range > 100.0 {
            continue;
        }
        // Single precision, and its error where the wall is met at a low angle.
        let tolerance = 1e-5 * range / along.y;
        assert_near("range", c.range()[row].into(), range, tolerance);
        let expected = match cloud.frame {
            Frame::World => pose.position + range * along,
            Frame::Sensor => range * own,
        };
        let off = (cloud.position(row) - expected).length();
        assert!(off <= tolerance, "point {row} at {} s is {off} m off", c.time()[row]);
        // The sensor at that time lies backwards along the beam from the point.
        if cloud.frame == Frame::World {
            let origin = cloud.position(row) - f64::from(c.range()[row]) * along;
            assert!((origin - pose.position).length() < 1e-4, "beam {beam} starts at {origin}, not {}", pose.position);
        }
    }
    cloud.len()
}

#[test]
fn a_sensor_that_drives_draws_a_spiral() {
    let (sensor, wall) = (spinner(), wall());
    let speed = DVec3::X * 20.0;
    let pose_at = |time: f64| Pose { position: DVec3::new(0.0, 1.0, 0.3) + time * speed, ..Pose::IDENTITY };
    let path = Trajectory::new(vec![(0.0, pose_at(0.0)), (0.7, pose_at(0.7)), (1.0, pose_at(1.0))]).unwrap();
    for coordinates in [Frame::World, Frame::Sensor] {
        for start_time in [0.0, 0.65] {
            let options =
                ScanOptions::default().fields(FieldSet::all()).start_time(start_time).coordinates(coordinates);
            let cloud = wall.scan(&sensor, &path, &options).unwrap();
            let points = check(&cloud, &sensor, start_time, pose_at);
            assert!(points > sensor.beams().len() / 3);
            assert_eq!(cloud.sensor_pose, path.at(start_time));
        }
    }
    // One turn advances the sensor by 2 m.
    let last = sensor.beams().time.iter().fold(0.0, |last: f64, &time| last.max(time));
    assert_near("advance", last * 20.0, 2.0, 0.01);
}

#[test]
fn a_sensor_that_turns_is_taken_at_each_beams_own_orientation() {
    let (sensor, wall) = (spinner(), wall());
    let from = Pose::at(0.0, -3.0, 0.0).with_rpy_deg(5.0, -10.0, 20.0).orientation;
    let axis = DVec3::new(0.2, 0.4, 1.0).normalize();
    // 1.9 rad in 0.2 s at a steady rate.
    let pose_at = |time: f64| Pose {
        position: DVec3::new(1.0, -3.0 + 2.0 * time, 0.0),
        orientation: DQuat::from_axis_angle(axis, 1.9 * time / 0.2) * from,
    };
    let mut end = pose_at(0.2);
    // The same orientation, expressed by the opposite quaternion.
    end.orientation = -end.orientation;
    let path = Trajectory::new(vec![(0.0, pose_at(0.0)), (0.2, end)]).unwrap();
    for coordinates in [Frame::World, Frame::Sensor] {
        let options = ScanOptions::default().fields(FieldSet::all()).coordinates(coordinates);
        let cloud = wall.scan(&sensor, &path, &options).unwrap();
        assert!(check(&cloud, &sensor, 0.0, pose_at) > sensor.beams().len() / 4);
        let c = cloud.columns();
        for row in 0..cloud.len() {
            let normal = vector(c.normal_x(), c.normal_y(), c.normal_z(), row);
            let in_world =
                if coordinates == Frame::World { normal } else { pose_at(c.time()[row]).orientation * normal };
            assert!((in_world + DVec3::Y).length() < 1e-5, "normal {in_world}");
        }
    }
}

#[test]
fn before_and_after_its_path_a_sensor_stands() {
    let (sensor, wall) = (spinner(), wall());
    let (first, last) = (Pose::at(0.0, 0.0, 0.0), Pose::at(3.0, 1.0, 0.0));
    let path = Trajectory::new(vec![(10.0, first), (11.0, last)]).unwrap();
    for (start_time, pose) in [(0.0, first), (20.0, last)] {
        let options = ScanOptions::default().fields(FieldSet::all()).start_time(start_time);
        let moving = wall.scan(&sensor, &path, &options).unwrap();
        let standing = wall.scan(&sensor, &Trajectory::fixed(pose), &options).unwrap();
        // As bits: NaN, of what the instrument does not measure, equals nothing.
        for info in FieldSet::all().iter() {
            let [moving, standing] = [&moving, &standing].map(|cloud| cloud.column(info.field).bytes());
            assert!(moving == standing, "{}", info.name);
        }
    }
}
