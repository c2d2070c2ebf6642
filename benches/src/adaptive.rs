//! What adaptive beams cost: their time relative to one ray per beam, their rays, and how many times faster than the
//! instrument they are.

use crate::Result;
use crate::clock::{cpu_per_call, median, two_digits};
use crate::presets::lidars;
use crate::scenes::{Site, sites};
use echocast::{PointCloud, ScanOptions, Sensor, Trajectory};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde_json::{Value, json};
use std::time::Duration;

const ROUNDS: usize = 5;
const LEAST: Duration = Duration::from_millis(20);

const HEAD: &str = "
Adaptive beams, one thread: processor time a beam of one ray and of adaptive beams, the ratio, that with all returns
reported (returns.mode: all), rays a beam, and how many times faster than the instrument a core is";

pub fn run() -> Result<Value> {
    println!("{HEAD}");
    println!(
        "{:<22}{:<11}{:>9}{:>10}{:>8}{:>8}{:>8}{:>11}",
        "sensor", "scene", "one ns", "adaptive", "ratio", "all", "rays", "real time"
    );
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let sensors = lidars()?;
    let mut rows = Vec::new();
    for site in sites()? {
        let site = site?;
        for sensor in &sensors {
            rows.push(row(&one, &site, sensor)?);
        }
    }
    Ok(json!(rows))
}

fn row(one: &ThreadPool, site: &Site, sensor: &Sensor) -> Result<Value> {
    let (trajectory, options) = (Trajectory::fixed(site.pose), ScanOptions::default());
    let with = |sub_rays: &str, all: bool| -> Result<Sensor> {
        let mut sensor = sensor.clone();
        sensor.set("beam.sub_rays", sub_rays)?;
        if all {
            sensor.set("returns", "{mode: all, max: 3}")?;
        }
        Ok(sensor)
    };
    let beams = sensor.beams().len() as f64;
    let sensors = [with("1", false)?, with("adaptive", false)?, with("1", true)?, with("adaptive", true)?];
    let mut times = [const { Vec::new() }; 4];
    let mut rays = [0.0; 4];
    let mut cloud = PointCloud::default();
    // The first round warms up memory and caches.
    for round in 0..=ROUNDS {
        for ((sensor, times), rays) in sensors.iter().zip(&mut times).zip(&mut rays) {
            let time = one.install(|| {
                cpu_per_call(LEAST, || {
                    site.built.scan_into(sensor, &trajectory, &options, &mut cloud).expect("a sound scan succeeds");
                })
            });
            if round > 0 {
                times.push(time / beams * 1e9);
            }
            *rays = cloud.rays as f64 / beams;
        }
    }
    let ratio = |a: usize, b: usize| median(times[a].iter().zip(&times[b]).map(|(a, b)| a / b).collect());
    let (ratio, ratio_all) = (ratio(1, 0), ratio(3, 2));
    let [plain, adaptive] = [0, 1].map(|case: usize| median(times[case].clone()));
    let (rays, real_time) = (rays[1], sensor.beams().period / (adaptive * beams * 1e-9));
    println!(
        "{:<22}{:<11}{plain:>9.1}{adaptive:>10.1}{ratio:>8.2}{ratio_all:>8.2}{rays:>8.2}{:>9} x",
        sensor.name(),
        site.name,
        two_digits(real_time),
    );
    Ok(json!({"sensor": sensor.name(), "scene": site.name, "one_ns": plain, "adaptive_ns": adaptive, "ratio": ratio,
        "ratio_all": ratio_all, "rays": rays, "real_time": real_time}))
}
