//! Pings through C are those of Rust, cell by cell, and a loop of them allocates only some small blocks.
#![allow(unsafe_code)] // calls of C, and an allocator that counts

mod common;

use common::folder;
use echocast::{
    CELL_FIELDS, Engine, Environment, FieldSet, LiveScene, Ping, Pose, ScanOptions, Scenario, Scene, Sensor, SonarView,
    Trajectory,
};
use echocast_capi::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::{CStr, CString};
use std::fs;
use std::path::PathBuf;
use std::ptr;

thread_local! {
    /// Number of blocks that this thread has allocated, and the size of the largest.
    static ALLOCATED: Cell<(usize, usize)> = const { Cell::new((0, 0)) };
}

struct Counting;

// SAFETY: everything is delegated to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATED.try_with(|allocated| {
            let (count, largest) = allocated.get();
            allocated.set((count + 1, largest.max(layout.size())));
        });
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

/// A sonar of each kind.
const SONARS: [(&str, SonarView); 5] = [
    ("sss_450", SonarView::Sidescan),
    ("mbes_400", SonarView::Swath),
    ("fls_900", SonarView::Fan),
    ("msis_675", SonarView::Single),
    ("sbes_200", SonarView::Single),
];

const WATER: &CStr = c"{water: {temperature_c: 8, salinity_psu: 30}}";

/// Maximum range of all of them, m.
const REACH: &str = "15";

/// A bed 10 m deep with a box on it.
fn lake(name: &str) -> PathBuf {
    let path = folder(name).join("lake.obj");
    let text = "o bed\nv -60 -60 -10\nv 60 -60 -10\nv 60 60 -10\nv -60 60 -10\nf 1 2 3 4\n\
                o box\nv 8 -3 -10\nv 8 3 -10\nv 8 3 -7\nv 8 -3 -7\nf 5 6 7 8\n";
    fs::write(&path, text).unwrap();
    path
}

/// Start of frame `frame`, ns, and the motion of the sonar: times, ns, and poses.
fn course(frame: u32) -> (i64, [(i64, Pose); 2]) {
    (50_000_000 * i64::from(frame), [(0, Pose::at(0.0, 0.0, -3.0)), (1_000_000_000, Pose::at(1.0, 0.5, -3.5))])
}

#[track_caller]
fn ok(status: echocast_status) {
    // SAFETY: the text belongs to this thread and ends in 0.
    let why = unsafe { CStr::from_ptr(echocast_last_error()) };
    assert_eq!(status, ECHOCAST_OK, "{why:?}");
}

fn c(text: &str) -> CString {
    CString::new(text).unwrap()
}

/// The lake, built through C.
struct Host {
    context: *mut echocast_context,
    snapshot: *mut echocast_snapshot,
}

impl Host {
    fn new(lake: &std::path::Path, threads: i32) -> Host {
        let (mut context, mut scene, mut snapshot) = (ptr::null_mut(), ptr::null_mut(), ptr::null_mut());
        let desc = echocast_context_desc { threads, ..Default::default() };
        let path = c(lake.to_str().unwrap());
        // SAFETY: all pointers refer to live variables.
        unsafe {
            ok(echocast_context_create(&desc, &mut context));
            ok(echocast_scene_create(context, ptr::null(), &mut scene));
            ok(echocast_scene_load(scene, path.as_ptr(), c"{up: z}".as_ptr()));
            ok(echocast_scene_commit(scene, &mut snapshot));
            echocast_scene_release(scene);
        }
        Host { context, snapshot }
    }

    fn sensor(&self, preset: &str) -> *mut echocast_sensor {
        let mut sensor = ptr::null_mut();
        // SAFETY: as above.
        unsafe {
            ok(echocast_sensor_create(self.context, c(preset).as_ptr(), &mut sensor));
            ok(echocast_sensor_set(sensor, c"range.max_m".as_ptr(), c(REACH).as_ptr()));
        }
        sensor
    }

    /// Sends the ping of a frame. Allocates nothing itself.
    fn ping(&self, sensor: *mut echocast_sensor, frame: u32, columns: &CStr, pings: &mut *mut echocast_pings) {
        let (t0_ns, course) = course(frame);
        let poses = course.map(|(t_ns, pose)| {
            let [x, y, z] = pose.position.to_array();
            echocast_pose_key { t_ns, pose: echocast_pose { m: [1., 0., 0., x, 0., 1., 0., y, 0., 0., 1., z] } }
        });
        let desc = echocast_scan_desc {
            sensor,
            poses: poses.as_ptr(),
            pose_count: 2,
            t0_ns,
            seed: 5,
            frame,
            columns: columns.as_ptr(),
            environment: WATER.as_ptr(),
            ..Default::default()
        };
        // SAFETY: as above.
        unsafe { ok(echocast_ping(self.snapshot, &desc, pings)) };
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // SAFETY: handles may have any value.
        unsafe {
            echocast_snapshot_release(self.snapshot);
            echocast_context_release(self.context);
        }
    }
}

/// The ping of a frame by Rust.
fn by_rust(live: &mut LiveScene, preset: &str, frame: u32) -> Ping {
    let (t0_ns, course) = course(frame);
    let keys = course.map(|(t_ns, pose)| ((t_ns - t0_ns) as f64 / 1e9, pose));
    let options = ScanOptions::default()
        .fields(FieldSet::all())
        .seed(5)
        .frame(frame)
        .start_time(t0_ns as f64 / 1e9)
        .trajectory_time(0.0)
        .environment(Environment::from_yaml(WATER.to_str().unwrap()).unwrap());
    let mut sensor = Sensor::preset(preset).unwrap();
    sensor.set("range.max_m", REACH).unwrap();
    live.commit().unwrap().ping(&sensor, &Trajectory::new(keys.to_vec()).unwrap(), &options).unwrap()
}

/// The numbers at `data`.
unsafe fn numbers<'a, T>(data: *const T, count: usize) -> &'a [T] {
    // SAFETY: as the caller promises.
    if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(data, count) } }
}

/// Compares ping `index` with that of Rust, bit by bit.
fn compare(pings: *mut echocast_pings, index: usize, expected: &Ping) {
    let layout = expected.layout();
    let mut info = echocast_ping_info::default();
    // SAFETY: all pointers refer to live variables, and views to as many elements as they state.
    unsafe {
        ok(echocast_pings_get_info(pings, index, &mut info));
        assert_eq!((info.number, info.t_ns), (expected.number, (expected.time * 1e9).round() as i64));
        assert_eq!((info.beams as usize, info.bins as usize), (layout.beams(), layout.bins));
        assert_eq!((info.bin_m, info.sound_speed), (layout.bin_m, layout.believed_speed));
        assert_eq!((info.first_bin as usize, info.noise_db), (layout.first_bin, layout.noise_db));
        assert_eq!(info.origin, expected.origin.to_array());
        let position = expected.pose.position;
        assert_eq!([3, 7, 11].map(|entry| info.sensor_pose.m[entry]), position.to_array());
        assert_eq!(numbers(info.axes, 2 * layout.beams()), layout.axes.as_flattened());
        assert_eq!(numbers(info.threshold_db, layout.bins), layout.threshold_db);
        assert_eq!(numbers(info.tvg_db, layout.bins), layout.tvg_db);

        for about in expected.fields().iter() {
            let mut view = std::mem::zeroed();
            ok(echocast_pings_view(pings, index, c(about.name).as_ptr(), &mut view));
            assert_eq!(view.count, layout.cells());
            let found = numbers(view.data.cast::<u8>(), view.count * view.stride);
            assert!(found == expected.column(about.field).bytes(), "{}", about.name);
        }

        let mut depths = std::mem::zeroed();
        ok(echocast_pings_soundings(pings, index, &mut depths));
        assert_eq!((depths.count, depths.stride), (expected.soundings().len(), size_of::<echocast_sounding>()));
        for (found, reference) in numbers(depths.data, depths.count).iter().zip(expected.soundings()) {
            assert_eq!((found.beam, found.cell, found.range), (reference.beam, reference.cell, reference.range));
            assert_eq!((found.level_db, found.quality), (reference.level_db, reference.quality));
            assert_eq!(found.corrected.map(f32::to_bits), reference.corrected.to_array().map(f32::to_bits));
        }

        // As an 8-bit image for ROS that covers 40 dB above the noise.
        let scale = 255.0 / 40.0;
        let shift = layout.noise_db.into();
        let grey =
            echocast_pack_item { column: c"intensity".as_ptr(), kind: ECHOCAST_TYPE_U8, offset: 0, shift, scale };
        let (mut packed, mut needed) = (vec![0u8; layout.cells()], 0);
        ok(echocast_pings_pack(pings, index, &grey, 1, 1, packed.as_mut_ptr().cast(), packed.len(), &mut needed));
        assert_eq!(needed, packed.len());
        for (pixel, cell) in packed.iter().zip((0..layout.cells()).map(|at| {
            let (bin, beam) = (at / layout.beams(), at % layout.beams());
            beam * layout.bins + bin
        })) {
            let exact = (f64::from(expected.cells().intensity()[cell]) - shift) * scale;
            assert!((f64::from(*pixel) - exact.clamp(0.0, 255.0)).abs() <= 0.5, "{pixel} {exact}");
        }
    }
}

#[test]
fn pings_are_those_of_rust() {
    let lake = lake("pings");
    let mut live = LiveScene::new(&Engine::with_threads(2).unwrap());
    live.add_scene(&Scene::load_with(&lake, &echocast::LoadOptions::from_yaml("{up: z}").unwrap()).unwrap()).unwrap();
    let hosts = [1, 3].map(|threads| Host::new(&lake, threads));
    let frames = [3, 4, 19];
    for (preset, view) in SONARS {
        let expected = frames.map(|frame| by_rust(&mut live, preset, frame));
        for ping in &expected {
            assert_eq!(ping.fields().iter().count(), CELL_FIELDS.len());
            assert_eq!(ping.layout().view, view);
            assert!(ping.soundings().is_empty() != matches!(view, SonarView::Swath | SonarView::Single), "{preset}");
        }
        for host in &hosts {
            let sensor = host.sensor(preset);
            let mut pings: *mut echocast_pings = ptr::null_mut();
            let mut all = pings;
            // SAFETY: all pointers refer to live variables.
            unsafe {
                for (frame, reference) in frames.iter().zip(&expected) {
                    host.ping(sensor, *frame, c"all", &mut pings);
                    compare(pings, 0, reference);
                    if all.is_null() {
                        host.ping(sensor, *frame, c"all", &mut all);
                    } else {
                        ok(echocast_pings_append(all, pings));
                    }
                }
                assert_eq!((echocast_pings_count(pings), echocast_pings_count(all)), (1, 3));
                (0..).zip(&expected).for_each(|(index, reference)| compare(all, index, reference));
                // Of several pings, one is left.
                host.ping(sensor, 4, c"all", &mut all);
                assert_eq!(echocast_pings_count(all), 1);
                compare(all, 0, &expected[1]);
                echocast_pings_release(pings);
                echocast_pings_release(all);
                echocast_sensor_release(sensor);
            }
        }
    }
}

#[test]
fn pings_of_samples_are_those_of_rust() {
    let yaml = "{scene: {generate: {seabed: {size_m: [20, 20], cell_m: 0.5}}}, sensors: [{sensor: mbes_400}], \
                trajectory: {position_m: [0, 0, -1]}, frames: {first: 0, last: 1}, fields: [default, velocity]}";
    let scenario = Scenario::from_yaml(yaml, ".").unwrap().with_engine(&Engine::with_threads(2).unwrap());
    let mut expected = scenario.sample(0).unwrap();
    let host = Host::new(&lake("samples"), 1);
    let (mut scenario, mut sample, mut pings) = (ptr::null_mut(), ptr::null_mut(), ptr::null_mut());
    // SAFETY: all pointers refer to live variables.
    unsafe {
        ok(echocast_scenario_from_text(host.context, c(yaml).as_ptr(), ptr::null(), &mut scenario));
        ok(echocast_scenario_sample(scenario, 0, &mut sample));
        for frame in [1, 0] {
            ok(echocast_sample_ping(sample, 0, frame, ptr::null(), &mut pings));
            compare(pings, 0, &expected.ping(0, frame).unwrap());
        }
        let mut view = std::mem::zeroed();
        assert_eq!(echocast_pings_view(pings, 0, c"bounces".as_ptr(), &mut view), ECHOCAST_E_ARGUMENT);
        ok(echocast_sample_ping(sample, 0, 0, c"bounces".as_ptr(), &mut pings));
        ok(echocast_pings_view(pings, 0, c"bounces".as_ptr(), &mut view));
        echocast_pings_release(pings);
        echocast_sample_release(sample);
        echocast_scenario_release(scenario);
    }
}

#[test]
fn a_loop_takes_small_blocks_alone() {
    // Only the calling thread scans, whose allocations are counted.
    let host = Host::new(&lake("loop"), 1);
    for (preset, _) in SONARS {
        let sensor = host.sensor(preset);
        let mut pings = ptr::null_mut();
        for frame in 0..6 {
            ALLOCATED.set((0, 0));
            host.ping(sensor, frame, c"all", &mut pings);
            // SAFETY: all pointers refer to live variables, and views to as many elements as they state.
            unsafe {
                let (mut view, mut depths) = (std::mem::zeroed(), std::mem::zeroed());
                let mut info = echocast_ping_info::default();
                ok(echocast_pings_view(pings, 0, c"intensity".as_ptr(), &mut view));
                ok(echocast_pings_soundings(pings, 0, &mut depths));
                ok(echocast_pings_get_info(pings, 0, &mut info));
                let grey = echocast_pack_item {
                    column: c"intensity".as_ptr(),
                    kind: ECHOCAST_TYPE_U8,
                    offset: 0,
                    shift: 50.0,
                    scale: 2.0,
                };
                let mut needed = 0;
                ok(echocast_pings_pack(pings, 0, &grey, 1, 1, ptr::null_mut(), 0, &mut needed));
            }
            let (count, largest) = ALLOCATED.get();
            // The first pings allocate the memory; the number of soundings may still grow.
            assert!(
                frame < 2 || count <= 20,
                "{count} blocks in ping {frame} of {preset}, the largest of {largest} bytes"
            );
        }
    }
}
