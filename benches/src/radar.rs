//! Frames of radars over a generated street, one thread, beside the bare Embree loop over as many rays as a radar looks
//! around with.

use crate::clock::{cpu_per_call, median};
use crate::{Result, scenes};
use echocast::radar::RadarRecord;
use echocast::{BareLoop, FieldSet, PointCloud, ScanOptions, Sensor, Trajectory};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::time::Duration;

const ROUNDS: usize = 5;
const LEAST: Duration = Duration::from_millis(60);

/// 256 samples, 128 chirps, 3 transmitters that take turns and 4 receivers.
const TWELVE: &str = "
name: twelve
kind: radar
pattern: {type: radar, azimuth_deg: [-60, 60], elevation_deg: [-15, 15], rate_hz: 20}
range: {min_m: 1, max_m: 100}
radar:
  power_dbm: 12
  waveform: {type: fmcw, start_ghz: 76.8, slope_mhz_per_us: 15, samples: 256, sample_rate_mhz: 12.5, ramp_us: 22, chirps: 128}
  array:
    tx: [[0, 0], [4, 0], [2, 1]]
    rx: {count: 4}
    tx_pattern: {gain_dbi: 10, azimuth_deg: 80, elevation_deg: 30}
    rx_pattern: {gain_dbi: 10, azimuth_deg: 80, elevation_deg: 30}
";

/// As many rays as a radar looks for surfaces with.
const FAN: &str = "
name: fan
kind: tof
pattern: {type: pinhole, resolution: [256, 64], fov_deg: [120, 50]}
range: {max_m: 100}
";

/// What is measured: name, preset or [`TWELVE`], changes.
type RadarCase = (&'static str, Option<&'static str>, &'static [(&'static str, &'static str)]);

const CASES: [RadarCase; 6] = [
    ("256 x 128 x 12", None, &[]),
    ("  without clutter", None, &[("radar.clutter", "false")]),
    ("  direct and ground", None, &[("radar.clutter", "false"), ("radar.mirrors", "1")]),
    ("  direct", None, &[("radar.clutter", "false"), ("radar.mirrors", "0")]),
    ("cascade, 192 channels", Some("ti_mmwcas_mimo"), &[]),
    ("rotating, 400 x 3360", Some("navtech_cts350x"), &[]),
];

pub fn run() -> Result<Value> {
    let site = scenes::site("street")?;
    let thread = ThreadPoolBuilder::new().num_threads(1).build()?;
    let trajectory = Trajectory::fixed(site.pose);
    let options = ScanOptions::default().fields(FieldSet::all());
    let fan = Sensor::from_yaml(FAN, ".")?;
    let mut bare = BareLoop::new(&site.built, &fan, site.pose);
    println!("\nRadars over a street, one thread: a frame beside {} rays of the bare loop", bare.len());
    println!("{:<28}{:>12}{:>12}{:>10}{:>10}{:>10}", "radar", "cells", "detections", "ms", "bare ms", "times");
    let mut rows = Vec::new();
    for (name, preset, settings) in CASES {
        let mut sensor = match preset {
            Some(preset) => Sensor::preset(preset)?,
            None => Sensor::from_yaml(TWELVE, ".")?,
        };
        for (key, value) in settings {
            sensor.set(key, value)?;
        }
        let mut cloud = PointCloud::default();
        let record = RadarRecord { cube: true, samples: false };
        let frame = site.built.radar_frame(&sensor, &trajectory, &options, record, &mut cloud)?;
        let polar = frame.polar.map_or(0, |polar| polar.levels.len());
        let cells = frame.cube.map_or(polar, |cube| cube.cells.len());
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let times = thread.install(|| {
                let scanned = cpu_per_call(LEAST, || {
                    let scanned = site.built.scan_into(&sensor, &trajectory, &options, &mut cloud);
                    scanned.expect("a sound scan succeeds");
                });
                [scanned, cpu_per_call(LEAST, || bare.run())]
            });
            ours.push(times[0]);
            theirs.push(times[1]);
        }
        let ratio = median(ours.iter().zip(&theirs).map(|(frame, bare)| frame / bare).collect());
        let [ms, bare_ms] = [median(ours), median(theirs)].map(|time| time * 1e3);
        println!("{name:<28}{cells:>12}{:>12}{ms:>10.1}{bare_ms:>10.2}{ratio:>10.1}", cloud.len());
        rows.push(
            json!({"radar": name.trim(), "cells": cells, "detections": cloud.len(), "ms": ms, "bare_ms": bare_ms,
            "times": ratio}),
        );
    }
    Ok(rows.into())
}
