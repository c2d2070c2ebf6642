//! Radars: cubes, samples, detections as in data sets, and their pictures.

mod common;

use common::{files, report, run, stderr, stdout};
use std::fs;
use std::path::Path;

/// 64 chirps of one transmitter and 128 samples, eight receivers.
const SMALL: &str = "\
name: small
kind: radar
pattern: {type: radar, azimuth_deg: [-60, 60], elevation_deg: [-20, 20], rate_hz: 10}
range: {max_m: 30}
radar:
  power_dbm: 12
  noise_figure_db: 12
  waveform: {type: fmcw, start_ghz: 77, slope_mhz_per_us: 30, samples: 128, sample_rate_mhz: 6, idle_us: 10, \
                     adc_start_us: 4, ramp_us: 30, chirps: 64}
  array: {rx: {count: 8}}
  clutter: false
";
const TURN: &str = "scan DIR/plate.obj --up z --sensor navtech_cts350x --at 0,0,0";
const SCAN: &str = "scan DIR/plate.obj --up z --sensor DIR/small.yaml --at 0,0,0";

/// A folder with `small.yaml` and `plate.obj`, a plate that faces the radar from 20 m.
fn plate() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = "o plate\nv 20 -0.5 -0.5\nv 20 0.5 -0.5\nv 20 0.5 0.5\nv 20 -0.5 0.5\nf 1 4 3 2\n";
    fs::write(folder.path().join("plate.obj"), text).unwrap();
    fs::write(folder.path().join("small.yaml"), SMALL).unwrap();
    folder
}

fn starts_with(file: &Path, bytes: &[u8]) -> bool {
    fs::read(file).unwrap().starts_with(bytes)
}

#[test]
fn one_frame_has_all_files() {
    let folder = plate();
    let folder = folder.path();
    let more =
        "--radar DIR/cube.npz --detections DIR/det.pcd --preview DIR/doppler.png --view range_doppler -o DIR/a.csv";
    let done = report(folder, &format!("{SCAN} {more}"));
    for name in ["cube.npz", "det.pcd", "doppler.png", "a.csv"] {
        let listed = done["outputs"].as_array().unwrap().iter().any(|file| file.as_str().unwrap().ends_with(name));
        assert!(listed && folder.join(name).exists(), "{name}");
    }
    assert!(starts_with(&folder.join("doppler.png"), b"\x89PNG") && starts_with(&folder.join("det.pcd"), b"# .PCD"));
    let cube = fs::read(folder.join("cube.npz")).unwrap();
    let has = |name: &str| cube.windows(name.len()).any(|window| window == name.as_bytes());
    assert!(has("cube.npy") && has("velocity_m_s.npy") && !has("adc.npy"));
    // The scenario of the report requests the same.
    let radar = &done["run"]["outputs"][0]["radar"];
    assert!(radar["frame"].as_str().unwrap().ends_with("cube.npz") && radar["polar"].is_null());
}

#[test]
fn single_frames_have_files_of_their_own() {
    let folder = plate();
    let folder = folder.path();
    let more =
        "--frames 2:3 --single --radar DIR/adc.bin --detections DIR/det.bin --preview DIR/az.png --view range_azimuth";
    stdout(folder, &format!("{SCAN} {more}"));
    let made = ["adc_0002.bin", "adc_0003.bin", "az_0002.png", "az_0003.png", "det_0002.bin", "det_0003.bin"];
    assert_eq!(files(folder), [&made[..], &["plate.obj", "small.yaml"]].concat());
    // 64 chirps of 8 receivers, 128 complex samples of 2 x 16 bits.
    assert_eq!(fs::metadata(folder.join("adc_0002.bin")).unwrap().len(), 64 * 8 * 128 * 4);
    // Seven f32 for each detection, of which the plate is one.
    let detections = fs::metadata(folder.join("det_0002.bin")).unwrap().len();
    assert!(detections > 0 && detections.is_multiple_of(28), "{detections}");
}

#[test]
fn cubes_repeat_for_any_number_of_threads() {
    let folder = plate();
    let cube = |name: &str, options: &str| {
        stdout(folder.path(), &format!("{SCAN} --radar DIR/{name}.npz --radar-parts cube,samples {options}"));
        fs::read(folder.path().join(format!("{name}.npz"))).unwrap()
    };
    let one = cube("one", "--threads 1");
    assert_eq!(one, cube("two", "--threads 2"));
    assert_ne!(one, cube("other", "--seed 1"));
}

#[test]
fn detections_are_explained() {
    let folder = plate();
    let folder = folder.path();
    let explained = stdout(folder, &format!("{SCAN} --explain 0"));
    for words in [
        "detection 0 of frame 0 of small",
        "(sensor frame), range rate ",
        "  Pt         12.00  power of a transmitter, dBm",
        "contribute, ",
        "direct: ",
    ] {
        assert!(explained.contains(words), "{words}:\n{explained}");
    }
    let turn = stdout(folder, &format!("{TURN} --explain 0"));
    assert!(
        turn.contains("detection 0 of frame 0 of navtech_cts350x") && turn.contains("of the turn, at azimuth"),
        "{turn}"
    );
    let output = run(folder, &format!("{SCAN} --explain 5000"));
    assert_eq!(output.status.code(), Some(2));
    let says = stderr(&output);
    assert!(says.contains("detection") && says.contains("5000") && says.contains("a detection of the frame"), "{says}");
    assert_eq!(files(folder), ["plate.obj", "small.yaml"]);
}

#[test]
fn wrong_requests_are_refused_before_the_scan() {
    let folder = plate();
    let folder = folder.path();
    let before = files(folder);
    let lidar = "scan DIR/plate.obj --up z --sensor velodyne_vlp16 --at 0,0,0";
    for (args, says) in [
        (format!("{lidar} --radar DIR/x.npz"), "--radar: the sensor is a lidar; allowed: with radars only"),
        (format!("{lidar} --detections DIR/x.pcd"), "--detections: the sensor is a lidar; allowed: with radars only"),
        (format!("{lidar} --polar DIR/x"), "--polar: the sensor is a lidar; allowed: with radars only"),
        (
            format!("{lidar} --preview DIR/x.png --view polar"),
            "--view polar: the sensor is a lidar; allowed: with radars only",
        ),
        (format!("{SCAN} --polar DIR/x"), "--polar: the radar does not rotate; allowed: with radars of the pattern"),
        (
            format!("{SCAN} --preview DIR/x.png --view polar"),
            "--view polar: the radar does not rotate; allowed: range_doppler, range_azimuth",
        ),
        (
            format!("{TURN} --radar DIR/x.bin"),
            "x.bin: a rotating radar records polar images alone; allowed: .npz and .h5 without --radar-parts",
        ),
        (
            format!("{TURN} --preview DIR/x.png --view range_doppler"),
            "--view range_doppler: the radar rotates; allowed: polar",
        ),
        (format!("{SCAN} --radar DIR/x.las"), "frames of radars are written as .npz, .h5, .hdf5, .bin"),
        (format!("{SCAN} --detections DIR/x.las"), "detections of radars are written as .pcd of nuScenes or .bin"),
        (format!("{SCAN} --radar DIR/x.bin --radar-parts cube"), "x.bin holds samples only; allowed: samples, or .npz"),
        (
            format!("{SCAN} --radar DIR/x.npz --frames 0:2"),
            "--radar: a file holds one frame, and 3 are scanned; allowed: --single",
        ),
        (format!("{SCAN} --radar DIR/x.npz --pings DIR/y.npz"), "--pings: the sensor is a radar"),
        (format!("{SCAN} --radar DIR/x.npz -o DIR/x.npz"), "x.npz: would be written twice"),
    ] {
        let output = run(folder, &args);
        assert_eq!(output.status.code(), Some(2), "{args}\n{}", stderr(&output));
        assert!(stderr(&output).contains(says), "{args}\n{}", stderr(&output));
        assert_eq!(files(folder), before, "{args}");
    }
}
