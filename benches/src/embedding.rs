//! The loop of a simulator in C compared with the same loop in Rust: `examples/c/live.c` and
//! `examples/rust/src/bin/live.rs`.

use crate::Result;
use crate::clock::median;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

const ROUNDS: usize = 15;

pub fn run() -> Result<Value> {
    let exe = std::env::current_exe()?;
    let target = exe.parent().ok_or("the benchmark lies in a folder")?;
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
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for (program, times) in [&c, &rust].into_iter().zip(&mut times) {
            times.push(milliseconds(program)?);
        }
    }
    let ratio = median(times[0].iter().zip(&times[1]).map(|(c, rust)| c / rust).collect());
    let [c, rust] = times.map(median);
    println!("C {c:.3} ms, Rust {rust:.3} ms, ratio {ratio:.3}");
    Ok(json!({"c_ms": c, "rust_ms": rust, "ratio": ratio}))
}

/// The program's own timing.
fn milliseconds(program: &Path) -> Result<f64> {
    let output = Command::new(program).output()?;
    let text = String::from_utf8(output.stderr)?;
    let number = text.lines().find_map(|line| line.strip_suffix(" ms of processor time a frame"));
    Ok(number.ok_or(text.as_str())?.parse()?)
}
