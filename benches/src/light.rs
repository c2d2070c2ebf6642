//! What weather adds to a scan of the terrain, processor time per beam; and the cost of mirrors and glass.

use crate::Result;
use crate::clock::{cpu_per_call, median};
use crate::presets;
use crate::scenes::{self, Builder};
use echocast::scene::{Material, Object};
use echocast::{BareLoop, BuiltScene, Environment, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;

const ROUNDS: usize = 9;
const LEAST: Duration = Duration::from_millis(60);

pub fn run() -> Result<Value> {
    println!("\nWeather on the terrain, one thread: processor time added to a plain scan, for each beam");
    println!("{:<18}{:<36}{:>12}{:>14}", "sensor", "weather", "added ns", "plain ns");
    let built = scenes::terrain().build()?;
    let mut rows = Vec::new();
    for name in ["velodyne_vlp32c", "velodyne_vls128"] {
        let sensor = presets::of_one_ray(name)?;
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
            .map(|(_, yaml)| Ok(ScanOptions::default().environment(Environment::from_yaml(yaml)?)))
            .collect::<Result<_>>()?;
        let scans: Vec<_> = options.iter().map(|options| (&built, options)).collect();
        let times = interleaved(&scans, &sensor)?;
        let plain = median(times[0].clone()) / beams * 1e9;
        for ((what, _), with) in cases.iter().zip(&times).skip(1) {
            let added = median(with.iter().zip(&times[0]).map(|(with, plain)| with - plain).collect()) / beams * 1e9;
            println!("{name:<18}{what:<36}{added:>12.1}{plain:>14.1}");
            rows.push(json!({"sensor": name, "weather": what, "added_ns": added, "plain_ns": plain}));
        }
    }
    Ok(json!({"weather": rows, "paths": paths()?, "sub_rays": sub_rays()?}))
}

/// Beams of 19 rays: pulses per second on one core, and the time of the bare Embree loop on the same rays relative to
/// that of the scan.
fn sub_rays() -> Result<Value> {
    println!(
        "\nBeams of 19 rays and all their returns, one thread: pulses a second, and the bare loop's time over ours"
    );
    println!("{:<18}{:<12}{:>12}{:>12}{:>10}{:>10}", "sensor", "scene", "Mpulses/s", "bare", "ratio", "returns");
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let pose = Pose::at(0.0, 0.0, 2.0);
    let mut rows = Vec::new();
    for (scene, built) in [("terrain", scenes::terrain().build()?), ("city", scenes::city().build()?)] {
        for name in ["velodyne_vlp32c", "velodyne_vls128"] {
            let mut sensor = Sensor::preset(name)?;
            sensor.set("beam.sub_rays", "19")?;
            sensor.set("returns", "{mode: all, max: 3}")?;
            let pulses = sensor.beams().len() as f64;
            let mut bare = BareLoop::new(&built, &sensor, pose);
            let (trajectory, options) = (Trajectory::fixed(pose), ScanOptions::default());
            let mut cloud = PointCloud::default();
            let (mut ours, mut theirs) = (Vec::new(), Vec::new());
            for round in 0..=ROUNDS {
                let times = one.install(|| {
                    let scan = cpu_per_call(LEAST, || {
                        built.scan_into(&sensor, &trajectory, &options, &mut cloud).expect("a sound scan succeeds");
                    });
                    [scan, cpu_per_call(LEAST, || bare.run())]
                });
                if round > 0 {
                    ours.push(times[0]);
                    theirs.push(times[1]);
                }
            }
            let ratio = median(theirs.iter().zip(&ours).map(|(bare, scan)| bare / scan).collect());
            let [rate, bare_rate] = [&ours, &theirs].map(|times| pulses / median(times.clone()) / 1e6);
            let returns = cloud.len() as f64 / pulses;
            println!("{name:<18}{scene:<12}{rate:>12.3}{bare_rate:>12.3}{ratio:>10.2}{returns:>10.3}");
            rows.push(json!({"sensor": name, "scene": scene, "mega_pulses_per_s": rate, "bare": bare_rate,
                "ratio": ratio, "returns_per_pulse": returns}));
        }
    }
    Ok(json!(rows))
}

/// Processor seconds of scans at 2 m on one thread, each scene with its options, in interleaved rounds.
fn interleaved(scans: &[(&BuiltScene, &ScanOptions)], sensor: &Sensor) -> Result<Vec<Vec<f64>>> {
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, 2.0));
    let mut times = vec![Vec::new(); scans.len()];
    let mut cloud = PointCloud::default();
    // The first round warms up memory and caches.
    for round in 0..=ROUNDS {
        for ((built, options), times) in scans.iter().zip(&mut times) {
            let time = one.install(|| {
                cpu_per_call(LEAST, || {
                    built.scan_into(sensor, &trajectory, options, &mut cloud).expect("a sound scan succeeds");
                })
            });
            if round > 0 {
                times.push(time);
            }
        }
    }
    Ok(times)
}

/// The city around a case of mirrors or glass that surrounds the sensor: processor time of a scan relative to one
/// without.
fn paths() -> Result<Value> {
    println!("\nMirrors and glass around the sensor in the city, one thread: time of a scan over that without");
    println!("{:<18}{:<24}{:>10}{:>14}", "sensor", "case", "ratio", "plain ns");
    let smooth = |material: Material| Arc::new(material.roughness(0.0));
    let cases = [
        ("mirror", smooth(Material::default().metallic(1.0))),
        ("pane", smooth(Material::default().transmission(1.0).pane_m(0.004))),
        ("wall of glass", smooth(Material::default().transmission(1.0).thickness_m(0.01))),
    ];
    let mut rows = Vec::new();
    for name in ["velodyne_vlp32c", "velodyne_vls128"] {
        let sensor = presets::of_one_ray(name)?;
        let beams = sensor.beams().len() as f64;
        let mut built = vec![scenes::city().build()?];
        for (what, material) in &cases {
            let mut case = Builder::default();
            // A mirror on one side shows the city on the other; glass is all round.
            let low = if *what == "mirror" { [2.0, -50.0, 0.5] } else { [-2.0, -2.0, 0.5] };
            let high = if *what == "mirror" { [2.1, 50.0, 40.0] } else { [2.0, 2.0, 3.5] };
            case.cuboid(low, high);
            if *what == "wall of glass" {
                case.cuboid(low.map(|x| x + 0.01), high.map(|x| x - 0.01));
            }
            let mut scene = scenes::city();
            scene.objects.push(Object::new(*what, Arc::new(case.mesh_of(what, material.clone()))));
            built.push(scene.build()?);
        }
        let options = ScanOptions::default();
        let scans: Vec<_> = built.iter().map(|built| (built, &options)).collect();
        let times = interleaved(&scans, &sensor)?;
        let plain = median(times[0].clone()) / beams * 1e9;
        for ((what, _), with) in cases.iter().zip(&times[1..]) {
            let ratio = median(with.iter().zip(&times[0]).map(|(with, plain)| with / plain).collect());
            println!("{name:<18}{what:<24}{ratio:>10.2}{plain:>14.1}");
            rows.push(json!({"sensor": name, "case": what, "ratio": ratio, "plain_ns": plain}));
        }
    }
    Ok(json!(rows))
}
