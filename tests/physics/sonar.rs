//! Pings: levels by the sonar equation, geometry, statistics.

mod bodies;
mod doppler;
mod dvl;
mod explain;
mod levels;
mod noise;
mod places;
mod points;
mod soundings;
mod speckle;
mod targets;

use super::assert_near;
use echocast::emitter::lobe::Lobe;
use echocast::material::Sound;
use echocast::scene::Material;
use echocast::{BuiltScene, Environment, FieldSet, Ping, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

/// A flat bottom at z = 0 of Lambert's law with mu 0.1, in pieces of `cell` m.
fn flat(cell: f64) -> BuiltScene {
    bottom(Sound::Lambert { mu_db: -10.0 }, cell)
}

/// A square of 400 m at z = 0, in pieces of `cell` m.
fn square(cell: f64) -> Shape {
    let count = (400.0 / cell) as u32;
    let mut shape = Shape::default();
    for i in 0..=count {
        for j in 0..=count {
            let [x, y] = [i, j].map(|index| (f64::from(index) * cell - 200.0) as f32);
            shape.positions.push([x, y, 0.0]);
        }
    }
    for i in 0..count {
        for j in 0..count {
            let corner = i * (count + 1) + j;
            let (right, up) = (corner + count + 1, corner + 1);
            shape.triangles.extend([[corner, right, up], [right, right + 1, up]]);
        }
    }
    shape
}

fn sounding_material(sound: Sound) -> Material {
    Material::default().name(format!("{sound:?}")).sound(sound)
}

/// A flat bottom at z = 0.
fn bottom(sound: Sound, cell: f64) -> BuiltScene {
    with_bottom(sound, cell, [])
}

/// A flat bottom at z = 0, and objects on it, of Lambert's law with mu 0.1: category 1, then 2 and so on.
fn with_bottom(sound: Sound, cell: f64, others: impl IntoIterator<Item = Shape>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.material(sounding_material(sound));
    scene.stand(square(cell), Some(paint));
    let other = scene.material(sounding_material(Sound::Lambert { mu_db: -10.0 }));
    for shape in others {
        scene.stand(shape, Some(other));
    }
    scene.finish().build().unwrap()
}

/// Something behind the sonar and out of its reach: a sea without an echo.
fn nothing() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::plate(DVec3::Z * -5000.0, DVec3::Z, 1.0), None);
    scene.finish().build().unwrap()
}

/// Water up to 50 m above the bottom, of 1500 m/s, without absorption and noise.
fn water(more: &str) -> Environment {
    let water = "surface_z_m: 50, absorption: none, wind_m_s: 0, profile: {constant: {speed_m_s: 1500}}";
    Environment::from_yaml(&format!("water: {{{water}{more}}}")).unwrap()
}

fn sidescan(more: &str) -> Sensor {
    let yaml = "
name: side
kind: sonar
pattern: {type: sidescan, sides: starboard, tilt_deg: 30, vertical_deg: 50, along_deg: 0.5, rays: 4096, rate_hz: 5}
acoustics: {frequency_khz: 450, source_level_db: 220, bandwidth_khz: 15, noise_level_db: -200, speckle: off}
range: {max_m: 100}
";
    set(Sensor::from_yaml(yaml, "").unwrap(), more)
}

/// Any sonar; the acoustics of `sidescan`.
fn sonar(pattern: &str, more: &str) -> Sensor {
    let yaml = format!(
        "
name: sonar
kind: sonar
pattern: {{{pattern}, rate_hz: 5}}
acoustics: {{frequency_khz: 450, source_level_db: 220, bandwidth_khz: 15, noise_level_db: -200, speckle: off}}
range: {{max_m: 100}}
"
    );
    set(Sensor::from_yaml(&yaml, "").unwrap(), more)
}

/// Applies `more`, `key=value` after `key=value`.
fn set(mut sensor: Sensor, more: &str) -> Sensor {
    for assignment in more.split_whitespace() {
        let (key, value) = assignment.split_once('=').unwrap();
        sensor.set(key, value).unwrap();
    }
    sensor
}

fn options(environment: Environment) -> ScanOptions {
    ScanOptions::default().fields(FieldSet::all()).environment(environment)
}

fn ping(scene: &BuiltScene, sensor: &Sensor, pose: Pose, options: &ScanOptions) -> Ping {
    scene.ping(sensor, &Trajectory::fixed(pose), options).unwrap()
}

fn power(level_db: f64) -> f64 {
    10f64.powf(level_db / 10.0)
}

fn db(power: f64) -> f64 {
    10.0 * power.log10()
}

/// Mean level of the bins around `range`, dB.
fn level(ping: &Ping, beam: usize, range: f64, around: f64) -> f64 {
    let layout = &ping.layout();
    let bins = ((range - around) / layout.bin_m) as usize..((range + around) / layout.bin_m) as usize;
    db(ping.levels(beam)[bins.clone()].iter().map(|&level| power(level.into())).sum::<f64>() / bins.len() as f64)
}

/// Level of a flat bottom `height` m below: sonar equation with the area of a resolution cell, by quadrature of the
/// beam.
fn flat_level(height: f64, range: f64) -> f64 {
    let wavelength = 1500.0 / 450e3;
    let (along, vertical) = (Lobe::Width(0.5).at(wavelength), Lobe::Width(50.0).at(wavelength));
    let steps = 20_000;
    let step = 0.2 / f64::from(steps);
    let width: f64 = (0..steps).map(|i| along.amplitude((f64::from(i) * step - 0.1).sin()).powi(4) * step).sum();
    let grazing = (height / range).asin();
    let beam = vertical.amplitude((grazing - 30f64.to_radians()).sin()).powi(4);
    let area = range * width * (0.5 * 1500.0 / 15e3) / grazing.cos();
    220.0 - 40.0 * range.log10() + 10.0 * (0.1 * grazing.sin().powi(2) * area * beam).log10()
}

#[test]
fn a_flat_bottom_has_the_level_of_the_sonar_equation() {
    let scene = flat(100.0);
    let ping = ping(&scene, &sidescan(""), Pose::at(0.0, 0.0, 20.0), &options(water("")));
    assert_eq!((ping.layout().beams(), ping.layout().bin_m), (1, 0.025));
    for range in [22.0, 25.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0] {
        assert_near(&format!("level at {range} m"), level(&ping, 0, range, 0.25), flat_level(20.0, range), 0.1);
    }
    // Nothing before the bottom and its sidelobes in range.
    assert!(ping.levels(0)[..780].iter().all(|&level| level < -150.0));
}
