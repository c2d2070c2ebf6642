//! Tests of OBJ and MTL files.

use super::pictures::red_above_blue;
use super::*;
use crate::scene::{LabelRules, LoadOptions, Scene, UpAxis};
use glam::DVec3;
use model::material::Reflectance;
use std::collections::BTreeMap;

/// Writes files, the first of which is the scene, and reads it.
fn read_files(files: &[(&str, &[u8])], options: &LoadOptions) -> Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    read_path(&folder.path().join(files[0].0), options)
}

fn read_path(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let images = &mut TextureBudget::new(options.texture_limit_mib);
    Ok(Scene::assemble(read(path, &options.of_files(), images)?, options))
}

fn read_text(text: &str) -> Result<Scene> {
    read_files(&[("scene.obj", text.as_bytes())], &LoadOptions::default())
}

/// A warning without the folder in front.
fn warnings(scene: &Scene) -> Vec<String> {
    let strip = |warning: &String| warning.split_once("scene.obj: ").map(|(_, text)| text.to_owned());
    scene.report.warnings.iter().filter_map(strip).collect()
}

/// World corners of all triangles.
fn triangles(scene: &Scene) -> Vec<[DVec3; 3]> {
    let mut all = Vec::new();
    for object in &scene.objects {
        for part in &object.mesh.parts {
            let world = |&i: &u32| {
                let local = glam::Vec3::from(part.positions[i as usize]).as_dvec3();
                object.world_from_object.transform_point3(local)
            };
            all.extend(part.triangles.iter().map(|triangle| triangle.each_ref().map(world)));
        }
    }
    all
}

const QUAD: &str = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\n";

#[test]
fn a_quad_becomes_two_triangles_that_share_vertices() {
    let scene = read_text(&format!("{QUAD}f 1 2 3 4")).unwrap();
    let part = &scene.meshes()[0].parts[0];
    assert_eq!((part.positions.len(), part.triangles.len()), (4, 2));
    assert!(part.normals.is_none() && part.uvs.is_none() && part.material.is_none());
    assert_eq!(scene.bounds().unwrap(), (DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)));
    assert_eq!((scene.objects[0].name.as_str(), scene.objects[0].part_ids.as_slice()), ("scene", &[0][..]));
    assert!(scene.report.warnings.is_empty());
}

#[test]
fn concave_polygons_keep_their_area() {
    let text = "v 0 0 5\nv 3 0 5\nv 3 1 5\nv 1 1 5\nv 1 3 5\nv 0 3 5\nf 1 2 3 4 5 6";
    let scene = read_text(text).unwrap();
    let areas = triangles(&scene).into_iter().map(|[a, b, c]| (b - a).cross(c - a).z / 2.0);
    assert_eq!(areas.sum::<f64>(), 5.0);
}

#[test]
fn objects_come_from_o_else_g_else_the_file() {
    let names = |text: &str| -> Vec<String> {
        let scene = read_text(&format!("{QUAD}{text}")).unwrap();
        scene.objects.iter().map(|object| object.name.clone()).collect()
    };
    assert_eq!(
        names("f 1 2 3\no a b\ng x\nf 1 2 3\ng y\nf 1 2 3\no c\nf 1 2 3\no a b\nf 1 2 4"),
        ["scene", "a b", "c", "a b"]
    );
    assert_eq!(names("g x\nf 1 2 3\ng y\nf 1 2 3\ng x\nf 1 2 3\no\n"), ["x", "y"]);
    assert_eq!(names("o empty\no full\nf 1 2 3"), ["full"]);
    let scene = read_files(
        &[("scene.obj", format!("{QUAD}o caf\u{e9}\nf 1 2 3\no b\nf 1 2 3").replace('\u{e9}', "?").as_bytes())],
        &LoadOptions::default(),
    );
    assert_eq!(scene.unwrap().objects[0].name, "caf?");
    let scene =
        read_files(&[("scene.obj", &[QUAD.as_bytes(), b"o caf\xe9\nf 1 2 3"].concat())], &LoadOptions::default());
    assert_eq!(scene.unwrap().objects[0].name, "caf\u{fffd}");
}

#[test]
fn one_part_for_each_material_with_labels() {
    let mtl = b"newmtl wood\nKd 0.5 0.25 0.125\nd 0.5\nreflectance 0.7\nnewmtl unused\n";
    let text = format!(
        "mtllib my mats.mtl gone.mtl\n{QUAD}o Desk_1\nusemtl wood\nf 1 2 3\nusemtl steel\nf 1 3 4\nusemtl wood\nf 2 3 4\nusemtl \nf 1 2 4\n"
    );
    let options = LoadOptions {
        labels: LabelRules {
            objects: BTreeMap::from([("Desk_*".into(), "desk".into())]),
            materials: BTreeMap::from([("st*".into(), "leg".into())]),
            ..LabelRules::default()
        },
        ..LoadOptions::default()
    };
    let scene = read_files(&[("scene.obj", text.as_bytes()), ("my mats.mtl", mtl)], &options).unwrap();
    let parts = &scene.meshes()[0].parts;
    assert_eq!(parts.iter().map(|part| part.triangles.len()).collect::<Vec<_>>(), [1, 2, 1]);
    let materials: Vec<_> = parts.iter().map(|p| p.material.as_ref().map(|material| material.name.as_str())).collect();
    assert_eq!(materials, [None, Some("wood"), Some("steel")]);
    assert_eq!(scene.materials.len(), 2);
    let wood = parts[1].material.as_ref().unwrap();
    assert_eq!(wood.base_color, [0.5, 0.25, 0.125, 0.5]);
    assert_eq!(wood.reflectance, Some(Reflectance::Constant(0.7)));
    let part_names: Vec<_> = scene.objects[0].part_ids.iter().map(|&id| scene.labels.part.name(id)).collect();
    assert_eq!(part_names, [None, Some("wood"), Some("leg")]);
    assert_eq!(scene.labels.category.name(scene.objects[0].category_id), Some("desk"));
    assert_eq!(
        warnings(&scene),
        ["material files not found: gone.mtl", "materials without definition are taken as white: steel"]
    );
}

#[test]
fn survey_coordinates_keep_a_tenth_of_a_millimetre() {
    let corners =
        [[500000.1234, 5600000.5678, 123.4567], [500100.4321, 5600000.5, 120.0], [500050.0, 5600099.9876, 0.5]];
    let lines: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    for (up, scale) in [(UpAxis::Z, 1.0), (UpAxis::Y, 1.0), (UpAxis::Y, 0.5)] {
        let options = LoadOptions { up, scale, ..LoadOptions::default() };
        let text = format!("{lines}f 1 2 3\n");
        let scene = read_files(&[("scene.obj", text.as_bytes())], &options).unwrap();
        for (found, [x, y, z]) in triangles(&scene)[0].iter().zip(corners) {
            let expected = if up == UpAxis::Y { DVec3::new(x, -z, y) } else { DVec3::new(x, y, z) } * scale;
            assert!(found.distance(expected) < 1e-5, "{found} {expected}");
        }
    }
}

#[test]
fn normals_are_kept_where_they_differ_from_the_faces() {
    let flat = format!("{QUAD}vn 0 0 2\nvn 0 0 -3\nf 1//1 2//1 3//1\nf 1//2 3//2 4");
    let scene = read_text(&flat).unwrap();
    let part = &scene.meshes()[0].parts[0];
    assert!(part.normals.is_none());
    assert_eq!(part.positions.len(), 4, "normals that are dropped split no vertices");

    let round = format!("{QUAD}vn 0 1 1\nvn 0 0 0\nvn 0 0 1\nf 1//1 2//1 3//2\nf 1//1 3 4//3\nf 1//1 2//1 4//-1");
    let scene = read_text(&round).unwrap();
    let part = &scene.meshes()[0].parts[0];
    let normals = part.normals.as_ref().unwrap();
    let half = 0.5f32.sqrt();
    let of = |triangle: usize| part.triangles[triangle].map(|i| normals[i as usize]);
    assert_eq!(of(0), [[0.0, half, half], [0.0, half, half], [0.0, 0.0, 1.0]]);
    assert_eq!(of(1), [[0.0, half, half], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
    assert_eq!(part.triangles[0][..2], part.triangles[2][..2]);
    assert_eq!(part.triangles[1][2], part.triangles[2][2]);
}

#[test]
fn textures_are_the_right_way_up() {
    let text = format!(
        "mtllib m.mtl\n{QUAD}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1 0\nusemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\nf 1 2 4\nusemtl plain\nf 1/1 2/2 3/3\n"
    );
    let mtl =
        b"newmtl a\nmap_Kd pic.png\nnewmtl b\nmap_Kd -clamp on -s 1 0.25 -o 0 0.5 .\\pic.png\nnewmtl plain\nKd 1 1 1";
    let files: &[(&str, &[u8])] = &[("scene.obj", text.as_bytes()), ("m.mtl", mtl), ("pic.png", &red_above_blue())];
    let scene = read_files(files, &LoadOptions::default()).unwrap();
    assert_eq!(scene.textures().len(), 1, "one image, read once");
    let color = |part: usize, vertex: usize| {
        let part = &scene.meshes()[0].parts[part];
        let use_ = part.material.as_ref().unwrap().base_color_texture.as_ref().unwrap();
        use_.sample(part.uvs.as_ref().unwrap()[vertex])
    };
    let scaled = scene.materials[1].base_color_texture.as_ref().unwrap();
    assert_eq!((scaled.wrap_u, scaled.transform), (Wrap::ClampToEdge, [[1.0, 0.0, 0.0], [0.0, -0.25, 0.5]]));
    // v = 0.75 there: the middle of the upper pixel; v = 0.5: half and half.
    assert_eq!(color(1, 2), [1.0, 0.0, 0.0, 1.0]);
    assert_eq!(color(1, 0), [0.5, 0.0, 0.5, 1.0]);
    let plain = scene.materials[0].base_color_texture.as_ref().unwrap();
    assert_eq!(plain.sample([0.5, 0.75]), [1.0, 0.0, 0.0, 1.0]);
    assert_eq!(plain.sample([0.5, 0.25]), [0.0, 0.0, 1.0, 1.0]);
    let uvs = scene.meshes()[0].parts.iter().map(|part| part.uvs.as_ref().map(|uvs| uvs.len()));
    assert_eq!(uvs.collect::<Vec<_>>(), [Some(3), Some(6), None]);
    assert!(scene.report.warnings.is_empty());
}

#[test]
fn images_that_cannot_be_read_are_errors_where_they_are_used() {
    let text = format!("mtllib m.mtl\n{QUAD}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    let with = |mtl: &[u8]| {
        let bad = &red_above_blue()[..40];
        let files: &[(&str, &[u8])] = &[("scene.obj", text.as_bytes()), ("m.mtl", mtl), ("bad.png", bad)];
        read_files(files, &LoadOptions::default())
    };
    let error = with(b"newmtl a\nKd 1 0 0\nmap_Kd gone.png").unwrap_err().to_string();
    assert!(error.ends_with("m.mtl: line 3: there is no image \"gone.png\""), "{error}");
    let error = with(b"newmtl a\nmap_Kd bad.png").unwrap_err().to_string();
    assert!(error.contains("bad.png: the image cannot be decoded"), "{error}");
    let scene = with(b"newmtl a\nnewmtl b\nmap_Kd gone.png\nnewmtl c\nmap_Kd bad.png").unwrap();
    assert!(scene.textures().is_empty() && scene.report.warnings.is_empty());
}

/// A greyscale PNG of four pixels, from left to right.
fn grey(pixels: [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 4, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    bytes
}

#[test]
fn transparency_is_coverage_and_masks_cut_out() {
    use model::material::Alpha;
    let text = format!("mtllib m.mtl\n{QUAD}vt 0 0\nvt 1 0\nvt 1 1\nusemtl a\nf 1/1 2/2 3/3\n");
    let read = |mtl: &str| {
        let files: &[(&str, &[u8])] = &[
            ("scene.obj", text.as_bytes()),
            ("m.mtl", mtl.as_bytes()),
            ("mask.png", &grey([0, 255, 255, 0])),
            ("soft.png", &grey([0, 77, 128, 255])),
            ("pic.png", &red_above_blue()),
        ];
        let scene = read_files(files, &LoadOptions::default()).unwrap();
        let material = (*scene.materials[0]).clone();
        (material, warnings(&scene))
    };
    for (mtl, alpha, opacity) in [
        ("d 1", Alpha::Solid, 1.0),
        ("d 0.3", Alpha::Coverage, 0.3),
        ("d -halo 0.3", Alpha::Coverage, 0.3),
        ("Tr 1", Alpha::Coverage, 0.0),
        ("Tr 0.25\nd 1", Alpha::Solid, 1.0),
        ("map_d mask.png", Alpha::Cutout, 1.0),
        ("map_Tr mask.png", Alpha::Cutout, 1.0),
        ("d 0.5\nmap_d mask.png", Alpha::Coverage, 0.5),
        ("map_d soft.png", Alpha::Coverage, 1.0),
        ("map_d -imfchan r pic.png", Alpha::Cutout, 1.0),
    ] {
        let (material, warnings) = read(&format!("newmtl a\nKd 0.5 0.5 0.5\n{mtl}"));
        assert_eq!((material.alpha, material.base_color[3]), (alpha, opacity), "{mtl}");
        assert_eq!(material.alpha_texture.is_some(), mtl.contains("map_"), "{mtl}");
        assert!(warnings.is_empty(), "{warnings:?}");
    }
    assert_eq!(read("newmtl Window glass\nd 0.2").0.alpha, Alpha::Solid, "glass is a pane");
    let mask = |mtl: &str| read(mtl).0.alpha_texture.unwrap();
    assert_eq!(mask("newmtl a\nmap_d mask.png").sample([0.375, 0.5])[3], 1.0);
    assert_eq!(mask("newmtl a\nmap_d -imfchan b pic.png").sample([0.5, 0.75])[3], 0.0);
    let (material, warnings) = read("newmtl a\nmap_Kd pic.png\nmap_d pic.png");
    assert!(material.alpha_texture.is_none() && warnings[0].contains("map_d that is the image of map_Kd"));
    let (material, warnings) = read("newmtl a\nd 0.5\nmap_d gone.tga");
    assert!(material.alpha == Alpha::Coverage && warnings[0].contains("cannot be read"), "{warnings:?}");
}

#[test]
fn triangles_without_area_are_counted() {
    let text = format!("{QUAD}v 1 0 0\nf 1 2 3\nf 1 1 2\nf 1 5 2\nf 1 5 2 5 2\nf 1 5 2 3 4\n");
    let scene = read_text(&text).unwrap();
    assert_eq!((scene.degenerate_triangles, scene.triangle_count()), (3, 4));
    assert_eq!(warnings(&scene), ["3 triangles without area left out"]);
    let scene = read_text(&format!("{QUAD}f 1 3 2 4")).unwrap();
    assert_eq!(warnings(&scene), ["1 polygon crossing itself or folded: the triangles there are a guess"]);
}

#[test]
fn errors_name_file_and_line() {
    let message = |text: &str| read_text(text).unwrap_err().to_string();
    assert!(message(&format!("{QUAD}f 1 2 9")).ends_with("scene.obj: line 5: vertex index 9 of 4"));
    assert!(message("v 0 inf 0").ends_with("scene.obj: line 1: \"inf\" is not a finite number"));
    assert!(message(QUAD).ends_with("scene.obj: the file holds no face (f) with 3 or more corners"));
    let mtl = b"newmtl a\nKd 1 1 x\nd 0.5\nnewmtl b\n";
    let with_material = |name: &str| {
        let text = format!("mtllib m.mtl\n{QUAD}usemtl {name}\nf 1 2 3");
        read_files(&[("scene.obj", text.as_bytes()), ("m.mtl", mtl)], &LoadOptions::default())
    };
    let bad_number = "m.mtl: line 2: not a number from -1e18 to 1e18";
    assert!(with_material("a").unwrap_err().to_string().ends_with(bad_number));
    let [warning] = &warnings(&with_material("b").unwrap())[..] else { panic!("one warning") };
    assert!(warning.starts_with("unused materials are faulty: ") && warning.ends_with(bad_number));
    let missing = read_path(Path::new("no/such.obj"), &LoadOptions::default()).unwrap_err().to_string();
    assert!(missing.starts_with("no/such.obj: "), "{missing}");
    let options = LoadOptions { scale: 0.0, ..LoadOptions::default() };
    let error = read_files(&[("scene.obj", QUAD.as_bytes())], &options).unwrap_err().to_string();
    assert_eq!(error, "scale is 0; allowed: finite numbers above 0");
}

#[test]
fn hostile_files_terminate_soon() {
    // A hundred thousand corners at one position, each with its own normal.
    let mut text = QUAD.to_owned();
    for i in 0..100_000 {
        text.push_str(&format!("vn 1 {i} 1\nf 1//-1 2 3\n"));
    }
    let scene = read_text(&text).unwrap();
    assert_eq!(scene.triangle_count(), 100_000);
    // A great many objects and unknown materials.
    let mut text = QUAD.to_owned();
    for i in 0..20_000 {
        text.push_str(&format!("o {i}\nusemtl {i}\nmtllib {i}\nf 1 2 3\n"));
    }
    let scene = read_text(&text).unwrap();
    assert_eq!((scene.objects.len(), scene.report.warnings.len()), (20_000, 2));
    assert!(warnings(&scene)[0].ends_with("not found: 0, 1, 2, 3, 4 and 19995 more"));
}
