//! Bodies that few rays meet, and smooth ones that answer in phase.

use super::{ping, power, set, sonar, water};
use crate::assert_near;
use echocast::material::Sound;
use echocast::scene::Material;
use echocast::{BuiltScene, FieldSet, Ping, Pose, ScanOptions, Sensor};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// A shape of one material where `place` puts it.
fn alone(shape: Shape, sound: Sound, place: DAffine3) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let made_of = scene.material(Material::default().name("thing").sound(sound));
    let mesh = scene.mesh([(shape, Some(made_of))]);
    scene.place(mesh, place);
    scene.finish().build().unwrap()
}

fn options(frame: u32) -> ScanOptions {
    ScanOptions::default().fields(FieldSet::all()).environment(water("")).frame(frame)
}

/// All that a beam hears, dB.
fn heard(ping: &Ping, beam: usize) -> f64 {
    10.0 * ping.levels(beam).iter().map(|&level| power(level.into())).sum::<f64>().log10()
}

fn loudest(ping: &Ping) -> f64 {
    ping.cells().intensity().iter().fold(f64::MIN, |most, &level| most.max(level.into()))
}

/// Unit vector along a beam.
fn axis(sensor: &Sensor, beam: usize) -> DVec3 {
    let far =
        alone(Shape::sphere(0.05, 6), Sound::Target { strength_db: 0.0 }, DAffine3::from_translation(DVec3::X * 1e4));
    let [azimuth, elevation] =
        ping(&far, sensor, Pose::at(0.0, 0.0, 0.0), &options(0)).layout().axes[beam].map(f64::from);
    DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
}

/// Presets, and the beam that is looked along.
const SONARS: [(&str, usize); 4] = [("sss_450", 0), ("mbes_400", 128), ("fls_900", 256), ("sbes_200", 0)];

/// A ball of Lambert's law has the strength `mu 2 pi a^2 / 3` (the integral of `mu sin^2(g)` over the half that is seen),
/// however many rays meet it: as much is heard of it as of a told target of that strength.
#[test]
fn a_small_mesh_is_never_lost_and_as_loud_as_it_is() {
    let (radius, mu) = (0.01f64, 0.1f64);
    let strength_db = 10.0 * (mu * TAU * radius * radius / 3.0).log10();
    for (name, beam) in SONARS {
        let more = "acoustics.noise_level_db=-200 acoustics.speckle=off range.min_m=0.5";
        let sensor = set(Sensor::preset(name).unwrap(), more);
        let along = axis(&sensor, beam);
        for step in 0..25 {
            // From 10 to 18 m, each time between other rays.
            let place = DAffine3::from_translation(along * (10.0 + 0.327 * f64::from(step)));
            let hear = |sound: Sound| {
                let scene = alone(Shape::sphere(radius, 12), sound, place);
                ping(&scene, &sensor, Pose::at(0.0, 0.0, 0.0), &options(step))
            };
            let found = hear(Sound::Lambert { mu_db: 10.0 * mu.log10() });
            let told = hear(Sound::Target { strength_db });
            // A target is heard from its front, the ball from all over it.
            let what = format!("{name}: level at {} m", 10.0 + 0.327 * f64::from(step));
            assert_near(&what, heard(&found, beam), heard(&told, beam), 1.0);
        }
    }
}

/// With speckle the mean of many balls is the same.
#[test]
fn small_meshes_have_speckle_of_the_same_mean() {
    let pattern = "type: imaging, beams: 33, fov_deg: 16, beam_deg: 1, vertical_deg: 20, rays: 64";
    let sensor = |more: &str| sonar(pattern, more);
    let along = axis(&sensor(""), 16);
    let place = DAffine3::from_translation(along * 12.0);
    let scene = alone(Shape::sphere(0.05, 12), Sound::Lambert { mu_db: -10.0 }, place);
    let hear = |sensor: &Sensor, seed: u64| {
        let options = options(0).seed(seed);
        heard(&ping(&scene, sensor, Pose::at(0.0, 0.0, 0.0), &options), 16)
    };
    let smooth = hear(&sensor("acoustics.speckle=off"), 0);
    let speckled: Vec<f64> = (0..200).map(|seed| power(hear(&sensor("acoustics.speckle=frozen"), seed))).collect();
    let mean = 10.0 * (speckled.iter().sum::<f64>() / 200.0).log10();
    assert_near("mean", mean, smooth, 0.8);
}

/// A thin rod, a stone before which another stands, and one behind it.
#[test]
fn bodies_hide_each_other() {
    let sensor = set(Sensor::preset("sss_450").unwrap(), "acoustics.noise_level_db=-200 acoustics.speckle=off");
    let along = axis(&sensor, 0);
    let mut scene = SceneBuilder::new();
    let law = Some(Sound::Lambert { mu_db: -10.0 });
    let stone = scene.material(Material::default().name("stone").sound(law));
    let mesh = scene.mesh([(Shape::sphere(0.06, 12), Some(stone))]);
    for range in [20.0, 20.6] {
        scene.place(mesh, DAffine3::from_translation(along * range));
    }
    let found = ping(&scene.finish().build().unwrap(), &sensor, Pose::at(0.0, 0.0, 0.0), &options(0));
    let near = |range: f64| {
        let bins = (0..found.layout().bins).filter(|&bin| (found.layout().range(bin) - range).abs() < 0.1);
        bins.map(|bin| f64::from(found.levels(0)[bin])).fold(f64::MIN, f64::max)
    };
    // What is left behind are sidelobes of the pulse.
    assert!(near(20.0) > near(20.6) + 30.0, "{} {}", near(20.0), near(20.6));
}

/// A sonar of one wide beam that looks ahead, at 450 kHz.
fn ahead() -> Sensor {
    sonar("type: single_beam, beam_deg: 20, tilt_deg: 0, rays: 512", "acoustics.bin_m=0.01 range.max_m=150")
}

/// Smooth and hard, without anything else.
const SMOOTH: Sound = Sound::Facet { mu_db: -100.0, slope_sigma_deg: 0.0, reflection_loss_db: 0.0 };

/// Target strength of a smooth shape at `range`, turned by `turn`, dB: what is heard, without the other terms of the sonar
/// equation.
fn strength(shape: Shape, range: f64, turn: DQuat) -> f64 {
    let place = DAffine3::from_rotation_translation(turn, DVec3::X * range);
    let scene = alone(shape, SMOOTH, place);
    let [found, mean] = ["frozen", "off"].map(|speckle| {
        let sensor = set(ahead(), &format!("acoustics.speckle={speckle}"));
        loudest(&ping(&scene, &sensor, Pose::at(0.0, 0.0, 0.0), &options(0)))
    });
    // Nothing about it is random; but what cancels over range does so by energies only on the whole.
    assert_near("mean", mean, found, 1.0);
    found - 220.0 + 40.0 * range.log10()
}

const WAVELENGTH: f64 = 1500.0 / 450e3;

/// `20 log(A / wavelength)` head-on, and times `sinc(2 L sin(i) / wavelength) cos(i)` aslant (Urick 1983, table 9.1).
#[test]
fn plates_answer_in_phase() {
    let plate = |side: f64| Shape::plate(DVec3::ZERO, DVec3::NEG_X, 0.5 * side);
    let head_on = |side: f64| 20.0 * (side * side / WAVELENGTH).log10();
    for (side, range) in [(0.05, 60.0), (0.1, 60.0), (0.2, 140.0)] {
        assert_near(&format!("plate of {side} m"), strength(plate(side), range, DQuat::IDENTITY), head_on(side), 0.5);
    }
    for degrees in [0.5f64, 1.0, 1.5, 3.3] {
        let angle = degrees.to_radians();
        let turns = 2.0 * 0.05 * angle.sin() / WAVELENGTH;
        let sinc = (PI * turns).sin() / (PI * turns);
        let expected = head_on(0.05) + 20.0 * (sinc * angle.cos()).abs().log10();
        let found = strength(plate(0.05), 60.0, DQuat::from_rotation_z(angle));
        assert_near(&format!("plate at {degrees} deg"), found, expected, 1.0);
    }
    // Near a large plate it is a mirror: half the pressure of its image at twice the range (r / 2).
    assert_near("mirror", strength(plate(0.9), 4.0, DQuat::IDENTITY), 20.0 * 2f64.log10(), 2.5);
}

/// Rigid spheres beside the series of modes: echosms 0.24 (`MSSModel`, fixed-rigid, 450 kHz, 1500 m/s), and `20 log(a / 2)`.
#[test]
fn spheres_answer_as_by_their_modes() {
    for (radius, modes) in [(0.02, -39.976), (0.05, -32.045), (0.1, -26.020), (0.2, -19.999), (0.5, -12.088)] {
        let found = strength(Shape::sphere(radius, 48), 40.0 * radius.max(0.25), DQuat::from_rotation_z(0.3));
        assert_near(&format!("sphere of {radius} m"), found, modes, 1.0);
    }
}

/// Cylinders broadside: `10 log(a L^2 / (2 wavelength))` (Urick 1983, table 9.1), and the thinnest beside the series of
/// modes of echosms 0.24 (`DCMModel`, fixed-rigid), which is cut off too early for thicker ones.
#[test]
fn cylinders_answer_broadside() {
    let length = 0.1;
    for radius in [0.012, 0.03, 0.06, 0.1] {
        let theory = 10.0 * (radius * length * length / (2.0 * WAVELENGTH)).log10();
        let found = strength(cylinder(radius, length, 96), 60.0, DQuat::IDENTITY);
        assert_near(&format!("cylinder of {radius} m"), found, theory, 1.0);
    }
    assert_near("modes", strength(cylinder(0.012, length, 96), 60.0, DQuat::IDENTITY), -17.434, 1.0);
}

/// The mantle of a cylinder about z, smooth.
fn cylinder(radius: f64, length: f64, sides: u32) -> Shape {
    let mut shape = Shape { normals: Some(Vec::new()), ..Shape::default() };
    for side in 0..=sides {
        let (sin, cos) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
        for end in [-0.5, 0.5] {
            let normal = DVec3::new(cos, sin, 0.0);
            shape.positions.push((radius * normal + DVec3::Z * end * length).as_vec3().to_array());
            shape.normals.get_or_insert_default().push(normal.as_vec3().to_array());
        }
    }
    for side in 0..sides {
        let [a, b, c, d] = [0, 1, 3, 2].map(|corner| 2 * side + corner);
        shape.triangles.extend([[a, b, c], [a, c, d]]);
    }
    shape
}

/// Corners send sound back from wherever it comes: `20 log(a^2 / (sqrt(3) wavelength))` along the axis of one of three
/// triangles with edges `a`, `20 log(sqrt(2) a b / wavelength)` for two plates (Knott, Shaeffer and Tuley 2004, table 6.1,
/// with the target strength as a 4 pi-th of the radar cross-section).
#[test]
fn corners_send_back() {
    let edge = 0.3;
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * edge);
    let corner = [[x, y], [y, z], [z, x]].map(|[a, b]| Shape::triangle([DVec3::ZERO, a, b]));
    let corner = corner.into_iter().reduce(Shape::and).unwrap();
    let expected = 20.0 * (edge * edge / (3f64.sqrt() * WAVELENGTH)).log10();
    let towards = DQuat::from_rotation_arc(DVec3::ONE.normalize(), DVec3::NEG_X);
    assert_near("trihedral", strength(corner.clone(), 100.0, towards), expected, 1.0);
    // From 10 degrees beside, too, it is within 2 dB.
    let beside = DQuat::from_rotation_z(10f64.to_radians()) * towards;
    assert_near("trihedral from beside", strength(corner, 100.0, beside), expected, 2.0);

    let (a, b) = (0.1, 0.15);
    let plates =
        Shape::quad(DVec3::ZERO, DVec3::X * a, DVec3::Z * b).and(Shape::quad(DVec3::ZERO, DVec3::Y * a, DVec3::Z * b));
    let expected = 20.0 * (2f64.sqrt() * a * b / WAVELENGTH).log10();
    let towards = DQuat::from_rotation_arc(DVec3::new(1.0, 1.0, 0.0).normalize(), DVec3::NEG_X);
    assert_near("dihedral", strength(plates.clone(), 100.0, towards), expected, 1.0);
    let beside = DQuat::from_rotation_z(12f64.to_radians()) * towards;
    // Of what is seen of both plates the narrower counts.
    let narrower = 20.0 * ((45f64 - 12.0).to_radians().sin() / 45f64.to_radians().sin()).log10();
    assert_near("dihedral from beside", strength(plates, 100.0, beside), expected + narrower, 1.5);
}
