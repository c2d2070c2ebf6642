//! Scans side by side in one engine: how long those of a small sensor take alone, and while others scan continuously.

use crate::Result;
use crate::clock::quantile;
use crate::presets;
use crate::scenes;
use echocast::{BuiltScene, Engine, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

const SCANS: usize = 150;

/// Pause between scans, as for a sensor that is far slower than its simulation.
const PAUSE: Duration = Duration::from_millis(10);

pub fn run() -> Result<Value> {
    let engine = Engine::with_threads(0)?;
    let built = scenes::city().build_with(&engine)?;
    let place = Trajectory::fixed(Pose::at(0.0, 0.0, 1.8));
    println!("\nScans side by side in the city, {} threads, ms of real time\n", engine.threads());
    println!("{:<16} {:<26} {:>8} {:>8} {:>8}", "sensor", "beside", "median", "95 %", "ratio");
    let mut rows = Vec::new();
    for (name, beside) in
        [("velodyne_vlp16", "velodyne_vls128"), ("velodyne_vlp16", "kinect_v2"), ("kinect_v2", "velodyne_vlp16")]
    {
        let [sensor, other] = [presets::of_one_ray(name)?, presets::of_one_ray(beside)?];
        times(&built, &sensor, &place);
        let alone = times(&built, &sensor, &place);
        let stop = AtomicBool::new(false);
        let together = thread::scope(|scope| {
            scope.spawn(|| {
                let mut cloud = PointCloud::default();
                while !stop.load(Ordering::Relaxed) {
                    let _ = built.scan_into(&other, &place, &ScanOptions::default(), &mut cloud);
                }
            });
            let together = times(&built, &sensor, &place);
            stop.store(true, Ordering::Relaxed);
            together
        });
        let [usual, late] = [0.5, 0.95].map(|part| [&alone, &together].map(|times| 1e3 * quantile(times, part)));
        let ratio = late[1] / late[0];
        println!("{name:<16} {:<26} {:>8.2} {:>8.2}", "nothing", usual[0], late[0]);
        println!("{name:<16} {:<26} {:>8.2} {:>8.2} {ratio:>8.2}", format!("{beside} without end"), usual[1], late[1]);
        rows.push(json!({"sensor": name, "beside": beside, "alone_ms": [usual[0], late[0]], "together_ms": [usual[1], late[1]], "ratio_95": ratio}));
    }
    Ok(json!(rows))
}

/// Durations of scans, s, sorted.
fn times(built: &BuiltScene, sensor: &Sensor, place: &Trajectory) -> Vec<f64> {
    let mut cloud = PointCloud::default();
    let mut times: Vec<f64> = (0..SCANS)
        .map(|_| {
            thread::sleep(PAUSE);
            let start = Instant::now();
            // Failures are reported by the other benchmarks.
            let _ = built.scan_into(sensor, place, &ScanOptions::default(), &mut cloud);
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times
}
