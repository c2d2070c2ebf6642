//! How fast clouds and images are written and scenes are read, on one core.

use crate::clock::cpu_seconds;
use crate::{Result, scenes};
use echocast::export::{self, AnnotationStyle, ImageFolder, ImageLayer, ImageOptions};
use echocast::{Pose, ScanOptions, Scene, Sensor, Trajectory};
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

const ROUNDS: usize = 5;

pub fn run() -> Result<Value> {
    let folder = tempfile::tempdir()?;
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| {
        Ok(json!({"write": write(folder.path())?, "images": images(folder.path())?, "read": read(folder.path())?}))
    })
}

fn write(folder: &Path) -> Result<Value> {
    let built = scenes::city().build()?;
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, 2.0));
    let sensor = Sensor::preset("velodyne_vls128")?;
    let mut cloud = built.scan(&sensor, &trajectory, &ScanOptions::default())?;
    let scan = cloud.clone();
    while cloud.len() < 2_000_000 {
        cloud.append(&scan)?;
    }
    println!("\nWriting {} points of the default columns, one core, best of {ROUNDS}", cloud.len());
    println!("{:<10}{:>16}{:>16}{:>10}", "format", "M points/CPU s", "M points/s", "MB");
    let mut rows = Vec::new();
    for format in export::FORMATS {
        let path = folder.join(format!("cloud.{}", format.name()));
        let (mut cpu, mut wall) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..ROUNDS {
            let (start, clock) = (cpu_seconds(), std::time::Instant::now());
            export::write(&cloud, &path, Some(format.name()))?;
            cpu = cpu.min(cpu_seconds() - start);
            wall = wall.min(clock.elapsed().as_secs_f64());
        }
        let size = std::fs::metadata(&path)?.len() as f64 / 1e6;
        let points = cloud.len() as f64 / 1e6;
        println!("{:<10}{:>16.2}{:>16.2}{size:>10.1}", format.name(), points / cpu, points / wall);
        rows.push(json!({"format": format.name(), "points_per_cpu_s": points / cpu * 1e6, "points_per_s": points / wall * 1e6}));
    }
    Ok(json!(rows))
}

/// Images of 1 Mpixel, and COCO's annotations of 1000 instances in one.
fn images(folder: &Path) -> Result<Value> {
    let eye = "{name: eye, kind: tof, pattern: {type: pinhole, resolution: [1250, 800], fov_deg: [90, 65]}}";
    let sensor = Sensor::from_yaml(eye, "")?;
    let layers = |names: &[ImageLayer]| ImageOptions::default().layers(names.to_vec());
    let masks = layers(&[ImageLayer::Category, ImageLayer::Part, ImageLayer::Instance, ImageLayer::Instance16]);
    let depth = layers(&[ImageLayer::Depth]);
    let coco = depth.clone().annotations(vec![AnnotationStyle::Coco]);
    let fields = masks.fields().union(coco.fields());
    let trajectory = Trajectory::fixed(Pose::at(0.0, 0.0, 2.0));
    let scene = scenes::city().build()?;
    let mut cloud = scene.scan(&sensor, &trajectory, &ScanOptions::default().fields(fields))?;
    println!("\nImages of 1 Mpixel, one core, best of {ROUNDS}: processor ms");
    let mut rows = Vec::new();
    for (name, options) in [("four masks", masks), ("depth", depth), ("depth, COCO of 1000", coco)] {
        if !options.annotations.is_empty() {
            let columns = cloud.columns_mut();
            for (tile, beam) in columns.instance_id.iter_mut().zip(columns.beam) {
                *tile = 1 + *beam % 1250 / 32 + 40 * (*beam / 1250 / 32);
            }
            columns.category_id.fill(1);
        }
        let mut cpu = f64::INFINITY;
        for _ in 0..ROUNDS {
            let start = cpu_seconds();
            let mut images = ImageFolder::create(folder.join("images"), &sensor, &options)?;
            images.add(&cloud, 0, 0.0)?;
            images.finish()?;
            cpu = cpu.min(cpu_seconds() - start);
        }
        println!("{name:<22}{:>10.1}", cpu * 1e3);
        rows.push(json!({"what": name, "cpu_s": cpu}));
    }
    Ok(json!(rows))
}

fn read(folder: &Path) -> Result<Value> {
    let scene = scenes::million();
    let part = &scene.meshes()[0].parts[0];
    let mut obj = String::new();
    for [x, y, z] in part.positions.iter() {
        writeln!(obj, "v {x} {y} {z}")?;
    }
    for [a, b, c] in part.triangles.iter() {
        writeln!(obj, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    std::fs::write(folder.join("million.obj"), obj)?;
    std::fs::write(folder.join("million.glb"), glb(&part.positions, &part.triangles))?;
    std::fs::write(folder.join("million.ply"), ply(&part.positions, &part.triangles))?;
    std::fs::write(folder.join("million.stl"), stl(&part.positions, &part.triangles))?;
    println!("\nReading 1 M triangles, one core, best of {ROUNDS}: processor seconds until ready to scan");
    println!("{:<14}{:>10}{:>10}{:>10}", "file", "load", "build", "both");
    let mut rows = Vec::new();
    for name in ["million.glb", "million.obj", "million.ply", "million.stl"] {
        let (mut load, mut build) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..ROUNDS {
            let start = cpu_seconds();
            let scene = Scene::load(folder.join(name))?;
            let loaded = cpu_seconds();
            scene.build()?;
            load = load.min(loaded - start);
            build = build.min(cpu_seconds() - loaded);
        }
        println!("{name:<14}{load:>10.2}{build:>10.2}{:>10.2}", load + build);
        rows.push(json!({"file": name, "load_cpu_s": load, "build_cpu_s": build}));
    }
    Ok(json!(rows))
}

/// A binary PLY.
fn ply(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        positions.len(),
        triangles.len()
    )
    .into_bytes();
    file.extend(positions.iter().flatten().flat_map(|v| v.to_le_bytes()));
    for triangle in triangles {
        file.push(3);
        file.extend(triangle.iter().flat_map(|v| v.to_le_bytes()));
    }
    file
}

/// A binary STL.
fn stl(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<u8> {
    let mut file = vec![0; 80];
    file.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        file.extend([0; 12]);
        file.extend(triangle.iter().flat_map(|&v| positions[v as usize]).flat_map(f32::to_le_bytes));
        file.extend([0; 2]);
    }
    file
}

/// The smallest GLB that holds one mesh.
fn glb(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<u8> {
    let mut binary: Vec<u8> = positions.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let indices_at = binary.len();
    binary.extend(triangles.iter().flatten().flat_map(|v| v.to_le_bytes()));
    let bound = |pick: fn(f32, f32) -> f32| {
        positions.iter().copied().reduce(|a, b| std::array::from_fn(|k| pick(a[k], b[k]))).unwrap_or_default()
    };
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "ground"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": binary.len()}],
        "bufferViews": [
            {"buffer": 0, "byteLength": indices_at},
            {"buffer": 0, "byteOffset": indices_at, "byteLength": binary.len() - indices_at},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": positions.len(), "type": "VEC3",
             "min": bound(f32::min), "max": bound(f32::max)},
            {"bufferView": 1, "componentType": 5125, "count": triangles.len() * 3, "type": "SCALAR"},
        ],
    });
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut file = b"glTF".to_vec();
    let word = |file: &mut Vec<u8>, value: usize| file.extend((value as u32).to_le_bytes());
    word(&mut file, 2);
    word(&mut file, 12 + 8 + text.len() + 8 + binary.len());
    word(&mut file, text.len());
    file.extend(b"JSON");
    file.extend(text);
    word(&mut file, binary.len());
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}
