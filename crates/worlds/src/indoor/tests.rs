//! Properties of rooms, and what a scan sees in them.

use super::Indoor;
use crate::tests::of_category;
use cloud::FieldSet;
use emitter::Trajectory;
use engine::scan::ScanOptions;
use engine::scene::{LoadOptions, Object, Scene};
use engine::sensor::Sensor;
use glam::{DVec3, Vec3};
use ground::pose::Pose;
use std::collections::HashSet;

const FURNITURE: [&str; 9] = ["table", "chair", "sofa", "bed", "shelf", "cupboard", "lamp", "plant", "tv"];

fn load(indoor: &Indoor, seed: u64) -> Scene {
    indoor.scene(seed).unwrap().load(&LoadOptions::default()).unwrap()
}

/// Lowest and highest place of an object.
fn extent(object: &Object) -> [DVec3; 2] {
    let all = object.mesh.parts.iter().flat_map(|part| part.positions.iter());
    let places = all.map(|&at| object.world_from_object.transform_point3(Vec3::from(at).as_dvec3()));
    places.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
}

#[test]
fn rooms_read_back() {
    let made = Indoor::default().scene(7).unwrap();
    assert!(made.bytes().len() < 500_000, "{}", made.bytes().len());
    let scene = made.load(&LoadOptions::default()).unwrap();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    assert_eq!((scene.degenerate_triangles, scene.triangle_count()), (0, made.triangles));
    for object in &scene.objects {
        assert!(object.category_id > 0 && object.instance_id > 0, "{}", object.name);
        assert!(object.part_ids.iter().all(|&part| part > 0), "{}", object.name);
    }
    let count = |name: &str| of_category(&scene, name).len();
    assert_eq!([count("floor"), count("ceiling"), count("wall")], [4, 4, 12]);
    assert_eq!([count("mirror"), count("partition"), count("window")], [2, 1, 7]);
    // A frame and a leaf each: between the rooms of both rows, between the rows, and to the outside.
    assert!([8, 10].contains(&count("door")), "{}", count("door"));
    let chair = of_category(&scene, "chair")[0];
    let parts: HashSet<_> = chair.part_ids.iter().filter_map(|&id| scene.labels.part.name(id)).collect();
    assert_eq!(parts, HashSet::from(["leg", "seat", "back"]));
    let (low, high) = scene.bounds().unwrap();
    assert!((low - DVec3::new(-5.07, -4.57, 0.0)).length() < 0.03, "{low}");
    assert!((high - DVec3::new(5.07, 4.57, 2.6)).length() < 0.03, "{high}");
    for name in ["Camera_1", "Camera_4", "Scanner"] {
        assert!((scene.camera(name).unwrap().pose.position.z - 1.5).abs() < 1e-9);
    }
    let scanner = scene.camera("Scanner").unwrap().pose;
    assert!((scanner.orientation * DVec3::X - DVec3::X).length() < 1e-9);
}

#[test]
fn same_seed_same_bytes() {
    let one = Indoor::default().scene(1).unwrap();
    assert_eq!(one.bytes(), Indoor::default().scene(1).unwrap().bytes());
    assert_ne!(one.bytes(), Indoor::default().scene(2).unwrap().bytes());
    let text = serde_json::to_string(&Indoor::default()).unwrap();
    assert_eq!(serde_json::from_str::<Indoor>(&text).unwrap(), Indoor::default());
    assert!(serde_json::from_str::<Indoor>("{\"room\": 3}").unwrap_err().to_string().contains("unknown field"));
}

#[test]
fn furniture_stands_on_the_floor_and_apart() {
    let mut kinds = HashSet::new();
    for seed in 0..12 {
        let indoor =
            Indoor { rooms: [3, 2], room_m: [3.5 + 0.3 * seed as f64, 4.0], mirrors: 6, panes: 6, ..Indoor::default() };
        let scene = load(&indoor, seed);
        let mut all = Vec::new();
        for category in FURNITURE.iter().chain(&["wall", "door", "mirror", "partition"]) {
            for object in of_category(&scene, category) {
                all.push((*category, object.name.as_str(), extent(object)));
            }
        }
        let fixed = |category: &str| !FURNITURE.contains(&category);
        for (index, (category, name, [low, high])) in all.iter().enumerate() {
            if !fixed(category) {
                kinds.insert(*category);
                assert!(low.z.abs() < 1e-6 || *category == "tv" && (low.z - 0.5).abs() < 1e-6, "{name} at {low}");
            }
            for (other_category, other, [other_low, other_high]) in &all[index + 1..] {
                if fixed(category) && fixed(other_category) {
                    continue;
                }
                let gap = (*low - *other_high).max(*other_low - *high).max_element();
                // Boxes of walls reach across their openings; objects in a room are beside them in any case.
                assert!(gap > -1e-6, "seed {seed}: {name} {other} {gap}");
            }
        }
        for number in 1..=6 {
            let camera = scene.camera(&format!("Camera_{number}")).unwrap().pose.position;
            for (_, name, [low, high]) in &all {
                assert!(!(camera.cmpgt(*low) & camera.cmplt(*high)).all(), "seed {seed}: a camera in {name}");
            }
        }
    }
    assert_eq!(kinds.len(), FURNITURE.len(), "{kinds:?}");
}

#[test]
fn every_room_can_be_reached() {
    // A person 1.2 m tall can pass through the middle of each door: nothing but frame and leaf is near.
    for seed in 0..6 {
        let scene = load(&Indoor { rooms: [3, 3], mirrors: 9, panes: 9, ..Indoor::default() }, seed);
        let frames: Vec<&Object> =
            of_category(&scene, "door").into_iter().filter(|door| !door.name.ends_with("Leaf")).collect();
        // At least those of a tree of nine rooms, and the one to the outside.
        assert!(frames.len() >= 9, "{}", frames.len());
        for frame in frames {
            let [low, high] = extent(frame);
            let middle = (low + high) / 2.0;
            for object in &scene.objects {
                let category = scene.labels.category.name(object.category_id).unwrap();
                if FURNITURE.contains(&category) || category == "partition" {
                    let [a, b] = extent(object);
                    let away = (a - middle).max(middle - b).truncate().max_element();
                    assert!(away > 0.5, "seed {seed}: {} is {away} m from {}", object.name, frame.name);
                }
            }
        }
    }
}

#[test]
fn mirrors_show_what_is_before_them_and_panes_let_light_through() {
    let scene = load(&Indoor { rooms: [2, 1], panes: 2, furniture: 0.3, ..Indoor::default() }, 1);
    let [mirror, pane] = ["mirror", "partition"].map(|name| scene.labels.category.id(name));
    let pose = Pose { position: scene.camera("Scanner").unwrap().pose.position, ..Pose::at(0.0, 0.0, 0.0) };
    let built = scene.build().unwrap();
    let sensor = Sensor::preset("velodyne_vlp32c").unwrap();
    let fields = FieldSet::parse("default,category_id,first_category_id,cause").unwrap();
    let options = ScanOptions::default().fields(fields);
    let columns = built.scan(&sensor, &Trajectory::fixed(pose), &options).unwrap().columns;
    let seen = |cause: u8, first: u32| {
        let rows = columns.cause.iter().zip(&columns.first_category_id).zip(&columns.category_id);
        // There are other objects in the mirror and behind the pane.
        rows.filter(|((c, f), id)| (**c, **f) == (cause, first) && ![0, first].contains(*id)).count()
    };
    assert!(seen(1, mirror) > 500, "{}", seen(1, mirror));
    assert!(seen(2, pane) > 1000, "{}", seen(2, pane));
}

#[test]
fn options_do_what_they_say() {
    let empty = Indoor { furniture: 0.0, mirrors: 0, panes: 0, ceiling: false, rooms: [1, 1], ..Indoor::default() };
    let made = empty.scene(1).unwrap();
    let names: Vec<&str> = made.categories.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["wall", "door", "window", "floor"]);
    let pieces = |furniture: f64| {
        let scene = load(&Indoor { furniture, ..Indoor::default() }, 5);
        FURNITURE.iter().map(|category| of_category(&scene, category).len()).sum::<usize>()
    };
    assert!(pieces(0.3) > 0 && pieces(0.3) < pieces(0.7) && pieces(0.7) < pieces(1.0));
    let large = load(&Indoor { rooms: [1, 1], room_m: [20.0, 20.0], ..Indoor::default() }, 5);
    assert!(large.objects.len() > 60, "{}", large.objects.len());
}

#[test]
fn bad_parameters_are_named() {
    let usual = Indoor::default;
    for (indoor, says) in [
        (Indoor { rooms: [0, 1], ..usual() }, "rooms is 0; allowed: 1 to 10"),
        (Indoor { rooms: [2, 11], ..usual() }, "rooms is 11"),
        (Indoor { room_m: [2.9, 4.0], ..usual() }, "room_m is 2.9; allowed: 3 to 20"),
        (Indoor { room_m: [4.0, f64::NAN], ..usual() }, "room_m is NaN"),
        (Indoor { height_m: 2.2, ..usual() }, "height_m is 2.2; allowed: 2.3 to 6"),
        (Indoor { furniture: 1.1, ..usual() }, "furniture is 1.1; allowed: 0 to 1"),
        (Indoor { mirrors: 101, ..usual() }, "mirrors is 101; allowed: 0 to 100"),
        (Indoor { panes: 101, ..usual() }, "panes is 101; allowed: 0 to 100"),
    ] {
        let error = indoor.scene(0).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}
