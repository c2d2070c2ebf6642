use super::pictures::red_above_blue;
use super::*;
use crate::scene::{LabelRules, LoadOptions, Scene, Wrap};
use glam::DVec3;
use std::fs;

/// Writes files, the first of which is the scene, and reads it.
fn read_files(files: &[(&str, &[u8])]) -> Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    Scene::load(folder.path().join(files[0].0))
}

fn read_text(text: &str) -> Result<Scene> {
    read_files(&[("scene.ply", text.as_bytes())])
}

/// A message without the folder in front.
fn error(bytes: &[u8]) -> String {
    let message = read_files(&[("scene.ply", bytes)]).unwrap_err().to_string();
    message.split_once("scene.ply: ").unwrap().1.to_owned()
}

fn warnings(scene: &Scene) -> Vec<String> {
    let strip = |warning: &String| warning.split_once("scene.ply: ").unwrap().1.to_owned();
    scene.report.warnings.iter().map(strip).collect()
}

fn ascii(elements: &str, rows: &str) -> String {
    format!("ply\nformat ascii 1.0\n{elements}end_header\n{rows}")
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";
const FACES: &str = "property list uchar int vertex_indices\n";
const QUAD: &str = "0 0 0\n2 0 0\n2 1 0\n0 1 0\n";

fn quad(faces: &str) -> String {
    let count = faces.lines().count();
    ascii(&format!("element vertex 4\n{XYZ}element face {count}\n{FACES}"), &format!("{QUAD}{faces}"))
}

#[test]
fn all_encodings_and_types_are_the_same_mesh() {
    let text = read_text(&quad("4 0 1 2 3\n")).unwrap();
    let corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]];
    type ToBytes = fn(i8) -> Vec<u8>;
    let kinds: [(&str, ToBytes); 10] = [
        ("char", |v| v.to_le_bytes().to_vec()),
        ("uint8", |v| (v as u8).to_le_bytes().to_vec()),
        ("short", |v| i16::from(v).to_le_bytes().to_vec()),
        ("ushort", |v| (v as u16).to_le_bytes().to_vec()),
        ("int32", |v| i32::from(v).to_le_bytes().to_vec()),
        ("uint", |v| (v as u32).to_le_bytes().to_vec()),
        ("int64", |v| i64::from(v).to_le_bytes().to_vec()),
        ("uint64", |v| (v as u64).to_le_bytes().to_vec()),
        ("float", |v| f32::from(v).to_le_bytes().to_vec()),
        ("double", |v| f64::from(v).to_le_bytes().to_vec()),
    ];
    for (number, (kind, bytes_of)) in kinds.into_iter().enumerate() {
        let (list_kind, list_bytes_of) = kinds[(number + 3) % 10];
        for order in ["little", "big"] {
            let put = |bytes: Vec<u8>| if order == "big" { bytes.into_iter().rev().collect() } else { bytes };
            // Unknown elements and properties before, between and after the known ones.
            let header = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement extra 1\nproperty list {kind} {list_kind} odd\nproperty {kind} one\n\
                 element vertex 4\nproperty {kind} x\nproperty list {list_kind} {kind} odd\nproperty {kind} y\nproperty {kind} z\n\
                 element face 1\nproperty {kind} odd\nproperty list {list_kind} {kind} vertex_index\nend_header\n"
            );
            let mut body: Vec<Vec<u8>> = vec![bytes_of(2), list_bytes_of(9), list_bytes_of(9), bytes_of(9)];
            for [x, y, z] in corners {
                body.extend([bytes_of(x), list_bytes_of(1), bytes_of(7), bytes_of(y), bytes_of(z)]);
            }
            body.extend([bytes_of(5), list_bytes_of(4), bytes_of(0), bytes_of(1), bytes_of(2), bytes_of(3)]);
            let bytes: Vec<u8> = header.bytes().chain(body.into_iter().flat_map(put)).collect();
            let binary = read_files(&[("scene.ply", &bytes)]).unwrap();
            for scene in [&text, &binary] {
                let [object] = &scene.objects[..] else { panic!("one object") };
                let part = &object.mesh.parts[0];
                assert_eq!((object.name.as_str(), part.positions.len()), ("scene", 4), "{kind} {order}");
                assert_eq!(part.triangles[..], [[0, 1, 2], [0, 2, 3]]);
                assert_eq!(scene.bounds().unwrap(), (DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)));
                assert!(part.normals.is_none() && part.uvs.is_none() && part.material.is_none());
                assert_eq!(scene.report.warnings, [""; 0]);
            }
            for length in 0..bytes.len() {
                assert!(read_files(&[("scene.ply", &bytes[..length])]).is_err(), "{length} bytes of it");
            }
        }
    }
}

#[test]
fn faces_may_come_first_and_points_may_be_missing() {
    let text = ascii(
        &format!("element face 2\n{FACES}element vertex 5\n{XYZ}"),
        &format!("3 0 1 2\r\n2 0 1\r\nnan NaN -inf\n{QUAD}").replace("3 0 1 2", "3 1 2 3"),
    );
    let scene = read_text(&text).unwrap();
    assert_eq!(scene.triangle_count(), 1);
    assert_eq!(warnings(&scene), ["1 face with fewer than 3 corners skipped"]);
    let error = error(text.replace("3 1 2 3", "3 0 2 3").as_bytes());
    assert_eq!(error, "vertex 0 is [NaN, NaN, -inf]; allowed: -1e18 to 1e18");
}

#[test]
fn strips_turn_every_other_triangle() {
    let text = ascii(
        &format!("element vertex 4\n{XYZ}element tristrips 1\nproperty list int int vertex_indices\n"),
        &format!("{QUAD}10 0 1 3 2 -1 2 3 -1 0 1"),
    );
    let scene = read_text(&text).unwrap();
    assert_eq!(scene.objects[0].mesh.parts[0].triangles[..], [[0, 1, 2], [2, 1, 3]]);
    let normals = |scene: &Scene| {
        let points: Vec<DVec3> = scene.world_points().collect();
        points.chunks(3).map(|p| (p[1] - p[0]).cross(p[2] - p[0]).z).collect::<Vec<_>>()
    };
    assert_eq!(normals(&scene), [2.0, 2.0]);
}

#[test]
fn labels_of_faces_make_objects() {
    let elements =
        format!("element vertex 4\n{XYZ}element face 4\n{FACES}property float scalar_label\nproperty int object_id\n");
    let rows = format!("{QUAD}3 0 1 2 7 2\n3 0 2 3 nan 2\n3 0 1 3 7 2\n3 1 2 3 7 1\n");
    let scene = read_text(&ascii(&elements, &rows)).unwrap();
    let found: Vec<_> = scene
        .objects
        .iter()
        .map(|o| (o.name.as_str(), scene.labels.category.name(o.category_id).unwrap(), o.mesh.triangle_count()))
        .collect();
    assert_eq!(found, [("scene_2", "scene_2", 1), ("scene_7_1", "7", 1), ("scene_7_2", "7", 2)]);

    // A label file gives them their numbers.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.ply");
    fs::write(&path, ascii(&elements, &rows)).unwrap();
    let labels = LabelRules { numbers: [("7".to_owned(), 7)].into(), ..LabelRules::default() };
    let scene = Scene::load_with(&path, &LoadOptions { labels, ..LoadOptions::default() }).unwrap();
    assert_eq!(scene.objects[1].category_id, 7);
}

#[test]
fn labels_of_vertices_are_those_of_most_corners() {
    let elements = format!("element vertex 4\n{XYZ}property ushort label\nelement face 2\n{FACES}");
    let rows = "0 0 0 3\n2 0 0 4\n2 1 0 4\n0 1 0 5\n3 0 1 2\n3 3 0 1\n";
    let scene = read_text(&ascii(&elements, rows)).unwrap();
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["scene_4", "scene_5"]);
}

#[test]
fn uniform_colours_colour_the_surface() {
    let colored = |rows: &str| {
        let color = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
        let elements = format!("element vertex 3\n{XYZ}{color}element face 1\n{FACES}");
        read_text(&ascii(&elements, &format!("{rows}3 0 1 2\n"))).unwrap()
    };
    let scene = colored("0 0 0 255 0 188\n1 0 0 255 0 188\n0 1 0 255 0 188\n");
    let [r, g, b, a] = scene.objects[0].mesh.parts[0].material.as_ref().unwrap().base_color;
    assert!([r, g, a] == [1.0, 0.0, 1.0] && (b - 0.5029).abs() < 1e-3, "{b}");
    let scene = colored("0 0 0 255 0 188\n1 0 0 255 0 188\n0 1 0 255 0 189\n");
    assert!(scene.objects[0].mesh.parts[0].material.is_none());
    assert_eq!(warnings(&scene), ["vertex colours that change over a mesh are not used"]);
}

#[test]
fn normals_are_kept_where_they_differ_from_the_faces() {
    let with = |normal: &str| {
        let elements = format!(
            "element vertex 3\n{XYZ}property float nx\nproperty float ny\nproperty float nz\nelement face 1\n{FACES}"
        );
        let rows = format!("0 0 0 {normal}\n1 0 0 0 0 2\n0 1 0 0 0 1\n3 0 1 2\n");
        read_text(&ascii(&elements, &rows)).unwrap().objects[0].mesh.parts[0].normals.clone()
    };
    assert!(with("0 0 3").is_none());
    let half = 0.5f32.sqrt();
    assert_eq!(with("0 1 1").unwrap()[..], [[0.0, half, half], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
    assert_eq!(with("nan 0 0").map(|normals| normals.len()), None);
}

#[test]
fn textures_are_the_right_way_up() {
    let png = red_above_blue();
    let comment = "comment TextureFile my pic.png\n";
    let of_vertices = ascii(
        &format!("{comment}element vertex 3\n{XYZ}property float s\nproperty float t\nelement face 1\n{FACES}"),
        "0 0 0 0 0.25\n1 0 0 0 0.25\n0 1 0 0 0.75\n3 0 1 2\n",
    );
    let of_faces = ascii(
        &format!(
            "{comment}element vertex 3\n{XYZ}element face 2\n{FACES}property list uchar float texcoord\nproperty int texnumber\n"
        ),
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0.25 0 0.25 0 0.75 0\n3 2 1 0 2 0.5 0.5 0\n",
    );
    for (text, vertices) in [(&of_vertices, 3), (&of_faces, 6)] {
        let scene = read_files(&[("scene.ply", text.as_bytes()), ("my pic.png", &png)]).unwrap();
        let part = &scene.objects[0].mesh.parts[0];
        let use_ = part.material.as_ref().unwrap().base_color_texture.as_ref().unwrap();
        assert_eq!((use_.wrap_u, part.positions.len()), (Wrap::Repeat, vertices));
        let color = |corner: usize| use_.sample(part.uvs.as_ref().unwrap()[part.triangles[0][corner] as usize]);
        assert_eq!((color(0), color(2)), ([0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 1.0]));
    }
    let scene = read_text(&of_vertices).unwrap();
    assert_eq!(warnings(&scene), ["there is no image \"my pic.png\""]);
    let outside = of_vertices.replace("my pic.png", "/etc/passwd");
    assert!(error(outside.as_bytes()).contains("leads out of the folder of the scene"));
}

#[test]
fn faults_are_reported() {
    for (text, message) in [
        ("solid".to_owned(), "line 1: not a PLY file: it does not begin with \"ply\""),
        (quad("3 0 1 4\n"), "line 14: vertex index 4 of 4, which count from 0"),
        (quad("3 0 1 -1\n"), "line 14: vertex index -1 of 4, which count from 0"),
        (quad("3 0 1 1.5\n"), "line 14: vertex index 1.5 of 4, which count from 0"),
        (quad("3 0 1 x\n"), "line 14: \"x\" is not a number"),
        (quad("-3 0 1 2\n"), "line 14: a list is -3 long; allowed: 0 and more"),
        (quad("3 0 1\n"), "line 15: the file is cut off"),
        (quad("90 0 1 2\n"), "line 14: the file is cut off: a list is 90 long, which takes more than the 8 bytes left"),
        (quad("2 0 1\n"), "the file holds no face with 3 or more corners"),
        (
            quad("3 0 1 2\n").replace("float z", "float w"),
            "the vertices have no position; allowed: the properties x, y and z",
        ),
        (
            quad("3 0 1 2\n").replace("vertex_indices", "corners"),
            "face: no corners; allowed: the list vertex_indices or vertex_index",
        ),
        (
            quad("3 0 1 2\n").replace("vertex 4", "vertex 99999999999"),
            "the file is cut off: 99999999999 rows of vertex take 6 bytes or more each, 33 bytes are left",
        ),
        (quad("3 0 0 0\n"), "no triangle to scan: the file holds no mesh with area"),
    ] {
        assert_eq!(error(text.as_bytes()), message);
    }
    let points = ascii(&format!("element vertex 4\n{XYZ}element face 0\n{FACES}"), QUAD);
    assert_eq!(
        error(points.as_bytes()),
        "the file holds 4 vertices and no face: point clouds are not read as scenes; allowed: meshes, which other programs \
         make of points"
    );
}
