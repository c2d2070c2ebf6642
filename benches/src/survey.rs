//! Line scanners over a generated landscape, one thread: pulses per second with all columns of surveys, and the time of the
//! bare Embree loop on the same rays relative to that of the scan.

use crate::Result;
use crate::clock::{cpu_per_call, median};
use crate::scenes;
use echocast::{BareLoop, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::time::Duration;

const ROUNDS: usize = 9;
const LEAST: Duration = Duration::from_millis(60);
/// Above the landscape, m, and along it, m/s.
const HEIGHT: f64 = 80.0;
const SPEED: f64 = 8.0;

/// What is measured: name, and changes of the preset.
type SurveyCase = (&'static str, &'static [(&'static str, &'static str)]);

const CASES: [SurveyCase; 4] = [
    ("one ray, standing", &[("beam.sub_rays", "1")]),
    ("one ray, flying", &[("beam.sub_rays", "1")]),
    ("adaptive, flying", &[]),
    ("19 rays, flying", &[("beam.sub_rays", "19")]),
];

pub fn run() -> Result<Value> {
    println!("\nriegl_vux1uav22 over a landscape, one thread: pulses a second, and the bare loop's time over ours");
    println!("{:<22}{:>12}{:>12}{:>10}{:>10}", "beams", "Mpulses/s", "bare", "ratio", "returns");
    let site = scenes::site("landscape")?;
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let start = Pose::at(-20.0, 0.0, HEIGHT);
    let mut rows = Vec::new();
    for (name, changes) in CASES {
        let mut sensor = Sensor::preset("riegl_vux1uav22")?;
        changes.iter().try_for_each(|(key, value)| sensor.set(key, value))?;
        let trajectory = if name.ends_with("standing") {
            Trajectory::fixed(start)
        } else {
            let end = Pose { position: start.position + glam::DVec3::X * SPEED, ..start };
            Trajectory::new(vec![(0.0, start), (1.0, end)])?
        };
        let options = ScanOptions::default().fields(sensor.default_fields());
        let mut bare = BareLoop::new(&site.built, &sensor, start);
        let pulses = sensor.beams().len() as f64;
        let mut cloud = PointCloud::default();
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for round in 0..=ROUNDS {
            let times = one.install(|| {
                let scan = cpu_per_call(LEAST, || {
                    let scanned = site.built.scan_into(&sensor, &trajectory, &options, &mut cloud);
                    scanned.expect("a sound scan succeeds");
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
        println!("{name:<22}{rate:>12.3}{bare_rate:>12.3}{ratio:>10.2}{returns:>10.3}");
        rows.push(json!({"beams": name, "mega_pulses_per_s": rate, "bare": bare_rate, "ratio": ratio,
            "returns_per_pulse": returns}));
    }
    Ok(rows.into())
}
