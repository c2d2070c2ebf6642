//! Scans: files, reports, frames, places.

mod common;

use common::{csv_column, files, report, run, stderr, stdout, write_room, write_single_beam};
use echocast::import;
use echocast::preview::{self, ColorBy, PreviewOptions, View};
use echocast::{Engine, FieldSet, LiveScene, PointCloud, Pose, Report, ScanOptions, Scene, Sensor, Trajectory};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const SCAN: &str = "scan HALL --sensor velodyne_vlp16 --at -6,6,1.2";

#[test]
fn files_appear_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let summary = stdout(
        folder.path(),
        &format!("{SCAN} -o DIR/a.las -o DIR/b.csv -o DIR/c.ply -o DIR/d.npz -o DIR/e.h5 --preview DIR/f.png"),
    );
    assert!(
        summary.contains("points of 28,928 beams (")
            && summary.contains(" rays), 1 frame")
            && summary.contains("a.las"),
        "{summary}"
    );
    assert_eq!(
        files(folder.path()),
        ["a.las", "b.csv", "b.labels.json", "c.labels.json", "c.ply", "d.npz", "e.h5", "f.png"]
    );
    assert!(fs::read(folder.path().join("f.png")).unwrap().starts_with(b"\x89PNG"));
    assert!(fs::read_to_string(folder.path().join("b.labels.json")).unwrap().contains("\"chair\""));

    let quiet = run(folder.path(), &format!("{SCAN} -q -o DIR/x --format csv"));
    assert!(quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty());
    assert_eq!(fs::read(folder.path().join("x")).unwrap(), fs::read(folder.path().join("b.csv")).unwrap());
}

#[test]
fn clouds_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let temporary = folder.path().join("temporary");
    fs::create_dir(&temporary).unwrap();
    let scan = |args: &str| {
        let mut command = common::command(folder.path(), &format!("{SCAN} {args}"));
        command.env("TMPDIR", &temporary);
        command
    };
    for (format, frames) in [("csv", "0"), ("las", "0"), ("npz", "0:2"), ("mcap", "0:2")] {
        let args = format!("--frames {frames} --format {format}");
        let output = scan(&format!("{args} -o - -o DIR/file")).output().unwrap();
        let said = stderr(&output);
        assert!(output.status.success(), "{said}");
        assert!(output.stdout == fs::read(folder.path().join("file")).unwrap(), "{format}");
        assert!(said.contains(" rays), ") && said.contains("  -\n"), "{said}");
        let lost = "warning: -o -: csv cannot hold label names, which are lost; formats that can: las";
        assert_eq!(said.contains(lost), format == "csv", "{said}");
    }
    let output = scan("-o - --format csv --json").output().unwrap();
    let report: Value = serde_json::from_str(stderr(&output)).unwrap();
    assert_eq!(report["outputs"], serde_json::json!(["-"]));
    // A reader that closes the pipe early.
    let mut child = scan("-o - --format csv -q").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    assert_eq!(files(&temporary), [""; 0]);
    let full = fs::File::create("/dev/full").unwrap();
    let output = scan("-o - --format csv -q").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(stderr(&output), "error: stdout: No space left on device (os error 28)\n");
    let output = scan("-o - --format csv").env("TMPDIR", "/nowhere").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("/nowhere"), "{}", stderr(&output));
}

#[test]
fn the_report_says_what_was_done_and_how_to_repeat_it() {
    let folder = tempfile::tempdir().unwrap();
    let report = report(
        folder.path(),
        &format!(
            "{SCAN} --rpy 0,0,90 --set noise.range_sigma_m=0.5 --returns last --seed 9 --threads 2 --profile paper -o \
             DIR/a.csv"
        ),
    );
    assert_eq!(report["version"], env!("CARGO_PKG_VERSION"));
    // Beams at edges are several rays.
    assert!(report["beams"] == 28928 && report["rays"].as_u64() > Some(28928), "{}", report["rays"]);
    assert_eq!(report["points"], csv_column(&folder.path().join("a.csv"), "range").len());
    assert_eq!((&report["frames"], &report["threads"]), (&1.into(), &2.into()));
    for phase in ["load", "build", "scan", "write"] {
        assert!(report["seconds"][phase].as_f64().is_some_and(|seconds| seconds > 0.0), "{phase}");
    }
    assert!(report["warnings"].is_array());
    let outputs: Vec<&str> = report["outputs"].as_array().unwrap().iter().map(|file| file.as_str().unwrap()).collect();
    assert!(outputs[0].ends_with("/a.csv") && outputs[1].ends_with("/a.labels.json") && outputs.len() == 2);

    let run = &report["run"];
    assert!(run["scene"]["files"][0].as_str().unwrap().ends_with("indoor-1.glb"));
    assert_eq!(run["sensors"][0]["sensor"]["name"], "velodyne_vlp16");
    assert_eq!(run["sensors"][0]["sensor"]["noise"]["range_sigma_m"], 0.5);
    assert_eq!(run["sensors"][0]["sensor"]["returns"]["mode"], "last");
    assert_eq!(run["trajectory"]["position_m"], serde_json::json!([-6.0, 6.0, 1.2]));
    assert_eq!((&run["seed"], &run["profile"]), (&9.into(), &"paper".into()));
    assert_eq!(run["fields"].as_array().unwrap().len(), echocast::FieldSet::default().iter().count());
    for key in ["folder", "frames", "reflectance_source", "frame", "order", "organised", "outputs"] {
        assert!(run.get(key).is_some(), "{key}");
    }
}

/// Flags and file are equivalent; a flag replaces the file's weather of its kind.
#[test]
fn weather_comes_by_flag_and_by_file() {
    let folder = tempfile::tempdir().unwrap();
    let yaml = "environment: {rain: {rate_mm_h: 30}, fog: {visibility_m: 60}, dust: {radius_um: 50, per_m3: 1e6, \
                start_m: 2, length_m: 3}}";
    fs::write(folder.path().join("weather.yaml"), yaml).unwrap();
    fs::write(folder.path().join("rain.yaml"), "rain: {rate_mm_h: 1}").unwrap();
    let by_flag = "--rain 30 --fog 60 --dust 50,1e6,2,3";
    for (name, options) in [
        ("clear", String::new()),
        ("flag", by_flag.to_owned()),
        ("file", "--env DIR/weather.yaml".to_owned()),
        ("both", format!("--env DIR/rain.yaml {by_flag}")),
    ] {
        let report = report(folder.path(), &format!("{SCAN} {options} --fields all -o DIR/{name}.csv"));
        assert_eq!(report["run"]["environment"].get("rain").is_some(), name != "clear");
    }
    let text = |name: &str| fs::read(folder.path().join(name).with_extension("csv")).unwrap();
    assert!(text("flag") == text("file") && text("flag") == text("both"));
    assert!(text("flag") != text("clear"));
}

#[test]
fn equal_input_gives_equal_bytes_whatever_the_threads() {
    let folder = tempfile::tempdir().unwrap();
    for (name, options) in [("a", ""), ("b", ""), ("one", "--threads 1"), ("two", "--threads 2"), ("seed", "--seed 1")]
    {
        stdout(folder.path(), &format!("{SCAN} --fields all {options} -o DIR/{name}.npz"));
    }
    let bytes = |name: &str| fs::read(folder.path().join(name).with_extension("npz")).unwrap();
    let first = bytes("a");
    assert!(first == bytes("b") && first == bytes("one") && first == bytes("two"));
    assert!(first != bytes("seed"));
}

/// As the examples of all languages do.
#[test]
fn the_file_is_that_of_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let [hall, ours, theirs] = ["hall.glb", "program.las", "library.las"].map(|name| folder.path().join(name));
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/scenes/indoor-1.glb"), &hall).unwrap();
    stdout(folder.path(), "scan DIR/hall.glb --sensor velodyne_vlp16 --at -6,6,1.2 --seed 7 -o DIR/program.las");
    let scene = Scene::load(hall).unwrap().build().unwrap();
    let at = Trajectory::fixed(Pose::at(-6.0, 6.0, 1.2));
    let options = ScanOptions::default().seed(7);
    scene.scan(&Sensor::preset("velodyne_vlp16").unwrap(), &at, &options).unwrap().write(&theirs).unwrap();
    assert!(fs::read(ours).unwrap() == fs::read(theirs).unwrap());
}

#[test]
fn an_older_file_survives_a_failed_or_killed_write() {
    let folder = tempfile::tempdir().unwrap();
    let old = folder.path().join("a.csv");
    fs::write(&old, "old").unwrap();
    // Files may not grow beyond 64 KiB, whether the signal for that is ignored or not.
    for trap in ["trap '' XFSZ;", ""] {
        let program = common::command(folder.path(), &format!("{SCAN} -o DIR/a.csv"));
        let mut limited = Command::new("sh");
        limited.args(["-c", &format!("{trap} ulimit -c 0; ulimit -f 128; exec \"$@\""), "sh"]);
        let output = limited.arg(program.get_program()).args(program.get_args()).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert_eq!(fs::read_to_string(&old).unwrap(), "old");
        let said = stderr(&output);
        assert!(said.starts_with("error: ") && said.ends_with("a.csv: File too large (os error 27)\n"), "{said}");
        assert_eq!(files(folder.path()), ["a.csv"]);
    }
}

/// Scene, labels, trajectory, environment and sensor are kept, by whatever name they are given.
#[test]
fn what_is_read_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_room(folder.path(), &[]);
    write_single_beam(folder.path());
    fs::write(at("still.csv"), "time,x,y,z,qx,qy,qz,qw\n0,0,0,1,0,0,0,1\n1,0,0,1,0,0,0,1\n").unwrap();
    fs::copy(at("still.csv"), at("still_0007.csv")).unwrap();
    fs::write(at("a.labels.json"), "{}").unwrap();
    fs::write(at("weather.yaml"), "fog: {visibility_m: 100}").unwrap();
    fs::write(at("table.yaml"), "{name: mine, kind: lidar, pattern: {type: table, file: beams.csv, rate_hz: 10}}")
        .unwrap();
    fs::write(at("beams.csv"), "azimuth_deg,elevation_deg\n0,0\n").unwrap();
    for name in ["hard.csv", "hard.png"] {
        fs::hard_link(at("room.gltf"), at(name)).unwrap();
    }
    std::os::unix::fs::symlink("pole.yaml", at("soft.npz")).unwrap();
    let before = files(folder.path());
    let scan = "scan DIR/room.gltf --sensor DIR/pole.yaml";
    for (args, named) in [
        ("--at 0,0,1 -o DIR/hard.csv", "hard.csv"),
        ("--at 0,0,1 -o DIR/soft.npz", "soft.npz"),
        ("--at 0,0,1 -o DIR/a.npz --preview DIR/hard.png", "hard.png"),
        ("--at 0,0,1 -o DIR/x.npz -o DIR/room.gltf --format csv", "room.gltf"),
        ("--at 0,0,1 --env DIR/weather.yaml -o DIR/weather.yaml --format las", "weather.yaml"),
        ("--at 0,0,1 --labels DIR/a.labels.json -o DIR/a.csv", "a.labels.json"),
        ("--trajectory DIR/still.csv -o DIR/still.csv", "still.csv"),
        ("--trajectory DIR/still_0007.csv --frames 0:9 --single -o DIR/still.csv", "still_0007.csv"),
    ] {
        let output = run(folder.path(), &format!("{scan} {args}"));
        let said = stderr(&output);
        assert!(output.status.code() == Some(2) && said.contains("which this run reads"), "{args}: {said}");
        assert!(said.starts_with(&format!("error: {}: would overwrite", at(named).display())), "{args}: {said}");
        assert_eq!(files(folder.path()), before, "{args}");
    }
    // A file that another one refers to.
    let output = run(folder.path(), "scan DIR/room.gltf --sensor DIR/table.yaml --at 0,0,1 -o DIR/beams.csv");
    assert!(stderr(&output).contains("beams.csv, which this run reads"), "{}", stderr(&output));
    assert_eq!(files(folder.path()), before);
    // Frames have names other than the requested file, and LAS has no label file.
    stdout(folder.path(), &format!("{scan} --trajectory DIR/still.csv --frames 0:1 --single -o DIR/still.csv"));
    stdout(folder.path(), &format!("{scan} --at 0,0,1 --labels DIR/a.labels.json -o DIR/a.las"));
}

#[test]
fn an_interrupted_run_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let mut program = common::command(folder.path(), &format!("{SCAN} --frames 0:1000000 --single -o DIR/a.h5"));
    let mut child = program.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    // Once the unfinished file has some size the program is in its frames.
    let unfinished =
        || fs::read_dir(folder.path()).unwrap().flatten().any(|file| file.metadata().is_ok_and(|m| m.len() > 1 << 16));
    while !unfinished() {
        assert!(start.elapsed() < Duration::from_secs(300) && child.try_wait().unwrap().is_none());
        sleep(Duration::from_millis(20));
    }
    let killed = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(files(folder.path()).is_empty(), "{:?}", files(folder.path()));
}

#[test]
fn the_only_camera_is_the_default_place() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path(), &["Down"]);
    write_single_beam(folder.path());
    let scan = "scan DIR/room.gltf --sensor DIR/pole.yaml --fields x,y,z,range";
    let range = |args: &str| {
        stdout(folder.path(), &format!("{scan} {args} -o DIR/a.csv"));
        csv_column(&folder.path().join("a.csv"), "range")
    };
    assert_eq!(range(""), [2.0]);
    assert_eq!(range("--camera Down"), [2.0]);
    // Pitch 30 degrees down from 1 m above the floor.
    let ranges = range("--at 1,1,1 --rpy 0,30,0");
    assert!((ranges[0] - 2.0).abs() < 1e-5, "{ranges:?}");
    assert!(range("--at 1,1,1").is_empty());
}

#[test]
fn frames_follow_the_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path(), &[]);
    write_single_beam(folder.path());
    // Rises from 1 m to 2 m within a second, looking straight down; the clock counts from 1970.
    let (w, y) = (std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2);
    fs::write(folder.path().join("rise.txt"), format!("1700000000 0 0 1 0 {y} 0 {w}\n1700000001 0 0 2 0 {y} 0 {w}\n"))
        .unwrap();
    let scan = "scan DIR/room.gltf --sensor DIR/pole.yaml --trajectory DIR/rise.txt --fields x,y,z,range,time,frame";
    let close = |found: Vec<f64>, expected: &[f64]| {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} is not {expected:?}");
    };

    let merged = report(folder.path(), &format!("{scan} --frames 0:8:4 -o DIR/a.csv -o DIR/a.las -o DIR/a.laz"));
    assert_eq!((&merged["frames"], &merged["rays"], &merged["points"]), (&3.into(), &3.into(), &3.into()));
    let column = |file: &str, name: &str| csv_column(&folder.path().join(file), name);
    close(column("a.csv", "range"), &[1.0, 1.4, 1.8]);
    close(column("a.csv", "time"), &[0.0, 0.4, 0.8]);
    close(column("a.csv", "frame"), &[0.0, 4.0, 8.0]);
    // LAS has the time of the clock.
    for file in ["a.las", "a.laz"] {
        let cloud = import::read(&folder.path().join(file), &mut Report::default()).unwrap();
        close(cloud.columns().time().to_vec(), &[1700000000.0, 1700000000.4, 1700000000.8]);
    }

    let single = report(folder.path(), &format!("{scan} --frames 1:2 --fps 4 --single -o DIR/b.csv -o DIR/b.h5"));
    assert_eq!(single["points"], 2);
    close(column("b_0001.csv", "range"), &[1.25]);
    close(column("b_0002.csv", "range"), &[1.5]);
    let written: Vec<String> = files(folder.path()).into_iter().filter(|name| name.starts_with('b')).collect();
    assert_eq!(written, ["b.h5", "b_0001.csv", "b_0001.labels.json", "b_0002.csv", "b_0002.labels.json"]);

    let whole = report(folder.path(), &format!("{scan} -o DIR/d.csv"));
    assert_eq!((&whole["frames"], &whole["warnings"]), (&10.into(), &serde_json::json!([])));
    close(column("d.csv", "frame"), &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
    let slower = report(folder.path(), &format!("{scan} --fps 4 -o DIR/d.csv"));
    assert_eq!(slower["frames"], 4);
    for (frames, number, range) in [("0:0", 0.0, 1.0), ("5", 5.0, 1.5)] {
        stdout(folder.path(), &format!("{scan} --frames {frames} -o DIR/d.csv"));
        close(column("d.csv", "frame"), &[number]);
        close(column("d.csv", "range"), &[range]);
    }

    let late = report(folder.path(), &format!("{scan} --frames 0:20:20 -o DIR/c.csv"));
    close(column("c.csv", "range"), &[1.0, 2.0]);
    assert!(late["warnings"][0].as_str().unwrap().contains("trajectory ends at 1.000 s"), "{late}");
}

/// A scanner of a drone, ten metres along y within a second, 30 m above the floor.
#[test]
fn a_line_scanner_that_looks_down_scans_across_its_track() {
    let folder = tempfile::tempdir().unwrap();
    let floor = "o floor\nv -99 -99 0\nv 99 -99 0\nv 99 99 0\nv -99 99 0\nf 1 2 3 4\n";
    fs::write(folder.path().join("floor.obj"), floor).unwrap();
    fs::write(
        folder.path().join("flight.csv"),
        "time_s,x,y,z,roll_deg,pitch_deg,yaw_deg\n0,0,0,30,0,0,90\n1,0,10,30,0,0,90\n",
    )
    .unwrap();
    let scan = "scan DIR/floor.obj --up z --sensor riegl_vux1uav22 --set pattern.mechanism.window_deg=[-50,50] \
                --trajectory DIR/flight.csv --fields x,y,z,beam,frame";
    stdout(folder.path(), &format!("{scan} -o DIR/strip.csv"));
    let column = |name: &str| csv_column(&folder.path().join("strip.csv"), name);
    let (x, y, beam, frame) = (column("x"), column("y"), column("beam"), column("frame"));
    assert_eq!(frame.last(), Some(&9.0));
    // To both sides, but for a step of 0.131 degrees.
    let half = 30.0 * 50f64.to_radians().tan();
    let [least, most] = [f64::min, f64::max].map(|pick| x.iter().copied().fold(0.0, pick));
    assert!((least + half).abs() < 0.3 && (most - half).abs() < 0.3, "{least} to {most} is not {half} m");
    // Of 200 lines a second and 2750 pulses a line, those in 100 of 360 degrees; the aircraft flies on meanwhile.
    for ((y, beam), frame) in y.iter().zip(&beam).zip(&frame) {
        let start = frame + (beam / 763.0).floor() * 0.05;
        assert!((start - 1e-3..start + 0.051).contains(y), "{y} in the line at {start}");
    }
}

#[test]
fn colours_that_a_sensor_has_no_values_for_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    stdout(folder.path(), "generate seabed --size 20,20 --cell 0.5 --boulders 5 -q -o DIR/lake.glb");
    let lake = "scan DIR/lake.glb --sensor mbes_400 --at 0,0,-2";
    for (scan, color, says) in [
        (SCAN, "doppler", "--color doppler: the sensor does not measure velocities; allowed: with a section doppler"),
        (lake, "doppler", "--color doppler: the sensor does not measure velocities; allowed: --color radial_velocity"),
    ] {
        let output = run(folder.path(), &format!("{scan} --preview DIR/a.png --color {color}"));
        assert_eq!(output.status.code(), Some(2), "{color}");
        assert!(stderr(&output).contains(says), "{}", stderr(&output));
    }
    assert_eq!(files(folder.path()), ["lake.glb"]);
}

#[test]
fn velocities_come_from_sensors_that_measure_them() {
    let folder = tempfile::tempdir().unwrap();
    for (options, expected) in [
        ("", false),
        ("--set doppler.sigma_m_s=0.1", true),
        ("--set doppler.sigma_m_s=0.1 --fields x,default", true),
        ("--set doppler.sigma_m_s=0.1 --fields x,y", false),
        ("--fields x,doppler", true),
    ] {
        stdout(folder.path(), &format!("{SCAN} {options} -o DIR/a.csv"));
        let text = fs::read_to_string(folder.path().join("a.csv")).unwrap();
        assert_eq!(text.lines().next().unwrap().contains("doppler"), expected, "{options}");
    }
}

#[test]
fn an_empty_cloud_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let report = report(folder.path(), "scan HALL --sensor paper/generic_lidar --at 5000,0,1 -o DIR/a.csv");
    assert_eq!(report["points"], 0);
    let warnings = report["warnings"].to_string();
    assert!(
        warnings.contains("no beam has a return: the sensor starts at 5000.0,0.0,1.0 and sees 0 to 120 m"),
        "{warnings}"
    );
}

/// A sensor with a large minimum range finds nothing in a small room.
#[test]
fn a_scene_nearer_than_the_sensor_sees_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path(), &[]);
    write_single_beam(folder.path());
    let scan = "scan DIR/room.gltf --at 0,0,1 --sensor DIR/pole.yaml --set range.min_m=500 -o DIR/a.csv";
    let report = report(folder.path(), scan);
    assert_eq!(report["points"], 0);
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains("starts at 0.0,0.0,1.0 and sees 500 m and more"), "{warnings}");
}

#[test]
fn an_empty_cloud_within_range_is_not_blamed_on_the_range() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path(), &[]);
    write_single_beam(folder.path());
    let pole = fs::read_to_string(folder.path().join("pole.yaml")).unwrap();
    let dull = "detection: {model: radar_equation, reflectance: 0.1, at_m: 1}\n";
    fs::write(folder.path().join("dull.yaml"), pole + dull).unwrap();
    let warnings = |args: &str| {
        let report = report(folder.path(), &format!("scan DIR/room.gltf --at 0,0,1 {args} -o DIR/a.csv"));
        report["warnings"].to_string()
    };
    let aside = warnings("--sensor DIR/pole.yaml");
    assert!(aside.contains("though the scene is within range of the sensor"), "{aside}");
    assert!(aside.contains("its beams miss the scene; --explain BEAM"), "{aside}");
    // The floor is hit, but far too dark in this fog.
    let weak = warnings("--sensor DIR/dull.yaml --rpy 0,90,0 --fog 0.5");
    assert!(weak.contains("echoes are below its detection limit, or the weather attenuates their light"), "{weak}");
    assert!(!weak.contains("reaches from"), "{weak}");
}

/// The picture has the columns that it shows, the files have the requested ones.
#[test]
fn pictures_need_no_columns_in_the_files() {
    let folder = tempfile::tempdir().unwrap();
    for color in ["label", "cause", "intensity", "range", "height", "velocity", "radial_velocity"] {
        let args = format!("{SCAN} --fog 20 --fields channel -o DIR/a.csv --preview DIR/{color}.png --color {color}");
        let report = report(folder.path(), &args);
        assert!(!report["warnings"].to_string().contains("preview: "), "{report}");
        assert_eq!(report["run"]["fields"], serde_json::json!(["channel"]));
        let text = fs::read_to_string(folder.path().join("a.csv")).unwrap();
        assert!(text.starts_with("channel\n"), "{color}");
    }
    let measured = "--set doppler.sigma_m_s=0.05 --fields channel -o DIR/c.csv --preview DIR/c.png --color doppler";
    assert!(!report(folder.path(), &format!("{SCAN} {measured}"))["warnings"].to_string().contains("preview: "));
    let merged = format!("{SCAN} --frames 0:1 --fields x,y,z -o DIR/b.csv --preview DIR/b.png --color cause");
    assert!(!report(folder.path(), &merged)["warnings"].to_string().contains("preview: "));
    assert!(fs::read_to_string(folder.path().join("b.csv")).unwrap().starts_with("x,y,z\n"));
}

/// A picture of several frames shows the points of all of them, where they were in the world; one in the view of the
/// sensor shows the last. Single frames have pictures with their numbers.
#[test]
fn what_moves_leaves_a_trail_in_pictures() {
    let folder = tempfile::tempdir().unwrap();
    stdout(folder.path(), "generate street --cars 3 --seconds 8 -q -o DIR/street.glb");
    let scan = "scan DIR/street.glb --sensor velodyne_vlp16 --camera Lidar --color velocity";
    for view in ["top", "perspective", "range"] {
        let [merged, single] = ["--frames 0:8:4", "--frames 0:8:4 --single"].map(|frames| {
            let name = format!("{view}{}", if frames.ends_with("single") { "" } else { "_all" });
            report(folder.path(), &format!("{scan} --view {view} {frames} --preview DIR/{name}.png"))
        });
        let outputs = |report: &Value| report["outputs"].as_array().unwrap().len();
        assert_eq!((outputs(&merged), outputs(&single)), (1, 3));
    }
    let names = [0, 4, 8].map(|frame| ["perspective", "range", "top"].map(|view| format!("{view}_{frame:04}.png")));
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    names.iter().flatten().for_each(|name| assert!(bytes(name).starts_with(b"\x89PNG"), "{name}"));
    assert_eq!(bytes("range_all.png"), bytes("range_0008.png"));
    assert_ne!(bytes("range_0004.png"), bytes("range_0008.png"));

    // The same with the library.
    let scene = Scene::load(folder.path().join("street.glb")).unwrap();
    let sensor = Sensor::preset("velodyne_vlp16").unwrap();
    let (fps, length) = (1.0 / sensor.beams().period, sensor.scan_time());
    let path = scene.camera_path("Lidar", 0.0, 8.0 / fps + length).unwrap();
    let mut live = LiveScene::new(&Engine::new().unwrap());
    live.add_scene(&scene).unwrap();
    let mut all = PointCloud::default();
    for frame in [0, 4, 8] {
        let start_time = f64::from(frame) / fps;
        live.set_time(start_time, length).unwrap();
        let fields = FieldSet::parse("default,velocity,cause").unwrap();
        let options = ScanOptions::default().frame(frame).start_time(start_time).fields(fields);
        all.append(&live.commit().unwrap().scan(&sensor, &path, &options).unwrap()).unwrap();
    }
    for view in [View::Top, View::Perspective] {
        let options = PreviewOptions::default().view(view).color(ColorBy::Velocity);
        let report = preview::write(&all, &folder.path().join("mine.png"), &options).unwrap();
        assert!(report.warnings.is_empty(), "{report:?}");
        assert!(bytes("mine.png") == bytes(&format!("{}_all.png", view.name())), "{view:?}");
    }

    let warnings = |args: &str| report(folder.path(), &format!("{scan} {args}"))["warnings"].to_string();
    let piled = "--frame sensor --frames 0:4:4 --preview DIR/piled.png";
    assert!(warnings(piled).contains("--frame world shows them in their places"));
    for other in ["--single", "--view range"] {
        assert!(!warnings(&format!("{piled} {other}")).contains("--frame world"), "{other}");
    }
}

#[test]
fn points_can_be_organised_ordered_and_in_the_sensor_frame() {
    let folder = tempfile::tempdir().unwrap();
    let column = |file: &str, name: &str| csv_column(&folder.path().join(file), name);
    let organised = report(folder.path(), &format!("{SCAN} --organised -o DIR/a.csv"));
    let ranges = column("a.csv", "range");
    let returns = ranges.iter().filter(|range| !range.is_nan()).count();
    assert!(ranges.len() == 28928 && (1..28928).contains(&returns));
    assert_eq!(organised["points"], returns);
    let fewer = report(folder.path(), &format!("{SCAN} --organised --order beam --fields x,y,z -o DIR/d.csv"));
    assert_eq!(fewer["points"], returns);

    stdout(folder.path(), &format!("{SCAN} --order time -o DIR/b.csv"));
    let times = column("b.csv", "time");
    assert!(times.is_sorted() && times.len() < 28928);

    stdout(folder.path(), &format!("{SCAN} --frame sensor --fields all -o DIR/c.csv"));
    let (x, y, z) = (column("c.csv", "x"), column("c.csv", "y"), column("c.csv", "z"));
    for (row, range) in column("c.csv", "range").iter().enumerate() {
        let length = (x[row].powi(2) + y[row].powi(2) + z[row].powi(2)).sqrt();
        assert!((length - range).abs() < 1e-4 * range, "row {row}: {length} is not {range}");
    }
}

#[test]
fn bags_hold_what_was_requested() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    fs::write(dir.join("drive.txt"), "0 -6 6 1.2 0 0 0 1\n0.1 -5.9 6 1.2 0 0 0 1\n0.2 -5.7 6 1.2 0 0 0 1\n").unwrap();
    let scan = "scan HALL --sensor hokuyo_ust10lx --trajectory DIR/drive.txt --fields x,y,z,category_id";
    let report = report(dir, &format!("{scan} -o DIR/a.mcap --messages scan,imu,odom,clock --imu ideal"));
    // Topics are told at the end, where nothing is compressed.
    let topics = |name: &str| -> Vec<&str> {
        let bytes = fs::read(dir.join(name)).unwrap();
        let has = |topic: &&str| bytes.windows(topic.len()).any(|window| window == topic.as_bytes());
        ["/points", "/scan", "/echoes", "/livox/lidar", "/imu", "/odom", "/clock", "/tf_static"]
            .into_iter()
            .filter(has)
            .collect()
    };
    assert_eq!(topics("a.mcap"), ["/scan", "/imu", "/odom", "/clock", "/tf_static"]);
    // The report repeats it.
    let mut run_again = report["run"].clone();
    let output = &mut run_again["outputs"][0];
    assert_eq!((&output["messages"][1], &output["imu"]), (&"imu".into(), &"ideal".into()));
    output["files"] = serde_json::json!(["again.mcap"]);
    run_again["folder"] = dir.to_str().into();
    fs::write(dir.join("again.json"), run_again.to_string()).unwrap();
    stdout(dir, "run DIR/again.json -q");
    assert!(fs::read(dir.join("again.mcap")).unwrap() == fs::read(dir.join("a.mcap")).unwrap());
    stdout(dir, &format!("{scan} --frames 0:2 --single -o DIR/b.mcap"));
    assert_eq!(topics("b_0001.mcap"), ["/points", "/scan"]);
    for (args, words) in [
        (
            "--sensor velodyne_vlp16 -o DIR/c.mcap --messages scan",
            "the beams of the sensor velodyne_vlp16 are not in one plane",
        ),
        ("--sensor sss_450 -o DIR/c.mcap --messages livox", "the sensor is a sonar; allowed: LiDARs"),
        (
            "--sensor hokuyo_ust10lx -o DIR/c.las --messages scan",
            "there is no bag; allowed: with a cloud file in .mcap",
        ),
        ("--sensor hokuyo_ust10lx -o DIR/c.mcap --messages lidar", "lidar"),
        ("--sensor hokuyo_ust10lx -o DIR/c.mcap --imu ideal", "--messages"),
    ] {
        let output = run(dir, &format!("scan missing.glb --at 0,0,1 {args}"));
        assert!(!output.status.success() && stderr(&output).contains(words), "{args}: {}", stderr(&output));
        assert!(!dir.join("c.mcap").exists(), "{args}");
    }
    run_again["outputs"][0]["messages"] = serde_json::json!(["scans"]);
    fs::write(dir.join("wrong.json"), run_again.to_string()).unwrap();
    let wrong = run(dir, "run DIR/wrong.json");
    assert!(stderr(&wrong).contains("messages: \"scans\" is none; allowed: points, scan, "), "{}", stderr(&wrong));
}

#[test]
fn units_and_up_axis_of_obj_files_can_be_set() {
    let folder = tempfile::tempdir().unwrap();
    // A wall at 4 units along the file's z axis, which may or may not be its up axis.
    fs::write(folder.path().join("wall.obj"), "o Wall\nv -9 -9 4\nv 9 -9 4\nv 9 9 4\nv -9 9 4\nf 1 2 3 4\n").unwrap();
    write_single_beam(folder.path());
    for (args, range) in [
        // z is up: the wall is a ceiling.
        ("--rpy 0,-90,0", 4.0),
        ("--rpy 0,-90,0 --scale 0.01", 0.04),
        // y is up: the file's z is the world's -y.
        ("--up y --rpy 0,0,-90", 4.0),
    ] {
        stdout(folder.path(), &format!("scan DIR/wall.obj --sensor DIR/pole.yaml --at 0,0,0 {args} -o DIR/a.csv"));
        let ranges = csv_column(&folder.path().join("a.csv"), "range");
        assert!(ranges.len() == 1 && (ranges[0] - range).abs() < 1e-5, "{args}: {ranges:?}");
    }
}

#[test]
fn several_scenes_are_one() {
    let folder = tempfile::tempdir().unwrap();
    let alone = report(folder.path(), &format!("{SCAN} -o DIR/a.csv"));
    let both = report(folder.path(), "scan HALL FLAT --sensor velodyne_vlp16 --at -6,6,1.2 -o DIR/b.csv");
    assert_ne!(alone["points"], both["points"]);
    let names = fs::read_to_string(folder.path().join("b.labels.json")).unwrap();
    assert!(names.contains("\"whiteboard\"") && names.contains("\"IKEA_sofa_EKTORP\""), "{names}");
    assert_eq!(both["run"]["scene"]["files"].as_array().unwrap().len(), 2);
}

/// A beam can be many rays.
#[test]
fn beams_and_rays_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path(), &[]);
    let scan = "scan DIR/room.gltf --sensor velodyne_vlp16 --at 0,0,1.5 --frames 0:1 -o DIR/a.csv --set beam.sub_rays=";
    let of = |rays: &str| {
        let report = report(folder.path(), &format!("{scan}{rays}"));
        assert_eq!(report["beams"], 2 * 28928);
        report["rays"].as_u64().unwrap()
    };
    assert_eq!((of("1"), of("7")), (2 * 28928, 2 * 7 * 28928));
    // A ray for each, one at the rim of those that hit anything, and 64 for those at the end of the floor.
    let adaptive = of("adaptive");
    assert!((2 * 28928 + 10_000..2 * 3 * 28928).contains(&adaptive), "{adaptive}");
    let said = stdout(folder.path(), &format!("{scan}7"));
    assert!(said.contains("points of 57,856 beams (404,992 rays), 2 frames"), "{said}");
}

#[test]
fn bench_compares_with_the_bare_loop() {
    let folder = tempfile::tempdir().unwrap();
    let figures = report(folder.path(), "bench HALL --sensor velodyne_vlp16 --at -6,6,1.2 --threads 2");
    assert_eq!((&figures["beams"], &figures["threads"]), (&28928.into(), &2.into()));
    assert!(figures["rays"].as_u64() > Some(28928), "{}", figures["rays"]);
    for key in ["seconds_per_scan", "cpu_seconds_per_scan", "bare_cpu_seconds_per_scan"] {
        let [best, median] = ["best", "median"].map(|name| figures[key][name].as_f64().expect(key));
        assert!(0.0 < best && best <= median, "{key}: {best} {median}");
    }
    assert!(figures["ratio"].as_f64().is_some_and(|ratio| ratio > 0.0));
}

/// A building of 8 x 6 x 4 m on the ground of the room, whose sides face outwards, or inwards.
fn write_house(folder: &Path, inwards: bool) {
    let mut text = String::from("o Ground\nv -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\no House_3\n");
    for corner in 0..8 {
        let at = |axis: u32, low: i32, high: i32| if corner >> axis & 1 == 1 { high } else { low };
        text.push_str(&format!("v {} {} {}\n", at(0, -4, 4), at(1, -3, 3), at(2, 0, 4)));
    }
    // Walls and roof, no floor.
    for mut side in [[4, 8, 6, 2], [1, 5, 7, 3], [1, 2, 6, 5], [3, 7, 8, 4], [5, 6, 8, 7]] {
        // The list is for x = low, high and so on; sides that face inwards have the reverse order.
        if matches!(side, [4, ..]) {
            side = [2, 4, 8, 6];
        }
        if inwards {
            side.reverse();
        }
        text.push_str(&format!("f {}\n", side.map(|corner| (corner + 4).to_string()).join(" ")));
    }
    fs::write(folder.join("house.obj"), text).unwrap();
}

#[test]
fn a_sensor_in_a_wall_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let warned = |args: &str| {
        let report = report(folder, &format!("scan DIR/house.obj {args} -o DIR/a.npz"));
        report["warnings"].as_array().unwrap().iter().map(|warning| warning.as_str().unwrap().to_owned()).collect()
    };
    let inside = |warnings: Vec<String>| warnings.into_iter().find(|warning| warning.contains("inside of"));
    write_house(folder, false);
    fs::write(folder.join("way.txt"), "0 1 1 1.5 0 0 0 1\n0.1 9 1 1.5 0 0 0 1\n").unwrap();
    fs::write(folder.join("back.txt"), "0 9 1 1.5 0 0 0 1\n0.1 1 1 1.5 0 0 0 1\n").unwrap();
    for args in
        ["--sensor vlp16 --at 1,1,1.5", "--sensor kinect_v2 --at 1,1,1.5", "--sensor vlp16 --trajectory DIR/way.txt"]
    {
        let warning = inside(warned(args)).expect(args);
        let starts = "the sensor at 1.00,1.00,1.50 seems to be inside of \"House_3\": 100 % of the directions";
        assert!(warning.starts_with(starts) && warning.contains("--preview"), "{warning}");
    }
    // Beside it, in the ground, far away, and where the walls face inwards.
    assert_eq!(inside(warned("--sensor vlp16 --at 9,1,1.5")), None);
    assert_eq!(inside(warned("--sensor vlp16 --trajectory DIR/back.txt")), None);
    assert_eq!(inside(warned("--sensor vlp16 --at 0,0,500")), None);
    assert!(inside(warned("--sensor vlp16 --at 20,1,-1")).unwrap().contains("\"Ground\""));
    write_house(folder, true);
    assert_eq!(inside(warned("--sensor vlp16 --at 1,1,1.5")), None);
}

const EYE: &str = "name: eye
kind: tof
pattern: {type: pinhole, resolution: [64, 48], fov_deg: [70, 55]}
range: {max_m: 6}
";

#[test]
fn images_are_files_of_each_frame_whatever_the_points() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    fs::write(dir.join("eye.yaml"), EYE).unwrap();
    let scan = "scan FLAT --sensor DIR/eye.yaml --at 0,0,1.2 --frames 3:5:2";
    let images = "--images DIR/images --annotations coco,voc,panoptic";
    let layers = ["category", "color", "depth", "instance", "panoptic"];
    let report = report(dir, &format!("{scan} {images} -o DIR/a.npz"));
    let mut expected: Vec<String> =
        layers.iter().flat_map(|layer| ["0003", "0005"].map(|frame| format!("{layer}_{frame}.png"))).collect();
    expected
        .extend(["coco.json", "color_0003.xml", "color_0005.xml", "images.json", "panoptic.json"].map(str::to_owned));
    expected.sort();
    assert_eq!(files(&dir.join("images")), expected);
    assert_eq!(report["outputs"].as_array().unwrap().len(), expected.len() + 1);
    let bytes = |name: &str| -> Vec<Vec<u8>> {
        files(&dir.join(name)).iter().map(|file| fs::read(dir.join(name).join(file)).unwrap()).collect()
    };
    let first = bytes("images");
    // Neither the cloud nor the images depend on each other.
    stdout(dir, &format!("{scan} -o DIR/b.npz"));
    assert!(fs::read(dir.join("a.npz")).unwrap() == fs::read(dir.join("b.npz")).unwrap());
    for other in ["--organised", "--order time --frame sensor", "--fields x,y,z"] {
        fs::remove_dir_all(dir.join("images")).unwrap();
        stdout(dir, &format!("{scan} {images} {other} -o DIR/a.npz"));
        assert!(bytes("images") == first, "{other}");
    }
    // The report repeats it, over existing files.
    fs::write(dir.join("run.json"), report["run"].to_string()).unwrap();
    stdout(dir, "run DIR/run.json");
    assert!(bytes("images") == first);
}

#[test]
fn impossible_images_are_refused_before_anything_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    fs::write(dir.join("eye.yaml"), EYE).unwrap();
    for (args, words) in [
        ("--sensor livox_avia --images DIR/i", "no rows and columns"),
        ("--sensor sss_450 --images DIR/i", "the sensor is a sonar"),
        ("--sensor DIR/eye.yaml --images DIR/none/i", "none/i: No such file"),
        ("--sensor DIR/eye.yaml --images DIR/eye.yaml", "eye.yaml"),
        ("--sensor DIR/eye.yaml --images DIR/i --depth-range 2,1", "depth range is 2,1"),
        ("--sensor DIR/eye.yaml --images DIR/i --depth-range 2", "two distances"),
        ("--sensor DIR/eye.yaml --images DIR/i --image-layers depth,dept", "dept"),
        ("--sensor DIR/eye.yaml --images DIR/i --image-layers depth,depth", "each once"),
        ("--sensor DIR/eye.yaml --images DIR --boxes DIR/images.json", "is the name that --images gives"),
        ("--sensor DIR/eye.yaml -o DIR/a.npz --annotations coco", "--images"),
    ] {
        let output = run(dir, &format!("scan missing.glb --at 0,0,1 {args}"));
        assert!(!output.status.success() && stderr(&output).contains(words), "{args}: {}", stderr(&output));
        assert_eq!(files(dir), ["eye.yaml"], "{args}");
    }
    // What the scan reads is not overwritten.
    for name in ["images.json", "depth_0000.png", "depth_12345.png"] {
        let labels = dir.join(name);
        fs::write(&labels, "{}").unwrap();
        let output = run(dir, &format!("scan FLAT --sensor DIR/eye.yaml --at 0,0,1 --images DIR --labels DIR/{name}"));
        let words = "would overwrite";
        assert!(!output.status.success() && stderr(&output).contains(words), "{name}: {}", stderr(&output));
        assert_eq!(fs::read_to_string(&labels).unwrap(), "{}");
        fs::remove_file(labels).unwrap();
    }
}
