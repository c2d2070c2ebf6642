//! Rays per second: five scenes, three sensors and two depth cameras, compared with the bare Embree loop on the same
//! rays.

use crate::clock::{cpu_per_call, median};
use crate::{Result, presets, scenes};
use echocast::{BareLoop, FieldSet, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde_json::{Value, json};
use std::time::Duration;

const ROUNDS: usize = 7;
const LEAST: Duration = Duration::from_millis(40);

/// Position, range, ids and normal: what the bare loop stores, resolved.
pub const GEOMETRY: &str = "x,y,z,range,category_id,part_id,instance_id,normal_x,normal_y,normal_z";

/// The one-megapixel depth camera.
const CAMERA: &str = "
name: depth_camera
kind: tof
pattern: {type: pinhole, resolution: [1024, 1024], fov_deg: [90, 90], rate_hz: 30}
range: {max_m: 300}
noise: {range_sigma_m: 0.01}
";

/// An instrument without errors and threshold, for pure geometry.
fn ideal(sensor: &Sensor) -> Result<Sensor> {
    let mut ideal = sensor.clone();
    for (key, value) in [("tof", "null"), ("detection", "{model: none}"), ("noise", "{}"), ("range.resolution_m", "0")]
    {
        ideal.set(key, value)?;
    }
    Ok(ideal)
}

pub fn run() -> Result<Value> {
    let lidars = [presets::of_one_ray("velodyne_vlp32c")?, presets::of_one_ray("velodyne_vls128")?];
    let camera = [Sensor::from_yaml(CAMERA, ".")?];
    let depth_cameras = [presets::of_one_ray("kinect_v2")?, presets::of_one_ray("realsense_d435")?];
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let all = ThreadPoolBuilder::new().build()?;
    let threads = all.current_num_threads();
    println!("Rays: M rays per second and core of the bare Embree loop, and what part of it a scan reaches");
    println!("(geometry: {GEOMETRY}; default: default columns with the sensor's noise and intensity)");
    println!(
        "{:<10}{:<18}{:>9}{:>10}{:>10}{:>24}{:>8}",
        "scene",
        "sensor",
        "bare",
        "geometry",
        "default",
        format!("{threads} threads / 1, per ray"),
        "bare"
    );
    let mut rows = Vec::new();
    let outside = Pose::at(0.0, 0.0, 2.0);
    for (name, scene, pose, cameras) in [
        ("quad", scenes::quad(), Pose::at(0.0, 0.0, 0.0), &camera[..]),
        ("city", scenes::city(), outside, &camera[..]),
        ("terrain", scenes::terrain(), outside, &camera[..]),
        ("forest", scenes::forest(), outside, &camera[..]),
        ("flat", scenes::flat()?, Pose::at(-2.2, 0.3, 1.4), &depth_cameras[..]),
    ] {
        let built = scene.build()?;
        for sensor in lidars.iter().chain(cameras) {
            let plain = ideal(sensor)?;
            let trajectory = Trajectory::fixed(pose);
            let geometry = ScanOptions::default().fields(FieldSet::parse(GEOMETRY)?);
            let default = ScanOptions::default();
            let mut bare = BareLoop::new(&built, sensor, pose);
            let mut clouds = [PointCloud::default(), PointCloud::default(), PointCloud::default()];
            let rays = bare.len() as f64;
            let scan = |pool: &ThreadPool, sensor: &Sensor, options: &ScanOptions, cloud: &mut PointCloud| {
                pool.install(|| {
                    cpu_per_call(LEAST, || {
                        built.scan_into(sensor, &trajectory, options, cloud).expect("a scan of a built scene succeeds");
                    })
                })
            };
            let mut times = [const { Vec::new() }; 5];
            for round in 0..=ROUNDS {
                let sample = [
                    one.install(|| cpu_per_call(LEAST, || bare.run())),
                    scan(&one, &plain, &geometry, &mut clouds[0]),
                    scan(&one, sensor, &default, &mut clouds[1]),
                    scan(&all, sensor, &default, &mut clouds[2]),
                    all.install(|| cpu_per_call(LEAST, || bare.run())),
                ];
                // The first round warms up memory and caches.
                if round > 0 {
                    times.iter_mut().zip(sample).for_each(|(list, time)| list.push(time));
                }
            }
            let ratio =
                |over: usize, under: usize| median(times[over].iter().zip(&times[under]).map(|(a, b)| a / b).collect());
            let (bare_rate, geometry, default) = (rays / median(times[0].clone()) / 1e6, ratio(0, 1), ratio(0, 2));
            let (scaling, bare_scaling) = (ratio(3, 2), ratio(4, 0));
            println!(
                "{name:<10}{:<18}{bare_rate:>9.1}{geometry:>10.2}{default:>10.2}{scaling:>24.2}{bare_scaling:>8.2}",
                sensor.name()
            );
            rows.push(json!({
                "scene": name, "sensor": sensor.name(), "rays": rays, "points": clouds[1].len(),
                "bare_mrays_per_cpu_s": bare_rate, "geometry_ratio": geometry, "default_ratio": default,
                "cpu_per_ray_all_threads_over_one": scaling, "bare_cpu_per_ray_all_threads_over_one": bare_scaling, "threads": threads,
            }));
        }
    }
    Ok(json!(rows))
}
