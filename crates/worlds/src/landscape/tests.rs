//! Properties of landscapes.

use super::plants;
use super::sites::{PATCH, ROCKS, TUFTS, VARIANTS};
use super::species::{BUSH, TREES};
use super::{HeightMap, Landscape, course};
use crate::Seabed;
use crate::tests::{chunks, of_category};
use engine::scene::{LoadOptions, Object, Scene};
use glam::{DVec2, DVec3, Vec3};
use ground::read::yaml;
use std::collections::HashSet;
use std::fs;

fn small() -> Landscape {
    Landscape {
        size_m: [48.0, 40.0],
        trees_per_ha: 400.0,
        bushes_per_ha: 400.0,
        rocks_per_ha: 300.0,
        grass_per_m2: 3.0,
        ..Landscape::default()
    }
}

fn load(landscape: &Landscape, seed: u64) -> Scene {
    landscape.scene(seed).unwrap().load(&LoadOptions::default()).unwrap()
}

/// The corners of all triangles of the objects of a category, in the world.
fn triangles(scene: &Scene, category: &str) -> Vec<[DVec3; 3]> {
    let of_part = |object: &Object, number: usize| -> Vec<[DVec3; 3]> {
        let part = &object.mesh.parts[number];
        let corner = |index: u32| {
            let position = Vec3::from(part.positions[index as usize]).as_dvec3();
            object.world_from_object.transform_point3(position)
        };
        part.triangles.iter().map(|triangle| triangle.map(corner)).collect()
    };
    let objects = of_category(scene, category);
    objects.iter().flat_map(|object| (0..object.mesh.parts.len()).flat_map(|n| of_part(object, n))).collect()
}

/// Twice the area of a triangle seen from above.
fn double_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Height of a triangle at a position, if it covers it.
fn height_in(triangle: &[DVec3; 3], at: DVec2) -> Option<f64> {
    let [a, b, c] = triangle.map(DVec3::truncate);
    let whole = double_area([a, b, c]);
    let weights = [double_area([at, b, c]), double_area([a, at, c]), double_area([a, b, at])].map(|part| part / whole);
    let inside = whole != 0.0 && weights.iter().all(|&weight| weight >= -1e-9);
    inside.then(|| (0..3).map(|corner| weights[corner] * triangle[corner].z).sum())
}

fn height(ground: &[[DVec3; 3]], at: DVec2) -> f64 {
    ground.iter().find_map(|triangle| height_in(triangle, at)).unwrap_or_else(|| panic!("a hole at {at}"))
}

/// Distance of a point from triangles, seen from above; 0 on them.
fn distance(triangles: &[[DVec3; 3]], at: DVec2) -> f64 {
    let edge = |a: DVec2, b: DVec2| {
        let part = ((at - a).dot(b - a) / (b - a).length_squared().max(1e-12)).clamp(0.0, 1.0);
        at.distance(a + (b - a) * part)
    };
    let far = |triangle: &[DVec3; 3]| {
        let [a, b, c] = triangle.map(DVec3::truncate);
        if height_in(triangle, at).is_some() { 0.0 } else { edge(a, b).min(edge(b, c)).min(edge(c, a)) }
    };
    triangles.iter().map(far).fold(f64::INFINITY, f64::min)
}

fn place(object: &Object) -> DVec3 {
    object.world_from_object.translation
}

#[test]
fn a_landscape_reads_back_with_every_triangle_labelled() {
    let made = small().scene(7).unwrap();
    let scene = made.load(&LoadOptions::default()).unwrap();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    assert_eq!(scene.degenerate_triangles, 0);
    assert_eq!(scene.triangle_count(), made.triangles);
    let names = ["bush", "grass", "path", "rock", "terrain", "tree", "water"];
    assert_eq!(scene.labels.category.names, names);
    let parts = ["branch", "grass", "leaf", "path", "rock", "sand", "soil", "trunk", "turf", "water"];
    assert!(scene.labels.part.names.iter().all(|name| parts.contains(&name.as_str())), "{:?}", scene.labels.part);
    for (category, count) in &made.categories {
        assert_eq!(of_category(&scene, category).len(), *count, "{category}");
    }
    let instances: HashSet<u32> = scene.objects.iter().map(|object| object.instance_id).collect();
    assert_eq!(instances.len(), scene.objects.len());
    for object in &scene.objects {
        assert!(object.category_id != 0 && object.instance_id != 0, "{}", object.name);
        assert!(object.part_ids.iter().all(|&part| part != 0), "{}", object.name);
        let part = |name: &str| object.part_ids.contains(&scene.labels.part.id(name));
        let is_tree = ["Oak", "Birch", "Spruce"].iter().any(|kind| object.name.starts_with(kind));
        assert!(!is_tree || ["trunk", "branch", "leaf"].into_iter().all(part), "{}", object.name);
        assert!(!object.name.starts_with("Dead") || !part("leaf"));
    }
    // Trees of one kind and variant share their mesh.
    assert!(scene.meshes().len() <= 3 + (TREES.len() + 2) * VARIANTS + ROCKS);
    let lidar = scene.camera("Lidar").unwrap().pose;
    let under = height(&triangles(&scene, "path"), lidar.position.truncate());
    assert!((lidar.position.z - under - 1.8).abs() < 0.01 && (lidar.orientation * DVec3::Z).z > 0.999_999);
    let overview = scene.camera("Overview").unwrap().pose;
    let (low, high) = scene.bounds().unwrap();
    assert!(overview.position.z > high.z - 10.0 && (overview.orientation * DVec3::X).z < -0.1, "{low} {high}");
    let (json, _) = chunks(made.bytes());
    assert_eq!(json["extensionsRequired"], serde_json::json!(["EXT_mesh_gpu_instancing"]));
}

#[test]
fn ground_and_path_cover_the_land_once() {
    for seed in [1, 2, 3] {
        let scene = load(&Landscape { trees_per_ha: 0.0, grass_per_m2: 0.0, ..small() }, seed);
        let all = [triangles(&scene, "terrain"), triangles(&scene, "path")].concat();
        let areas: Vec<f64> = all.iter().map(|triangle| double_area(triangle.map(DVec3::truncate)) / 2.0).collect();
        assert!(areas.iter().all(|&area| area > 0.0));
        assert!((areas.iter().sum::<f64>() - 48.0 * 40.0).abs() < 1e-2);
        // They join without gaps: each inner edge belongs to two triangles.
        let bits = |at: DVec3| at.to_array().map(f64::to_bits);
        let mut edges = HashSet::new();
        for [a, b, c] in all {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                assert!(edges.insert([bits(from), bits(to)]), "{from} {to}");
            }
        }
        let is = |bits: u64, value: f64| f64::from_bits(bits).abs() == value;
        let on_edge = |[x, y, _]: [u64; 3]| is(x, 24.0) || is(y, 20.0);
        let alone = edges.iter().filter(|&&[a, b]| !edges.contains(&[b, a]));
        assert!(alone.into_iter().all(|&[a, b]| on_edge(a) && on_edge(b)));
    }
}

#[test]
fn plants_stand_upright_on_the_ground_off_path_and_water() {
    for seed in [7, 8] {
        let scene = load(&small(), seed);
        let ground = triangles(&scene, "terrain");
        let courses = [triangles(&scene, "path"), triangles(&scene, "water")].concat();
        for category in ["tree", "bush"] {
            for object in of_category(&scene, category) {
                let at = place(object);
                assert!((at.z - height(&ground, at.truncate())).abs() < 0.01, "{} at {at}", object.name);
                let up = object.world_from_object.matrix3.col(2).normalize();
                // Meshes of a file are y up: their z axis is the world's -y turned about z.
                let upright = object.world_from_object.transform_vector3(DVec3::Y).normalize();
                assert!(upright.z > 1.0 - 1e-6 && up.z.abs() < 1e-3, "{upright}");
                // The water reaches 0.25 m into its banks.
                assert!(distance(&courses, at.truncate()) > 0.9, "{} at {at}", object.name);
            }
        }
        for rock in of_category(&scene, "rock") {
            let at = place(rock);
            let half = rock.world_from_object.transform_vector3(DVec3::X).length();
            assert!(distance(&courses, at.truncate()) > 0.8 * half, "{half} m at {at}");
            let above = at.z - height(&ground, at.truncate());
            assert!((0.0..0.2 * half).contains(&above), "{above}");
        }
        for patch in of_category(&scene, "grass") {
            assert!(distance(&courses, place(patch).truncate()) > PATCH - 0.4);
        }
    }
}

#[test]
fn plants_keep_their_distance_and_are_as_many_as_requested() {
    let landscape = Landscape { trees_per_ha: 1250.0, ..small() };
    let scene = load(&landscape, 4);
    let trees: Vec<DVec2> = of_category(&scene, "tree").iter().map(|tree| place(tree).truncate()).collect();
    assert_eq!(trees.len(), 240);
    let least = 0.5 * (48.0 * 40.0 / 240.0_f64).sqrt();
    for (number, tree) in trees.iter().enumerate() {
        assert!(trees[..number].iter().all(|other| other.distance(*tree) >= least - 1e-4));
    }
    let bushes = of_category(&scene, "bush");
    assert_eq!((bushes.len(), of_category(&scene, "rock").len()), (77, 58));
    assert!(bushes.iter().all(|bush| trees.iter().all(|tree| tree.distance(place(bush).truncate()) >= 1.0 - 1e-4)));
    // All kinds of trees, few of them dead.
    let kind = |name: &str| {
        let trees = of_category(&scene, "tree");
        trees.iter().filter(|tree| tree.name.starts_with(name)).count()
    };
    assert!(["Oak", "Birch", "Spruce"].into_iter().all(|name| kind(name) > 10) && kind("Dead") < 30);
}

#[test]
fn grass_on_turf_has_the_requested_density() {
    let size_m = [100.0, 80.0];
    let bare = Landscape { path: false, stream: false, trees_per_ha: 0.0, bushes_per_ha: 0.0, ..Landscape::default() };
    let scene = load(&Landscape { size_m, grass_per_m2: 6.0, ..bare }, 2);
    let terrain = of_category(&scene, "terrain")[0];
    let turf = terrain.part_ids.iter().position(|&part| part == scene.labels.part.id("turf")).unwrap();
    let part = &terrain.mesh.parts[turf];
    let area = part.triangles.iter().map(|triangle| {
        let corner = |index: u32| Vec3::from(part.positions[index as usize]).as_dvec3();
        let [a, b, c] = triangle.map(corner).map(|at| DVec2::new(at.x, -at.z));
        double_area([a, b, c]) / 2.0
    });
    let expected = 6.0 * area.sum::<f64>() / TUFTS as f64;
    let found = of_category(&scene, "grass").len() as f64;
    // Nearly all of the land is turf, so that the binomial error is below that of a count; slopes differ a little.
    assert!(expected > 1000.0 && (found - expected).abs() < 4.0 * expected.sqrt(), "{found} {expected}");
}

#[test]
fn same_seed_same_bytes() {
    let one = small().scene(1).unwrap();
    assert_eq!(one.bytes(), small().scene(1).unwrap().bytes());
    assert_ne!(one.bytes(), small().scene(2).unwrap().bytes());
    let landscape = Landscape { path: false, ..small() };
    assert_ne!(one.bytes(), landscape.scene(1).unwrap().bytes());
}

#[test]
fn land_has_the_requested_relief() {
    for (relief_m, seed) in [(0.0, 1), (5.0, 2), (12.0, 3)] {
        let landscape = Landscape { relief_m, path: false, stream: false, grass_per_m2: 0.0, ..small() };
        let land = landscape.land(seed, &mut Vec::new()).unwrap();
        let [low, high] = land.terrain.height_range();
        assert!(low.abs() < 1e-4 && (f64::from(high) - relief_m).abs() < 1e-3, "{low} {high}");
        // Noise without steps: no slope is far above what hills of that height have.
        let steepest = land.terrain.normals().iter().map(|[_, _, z]| z.acos()).fold(0.0, f32::max);
        assert!(steepest.to_degrees() < 65.0, "{steepest}");
    }
}

#[test]
fn water_runs_downhill_in_its_bed_and_the_path_is_level_across() {
    for seed in 0..6 {
        let landscape = Landscape { size_m: [80.0, 60.0], relief_m: 6.0, ..small() };
        let land = landscape.land(seed, &mut Vec::new()).unwrap();
        let stream = land.stream.as_ref().unwrap_or_else(|| panic!("no stream with seed {seed}"));
        assert!(stream.length() > 15.0);
        assert!(stream.stations.windows(2).all(|pair| pair[1].level <= pair[0].level));
        let inside = |at: DVec2| at.x.abs() < 39.0 && at.y.abs() < 29.0;
        for station in stream.stations.iter().filter(|station| inside(station.at)) {
            let bed = land.terrain.height(station.at.x, station.at.y);
            assert!(bed < station.level - 0.05, "seed {seed}: bed {bed}, {station:?}");
        }
        let path = land.path.as_ref().unwrap();
        let [first, .., last] = path.stations.as_slice() else { panic!() };
        assert!((first.at.x + 40.0).abs() < 1e-6 && (last.at.x - 40.0).abs() < 1e-6);
        for pair in path.stations.windows(2).filter(|pair| inside(pair[0].at)) {
            let side = (pair[1].at - pair[0].at).perp().normalize();
            let [left, right] = [1.0, -1.0].map(|sign| pair[0].at + side * sign);
            // Not where it leads through the water.
            if stream.clearance(pair[0].at) > 5.0 {
                let tilt = land.terrain.height(left.x, left.y) - land.terrain.height(right.x, right.y);
                assert!(tilt.abs() < 0.12, "seed {seed}: {tilt} at {}", pair[0].at);
            }
        }
    }
}

#[test]
fn distances_to_courses_are_exact() {
    let land = small().land(3, &mut Vec::new()).unwrap();
    let path = land.path.unwrap();
    for step in 0..200 {
        let at = DVec2::new(f64::from(step % 20) * 2.3 - 23.0, f64::from(step / 20) * 3.9 - 19.5);
        let segments = path.stations.windows(2).map(|pair| {
            let [a, b] = [pair[0].at, pair[1].at];
            let part = ((at - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            at.distance(a + (b - a) * part)
        });
        let nearest = segments.fold(f64::INFINITY, f64::min);
        let found = path.nearest(at).map_or(f64::INFINITY, |(_, distance)| distance);
        assert!(found == nearest || nearest > 10.0 && found >= nearest, "{at}: {found} {nearest}");
    }
    let flat = Landscape { relief_m: 0.0, ..small() }.land(3, &mut Vec::new()).unwrap();
    assert!(flat.path.is_some() && course::stream(&flat.terrain).is_none_or(|stream| stream.length() > 0.0));
}

#[test]
fn plants_look_like_their_kind() {
    for (kind, species) in TREES.iter().chain([&BUSH]).enumerate() {
        for (variant, seed) in (0..VARIANTS).flat_map(|variant| [(variant, 1), (variant, 2)]) {
            let plant = plants::shape(species, kind, variant, seed);
            let name = species.name;
            let count: usize = plant.parts.iter().map(Vec::len).sum();
            let most = 35_000;
            let least = if ["Dead", "Bush"].contains(&name) { 2000 } else { 10_000 };
            assert!((least..most).contains(&count), "{name}: {count}");
            assert!(plant.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-6));
            let extreme = |of: fn(&DVec3) -> f64| plant.vertices.iter().map(of).fold(0.0, f64::max);
            let (tall, deep) = (extreme(|at| at.z), extreme(|at| -at.z));
            let wide = extreme(|at| at.truncate().length()) * 2.0;
            // Forked stems of oaks reach a little above the height of their trunk.
            let [height, by] = species.height;
            assert!((height - by) * 0.85 < tall && tall < (height + by) * 1.3, "{name} is {tall} m tall");
            assert!(wide > 0.3 * tall && wide < 2.0 * tall, "{name}: {wide} m wide, {tall} m tall");
            assert!(name == "Spruce" || deep < 0.5, "{name}: {deep}");
            // No leaf without a twig: its foot is on one.
            assert_eq!(plant.parts[2].is_empty(), name == "Dead");
            let used: HashSet<u32> = plant.parts.iter().flatten().flatten().copied().collect();
            assert_eq!(used.len(), plant.vertices.len());
            // The trunk leads to the top, the lowest branch of a tree begins above the ground.
            let top = plant.parts[0].iter().flatten().map(|&v| plant.vertices[v as usize].z).fold(0.0, f64::max);
            assert!(top > 0.6 * tall, "{name}: the trunk ends at {top} of {tall} m");
        }
    }
    // A spruce is widest below, a birch not.
    let widest = |kind: usize| {
        let plant = plants::shape(&TREES[kind], kind, 0, 1);
        let far = |at: &&DVec3| at.truncate().length();
        let tall = plant.vertices.iter().map(|at| at.z).fold(0.0, f64::max);
        plant.vertices.iter().max_by(|a, b| far(a).total_cmp(&far(b))).unwrap().z / tall
    };
    assert!(widest(2) < 0.3 && widest(1) > 0.3, "{} {}", widest(2), widest(1));
}

/// Heights of a map of 7 x 5 samples, rows from the north.
fn sample(column: usize, row: usize) -> f32 {
    100.0 + column as f32 * 2.0 + (row * row) as f32 * 0.5
}

fn samples() -> Vec<f32> {
    (0..35).map(|i| sample(i % 7, i / 7)).collect()
}

fn bare(file: &std::path::Path) -> Landscape {
    Landscape {
        size_m: [60.0, 40.0],
        trees_per_ha: 0.0,
        bushes_per_ha: 0.0,
        rocks_per_ha: 0.0,
        grass_per_m2: 0.0,
        path: false,
        stream: false,
        height_map: Some(HeightMap { file: file.to_owned(), range_m: None }),
        ..Landscape::default()
    }
}

fn write_tiff(path: &std::path::Path, keys: &[u16]) {
    use tiff::encoder::{TiffEncoder, colortype};
    use tiff::tags::Tag;
    let mut encoder = TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    let mut image = encoder.new_image::<colortype::Gray32Float>(7, 5).unwrap();
    image.encoder().write_tag(Tag::ModelPixelScaleTag, &[10.0, 10.0, 0.0][..]).unwrap();
    if !keys.is_empty() {
        image.encoder().write_tag(Tag::GeoKeyDirectoryTag, keys).unwrap();
    }
    image.encoder().write_tag(Tag::GdalNodata, "-9999").unwrap();
    image.write_data(&samples()).unwrap();
}

fn write_png(path: &std::path::Path, bits: png::BitDepth) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), 7, 5);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(bits);
    let mut writer = encoder.write_header().unwrap();
    let part = |height: f32| ((f64::from(height) - 100.0) / 20.0 * 65535.0).round() as u16;
    let bytes: Vec<u8> = samples().into_iter().flat_map(|height| part(height).to_be_bytes()).collect();
    let bytes = if bits == png::BitDepth::Sixteen { bytes } else { bytes[..35].to_vec() };
    writer.write_image_data(&bytes).unwrap();
}

fn grid() -> String {
    let mut text = "ncols 7\nnrows 5\nxllcorner 4000.5\nyllcorner 20\ncellsize 10\nNODATA_value -1\n".to_owned();
    for row in 0..5 {
        let line: Vec<String> = (0..7).map(|column| sample(column, row).to_string()).collect();
        text += &(line.join(" ") + "\n");
    }
    text
}

#[test]
fn height_maps_are_reproduced_at_their_samples() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_tiff(&at("a.tif"), &[]);
    write_png(&at("a.png"), png::BitDepth::Sixteen);
    fs::write(at("a.asc"), grid()).unwrap();
    for name in ["a.tif", "a.png", "a.asc"] {
        let mut landscape = bare(&at(name));
        if name == "a.png" {
            landscape.height_map.as_mut().unwrap().range_m = Some([100.0, 120.0]);
        }
        let scene = load(&landscape, 1);
        let ground = triangles(&scene, "terrain");
        for (column, row) in (0..35).map(|i| (i % 7, i / 7)) {
            // The first row is the north, y = 20.
            let place = DVec2::new(column as f64 * 10.0 - 30.0, 20.0 - row as f64 * 10.0);
            let found = height(&ground, place);
            assert!((found - f64::from(sample(column, row))).abs() < 2e-4, "{name} {column} {row}: {found}");
        }
        // On a finer grid, the samples are still there.
        let fine = landscape.land(1, &mut Vec::new()).unwrap().terrain;
        assert_eq!((fine.cells, fine.size), ([6, 4], [60.0, 40.0]));
        landscape.cell_m = Some(2.5);
        let finer = landscape.land(1, &mut Vec::new()).unwrap().terrain;
        assert_eq!(finer.cells, [24, 16]);
        assert!((finer.height(10.0, -10.0) - fine.height(10.0, -10.0)).abs() < 1e-4);
    }
}

#[test]
fn samples_without_a_height_take_that_of_a_neighbour() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.asc");
    fs::write(&file, "NCOLS 3\nNROWS 2\nCELLSIZE 20\nNODATA_VALUE -1\n1 -1 -1\n-1 -1 5\n").unwrap();
    let mut details = Vec::new();
    let land = bare(&file).land(1, &mut details).unwrap();
    let heights = &land.terrain.heights;
    assert_eq!((heights[3], heights[2]), (1.0, 5.0));
    assert!(heights.iter().all(|height| [1.0, 5.0].contains(height)), "{heights:?}");
    assert!(details.iter().any(|line| line.contains("4 without a height")), "{details:?}");
}

#[test]
fn bad_height_maps_are_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let message = |landscape: &Landscape| {
        let message = landscape.scene(0).unwrap_err().to_string();
        assert!(message.len() < 500 && !message.contains('\n'), "{message}");
        message
    };
    write_png(&at("8.png"), png::BitDepth::Eight);
    let mut encoder = tiff::encoder::TiffEncoder::new(fs::File::create(at("rgb.tif")).unwrap()).unwrap();
    encoder.write_image::<tiff::encoder::colortype::RGB8>(7, 5, &[0; 105]).unwrap();
    write_png(&at("a.png"), png::BitDepth::Sixteen);
    write_tiff(&at("degrees.tif"), &[1, 1, 0, 1, 1024, 0, 1, 2]);
    fs::write(at("text"), "hello").unwrap();
    let grids = [
        ("ncols 3\nnrows 2\n1 2 3 4 5 6", "cellsize"),
        ("ncols 3\nnrows 2\ncellsize 20\n1 2 3 4 5", "5 heights; allowed: 6, 3 x 2"),
        ("ncols 3\nnrows 2\ncellsize 20\n1 2 3 4 5 6 7", "row 2 column 0: more than 3 x 2 heights"),
        ("ncols 3\nnrows 2\ncellsize 20\n1 2 3 4 x5 6", "row 1 column 1: \"x5\"; allowed: a number"),
        ("ncols 9000000\nnrows 9000000\ncellsize 20\n1 2", "allowed: 25000000 in all"),
        ("ncols -3\nnrows 2\ncellsize 20\n1 2", "ncols: -3; allowed: 2 to 25000000"),
        ("ncols 3\nnrows 2\ncellsize 0\n1 2 3 4 5 6", "0 x 0 m from sample to sample"),
        ("ncols 3\nnrows 2\ncellsize 20\nfoo 7\n1 2 3 4 5 6", "foo: unknown key; allowed: ncols"),
        ("ncols 3\nnrows 2\ncellsize 20\n1 2 3 4 5 1e7", "a height of 10000000 m"),
        ("ncols 3\nnrows 2\ncellsize 20\n-9999 -9999 -9999 -9999 -9999 -9999", "no sample has a height"),
        ("ncols 3\nnrows 2\ncellsize", "cellsize: \"\"; allowed: a number"),
    ];
    for (number, (text, says)) in grids.iter().enumerate() {
        let file = at(&format!("{number}.asc"));
        fs::write(&file, text).unwrap();
        let message = message(&bare(&file));
        assert!(message.contains(says) && message.contains(".asc"), "{message}");
    }
    for (file, range_m, says) in [
        ("8.png", Some([0.0, 1.0]), "a PNG of 1 x 8 bits a pixel; allowed: 1 x 16 bits, grey"),
        ("rgb.tif", None, "a TIFF of 3 channels; allowed: one channel of numbers"),
        ("a.png", None, "height_map.range_m is missing"),
        ("a.png", Some([4.0, 4.0]), "height_map.range_m is 4,4; allowed: two numbers that rise"),
        ("a.png", Some([f64::NAN, 4.0]), "height_map.range_m is NaN,4"),
        ("degrees.tif", None, "its coordinates are in degrees"),
        ("degrees.tif", Some([0.0, 1.0]), "degrees"),
        ("text", None, "not a height map; allowed: a PNG of 16 bits"),
        ("none.tif", None, "none.tif: No such file"),
    ] {
        let landscape = Landscape { height_map: Some(HeightMap { file: at(file), range_m }), ..bare(&at(file)) };
        let message = message(&landscape);
        assert!(message.contains(says), "{message}");
    }
    // Truncated or corrupted files are read or refused.
    write_tiff(&at("a.tif"), &[]);
    for (name, range_m) in [("a.tif", None), ("a.png", Some([0.0, 1.0]))] {
        let whole = fs::read(at(name)).unwrap();
        for change in 0..whole.len().min(400) {
            let (mut flipped, cut) = (whole.clone(), &whole[..change]);
            flipped[change] ^= 0xff;
            for bytes in [cut, &flipped] {
                fs::write(at("x"), bytes).unwrap();
                let landscape = Landscape { height_map: Some(HeightMap { file: at("x"), range_m }), ..bare(&at("x")) };
                if let Err(error) = landscape.land(0, &mut Vec::new()) {
                    assert!(error.to_string().len() < 500);
                }
            }
        }
    }
}

#[test]
fn bad_parameters_are_named() {
    let usual = Landscape::default;
    for (landscape, says) in [
        (Landscape { size_m: [9.0, 50.0], ..usual() }, "size_m is 9; allowed: 10 to 10000"),
        (Landscape { size_m: [50.0, f64::NAN], ..usual() }, "size_m is NaN"),
        (Landscape { cell_m: Some(0.01), ..usual() }, "cell_m is 0.01; allowed: 0.0448 to 25: land of 100 x 100 m"),
        (Landscape { cell_m: Some(30.0), ..usual() }, "cell_m is 30"),
        (Landscape { relief_m: -1.0, ..usual() }, "relief_m is -1; allowed: 0 to 5000"),
        (Landscape { trees_per_ha: 5001.0, ..usual() }, "trees_per_ha is 5001; allowed: 0 to 5000"),
        (Landscape { bushes_per_ha: -1.0, ..usual() }, "bushes_per_ha is -1"),
        (Landscape { rocks_per_ha: f64::NAN, ..usual() }, "rocks_per_ha is NaN"),
        (Landscape { grass_per_m2: 31.0, ..usual() }, "grass_per_m2 is 31; allowed: 0 to 30"),
        (
            Landscape { size_m: [8000.0, 8000.0], cell_m: Some(100.0), ..usual() },
            "trees_per_ha is 300; allowed: 0 to 156.25",
        ),
    ] {
        let error = landscape.scene(0).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn parameters_are_sections_of_yaml() {
    let text = "size_m: [50, 40]\nstream: false\nheight_map: {file: a.tif}\n";
    let read: Landscape = yaml::from_str("text", text).unwrap();
    let height_map = Some(HeightMap { file: "a.tif".into(), range_m: None });
    assert_eq!(read, Landscape { size_m: [50.0, 40.0], stream: false, height_map, ..Landscape::default() });
    let again: Landscape = yaml::from_str("text", &yaml::to_string(&read).unwrap()).unwrap();
    assert_eq!(again, read);
    let error = yaml::from_str::<Landscape>("text", "tree_per_ha: 5").unwrap_err().to_string();
    assert!(error.contains("trees_per_ha"), "{error}");
    let seabed: Seabed = yaml::from_str("text", "depth_m: 7\nripples: {wavelength_m: 0.5, height_m: 0.02}").unwrap();
    assert_eq!((seabed.depth_m, seabed.ripples.unwrap().height_m, seabed.fish), (7.0, 0.02, 60));
}

#[test]
fn the_landscape_of_the_paper_has_trees_rocks_and_grass() {
    let made = Landscape { size_m: [40.0, 40.0], ..Landscape::paper() }.scene(1).unwrap();
    let mut found: Vec<&str> = made.categories.iter().map(|(name, _)| *name).collect();
    found.sort_unstable();
    assert_eq!(found, ["grass", "rock", "terrain", "tree"]);
    // Its sensor is not inside a tree, even without a path.
    let scene = made.load(&LoadOptions::default()).unwrap();
    let lidar = scene.camera("Lidar").unwrap().pose.position;
    assert!(of_category(&scene, "tree").iter().all(|tree| place(tree).distance(lidar) > 2.0));
    assert!((lidar.z - height(&triangles(&scene, "terrain"), lidar.truncate()) - 1.8).abs() < 0.01);
}
