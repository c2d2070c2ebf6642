//! COLLADA files of our own.

use crate::{FileOptions, read};
use glam::DVec3;
use model::material::{Alpha, TextureBudget};
use model::{RawObject, RawScene, corners, surrounding};
use std::fs;
use std::path::Path;

const SHED: &str = include_str!("shed.dae");

fn read_text(folder: &Path, text: &str, options: &FileOptions) -> Result<RawScene, String> {
    let path = folder.join("shed.dae");
    fs::write(&path, text).unwrap();
    let scene = read(&path, options, &mut TextureBudget::new(16));
    scene.map_err(|error| error.to_string().replace(path.to_str().unwrap(), "FILE"))
}

fn shed(options: &FileOptions) -> RawScene {
    read_text(tempfile::tempdir().unwrap().path(), SHED, options).unwrap()
}

fn object<'s>(scene: &'s RawScene, name: &str) -> &'s RawObject {
    scene.objects.iter().find(|object| object.name == name).unwrap()
}

fn bounds(object: &RawObject) -> [DVec3; 2] {
    let points = object.mesh.world_points(&object.world_from_object);
    let (low, high) = surrounding(points).unwrap();
    [low, high]
}

#[test]
fn meshes_are_where_trimesh_puts_them() {
    // trimesh 5.2.0 with pycollada 0.9.3, whose coordinates are those of the file: centimetres, y up.
    let expected: [(&str, [f64; 3], [f64; 3]); 3] = [
        (
            "walls",
            [9.999995628861171, -30.0, -179.99998807907104],
            [208.20507764816284, 70.00000866381912, 106.60253366216786],
        ),
        ("roof_a", [9.999999125772234, -30.0, 119.99999403953552], [40.0, -10.0, 119.99999403953552]),
        ("roof_b", [9.999998907215293, -25.0, 126.99999362230301], [39.99999978144306, -5.0, 126.99999362230301]),
    ];
    let scene = shed(&FileOptions::default());
    assert_eq!(scene.objects.len(), 3);
    for (name, low, high) in expected {
        let found = bounds(object(&scene, name));
        for (found, expected) in found.into_iter().zip([low, high]) {
            let off = (found - DVec3::from(expected) * 0.01).length();
            assert!(off < 3e-7, "{name}: {found}, {expected:?} cm");
        }
    }
    // Area of the walls and of the window, cm^2.
    let walls = object(&scene, "walls");
    let areas: Vec<f64> = walls.mesh.parts.iter().map(|part| part.area(&walls.world_from_object)).collect();
    for (found, expected) in areas.iter().zip([64485.26536221694, 46457.51027545483]) {
        assert!((found / (expected * 1e-4) - 1.0).abs() < 1e-6, "{found}, {expected} cm2");
    }
}

#[test]
fn axes_are_those_of_the_file_unless_they_are_ignored() {
    let place = |text: &str, ignores_axes: bool| {
        let options = FileOptions { ignores_axes, ..FileOptions::default() };
        let folder = tempfile::tempdir().unwrap();
        bounds(object(&read_text(folder.path(), text, &options).unwrap(), "roof_a"))[1]
    };
    let [y_up, z_up, as_is] =
        [place(SHED, false), place(&SHED.replace("Y_UP", "Z_UP"), false), place(&SHED.replace("Y_UP", "X_UP"), true)];
    assert!((y_up - DVec3::new(0.4, -0.1, 1.2)).length() < 1e-6, "{y_up}");
    assert!((z_up - DVec3::new(0.4, 1.2, 0.3)).length() < 1e-6, "{z_up}");
    assert_eq!(z_up, as_is);
    // Without a word a unit is a metre and y is up.
    let bare = SHED.replace("<unit name=\"centimeter\" meter=\"0.01\"/><up_axis>Y_UP</up_axis>", "");
    assert!((place(&bare, false) - y_up * 100.0).length() < 1e-4);
}

#[test]
fn materials_have_their_colours_and_images() {
    let folder = tempfile::tempdir().unwrap();
    let mut encoder = png::Encoder::new(fs::File::create(folder.path().join("my planks.png")).unwrap(), 1, 2);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[255, 0, 0, 0, 0, 255]).unwrap();
    let scene = read_text(folder.path(), SHED, &FileOptions::default()).unwrap();
    let walls = &object(&scene, "walls").mesh.parts;
    let material = |index: usize| walls[index].material.as_ref().unwrap();
    assert_eq!(
        (&*material(0).name, material(0).base_color, material(0).alpha),
        ("Red", [0.8, 0.1, 0.05, 1.0], Alpha::Solid)
    );
    assert_eq!((&*material(1).name, material(1).alpha), ("Foil", Alpha::Coverage));
    assert!((material(1).base_color[3] - 0.25).abs() < 1e-6);
    assert_eq!(material(1).ior, 1.4);
    let roof = &object(&scene, "roof_a").mesh.parts[0];
    let texture = roof.material.as_ref().unwrap().base_color_texture.as_ref().unwrap();
    // The first row of an image is at its top, where v is 1.
    let at = |uv: [f32; 2]| texture.sample(uv);
    assert!(at([0.5, 0.75])[0] > 0.9 && at([0.5, 0.25])[2] > 0.9);
    // The second corner of the triangle has the third coordinates.
    let corner = |index: usize| {
        let vertex = roof.triangles[0][index] as usize;
        (roof.positions[vertex], roof.uvs.as_ref().unwrap()[vertex])
    };
    assert_eq!([corner(0).1, corner(1).1, corner(2).1], [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]);
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report);
}

#[test]
fn two_instances_share_a_mesh() {
    let scene = shed(&FileOptions::default());
    let [a, b] = ["roof_a", "roof_b"].map(|name| object(&scene, name));
    assert!(std::sync::Arc::ptr_eq(&a.mesh, &b.mesh));
    let names: Vec<&str> = a.ancestors.iter().map(|ancestor| &*ancestor.name).collect();
    assert_eq!(names, ["shed", "top", "pair", "roof_a"]);
    assert!(corners(a.mesh.bounds().unwrap(), &a.world_from_object)[0].is_finite());
}

#[test]
fn what_is_left_out_is_said() {
    let warnings = shed(&FileOptions::default()).report.warnings;
    assert!(
        warnings.len() == 1 && warnings[0].ends_with("images that are not there are left out: \"my planks.png\""),
        "{warnings:?}"
    );
    let outside = SHED.replace("my%20planks.png", "..%2fplanks.png");
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    fs::create_dir(&inner).unwrap();
    fs::write(folder.path().join("planks.png"), "secret").unwrap();
    let warnings = read_text(&inner, &outside, &FileOptions::default()).unwrap().report.warnings;
    assert!(warnings[0].contains("images that are elsewhere are left out"), "{warnings:?}");
}

#[test]
fn faults_are_told_with_their_lines() {
    let fault = |from: &str, to: &str| {
        assert!(SHED.contains(from), "{from}");
        let folder = tempfile::tempdir().unwrap();
        read_text(folder.path(), &SHED.replacen(from, to, 1), &FileOptions::default()).err().unwrap()
    };
    assert_eq!(
        fault("meter=\"0.01\"", "meter=\"-1\""),
        "FILE: line 3: unit \"centimeter\" has meter \"-1\"; allowed: metres above 0"
    );
    assert!(fault("Y_UP", "UP").contains("line 3: up_axis is \"UP\"; allowed: X_UP, Y_UP, Z_UP"));
    assert!(fault("0 3 2 1 4", "0 3 2 9 4").contains("has the index 9; allowed: below 8, the number of positions"));
    assert!(fault("0 3 2 1 4", "0 3 -2 1 4").contains("holds other things than indices"));
    assert!(fault("4 4 4 4</vcount>", "4 4 4 5</vcount>").contains("has fewer indices in p than vcount says"));
    assert!(fault("count=\"8\" stride=\"3\"", "count=\"9\" stride=\"3\"").contains("has 8 elements; allowed: the 9"));
    assert!(fault(">0 0 0 100 0", ">0 0 0 1e30 0").contains("holds \"1e30\"; allowed: numbers, -1e18 to 1e18"));
    assert!(
        fault("instance_node url=\"#pair\"", "instance_node url=\"#none\"")
            .contains("refers to \"none\", which is no id")
    );
    assert!(fault("<matrix>10", "<matrix>inf").contains("allowed: 16 numbers"));
    let circle = fault("<node id=\"pair\" name=\"pair\">", "<node id=\"pair\"><instance_node url=\"#pair\"/>");
    assert!(circle.contains("allowed: fewer, and no circle of instances"), "{circle}");
    let folder = tempfile::tempdir().unwrap();
    let other = read_text(folder.path(), "<robot/>", &FileOptions::default()).err().unwrap();
    assert_eq!(other, "FILE: line 1: the outermost element is \"robot\"; allowed: COLLADA");
}
