use super::*;
use crate::scene::{LoadOptions, Scene, UpAxis};
use std::fs;

const ONE: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
const OTHER: &str =
    "facet normal 0 0 nan\nOUTER LOOP\nvertex 2 -0 0\nvertex 2. 1e0 0\nvertex 0 1 0\nendloop endfacet\n";

fn read_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.stl");
    fs::write(&path, bytes).unwrap();
    Scene::load_with(path, options)
}

fn read_text(text: &str) -> Result<Scene> {
    read_bytes(text.as_bytes(), &LoadOptions::default())
}

/// A message without the folder in front.
fn error(bytes: &[u8]) -> String {
    let message = read_bytes(bytes, &LoadOptions::default()).unwrap_err().to_string();
    message.split_once("part.stl: ").unwrap().1.to_owned()
}

fn binary(head: &str, triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = head.as_bytes().to_vec();
    bytes.resize(84 - 4, b' ');
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([7; 2]);
    }
    bytes
}

const QUAD: [[[f32; 3]; 3]; 2] =
    [[[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[2.0, -0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];

#[test]
fn text_and_binary_files_are_the_same_mesh() {
    let text = read_text(&format!("solid\n{ONE}{OTHER}endsolid\n")).unwrap();
    for head in ["made by hand", "solid but binary"] {
        let binary = read_bytes(&binary(head, &QUAD), &LoadOptions::default()).unwrap();
        for scene in [&text, &binary] {
            let [object] = &scene.objects[..] else { panic!("one object") };
            let part = &object.mesh.parts[0];
            assert_eq!(
                (object.name.as_str(), part.positions.len(), part.triangles.len()),
                ("part", 4, 2),
                "corners are shared"
            );
            assert_eq!(part.triangles[..], [[0, 1, 2], [1, 3, 2]]);
            assert_eq!(scene.bounds().unwrap(), (DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)));
            assert_eq!(scene.report.warnings, [""; 0]);
        }
    }
}

#[test]
fn solids_are_objects() {
    let scene = read_text(&format!(
        "solid left wing\r\n{ONE}endsolid left wing\nsolid empty\nendsolid\nSolid\n{OTHER}endsolid\n{ONE}"
    ));
    let scene = scene.unwrap();
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["left wing", "part", "part"]);
    assert_eq!(scene.report.warnings, [""; 0]);
    let scene = read_text(&format!("solid a\n{ONE}")).unwrap();
    assert!(scene.report.warnings[0].ends_with("no \"endsolid\": the file may be cut off"), "{:?}", scene.report);
}

#[test]
fn axes_and_units_are_those_of_the_options() {
    let corners = [[1.0, 2.0, 3.0], [4.0, 2.0, 3.0], [1.0, 5.0, 3.0]];
    for (up, world) in [
        (UpAxis::X, DVec3::new(-3.0, 2.0, 1.0)),
        (UpAxis::Y, DVec3::new(1.0, -3.0, 2.0)),
        (UpAxis::Z, DVec3::new(1.0, 2.0, 3.0)),
        (UpAxis::MinusX, DVec3::new(3.0, 2.0, -1.0)),
        (UpAxis::MinusY, DVec3::new(1.0, 3.0, -2.0)),
        (UpAxis::MinusZ, DVec3::new(1.0, -2.0, -3.0)),
    ] {
        let options = LoadOptions { up, scale: 0.5, ..LoadOptions::default() };
        let scene = read_bytes(&binary("", &[corners]), &options).unwrap();
        assert_eq!(scene.world_points().next().unwrap(), world * 0.5, "{up:?}");
        let turned = up.world_from_file();
        assert_eq!(up.upright(&turned), glam::DMat3::IDENTITY, "{up:?}");
        assert_eq!(turned.determinant(), 1.0, "{up:?}");
        let yaml = LoadOptions::from_yaml(&format!("up: {}", up.name())).unwrap();
        assert_eq!(yaml.up, up);
    }
    let scale = LoadOptions { scale: -1.0, ..LoadOptions::default() };
    assert!(read_bytes(&binary("", &[corners]), &scale).unwrap_err().to_string().starts_with("scale is -1"));
}

#[test]
fn survey_coordinates_keep_their_digits() {
    let text = "solid\nfacet\nouter loop\nvertex 500000.1234 5600000.5678 1\nvertex 500001 5600000.5 1\n\
                vertex 500000 5600009.9876 2\nendloop\nendfacet\nendsolid";
    let scene = read_text(text).unwrap();
    let first = scene.world_points().next().unwrap();
    assert!(first.distance(DVec3::new(500000.1234, 5600000.5678, 1.0)) < 1e-6, "{first}");
}

#[test]
fn millimetres_are_suspected() {
    let large = QUAD.map(|triangle| triangle.map(|corner| corner.map(|x| x * 600.0)));
    let scene = read_bytes(&binary("", &large), &LoadOptions::default()).unwrap();
    assert!(scene.report.warnings[0].contains("it is 1200 m large") && scene.report.warnings[0].contains("--scale"));
    let options = LoadOptions { scale: 0.001, ..LoadOptions::default() };
    assert_eq!(read_bytes(&binary("", &large), &options).unwrap().report.warnings, [""; 0]);
}

#[test]
fn triangles_without_area_are_counted() {
    let line = [[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]];
    let scene = read_bytes(&binary("", &[line, QUAD[0], line]), &LoadOptions::default()).unwrap();
    assert_eq!((scene.triangle_count(), scene.degenerate_triangles), (1, 2));
    assert_eq!(error(&binary("", &[line])), "no triangle to scan: the file holds no mesh with area");
}

#[test]
fn faults_are_reported() {
    let whole = binary("", &QUAD);
    assert_eq!(
        error(&whole[..183]),
        "the file is cut off, or not an STL file: its header states 2 triangles, which take 184 bytes, but it has 183"
    );
    assert!(error(&whole[..83]).starts_with("not an STL file: 83 bytes"));
    assert!(error(b"").starts_with("not an STL file: 0 bytes"));
    let mut wrong_count = whole.clone();
    wrong_count[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(error(&wrong_count).contains("states 4294967295 triangles"));
    wrong_count[80..84].copy_from_slice(&0u32.to_le_bytes());
    assert_eq!(error(&wrong_count), "its header states 0 triangles; 100 bytes follow");
    wrong_count[80..84].copy_from_slice(&1u32.to_le_bytes());
    let scene = read_bytes(&wrong_count, &LoadOptions::default()).unwrap();
    assert!(scene.report.warnings[0].ends_with("50 bytes after the last triangle are not read"));
    let mut nan = whole;
    nan[84 + 50 + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_eq!(error(&nan), "triangle 2: a corner is [NaN, -0.0, 0.0]; allowed: -1e18 to 1e18");

    for (text, message) in [
        ("solid\nendsolid\n".to_owned(), "the file holds no facet"),
        (format!("solid\n{}", &ONE[..60]), "line 6: the file is cut off in a facet"),
        (format!("solid\n{}", &ONE[..70]), "line 7: the file is cut off in a facet"),
        (ONE.replace("2 0 0", "2 x 0"), "line 5: \"x\" is not a finite number from -1e18 to 1e18"),
        (ONE.replace("2 0 0", "2 nan 0"), "line 5: \"nan\" is not a finite number from -1e18 to 1e18"),
        (ONE.replace("vertex 2 0 0\n", ""), "line 6: a facet of 2 vertices; allowed: 3"),
        (
            ONE.replace("endfacet", "facet"),
            "line 8: unexpected \"facet\"; allowed: normal, outer loop, vertex, endloop, endfacet",
        ),
        (format!("loop\n{ONE}"), "line 2: unexpected \"loop\"; allowed: facet, endsolid, solid"),
    ] {
        let text = if text.starts_with("solid") { text } else { format!("solid\n{text}") };
        assert_eq!(error(text.as_bytes()), message);
    }
}
