//! A simulator's loop: makes its own meshes, then for 100 frames moves a car and the sensor, commits, scans at the
//! sensor's rate and reads columns. Prints how many points there were and a digest of them, the same in every language,
//! and the processor time of a frame.
//!
//! `cargo run --release -p echocast-example --bin live`
#![forbid(unsafe_code)]

use echocast::scene::{Material, Mesh, Object, Part};
use echocast::{Engine, Field, FieldSet, LiveScene, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use glam::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

const FRAMES: u32 = 100;
const HOUSES: u32 = 24;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let plaster = Arc::new(Material::from_yaml("{name: plaster, reflectance: 0.5}")?);
    let paint = Arc::new(Material::from_yaml("{name: paint, reflectance: 0.75}")?);

    let mut scene = LiveScene::new(&Engine::with_threads(0)?);
    scene.name_label("category", 1, "ground")?;
    scene.name_label("category", 2, "house")?;
    scene.name_label("category", 3, "car")?;
    let ground = cuboid(100.0, 100.0, 0.25, None)?;
    scene.add_fixed(object("ground", &ground, [0.0, 0.0, -0.25], 1, 1))?;
    let house = cuboid(4.0, 4.0, 6.0, Some(plaster))?;
    for i in 0..HOUSES {
        let place = [10.0 * f64::from(i / 2) - 60.0, if i % 2 == 1 { 12.0 } else { -12.0 }, 0.0];
        scene.add_fixed(object("house", &house, place, 2, 2 + i))?;
    }
    let body = cuboid(2.0, 1.0, 1.5, Some(paint))?;
    let car = scene.add(object("car", &body, [0.0; 3], 3, 100))?;

    let sensor = Sensor::preset("velodyne_vlp16")?;
    let period_ns = (sensor.beams().period * 1e9).round() as i64;
    let seconds = |ns: i64| (ns / 1_000_000_000) as f64 + (ns % 1_000_000_000) as f64 * 1e-9;
    let fields = FieldSet::parse("x,y,z,range,intensity,category_id,instance_id,time")?;
    let mut points = PointCloud::default();
    let (mut hash, mut total) = (0xcbf2_9ce4_8422_2325, 0);
    let mut start = 0.0;
    for frame in 0..FRAMES {
        if frame == 1 {
            start = processor_seconds(); // the first frame builds what stands
        }
        // The car drives ahead, turned by the angle of the triangle 3, 4, 5.
        let turned = DMat3::from_cols(DVec3::new(0.8, 0.6, 0.0), DVec3::new(-0.6, 0.8, 0.0), DVec3::Z);
        let place = DVec3::new(8.0 + 0.25 * f64::from(frame), 0.0625 * f64::from(frame) - 3.0, 0.0);
        scene.set_pose(car, DAffine3::from_mat3_translation(turned, place))?;
        let built = scene.commit()?;

        // The sensor moves during the scan.
        let [before, after] = [frame, frame + 1]
            .map(|frame| (seconds(i64::from(frame) * period_ns), Pose::at(0.125 * f64::from(frame), 0.0, 1.75)));
        let options = ScanOptions::default().fields(fields).seed(7).frame(frame).start_time(before.0);
        built.scan_into(&sensor, &Trajectory::new(vec![before, after])?, &options, &mut points)?;

        total += points.len();
        for field in [Field::Range, Field::InstanceId] {
            hash = points
                .column(field)
                .bytes()
                .iter()
                .fold(hash, |hash: u64, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
        }
    }
    let milliseconds = 1000.0 * (processor_seconds() - start) / f64::from(FRAMES - 1);
    println!("{FRAMES} frames: {total} points, digest {hash:016x}");
    eprintln!("{milliseconds:.3} ms of processor time a frame");
    Ok(())
}

/// A box of 12 triangles from (-x, -y, 0) to (x, y, z).
fn cuboid(x: f32, y: f32, z: f32, material: Option<Arc<Material>>) -> echocast::Result<Arc<Mesh>> {
    let corner =
        |i: u32| [if i & 1 == 1 { x } else { -x }, if i & 2 == 2 { y } else { -y }, if i & 4 == 4 { z } else { 0.0 }];
    let triangles = [[0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5], [0, 1, 5], [0, 5, 4]];
    let more = [[2, 6, 7], [2, 7, 3], [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6]];
    let part = Part::default()
        .positions((0..8).map(corner).collect::<Vec<_>>().into())
        .triangles([triangles, more].concat().into())
        .material(material);
    Ok(Arc::new(Mesh::new("box", vec![part])?))
}

fn object(name: &str, mesh: &Arc<Mesh>, place: [f64; 3], category_id: u32, instance_id: u32) -> Object {
    Object::new(name, mesh.clone())
        .world_from_object(DAffine3::from_translation(place.into()))
        .category_id(category_id)
        .part_ids(vec![1])
        .instance_id(instance_id)
}

/// Of all threads of this process.
fn processor_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
