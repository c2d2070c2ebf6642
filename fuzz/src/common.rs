//! What the fuzz targets of the scene readers share.

use echocast::scene::Part;
use echocast::{Engine, FieldSet, LiveScene, Pose, ScanOptions, Scene, Sensor, Trajectory};
use std::collections::HashSet;
use std::sync::Arc;

/// Scenes up to here are built too: Embree is the slow part.
const MOST_TO_BUILD: usize = 1000;

/// Texture coordinates that are sampled besides a part's own.
const UVS: [[f32; 2]; 5] = [[0.0, 0.0], [0.999, -7.3], [3e38, 0.5], [0.5, f32::NAN], [f32::INFINITY, 1.0]];

/// Asserts what the module `scene` promises of every scene that has been read.
pub fn check(scene: &Scene) {
    assert!(scene.triangle_count() > 0);
    // What changes its shape may have triangles that open up.
    let still: HashSet<_> =
        scene.objects.iter().filter(|object| object.motion.is_none()).map(|object| Arc::as_ptr(&object.mesh)).collect();
    for mesh in scene.meshes() {
        assert!(!mesh.parts.is_empty());
        mesh.parts.iter().for_each(|part| check_part(part, still.contains(&Arc::as_ptr(mesh))));
    }
    for material in &scene.materials {
        let fractions = material.base_color.into_iter().chain([material.metallic, material.roughness]);
        assert!(
            fractions.chain(material.reflectance.as_ref().map(|own| own.at(905.0))).all(|x| (0.0..=1.0).contains(&x))
        );
        assert!(material.ior >= 1.0);
    }
    for object in &scene.objects {
        assert!(object.world_from_object.is_finite());
        assert_eq!(object.part_ids.len(), object.mesh.parts.len());
    }
    let (low, high) = scene.bounds().expect("a box around the triangles");
    assert!(low.abs().max(high.abs()).max_element() <= 1e18);
    if scene.triangle_count() < MOST_TO_BUILD {
        scene.build().expect("the scene can be built");
        if scene.is_moving() {
            play(scene);
        }
    }
}

/// Scans it while it moves.
fn play(scene: &Scene) {
    thread_local! {
        static ENGINE: Engine = Engine::with_threads(1).expect("an engine");
    }
    const SENSOR: &str = "{name: s, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 360, step_deg: 30}, \
        elevation: {fov_deg: 120, step_deg: 30}}}";
    let sensor = Sensor::from_yaml(SENSOR, "").expect("a sensor");
    let mut live = LiveScene::new(&ENGINE.with(Engine::clone));
    live.add_scene(scene).expect("what can be built can be added");
    for (start_time, length) in [(0.0, 0.1), (0.7, sensor.scan_time()), (-1.0, 3.0)] {
        live.set_time(start_time, length).expect("a time");
        // What moves may take too much memory.
        let Ok(built) = live.commit() else { continue };
        if length < sensor.scan_time() {
            continue;
        }
        let options = ScanOptions::default().start_time(start_time).fields(FieldSet::all());
        let cloud = built.scan(&sensor, &Trajectory::fixed(Pose::IDENTITY), &options).expect("it can be scanned");
        assert!(cloud.columns().x().iter().all(|x| !x.is_nan()));
    }
}

fn check_part(part: &Part, is_still: bool) {
    let vertices = part.positions.len();
    assert!(!part.triangles.is_empty());
    assert!(part.positions.iter().flatten().all(|x| x.abs() <= 1e18));
    for triangle in part.triangles.iter() {
        let corners = triangle.map(|index| part.positions[index as usize].map(f64::from));
        let [ab, ac] = [1, 2].map(|i| [0, 1, 2].map(|axis| corners[i][axis] - corners[0][axis]));
        let area = [(1, 2), (2, 0), (0, 1)].map(|(u, v)| ab[u] * ac[v] - ab[v] * ac[u]);
        assert!(area != [0.0; 3] || !is_still, "a degenerate triangle");
    }
    if let Some(normals) = &part.normals {
        assert_eq!(normals.len(), vertices);
        let length = |n: &[f32; 3]| n.iter().map(|x| x * x).sum::<f32>();
        assert!(normals.iter().all(|normal| (length(normal) - 1.0).abs() < 1e-5));
    }
    assert!(part.uvs.as_ref().is_none_or(|uvs| uvs.len() == vertices));
    let Some(use_) = part.material.as_ref().and_then(|material| material.base_color_texture.as_ref()) else { return };
    let own = part.uvs.iter().flat_map(|uvs| uvs.iter().take(20));
    for &uv in own.chain(&UVS) {
        let color = use_.sample(uv);
        assert!(color.iter().all(|x| (-1e-6..=1.000_001).contains(x)), "{color:?} at {uv:?}");
    }
}
