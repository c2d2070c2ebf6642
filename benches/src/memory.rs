//! Peak memory of a scan, compared with what it must hold: scene data, Embree's own, output columns.

use crate::{Result, scenes};
use echocast::{FieldSet, Pose, ScanOptions, Scene, Sensor, Trajectory};
use serde_json::{Value, json};
use std::process::Command;

/// First argument of the child process that is measured.
pub const CHILD: &str = "measure-memory-of";

pub fn run() -> Result<Value> {
    println!("\nPeak memory of a process that scans once (all columns), beside scene data + Embree's + columns");
    println!(
        "{:<10}{:>12}{:>12}{:>12}{:>10}{:>10}{:>8}",
        "scene", "scene MB", "Embree MB", "columns MB", "base MB", "peak MB", "ratio"
    );
    let mut rows = Vec::new();
    for name in ["city", "terrain", "forest", "million"] {
        let output = Command::new(std::env::current_exe()?).args([CHILD, name]).output()?;
        if !output.status.success() {
            return Err(format!("measuring {name} failed: {}", String::from_utf8_lossy(&output.stderr)).into());
        }
        let row: Value = serde_json::from_slice(&output.stdout)?;
        let mb = |key: &str| row[key].as_f64().unwrap_or(f64::NAN) / 1e6;
        println!(
            "{name:<10}{:>12.1}{:>12.1}{:>12.1}{:>10.1}{:>10.1}{:>8.2}",
            mb("scene"),
            mb("embree"),
            mb("columns"),
            mb("base"),
            mb("peak"),
            row["ratio"].as_f64().unwrap_or(f64::NAN)
        );
        rows.push(row);
    }
    Ok(json!(rows))
}

/// Scans `name` once and prints the measurements as JSON.
pub fn child(name: &str) -> Result<()> {
    let base = status("VmRSS")?;
    let scene = match name {
        "city" => scenes::city(),
        "terrain" => scenes::terrain(),
        "forest" => scenes::forest(),
        _ => scenes::million(),
    };
    let scene_bytes = scene_bytes(&scene);
    // Making the scene does not count: reset the peak.
    std::fs::write("/proc/self/clear_refs", "5")?;
    let before = status("VmRSS")?;
    let built = scene.build()?;
    // What building added to the process, minus what our tables hold: Embree's structure and vertex copies.
    let embree = status("VmRSS")?.saturating_sub(before);
    let sensor = Sensor::preset("velodyne_vls128")?;
    let options = ScanOptions::default().fields(FieldSet::all());
    let cloud = built.scan(&sensor, &Trajectory::fixed(Pose::at(0.0, 0.0, 2.0)), &options)?;
    let columns: usize = cloud.fields().iter().map(|info| info.kind.size() * cloud.len()).sum();
    let peak = status("VmHWM")?;
    let needed = scene_bytes + embree + columns;
    let ratio = (peak - base) as f64 / needed as f64;
    let row = json!({"scene_name": name, "scene": scene_bytes, "embree": embree, "columns": columns, "base": base, "peak": peak, "ratio": ratio});
    println!("{row}");
    Ok(())
}

fn scene_bytes(scene: &Scene) -> usize {
    let meshes = scene.meshes();
    let parts = meshes.iter().flat_map(|mesh| &mesh.parts);
    parts.map(|part| part.positions.len() * 12 + part.triangles.len() * 12).sum::<usize>()
        + scene.objects.len() * std::mem::size_of::<echocast::scene::Object>()
}

/// A line of `/proc/self/status`, bytes.
fn status(key: &str) -> Result<usize> {
    let text = std::fs::read_to_string("/proc/self/status")?;
    let line = text.lines().find(|line| line.starts_with(key)).ok_or("no such line in /proc/self/status")?;
    let kilobytes: usize = line.split_whitespace().nth(1).ok_or("no number in /proc/self/status")?.parse()?;
    Ok(kilobytes * 1024)
}
