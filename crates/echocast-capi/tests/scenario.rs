//! Samples of a scenario made by C, C++ and Python are those made by Rust and written by `echocast run`, bit by bit.

mod common;

use common::{compilers, folder, program, run, source};
use echocast::scenario::set::{self, RunOptions};
use echocast::{Engine, PointCloud, Scenario};
use std::path::Path;
use std::process::Command;
use std::{env, fs};

/// Cars that drive past a rig of two, in rain; and a sonar.
const STREET: &str = "\
scene: {generate: {street: {cars: 2, seconds: 8}, seed: 3}}
sensors:
  - {name: top, sensor: velodyne_vlp16, set: {noise.range_sigma_m: 0.02}}
  - {name: camera, sensor: kinect_v2, set: {pattern.resolution: [32, 24]}, mount: {position_m: [0.5, 0, -0.3]},
     rate_hz: 30, start_s: 0.01}
trajectory: {on: {category: road}, height_m: 1.9, clearance_m: 0.5}
frames: {first: 0, last: 1}
fields: [default, velocity, true_range]
samples: 6
seed: 5
outputs: [{style: plain, format: las}]
variation:
  - {move: \"Car_*\", by_m: [{uniform: [-3, 3]}, 0, 0]}
  - {remove: \"Tree_*\", chance: 0.4}
  - {set: environment.rain.rate_mm_h, to: {log_uniform: [0.5, 20]}}
  - {set: sensors.top.set.noise.range_sigma_m, to: {uniform: [0.01, 0.1]}}
";
const LAKE: &str = "\
scene: {generate: {seabed: {size_m: [20, 20], cell_m: 0.5}}}
sensors: [{name: swath, sensor: mbes_400}]
trajectory: {position_m: [0, 0, -1]}
frames: {first: 0, last: 1}
samples: 2
outputs: [{style: plain, format: las}]
variation:
  - {set: environment.water.temperature_c, to: {uniform: [4, 20]}}
";

/// The bytes of all columns, one after the other.
fn bytes(cloud: &PointCloud) -> Vec<u8> {
    cloud.fields().iter().flat_map(|info| cloud.column(info.field).bytes().iter().copied()).collect()
}

/// Compares what a program has written to `made` with the samples of Rust; drawn values are compared as text, or by
/// value if the program formats them differently (`other_numbers`).
fn compare(scenario: &Scenario, written: &Path, made: &Path, other_numbers: bool) {
    let mut points = 0;
    for number in 0..scenario.samples() {
        let mut sample = scenario.sample(number).unwrap();
        let drawn = serde_json::Value::Array(sample.drawn().to_vec());
        let recorded = fs::read_to_string(made.join(format!("{number}.json"))).unwrap();
        if other_numbers {
            assert_eq!(serde_json::from_str::<serde_json::Value>(&recorded).unwrap(), drawn);
        } else {
            assert_eq!(recorded, drawn.to_string());
        }
        for scan in 0..sample.scans().len() {
            let name = sample.scans()[scan].name().to_owned();
            let frames = sample.scans()[scan].frames().to_vec();
            for (frame, time) in frames.iter().enumerate() {
                let cloud = sample.cloud(scan, frame).unwrap();
                points += cloud.len();
                let stem = format!("{number}_{name}_{frame}");
                assert!(fs::read(made.join(format!("{stem}.columns"))).unwrap() == bytes(&cloud), "{stem}");
                let by_run = written.join(format!("data/{number:06}/{name}_{:04}.las", time.number));
                assert!(fs::read(made.join(format!("{stem}.las"))).unwrap() == fs::read(by_run).unwrap(), "{stem}");
            }
        }
    }
    assert!(points > 500, "{points}");
}

#[test]
fn samples_are_those_of_rust_and_of_the_program() {
    let folder = folder("samples");
    let [[c, cpp], ..] = compilers()[..] else { unreachable!("there is a compiler") };
    let in_c = program(&folder, c, &["-std=c99"], &[source("samples.c")]);
    fs::create_dir(folder.join("cpp")).unwrap();
    let in_cpp = program(&folder.join("cpp"), cpp, &["-std=c++11"], &[source("samples.cpp")]);
    for (name, text) in [("street", STREET), ("lake", LAKE)] {
        let file = folder.join(format!("{name}.yaml"));
        fs::write(&file, text).unwrap();
        let load = || Scenario::load(&file).unwrap();
        let written = folder.join(format!("{name}-run"));
        let options = RunOptions::default().folder(written.clone()).samples(None).shard(None).resume(false).threads(2);
        assert!(set::run(load(), &options, &|_| ()).unwrap().failed.is_empty());
        let scenario = load().with_engine(&Engine::with_threads(2).unwrap());
        let compiled = [(&in_c, "1"), (&in_c, "3"), (&in_cpp, "1"), (&in_cpp, "2")];
        let mut programs: Vec<_> =
            compiled.map(|(program, threads)| (Command::new(program), threads, false)).into_iter().collect();
        // Where the wheel is installed, as in `make test`.
        if let Some(python) = env::var_os("ECHOCAST_WHEEL_PYTHON") {
            let mut command = Command::new(python);
            command.arg(source("samples.py"));
            // It formats numbers differently: 1e-05.
            programs.push((command, "2", true));
        }
        for (number, (mut program, threads, other_numbers)) in programs.into_iter().enumerate() {
            let made = folder.join(format!("{name}-{number}"));
            fs::create_dir(&made).unwrap();
            let output = run(program.arg(&made).arg(&file).arg(threads));
            assert_eq!(String::from_utf8_lossy(&output.stdout), "passed\n");
            compare(&scenario, &written, &made, other_numbers);
        }
    }
}
