//! Objects that move while they are scanned, where the answer is a formula.

use super::{assert_near, vector};
use echocast::scene::Material;
use echocast::{Engine, FieldSet, LiveScene, ObjectId, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DQuat, DVec3};
use std::f64::consts::TAU;

/// A spinning sensor without errors, 16 channels, 10 turns a second.
fn spinner() -> Sensor {
    let yaml = "
name: spinner
kind: lidar
pattern:
  type: spinning
  azimuth: {fov_deg: 360, rate_hz: 10}
  cycle_us: 50
  channels:
    elevation_deg: [-15, -13, -11, -9, -7, -5, -3, -1, 1, 3, 5, 7, 9, 11, 13, 15]
    fire_time_us: [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30]
";
    Sensor::from_yaml(yaml, "").unwrap()
}

/// Shapes that may move, each an object.
fn live(shapes: impl IntoIterator<Item = Shape>) -> (LiveScene, Vec<ObjectId>) {
    let mut builder = SceneBuilder::new();
    for shape in shapes {
        builder.stand(shape, None);
    }
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    let objects = scene.add_scene(&builder.finish()).unwrap();
    (scene, objects)
}

fn scan(scene: &mut LiveScene, trajectory: &Trajectory, options: ScanOptions) -> PointCloud {
    scene.commit().unwrap().scan(&spinner(), trajectory, &options.fields(FieldSet::all())).unwrap()
}

fn at(time: f64, place: DVec3) -> (f64, DAffine3) {
    (time, DAffine3::from_translation(place))
}

#[test]
fn a_wall_that_comes_nearer_is_slanted_by_the_turning_sensor() {
    let (mut scene, objects) = live([Shape::plate(DVec3::ZERO, -DVec3::X, 50.0)]);
    let speed = -30.0;
    let wall_at = |time: f64| 40.0 + speed * time;
    let keys = [0.0, 2.0].map(|time| at(time, DVec3::X * wall_at(time)));
    scene.set_motion(objects[0], &keys).unwrap();
    for start_time in [0.0, 0.7] {
        scene.set_time(start_time, 0.1).unwrap();
        // A sensor that stands, and one that drives towards the wall.
        for own_speed in [0.0, 20.0] {
            let place = |time: f64| DVec3::new(own_speed * (time - start_time), 3.0, 0.0);
            let keys =
                [start_time, start_time + 1.0].map(|time| (time, Pose { position: place(time), ..Pose::IDENTITY }));
            let path = Trajectory::new(keys.to_vec()).unwrap();
            let cloud = scan(&mut scene, &path, ScanOptions { start_time, ..ScanOptions::default() });
            let c = &cloud.columns;
            assert!(cloud.len > 5_000, "{}", cloud.len);
            for row in 0..cloud.len {
                let along = vector(&c.x, &c.y, &c.z, row) - place(c.time[row]);
                let distance = wall_at(c.time[row]) - place(c.time[row]).x;
                assert_near("x", along.x, distance, 1e-4);
                let velocity = vector(&c.velocity_x, &c.velocity_y, &c.velocity_z, row);
                assert!((velocity - DVec3::X * speed).length() < 1e-3, "{velocity}");
                let radial = (speed - own_speed) * along.x / along.length();
                assert_near("radial velocity", c.radial_velocity[row].into(), radial, 1e-3);
                let flow = vector(&c.flow_x, &c.flow_y, &c.flow_z, row);
                assert!((flow - DVec3::X * speed * 0.1).length() < 1e-4, "{flow}");
                assert_near("normal", c.normal_x[row].into(), -1.0, 1e-6);
            }
        }
    }
    let outside = ScanOptions { start_time: 0.9, ..ScanOptions::default() };
    let error = scene.commit().unwrap().scan(&spinner(), &Trajectory::fixed(Pose::IDENTITY), &outside).unwrap_err();
    assert!(error.to_string().contains("0.7 to 0.79"), "{error}");
}

/// Four blades, 50 turns a second, before a sensor that turns 10 times a second.
#[test]
fn a_rotor_draws_its_true_spiral() {
    let blade = Shape::cuboid(DVec3::new(-0.02, -0.15, 0.1), DVec3::new(0.02, 0.15, 4.0));
    let (mut scene, objects) = live([blade.clone()]);
    let hub = DVec3::new(10.0, 0.0, 0.0);
    let rate = 50.0 * TAU;
    let pose = |time: f64| DAffine3::from_rotation_translation(DQuat::from_rotation_x(rate * time), hub);
    let keys: Vec<_> = (0..=1200).map(|k| f64::from(k) / 6000.0).map(|time| (time, pose(time))).collect();
    scene.set_motion(objects[0], &keys).unwrap();
    for start_time in [0.0, 0.1] {
        scene.set_time(start_time, 0.1).unwrap();
        let cloud =
            scan(&mut scene, &Trajectory::fixed(Pose::IDENTITY), ScanOptions { start_time, ..ScanOptions::default() });
        assert!(cloud.len > 20, "{}", cloud.len);
        let c = &cloud.columns;
        for row in 0..cloud.len {
            let point = cloud.position(row);
            let own = pose(c.time[row]).inverse().transform_point3(point);
            let outside = (own.abs() - DVec3::new(0.02, 0.15, 4.0)).max_element();
            assert!(outside.abs() < 3e-4, "row {row}: {own} is {outside} m off the blade");
            let velocity = vector(&c.velocity_x, &c.velocity_y, &c.velocity_z, row);
            let should = (rate * DVec3::X).cross(point - hub);
            assert!((velocity - should).length() < 2e-3 * should.length(), "{velocity} {should}");
        }
    }
}

/// With everything held still, a frame is the scan of the scene as it is when the frame starts.
#[test]
fn a_frozen_frame_is_the_still_scene_at_its_start() {
    let shapes = || [Shape::cuboid(-DVec3::ONE, DVec3::ONE), Shape::plate(-2.0 * DVec3::Z, DVec3::Z, 30.0)];
    let (mut moving, objects) = live(shapes());
    let pose = |time: f64| {
        let turn = DQuat::from_rotation_z(1.3 * time) * DQuat::from_rotation_x(0.4);
        DAffine3::from_rotation_translation(turn, DVec3::new(5.0 + 10.0 * time, -20.0 * time, 0.5))
    };
    let keys: Vec<_> = (0..=20).map(|k| f64::from(k) / 20.0).map(|time| (time, pose(time))).collect();
    moving.set_motion(objects[0], &keys).unwrap();
    let start_time = 0.25;
    moving.set_time(start_time, 0.1).unwrap();
    let still_sensor = Trajectory::fixed(Pose::IDENTITY);
    let options = ScanOptions { start_time, freeze: true, organised: true, ..ScanOptions::default() };
    let frozen = scan(&mut moving, &still_sensor, options.clone());
    let (mut still, objects) = live(shapes());
    still.set_pose(objects[0], pose(start_time)).unwrap();
    let expected = scan(&mut still, &still_sensor, options.clone());
    // The same by setting a time without length.
    moving.set_time(start_time, 0.0).unwrap();
    let held = scan(&mut moving, &still_sensor, options);
    let moves = frozen.columns.velocity_x.iter().filter(|speed| **speed != 0.0 && !speed.is_nan()).count();
    assert!(moves > 100);
    for cloud in [frozen, held] {
        assert_eq!(cloud.len, expected.len);
        let mut other = 0;
        for row in 0..cloud.len {
            if cloud.columns.instance_id[row] != expected.columns.instance_id[row] {
                other += 1;
            } else if !cloud.columns.range[row].is_nan() {
                let (is, should) = (cloud.columns.range[row].into(), expected.columns.range[row].into());
                assert_near("range", is, should, 1e-4 + 2e-5 * should);
            }
        }
        // At the very edge of the box rounding decides.
        assert!(other <= 2, "{other}");
    }
}

/// A wall behind a mirror, both on the move: the image moves as the range does.
#[test]
fn images_move_as_the_range_to_them_changes() {
    let mut builder = SceneBuilder::new();
    let glass = builder.material(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
    builder.stand(Shape::plate(DVec3::ZERO, DVec3::new(-1.0, 1.0, 0.0).normalize(), 2.0), Some(glass));
    builder.stand(Shape::plate(DVec3::ZERO, -DVec3::Y, 60.0), None);
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    let objects = scene.add_scene(&builder.finish()).unwrap();
    let (mirror, wall) = (DVec3::new(4.0, 0.5, 0.0), DVec3::new(1.0, -9.0, 0.0));
    scene.set_motion(objects[0], &[at(0.0, DVec3::X * 6.0), at(1.0, DVec3::X * 6.0 + mirror)]).unwrap();
    scene.set_motion(objects[1], &[at(0.0, DVec3::Y * 20.0), at(1.0, DVec3::Y * 20.0 + wall)]).unwrap();
    let scans = [0.3, 0.301].map(|start_time| {
        scene.set_time(start_time, 0.1).unwrap();
        let options = ScanOptions { start_time, freeze: true, organised: true, ..ScanOptions::default() };
        scan(&mut scene, &Trajectory::fixed(Pose::IDENTITY), options)
    });
    let [a, b] = scans.each_ref().map(|cloud| &cloud.columns);
    let mut seen = 0;
    for row in 0..scans[0].len {
        if a.bounces[row] == 1 && b.bounces[row] == 1 {
            seen += 1;
            // The point of the wall that a beam meets moves on the wall: only across it does its speed count.
            let image_normal = vector(&a.normal_x, &a.normal_y, &a.normal_z, row);
            let normal = DVec3::new(image_normal.y, image_normal.x, image_normal.z);
            let along = vector(&a.x, &a.y, &a.z, row).normalize();
            let velocity = vector(&a.velocity_x, &a.velocity_y, &a.velocity_z, row);
            let rate = (f64::from(b.range[row]) - f64::from(a.range[row])) / 1e-3;
            assert_near("rate", velocity.dot(normal) / along.dot(normal), rate, 0.03);
        }
    }
    assert!(seen > 50, "{seen}");
}
