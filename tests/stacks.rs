//! How much stack builds and scans use: of a host's thread that does all the work itself, and of an engine's threads.
//! Alone in its file, where nothing else has stacks of the same size.

#![cfg(target_os = "linux")]

use echocast::{
    Engine, Environment, FieldSet, PointCloud, Pose, ScanOptions, Scenario, Scene, Sensor, SensorKind, Trajectory,
};
use std::fmt::Write as _;
use std::fs;
use std::ops::Range;
use std::path::Path;

/// What `docs/embedding.md` and the C header guarantee for the calling thread.
const CALLER_KIB: usize = 256;

/// A quarter of what an engine's threads have.
const WORKER_KIB: usize = 512;

/// How much of the stack that each of `addresses` is in has been touched, KiB: the maximum.
fn deepest(addresses: &[usize]) -> usize {
    touched(|range| addresses.iter().any(|address| range.contains(address)))
}

/// The most memory resident in any mapping that is `wanted`, KiB.
fn touched(wanted: impl Fn(&Range<usize>) -> bool) -> usize {
    let maps = fs::read_to_string("/proc/self/smaps").unwrap();
    let (mut is_wanted, mut most) = (false, 0);
    for line in maps.lines() {
        let mut words = line.split_whitespace();
        let (Some(first), Some(second)) = (words.next(), words.next()) else { continue };
        if let Some((from, to)) = first.split_once('-') {
            let [from, to] = [from, to].map(|text| usize::from_str_radix(text, 16).unwrap());
            is_wanted = second == "rw-p" && wanted(&(from..to));
        } else if first == "Rss:" && is_wanted {
            most = most.max(second.parse().unwrap());
        }
    }
    assert!(most > 0, "no stack is found");
    most
}

/// An address in the stack of this thread.
#[inline(never)]
fn here() -> usize {
    let local = 0u8;
    std::hint::black_box(&raw const local).addr()
}

/// Does `work` on a separate thread and returns how much of its stack was touched, KiB.
fn caller(work: impl FnOnce() + Send) -> usize {
    let on_its_own = || {
        work();
        deepest(&[here()])
    };
    std::thread::scope(|scope| scope.spawn(on_its_own).join().unwrap())
}

/// The most that has been touched of the stacks of engines' threads, KiB. They cannot be asked where they are; the size of
/// their stacks identifies them.
fn workers() -> usize {
    touched(|range| (2047 << 10..=2053 << 10).contains(&range.len()))
}

/// Every preset, and sensors that do more than those.
fn sensors() -> Vec<(String, Sensor)> {
    let mut all: Vec<(String, Sensor)> =
        Sensor::presets().iter().map(|preset| (preset.name.clone(), Sensor::preset(&preset.name).unwrap())).collect();
    for (name, preset, settings) in [
        (
            "all returns of 16 rays",
            "velodyne_vlp16",
            &[("returns", "{mode: all, max: 5}"), ("beam.sub_rays", "16")][..],
        ),
        ("blooming", "velodyne_vlp16", &[("detection.blooming", "{weight: 0.1, width_deg: 1, floor: 0.001}")]),
        ("multipath", "kinect_v2", &[("beam.sub_rays", "1"), ("tof.multipath_rays", "4")]),
    ] {
        let mut sensor = Sensor::preset(preset).unwrap();
        settings.iter().for_each(|(key, value)| sensor.set(key, value).unwrap());
        all.push((name.to_owned(), sensor));
    }
    let dense = "{name: dense, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 300, step_deg: 0.5}, elevation: \
                 {fov_deg: 90, step_deg: 0.1}}}";
    all.push(("dense".to_owned(), Sensor::from_yaml(dense, ".").unwrap()));
    all
}

/// All that a host does with a sensor, on `engine`: a scene from a file is built and scanned, several times if there
/// are threads, which share the work differently each time.
fn use_sensor(engine: &Engine, sensor: &Sensor) {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/scenes/glass.gltf")).unwrap();
    let built = scene.build_with(engine).unwrap();
    let environment = match sensor.kind() {
        SensorKind::Sonar => "water: {surface_z_m: 50}",
        _ => "{rain: {rate_mm_h: 20}, fog: {visibility_m: 60}}",
    };
    let environment = Environment::from_yaml(environment).unwrap();
    let options = ScanOptions { fields: FieldSet::all(), environment, ..ScanOptions::default() };
    let mut cloud = PointCloud::default();
    for _ in 0..engine.threads().min(2) {
        built.scan_into(sensor, &Trajectory::fixed(Pose::at(0.0, 0.0, 1.0)), &options, &mut cloud).unwrap();
    }
}

/// A ground with enough triangles that all building threads are called, as a part of it again and again.
#[test]
fn building_takes_little_stack() {
    let side = 400;
    let mut obj = String::new();
    for (i, j) in (0..=side).flat_map(|i| (0..=side).map(move |j| (i, j))) {
        writeln!(obj, "v {i} {j} {}", (f64::from(i) * 0.1).sin() * (f64::from(j) * 0.2).cos()).unwrap();
    }
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        let a = i * (side + 1) + j + 1;
        let b = a + side + 1;
        writeln!(obj, "f {a} {b} {c} {d}", c = b + 1, d = a + 1).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ground.obj");
    fs::write(&path, obj).unwrap();
    let scene = Scene::load(&path).unwrap();
    let alone = caller(|| drop(scene.build_with(&Engine::with_threads(1).unwrap()).unwrap()));
    let engine = Engine::with_threads(64).unwrap();
    for _ in 0..3 {
        scene.build_with(&engine).unwrap();
    }
    let helped = workers();
    println!("a build takes {alone} KiB of stack alone, {helped} KiB of threads that help");
    assert!(alone <= CALLER_KIB && helped <= WORKER_KIB);
}

/// A scenario is read, a scene made and varied, with models that are placed, and scanned.
#[test]
fn samples_take_little_stack() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/scenes"));
    let street = "
        scene: {generate: {street: {cars: 3, people: 2}}}
        sensors: [{sensor: velodyne_vlp16}, {sensor: kinect_v2, set: {pattern.resolution: [64, 48]}}]
        trajectory: {on: {category: road}, height_m: 1.9, clearance_m: 1}
        variation:
          - {set: environment.rain.rate_mm_h, to: {log_uniform: [0.5, 20]}}
          - {set: 'sensors[0].set.noise', to: {choice: [{range_sigma_m: 0.01}, {range_sigma_m: 0.1}]}}
          - {move: 'Car_*', by_m: [{uniform: [-3, 3]}, 0, 0], turn_deg: {normal: [0, 3]}, drop: true}
          - {look: '*', of: 'Car_*', wetness: 1}
          - {place: glass.gltf, at: {on: {category: road}}, count: 3, align: slope, otherwise: fail}";
    let lake = "
        scene: {generate: {seabed: {size_m: [20, 20], cell_m: 0.2}}}
        sensors: [{sensor: mbes_400}]
        trajectory: {position_m: [0, 0, -1]}";
    let woods = "
        scene: {generate: {landscape: {size_m: [40, 40]}}}
        sensors: [{sensor: velodyne_vlp16}]
        trajectory: {on: {category: terrain}, height_m: 1.9}";
    for (name, text) in [("street", street), ("lake", lake), ("woods", woods)] {
        let alone = caller(|| {
            let scenario = Scenario::from_yaml(text, folder).unwrap();
            let mut sample = scenario.with_engine(&Engine::with_threads(1).unwrap()).sample(1).unwrap();
            (0..sample.scans().len()).for_each(|scan| drop(sample.cloud(scan, 0).unwrap()));
        });
        println!("{name}: {alone} KiB");
        assert!(alone <= CALLER_KIB, "{name}: {alone} KiB of the calling thread");
    }
}

#[test]
fn stacks_are_as_small_as_promised() {
    println!("{:28}{:>10}{:>10}{:>10} KiB of stack with 1, 2 and 64 threads", "", 1, 2, 64);
    let mut most = [0; 3];
    for (name, sensor) in sensors() {
        let alone = caller(|| use_sensor(&Engine::with_threads(1).unwrap(), &sensor));
        let [two, many] = [2, 64].map(|threads| {
            let engine = Engine::with_threads(threads).unwrap();
            use_sensor(&engine, &sensor);
            workers()
        });
        println!("{name:28}{alone:>10}{two:>10}{many:>10}");
        most = [most[0].max(alone), most[1].max(two), most[2].max(many)];
    }
    let [alone, two, many] = most;
    println!("{:28}{alone:>10}{two:>10}{many:>10}", "most");
    assert!(alone <= CALLER_KIB, "{alone} KiB of the calling thread");
    assert!(two.max(many) <= WORKER_KIB, "{two} and {many} KiB of threads of an engine");
}
