//! How fast samples of a set are made: a street in which five cars move, seen by a VLP-32C, as SemanticKITTI. The cost
//! of each style of sets in addition to the scans.

use crate::Result;
use crate::clock::{cpu_seconds, median};
use echocast::generate::Street;
use echocast::scenario::set::{self, RunOptions};
use echocast::{Engine, PointCloud, Scenario};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;
use tempfile::TempDir;

/// Samples of a run, and frames of the plain scans: few for a set, whose first twelve have pictures.
const SAMPLES: u64 = 120;
const ROUNDS: usize = 3;

const STREET: &str = "scene: {files: street.glb}\nsensors: [{sensor: velodyne_vlp32c}]\ntrajectory: {camera: Corner}\n\
                      outputs: [{style: semantic_kitti}]\n";

/// A folder with the scene.
pub fn street() -> Result<TempDir> {
    let folder = tempfile::tempdir()?;
    Street::default().cars(5).scene(7)?.write(folder.path().join("street.glb"))?;
    Ok(folder)
}

pub fn run() -> Result<Value> {
    let folder = street()?;
    // Sample 17 at the time of frame 17, so that as much moves as in the plain scans.
    let frames: Vec<String> = (0..SAMPLES).map(|frame| format!("{{first: {frame}, last: {frame}}}")).collect();
    let varied = format!(
        "{STREET}samples: {SAMPLES}\nvariation:\n  - {{move: \"Car_*\", by_m: [{{uniform: [-3, 3]}}, 0, 0]}}\n\
         \x20 - {{set: frames, to: {{grid: [{}]}}}}\n",
        frames.join(", ")
    );
    // One sample whose frames are scanned and written one after the other.
    let plain = format!("{STREET}frames: {{last: {}}}\n", SAMPLES - 1);
    let mut number = 0;
    let mut make = |text: &str, threads: usize| -> Result<[f64; 3]> {
        number += 1;
        made(folder.path(), text, options(folder.path().join(number.to_string()), threads))
    };
    // Warm-up: files are read once before.
    make(&plain, 1)?;
    let (mut ratios, mut rates, mut shards) = (Vec::new(), Vec::new(), Vec::new());
    for round in 0..ROUNDS {
        let [_, plain, _] = make(&plain, 1)?;
        let [alone, one, _] = make(&varied, 1)?;
        ratios.push(one / plain);
        let [wall, ..] = make(&varied, 2)?;
        rates.push(SAMPLES as f64 / wall);
        // Two shards at once, each on one core, beside all samples by one.
        let start = Instant::now();
        let parts = folder.path().join(format!("shards_{round}"));
        let shard = |part: u64| options(parts.clone(), 1).shard([part, 2]);
        let work = |part: u64| made(folder.path(), &varied, shard(part));
        std::thread::scope(|scope| -> Result<()> {
            let other = scope.spawn(|| work(1));
            work(0)?;
            other.join().map_err(|_| "a shard has failed")??;
            Ok(())
        })?;
        shards.push(alone / start.elapsed().as_secs_f64());
    }
    let [ratio, rate, shards] = [ratios, rates, shards].map(median);
    println!("\nSamples of a street with five cars that move, a VLP-32C, written as SemanticKITTI");
    println!(
        "{rate:.1} samples a second on two cores; a sample takes {ratio:.2} of the processor time of a plain scan and its \
         writing; two shards at once are {shards:.2} times as fast as one"
    );
    Ok(json!({"samples_per_s": rate, "over_plain": ratio, "two_shards": shards}))
}

// One ray per beam, so that a scan is not much slower than what is measured in addition to it.
const TOP: &str = "{name: top, sensor: velodyne_vls128, set: {beam.sub_rays: 1}}";
const EYE: &str = "{name: eye, sensor: {name: eye, kind: lidar, pattern: {type: pinhole, resolution: [1242, 375], \
                   fov_deg: [81, 29]}}}";

/// Styles, and sensors whose data they hold.
const STYLES: [(&str, &[&str]); 7] = [
    ("plain", &[TOP]),
    ("semantic_kitti", &[TOP]),
    ("kitti", &[TOP, EYE]),
    ("nuscenes", &[TOP]),
    ("webdataset", &[TOP]),
    ("coco", &[EYE]),
    ("voc", &[EYE]),
];

/// First and last of the samples that are measured: those before have pictures.
const MEASURED: [u64; 2] = [12, 21];

/// Processor time of styles: of making samples without their scans, that is, further columns and boxes, files and their
/// digests.
pub fn styles() -> Result<Value> {
    let folder = street()?;
    let folder = folder.path();
    let [first, last] = MEASURED;
    let count = (last - first + 1) as f64;
    println!("\nStyles of sets: a VLS-128, a camera of 1242 x 375 or both, one core, median of {ROUNDS}");
    println!("{:<16}{:>10}{:>12}{:>14}{:>18}", "style", "points", "scan, ms", "style, ms", "M points/CPU s");
    let mut rows = Vec::new();
    for (style, sensors) in STYLES {
        let text = format!(
            "scene: {{files: street.glb}}\nsensors: [{}]\ntrajectory: {{camera: Corner}}\nsamples: {}\n\
             outputs: [{{style: {style}}}]\n",
            sensors.join(", "),
            last + 1
        );
        let (mut scans, mut others, mut points) = (Vec::new(), Vec::new(), 0.0);
        for round in 0..ROUNDS {
            let scan = scanned(folder, &text)? / count;
            let options = options(folder.join(format!("{style}_{round}")), 1);
            let [_, cpu, all] = made(folder, &text, options.samples([first, last, 1]))?;
            scans.push(scan);
            others.push(cpu / count - scan);
            points = all / count;
        }
        let [scan, other] = [scans, others].map(median);
        let rate = points / other;
        println!("{style:<16}{points:>10.0}{:>12.1}{:>14.1}{:>18.2}", scan * 1e3, other * 1e3, rate / 1e6);
        rows.push(json!({
            "style": style, "points": points, "scan_cpu_s": scan, "style_cpu_s": other, "points_per_cpu_s": rate,
        }));
    }
    Ok(json!(rows))
}

/// Makes scans without writing them; processor seconds.
fn scanned(folder: &Path, text: &str) -> Result<f64> {
    let scenario = Scenario::from_yaml(text, folder)?.with_engine(&Engine::with_threads(1)?);
    let mut cloud = PointCloud::default();
    let start = cpu_seconds();
    for number in MEASURED[0]..=MEASURED[1] {
        let mut sample = scenario.sample(number)?;
        for scan in 0..sample.scans().len() {
            sample.cloud_into(scan, 0, &mut cloud)?;
        }
    }
    Ok(cpu_seconds() - start)
}

/// All samples, to the folder `to`.
fn options(to: PathBuf, threads: usize) -> RunOptions {
    RunOptions::default().folder(to).samples(None).shard(None).resume(false).threads(threads)
}

/// Makes a set; wall and processor seconds, and points.
fn made(folder: &Path, text: &str, options: RunOptions) -> Result<[f64; 3]> {
    let scenario = Scenario::from_yaml(text, folder)?;
    let (wall, cpu) = (Instant::now(), cpu_seconds());
    let summary = set::run(scenario, &options, &|_| {})?;
    if let Some((sample, error)) = summary.failed.first() {
        return Err(format!("sample {sample}: {error}").into());
    }
    Ok([wall.elapsed().as_secs_f64(), cpu_seconds() - cpu, summary.points as f64])
}
