//! Pings of sonars over a generated lake bed of 41 thousand triangles, one thread.

use crate::Result;
use crate::clock::{cpu_per_call, cpu_seconds, median};
use echocast::generate::Seabed;
use echocast::preview::{self, ColorBy, PreviewOptions, View};
use echocast::{
    BareLoop, BuiltScene, Environment, FieldSet, LoadOptions, Ping, Pings, Pose, ScanOptions, Sensor, Trajectory,
};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

const ROUNDS: usize = 7;
const LEAST: Duration = Duration::from_millis(60);

/// Uniform; ten layers; a cast with gradients.
const WATERS: [(&str, &str); 3] = [
    ("one speed", "{profile: {constant: {speed_m_s: 1480}}}"),
    (
        "ten layers",
        "{profile: {layers: [{depth_m: 0, speed_m_s: 1490}, {depth_m: 1.5, speed_m_s: 1488}, {depth_m: 2.5, speed_m_s: \
         1486}, {depth_m: 3.5, speed_m_s: 1484}, {depth_m: 4.5, speed_m_s: 1482}, {depth_m: 5.5, speed_m_s: 1480}, {depth_m: \
         6.5, speed_m_s: 1478}, {depth_m: 7.5, speed_m_s: 1476}, {depth_m: 8.5, speed_m_s: 1474}, {depth_m: 9.5, speed_m_s: \
         1472}]}}",
    ),
    (
        "a cast",
        "{profile: {cast: [{depth_m: 0, speed_m_s: 1490}, {depth_m: 5, speed_m_s: 1484}, {depth_m: 40, speed_m_s: 1470}]}}",
    ),
];

/// What is measured: name, preset, settings, water.
type Case = (&'static str, &'static str, &'static [(&'static str, &'static str)], usize);

const CASES: [Case; 7] = [
    ("side-scan, 2 x 2048 rays", "sss_450", &[("acoustics.bounces", "0")], 0),
    ("  in ten layers", "sss_450", &[("acoustics.bounces", "0")], 1),
    ("  in a cast", "sss_450", &[("acoustics.bounces", "0")], 2),
    ("  2 reflections", "sss_450", &[("acoustics.bounces", "2")], 0),
    ("imaging, 512 x 1000", "fls_900", &[("acoustics.bin_m", "0.06")], 0),
    ("swath, 256 beams", "mbes_400", &[("range.max_m", "60")], 0),
    ("echo sounder", "sbes_200", &[("range.max_m", "60")], 0),
];

pub fn run() -> Result<Value> {
    let scene = Seabed::default().scene(1)?.load(&LoadOptions::default())?.build()?;
    println!("\nSonar over a lake bed, one thread: a ping, its rays a second, and what part of the bare loop that is");
    println!("{:<28}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}", "sonar", "rays", "cells", "ms", "Mrays/s", "bare", "ratio");
    let mut rows = Vec::new();
    for (name, preset, settings, water) in CASES {
        let mut sensor = Sensor::preset(preset)?;
        for (key, value) in settings {
            sensor.set(key, value)?;
        }
        let row = one(&scene, name, &sensor, WATERS[water].1)?;
        rows.push(row);
    }
    Ok(json!({"pings": rows, "mission": mission(&scene)?}))
}

/// A thousand pings of a side-scan sonar with two reflections, and the pictures of them: waterfall and track.
fn mission(scene: &BuiltScene) -> Result<Value> {
    const PINGS: u32 = 1000;
    let sensor = Sensor::preset("sss_450")?;
    let period = sensor.beams().period;
    let end = f64::from(PINGS) * period;
    let way = vec![(0.0, Pose::at(-28.0, 0.0, -3.0)), (end, Pose::at(28.0, 1.0, -3.0))];
    let trajectory = Trajectory::new(way)?;
    let folder = tempfile::tempdir()?;
    let pictures = [("waterfall.png", View::Waterfall), ("track.png", View::Track)];
    let options = PreviewOptions::default().view(View::Waterfall).color(ColorBy::Intensity);
    let (start, wall) = (cpu_seconds(), Instant::now());
    let mut pings = Pings::default();
    let mut ping = Ping::default();
    for frame in 0..PINGS {
        let start_time = f64::from(frame) * period;
        let scan = ScanOptions::default().fields(options.fields()).frame(frame).start_time(start_time);
        scene.ping_into(&sensor, &trajectory, &scan, &mut ping)?;
        pings.push(ping.with(options.fields()))?;
    }
    let scanned = cpu_seconds() - start;
    for (name, view) in pictures {
        preview::write_pings(&pings, &folder.path().join(name), &options.view(view))?;
    }
    let (cpu, wall) = (cpu_seconds() - start, wall.elapsed().as_secs_f64());
    println!(
        "a mission of {PINGS} pings with labels and two pictures: {cpu:.2} s of processor time, {scanned:.2} of them pings; {wall:.2} s on the wall"
    );
    Ok(json!({"pings": PINGS, "cpu_s": cpu, "pings_cpu_s": scanned, "wall_s": wall}))
}

fn one(scene: &BuiltScene, name: &str, sensor: &Sensor, water: &str) -> Result<Value> {
    let thread = ThreadPoolBuilder::new().num_threads(1).build()?;
    let pose = Pose::at(-20.0, 0.0, -2.0);
    let trajectory = Trajectory::fixed(pose);
    let environment = Environment::from_yaml(&format!("water: {water}"))?;
    let fields = FieldSet::parse("intensity,category_id,instance_id,true_x,true_y,true_z")?;
    let options = ScanOptions::default().fields(fields).environment(environment);
    let mut ping = Ping::default();
    let mut bare = BareLoop::new(scene, sensor, pose);
    let rays = bare.len() as f64;
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for round in 0..=ROUNDS {
        let times = thread.install(|| {
            let pinged = cpu_per_call(LEAST, || {
                scene.ping_into(sensor, &trajectory, &options, &mut ping).expect("a sound ping succeeds");
            });
            [pinged, cpu_per_call(LEAST, || bare.run())]
        });
        if round > 0 {
            ours.push(times[0]);
            theirs.push(times[1]);
        }
    }
    let ratio = median(theirs.iter().zip(&ours).map(|(bare, ping)| bare / ping).collect());
    let (time, bare_time) = (median(ours), median(theirs));
    let [rate, bare_rate] = [time, bare_time].map(|time| rays / time / 1e6);
    let cells = ping.layout().cells();
    let ms = time * 1e3;
    println!("{name:<28}{rays:>10}{cells:>10}{ms:>10.3}{rate:>10.2}{bare_rate:>10.2}{ratio:>10.3}");
    Ok(json!({"sonar": name, "rays": rays, "cells": cells, "ms": ms, "mega_rays_per_s": rate, "bare": bare_rate,
        "ratio": ratio}))
}
