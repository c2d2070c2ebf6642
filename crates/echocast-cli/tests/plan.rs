//! Surveys planned by the program.

mod common;

use common::{files, run, stderr, stdout};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Level ground of 300 x 200 m, and a scanner of 100 lines per second.
fn prepare(folder: &Path) {
    let ground = "o Ground\nv 0 0 0\nv 300 0 0\nv 300 200 0\nv 0 200 0\nf 1 2 3 4\n";
    fs::write(folder.join("ground.obj"), ground).unwrap();
    let scanner = "name: top\nkind: lidar\npattern: {type: line_scan, pulse_rate_hz: 4000, lines_hz: 100, mechanism: {type: \
                   rotating, window_deg: [-45, 45], sweep_deg: 180}}\nrange: {max_m: 100}\n";
    fs::write(folder.join("scanner.yaml"), scanner).unwrap();
}

const PLAN: &str = "plan DIR/ground.obj --sensor DIR/scanner.yaml --height 40 --speed 20";

/// What is printed is what the scenario then scans, in a file for each strip; the picture is drawn.
#[test]
fn plans_are_scanned_as_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    prepare(folder);
    let plan = stdout(
        folder,
        &format!("{PLAN} --crs EPSG:25832 --offset 478000,5471000,0 --json -o DIR/plan.yaml --preview DIR/plan.png"),
    );
    let plan: Value = serde_json::from_str(&plan).unwrap();
    // Swaths are twice the height wide; 200 m need ceil((200 - 80) / 56) + 1 of them.
    assert!((plan["swath_m"].as_f64().unwrap() - 80.0).abs() < 1e-9);
    let strips = plan["strips"].as_array().unwrap();
    assert_eq!((strips.len(), plan["area"]["covered"].as_f64()), (4, Some(1.0)));
    assert!(fs::metadata(folder.join("plan.png")).unwrap().len() > 1000);
    stdout(folder, "run DIR/plan.yaml -o DIR/set -q");
    let data = folder.join("set/data/000000");
    assert_eq!(files(&data), ["top_0001.laz", "top_0002.laz", "top_0003.laz", "top_0004.laz"]);
    let counts = files(&data).into_iter().map(|name| {
        let info = stdout(&data, &format!("info DIR/{name} --json"));
        serde_json::from_str::<Value>(&info).unwrap()["points"].as_f64().unwrap()
    });
    let points: f64 = counts.sum();
    let planned = plan["points"].as_f64().unwrap();
    // Of the outer strips, 84 m from the middle, 24 m of the swaths look past the scene.
    assert!((points / planned / (272.0 / 320.0) - 1.0).abs() < 0.02, "{points} {planned}");
    // The world lies where it was said to, and a plan is the same elsewhere.
    let info = stdout(&data, "info DIR/top_0001.laz --json");
    assert!(info.contains("ETRS89 / UTM zone 32N"), "{info}");
    fs::create_dir(folder.join("plans")).unwrap();
    stdout(folder, "plan DIR/plan.yaml --set trajectory.plan.speed_m_s=10 -o DIR/plans/slow.yaml");
    let slow = stdout(folder, "plan DIR/plans/slow.yaml");
    assert!(slow.contains("4 strips, 1200 m") && slow.contains("10 m/s"), "{slow}");
    // The same scenario says the same.
    let again = stdout(folder, "plan DIR/plan.yaml");
    assert!(again.contains("4 strips, 1200 m") && again.contains("swath 80.0 m"), "{again}");
}

#[test]
fn plans_that_cannot_be_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    prepare(folder);
    for (args, found) in [
        (format!("{PLAN} --area 1000,0,1100,100"), "strip 1 from 1000.0,22.0 to 1100.0,22.0 misses it"),
        (format!("{PLAN} --density 1000"), "trajectory.plan.density_per_m2"),
        ("plan DIR/ground.obj --sensor DIR/scanner.yaml --height 40".into(), "--speed: is missing"),
        ("plan DIR/plan.yaml --overlap 0.2".into(), "--overlap: is for scene files"),
        ("plan DIR/plan.yaml --crs local".into(), "--crs: is for scene files"),
        (
            "plan DIR/ground.obj --sensor velodyne_vlp16 --height 40 --speed 3 --overlap 2".into(),
            "trajectory.plan.overlap",
        ),
    ] {
        let output = run(folder, &args);
        assert!(!output.status.success() && stderr(&output).contains(found), "{}", stderr(&output));
    }
}
