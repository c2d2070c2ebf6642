//! Scenes as other programs write them: compressed, quantised, or in other formats, they give the same scan.

use echocast::{Field, LoadOptions, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::{python, root};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    root().join("tests/data/scenes/compressed").join(name)
}

/// Ranges by beam.
fn ranges(scene: &Scene) -> BTreeMap<u32, f32> {
    const SENSOR: &str = "{name: s, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 360, step_deg: 2}, \
        elevation: {fov_deg: 60, step_deg: 2}}}";
    let sensor = Sensor::from_yaml(SENSOR, "").unwrap();
    let options = ScanOptions { fields: [Field::Beam, Field::Range].into_iter().collect(), ..ScanOptions::default() };
    let pose = Trajectory::fixed(Pose::at(0.3, 0.2, 1.0));
    let cloud = scene.build().unwrap().scan(&sensor, &pose, &options).unwrap();
    cloud.columns.beam.iter().copied().zip(cloud.columns.range.iter().copied()).collect()
}

/// Asserts that `scene` gives the scan of the plain file to `tolerance`, m, along and across the beams.
fn same_scan(scene: &Scene, plain: &BTreeMap<u32, f32>, tolerance: f32, what: &str) {
    let found = ranges(scene);
    assert!(plain.len() > 1500, "{}", plain.len());
    let near = |(beam, range): (&u32, &f32)| found.get(beam).is_some_and(|other| (range - other).abs() < tolerance);
    let off = plain.iter().filter(|&(beam, range)| !near((beam, range))).count() + found.len().abs_diff(plain.len());
    // Beams along an edge may pass it on either side.
    assert!(off * 100 < plain.len(), "{what}: {off} of {} beams differ", plain.len());
}

#[test]
fn compressed_and_quantised_files_give_the_scan_of_the_plain_one() {
    let plain = Scene::load(file("plain.glb")).unwrap();
    let expected = ranges(&plain);
    for (name, tolerance) in [
        // Positions of 14 bits over 20 m; at a slant they count several times.
        ("quantized.glb", 0.01),
        ("meshopt.glb", 0.01),
        ("pack_khr.glb", 0.01),
        // Rotations of 12 bits too.
        ("pack_instanced.glb", 0.03),
        ("pack_float.glb", 1e-4),
        ("draco_edgebreaker.glb", 0.01),
        ("draco_sequential.glb", 0.01),
    ] {
        let scene = Scene::load(file(name)).unwrap();
        same_scan(&scene, &expected, tolerance, name);
        let balls = scene.objects.iter().filter(|object| object.name == "Ball").count();
        let mesh = scene.objects.iter().filter(|object| object.mesh.name == "ball").count();
        assert!(balls == 5 || mesh == 5 || name.starts_with("pack_"), "{name}: {balls} balls, {mesh} of the mesh");
        assert_eq!(scene.objects.len(), 6, "{name}");
        let materials: Vec<_> = scene.materials.iter().map(|material| &*material.name).collect();
        assert!(materials.contains(&"ball_paint") || name.starts_with("pack_"), "{name}: {materials:?}");
        let unexpected = scene.report.warnings.iter().find(|warning| !warning.contains("without area left out"));
        assert!(unexpected.is_none(), "{name}: {unexpected:?}");
    }
}

/// Writes the scene at `from` in other formats to `folder`, by `readers/meshes.py`.
fn converted(from: &Path, folder: &Path) {
    let script = root().join("tests/readers/meshes.py");
    let output = python().arg(script).arg(from).arg(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn ply_stl_and_obj_files_of_another_program_give_the_scan_of_the_gltf_file() {
    let expected = ranges(&Scene::load(file("plain.glb")).unwrap());
    let folder = tempfile::tempdir().unwrap();
    converted(&file("plain.glb"), folder.path());
    for name in ["text.ply", "binary.ply", "big.ply", "text.stl", "binary.stl", "scene.obj"] {
        let scale = if name == "binary.stl" { 0.001 } else { 1.0 };
        let options = LoadOptions { up: echocast::scene::UpAxis::Y, scale, ..LoadOptions::default() };
        let scene = Scene::load_with(folder.path().join(name), &options).unwrap();
        same_scan(&scene, &expected, 1e-3, name);
        let vertices: usize = scene.meshes().iter().flat_map(|mesh| &mesh.parts).map(|part| part.positions.len()).sum();
        assert!(vertices < scene.triangle_count(), "{name}: {vertices} vertices");
    }
}
