//! How much stack a scan takes: of a host's thread that does all the work itself, and of the threads of an engine. Alone in
//! its file: stacks of this process are told apart by their size.

#![cfg(target_os = "linux")]

use echocast::{Engine, Environment, FieldSet, PointCloud, Pose, ScanOptions, Scene, Sensor, SensorKind, Trajectory};
use std::fs;
use std::ops::RangeInclusive;

/// What `docs/embedding.md` and the C header promise of the thread that calls.
const CALLER_KIB: usize = 256;

/// A fourth of what threads of an engine have.
const WORKER_KIB: usize = 512;

/// Stack of the calling threads here, which nobody else has.
const OWN_KIB: usize = 3000;

/// The most that has been touched of any stack whose size is among `sizes`, both KiB.
fn deepest(sizes: RangeInclusive<usize>) -> usize {
    let maps = fs::read_to_string("/proc/self/smaps").unwrap();
    let (mut is_stack, mut most) = (false, 0);
    for line in maps.lines() {
        let mut words = line.split_whitespace();
        let (Some(first), Some(second)) = (words.next(), words.next()) else { continue };
        if let Some((from, to)) = first.split_once('-') {
            let [from, to] = [from, to].map(|text| usize::from_str_radix(text, 16).unwrap());
            is_stack = second == "rw-p" && sizes.contains(&((to - from) >> 10));
        } else if first == "Rss:" && is_stack {
            most = most.max(second.parse().unwrap());
        }
    }
    most
}

/// Does `work` on a thread of its own and says how much of its stack that has touched, KiB.
fn caller(work: impl FnOnce() + Send) -> usize {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(OWN_KIB << 10).spawn_scoped(scope, || {
            work();
            deepest(OWN_KIB - 16..=OWN_KIB + 16)
        });
        let kib = thread.unwrap().join().unwrap();
        assert!(kib > 0, "the stack of the thread is not found");
        kib
    })
}

/// Every preset, and sensors that do more than those.
fn sensors() -> Vec<(String, Sensor)> {
    let mut all: Vec<(String, Sensor)> = Sensor::presets()
        .iter()
        .map(|preset| (preset.name.to_owned(), Sensor::preset(preset.name).unwrap()))
        .collect();
    for (name, preset, settings) in [
        ("all returns of 16 rays", "velodyne_vlp16", &[("returns", "{mode: all, max: 5}"), ("beam.sub_rays", "16")][..]),
        ("blooming", "velodyne_vlp16", &[("detection.blooming", "{weight: 0.1, width_deg: 1, floor: 0.001}")]),
        ("multipath", "kinect_v2", &[("tof.multipath_rays", "4")]),
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

/// All that a host does with a sensor, on `engine`: a scene from a file is built and scanned, some times where there are
/// threads, which share the work in another way each time.
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
    for _ in 0..engine.threads().min(3) {
        built.scan_into(sensor, &Trajectory::fixed(Pose::at(0.0, 0.0, 1.0)), &options, &mut cloud).unwrap();
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
            deepest(2040..=2056)
        });
        println!("{name:28}{alone:>10}{two:>10}{many:>10}");
        most = [most[0].max(alone), most[1].max(two), most[2].max(many)];
    }
    let [alone, two, many] = most;
    println!("{:28}{alone:>10}{two:>10}{many:>10}", "most");
    assert!(alone <= CALLER_KIB, "{alone} KiB of the calling thread");
    assert!(two.max(many) <= WORKER_KIB, "{two} and {many} KiB of threads of an engine");
}
