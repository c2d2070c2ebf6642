//! A scan in a loop allocates nothing, a ping next to nothing. Alone in its file: every allocation of the process is
//! counted.
#![allow(unsafe_code)] // a global allocator is unsafe by nature; this one only counts

use echocast::scene::{Mesh, Object, Part};
use echocast::{
    Engine, Environment, FieldSet, LiveScene, Ping, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory,
};
use echocast_tests::reference::Shape;
use glam::{DAffine3, DVec3};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static COUNT: AtomicUsize = AtomicUsize::new(0);

// SAFETY: everything is delegated to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
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

/// Both in one test: tests run side by side, and all allocations are counted.
#[test]
fn scans_and_pings_in_a_loop_hardly_allocate() {
    scans();
    sensors();
    pings();
}

fn scans() {
    let shape = Shape::cuboid(-DVec3::ONE, DVec3::ONE);
    let part = Part { positions: shape.positions.into(), triangles: shape.triangles.into(), ..Part::default() };
    let mesh = Arc::new(Mesh::new("car", vec![part]).unwrap());
    let sensor = Sensor::preset("velodyne_vlp16").unwrap();
    let trajectory = Trajectory::new(vec![(0.0, Pose::at(0.0, 0.0, 1.0)), (0.1, Pose::at(1.0, 0.0, 1.0))]).unwrap();
    for (threads, allowed) in [(1, 0), (2, 4)] {
        let mut live = LiveScene::new(&Engine::with_threads(threads).unwrap());
        let car = live.add(Object::new("car", mesh.clone())).unwrap();
        let mut cloud = PointCloud::default();
        let mut most = 0;
        for frame in 0..60 {
            let pose = DAffine3::from_translation(DVec3::new(6.0, f64::from(frame) / 10.0 - 3.0, 0.0));
            live.set_pose(car, pose).unwrap();
            let built = live.commit().unwrap();
            let options = ScanOptions { frame, fields: FieldSet::all(), ..ScanOptions::default() };
            let before = COUNT.load(Ordering::Relaxed);
            built.scan_into(&sensor, &trajectory, &options, &mut cloud).unwrap();
            let count = COUNT.load(Ordering::Relaxed) - before;
            assert!(cloud.len > 100);
            // The first scan makes the columns. rayon's queue of tasks takes a block now and then.
            if frame > 0 {
                most = most.max(count);
            }
        }
        assert!(most <= allowed, "{most} allocations in a scan with {threads} threads");
    }
}

/// Sensors that work in their own memory, in front of a mirror and glass.
fn sensors() {
    let scene = Scene::load(echocast_tests::root().join("examples/scenes/glass.gltf")).unwrap();
    let (dry, wet) = ("{}", "{rain: {rate_mm_h: 20}, fog: {visibility_m: 60}}");
    let place = Trajectory::fixed(Pose::at(0.0, 0.0, 1.0));
    // What a scan may allocate with one thread: as documented.
    for (preset, settings, weather, allowed) in [
        ("velodyne_vlp16", &[][..], dry, 0),
        ("kinect_v1", &[("pattern.resolution", "[80, 60]")], dry, 0),
        ("kinect_v2", &[("pattern.resolution", "[80, 60]"), ("tof.multipath_rays", "2")], dry, 0),
        ("realsense_d435", &[("pattern.resolution", "[80, 60]")], dry, 0),
        ("velodyne_vlp16", &[("returns", "{mode: all, max: 5}"), ("beam.sub_rays", "8")], dry, 9),
        ("velodyne_vlp16", &[("detection.blooming", "{weight: 0.1, width_deg: 1, floor: 0.001}")], dry, 9),
        ("velodyne_vlp16", &[], wet, 9),
    ] {
        let mut sensor = Sensor::preset(preset).unwrap();
        settings.iter().for_each(|(key, value)| sensor.set(key, value).unwrap());
        let environment = Environment::from_yaml(weather).unwrap();
        for (threads, own) in [(1, 0), (2, 4)] {
            let built = scene.build_with(&Engine::with_threads(threads).unwrap()).unwrap();
            let mut cloud = PointCloud::default();
            let mut counts = Vec::new();
            for frame in 0..30 {
                let options = ScanOptions { frame, environment: environment.clone(), ..ScanOptions::default() };
                let before = COUNT.load(Ordering::Relaxed);
                built.scan_into(&sensor, &place, &options, &mut cloud).unwrap();
                counts.push(COUNT.load(Ordering::Relaxed) - before);
            }
            // Until every thread has worked, and lists have reached full length.
            let most = counts[15..].iter().max().unwrap();
            assert!(
                *most <= allowed + own,
                "{counts:?} allocations in scans of {preset} with {settings:?}, {threads} threads"
            );
        }
    }
}

fn pings() {
    let shape = Shape::plate(DVec3::ZERO, DVec3::Z, 100.0);
    let part = Part { positions: shape.positions.into(), triangles: shape.triangles.into(), ..Part::default() };
    let mesh = Arc::new(Mesh::new("bottom", vec![part]).unwrap());
    let layers = "profile: {layers: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 15, speed_m_s: 1480}]}";
    for (threads, allowed) in [(1, 20), (2, 40)] {
        let mut live = LiveScene::new(&Engine::with_threads(threads).unwrap());
        live.add(Object::new("bottom", mesh.clone())).unwrap();
        let built = live.commit().unwrap();
        for (preset, water) in
            [("sss_450", ""), ("mbes_400", ""), ("fls_900", ""), ("msis_675", ""), ("sbes_200", layers)]
        {
            let sensor = Sensor::preset(preset).unwrap();
            let environment = Environment::from_yaml(&format!("water: {{surface_z_m: 30, {water}}}")).unwrap();
            let mut ping = Ping::default();
            let mut counts = Vec::new();
            for frame in 0..4 {
                let options = ScanOptions {
                    frame,
                    fields: FieldSet::all(),
                    environment: environment.clone(),
                    ..ScanOptions::default()
                };
                let trajectory = Trajectory::fixed(Pose::at(0.1 * f64::from(frame), 0.0, 10.0));
                let before = COUNT.load(Ordering::Relaxed);
                built.ping_into(&sensor, &trajectory, &options, &mut ping).unwrap();
                counts.push(COUNT.load(Ordering::Relaxed) - before);
            }
            // What the water and the tracer of a ping consist of; none of it grows with rays or cells.
            let most = counts[1..].iter().max().unwrap();
            assert!(*most <= allowed, "{most} allocations in a ping of {preset} with {threads} threads");
        }
    }
}
