//! The loop of a simulator in C compared with the same loop in Rust, `examples/c/live.c` and
//! `examples/rust/src/bin/live.rs`; and scans from Python compared with scans from Rust.

use crate::Result;
use crate::clock::{cpu_seconds, median};
use crate::scenario::street;
use echocast::{ScanOptions, Scene, Sensor, Trajectory};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};

const ROUNDS: usize = 15;

/// Scans of a round.
const SCANS: u32 = 20;

pub fn run() -> Result<Value> {
    let exe = std::env::current_exe()?;
    let target = exe.parent().ok_or("the benchmark is in a folder")?;
    Ok(json!({"c": c(target)?, "python": python(target)?}))
}

/// The loop in C.
fn c(target: &Path) -> Result<Value> {
    let (library, rust) = (target.join("libechocast_capi.so"), target.join("live"));
    println!(
        "\nA simulator's loop, 100 frames of a VLP-16: processor time of a frame, medians of {ROUNDS} rounds in turn"
    );
    if !library.exists() || !rust.exists() {
        println!("left out: cargo build --release -p echocast-capi -p echocast-example builds what it needs");
        return Ok(Value::Null);
    }
    let folder = tempfile::tempdir()?;
    for name in ["libechocast.so", "libechocast.so.1"] {
        std::os::unix::fs::symlink(&library, folder.path().join(name))?;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let c = folder.path().join("live");
    let compiled = Command::new("cc")
        .args(["-std=c99", "-O2", "-I"])
        .arg(root.join("include"))
        .arg(root.join("examples/c/live.c"))
        .arg("-L")
        .arg(folder.path())
        .arg(format!("-Wl,-rpath,{}", folder.path().display()))
        .args(["-lechocast", "-o"])
        .arg(&c)
        .status()?;
    if !compiled.success() {
        return Err("examples/c/live.c cannot be compiled".into());
    }
    beside_rust("C", || milliseconds(&c), || milliseconds(&rust))
}

/// Scans from Python. All threads, whose processor time counts together.
fn python(target: &Path) -> Result<Value> {
    println!("\nScans of a street with a VLP-32C: processor time of a scan, medians of {ROUNDS} rounds in turn");
    let python = target.with_file_name("python/released/bin/python");
    if !python.exists() {
        println!("left out: `make wheel` builds what it needs");
        return Ok(Value::Null);
    }
    let folder = street()?;
    let path = folder.path().join("street.glb");
    let program = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/scan.py");
    let mut command = Command::new(python);
    let mut child = command.arg(program).arg(&path).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let (Some(mut requests), Some(replies)) = (child.stdin.take(), child.stdout.take()) else {
        return Err("Python has no pipes".into());
    };
    let mut replies = BufReader::new(replies);
    let scene = Scene::load(&path)?;
    let place = Trajectory::fixed(scene.camera("Corner")?.pose);
    let (built, sensor) = (scene.build()?, Sensor::preset("velodyne_vlp32c")?);
    let rust = || -> Result<f64> {
        let start = cpu_seconds();
        for frame in 0..SCANS {
            let options = ScanOptions::default().seed(7).frame(frame);
            let cloud = built.scan(&sensor, &place, &options)?;
            assert!(!cloud.is_empty(), "the street is seen");
        }
        Ok(1000.0 * (cpu_seconds() - start) / f64::from(SCANS))
    };
    let mut python = || -> Result<f64> {
        writeln!(requests, "{SCANS}")?;
        let mut line = String::new();
        replies.read_line(&mut line)?;
        Ok(line.trim().parse()?)
    };
    // Both build what they need first.
    python()?;
    rust()?;
    let compared = beside_rust("Python", python, rust)?;
    drop(requests);
    child.wait()?;
    Ok(compared)
}

/// Compares the milliseconds of `other`, in the language `name`, with those of Rust, measured in turn.
fn beside_rust(name: &str, mut other: impl FnMut() -> Result<f64>, rust: impl Fn() -> Result<f64>) -> Result<Value> {
    let rounds: Vec<(f64, f64)> = (0..ROUNDS).map(|_| Ok((other()?, rust()?))).collect::<Result<_>>()?;
    let ratio = median(rounds.iter().map(|(other, rust)| other / rust).collect());
    let (other, rust): (Vec<f64>, Vec<f64>) = rounds.into_iter().unzip();
    let (other, rust) = (median(other), median(rust));
    println!("{name} {other:.3} ms, Rust {rust:.3} ms, ratio {ratio:.3}");
    Ok(json!({format!("{}_ms", name.to_lowercase()): other, "rust_ms": rust, "ratio": ratio}))
}

/// The program's own timing.
fn milliseconds(program: &Path) -> Result<f64> {
    let output = Command::new(program).output()?;
    let text = String::from_utf8(output.stderr)?;
    let number = text.lines().find_map(|line| line.strip_suffix(" ms of processor time a frame"));
    Ok(number.ok_or(text.as_str())?.parse()?)
}
