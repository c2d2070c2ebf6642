//! Scenes as other programs write them: compressed, quantised, or in other formats, they give the same scan.

use echocast::{Field, LoadOptions, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::{python, root};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    root().join("tests/data/scenes/compressed").join(name)
}

/// Range, m, and cosine of the angle of incidence by beam.
fn ranges(scene: &Scene) -> BTreeMap<u32, [f32; 2]> {
    const SENSOR: &str = "{name: s, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 360, step_deg: 2}, \
        elevation: {fov_deg: 60, step_deg: 2}}}";
    let sensor = Sensor::from_yaml(SENSOR, "").unwrap();
    let fields = [Field::Beam, Field::Range, Field::CosIncidence].into_iter().collect();
    let options = ScanOptions::default().fields(fields);
    let pose = Trajectory::fixed(Pose::at(0.3, 0.2, 1.0));
    let cloud = scene.build().unwrap().scan(&sensor, &pose, &options).unwrap();
    let c = cloud.columns();
    let found = c.range().iter().zip(c.cos_incidence()).map(|(&range, &cosine)| [range, cosine]);
    c.beam().iter().copied().zip(found).collect()
}

/// Asserts that `scene` gives the scan of the plain file to `tolerance`, m, across the surfaces.
fn same_scan(scene: &Scene, plain: &BTreeMap<u32, [f32; 2]>, tolerance: f32, what: &str) {
    let found = ranges(scene);
    assert!(plain.len() > 1500, "{}", plain.len());
    let near = |(beam, [range, cosine]): (&u32, &[f32; 2])| {
        found.get(beam).is_some_and(|[other, _]| (range - other).abs() * cosine < tolerance)
    };
    let off = plain.iter().filter(|&found| !near(found)).count() + found.len().abs_diff(plain.len());
    // Beams along an edge may pass it on either side.
    assert!(off * 1000 <= plain.len() * 2, "{what}: {off} of {} beams differ", plain.len());
}

#[test]
fn compressed_and_quantised_files_give_the_scan_of_the_plain_one() {
    let plain = Scene::load(file("plain.glb")).unwrap();
    let expected = ranges(&plain);
    for (name, tolerance) in [
        // Positions of 14 bits over 20 m: half a step along each axis.
        ("quantized.glb", 1.1e-3),
        ("meshopt.glb", 1.1e-3),
        ("pack_khr.glb", 1.1e-3),
        // Rotations of 12 bits too, about a point 14 m from the balls.
        ("pack_instanced.glb", 7e-3),
        ("pack_float.glb", 1e-4),
        ("draco_edgebreaker.glb", 1.1e-3),
        ("draco_sequential.glb", 1.1e-3),
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
        let options = LoadOptions::default().up(echocast::scene::UpAxis::Y).scale(scale);
        let scene = Scene::load_with(folder.path().join(name), &options).unwrap();
        same_scan(&scene, &expected, 1e-3, name);
        let vertices: usize = scene.meshes().iter().flat_map(|mesh| &mesh.parts).map(|part| part.positions.len()).sum();
        assert!(vertices < scene.triangle_count(), "{name}: {vertices} vertices");
    }
}
