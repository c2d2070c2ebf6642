//! How much stack builds and scans use: of a host's thread that does all the work itself, and of an engine's threads.
//! Alone in its file, where nothing else takes processes' large pages away.

#![cfg(target_os = "linux")]

use echocast::emitter::lobe::Lobe;
use echocast::emitter::pattern::Pattern;
use echocast::generate::Generate;
use echocast::preview::PreviewOptions;
use echocast::scene::{Material, MaterialRules};
use echocast::{
    Engine, Environment, FieldSet, LabelRules, LoadOptions, PointCloud, Pose, ScanOptions, Scenario, Scene, Sensor,
    SensorKind, Trajectory,
};
use echocast_tests::different_presets;
use rustix::thread::disable_transparent_huge_pages;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Where the system makes large pages of memory as it pleases, all of a stack is there once some of it is touched: none
/// for this process, please.
fn without_huge_pages() {
    disable_transparent_huge_pages(true).unwrap();
}

/// What `docs/embedding.md` and the C header guarantee for the calling thread.
const CALLER_KIB: usize = 256;

/// A quarter of what an engine's threads have.
const WORKER_KIB: usize = 512;

/// How much of the stacks that `addresses` are in has been touched, KiB: the maximum, 0 of none.
fn deepest(addresses: &[usize]) -> usize {
    let maps = fs::read_to_string("/proc/self/smaps").unwrap();
    let (mut is_wanted, mut most) = (false, 0);
    for line in maps.lines() {
        let mut words = line.split_whitespace();
        let (Some(first), Some(second)) = (words.next(), words.next()) else { continue };
        if let Some((from, to)) = first.split_once('-') {
            let [from, to] = [from, to].map(|text| usize::from_str_radix(text, 16).unwrap());
            is_wanted = addresses.iter().any(|address| (from..to).contains(address));
        } else if first == "Rss:" && is_wanted {
            most = most.max(second.parse().unwrap());
        }
    }
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

/// The most that has been touched of the stacks of engines' threads, KiB: as the kernel shows where they wait for work. On a
/// busy machine all may be done before a thread begins, and has its name.
fn workers() -> usize {
    let tasks: Vec<_> = fs::read_dir("/proc/self/task").unwrap().map(|task| task.unwrap().path()).collect();
    let waits_at = |task: &PathBuf| {
        // One of an engine that another test has just dropped is gone.
        let name = fs::read_to_string(task.join("comm")).ok()?;
        while name.starts_with("echocast") {
            // The number of what it has called, six arguments, and the pointers to stack and code; or `running`.
            let call = fs::read_to_string(task.join("syscall")).ok()?;
            if let Some(stack) = call.split_whitespace().nth(7) {
                return usize::from_str_radix(stack.trim_start_matches("0x"), 16).ok();
            }
            std::thread::yield_now();
        }
        None
    };
    let addresses: Vec<usize> = tasks.iter().filter_map(waits_at).collect();
    deepest(&addresses)
}

/// Presets, and sensors that do more than those.
fn sensors() -> Vec<(String, Sensor)> {
    let mut all: Vec<(String, Sensor)> = Vec::new();
    for (info, mut sensor) in different_presets() {
        if let Pattern::RadarRotor(_) = sensor.spec().pattern {
            // A few rows of a turn go as deep as all of them.
            sensor.set("pattern.azimuths", "32").unwrap();
        }
        all.push((info.name, sensor));
    }
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
    let options = ScanOptions::default().fields(FieldSet::all()).environment(environment);
    let mut cloud = PointCloud::default();
    for _ in 0..engine.threads().min(2) {
        built.scan_into(sensor, &Trajectory::fixed(Pose::at(0.0, 0.0, 1.0)), &options, &mut cloud).unwrap();
    }
}

/// A ground with enough triangles that all building threads are called, as a part of it again and again.
#[test]
fn building_takes_little_stack() {
    without_huge_pages();
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
    assert!((1..=CALLER_KIB).contains(&alone) && (1..=WORKER_KIB).contains(&helped));
}

/// A scenario is read, a scene made and varied, with models that are placed, and scanned.
#[test]
fn samples_take_little_stack() {
    without_huge_pages();
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
        assert!((1..=CALLER_KIB).contains(&alone), "{name}: {alone} KiB of the calling thread");
    }
}

#[test]
fn stacks_are_as_small_as_promised() {
    without_huge_pages();
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
    assert!((1..=CALLER_KIB).contains(&alone), "{alone} KiB of the calling thread");
    assert!((64..=WORKER_KIB).contains(&two.max(many)), "{two} and {many} KiB of threads of an engine");
}

/// What reads a text calls itself at every level of it. With a stack of the size that is promised to be enough, and no more:
/// an overflow ends this process.
#[test]
fn nested_texts_take_little_stack() {
    /// The most levels of sections and lists.
    const DEEPEST: usize = 24;
    type Read = fn(&str) -> echocast::Result<()>;
    let kinds: [(&str, Read); 13] = [
        ("sensor", |text| Sensor::from_yaml(&format!("{{name: a, kind: lidar, pattern: {text}}}"), "").map(drop)),
        ("value of a sensor", |text| Sensor::preset("velodyne_vlp16")?.set("noise", text)),
        ("lobe", |text| Lobe::from_yaml(&format!("{{shape: {text}}}")).map(drop)),
        ("material", |text| Material::from_yaml(&format!("{{name: a, reflectance: {text}}}")).map(drop)),
        ("materials", |text| MaterialRules::from_yaml(&format!("{{a: {text}}}")).map(drop)),
        ("labels", |text| LabelRules::from_yaml(&format!("{{rules: {text}}}")).map(drop)),
        ("environment", |text| Environment::from_yaml(&format!("{{rain: {text}}}")).map(drop)),
        ("scene options", |text| LoadOptions::from_yaml(&format!("{{labels: {text}}}")).map(drop)),
        ("picture options", |text| PreviewOptions::from_yaml(&format!("{{view: {text}}}")).map(drop)),
        ("generated scene", |text| Generate::from_yaml(&format!("{{street: {text}}}")).map(drop)),
        ("scenario", |text| Scenario::from_yaml(&format!("{{scene: {text}}}"), "").map(drop)),
        // A number may be a list of numbers, and so on.
        ("drawn value", |text| {
            let scenario = "scene: {generate: {street: {}}}\nsensors: [{sensor: velodyne_vlp16}]\ntrajectory: {position_m: [0, 0, 1]}";
            let set = format!("[{{set: environment.rain, to: {text}}}]");
            Scenario::from_yaml(&format!("{scenario}\nvariation: {set}"), "").map(drop)
        }),
        ("value of a scenario", |text| {
            let scenario = "{scene: {generate: {street: {}}}, sensors: [{sensor: velodyne_vlp16}], trajectory: {position_m: [0, 0, 1]}}";
            Scenario::from_yaml(scenario, "")?.set("environment", text)
        }),
    ];
    let work = move || {
        for (name, read) in kinds {
            for depth in (DEEPEST - 4..=DEEPEST + 2).chain([40, 63, 64, 100, 1000, 100_000]) {
                let texts = [
                    "{a: ".repeat(depth) + "1" + &"}".repeat(depth),
                    "[".repeat(depth) + "1" + &"]".repeat(depth),
                    "{\"a\": [".repeat(depth / 2) + "1" + &"]}".repeat(depth / 2),
                ];
                for text in texts {
                    let told = read(&text).err().map_or(String::new(), |error| error.to_string());
                    if depth > DEEPEST {
                        assert!(told.contains("deeper than 24, the most allowed"), "{name} {depth}: {told}");
                    }
                }
            }
        }
        let path = "a.".repeat(DEEPEST - 2) + "a";
        let told = Sensor::preset("velodyne_vlp16").unwrap().set(&path, "[[1]]").unwrap_err().to_string();
        assert!(told.ends_with("deeper than 24, the most allowed"), "{told}");
        let nested: String = (0..DEEPEST + 1).map(|level| format!("{}a:\n", " ".repeat(level))).collect();
        let told = Sensor::from_yaml(&nested, "").unwrap_err().to_string();
        assert!(told.starts_with("YAML text: line 25: sections and lists are nested deeper than 24"), "{told}");
        // Aliases make it deeper than it looks.
        let levels = "[".repeat(20);
        let alias = format!("a: &a {levels}1{}\nb: {levels}*a{}\n", "]".repeat(20), "]".repeat(20));
        assert!(Sensor::from_yaml(&alias, "").unwrap_err().to_string().contains("deeper than 24"));
        // What users write into glTF files is JSON.
        let folder = tempfile::tempdir().unwrap();
        for depth in [24, 100, 120, 127, 1000, 100_000] {
            let extras = "{\"category\": ".repeat(depth) + "1" + &"}".repeat(depth);
            let gltf = format!(
                "{{\"asset\": {{\"version\": \"2.0\"}}, \"scene\": 0, \"scenes\": [{{\"nodes\": [0]}}], \"nodes\": \
                                [{{\"name\": \"a\", \"extras\": {extras}}}], \"extras\": {extras}}}"
            );
            let path = folder.path().join("deep.gltf");
            fs::write(&path, gltf).unwrap();
            let _ = Scene::load(&path);
        }
    };
    std::thread::Builder::new().stack_size(CALLER_KIB << 10).spawn(work).unwrap().join().unwrap();
}
