//! Scans side by side in one engine: each is what it is alone, and none waits for the others. A program of its own, so
//! that other tests do not take its time.

use echocast::{BuiltScene, Engine, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::root;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

fn place() -> Trajectory {
    Trajectory::fixed(Pose::at(0.0, 0.0, 1.2))
}

fn hall(engine: &Engine) -> BuiltScene {
    Scene::load(root().join("examples/scenes/indoor-1.glb")).unwrap().build_with(engine).unwrap()
}

fn scan(built: &BuiltScene, sensor: &Sensor, seed: u64, cloud: &mut PointCloud) {
    built.scan_into(sensor, &place(), &ScanOptions::default().seed(seed), cloud).unwrap();
}

/// Everything that tells two clouds apart.
fn bits(cloud: &PointCloud) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    let of = |column: &[f32]| column.iter().map(|value| value.to_bits()).collect();
    (of(cloud.columns().x()), of(cloud.columns().intensity()), cloud.columns().category_id().to_vec())
}

/// Runs `work` while another thread scans with `sensor` without end.
fn beside<R>(built: &BuiltScene, sensor: &Sensor, work: impl FnOnce() -> R) -> R {
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut cloud = PointCloud::default();
            while !stop.load(Ordering::Relaxed) {
                scan(built, sensor, 1, &mut cloud);
            }
        });
        let done = work();
        stop.store(true, Ordering::Relaxed);
        done
    })
}

#[test]
fn scans_side_by_side_are_the_same_and_wait_for_nobody() {
    for threads in [2, 5] {
        let built = hall(&Engine::with_threads(threads).unwrap());
        let large = Sensor::preset("velodyne_vls128").unwrap();
        let small = Sensor::preset("velodyne_vlp16").unwrap();
        let mut cloud = PointCloud::default();
        // With the time that three of four scans take at most: machines are busy with other things.
        let mut alone = |seeds: std::ops::Range<u64>| -> (Vec<_>, Duration) {
            let mut times = Vec::new();
            let found = seeds.map(|seed| {
                let start = Instant::now();
                scan(&built, &small, seed, &mut cloud);
                times.push(start.elapsed());
                thread::sleep(Duration::from_millis(2));
                bits(&cloud)
            });
            let found = found.collect();
            times.sort();
            (found, times[times.len() * 3 / 4])
        };
        alone(0..2);
        // Waiting for large scans would take that long whenever it is tried.
        let is_fair = (0..5).any(|_| {
            let (expected, least) = alone(0..12);
            let start = Instant::now();
            scan(&built, &large, 1, &mut PointCloud::default());
            let large_takes = start.elapsed();
            let (found, most) = beside(&built, &large, || alone(0..12));
            assert!(found == expected, "a scan is another while others scan beside it");
            println!("{threads} threads: {most:?} beside a scan of {large_takes:?}, {least:?} alone");
            // It is enough that the small scan does not wait for large ones to end.
            most < 8 * least + large_takes / 2
        });
        assert!(is_fair, "{threads} threads");
    }
}

#[test]
fn many_threads_scan_one_snapshot_at_once() {
    let built = hall(&Engine::with_threads(3).unwrap());
    let sensors = ["velodyne_vlp16", "kinect_v2", "livox_mid40"].map(|name| Sensor::preset(name).unwrap());
    let expected = sensors.each_ref().map(|sensor| {
        let mut cloud = PointCloud::default();
        scan(&built, sensor, 3, &mut cloud);
        bits(&cloud)
    });
    thread::scope(|scope| {
        for (sensor, expected) in sensors.iter().zip(&expected) {
            for _ in 0..2 {
                scope.spawn(|| {
                    let mut cloud = PointCloud::default();
                    for _ in 0..3 {
                        scan(&built, sensor, 3, &mut cloud);
                        assert!(bits(&cloud) == *expected, "{} is another", sensor.name());
                    }
                });
            }
        }
    });
}
