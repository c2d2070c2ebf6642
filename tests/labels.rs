//! Labels as people mean them: scenes as other programs write them, and rules for them.

use echocast::scene::InstanceRule;
use echocast::{Engine, Environment, LabelRules, LiveScene, LoadOptions, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::{python, root};
use std::collections::BTreeMap;
use std::path::PathBuf;

fn file(name: &str) -> PathBuf {
    root().join("tests/data/scenes").join(name)
}

/// The scene called `name` with `labels`.
fn load(name: &str, labels: LabelRules) -> Scene {
    Scene::load_with(file(&format!("{name}.gltf")), &LoadOptions::default().labels(labels)).unwrap()
}

fn rules(yaml: &str) -> LabelRules {
    LabelRules::from_yaml(yaml).unwrap()
}

/// Object, category and instance, a row for each object.
fn table(scene: &Scene) -> Vec<Vec<String>> {
    let row = |object: &echocast::scene::Object| {
        let category = scene.labels.category.name(object.category_id).unwrap();
        let instance = scene.labels.instance.name(object.instance_id).unwrap();
        [&object.name, category, instance].map(str::to_owned).to_vec()
    };
    scene.objects.iter().map(row).collect()
}

/// Object names by instance, in the order of instance numbers.
fn instances(scene: &Scene) -> Vec<Vec<&str>> {
    let mut by_number: BTreeMap<u32, Vec<&str>> = BTreeMap::new();
    for object in &scene.objects {
        by_number.entry(object.instance_id).or_default().push(&object.name);
    }
    by_number.into_values().collect()
}

#[test]
fn scenes_as_people_bring_them() {
    for name in ["blender", "empties", "pieces", "sky", "building"] {
        let labels = file(&format!("{name}.labels.yaml"));
        let labels = if labels.exists() { LabelRules::load(labels).unwrap() } else { LabelRules::default() };
        let scene = load(name, labels);
        let expected = std::fs::read_to_string(file(&format!("{name}.csv"))).unwrap();
        let expected: Vec<Vec<&str>> = expected.lines().skip(1).map(|line| line.split(',').collect()).collect();
        assert_eq!(table(&scene), expected, "{name}");
        assert!(scene.report.warnings.is_empty(), "{name}: {:?}", scene.report.warnings);
    }
}

#[test]
fn the_same_tree_is_an_instance_though_its_meshes_share_no_number() {
    let scene = load("empties", LabelRules::load(file("empties.labels.yaml")).unwrap());
    let [one, two] = ["Tree.001", "Tree.002"].map(|name| scene.labels.instance.id(name));
    assert_ne!(one, two);
    let of = |number: u32| scene.objects.iter().filter(|object| object.instance_id == number).count();
    assert_eq!((of(one), of(two)), (2, 2));
    assert_eq!(scene.labels.category.id("tree"), 70);
}

#[test]
fn rules_say_which_objects_are_one() {
    let with = |instances| load("empties", LabelRules::default().instances(instances));
    let trees = ["Cylinder.004", "Icosphere.001", "Cylinder.005", "Icosphere.002"];
    let named = |patterns: &[&str]| InstanceRule::Named(patterns.iter().map(|it| (*it).to_owned()).collect());
    assert_eq!(instances(&with(InstanceRule::Node)).len(), 6);
    let roots = with(InstanceRule::Root);
    assert_eq!(instances(&roots), [[&trees[..], &["Bush"]].concat(), vec!["Ground"]]);
    assert_eq!(instances(&with(named(&["Forest"]))), [[&trees[..], &["Bush"]].concat(), vec!["Ground"]]);
    let spheres = with(named(&["Icosphere*", "Shrub*"]));
    assert_eq!(instances(&spheres).len(), 6);
    assert_eq!(rules("instances: node").instances, Some(InstanceRule::Node));
    assert_eq!(rules("instances: root").instances, Some(InstanceRule::Root));
    assert_eq!(rules("instances: \"Car*\"").instances, Some(named(&["Car*"])));
    assert_eq!(rules("instances: [\"Car*\", Bus]").instances, Some(named(&["Car*", "Bus"])));
}

#[test]
fn nearer_names_count_and_contradictions_are_told() {
    let scene = load("empties", rules("objects: {\"Tree*\": tree, \"Icosphere*\": crown, \"*\": thing}"));
    let of = |name: &str| table(&scene).into_iter().find(|row| row[0] == name).unwrap();
    assert_eq!(of("Cylinder.004"), ["Cylinder.004", "tree", "Tree.001"]);
    assert_eq!(of("Icosphere.001"), ["Icosphere.001", "crown", "Icosphere.001"]);
    assert_eq!(of("Bush"), ["Bush", "thing", "Shrub.004"]);
    assert_eq!(
        scene.report.warnings,
        [
            "label rules: objects: of two patterns, the one that matches the nearer name counts: \"Icosphere.001\" is \"crown\" by \
          \"Icosphere*\", and \"tree\" by \"Tree*\", which matches \"Tree.001\" above it"
        ]
    );
    // What the file says yields to rules, also to those for what an object hangs on.
    let scene = load("pieces", rules("objects: {\"Bench\": seat, \"Plank_2\": back}"));
    let of = |name: &str| table(&scene).into_iter().find(|row| row[0] == name).unwrap();
    assert_eq!(of("Plank_1"), ["Plank_1", "seat", "Bench"]);
    assert_eq!(of("Plank_2"), ["Plank_2", "back", "Plank_2"]);
}

#[test]
fn hidden_objects_are_not_there() {
    let hide = |patterns: &[&str]| {
        let hide = patterns.iter().map(|it| (*it).to_owned()).collect();
        Scene::load_with(file("sky.gltf"), &LoadOptions::default().hide(hide))
    };
    let scene = hide(&["SkyBox", "Hause"]).unwrap();
    assert_eq!(scene.objects.len(), 2);
    assert_eq!(scene.hidden, ["SkyBox"]);
    assert_eq!(scene.report.warnings, ["hide: no object's name matches \"Hause\"; near: House"]);
    let error = hide(&["*"]).unwrap_err().to_string();
    assert!(error.contains("hide") && error.contains("leave something to scan"), "{error}");
    // By the name of what they hang on.
    let scene = load("empties", rules("hide: Tree.001"));
    assert_eq!(scene.objects.len(), 4);
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
}

#[test]
fn skies_are_known_by_name_and_by_size() {
    let scene = load("sky", LabelRules::default());
    let names = |scene: &Scene| -> Vec<String> {
        scene.skies().iter().map(|&id| scene.labels.instance.name(id).unwrap().to_owned()).collect()
    };
    assert_eq!(names(&scene), ["SkyBox"]);
    let text = std::fs::read_to_string(file("sky.gltf")).unwrap().replace("\"SkyBox\"", "\"Sphere.007\"");
    let renamed = Scene::from_glb_bytes(text.as_bytes(), &LoadOptions::default()).unwrap();
    assert_eq!(names(&renamed), ["Sphere.007"]);
    // A house around its furniture is none.
    assert!(load("building", LabelRules::default()).skies().is_empty());
}

#[test]
fn rules_that_ship_with_the_library_fit_and_keep_quiet() {
    let names: Vec<&str> = LabelRules::presets().map(|(name, _)| name).collect();
    assert_eq!(names, ["forest", "semantic_kitti", "street"]);
    for name in names {
        let scene = load("empties", LabelRules::open(name).unwrap());
        assert!(scene.report.warnings.is_empty(), "{name}: {:?}", scene.report.warnings);
    }
    let street = load("sky", LabelRules::open("street").unwrap());
    assert_eq!(table(&street), [["Ground", "terrain", "Ground"], ["House", "building", "House"]]);
    let kitti = load("empties", LabelRules::open("semantic_kitti").unwrap());
    assert_eq!(kitti.labels.category.id("vegetation"), 70);
    assert_eq!(kitti.labels.category.id("terrain"), 72);
}

#[test]
fn las_files_have_the_classes_that_rules_give() {
    let scene = load("empties", LabelRules::load(file("empties.labels.yaml")).unwrap());
    // Also through a scene that is edited.
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.add_scene(&scene).unwrap();
    let built = live.commit().unwrap();
    let options = ScanOptions::default().environment(Environment::default());
    let place = Trajectory::fixed(Pose::at(0.0, 0.0, 1.8));
    let cloud = built.scan(&Sensor::preset("velodyne_vlp16").unwrap(), &place, &options).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("classes.las");
    cloud.write(&path).unwrap();
    let code = "import sys, laspy, numpy as np\nf = laspy.read(sys.argv[1])\n\
                pairs = sorted(set(zip(np.array(f['category_id']).tolist(), np.array(f.classification).tolist())))\n\
                print(pairs)";
    let output = python().args(["-c", code]).arg(&path).output().unwrap();
    let found = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let [shrub, tree, terrain] = ["Shrub", "tree", "terrain"].map(|name| cloud.labels.category.id(name));
    let mut expected = [(shrub, 0), (tree, 5), (terrain, 2)];
    expected.sort_unstable();
    assert_eq!(found.trim(), format!("{expected:?}"));
}
