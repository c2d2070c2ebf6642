//! Shapes that other programs have computed: numbered files and vertex caches, in scans.

use super::assert_near;
use echocast::scene::CacheFile;
use echocast::{Engine, FieldSet, LiveScene, LoadOptions, PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory};
use echocast_tests::reference::{Actor, Keys, Moving, Shape, Track, mdd, pc2};
use glam::DVec3;
use std::path::Path;

/// From left to right in 0.1 s.
fn ahead() -> Sensor {
    let yaml = "
name: ahead
kind: lidar
pattern: {type: raster, azimuth: {fov_deg: 60, step_deg: 0.25}, elevation: {fov_deg: 10, step_deg: 2}, rate_hz: 10}
";
    Sensor::from_yaml(yaml, "").unwrap()
}

/// A square plate across x, 40 m a side, at a distance.
fn plate(distance: f64) -> [[f32; 3]; 4] {
    [[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]].map(|[y, z]| [distance as f32, y, z])
}

/// It as a file, of two triangles, or of four that the last vertex joins.
fn obj(distance: f64, triangles: usize) -> String {
    let corners = plate(distance).map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    let faces = match triangles {
        2 => "f 1 2 3\nf 1 3 4\n".to_owned(),
        _ => format!("v {distance} 0 0\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"),
    };
    format!("o Plate\n{corners}{faces}")
}

fn load(scene: &Path, cache: &Path, fps: Option<f64>, looped: bool) -> LiveScene {
    let mut options = LoadOptions::default().looped(looped);
    options.caches.insert("Plate".into(), CacheFile::new(cache).fps(fps));
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.add_scene(&Scene::load_with(scene, &options).unwrap()).unwrap();
    live
}

fn scan(live: &mut LiveScene, start_time: f64) -> PointCloud {
    live.set_time(start_time, 0.1).unwrap();
    let options = ScanOptions::default().start_time(start_time).fields(FieldSet::all());
    live.commit().unwrap().scan(&ahead(), &Trajectory::fixed(Pose::IDENTITY), &options).unwrap()
}

/// Every beam meets the plate where that is at its own time.
fn check(cloud: &PointCloud, distance: impl Fn(f64) -> f64) {
    assert_eq!(cloud.len(), ahead().beams().len());
    let c = cloud.columns();
    for row in 0..cloud.len() {
        assert_near("x", f64::from(c.x()[row]) + cloud.origin.x, distance(c.time()[row]), 2e-4);
        assert_eq!((c.instance_id()[row], c.normal_x()[row]), (1, -1.0));
    }
}

/// 40 files a second: four in a frame, of which the one that is there at the time of a beam is hit.
#[test]
fn numbered_files_are_hit_while_they_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.obj");
    std::fs::write(&scene, obj(50.0, 2)).unwrap();
    const FILES: usize = 6;
    for number in 0..FILES {
        let distance = 5.0 + number as f64;
        std::fs::write(folder.path().join(format!("w_{number:02}.obj")), obj(distance, 2 + 2 * (number % 2))).unwrap();
        // Files of glTF hold what they hold where its nodes are.
        let shape = Shape { positions: plate(1.0).to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]], ..Shape::default() };
        let track = Track::still(DVec3::X * (distance - 1.0));
        let actor = Actor { name: "any".into(), parts: vec![(shape, 0)], track, ..Actor::default() };
        let moving = Moving { actors: vec![actor], materials: vec![(0.5, [0.5; 3])] };
        std::fs::write(folder.path().join(format!("w_{number:02}.glb")), moving.glb()).unwrap();
    }
    for ending in ["obj", "glb"] {
        let first = folder.path().join(format!("w_00.{ending}"));
        for looped in [false, true] {
            let mut live = load(&scene, &first, Some(40.0), looped);
            // Before, within and after; back again.
            for start_time in [-0.2, 0.0, 0.1, 0.3, 0.35, 0.05] {
                let cloud = scan(&mut live, start_time);
                check(&cloud, |time| {
                    let number = (time * 40.0 + 1e-9).floor();
                    let last = FILES as f64 - 1.0;
                    5.0 + if looped { number.rem_euclid(FILES as f64) } else { number.clamp(0.0, last) }
                });
                assert!(
                    cloud.columns().velocity_x().iter().all(|speed| *speed == 0.0),
                    "one takes the place of another"
                );
            }
        }
    }
}

/// Samples of a plate that falls away, in straight lines between them, then rests or begins again.
#[test]
fn caches_are_played_between_their_samples() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.obj");
    std::fs::write(&scene, obj(50.0, 2)).unwrap();
    let samples: Keys<Vec<[f32; 3]>> =
        (0..9).map(|k| 0.025 * f64::from(k)).map(|time| (time, plate(6.0 + 80.0 * time * time).to_vec())).collect();
    let between = |time: f64| {
        let after = samples.iter().position(|(sample, _)| *sample > time).unwrap_or(samples.len() - 1).max(1);
        let [(t0, a), (t1, b)] = [&samples[after - 1], &samples[after]];
        let [a, b] = [a, b].map(|plate| f64::from(plate[0][0]));
        (a + (b - a) * ((time - t0) / (t1 - t0)).clamp(0.0, 1.0), if time < 0.2 { (b - a) / (t1 - t0) } else { 0.0 })
    };
    for (name, bytes, fps) in [("a.mdd", mdd(&samples), None), ("a.pc2", pc2(&samples, 80.0), Some(80.0))] {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).unwrap();
        for looped in [false, true] {
            let mut live = load(&scene, &file, fps, looped);
            for start_time in [0.0, 0.1, 0.17, 0.3] {
                let cloud = scan(&mut live, start_time);
                let own = |time: f64| if looped { time.rem_euclid(0.2) } else { time };
                check(&cloud, |time| between(own(time)).0);
                for (&speed, &time) in cloud.columns().velocity_x().iter().zip(cloud.columns().time()) {
                    // Where the speed jumps either is right.
                    if (time / 0.025 - (time / 0.025).round()).abs() > 1e-3 {
                        assert_near("velocity", speed.into(), between(own(time)).1, 2e-3);
                    }
                }
            }
        }
    }
}
