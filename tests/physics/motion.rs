//! Objects that move while they are scanned, where the answer is a formula.

use super::{assert_near, vector};
use echocast::scene::Material;
use echocast::{Engine, FieldSet, LiveScene, ObjectId, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{Actor, Change, Moving, Random, SceneBuilder, Shape, Track};
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
            let cloud = scan(&mut scene, &path, ScanOptions::default().start_time(start_time));
            let c = cloud.columns();
            assert!(cloud.len() > 5_000, "{}", cloud.len());
            for row in 0..cloud.len() {
                let along = vector(c.x(), c.y(), c.z(), row) - place(c.time()[row]);
                let distance = wall_at(c.time()[row]) - place(c.time()[row]).x;
                assert_near("x", along.x, distance, 1e-4);
                let velocity = vector(c.velocity_x(), c.velocity_y(), c.velocity_z(), row);
                assert!((velocity - DVec3::X * speed).length() < 1e-3, "{velocity}");
                let radial = (speed - own_speed) * along.x / along.length();
                assert_near("radial velocity", c.radial_velocity()[row].into(), radial, 1e-3);
                let flow = vector(c.flow_x(), c.flow_y(), c.flow_z(), row);
                assert!((flow - DVec3::X * speed * 0.1).length() < 1e-4, "{flow}");
                assert_near("normal", c.normal_x()[row].into(), -1.0, 1e-6);
            }
        }
    }
    let outside = ScanOptions::default().start_time(0.9);
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
        let cloud = scan(&mut scene, &Trajectory::fixed(Pose::IDENTITY), ScanOptions::default().start_time(start_time));
        assert!(cloud.len() > 20, "{}", cloud.len());
        let c = cloud.columns();
        for row in 0..cloud.len() {
            let point = cloud.position(row);
            let own = pose(c.time()[row]).inverse().transform_point3(point);
            let outside = (own.abs() - DVec3::new(0.02, 0.15, 4.0)).max_element();
            assert!(outside.abs() < 3e-4, "row {row}: {own} is {outside} m off the blade");
            let velocity = vector(c.velocity_x(), c.velocity_y(), c.velocity_z(), row);
            let should = (rate * DVec3::X).cross(point - hub);
            assert!((velocity - should).length() < 2e-3 * should.length(), "{velocity} {should}");
        }
    }
}

/// A plate on a rod of 4 m that swings towards the sensor and back: its distance along each beam is that to the plane
/// it lies in at the time of the beam.
#[test]
fn a_pendulum_is_where_it_swings() {
    let (pivot, length, widest) = (DVec3::new(10.0, 0.0, 4.0), 4.0, 0.5);
    let (mut scene, objects) = live([Shape::plate(-length * DVec3::Z, -DVec3::X, 1.0)]);
    let rate = (9.81 / length).sqrt();
    let angle = |time: f64| widest * (rate * time).cos();
    let turned = |time: f64| DQuat::from_rotation_y(angle(time));
    let keys: Vec<_> = (0..=800)
        .map(|k| 0.005 * f64::from(k))
        .map(|time| (time, DAffine3::from_rotation_translation(turned(time), pivot)))
        .collect();
    scene.set_motion(objects[0], &keys).unwrap();
    for frame in 0..30 {
        let start_time = 0.1 * f64::from(frame);
        scene.set_time(start_time, 0.1).unwrap();
        let cloud = scan(&mut scene, &Trajectory::fixed(Pose::IDENTITY), ScanOptions::default().start_time(start_time));
        assert!(cloud.len() > 50, "frame {frame}: {}", cloud.len());
        let c = cloud.columns();
        for row in 0..cloud.len() {
            let along = cloud.position(row).normalize();
            let normal = turned(c.time()[row]) * DVec3::X;
            assert_near("range", c.range()[row].into(), pivot.dot(normal) / along.dot(normal), 2e-4);
            let turning = -widest * rate * (rate * c.time()[row]).sin() * DVec3::Y;
            let should = turning.cross(cloud.position(row) - pivot);
            let velocity = vector(c.velocity_x(), c.velocity_y(), c.velocity_z(), row);
            // The motion between two keys is uniform.
            let tolerance = 0.0025 * widest * rate * rate * 6.0 + 1e-3;
            assert!((velocity - should).length() < tolerance, "{velocity} {should}");
            assert_near("radial velocity", c.radial_velocity()[row].into(), velocity.dot(along), 1e-4);
        }
    }
}

/// Where the ray from 0 along `along` enters the box from `low` to `high`, if it does.
fn enters(along: DVec3, low: DVec3, high: DVec3) -> Option<f64> {
    let (a, b) = (low / along, high / along);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    (enter > 0.0 && enter < leave).then_some(enter)
}

/// In the far lane, a fast car passes a slow one in the near lane: which one a beam meets is decided at its own time.
#[test]
fn a_car_that_overtakes_is_hidden_as_long_as_it_is_behind_the_other() {
    let half = DVec3::new(2.2, 0.9, 0.75);
    let (mut scene, objects) = live([(); 2].map(|()| Shape::cuboid(-half, half)));
    let cars = [(DVec3::new(-3.0, 6.0, 0.0), 8.0), (DVec3::new(-12.0, 11.0, 0.5), 40.0)];
    let place = |car: usize, time: f64| cars[car].0 + DVec3::X * cars[car].1 * time;
    for (car, object) in objects.iter().enumerate() {
        scene.set_motion(*object, &[0.0, 2.0].map(|time| at(time, place(car, time)))).unwrap();
    }
    let hit = |along: DVec3, time: f64| {
        let boxes = [0, 1].map(|car| enters(along, place(car, time) - half, place(car, time) + half));
        match boxes {
            [Some(near), far] if far.is_none_or(|far| near < far) => Some((1, near)),
            [_, far] => far.map(|range| (2, range)),
        }
    };
    let sensor = spinner();
    let beams = sensor.beams();
    let (mut seen, mut changed, mut edges) = ([0; 2], 0, 0);
    for frame in 0..8 {
        let start_time = 0.1 * f64::from(frame);
        scene.set_time(start_time, 0.1).unwrap();
        let options = ScanOptions::default().start_time(start_time).organised(true);
        let cloud = scan(&mut scene, &Trajectory::fixed(Pose::IDENTITY), options);
        let c = cloud.columns();
        for row in 0..cloud.len() {
            let along = vector(&beams.dir_x, &beams.dir_y, &beams.dir_z, row).normalize();
            let expected = hit(along, c.time()[row]);
            let found = (c.instance_id()[row] > 0).then_some((c.instance_id()[row], f64::from(c.range()[row])));
            match (found, expected) {
                (None, None) => continue,
                (Some((car, range)), Some((should, at))) if car == should && (range - at).abs() < 2e-4 => {}
                _ => {
                    // At an edge, a moment earlier or later it is right.
                    let near = [-1e-5, 1e-5].map(|step| hit(along, c.time()[row] + step).map(|(car, _)| car));
                    assert!(near.contains(&found.map(|(car, _)| car)), "beam {row}: {found:?}, not {expected:?}");
                    edges += 1;
                    continue;
                }
            }
            let car = c.instance_id()[row] as usize - 1;
            seen[car] += 1;
            changed += usize::from(hit(along, start_time).map(|(car, _)| car) != Some(car as u32 + 1));
            let velocity = vector(c.velocity_x(), c.velocity_y(), c.velocity_z(), row);
            assert!((velocity - DVec3::X * cars[car].1).length() < 1e-3, "{velocity}");
            assert_eq!(c.track_id()[row], c.instance_id()[row], "in every frame the same");
        }
    }
    assert!(seen[0] > 1000 && seen[1] > 500 && changed > 200 && edges < 10, "{seen:?} {changed} {edges}");
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
    let options = ScanOptions::default().start_time(start_time).freeze(true).organised(true);
    let frozen = scan(&mut moving, &still_sensor, options.clone());
    let (mut still, objects) = live(shapes());
    still.set_pose(objects[0], pose(start_time)).unwrap();
    let expected = scan(&mut still, &still_sensor, options.clone());
    // The same by setting a time without length.
    moving.set_time(start_time, 0.0).unwrap();
    let held = scan(&mut moving, &still_sensor, options);
    let moves = frozen.columns().velocity_x().iter().filter(|speed| **speed != 0.0 && !speed.is_nan()).count();
    assert!(moves > 100);
    for cloud in [frozen, held] {
        assert_eq!(cloud.len(), expected.len());
        let mut other = 0;
        for row in 0..cloud.len() {
            if cloud.columns().instance_id()[row] != expected.columns().instance_id()[row] {
                other += 1;
            } else if !cloud.columns().range()[row].is_nan() {
                let (is, should) = (cloud.columns().range()[row].into(), expected.columns().range()[row].into());
                assert_near("range", is, should, 1e-4 + 2e-5 * should);
            }
        }
        // At the very edge of the box rounding decides.
        assert!(other <= 2, "{other}");
    }
}

/// The same for all that changes its shape: held still by the scan it is as it is when the scene is set to that time,
/// and as the same scene is when it stands.
#[test]
fn what_changes_its_shape_is_frozen_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut moving = Moving::random(&mut Random::new(6));
    let ground = Shape::plate(-3.0 * DVec3::Z, DVec3::Z, 40.0);
    moving.actors.push(Actor { name: "ground".into(), parts: vec![(ground, 0)], ..Actor::default() });
    let scene = moving.load(folder.path());
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.add_scene(&scene).unwrap();
    let standing = Trajectory::fixed(Pose::IDENTITY);
    for start_time in [0.0, 0.13] {
        let options = ScanOptions::default().start_time(start_time).freeze(true).organised(true);
        live.set_time(start_time, 0.1).unwrap();
        let frozen = scan(&mut live, &standing, options.clone());
        let moves = scan(&mut live, &standing, options.clone().freeze(false));
        live.set_time(start_time, 0.0).unwrap();
        let held = scan(&mut live, &standing, options.clone());
        let mut still = LiveScene::new(&Engine::new().unwrap());
        still.add_scene(&moving.still(&scene, start_time)).unwrap();
        let expected = scan(&mut still, &standing, options);
        let ground = scene.objects.iter().find(|object| object.name == "ground").unwrap().instance_id;
        let (mut same, mut other, mut apart) = (0, [0; 2], 0);
        for row in 0..frozen.len() {
            let [f, h, e, m] = [&frozen, &held, &expected, &moves].map(|cloud| {
                let c = cloud.columns();
                (c.instance_id()[row], c.part_id()[row], c.range()[row])
            });
            for (other, known) in other.iter_mut().zip([h, e]) {
                if (f.0, f.1) != (known.0, known.1) {
                    *other += 1;
                } else if f.0 > 0 {
                    assert_near("range", f.2.into(), known.2.into(), 1e-4);
                }
            }
            apart += usize::from(f.0 != ground && m.0 == f.0 && (f.2 - m.2).abs() > 5e-3);
            // What stands is hit at the same bits, whatever moves beside it.
            if f.0 == ground && m.0 == ground {
                same += 1;
                for column in [frozen.columns(), held.columns()] {
                    let of = |c: &echocast::cloud::Columns| {
                        [c.x()[row], c.y()[row], c.z()[row], c.range()[row], c.intensity()[row]]
                    };
                    assert_eq!(of(column), of(moves.columns()), "beam {row}");
                }
            }
        }
        // At edges rounding decides.
        assert!(other[0] <= 1 && other[1] <= 4 && same > 1000 && apart > 200, "{other:?} {same} {apart}");
    }
    // At rest, frozen or not is the same in everything.
    let start_time = 0.5;
    live.set_time(start_time, 0.1).unwrap();
    let [frozen, free] = [true, false]
        .map(|freeze| scan(&mut live, &standing, ScanOptions::default().start_time(start_time).freeze(freeze)));
    assert_eq!(frozen.len(), free.len());
    for info in echocast::cloud::FIELDS {
        for row in 0..frozen.len() {
            // Up to the rounding of speeds; NaN is as good as NaN.
            let [a, b] = [&frozen, &free].map(|cloud| cloud.column(info.field).get_f64(row));
            assert!((a - b).abs() < 1e-9 || a.is_nan() && b.is_nan(), "{}: {a} {b}", info.name);
        }
    }
}

/// A wall behind a mirror, both on the move: the image moves as the range does.
#[test]
fn images_move_as_the_range_to_them_changes() {
    let mut builder = SceneBuilder::new();
    let glass = builder.material(Material::default().metallic(1.0).roughness(0.0));
    builder.stand(Shape::plate(DVec3::ZERO, DVec3::new(-1.0, 1.0, 0.0).normalize(), 2.0), Some(glass));
    builder.stand(Shape::plate(DVec3::ZERO, -DVec3::Y, 60.0), None);
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    let objects = scene.add_scene(&builder.finish()).unwrap();
    let (mirror, wall) = (DVec3::new(4.0, 0.5, 0.0), DVec3::new(1.0, -9.0, 0.0));
    scene.set_motion(objects[0], &[at(0.0, DVec3::X * 6.0), at(1.0, DVec3::X * 6.0 + mirror)]).unwrap();
    scene.set_motion(objects[1], &[at(0.0, DVec3::Y * 20.0), at(1.0, DVec3::Y * 20.0 + wall)]).unwrap();
    let scans = [0.3, 0.301].map(|start_time| {
        scene.set_time(start_time, 0.1).unwrap();
        let options = ScanOptions::default().start_time(start_time).freeze(true).organised(true);
        scan(&mut scene, &Trajectory::fixed(Pose::IDENTITY), options)
    });
    let [a, b] = scans.each_ref().map(|cloud| cloud.columns());
    let mut seen = 0;
    for row in 0..scans[0].len() {
        if a.bounces()[row] == 1 && b.bounces()[row] == 1 {
            seen += 1;
            // The point of the wall that a beam meets moves on the wall: only across it does its speed count.
            let image_normal = vector(a.normal_x(), a.normal_y(), a.normal_z(), row);
            let normal = DVec3::new(image_normal.y, image_normal.x, image_normal.z);
            let along = vector(a.x(), a.y(), a.z(), row).normalize();
            let velocity = vector(a.velocity_x(), a.velocity_y(), a.velocity_z(), row);
            let rate = (f64::from(b.range()[row]) - f64::from(a.range()[row])) / 1e-3;
            assert_near("rate", velocity.dot(normal) / along.dot(normal), rate, 0.03);
        }
    }
    assert!(seen > 50, "{seen}");
}

/// A bed that rises under a boat that sinks and drives on; and its points.
#[test]
fn sonars_tell_how_what_they_hear_moves() {
    let (mut scene, objects) = live([Shape::plate(DVec3::ZERO, DVec3::Z, 200.0)]);
    let (bed, boat) = (DVec3::new(0.5, 0.0, 1.0), DVec3::new(3.0, 0.0, -0.25));
    let keys = [0.0, 10.0].map(|time| at(time, bed * time - 20.0 * DVec3::Z));
    scene.set_motion(objects[0], &keys).unwrap();
    scene.set_time(2.0, 0.5).unwrap();
    let path = [0.0, 10.0].map(|time| (time, Pose { position: boat * time - 2.0 * DVec3::Z, ..Pose::IDENTITY }));
    let path = Trajectory::new(path.to_vec()).unwrap();
    let sonar = Sensor::preset("mbes_400").unwrap();
    let options = ScanOptions::default().start_time(2.0).frame_period(0.1);
    let options = options.fields(FieldSet::all());
    let cloud = scene.commit().unwrap().scan(&sonar, &path, &options).unwrap();
    let columns = cloud.columns();
    assert!(cloud.len() > 100);
    let here = path.at(2.0).position;
    for row in 0..cloud.len() {
        let velocity = vector(columns.velocity_x(), columns.velocity_y(), columns.velocity_z(), row);
        let flow = vector(columns.flow_x(), columns.flow_y(), columns.flow_z(), row);
        assert!((velocity - bed).length() < 1e-3 && (flow - 0.1 * bed).length() < 1e-4, "{velocity} {flow}");
        let place = vector(columns.true_x(), columns.true_y(), columns.true_z(), row) + cloud.origin;
        let along = (place - here).normalize();
        // Water without a profile: sound goes straight. The place within a cell is rounded along the bed, and what is heard in
        // sidelobes along the track comes from a long one.
        let expected = (bed - boat).dot(along);
        assert!((f64::from(columns.radial_velocity()[row]) - expected).abs() < 0.1, "{row}: {expected}");
        // It has risen when the sound gets there.
        let met = columns.true_range()[row] as f64 / 1500.0;
        assert!((place.z - (-18.0 + met)).abs() < 2e-3, "{place} {met}");
    }
}

/// A plan of a skin is about as quick as one of the same body that stands: its joints move it once, not once for every
/// place that is looked at.
#[test]
fn a_plan_moves_joints_once() {
    const JOINTS: u16 = 20;
    let folder = tempfile::tempdir().unwrap();
    let shape = Shape::sphere(1.0, 12);
    let turns = (0..30).map(|key| (0.1 * f64::from(key), DQuat::from_rotation_x(0.1 * f64::from(key % 7)))).collect();
    let track = Track { places: vec![(0.0, DVec3::Z * 0.1)], turns };
    let joints = (0..JOINTS).map(|joint| (DVec3::Z * 0.1 * f64::from(joint), track.clone())).collect();
    let of = |place: &[f32; 3]| {
        let joint = ((place[2].clamp(0.0, 1.0) * f32::from(JOINTS - 1)) as u16).min(JOINTS - 1);
        [(joint, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]
    };
    let influences = vec![shape.positions.iter().map(of).collect()];
    let draw = |change: Change| {
        let actor = Actor { name: "body".into(), parts: vec![(shape.clone(), 0)], track: Track::default(), change };
        let scene = Moving { actors: vec![actor], materials: vec![(0.5, [0.5; 3])] }.load(folder.path());
        let built = scene.build().unwrap();
        let start = std::time::Instant::now();
        echocast::preview::write_plan(&scene, &built, &folder.path().join("plan.png"), 800).unwrap();
        start.elapsed().as_secs_f64()
    };
    let mut least = [f64::INFINITY; 2];
    // Whatever else runs beside this, one of them is undisturbed.
    for _ in 0..4 {
        least[0] = least[0].min(draw(Change::None));
        least[1] =
            least[1].min(draw(Change::Skin { joints: Vec::clone(&joints), influences: Vec::clone(&influences) }));
    }
    let [still, skin] = least;
    assert!(skin < 4.0 * still + 0.1, "{skin} s, standing {still} s");
}
