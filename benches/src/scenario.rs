//! How fast samples of a set are made: a street in which five cars move, seen by a VLP-32C, as SemanticKITTI.

use crate::Result;
use crate::clock::{cpu_seconds, median};
use echocast::Scenario;
use echocast::generate::Street;
use echocast::scenario::set::{self, RunOptions};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Samples of a run, and frames of the plain scans: few for a set, whose first twelve have pictures.
const SAMPLES: u64 = 120;
const ROUNDS: usize = 3;

const STREET: &str = "scene: {files: street.glb}\nsensors: [{sensor: velodyne_vlp32c}]\ntrajectory: {camera: Corner}\n\
                      outputs: [{style: semantic_kitti}]\n";

pub fn run() -> Result<Value> {
    let folder = tempfile::tempdir()?;
    Street { cars: Some(5), ..Street::default() }.scene(7)?.write(folder.path().join("street.glb"))?;
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
    let mut make = |text: &str, threads: usize, shard: Option<[u64; 2]>| -> Result<[f64; 2]> {
        number += 1;
        made(folder.path(), text, &folder.path().join(number.to_string()), threads, shard)
    };
    // Files are read once before.
    make(&plain, 1, None)?;
    let (mut ratios, mut rates, mut shards) = (Vec::new(), Vec::new(), Vec::new());
    for round in 0..ROUNDS {
        let [_, plain] = make(&plain, 1, None)?;
        let [alone, one] = make(&varied, 1, None)?;
        ratios.push(one / plain);
        let [wall, _] = make(&varied, 2, None)?;
        rates.push(SAMPLES as f64 / wall);
        // Two shards at once, each on one core, beside all samples by one.
        let start = Instant::now();
        let parts = folder.path().join(format!("shards_{round}"));
        let work = |part: u64| made(folder.path(), &varied, &parts, 1, Some([part, 2]));
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

/// Makes a set; wall and processor seconds.
fn made(folder: &Path, text: &str, to: &Path, threads: usize, shard: Option<[u64; 2]>) -> Result<[f64; 2]> {
    let scenario = Scenario::from_yaml(text, folder)?;
    let options = RunOptions { folder: Some(to.to_owned()), samples: None, shard, resume: false, threads };
    let (wall, cpu) = (Instant::now(), cpu_seconds());
    let summary = set::run(scenario, &options, &|_| {})?;
    if let Some((sample, error)) = summary.failed.first() {
        return Err(format!("sample {sample}: {error}").into());
    }
    Ok([wall.elapsed().as_secs_f64(), cpu_seconds() - cpu])
}
