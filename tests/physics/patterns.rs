use super::{assert_near, vector};
use echocast::{BuiltScene, FieldSet, Frame, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

/// A wall across x at 10 m.
fn wall() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::plate(DVec3::X * 10.0, DVec3::X, 900.0), None);
    scene.finish().build().unwrap()
}

fn prisms() -> Sensor {
    let yaml = "
name: prisms
kind: lidar
pattern:
  type: risley
  pulse_rate_hz: 20000
  line_elevation_deg: [-1, 1]
  prisms:
    - {wedge_deg: 18, ior: 1.5, rpm: 7294, first_face: flat}
    - {wedge_deg: 18, ior: 1.5, rpm: -4664, phase_deg: 30, first_face: tilted}
";
    Sensor::from_yaml(yaml, "").unwrap()
}

#[test]
fn scans_take_up_a_pattern_where_it_is_when_they_start() {
    let (wall, mut sensor) = (wall(), prisms());
    let still = Trajectory::fixed(Pose::IDENTITY);
    let mut seen = Vec::new();
    for start_time in [0.0, 0.1, 0.1, 1000.05] {
        let options = ScanOptions::default().fields(FieldSet::all()).start_time(start_time);
        let cloud = wall.scan(&sensor, &still, &options).unwrap();
        let (c, beams) = (cloud.columns(), sensor.beams_at(start_time).unwrap());
        assert_eq!((cloud.len(), beams.rows, beams.columns), (4000, 2, 2000));
        for row in 0..cloud.len() {
            assert_eq!(c.beam()[row] as usize, row);
            let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, row);
            assert_near("range", c.range()[row].into(), 10.0 / along.x, 1e-4);
            assert!((cloud.position(row) - 10.0 / along.x * along).length() < 1e-4);
            assert_near("time", c.time()[row], start_time + (row % 2000) as f64 / 20_000.0, 1e-12);
            assert_eq!((u32::from(c.channel()[row]), c.firing()[row]), (row as u32 / 2000, row as u32 % 2000));
        }
        seen.push(cloud.columns().y().to_vec());
    }
    assert_ne!(seen[0], seen[1]);
    assert_eq!(seen[1], seen[2]);
    // Patterns that do not rotate, and those of a table, are unaffected.
    sensor
        .set("pattern", "{type: raster, azimuth: {fov_deg: 4, step_deg: 2}, elevation: {fov_deg: 2, step_deg: 1}}")
        .unwrap();
    let own = Sensor::from_beams("own", prisms().beams().clone()).unwrap();
    for sensor in [sensor, own] {
        let [early, late] = [0.0, 0.1].map(|start_time| {
            let options = ScanOptions::default().start_time(start_time);
            wall.scan(&sensor, &still, &options).unwrap().columns().y().to_vec()
        });
        assert_eq!(early, late);
    }
    let options = ScanOptions::default().start_time(f64::NAN);
    let error = wall.scan(&prisms(), &still, &options).unwrap_err().to_string();
    assert_eq!(error, "start_time is NaN; allowed: finite numbers");
}

/// The trajectory's time differs from that of the run, which turns the prisms.
#[test]
fn a_sensor_that_drives_sees_along_its_beams() {
    let (wall, sensor) = (wall(), prisms());
    let path = Trajectory::new(vec![(0.0, Pose::at(0.0, 0.0, 0.0)), (1.0, Pose::at(4.0, 0.0, 0.0))]).unwrap();
    let options =
        ScanOptions::default().fields(FieldSet::all()).start_time(7.0).trajectory_time(0.5).coordinates(Frame::Sensor);
    let cloud = wall.scan(&sensor, &path, &options).unwrap();
    let beams = sensor.beams_at(7.0).unwrap();
    assert_eq!(cloud.len(), beams.len());
    for row in 0..cloud.len() {
        let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, row);
        let away = 10.0 - 4.0 * (0.5 + beams.time[row]);
        assert!((cloud.position(row) - away / along.x * along).length() < 1e-4, "beam {row}");
    }
}
