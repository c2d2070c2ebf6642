//! What adaptive beams cost and find, preset by preset: their time relative to one ray per beam, their rays, and which
//! fraction of the second returns and mixed points found by 64 rays per beam they find, too.

use crate::Result;
use crate::clock::{cpu_per_call, median};
use crate::scenes;
use echocast::{BuiltScene, Cause, FieldSet, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::time::Duration;

const ROUNDS: usize = 3;
const LEAST: Duration = Duration::from_millis(20);

/// Beams whose number of rays is sampled.
const SAMPLED: usize = 500;

pub fn run() -> Result<Value> {
    println!(
        "\nAdaptive beams, one thread: processor time a beam; over that of one ray; second returns and mixed points"
    );
    println!("of 64 rays for every beam, and the part of them that adaptive beams find (returns.mode: all)");
    println!(
        "{:<22}{:<9}{:>9}{:>9}{:>8}{:>8}{:>7}{:>9}{:>8}{:>9}{:>8}",
        "sensor", "scene", "one ns", "adaptive", "ratio", "all", "rays", "second", "found", "mixed", "found"
    );
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut rows = Vec::new();
    for (scene, built, height) in [
        ("city", scenes::city().build()?, 2.0),
        ("terrain", scenes::terrain().build()?, 2.0),
        ("forest", scenes::forest().build()?, 2.0),
        ("hall", scenes::hall()?.build()?, 1.2),
    ] {
        for preset in Sensor::presets().iter().filter(|preset| preset.folder == "lidar") {
            rows.push(row(&one, &built, height, scene, &Sensor::preset(&preset.name)?)?);
        }
    }
    Ok(json!(rows))
}

/// A preset whose beams are one ray each, for comparisons with the bare loop over as many rays.
pub fn of_one_ray(preset: &str) -> Result<Sensor> {
    let mut sensor = Sensor::preset(preset)?;
    sensor.set("beam.sub_rays", "1")?;
    Ok(sensor)
}

fn row(one: &ThreadPool, built: &BuiltScene, height: f64, scene: &str, sensor: &Sensor) -> Result<Value> {
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, height));
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
    let mut times = vec![Vec::new(); sensors.len()];
    let mut cloud = PointCloud::default();
    for round in 0..=ROUNDS {
        for (sensor, times) in sensors.iter().zip(&mut times) {
            let options = ScanOptions::default();
            let time = one.install(|| {
                cpu_per_call(LEAST, || {
                    built.scan_into(sensor, &trajectory, &options, &mut cloud).expect("a sound scan succeeds");
                })
            });
            if round > 0 {
                times.push(time / beams * 1e9);
            }
        }
    }
    let ratio = |a: usize, b: usize| median(times[a].iter().zip(&times[b]).map(|(a, b)| a / b).collect());
    let (ratio, ratio_all) = (ratio(1, 0), ratio(3, 2));
    let [plain, adaptive] = [0, 1].map(|case: usize| median(times[case].clone()));
    let mut found = |sub_rays: &str| -> Result<[HashSet<u32>; 2]> {
        let options = ScanOptions::default().fields(FieldSet::all());
        built.scan_into(&with(sub_rays, true)?, &trajectory, &options, &mut cloud)?;
        let c = cloud.columns();
        let beams =
            |is: &dyn Fn(usize) -> bool| (0..cloud.len()).filter(|&row| is(row)).map(|row| c.beam()[row]).collect();
        Ok([beams(&|row| c.return_count()[row] > 1), beams(&|row| c.cause()[row] == Cause::Mixed as u8)])
    };
    // One along the axis, most often one at the rim; 64 more where the explanation has them.
    let sampled = (0..SAMPLED).map(|part| (part * sensor.beams().len() / SAMPLED) as u32);
    let options = ScanOptions::default();
    let mut several = 0;
    for beam in sampled {
        several += usize::from(!built.explain(&sensors[1], &trajectory, &options, beam)?.contains("\nray: one"));
    }
    let rays = 2.0 + 64.0 * several as f64 / SAMPLED as f64;
    let (all, ours) = (found("64")?, found("adaptive")?);
    let part = |k: usize| {
        if all[k].is_empty() { 1.0 } else { all[k].intersection(&ours[k]).count() as f64 / all[k].len() as f64 }
    };
    let [second, mixed] = [part(0), part(1)];
    println!(
        "{:<22}{scene:<9}{plain:>9.1}{adaptive:>9.1}{ratio:>8.2}{ratio_all:>8.2}{rays:>7.1}{:>9}{second:>8.3}{:>9}{mixed:>8.3}",
        sensor.name(),
        all[0].len(),
        all[1].len(),
    );
    Ok(json!({"sensor": sensor.name(), "scene": scene, "one_ns": plain, "adaptive_ns": adaptive, "ratio": ratio,
        "ratio_all": ratio_all, "rays": rays, "second": all[0].len(), "second_found": second, "mixed": all[1].len(),
        "mixed_found": mixed}))
}
