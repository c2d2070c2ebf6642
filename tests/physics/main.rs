//! Laws: scenes whose answer is a formula, and tables made elsewhere from the formulas.

mod baked;
mod beams;
mod boxes;
mod cameras;
mod closed;
mod detection;
mod doppler;
mod extremes;
mod flow;
mod fog;
mod geometry;
mod instruments;
mod intensity;
mod motion;
mod moving;
mod multipath;
mod noise;
mod origins;
mod paths;
mod patterns;
mod primitives;
mod printed;
mod radar;
mod rays;
mod returns;
mod sonar;
mod surfaces;
mod survey;
mod water;
mod weather;

use echocast::{BuiltScene, Environment, FieldSet, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::DVec3;

/// Scans with `sensor` at the world's origin and all columns.
fn scan(scene: &BuiltScene, sensor: &Sensor, options: ScanOptions) -> PointCloud {
    scan_at(scene, sensor, Pose::IDENTITY, options)
}

fn scan_at(scene: &BuiltScene, sensor: &Sensor, pose: Pose, options: ScanOptions) -> PointCloud {
    scene.scan(sensor, &Trajectory::fixed(pose), &options.fields(FieldSet::all())).unwrap()
}

/// A target of `reflectance` that the x axis meets at `range` m, turned by `angle_deg` from head-on.
fn target(reflectance: f64, range: f64, angle_deg: f64) -> BuiltScene {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let along = DVec3::new(sin, cos, 0.0);
    let corners = [-along - DVec3::Z, along - DVec3::Z, 0.1 * along + 2.0 * DVec3::Z];
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(reflectance as f32);
    // As wide as the range requires: single precision keeps the direction of a small, distant triangle only roughly.
    let size = 0.1 * range;
    scene.stand(Shape::triangle(corners.map(|corner| DVec3::X * range + size * corner)), Some(paint));
    scene.finish().build().unwrap()
}

/// Scans with `sensor` in the environment of the text `yaml`.
fn in_weather(scene: &BuiltScene, sensor: &Sensor, yaml: &str) -> PointCloud {
    let environment = Environment::from_yaml(yaml).unwrap();
    scan(scene, sensor, ScanOptions::default().environment(environment))
}

/// Something far behind the sensor: a scene must not be empty.
fn nothing() -> BuiltScene {
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::plate(DVec3::new(-5000.0, 0.0, 0.0), DVec3::X, 1.0), None);
    scene.finish().build().unwrap()
}

/// A wall of a reflectance all around at `range` m, met head-on: a sphere of so many `rows`.
fn wall_all_around(reflectance: f64, range: f64, rows: u32) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(reflectance as f32);
    scene.stand(Shape::sphere(range, rows), Some(paint));
    scene.finish().build().unwrap()
}

/// Greatest number between two, to `step`, up to which `holds`, by bisection.
fn farthest([mut near, mut far]: [f64; 2], step: f64, holds: impl Fn(f64) -> bool) -> f64 {
    while far - near > step {
        let middle = (near + far) / 2.0;
        if holds(middle) { near = middle } else { far = middle }
    }
    near
}

fn mean_and_sigma(sample: &[f64]) -> (f64, f64) {
    let n = sample.len() as f64;
    let mean = sample.iter().sum::<f64>() / n;
    (mean, (sample.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt())
}

#[track_caller]
fn assert_near(what: &str, is: f64, expected: f64, tolerance: f64) {
    // Written so that NaN fails too.
    assert!((is - expected).abs() <= tolerance, "{what} is {is}, not {expected} +- {tolerance:.1e}");
}

/// Row `row` of three columns.
fn vector(x: &[f32], y: &[f32], z: &[f32], row: usize) -> DVec3 {
    DVec3::new(x[row].into(), y[row].into(), z[row].into())
}
