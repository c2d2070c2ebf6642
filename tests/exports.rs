//! One scene in the formats that Blender exports: the same scan.

use echocast::{Field, LoadOptions, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::root;
use std::collections::BTreeMap;

/// How far ranges may differ, m: Blender stores corners and places in single precision, and turns them by its own
/// matrices.
const TOLERANCE_M: f32 = 1e-4;

fn load(name: &str, options: &LoadOptions) -> Scene {
    Scene::load_with(root().join("tests/data/scenes/blender").join(name), options).unwrap()
}

/// The scan of a still sensor without noise, at the start of the animations or later.
fn scan(scene: &Scene, start_time: f64) -> PointCloud {
    const SENSOR: &str = "{name: s, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 360, step_deg: 0.7}, \
        elevation: {fov_deg: 110, step_deg: 0.9, centre_deg: -10}, rate_hz: 10000}, range: {max_m: 100}}";
    let sensor = Sensor::from_yaml(SENSOR, "").unwrap();
    let pose = Trajectory::fixed(Pose::at(0.3, -0.4, 1.3));
    let fields = [Field::Range, Field::CategoryId, Field::PartId, Field::Beam].into_iter().collect();
    let options = ScanOptions::default().start_time(start_time).fields(fields);
    scene.build().unwrap().scan(&sensor, &pose, &options).unwrap()
}

/// For every beam its range, category and part, by names.
fn found(scene: &Scene, cloud: &PointCloud) -> BTreeMap<u32, (f32, String, String)> {
    let columns = cloud.columns();
    let name = |table: &echocast::scene::NameTable, id: u32| table.name(id).unwrap_or_default().to_owned();
    let row = |row: usize| {
        let category = name(&scene.labels.category, columns.category_id()[row]);
        let part = name(&scene.labels.part, columns.part_id()[row]);
        (columns.beam()[row], (columns.range()[row], category, part))
    };
    (0..columns.range().len()).map(row).collect()
}

/// Checks that nearly all beams see the same in both: a few meet edges, where the last digit decides.
#[track_caller]
fn check_same(a: &BTreeMap<u32, (f32, String, String)>, b: &BTreeMap<u32, (f32, String, String)>, names: bool) {
    assert!(a.len() > 20_000, "{} beams see something", a.len());
    let same = |beam: &u32, (range, category, part): &(f32, String, String)| {
        b.get(beam).is_some_and(|other| {
            let labelled = !names || (category, part) == (&other.1, &other.2);
            (range - other.0).abs() <= TOLERANCE_M && labelled
        })
    };
    let differing: Vec<_> = a.iter().filter(|(beam, seen)| !same(beam, seen)).collect();
    let shown: Vec<_> = differing.iter().take(5).map(|(beam, seen)| (seen, b.get(beam))).collect();
    assert!(differing.len() * 2000 <= a.len(), "{} of {} beams differ: {shown:?}", differing.len(), a.len());
    assert!(b.len().abs_diff(a.len()) * 2000 <= a.len());
}

#[test]
fn all_formats_of_one_scene_give_one_scan() {
    let plain = LoadOptions::default();
    let [fbx, glb] = ["scene.fbx", "scene.glb"].map(|name| load(name, &plain));
    let seen_by_glb = found(&glb, &scan(&glb, 0.0));
    check_same(&found(&fbx, &scan(&fbx, 0.0)), &seen_by_glb, true);

    // OBJ has no custom properties and no nodes: names are given as people do, by rules.
    let rules = "labels: {objects: {Floor: ground, 'Top*': furniture, 'Leg*': furniture, House: House, Wall*: House, \
                 Window*: House}}\nup: y";
    let obj = load("scene.obj", &LoadOptions::from_yaml(rules).unwrap());
    let ranges = found(&obj, &scan(&obj, 0.0));
    check_same(&ranges, &seen_by_glb, false);
    let categories = |of: &BTreeMap<u32, (f32, String, String)>| {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        of.values().for_each(|(_, category, _)| *counts.entry(category.clone()).or_default() += 1);
        counts
    };
    let [of_glb, of_obj] = [&seen_by_glb, &ranges].map(categories);
    for name in ["ground", "furniture", "House"] {
        assert!(of_glb[name].abs_diff(of_obj[name]) <= 5, "{name}: {of_glb:?} {of_obj:?}");
    }

    // One mesh without names or materials.
    for name in ["scene.ply", "scene.stl"] {
        let scene = load(name, &plain);
        check_same(&found(&scene, &scan(&scene, 0.0)), &seen_by_glb, false);
    }
}

#[test]
fn fbx_and_glb_of_one_scene_move_alike() {
    let [fbx, glb] = ["scene.fbx", "scene.glb"].map(|name| load(name, &LoadOptions::default()));
    // At frames: between them both programs have curves of their own.
    for frame in [7, 24, 31, 48] {
        let time = f64::from(frame) / 24.0;
        let [of_fbx, of_glb] = [&fbx, &glb].map(|scene| found(scene, &scan(scene, time)));
        check_same(&of_fbx, &of_glb, true);
    }
}
