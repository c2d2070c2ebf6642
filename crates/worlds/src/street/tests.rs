//! Properties of the street, and what other readers find in its file.

use super::cars::WHEEL;
use super::drive::{self, WHEEL_KEYS};
use super::person::{self, PersonBody};
use super::plan::{FRONT, HALF_ROAD, LANE_MIDDLE, SIDE_FRONT, SIDE_HALF_ROAD, StreetPlan};
use super::skeleton::JOINTS;
use super::{Street, walk};
use crate::tests::{chunks, of_category};
use cloud::FieldSet;
use emitter::Trajectory;
use engine::scan::ScanOptions;
use engine::scene::{LoadOptions, Object};
use engine::sensor::Sensor;
use glam::{DQuat, DVec2, DVec3, Quat, Vec3};
use ground::pose::Pose;
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

fn town(blocks: [u32; 2]) -> Street {
    Street { blocks: Some(blocks), ..Street::default() }
}

fn plan(street: &Street) -> StreetPlan {
    StreetPlan::new(street).unwrap()
}

/// The file parsed by the specification alone: JSON and numbers. The `gltf` crate does not support channels without a
/// node.
struct File<'a> {
    json: Value,
    binary: &'a [u8],
}

impl<'a> File<'a> {
    fn new(glb: &'a [u8]) -> Self {
        let (json, binary) = chunks(glb);
        File { json, binary }
    }

    fn list(&self, name: &str) -> &[Value] {
        self.json[name].as_array().unwrap()
    }

    /// The rows of an accessor.
    fn rows(&self, accessor: &Value) -> Vec<Vec<f32>> {
        let accessor = &self.list("accessors")[number(accessor)];
        let view = &self.list("bufferViews")[number(&accessor["bufferView"])];
        let (width, size) = match (accessor["type"].as_str().unwrap(), number(&accessor["componentType"])) {
            ("SCALAR", 5126) => (1, 4),
            ("SCALAR", 5121) => (1, 1),
            ("SCALAR", 5123) => (1, 2),
            ("SCALAR", 5125) => (1, 4),
            ("VEC3", 5126) => (3, 4),
            ("VEC4", 5126) => (4, 4),
            ("VEC4", 5121) => (4, 1),
            ("MAT4", 5126) => (16, 4),
            other => panic!("{other:?}"),
        };
        let count = number(&accessor["count"]);
        assert_eq!(number(&view["byteLength"]), count * width * size);
        let start = number(&view["byteOffset"]);
        assert!(start.is_multiple_of(4) && start + count * width * size <= self.binary.len());
        let whole = number(&accessor["componentType"]) == 5125;
        let one = |bytes: &[u8]| match *bytes {
            [a] => f32::from(a),
            [a, b] => f32::from(u16::from_le_bytes([a, b])),
            [a, b, c, d] if whole => u32::from_le_bytes([a, b, c, d]) as f32,
            [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
            _ => panic!(),
        };
        let values: Vec<f32> = self.binary[start..start + count * width * size].chunks(size).map(one).collect();
        values.chunks(width).map(<[f32]>::to_vec).collect()
    }

    fn node(&self, name: &str) -> usize {
        self.list("nodes").iter().position(|node| node["name"] == name).unwrap()
    }

    /// Times and values of the keyframes that animate a property of a node.
    fn keys(&self, node: &str, path: &str) -> (Vec<f32>, Vec<Vec<f32>>) {
        let animation = &self.list("animations")[0];
        let node = self.node(node);
        let target = |channel: &&Value| channel["target"]["node"] == node && channel["target"]["path"] == path;
        let channel = animation["channels"].as_array().unwrap().iter().find(target).unwrap();
        let sampler = &animation["samplers"][number(&channel["sampler"])];
        (self.rows(&sampler["input"]).concat(), self.rows(&sampler["output"]))
    }
}

fn number(value: &Value) -> usize {
    value.as_u64().unwrap_or_else(|| panic!("{value}")) as usize
}

#[test]
fn a_street_reads_back() {
    let made = Street::default().scene(7).unwrap();
    assert!(made.bytes().len() < 4_000_000, "{}", made.bytes().len());
    let scene = made.load(&LoadOptions::default()).unwrap();
    assert_eq!(scene.degenerate_triangles, 0);
    assert_eq!(scene.triangle_count(), made.triangles);
    assert_eq!(scene.animations, ["Street"]);
    let mut categories = vec!["road", "lane-marking", "parking", "sidewalk", "terrain", "building", "fence"];
    categories.extend([
        "vegetation",
        "trunk",
        "pole",
        "traffic-sign",
        "other-object",
        "car",
        "truck",
        "bicycle",
        "person",
    ]);
    let mut found: Vec<&str> = made.categories.iter().map(|(name, _)| *name).collect();
    categories.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, categories);
    for (category, count) in &made.categories {
        assert_eq!(of_category(&scene, category).len(), *count, "{category}");
    }
    let (low, high) = scene.bounds().unwrap();
    assert!((low.x + 100.0).abs() < 2.0 && (high.x - 100.0).abs() < 2.0 && low.z > -0.01, "{low} {high}");
    let lidar = scene.camera("Lidar").unwrap().pose;
    assert!((lidar.position.z - 1.9).abs() < 1e-9 && (lidar.orientation * DVec3::X - DVec3::X).length() < 1e-9);
    assert!((lidar.position.y + LANE_MIDDLE).abs() < 1e-6 && lidar.position.x < -55.0);
    let corner = scene.camera("Corner").unwrap().pose;
    assert!((3.0..3.2).contains(&corner.position.z) && (corner.orientation * DVec3::Z).z > 0.9);
}

#[test]
fn nothing_of_the_car_below_is_in_the_sensor_s_view() {
    let scene = Street::default().scene(7).unwrap().load(&LoadOptions::default()).unwrap();
    let camera = scene.camera("Lidar").unwrap().pose.position;
    let own = scene.objects.iter().filter(|object| object.name.starts_with("Car_1"));
    for object in own {
        for part in &object.mesh.parts {
            for &vertex in part.positions.iter() {
                let at = object.world_from_object.transform_point3(Vec3::from(vertex).as_dvec3()) - camera;
                let down = (-at.z).atan2(at.truncate().length()).to_degrees();
                assert!(down > 25.0, "{} at {at}: {down} degrees down", object.name);
            }
        }
    }
}

#[test]
fn same_seed_same_bytes() {
    let one = Street::default().scene(1).unwrap();
    assert_eq!(one.bytes(), Street::default().scene(1).unwrap().bytes());
    assert_ne!(one.bytes(), Street::default().scene(2).unwrap().bytes());
    let blocks = town([2, 1]).scene(1).unwrap();
    assert_eq!(blocks.bytes(), town([2, 1]).scene(1).unwrap().bytes());
    assert_ne!(blocks.bytes(), town([2, 1]).scene(2).unwrap().bytes());
}

#[test]
fn files_are_valid_gltf() {
    let longest = Street { cars: Some(10), seconds: 30.0, ..Street::default() };
    let town = Street { people: Some(7), ..town([1, 1]) };
    for (street, people) in [(Street::default(), 2), (longest, 2), (town, 7)] {
        let made = street.scene(3).unwrap();
        let file = File::new(made.bytes());
        for mesh in file.list("meshes") {
            for primitive in mesh["primitives"].as_array().unwrap() {
                let attributes = &primitive["attributes"];
                let targets = primitive["targets"].as_array().into_iter().flatten();
                let vertices = file.rows(&attributes["POSITION"]).len();
                for positions in targets.map(|target| &target["POSITION"]).chain([&attributes["POSITION"]]) {
                    let rows = file.rows(positions);
                    assert_eq!(rows.len(), vertices);
                    let accessor = &file.list("accessors")[number(positions)];
                    for axis in 0..3 {
                        let values = || rows.iter().map(|row| row[axis]);
                        let bound = |key: &str| accessor[key][axis].as_f64().unwrap() as f32;
                        assert_eq!(values().fold(f32::INFINITY, f32::min), bound("min"));
                        assert_eq!(values().fold(f32::NEG_INFINITY, f32::max), bound("max"));
                    }
                }
                if attributes["NORMAL"].is_u64() {
                    let normals = file.rows(&attributes["NORMAL"]);
                    assert_eq!(normals.len(), vertices);
                    assert!(normals.iter().all(|n| (Vec3::from_slice(n).length() - 1.0).abs() < 1e-5));
                }
                let indices = file.rows(&primitive["indices"]).concat();
                assert!(indices.len().is_multiple_of(3) && indices.iter().all(|&index| (index as usize) < vertices));
                if attributes["JOINTS_0"].is_u64() {
                    let (joints, weights) = (file.rows(&attributes["JOINTS_0"]), file.rows(&attributes["WEIGHTS_0"]));
                    assert_eq!((joints.len(), weights.len()), (vertices, vertices));
                    assert!(weights.iter().all(|row| (row.iter().sum::<f32>() - 1.0).abs() < 4e-7));
                    assert!(joints.iter().flatten().all(|&joint| (joint as usize) < JOINTS.len()));
                }
            }
        }
        assert_eq!(file.list("skins").len(), people);
        for skin in file.list("skins") {
            assert_eq!(skin["joints"].as_array().unwrap().len(), file.rows(&skin["inverseBindMatrices"]).len());
        }
        let [animation] = file.list("animations") else { panic!() };
        for channel in animation["channels"].as_array().unwrap() {
            let sampler = &animation["samplers"][number(&channel["sampler"])];
            let times = file.rows(&sampler["input"]).concat();
            let accessor = &file.list("accessors")[number(&sampler["input"])];
            let last = times[times.len() - 1];
            assert!(
                times[0] == 0.0 && f64::from(last) <= street.seconds && times.windows(2).all(|pair| pair[0] < pair[1])
            );
            assert_eq!((accessor["min"][0].as_f64(), accessor["max"][0].as_f64()), (Some(0.0), Some(last.into())));
            let values = file.rows(&sampler["output"]);
            let rows = match (channel["target"]["path"].as_str().unwrap(), sampler["interpolation"].as_str().unwrap()) {
                ("translation", "CUBICSPLINE") => 3 * times.len(),
                ("weights", "LINEAR") => 2 * times.len(),
                ("rotation", "LINEAR") => {
                    for pair in values.windows(2) {
                        let [a, b] = [&pair[0], &pair[1]].map(|q| Quat::from_slice(q));
                        assert!((a.length() - 1.0).abs() < 1e-5);
                        assert!(a.dot(b).abs() > std::f32::consts::FRAC_1_SQRT_2, "{} degrees", a.angle_between(b));
                    }
                    times.len()
                }
                ("translation", "LINEAR") => times.len(),
                ("pointer", "STEP") => {
                    let pointer = &channel["target"]["extensions"]["KHR_animation_pointer"]["pointer"];
                    let value = file.json.pointer(pointer.as_str().unwrap()).unwrap();
                    assert!(channel["target"]["node"].is_null());
                    assert_eq!(value.as_bool().map(|on| f32::from(u8::from(on))), Some(values[0][0]));
                    times.len()
                }
                other => panic!("{other:?}"),
            };
            assert_eq!(values.len(), rows);
        }
        for used in ["KHR_animation_pointer", "KHR_node_visibility", "KHR_materials_transmission"] {
            assert!(file.list("extensionsUsed").iter().any(|name| name == used));
        }
        assert!(file.json["extensionsRequired"].is_null());
    }
}

#[test]
fn animations_start_at_the_static_transforms() {
    let made = Street::default().scene(5).unwrap();
    let file = File::new(made.bytes());
    let animation = &file.list("animations")[0];
    for channel in animation["channels"].as_array().unwrap() {
        let (target, sampler) = (&channel["target"], &animation["samplers"][number(&channel["sampler"])]);
        let path = target["path"].as_str().unwrap();
        if !["translation", "rotation"].contains(&path) {
            continue;
        }
        let node = &file.list("nodes")[number(&target["node"])];
        let rows = file.rows(&sampler["output"]);
        let first = if sampler["interpolation"] == "CUBICSPLINE" { &rows[1] } else { &rows[0] };
        let rest = if path == "translation" { vec![0.0; 3] } else { vec![0.0, 0.0, 0.0, 1.0] };
        let still: Vec<f32> = match node[path].as_array() {
            Some(still) => still.iter().map(|value| value.as_f64().unwrap() as f32).collect(),
            None => rest,
        };
        let difference = first.iter().zip(&still).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(difference < 1e-5, "{} {path}: {first:?} {still:?}", node["name"]);
    }
    // The red lamps of the street are off, those of the side street are on.
    let lit = |name: &str| file.list("nodes")[file.node(name)]["extensions"]["KHR_node_visibility"]["visible"] == true;
    assert!(lit("TrafficLight_East_green") && !lit("TrafficLight_East_red") && lit("TrafficLight_South_red"));
}

#[test]
fn wheels_turn_as_far_as_their_car_drives() {
    let made = Street::default().scene(5).unwrap();
    let file = File::new(made.bytes());
    for car in 1..=6 {
        let (_, places) = file.keys(&format!("Car_{car}"), "translation");
        let (_, turns) = file.keys(&format!("Wheel_RL_of_Car_{car}"), "rotation");
        // Chords of arcs are a little shorter than the arcs.
        let at: Vec<Vec3> = places.iter().skip(1).step_by(3).map(|row| Vec3::from_slice(row)).collect();
        let driven: f32 = at.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        let angle = |pair: &[Vec<f32>]| {
            let turn = Quat::from_slice(&pair[0]).inverse() * Quat::from_slice(&pair[1]);
            let turn = if turn.w < 0.0 { -turn } else { turn };
            // The axle is the z axis of the file, and cars drive along its x axis: forward is a negative rotation about
            // z.
            assert!(turn.x.abs() < 1e-5 && turn.y.abs() < 1e-5 && turn.z <= 1e-6);
            -2.0 * turn.z.asin()
        };
        let rolled: f32 = turns.windows(2).map(angle).sum::<f32>() * WHEEL as f32;
        assert!((rolled - driven).abs() < 0.02 && driven > 30.0, "{car}: {rolled} {driven}");
    }
}

#[test]
fn traffic_is_orderly() {
    for (seed, seconds) in (0..40).flat_map(|seed| [(seed, 8.0), (seed, 10.0), (seed, 17.0), (seed, 30.0)]) {
        for cars in [1, 6, 10] {
            let plan = plan(&Street { seconds, ..Street::default() });
            let [[_, end], [_, side_end]] = plan.ends();
            let drives = drive::drives(&plan, cars, seed);
            let context = |car: usize| format!("seed {seed}, {seconds} s, car {}: {:?}", car + 1, drives[car].speeds());
            let steps = (seconds * WHEEL_KEYS) as u32;
            for step in 0..=steps {
                let time = f64::from(step) / WHEEL_KEYS;
                let places: Vec<DVec3> = drives.iter().map(|drive| drive.place(time)[0]).collect();
                for (a, at) in places.iter().enumerate() {
                    assert!(at.x.abs() < end - 1.0 && at.y.abs() < side_end - 1.0, "{} at {at}", context(a));
                    for (b, other) in places.iter().enumerate().skip(a + 1) {
                        let apart = (*at - *other).abs();
                        let beside = apart.y >= 1.9 && at.y.abs() < 3.0 && other.y.abs() < 3.0;
                        let aside = apart.x >= 1.9 && at.x.abs() < 3.0 && other.x.abs() < 3.0;
                        assert!(apart.length() > 4.9 || beside || aside, "{} and {} at {time}", context(a), context(b));
                    }
                }
            }
            for (car, drive) in drives.iter().enumerate() {
                let [slowest, fastest] = drive.speeds();
                assert!(slowest >= 0.0 && (8.0..=14.0).contains(&fastest), "{}", context(car));
                let step = drive.rolled(5.0, WHEEL) - drive.rolled(5.0 - 1.0 / WHEEL_KEYS, WHEEL);
                assert!(step < FRAC_PI_2);
            }
            // The first meets no red light, the second stops and drives on, the third turns to the right.
            assert!(drives[0].speeds()[0] > 8.0, "{}", context(0));
            if cars > 1 {
                let [slowest, _] = drives[1].speeds();
                let [[at, _], [_, velocity]] = [drives[1].place(plan.lights()[4].0), drives[1].place(seconds)];
                assert!(slowest < 0.3 && velocity.y < -1.5 && (15.0..19.0).contains(&at.y), "{} {at}", context(1));
                let [at, velocity] = drives[2].place(seconds);
                assert!((at.x - LANE_MIDDLE).abs() < 1e-9 && at.y > 12.0 && velocity.y > 5.0, "{} {at}", context(2));
            }
        }
    }
}

/// Position, relative to the person, of a point that is attached to a joint.
fn place(gait: &walk::Gait, joint: usize, point: DVec3) -> DVec3 {
    let bound = |joint: usize| DVec3::from(JOINTS[joint].2);
    let (mut at, mut joint) = (point - bound(joint), joint);
    loop {
        at = gait.turns[joint] * at;
        match JOINTS[joint].1 {
            Some(parent) => at += bound(joint) - bound(parent),
            None => return at + gait.hips,
        }
        joint = JOINTS[joint].1.unwrap();
    }
}

#[test]
fn feet_stand_still_on_the_ground() {
    let mut standing = [0, 0];
    for step in 0..1000 {
        let times = [f64::from(step) / 500.0, f64::from(step + 1) / 500.0];
        let gaits = times.map(|time| walk::gait(time, 0.0));
        let mut lowest = f64::INFINITY;
        for (foot, side) in [(13, 0.095), (16, -0.095)] {
            // The ends of the sole.
            for x in [-0.05, 0.16] {
                let sole = DVec3::new(x, side, 0.0);
                let [now, next] = [0, 1].map(|i| place(&gaits[i], foot, sole) + DVec3::X * walk::SPEED * times[i]);
                assert!(now.z > -0.012, "{now} at {}", times[0]);
                lowest = lowest.min(now.z);
                let speed = (next - now).truncate().length() * 500.0;
                // On the ground from the time the heel touches it until the toes leave it.
                let phase = (times[0] + if foot == 16 { 0.5 } else { 0.0 }) % 1.0;
                if now.z < 0.003 && next.z < 0.003 && phase < 0.598 {
                    standing[usize::from(foot == 16)] += 1;
                    assert!(speed < 0.25, "slides at {speed} m/s, {now}, {}", times[0]);
                }
                assert!(speed < 7.0, "{speed} m/s at {}", times[0]);
            }
        }
        assert!(lowest < 0.02, "flies at {}", times[0]);
    }
    assert!(standing.iter().all(|&count| count > 500), "{standing:?}");
}

#[test]
fn a_body_is_closed_and_its_joints_move_what_is_near() {
    let body = PersonBody::new();
    let (vertices, triangles) = body.skin();
    assert!((2000..7000).contains(&triangles.len()), "{}", triangles.len());
    let mut edges = HashMap::new();
    let mut volume = 0.0;
    for &[a, b, c] in &triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_insert(0) += 1;
        }
        let corner = |index: u32| vertices[index as usize];
        volume += corner(a).cross(corner(b)).dot(corner(c)) / 6.0;
    }
    assert!(edges.iter().all(|([a, b], count)| edges.get(&[*b, *a]) == Some(count)));
    // People of 1.76 m have 60 to 90 litres.
    assert!((0.055..0.09).contains(&volume), "{volume}");
    let tallest = vertices.iter().fold(0.0, |tallest: f64, at| tallest.max(at.z));
    assert!((1.7..1.85).contains(&tallest), "{tallest}");
    for &at in &vertices {
        let (joints, weights) = body.weights(at);
        for (joint, weight) in joints.into_iter().zip(weights) {
            let [_, y, _] = JOINTS[usize::from(joint)].2;
            assert!(weight >= 0.0 && (weight == 0.0 || y * at.y >= -0.01), "{joint} moves {at}");
        }
    }
}

#[test]
fn a_town_has_its_blocks() {
    let made = town([3, 2]).scene(7).unwrap();
    assert!(made.bytes().len() < 4_000_000, "{}", made.bytes().len());
    let scene = made.load(&LoadOptions::default()).unwrap();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    assert_eq!((scene.degenerate_triangles, scene.triangle_count()), (0, made.triangles));
    // Every triangle belongs to an object of a category and has a part.
    let names: Vec<&str> = made.categories.iter().map(|(name, _)| *name).collect();
    for object in &scene.objects {
        let category = scene.labels.category.name(object.category_id);
        assert!(category.is_some_and(|name| names.contains(&name)), "{}", object.name);
        assert!(object.instance_id > 0 && object.part_ids.iter().all(|&part| part > 0), "{}", object.name);
    }
    // Wheels and drivers are one instance with their car.
    let numbers: HashMap<&str, u32> =
        scene.objects.iter().map(|object| (object.name.as_str(), object.instance_id)).collect();
    for object in &scene.objects {
        if let Some((_, car)) = object.name.split_once("_of_") {
            assert_eq!(object.instance_id, numbers[car], "{}", object.name);
        }
    }
    let cars: HashSet<u32> = of_category(&scene, "car").iter().map(|object| object.instance_id).collect();
    let bodies = of_category(&scene, "car").iter().filter(|object| !object.name.contains("_of_")).count();
    assert_eq!(cars.len(), bodies);
    let (low, high) = scene.bounds().unwrap();
    let size = (high - low).truncate();
    // Crowns of trees reach a little farther.
    assert!((390.0..402.0).contains(&size.x) && (258.0..270.0).contains(&size.y), "{low} {high}");
    let count = |name: &str| made.categories.iter().find(|(known, _)| *known == name).unwrap().1;
    assert_eq!([count("road"), count("sidewalk"), count("person")], [12, 48, 24]);
    assert_eq!(
        scene.objects.iter().filter(|object| object.name.starts_with("Car_") && object.name.len() < 7).count(),
        24
    );
    // The same meshes everywhere.
    let meshes: HashSet<_> = of_category(&scene, "building").iter().map(|house| Arc::as_ptr(&house.mesh)).collect();
    assert_eq!(meshes.len(), 33);
    let lidar = scene.camera("Lidar").unwrap().pose.position;
    assert!((lidar.y + LANE_MIDDLE).abs() < 1e-6 && (lidar.z - 1.9).abs() < 1e-9, "{lidar}");
    assert!(scene.camera("Corner").is_ok());
}

/// Extent along x and y of an object.
fn extent(object: &Object) -> [DVec2; 2] {
    let all = object.mesh.parts.iter().flat_map(|part| part.positions.iter());
    let places = all.map(|&at| object.world_from_object.transform_point3(Vec3::from(at).as_dvec3()).truncate());
    places.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
}

#[test]
fn things_stand_apart() {
    for (seed, street) in [(1, Street::default()), (2, town([2, 1])), (3, town([1, 3]))] {
        let scene = street.scene(seed).unwrap().load(&LoadOptions::default()).unwrap();
        let mut boxes = Vec::new();
        for prefix in
            ["House_", "Car_", "Parked_", "Truck_", "Bicycle_", "Bench_", "Bin_", "Sign_", "Lamp_", "Bollard_"]
        {
            let whole = |name: &str| name.starts_with(prefix) && name.matches('_').count() == 1;
            let named = scene.objects.iter().filter(|object| whole(&object.name));
            boxes.extend(named.map(|object| {
                // Arms of lamps and plates of signs are above other objects.
                let at = object.world_from_object.translation.truncate();
                let is_post = ["Sign_", "Lamp_"].contains(&prefix);
                (prefix, object.name.as_str(), if is_post { [at - 0.12, at + 0.12] } else { extent(object) })
            }));
        }
        boxes.extend(of_category(&scene, "trunk").into_iter().map(|object| {
            // Branches are above other objects.
            let at = object.world_from_object.translation.truncate();
            ("Trunk", object.name.as_str(), [at - 0.2, at + 0.2])
        }));
        assert!(boxes.len() > 100);
        for (index, (kind, name, [low, high])) in boxes.iter().enumerate() {
            for (other_kind, other, [other_low, other_high]) in &boxes[index + 1..] {
                // Houses touch; their cornices, awnings and eaves overhang the neighbour and the sidewalk.
                let margin = if kind == other_kind && *kind == "House_" { 0.4 } else { 0.0 };
                let gap = (*low - *other_high).max(*other_low - *high) + margin;
                assert!(gap.max_element() > -1e-3, "{name} {other}: {gap}");
            }
        }
    }
}

#[test]
fn traffic_in_a_town_is_orderly() {
    let mut stopped = 0;
    for (seed, blocks, seconds) in
        [(1, [1, 1], 10.0), (2, [3, 2], 8.0), (3, [3, 2], 30.0), (4, [2, 3], 20.0), (5, [4, 1], 10.0)]
    {
        let plan = plan(&Street { seconds, ..town(blocks) });
        let most = drive::most_cars(&plan);
        assert!(most >= 4 * plan.crossings.len() as u32, "{most}");
        for cars in [most / 3, most] {
            let drives = drive::drives(&plan, cars, seed);
            let ends = plan.ends();
            for step in 0..=(seconds * 10.0) as u32 {
                let time = f64::from(step) / 10.0;
                let places: Vec<[DVec3; 2]> = drives.iter().map(|drive| drive.place(time)).collect();
                for (a, [at, _]) in places.iter().enumerate() {
                    let context = || format!("seed {seed}, {seconds} s, car {} of {cars} at {at}, {time} s", a + 1);
                    // On the right half of a street or a side street, and not past its end.
                    let right = |axis: usize| {
                        let heading = drives[a].turned(time) * DVec3::X;
                        let aside = [DVec3::NEG_Y, DVec3::X][axis] * heading[axis].signum() * LANE_MIDDLE;
                        heading[axis].abs() > 0.99
                            && plan.middles[1 - axis]
                                .iter()
                                .any(|middle| (at[1 - axis] - middle - aside[1 - axis]).abs() < 1e-9)
                    };
                    assert!(right(0) || right(1), "{}", context());
                    assert!((ends[0][0] + 2.0..=ends[0][1] - 2.0).contains(&at.x), "{}", context());
                    assert!((ends[1][0] + 2.0..=ends[1][1] - 2.0).contains(&at.y), "{}", context());
                    for (b, [other, _]) in places.iter().enumerate().skip(a + 1) {
                        let apart = (*at - *other).abs();
                        let beside = apart.x >= 1.9 && apart.y >= 1.9 || apart.x.min(apart.y) >= 1.9;
                        let one_lane = apart.x.min(apart.y) < 1e-6;
                        let opposite = right(0) && apart.y > 3.0 || right(1) && apart.x > 3.0;
                        let fine = if one_lane { apart.length() > 4.9 } else { apart.length() > 3.3 };
                        assert!(fine || beside || opposite, "{} and car {} at {other}", context(), b + 1);
                    }
                }
            }
            assert!(drives.iter().all(|drive| drive.speeds()[1] > 8.0));
            stopped += drives.iter().filter(|drive| drive.speeds()[0] < 1.0).count();
        }
    }
    assert!(stopped > 20, "{stopped}");
}

#[test]
fn people_stay_on_the_sidewalks_and_apart() {
    for (seed, street) in [(1, Street::default()), (2, town([2, 2])), (3, Street { seconds: 30.0, ..town([1, 2]) })] {
        let plan = plan(&street);
        let walks = person::walks(&plan, seed);
        assert!(walks.len() >= 2 * plan.crossings.len(), "{}", walks.len());
        let near = |at: f64, middles: &[f64]| middles.iter().map(|m| (at - m).abs()).fold(f64::INFINITY, f64::min);
        for step in 0..=20 {
            let way = walk::SPEED * street.seconds * f64::from(step) / 20.0;
            let places: Vec<DVec2> =
                walks.iter().map(|walk| walk.from.truncate() + DVec2::from_angle(walk.heading) * way).collect();
            for (number, at) in places.iter().enumerate() {
                let [x, y] = [near(at.x, &plan.middles[0]), near(at.y, &plan.middles[1])];
                let on = |away: f64, kerb: f64, front: f64| (kerb + 0.3..=front - 0.3).contains(&away);
                let beside_street = on(y, HALF_ROAD, FRONT) && x > SIDE_HALF_ROAD;
                let beside_side_street = on(x, SIDE_HALF_ROAD, SIDE_FRONT) && y > HALF_ROAD;
                assert!(beside_street || beside_side_street, "{number} at {at}");
                for other in &places[number + 1..] {
                    assert!(at.distance(*other) > 0.6, "{number} at {at} and {other}");
                }
            }
        }
    }
    // At a single crossing the first two walk towards each other's side.
    let walks = person::walks(&plan(&Street::default()), 9);
    assert!(walks[0].from.y < 0.0 && walks[0].heading == 0.0 && walks[1].from.y > 0.0 && walks[1].heading > 3.0);
}

#[test]
fn signs_send_light_back_and_panes_let_it_through() {
    let scene = Street::default().scene(7).unwrap().load(&LoadOptions::default()).unwrap();
    let sign = scene.objects.iter().find(|object| object.name == "Sign_01_Plate").unwrap();
    let (at, front) = (sign.world_from_object.translation, sign.world_from_object.matrix3 * DVec3::X);
    let from = at + front * 20.0;
    let yaw = (-front.y).atan2(-front.x).to_degrees();
    let (category, building) = (scene.labels.category.id("traffic-sign"), scene.labels.category.id("building"));
    let built = scene.build().unwrap();
    let mut sensor = Sensor::preset("velodyne_vlp32c").unwrap();
    sensor.set("intensity.encoding", "reflectivity").unwrap();
    let scan = |at: DVec3, yaw: f64| {
        let mut pose = Pose::at(at.x, at.y, at.z);
        pose.orientation = DQuat::from_rotation_z(yaw.to_radians());
        let fields = FieldSet::parse("default,category_id,cause,bounces").unwrap();
        let options = ScanOptions::default().fields(fields);
        built.scan(&sensor, &Trajectory::fixed(pose), &options).unwrap()
    };
    let cloud = scan(from, yaw);
    let brightest = |on_signs: bool| {
        let rows = cloud.columns.intensity.iter().zip(&cloud.columns.category_id);
        rows.filter(|(_, id)| (**id == category) == on_signs).fold(0.0_f32, |most, (value, _)| most.max(*value))
    };
    // White sheeting of 250 cd/(lx m^2) is 785 times as bright as a white surface, red 141 times.
    assert!(brightest(true) > 30.0 && brightest(false) <= 1.0, "{} {}", brightest(true), brightest(false));
    // From the street into the rooms.
    let cloud = scan(DVec3::new(0.0, 0.0, 5.0), 0.0);
    let behind = cloud
        .columns
        .cause
        .iter()
        .zip(&cloud.columns.category_id)
        .filter(|(cause, id)| **cause == 2 && **id == building);
    assert!(behind.count() > 50);
}

#[test]
fn the_ground_is_covered_once() {
    // The areas of road, parking and terrain add up to that of the town; sidewalks lie on the asphalt.
    for (street, size) in [(Street::default(), [200.0, 100.0]), (town([2, 1]), [290.0, 174.0])] {
        let scene = street.scene(1).unwrap().load(&LoadOptions::default()).unwrap();
        let mut area = 0.0;
        for category in ["road", "parking", "terrain"] {
            for object in of_category(&scene, category) {
                for part in &object.mesh.parts {
                    let corner = |index: u32| Vec3::from(part.positions[index as usize]).as_dvec3();
                    let faces = part
                        .triangles
                        .iter()
                        .map(|&[a, b, c]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).y / 2.0);
                    area += faces.sum::<f64>();
                }
            }
        }
        assert!((area - size[0] * size[1]).abs() < 1.0, "{area}");
    }
}

#[test]
fn bad_parameters_are_named() {
    for (street, says) in [
        (Street { cars: Some(0), ..Street::default() }, "cars is 0; allowed: 1 to 10"),
        (Street { cars: Some(11), ..Street::default() }, "cars is 11"),
        (Street { cars: Some(1000), ..town([1, 1]) }, "cars is 1000; allowed: 1 to 2"),
        (Street { people: Some(1000), ..Street::default() }, "people is 1000; allowed: 0 to"),
        (town([0, 3]), "blocks is 0; allowed: 1 to 10"),
        (town([3, 11]), "blocks is 11; allowed: 1 to 10"),
        (Street { seconds: 7.9, ..Street::default() }, "seconds is 7.9; allowed: 8 to 30"),
        (Street { seconds: 30.1, ..Street::default() }, "seconds is 30.1"),
        (Street { seconds: f64::NAN, ..Street::default() }, "seconds is NaN"),
    ] {
        let error = street.scene(0).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}
