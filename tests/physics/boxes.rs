use super::{assert_near, scan_at};
use echocast::scene::{Material, Mesh, Object, Part, UpAxis};
use echocast::{
    BoxAxes, BoxTime, BuiltScene, Engine, Environment, Field, FieldSet, Frame, InstanceBox, LiveScene, PointCloud,
    Pose, ScanOptions, Sensor, Trajectory,
};
use echocast_tests::reference::{Random, Shape};
use glam::{DAffine3, DQuat, DVec3};
use std::sync::Arc;

/// Half a degree between beams, 90 degrees to the left and right and 30 up and down, from left to right in 0.1 s.
fn sensor() -> Sensor {
    let yaml = "
name: ahead
kind: lidar
pattern:
  type: raster
  azimuth: {fov_deg: 180, step_deg: 0.5}
  elevation: {fov_deg: 60, step_deg: 0.5}
  rate_hz: 10
range: {max_m: 100}
";
    Sensor::from_yaml(yaml, "").unwrap()
}

fn mesh(shape: Shape) -> Arc<Mesh> {
    of_material(shape, None)
}

fn of_material(shape: Shape, material: Option<Arc<Material>>) -> Arc<Mesh> {
    let part = Part::default().positions(shape.positions.into()).triangles(shape.triangles.into()).material(material);
    Arc::new(Mesh::new("shape", vec![part]).unwrap())
}

/// A scene of `objects`, numbered from 1 where they have no number, of category 10 and up.
fn scene(objects: impl IntoIterator<Item = Object>) -> LiveScene {
    let mut scene = LiveScene::new(&Engine::with_threads(2).unwrap());
    for (index, object) in (0..).zip(objects) {
        let instance_id = if object.instance_id == 0 { index + 1 } else { object.instance_id };
        scene.add(object.instance_id(instance_id).category_id(10 + index)).unwrap();
    }
    scene
}

fn thing(mesh: &Arc<Mesh>, world_from_object: DAffine3) -> Object {
    Object::new("thing", mesh.clone()).world_from_object(world_from_object)
}

fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

fn options(axes: BoxAxes) -> ScanOptions {
    ScanOptions::default().boxes(axes).frame(3)
}

fn scan(scene: &BuiltScene, options: &ScanOptions) -> PointCloud {
    scene.scan(&sensor(), &Trajectory::fixed(Pose::IDENTITY), options).unwrap()
}

fn boxes(scene: &BuiltScene, axes: BoxAxes) -> Vec<InstanceBox> {
    scan(scene, &options(axes)).boxes.unwrap()
}

#[track_caller]
fn assert_close(what: &str, is: DVec3, expected: DVec3, tolerance: f64) {
    assert!((is - expected).length() <= tolerance, "{what} is {is}, not {expected}");
}

/// Corners in an order that does not depend on the box's axes.
fn sorted(corners: impl IntoIterator<Item = DVec3>) -> Vec<[i64; 3]> {
    let mut corners: Vec<_> =
        corners.into_iter().map(|corner| (corner * 1e5).round().to_array().map(|x| x as i64)).collect();
    corners.sort_unstable();
    corners
}

/// A box whose mesh is off its origin, scaled, turned and far from the world's origin: its corners are those of the
/// mesh, in the world and in the sensor's frame.
#[test]
fn a_box_is_where_its_object_is() {
    let (low, high) = (DVec3::new(-1.0, 0.0, 0.5), DVec3::new(3.0, 1.0, 2.0));
    let body = mesh(Shape::cuboid(low, high));
    let far = DVec3::new(4e5, 5.6e6, 100.0);
    let random = &mut Random::new(5);
    for mirror in [1.0, -1.0] {
        let turn = random.rotation();
        let scale = DVec3::new(0.5, 1.5 * mirror, 2.0);
        let pose = DAffine3::from_scale_rotation_translation(scale, turn, far + DVec3::new(20.0, 3.0, 1.0));
        let built = scene([thing(&body, pose)]).commit().unwrap();
        let sensor_pose = Pose { position: far, orientation: DQuat::from_rotation_z(0.2) };
        let corner = |k: usize| DVec3::from_array(std::array::from_fn(|axis| [low, high][k >> axis & 1][axis]));
        let corners = (0..8).map(|k| pose.transform_point3(corner(k)));
        for coordinates in [Frame::World, Frame::Sensor] {
            let options = options(BoxAxes::Object).coordinates(coordinates);
            let cloud = built.scan(&sensor(), &Trajectory::fixed(sensor_pose), &options).unwrap();
            let cloud_end = sensor().beams().period;
            let [found] = cloud.boxes.as_deref().unwrap() else { panic!("one box") };
            let into = |place: DVec3| match coordinates {
                Frame::World => place,
                Frame::Sensor => sensor_pose.orientation.inverse() * (place - sensor_pose.position),
            };
            assert_eq!(sorted(found.corners()), sorted(corners.clone().map(into)));
            assert_close("size", found.size, (high - low) * scale.abs(), 1e-6);
            let frame = if coordinates == Frame::World { DQuat::IDENTITY } else { sensor_pose.orientation };
            assert_close("x", frame * found.pose.orientation * DVec3::X, turn * DVec3::X, 1e-9);
            assert_close("z", frame * found.pose.orientation * DVec3::Z, turn * DVec3::Z, 1e-9);
            assert_eq!((found.frame, found.velocity), (3, DVec3::ZERO));
            assert!((0.0..cloud_end).contains(&found.time), "{}", found.time);
            assert_eq!((found.instance_id, found.track_id, found.category_id), (1, 1, 10));
            // Every point lies in its box, up to single precision.
            assert!(found.points > 50 && found.points as usize == cloud.len() && found.visible == 1.0);
            let back = found.pose.orientation.inverse();
            for row in 0..cloud.len() {
                let inside = (back * (cloud.position(row) - found.pose.position)).abs() - 0.5 * found.size;
                assert!(inside.max_element() < 0.05, "{inside}");
            }
        }
    }
}

/// What a file with y up calls z is the way to the side: boxes stand upright all the same.
#[test]
fn boxes_of_files_with_y_up_stand_upright() {
    let upright = DAffine3::from_quat(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2));
    let heading = DAffine3::from_rotation_z(0.5);
    let body = mesh(Shape::cuboid(DVec3::ZERO, DVec3::new(4.0, 1.5, 2.0)));
    let object = thing(&body, at(10.0, 0.0, 0.0) * heading * upright).up(UpAxis::Y);
    let [found] = *boxes(&scene([object]).commit().unwrap(), BoxAxes::Object) else { panic!("one box") };
    assert_close("size", found.size, DVec3::new(4.0, 2.0, 1.5), 1e-6);
    assert_close("x", found.pose.orientation * DVec3::X, heading.transform_vector3(DVec3::X), 1e-9);
    assert_close("z", found.pose.orientation * DVec3::Z, DVec3::Z, 1e-9);
}

/// Around what a mesh is, not around its box: a ball turned by any angle is as wide as a ball.
#[test]
fn axes_of_the_frame_touch_the_mesh() {
    let ball = mesh(Shape::sphere(1.0, 40));
    let turned = DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.7), DVec3::new(9.0, 1.0, 0.0));
    let built = scene([thing(&ball, turned)]).commit().unwrap();
    let [found] = *boxes(&built, BoxAxes::Frame) else { panic!("one box") };
    assert_close("size", found.size, DVec3::splat(2.0), 0.01);
    assert_close("place", found.pose.position, turned.translation, 0.01);
    assert_eq!(found.pose.orientation, DQuat::IDENTITY);
    // In the sensor's frame, along the sensor's axes.
    let body = mesh(Shape::cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0)));
    let built = scene([thing(&body, at(5.0, 0.0, 0.0))]).commit().unwrap();
    let sensor_pose = Pose::IDENTITY.with_rpy_deg(0.0, 0.0, 30.0);
    let options = options(BoxAxes::Frame).coordinates(Frame::Sensor);
    let cloud = built.scan(&sensor(), &Trajectory::fixed(sensor_pose), &options).unwrap();
    let [found] = cloud.boxes.as_deref().unwrap() else { panic!("one box") };
    assert!(found.pose.orientation.abs_diff_eq(DQuat::IDENTITY, 1e-9));
    let (sin, cos) = 30f64.to_radians().sin_cos();
    assert_close("size", found.size, DVec3::new(2.0 * cos + sin, 2.0 * sin + cos, 1.0), 1e-6);
}

/// A clutter of objects: the counts are those of the cloud, whatever the columns; the same bits for all threads.
#[test]
fn points_are_those_of_the_cloud() {
    let shapes = [Shape::sphere(0.6, 8), Shape::cuboid(-DVec3::ONE, DVec3::ONE)].map(mesh);
    let objects = |random: &mut Random| {
        let near = |random: &mut Random| DVec3::new(12.0, 0.0, 0.0) + random.in_cube(9.0);
        let pose = |random: &mut Random| DAffine3::from_mat3_translation(random.linear_map(), near(random));
        let object = |random: &mut Random| thing(&shapes[random.below(2)], pose(random));
        (0..40).map(|_| object(random)).collect::<Vec<_>>()
    };
    let made = objects(&mut Random::new(8));
    let environment = Environment::from_yaml("rain: {rate_mm_h: 20}").unwrap();
    let scanned = |threads: usize, fields: FieldSet| {
        let mut live = LiveScene::new(&Engine::with_threads(threads).unwrap());
        for (index, object) in (1..).zip(&made) {
            // Some are not labelled.
            let instance_id = if index % 5 == 0 { 0 } else { 7 * index };
            live.add(object.clone().instance_id(instance_id).category_id(index % 3)).unwrap();
        }
        let options = options(BoxAxes::Object).fields(fields).environment(environment.clone());
        scan(&live.commit().unwrap(), &options)
    };
    let cloud = scanned(1, FieldSet::default());
    let found = cloud.boxes.as_deref().unwrap();
    assert_eq!(found.len(), 32);
    assert!(found.is_sorted_by_key(|found| found.instance_id));
    for InstanceBox { instance_id, points, visible, .. } in found {
        let count = cloud.columns().instance_id().iter().filter(|id| *id == instance_id).count();
        assert_eq!((*points as usize, *instance_id > 0), (count, true));
        assert!((0.0..=1.0).contains(visible));
    }
    assert!(found.iter().any(|found| found.visible < 0.5) && found.iter().any(|found| found.visible > 0.9));
    for threads in [2, 7] {
        assert_eq!(scanned(threads, FieldSet::default()).boxes, cloud.boxes);
    }
    // Without the columns that say it.
    let few = scanned(2, FieldSet::EMPTY.with(Field::Range));
    assert_eq!(few.boxes, cloud.boxes);
    assert_eq!((few.columns().instance_id().len(), few.fields()), (0, FieldSet::EMPTY.with(Field::Range)));
    assert_eq!(few.columns().range(), cloud.columns().range());
    // They change nothing.
    let mut live = scene(made.clone());
    let built = live.commit().unwrap();
    let with = scan(&built, &options(BoxAxes::Object));
    let without = scan(&built, &options(BoxAxes::Object).boxes(None));
    assert_eq!((&without.boxes, without.columns().x()), (&None, with.columns().x()));
}

/// What moves has its box where it is when it is asked for, and the velocity of the box's middle.
#[test]
fn boxes_move_with_their_objects() {
    let body = mesh(Shape::cuboid(DVec3::new(1.0, -0.5, -0.5), DVec3::new(3.0, 0.5, 0.5)));
    let mut live = scene([thing(&body, at(20.0, 0.0, 0.0)), thing(&body, at(0.0, 10.0, 0.0))]);
    let ids: Vec<_> = live.objects().map(|(id, _)| id).collect();
    let turn_rate = 2.0;
    let pose = |time: f64| at(20.0 - 8.0 * time, 2.0, 0.0) * DAffine3::from_rotation_z(turn_rate * time);
    let keys: Vec<(f64, DAffine3)> = (0..=20).map(|k| 0.05 * f64::from(k)).map(|time| (time, pose(time))).collect();
    live.set_motion(ids[0], &keys).unwrap();
    for start_time in [0.0, 0.3, 0.62] {
        // Within the time of the scene, and from its start on.
        for begin in [start_time, 0.0] {
            live.set_time(begin, 0.9).unwrap();
            let built = live.commit().unwrap();
            for freeze in [false, true] {
                let options = options(BoxAxes::Object).start_time(start_time).freeze(freeze).box_time(BoxTime::Start);
                let cloud = scan(&built, &options);
                let [found, still] = cloud.boxes.as_deref().unwrap() else { panic!("two boxes") };
                let middle = pose(start_time).transform_point3(2.0 * DVec3::X);
                assert_eq!(found.time, start_time);
                assert_close("place", found.pose.position, middle, 1e-9);
                assert_close("size", found.size, DVec3::new(2.0, 1.0, 1.0), 1e-9);
                let x = DQuat::from_rotation_z(turn_rate * start_time) * DVec3::X;
                assert_close("x", found.pose.orientation * DVec3::X, x, 1e-9);
                let around = DVec3::new(-8.0, 0.0, 0.0) + (turn_rate * DVec3::Z).cross(2.0 * x);
                assert_close("velocity", found.velocity, around, 0.01);
                assert_eq!(still.velocity, DVec3::ZERO);
                assert!(found.points > 0 && found.visible == 1.0);
            }
        }
    }
    // Where the scene holds still it is where it is then.
    live.set_time(0.5, 0.0).unwrap();
    let found = boxes(&live.commit().unwrap(), BoxAxes::Object)[0];
    assert_close("place", found.pose.position, pose(0.5).transform_point3(2.0 * DVec3::X), 1e-9);
    assert_eq!(found.velocity, DVec3::ZERO);
    // In the sensor's frame velocities are over the ground all the same.
    live.set_time(0.3, 0.2).unwrap();
    let options = options(BoxAxes::Object)
        .start_time(0.3)
        .trajectory_time(0.0)
        .coordinates(Frame::Sensor)
        .box_time(BoxTime::Start);
    let drive = |time: f64| Pose::at(3.0 * time, 0.0, 0.0).with_rpy_deg(0.0, 0.0, 90.0);
    let path = Trajectory::new(vec![(0.0, drive(0.0)), (1.0, drive(1.0))]).unwrap();
    let cloud = live.commit().unwrap().scan(&sensor(), &path, &options).unwrap();
    let found = cloud.boxes.unwrap()[0];
    let x = DQuat::from_rotation_z(turn_rate * 0.3) * DVec3::X;
    let over_ground = DVec3::new(-8.0, 0.0, 0.0) + (turn_rate * DVec3::Z).cross(2.0 * x);
    assert_close("velocity", found.velocity, DQuat::from_rotation_z(-std::f64::consts::FRAC_PI_2) * over_ground, 0.01);
}

/// 720 columns of 40 beams all round, from straight behind on, in 0.1 s.
fn spinning() -> Sensor {
    let yaml = "
name: round
kind: lidar
pattern:
  type: spinning
  azimuth: {fov_deg: 360, step_deg: 0.5, rate_hz: 10}
  elevation: {fov_deg: 40, step_deg: 1}
range: {max_m: 100}
";
    Sensor::from_yaml(yaml, "").unwrap()
}

/// Cars of 4 m that pass a spinning sensor on all sides but where its turn begins, which drives and turns itself, and one
/// that stands: the scene and the way of the sensor.
fn traffic() -> (LiveScene, Trajectory) {
    let car = mesh(Shape::cuboid(DVec3::new(-2.0, -0.9, -0.7), DVec3::new(2.0, 0.9, 0.7)));
    let starts = [(-5.0, 11.0, 12.0), (3.0, 17.0, -14.0), (-6.0, -5.0, 10.0), (6.0, -12.0, -12.0), (14.0, 12.0, 0.0)];
    let mut live = scene(starts.map(|(x, y, _)| thing(&car, at(x, y, 0.0))));
    let ids: Vec<_> = live.objects().map(|(id, _)| id).collect();
    for (id, (x, y, speed)) in ids.into_iter().zip(starts).take(4) {
        let pose = |time: f64| at(x + speed * time, y, 0.0) * DAffine3::from_rotation_z(0.3 * time);
        let keys: Vec<(f64, DAffine3)> = (0..=10).map(|k| 0.1 * f64::from(k)).map(|time| (time, pose(time))).collect();
        live.set_motion(id, &keys).unwrap();
    }
    let drive = |time: f64| Pose::at(0.0, 10.0 * time, 0.2).with_rpy_deg(0.0, 0.0, 20.0 * time);
    let path = Trajectory::new((0..=10).map(|k| 0.1 * f64::from(k)).map(|time| (time, drive(time))).collect());
    (live, path.unwrap())
}

/// Of the points of the objects with the numbers `ids`, how many are within 5 cm of their boxes.
fn share_inside(cloud: &PointCloud, ids: std::ops::RangeInclusive<u32>) -> f64 {
    let (mut all, mut inside) = (0, 0);
    for found in cloud.boxes.as_deref().unwrap().iter().filter(|found| ids.contains(&found.instance_id)) {
        let back = found.pose.orientation.inverse();
        for row in (0..cloud.len()).filter(|&row| cloud.columns().instance_id()[row] == found.instance_id) {
            let out = (back * (cloud.position(row) - found.pose.position)).abs() - 0.5 * found.size;
            (all, inside) = (all + 1, inside + u32::from(out.max_element() < 0.05));
        }
    }
    assert!(all > 100, "{all} points");
    f64::from(inside) / f64::from(all)
}

/// Boxes hold when their objects are scanned: points lie in them, in the world and in the frame of a sensor that moves,
/// which they do not in boxes of the start or the end.
#[test]
fn points_of_what_moves_lie_in_its_box() {
    let (mut live, path) = traffic();
    live.set_time(0.3, 0.2).unwrap();
    let built = live.commit().unwrap();
    let scanned = |coordinates: Frame, box_time: BoxTime| {
        let options = options(BoxAxes::Object).start_time(0.3).coordinates(coordinates).box_time(box_time);
        built.scan(&spinning(), &path, &options).unwrap()
    };
    for coordinates in [Frame::World, Frame::Sensor] {
        let cloud = scanned(coordinates, BoxTime::Scan);
        // The ends of a car that is near and fast are met when it is some 6 cm from there.
        assert!(share_inside(&cloud, 1..=4) >= 0.99, "{}", share_inside(&cloud, 1..=4));
        assert!(share_inside(&cloud, 5..=5) >= 0.999, "{}", share_inside(&cloud, 5..=5));
        for found in cloud.boxes.as_deref().unwrap().iter().filter(|found| found.points > 0) {
            let rows = (0..cloud.len()).filter(|&row| cloud.columns().instance_id()[row] == found.instance_id);
            let times: Vec<f64> = rows.map(|row| cloud.columns().time()[row]).collect();
            assert_near("time", found.time, times.iter().sum::<f64>() / times.len() as f64, 1e-9);
        }
        for box_time in [BoxTime::Start, BoxTime::End] {
            let cloud = scanned(coordinates, box_time);
            let time = if box_time == BoxTime::Start { 0.3 } else { 0.3 + spinning().beams().last_time() };
            assert!(cloud.boxes.as_deref().unwrap().iter().all(|found| found.time == time));
            assert!(share_inside(&cloud, 1..=4) < 0.95, "{box_time:?}: {}", share_inside(&cloud, 1..=4));
        }
    }
    // Without a point: in the middle of the scan.
    let far = options(BoxAxes::Object).mask(2).start_time(0.3);
    let hidden = thing(&mesh(Shape::cuboid(-DVec3::ONE, DVec3::ONE)), at(0.0, 0.0, 60.0));
    let mut live = scene([hidden.mask(2)]);
    let cloud = live.commit().unwrap().scan(&spinning(), &Trajectory::fixed(Pose::IDENTITY), &far).unwrap();
    assert_near("time", cloud.boxes.unwrap()[0].time, 0.3 + 0.5 * spinning().beams().last_time(), 1e-12);
}

/// What a turn meets at its beginning and again at its end has its box where the most points are, not in between.
#[test]
fn boxes_at_the_seam_of_a_turn_hold_points() {
    let car = mesh(Shape::cuboid(DVec3::new(-2.0, -0.9, -0.7), DVec3::new(2.0, 0.9, 0.7)));
    // Behind, where the turn begins, more of it on one side; driving off.
    let mut live = scene([thing(&car, at(-8.0, 0.3, 0.0))]);
    let id = live.objects().next().unwrap().0;
    live.set_motion(id, &[(0.0, at(-8.0, 0.3, 0.0)), (1.0, at(-20.0, 0.3, 0.0))]).unwrap();
    live.set_time(0.0, 0.2).unwrap();
    let built = live.commit().unwrap();
    let cloud = built.scan(&spinning(), &Trajectory::fixed(Pose::IDENTITY), &options(BoxAxes::Object)).unwrap();
    let [found] = cloud.boxes.as_deref().unwrap() else { panic!("one box") };
    let early = cloud.columns().time().iter().filter(|&&time| time < 0.05).count();
    let larger = early.max(cloud.len() - early) as f64 / cloud.len() as f64;
    assert!(early > 20 && cloud.len() - early > 20 && larger < 0.8, "{early} of {}", cloud.len());
    assert!(found.time < 0.01 || found.time > 0.09, "{}", found.time);
    assert!(share_inside(&cloud, 1..=1) >= 0.99 * larger, "{}", share_inside(&cloud, 1..=1));
}

/// Points that are brought to the start are those of a scene that holds still then, seen from where the sensor was: on the
/// faces of their boxes, within half a millimetre, and the columns of what was measured stay.
#[test]
fn points_come_back_to_the_start() {
    let (mut live, path) = traffic();
    live.set_time(0.3, 0.2).unwrap();
    let built = live.commit().unwrap();
    let scanned = |coordinates: Frame, deskew: bool| {
        let fields = FieldSet::parse("default,normal_x,normal_y,normal_z,true_x,true_y,true_z").unwrap();
        let options = options(BoxAxes::Object).start_time(0.3).coordinates(coordinates).deskew(deskew).fields(fields);
        built.scan(&spinning(), &path, &options).unwrap()
    };
    for coordinates in [Frame::World, Frame::Sensor] {
        let [raw, cloud] = [false, true].map(|deskew| scanned(coordinates, deskew));
        let boxes = cloud.boxes.as_deref().unwrap();
        assert_eq!((boxes.len(), cloud.len()), (5, raw.len()));
        for found in boxes {
            assert_eq!(found.time, 0.3);
            let back = found.pose.orientation.inverse();
            for row in (0..cloud.len()).filter(|&row| cloud.columns().instance_id()[row] == found.instance_id) {
                let own = back * (cloud.position(row) - found.pose.position);
                let out = own.abs() - 0.5 * found.size;
                assert!(out.max_element().abs() < 5e-4, "{}: {out}", found.instance_id);
                // The normal is that of the face.
                let [x, y, z] = [cloud.columns().normal_x(), cloud.columns().normal_y(), cloud.columns().normal_z()];
                let normal = back * DVec3::new(x[row].into(), y[row].into(), z[row].into());
                let face = own / (0.5 * found.size);
                assert!((normal * face).max_element() > 0.999, "{}: {normal}, {face}", found.instance_id);
            }
        }
        let (a, b) = (raw.columns(), cloud.columns());
        assert_eq!((a.time(), a.range(), a.true_x(), a.true_y()), (b.time(), b.range(), b.true_x(), b.true_y()));
        assert_eq!((a.instance_id(), a.intensity()), (b.instance_id(), b.intensity()));
        let moved = |row: usize| (raw.position(row) - cloud.position(row)).length();
        assert!((0..cloud.len()).any(|row| moved(row) > 0.5));
    }
    // In the sensor's frame at the start they are those of the world.
    let [world, sensor] = [Frame::World, Frame::Sensor].map(|coordinates| scanned(coordinates, true));
    let pose = sensor.sensor_pose;
    for row in 0..world.len() {
        let place = pose.position + pose.orientation * sensor.position(row);
        assert!((place - world.position(row)).length() < 1e-4);
    }
    let sonar = Sensor::preset("mbes_400").unwrap();
    let asked = ScanOptions::default().deskew(true);
    let error = built.scan(&sonar, &Trajectory::fixed(Pose::at(0.0, 0.0, -2.0)), &asked).unwrap_err().to_string();
    assert!(error.starts_with("deskew is true; allowed: false for sonars"), "{error}");
}

/// A plate of 4 m at 10 m, of which something hides the left half, whatever the weather and however it is detected.
#[test]
fn what_hides_half_of_a_plate_leaves_half() {
    let plate = mesh(Shape::plate(DVec3::ZERO, DVec3::X, 2.0));
    let hide =
        |material: Option<Material>| of_material(Shape::plate(DVec3::ZERO, DVec3::X, 3.0), material.map(Arc::new));
    let glass = Material::default().transmission(1.0).roughness(0.0);
    let mirror = Material::default().metallic(1.0).roughness(0.0);
    // From the sensor, its right edge is where the plate's middle is.
    let before = at(5.0, 3.0, 0.0);
    let (wall, pane, mirror) = (hide(None), hide(Some(glass)), hide(Some(mirror)));
    let share = |objects: Vec<Object>, options: &ScanOptions, sensor: &Sensor| {
        let built = scene(objects).commit().unwrap();
        let cloud = built.scan(sensor, &Trajectory::fixed(Pose::IDENTITY), options).unwrap();
        cloud.boxes.unwrap().iter().map(|found| (found.instance_id, found.visible)).collect::<Vec<_>>()
    };
    let asked = options(BoxAxes::Object);
    let ahead = thing(&plate, at(10.0, 0.0, 0.0));
    assert_eq!(share(vec![ahead.clone()], &asked, &sensor()), [(1, 1.0)]);
    let half = share(vec![ahead.clone(), thing(&wall, before)], &asked, &sensor());
    assert_near("share", half[0].1, 0.5, 0.03);
    assert_eq!(half[1], (2, 1.0));
    // Unlabelled things hide as well, mirrors too; glass does not; behind, nothing hides.
    for (cover, seen) in [(&mirror, half[0].1), (&pane, 1.0)] {
        assert_eq!(share(vec![ahead.clone(), thing(cover, before)], &asked, &sensor())[0], (1, seen));
    }
    assert_eq!(share(vec![ahead.clone(), thing(&wall, at(15.0, 3.0, 0.0))], &asked, &sensor())[0], (1, 1.0));
    let mut unlabelled = scene([ahead.clone()]);
    unlabelled.add(thing(&wall, before)).unwrap();
    assert_eq!(boxes(&unlabelled.commit().unwrap(), BoxAxes::Object)[0].visible, half[0].1);

    let fog = asked.clone().environment(Environment::from_yaml("fog: {visibility_m: 5}").unwrap());
    let mut noisy = sensor();
    noisy.set("noise.dropout", "0.9").unwrap();
    noisy.set("noise.pointing_sigma_deg", "1").unwrap();
    for (options, sensor) in [(&fog, &sensor()), (&asked, &noisy)] {
        assert_eq!(share(vec![ahead.clone(), thing(&wall, before)], options, sensor), half);
    }
    // Things in a row, each behind the next: only the first is seen.
    let row = (0..40).map(|k| thing(&plate, at(10.0 + f64::from(k), 0.0, 0.0))).collect();
    let row = share(row, &asked, &sensor());
    assert_eq!(row[0], (1, 1.0));
    assert!(row[1..].iter().all(|(_, seen)| *seen == 0.0), "{row:?}");
}

/// What is listed, and how several objects share a box.
#[test]
fn boxes_are_of_what_the_scan_can_see() {
    let cube = mesh(Shape::cuboid(-DVec3::ONE, DVec3::ONE));
    let near = thing(&cube, at(10.0, 0.0, 0.0));
    let behind = thing(&cube, at(-100.5, 0.0, 0.0));
    let beyond = thing(&cube, at(-101.5, 0.0, 0.0));
    let hidden = thing(&cube, at(0.0, 20.0, 0.0)).mask(2);
    let built = scene([near, behind, beyond, hidden]).commit().unwrap();
    let seen = |mask: u32| {
        let options = options(BoxAxes::Object).mask(mask);
        scan(&built, &options).boxes.unwrap().iter().map(|found| found.instance_id).collect::<Vec<_>>()
    };
    assert_eq!(seen(u32::MAX), [1, 2, 4]);
    assert_eq!(seen(1), [1, 2]);
    let found = boxes(&built, BoxAxes::Object)[1];
    assert_eq!((found.points, found.visible), (0, 0.0));

    let turned = DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.3), DVec3::new(10.0, 0.0, 0.0));
    let numbered = |pose: DAffine3| thing(&cube, pose).instance_id(9);
    let built = scene([numbered(turned), numbered(turned * at(3.0, 0.0, 1.0))]).commit().unwrap();
    let [found] = *boxes(&built, BoxAxes::Object) else { panic!("one box") };
    assert_close("size", found.size, DVec3::new(5.0, 2.0, 3.0), 1e-6);
    assert_close("place", found.pose.position, turned.transform_point3(DVec3::new(1.5, 0.0, 0.5)), 1e-6);
    assert_eq!(found.category_id, 10);

    assert!(boxes(&scene([]).commit().unwrap(), BoxAxes::Object).is_empty());
    let without = PointCloud::default();
    let sensor = sensor();
    let error = built.boxes(&sensor, &Trajectory::fixed(Pose::IDENTITY), &ScanOptions::default(), &without);
    assert_eq!(
        error.unwrap_err().to_string(),
        "cloud is without instance_id; allowed: one with it, by which points are counted"
    );
}

/// A sonar's points have boxes too; glass hides from sound.
#[test]
fn boxes_of_sonars_count_their_points() {
    let pane = Material::default().transmission(1.0).roughness(0.0);
    let cube = mesh(Shape::cuboid(-DVec3::ONE, DVec3::ONE));
    let bed = mesh(Shape::plate(DVec3::ZERO, DVec3::Z, 40.0));
    let cover = of_material(Shape::plate(DVec3::ZERO, DVec3::Z, 2.0), Some(Arc::new(pane)));
    let objects =
        [thing(&bed, at(0.0, 0.0, -20.0)), thing(&cube, at(0.0, 4.0, -19.0)), thing(&cover, at(0.0, 4.0, -16.0))];
    let built = scene(objects).commit().unwrap();
    let sonar = Sensor::preset("mbes_400").unwrap();
    let cloud = scan_at(&built, &sonar, Pose::at(0.0, 0.0, -2.0), options(BoxAxes::Object));
    let found = cloud.boxes.as_deref().unwrap();
    assert_eq!(found.len(), 3);
    for found in found {
        let count = cloud.columns().instance_id().iter().filter(|id| **id == found.instance_id).count();
        assert_eq!(found.points as usize, count);
    }
    assert!(found[0].points > 50 && found[0].visible > 0.8);
    assert!(found[1].visible < 0.2 && found[2].visible == 1.0, "{found:?}");
}
