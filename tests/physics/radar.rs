//! Radars: whole scans against the radar equation, closed forms of cross-sections, images in mirrors, and statistics.

mod bad;
mod clutter;
mod equation;
mod media;
mod multipath;
mod noise;
mod polarisation;
mod targets;

use super::assert_near;
use echocast::radar::{RadarCube, RadarRecord};
use echocast::scene::Material;
use echocast::{
    BuiltScene, Engine, FieldSet, LiveScene, PathType, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory,
};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DAffine3, DQuat, DVec3};
use std::f64::consts::PI;

/// Middle of the sampled band: 76.872 GHz and half of 256 MHz.
const WAVELENGTH: f64 = 299_792_458.0 / 77e9;
/// `c / 2B` with 256 MHz.
const STEP: f64 = 299_792_458.0 / 512e6;
/// Greatest unambiguous range rate, m/s: `lambda / (4 T_r)` with chirps every 25.6 us.
const FASTEST: f64 = WAVELENGTH / (4.0 * 25.6e-6);

/// 256 MHz in 256 samples at 10 MHz, 128 chirps without a pause: 3.2768 ms. One element of 0 dBi, 42 dBm, noise figure
/// 14 dB, unless `more` says otherwise, `key=value` after `key=value`.
fn radar(more: &str) -> Sensor {
    let yaml = "
name: radar
kind: radar
pattern: {type: radar, azimuth_deg: [-60, 60], elevation_deg: [-20, 20], rate_hz: 20}
range: {min_m: 1, max_m: 140}
radar:
  power_dbm: 42
  noise_figure_db: 14
  waveform: {type: fmcw, start_ghz: 76.872, slope_mhz_per_us: 10, samples: 256, sample_rate_mhz: 10, ramp_us: 25.6, chirps: 128}
  array: {gain_error_db: 0, phase_error_deg: 0}
  clutter: false
";
    let mut sensor = Sensor::from_yaml(yaml, "").unwrap();
    for assignment in more.split_whitespace() {
        let (key, value) = assignment.split_once('=').unwrap();
        // YAML wants spaces after colons, which would end the value.
        sensor.set(key, &value.replace(':', ": ")).unwrap();
    }
    sensor
}

/// Four columns and four rows of receivers half a wavelength apart.
const SQUARE: &str = "radar.array.rx={count:4,rows:4,step:1,row_step:1}";

fn options() -> ScanOptions {
    ScanOptions::default().fields(FieldSet::all()).seed(7)
}

fn material(radar: &str) -> Material {
    Material::from_yaml(&format!("{{name: surface, radar: {{{radar}}}}}")).unwrap()
}

const METAL: &str = "law: metal";

/// Shapes and what they are made of, each an instance of its own, from 1.
fn scene(objects: impl IntoIterator<Item = (Shape, &'static str)>) -> BuiltScene {
    scene_on(&Engine::new().unwrap(), objects)
}

fn scene_on(engine: &Engine, objects: impl IntoIterator<Item = (Shape, &'static str)>) -> BuiltScene {
    standing(objects).build_with(engine).unwrap()
}

fn standing(objects: impl IntoIterator<Item = (Shape, &'static str)>) -> Scene {
    let mut scene = SceneBuilder::new();
    for (shape, radar) in objects {
        let material = scene.material(material(radar));
        scene.stand(shape, Some(material));
    }
    scene.finish()
}

/// A scene whose only object moves at `velocity`, m/s, and is where its coordinates say at the middle of a frame.
fn moving(shape: Shape, velocity: DVec3) -> BuiltScene {
    let mut live = LiveScene::new(&Engine::new().unwrap());
    let object = live.add_scene(&standing([(shape, METAL)])).unwrap()[0];
    let middle = 0.5 * 128.0 * 25.6e-6;
    let at = |time: f64| (time, DAffine3::from_translation(velocity * (time - middle)));
    live.set_motion(object, &[at(0.0), at(0.1)]).unwrap();
    live.set_time(0.0, 0.1).unwrap();
    live.commit().unwrap()
}

/// Three triangles at right angles with edges of `a` m that meet at `apex` and open towards -x.
fn trihedral(a: f64, apex: DVec3) -> Shape {
    let turn = DQuat::from_rotation_arc(DVec3::ONE.normalize(), DVec3::NEG_X);
    let at = |place: DVec3| (apex + turn * place * a).as_vec3().to_array();
    Shape {
        positions: [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(at).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1]],
        ..Shape::default()
    }
}

/// A shape turned and moved.
fn placed(shape: Shape, place: DAffine3) -> Shape {
    let positions = shape.positions.iter().map(|&at| {
        let at = DVec3::from_array(at.map(f64::from));
        place.transform_point3(at).as_vec3().to_array()
    });
    let turned = |normal: &[f32; 3]| place.transform_vector3(DVec3::from_array(normal.map(f64::from)));
    let normals = shape.normals.as_ref();
    let normals = normals.map(|all| all.iter().map(|normal| turned(normal).as_vec3().to_array()).collect());
    Shape { positions: positions.collect(), normals, ..shape }
}

fn scan(scene: &BuiltScene, sensor: &Sensor, options: &ScanOptions) -> PointCloud {
    scene.scan(sensor, &Trajectory::fixed(Pose::IDENTITY), options).unwrap()
}

/// A frame with its cube.
fn cube(scene: &BuiltScene, sensor: &Sensor, options: &ScanOptions) -> RadarCube {
    let record = RadarRecord { cube: true, samples: false };
    let (pose, mut cloud) = (Trajectory::fixed(Pose::IDENTITY), PointCloud::default());
    scene.radar_frame(sensor, &pose, options, record, &mut cloud).unwrap().cube.unwrap()
}

/// Power in the cell of the first channel nearest to a range and a range rate, W.
fn cell(cube: &RadarCube, range: f64, rate: f64) -> f64 {
    let [column, row] = [cube.axes.range.cells(range), cube.axes.velocity.cells(rate)].map(|at| at.round() as usize);
    f64::from(cube.cells[row * cube.axes.range.len + column].norm_sqr())
}

/// The row of the strongest detection that `is` of interest.
fn strongest(cloud: &PointCloud, is: impl Fn(usize) -> bool) -> Option<usize> {
    let power = cloud.columns().power();
    (0..cloud.len()).filter(|&row| is(row)).max_by(|&a, &b| power[a].total_cmp(&power[b]))
}

/// The row of the strongest detection.
fn first(cloud: &PointCloud) -> usize {
    strongest(cloud, |_| true).expect("a detection")
}

fn path(cloud: &PointCloud, row: usize) -> PathType {
    PathType::from_number(cloud.columns().path()[row]).unwrap()
}

fn db(power: f64) -> f64 {
    10.0 * power.log10()
}

/// Power of the echo of `area` m^2 at `range` m for transmitters of `power_dbm` and 0 dBi, W:
/// `P lambda^2 sigma / ((4 pi)^3 R^4)` (Skolnik 2008, Radar Handbook, eq. 1.8).
fn echo(power_dbm: f64, area: f64, range: f64) -> f64 {
    let sent = 1e-3 * 10f64.powf(0.1 * power_dbm);
    sent * WAVELENGTH * WAVELENGTH * area / ((4.0 * PI).powi(3) * range.powi(4))
}
