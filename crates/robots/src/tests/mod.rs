//! Robots of our own against what other programs make of them.

mod faults;
mod scenes;

use crate::{GeometryUse, JointKind, LinkShape, Robot, RobotOptions};
use glam::{DAffine3, DMat3, DVec3};
use std::path::{Path, PathBuf};

/// The folder of the robots.
fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/tests/data")
}

fn options() -> RobotOptions {
    RobotOptions { model_paths: vec![data()], ..RobotOptions::default() }
}

fn load(name: &str) -> Robot {
    Robot::load(data().join(name), &options()).unwrap()
}

/// Compares all link poses of a robot with those of a table: rows `positions`, and, for these, of each link the first
/// three rows of its matrix. Returns how many poses were compared, and how far the worst is off.
fn compare(robot: &Robot, table: &str) -> (usize, f64) {
    let (mut poses, mut worst, mut count) = (Vec::new(), 0f64, 0);
    for row in table.lines() {
        let (name, numbers) = row.split_once(',').unwrap();
        let numbers: Vec<f64> = numbers.split(',').map(|number| number.parse().unwrap()).collect();
        if name == "positions" {
            let positions = if robot.positions == 0 { &[] } else { &numbers[..] };
            poses = robot.link_poses(positions).unwrap();
            continue;
        }
        let n = |row: usize, column: usize| numbers[4 * row + column];
        let columns = [0, 1, 2, 3].map(|column| DVec3::new(n(0, column), n(1, column), n(2, column)));
        let expected =
            DAffine3::from_mat3_translation(DMat3::from_cols(columns[0], columns[1], columns[2]), columns[3]);
        let found = poses[robot.link(name).unwrap()];
        let off =
            (found.matrix3 - expected.matrix3).to_cols_array().into_iter().fold(0f64, |most, x| most.max(x.abs()));
        worst = worst.max(off).max((found.translation - expected.translation).length());
        count += 1;
    }
    (count, worst)
}

#[test]
fn links_of_urdf_are_where_yourdfpy_puts_them() {
    // yourdfpy 0.0.60, get_transform after update_cfg with random positions of its actuated joints.
    let (count, worst) = compare(&load("arm.urdf"), include_str!("data/arm.csv"));
    assert!(count == 24 && worst < 1e-14, "{count} poses, {worst:e}");
}

#[test]
fn bodies_of_mjcf_are_where_mujoco_puts_them() {
    // MuJoCo 4.0.0, xpos and xmat after mj_kinematics with random qpos, whose quaternions it normalises.
    let robot = load("crawler.xml");
    let (count, worst) = compare(&robot, include_str!("data/crawler.csv"));
    assert!(count == 24 && worst < 2e-14, "{count} poses, {worst:e}");
    assert_eq!(robot.positions, 15);
}

#[test]
fn links_of_sdf_are_where_the_semantics_of_its_poses_put_them() {
    // Composed with numpy 2.4.6 from the matrices of the poses, by hand.
    let (count, worst) = compare(&load("cart.sdf"), include_str!("data/cart.csv"));
    assert!(count == 6 && worst < 1e-14, "{count} poses, {worst:e}");
}

#[test]
fn at_rest_links_are_where_the_file_draws_them() {
    for name in ["arm.urdf", "crawler.xml", "cart.sdf"] {
        let robot = load(name);
        let poses = robot.link_poses(&robot.rest_positions()).unwrap();
        for (index, link) in robot.links.iter().enumerate() {
            // A mimic with an offset is not at rest when all positions are 0.
            if link.name == "right_finger" {
                continue;
            }
            let parent = link.parent.map_or(DAffine3::IDENTITY, |parent| poses[parent]);
            assert!(poses[index].abs_diff_eq(parent * link.parent_from_link, 1e-15), "{name}: {}", link.name);
        }
    }
}

#[test]
fn a_turn_by_two_angles_is_the_turn_by_their_sum() {
    // A law of axes, whatever their frames: what a joint adds to its link does not depend on where it is already.
    let robot = load("crawler.xml");
    let hip = robot.joint("left_hip").unwrap();
    let pose = |angle: f64| {
        let mut positions = robot.rest_positions();
        positions[robot.joints[hip].first] = angle;
        robot.link_poses(&positions).unwrap()[robot.joints[hip].link]
    };
    let step = |from: f64, by: f64| pose(from).inverse() * pose(from + by);
    for from in [-2.0, 0.3, 5.0] {
        assert!(step(from, 0.7).abs_diff_eq(step(0.0, 0.7), 1e-13));
    }
}

#[test]
fn limits_kinds_and_mimics_are_those_of_the_file() {
    let arm = load("arm.urdf");
    let joint = |name: &str| &arm.joints[arm.joint(name).unwrap()];
    assert_eq!(joint("shoulder").limits, Some([-2.0, 2.0]));
    assert_eq!((joint("elbow").kind, joint("elbow").limits), (JointKind::Continuous, None));
    let mimic = joint("right_finger_joint").mimic.unwrap();
    assert_eq!((mimic.multiplier, mimic.offset, arm.positions), (-1.5, 0.01, 3));
    let crawler = load("crawler.xml");
    let ankle = &crawler.joints[crawler.joint("left_ankle").unwrap()];
    assert_eq!((ankle.kind, ankle.limits), (JointKind::Prismatic, Some([-0.1, 0.1])));
    let hip = &crawler.joints[crawler.joint("left_hip").unwrap()];
    assert_eq!((hip.rest, hip.limits), (10f64.to_radians(), Some([-80f64.to_radians(), 80f64.to_radians()])));
}

#[test]
fn geoms_have_the_sizes_and_places_that_mujoco_compiles() {
    // geom_size, geom_pos and geom_quat of MuJoCo 4.0.0.
    let robot = load("crawler.xml");
    let leg = &robot.links[robot.link("left_leg").unwrap()].geometry[0];
    let LinkShape::Capsule { radius, length } = leg.shape else { panic!("{:?}", leg.shape) };
    assert!(radius == 0.03 && (length / 2.0 - 0.10049876).abs() < 1e-8);
    let turned = glam::DQuat::from_xyzw(0.0, -0.0498137, 0.0, 0.99875853);
    let expected = DAffine3::from_rotation_translation(turned, DVec3::new(0.01, 0.0, -0.1));
    assert!(leg.link_from_geometry.abs_diff_eq(expected, 1e-7));
    let geoms = |geometry| -> usize {
        let robot = Robot::load(data().join("crawler.xml"), &RobotOptions { geometry, ..options() }).unwrap();
        robot.links.iter().map(|link| link.geometry.len()).sum()
    };
    // The ball of group 3 is not to be seen, the foot is not to be touched.
    assert_eq!((geoms(GeometryUse::Visual), geoms(GeometryUse::Collision)), (6, 6));
    let floor = &robot.links[0].geometry[0];
    assert_eq!(floor.shape, LinkShape::Plane { size: [10.0, 10.0] });
}

#[test]
fn sensors_are_mounted_where_the_files_say() {
    let crawler = load("crawler.xml");
    let [eye, down] = &crawler.sites[..] else { panic!("{:?}", crawler.sites) };
    assert!(eye.sensor.is_none() && eye.link == Some(crawler.link("trunk").unwrap()));
    // A rangefinder measures along the z axis of its site, our sensors along x.
    let ahead = |pose: &DAffine3, axis: DVec3| pose.transform_vector3(axis);
    let expected = DVec3::new(1.0, 0.0, -0.2).normalize();
    assert!((ahead(&down.link_from_site, DVec3::X) - expected).length() < 1e-15);
    assert!((ahead(&eye.link_from_site, DVec3::Z) - expected).length() < 1e-15);
    assert_eq!(down.sensor.as_ref().unwrap()["range"]["max_m"], 4.0);

    let cart = load("cart.sdf");
    let scanner = cart.sites.iter().find(|site| site.name == "cart::chassis::scanner").unwrap();
    assert_eq!(scanner.link_from_site.translation, DVec3::new(0.5, 0.0, 0.2));
    let elevations = scanner.sensor.as_ref().unwrap()["pattern"]["channels"]["elevation_deg"].as_array().unwrap();
    assert_eq!(elevations.len(), 16);
    assert!(
        cart.report.warnings.iter().any(|warning| warning.contains("\"compass\" is left out")),
        "{:?}",
        cart.report
    );

    let arm = load("arm.urdf");
    let spec = arm.sites[0].sensor.as_ref().unwrap();
    assert_eq!((&spec["range"]["min_m"], &spec["noise"]["range_sigma_m"]), (&0.1.into(), &0.01.into()));
    assert!((spec["pattern"]["azimuth"]["step_deg"].as_f64().unwrap() - 1.0).abs() < 1e-12);
}
