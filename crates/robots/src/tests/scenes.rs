//! Robots as scenes.

use super::{data, options};
use crate::{RobotOptions, read_scene};
use glam::Vec3;
use model::material::TextureBudget;
use model::{RawObject, RawScene};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn scene(path: &Path, options: &RobotOptions) -> RawScene {
    read_scene(path, options, &mut TextureBudget::new(16)).unwrap()
}

fn object<'s>(scene: &'s RawScene, name: &str) -> &'s RawObject {
    scene.objects.iter().find(|object| object.name == name).unwrap()
}

#[test]
fn every_link_with_geometry_is_an_object() {
    let arm = scene(&data().join("arm.urdf"), &options());
    let names: Vec<&str> = arm.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["base", "upper", "fore", "hand", "left_finger", "right_finger"]);
    assert_eq!(object(&arm, "base").mesh.parts[0].material_name(), "orange");
    assert_eq!(arm.joints, ["left_finger_joint", "shoulder", "elbow"]);
    assert_eq!(arm.cameras[0].name, "lidar");
    // A world: models are the groups of their links, and an included one is read once.
    let yard = scene(&data().join("cart.sdf"), &options());
    let names: Vec<&str> = yard.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(
        names,
        ["ground::slab", "cart::chassis", "cart::wheel", "cart::mast::pole", "lamp_1::lamp", "lamp_2::lamp"]
    );
    let lamps = ["lamp_1::lamp", "lamp_2::lamp"].map(|name| object(&yard, name));
    assert!(std::sync::Arc::ptr_eq(&lamps[0].mesh, &lamps[1].mesh));
    assert_eq!(&*lamps[0].ancestors[0].name, "lamp_1");
}

#[test]
fn mirrored_meshes_face_outwards() {
    // A tetrahedron, in millimetres, with its right angle at the origin.
    let volume = |object: &RawObject| -> f64 {
        let part = &object.mesh.parts[0];
        let corner = |index: u32| Vec3::from(part.positions[index as usize]).as_dvec3();
        part.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum()
    };
    let arm = scene(&data().join("arm.urdf"), &options());
    let expected = 0.04 * 0.01 * 0.02 / 6.0;
    for name in ["left_finger", "right_finger"] {
        let found = volume(object(&arm, name));
        assert!((found / expected - 1.0).abs() < 1e-5, "{name}: {found:e}");
    }
    let lowest = |name: &str| object(&arm, name).mesh.bounds().unwrap()[0][1];
    assert!(lowest("left_finger") == 0.0 && (lowest("right_finger") + 0.01).abs() < 1e-8);
}

#[test]
fn given_joints_move_their_links_and_no_others() {
    let path = data().join("arm.urdf");
    let joints = BTreeMap::from([("elbow".to_owned(), 0.5), ("of_another_robot".to_owned(), 1.0)]);
    let (rest, bent) = (scene(&path, &options()), scene(&path, &RobotOptions { joints, ..options() }));
    let moved = |name: &str| object(&rest, name).world_from_object != object(&bent, name).world_from_object;
    assert_eq!(["upper", "fore", "hand"].map(moved), [false, true, true]);
}

#[test]
fn visual_and_collision_geometry_are_told_apart() {
    use crate::GeometryUse::Collision;
    let arm = scene(&data().join("arm.urdf"), &RobotOptions { geometry: Collision, ..options() });
    assert_eq!(arm.objects.len(), 1);
    assert_eq!(arm.objects[0].mesh.bounds().unwrap()[1], [0.1, 0.1, 0.025]);
}

#[test]
fn collada_meshes_of_robots_keep_their_axes_but_not_their_unit() {
    // As RViz shows them; a tetrahedron in inches, y up.
    let folder = tempfile::tempdir().unwrap();
    fs::copy(data().join("tetra.dae"), folder.path().join("tetra.dae")).unwrap();
    let urdf = "<robot name='r'><link name='l'><visual><geometry><mesh filename='tetra.dae'/></geometry></visual></link></robot>";
    fs::write(folder.path().join("r.urdf"), urdf).unwrap();
    let high = |scene: &RawScene| {
        let object = &scene.objects[0];
        let corners = model::corners(object.mesh.bounds().unwrap(), &object.world_from_object);
        corners[7].max(corners[0])
    };
    let of_robot = high(&scene(&folder.path().join("r.urdf"), &RobotOptions::default()));
    assert!((of_robot - glam::DVec3::new(0.0254, 0.0508, 0.0762)).length() < 1e-8, "{of_robot}");
}
