//! Scene flow: where a point will be one frame later, of everything that moves.

use super::vector;
use echocast::scene::Material;
use echocast::{Engine, FieldSet, Frame, LiveScene, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::reference::{Actor, Change, Moving, Random, SceneBuilder, Shape, Track};
use glam::{DAffine3, DQuat, DVec3};

/// 10 frames a second, all around, 32 channels, in the order of azimuth.
fn around() -> Sensor {
    let yaml = "
name: around
kind: lidar
pattern:
  type: raster
  azimuth: {fov_deg: 360, step_deg: 1}
  elevation: {fov_deg: 120, step_deg: 3}
  rate_hz: 10
";
    Sensor::from_yaml(yaml, "").unwrap()
}

fn scan(scene: &Scene, trajectory: &Trajectory, options: ScanOptions) -> PointCloud {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.add_scene(scene).unwrap();
    live.set_time(options.start_time, 0.1).unwrap();
    live.commit().unwrap().scan(&around(), trajectory, &options.fields(FieldSet::all())).unwrap()
}

fn flow(cloud: &PointCloud, row: usize) -> DVec3 {
    let c = cloud.columns();
    vector(c.flow_x(), c.flow_y(), c.flow_z(), row)
}

/// How far `point` is from the nearest of `triangles`, which that is, and the weights of its corners there.
fn nearest(point: DVec3, triangles: &[[DVec3; 3]]) -> (f64, usize, [f64; 3]) {
    let mut best = (f64::INFINITY, 0, [0.0; 3]);
    for (number, &[a, b, c]) in triangles.iter().enumerate() {
        let (ab, ac, ap) = (b - a, c - a, point - a);
        let normal = ab.cross(ac);
        let area = normal.length_squared();
        let weights = [ap.cross(ac).dot(normal) / area, ab.cross(ap).dot(normal) / area];
        let inside = weights[0] >= 0.0 && weights[1] >= 0.0 && weights[0] + weights[1] <= 1.0;
        // On one of the edges, if not within.
        let along = |from: DVec3, edge: DVec3| ((point - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        let (s, t, u) = (along(a, ab), along(a, ac), along(b, c - b));
        let candidates: &[[f64; 2]] = if inside { &[weights] } else { &[[s, 0.0], [0.0, t], [1.0 - u, u]] };
        for &[v, w] in candidates {
            let distance = (a + v * ab + w * ac - point).length();
            if distance < best.0 {
                best = (distance, number, [1.0 - v - w, v, w]);
            }
        }
    }
    best
}

/// Of what turns, drives, bends, morphs and comes from caches, from a sensor that drives itself: moved by its flow, a
/// point lies on its object one frame later, at the very spot that the beam met.
#[test]
fn points_moved_by_their_flow_stay_on_their_objects() {
    let folder = tempfile::tempdir().unwrap();
    let mut met = [0; 6];
    for (seed, start_time, period) in [(1, 0.0, None), (2, 0.1, None), (3, 0.05, Some(0.04))] {
        let moving = Moving::random(&mut Random::new(seed));
        let scene = moving.load(folder.path());
        let drive = Trajectory::new(vec![(0.0, Pose::IDENTITY), (1.0, Pose::at(9.0, 2.0, 1.0))]).unwrap();
        let options = ScanOptions::default().start_time(start_time).frame_period(period);
        let cloud = scan(&scene, &drive, options.clone());
        for row in 0..cloud.len() {
            let object = cloud.columns().instance_id()[row] as usize;
            let name = &scene.objects.iter().find(|found| found.instance_id == object as u32).unwrap().name;
            let actor = moving.actors.iter().find(|actor| actor.name == *name).unwrap();
            let time = cloud.columns().time()[row];
            let (off, triangle, weights) = nearest(cloud.position(row), &actor.triangles(time));
            assert!(off < 1.1e-3, "{name}: point {row} is {off} m off the object");
            let later = actor.triangles(time + period.unwrap_or(0.1));
            let moved = cloud.position(row) + flow(&cloud, row);
            let off = nearest(moved, &later).0;
            assert!(off < 2e-3, "{name}: moved, point {row} is {off} m off the object");
            let spot: DVec3 = later[triangle].iter().zip(weights).map(|(corner, weight)| weight * *corner).sum();
            assert!((moved - spot).length() < 3e-3, "{name}: point {row} went to {moved}, its spot to {spot}");
            met[object] += 1;
        }
        // In the world, whatever the coordinates.
        let own = scan(&scene, &drive, options.coordinates(Frame::Sensor));
        assert!(
            own.columns().flow_x() == cloud.columns().flow_x()
                && own.columns().velocity_z() == cloud.columns().velocity_z()
        );
    }
    assert!(met[1..].iter().all(|points| *points > 150), "{met:?}");
}

/// A car that waits and starts within the next frame flows already; one that has stopped flows no more.
#[test]
fn what_is_about_to_move_flows() {
    let car = |name: &str, y: f64, keys: [(f64, DVec3); 2]| {
        let shape = Shape::cuboid(DVec3::new(-2.0, y, -1.0), DVec3::new(2.0, y + 2.0, 1.0));
        let track = Track { places: keys.to_vec(), turns: Vec::new() };
        Actor { name: name.into(), parts: vec![(shape, 0)], track, ..Actor::default() }
    };
    let speed = DVec3::X * 10.0;
    let starts = car("starts", 6.0, [(0.35, DVec3::ZERO), (1.35, speed)]);
    let stops = car("stops", -8.0, [(0.0, -0.25 * speed), (0.25, DVec3::ZERO)]);
    let moving = Moving { actors: vec![starts, stops], materials: vec![(0.5, [0.5; 3])] };
    let folder = tempfile::tempdir().unwrap();
    let scene = moving.load(folder.path());
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.add_scene(&scene).unwrap();
    let mut met = [0; 2];
    for frame in [3, 0, 1, 2, 3, 4, 14] {
        let start_time = 0.1 * f64::from(frame);
        live.set_time(start_time, 0.1).unwrap();
        let options = ScanOptions::default().start_time(start_time).fields(FieldSet::all());
        let cloud = live.commit().unwrap().scan(&around(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap();
        assert!(cloud.len() > 100);
        let c = cloud.columns();
        for row in 0..cloud.len() {
            let actor = usize::from(cloud.position(row).y < 0.0);
            let way = |time: f64| moving.actors[actor].track.at(time).translation;
            let expected = way(c.time()[row] + 0.1) - way(c.time()[row]);
            assert!((flow(&cloud, row) - expected).length() < 1e-3, "frame {frame}: {}", flow(&cloud, row));
            met[actor] += usize::from(expected.x > 0.1 && c.velocity_x()[row] == 0.0);
            if frame == 14 {
                assert_eq!((flow(&cloud, row), c.velocity_x()[row]), (DVec3::ZERO, 0.0), "both stand");
            }
        }
    }
    assert!(met[0] > 100 && met[1] == 0, "{met:?}");
}

/// What drives and changes its shape uniformly flows as fast as it moves.
#[test]
fn uniform_motion_flows_at_its_velocity() {
    let ball = Shape::sphere(1.5, 8);
    let random = &mut Random::new(4);
    let target: Vec<_> = ball.positions.iter().map(|_| random.in_cube(0.4).as_vec3().to_array()).collect();
    let track = Track { places: vec![(0.0, DVec3::X * 6.0), (1.0, DVec3::new(2.0, 3.0, -1.0))], turns: Vec::new() };
    let weights = vec![(0.0, vec![-1.0]), (1.0, vec![1.0])];
    let change = Change::Morph { targets: vec![vec![target]], weights };
    let actor = Actor { name: "ball".into(), parts: vec![(ball, 0)], track, change };
    let moving = Moving { actors: vec![actor], materials: vec![(0.5, [0.5; 3])] };
    let folder = tempfile::tempdir().unwrap();
    let options = ScanOptions::default().start_time(0.35);
    let cloud = scan(&moving.load(folder.path()), &Trajectory::fixed(Pose::IDENTITY), options);
    assert!(cloud.len() > 100, "{}", cloud.len());
    let c = cloud.columns();
    let mut speeds = Vec::new();
    for row in 0..cloud.len() {
        let velocity = vector(c.velocity_x(), c.velocity_y(), c.velocity_z(), row);
        assert!((flow(&cloud, row) - 0.1 * velocity).length() < 1e-5, "{velocity} {}", flow(&cloud, row));
        speeds.push(velocity.length());
    }
    // Not all of it is the common drive.
    speeds.sort_by(f64::total_cmp);
    assert!(speeds[speeds.len() - 1] - speeds[0] > 0.3, "{speeds:?}");
}

/// The image of a box that turns and drives, in a mirror that moves: it flows to where the image of the same spot is.
#[test]
fn images_flow_to_where_the_image_is() {
    let mut builder = SceneBuilder::new();
    let glass = builder.material(Material::default().metallic(1.0).roughness(0.0));
    let normal = DVec3::new(-1.0, 1.0, 0.2).normalize();
    builder.stand(Shape::plate(DVec3::ZERO, normal, 6.0), Some(glass));
    let half = DVec3::new(1.0, 1.5, 1.2);
    builder.stand(Shape::cuboid(-half, half), None);
    let mut scene = LiveScene::new(&Engine::new().unwrap());
    let objects = scene.add_scene(&builder.finish()).unwrap();
    let mirror = |time: f64| DVec3::new(6.0 + 3.0 * time, 0.4 * time, 0.0);
    let place = |time: f64| {
        let turn = DQuat::from_rotation_z(2.0 * time) * DQuat::from_rotation_x(0.5);
        DAffine3::from_rotation_translation(turn, DVec3::new(5.0 - 4.0 * time, 9.0 + 2.0 * time, time))
    };
    scene.set_motion(objects[0], &[0.0, 1.0].map(|time| (time, DAffine3::from_translation(mirror(time))))).unwrap();
    let keys: Vec<_> = (0..=100).map(|k| f64::from(k) / 100.0).map(|time| (time, place(time))).collect();
    scene.set_motion(objects[1], &keys).unwrap();
    let start_time = 0.3;
    scene.set_time(start_time, 0.1).unwrap();
    let options = ScanOptions::default().start_time(start_time).fields(FieldSet::all());
    let cloud = scene.commit().unwrap().scan(&around(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap();
    let image = |point: DVec3, time: f64| point - 2.0 * (point - mirror(time)).dot(normal) * normal;
    let mut images = 0;
    for row in
        (0..cloud.len()).filter(|&row| cloud.columns().bounces()[row] == 1 && cloud.columns().instance_id()[row] == 2)
    {
        images += 1;
        let time = cloud.columns().time()[row];
        // An image's image is the thing itself.
        let own = place(time).inverse().transform_point3(image(cloud.position(row), time));
        let outside = (own.abs() - half).max_element();
        assert!(outside.abs() < 1e-3, "the image of {own} is {outside} m off the box");
        let later = image(place(time + 0.1).transform_point3(own), time + 0.1);
        let moved = cloud.position(row) + flow(&cloud, row);
        assert!((moved - later).length() < 2e-3, "{moved} {later}");
    }
    assert!(images > 30, "{images}");
}
