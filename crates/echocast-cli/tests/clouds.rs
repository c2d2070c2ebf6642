//! Clouds that are read: converted, described, drawn.

mod common;

use common::{files, report, run, stderr, stdout};
use echocast::cloud::{Record, Records};
use echocast::{FieldSet, PointCloud};
use std::fs;
use std::io::Write as _;
use std::process::Stdio;
use std::sync::Arc;

const SCAN: &str = "scan HALL --sensor velodyne_vlp16 --at -6,6,1.2 --fields default,true_range,cause";

#[test]
fn clouds_go_from_format_to_format() {
    let folder = tempfile::tempdir().unwrap();
    stdout(folder.path(), &format!("{SCAN} -o DIR/a.laz -o DIR/z.npz"));
    // Through formats that hold all columns; label names are kept.
    let mut from = "a.laz".to_owned();
    for to in ["b.pcd", "c.ply", "d.e57", "e.h5", "f.csv", "g.npz", "h.las"] {
        let said = run(folder.path(), &format!("convert DIR/{from} -o DIR/{to}"));
        assert!(said.status.success() && stderr(&said).is_empty(), "{to}: {}", stderr(&said));
        from = to.to_owned();
    }
    let read = |name: &str| PointCloud::read(folder.path().join(name)).unwrap();
    let (first, last) = (read("z.npz"), read("h.las"));
    assert_eq!((first.len(), first.fields(), &first.labels), (last.len(), last.fields(), &last.labels));
    for (a, b) in [
        (first.columns().category_id(), last.columns().category_id()),
        (first.columns().part_id(), last.columns().part_id()),
        (first.columns().instance_id(), last.columns().instance_id()),
    ] {
        assert!(a == b);
    }
    assert!(
        first.columns().true_range() == last.columns().true_range()
            && first.columns().cause() == last.columns().cause()
    );
    assert!((0..first.len()).all(|row| (first.position(row) - last.position(row)).abs().max_element() < 5e-4));

    // What the simplest LAS cannot hold is reported.
    let said = run(folder.path(), "convert DIR/h.las -o DIR/i.las --format las2");
    assert!(stderr(&said).contains("las2: cannot hold the columns range, part_id"), "{}", stderr(&said));
    let plain = read("i.las");
    let held = FieldSet::parse("x,y,z,intensity,category_id,return_number,return_count,red,green,blue").unwrap();
    assert_eq!((plain.fields(), plain.columns().category_id()), (held, last.columns().category_id()));
    assert_eq!(plain.labels.category, last.labels.category);
}

#[test]
fn clouds_come_from_standard_input_and_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let temporary = folder.path().join("temporary");
    fs::create_dir(&temporary).unwrap();
    stdout(folder.path(), &format!("{SCAN} -o DIR/a.las -o DIR/a.h5 -o DIR/a.csv"));
    let piped = |args: &str, input: &[u8]| {
        let mut command = common::command(folder.path(), args);
        command.env("TMPDIR", &temporary).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        child.stdin.take().unwrap().write_all(input).unwrap();
        child.wait_with_output().unwrap()
    };
    for name in ["a.las", "a.h5"] {
        let bytes = fs::read(folder.path().join(name)).unwrap();
        let direct = run(folder.path(), &format!("convert DIR/{name} -o DIR/direct.npz"));
        assert!(direct.status.success(), "{}", stderr(&direct));
        let output = piped("convert - -o - --format npz", &bytes);
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(stderr(&output).contains("-: ") && stderr(&output).ends_with(" points as npz\n  -\n"), "{name}");
        assert!(output.stdout == fs::read(folder.path().join("direct.npz")).unwrap(), "{name}");
    }
    let las = fs::read(folder.path().join("a.las")).unwrap();
    let message = String::from_utf8(piped("info -", &las).stdout).unwrap();
    let of_file = stdout(folder.path(), "info DIR/a.las");
    assert_eq!(message.split_once('\n').unwrap().1, of_file.split_once('\n').unwrap().1);
    assert!(piped("preview - -o DIR/a.png", &las).status.success() && folder.path().join("a.png").exists());
    let laz = piped("convert - -o - --format laz", &las);
    assert!(laz.status.success() && piped("info -", &laz.stdout).status.success(), "{}", stderr(&laz));
    let lost = piped("convert - -o - --format csv", &las);
    assert!(stderr(&lost).contains("warning: -o -: csv cannot hold label names"), "{}", stderr(&lost));
    let cut = piped("convert - -o - --format npz", &las[..1000]);
    assert_eq!(cut.status.code(), Some(1));
    assert!(cut.stdout.is_empty() && stderr(&cut).starts_with("error: standard input: "), "{}", stderr(&cut));
    assert_eq!(files(&temporary), [""; 0]);
}

#[test]
fn columns_of_text_are_named_or_guessed_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("a.xyz");
    fs::write(&place, "1 2 3 0.5\n4 5 6 0.25\n").unwrap();
    let guessed = run(folder.path(), "convert DIR/a.xyz -o DIR/a.npz");
    let message =
        "warning: csv: no header names its columns, which are taken as x,y,z,intensity; --columns overrides that";
    assert!(guessed.status.success() && stderr(&guessed).contains(message), "{}", stderr(&guessed));
    let named = run(folder.path(), "convert DIR/a.xyz -o DIR/b.npz --columns x,y,z,range");
    assert!(named.status.success() && stderr(&named).is_empty(), "{}", stderr(&named));
    let read = |name: &str| PointCloud::read(folder.path().join(name)).unwrap();
    assert_eq!(
        (read("a.npz").columns().intensity(), read("b.npz").columns().range()),
        (&[0.5, 0.25][..], &[0.5, 0.25][..])
    );
    assert!(stdout(folder.path(), "info DIR/a.xyz --columns x,y,z").contains("columns     3"));
    fs::write(folder.path().join("scene.obj"), "v 0 0 0\n").unwrap();
    for (args, code, message) in [
        ("convert DIR/a.xyz -o DIR/c.npz --columns x,y,colour", 2, "--columns: "),
        ("convert DIR/a.npz -o DIR/c.npz --columns x,y,z", 1, "columns is given for NPZ"),
        ("info DIR/scene.obj DIR/scene.obj --columns x,y,z", 2, "--columns: is for clouds as text"),
    ] {
        let output = run(folder.path(), args);
        assert!(output.status.code() == Some(code) && stderr(&output).contains(message), "{args}: {}", stderr(&output));
    }
    assert!(!folder.path().join("c.npz").exists());
}

#[test]
fn coordinate_systems_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let system = "PROJCS[\"WGS 84 / UTM zone 33N\",GEOGCS[\"WGS 84\"]]\0";
    let record = |user: &str, id, data: &str| Record {
        user: user.to_owned(),
        id,
        description: String::new(),
        data: data.as_bytes().to_vec(),
    };
    fs::write(folder.path().join("a.csv"), "x,y,z\n1,2,3\n").unwrap();
    let mut cloud = PointCloud::read(folder.path().join("a.csv")).unwrap();
    let all = vec![record("LASF_Projection", 2112, system), record("liblas", 5, "abc")];
    cloud.records = Arc::new(Records::default().all(all));
    cloud.write(folder.path().join("a.las")).unwrap();
    stdout(folder.path(), "convert DIR/a.las -o DIR/b.laz");
    let message = stdout(folder.path(), "info DIR/b.laz");
    assert!(
        message.contains("system      WGS 84 / UTM zone 33N, as WKT\nrecords     liblas 5 (3 bytes)\n"),
        "{message}"
    );
    let json = report(folder.path(), "info DIR/b.laz");
    assert_eq!(json["coordinate_system"], "WGS 84 / UTM zone 33N");
    assert_eq!(json["wkt"], system.trim_end_matches('\0'));
    let lost = run(folder.path(), "convert DIR/b.laz -o DIR/c.ply");
    let message =
        "ply: cannot hold the coordinate system WGS 84 / UTM zone 33N and the records liblas 5; las and laz do";
    assert!(stderr(&lost).contains(message), "{}", stderr(&lost));
}

#[test]
fn a_closed_standard_output_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "x,y,z\n1,2,3\n").unwrap();
    let program = env!("CARGO_BIN_EXE_echocast");
    let shell = |to: &str| {
        let line = format!("'{program}' convert '{}' -o - --format csv {to}", folder.path().join("a.csv").display());
        std::process::Command::new("sh").args(["-c", &line]).output().unwrap()
    };
    let closed = shell(">&-");
    assert_eq!(closed.status.code(), Some(1));
    assert!(stderr(&closed).contains("-o -: standard output is closed"), "{}", stderr(&closed));
    for to in ["> /dev/null", "1<> /dev/null", "| head -c 1"] {
        assert!(shell(to).status.success(), "{to}");
    }
    // The same holds for everything that is printed.
    for command in ["info DIR/a.csv", "info --json DIR/a.csv", "sensors vlp16", "formats", "--version", "scan --help"] {
        let command = command.replace("DIR", &folder.path().display().to_string());
        let line = format!("'{program}' {command} >&-");
        let closed = std::process::Command::new("sh").args(["-c", &line]).output().unwrap();
        assert_eq!(closed.status.code(), Some(1), "{command}");
        let message = stderr(&closed);
        assert_eq!(message, "error: standard output is closed; allowed: a terminal, a pipe, a file\n", "{command}");
    }
}

#[test]
fn impossible_conversions_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "x,y,z\n1,2,3\n").unwrap();
    fs::write(folder.path().join("b.csv"), "range,time\n1,2\n").unwrap();
    fs::write(folder.path().join("broken.las"), "LASF and nothing else").unwrap();
    fs::write(folder.path().join("scene.obj"), "v 0 0 0\n").unwrap();
    let before = files(folder.path());
    for (args, code, message) in [
        ("convert DIR/a.csv -o DIR/a.csv", 2, "would overwrite"),
        ("convert DIR/a.csv -o -", 2, "-o -: standard output has no ending"),
        ("convert DIR/a.csv -o DIR/a.xyz", 2, "clouds are written as .las"),
        ("convert DIR/a.csv -o DIR/c --format pcx", 2, "near: pcd"),
        ("convert DIR/missing.las -o DIR/c.las", 1, "missing.las: No such file"),
        ("convert DIR/broken.las -o DIR/c.las", 1, "broken.las: ends within its header: it is cut off"),
        ("convert DIR/scene.obj -o DIR/c.las", 1, "scene.obj: does not begin as a cloud does"),
        ("convert DIR/b.csv -o DIR/c.las", 1, "without x, y, z"),
        ("preview DIR/a.csv -o DIR/a.jpg", 2, "pictures are written as .png"),
        ("preview DIR/a.csv -o DIR/a.png --view fan", 2, "top, perspective or range"),
        ("preview DIR/a.csv -o DIR/a.png --width 10", 2, "320 to 4096"),
        ("info DIR/broken.las", 1, "broken.las: ends within"),
        ("info DIR/missing.las", 1, "missing.las: No such file"),
        ("info DIR/a.csv --preview DIR/c.jpg", 2, "pictures are written as .png"),
    ] {
        let output = run(folder.path(), args);
        let said = stderr(&output);
        assert!(output.status.code() == Some(code) && said.contains(message), "{args}: {code} {said}");
        assert_eq!(said.lines().count(), 1, "{args}: {said}");
    }
    assert_eq!(files(folder.path()), before);
}

#[test]
fn info_describes_a_cloud() {
    let folder = tempfile::tempdir().unwrap();
    stdout(folder.path(), &format!("{SCAN} --organised -o DIR/a.npz"));
    let message = stdout(folder.path(), "info DIR/a.npz");
    for text in
        ["points      28,928", "16 rows of 1808", "coordinates world", "chair", "intensity", "range       m", "####"]
    {
        assert!(message.contains(text), "{text} is missing in\n{message}");
    }
    let cloud = PointCloud::read(folder.path().join("a.npz")).unwrap();
    let json = report(folder.path(), "info DIR/a.npz");
    assert_eq!((&json["points"], &json["shape"]), (&28928.into(), &serde_json::json!([16, 1808])));
    let chairs = cloud.labels.category.id("chair");
    let expected = cloud.columns().category_id().iter().filter(|&&id| id == chairs).count();
    let found = json["categories"].as_array().unwrap().iter().find(|row| row["name"] == "chair").unwrap();
    assert_eq!(found["points"], expected);
    let hits = cloud.columns().range().iter().filter(|range| !range.is_nan()).count();
    let bars: u64 = json["histogram"]["points"].as_array().unwrap().iter().filter_map(|bar| bar.as_u64()).sum();
    assert_eq!((json["histogram"]["column"].as_str(), bars), (Some("range"), hits as u64));
    // A mesh is a scene, points are a cloud.
    let points = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    fs::write(folder.path().join("points.ply"), points).unwrap();
    assert!(stdout(folder.path(), "info DIR/points.ply").contains("points      1"));
}

#[test]
fn clouds_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    stdout(folder.path(), &format!("{SCAN} -o DIR/a.las --preview DIR/scan.png"));
    // The same points give the same picture, apart from rounding by LAS.
    stdout(folder.path(), "preview DIR/a.las -o DIR/a.png");
    assert!(fs::read(folder.path().join("a.png")).unwrap().starts_with(b"\x89PNG"));
    // Without labels, colours are those of heights if no others are requested.
    fs::write(folder.path().join("b.csv"), "x,y,z\n1,2,3\n2,3,4\n").unwrap();
    let said = run(folder.path(), "preview DIR/b.csv -o DIR/b.png --view perspective --width 640");
    assert!(said.status.success() && stderr(&said).is_empty(), "{}", stderr(&said));
    assert!(String::from_utf8_lossy(&said.stdout).contains("b.csv: 2 points"));
}
