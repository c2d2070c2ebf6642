use crate::scene::{LabelRules, LoadOptions, Scene};
use glam::{DAffine3, DQuat, DVec3};
use ground::error::Result;
use model::material::{Alpha, Filter, Reflectance, Scattering, Sound, TextureBudget, Wrap};
use scene_files::gltf::read_bytes;
use serde_json::{Value, json};
use std::path::Path;

pub(super) const F32: u32 = 5126;

/// A file under construction.
#[derive(Clone)]
pub(super) struct File {
    pub json: Value,
    pub bin: Vec<u8>,
}

/// An edit that corrupts a file.
pub(super) type Edit<'a> = &'a dyn Fn(&mut File);

impl File {
    /// One node, `Chair`, with one triangle: (0, 0, 0), (1, 0, 0), (0, 1, 0). Its positions are accessor 0.
    pub fn triangle() -> File {
        let mut file = File {
            json: json!({
                "asset": {"version": "2.0"},
                "nodes": [{"name": "Chair", "mesh": 0}],
                "meshes": [{"name": "Seat", "primitives": [{"attributes": {"POSITION": 0}}]}],
                "accessors": [], "bufferViews": [], "buffers": [{}],
            }),
            bin: Vec::new(),
        };
        file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        file
    }

    /// Four vertices of the unit square in the plane z = 0, in order along its edge, instead of three.
    pub fn square() -> File {
        let mut file = File::triangle();
        let square = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
        file.primitive()["attributes"]["POSITION"] = square.into();
        file
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        push(&mut self.json["bufferViews"], json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        push(&mut self.json["accessors"], accessor)
    }

    pub fn floats(&mut self, kind: &str, numbers: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "MAT4" => 16,
            _ => kind[3..].parse().unwrap(),
        };
        self.accessor(kind, F32, numbers.len() / width, bytemuck::cast_slice(numbers))
    }

    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    pub fn node(&mut self) -> &mut Value {
        &mut self.json["nodes"][0]
    }

    /// Gives the primitive a material.
    pub fn material(&mut self, material: Value) {
        self.json["materials"] = json!([material]);
        self.primitive()["material"] = json!(0);
    }

    /// Gives the primitive a base colour texture of 2 x 1 pixels, red and green, and texture coordinates.
    fn texture(&mut self) {
        let image = self.view(&png(2, 1, &[255, 0, 0, 255, 0, 255, 0, 255]));
        self.json["images"] = json!([{"bufferView": image, "name": "wood"}]);
        self.json["textures"] = json!([{"source": 0}]);
        self.material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
        let uvs = self.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        self.primitive()["attributes"]["TEXCOORD_0"] = uvs.into();
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if json["buffers"][0].get("uri").is_none() && json["buffers"][0].get("byteLength").is_none() {
            json["buffers"][0]["byteLength"] = self.bin.len().into();
        }
        glb(json.to_string().as_bytes(), &self.bin)
    }

    pub fn load(&self) -> Result<Scene> {
        load(&self.bytes())
    }

    pub fn error(&self) -> String {
        self.load().expect_err("the file is bad").to_string()
    }
}

/// Reads the bytes of a file without a folder.
fn load(bytes: &[u8]) -> Result<Scene> {
    load_with(bytes, &LoadOptions::default())
}

pub(super) fn load_with(bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
    let images = &mut TextureBudget::new(options.texture_limit_mib);
    Ok(Scene::assemble(read_bytes(bytes, Path::new("street.glb"), None, &options.of_files(), images)?, options))
}

pub(super) fn push(array: &mut Value, value: Value) -> usize {
    let array = array.as_array_mut().unwrap();
    array.push(value);
    array.len() - 1
}

fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, data, padding) in [(b"JSON", json, b' '), (b"BIN\0", bin, 0)] {
        let length = data.len().next_multiple_of(4);
        bytes.extend((length as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(data);
        bytes.resize(bytes.len() + length - data.len(), padding);
    }
    let length = bytes.len() as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    bytes
}

fn png(width: u32, height: u32, rgba: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(rgba).unwrap();
    bytes
}

/// World position of a vertex of the first part of an object.
pub(super) fn world_vertex(scene: &Scene, object: usize, vertex: usize) -> DVec3 {
    let object = &scene.objects[object];
    let position = object.mesh.parts[0].positions[vertex];
    object.world_from_object.transform_point3(DVec3::from(position.map(f64::from)))
}

pub(super) fn close(a: DVec3, b: DVec3, tolerance: f64) {
    assert!((a - b).length() <= tolerance, "{a} is not {b}");
}

pub(super) fn only_warning(scene: &Scene) -> &str {
    assert_eq!(scene.report.warnings.len(), 1, "{:?}", scene.report.warnings);
    &scene.report.warnings[0]
}

#[test]
fn y_up_becomes_z_up_once() {
    let scene = File::triangle().load().unwrap();
    close(world_vertex(&scene, 0, 1), DVec3::X, 0.0);
    close(world_vertex(&scene, 0, 2), DVec3::Z, 0.0);
    let mut moved = File::triangle();
    moved.node()["translation"] = json!([1, 2, 3]);
    close(world_vertex(&moved.load().unwrap(), 0, 0), DVec3::new(1.0, -3.0, 2.0), 0.0);
}

#[test]
fn survey_coordinates_keep_a_tenth_of_a_millimetre() {
    // z up: x = 500000.1234, y = 5600000.5678, z = 100.25.
    let (translation, world) =
        (json!([500000.1234, 100.25, -5600000.5678]), DVec3::new(500000.1234, 5600000.5678, 100.25));
    let mut file = File::triangle();
    file.node()["translation"] = translation.clone();
    close(world_vertex(&file.load().unwrap(), 0, 0), world, 1e-9);

    let mut file = File::triangle();
    file.node()["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 500000.1234, 100.25, -5600000.5678, 1]);
    close(world_vertex(&file.load().unwrap(), 0, 0), world, 1e-9);

    let mut file = File::triangle();
    push(&mut file.json["nodes"], json!({"translation": translation, "children": [0]}));
    close(world_vertex(&file.load().unwrap(), 0, 1), world + DVec3::X, 1e-9);
}

#[test]
fn transforms_add_up_through_the_hierarchy() {
    let (turn, scale) = (DQuat::from_rotation_y(0.7), DVec3::new(2.0, -3.0, 0.5));
    let mut file = File::triangle();
    *file.node() = json!({"mesh": 0, "scale": scale.to_array()});
    push(&mut file.json["nodes"], json!({"rotation": turn.to_array(), "translation": [5, 6, 7], "children": [0]}));
    let shear = DAffine3::from_cols_array(&[1.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 9.0, 8.0, 7.0]);
    let columns = glam::DMat4::from(shear).to_cols_array();
    push(&mut file.json["nodes"], json!({"matrix": columns, "children": [1]}));
    let scene = file.load().unwrap();
    let expected =
        shear * DAffine3::from_rotation_translation(turn, DVec3::new(5.0, 6.0, 7.0)) * DAffine3::from_scale(scale);
    for (vertex, p) in [DVec3::ZERO, DVec3::X, DVec3::Y].into_iter().enumerate() {
        let q = expected.transform_point3(p);
        close(world_vertex(&scene, 0, vertex), DVec3::new(q.x, -q.z, q.y), 1e-12);
    }
    assert!(scene.objects[0].world_from_object.matrix3.determinant() < 0.0, "a mirrored object stays mirrored");
}

#[test]
fn a_very_deep_hierarchy_is_walked_without_recursion() {
    const DEPTH: usize = 100_000;
    let mut file = File::triangle();
    let mut nodes: Vec<Value> =
        (1..DEPTH).map(|child| json!({"children": [child], "translation": [1, 0, 0]})).collect();
    nodes.push(json!({"mesh": 0}));
    file.json["nodes"] = nodes.into();
    close(world_vertex(&file.load().unwrap(), 0, 0), DVec3::X * (DEPTH - 1) as f64, 0.0);
}

#[test]
fn nodes_that_do_not_form_a_tree_are_errors() {
    for (nodes, message) in [
        (
            json!([{"children": [1]}, {"children": [0]}]),
            "street.glb: node 0: it is, or lies below, its own ancestor (a cycle)",
        ),
        (json!([{"mesh": 0}, {"children": [1], "name": "loop"}]), "node 1 \"loop\": it is, or lies below"),
        (
            json!([{"children": [2]}, {"children": [2], "name": "b"}, {}]),
            "node 1 \"b\": its child 2 is already a child of node 0",
        ),
        (json!([{"children": [7]}]), "node 0: its child 7 does not exist: the file has 1 nodes"),
        (json!([{"mesh": 5}]), "node 0: its mesh 5 does not exist"),
        (json!([{"camera": 5}]), "node 0: its camera 5 does not exist"),
        (json!([{"mesh": 0, "rotation": [0, 0, 0, 0]}]), "node 0: its rotation [0, 0, 0, 0] has no direction"),
        (json!([{"matrix": [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]), "node 0: the last row of its matrix"),
        (
            (0..9)
                .map(|node| json!({"scale": [1e38, 1, 1], "children": if node < 8 { vec![node + 1] } else { vec![] }}))
                .collect(),
            "node 8: its world transform is not finite",
        ),
    ] {
        let mut file = File::triangle();
        file.json["nodes"] = nodes;
        assert!(file.error().contains(message), "{}", file.error());
    }
    for (scenes, message) in [
        (json!([{"nodes": [4]}]), "scene 0: its node 4 does not exist"),
        (json!([{"nodes": [0, 0], "name": "s"}]), "scene 0 \"s\": it lists node 0 twice"),
        (json!([{"nodes": [1]}]), "scene 0: its node 1 is a child of node 0"),
        (json!([]), "its scene 3 does not exist"),
    ] {
        let mut file = File::triangle();
        file.json["nodes"] = json!([{"children": [1]}, {"mesh": 0}]);
        if scenes.as_array().unwrap().is_empty() {
            file.json["scene"] = json!(3);
        }
        file.json["scenes"] = scenes;
        assert!(file.error().contains(message), "{}", file.error());
    }
}

#[test]
fn the_default_scene_is_read() {
    let mut file = File::triangle();
    file.json["nodes"] = json!([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}, {"mesh": 0, "name": "c"}]);
    let names = |file: &File| file.load().unwrap().objects.into_iter().map(|o| o.name).collect::<Vec<_>>();
    assert_eq!(names(&file), ["a", "b", "c"]);
    file.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [2, 1]}]);
    assert_eq!(names(&file), ["a"]);
    file.json["scene"] = json!(1);
    assert_eq!(names(&file), ["c", "b"]);
}

#[test]
fn objects_scaled_flat_are_kept_those_scaled_to_a_line_are_left_out() {
    let mut file = File::triangle();
    push(&mut file.json["nodes"], json!({"mesh": 0, "scale": [1, 1, 0], "name": "Sign"}));
    push(&mut file.json["nodes"], json!({"mesh": 0, "scale": [1, 0, 0], "name": "Line"}));
    push(&mut file.json["nodes"], json!({"mesh": 0, "scale": [0, 0, 0], "name": "Point"}));
    let scene = file.load().unwrap();
    assert_eq!(scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["Chair", "Sign"]);
    let message = "street.glb: objects scaled to a line or a point are left out: node 2 \"Line\" and 1 more";
    assert_eq!(only_warning(&scene), message);
    scene.build().unwrap();
}

#[test]
fn coordinates_beyond_all_reach_are_errors() {
    for far in [1e19f32, f32::MAX, -1e19] {
        let mut file = File::triangle();
        let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, far, 0.0]);
        file.primitive()["attributes"]["POSITION"] = positions.into();
        let error = file.error();
        assert!(error.contains("mesh 0 \"Seat\" primitive 0: vertex 2 is [0.0, "), "{error}");
        assert!(error.ends_with("allowed: -1e18 to 1e18"), "{error}");
    }
    for place in [json!({"translation": [0, 1e19, 0]}), json!({"scale": [1e19, 1, 1]}), json!({"scale": [1, -1e38, 1]})]
    {
        let mut file = File::triangle();
        file.node().as_object_mut().unwrap().append(&mut place.as_object().unwrap().clone());
        let error = Scene::from_glb_bytes(&file.bytes(), &LoadOptions::default()).unwrap_err().to_string();
        assert!(error.starts_with("glTF data: object \"Chair\": it reaches to ["), "{error}");
        assert!(error.ends_with("in the world; allowed: -1e18 to 1e18"), "{error}");
    }
}

#[test]
fn a_mesh_of_many_nodes_is_kept_once() {
    let mut file = File::triangle();
    file.json["nodes"] = (0..50).map(|i| json!({"mesh": 0, "translation": [i, 0, 0]})).collect::<Vec<_>>().into();
    let scene = file.load().unwrap();
    assert_eq!((scene.meshes().len(), scene.objects.len(), scene.triangle_count()), (1, 50, 50));
    assert_eq!((scene.objects[7].name.as_str(), scene.meshes()[0].name.as_str()), ("Seat", "Seat"));
    file.json["meshes"][0].as_object_mut().unwrap().remove("name");
    assert_eq!(file.load().unwrap().objects[7].name, "object_7");
}

#[test]
fn data_that_primitives_share_is_decoded_once() {
    let mut file = File::triangle();
    let (one, two) = (file.accessor("SCALAR", 5121, 3, &[0, 1, 2]), file.accessor("SCALAR", 5121, 3, &[2, 1, 0]));
    file.json["materials"] = json!([{"name": "leg"}, {"name": "plate"}]);
    file.json["meshes"][0]["primitives"] = json!([
        {"attributes": {"POSITION": 0}, "indices": one, "material": 0},
        {"attributes": {"POSITION": 0}, "indices": one, "material": 1},
        {"attributes": {"POSITION": 0}, "indices": two, "material": 1},
    ]);
    let scene = file.load().unwrap();
    let parts = &scene.meshes()[0].parts;
    assert!(parts[0].positions.is(&parts[2].positions));
    assert!(parts[0].triangles.is(&parts[1].triangles));
    assert!(!parts[0].triangles.is(&parts[2].triangles));
    let names: Vec<_> = scene.objects[0].part_ids.iter().map(|&id| scene.labels.part.name(id).unwrap()).collect();
    assert_eq!(names, ["leg", "plate", "plate"]);
}

#[test]
fn parts_carry_only_the_vertices_they_use() {
    const VERTICES: usize = 30_000;
    let mut file = File::triangle();
    file.texture();
    let corner = |i: usize| [(i % 3 == 1) as u8 as f32, (i % 3 == 2) as u8 as f32, i as f32];
    let positions = file.floats("VEC3", &(0..VERTICES).flat_map(corner).collect::<Vec<_>>());
    let normals = file.floats("VEC3", &(0..VERTICES).flat_map(|i| [1.0, i as f32, 0.0]).collect::<Vec<_>>());
    let uvs = file.floats("VEC2", &(0..VERTICES).flat_map(|i| [i as f32, 0.5]).collect::<Vec<_>>());
    let attributes = json!({"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs});
    // So many that whole buffers would exceed the limit.
    let primitives: Vec<Value> = (0..400)
        .map(|i| {
            let corners = [3 * i + 2, 3 * i, 3 * i + 1].map(|corner: u16| corner.to_le_bytes());
            let indices = file.accessor("SCALAR", 5123, 3, corners.as_flattened());
            json!({"attributes": attributes, "indices": indices, "material": 0})
        })
        .collect();
    file.json["meshes"][0]["primitives"] = primitives.into();
    let scene = file.load().unwrap();
    for (i, part) in scene.meshes()[0].parts.iter().enumerate() {
        assert_eq!((part.positions.len(), part.triangles[0]), (3, [2, 0, 1]));
        let (normals, uvs) = (part.normals.as_ref().unwrap(), part.uvs.as_ref().unwrap());
        assert_eq!((part.positions[1][2], uvs[1], normals.len()), ((3 * i + 1) as f32, [(3 * i + 1) as f32, 0.5], 3));
        assert!((normals[1][1] / normals[1][0] / (3 * i + 1) as f32 - 1.0).abs() < 1e-6);
    }
    // The same normals for another number of vertices.
    file.primitive()["attributes"] = json!({"POSITION": 0, "NORMAL": normals});
    assert!(file.error().contains("primitive 0: NORMAL has 30000 elements for 3 vertices"), "{}", file.error());
    file.json["meshes"][0]["primitives"].as_array_mut().unwrap().reverse();
    file.primitive()["attributes"] = attributes;
    assert!(file.error().contains("primitive 399: NORMAL has 30000 elements for 3 vertices"), "{}", file.error());
}

#[test]
fn every_kind_of_index_is_read() {
    let expected = [[0, 1, 2], [0, 2, 3]];
    let indices = [0u8, 1, 2, 0, 2, 3];
    for component in [5121, 5123, 5125] {
        let bytes: Vec<u8> = match component {
            5121 => indices.to_vec(),
            5123 => indices.iter().flat_map(|&i| u16::from(i).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|&i| u32::from(i).to_le_bytes()).collect(),
        };
        let mut file = File::square();
        file.primitive()["indices"] = file.accessor("SCALAR", component, 6, &bytes).into();
        assert_eq!(*file.load().unwrap().meshes()[0].parts[0].triangles, expected);
    }
}

#[test]
fn strips_and_fans_keep_the_winding() {
    let triangles = |file: &File| file.load().unwrap().meshes()[0].parts[0].triangles.to_vec();
    let mut strip = File::square();
    strip.primitive()["indices"] = strip.accessor("SCALAR", 5121, 4, &[0, 1, 3, 2]).into();
    strip.primitive()["mode"] = json!(5);
    assert_eq!(triangles(&strip), [[0, 1, 3], [1, 2, 3]]);
    let mut fan = File::square();
    fan.primitive()["mode"] = json!(6);
    assert_eq!(triangles(&fan), [[1, 2, 0], [2, 3, 0]]);
}

#[test]
fn points_lines_and_leftovers_are_skipped_with_one_warning_each() {
    let mut file = File::square();
    let square = file.primitive()["attributes"].clone();
    file.json["meshes"][0]["primitives"] = json!([
        {"attributes": square, "mode": 0},
        {"attributes": square, "mode": 1},
        {"attributes": square, "mode": 3},
        {"attributes": {"NORMAL": 0}},
        {"attributes": square},
    ]);
    let scene = file.load().unwrap();
    assert_eq!(scene.meshes()[0].triangle_count(), 1, "four vertices without indices hold one whole triangle");
    assert_eq!(
        scene.report.warnings,
        [
            "street.glb: points and lines are skipped: mesh 0 \"Seat\" primitive 0 and 2 more",
            "street.glb: primitives without positions are skipped: mesh 0 \"Seat\" primitive 3",
            "street.glb: corners left over after the last whole triangle are skipped: mesh 0 \"Seat\" primitive 4",
        ]
    );
}

#[test]
fn interleaved_vertices_are_read() {
    let mut file = File::triangle();
    // x y z nx ny nz, 24 bytes per vertex; one normal is tilted, so that they are not flat, and so short that its
    // square is subnormal.
    let vertices: [f32; 18] =
        [0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.6e-20, 0.0, 0.8e-20];
    let view = file.view(bytemuck::cast_slice(&vertices));
    file.json["bufferViews"][view]["byteStride"] = json!(24);
    let accessor =
        |offset| json!({"bufferView": view, "byteOffset": offset, "componentType": F32, "type": "VEC3", "count": 3});
    let position = push(&mut file.json["accessors"], accessor(0));
    let normal = push(&mut file.json["accessors"], accessor(12));
    file.primitive()["attributes"] = json!({"POSITION": position, "NORMAL": normal});
    let scene = file.load().unwrap();
    let part = &scene.meshes()[0].parts[0];
    assert_eq!(*part.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let normals = part.normals.as_ref().expect("they are not flat");
    assert_eq!(normals[0], [0.0, 0.0, 1.0], "normals have unit length");
    close(DVec3::from(normals[2].map(f64::from)), DVec3::new(0.6, 0.0, 0.8), 1e-6);
}

#[test]
fn flat_and_broken_normals_are_not_kept() {
    let mut flat = File::triangle();
    flat.primitive()["attributes"]["NORMAL"] =
        flat.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]).into();
    let scene = flat.load().unwrap();
    assert!(scene.meshes()[0].parts[0].normals.is_none() && scene.report.warnings.is_empty());
    for bad in [0.0, f32::NAN] {
        let mut broken = File::triangle();
        let normals = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, bad];
        broken.primitive()["attributes"]["NORMAL"] = broken.floats("VEC3", &normals).into();
        let scene = broken.load().unwrap();
        assert!(scene.meshes()[0].parts[0].normals.is_none());
        assert!(only_warning(&scene).contains("normals of zero length are not used"));
    }
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut file = File::square();
    let indices = file.view(&[2, 0, 3, 0]);
    let values = file.view(bytemuck::cast_slice(&[5.0f32, 5.0, 5.0, 6.0, 6.0, 6.0]));
    let sparse = json!({"count": 2, "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": values}});
    let square = file.primitive()["attributes"]["POSITION"].as_u64().unwrap() as usize;
    file.json["accessors"][square]["sparse"] = sparse.clone();
    let positions = |file: &File| file.load().unwrap().meshes()[0].parts[0].positions.to_vec();
    let over_square = [[0.0; 3], [1.0, 0.0, 0.0], [5.0; 3], [6.0; 3]];
    assert_eq!(positions(&file), over_square);
    // Without a buffer view: zeros.
    file.json["accessors"][square].as_object_mut().unwrap().remove("bufferView");
    file.primitive()["indices"] = file.accessor("SCALAR", 5121, 3, &[0, 2, 3]).into();
    let on_a_line = file.load().unwrap();
    assert_eq!((on_a_line.triangle_count(), on_a_line.degenerate_triangles), (0, 1));
    file.json["accessors"][square]["sparse"]["indices"]["bufferView"] = json!(99);
    assert!(file.error().contains("POSITION: accessor 1 sparse data refers to buffer view 99"), "{}", file.error());
    file.json["accessors"][square]["sparse"] = sparse;
    file.json["accessors"][square]["count"] = json!(3);
    assert!(file.error().contains("accessor 1 sparse data replaces element 3 of 3"), "{}", file.error());
    file.json["accessors"][square]["count"] = json!(4_000_000_000_000u64);
    assert!(file.error().contains("64 times its size"), "{}", file.error());
}

/// glTF 2.0, 3.6.2.1: with sparse elements, as exporters write morph targets that move little, or without any.
#[test]
fn accessors_without_a_view_are_zeros() {
    let mut file = File::square();
    let count = json!({"componentType": F32, "type": "VEC3", "count": 4});
    let nothing = push(&mut file.json["accessors"], count.clone());
    let indices = file.view(&[2, 0]);
    let values = file.view(bytemuck::cast_slice(&[0.0f32, 0.0, 1.5]));
    let lifted = push(&mut file.json["accessors"], count);
    file.json["accessors"][lifted]["sparse"] = json!({"count": 1, "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": values}});
    file.primitive()["indices"] = file.accessor("SCALAR", 5121, 6, &[0, 1, 2, 0, 2, 3]).into();
    file.primitive()["targets"] = json!([{"POSITION": nothing}, {"POSITION": lifted}]);
    file.json["meshes"][0]["weights"] = json!([1, 1]);
    let scene = file.load().unwrap();
    assert_eq!(scene.triangle_count(), 2);
    let highest = scene.meshes()[0].parts[0].positions.iter().map(|p| p[2]).fold(0.0, f32::max);
    assert_eq!(highest, 1.5);
    // Normals of zero length, and positions that all coincide.
    file.primitive()["attributes"]["NORMAL"] = nothing.into();
    assert!(only_warning(&file.load().unwrap()).contains("normals of zero length"));
    let mut file = File::square();
    file.json["accessors"][1].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(file.load().unwrap().triangle_count(), 0);
    file.json["accessors"][1]["count"] = json!(4_000_000_000_000u64);
    assert!(file.error().contains("64 times its size"), "{}", file.error());
}

#[test]
fn alpha_of_vertices_multiplies_that_of_the_material() {
    let blend = json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}});
    let mut file = File::triangle();
    file.material(blend);
    let colors = |file: &mut File, alphas: [u8; 3]| {
        let bytes: Vec<u8> = alphas.iter().flat_map(|&alpha| [255, 255, 255, alpha]).collect();
        let accessor = file.accessor("VEC4", 5121, 3, &bytes);
        file.json["accessors"][accessor]["normalized"] = json!(true);
        file.primitive()["attributes"]["COLOR_0"] = accessor.into();
    };
    colors(&mut file, [0; 3]);
    let scene = file.load().unwrap();
    let part = &scene.objects[0].mesh.parts[0];
    let made_of = part.material.as_ref().unwrap();
    assert_eq!((made_of.alpha, made_of.base_color[3], part.alphas.is_none()), (Alpha::Coverage, 0.0, true));
    colors(&mut file, [0, 255, 51]);
    let scene = file.load().unwrap();
    let part = &scene.objects[0].mesh.parts[0];
    assert_eq!(part.alphas.as_ref().unwrap().to_vec(), [0.0, 1.0, 0.2]);
    assert_eq!(part.material.as_ref().unwrap().base_color[3], 0.5);
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report);
    // Rules may give alpha a meaning that the material does not.
    file.material(json!({"alphaMode": "OPAQUE"}));
    assert!(file.load().unwrap().objects[0].mesh.parts[0].alphas.is_some());
}

#[test]
fn quantised_vertices_and_texture_coordinates_are_read() {
    let mut file = File::triangle();
    file.texture();
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let positions = file.accessor("VEC3", 5122, 3, bytemuck::cast_slice(&[0i16, 0, 0, 100, 0, 0, 0, -200, 0]));
    let uvs = file.accessor("VEC2", 5123, 3, bytemuck::cast_slice(&[0u16, 65535, 13107, 0, 0, 0]));
    let normals = file.accessor("VEC3", 5120, 3, &[127, 0, 0, 0, 127, 0, 0, 0, 129]);
    file.json["accessors"][uvs]["normalized"] = json!(true);
    file.json["accessors"][normals]["normalized"] = json!(true);
    file.primitive()["attributes"] = json!({"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs});
    let scene = file.load().unwrap();
    let part = &scene.meshes()[0].parts[0];
    assert_eq!(part.positions[2], [0.0, -200.0, 0.0]);
    assert_eq!(part.normals.as_ref().unwrap()[2], [0.0, 0.0, -1.0]);
    assert_eq!(part.uvs.as_ref().unwrap()[..2], [[0.0, 1.0], [0.2, 0.0]]);
    // 8-bit texture coordinates.
    let uvs = file.accessor("VEC2", 5121, 3, &[0, 255, 51, 0, 0, 0]);
    file.json["accessors"][uvs]["normalized"] = json!(true);
    file.primitive()["attributes"]["TEXCOORD_0"] = uvs.into();
    assert_eq!(file.load().unwrap().meshes()[0].parts[0].uvs.as_ref().unwrap()[..2], [[0.0, 1.0], [0.2, 0.0]]);
}

#[test]
fn degenerate_triangles_are_left_out_and_counted() {
    let mut file = File::square();
    file.primitive()["indices"] = file.accessor("SCALAR", 5121, 9, &[0, 1, 1, 0, 1, 2, 3, 3, 3]).into();
    let scene = file.load().unwrap();
    assert_eq!((scene.degenerate_triangles, scene.triangle_count()), (2, 1));
    assert_eq!(only_warning(&scene), "street.glb: 2 triangles without area left out");
}

#[test]
fn bad_geometry_is_an_error_that_names_the_place() {
    let with = |edit: Edit| {
        let mut file = File::square();
        edit(&mut file);
        file.error()
    };
    let attribute =
        |file: &mut File, name: &str, accessor: usize| file.primitive()["attributes"][name] = accessor.into();
    let cases: [(Edit, &str); 21] = [
        (
            &|f| f.primitive()["indices"] = f.accessor("SCALAR", 5121, 3, &[0, 1, 4]).into(),
            "street.glb: mesh 0 \"Seat\" primitive 0: index 4 is past the last of 4 vertices",
        ),
        (
            &|f| {
                let bad = f.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0, 1.0, 1.0, 0.0]);
                attribute(f, "POSITION", bad);
            },
            "mesh 0 \"Seat\" primitive 0: vertex 1 is [1.0, NaN, 0.0]; allowed: -1e18 to 1e18",
        ),
        (
            &|f| {
                let bad = f.floats("VEC3", &[f32::INFINITY; 9]);
                attribute(f, "POSITION", bad);
            },
            "vertex 0 is [inf, inf, inf]",
        ),
        (&|f| attribute(f, "POSITION", 77), "POSITION: accessor 77 does not exist: the file has 2"),
        (
            &|f| f.json["accessors"][1]["count"] = json!(5),
            "accessor 1 ends beyond buffer view 1: 5 elements 12 bytes apart from byte 0 on, the view has 48 bytes",
        ),
        (&|f| f.json["accessors"][1]["count"] = json!(u64::MAX), "accessor 1 ends beyond buffer view 1"),
        (&|f| f.json["accessors"][1]["byteOffset"] = json!(4), "accessor 1 ends beyond buffer view 1"),
        (&|f| f.json["accessors"][1]["byteOffset"] = json!(u64::MAX), "accessor 1 ends beyond buffer view 1"),
        (&|f| f.json["accessors"][1]["bufferView"] = json!(9), "accessor 1 refers to buffer view 9, the file has 2"),
        (&|f| f.json["accessors"][1]["type"] = json!("VEC2"), "accessor 1 is not of type VEC3"),
        (&|f| f.json["accessors"][1]["componentType"] = json!(5125), "accessor 1 holds 32-bit integers"),
        (&|f| f.json["accessors"][1]["componentType"] = json!(1), "accessor 1 has an unknown componentType"),
        (
            &|f| f.json["bufferViews"][1]["byteStride"] = json!(8),
            "accessor 1 has elements of 12 bytes, but buffer view 1 a byteStride of 8",
        ),
        (
            &|f| f.json["bufferViews"][1]["byteLength"] = json!(4000),
            "buffer view 1, which ends beyond buffer 0: 4000 bytes from byte 36 on, the buffer has 84 bytes",
        ),
        (&|f| f.json["bufferViews"][1]["byteOffset"] = json!(u64::MAX), "buffer view 1, which ends beyond buffer 0"),
        (&|f| f.json["bufferViews"][1]["buffer"] = json!(3), "accessor 1 refers to buffer 3, the file has 1"),
        (
            &|f| f.primitive()["indices"] = f.floats("SCALAR", &[0.0, 1.0, 2.0]).into(),
            "indices: accessor 2 holds no indices",
        ),
        (&|f| attribute(f, "NORMAL", 0), "NORMAL has 3 elements for 4 vertices"),
        (&|f| attribute(f, "COLOR_0", 0), "COLOR_0 has 3 elements for 4 vertices"),
        (&|f| f.primitive()["material"] = json!(2), "its material 2 does not exist: the file has 0"),
        (&|f| f.primitive()["mode"] = json!(9), "its mode is unknown"),
    ];
    for (edit, message) in cases {
        assert!(with(edit).contains(message), "{} does not say {message}", with(edit));
        assert!(with(edit).contains("street.glb: mesh 0 \"Seat\" primitive 0: "), "{}", with(edit));
    }
}

#[test]
fn accessors_that_overlap_a_thousandfold_are_refused() {
    let mut file = File::triangle();
    let vertices = vec![0.0f32; 300_000];
    file.floats("VEC3", &vertices);
    let accessor = file.json["accessors"][1].clone();
    let primitives: Vec<Value> = (0..100)
        .map(|_| json!({"attributes": {"POSITION": push(&mut file.json["accessors"], accessor.clone())}}))
        .collect();
    file.json["meshes"][0]["primitives"] = primitives.into();
    assert!(file.error().contains("is too much: the file would take more than 64 times its size"), "{}", file.error());
}

#[test]
fn a_file_without_triangles_has_nothing_to_scan() {
    let mut file = File::triangle();
    file.primitive()["mode"] = json!(0);
    assert_eq!(file.load().unwrap().triangle_count(), 0);
    let error = Scene::from_glb_bytes(&file.bytes(), &LoadOptions::default()).unwrap_err().to_string();
    assert_eq!(error, "glTF data: no triangle to scan: the file holds no mesh with area");
}

#[test]
fn materials_are_read_with_their_extensions() {
    let mut file = File::triangle();
    file.json["extensionsRequired"] = json!(["KHR_materials_transmission", "KHR_materials_clearcoat"]);
    file.material(json!({
        "name": "glass",
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25, "roughnessFactor": 0.5},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.75},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_volume": {"thicknessFactor": 0.01, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]},
            "KHR_materials_unlit": {},
        },
        "extras": {"reflectance": 0.6, "blainder_rgba": [0, 0, 0, 0.9],
            "scattering": {"model": "oren_nayar", "slope_sigma_deg": 17}, "dirt": 0.02,
            "sound": {"law": "target", "strength_db": -30}, "radar": {"law": "metal", "rms_height_mm": 0.1},
            "pane_m": 0.004, "group_index": 1.4},
    }));
    let samples = json!([{"wavelength_nm": 905, "value": 0.75}, {"wavelength_nm": 1550, "value": 0.25}]);
    let mut sampled = File::triangle();
    sampled.material(json!({"extras": {"reflectance": samples}}));
    let sampled = sampled.load().unwrap().materials[0].reflectance.clone().unwrap();
    assert_eq!([905.0, 1550.0].map(|nm| sampled.at(nm)), [0.75, 0.25]);
    let scene = file.load().unwrap();
    let m = scene.meshes()[0].parts[0].material.as_ref().unwrap();
    assert_eq!((m.name.as_str(), m.base_color, m.metallic, m.roughness), ("glass", [0.1, 0.2, 0.3, 0.4], 0.25, 0.5));
    assert_eq!((m.transmission, m.ior, m.unlit), (0.75, 1.33, true));
    assert_eq!(m.reflectance, Some(Reflectance::Constant(0.6)));
    assert_eq!((&m.scattering, m.dirt), (&Scattering::OrenNayar { slope_sigma_deg: 17.0 }, 0.02));
    assert_eq!(m.sound, Some(Sound::Target { strength_db: -30.0 }));
    assert_eq!(m.radar.as_ref().map(ToString::to_string).unwrap(), "metal, rough by 0.1 mm");
    assert_eq!((m.pane_m, m.group_index, m.extinction_index), (Some(0.004), Some(1.4), 0.0));
    assert_eq!((m.thickness_m, m.attenuation_distance_m, m.attenuation_color), (0.01, 2.0, [1.0, 0.5, 0.0]));

    file.material(json!({"extras": {"ior": 0.2, "extinction_index": 6}}));
    let scene = file.load().unwrap();
    let gold = scene.meshes()[0].parts[0].material.as_ref().unwrap();
    assert_eq!((gold.ior, gold.extinction_index), (0.2, 6.0));

    file.material(json!({}));
    let scene = file.load().unwrap();
    let m = &scene.materials[0];
    // glTF's defaults for a material without keys.
    assert_eq!((m.name.as_str(), m.metallic, m.roughness, m.ior), ("material_0", 1.0, 1.0, 1.5));
    assert_eq!((&m.reflectance, m.thickness_m, m.attenuation_distance_m), (&None, 0.0, f32::INFINITY));

    file.material(json!({"extensions": {"KHR_materials_pbrSpecularGlossiness":
        {"diffuseFactor": [0.5, 0.25, 0.125, 1], "glossinessFactor": 0.75}}}));
    let scene = file.load().unwrap();
    let m = &scene.materials[0];
    assert_eq!((m.base_color, m.metallic, m.roughness), ([0.5, 0.25, 0.125, 1.0], 0.0, 0.25));
}

#[test]
fn alpha_modes_say_what_alpha_means() {
    let mut file = File::triangle();
    for (source, expected) in [
        (json!({}), (Alpha::Solid, 0.5)),
        (json!({"alphaMode": "OPAQUE"}), (Alpha::Solid, 0.5)),
        (json!({"alphaMode": "BLEND", "extras": {"alpha": 0.5}}), (Alpha::Coverage, 0.5)),
        (json!({"alphaMode": "BLEND", "extras": {"alpha": "solid"}}), (Alpha::Solid, 0.5)),
        (json!({"alphaMode": "BLEND", "name": "Window_Glass"}), (Alpha::Solid, 0.5)),
        (
            json!({"alphaMode": "BLEND", "name": "Window_Glass", "extras": {"alpha": "coverage"}}),
            (Alpha::Coverage, 0.5),
        ),
        (
            json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"metallicFactor": 0},
                "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.9}}}),
            (Alpha::Solid, 0.5),
        ),
        (json!({"alphaMode": "MASK"}), (Alpha::Cutout, 0.5)),
        (json!({"alphaMode": "MASK", "alphaCutoff": 0.25}), (Alpha::Cutout, 0.25)),
        (json!({"alphaMode": "MASK", "extras": {"alpha": "ignore"}}), (Alpha::Solid, 0.5)),
        (json!({"alphaMode": "BLEND", "extras": {"alpha": "cutout", "alpha_cutoff": 0.75}}), (Alpha::Cutout, 0.75)),
        (json!({"extras": {"alpha": "reflectance"}}), (Alpha::Reflectance, 0.5)),
    ] {
        file.material(source.clone());
        let material = &file.load().unwrap().materials[0];
        assert_eq!((material.alpha, material.alpha_cutoff), expected, "{source}");
    }
}

#[test]
fn properties_of_the_papers_system_are_read() {
    let mut file = File::triangle();
    file.material(json!({"pbrMetallicRoughness": {"metallicFactor": 0.5}, "extras":
        {"blainder_rgba": [0.8, 0.8, 0.8, 0.9], "blainder_metallic": 1.0, "blainder_ior": 1.45, "other": {"x": []}}}));
    let read = |file: &File| file.load().unwrap().materials.swap_remove(0);
    let m = read(&file);
    assert_eq!((&m.reflectance, m.metallic, m.ior), (&Some(Reflectance::Constant(0.9)), 1.0, 1.45));
    file.json["materials"][0]["extras"]["blainder_ior"] = json!(0.0);
    assert_eq!(read(&file).ior, 1.5, "0: no refraction said");
}

#[test]
fn material_values_out_of_range_are_errors() {
    for (material, message) in [
        (
            json!({"name": "x", "extras": {"reflectance": 1.5}}),
            "street.glb: material 0 \"x\": extras.reflectance is 1.5; allowed: 0 to 1",
        ),
        (
            json!({"extras": {"reflectance": "high"}}),
            "extras.reflectance: invalid type: string \"high\", expected a number or a list of {wavelength_nm, value}",
        ),
        (
            json!({"extras": {"reflectance": []}}),
            "extras.reflectance is an empty list; allowed: a number, or one sample or more",
        ),
        (
            json!({"extras": {"reflectance": [{"wavelength_nm": 905, "value": 2}]}}),
            "extras.reflectance[0].value is 2; allowed: 0 to 1",
        ),
        (
            json!({"extras": {"reflectance": [{"wavelength_nm": 905}]}}),
            "extras.reflectance: [0]: the key `value` is missing",
        ),
        (json!({"extras": {"blainder_rgba": [1, 1, 1]}}), "extras.blainder_rgba[3] is not a number"),
        (json!({"extras": {"ior": 0.2}}), "extras.ior is 0.2; allowed: 1 to 100, or less with an extinction_index"),
        (json!({"extras": {"pane_m": -1}}), "extras.pane_m is -1; allowed: 0 to 10"),
        (json!({"extras": {"group_index": "x"}}), "extras.group_index is not a number; allowed: 1 to 10"),
        (json!({"extras": {"extinction_index": 101}}), "extras.extinction_index is 101; allowed: 0 to 100"),
        (json!({"extras": {"blainder_rgba": [1, 1, 1, -1]}}), "extras.blainder_rgba[3] is -1"),
        (
            json!({"extras": {"scattering": {"model": "ggx", "f0": 2, "alpha": 0.3}}}),
            "extras.scattering.f0 is 2; allowed: 0 to 1",
        ),
        (
            json!({"extras": {"sound": {"law": "lambert", "mu_db": 3}}}),
            "extras.sound.mu_db is 3; allowed: -100 to -4.9715",
        ),
        (
            json!({"extras": {"radar": {"law": "permittivity", "eps": 0.5}}}),
            "extras.radar.eps is 0.5; allowed: 1 to 1000",
        ),
        (
            json!({"extras": {"scattering": {"model": "ggx", "f0": 0.04, "alph": 0.3}}}),
            "extras.scattering: alph: unknown key \"alph\"; near: alpha; allowed: f0, alpha",
        ),
        (
            json!({"extras": {"scattering": {"model": "phong", "specular": 0.5, "exponent": 9}, "reflectance": 0.6}}),
            "extras.scattering.specular is 0.5; allowed: such that it and the reflectance of 0.6 make at most 1",
        ),
        (
            json!({"extras": {"alpha": "mask"}}),
            "extras.alpha: unknown value \"mask\"; allowed: ignore, solid, coverage, cutout, reflectance",
        ),
        (json!({"extras": {"alpha_cutoff": 2}}), "extras.alpha_cutoff is 2; allowed: a number from 0 to 1"),
        (json!({"extras": {"blainder_metallic": 2}}), "extras.blainder_metallic is 2"),
        (json!({"extras": {"blainder_ior": 0.5}}), "extras.blainder_ior is 0.5; allowed: 0 for none, or 1 and more"),
        (json!({"extensions": {"KHR_materials_ior": {"ior": 0.5}}}), "ior is 0.5"),
        (
            json!({"extensions": {"KHR_materials_volume": {"thicknessFactor": -1}}}),
            "thicknessFactor is -1; allowed: 0 or more",
        ),
        (
            json!({"extensions": {"KHR_materials_volume": {"attenuationDistance": 0}}}),
            "attenuationDistance is 0; allowed: more than 0",
        ),
        (json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 3}}}), "its texture 3 does not exist"),
    ] {
        let mut file = File::triangle();
        file.material(material);
        assert!(file.error().contains(message), "{} does not say {message}", file.error());
    }
    let mut file = File::triangle();
    file.material(json!({"pbrMetallicRoughness": {"baseColorFactor": [1.5, 0, 0, 1], "roughnessFactor": -0.1}}));
    let scene = file.load().unwrap();
    assert_eq!((scene.materials[0].base_color[0], scene.materials[0].roughness), (1.0, 0.0));
    assert_eq!(
        only_warning(&scene),
        "street.glb: factors outside 0..1 are clamped: material 0 baseColorFactor 1.5 and 1 more"
    );
}

#[test]
fn a_texture_is_read_with_its_sampler() {
    let mut file = File::triangle();
    file.texture();
    let scene = file.load().unwrap();
    let image = &scene.textures()[0];
    assert_eq!((image.width, image.height, &image.pixels[..]), (2, 1, &[[255, 0, 0, 255], [0, 255, 0, 255]][..]));
    let plain = scene.materials[0].base_color_texture.clone().unwrap();
    assert_eq!((plain.wrap_u, plain.wrap_v, plain.filter), (Wrap::Repeat, Wrap::Repeat, Filter::Linear));
    assert_eq!(*scene.meshes()[0].parts[0].uvs.clone().unwrap(), [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);

    file.json["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]);
    file.json["textures"][0]["sampler"] = json!(0);
    let scene = file.load().unwrap();
    let use_ = scene.materials[0].base_color_texture.clone().unwrap();
    assert_eq!((use_.wrap_u, use_.wrap_v, use_.filter), (Wrap::ClampToEdge, Wrap::MirroredRepeat, Filter::Nearest));

    // Two materials with one image: decoded once.
    let again = file.json["materials"][0].clone();
    push(&mut file.json["materials"], again);
    let mut primitive = file.primitive().clone();
    primitive["material"] = json!(1);
    push(&mut file.json["meshes"][0]["primitives"], primitive);
    let scene = file.load().unwrap();
    assert!(scene.materials.iter().all(|material| material.base_color_texture.is_some()));
    assert_eq!((scene.materials.len(), scene.textures().len()), (2, 1));
}

#[test]
fn images_that_nothing_uses_are_not_decoded() {
    let mut file = File::triangle();
    file.texture();
    file.material(json!({"name": "plain"}));
    push(&mut file.json["materials"], json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    file.json["images"][0] = json!({"uri": "gone.png"});
    let scene = file.load().unwrap();
    assert_eq!((scene.materials.len(), scene.textures().len()), (2, 0));
    assert!(scene.materials[1].base_color_texture.is_none());
}

#[test]
fn a_texture_transform_moves_the_coordinates() {
    let mut file = File::triangle();
    file.texture();
    let other = file.floats("VEC2", &[0.5, 0.5, 0.25, 0.75, 0.0, 1.0]);
    file.primitive()["attributes"]["TEXCOORD_1"] = other.into();
    file.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    file.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!(
        {"KHR_texture_transform": {"offset": [0.5, 0.25], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 3], "texCoord": 1}}
    );
    let scene = file.load().unwrap();
    assert_eq!(scene.meshes()[0].parts[0].uvs.as_ref().unwrap()[1], [0.25, 0.75], "its texCoord goes before");
    let rows = scene.materials[0].base_color_texture.as_ref().unwrap().transform;
    let at = |u: f32, v: f32| rows.map(|row| row[0] * u + row[1] * v + row[2]);
    // (1, 0) is scaled to (2, 0), turned counter-clockwise in the image, v down, to (0, -2), and moved.
    for (found, expected) in [(at(1.0, 0.0), [0.5, -1.75]), (at(0.0, 1.0), [3.5, 0.25])] {
        assert!((found[0] - expected[0]).abs() < 1e-6 && (found[1] - expected[1]).abs() < 1e-6, "{found:?}");
    }
}

#[test]
fn textures_that_cannot_be_used_cause_a_warning() {
    let mut file = File::triangle();
    file.texture();
    file.primitive()["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    let scene = file.load().unwrap();
    assert!(scene.meshes()[0].parts[0].uvs.is_none());
    assert!(only_warning(&scene).contains("textures are not used where texture coordinates are missing: mesh 0"));

    file.json["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    let scene = file.load().unwrap();
    assert!(scene.materials[0].base_color_texture.is_none());
    assert!(only_warning(&scene).contains("textures without a PNG or JPEG image are left out: material 0"));
}

#[test]
fn bad_images_are_errors() {
    let cases: [(Edit, &str); 7] = [
        (&|f| f.json["images"][0] = json!({}), "street.glb: image 0: it has neither uri nor bufferView"),
        (&|f| f.json["images"][0]["bufferView"] = json!(8), "image 0 \"wood\": it refers to buffer view 8"),
        (&|f| f.json["images"][0] = json!({"uri": "data:,hello"}), "image 0: the image is neither PNG nor JPEG"),
        (&|f| f.json["images"][0] = json!({"uri": "wood.png"}), "image 0: \"wood.png\" is a file of its own"),
        (&|f| f.json["bufferViews"][1]["byteLength"] = json!(50), "image 0 \"wood\": the image cannot be decoded"),
        (&|f| f.json["textures"][0]["source"] = json!(4), "material 0: its image 4 does not exist"),
        (&|f| f.json["textures"][0]["sampler"] = json!(4), "material 0: its sampler 4 does not exist"),
    ];
    for (edit, message) in cases {
        let mut file = File::triangle();
        file.texture();
        edit(&mut file);
        assert!(file.error().contains(message), "{} does not say {message}", file.error());
    }
    // A header that announces 100,000 x 100,000 pixels.
    let mut huge = png(1, 1, &[0; 4]);
    huge[16..20].copy_from_slice(&100_000u32.to_be_bytes());
    huge[20..24].copy_from_slice(&100_000u32.to_be_bytes());
    let mut file = File::triangle();
    file.texture();
    let view = file.view(&huge);
    file.json["images"][0]["bufferView"] = view.into();
    assert!(file.error().contains("image 0 \"wood\": the image cannot be decoded"), "{}", file.error());
}

#[test]
fn one_colour_of_all_vertices_tints_the_material() {
    let mut file = File::triangle();
    file.material(json!({"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]}}));
    let constant = file.floats("VEC3", &[0.5, 0.25, 1.0, 0.5, 0.25, 1.0, 0.5, 0.25, 1.0]);
    file.primitive()["attributes"]["COLOR_0"] = constant.into();
    let scene = file.load().unwrap();
    let material = scene.meshes()[0].parts[0].material.as_ref().unwrap();
    assert_eq!((material.name.as_str(), material.base_color), ("paint", [0.25, 0.25, 1.0, 1.0]));
    assert_eq!(scene.materials[0].base_color, [0.5, 1.0, 1.0, 1.0], "others may use the material untinted");
    assert_eq!(scene.labels.material.names, ["paint"]);

    file.primitive()["attributes"]["COLOR_0"] = file.accessor("VEC4", 5121, 3, &[255; 12]).into();
    file.json["accessors"][2]["normalized"] = json!(true);
    assert_eq!(file.load().unwrap().materials.len(), 1, "white tints nothing");

    file.primitive()["attributes"]["COLOR_0"] =
        file.accessor("VEC4", 5121, 3, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]).into();
    let scene = file.load().unwrap();
    assert_eq!(scene.materials.len(), 1);
    assert!(only_warning(&scene).contains("vertex colours that change over a primitive are not used: mesh 0"));

    file.json.as_object_mut().unwrap().remove("materials");
    *file.primitive() = json!({"attributes": {"POSITION": 0, "COLOR_0": constant}});
    let scene = file.load().unwrap();
    assert_eq!(scene.meshes()[0].parts[0].material.as_ref().unwrap().base_color, [0.5, 0.25, 1.0, 1.0]);
}

#[test]
fn cameras_are_named_and_placed() {
    let mut file = File::triangle();
    file.json["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}, "name": "lens"},
        {"type": "orthographic", "orthographic": {"xmag": 1.0, "ymag": 1.0, "znear": 0.1, "zfar": 9.0}},
    ]);
    file.json["nodes"] = json!([
        {"mesh": 0, "children": [1]},
        {"camera": 0, "name": "Sensor", "translation": [1, 2, 3]},
        {"camera": 0},
        {"camera": 1},
    ]);
    let scene = file.load().unwrap();
    let names: Vec<_> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["Sensor", "lens", "camera_1"]);
    let pose = scene.camera("Sensor").unwrap().pose;
    close(pose.position, DVec3::new(1.0, -3.0, 2.0), 0.0);
    // glTF cameras look along -z, which is +y here, and have y, here z, up.
    close(pose.orientation * DVec3::X, DVec3::Y, 1e-12);
    close(pose.orientation * DVec3::Z, DVec3::Z, 1e-12);
}

#[test]
fn labels_come_from_the_node_or_its_nearest_ancestor() {
    let mut file = File::triangle();
    file.material(json!({"name": "wood"}));
    file.json["nodes"] = json!([
        {"name": "Room", "children": [1, 2], "extras": {"categoryID": "room", "partID": 7}},
        {"name": "Chair", "children": [3], "extras": {"categoryID": "chair"}},
        {"name": "Wall", "mesh": 0},
        {"name": "Seat", "mesh": 0, "extras": {"partID": "seat", "x": 1}},
        {"name": "Lamp", "mesh": 0, "extras": {"categoryID": {"not": "text"}}},
        {"name": "Tag", "mesh": 0, "extras": {"categoryID": 3.0, "partID": 2.5}},
    ]);
    let scene = file.load().unwrap();
    let labels = |name: &str| {
        let object = scene.objects.iter().find(|object| object.name == name).unwrap();
        let part = scene.labels.part.name(object.part_ids[0]).unwrap();
        (scene.labels.category.name(object.category_id).unwrap(), part)
    };
    assert_eq!(labels("Wall"), ("room", "7"));
    assert_eq!(labels("Seat"), ("chair", "seat"));
    assert_eq!(labels("Lamp"), ("Lamp", "wood"));
    assert_eq!(labels("Tag"), ("3", "2.5"));
}

/// Whole numbers are kept as labels; names take the free ones.
#[test]
fn numeric_labels_are_kept() {
    let mut file = File::triangle();
    file.material(json!({"name": "wood", "extras": {"partID": 9}}));
    let node = |name: &str, category: Value| json!({"name": name, "mesh": 0, "extras": {"categoryID": category}});
    file.json["nodes"] = json!([
        node("Desk", json!(30)),
        node("Lamp", json!(12.0)),
        node("Rug", json!("carpet")),
        node("Vase", json!("7")),
        node("Air", json!(0)),
        node("Odd", json!(-3)),
        node("Huge", json!(5_000_000_000_u64)),
        {"name": "Door", "mesh": 0},
    ]);
    let of = |scene: &Scene, name: &str| scene.objects.iter().find(|object| object.name == name).unwrap().category_id;
    let scene = file.load().unwrap();
    let found = ["Desk", "Lamp", "Vase", "Air"].map(|name| of(&scene, name));
    assert_eq!(found, [30, 12, 7, 0]);
    assert_eq!(scene.labels.category.names, ["-3", "5000000000", "Door", "carpet", "7", "12", "30"]);
    assert_eq!((scene.objects[0].part_ids[0], scene.labels.part.name(9)), (9, Some("9")));
    let odd = "categories: numbers that are not whole or not in 0 to 4294967295 are taken as names: -3, 5000000000";
    assert_eq!(only_warning(&scene), odd);

    // Rules name numbers; the same name from elsewhere causes a warning.
    let numbers = "numbers: {desk: 30, lamp: 12}\nobjects: {Door: desk}";
    let options = LoadOptions { labels: LabelRules::from_yaml(numbers).unwrap(), ..LoadOptions::default() };
    let scene = load_with(&file.bytes(), &options).unwrap();
    assert_eq!(["Desk", "Door", "Lamp"].map(|name| of(&scene, name)), [30, 30, 12]);
    assert_eq!(scene.labels.category.name(30), Some("desk"));
    assert!(scene.report.warnings[1].ends_with("are the same labels: desk"), "{:?}", scene.report);
}

/// Data that takes a few bytes of a file is counted before it is allocated.
#[test]
fn compressed_instances_are_counted_first() {
    // Blocks of 256 elements of 12 zero bytes (EXT_meshopt_compression, mode 0, version 0): four header bytes per byte
    // position.
    let count = 400_000_usize;
    let block = |vertices: usize| vec![0u8; vertices.div_ceil(16).div_ceil(4) * 12];
    let mut stream = vec![0xa0];
    (0..count / 256).for_each(|_| stream.extend(block(256)));
    stream.extend(block(count % 256));
    stream.resize(stream.len() + 32, 0);
    let mut file = File::triangle();
    let view = file.view(&stream);
    let length = stream.len();
    let offset = file.json["bufferViews"][view]["byteOffset"].clone();
    file.json["bufferViews"][view] = json!({
        "buffer": 0, "byteLength": count * 12, "byteStride": 12,
        "extensions": {"EXT_meshopt_compression": {
            "buffer": 0, "byteOffset": offset, "byteLength": length, "byteStride": 12, "count": count, "mode": "ATTRIBUTES"
        }},
    });
    let accessor = json!({"bufferView": view, "componentType": F32, "type": "VEC3", "count": count});
    let places = push(&mut file.json["accessors"], accessor);
    file.node()["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}});
    let error = file.error();
    assert!(
        error.contains("node 0 \"Chair\": EXT_mesh_gpu_instancing: its number of instances, 400000, is too much"),
        "{error}"
    );
}

#[test]
fn instances_of_a_node_become_objects() {
    let mut file = File::triangle();
    let translation = file.floats("VEC3", &[0.0, 0.0, 0.0, 10.0, 0.0, 0.0]);
    let scale = file.floats("VEC3", &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    file.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    file.node()["translation"] = json!([0, 0, 5]);
    file.node()["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation, "SCALE": scale, "_ID": 0}}});
    let scene = file.load().unwrap();
    assert_eq!((scene.meshes().len(), scene.objects.len()), (1, 2));
    close(world_vertex(&scene, 1, 1), DVec3::new(12.0, -5.0, 0.0), 0.0);
    let rotation = file.floats("VEC4", &[0.0; 8]);
    let attributes =
        |file: &mut File, value| file.node()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = value;
    for (value, message) in [
        (json!({"TRANSLATION": translation, "SCALE": 0}), "its accessors have 3 and other counts"),
        (json!({}), "it has no attributes"),
        (json!({"ROTATION": rotation}), "instance 0 has a transform that is not finite"),
        (json!({"TRANSLATION": "x"}), "EXT_mesh_gpu_instancing: invalid type"),
        (json!({"TRANSLATION": 55}), "accessor 55 does not exist"),
    ] {
        attributes(&mut file, value);
        assert!(
            file.error().contains("street.glb: node 0 \"Chair\": ") && file.error().contains(message),
            "{}",
            file.error()
        );
    }
}

#[test]
fn extensions_that_are_not_supported_are_named() {
    for name in ["MPEG_media", "ACME_anything"] {
        let mut file = File::triangle();
        file.json["extensionsRequired"] = json!([name]);
        assert_eq!(
            file.error(),
            format!(
                "street.glb: the extension {name}, which the file requires, is not supported: convert the file with another \
                 tool first, such as gltf-transform"
            )
        );
    }
}

#[test]
fn extensions_without_effect_cause_a_warning() {
    let mut file = File::triangle();
    file.json["extensionsRequired"] = json!([
        "KHR_materials_clearcoat",
        "KHR_materials_ior",
        "KHR_mesh_quantization",
        "EXT_meshopt_compression",
        "KHR_draco_mesh_compression",
        "EXT_mesh_gpu_instancing",
        "KHR_texture_basisu",
    ]);
    let scene = file.load().unwrap();
    assert_eq!(
        scene.report.warnings,
        ["street.glb: extensions that the file requires have no effect: KHR_materials_clearcoat, KHR_texture_basisu"]
    );
}

#[test]
fn compressed_files_are_read() {
    for file in [
        &include_bytes!("../../../tests/data/scenes/compressed/draco_edgebreaker.glb")[..],
        &include_bytes!("../../../tests/data/scenes/compressed/draco_sequential.glb")[..],
        &include_bytes!("../../../tests/data/scenes/compressed/meshopt.glb")[..],
    ] {
        let scene = load(file).unwrap();
        assert_eq!(scene.triangle_count(), 2 * 14 * 14 + 5 * 2 * 12 * 7);
    }
}

#[test]
fn damaged_files_are_errors() {
    let read = |bytes: &[u8]| {
        let found = load(bytes).expect_err("the file is damaged").to_string();
        assert!(!found.contains("serde") && !found.contains("struct"), "{found}");
        found
    };
    assert_eq!(read(b""), "street.glb: the file is empty");
    assert_eq!(read(b"glTF\x02\0\0\0"), "street.glb: the file is cut off: 8 bytes, a GLB header alone has 12");
    assert_eq!(read(b"glTF\x01\0\0\0\x0c\0\0\0"), "street.glb: GLB version 1; allowed: 2");
    assert_eq!(read(b"glTF\x02\0\0\0\x03\0\0\0"), "street.glb: the first GLB chunk is not JSON");
    assert!(read(b"{\"asset\": 3,\n ?}").starts_with("street.glb: line 1 column 11: not a glTF file: "));
    assert!(read(b"{}").contains("the key `asset` is missing"));
    assert!(read(b"\xff\xfe\x00").contains("not a glTF file"));
    assert!(read(br#"{"asset":{"version":"2.0"},"nodes":[{"mesh":-1}]}"#).contains("not a glTF file: invalid "));
    assert!(read(br#"{"asset":{"version":"2.0"},"nodes":{"a":{}}}"#).contains("not a glTF file: invalid type: map"));
    let first = br#"{"asset":{"version":"1.0"},"nodes":{"a":{}}}"#;
    assert_eq!(read(first), "street.glb: asset: glTF version 1.0; allowed: 2.0");

    let whole = File::triangle().bytes();
    for length in 1..whole.len() {
        let error = read(&whole[..length]);
        assert!(error.contains("cut off") || length < 4, "{length}: {error}");
    }
    // The length in the header matches the rest, the chunks do not.
    for length in 12..whole.len() {
        let mut cut = whole[..length].to_vec();
        cut[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        let error = read(&cut);
        let known = ["cut off", "the first GLB chunk is not JSON", "neither uri nor GLB chunk"];
        assert!(known.iter().any(|message| error.contains(message)), "{length}: {error}");
    }
    let mut file = File::triangle();
    file.json["buffers"][0]["byteLength"] = json!(u64::MAX);
    let message = "street.glb: buffer 0: it is cut off: 36 bytes, its byteLength is 18446744073709551615";
    assert_eq!(file.error(), message);
    push(&mut file.json["buffers"], json!({"byteLength": 4}));
    file.json["buffers"][0]["byteLength"] = json!(36);
    assert_eq!(file.error(), "street.glb: buffer 1: it has neither uri nor GLB chunk");
}

#[test]
fn text_files_lead_to_their_buffers_and_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("street.gltf");
    let mut file = File::triangle();
    file.texture();
    let image = png(1, 1, &[1, 2, 3, 4]);
    std::fs::create_dir(folder.path().join("my textures")).unwrap();
    std::fs::write(folder.path().join("my textures/wood.png"), &image).unwrap();
    std::fs::write(folder.path().join("mesh data.bin"), &file.bin).unwrap();
    file.json["images"][0] = json!({"uri": "my%20textures/wood.png"});
    file.json["buffers"][0] = json!({"uri": "mesh%20data.bin", "byteLength": file.bin.len(), "name": "data"});
    let load = |file: &File| {
        std::fs::write(&path, format!("\u{feff}{}", file.json)).unwrap();
        Scene::load(&path)
    };
    let error = |file: &File| load(file).unwrap_err().to_string();
    let scene = load(&file).unwrap();
    assert_eq!((scene.triangle_count(), scene.textures()[0].pixels[0]), (1, [1, 2, 3, 4]));

    let place = format!("{}: ", path.display());
    file.json["buffers"][0]["uri"] = json!("gone.bin");
    assert!(error(&file).starts_with(&format!("{place}buffer 0 \"data\": cannot read ")), "{}", error(&file));
    assert!(error(&file).contains("gone.bin: No such file"));
    file.json["buffers"][0]["uri"] = json!("mesh data.bin");
    file.json["buffers"][0]["byteLength"] = json!(file.bin.len() + 1);
    assert!(error(&file).contains("buffer 0 \"data\": it is cut off"), "{}", error(&file));
    file.json["buffers"][0]["byteLength"] = json!(file.bin.len());
    file.json["images"][0]["uri"] = json!("gone.png");
    assert!(error(&file).starts_with(&format!("{place}image 0: cannot read ")), "{}", error(&file));
    for absolute in [format!("file://{}", path.display()), path.display().to_string()] {
        file.json["images"][0]["uri"] = absolute.into();
        let found = error(&file);
        assert!(found.contains("leads out of the folder of the scene; allowed: paths in it, or any with"), "{found}");
        let options = LoadOptions { allow_outside_paths: true, ..LoadOptions::default() };
        let found = Scene::load_with(&path, &options).unwrap_err().to_string();
        assert!(found.contains("the image is neither PNG nor JPEG"), "{found}");
    }
    let missing = Scene::load(folder.path().join("none.glb")).unwrap_err().to_string();
    assert!(missing.contains("none.glb: No such file"), "{missing}");
}

#[test]
fn scenes_of_other_programs_are_read() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/examples");
    for (name, triangles) in [("apartment", 10_628), ("indoor-1", 58_951)] {
        let labels = LabelRules::load(scenes.join(format!("{name}.labels.yaml"))).unwrap();
        let options = LoadOptions { labels, ..LoadOptions::default() };
        let scene = Scene::load_with(scenes.join(format!("{name}.glb")), &options).unwrap();
        let kept: usize = scene.meshes().iter().map(|mesh| mesh.triangle_count()).sum();
        assert_eq!(kept + scene.degenerate_triangles, triangles, "{name}");
        assert!(scene.labels.category.names.iter().any(|category| category == "wall"), "{name}");
        assert!(!scene.report.warnings.iter().any(|warning| warning.contains("label rules")), "{:?}", scene.report);
    }
}

#[test]
fn fallback_buffers_need_not_have_data() {
    let file = include_bytes!("../../../tests/data/scenes/compressed/pack_khr.glb");
    let scene = Scene::from_glb_bytes(file, &LoadOptions::default()).unwrap();
    assert_eq!(scene.triangle_count(), 2 * 14 * 14 + 5 * 2 * 12 * 7);
    assert_eq!(scene.objects.len(), 6);
}
