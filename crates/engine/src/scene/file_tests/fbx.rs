use super::*;
use crate::scene::{LoadOptions, UpAxis};
use glam::{DAffine3, Vec3};
use model::material::{Alpha, Reflectance, Wrap};
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

/// Path of a file that `scripts/blender-scene.py` makes.
fn blender(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/scenes/blender").join(name)
}

fn options() -> LoadOptions {
    LoadOptions::default()
}

fn read_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    read_in(folder.path(), bytes, options)
}

fn read_in(folder: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
    let path = folder.join("scene.fbx");
    fs::write(&path, bytes).unwrap();
    Ok(Scene::assemble(read(&path, &options.of_files(), &mut TextureBudget::new(64))?, options))
}

fn read_text(text: &str) -> Scene {
    read_bytes(text.as_bytes(), &options()).unwrap()
}

fn error(text: &str) -> String {
    read_bytes(text.as_bytes(), &options()).unwrap_err().to_string()
}

/// Properties of an object, one `name type values` each; those with the flag `U` are user properties.
fn properties(lines: &[&str]) -> String {
    let lines: Vec<String> = lines.iter().map(|line| format!("P: {line}\n")).collect();
    format!("Properties70: {{\n{}}}\n", lines.concat())
}

/// A file with these objects and connections, y up, in units of 1 cm.
fn text(objects: &str, connections: &str) -> String {
    in_units("1,1,1", objects, connections)
}

/// The same with `settings`: the sign of its up axis, the up axis itself (1: y, 2: z) and its unit in cm.
fn in_units(settings: &str, objects: &str, connections: &str) -> String {
    let [sign, up, unit]: [&str; 3] = settings.split(',').collect::<Vec<_>>().try_into().unwrap();
    let (front, front_sign) = if up == "2" { (1, -1) } else { (2, 1) };
    let settings = properties(&[
        &format!(r#""UpAxis", "int", "Integer", "",{up}"#),
        &format!(r#""UpAxisSign", "int", "Integer", "",{sign}"#),
        &format!(r#""FrontAxis", "int", "Integer", "",{front}"#),
        &format!(r#""FrontAxisSign", "int", "Integer", "",{front_sign}"#),
        r#""CoordAxis", "int", "Integer", "",0"#,
        r#""CoordAxisSign", "int", "Integer", "",1"#,
        &format!(r#""UnitScaleFactor", "double", "Number", "",{unit}"#),
    ]);
    format!(
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}}\n\
         GlobalSettings: {{\nVersion: 1000\n{settings}}}\nObjects: {{\n{objects}}}\nConnections: {{\n{connections}}}\n"
    )
}

/// Mesh `id`, a triangle 1 m long and 2 m high.
fn sail(id: u32) -> String {
    mesh(id, "0,0,0,100,0,0,0,200,0", "0,1,-3", "")
}

fn mesh(id: u32, vertices: &str, corners: &str, layers: &str) -> String {
    let counts = [vertices, corners].map(|list| list.split(',').count());
    format!(
        "Geometry: {id}, \"Geometry::mesh{id}\", \"Mesh\" {{\nVertices: *{} {{ a: {vertices}\n}}\nPolygonVertexIndex: *{} \
         {{ a: {corners}\n}}\n{layers}}}\n",
        counts[0], counts[1]
    )
}

fn model(id: u32, name: &str, lines: &[&str]) -> String {
    format!("Model: {id}, \"Model::{name}\", \"Mesh\" {{\nVersion: 232\n{}}}\n", properties(lines))
}

/// Connections of objects to objects, each `child,parent`.
fn links(pairs: &[&str]) -> String {
    pairs.iter().map(|pair| format!("C: \"OO\",{pair}\n")).collect()
}

/// A file with one mesh on one node.
fn one(mesh: &str, lines: &[&str]) -> String {
    text(&(mesh.to_owned() + &model(10, "Sail", lines)), &links(&["1,10", "10,0"]))
}

/// Curve `id` through keys at times, s, of `kind`: the flags of `KeyAttrFlags`.
fn curve(id: u32, times: &[f64], values: &[f64], kind: u32, slopes: &str) -> String {
    let ticks: Vec<String> = times.iter().map(|time| format!("{}", (time * 46_186_158_000.0).round())).collect();
    let values: Vec<String> = values.iter().map(f64::to_string).collect();
    let count = times.len();
    format!(
        "AnimationCurve: {id}, \"AnimCurve::\", \"\" {{\nDefault: 0\nKeyVer: 4009\nKeyTime: *{count} {{ a: {}\n}}\n\
         KeyValueFloat: *{count} {{ a: {}\n}}\nKeyAttrFlags: *1 {{ a: {kind}\n}}\nKeyAttrDataFloat: *4 {{ a: {slopes}\n}}\n\
         KeyAttrRefCount: *1 {{ a: {count}\n}}\n}}\n",
        ticks.join(","),
        values.join(",")
    )
}

const CONSTANT: u32 = 0x2;
const CONSTANT_NEXT: u32 = 0x102;
const LINEAR: u32 = 0x4;
const CUBIC: u32 = 0x108;
const SLOPED: u32 = 0x408;
const NO_SLOPES: &str = "0,0,0,0";

/// An animation: objects and connections of curves, each with the number of its node, its property and its axis.
fn animation(name: &str, first: u32, curves: &[(u32, &str, &str, String)]) -> (String, String) {
    let (stack, layer) = (first, first + 1);
    let mut objects = format!(
        "AnimationStack: {stack}, \"AnimStack::{name}\", \"\" {{\n}}\nAnimationLayer: {layer}, \"AnimLayer::l\", \"\" \
         {{\n}}\n"
    );
    let mut connections = links(&[&format!("{layer},{stack}")]);
    for (number, of_property) in curves.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).enumerate() {
        let (node, property, ..) = of_property[0];
        let id = first + 10 + number as u32;
        // Value of the axes without a curve.
        let rest = u32::from(property == "Lcl Scaling");
        let axes = ["X", "Y", "Z"].map(|axis| format!("\"d|{axis}\", \"Number\", \"\", \"A\",{rest}"));
        let axes = properties(&axes.each_ref().map(String::as_str));
        objects += &format!("AnimationCurveNode: {id}, \"AnimCurveNode::{property}\", \"\" {{\n{axes}}}\n");
        connections += &links(&[&format!("{id},{layer}")]);
        connections += &format!("C: \"OP\",{id},{node}, \"{property}\"\n");
        for (_, _, axis, curve) in of_property {
            objects += curve;
            let own = curve.split([' ', ',']).nth(1).unwrap();
            connections += &format!("C: \"OP\",{own},{id}, \"{axis}\"\n");
        }
    }
    (objects, connections)
}

/// World corners of all triangles of an object.
fn triangles(object: &Object) -> Vec<[DVec3; 3]> {
    let world = |p: [f32; 3]| object.world_from_object.transform_point3(Vec3::from(p).as_dvec3());
    let parts = object.mesh.parts.iter();
    parts
        .flat_map(|part| part.triangles.iter().map(|t| t.map(|corner| world(part.positions[corner as usize]))))
        .collect()
}

fn corners(scene: &Scene, object: usize) -> Vec<[f64; 3]> {
    let rounded = |p: DVec3| ((p * 1e6).round() / 1e6 + 0.0).to_array();
    triangles(&scene.objects[object]).into_iter().flatten().map(rounded).collect()
}

/// World positions of the vertices of `object` at `time`.
fn at(scene: &Scene, object: &Object, time: f64) -> Vec<DVec3> {
    (0..object.mesh.parts.len()).flat_map(|part| vertices_at(scene, object, part, time)).collect()
}

/// World positions of the vertices of every mesh at `time` as the library itself evaluates them, by node, depth first.
fn evaluated(file: &ufbx::Scene, stack: usize, time: f64) -> Vec<Vec<DVec3>> {
    let options = ufbx::EvaluateOpts { evaluate_skinning: true, ..ufbx::EvaluateOpts::default() };
    let posed = file.evaluate(&file.anim_stacks[stack].anim, time, options).unwrap();
    let mut all = Vec::new();
    let mut stack: Vec<&ufbx::Node> = vec![&posed.root_node];
    while let Some(node) = stack.pop() {
        stack.extend(node.children.as_ref().iter().rev().map(|child| &**child));
        let Some(mesh) = node.mesh.as_deref() else { continue };
        let place = if mesh.skinned_is_local { affine(&node.geometry_to_world) } else { DAffine3::IDENTITY };
        all.push(mesh.skinned_position.values.iter().map(|&p| place.transform_point3(vector(p))).collect());
    }
    all
}

fn vector(vector: ufbx::Vec3) -> DVec3 {
    DVec3::new(vector.x, vector.y, vector.z)
}

fn affine(m: &ufbx::Matrix) -> DAffine3 {
    let column = |x, y, z| DVec3::new(x, y, z);
    DAffine3::from_cols(
        column(m.m00, m.m10, m.m20),
        column(m.m01, m.m11, m.m21),
        column(m.m02, m.m12, m.m22),
        column(m.m03, m.m13, m.m23),
    )
}

/// Checks that a file moves as the library evaluates it, at times that are not keys.
fn check_motion(bytes: &[u8], stack: usize, tolerance: f64) {
    let scene = read_bytes(bytes, &options()).unwrap();
    let ours = ufbx::LoadOpts {
        target_axes: ufbx::CoordinateAxes::right_handed_z_up(),
        target_unit_meters: 1.0,
        inherit_mode_handling: ufbx::InheritModeHandling::HelperNodes,
        ..ufbx::LoadOpts::default()
    };
    let file = ufbx::load_memory(bytes, ours).unwrap();
    for step in 0..140 {
        let time = -0.05 + f64::from(step) * 0.0173;
        let expected = evaluated(&file, stack, time);
        assert_eq!(expected.len(), scene.objects.len());
        for (object, expected) in scene.objects.iter().zip(expected) {
            for found in at(&scene, object, time) {
                let nearest = expected.iter().map(|p| p.distance(found)).fold(f64::INFINITY, f64::min);
                assert!(nearest < tolerance, "{} at {time} s: {found} is off by {nearest} m", object.name);
            }
        }
    }
}

#[test]
fn axes_and_units_are_ours() {
    let place = &[r#""Lcl Translation", "Lcl Translation", "", "A",100,200,300"#];
    let found = |settings: &str| {
        let objects = sail(1) + &model(10, "Sail", place);
        let scene = read_text(&in_units(settings, &objects, &links(&["1,10", "10,0"])));
        corners(&scene, 0)
    };
    // y up: (x, y, z) is our (x, -z, y).
    assert_eq!(found("1,1,1"), [[1.0, -3.0, 2.0], [2.0, -3.0, 2.0], [1.0, -3.0, 4.0]]);
    assert_eq!(found("1,2,1"), [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0], [1.0, 4.0, 3.0]]);
    // Metres, and inches.
    assert_eq!(found("1,2,100")[0], [100.0, 200.0, 300.0]);
    assert_eq!(found("1,2,2.54")[0], [2.54, 5.08, 7.62]);
    let up = |settings| {
        let scene = read_text(&in_units(settings, &(sail(1) + &model(10, "Sail", place)), &links(&["1,10", "10,0"])));
        scene.objects[0].up
    };
    assert_eq!([up("1,1,1"), up("1,2,1")], [UpAxis::Y, UpAxis::Z]);
}

#[test]
fn nodes_form_hierarchies_and_share_meshes() {
    let objects = sail(1)
        + &model(
            10,
            "Boat",
            &[
                r#""Lcl Translation", "Lcl Translation", "", "A",1000,0,0"#,
                r#""Lcl Rotation", "Lcl Rotation", "", "A",0,90,0"#,
                r#""Lcl Scaling", "Lcl Scaling", "", "A",2,2,2"#,
                r#""categoryID", "KString", "", "U", "boat""#,
            ],
        )
        + &model(11, "Sail", &[r#""partID", "Integer", "", "U",7"#])
        + &model(12, "Mirrored", &[r#""Lcl Scaling", "Lcl Scaling", "", "A",-1,1,1"#]);
    let scene = read_text(&text(&objects, &links(&["1,11", "1,12", "11,10", "12,10", "10,0"])));
    let [sail, mirrored] = &scene.objects[..] else { panic!("{:?}", scene.objects) };
    assert!(Arc::ptr_eq(&sail.mesh, &mirrored.mesh));
    // A quarter turn about y takes x to -z, our y.
    assert_eq!(corners(&scene, 0), [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [10.0, 0.0, 4.0]]);
    assert_eq!(corners(&scene, 1), [[10.0, 0.0, 0.0], [10.0, -2.0, 0.0], [10.0, 0.0, 4.0]]);
    assert!(mirrored.world_from_object.matrix3.determinant() < 0.0, "a mirrored object stays mirrored");
    let names: Vec<&str> = mirrored.ancestors.iter().map(|node| &*node.name).collect();
    assert_eq!(names, ["Boat", "Mirrored"]);
    assert_eq!(scene.labels.category.names, ["boat"]);
    assert_eq!(scene.labels.part.name(sail.part_ids[0]), Some("7"));
    assert_eq!(sail.instance_id, mirrored.instance_id, "what gives a category makes one instance");
}

#[test]
fn geometric_transforms_move_the_mesh_alone() {
    let objects = sail(1)
        + &sail(2)
        + &model(
            10,
            "Sail",
            &[
                r#""GeometricTranslation", "Vector3D", "Vector", "",100,0,0"#,
                r#""GeometricScaling", "Vector3D", "Vector", "",1,3,1"#,
            ],
        )
        + &model(11, "Child", &[]);
    let scene = read_text(&text(&objects, &links(&["1,10", "2,11", "11,10", "10,0"])));
    assert_eq!(corners(&scene, 0), [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 6.0]]);
    assert_eq!(corners(&scene, 1), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]);
}

/// A child of a scaled node that does not pass its scale on.
#[test]
fn scales_that_children_do_not_inherit_stay_with_the_parent() {
    let squeezed = |lines: &[&str]| {
        let objects = sail(1)
            + &sail(2)
            + &model(10, "Wide", &[r#""Lcl Scaling", "Lcl Scaling", "", "A",5,1,1"#])
            + &model(11, "Child", &[&[r#""Lcl Translation", "Lcl Translation", "", "A",100,0,0"#], lines].concat());
        read_text(&text(&objects, &links(&["1,10", "2,11", "11,10", "10,0"])))
    };
    let usual = squeezed(&[r#""InheritType", "enum", "", "",1"#]);
    assert_eq!(corners(&usual, 1), [[5.0, 0.0, 0.0], [10.0, 0.0, 0.0], [5.0, 0.0, 2.0]]);
    let scene = squeezed(&[r#""InheritType", "enum", "", "",2"#]);
    let by_name = |name: &str| scene.objects.iter().position(|object| object.name == name).unwrap();
    assert_eq!(corners(&scene, by_name("Wide"))[1], [5.0, 0.0, 0.0]);
    assert_eq!(corners(&scene, by_name("Child")), [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 0.0, 2.0]]);
    let names = |name| scene.objects[by_name(name)].ancestors.iter().map(|node| node.name.clone()).collect::<Vec<_>>();
    assert_eq!((names("Wide").len(), names("Child").join("/")), (1, "Wide/Child".to_owned()));
}

#[test]
fn polygons_of_several_materials_become_parts() {
    // A roof of two quads and a gable of five corners, not convex.
    let vertices =
        "0,0,0, 100,0,0, 100,100,0, 0,100,0, 200,0,0, 200,100,0, 0,0,50, 100,0,50, 100,100,50, 50,20,50, 0,100,50";
    let layers = "LayerElementMaterial: 0 {\nMappingInformationType: \"ByPolygon\"\nReferenceInformationType: \
                  \"IndexToDirect\"\nMaterials: *3 { a: 0,1,0\n}\n}\nLayer: 0 {\nLayerElement: {\nType: \
                  \"LayerElementMaterial\"\nTypedIndex: 0\n}\n}\n";
    let objects = mesh(1, vertices, "0,1,2,-4,1,4,5,-3,6,7,8,9,-11", layers)
        + &model(10, "Roof", &[])
        + "Material: 20, \"Material::tiles\", \"\" {\n}\nMaterial: 21, \"Material::lead\", \"\" {\n}\n";
    let scene = read_text(&text(&objects, &links(&["1,10", "20,10", "21,10", "10,0"])));
    let parts = &scene.objects[0].mesh.parts;
    let made_of: Vec<_> = parts.iter().map(|part| (part.material_name(), part.triangles.len())).collect();
    assert_eq!(made_of, [("tiles", 5), ("lead", 2)]);
    assert!(parts.iter().all(|part| part.normals.is_none()));
    let area = |part: &crate::scene::Part| part.area(&scene.objects[0].world_from_object);
    assert!((area(&parts[0]) - 1.6).abs() < 1e-6 && (area(&parts[1]) - 1.0).abs() < 1e-6, "{}", area(&parts[0]));
}

#[test]
fn survey_coordinates_keep_their_digits() {
    let scene =
        read_text(&one(&mesh(1, "45000000012.5,0,0, 45000000112.5,0,0, 45000000012.5,100,0", "0,1,-3", ""), &[]));
    let [a, b, _] = triangles(&scene.objects[0])[0];
    assert!((a.x - 450_000_000.125).abs() < 1e-7 && (b.x - a.x - 1.0).abs() < 1e-7, "{a} {b}");
}

#[test]
fn materials_and_their_properties_are_read() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(blender("squares.png"), folder.path().join("bricks.png")).unwrap();
    let layers = "LayerElementUV: 0 {\nName: \"map1\"\nMappingInformationType: \"ByPolygonVertex\"\n\
                  ReferenceInformationType: \"Direct\"\nUV: *6 { a: 0,0,1,0,0,1\n}\n}\nLayer: 0 {\nLayerElement: {\nType: \
                  \"LayerElementUV\"\nTypedIndex: 0\n}\n}\n";
    let material = format!(
        "Material: 20, \"Material::brick\", \"\" {{\nShadingModel: \"phong\"\n{}}}\n",
        properties(&[
            r#""DiffuseColor", "Color", "", "A",0.5,0.25,2"#,
            r#""pane_m", "Number", "", "U",0.004"#,
            r#""ior", "double", "Number", "U",1.6"#,
            r#""reflectance", "KString", "", "U", "[{&quot;wavelength_nm&quot;: 905, &quot;value&quot;: 0.3}]""#,
        ])
    );
    let texture = |name: &str| {
        format!(
            "Texture: 30, \"Texture::t\", \"\" {{\nType: \"TextureVideoClip\"\nFileName: \"C:\\art\\{name}\"\n\
             RelativeFilename: \"..\\art\\{name}\"\nProperties70: {{\nP: \"WrapModeU\", \"enum\", \"\", \"\",1\n}}\n}}\n"
        )
    };
    let objects = |name| {
        mesh(1, "0,0,0,100,0,0,0,200,0", "0,1,-3", layers) + &model(10, "Wall", &[]) + &material + &texture(name)
    };
    let connections = links(&["1,10", "20,10", "10,0"]) + "C: \"OP\",30,20, \"DiffuseColor\"\n";
    let load = |name, connections: &str| {
        read_in(folder.path(), text(&objects(name), connections).as_bytes(), &options()).unwrap()
    };

    let plain = load("bricks.png", &links(&["1,10", "20,10", "10,0"]));
    let brick = &plain.materials[0];
    assert_eq!((brick.name.as_str(), brick.base_color), ("brick", [0.5, 0.25, 1.0, 1.0]));
    assert_eq!((brick.pane_m, brick.ior), (Some(0.004), 1.6));
    assert_eq!(brick.reflectance.as_ref().map(|own| own.at(905.0)), Some(0.3));
    assert!(plain.report.warnings[0].contains("factors outside 0..1 are clamped: material \"brick\" base colour 2"));

    let found = load("bricks.png", &connections);
    let use_ = found.materials[0].base_color_texture.as_ref().unwrap();
    assert_eq!((use_.texture.width, use_.wrap_u, use_.wrap_v), (16, Wrap::ClampToEdge, Wrap::Repeat));
    assert_eq!(found.materials[0].base_color, [1.0; 4], "an image takes the place of the colour");
    assert_eq!(found.objects[0].mesh.parts[0].uvs.as_ref().unwrap()[1], [1.0, 0.0]);
    // v is up in FBX, and the blue square is in the upper left corner of the image.
    let blue = |uv| use_.sample(uv)[2] > 0.9;
    assert!(blue([0.2, 0.8]) && !blue([0.2, 0.2]) && !blue([0.8, 0.8]));

    // Connected to the opacity, the image is a mask by its brightness.
    let mask = links(&["1,10", "20,10", "10,0"]) + "C: \"OP\",30,20, \"TransparentColor\"\n";
    let veil = load("bricks.png", &mask);
    let material = &veil.materials[0];
    assert!(material.base_color_texture.is_none() && material.alpha == Alpha::Coverage, "{material:?}");
    let use_ = material.alpha_texture.as_ref().unwrap();
    assert!((use_.sample([0.2, 0.8])[3] - 0.0722).abs() < 0.1 && veil.objects[0].mesh.parts[0].uvs.is_some());
    let bare = objects("bricks.png").replace(layers, "");
    let bare = read_in(folder.path(), text(&bare, &mask).as_bytes(), &options()).unwrap();
    let warnings = bare.report.warnings.join("\n");
    assert!(warnings.contains("texture coordinates are missing"), "{warnings}");

    let missing = load("gone.png", &connections);
    assert!(missing.materials[0].base_color_texture.is_none());
    let warnings = missing.report.warnings.join("\n");
    assert!(
        warnings.contains("left out: material \"brick\": there is no image \"..\\\\art\\\\gone.png\""),
        "{warnings}"
    );

    let outside = folder.path().parent().unwrap().join("echocast_outside.png");
    fs::copy(blender("squares.png"), &outside).unwrap();
    let scene = objects("x.png").replace("..\\art\\x.png", "../echocast_outside.png");
    let refused = read_in(folder.path(), text(&scene, &connections).as_bytes(), &options()).unwrap();
    assert!(
        refused.report.warnings.join("\n").contains("leads out of the folder of the scene"),
        "{:?}",
        refused.report
    );
    let allowed = LoadOptions { allow_outside_paths: true, ..options() };
    let found = read_in(folder.path(), text(&scene, &connections).as_bytes(), &allowed).unwrap();
    assert!(found.materials[0].base_color_texture.is_some());
    fs::remove_file(outside).unwrap();
}

#[test]
fn transparency_is_coverage() {
    let load = |model: &str, lines: &[&str], name: &str| {
        let lines = properties(lines);
        let material = format!("Material: 20, \"Material::{name}\", \"\" {{\nShadingModel: \"{model}\"\n{lines}}}\n");
        let objects = sail(1) + &model_of_wall() + &material;
        let scene = read_text(&text(&objects, &links(&["1,10", "20,10", "10,0"])));
        let material = &scene.materials[0];
        assert_eq!(material.transmission, 0.0);
        (material.alpha, material.base_color[3])
    };
    let (factor, color) =
        (r#""TransparencyFactor", "Number", "", "A",0.7"#, r#""TransparentColor", "Color", "", "A",1,1,1"#);
    let (all, black) =
        (r#""TransparencyFactor", "Number", "", "A",1"#, r#""TransparentColor", "Color", "", "A",0,0,0"#);
    for model in ["phong", "lambert"] {
        let of = |lines: &[&str]| {
            let (alpha, opacity) = load(model, lines, "veil");
            (alpha, (opacity * 100.0).round() / 100.0)
        };
        assert_eq!(of(&[factor]), (Alpha::Coverage, 0.3));
        assert_eq!(of(&[factor, color]), (Alpha::Coverage, 0.3));
        assert_eq!(of(&[all, color]), (Alpha::Coverage, 0.0));
        assert_eq!(of(&[all, black]), (Alpha::Solid, 1.0));
        assert_eq!(of(&[r#""Opacity", "double", "Number", "",0.25"#]), (Alpha::Coverage, 0.25));
        assert_eq!(of(&[all, color, r#""Opacity", "double", "Number", "",1"#]), (Alpha::Solid, 1.0));
        assert_eq!(of(&[]), (Alpha::Solid, 1.0));
        assert_eq!(load(model, &[factor], "Window_Glass").0, Alpha::Solid, "glass is a pane");
    }
}

fn model_of_wall() -> String {
    model(10, "Wall", &[])
}

#[test]
fn properties_out_of_range_are_errors() {
    let material =
        format!("Material: 20, \"Material::m\", \"\" {{\n{}}}\n", properties(&[r#""dirt", "Number", "", "U",2"#]));
    let text = text(&(sail(1) + &model(10, "S", &[]) + &material), &links(&["1,10", "20,10", "10,0"]));
    assert!(
        error(&text).ends_with("material \"m\": property dirt is 2; allowed: a number from 0 to 1"),
        "{}",
        error(&text)
    );
}

#[test]
fn lines_of_3ds_max_are_properties() {
    let lines = r#""UDP3DSMAX", "KString", "", "U", "speed = 3&cr;&lf;categoryID = lorry&cr;&lf;partID=7""#;
    let scene = read_text(&one(&sail(1), &[lines]));
    assert_eq!((&scene.labels.category.names[0], &scene.labels.part.names[0]), (&"lorry".to_owned(), &"7".to_owned()));
}

#[test]
fn hidden_objects_are_left_out() {
    let objects =
        sail(1) + &model(10, "Hidden", &[r#""Visibility", "Visibility", "", "A",0"#]) + &model(11, "Shown", &[]);
    let scene = read_text(&text(&objects, &links(&["1,10", "1,11", "10,0", "11,0"])));
    assert_eq!(scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["Shown"]);
}

/// A robot arm with everything that affects a transform in FBX: pivots, offsets, rotation orders, curves of all kinds.
#[test]
fn motion_matches_the_library() {
    let times = [0.0, 0.7, 1.1, 2.0];
    // Slopes are the bits of single-precision numbers.
    let slopes = format!("{},{},0,0", 300f32.to_bits() as i32, (-90f32).to_bits() as i32);
    let nodes = sail(1)
        + &sail(2)
        + &sail(3)
        + &model(
            10,
            "Shoulder",
            &[
                r#""RotationPivot", "Vector3D", "Vector", "",50,20,0"#,
                r#""RotationOffset", "Vector3D", "Vector", "",0,10,5"#,
                r#""ScalingPivot", "Vector3D", "Vector", "",0,40,0"#,
                r#""PreRotation", "Vector3D", "Vector", "",10,20,30"#,
                r#""PostRotation", "Vector3D", "Vector", "",0,-40,0"#,
                r#""RotationActive", "bool", "", "",1"#,
                r#""RotationOrder", "enum", "", "",4"#,
                r#""Lcl Translation", "Lcl Translation", "", "A",100,0,0"#,
            ],
        )
        + &model(11, "Elbow", &[r#""Lcl Translation", "Lcl Translation", "", "A",0,200,0"#])
        + &model(
            12,
            "Hand",
            &[r#""InheritType", "enum", "", "",2"#, r#""Lcl Translation", "Lcl Translation", "", "A",70,0,0"#],
        );
    let (objects, connections) = animation(
        "work",
        100,
        &[
            (10, "Lcl Translation", "d|X", curve(200, &times, &[0.0, 90.0, -20.0, 40.0], CUBIC, NO_SLOPES)),
            (10, "Lcl Rotation", "d|Y", curve(201, &times, &[0.0, 170.0, 80.0, 500.0], SLOPED, &slopes)),
            (10, "Lcl Rotation", "d|Z", curve(202, &[0.2, 1.5], &[0.0, 60.0], LINEAR, NO_SLOPES)),
            (10, "Lcl Scaling", "d|Y", curve(203, &[0.0, 1.0], &[1.0, 2.0], LINEAR, NO_SLOPES)),
            (11, "Lcl Rotation", "d|X", curve(204, &times, &[0.0, 45.0, -45.0, 10.0], CONSTANT, NO_SLOPES)),
            (11, "Lcl Translation", "d|Z", curve(205, &times, &[0.0, 30.0, 60.0, 0.0], CONSTANT_NEXT, NO_SLOPES)),
            (11, "Lcl Scaling", "d|X", curve(206, &times, &[1.0, 1.5, 0.5, 1.0], CUBIC, NO_SLOPES)),
            (12, "Lcl Rotation", "d|X", curve(207, &times, &[0.0, 300.0, -100.0, 700.0], LINEAR, NO_SLOPES)),
            (12, "Lcl Rotation", "d|Z", curve(208, &times, &[0.0, 30.0, 90.0, -40.0], LINEAR, NO_SLOPES)),
        ],
    );
    let links = links(&["1,10", "2,11", "3,12", "12,11", "11,10", "10,0"]);
    let file = text(&(nodes + &objects), &(links + &connections));
    check_motion(file.as_bytes(), 0, 1e-4);
    let scene = read_text(&file);
    assert_eq!(
        (scene.animations.as_slice(), scene.animation_lengths.as_slice()),
        (&["work".to_owned()][..], &[2.0][..])
    );
    let keys =
        scene.timeline.nodes.iter().filter_map(|node| node.rotation.as_ref()).map(|track| track.curve.times.len());
    assert!(keys.clone().max().unwrap() < 400, "{:?}", keys.collect::<Vec<_>>());
    // It jumps where the file does.
    let jumps = |time: f64| {
        let object = scene.objects.iter().find(|object| object.name == "Elbow").unwrap();
        at(&scene, object, time + 1e-6)[2].distance(at(&scene, object, time - 1e-6)[2])
    };
    assert!(jumps(1.1) > 0.5 && jumps(1.0) < 1e-4, "{} {}", jumps(1.1), jumps(1.0));
}

#[test]
fn animations_are_chosen_and_repeated() {
    let (first, links_of_first) = animation(
        "go",
        100,
        &[(10, "Lcl Translation", "d|X", curve(200, &[0.0, 1.0], &[0.0, 100.0], LINEAR, NO_SLOPES))],
    );
    let (second, links_of_second) = animation(
        "rise",
        300,
        &[(10, "Lcl Translation", "d|Y", curve(400, &[0.0, 2.0], &[0.0, 100.0], LINEAR, NO_SLOPES))],
    );
    let objects = sail(1) + &model(10, "Sail", &[]) + &first + &second;
    let file = text(&objects, &(links(&["1,10", "10,0"]) + &links_of_first + &links_of_second));
    let corner = |options: &LoadOptions, time| {
        let scene = read_bytes(file.as_bytes(), options).unwrap();
        assert_eq!((scene.animations.join(" "), &scene.animation_lengths[..]), ("go rise".to_owned(), &[1.0, 2.0][..]));
        (at(&scene, &scene.objects[0], time)[0] * 1e6).round() / 1e6
    };
    let go = LoadOptions { animation: Some("go".into()), ..options() };
    assert_eq!(corner(&go, 0.5), DVec3::new(0.5, 0.0, 0.0));
    assert_eq!(corner(&go, 1.25), DVec3::new(1.0, 0.0, 0.0));
    assert_eq!(corner(&LoadOptions { looped: true, ..go }, 1.25), DVec3::new(0.25, 0.0, 0.0));
    assert_eq!(corner(&options(), 0.5), DVec3::new(0.0, 0.0, 0.25), "of two that move one node, the last is played");
    let scene = read_text(&file);
    assert!(scene.report.warnings[0].contains("the last is played: node \"Sail\""), "{:?}", scene.report);
}

#[test]
fn node_visibility_is_animated() {
    let (objects, connections) = animation(
        "blink",
        100,
        &[(10, "Visibility", "d|Visibility", curve(200, &[0.0, 1.0], &[1.0, 0.0], CONSTANT, NO_SLOPES))],
    );
    let file = text(&(sail(1) + &model(10, "Sail", &[]) + &objects), &(links(&["1,10", "10,0"]) + &connections));
    let scene = read_text(&file);
    let node = scene.objects[0].motion.as_ref().unwrap().node;
    assert_eq!([0.5, 1.5].map(|time| scene.timeline.is_visible(node, time)), [true, false]);
}

/// A flag on two bones, one of which turns, with two shapes on one weight.
#[test]
fn bones_and_blend_shapes_deform() {
    let flag = mesh(1, "0,0,0,100,0,0,100,100,0,0,100,0,200,50,0", "0,1,2,-4,1,4,-3", "");
    let cluster = |id: u32, indices: &str, weights: &str, shift: i32| {
        let count = indices.split(',').count();
        format!(
            "Deformer: {id}, \"SubDeformer::\", \"Cluster\" {{\nIndexes: *{count} {{ a: {indices}\n}}\nWeights: *{count} \
             {{ a: {weights}\n}}\nTransform: *16 {{ a: 1,0,0,0,0,1,0,0,0,0,1,0,{shift},0,0,1\n}}\n}}\n"
        )
    };
    let shape = |id: u32, offsets: &str| {
        format!(
            "Geometry: {id}, \"Geometry::s{id}\", \"Shape\" {{\nIndexes: *2 {{ a: 2,4\n}}\nVertices: *6 {{ a: {offsets}\n}}\n}}\n"
        )
    };
    let bone = |id: u32, name: &str, x: i32| {
        let line = format!(r#""Lcl Translation", "Lcl Translation", "", "A",{x},0,0"#);
        format!("Model: {id}, \"Model::{name}\", \"LimbNode\" {{\n{}}}\n", properties(&[&line]))
    };
    let objects = flag
        + &model(10, "Flag", &[r#""Lcl Translation", "Lcl Translation", "", "A",0,30,0"#])
        + &bone(11, "Mast", 0)
        + &bone(12, "Tip", 100)
        + "Deformer: 20, \"Deformer::\", \"Skin\" {\n}\nDeformer: 30, \"Deformer::\", \"BlendShape\" {\n}\n"
        + &cluster(21, "1,2", "0.5,0.25", 0)
        + &cluster(22, "1,2,4", "0.5,0.75,2", -100)
        + "Deformer: 31, \"SubDeformer::wave\", \"BlendShapeChannel\" {\nDeformPercent: 0\nFullWeights: *2 { a: 50,100\n}\n}\n"
        + &shape(32, "0,0,40,0,0,80")
        + &shape(33, "0,0,-40,0,20,10");
    let (curves, of_curves) = animation(
        "wave",
        100,
        &[
            (12, "Lcl Rotation", "d|Z", curve(200, &[0.0, 1.0, 2.0], &[0.0, 90.0, 30.0], CUBIC, NO_SLOPES)),
            (31, "DeformPercent", "d|DeformPercent", curve(201, &[0.0, 2.0], &[-20.0, 130.0], LINEAR, NO_SLOPES)),
        ],
    );
    let links = links(&[
        "1,10", "10,0", "11,0", "12,11", "20,1", "21,20", "22,20", "11,21", "12,22", "30,1", "31,30", "32,31", "33,31",
    ]);
    let file = text(&(objects + &curves), &(links + &of_curves));
    check_motion(file.as_bytes(), 0, 1e-4);
    let scene = read_text(&file);
    // The corners that no bone moves stay on their node.
    let corners = at(&scene, &scene.objects[0], 1.0);
    assert!(corners.iter().any(|corner| corner.distance(DVec3::Z * 0.3) < 1e-6), "{corners:?}");
}

#[test]
fn a_scene_of_blender_is_as_its_gltf_has_it() {
    let [fbx, glb] = ["scene.fbx", "scene.glb"].map(|name| Scene::load(blender(name)).unwrap());
    assert!(fbx.report.warnings.is_empty(), "{:?}", fbx.report);
    let names = |scene: &Scene| {
        let mut all: Vec<_> = scene
            .objects
            .iter()
            .map(|object| {
                let category = scene.labels.category.name(object.category_id).unwrap().to_owned();
                let instance = scene.labels.instance.name(object.instance_id).unwrap().to_owned();
                let parts: Vec<_> = object.part_ids.iter().map(|&id| scene.labels.part.name(id)).collect();
                // Blender parents what a rig moves to the rig in glTF only.
                let above = object.ancestors.iter().map(|node| &*node.name).filter(|name| *name != "Rig");
                let above: Vec<_> = above.collect();
                format!("{} {category} {instance} {parts:?} {above:?} {}", object.name, object.mesh.triangle_count())
            })
            .collect();
        all.sort();
        all
    };
    assert_eq!(names(&fbx), names(&glb));
    assert_eq!(fbx.meshes().len(), glb.meshes().len(), "what shares a mesh there does so here");
    assert!(fbx.objects.iter().all(|object| object.up == UpAxis::Z), "Blender models z up");

    let [a, b] = [&fbx, &glb].map(|scene| scene.camera("Eye").unwrap().pose);
    assert!(a.position.distance(b.position) < 1e-5 && a.orientation.angle_between(b.orientation) < 1e-5, "{a:?} {b:?}");
    for material in &glb.materials {
        let own = fbx.materials.iter().find(|own| own.name == material.name).unwrap();
        let differ = own.base_color.iter().zip(material.base_color).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(differ < 1e-6, "{own:?} {material:?}");
        assert!((own.roughness - material.roughness).abs() < 1e-3, "{own:?} {material:?}");
        assert!((own.metallic - material.metallic).abs() < 1e-6 && own.pane_m == material.pane_m, "{own:?}");
        assert_eq!(own.reflectance, material.reflectance.clone());
        assert_eq!(own.base_color_texture.is_some(), material.base_color_texture.is_some());
    }
    assert_eq!(
        fbx.materials.iter().find(|m| m.name == "brick").unwrap().reflectance,
        Some(Reflectance::Constant(0.35))
    );
}

#[test]
fn a_scene_of_blender_moves_as_its_gltf_does() {
    check_motion(&fs::read(blender("scene.fbx")).unwrap(), 0, 1e-4);
    let [fbx, glb] = ["scene.fbx", "scene.glb"].map(|name| Scene::load(blender(name)).unwrap());
    assert_eq!(fbx.animation_lengths, [2.0]);
    let mut moved = 0;
    for object in &glb.objects {
        let own = fbx.objects.iter().find(|own| own.name == object.name).unwrap();
        assert_eq!(own.motion.is_some(), object.motion.is_some(), "{}", object.name);
        moved += usize::from(own.motion.is_some());
        // At frames, 24 per second; between them the curves of the two formats differ.
        for (time, tolerance) in [(0.0, 2e-5), (0.5, 2e-5), (1.0, 2e-5), (29.0 / 24.0, 2e-5), (1.52, 2e-3), (2.0, 2e-5)]
        {
            let expected = at(&glb, object, time);
            for found in at(&fbx, own, time) {
                let nearest = expected.iter().map(|p| p.distance(found)).fold(f64::INFINITY, f64::min);
                assert!(nearest < tolerance, "{} at {time} s: {found} is off by {nearest} m", object.name);
            }
        }
    }
    assert_eq!(moved, 2, "the cart and the worm");
}

#[test]
fn a_very_deep_hierarchy_is_read() {
    const DEPTH: u32 = 100_000;
    let line = r#""Lcl Translation", "Lcl Translation", "", "A",100,0,0"#;
    let mut objects = sail(1);
    let mut connections = links(&["1,10", &format!("{},0", 10 + DEPTH - 1)]);
    for node in 10..10 + DEPTH {
        objects += &model(node, "n", &[line]);
        if node > 10 {
            connections += &format!("C: \"OO\",{},{node}\n", node - 1);
        }
    }
    let scene = read_text(&text(&objects, &connections));
    assert_eq!(corners(&scene, 0)[0], [f64::from(DEPTH), 0.0, 0.0]);
}

#[test]
fn damaged_files_are_errors() {
    assert!(error("").ends_with("scene.fbx: it is empty"), "{}", error(""));
    for other in
        ["o cube\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "newmtl a\nKd 1 1 1\n", "solid a\nendsolid\n", "hello"]
    {
        assert!(error(other).ends_with("scene.fbx: it is not an FBX file"), "{}", error(other));
    }
    // A cycle.
    let objects = sail(1) + &model(10, "a", &[]) + &model(11, "b", &[]);
    let cycle = error(&text(&objects, &links(&["1,10", "10,11", "11,10"])));
    assert!(cycle.ends_with("scene.fbx: it is damaged: cyclic node hierarchy"), "{cycle}");
    let far = error(&one(&mesh(1, "0,0,0,1e30,0,0,0,200,0", "0,1,-3", ""), &[]));
    assert!(far.contains("mesh \"mesh1\": vertex 1 is [1e30, 0.0, 0.0]; allowed: -1e18 to 1e18"), "{far}");
    let huge = r#""Lcl Scaling", "Lcl Scaling", "", "A",1e308,1e308,1e308"#;
    let objects = sail(1) + &model(10, "a", &[huge]) + &model(11, "b", &[huge]);
    let far = error(&text(&objects, &links(&["1,10", "10,11", "11,0"])));
    assert!(far.contains("node \"b\": its world transform is not finite") || far.contains("node \"a\""), "{far}");
    // A list that claims to be longer than any memory, and one with an index out of range.
    let long = one(&sail(1), &[]).replace("*9 {", "*900000000000000 {");
    if let Err(error) = read_bytes(long.as_bytes(), &options()) {
        assert!(error.to_string().contains("scene.fbx: "), "{error}");
    }
    let far = error(&one(&mesh(1, "0,0,0,100,0,0,0,200,0", "0,1,-3,0,77,-3", ""), &[]));
    assert!(far.ends_with("scene.fbx: it is damaged: lists or numbers in it do not fit together"), "{far}");
}

#[test]
fn truncated_files_give_a_readable_error() {
    let whole = fs::read(blender("scene.fbx")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for length in (0..whole.len()).step_by(1499) {
        match read_in(folder.path(), &whole[..length], &options()) {
            Ok(_) => {}
            Err(error) => assert!(error.to_string().contains("scene.fbx: it is "), "{error}"),
        }
    }
}
