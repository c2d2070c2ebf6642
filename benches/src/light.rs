//! What weather adds to a scan of the terrain: processor time for each beam.

use crate::Result;
use crate::clock::{cpu_per_call, median};
use crate::scenes;
use echocast::{Environment, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::time::Duration;

const ROUNDS: usize = 9;
const LEAST: Duration = Duration::from_millis(60);

pub fn run() -> Result<Value> {
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    println!("\nWeather on the terrain, one thread: processor time added to a plain scan, for each beam");
    println!("{:<18}{:<36}{:>12}{:>14}", "sensor", "weather", "added ns", "plain ns");
    let built = scenes::terrain().build()?;
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, 2.0));
    let mut rows = Vec::new();
    for name in ["velodyne_vlp32c", "velodyne_vls128"] {
        let sensor = Sensor::preset(name)?;
        let beams = sensor.beams().len() as f64;
        let cases = [
            ("nothing", "{}"),
            ("rain with its range noise", "{rain: {rate_mm_h: 10, drops: false, range_noise: true}}"),
            ("rain with its drops", "{rain: {rate_mm_h: 10}}"),
            ("snow with its flakes", "{snow: {rate_mm_h: 2}}"),
            ("fog", "{fog: {visibility_m: 200}}"),
            ("dust around the sensor", "{dust: {radius_um: 50, per_m3: 1e6, start_m: 5, length_m: 12.5}}"),
            ("dust in a box", "{dust: {radius_um: 50, per_m3: 1e6, box: {min_m: [5, -20, 0], max_m: [17, 20, 9]}}}"),
        ];
        let options: Vec<ScanOptions> = (cases.iter())
            .map(|(_, yaml)| Ok(ScanOptions { environment: Environment::from_yaml(yaml)?, ..ScanOptions::default() }))
            .collect::<Result<_>>()?;
        let mut times = vec![Vec::new(); cases.len()];
        let mut cloud = PointCloud::default();
        for round in 0..=ROUNDS {
            for (options, times) in options.iter().zip(&mut times) {
                let time = one.install(|| {
                    cpu_per_call(LEAST, || {
                        built.scan_into(&sensor, &trajectory, options, &mut cloud).expect("a sound scan succeeds");
                    })
                });
                if round > 0 {
                    times.push(time);
                }
            }
        }
        let plain = median(times[0].clone()) / beams * 1e9;
        for ((what, _), with) in cases.iter().zip(&times).skip(1) {
            let added = median(with.iter().zip(&times[0]).map(|(with, plain)| with - plain).collect()) / beams * 1e9;
            println!("{name:<18}{what:<36}{added:>12.1}{plain:>14.1}");
            rows.push(json!({"sensor": name, "weather": what, "added_ns": added, "plain_ns": plain}));
        }
    }
    Ok(json!(rows))
}
