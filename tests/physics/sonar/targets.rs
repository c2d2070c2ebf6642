//! What answers as a whole: told targets, heard whether rays meet them or not.

use super::{ping, set, water};
use crate::assert_near;
use echocast::material::Sound;
use echocast::scene::Material;
use echocast::{Environment, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DVec3};

/// A ball of 10 cm and 0 dB at each place, and something else to be met behind them.
fn balls(places: &[DVec3], wall: Option<Shape>) -> echocast::BuiltScene {
    let mut scene = SceneBuilder::new();
    let told = Sound::Target { strength_db: 0.0 };
    let ball = scene.material(Material::default().name("ball").sound(told));
    let mesh = scene.mesh([(Shape::sphere(0.05, 12), Some(ball))]);
    for &place in places {
        scene.place(mesh, DAffine3::from_translation(place));
    }
    if let Some(wall) = wall {
        scene.stand(wall, None);
    }
    scene.finish().build().unwrap()
}

/// Presets, the beam that is looked along, and how much of the pressure is sent there and heard from there: all of it.
const SONARS: [(&str, usize); 4] = [("sss_450", 0), ("mbes_400", 128), ("fls_900", 256), ("sbes_200", 0)];

/// A sonar without noise.
fn quiet(name: &str) -> Sensor {
    set(Sensor::preset(name).unwrap(), "acoustics.noise_level_db=-200 range.min_m=0.5")
}

/// Unit vector along a beam.
fn axis(sensor: &Sensor, beam: usize) -> DVec3 {
    let scene = balls(&[DVec3::X * 1e4], None);
    let [azimuth, elevation] =
        ping(&scene, sensor, Pose::at(0.0, 0.0, 0.0), &options("")).layout().axes[beam].map(f64::from);
    DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
}

fn options(more: &str) -> ScanOptions {
    ScanOptions::default().environment(water(more))
}

/// Loudest level of any cell, dB, and where it is: beam and range.
fn loudest(ping: &echocast::Ping) -> (f64, usize, f64) {
    let bins = ping.layout().bins;
    let (cell, level) = ping.cells().intensity().iter().enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b)).unwrap();
    (f64::from(*level), cell / bins, ping.layout().range(cell % bins))
}

/// The sonar equation of a point target (Urick 1983, section 2.1) on the axis: `SL - 40 log r + TS`.
#[test]
fn a_target_on_the_axis_is_never_lost_and_as_loud_as_it_is_told() {
    for (name, beam) in SONARS {
        let sensor = quiet(name);
        let along = axis(&sensor, beam);
        let source = sensor.acoustics().unwrap().source_level_db;
        for step in 0..51 {
            // From 10 to 18 m, each time between other rays.
            let range = 10.0 + 0.163 * f64::from(step);
            let scene = balls(&[along * range], None);
            let found = ping(&scene, &sensor, Pose::at(0.0, 0.0, 0.0), &options("").frame(step));
            let (level, _, at) = loudest(&found);
            // At the side of the ball that faces the sonar.
            let near = range - 0.05;
            assert_near(&format!("{name}: level at {range} m"), level, source - 40.0 * near.log10(), 1.0);
            assert!(
                at > near - 1.5 * found.layout().bin_m && at < range + found.layout().bin_m,
                "{name}: at {at} m, not {near}"
            );
        }
    }
}

/// Sound that bends gets to a target as light would not: it is heard where a straight line passes the bed, and not behind
/// what its ray meets.
#[test]
fn targets_are_seen_along_the_rays_of_sound() {
    let sensor = quiet("fls_900");
    let water = "water: {surface_z_m: 5, absorption: none, wind_m_s: 0, profile: {cast: [{depth_m: 0, speed_m_s: 1540}, \
                 {depth_m: 40, speed_m_s: 1440}]}}";
    let options = || ScanOptions::default().environment(Environment::from_yaml(water).unwrap());
    let place = DVec3::new(38.0, 1.0, -12.0);
    let along = place.normalize();
    let hear = |wall: Option<Shape>| {
        let found = ping(&balls(&[place], wall), &sensor, Pose::at(0.0, 0.0, 0.0), &options());
        let bins = found.layout().bins;
        let near = |cell: &usize| (found.layout().range(cell % bins) - place.length()).abs() < 1.0;
        let cells = (0..found.cells().intensity().len()).filter(near);
        cells.map(|cell| f64::from(found.cells().intensity()[cell])).fold(f64::MIN, f64::max)
    };
    let open = hear(None);
    assert_near("level", open, 210.0 - 40.0 * place.length().log10(), 3.0);
    // Sound comes from above the straight line, 0.5 m at half the way.
    let half = 0.5 * place;
    let plate = |up: f64| Shape::plate(half + DVec3::Z * up, -along, 0.4);
    assert!((hear(Some(plate(-0.35))) - open).abs() < 0.1, "the straight line is no way of sound");
    assert!(hear(Some(plate(0.45))) < open - 20.0, "a wall across the ray");
}

/// What is larger than its distance is no point.
#[test]
fn a_target_about_the_sonar_is_refused() {
    let error = balls(&[DVec3::X * 0.03], None)
        .ping(&quiet("sss_450"), &Trajectory::fixed(Pose::at(0.0, 0.0, 0.0)), &options(""))
        .unwrap_err()
        .to_string();
    assert!(error.starts_with("sound.law is target, of a mesh of the material \"ball\""), "{error}");
}
