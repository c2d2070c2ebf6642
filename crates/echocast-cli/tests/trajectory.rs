//! Trajectories and errors of navigation, from files to files.

mod common;

use common::{csv_column, files, report, run, stderr, stdout, write_room, write_single_beam};
use std::fs;
use std::path::Path;

/// A pass over the room, looking ahead and down, in places on the Earth.
const PASS: &str = "t,lat,lon,height,roll_deg,pitch_deg,heading_deg\n100,48.7,9,2,0,-90,0\n101,48.70001,9,2,0,-90,0\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path(), &[]);
    write_single_beam(folder.path());
    fs::write(folder.path().join("pass.csv"), PASS).unwrap();
    let errors = "navigation: {boresight_deg: [0, 1, 0], position: {vertical_m: 0.1, tau_s: 1}}\n";
    fs::write(folder.path().join("errors.yaml"), errors).unwrap();
    folder
}

/// Northing of the first pose.
fn northing(folder: &Path) -> f64 {
    stdout(folder, "trajectory DIR/pass.csv --crs EPSG:25832 -o DIR/grid.csv");
    csv_column(&folder.join("grid.csv"), "northing")[0]
}

#[test]
fn a_scan_has_the_estimate_and_the_truth() {
    let folder = folder();
    let north = northing(folder.path());
    let scan = format!(
        "scan DIR/room.gltf --sensor DIR/pole.yaml --trajectory DIR/pass.csv --crs EPSG:25832 --offset 500000,{north},0 \
         --frames 0:5 --navigation DIR/errors.yaml --seed 3 --fields x,y,z,true_x,true_y,true_z,time -o DIR/a.csv \
         --trajectory-out DIR/flight.sbet"
    );
    let said = report(folder.path(), &scan);
    assert_eq!(said["points"], 6);
    let column = |name: &str| csv_column(&folder.path().join("a.csv"), name);
    let (y, true_y) = (column("y"), column("true_y"));
    // Nose up by a degree, what is straight down appears ahead; the height differs by the drift.
    assert!(y.iter().zip(&true_y).all(|(y, truth)| (y - truth - 2.0 * 1f64.to_radians().sin()).abs() < 1e-3), "{y:?}");
    assert!(column("z").iter().any(|z| z.abs() > 1e-3) && column("true_z").iter().all(|z| z.abs() < 1e-5));
    let written = ["flight.sbet", "flight_true.sbet", "smrmsg_flight.out"];
    assert!(written.iter().all(|name| files(folder.path()).iter().any(|known| known == name)));
    // Two poses, and the nodes of a drift over a second.
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("flight_true.sbet").len(), 2 * 136);
    assert!(bytes("flight.sbet").len() > 100 * 136 && bytes("smrmsg_flight.out").len() == 2 * 80);
    let found = report(folder.path(), "trajectory DIR/flight_true.sbet --crs EPSG:25832");
    assert_eq!((&found["start_s"], &found["end_s"]), (&100.0.into(), &101.0.into()));
    // The report repeats it.
    fs::write(folder.path().join("report.json"), said.to_string()).unwrap();
    let before = fs::read(folder.path().join("a.csv")).unwrap();
    fs::remove_file(folder.path().join("a.csv")).unwrap();
    stdout(folder.path(), "run DIR/report.json");
    assert!(fs::read(folder.path().join("a.csv")).unwrap() == before);
}

#[test]
fn mistakes_are_said_in_a_sentence() {
    let folder = folder();
    fs::write(folder.path().join("short.sbet"), [0; 100]).unwrap();
    fs::write(folder.path().join("wrong.yaml"), "position: {tau: 1}\n").unwrap();
    let scan = "scan DIR/room.gltf --sensor DIR/pole.yaml --trajectory DIR/pass.csv -o DIR/b.csv";
    for (args, code, expected) in [
        ("trajectory DIR/short.sbet", 1, "has 100 bytes; expected a multiple of 136"),
        ("trajectory DIR/pass.csv --crs EPSG:1", 2, "crs is \"EPSG:1\"; allowed: EPSG:25832"),
        ("trajectory DIR/pass.csv -o DIR/x.las", 2, "allowed: .sbet, .out, .csv or .txt"),
        ("trajectory DIR/pass.csv -o DIR/pass.csv", 2, "would overwrite"),
        ("trajectory DIR/pass.csv --crs local", 1, "which has no projection"),
        ("trajectory DIR/pass.csv --navigation DIR/errors.yaml", 2, "--navigation: allowed: with -o"),
        ("convert DIR/short.sbet -o DIR/x.las", 2, "is the name of a trajectory, not of a cloud"),
        ("convert DIR/pass.csv -o DIR/x.sbet", 2, "is the name of a trajectory, not of a cloud"),
        (&format!("{scan} --navigation DIR/wrong.yaml"), 1, "wrong.yaml: line 1: position.tau: unknown key"),
        (&format!("{scan} --trajectory-out DIR/b.csv"), 2, "b.csv"),
        (&format!("{scan} --trajectory-out DIR/pass.csv"), 2, "would overwrite"),
    ] {
        let output = run(folder.path(), args);
        let said = stderr(&output);
        let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
        assert_eq!(output.status.code(), Some(code), "{args}: {said}");
        assert!(errors.len() == 1 && errors[0].contains(expected), "{args}: {said}");
    }
    let local =
        "scan DIR/room.gltf --sensor DIR/pole.yaml --at 0,0,2 --rpy 0,90,0 -o DIR/c.csv --trajectory-out DIR/c.sbet";
    assert!(stderr(&run(folder.path(), local)).contains("allowed: with the coordinate system of a UTM zone"));
    // With one, a place in the world is a place on the Earth.
    stdout(folder.path(), &format!("{local} --crs EPSG:25832 --offset 500000,5400000,0"));
    assert_eq!(fs::read(folder.path().join("c.sbet")).unwrap().len(), 136);
}
