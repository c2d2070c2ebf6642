//! What is wrong is said in one sentence.

use super::{load, options};
use crate::{Robot, RobotOptions};
use std::collections::BTreeMap;
use std::fs;

/// The error of reading `text` as a file called `name`, with `FOLDER` for its folder.
fn fault_of(name: &str, text: &str, options: &RobotOptions) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    let error = Robot::load(&path, options).unwrap_err().to_string();
    error.replace(folder.path().to_str().unwrap(), "FOLDER")
}

fn urdf(text: &str) -> String {
    fault_of("a.urdf", &format!("<robot name='a'>\n{text}</robot>"), &RobotOptions::default())
}

fn sdf(text: &str) -> String {
    fault_of("a.sdf", &format!("<sdf version='1.9'><model name='a'>\n{text}</model></sdf>"), &RobotOptions::default())
}

fn mjcf(text: &str) -> String {
    fault_of("a.xml", &format!("<mujoco><worldbody>\n{text}</worldbody></mujoco>"), &RobotOptions::default())
}

/// A visual with this geometry, in a link.
fn visual(geometry: &str) -> String {
    format!("<link name='l'><visual><geometry>{geometry}</geometry></visual></link>")
}

const LINKS: &str = "<link name='l'/><link name='m'/>";

fn joint(name: &str, parent: &str, child: &str) -> String {
    format!("<joint name='{name}' type='continuous'><parent link='{parent}'/><child link='{child}'/></joint>")
}

#[test]
fn meshes_that_are_not_there_are_named_with_the_paths_searched() {
    let mesh = visual("<mesh filename='package://pkg/x.stl'/>");
    let text = format!("<robot name='a'>\n{mesh}</robot>");
    let options = RobotOptions { model_paths: vec!["/models".into()], ..RobotOptions::default() };
    assert_eq!(
        fault_of("a.urdf", &text, &options),
        "FOLDER/a.urdf: line 2: mesh filename \"package://pkg/x.stl\" is not there; searched: /models/pkg/x.stl, \
         FOLDER/pkg/x.stl; allowed: a file in the folder of the file or of model_paths (--model-path)"
    );
    let outside = urdf(&visual("<mesh filename='../x.stl'/>"));
    assert!(
        outside.contains("leads out of the folder of the file and of those given; allowed: files in them"),
        "{outside}"
    );
    let scheme = urdf(&visual("<mesh filename='http://x/x.stl'/>"));
    assert!(scheme.contains("has the scheme \"http\"; allowed: package://, model://, file://, and paths"), "{scheme}");
    assert!(
        sdf(&visual("<mesh><uri>model://no/x.dae</uri></mesh>"))
            .contains("\"model://no/x.dae\" is not there; searched: ")
    );
}

#[test]
fn packages_cannot_name_what_is_outside_of_them() {
    for name in [
        "package://pkg/../../x.stl",
        "package://../x.stl",
        "package:///etc/passwd",
        "file:///etc/passwd",
        "/etc/passwd",
    ] {
        let error = urdf(&visual(&format!("<mesh filename='{name}'/>")));
        assert!(!error.contains("passwd; ") && !error.contains("/etc/passwd, "), "{error}");
        assert!(error.contains("leads out of") || error.contains("is not there"), "{error}");
    }
}

#[test]
fn joints_form_a_tree() {
    let circle = urdf(&[LINKS, &joint("i", "l", "m"), &joint("j", "m", "l")].concat());
    assert!(
        circle.starts_with("FOLDER/a.urdf: link \"l\" hangs on itself by a circle of joints")
            || circle.contains("link \"m\" hangs on itself"),
        "{circle}"
    );
    let twice = urdf(&[LINKS, "<link name='n'/>", &joint("i", "l", "m"), "\n", &joint("j", "n", "m")].concat());
    assert_eq!(
        twice,
        "FOLDER/a.urdf: line 3: joint \"j\" moves link \"m\", which another joint moves already; allowed: one joint for \
         each link"
    );
    let names = urdf("<link name='l'/>\n<link name='l'/>");
    assert_eq!(names, "FOLDER/a.urdf: line 3: link \"l\" comes twice; allowed: one link of each name");
    let joints = urdf(&[LINKS, "<link name='n'/>", &joint("i", "l", "m"), &joint("i", "m", "n")].concat());
    assert_eq!(joints, "FOLDER/a.urdf: there are two joints named \"i\"; allowed: one of each name");
    assert!(urdf(&[LINKS, &joint("i", "l", "k")].concat()).contains("has the child \"k\", which is no link"));
    let mimics = |name: &str, child: &str, other: &str| {
        joint(name, "l", child).replace("</joint>", &format!("<mimic joint='{other}'/></joint>"))
    };
    let error = urdf(&[LINKS, "<link name='n'/>", &mimics("i", "m", "j"), &mimics("j", "n", "i")].concat());
    assert!(error.contains("mimics itself; allowed: to mimic a joint with a position"), "{error}");
}

#[test]
fn sizes_scales_and_axes_make_sense() {
    let fault = |geometry: &str| urdf(&visual(geometry));
    assert_eq!(
        fault("<box size='1 -2 3'/>"),
        "FOLDER/a.urdf: line 2: box has size \"1 -2 3\"; allowed: metres above 0, up to 1e6"
    );
    assert!(fault("<sphere radius='nan'/>").contains("sphere has radius \"nan\"; allowed: a number"));
    assert!(fault("<cylinder radius='1'/>").contains("cylinder has no attribute length"));
    let axis = joint("i", "l", "m").replace("</joint>", "<axis xyz='0 0 0'/></joint>");
    assert!(urdf(&[LINKS, &axis].concat()).contains("has xyz [0.0, 0.0, 0.0]; allowed: a direction, not of length 0"));
    assert!(mjcf("<geom type='box' size='1 -1 1'/>").contains("geom has size \"1 -1 1\"; allowed: metres above 0"));
    assert!(mjcf("<geom type='capsule' size='1'/>").contains("geom has size \"1\"; allowed: metres above 0"));
    assert!(
        sdf(&visual("<sphere><radius>-1</radius></sphere>"))
            .contains("sphere has the radius -1; allowed: metres above 0")
    );
}

#[test]
fn positions_are_finite_and_as_many_as_joints_take() {
    let arm = load("arm.urdf");
    let fault = |positions: &[f64]| arm.link_poses(positions).unwrap_err().to_string();
    assert_eq!(fault(&[0.0; 2]), "the number of joint positions is 2; allowed: 3, those of all joints");
    assert_eq!(fault(&[0.0, f64::NAN, 0.0]), "the position of joint \"shoulder\" is NaN; allowed: finite numbers");
    let crawler = load("crawler.xml");
    let error = crawler.link_poses(&[0.0; 15]).unwrap_err().to_string();
    assert_eq!(error, "the position of joint \"root\" is a quaternion of length 0; allowed: rotations, w first");
    let given = |robot: &Robot, name: &str, position: f64| {
        robot.positions_with(&BTreeMap::from([(name.to_owned(), position)])).unwrap_err().to_string()
    };
    assert_eq!(given(&arm, "elbow", f64::INFINITY), "joints.elbow is inf; allowed: a finite number");
    assert!(given(&arm, "right_finger_joint", 0.0).contains("given for a joint that follows another"));
    assert!(given(&crawler, "root", 0.0).contains("one number for a joint that takes several"));
}

#[test]
fn frames_of_sdf_are_there_and_not_in_circles() {
    let link = "<link name='l'><pose relative_to='f'/></link>";
    let missing = sdf(link);
    assert_eq!(
        missing,
        "FOLDER/a.sdf: line 2: there is no frame \"f\"; allowed: links, joints, frames and models of the same model; \
         near: l"
    );
    let circle =
        sdf(&format!("{link}<frame name='f'><pose relative_to='g'/></frame><frame name='g' attached_to='f'/>"));
    assert!(circle.contains("circle of frames"), "{circle}");
    let double = sdf("<link name='l'/>\n<frame name='l'/>");
    assert!(
        double.contains("line 3: frame \"l\" has the name of another link, joint, frame or model beside it"),
        "{double}"
    );
    let joint = "<joint name='j' type='fixed'><parent>l</parent><child>world</child></joint><link name='l'/>";
    assert!(sdf(joint).contains("a joint has the world as its child; allowed: links"));
}

#[test]
fn models_do_not_include_themselves_for_ever() {
    let folder = tempfile::tempdir().unwrap();
    let text = "<sdf version='1.9'><model name='m'><link name='l'/><include><uri>m.sdf</uri><name>n</name></include></model></sdf>";
    fs::write(folder.path().join("m.sdf"), text).unwrap();
    let error = Robot::load(folder.path().join("m.sdf"), &RobotOptions::default()).unwrap_err().to_string();
    assert!(error.contains("is nested more than 32 deep; allowed: less, and no model in itself"), "{error}");
    fs::write(folder.path().join("m.xml"), "<mujoco><include file='m.xml'/></mujoco>").unwrap();
    let error = Robot::load(folder.path().join("m.xml"), &RobotOptions::default()).unwrap_err().to_string();
    assert!(error.contains("twice; allowed: each file once"), "{error}");
}

#[test]
fn other_files_are_told_from_robots() {
    let error = fault_of("a.xml", "<document/>", &RobotOptions::default());
    assert_eq!(
        error,
        "FOLDER/a.xml: line 1: the outermost element is \"document\"; allowed: robot (URDF), sdf, mujoco (MJCF)"
    );
    let macros = "<robot name='a' xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:macro name='m'/></robot>";
    assert!(
        fault_of("a.urdf", macros, &RobotOptions::default()).contains("holds macros of xacro; allowed: plain URDF")
    );
    assert!(urdf("").contains("has no link; allowed: at least one"));
}

#[test]
fn bodies_are_nested_as_deep_as_the_stack_allows() {
    let bodies = ["<body>".repeat(200), "</body>".repeat(200)].concat();
    assert!(mjcf(&bodies).contains("is below more than 100 bodies, the most allowed"));
}

#[test]
fn deep_trees_are_read_without_recursion_that_overflows() {
    let count = 20_000;
    let links: String = (0..count).map(|k| format!("<link name='l{k}'/>")).collect();
    let joints: String =
        (1..count).rev().map(|k| joint(&format!("j{k}"), &format!("l{}", k - 1), &format!("l{k}"))).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.urdf");
    fs::write(&path, format!("<robot name='a'>{links}{joints}</robot>")).unwrap();
    let robot = Robot::load(&path, &options()).unwrap();
    assert_eq!((robot.links.len(), robot.positions), (count, count - 1));
    assert!(robot.links.iter().enumerate().all(|(index, link)| link.parent.is_none_or(|parent| parent < index)));
    assert!(robot.link_poses(&robot.rest_positions()).is_ok());
}
