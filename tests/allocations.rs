//! A scan in a loop allocates nothing, a ping next to nothing. Alone in its file: every allocation of the process is
//! counted.
#![allow(unsafe_code)] // a global allocator is unsafe by nature; this one only counts

use echocast::emitter::pattern::Pattern;
use echocast::scene::{Mesh, Object, Part};
use echocast::{
    Engine, Environment, FieldSet, LiveScene, Ping, PointCloud, Pose, ScanOptions, Scene, Sensor, SensorKind,
    Trajectory,
};
use echocast_tests::different_presets;
use echocast_tests::reference::{Actor, Change, Moving, Shape, Track};
use glam::{DAffine3, DQuat, DVec3};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static COUNT: AtomicUsize = AtomicUsize::new(0);
static BYTES: AtomicUsize = AtomicUsize::new(0);
static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: everything is delegated to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        BYTES.fetch_add(layout.size(), Ordering::Relaxed);
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Without the usual harness: its own thread allocates, too, as when it reports that a test takes long.
fn main() {
    if std::env::args().skip(1).any(|filter| !filter.starts_with('-') && !"allocations".contains(&filter)) {
        return;
    }
    for (what, test) in
        [("scans", scans as fn()), ("sensors", sensors), ("pings", pings), ("frames of what moves", frames)]
    {
        test();
        println!("{what} in a loop hardly allocate: ok");
    }
}

/// What something allocates.
#[derive(Clone, Copy, Debug, Default)]
struct Cost {
    count: usize,
    bytes: usize,
    /// Bytes of the largest one.
    largest: usize,
}

impl Cost {
    fn of<T>(what: impl FnOnce() -> T) -> (Cost, T) {
        LARGEST.store(0, Ordering::Relaxed);
        let before = (COUNT.load(Ordering::Relaxed), BYTES.load(Ordering::Relaxed));
        let done = what();
        let (count, bytes) = (COUNT.load(Ordering::Relaxed), BYTES.load(Ordering::Relaxed));
        (Cost { count: count - before.0, bytes: bytes - before.1, largest: LARGEST.load(Ordering::Relaxed) }, done)
    }

    fn most(self, other: Cost) -> Cost {
        Cost {
            count: self.count.max(other.count),
            bytes: self.bytes.max(other.bytes),
            largest: self.largest.max(other.largest),
        }
    }
}

fn scans() {
    let shape = Shape::cuboid(-DVec3::ONE, DVec3::ONE);
    let part = Part::default().positions(shape.positions.into()).triangles(shape.triangles.into());
    let mesh = Arc::new(Mesh::new("car", vec![part]).unwrap());
    let sensor = Sensor::preset("velodyne_vlp16").unwrap();
    let trajectory = Trajectory::new(vec![(0.0, Pose::at(0.0, 0.0, 1.0)), (0.1, Pose::at(1.0, 0.0, 1.0))]).unwrap();
    // Two threads: a few for the tasks that a scan is divided into.
    for (threads, allowed) in [(1, 0), (2, 12)] {
        let mut live = LiveScene::new(&Engine::with_threads(threads).unwrap());
        let car = live.add(Object::new("car", mesh.clone())).unwrap();
        let mut cloud = PointCloud::default();
        let mut counts = Vec::new();
        for frame in 0..60 {
            let pose = DAffine3::from_translation(DVec3::new(6.0, f64::from(frame) / 10.0 - 3.0, 0.0));
            live.set_pose(car, pose).unwrap();
            let built = live.commit().unwrap();
            let options = ScanOptions::default().frame(frame).fields(FieldSet::all());
            let before = COUNT.load(Ordering::Relaxed);
            built.scan_into(&sensor, &trajectory, &options, &mut cloud).unwrap();
            let count = COUNT.load(Ordering::Relaxed) - before;
            assert!(cloud.len() > 100);
            // The first scan makes the columns.
            if frame > 0 {
                counts.push(count);
            }
        }
        // On a loaded machine a thread may take part late, which then makes its memory, and queues of work grow.
        counts.sort_unstable();
        let usual = if threads == 1 { counts[counts.len() - 1] } else { counts[counts.len() / 2] };
        assert!(usual <= allowed, "{usual} allocations in a scan with {threads} threads");
    }
}

/// Preset, settings and weather.
type Case = (String, Vec<(&'static str, &'static str)>, String);

/// Sensors that work in their own memory, in front of a mirror and glass: presets of light, what they can be set to, and all
/// that is in the air.
fn sensors() {
    let scene = Scene::load(echocast_tests::root().join("examples/scenes/glass.gltf")).unwrap();
    let place = Trajectory::fixed(Pose::at(0.0, 0.0, 1.0));
    let box_m = "box: {min_m: [0, -3, 0], max_m: [6, 3, 4]}";
    let mut cases: Vec<Case> = Vec::new();
    let presets = different_presets().into_iter().filter(|(info, _)| info.kind.is_optical());
    cases.extend(presets.map(|(info, _)| (info.name, Vec::new(), "{}".to_owned())));
    for weather in [
        "rain: {rate_mm_h: 20}".to_owned(),
        "fog: {visibility_m: 60}".to_owned(),
        "snow: {rate_mm_h: 2}".to_owned(),
        "dust: {radius_um: 50, per_m3: 1.0e5, start_m: 2, length_m: 5}".to_owned(),
        "{rain: {rate_mm_h: 20}, fog: {visibility_m: 60}, clear_air: {visibility_m: 23000}}".to_owned(),
        format!("rain: {{rate_mm_h: 20, {box_m}}}"),
        format!("fog: {{visibility_m: 60, {box_m}}}"),
        format!("snow: {{rate_mm_h: 2, {box_m}}}"),
        format!("dust: {{radius_um: 50, per_m3: 1.0e5, {box_m}}}"),
        format!("spray: {{spectrum: strong_spray, {box_m}}}"),
    ] {
        cases.extend(["velodyne_vlp16", "kinect_v2"].map(|preset| (preset.to_owned(), Vec::new(), weather.clone())));
    }
    for settings in [
        &[("returns", "{mode: all, max: 5}"), ("beam.sub_rays", "8")][..],
        &[("returns", "{mode: all, max: 5}"), ("beam.sub_rays", "adaptive")],
        &[("detection.blooming", "{weight: 0.1, width_deg: 1, floor: 0.001}")],
        &[("noise.channel_bias_sigma_m", "0.01"), ("noise.range_table", "[{at_m: 2, sigma_m: 0.01}]")],
    ] {
        cases.push(("velodyne_vlp16".to_owned(), settings.to_vec(), "{}".to_owned()));
    }
    let multipath = vec![("beam.sub_rays", "1"), ("tof.multipath_rays", "2")];
    cases.push(("kinect_v2".to_owned(), multipath, "{}".to_owned()));
    for (preset, settings, weather) in cases {
        let mut sensor = Sensor::preset(&preset).unwrap();
        if sensor.kind() == SensorKind::Tof {
            sensor.set("pattern.resolution", "[80, 60]").unwrap();
        }
        // A quarter of a turn has many chunks of beams, too.
        if weather != "{}" && sensor.kind() == SensorKind::Lidar {
            sensor.set("pattern.azimuth.fov_deg", "90").unwrap();
        }
        settings.iter().for_each(|(key, value)| sensor.set(key, value).unwrap());
        let environment = Environment::from_yaml(&weather).unwrap();
        // Prisms make other patterns at other times.
        let varies = matches!(sensor.spec().pattern, Pattern::Risley(_)) || weather != "{}" || !settings.is_empty();
        let rounds: u32 = if varies { 12 } else { 3 };
        for threads in [1, 2] {
            let built = scene.build_with(&Engine::with_threads(threads).unwrap()).unwrap();
            let mut cloud = PointCloud::default();
            let mut counts = Vec::new();
            // Lists have reached full length when all patterns have been seen, and enough of the weather.
            for frame in (0..rounds).chain(0..rounds) {
                let start_time = 0.1 * f64::from(frame);
                let options =
                    ScanOptions::default().frame(frame).start_time(start_time).environment(environment.clone());
                let before = COUNT.load(Ordering::Relaxed);
                built.scan_into(&sensor, &place, &options, &mut cloud).unwrap();
                counts.push(COUNT.load(Ordering::Relaxed) - before);
            }
            // A thread that helps makes its memory at its first chunk, and the rest at its first one with returns.
            let above = counts[rounds as usize..].iter().filter(|count| **count > 0).count();
            assert!(
                above <= 2 * (threads - 1),
                "{counts:?} allocations in scans of {preset} with {settings:?} and {weather}, {threads} threads"
            );
        }
    }
}

/// Warm, a loop over a moving scene allocates small things alone, whatever the size of its meshes, and the scan nothing.
fn frames() {
    let folder = tempfile::tempdir().unwrap();
    // Closed and smooth, 20,000 vertices.
    let ball = || Shape::sphere(1.0, 100);
    let vertices = ball().positions.len();
    // To and fro by so many rad every 0.1 s.
    let drive = |place: DVec3, turn: f64| Track {
        places: [0.0, 10.0].map(|time| (time, place + DVec3::X * time)).to_vec(),
        turns: (0..100).map(|k| (0.1 * f64::from(k), DQuat::from_rotation_x(turn * f64::from(k % 3)))).collect(),
    };
    let skin = || {
        let of = |[_, _, z]: [f32; 3]| [(0, 0.5 - 0.5 * z), (1, 0.5 + 0.5 * z), (0, 0.0), (0, 0.0)];
        let influences = ball().positions.into_iter().map(of);
        let joints = vec![(DVec3::ZERO, Track::default()), (DVec3::ZERO, drive(DVec3::ZERO, 0.3))];
        Change::Skin { joints, influences: vec![influences.collect()] }
    };
    let grown = |by: f32| ball().positions.iter().map(|place| place.map(|x| by * x)).collect::<Vec<_>>();
    let morph = || {
        let weights = (0..100).map(|k| (0.1 * f64::from(k), vec![f64::from(k % 2)])).collect();
        Change::Morph { targets: vec![vec![grown(0.2)]], weights }
    };
    let cache = || Change::Cache {
        samples: (0..100).map(|k| (0.05 * f64::from(k), grown(1.0 + 0.1 * (k % 2) as f32))).collect(),
        fps: None,
    };
    for (what, count, shape, change) in [
        ("stiff", 10, Shape::cuboid(-DVec3::ONE, DVec3::ONE), &(|| Change::None) as &dyn Fn() -> Change),
        ("skinned", 1, ball(), &skin),
        ("morphing", 1, ball(), &morph),
        ("cached", 1, ball(), &cache),
    ] {
        let actor = |number: i32| Actor {
            name: format!("{what} {number}"),
            parts: vec![(shape.clone(), 0)],
            track: drive(DVec3::new(3.0, 3.0 * f64::from(number) - 9.0, 0.0), 0.05),
            change: change(),
        };
        let ground = Actor {
            name: "ground".into(),
            parts: vec![(Shape::plate(-2.0 * DVec3::Z, DVec3::Z, 50.0), 0)],
            ..Actor::default()
        };
        let actors = (0..count).map(actor).chain([ground]).collect();
        let scene = Moving { actors, materials: vec![(0.5, [0.5; 3])] }.load(folder.path());
        let sensor = Sensor::preset("velodyne_vlp16").unwrap();
        let place = Trajectory::fixed(Pose::IDENTITY);
        let mut live = LiveScene::new(&Engine::with_threads(1).unwrap());
        live.add_scene(&scene).unwrap();
        let mut cloud = PointCloud::default();
        let [mut set, mut scanned] = [Cost::default(); 2];
        for frame in 0..30 {
            let start_time = 0.1 * f64::from(frame);
            let fields = FieldSet::parse("default,velocity,normal_x,track_id").unwrap();
            let options = ScanOptions::default().frame(frame).start_time(start_time).fields(fields);
            let (cost, built) = Cost::of(|| {
                live.set_time(start_time, 0.1).unwrap();
                live.commit().unwrap()
            });
            let (scan, ()) = Cost::of(|| built.scan_into(&sensor, &place, &options, &mut cloud).unwrap());
            assert!(cloud.columns().velocity_x().iter().filter(|speed| **speed > 0.5).count() > 50);
            if frame >= 10 {
                (set, scanned) = (set.most(cost), scanned.most(scan));
            }
        }
        assert!(set.largest <= 16 << 10, "{what} of {vertices} vertices: {set:?}");
        assert_eq!(scanned.count, 0, "{what}: {scanned:?} in scans");
    }
}

fn pings() {
    let shape = Shape::plate(DVec3::ZERO, DVec3::Z, 100.0);
    let part = Part::default().positions(shape.positions.into()).triangles(shape.triangles.into());
    let mesh = Arc::new(Mesh::new("bottom", vec![part]).unwrap());
    let layers = "profile: {layers: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 15, speed_m_s: 1480}]}";
    for (threads, allowed) in [(1, 20), (2, 40)] {
        let mut live = LiveScene::new(&Engine::with_threads(threads).unwrap());
        live.add(Object::new("bottom", mesh.clone())).unwrap();
        let built = live.commit().unwrap();
        for (preset, water) in [
            ("sss_450", ""),
            ("mbes_400", ""),
            ("mbes_400", layers),
            ("fls_900", ""),
            ("fls_900", layers),
            ("msis_675", ""),
            ("sbes_200", layers),
        ] {
            let sensor = Sensor::preset(preset).unwrap();
            let environment = Environment::from_yaml(&format!("water: {{surface_z_m: 30, {water}}}")).unwrap();
            let mut ping = Ping::default();
            let mut counts = Vec::new();
            for frame in 0..4 {
                let options =
                    ScanOptions::default().frame(frame).fields(FieldSet::all()).environment(environment.clone());
                let trajectory = Trajectory::fixed(Pose::at(0.1 * f64::from(frame), 0.0, 10.0));
                let before = COUNT.load(Ordering::Relaxed);
                built.ping_into(&sensor, &trajectory, &options, &mut ping).unwrap();
                counts.push(COUNT.load(Ordering::Relaxed) - before);
            }
            // What the water and the tracer of a ping consist of; none of it grows with rays or cells. The queue of work
            // makes one block more now and then.
            counts[1..].sort_unstable();
            let usual = counts[2];
            assert!(usual <= allowed, "{usual} allocations in a ping of {preset} with {threads} threads");
        }
    }
}
