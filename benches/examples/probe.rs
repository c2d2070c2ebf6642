#![allow(missing_docs, dead_code)]
#[path = "../src/clock.rs"]
mod clock;
#[path = "../src/scenes.rs"]
mod scenes;
type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;
use clock::{cpu_per_call, median};
use echocast::cloud::FIELDS;
use echocast::{Environment, FieldSet, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::Duration;

fn cases() -> Vec<(&'static str, &'static str)> {
    vec![
        ("nothing", "{}"),
        ("noise", "{rain: {rate_mm_h: 10, drops: false, range_noise: true}}"),
        ("rain", "{rain: {rate_mm_h: 10}}"),
        ("snow", "{snow: {rate_mm_h: 2}}"),
        ("fog", "{fog: {visibility_m: 200}}"),
        ("dust", "{dust: {radius_um: 50, per_m3: 1e6, start_m: 5, length_m: 12.5}}"),
        ("box", "{dust: {radius_um: 50, per_m3: 1e6, box: {min_m: [5, -20, 0], max_m: [17, 20, 9]}}}"),
    ]
}
fn more() -> Vec<(&'static str, &'static str)> {
    let mut all = cases();
    all.extend([
        ("all", "{rain: {rate_mm_h: 30, range_noise: true}, snow: {rate_mm_h: 3}, fog: {visibility_m: 90}, dust: {radius_um: 50, per_m3: 1e7, box: {min_m: [1, -9, -2], max_m: [9, 9, 9]}}}"),
        ("boxes", "{dust: [{radius_um: 50, per_m3: 1e7, box: {min_m: [1, -9, -2], max_m: [9, 9, 9]}}, {radius_um: 50, per_m3: 1e6, box: {min_m: [-9, -9, -2], max_m: [2, 9, 9]}}]}"),
        ("places", "{snow: [{rate_mm_h: 3, box: {min_m: [3, -20, -2], max_m: [40, 20, 20]}}, {rate_mm_h: 1, start_m: 5, length_m: 20}], rain: {rate_mm_h: 10, sphere: {center_m: [0, 20, 0], radius_m: 19}}, fog: {visibility_m: 50, half_space: {point_m: [0, 0, 3], normal: [0, 0, 1]}}}"),
    ]);
    all
}

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().collect();
    let built = scenes::terrain().build()?;
    let path = Trajectory::fixed(Pose::at(0.0, 0.0, 2.0));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut cloud = PointCloud::default();
    let of = |name: &str| -> Result<Sensor> {
        let mut sensor = Sensor::preset(name)?;
        sensor.set("beam.sub_rays", "1")?;
        Ok(sensor)
    };
    match args[1].as_str() {
        "hash" => {
            let statistical = "{model: statistical, reflectance: 0.1, at_m: 120, tnr: 5, bandwidth_mhz: 300}";
            let one = |name: &str, sets: &[(&str, &str)]| -> Result<Sensor> {
                let mut sensor = of(name)?;
                for (key, value) in sets {
                    sensor.set(key, value)?;
                }
                Ok(sensor)
            };
            let mut sensors = vec![
                ("vlp32c", one("velodyne_vlp32c", &[])?),
                ("vls128", one("velodyne_vls128", &[])?),
                ("first", one("velodyne_vls128", &[("returns", "{mode: first}")])?),
                ("last", one("velodyne_vls128", &[("returns", "{mode: last}")])?),
                ("statistical", one("velodyne_vls128", &[("detection", statistical)])?),
                (
                    "statistical first",
                    one("velodyne_vlp32c", &[("detection", statistical), ("returns", "{mode: first}")])?,
                ),
                (
                    "statistical last",
                    one("velodyne_vlp32c", &[("detection", statistical), ("returns", "{mode: last}")])?,
                ),
                (
                    "doppler",
                    one(
                        "velodyne_vls128",
                        &[("detection", statistical), ("doppler", "{sigma_m_s: 0.2, ambiguity_m_s: 9}")],
                    )?,
                ),
                ("all", one("velodyne_vlp32c", &[("returns", "{mode: all, max: 3}")])?),
                ("19", one("velodyne_vlp16", &[("returns", "{mode: all, max: 3}"), ("beam.sub_rays", "19")])?),
                ("adaptive", one("velodyne_vlp16", &[("beam.sub_rays", "adaptive")])?),
            ];
            for preset in Sensor::presets().iter().filter(|preset| preset.folder != "sonar") {
                sensors.push(("preset", Sensor::preset(&preset.name)?));
            }
            for (what, sensor) in &sensors {
                for (case, yaml) in more() {
                    let options = ScanOptions::default()
                        .fields(FieldSet::all())
                        .seed(5)
                        .frame(2)
                        .environment(Environment::from_yaml(yaml)?);
                    if let Err(error) = built.scan_into(sensor, &path, &options, &mut cloud) {
                        println!("{what} {} {case}: {error}", sensor.name());
                        continue;
                    }
                    let mut hash = DefaultHasher::new();
                    for info in FIELDS {
                        cloud.column(info.field).bytes().hash(&mut hash);
                    }
                    let air = cloud.columns().cause().iter().filter(|&&c| c != 0).count();
                    println!("{what} {} {case}: {} {air} {:016x}", sensor.name(), cloud.len(), hash.finish());
                }
            }
        }
        "time" => {
            let rounds = args.get(2).map_or(5, |text| text.parse().unwrap());
            for name in ["velodyne_vlp32c", "velodyne_vls128"] {
                let sensor = of(name)?;
                let beams = sensor.beams().len() as f64;
                let cases = cases();
                let mut times = vec![Vec::new(); cases.len()];
                for round in 0..=rounds {
                    for ((_, yaml), times) in cases.iter().zip(&mut times) {
                        let options = ScanOptions::default().environment(Environment::from_yaml(yaml)?);
                        let time = one.install(|| {
                            cpu_per_call(Duration::from_millis(60), || {
                                built.scan_into(&sensor, &path, &options, &mut cloud).unwrap();
                            })
                        });
                        if round > 0 {
                            times.push(time);
                        }
                    }
                }
                let mut line = format!("{name} plain {:.1}", median(times[0].clone()) / beams * 1e9);
                for ((what, _), with) in cases.iter().zip(&times).skip(1) {
                    let added =
                        median(with.iter().zip(&times[0]).map(|(with, plain)| with - plain).collect()) / beams * 1e9;
                    line += &format!("  {what} {added:.1}");
                }
                println!("{line}");
            }
        }
        "loop" => {
            let sensor = of(&args[2])?;
            let yaml = cases().iter().find(|(what, _)| *what == args[3]).unwrap().1;
            let options = ScanOptions::default().environment(Environment::from_yaml(yaml)?);
            let count: usize = args[4].parse()?;
            one.install(|| {
                for _ in 0..count {
                    built.scan_into(&sensor, &path, &options, &mut cloud).unwrap();
                }
            });
        }
        _ => {}
    }
    Ok(())
}
