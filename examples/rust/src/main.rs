//! The shortest program: loads the hall, scans it with a Velodyne VLP-16, writes a LAS file, and prints how many points
//! there are and a digest of them, the same in every language.
//!
//! Run it from the root of the repository: `cargo run --release -p echocast-example -- scan.las`.
#![forbid(unsafe_code)]

use echocast::{PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or("hall.las".into());
    let pose = Pose::at(-6.0, 6.0, 1.2);

    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/indoor-1.glb"))?.build()?;
    let sensor = Sensor::preset("velodyne_vlp16")?;
    let cloud = scene.scan(&sensor, &Trajectory::fixed(pose), &ScanOptions::default().seed(7))?;
    cloud.write(&path)?;

    println!("{path}: {} points, digest {:016x}", cloud.len(), digest(&cloud));
    Ok(())
}

/// 64-bit FNV-1a of the bytes of all columns, one after the other in the order of the table of columns.
fn digest(cloud: &PointCloud) -> u64 {
    let bytes = cloud.fields().iter().flat_map(|info| cloud.column(info.field).bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}
