//! Tests with animated files.

use super::gltf::{Edit, F32, File, close, load_with, only_warning, push, world_vertex};
use super::vertices_at;
use crate::scene::{LoadOptions, Scene};
use glam::{DAffine3, DQuat, DVec3};
use model::material::Reflectance;
use model::motion::{Deformation, Pull};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::sync::Arc;

impl File {
    /// Adds a channel to the last animation, or to a new one named `clip`.
    fn channel(&mut self, clip: &str, target: Value, interpolation: &str, times: &[f32], output: usize) {
        if self.json.get("animations").is_none() {
            self.json["animations"] = json!([]);
        }
        let known = self.json["animations"].as_array().unwrap().last().map(|last| last["name"] == clip);
        if known != Some(true) {
            push(&mut self.json["animations"], json!({"name": clip, "channels": [], "samplers": []}));
        }
        let input = self.floats("SCALAR", times);
        let last = self.json["animations"].as_array().unwrap().len() - 1;
        let animation = &mut self.json["animations"][last];
        let sampler = json!({"input": input, "output": output, "interpolation": interpolation});
        let sampler = push(&mut animation["samplers"], sampler);
        push(&mut animation["channels"], json!({"sampler": sampler, "target": target}));
    }

    /// Animates `path` of `node` with `values` of accessor type `kind`.
    fn animate(&mut self, node: usize, path: &str, times: &[f32], kind: &str, values: &[f32]) {
        let output = self.floats(kind, values);
        self.channel("clip", json!({"node": node, "path": path}), "LINEAR", times, output);
    }

    /// Animates the property that `pointer` refers to.
    fn point(&mut self, pointer: &str, interpolation: &str, times: &[f32], kind: &str, values: &[f32]) {
        let output = self.floats(kind, values);
        let target = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
        self.channel("clip", target, interpolation, times, output);
    }

    /// A triangle that moves 2 m along x within 2 s.
    fn slide() -> File {
        let mut file = File::triangle();
        file.animate(0, "translation", &[0.0, 2.0], "VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
        file
    }

    /// A strip 2 long and 1 wide with six vertices, upright along x; its right end follows joint 1, a node at (1, 0, 0)
    /// below joint 0, the middle both.
    fn bar() -> File {
        let mut file = File::triangle();
        let positions = [0.0, 1.0, 2.0].iter().flat_map(|&x| [[x, 0.0, 0.0], [x, 1.0, 0.0]]).flatten();
        let positions = file.floats("VEC3", &positions.collect::<Vec<f32>>());
        let normals = file.floats("VEC3", &[0.0, 0.0, 1.0].repeat(6));
        let triangles = file.accessor("SCALAR", 5121, 12, &[0, 2, 1, 1, 2, 3, 2, 4, 3, 3, 4, 5]);
        let joints: Vec<u8> =
            [[0, 0], [0, 0], [0, 1], [0, 1], [1, 0], [1, 0]].iter().flat_map(|&[a, b]| [a, b, 0, 0]).collect();
        let joints = file.accessor("VEC4", 5121, 6, &joints);
        let weights = [[1.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.5, 0.5], [1.0, 0.0], [1.0, 0.0]];
        let weights: Vec<f32> = weights.iter().flat_map(|&[a, b]| [a, b, 0.0, 0.0]).collect();
        let weights = file.floats("VEC4", &weights);
        *file.primitive() = json!({"attributes": {"POSITION": positions, "NORMAL": normals, "JOINTS_0": joints,
            "WEIGHTS_0": weights}, "indices": triangles});
        let matrix = |x: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -x, 0.0, 0.0, 1.0];
        let matrices = file.floats("MAT4", &[matrix(0.0), matrix(1.0)].concat());
        file.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": matrices, "name": "arm"}]);
        file.json["nodes"] = json!([
            {"name": "Bar", "mesh": 0, "skin": 0, "translation": [100, 200, 300]},
            {"children": [2], "translation": [5, 0, 0]},
            {"translation": [1, 0, 0]},
        ]);
        file
    }

    /// Bends the bar by 90 degrees up within 1 s.
    fn bend(&mut self) {
        let up = DQuat::from_rotation_z(FRAC_PI_2).as_quat().to_array();
        let still = [0.0, 0.0, 0.0, 1.0];
        self.animate(2, "rotation", &[0.0, 1.0], "VEC4", &[still, up].concat());
    }

    /// A triangle with two morph targets: the second vertex moves to x = 3, the third is lifted by 1 along z.
    fn morphing() -> File {
        let mut file = File::triangle();
        let far = file.floats("VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let indices = file.view(&[2]);
        let values = file.view(bytemuck::cast_slice(&[0.0f32, 0.0, 1.0]));
        let sparse = json!({"count": 1, "indices": {"bufferView": indices, "componentType": 5121},
            "values": {"bufferView": values}});
        let lifted = json!({"componentType": F32, "type": "VEC3", "count": 3, "sparse": sparse});
        let lifted = push(&mut file.json["accessors"], lifted);
        file.primitive()["targets"] = json!([{"POSITION": far}, {"POSITION": lifted}]);
        file
    }

    fn moving(&self) -> Scene {
        let scene = self.load().unwrap();
        assert!(scene.report.warnings.is_empty(), "{:?}", scene.report);
        scene
    }

    fn with(&self, options: &LoadOptions) -> Scene {
        load_with(&self.bytes(), options).unwrap()
    }
}

fn vertex_at(scene: &Scene, vertex: usize, time: f64) -> DVec3 {
    vertices_at(scene, &scene.objects[0], 0, time)[vertex]
}

fn shape(scene: &Scene) -> &Arc<Deformation> {
    scene.objects[0].motion.as_ref().unwrap().shape.as_ref().unwrap()
}

#[test]
fn animated_nodes_move_with_their_descendants() {
    let mut file = File::slide();
    push(&mut file.json["nodes"], json!({"mesh": 0, "name": "Still"}));
    push(&mut file.json["nodes"], json!({"translation": [0, 7, 0], "children": [0, 4]}));
    push(&mut file.json["nodes"], json!({"mesh": 0, "name": "Load", "translation": [0, 0, 5]}));
    push(&mut file.json["nodes"], json!({"camera": 0, "name": "Beside"}));
    file.node()["children"] = json!([3]);
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    let scene = file.moving();
    assert_eq!((&scene.animations[..], &scene.animation_lengths[..]), (&["clip".to_owned()][..], &[2.0][..]));
    assert_eq!(scene.timeline.nodes.len(), 3, "what is above the animated node is one, and nothing else is there");
    let object = |name: &str| scene.objects.iter().find(|object| object.name == name).unwrap();
    assert!(object("Still").motion.is_none() && scene.cameras[0].node.is_none());
    for (time, x) in [(-1.0, 0.0), (0.0, 0.0), (0.5, 0.5), (2.0, 2.0), (9.0, 2.0)] {
        close(vertices_at(&scene, object("Chair"), 0, time)[0], DVec3::new(x, 0.0, 7.0), 1e-12);
        close(vertices_at(&scene, object("Load"), 0, time)[0], DVec3::new(x, -5.0, 7.0), 1e-12);
    }
    close(world_vertex(&scene, 0, 0), DVec3::ZERO, 0.0);
    // Two files in one scene.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.glb");
    std::fs::write(&path, file.bytes()).unwrap();
    let two = Scene::load_all(&[&path, &path], &LoadOptions::default()).unwrap();
    assert_eq!((two.timeline.nodes.len(), two.animation_lengths.len()), (6, 2));
    for (a, b) in two.objects.iter().zip(two.objects.iter().skip(3)) {
        assert_eq!(vertices_at(&two, a, 0, 0.7), vertices_at(&two, b, 0, 0.7));
    }
}

#[test]
fn a_still_file_stays_as_it_was() {
    let file = File::triangle();
    let before = file.moving();
    let animated = |edit: Edit| {
        let mut file = file.clone();
        edit(&mut file);
        file.moving()
    };
    let cases: [Edit; 4] = [
        &|_| (),
        // One value at all times, which differs from that without the animation.
        &|file| {
            file.node()["translation"] = json!([4, 4, 4]);
            file.animate(0, "translation", &[0.5, 1.0], "VEC3", &[0.0; 6]);
        },
        &|file| file.animate(0, "scale", &[3.0], "VEC3", &[1.0; 3]),
        // A node that is not in the scene.
        &|file| {
            push(&mut file.json["nodes"], json!({"mesh": 0}));
            file.json["scenes"] = json!([{"nodes": [0]}]);
            file.animate(1, "scale", &[0.0, 1.0], "VEC3", &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
        },
    ];
    for edit in cases {
        let scene = animated(edit);
        assert!(scene.timeline.nodes.is_empty() && scene.objects[0].motion.is_none());
        assert_eq!(scene.objects[0].world_from_object, before.objects[0].world_from_object);
    }
}

#[test]
fn every_interpolation_is_played() {
    let at = |interpolation: &str, values: &[f32], time: f64| {
        let mut file = File::triangle();
        let output = file.floats("VEC3", values);
        file.channel("clip", json!({"node": 0, "path": "translation"}), interpolation, &[1.0, 3.0], output);
        vertex_at(&file.moving(), 0, time).x
    };
    let ends = [5.0, 0.0, 0.0, 9.0, 0.0, 0.0];
    assert_eq!([0.0, 1.0, 2.9, 3.0].map(|time| at("STEP", &ends, time)), [5.0, 5.0, 5.0, 9.0]);
    assert_eq!([0.0, 1.0, 2.0, 3.0].map(|time| at("LINEAR", &ends, time)), [5.0, 5.0, 7.0, 9.0]);
    let mut spline = [0.0; 18];
    // Values 5 and 9, slopes 3 per second after the first and -1 before the second; the outer tangents do not matter.
    (spline[0], spline[3], spline[6], spline[9], spline[12], spline[15]) = (77.0, 5.0, 3.0, -1.0, 9.0, -77.0);
    // (5 + 9) / 2 + 2 s (3 + 1) / 8.
    for (time, x) in [(0.0, 5.0), (2.0, 8.0), (4.0, 9.0)] {
        assert!((at("CUBICSPLINE", &spline, time) - x).abs() < 1e-12, "{time}");
    }
}

/// A chain with rotations, non-uniform scales and a matrix, compared with products of matrices.
#[test]
fn a_chain_is_the_product_of_its_places() {
    let mut file = File::triangle();
    let shear = DAffine3::from_cols_array(&[1.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 9.0, 8.0, 7.0]);
    file.json["nodes"] = json!([
        {"mesh": 0, "scale": [1, 2, 3]},
        {"matrix": glam::DMat4::from(shear).to_cols_array(), "children": [0]},
        {"scale": [2, 1, 0.5], "rotation": [0, 0, 0, 1], "children": [1]},
    ]);
    let (a, b) = (DQuat::from_rotation_x(0.3), DQuat::from_rotation_x(1.5));
    let turns = [a, -b].map(|q| q.as_quat().to_array()).concat();
    file.animate(2, "rotation", &[0.0, 4.0], "VEC4", &turns);
    let rise = [0.0, 0.0, 0.0, 0.0, 8.0, 0.0];
    file.animate(0, "translation", &[1.0, 3.0], "VEC3", &rise);
    let scene = file.moving();
    let y_up = DAffine3::from_quat(DQuat::from_rotation_x(FRAC_PI_2));
    for (time, angle, height) in [(0.0, 0.3, 0.0), (1.0, 0.6, 0.0), (1.5, 0.75, 2.0), (4.0, 1.5, 8.0)] {
        let world = y_up
            * DAffine3::from_quat(DQuat::from_rotation_x(angle))
            * DAffine3::from_scale(DVec3::new(2.0, 1.0, 0.5))
            * shear
            * DAffine3::from_translation(DVec3::Y * height)
            * DAffine3::from_scale(DVec3::new(1.0, 2.0, 3.0));
        close(vertex_at(&scene, 2, time), world.transform_point3(DVec3::Y), 2e-6);
    }
}

#[test]
fn one_animation_may_be_chosen_and_all_may_be_repeated() {
    let mut file = File::slide();
    let lift = file.floats("VEC3", &[1.0, 1.0, 1.0, 1.0, 3.0, 1.0]);
    file.channel("lift", json!({"node": 0, "path": "scale"}), "LINEAR", &[0.0, 4.0], lift);
    let place =
        |options: &LoadOptions, time| vertices_at(&file.with(options), &file.with(options).objects[0], 0, time)[2];
    let all = LoadOptions::default();
    close(place(&all, 3.0), DVec3::new(2.0, 0.0, 2.5), 1e-12);
    // Each has its own period.
    let looped = LoadOptions { looped: true, ..LoadOptions::default() };
    close(place(&looped, 3.0), DVec3::new(1.0, 0.0, 2.5), 1e-12);
    close(place(&looped, 4.0), DVec3::new(0.0, 0.0, 1.0), 1e-12);
    let only = LoadOptions { animation: Some("lift".into()), ..LoadOptions::default() };
    close(place(&only, 3.0), DVec3::new(0.0, 0.0, 2.5), 1e-12);
    assert_eq!(file.with(&only).animation_lengths, [2.0, 4.0]);
    let wrong = LoadOptions::from_yaml("{animation: lifd, loop: true}").unwrap();
    assert!(wrong.looped);
    let error = Scene::from_glb_bytes(&file.bytes(), &wrong).unwrap_err().to_string();
    assert_eq!(error, "there is no animation named \"lifd\"; near: lift");

    let mut short = File::triangle();
    short.animate(0, "translation", &[0.0, 1e-9], "VEC3", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let error = load_with(&short.bytes(), &looped).unwrap_err().to_string();
    assert!(error.starts_with("street.glb: animation 0 \"clip\": it takes 9.9999997"), "{error}");
    assert!(error.ends_with(" s; allowed to be repeated: 0.001 s and more"), "{error}");
}

#[test]
fn the_last_of_two_channels_of_a_property_is_played() {
    let mut file = File::slide();
    file.point("/nodes/0/translation", "STEP", &[0.0, 1.0], "VEC3", &[7.0, 0.0, 0.0, 8.0, 0.0, 0.0]);
    let scene = file.load().unwrap();
    assert_eq!(vertex_at(&scene, 0, 0.5).x, 7.0);
    let expected =
        "street.glb: of the channels that animate one property, the last is played: animation 0 \"clip\" channel 1";
    assert_eq!(only_warning(&scene), expected);
}

#[test]
fn what_is_not_played_is_named_once_per_kind() {
    let mut file = File::slide();
    file.json["extensionsRequired"] = json!(["KHR_animation_pointer", "KHR_node_visibility"]);
    for number in 0..3 {
        file.point(&format!("/cameras/{number}/perspective/yfov"), "LINEAR", &[1.0], "SCALAR", &[1.0]);
    }
    file.point("/nodes/0/weights/1", "LINEAR", &[1.0], "SCALAR", &[1.0]);
    let none = file.floats("VEC3", &[0.0; 3]);
    file.channel("clip", json!({"path": "translation"}), "LINEAR", &[7.0], none);
    let scene = file.load().unwrap();
    let names = "/cameras/N/perspective/yfov, /nodes/N/weights/N, translation of no node";
    assert_eq!(only_warning(&scene), format!("street.glb: animations of these are not played: {names}"));
    assert_eq!(scene.animation_lengths, [7.0]);
}

#[test]
fn invisible_objects_are_left_out_and_visibility_is_animated() {
    let mut file = File::triangle();
    let visible = |visible: bool| json!({"KHR_node_visibility": {"visible": visible}});
    file.json["nodes"] = json!([
        {"mesh": 0, "name": "a", "extensions": visible(true)},
        {"mesh": 0, "name": "b", "extensions": visible(false), "children": [2]},
        {"mesh": 0, "name": "c", "extensions": visible(true), "camera": 0},
        {"mesh": 0, "name": "d", "extensions": visible(false)},
        {"mesh": 0, "name": "e", "children": [5]},
        {"mesh": 0, "name": "f"},
    ]);
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    let blink = file.accessor("SCALAR", 5121, 3, &[1, 0, 1]);
    let target = |node| {
        let pointer = format!("/nodes/{node}/extensions/KHR_node_visibility/visible");
        json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}})
    };
    file.channel("clip", target(3), "STEP", &[0.0, 1.0, 2.0], blink);
    let never = file.accessor("SCALAR", 5121, 1, &[0]);
    file.channel("clip", target(4), "STEP", &[0.0], never);
    let scene = file.moving();
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!((names, scene.cameras.len()), (vec!["a", "d"], 1));
    assert!(scene.objects[0].motion.is_none());
    let node = scene.objects[1].motion.as_ref().unwrap().node;
    assert_eq!([0.5, 1.5, 2.5].map(|time| scene.timeline.is_visible(node, time)), [true, false, true]);
    file.json["nodes"][0]["extensions"] = json!({"KHR_node_visibility": {"visible": 1}});
    let message = "street.glb: node 0 \"a\": KHR_node_visibility: visible is not a boolean; allowed: true, false";
    assert_eq!(file.error(), message);
}

/// A skinned mesh is where its skeleton is, but its node still determines its visibility.
#[test]
fn a_skin_follows_the_visibility_of_its_node() {
    let mut file = File::bar();
    push(&mut file.json["nodes"], json!({"children": [0]}));
    file.json["nodes"].as_array_mut().unwrap().push(json!({"children": [3]}));
    for (node, values) in [(3, [1.0, 0.0]), (4, [0.0, 1.0])] {
        let pointer = format!("/nodes/{node}/extensions/KHR_node_visibility/visible");
        file.point(&pointer, "STEP", &[0.0, 1.0 + node as f32], "SCALAR", &values);
    }
    let scene = file.moving();
    let motion = scene.objects[0].motion.as_ref().unwrap();
    assert!(motion.shape.is_none());
    let seen = [0.0, 4.5, 6.0].map(|time| scene.timeline.is_visible(motion.node, time));
    assert_eq!(seen, [false, false, false]);
    assert_eq!(scene.timeline.world_from_node(motion.node, 2.0), scene.objects[0].world_from_object);
}

#[test]
fn instances_follow_moving_nodes() {
    let mut file = File::slide();
    let translation = file.floats("VEC3", &[0.0, 0.0, 0.0, 10.0, 0.0, 0.0]);
    file.node()["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation}}});
    let scene = file.moving();
    let x = |time| [0, 1].map(|object| vertices_at(&scene, &scene.objects[object], 0, time)[0].x);
    assert_eq!((x(0.0), x(1.0)), ([0.0, 10.0], [1.0, 11.0]));
    assert_eq!(scene.meshes().len(), 1);
}

#[test]
fn objects_scaled_up_from_zero_are_kept() {
    let mut file = File::triangle();
    file.animate(0, "scale", &[0.0, 1.0], "VEC3", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let scene = file.moving();
    assert_eq!(vertex_at(&scene, 1, 0.5), DVec3::X * 0.5);
}

#[test]
fn two_bones_bend_a_bar() {
    let mut file = File::bar();
    let still = file.moving();
    assert!(still.objects[0].motion.is_none() && still.timeline.nodes.is_empty());
    // The transform of its own node is ignored (glTF 2.0, 3.7.3.3); its skeleton is at x = 5.
    close(world_vertex(&still, 0, 5), DVec3::new(7.0, 0.0, 1.0), 1e-6);

    file.bend();
    let scene = file.moving();
    assert_eq!(scene.objects[0].world_from_object, DAffine3::from_translation(DVec3::X * 5.0));
    for vertex in 0..6 {
        close(world_vertex(&scene, 0, vertex), world_vertex(&still, 0, vertex), 1e-6);
    }
    // The end of the bar turns about the second joint, at (6, 0, 0); the middle moves half of the way.
    let end = |time: f64| {
        let (sin, cos) = (time * FRAC_PI_2).sin_cos();
        [DVec3::new(6.0 + cos, 0.0, sin), DVec3::new(6.0 + cos - sin, 0.0, sin + cos)]
    };
    for time in [0.0f64, 0.25, 0.5, 1.0, 3.0] {
        let [low, high] = end(time.min(1.0));
        close(vertex_at(&scene, 4, time), low, 2e-6);
        close(vertex_at(&scene, 5, time), high, 2e-6);
        close(vertex_at(&scene, 1, time), DVec3::new(5.0, 0.0, 1.0), 2e-6);
        close(vertex_at(&scene, 2, time), DVec3::new(6.0, 0.0, 0.0), 2e-6);
        let turned = DVec3::new(6.0 - (time.min(1.0) * FRAC_PI_2).sin(), 0.0, (time.min(1.0) * FRAC_PI_2).cos());
        close(vertex_at(&scene, 3, time), 0.5 * (DVec3::new(6.0, 0.0, 1.0) + turned), 2e-6);
    }
    // Flat as modelled, but vertices are shared: normals are kept, and point across the bar.
    let mut normals = Vec::new();
    let frame = scene.objects[0].world_from_object;
    let Pull { weights, palette } = shape(&scene).pull(&scene.timeline, 0.7, &frame);
    shape(&scene).vertices.parts[0].turn(&weights, &palette, &mut normals);
    assert_eq!(normals.len(), 6);
    for normal in &normals {
        close(DVec3::from(normal.map(f64::from)), DVec3::NEG_Y, 1e-6);
    }
    assert_eq!(scene.objects[0].mesh.parts[0].normals.as_ref().unwrap()[0], [0.0, -1.0, 0.0]);
}

#[test]
fn a_skeleton_in_survey_coordinates_keeps_a_tenth_of_a_millimetre() {
    let mut file = File::bar();
    file.json["nodes"][1]["translation"] = json!([500000.1234, 100.25, -5600000.5678]);
    file.bend();
    let scene = file.moving();
    close(vertex_at(&scene, 4, 1.0), DVec3::new(500001.1234, 5600000.5678, 101.25), 1e-5);
}

#[test]
fn bones_outside_the_scene_work() {
    let mut file = File::bar();
    file.bend();
    let inside = vertex_at(&file.moving(), 5, 0.5);
    file.json["scenes"] = json!([{"nodes": [0]}]);
    close(vertex_at(&file.moving(), 5, 0.5), inside, 1e-12);
}

#[test]
fn objects_of_one_mesh_share_its_vertices() {
    let mut file = File::bar();
    file.bend();
    push(&mut file.json["nodes"], json!({"mesh": 0, "skin": 1}));
    push(&mut file.json["nodes"], json!({"translation": [0, 0, 9]}));
    file.json["skins"].as_array_mut().unwrap().push(json!({"joints": [2, 4]}));
    let scene = file.moving();
    let shapes: Vec<&Arc<Deformation>> =
        scene.objects.iter().map(|object| object.motion.as_ref().unwrap().shape.as_ref().unwrap()).collect();
    assert!(Arc::ptr_eq(&shapes[0].vertices, &shapes[1].vertices) && scene.meshes().len() == 2);
    // Without inverse bind matrices: the first joint uses the vertices as modelled.
    close(vertices_at(&scene, &scene.objects[1], 0, 0.0)[0], DVec3::new(6.0, 0.0, 0.0), 1e-6);
    close(vertices_at(&scene, &scene.objects[1], 0, 0.0)[4], DVec3::new(2.0, -9.0, 0.0), 1e-6);
}

#[test]
fn eight_influences_are_used_and_weights_are_made_to_add_up_to_one() {
    let mut file = File::bar();
    let joints = file.accessor("VEC4", 5123, 6, bytemuck::cast_slice(&[1u16, 0, 0, 0].repeat(6)));
    let weights = file.accessor("VEC4", 5121, 6, &[128, 0, 0, 0].repeat(6));
    file.json["accessors"][weights]["normalized"] = json!(true);
    let halves = file.accessor("VEC4", 5121, 6, &[127, 0, 0, 0].repeat(6));
    file.json["accessors"][halves]["normalized"] = json!(true);
    let attributes = &mut file.primitive()["attributes"];
    attributes["JOINTS_1"] = joints.into();
    attributes["WEIGHTS_0"] = weights.into();
    attributes["WEIGHTS_1"] = halves.into();
    file.bend();
    let scene = file.moving();
    // The first vertex follows joint 0, which is still, and joint 1 by half each.
    let turned = DVec3::new(6.0, 0.0, -1.0);
    close(vertex_at(&scene, 0, 1.0), DVec3::X * 5.0 * (128.0 / 255.0) + turned * (127.0 / 255.0), 2e-6);
    assert_eq!(shape(&scene).vertices.parts[0].joints.len(), 2);

    // A third set, and equal weights that do not add up to 1.
    file.primitive()["attributes"]["JOINTS_2"] = joints.into();
    file.primitive()["attributes"]["WEIGHTS_2"] = halves.into();
    file.primitive()["attributes"]["WEIGHTS_0"] = halves.into();
    file.json["accessors"][halves]["normalized"] = json!(false);
    let scene = file.load().unwrap();
    let half = DVec3::X * 2.5 + turned * 0.5;
    close(vertex_at(&scene, 0, 1.0), half, 2e-6);
    let warnings = [
        "street.glb: of the joints that move a vertex, only the first eight are used: mesh 0 \"Seat\" primitive 0",
        "street.glb: weights of joints that do not add up to 1 are scaled: mesh 0 \"Seat\" primitive 0 vertex 0 and 5 more",
    ];
    assert_eq!(scene.report.warnings, warnings);
    // No weight at all; joints without weight may have any number.
    let nothing = file.floats("VEC4", &[[0.0; 4]; 6].concat());
    let wild = file.accessor("VEC4", 5123, 6, bytemuck::cast_slice(&[9u16; 24]));
    file.primitive()["attributes"] =
        json!({"POSITION": file.primitive()["attributes"]["POSITION"], "JOINTS_0": wild, "WEIGHTS_0": nothing});
    let scene = file.load().unwrap();
    close(vertex_at(&scene, 4, 1.0), DVec3::X * 7.0, 2e-6);
    assert!(only_warning(&scene).contains("vertices without a joint are moved by the first: mesh 0"));
}

#[test]
fn parts_of_a_skin_carry_only_the_vertices_they_use() {
    let mut file = File::bar();
    let whole = file.primitive().clone();
    let end = file.accessor("SCALAR", 5121, 3, &[3, 4, 5]);
    // Three of twelve vertices, far fewer than half: the strip twice over.
    let mut twice = |name: &str, bytes: usize| {
        let accessor = whole["attributes"][name].as_u64().unwrap() as usize;
        let view = file.json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        let start = file.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
        let data = file.bin[start..start + bytes * 6].repeat(2);
        let kind = file.json["accessors"][accessor]["type"].as_str().unwrap().to_owned();
        let component = file.json["accessors"][accessor]["componentType"].as_u64().unwrap() as u32;
        file.accessor(&kind, component, 12, &data)
    };
    let attributes = json!({"POSITION": twice("POSITION", 12), "NORMAL": twice("NORMAL", 12),
        "JOINTS_0": twice("JOINTS_0", 4), "WEIGHTS_0": twice("WEIGHTS_0", 16)});
    let lift = file.floats("VEC3", &(0..12).flat_map(|i| [0.0, 0.0, i as f32]).collect::<Vec<f32>>());
    let targets = json!([{"POSITION": lift}]);
    file.json["meshes"][0]["primitives"] = json!([{"attributes": attributes, "indices": end, "targets": targets}]);
    file.node()["weights"] = json!([2.0]);
    file.bend();
    let scene = file.moving();
    let vertices = &shape(&scene).vertices.parts[0];
    assert_eq!((vertices.positions.len(), vertices.targets[0].positions.as_ref().unwrap()[2]), (3, [0.0, 0.0, 5.0]));
    assert_eq!(vertices.joints[0].len(), 3);
    // Vertices 3, 4, 5: z of the file is -y of the world.
    close(vertex_at(&scene, 1, 1.0), DVec3::new(6.0, -8.0, 1.0), 2e-6);
    close(vertex_at(&scene, 0, 0.0), DVec3::new(6.0, -6.0, 1.0), 2e-6);
}

#[test]
fn morph_targets_move_vertices_by_their_weights() {
    let mut file = File::morphing();
    let base = file.moving();
    assert!(base.objects[0].mesh.parts[0].positions[1] == [1.0, 0.0, 0.0] && base.objects[0].motion.is_none());
    file.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    push(&mut file.json["nodes"], json!({"mesh": 0, "weights": [0.0, -1.0]}));
    push(&mut file.json["nodes"], json!({"mesh": 0}));
    let posed = file.moving();
    assert!(posed.timeline.is_still() && posed.meshes().len() == 2);
    assert_eq!(posed.objects[0].mesh.parts[0].positions[1], [2.0, 0.0, 0.0]);
    assert_eq!(posed.objects[1].mesh.parts[0].positions[2], [0.0, 1.0, -1.0]);

    file.animate(0, "weights", &[1.0, 2.0, 3.0], "SCALAR", &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    let scene = file.moving();
    assert_eq!(shape(&scene).vertices.parts[0].targets[1].positions.as_ref().unwrap()[2], [0.0, 0.0, 1.0]);
    for (time, x, lift) in [(0.0, 1.0, 0.0), (1.5, 2.0, 0.0), (2.5, 3.0, 0.5), (9.0, 3.0, 1.0)] {
        close(vertex_at(&scene, 1, time), DVec3::X * x, 1e-6);
        close(vertex_at(&scene, 2, time), DVec3::new(0.0, -lift, 1.0), 1e-6);
    }
    // Normalised integers in a spline, animated by pointer, on a node that moves.
    let mut file = File::morphing();
    let mut keys = [0u8; 12];
    (keys[2], keys[8]) = (255, 51);
    let output = file.accessor("SCALAR", 5121, 12, &keys);
    file.json["accessors"][output]["normalized"] = json!(true);
    let target = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/0/weights"}}});
    file.channel("clip", target, "CUBICSPLINE", &[0.0, 2.0], output);
    file.animate(0, "translation", &[0.0, 1.0], "VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    let scene = file.moving();
    close(vertex_at(&scene, 1, 0.0), DVec3::X * 3.0, 1e-6);
    close(vertex_at(&scene, 1, 1.0), DVec3::new(1.0 + 0.6 * 2.0, 0.0, 4.0), 1e-6);
}

#[test]
fn a_mesh_with_still_joints_may_morph() {
    let mut file = File::bar();
    let lift = file.floats("VEC3", &[0.0, 0.0, 1.0].repeat(6));
    file.primitive()["targets"] = json!([{"POSITION": lift}]);
    file.animate(0, "weights", &[0.0, 1.0], "SCALAR", &[0.0, 1.0]);
    // Another object has the same skin, but does not move.
    file.json["nodes"].as_array_mut().unwrap().insert(0, json!({"mesh": 0, "skin": 0, "name": "Still"}));
    file.json["nodes"][2]["children"] = json!([3]);
    file.json["skins"][0]["joints"] = json!([2, 3]);
    file.json["animations"][0]["channels"][0]["target"]["node"] = json!(1);
    let scene = file.moving();
    assert!(scene.objects[0].motion.is_none());
    let end = |time| vertices_at(&scene, &scene.objects[1], 0, time)[4];
    close(end(0.0), DVec3::X * 7.0, 1e-6);
    close(end(0.5), DVec3::new(7.0, -0.5, 0.0), 1e-6);
}

#[test]
fn normals_follow_morph_targets_and_scaled_bones() {
    let mut file = File::morphing();
    file.primitive()["attributes"]["NORMAL"] =
        file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.8]).into();
    let turn = file.floats("VEC3", &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    file.primitive()["targets"][0]["NORMAL"] = turn.into();
    file.animate(0, "weights", &[0.0, 1.0], "SCALAR", &[0.0, 0.0, 1.0, 0.0]);
    let scene = file.moving();
    let mut normals = Vec::new();
    let Pull { weights, palette } = shape(&scene).pull(&scene.timeline, 1.0, &DAffine3::IDENTITY);
    shape(&scene).vertices.parts[0].turn(&weights, &palette, &mut normals);
    let half = 0.5f32.sqrt();
    assert_eq!((normals[1], normals.len()), ([0.0, 0.0, 1.0], 3));
    close(DVec3::from(normals[0].map(f64::from)), DVec3::new(half.into(), 0.0, half.into()), 1e-6);

    // A bone stretches a tilted surface along x: its normals tilt less.
    let mut file = File::bar();
    let lean = file.floats("VEC3", &[0.6, 0.0, 0.8].repeat(6));
    file.primitive()["attributes"]["NORMAL"] = lean.into();
    file.json["nodes"][1]["scale"] = json!([2, 1, 1]);
    let posed = file.moving();
    let normal = posed.objects[0].mesh.parts[0].normals.as_ref().unwrap()[0];
    let expected = DVec3::new(0.3, -0.8, 0.0).normalize();
    close(DVec3::from(normal.map(f64::from)), expected, 1e-6);
}

#[test]
fn triangles_that_may_open_up_are_kept() {
    let mut file = File::morphing();
    // All corners on a line until the weight of the second target lifts one; and a triangle with two identical corners.
    let line = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
    file.primitive()["attributes"]["POSITION"] = line.into();
    file.primitive()["indices"] = file.accessor("SCALAR", 5121, 6, &[0, 1, 2, 0, 1, 1]).into();
    let closed = file.load().unwrap();
    assert_eq!((closed.triangle_count(), closed.degenerate_triangles), (0, 2));
    file.node()["weights"] = json!([0, 1]);
    let open = file.load().unwrap();
    assert_eq!((open.triangle_count(), open.degenerate_triangles), (1, 1));
    file.node()["weights"] = json!([1, 0]);
    assert_eq!(file.load().unwrap().triangle_count(), 0, "it stays on the line");
    file.animate(0, "weights", &[0.0, 1.0], "SCALAR", &[0.0, 0.0, 0.0, 1.0]);
    let opening = file.load().unwrap();
    assert_eq!((opening.triangle_count(), opening.degenerate_triangles), (1, 1));
}

#[test]
fn materials_change_by_pointers() {
    let mut file = File::triangle();
    file.material(json!({"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}}));
    let fade = [1.0, 1.0, 1.0, 1.0, 0.0, 0.5, 1.0, 1.0];
    file.point("/materials/0/pbrMetallicRoughness/baseColorFactor", "LINEAR", &[0.0, 2.0], "VEC4", &fade);
    file.point("/materials/0/pbrMetallicRoughness/metallicFactor", "STEP", &[0.0, 1.0], "SCALAR", &[0.25, 0.75]);
    let wave = [0.0, 0.5, 9.0, 9.0, 0.5, 0.0];
    file.point("/materials/0/pbrMetallicRoughness/roughnessFactor", "CUBICSPLINE", &[0.0, 2.0], "SCALAR", &wave);
    file.point("/materials/0/extras/reflectance", "LINEAR", &[0.0, 2.0], "SCALAR", &[0.2, 0.6]);
    let scene = file.moving();
    let paint = scene.objects[0].mesh.parts[0].material.as_ref().unwrap();
    assert_eq!((paint.base_color, paint.metallic, paint.roughness), ([1.0; 4], 0.25, 0.5));
    let now = paint.at(1.0).unwrap();
    assert_eq!((now.base_color, now.metallic, now.changes), ([0.5, 0.75, 1.0, 1.0], 0.75, None));
    let Some(Reflectance::Constant(value)) = now.reflectance else { panic!() };
    assert!((value - 0.4).abs() < 1e-6);
    assert_eq!(paint.at(0.5).unwrap().roughness, 1.0, "splines are clamped");
    assert!(scene.timeline.is_still() && scene.objects[0].motion.is_none());

    // Vertex colours multiply the base colour at all times.
    let half = file.floats("VEC3", &[0.5; 9]);
    file.primitive()["attributes"]["COLOR_0"] = half.into();
    let scene = file.moving();
    let tinted = scene.objects[0].mesh.parts[0].material.as_ref().unwrap();
    assert_eq!(tinted.at(2.0).unwrap().base_color, [0.0, 0.25, 0.5, 1.0]);

    let mut file = File::triangle();
    file.material(json!({}));
    file.point("/materials/0/pbrMetallicRoughness/roughnessFactor", "LINEAR", &[0.0, 2.0], "SCALAR", &[0.25, 0.25]);
    let still = file.moving();
    assert_eq!((still.materials[0].roughness, still.materials[0].at(1.0)), (0.25, None));
    file.json["materials"][0]["extras"] = json!({"scattering": {"model": "phong", "specular": 0.5, "exponent": 9}});
    file.point("/materials/0/extras/reflectance", "LINEAR", &[0.0, 2.0], "SCALAR", &[0.2, 0.6]);
    assert!(
        file.error().contains("extras.scattering.specular is 0.5; allowed: such that it and the reflectance of 0.6")
    );
}

#[test]
fn cameras_move_with_their_nodes() {
    let mut file = File::triangle();
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    file.json["nodes"] = json!([
        {"mesh": 0},
        {"children": [2], "scale": [2, 2, 2]},
        {"camera": 0, "name": "Eye", "translation": [10, 0, 0]},
        {"camera": 0, "name": "Fixed"},
    ]);
    // Four turns of almost 180 degrees; the camera jumps during the third.
    let turns: Vec<f32> =
        (0..=4).flat_map(|i| DQuat::from_rotation_y(f64::from(i) * PI * 0.9).as_quat().to_array()).collect();
    file.animate(1, "rotation", &[0.0, 1.0, 2.0, 3.0, 4.0], "VEC4", &turns);
    let jump = file.floats("VEC3", &[10.0, 0.0, 0.0, 11.0, 0.0, 0.0]);
    file.channel("clip", json!({"node": 2, "path": "translation"}), "STEP", &[0.0, 2.5], jump);
    let scene = file.with(&LoadOptions { looped: true, ..LoadOptions::default() });
    let fixed = scene.camera_path("Fixed", 0.0, 9.0).unwrap();
    assert_eq!(fixed.constant(), Some(scene.camera("Fixed").unwrap().pose));
    let path = scene.camera_path("Eye", 0.5, 9.5).unwrap();
    let node = scene.camera("Eye").unwrap().node.unwrap();
    let pose = |time| ground::pose::Pose::from_camera_node(&scene.timeline.world_from_node(node, time));
    for step in 0..=9000 {
        let time = 0.5 + f64::from(step) * 1e-3 + if step < 9000 { 1.1e-6 } else { 0.0 };
        let (found, exact) = (path.at(time), pose(time));
        assert!(found.position.distance(exact.position) < 1e-4, "{time}");
        assert!(found.orientation.angle_between(exact.orientation) < 1e-4, "{time}");
    }
    let keys = path.into_keys();
    assert_eq!((keys[0].0, keys[keys.len() - 1].0), (0.5, 9.5));
    assert!(keys.len() < 20_000, "{}", keys.len());
    assert_eq!(scene.camera_path("Eye", 1.0, 1.0).unwrap().span(), (1.0, 1.0));
    let error = |from, to| scene.camera_path("Eye", from, to).unwrap_err().to_string();
    let range = "times of the camera path is 2 to 1 s; allowed: rising finite times";
    assert_eq!(error(2.0, 1.0), range);
    assert!(error(0.0, f64::NAN).ends_with("allowed: rising finite times"));
    assert!(
        error(0.0, 1e12).contains("which takes more than 1000000 poses; allowed: a shorter time"),
        "{}",
        error(0.0, 1e12)
    );
    assert!(scene.camera_path("Eyes", 0.0, 1.0).unwrap_err().to_string().contains("near: Eye"));
}

/// Invalid animations, and the error messages about them.
#[test]
fn bad_animations_are_errors_that_name_the_channel() {
    let keys = |times: &[f32]| {
        let mut file = File::triangle();
        file.animate(0, "translation", times, "VEC3", &vec![0.5; 3 * times.len()]);
        file.error()
    };
    let place = "street.glb: animation 0 \"clip\" channel 0: ";
    for (times, message) in [
        (&[0.0, 2.0, 1.0][..], "input: key 2 at 1 s follows one at 2 s; allowed: rising times"),
        (&[0.0, 1.0, 1.0], "input: key 2 at 1 s follows one at 1 s; allowed: rising times"),
        (&[-1.0, 1.0], "input: key 0 is at -1 s; allowed: 0 and more"),
        (&[0.0, f32::NAN], "input: key 1 is at NaN s; allowed: 0 and more"),
        (&[0.0, f32::INFINITY], "input: key 1 is at inf s; allowed: 0 and more"),
        (&[], "input: it has no key; allowed: one and more"),
    ] {
        assert_eq!(keys(times), format!("{place}{message}"));
    }
    let sampled = |path: &str, interpolation: &str, times: &[f32], kind: &str, values: &[f32]| {
        let mut file = File::morphing();
        let output = file.floats(kind, values);
        file.channel("clip", json!({"node": 0, "path": path}), interpolation, times, output);
        file.error()
    };
    let two = &[0.0, 1.0][..];
    for (error, message) in [
        (
            sampled("translation", "LINEAR", two, "VEC3", &[0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0]),
            "output: key 1 has NaN; allowed: finite numbers",
        ),
        (
            sampled("scale", "CUBICSPLINE", two, "VEC3", &[f32::INFINITY; 18]),
            "output: key 0 has inf; allowed: finite numbers",
        ),
        (sampled("translation", "STEP", two, "VEC3", &[0.0; 9]), "output: 3 elements for 2 keys; allowed: 2"),
        (
            sampled("translation", "CUBICSPLINE", two, "VEC3", &[0.0; 6]),
            "output: 2 elements for 2 keys with 3 each; allowed: 6",
        ),
        (
            sampled("weights", "LINEAR", two, "SCALAR", &[0.0; 2]),
            "output: 2 elements for 2 keys with 2 each; allowed: 4",
        ),
        (
            sampled("weights", "CUBICSPLINE", two, "SCALAR", &[0.0; 4]),
            "output: 4 elements for 2 keys with 6 each; allowed: 12",
        ),
        (
            sampled("scale", "CUBICSPLINE", &[1.0], "VEC3", &[0.0; 9]),
            "a CUBICSPLINE with one key; allowed: two and more",
        ),
        (
            sampled("rotation", "LINEAR", two, "VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
            "output: key 1 is a quaternion of length 0; allowed: unit quaternions",
        ),
        (sampled("rotation", "LINEAR", two, "VEC3", &[0.0; 6]), "output: accessor 3 is not of type VEC4"),
        (
            sampled("scale", "SPLINE", two, "VEC3", &[0.0; 6]),
            "its interpolation is \"SPLINE\"; allowed: LINEAR, STEP, CUBICSPLINE",
        ),
        (
            sampled("color", "STEP", two, "VEC3", &[0.0; 6]),
            "its path is \"color\"; allowed: translation, rotation, scale, weights, pointer",
        ),
        (
            sampled("pointer", "STEP", two, "VEC3", &[0.0; 6]),
            "its path is pointer, but it has no KHR_animation_pointer",
        ),
    ] {
        assert!(error.starts_with(place) && error.contains(message), "{error} is not {message}");
    }
    let clip = |file: &mut File| std::mem::take(&mut file.json["animations"][0]);
    type Change<'a> = &'a dyn Fn(&mut Value);
    let edits: [(Change, &str); 7] = [
        (
            &|clip| clip["channels"][0]["sampler"] = json!(7),
            "animation 0 \"clip\" channel 0: its sampler 7 does not exist: the animation has 1",
        ),
        (&|clip| clip["samplers"][0]["input"] = json!(70), "channel 0: input: accessor 70 does not exist"),
        (&|clip| clip["samplers"][0]["output"] = json!(70), "channel 0: output: accessor 70 does not exist"),
        (
            &|clip| clip["channels"][0]["target"]["node"] = json!(3),
            "channel 0: its node 3 does not exist: the file has 1",
        ),
        (
            &|clip| clip["channels"][0]["target"]["path"] = json!("weights"),
            "channel 0: node 0 \"Chair\" has no mesh with morph targets, so it cannot have animated weights",
        ),
        (
            &|clip| clip["channels"][0]["target"]["node"] = json!(-1),
            "animations[0].channels[0].target.node: not a glTF file: invalid value: integer `-1`, expected a whole number",
        ),
        (
            &|clip| clip["channels"][0] = json!({}),
            "animations[0].channels[0]: not a glTF file: the key `sampler` is missing",
        ),
    ];
    for (edit, message) in edits {
        let mut file = File::slide();
        let mut animation = clip(&mut file);
        edit(&mut animation);
        file.json["animations"][0] = animation;
        assert!(file.error().contains(message), "{} is not {message}", file.error());
    }
    let mut file = File::slide();
    file.node()["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let message =
        "node 0 \"Chair\" has a matrix, so it cannot be animated; allowed: nodes with translation, rotation, scale";
    assert_eq!(file.error(), format!("{place}{message}"));
    for (pointer, values, message) in [
        ("/materials/3/extras/reflectance", [0.0, 1.0], "its material 3 does not exist: the file has 1"),
        ("/materials/0/extras/reflectance", [0.0, 1.5], "output: key 1 is 1.5; allowed: 0 to 1"),
        ("/nodes/9/weights", [0.0, 1.0], "its node 9 does not exist: the file has 1"),
        ("/nodes/0/extensions/KHR_node_visibility/visible", [0.0, 1.0], "a boolean is interpolated; allowed: STEP"),
    ] {
        let mut file = File::triangle();
        file.material(json!({}));
        file.point(pointer, "LINEAR", two, "SCALAR", &values);
        assert_eq!(file.error(), format!("{place}{message}"));
    }
    let mut again = File::slide();
    again.json["nodes"][0]["scale"] = json!([1e38, 1, 1]);
    let mut below = 0;
    for _ in 0..8 {
        below = push(&mut again.json["nodes"], json!({"children": [below], "scale": [1e38, 1, 1]}));
    }
    assert!(again.error().contains("its world transform is not finite"), "{}", again.error());
}

#[test]
fn bad_skins_are_errors() {
    let cases: [(Edit, &str); 16] = [
        (&|f| f.node()["skin"] = json!(4), "node 0 \"Bar\": its skin 4 does not exist: the file has 1"),
        (&|f| f.json["skins"][0]["joints"] = json!([]), "skin 0 \"arm\": it has 0 joints; allowed: 1 to 65535"),
        (
            &|f| f.json["skins"][0]["joints"] = json!(vec![1; 65536]),
            "skin 0 \"arm\": it has 65536 joints; allowed: 1 to 65535",
        ),
        (
            &|f| f.json["skins"][0]["joints"] = json!([1, 8]),
            "skin 0 \"arm\": its joint 8 does not exist: the file has 3 nodes",
        ),
        (
            &|f| f.json["skins"][0]["joints"] = json!([1, 2, 0]),
            "skin 0 \"arm\": inverseBindMatrices: 2 for 3 joints; allowed: one for each",
        ),
        (
            &|f| f.json["skins"][0]["joints"] = json!([1]),
            "node 0 \"Bar\": vertex 2 has the joint 1: its skin has 1 joints",
        ),
        (
            &|f| {
                let bad = f.floats("MAT4", &[f32::NAN; 32]);
                f.json["skins"][0]["inverseBindMatrices"] = json!(bad);
            },
            "inverseBindMatrices: that of joint 0 has a number that is not finite",
        ),
        (
            &|f| {
                let bad = f.floats("MAT4", &[1.0; 32]);
                f.json["skins"][0]["inverseBindMatrices"] = json!(bad);
            },
            "inverseBindMatrices: the last row of that of joint 0 is [1, 1, 1, 1]; allowed: [0, 0, 0, 1]",
        ),
        (
            &|f| f.json["skins"][0]["inverseBindMatrices"] = json!(0),
            "inverseBindMatrices: accessor 0 is not of type MAT4",
        ),
        (
            &|f| drop(f.primitive()["attributes"].as_object_mut().unwrap().remove("WEIGHTS_0")),
            "mesh 0 \"Seat\" primitive 0: it has no WEIGHTS_0, which a mesh with a skin needs",
        ),
        (
            &|f| drop(f.primitive()["attributes"].as_object_mut().unwrap().remove("JOINTS_0")),
            "primitive 0: it has no JOINTS_0, which a mesh with a skin needs",
        ),
        (
            &|f| f.primitive()["attributes"]["JOINTS_1"] = f.primitive()["attributes"]["JOINTS_0"].clone(),
            "primitive 0: it has no WEIGHTS_1, which a mesh with a skin needs",
        ),
        (
            &|f| f.primitive()["attributes"]["JOINTS_0"] = f.primitive()["attributes"]["WEIGHTS_0"].clone(),
            "JOINTS_0: accessor 5 does not hold joint numbers; allowed: componentType 5121, 5123",
        ),
        (
            &|f| {
                let bad = f.floats(
                    "VEC4",
                    &[[1.0; 4], [0.5, -0.5, 1.0, 0.0], [1.0; 4], [1.0; 4], [1.0; 4], [1.0; 4]].concat(),
                );
                f.primitive()["attributes"]["WEIGHTS_0"] = json!(bad);
            },
            "primitive 0: WEIGHTS_0: vertex 1 has [0.5, -0.5, 1.0, 0.0]; allowed: 0 and more",
        ),
        (
            &|f| {
                let bad = f.floats("VEC4", &[1.0; 20]);
                f.primitive()["attributes"]["WEIGHTS_0"] = json!(bad);
            },
            "primitive 0: WEIGHTS_0 has 5 elements for 6 vertices",
        ),
        (&|f| f.json["nodes"][1]["scale"] = json!([1e30, 1, 1]), "node 0 \"Bar\": its vertex 2 moves to ["),
    ];
    for (edit, message) in cases {
        let mut file = File::bar();
        edit(&mut file);
        assert!(file.error().contains(message), "{} is not {message}", file.error());
    }
    // A singular matrix collapses the vertices that are bound to it.
    let mut file = File::bar();
    let mut flat = [0.0; 32];
    (flat[15], flat[31]) = (1.0, 1.0);
    file.json["skins"][0]["inverseBindMatrices"] = json!(file.floats("MAT4", &flat));
    file.bend();
    close(vertex_at(&file.moving(), 5, 0.5), DVec3::X * 6.0, 1e-6);
    file.json["nodes"][2]["children"] = json!([1]);
    assert!(file.error().contains("(a cycle)"));
}

#[test]
fn bad_morph_targets_are_errors() {
    let cases: [(Edit, &str); 7] = [
        (&|f| f.node()["weights"] = json!([1.0]), "node 0 \"Chair\": it has 1 weights for 2 morph targets"),
        (&|f| f.node()["weights"] = json!([1e39, 0.0]), "number out of range"),
        (
            &|f| {
                let mut other = f.primitive().clone();
                other["targets"] = json!([{}]);
                push(&mut f.json["meshes"][0]["primitives"], other);
            },
            "node 0 \"Chair\": its mesh 0 has primitives with 2 and 1 morph targets; allowed: one number",
        ),
        (
            &|f| {
                let bad = f.floats("VEC3", &[0.0; 12]);
                f.primitive()["targets"][1]["POSITION"] = json!(bad);
            },
            "mesh 0 \"Seat\" primitive 0: morph target 1 POSITION has 4 elements for 3 vertices",
        ),
        (
            &|f| {
                let bad = f.floats("VEC3", &[f32::NAN; 9]);
                f.primitive()["targets"][0]["POSITION"] = json!(bad);
            },
            "morph target 0 POSITION: vertex 0 has [NaN, NaN, NaN]; allowed: -1e18 to 1e18",
        ),
        (
            &|f| f.primitive()["targets"][0]["POSITION"] = json!(99),
            "morph target 0 POSITION: accessor 99 does not exist",
        ),
        (&|f| f.node()["weights"] = json!([3e38, 0.0]), "node 0 \"Chair\": its vertex 1 moves to [inf, 0.0, 0.0]"),
    ];
    for (edit, message) in cases {
        let mut file = File::morphing();
        file.node()["weights"] = json!([1.0, 1.0]);
        // Attributes that are not read may have any value.
        file.primitive()["targets"][0]["TANGENT"] = json!(500);
        edit(&mut file);
        assert!(file.error().contains(message), "{} is not {message}", file.error());
    }
}

#[test]
fn a_million_keys_are_read_and_more_than_fit_are_refused() {
    const KEYS: usize = 1_000_000;
    let times: Vec<f32> = (0..KEYS).map(|key| key as f32 / 128.0).collect();
    let mut file = File::triangle();
    file.animate(0, "translation", &times, "VEC3", &(0..3 * KEYS).map(|i| i as f32 * 0.25).collect::<Vec<_>>());
    let scene = file.moving();
    assert!((vertex_at(&scene, 0, 1000.0 / 128.0).x - 750.0).abs() < 1e-9);
    // Many samplers of different accessors to the same bytes.
    let clip = file.json["animations"][0].clone();
    let output = file.json["accessors"][clip["samplers"][0]["output"].as_u64().unwrap() as usize].clone();
    for _ in 0..40 {
        let output = push(&mut file.json["accessors"], output.clone());
        file.json["animations"][0]["samplers"]
            .as_array_mut()
            .unwrap()
            .push(json!({"input": clip["samplers"][0]["input"], "output": output}));
    }
    file.json["animations"][0]["channels"] =
        (0..41).map(|sampler| json!({"sampler": sampler, "target": {"node": 0, "path": "translation"}})).collect();
    assert!(file.error().contains("64 times its size"), "{}", file.error());
}

/// Positions by the specification, evaluated by another program, and by Blender: tests/data/motion.
#[test]
fn vertices_are_where_the_specification_and_blender_put_them() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/motion");
    let table = std::fs::read_to_string(folder.join("vertices.csv")).unwrap();
    let mut scenes: BTreeMap<(String, String), Scene> = BTreeMap::new();
    let mut compared = 0;
    for line in table.lines().skip(1) {
        let words: Vec<&str> = line.split(',').collect();
        let [evaluator, file, clip, name, time, vertex, ref place @ ..] = words[..] else { panic!("{line}") };
        if evaluator == "blender" {
            continue;
        }
        let scene = scenes.entry((file.to_owned(), clip.to_owned())).or_insert_with(|| {
            let animation = (clip != "*").then(|| clip.to_owned());
            let options = LoadOptions { animation, ..LoadOptions::default() };
            Scene::load_with(folder.join(format!("{file}.glb")), &options).unwrap()
        });
        let object = scene.objects.iter().find(|object| object.name == name).unwrap();
        let found = vertices_at(scene, object, 0, time.parse().unwrap())[vertex.parse::<usize>().unwrap()];
        let place: Vec<f64> = place.iter().map(|word| word.parse().unwrap()).collect();
        assert!((found - DVec3::from_slice(&place)).length() < 5e-6, "{line}: {found}");
        compared += 1;
    }
    assert!(compared > 2000 && scenes.len() > 8, "{compared} in {}", scenes.len());

    let table = std::fs::read_to_string(folder.join("cameras.csv")).unwrap();
    let scene = Scene::load(folder.join("trs_linear.glb")).unwrap();
    let path = scene.camera_path("eye", 0.0, 10.0).unwrap();
    for line in table.lines().skip(1).filter(|line| !line.starts_with("blender")) {
        let numbers: Vec<f64> = line.split(',').skip(4).map(|word| word.parse().unwrap()).collect();
        let pose = path.at(numbers[0]);
        close(pose.position, DVec3::from_slice(&numbers[1..]), 1e-4);
        close(pose.orientation * DVec3::X, DVec3::from_slice(&numbers[4..]), 1e-4);
        close(pose.orientation * DVec3::Z, DVec3::from_slice(&numbers[7..]), 1e-4);
    }
}
