//! Fog as it was measured: in fog chambers and outdoors.

use super::scan;
use echocast::{BuiltScene, Cause, Environment, PointCloud, ScanOptions, Sensor, SensorKind};
use echocast_tests::reference::{SceneBuilder, Shape, Table};

/// A wall of the reflectance `rho` all around at `range` m, met head-on.
fn wall(rho: f64, range: f64) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(rho as f32);
    scene.stand(Shape::sphere(range, 60), Some(paint));
    scene.finish().build().unwrap()
}

fn in_fog(scene: &BuiltScene, sensor: &Sensor, fog: &str) -> PointCloud {
    let environment = Environment::from_yaml(&format!("{{fog: {fog}}}")).unwrap();
    scan(scene, sensor, ScanOptions { environment, ..ScanOptions::default() })
}

/// Part of the beams of `sensor` with a point of `cause`.
fn part(cloud: &PointCloud, sensor: &Sensor, cause: Cause) -> f64 {
    let points = cloud.columns.cause.iter().filter(|&&value| value == cause as u8).count();
    points as f64 / sensor.beams().len() as f64
}

#[test]
fn table() {
    let sensor = Sensor::preset("velodyne_vlp16").unwrap();
    for kind in ["rain", "snow"] {
        for rate in [1.0, 2.0, 10.0, 30.0] {
            let environment = Environment::from_yaml(&format!("{{{kind}: {{rate_mm_h: {rate}}}}}")).unwrap();
            let cloud = scan(&wall(0.3, 60.0), &sensor, ScanOptions { environment, ..ScanOptions::default() });
            let cause = if kind == "rain" { Cause::Rain } else { Cause::Snow };
            let mut r: Vec<f64> = cloud.columns.range.iter().zip(&cloud.columns.cause).filter(|(_, c)| **c == cause as u8).map(|(r, _)| f64::from(*r)).collect();
            r.sort_by(f64::total_cmp);
            let n = r.len();
            let l: Vec<f64> = r.iter().map(|r| r.ln()).collect();
            let m = l.iter().sum::<f64>() / n as f64;
            let sd = (l.iter().map(|x| (x - m).powi(2)).sum::<f64>() / n as f64).sqrt();
            eprintln!("{kind} {rate}: {:.3e} per beam per mm/h, ln {m:.2} +- {sd:.2}", n as f64 / sensor.beams().len() as f64 / rate);
        }
    }
    for v in [100.0, 70.0, 50.0, 30.0, 20.0] {
        let sensor = Sensor::preset("velodyne_hdl64e").unwrap();
        let cloud = in_fog(&wall(0.1, 20.0), &sensor, &format!("{{mor_m: {v}}}"));
        let r: Vec<f64> = cloud.columns.range.iter().zip(&cloud.columns.cause).filter(|(_, c)| **c == Cause::Fog as u8).map(|(r, _)| f64::from(*r)).collect();
        let m = r.iter().sum::<f64>() / r.len() as f64;
        let s = (r.iter().map(|x| (x - m).powi(2)).sum::<f64>() / r.len() as f64).sqrt();
        eprintln!("hdl64 {v}: fog {:.3} at {m:.2} +- {s:.2}, wall {:.3}", part(&cloud, &sensor, Cause::Fog), part(&cloud, &sensor, Cause::Surface));
    }
}
