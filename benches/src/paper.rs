//! The paper's experiments 5.2.1 (number of rays) and 5.2.2 (number of objects).

use crate::clock::{cpu_per_call, median};
use crate::rays::GEOMETRY;
use crate::{Result, scenes};
use echocast::{BareLoop, FieldSet, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

const ROUNDS: usize = 7;
const LEAST: Duration = Duration::from_millis(30);

fn camera(width: u32, height: u32) -> echocast::Result<Sensor> {
    let text = format!(
        "name: camera\nkind: tof\npattern: {{type: pinhole, resolution: [{width}, {height}], fov_deg: [90, 90], rate_hz: 30}}\n"
    );
    Sensor::from_yaml(&text, ".")
}

pub fn run() -> Result<Value> {
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let pose = Pose::IDENTITY;
    let trajectory = Trajectory::fixed(pose);
    let options = ScanOptions::default().fields(FieldSet::parse(GEOMETRY)?);

    println!("\nThe paper's 5.2.1: one square, 1 to 1,000,000 rays, one thread, from the built scene to the cloud");
    println!("{:>10}{:>14}{:>14}", "rays", "first ms", "ns per ray");
    let built = scenes::tiles(0).build()?;
    let mut by_rays = Vec::new();
    for (width, height) in [(1, 1), (10, 1), (10, 10), (100, 10), (100, 100), (1000, 100), (1000, 1000)] {
        let sensor = camera(width, height)?;
        let rays = f64::from(width * height);
        let (first, steady) = one.install(|| {
            let start = Instant::now();
            let mut cloud = built.scan(&sensor, &trajectory, &options).expect("a scan of a built scene succeeds");
            let first = start.elapsed().as_secs_f64();
            let steady = cpu_per_call(LEAST, || {
                built.scan_into(&sensor, &trajectory, &options, &mut cloud).expect("a scan of a built scene succeeds");
            });
            (first, steady)
        });
        println!("{rays:>10}{:>14.3}{:>14.1}", first * 1e3, steady / rays * 1e9);
        by_rays.push(json!({"rays": rays, "first_s": first, "cpu_s": steady}));
    }

    println!("\nThe paper's 5.2.2: 300 x 300 rays on a square cut into 4^i objects, one thread");
    println!("{:>10}{:>12}{:>16}{:>10}", "objects", "build ms", "bare Mrays/s", "ratio");
    let sensor = camera(300, 300)?;
    let mut by_objects = Vec::new();
    for level in 0..=7 {
        let scene = scenes::tiles(level);
        let start = Instant::now();
        let built = scene.build()?;
        let build = start.elapsed().as_secs_f64();
        let mut bare = BareLoop::new(&built, &sensor, pose);
        let mut cloud = PointCloud::default();
        let (mut bare_times, mut ratios) = (Vec::new(), Vec::new());
        for round in 0..=ROUNDS {
            let (a, b) = one.install(|| {
                let a = cpu_per_call(LEAST, || bare.run());
                let b = cpu_per_call(LEAST, || {
                    built
                        .scan_into(&sensor, &trajectory, &options, &mut cloud)
                        .expect("a scan of a built scene succeeds");
                });
                (a, b)
            });
            if round > 0 {
                bare_times.push(a);
                ratios.push(a / b);
            }
        }
        let (objects, rate, ratio) = (4u32.pow(level), 90_000.0 / median(bare_times) / 1e6, median(ratios));
        println!("{objects:>10}{:>12.2}{rate:>16.1}{ratio:>10.2}", build * 1e3);
        by_objects.push(json!({"objects": objects, "build_s": build, "bare_mrays_per_cpu_s": rate, "ratio": ratio}));
    }
    Ok(json!({"rays": by_rays, "objects": by_objects}))
}
