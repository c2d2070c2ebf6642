use super::*;
use engine::trace::{Engine, LiveScene};
use glam::{DQuat, DVec3};
use ground::error::Result;
use ground::shown;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// A box in OBJ, from `low` to `high`.
fn cuboid(name: &str, material: &str, low: [f64; 3], high: [f64; 3], first: &mut usize) -> String {
    let mut text = format!("o {name}\nusemtl {material}\n");
    for k in 0..8 {
        let at = |axis: usize| if k >> axis & 1 == 0 { low[axis] } else { high[axis] };
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        let corners = face.map(|corner| (corner + *first + 1).to_string());
        text += &format!("f {}\n", corners.join(" "));
    }
    *first += 8;
    text
}

/// A floor of 20 m, a wall across it at x = 3, a slope at its end, six chairs; and two models.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut first = 0;
    let mut room = cuboid("Floor", "wood", [-10.0, -10.0, -0.1], [10.0, 10.0, 0.0], &mut first);
    room += &cuboid("Wall", "paint", [3.0, -10.0, 0.0], [3.2, 10.0, 2.5], &mut first);
    for k in 0..6 {
        let x = -8.0 + 1.5 * f64::from(k);
        room += &cuboid(&format!("Chair_{k}"), "plastic", [x, 0.0, 0.0], [x + 0.5, 0.5, 0.9], &mut first);
    }
    room += "o Slope\nusemtl grass\nv 10 -10 0\nv 30 -10 10\nv 30 10 10\nv 10 10 0\nf 57 58 59 60\nf 57 59 60\n"
        .replace("57 58 59 60\nf ", &format!("{0} {1} {2}\nf ", first + 1, first + 2, first + 3))
        .replace("57 59 60", &format!("{} {} {}", first + 1, first + 3, first + 4))
        .as_str();
    fs::write(folder.path().join("room.obj"), room).unwrap();
    fs::create_dir(folder.path().join("models")).unwrap();
    for (name, size) in [("crate", [1.0, 0.6, 0.4]), ("pole", [0.1, 0.1, 2.0])] {
        let half = [size[0] / 2.0, size[1] / 2.0];
        let text = cuboid(name, "metal", [-half[0], -half[1], -0.2], [half[0], half[1], size[2] - 0.2], &mut 0);
        fs::write(folder.path().join("models").join(format!("{name}.obj")), text).unwrap();
    }
    fs::write(folder.path().join("models/readme.txt"), "no model").unwrap();
    folder
}

fn scenario(folder: &TempDir, rest: &str) -> Result<Scenario> {
    let text = format!(
        "scene: {{files: room.obj, labels: {{objects: {{\"Chair_*\": chair}}}}}}\n\
         sensors: [{{sensor: velodyne_vlp16, name: top}}]\ntrajectory: {{position_m: [0, -5, 1.5]}}\nsamples: 1000\n{rest}"
    );
    Ok(Scenario::from_yaml(&text, folder.path())?.with_engine(&Engine::with_threads(1).unwrap()))
}

fn rules(rules: &str) -> (TempDir, Scenario) {
    let folder = folder();
    let scenario = scenario(&folder, &format!("variation:\n{rules}")).unwrap();
    (folder, scenario)
}

/// Names of all objects that match, with the centres of their boxes and their lowest and highest points.
fn places(live: &LiveScene, pattern: &str) -> Vec<(String, DVec3, f64, f64)> {
    let fits = |name: &str| engine::scene::matches(pattern, name);
    let named = |number: u32| live.labels().instance.name(number).unwrap_or_default().to_owned();
    live.objects()
        .map(|(_, object)| (named(object.instance_id), object))
        .filter(|(name, _)| fits(name))
        .map(|(name, object)| {
            let corners = model::corners(object.mesh.bounds().unwrap(), &object.world_from_object);
            let middle = corners.iter().sum::<DVec3>() / 8.0;
            let heights = corners.map(|corner| corner.z);
            let (low, high) = heights.iter().fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(*z), b.max(*z)));
            (name, middle, low, high)
        })
        .collect()
}

#[test]
fn an_added_rule_changes_no_other_draw() {
    let chairs = "  - move: \"Chair_*\"\n    by_m: [{normal: [0, 0.2]}, {uniform: [-1, 1]}, 0]\n    turn_deg: {uniform: [0, 360]}\n";
    let (_a, alone) = rules(chairs);
    let (_b, among) = rules(
        &format!(
            "  - remove: Wall\n  - set: seed_of_nothing\n    to: 1\n{chairs}  - place: models\n    at: {{on: Floor}}\n"
        )
        .replace(
            "  - set: seed_of_nothing\n    to: 1\n",
            "  - set: environment.clear_air\n    to: {choice: [{visibility_m: 5000}]}\n",
        ),
    );
    for index in [0, 1, 17, 999] {
        let [a, b] = [&alone, &among].map(|scenario| places(scenario.sample(index).unwrap().scene(), "Chair_*"));
        assert_eq!(a, b);
    }
    // In any order, repeatedly.
    let again: Vec<_> =
        [5, 3, 5].map(|index| places(alone.sample(index).unwrap().scene(), "Chair_*")).into_iter().collect();
    assert_eq!(again[0], again[2]);
    assert_ne!(again[0], again[1]);
}

#[test]
fn drawn_values_are_reported() {
    let (_folder, scenario) = rules(
        "  - {remove: \"Chair_*\", chance: 0.5}\n  - {swap: Chair_3, with: models/crate.obj}\n\
         \x20 - {set: environment.rain.rate_mm_h, to: {uniform: [5, 20]}, name: shower}\n",
    );
    let sample = scenario.sample(4).unwrap();
    let drawn = sample.drawn();
    assert_eq!(drawn[0]["rule"], "shower");
    let rate = drawn[0]["value"].as_f64().unwrap();
    let rain = &sample.scans()[0].options(0).environment.rain;
    assert!((5.0..20.0).contains(&rate) && serde_json::to_value(rain).unwrap()[0]["rate_mm_h"] == json!(rate));
    let removed = drawn.iter().filter(|entry| entry["rule"] == "remove Chair_*").count();
    assert_eq!(places(sample.scene(), "Chair_*").len(), 6 - removed);
    let kept: usize = (0..200).map(|k| places(scenario.sample(k).unwrap().scene(), "Chair_*").len()).sum();
    assert!((500..700).contains(&kept), "{kept}");
}

#[test]
fn models_stand_on_their_surface_and_clear_of_others() {
    let (_folder, scenario) = rules(
        "  - place: [models/crate.obj, {value: models/pole.obj, weight: 3}]\n    call: thing\n    category: clutter\n\
         \x20   count: {uniform: [5, 12]}\n    at: {on: {category: Floor}}\n    turn_deg: {uniform: [0, 360]}\n\
         \x20   scale: {uniform: [0.8, 1.2]}\n    clearance_m: 0.2\n",
    );
    let mut poles = 0;
    for index in 0..20 {
        let sample = scenario.sample(index).unwrap();
        let things = places(sample.scene(), "thing_*");
        assert!((5..=12).contains(&things.len()));
        let others: Vec<_> = ["Chair_*", "Wall"].iter().flat_map(|it| places(sample.scene(), it)).collect();
        for (k, (name, middle, low, high)) in things.iter().enumerate() {
            assert!(low.abs() < 1e-3, "{name} stands at {low}");
            poles += usize::from(high - low > 1.0);
            assert!(middle.x.abs() < 10.0 && middle.y.abs() < 10.0);
            // A lower bound: the clearance plus half of their smallest sizes.
            for (other, there, ..) in things[..k].iter().chain(others.iter().filter(|other| other.0 != "Wall")) {
                assert!(middle.truncate().distance(there.truncate()) > 0.2 + 0.1, "{name} and {other}");
            }
            assert!((middle.x - 3.1).abs() > 0.1 + 0.2 + 0.04, "{name} stands in the wall");
        }
        let object = sample.scene().objects().find(|(_, object)| object.name == "crate" || object.name == "pole");
        let category = object.unwrap().1.category_id;
        assert_eq!(sample.scene().labels().category.name(category), Some("clutter"));
        // Each is an instance of its own.
        let mut numbers: Vec<u32> = sample.scene().objects().map(|(_, object)| object.instance_id).collect();
        numbers.sort_unstable();
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]));
    }
    assert!(poles > 60, "{poles}");
}

#[test]
fn objects_drop_and_align_with_the_slope() {
    let (_folder, scenario) = rules(
        "  - {place: models/pole.obj, call: up, at: {on: Slope}}\n\
         \x20 - {place: models/crate.obj, call: flat, at: {on: Slope}, align: slope, clearance_m: 0.3}\n\
         \x20 - {place: models/crate.obj, call: fallen, at: {within: {min_m: [11, -5, 30], max_m: [25, 5, 40]}}, drop: true}\n\
         \x20 - {move: Chair_0, by_m: [20, 0, 6], drop: true}\n\
         \x20 - {move: Chair_0, name: up, by_m: [1, 0, 0.5], clearance_m: 0.1}\n",
    );
    let ground = |at: DVec3| 0.5 * (at.x - 10.0);
    for index in 0..30 {
        let sample = scenario.sample(index).unwrap();
        assert!(sample.report().warnings.iter().all(|warning| !warning.contains("no room")), "{:?}", sample.report());
        let at = |name: &str| places(sample.scene(), name)[0].clone();
        let (_, pole, low, high) = at("up_1");
        assert!((low - ground(pole)).abs() < 1e-3 && (high - low - 2.0).abs() < 1e-6);
        let (_, crate_, ..) = at("flat_1");
        // Half of its height above the slope, along the normal.
        assert!(((crate_.z - ground(crate_)) / 1.25_f64.sqrt() - 0.2).abs() < 1e-3);
        let (_, fallen, low, _) = at("fallen_1");
        let others = (low - ground(fallen)).abs() > 1e-3;
        assert!(!others || low > ground(fallen), "{low}");
        let (_, chair, low, _) = at("Chair_0");
        assert!((low - ground(chair)).abs() < 1e-3 && (chair.x - 13.25).abs() < 1e-6);
    }
}

/// An upright box on a slope reaches into the slope, and into nothing else.
#[test]
fn things_on_a_slope_stand_clear_of_each_other() {
    let (_folder, scenario) =
        rules("  - {place: models/crate.obj, call: it, count: 60, at: {on: Slope}, clearance_m: 0.1}\n");
    for index in 0..5 {
        let there = places(scenario.sample(index).unwrap().scene(), "it_*");
        assert!(there.len() > 40);
        for (k, (name, middle, ..)) in there.iter().enumerate() {
            for (other, at, ..) in &there[..k] {
                let apart = (*middle - *at).abs() - DVec3::new(1.0, 0.6, 0.4) + 1e-6;
                // The lowest 2 cm may reach into other objects.
                assert!(apart.cmpge(DVec3::new(0.1, 0.1, -0.02)).any(), "{name} and {other}: {apart}");
            }
        }
    }
}

#[test]
fn tipped_objects_stand_on_their_side() {
    let (_folder, scenario) = rules(
        "  - {place: models/crate.obj, call: side, at: {on: Floor}, turn_deg: [90, 0, 20]}\n\
         \x20 - {place: models/pole.obj, call: lying, at: {on: Slope}, turn_deg: [0, 90, {uniform: [0, 360]}], align: slope}\n\
         \x20 - {move: Chair_0, turn_deg: [0, 30, 0], drop: true}\n",
    );
    let sample = scenario.sample(3).unwrap();
    assert!(sample.report().warnings.iter().all(|warning| !warning.contains("no room")), "{:?}", sample.report());
    let at = |name: &str| places(sample.scene(), name)[0].clone();
    let (_, _, low, high) = at("side_1");
    assert!(low.abs() < 1e-6 && (high - 0.6).abs() < 1e-6, "{low} {high}");
    let (_, pole, ..) = at("lying_1");
    // Half of its width above the slope, along the normal.
    assert!(((pole.z - 0.5 * (pole.x - 10.0)) / 1.25_f64.sqrt() - 0.05).abs() < 1e-3);
    let (_, _, low, high) = at("Chair_0");
    assert!(low.abs() < 1e-6 && (high - (0.9 * 30_f64.to_radians().cos() + 0.25)).abs() < 1e-6, "{low} {high}");
}

#[test]
fn lack_of_room_is_reported_or_fails() {
    let rule = |otherwise: &str| {
        format!(
            "  - {{place: models/pole.obj, at: {{on: Floor}}, count: 3, clearance_m: 30, tries: 5, otherwise: {otherwise}}}\n"
        )
    };
    let (_a, skip) = rules(&rule("skip"));
    let sample = skip.sample(0).unwrap();
    let notes: Vec<_> = sample.report().warnings.iter().filter(|note| note.contains("no room")).collect();
    assert_eq!(notes[0], "variation[0]: no room for \"pole_1\" in 5 tries: left out");
    assert_eq!((notes.len(), places(sample.scene(), "pole_*").len()), (3, 0));
    let (_b, fail) = rules(&rule("fail"));
    let error = fail.sample(0).unwrap_err().to_string();
    assert!(
        error.starts_with("variation[0] is a rule that finds no room for \"pole_1\" in 5 tries; allowed: "),
        "{error}"
    );
}

#[test]
fn swapped_objects_keep_place_name_and_category() {
    let (_folder, scenario) =
        rules("  - {swap: {category: chair}, with: models, fit: true}\n  - {move: Chair_2, by_m: [0, 2, 0]}\n");
    let base = places(rules("").1.sample(0).unwrap().scene(), "Chair_*");
    let sample = scenario.sample(3).unwrap();
    let now = places(sample.scene(), "Chair_*");
    assert_eq!(now.len(), 6);
    for (name, middle, low, high) in &now {
        let (_, before, ..) = base.iter().find(|(known, ..)| known == name).unwrap();
        let by = if name == "Chair_2" { 2.0 } else { 0.0 };
        assert!((middle.truncate() - before.truncate() - by * glam::DVec2::Y).length() < 1e-6);
        assert!(low.abs() < 1e-6 && (high - 0.9).abs() < 1e-6);
    }
    let chair = sample.scene().labels().category.id("chair");
    assert_eq!(sample.scene().objects().filter(|(_, object)| object.category_id == chair).count(), 6);
}

/// A car of the generated street has wheels, which are objects of their own and turn while it drives.
#[test]
fn children_move_with_their_node() {
    let text = "scene: {generate: {street: {}}}\nsensors: [{sensor: velodyne_vlp16}]\ntrajectory: {camera: Corner}\n\
                samples: 10\nvariation:\n  - {move: \"Car_*\", by_m: [{uniform: [1, 3]}, 0, {uniform: [1, 2]}]}\n";
    let scenario = Scenario::from_yaml(text, "").unwrap().with_engine(&Engine::with_threads(1).unwrap());
    let plain = Scenario::from_yaml(text.split("variation").next().unwrap(), "").unwrap();
    let (mut sample, mut before) = (scenario.sample(3).unwrap(), plain.sample(3).unwrap());
    assert_eq!(sample.drawn().len(), 6, "{:?}", sample.drawn());
    for time in [0.0, 2.5] {
        sample.built_at(time, 0.1).unwrap();
        before.built_at(time, 0.1).unwrap();
        let there = |sample: &Sample, name: &str| -> Vec<DVec3> {
            let part = format!("_of_{name}");
            let named = sample.scene().objects().filter(|(_, it)| it.name == name || it.name.ends_with(&part));
            named.map(|(_, object)| object.world_from_object.translation).collect()
        };
        for entry in sample.drawn() {
            let name = entry["object"].as_str().unwrap();
            let by: Vec<f64> = entry["moved_m"].as_array().unwrap().iter().map(|it| it.as_f64().unwrap()).collect();
            let (now, then) = (there(&sample, name), there(&before, name));
            assert!(now.len() >= 5 && now.len() == then.len(), "{name}");
            for (now, then) in now.iter().zip(&then) {
                assert!((*now - *then - DVec3::from_slice(&by)).length() < 1e-9, "{name} at {time}");
            }
        }
    }
}

#[test]
fn looks_change_what_is_seen_without_building() {
    let (_folder, scenario) = rules(
        "  - {look: plastic, reflectance: {uniform: [0.1, 0.9]}, of: \"Chair_*\"}\n  - {look: wood, reflectance: 0.25, wetness: 1}\n",
    );
    let mut sample = scenario.sample(2).unwrap();
    let built = sample.built(0, 0).unwrap();
    let drawn: Vec<f64> = sample.drawn().iter().filter_map(|entry| entry["reflectance"].as_f64()).collect();
    assert_eq!(drawn.len(), 7);
    assert!((0..6).all(|k| !drawn[..k].contains(&drawn[k])));
    let materials = built.materials();
    let of = |name: &str| -> Vec<f32> {
        let named = materials.iter().filter(|material| material.name == name);
        let value = |material: &Arc<model::material::Material>| match material.reflectance {
            Some(model::material::Reflectance::Constant(value)) => value,
            _ => f32::NAN,
        };
        named.map(value).collect()
    };
    let seen = of("plastic");
    assert!(seen.len() == 6 && seen.iter().all(|value| drawn.iter().any(|it| (*it as f32 - value).abs() < 1e-6)));
    let wet = of("wood");
    assert!(wet.len() == 1 && wet[0] > 0.12 && wet[0] < 0.18, "{wet:?}");
}

#[test]
fn rigs_scan_at_their_own_rates_from_their_own_places() {
    let folder = folder();
    fs::write(
        folder.path().join("drive.txt"),
        "0 0 -8 1 0 0 0 1\n2 4 -8 1 0 0 0.7071067811865476 0.7071067811865476\n",
    )
    .unwrap();
    let text = "scene: {files: room.obj}\nseed: 3\ntrajectory: {file: drive.txt}\nframes: {last: 9, fps: 10}\nsensors:\n\
                \x20 - {name: top, sensor: velodyne_vlp16, mount: {position_m: [1, 0, 0.5], rpy_deg: [0, 10, 0]}, set: {range.max_m: 30}}\n\
                \x20 - {name: side, sensor: velodyne_vlp16, mount: {position_m: [0, 1, 0]}, rate_hz: 5, start_s: 0.05, set: {noise: {range_sigma_m: 0}}}\n";
    let scenario = Scenario::from_yaml(text, folder.path()).unwrap().with_engine(&Engine::with_threads(1).unwrap());
    let mut sample = scenario.sample(0).unwrap();
    let [top, side] = sample.scans() else { panic!() };
    assert_eq!((top.name(), top.frames().len(), side.frames().len()), ("top", 10, 5));
    assert_eq!(side.frames()[2], FrameTime { number: 2, start: 0.05 + 0.4 });
    assert_eq!((top.options(0).seed, top.options(3).frame), (3, 3));
    assert_ne!(side.options(0).seed, 3);
    assert_eq!((top.sensor().spec().range.max_m, side.sensor().spec().noise.range_sigma_m), (Some(30.0), 0.0));
    // On the arc of the lever, everywhere.
    let carrier = emitter::Trajectory::load(folder.path().join("drive.txt")).unwrap();
    for k in 0..=200 {
        let time = f64::from(k) / 100.0;
        let (on, own) = (carrier.at(time), top.trajectory().at(time));
        assert!(own.position.distance(on.position + on.orientation * DVec3::new(1.0, 0.0, 0.5)) < 1e-4);
        let turned = on.orientation * DQuat::from_rotation_y(10f64.to_radians());
        assert!(own.orientation.angle_between(turned) < 1e-6);
    }
    let clouds = [sample.cloud(0, 9).unwrap(), sample.cloud(1, 4).unwrap()];
    assert!(clouds.iter().all(|cloud| cloud.len > 1000));
}

#[test]
fn carriers_stand_on_surfaces() {
    let folder = folder();
    let text = "scene: {files: room.obj}\nsensors: [{sensor: velodyne_vlp16}]\nsamples: 50\n\
                trajectory: {on: Floor, height_m: {uniform: [1, 2]}, turn_deg: {uniform: [0, 360]}, clearance_m: 0.4}\n";
    let scenario = Scenario::from_yaml(text, folder.path()).unwrap().with_engine(&Engine::with_threads(1).unwrap());
    for index in 0..50 {
        let sample = scenario.sample(index).unwrap();
        let pose = sample.scans()[0].trajectory().at(0.0);
        assert!(pose.position.x.abs() <= 10.0 && (1.0..2.0).contains(&pose.position.z));
        assert!((pose.position.x - 3.1).abs() > 0.5, "{}", pose.position);
        assert_eq!(sample.drawn()[0]["rule"], "trajectory");
    }
}

#[test]
fn surfaces_are_taken_in_a_box() {
    let part = "within: {min_m: [-3, -2, -1], max_m: [-1, 0, 1]}";
    let (_folder, mut scenario) =
        rules(&format!("  - {{place: models/pole.obj, at: {{on: Floor, {part}}}, overlap: true}}\n"));
    scenario.set("trajectory", &format!("{{on: Floor, {part}}}")).unwrap();
    let holds = |at: DVec3| (-3.0..=-1.0).contains(&at.x) && (-2.0..=0.0).contains(&at.y);
    for index in 0..40 {
        let sample = scenario.sample(index).unwrap();
        assert!(holds(sample.scans()[0].trajectory().at(0.0).position) && holds(places(sample.scene(), "pole_1")[0].1));
    }
    scenario.set("trajectory.within.min_m[2]", "0.5").unwrap();
    let error = scenario.sample(0).unwrap_err().to_string();
    assert!(error.contains("no place with") && error.contains("a larger box"), "{error}");
    let error = scenario.set("trajectory.within.min_m[0]", "7").unwrap_err().to_string();
    assert!(error.contains("trajectory.within: is from 7 to -1; allowed: min_m not above max_m"), "{error}");
}

/// A job that a thread takes up while it waits for part of a scene may need the same scene.
#[test]
fn samples_are_made_on_the_threads_of_any_pool() {
    use rayon::prelude::*;
    let text = "scene: {generate: {seabed: {size_m: [20, 20]}}}\nsensors: [{sensor: velodyne_vlp16}]\nsamples: 100\n\
                trajectory: {position_m: [0, 0, 1]}\nvariation: [{set: scene.generate.seed, to: {choice: [1, 2]}}]\n";
    let scenario = Scenario::from_yaml(text, "").unwrap();
    for threads in [1, 3] {
        let scenario = Scenario::from_yaml(text, "").unwrap().with_engine(&Engine::with_threads(threads).unwrap());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        pool.install(|| {
            (0..24_u64).into_par_iter().for_each(|index| assert_eq!(scenario.sample(index).unwrap().scans().len(), 1));
        });
    }
    assert_eq!(scenario.sample(7).unwrap().scans().len(), 1);
}

#[test]
fn grids_go_through_all_values() {
    let (_folder, scenario) = rules(
        "  - {set: environment.fog, to: {grid: [{visibility_m: 50}, {visibility_m: 100}]}}\n\
         \x20 - {set: \"sensors.top.mount.position_m\", to: {grid: [[0, 0, 1], [0, 0, 2], [0, 0, 3]]}}\n",
    );
    let mut seen: Vec<String> = (0..6)
        .map(|index| {
            let sample = scenario.sample(index).unwrap();
            let height = sample.scans()[0].trajectory().at(0.0).position.z;
            format!("{:?} {height}", sample.scans()[0].options(0).environment.fog[0].what.visibility_m)
        })
        .collect();
    seen.sort();
    seen.dedup();
    assert_eq!(seen.len(), 6);
}

#[test]
fn whole_numbers_are_drawn_where_a_key_takes_them() {
    let folder = folder();
    let rules = "frames: {last: 9}\nvariation:\n  - {set: frames.first, to: {uniform: [2, 4]}}\n\
                 \x20 - {set: sensors.top.mount.position_m, to: [0, 0, {uniform: [1, 2]}]}\n\
                 \x20 - {set: environment.fog.visibility_m, to: {uniform: [80, 500]}}\n";
    let scenario = scenario(&folder, rules).unwrap();
    let drawn: Vec<Vec<Value>> = (0..30).map(|index| scenario.sample(index).unwrap().drawn().to_vec()).collect();
    let firsts: std::collections::BTreeSet<i64> = drawn.iter().map(|all| all[0]["value"].as_i64().unwrap()).collect();
    assert_eq!(firsts.into_iter().collect::<Vec<_>>(), [2, 3, 4]);
    assert!(drawn.iter().all(|all| all[2]["value"].as_f64().unwrap().fract() > 0.0));
}

#[test]
fn keys_are_changed_by_path() {
    let folder = folder();
    let mut scenario = scenario(&folder, "frames: {last: 3}\n").unwrap();
    scenario.set("frames.last", "5").unwrap();
    scenario.set("sensors.top.mount.position_m", "[0, 0, 2]").unwrap();
    scenario.set("environment", "null").unwrap();
    scenario.set("environment.rain.rate_mm_h", "3").unwrap();
    scenario.set("environment.fog", "null").unwrap();
    let sample = scenario.sample(0).unwrap();
    assert_eq!(sample.scans()[0].frames().len(), 6);
    assert_eq!(sample.scans()[0].trajectory().at(0.0).position.z, 3.5);
    let deep = "a.".repeat(300_000);
    for (key, value, fault) in [
        (deep.as_str(), "1", "sections and lists are nested deeper than 24"),
        ("frames.lats", "5", "frames.lats=5: frames.lats: unknown key \"lats\"; near: last"),
        ("sensors.left.rate_hz", "5", "sensors.left.rate_hz=5: sensors, a list of 1, has no entry called \"left\""),
        ("samples", "1000000000000", "samples=1000000000000: samples: is 1000000000000; allowed: 1 to 1000000000"),
        ("environment.rain.rate_mm_h", "-3", "rate_mm_h"),
        ("frames.last", "", "frames.last=: has no value; `null` removes a key"),
    ] {
        let error = scenario.set(key, value).unwrap_err().to_string();
        assert!(error.contains(fault), "{error}");
    }
    assert_eq!(scenario.sample(0).unwrap().scans()[0].frames().len(), 6);
}

#[test]
fn invalid_files_are_reported_with_line_and_key() {
    let folder = folder();
    fs::create_dir(folder.path().join("empty")).unwrap();
    let fault = |rest: &str| {
        let error = scenario(&folder, rest).and_then(|scenario| scenario.sample(0)).unwrap_err();
        error.to_string()
    };
    for (rest, expected_text) in [
        (
            "variation: [{place: models/pole.obj, at: {on: Floor}, count: {normal: [1.0e+30, 1]}}]",
            "variation[0].count is 9223372036854775807; allowed: 0 to 100000",
        ),
        (
            "variation: [{place: models/pole.obj, at: {on: Floor}, scale: {normal: [-1, 0]}}]",
            "variation[0].scale is -1.0; allowed: 1e-6 to 1e6",
        ),
        ("variaton: []", "line 5: variaton: unknown key \"variaton\"; near: variation"),
        ("variation: [{move: \"Chair_*\", by_m: [{uniform: [2, 1]}, 0, 0]}]", "variation[0].by_m"),
        (
            "variation: [{move: \"Cahir_*\", by_m: [1, 0, 0]}]",
            "variation[0] is object \"Cahir_*\", which matches nothing in the scene",
        ),
        ("variation: [{shuffle: \"Chair_*\"}]", "unknown key \"shuffle\""),
        (
            "variation: [{remove: Wall}, {remove: Wall}]",
            "variation[1]: is called \"remove Wall\", like an earlier rule",
        ),
        ("variation: [{place: empty, at: {on: Floor}}]", "a folder without models"),
        ("variation: [{place: none.obj, at: {on: Floor}}]", "none.obj: No such file"),
        (
            "variation: [{place: models, at: {on: Roof}}]",
            "variation[0].at.on is object \"Roof\", which matches nothing in the scene",
        ),
        (
            "variation: [{place: models, at: {on: Wall, along: [[0, 0, 0], [1, 0, 0]]}}]",
            "variation[0].at: is several places",
        ),
        ("variation: [{remove: Wall, chance: 2}]", "variation[0].chance: is 2; allowed: 0 to 1"),
        ("variation: [{set: sensors.left.rate_hz, to: 3}]", "this file cannot contain \"sensors.left.rate_hz\""),
        ("variation: [{set: environment.rain.rate_mm_h, to: -3}]", "YAML text, sample 0: environment.rain.rate_mm_h"),
        ("frames: {last: 3, first: 5}", "line 5: frames: is 5 to 3 with step 1"),
        ("outputs: 3", "line 5: outputs"),
    ] {
        let error = fault(rest);
        assert!(error.contains(expected_text), "{rest}: {error}");
    }
    let two = "scene: {files: room.obj}\nsensors: [{sensor: velodyne_vlp16}, {sensor: velodyne_vlp16}]\ntrajectory: {position_m: [0, 0, 1]}";
    let error = Scenario::from_yaml(two, folder.path()).unwrap().sample(0).unwrap_err().to_string();
    assert_eq!(
        error,
        "sensors[1] is called \"velodyne_vlp16\", like an earlier sensor; allowed: a `name` of its own for each"
    );
    // Names that no file can have.
    for name in ["x".repeat(300), String::new()] {
        let named = two.replace("}, {sensor: velodyne_vlp16}", &format!(", name: '{name}'}}"));
        let error = Scenario::from_yaml(&named, folder.path()).unwrap().sample(0).unwrap_err().to_string();
        assert!(error.contains("sensors[0].name is ") && error.contains("allowed: 1 to 200 bytes"), "{error}");
    }
}

/// Files of a folder by name, with their contents.
fn contents(root: &Path) -> std::collections::BTreeMap<String, Vec<u8>> {
    let mut all = std::collections::BTreeMap::new();
    let mut open = vec![root.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                all.insert(shown::path(path.strip_prefix(root).unwrap()), fs::read(&path).unwrap());
            }
        }
    }
    all
}

const VARIED: &str = "set: {folder: made}\nfields: [default, velocity]\n\
    outputs: [{style: plain, format: ply}, {style: semantic_kitti}]\nframes: {last: 1}\nvariation:\n\
    \x20 - {place: models, call: thing, category: car, count: {uniform: [0, 4]}, at: {on: Floor}, turn_deg: {uniform: [0, 360]}}\n\
    \x20 - {remove: \"Chair_*\", chance: 0.3}\n  - {look: wood, reflectance: {uniform: [0.1, 0.9]}}\n\
    \x20 - {set: environment.fog.visibility_m, to: {log_uniform: [50, 500]}}\n";

fn run(folder: &TempDir, rest: &str, options: &set::RunOptions) -> Result<set::RunSummary> {
    let text = format!("{}seed: 5\n", VARIED.replace("variation:\n", &format!("{rest}variation:\n")));
    set::run(scenario(folder, &text)?, options, &|_| {})
}

fn options(folder: Option<PathBuf>) -> set::RunOptions {
    set::RunOptions { folder, samples: Some([0, 13, 1]), shard: None, resume: false, threads: 1 }
}

#[test]
fn sets_are_the_same_however_they_are_made() {
    let folder = folder();
    let fourteen_of = |folder: &TempDir, options: &set::RunOptions| {
        let mut scenario = scenario(folder, &format!("{VARIED}seed: 5\n")).unwrap();
        scenario.set("samples", "14").unwrap();
        set::run(scenario, options, &|_| {}).unwrap()
    };
    let fourteen = |options: &set::RunOptions| fourteen_of(&folder, options);
    let summary = fourteen(&options(None));
    assert_eq!((summary.made, summary.found, summary.failed.len(), summary.complete), (14, 0, 0, true));
    let whole = contents(&folder.path().join("made"));
    assert!(whole["manifest.json"].len() > 1000 && whole.contains_key("report.html"));
    assert!(
        whole.contains_key("data/000013/top_0001.ply") && whole.contains_key("sequences/000000/labels/000001.label")
    );
    assert_eq!(set::check_folder(&folder.path().join("made")).unwrap(), Vec::<String>::new());

    // In another folder.
    let other = self::folder();
    fourteen_of(&other, &options(None));
    assert_eq!(contents(&other.path().join("made")), whole);

    // Seven shards, in another order, with two threads.
    let parts = folder.path().join("parts");
    for part in [6, 0, 3, 1, 2, 5, 4] {
        let shard = set::RunOptions { shard: Some([part, 7]), threads: 2, ..options(Some(parts.clone())) };
        assert_eq!(fourteen(&shard).made, 2);
    }
    assert_eq!(set::check_folder(&parts).unwrap(), Vec::<String>::new());
    set::finish(&parts).unwrap();
    assert_eq!(contents(&parts), whole);

    // With some of it lost, damaged or half written.
    let again = folder.path().join("again");
    fourteen(&set::RunOptions { samples: Some([3, 9, 2]), ..options(Some(again.clone())) });
    fs::remove_file(again.join("data/000005/top_0000.ply")).unwrap();
    fs::write(again.join("sequences/000007/times.txt"), "0\n1\n").unwrap();
    fs::write(again.join(".echocast-abc"), "half").unwrap();
    fs::create_dir(again.join("data/.000001.unfinished")).unwrap();
    fs::write(again.join("data/.000001.unfinished/top_0000.ply"), "half").unwrap();
    let log = fs::read_to_string(again.join("manifest.jsonl")).unwrap();
    fs::write(again.join("manifest.jsonl"), format!("{log}{{\"sample\":1,\"fil")).unwrap();
    let faults = set::check_folder(&again).unwrap();
    assert_eq!(faults[0], "10 of 14 samples are missing, the first is 0");
    assert!(faults[1].contains("top_0000.ply is missing") && faults[2].contains("times.txt has "), "{faults:?}");
    let refused = set::finish(&again).unwrap_err().to_string();
    assert!(refused.contains("10 of 14 samples are missing"), "{refused}");
    let summary = fourteen(&set::RunOptions { resume: true, ..options(Some(again.clone())) });
    assert_eq!((summary.made, summary.found, summary.complete), (12, 2, true));
    assert_eq!(contents(&again), whole);
}

/// A moving LiDAR and a camera, in every style.
const STYLED: &str = "scene: {files: room.obj, labels: {objects: {Floor: road, Wall: building, \"Chair_*\": car}}}\n\
    sensors:\n\
    \x20 - {name: top, sensor: velodyne_vlp16, mount: {position_m: [0, 0, 0.5]}}\n\
    \x20 - {name: eye, sensor: {name: eye, kind: lidar, pattern: {type: pinhole, resolution: [40, 30], fov_deg: [90, 70]}}, \
           mount: {position_m: [0.5, 0.1, 0], rpy_deg: [0, 10, 0]}}\n\
    trajectory: {poses: [[0, -2, -5, 1, 0, 0, 0.7071067811865476, 0.7071067811865476], \
                         [1, -2, -3, 1, 0, 0, 0.7071067811865476, 0.7071067811865476]]}\n\
    frames: {last: 6, fps: 10}\nsamples: 9\nseed: 3\nset: {splits: 60/40, licence: CC0-1.0}\n\
    outputs: [{style: plain}, {style: semantic_kitti, sensor: top}, {style: kitti, frames: 10}, {style: nuscenes}, \
              {style: webdataset, samples: 2, format: ply}]\n\
    variation:\n  - {move: \"Chair_*\", by_m: [{uniform: [-0.2, 0.2]}, 0, 0]}\n  - {remove: Chair_3, chance: 0.5}\n";

fn styled(folder: &TempDir, samples: u64, options: &set::RunOptions) -> Result<set::RunSummary> {
    let mut scenario = Scenario::from_yaml(STYLED, folder.path())?;
    scenario.set("samples", &samples.to_string())?;
    set::run(scenario, options, &|_| {})
}

#[test]
fn sets_of_every_style_grow_and_are_the_same_however_they_are_made() {
    let folder = folder();
    let in_folder = |name: &str| set::RunOptions { samples: None, ..options(Some(folder.path().join(name))) };
    let summary = styled(&folder, 9, &in_folder("whole")).unwrap();
    assert!(summary.complete && summary.failed.is_empty(), "{summary:?}");
    let whole = contents(&folder.path().join("whole"));
    for name in [
        "README.md",
        "files.json",
        "splits/train.txt",
        "kitti/training/label_2/000086.txt",
        "kitti/training/semantic/000086.png",
        "kitti/training/instance/000086.png",
        "kitti/ImageSets/val.txt",
        "nuscenes/v1.0-echocast/sample_annotation.json",
        "webdataset/train-000000.tar",
        "webdataset/val-000000.tar",
    ] {
        assert!(whole.contains_key(name), "{name}");
    }
    assert!(!whole.keys().any(|name| name.starts_with("webdataset/.")), "archives have all of the samples");
    let faults = |name: &str| set::check_folder(&folder.path().join(name)).unwrap();
    assert_eq!(faults("whole"), [""; 0]);

    // Shards, the last first.
    for part in [2, 0, 1] {
        let shard = set::RunOptions { shard: Some([part, 3]), threads: 2, ..in_folder("parts") };
        assert_eq!(styled(&folder, 9, &shard).unwrap().made, 3);
    }
    set::finish(&folder.path().join("parts")).unwrap();
    assert!(contents(&folder.path().join("parts")) == whole);
    // Repeating it changes nothing.
    set::finish(&folder.path().join("parts")).unwrap();
    assert!(contents(&folder.path().join("parts")) == whole);

    // Grown in two steps.
    styled(&folder, 4, &in_folder("grown")).unwrap();
    let few = contents(&folder.path().join("grown"));
    let resumed = || set::RunOptions { resume: true, ..in_folder("grown") };
    assert_eq!(styled(&folder, 7, &resumed()).unwrap().found, 4);
    // A run that was killed when it had only to remove what it no longer needed.
    fs::write(folder.path().join("grown/webdataset/.pieces/000002.tar"), "old").unwrap();
    fs::write(folder.path().join("grown/nuscenes/v1.0-echocast/.echocast-abc"), "half").unwrap();
    assert_eq!(styled(&folder, 9, &resumed()).unwrap().found, 7);
    let grown = contents(&folder.path().join("grown"));
    let different: Vec<_> = whole.keys().filter(|name| grown.get(*name) != whole.get(*name)).collect();
    assert!(different.is_empty() && grown.len() == whole.len(), "{different:?}");
    // Samples stay in their split.
    for part in ["train", "val"] {
        let lines = |all: &std::collections::BTreeMap<String, Vec<u8>>| {
            String::from_utf8(all[&format!("splits/{part}.txt")].clone()).unwrap()
        };
        assert!(lines(&whole).starts_with(&lines(&few)), "{part}");
    }

    // Damage is found and repaired.
    let root = folder.path().join("grown");
    for (name, words) in [
        ("webdataset/train-000000.tar", "webdataset/train-000000.tar has other contents"),
        ("nuscenes/.pieces/000001.txt", "nuscenes/.pieces/000001.txt has"),
        ("nuscenes/v1.0-echocast/scene.json", "nuscenes/v1.0-echocast/scene.json has other contents"),
        ("kitti/training/label_2/000013.txt", "label_2/000013.txt is missing"),
        ("README.md", "README.md has other contents"),
    ] {
        let path = root.join(name);
        match words.ends_with("missing") {
            true => fs::remove_file(&path).unwrap(),
            false => {
                let mut bytes = fs::read(&path).unwrap();
                let middle = bytes.len() / 3;
                bytes[middle] ^= 1;
                fs::write(&path, bytes).unwrap();
            }
        }
        let said = faults("grown").join("\n");
        assert!(said.contains(words), "{name}: {said}");
        styled(&folder, 9, &resumed()).unwrap();
        assert!(contents(&root) == whole, "{name}");
    }
}

#[test]
fn labels_of_kitti_are_what_its_camera_sees() {
    let folder = folder();
    let made = folder.path().join("made");
    styled(&folder, 1, &set::RunOptions { samples: None, ..options(Some(made.clone())) }).unwrap();
    let read = |name: &str| fs::read_to_string(made.join("kitti/training").join(name)).unwrap();
    let numbers = |line: &str| -> Vec<f64> { line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect() };
    let text = read("calib/000003.txt");
    let matrix = |name: &str| numbers(text.lines().find(|line| line.starts_with(name)).unwrap());
    let (camera, to_camera) = (matrix("P2:"), matrix("Tr_velo_to_cam:"));
    // The camera is 0.5 m ahead of the LiDAR, 0.1 m to its left and 0.5 m below it, and looks down by 10 degrees.
    let (sin, cos) = 10_f64.to_radians().sin_cos();
    let expected =
        [[0.0, -1.0, 0.0, 0.1], [-sin, 0.0, -cos, 0.5 * sin - 0.5 * cos], [cos, 0.0, -sin, -0.5 * cos - 0.5 * sin]];
    for (found, expected) in to_camera.iter().zip(expected.as_flattened()) {
        assert!((found - expected).abs() < 1e-9, "{to_camera:?}");
    }
    assert!((camera[0] - 20.0).abs() < 1e-9 && camera[2] == 19.5 && camera[6] == 14.5);

    let labels = read("label_2/000003.txt");
    assert!(labels.lines().count() >= 2, "{labels}");
    let scenario = Scenario::from_yaml(STYLED, folder.path()).unwrap();
    let mut sample = scenario.sample(0).unwrap();
    let mut cloud = cloud::PointCloud::default();
    sample.piece_into(1, [3, 0], cloud::FieldSet::all(), sample::BoxScope::None, &mut cloud).unwrap();
    // The pixels of each chair are in its box, and one of them touches each side that is not hidden.
    let mut matched = 0;
    // Chairs that only the LiDAR hits have none.
    let seen = || labels.lines().filter(|line| numbers(line)[1] < 3.0);
    for line in seen() {
        assert!(line.starts_with("Car "));
        let label = numbers(line);
        let (rect, size, turned) = (&label[3..7], &label[7..10], label[13]);
        assert!((size[0] - 0.9).abs() < 1e-3 && (size[1] - 0.5).abs() < 1e-3 && (size[2] - 0.5).abs() < 1e-3);
        // The chairs' x axis points to the right when looking along y.
        assert!(turned.abs() < 1e-3, "{line}");
        assert!((label[2] - (turned - label[10].atan2(label[12]))).abs() < 2e-4, "{line}");
        let inside = (0..cloud.len).filter(|&row| {
            let [column, line] = [cloud.columns.beam[row] % 40, cloud.columns.beam[row] / 40].map(f64::from);
            let chair = cloud.labels.category.name(cloud.columns.category_id[row]) == Some("car");
            let across = rect[0] - 0.5 <= column && column <= rect[2] + 0.5;
            chair && across && rect[1] - 0.5 <= line && line <= rect[3] + 0.5
        });
        matched += usize::from(inside.count() >= 4);
    }
    assert_eq!(matched, seen().count(), "{labels}");
}

/// A third sensor, which scans twice as often; objects that only the LiDAR hits.
#[test]
fn kitti_leaves_out_sensors_and_nothing_that_a_sensor_sees() {
    let folder = folder();
    let side = "  - {name: side, sensor: velodyne_vlp16, rate_hz: 20}\ntrajectory:";
    let text = STYLED.replace("trajectory:", side);
    let from = text.find("outputs:").unwrap();
    let until = text.find("variation:").unwrap();
    let lines = |rest: &str, name: &str| {
        let outputs = format!("outputs: [{{style: kitti, velodyne: top, frames: 10{rest}}}]\n");
        let text = format!("{}{outputs}{}", &text[..from], &text[until..]);
        let scenario = Scenario::from_yaml(&text, folder.path()).unwrap();
        let made = folder.path().join(name);
        let first = set::RunOptions { samples: Some([0, 0, 1]), ..options(Some(made.clone())) };
        let summary = set::run(scenario, &first, &|_| ()).unwrap();
        assert_eq!((summary.made, summary.failed), (1, Vec::new()));
        assert!(summary.warnings.iter().any(|seen| seen.warning.contains("left out: side")), "{:?}", summary.warnings);
        let read = |frame| fs::read_to_string(made.join(format!("kitti/training/label_2/{frame:06}.txt"))).unwrap();
        (0..7).map(read).collect::<Vec<_>>().concat()
    };
    let seen = lines("", "seen");
    assert!(seen.lines().count() >= 7, "{seen}");
    let all = lines(", unseen: true", "all");
    assert!(seen.lines().all(|line| all.contains(line)), "{seen}{all}");
}

#[test]
fn unsuitable_samples_are_refused_before_anything_is_written() {
    let folder = folder();
    let fault = |sensors: &str, output: &str| {
        let text = format!(
            "scene: {{files: room.obj}}\nsensors: [{sensors}]\ntrajectory: {{position_m: [0, -5, 1.5]}}\n\
             set: {{folder: made}}\noutputs: [{{{output}}}]\n"
        );
        let scenario = Scenario::from_yaml(&text, folder.path()).unwrap();
        let error = set::run(scenario, &set::RunOptions { samples: None, ..options(None) }, &|_| {}).unwrap_err();
        assert!(!folder.path().join("made").exists());
        error.to_string()
    };
    let (lidar, sonar) = ("{sensor: velodyne_vlp16}", "{sensor: mbes_400}");
    let other = "{name: b, sensor: velodyne_vlp16}";
    let eye = "{sensor: {name: eye, kind: lidar, pattern: {type: pinhole, resolution: [4, 3], fov_deg: [90, 70]}}}";
    for (sensors, output, words) in [
        (sonar.to_owned(), "style: kitti", "kitti: velodyne is missing among the sensors mbes_400; allowed: a LiDAR"),
        (sonar.to_owned(), "style: nuscenes", "nuscenes: top is missing among the sensors mbes_400; allowed: a LiDAR"),
        (
            lidar.to_owned(),
            "style: kitti",
            "kitti: camera is missing among the sensors velodyne_vlp16; allowed: a camera",
        ),
        (eye.to_owned(), "style: kitti", "velodyne is missing among the sensors eye; allowed: a LiDAR in `sensors`"),
        (
            format!("{lidar}, {other}, {eye}"),
            "style: kitti",
            "there are 2 such sensors; allowed: one of velodyne_vlp16, b",
        ),
        (
            format!("{lidar}, {eye}"),
            "style: kitti, velodyne: eye",
            "kitti: velodyne is \"eye\"; allowed: velodyne_vlp16",
        ),
        (format!("{lidar}, {eye}"), "style: kitti, frames: 0", "outputs[0].frames: is 0; allowed: 1 to 100000"),
        (
            format!("{lidar}, {eye}"),
            "style: kitti, classes: {bench: Misc}",
            "outputs[0].classes.bench: is \"Misc\"; allowed: unlabeled, static,",
        ),
        (
            format!("{lidar}, {}", eye.replace("{sensor: {", "{rate_hz: 10, start_s: 0.02, sensor: {")),
            "style: kitti",
            "kitti is of sensors that scan at other times, velodyne_vlp16 and eye; allowed: both without rate_hz",
        ),
        (lidar.to_owned(), "style: nuscenes, top: x", "nuscenes: top is \"x\"; allowed: velodyne_vlp16"),
        (lidar.to_owned(), "style: nuscenes, version: ../x", "outputs[0].version: is \"../x\"; allowed: a name of a"),
        (lidar.to_owned(), "style: webdataset, format: zip", "there is no output format named \"zip\""),
        (lidar.to_owned(), "style: webdataset, samples: 0", "outputs[0].samples: is 0; allowed: 1 or more"),
    ] {
        let error = fault(&sensors, output);
        assert!(error.contains(words) && error.len() < 500, "{output}: {error}");
    }
    let text = format!("scene: {{files: room.obj}}\nsensors: [{lidar}]\nset: {{splits: 80}}\n");
    let error = Scenario::from_yaml(&text, folder.path()).unwrap_err().to_string();
    assert!(error.contains("line 3") && error.contains("allowed: shares such as 80/10/10"), "{error}");
}

#[test]
fn the_readme_says_what_a_set_is() {
    let folder = folder();
    let made = folder.path().join("made");
    styled(&folder, 2, &set::RunOptions { samples: None, ..options(Some(made.clone())) }).unwrap();
    let text = fs::read_to_string(made.join("README.md")).unwrap();
    for words in [
        "# Set of 2 samples",
        "CC0-1.0",
        "| top | Velodyne VLP-16",
        "| eye | eye |",
        "| `intensity` | 1 |",
        "| car | ",
        "| train | ",
        "NuScenes(version='v1.0-echocast'",
        "webdataset.WebDataset('webdataset/train-000000.tar'",
        env!("CARGO_PKG_VERSION"),
        "\"seed\": 3",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    // Licence and splits may change later.
    let mut scenario = Scenario::from_yaml(STYLED, folder.path()).unwrap();
    scenario.set("samples", "2").unwrap();
    scenario.set("set", "{splits: {a: 1, b: 1}}").unwrap();
    let options = set::RunOptions { samples: None, resume: true, ..options(Some(made.clone())) };
    assert_eq!(set::run(scenario, &options, &|_| {}).unwrap().found, 2);
    let all = contents(&made);
    assert!(String::from_utf8_lossy(&all["README.md"]).contains("None specified."));
    assert!(all.contains_key("splits/a.txt") && !all.contains_key("splits/train.txt"));
    assert!(!all.contains_key("webdataset/train-000000.tar"));
    assert_eq!(set::check_folder(&made).unwrap(), [""; 0]);
    // A list that names files outside the set is rejected.
    let entry = json!([{"path": "../room.obj", "bytes": 1, "sha256": ""}]);
    fs::write(made.join("files.json"), entry.to_string()).unwrap();
    let error = set::finish(&made).unwrap_err().to_string();
    assert!(
        error.contains("names \"../room.obj\", which is not in the set") && folder.path().join("room.obj").exists()
    );
}

#[test]
fn foreign_folders_are_left_alone() {
    let folder = folder();
    let ten = set::RunOptions { samples: Some([0, 1, 1]), ..options(None) };
    run(&folder, "", &ten).unwrap();
    let before = contents(&folder.path().join("made"));
    let error = run(&folder, "", &ten).unwrap_err().to_string();
    assert!(error.contains("in which 2 of these samples are; allowed: another folder, or to go on"), "{error}");
    let error = run(&folder, "organised: true\n", &ten).unwrap_err().to_string();
    assert!(error.contains("which holds a set of another scenario"), "{error}");
    fs::create_dir(folder.path().join("mine")).unwrap();
    fs::write(folder.path().join("mine/letter.txt"), "dear").unwrap();
    let other = set::RunOptions { folder: Some(folder.path().join("mine")), ..ten.clone() };
    let error = run(&folder, "", &other).unwrap_err().to_string();
    assert!(error.contains("which holds other files; allowed: an empty or a new folder"), "{error}");
    // A set belongs to one scene.
    let room = fs::read_to_string(folder.path().join("room.obj")).unwrap();
    fs::write(folder.path().join("room.obj"), room.clone() + "# painted\n").unwrap();
    let resumed = set::RunOptions { resume: true, ..ten.clone() };
    let error = run(&folder, "", &resumed).unwrap_err().to_string();
    assert!(error.contains("for which room.obj had other contents; allowed: another folder, or the"), "{error}");
    fs::write(folder.path().join("room.obj"), room).unwrap();
    assert_eq!(contents(&folder.path().join("made")), before);
    assert_eq!(run(&folder, "", &resumed).unwrap().found, 2);
    for (options, fault) in [
        (set::RunOptions { shard: Some([7, 7]), ..ten.clone() }, "shard is 7/7; allowed: 0/7 to 6/7"),
        (
            set::RunOptions { samples: Some([5, 1000, 1]), ..ten.clone() },
            "samples is 5 to 1000, every 1; allowed: 0 to 999",
        ),
    ] {
        assert!(run(&folder, "", &options).unwrap_err().to_string().starts_with(fault));
    }
}

#[test]
fn a_sample_that_fails_does_not_stop_the_others() {
    let folder = folder();
    let text = "set: {folder: made}\noutputs: [{style: plain}]\nvariation:\n\
                \x20 - {set: environment.rain.rate_mm_h, name: rate, to: {grid: [5, 5, -1]}}\n";
    let scenario = || {
        scenario(&folder, text).map(|mut scenario| {
            scenario.set("samples", "12").unwrap();
            scenario
        })
    };
    let options = set::RunOptions { samples: None, ..options(None) };
    let summary = set::run(scenario().unwrap(), &options, &|_| {}).unwrap();
    assert_eq!((summary.made, summary.failed.len()), (8, 4));
    assert_eq!(summary.failed[0].0, 2);
    assert!(summary.failed[0].1.contains("sample 2: environment.rain.rate_mm_h: is -1"), "{:?}", summary.failed[0]);
    let page = fs::read_to_string(folder.path().join("made/report.html")).unwrap();
    assert!(page.contains("4 samples have failed") && page.contains("sample 2: environment.rain"));
    // Failed samples are retried.
    let summary = set::run(scenario().unwrap(), &set::RunOptions { resume: true, ..options }, &|_| {}).unwrap();
    assert_eq!((summary.found, summary.failed.len()), (8, 4));
}

#[test]
fn sequences_of_semantic_kitti_are_as_its_readers_expect() {
    let folder = folder();
    fs::write(folder.path().join("drive.txt"), "0 0 -8 1 0 0 0 1\n1 4 -8 1 0 0 0 1\n").unwrap();
    let text = "scene: {files: room.obj, labels: {objects: {Floor: road, Wall: building, \"Chair_*\": car}}}\n\
                sensors: [{sensor: velodyne_vlp16}]\ntrajectory: {file: drive.txt}\nframes: {last: 2, fps: 10}\n\
                outputs: [{style: semantic_kitti}]\nset: {folder: made}\n";
    let scenario = Scenario::from_yaml(text, folder.path()).unwrap();
    let cloud = scenario.sample(0).unwrap().cloud(0, 1).unwrap();
    set::run(scenario, &set::RunOptions { samples: None, ..options(None) }, &|_| {}).unwrap();
    let root = folder.path().join("made/sequences/000000");
    let points = fs::read(root.join("velodyne/000001.bin")).unwrap();
    let labels = fs::read(root.join("labels/000001.label")).unwrap();
    assert_eq!((points.len(), labels.len()), (16 * cloud.len, 4 * cloud.len));
    let number = |k: usize| f32::from_le_bytes(points[4 * k..4 * k + 4].try_into().unwrap());
    for row in (0..cloud.len).step_by(97) {
        // The sensor has moved by 0.4 m when the second scan begins.
        assert!((number(4 * row) - (cloud.columns.x[row] - 0.4)).abs() < 1e-4);
        let label = u32::from_le_bytes(labels[4 * row..4 * row + 4].try_into().unwrap());
        let name = cloud.labels.category.name(cloud.columns.category_id[row]).unwrap();
        let class = [("road", 40), ("building", 50), ("car", 10)].iter().find(|(known, _)| *known == name);
        assert_eq!(label & 0xffff, class.map_or(0, |(_, class)| *class));
        assert!((1..=9).contains(&(label >> 16)));
    }
    let poses = fs::read_to_string(root.join("poses.txt")).unwrap();
    let last: Vec<f64> = poses.lines().nth(2).unwrap().split(' ').map(|number| number.parse().unwrap()).collect();
    assert!((last[3] - 0.8).abs() < 1e-9 && last[0] == 1.0 && last.len() == 12);
    assert_eq!(fs::read_to_string(root.join("times.txt")).unwrap(), "0e0\n1e-1\n2e-1\n");
}

#[test]
fn moving_objects_have_classes_of_their_own() {
    let folder = folder();
    let text = "scene: {generate: {street: {cars: 6}}}\nsensors: [{sensor: velodyne_vlp32c}]\ntrajectory: {camera: Corner}\n\
                outputs: [{style: semantic_kitti}]\nset: {folder: made}\nfields: [default, velocity]\n";
    let scenario = Scenario::from_yaml(text, folder.path()).unwrap();
    let cloud = scenario.sample(0).unwrap().cloud(0, 0).unwrap();
    set::run(scenario, &set::RunOptions { samples: None, ..options(None) }, &|_| {}).unwrap();
    let labels = fs::read(folder.path().join("made/sequences/000000/labels/000000.label")).unwrap();
    let mut seen = std::collections::BTreeMap::new();
    for (row, label) in labels.as_chunks::<4>().0.iter().enumerate() {
        let columns = &cloud.columns;
        let velocity = [columns.velocity_x[row], columns.velocity_y[row], columns.velocity_z[row]];
        let name = cloud.labels.category.name(columns.category_id[row]).unwrap();
        let class = u32::from_le_bytes(*label) & 0xffff;
        // Cars are rigid.
        if name == "car" && velocity.iter().all(|speed| speed.abs() < 0.01) {
            assert_eq!(class, 10);
        } else if name == "car" && velocity.iter().any(|speed| speed.abs() > 1.0) {
            assert_eq!(class, 252);
        }
        *seen.entry((name, class)).or_insert(0) += 1;
    }
    assert!(seen.contains_key(&("car", 252)) && seen.contains_key(&("person", 254)), "{seen:?}");
    assert!(seen.keys().all(|(name, class)| *class < 252 || ["car", "person", "bicyclist"].contains(name)), "{seen:?}");
}

/// The schema for editors has exactly the keys that are read.
#[test]
fn the_schema_has_the_keys_of_the_file() {
    let schema: Value = serde_json::from_str(include_str!("../tests/scenario.schema.json")).unwrap();
    let folder = folder();
    let fault = |text: &str| {
        let scenario = Scenario::from_yaml(text, folder.path());
        let run = scenario.and_then(|scenario| set::run(scenario, &options(Some(folder.path().join("x"))), &|_| {}));
        run.unwrap_err().to_string()
    };
    let rule = |index: usize| format!("/$defs/rule/oneOf/{index}/properties");
    let output = |index: usize| format!("/$defs/output/oneOf/{index}/properties");
    for (text, place) in [
        ("zzz: 1", "/properties".to_owned()),
        ("scene: {zzz: 1}", "/properties/scene/properties".into()),
        ("scene: {generate: {zzz: 1}}", "/properties/scene/properties/generate/properties".into()),
        ("scene: {place: [{model: a, zzz: 1}]}", "/properties/scene/properties/place/items/properties".into()),
        ("sensors: [{sensor: a, zzz: 1}]", "/$defs/sensor/properties".into()),
        ("sensors: [{sensor: a, mount: {zzz: 1}}]", "/$defs/pose/properties".into()),
        ("frames: {last: 1, zzz: 1}", "/properties/frames/properties".into()),
        ("set: {zzz: 1}", "/properties/set/properties".into()),
        ("trajectory: {on: a, zzz: 1}", "/$defs/trajectory/oneOf/5/properties".into()),
        ("trajectory: {position_m: [0, 0, 0], zzz: 1}", "/$defs/trajectory/oneOf/2/properties".into()),
        ("variation: [{set: a, to: 1, zzz: 1}]", rule(0)),
        ("variation: [{remove: a, zzz: 1}]", rule(1)),
        ("variation: [{swap: a, with: b, zzz: 1}]", rule(2)),
        ("variation: [{move: a, zzz: 1}]", rule(3)),
        ("variation: [{place: a, at: {on: b}, zzz: 1}]", rule(4)),
        ("variation: [{look: a, zzz: 1}]", rule(5)),
        ("variation: [{place: a, at: {zzz: 1}}]", "/$defs/place/properties".into()),
        ("variation: [{remove: {zzz: 1}}]", "/$defs/target/oneOf/1/properties".into()),
        ("outputs: [{style: plain, zzz: 1}]", output(0)),
        ("outputs: [{style: semantic_kitti, zzz: 1}]", output(1)),
        ("outputs: [{style: kitti, zzz: 1}]", output(3)),
        ("outputs: [{style: nuscenes, zzz: 1}]", output(4)),
        ("outputs: [{style: webdataset, zzz: 1}]", output(5)),
    ] {
        let error = fault(text);
        let allowed = error.split_once("; allowed: ").unwrap_or_else(|| panic!("{text}: {error}")).1;
        let mut allowed: Vec<&str> = allowed.split(", ").collect();
        let own = schema.pointer(&place).and_then(Value::as_object).unwrap_or_else(|| panic!("{place}"));
        // Names of rules and styles are read before the other keys.
        let mut known: Vec<&str> = own.keys().map(String::as_str).collect();
        known.retain(|key| !(*key == "style" || *key == "name" && place.contains("/rule/")));
        allowed.sort_unstable();
        known.sort_unstable();
        assert_eq!(allowed, known, "{text}");
    }
}

/// Training epochs differ only in their seed.
#[test]
fn another_seed_has_the_same_scene_and_other_draws() {
    let rule = "  - {move: \"Chair_*\", by_m: [{uniform: [-0.5, 0.5]}, 0, 0]}\n";
    let (folder, mut changed) = rules(rule);
    let ranges = |scenario: &Scenario| scenario.sample(3).unwrap().cloud(0, 0).unwrap().columns.range;
    let before = ranges(&changed);
    let stage = changed.stage().unwrap();
    changed.set("seed", "5").unwrap();
    assert!(Arc::ptr_eq(&stage, &changed.stage().unwrap()));
    let after = ranges(&changed);
    let fresh = scenario(&folder, &format!("seed: 5\nvariation:\n{rule}")).unwrap();
    assert!(after == ranges(&fresh) && after != before);
    changed.set("scene.scale", "2").unwrap();
    assert!(!Arc::ptr_eq(&stage, &changed.stage().unwrap()));
}

/// Blender reads it, elsewhere: here the scene is given.
#[test]
fn a_scene_of_blender_is_given() {
    let text = "scene: {blend: street.blend, hide: Ground}\nsensors: [{sensor: velodyne_vlp16}]\n\
                trajectory: {position_m: [0, 0, 1]}\n";
    let scenario = Scenario::from_yaml(text, "folder").unwrap();
    assert_eq!(scenario.blend(), Some("folder/street.blend".into()));
    let fault = scenario.sample(0).err().unwrap().to_string();
    assert!(fault.starts_with("scene.blend is folder/street.blend, which only Blender can read; allowed: "), "{fault}");

    let part = |z: f32| {
        let positions = vec![[-9.0, -9.0, z], [9.0, -9.0, z], [0.0, 9.0, z]];
        let part = engine::scene::Part::default().positions(positions.into()).triangles(vec![[0, 1, 2]].into());
        std::sync::Arc::new(engine::scene::Mesh::new("mesh", vec![part]).unwrap())
    };
    let mut scene = engine::scene::Scene::default();
    scene.objects = [("Ground", 0.0), ("Roof", 3.0)].map(|(name, z)| engine::scene::Object::new(name, part(z))).into();
    let mut sample = scenario.with_scene(scene.clone()).sample(0).unwrap();
    let cloud = sample.cloud(0, 0).unwrap();
    // The ground is hidden.
    assert!(!cloud.is_empty() && cloud.columns().z().iter().all(|z| (*z - 3.0).abs() < 0.2));
    for (text, allowed) in [
        ("scene: {blend: a.blend, files: b.glb}", "one of them"),
        ("scene: {blend: a.blend, labels: {numbers: {car: 1}}}", "categoryID"),
    ] {
        let scenario = Scenario::from_yaml(&format!("{text}\nsensors: [{{sensor: velodyne_vlp16}}]\n"), "").unwrap();
        let fault = scenario.with_scene(scene.clone()).sample(0).err().unwrap().to_string();
        assert!(fault.contains(allowed), "{fault}");
    }
}

/// All of a scene may be placed, and its categories have the classes of the label rules.
#[test]
fn scenes_may_be_nothing_but_models() {
    let folder = folder();
    let text = "scene:\n  place:\n    - {model: models/crate.obj, name: box, category: building, at: {position_m: [2, 0, 0]}}\n  \
                labels: {las_class: {building: 6}, surfaces: {metal: concrete}}\n\
                sensors: [{sensor: velodyne_vlp16, name: top}]\ntrajectory: {position_m: [0, 0, 0]}\n";
    let scenario = Scenario::from_yaml(text, folder.path()).unwrap().with_engine(&Engine::with_threads(1).unwrap());
    let sample = scenario.sample(0).unwrap();
    let labels = sample.scene().labels();
    let (id, _) = labels.category.iter().find(|(_, name)| *name == "building").unwrap();
    assert_eq!(labels.las_class.get(&id), Some(&6));
    assert_eq!(places(sample.scene(), "*").len(), 1);
}
