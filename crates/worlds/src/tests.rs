//! Properties of generated scenes, and what other readers find in the files.

use super::bed::Bed;
use super::seabed::FISH_MU_DB;
use super::{Ripples, Seabed};
use engine::scene::{LoadOptions, Object, Scene};
use glam::{DVec2, DVec3, Vec3};
use serde_json::Value;
use std::collections::{HashMap, HashSet};

fn small() -> Seabed {
    Seabed { size_m: [24.0, 20.0], cell_m: Some(0.5), boulders: 12, fish: 9, ..Seabed::default() }
}

fn load(seabed: &Seabed, seed: u64) -> Scene {
    seabed.scene(seed).unwrap().load(&LoadOptions::default()).unwrap()
}

fn bed(seabed: &Seabed, seed: u64) -> Bed {
    Bed::new(seabed.ground().unwrap(), seed)
}

pub(super) fn of_category<'a>(scene: &'a Scene, category: &str) -> Vec<&'a Object> {
    let id = scene.labels.category.id(category);
    scene.objects.iter().filter(|object| object.category_id == id).collect()
}

/// World positions of all vertices of an object.
fn vertices(object: &Object) -> Vec<DVec3> {
    let all = object.mesh.parts.iter().flat_map(|part| part.positions.iter());
    all.map(|&p| object.world_from_object.transform_point3(Vec3::from(p).as_dvec3())).collect()
}

#[test]
fn a_written_scene_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lake.glb");
    let made = Seabed::default().scene(7).unwrap();
    made.write(&path).unwrap();
    let scene = Scene::load(&path).unwrap();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);

    assert_eq!(scene.degenerate_triangles, 0);
    assert_eq!((scene.triangle_count(), scene.objects.len()), (made.triangles, 82));
    assert_eq!(made.triangles, 30_000 + 20 * 320 + 40 + 60 * 80);
    assert_eq!(made.categories, [("seabed", 1), ("boulder", 20), ("wreck", 1), ("fish", 60)]);
    for (category, count) in &made.categories {
        assert_eq!(of_category(&scene, category).len(), *count, "{category}");
    }
    assert_eq!(scene.labels.part.names, ["cabin", "fish", "gravel", "hull", "mast", "mud", "rock", "sand"]);
    let wreck = of_category(&scene, "wreck")[0];
    let parts: Vec<_> = wreck.part_ids.iter().filter_map(|&id| scene.labels.part.name(id)).collect();
    assert_eq!((wreck.name.as_str(), parts), ("Wreck_01", vec!["hull", "cabin", "mast"]));
    let swarm = of_category(&scene, "fish");
    assert!(swarm.iter().all(|fish| std::sync::Arc::ptr_eq(&fish.mesh, &swarm[0].mesh)));
    assert_eq!(scene.animations, ["Swarm"]);
    assert!(scene.objects.iter().all(|object| object.motion.is_some() == (object.name.starts_with("Fish"))));

    let (low, high) = scene.bounds().unwrap();
    assert_eq!((low.truncate(), high.truncate()), ((-30.0, -20.0).into(), (30.0, 20.0).into()));
    assert!(low.z > -18.0 && high.z < 0.0, "{low} {high}");
    let camera = scene.camera("Sonar").unwrap().pose;
    assert!((camera.position - DVec3::new(-30.0, 0.0, -1.0)).length() < 1e-12);
    assert!((camera.orientation * DVec3::X - DVec3::X).length() < 1e-12);
    assert!((camera.orientation * DVec3::Z - DVec3::Z).length() < 1e-12);
}

#[test]
fn same_seed_same_bytes_and_objects_do_not_affect_each_other() {
    let seabed = small();
    let one = seabed.scene(1).unwrap();
    assert_eq!(one.bytes(), seabed.scene(1).unwrap().bytes());
    assert_ne!(one.bytes(), seabed.scene(2).unwrap().bytes());
    let (before, after) = (load(&seabed, 1), load(&Seabed { boulders: 40, wrecks: 3, fish: 20, ..seabed }, 1));
    for object in before.objects.iter().filter(|object| object.category_id != before.labels.category.id("fish")) {
        let same = after.objects.iter().find(|other| other.name == object.name).unwrap();
        assert_eq!(vertices(object), vertices(same), "{}", object.name);
    }
}

#[test]
fn the_bed_is_a_sheet_of_that_depth_with_normals_up() {
    let sizes = [([60.0, 40.0], 12.0, None), ([300.0, 5.0], 2.0, Some(0.5)), ([1.0, 1.0], 0.5, Some(0.1))];
    for (seed, (size_m, depth_m, cell_m)) in sizes.into_iter().enumerate() {
        let seabed = Seabed { size_m, depth_m, cell_m, ..Seabed::default() };
        let bed = bed(&seabed, seed as u64);
        let (positions, normals) = bed.vertices();
        let mean = positions.iter().map(|p| f64::from(p[2])).sum::<f64>() / positions.len() as f64;
        assert!((mean + depth_m).abs() < 1e-5 * depth_m, "{mean}");
        assert!(positions.iter().all(|p| (0.45..1.55).contains(&(-f64::from(p[2]) / depth_m))));
        assert!(normals.iter().all(|n| n[2] > 0.5 && (Vec3::from(*n).length() - 1.0).abs() < 1e-5));

        let [x, y] = size_m;
        let (mut area, mut edges) = (0.0, HashMap::new());
        let triangles = bed.triangles().concat();
        for corners in &triangles {
            let [a, b, c] = corners.map(|corner| Vec3::from(positions[corner as usize]).as_dvec3());
            let upward = (b - a).cross(c - a).z / 2.0;
            assert!(upward > 0.0);
            area += upward;
            for i in 0..3 {
                *edges.entry([corners[i], corners[(i + 1) % 3]]).or_insert(0) += 1;
            }
            // The ground on which objects are placed is the ground in the file.
            let middle = (a + b + c) / 3.0;
            assert!((bed.height(middle.x, middle.y) - middle.z).abs() < 1e-4 * depth_m);
        }
        assert!((area - x * y).abs() < 1e-3 * x * y, "{area}");
        assert!(edges.values().all(|&count| count == 1));
        let rim = edges.keys().filter(|[a, b]| !edges.contains_key(&[*b, *a])).count();
        let [columns, rows] = bed.ground.cells;
        assert_eq!((rim, triangles.len()), (2 * (columns + rows), 2 * columns * rows));
    }
}

#[test]
fn sand_gravel_and_mud_have_their_shares() {
    for seed in 0..4 {
        let [sand, gravel, mud] = bed(&Seabed::default(), seed).triangles().map(|all| all.len() as f64 / 30_000.0);
        assert!((gravel - 0.15).abs() < 0.02 && (0.1..0.22).contains(&mud), "{gravel} {mud}");
        assert!((sand + gravel + mud - 1.0).abs() < 1e-9);
    }
}

#[test]
fn ripples_are_seen_where_the_cells_show_them() {
    let heights = |ripples, cell_m| {
        let seabed = Seabed { size_m: [12.0, 10.0], cell_m, ripples, ..Seabed::default() };
        bed(&seabed, 3).vertices().0.iter().map(|p| p[2]).collect::<Vec<_>>()
    };
    let (none, requested) = (Ripples { height_m: 0.0, ..Ripples::default() }, Ripples::default());
    // The default cells of such a small bed are fine enough; those of a large one are not.
    assert_eq!(heights(None, None), heights(Some(requested), None));
    assert_eq!(heights(None, Some(0.5)), heights(Some(none), Some(0.5)));
    assert_eq!(Seabed::default().ground().unwrap().ripples, None);
    let requested_large = Seabed { ripples: Some(requested), ..Seabed::default() }.ground().unwrap();
    assert_eq!((requested_large.ripples, requested_large.cells), (Some(requested), [400, 267]));

    let (flat, rippled) = (heights(Some(none), None), heights(Some(requested), None));
    let difference: Vec<f32> = flat.iter().zip(&rippled).map(|(flat, rippled)| rippled - flat).collect();
    let largest = difference.iter().fold(0.0, |largest: f32, d| largest.max(d.abs()));
    assert!((0.024..0.026).contains(&largest), "{largest}");
    // A sine of amplitude 0.025 has an rms of 0.0177; gravel, mud and their surroundings have none.
    let rms = (difference.iter().map(|d| d * d).sum::<f32>() / difference.len() as f32).sqrt();
    assert!((0.008..0.0177).contains(&rms), "{rms}");
}

#[test]
fn boulders_and_wrecks_lie_on_the_bed_and_everything_is_under_water() {
    for (seed, (size_m, depth_m)) in
        [([24.0, 20.0], 12.0), ([60.0, 8.0], 3.0), ([2.0, 3.0], 0.5), ([200.0, 200.0], 60.0)].into_iter().enumerate()
    {
        let seabed = Seabed { size_m, depth_m, cell_m: None, wrecks: 3, ..small() };
        let (scene, bed) = (load(&seabed, seed as u64), bed(&seabed, seed as u64));
        for object in scene.objects.iter().filter(|object| object.name != "Seabed") {
            let name = &object.name;
            let all = vertices(object);
            for vertex in &all {
                assert!(vertex.z < 0.0, "{name} at {vertex}");
                assert!(vertex.x.abs() <= size_m[0] / 2.0 && vertex.y.abs() <= size_m[1] / 2.0, "{name} at {vertex}");
            }
            let gaps = all.iter().map(|vertex| vertex.z - bed.height(vertex.x, vertex.y));
            let [lowest, highest] = gaps.fold([f64::MAX, f64::MIN], |[low, high], gap| [low.min(gap), high.max(gap)]);
            let [bottom, top] = all.iter().fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v.z), high.max(v.z)]);
            if name.starts_with("Fish") {
                assert!(lowest > 0.0, "{name} in the ground");
                assert!((0.35..0.65).contains(&(-bottom / depth_m)), "{name} at {bottom}");
            } else {
                // Sunk in slightly, and mostly above the ground.
                assert!(lowest < -0.05 * (top - bottom) && highest > 0.3 * (top - bottom), "{name} {lowest} {highest}");
            }
        }
        let camera = scene.camera("Sonar").unwrap().pose.position;
        assert!(camera.z < 0.0 && camera.z > bed.height_range()[1] + 0.1 * depth_m);
    }
    for boulder in of_category(&load(&small(), 5), "boulder") {
        let all = vertices(boulder);
        let length = all.iter().flat_map(|a| all.iter().map(move |b| a.distance(*b))).fold(0.0, f64::max);
        assert!((0.2..=1.5).contains(&length), "{length}");
    }
}

/// A bed with objects of all kinds on it.
fn full() -> Seabed {
    Seabed { pipes: 2, mines: 6, seagrass: 3, ..small() }
}

#[test]
fn pipes_mines_and_sea_grass_lie_on_the_bed() {
    for (seed, (size_m, depth_m)) in
        [([24.0, 20.0], 12.0), ([60.0, 30.0], 3.0), ([3.0, 4.0], 0.6)].into_iter().enumerate()
    {
        let seabed = Seabed { size_m, depth_m, cell_m: None, ..full() };
        let made = seabed.scene(seed as u64).unwrap();
        let (scene, bed) = (load(&seabed, seed as u64), bed(&seabed, seed as u64));
        assert_eq!((scene.triangle_count(), scene.degenerate_triangles), (made.triangles, 0));
        assert!(scene.objects.iter().all(|object| object.category_id > 0 && object.part_ids.iter().all(|&id| id > 0)));
        assert_eq!([of_category(&scene, "pipe").len(), of_category(&scene, "mine").len()], [2, 6]);
        let grass = of_category(&scene, "seagrass");
        assert!(grass.len() > 30, "{}", grass.len());
        let tufts: HashSet<_> = grass.iter().map(|tuft| std::sync::Arc::as_ptr(&tuft.mesh)).collect();
        assert!(tufts.len() <= 4);
        for category in ["pipe", "mine", "seagrass"] {
            for object in of_category(&scene, category) {
                let (name, all) = (&object.name, vertices(object));
                let gaps = all.iter().map(|vertex| vertex.z - bed.height(vertex.x, vertex.y));
                let [lowest, highest] =
                    gaps.fold([f64::MAX, f64::MIN], |[low, high], gap| [low.min(gap), high.max(gap)]);
                assert!(lowest < 0.0 && highest > 0.05 * depth_m.min(2.0), "{name}: {lowest} {highest}");
                for vertex in &all {
                    assert!(vertex.z < 0.0, "{name} at {vertex}");
                    assert!(
                        vertex.x.abs() <= size_m[0] / 2.0 && vertex.y.abs() <= size_m[1] / 2.0,
                        "{name} at {vertex}"
                    );
                }
            }
        }
        for pipe in of_category(&scene, "pipe") {
            let all = vertices(pipe);
            let [low, high] = all.iter().fold([DVec3::MAX, DVec3::MIN], |[low, high], v| [low.min(*v), high.max(*v)]);
            let across = (high - low).truncate() / DVec2::from(size_m);
            assert!(across.max_element() > 0.7, "{across}");
        }
    }
}

#[test]
fn new_things_leave_the_bed_as_it_was() {
    let seabed = small();
    let before = load(&seabed, 1);
    let after = load(&full(), 1);
    for object in &before.objects {
        let same = after.objects.iter().find(|other| other.name == object.name).unwrap();
        assert_eq!(vertices(object), vertices(same), "{}", object.name);
    }
    assert!(after.objects.len() > before.objects.len());
    let text = serde_json::to_string(&full()).unwrap();
    assert_eq!(serde_json::from_str::<Seabed>(&text).unwrap(), full());
    assert!(serde_json::from_str::<Seabed>("{\"pipe\": 3}").unwrap_err().to_string().contains("unknown field"));
}

#[test]
fn ripples_have_the_requested_direction() {
    let of = |height_m, direction_deg| {
        let ripples = Some(Ripples { height_m, direction_deg, ..Ripples::default() });
        bed(&Seabed { size_m: [12.0, 10.0], ripples, ..Seabed::default() }, 3)
    };
    for direction in [0.0_f64, 30.0, 120.0] {
        let (flat, rippled) = (of(0.0, None), of(0.05, Some(direction)));
        let waves = |x: f64, y: f64| rippled.height(x, y) - flat.height(x, y);
        // Slopes across the crests are much steeper than along them.
        let (sin, cos) = direction.to_radians().sin_cos();
        let (mut across, mut along) = (0.0, 0.0);
        for i in -20..=20 {
            for j in -20..=20 {
                let (x, y, step) = (0.25 * f64::from(i), 0.2 * f64::from(j), 0.1);
                let here = waves(x, y);
                across += (waves(x + step * cos, y + step * sin) - here).powi(2);
                along += (waves(x - step * sin, y + step * cos) - here).powi(2);
            }
        }
        assert!(across > 6.0 * along && along > 0.0, "{direction}: {across} {along}");
    }
}

/// The JSON and binary chunks of a GLB, parsed by the specification alone.
pub(super) fn chunks(glb: &[u8]) -> (Value, &[u8]) {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&glb[..4], word(4), word(8)), (&b"glTF"[..], 2, glb.len()));
    let json = word(12);
    let binary = 20 + json;
    assert_eq!((&glb[16..20], &glb[binary + 4..binary + 8]), (&b"JSON"[..], &b"BIN\0"[..]));
    assert_eq!((json % 4, word(binary) % 4, binary + 8 + word(binary)), (0, 0, glb.len()));
    (serde_json::from_slice(&glb[20..binary]).unwrap(), &glb[binary + 8..])
}

#[test]
fn files_are_valid_gltf() {
    // Few and many vertices: two-byte and four-byte indices.
    for cell_m in [Some(0.5), Some(0.08)] {
        let made = Seabed { cell_m, ..small() }.scene(1).unwrap();
        let gltf = gltf::Gltf::from_slice(made.bytes()).unwrap();
        let (json, binary) = chunks(made.bytes());
        assert_eq!(json["buffers"][0]["byteLength"], binary.len());
        for view in gltf.views() {
            assert!(view.offset() % 4 == 0 && view.offset() + view.length() <= binary.len());
        }
        for accessor in gltf.accessors() {
            let view = accessor.view().unwrap();
            assert_eq!(accessor.offset() + accessor.count() * accessor.size(), view.length());
        }
        let mut long = 0;
        for mesh in gltf.meshes() {
            for primitive in mesh.primitives() {
                let reader = primitive.reader(|_| Some(binary));
                let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
                let bounds = primitive.bounding_box();
                for axis in 0..3 {
                    let values = || positions.iter().map(|position| position[axis]);
                    assert_eq!(values().fold(f32::INFINITY, f32::min), bounds.min[axis]);
                    assert_eq!(values().fold(f32::NEG_INFINITY, f32::max), bounds.max[axis]);
                }
                if let Some(normals) = reader.read_normals() {
                    let normals: Vec<[f32; 3]> = normals.collect();
                    assert_eq!(normals.len(), positions.len());
                    assert!(normals.iter().all(|n| (Vec3::from(*n).length() - 1.0).abs() < 1e-5));
                }
                let indices = reader.read_indices().unwrap();
                long += usize::from(matches!(indices, gltf::mesh::util::ReadIndices::U32(_)));
                let indices: Vec<u32> = indices.into_u32().collect();
                assert!(indices.len().is_multiple_of(3) && !indices.is_empty());
                assert!(indices.iter().all(|&index| (index as usize) < positions.len()));
            }
        }
        assert_eq!(long, if cell_m == Some(0.5) { 0 } else { 3 });

        let sounds: HashMap<&str, &Value> = json["materials"]
            .as_array()
            .unwrap()
            .iter()
            .map(|material| (material["name"].as_str().unwrap(), &material["extras"]["sound"]["name"]))
            .collect();
        for (material, sediment) in
            [("sand", "medium_sand"), ("gravel", "sandy_gravel"), ("mud", "silt"), ("rock", "rock")]
        {
            assert_eq!(*sounds[material], sediment);
        }
    }
}

#[test]
fn the_swarm_swims_against_x() {
    let made = Seabed::default().scene(4).unwrap();
    let gltf = gltf::Gltf::from_slice(made.bytes()).unwrap();
    let (_, binary) = chunks(made.bytes());
    let animation = gltf.animations().next().unwrap();
    let channel = animation.channels().next().unwrap();
    let node = channel.target().node();
    assert_eq!((node.name(), node.children().len()), (Some("Swarm"), 60));
    let reader = channel.reader(|_| Some(binary));
    let times: Vec<f32> = reader.read_inputs().unwrap().collect();
    let gltf::animation::util::ReadOutputs::Translations(places) = reader.read_outputs().unwrap() else {
        panic!("no translations")
    };
    let places: Vec<Vec3> = places.map(Vec3::from).collect();
    assert_eq!(times, [0.0, 24.0]);
    // At time 0 it is where it is without the animation.
    assert_eq!(Vec3::from(node.transform().decomposed().0), places[0]);
    assert_eq!(places[1] - places[0], Vec3::NEG_X * 24.0);
    for fish in of_category(&load(&Seabed::default(), 4), "fish") {
        let nose = fish.world_from_object.transform_vector3(DVec3::X);
        assert!(nose.normalize().x < -0.95 && (0.34..0.46).contains(&nose.length()), "{nose}");
    }
    let still = load(&Seabed { fish: 0, boulders: 0, wrecks: 0, ..Seabed::default() }, 4);
    assert!(still.animations.is_empty() && still.objects.len() == 1);
}

#[test]
fn a_fish_is_as_strong_as_measured_from_above() {
    let scene = load(&small(), 1);
    let mesh = &of_category(&scene, "fish")[0].mesh;
    let part = &mesh.parts[0];
    // Lambert: mu cos^2 of every piece of the surface that faces up (y in a mesh), for a fish 0.4 m long.
    let mut sum = 0.0;
    for corners in part.triangles.iter() {
        let [a, b, c] = corners.map(|corner| Vec3::from(part.positions[corner as usize]).as_dvec3() * 0.4);
        let area = (b - a).cross(c - a) / 2.0;
        sum += area.y.max(0.0).powi(2) / area.length();
    }
    let strength = 10.0 * sum.log10() + FISH_MU_DB;
    let foote = 20.0 * 40f64.log10() - 67.4;
    assert!((strength - foote).abs() < 1.0, "{strength} {foote}");
}

#[test]
fn bad_parameters_are_named() {
    let ripples = |wavelength_m, height_m| Some(Ripples { wavelength_m, height_m, direction_deg: None });
    let usual = Seabed::default;
    for (seabed, says) in [
        (Seabed { size_m: [-3.0, 4.0], ..usual() }, "size_m is -3; allowed: 1 to 10000"),
        (Seabed { size_m: [30.0, f64::NAN], ..usual() }, "size_m is NaN"),
        (Seabed { depth_m: 0.0, ..usual() }, "depth_m is 0; allowed: 0.5 to 11000"),
        (Seabed { cell_m: Some(0.01), ..usual() }, "cell_m is 0.01; allowed: 0.0220 to 40"),
        (Seabed { cell_m: Some(-1.0), ..usual() }, "cell_m is -1"),
        (Seabed { cell_m: Some(f64::NAN), ..usual() }, "cell_m is NaN"),
        (Seabed { cell_m: Some(41.0), ..usual() }, "cell_m is 41"),
        (Seabed { ripples: ripples(0.0, 0.1), ..usual() }, "ripples.wavelength_m is 0"),
        (Seabed { ripples: ripples(0.6, 0.4), ..usual() }, "ripples.height_m is 0.4; allowed: 0 to 0.3"),
        (Seabed { ripples: ripples(0.05, 0.01), ..usual() }, "ripples.wavelength_m is 0.05; allowed: 0.088 or more"),
        (
            Seabed { ripples: ripples(0.6, 0.1), cell_m: Some(0.4), ..usual() },
            "ripples.wavelength_m is 0.6; allowed: 1.200 or more",
        ),
        (Seabed { boulders: 10_001, ..usual() }, "boulders is 10001; allowed: 0 to 10000"),
        (Seabed { wrecks: 101, ..usual() }, "wrecks is 101"),
        (Seabed { fish: 10_001, ..usual() }, "fish is 10001"),
        (Seabed { pipes: 21, ..usual() }, "pipes is 21; allowed: 0 to 20"),
        (Seabed { mines: 1001, ..usual() }, "mines is 1001"),
        (Seabed { seagrass: 201, ..usual() }, "seagrass is 201"),
        (
            Seabed { ripples: Some(Ripples { direction_deg: Some(361.0), ..Ripples::default() }), ..usual() },
            "ripples.direction_deg is 361; allowed: -360 to 360",
        ),
    ] {
        let error = seabed.scene(0).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    // The finest cells allowed make no more triangles than allowed, however long the bed.
    for size_m in [[60.0, 40.0], [10_000.0, 1.0], [1.0, 1.0]] {
        let refused = Seabed { size_m, cell_m: Some(1e-9), ..usual() }.ground().err().unwrap().to_string();
        let finest = refused.split_once("allowed: ").unwrap().1.split_once(" to ").unwrap().0.parse().unwrap();
        let [x, y] = Seabed { size_m, cell_m: Some(finest), ..usual() }.ground().unwrap().cells;
        assert!((8_000_000..=10_000_000).contains(&(2 * x * y)), "{x} x {y}");
    }
}
