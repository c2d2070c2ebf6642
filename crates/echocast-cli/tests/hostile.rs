//! Files and names that do harm, on purpose or by accident.
#![cfg(unix)]

mod common;

use common::{run, stderr};
use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::{MetadataExt as _, symlink};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const BEAM: &str =
    "name: pole\nkind: lidar\npattern: {type: pinhole, resolution: [1, 1], fov_deg: [1, 1], rate_hz: 10}\n";
const SONAR: &str = "--set range.max_m=5 --sensor sss_450 --at 0,0,-1";

/// A triangle in three lines.
const TRIANGLE: &str = "v 3 -1 0\nv 3 1 0\nv 3 0 2\n";

/// A pipe that nothing writes to.
fn pipe(path: &Path) -> PathBuf {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    path.to_owned()
}

/// The single line of a failure, which must come soon.
#[track_caller]
fn failure(folder: &Path, args: &str) -> String {
    let start = Instant::now();
    let output = run(folder, args);
    assert!(start.elapsed() < Duration::from_secs(60), "{args}");
    let line = stderr(&output).to_owned();
    assert_eq!(output.status.code(), Some(1), "{args}\n{line}");
    assert!(line.starts_with("error: ") && line.trim_end().lines().count() == 1 && line.len() < 508, "{args}\n{line}");
    assert!(!line.trim_end().contains(char::is_control), "{line:?}");
    line
}

/// Runs the program with arguments that need not be text, and `input` on its stdin.
fn run_bytes(args: &[&[u8]], input: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_echocast"));
    command.args(args.iter().map(|arg| OsStr::from_bytes(arg)));
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    // It may end before it has read all.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

/// As in a container with a limit on processes. Root has none, so root becomes another user.
#[test]
fn a_system_without_threads_is_reported() {
    for (threads, message) in [("", "as many threads as there are cores"), ("--threads 8", "8 threads")] {
        let mut command = Command::new("bash");
        command.args(["-c", r#"ulimit -u 1 && exec "$0" bench x.glb --sensor velodyne_vlp16 --at 0,0,0 $1"#]);
        command.args([env!("CARGO_BIN_EXE_echocast"), threads]);
        if fs::metadata("/proc/self").unwrap().uid() == 0 {
            command.uid(54321);
        }
        let Some(output) = command.output().ok().filter(|output| output.status.code() == Some(1)) else {
            println!("skipped: this program cannot be run by another user here");
            return;
        };
        let said = stderr(&output);
        assert!(said.starts_with(&format!("error: --threads: the system cannot start {message} (")), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

/// Wherever memory runs out: in Rust, in Embree or when a thread is started.
#[test]
fn a_system_without_memory_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let limited = |mib: usize, args: &str| {
        let mut command = Command::new("bash");
        command.args(["-c", r#"ulimit -c 0; ulimit -v "$0" && exec "$@""#, &(mib << 10).to_string()]);
        let program = common::command(folder.path(), args);
        command.arg(program.get_program()).args(program.get_args()).output().unwrap()
    };
    // With less, the system cannot load it.
    let least = (60..2000).step_by(20).find(|&mib| limited(mib, "--version").status.success()).unwrap();
    let mut failures = 0;
    for more in (0..=120).step_by(8) {
        let output = limited(
            least + more,
            "scan HALL --sensor velodyne_vlp16 --set beam.sub_rays=1 --at -6,6,1.2 --threads 2 -o DIR/x.npz -o DIR/y.las",
        );
        let said = stderr(&output);
        if output.status.success() {
            continue;
        }
        failures += 1;
        assert_eq!(output.status.code(), Some(1), "{} MiB: {said}", least + more);
        assert!(said.starts_with("error: ") && said.lines().count() == 1, "{} MiB: {said}", least + more);
        let left = common::files(folder.path());
        assert!(left.iter().all(|name| !name.starts_with('.')), "{left:?}");
    }
    assert!(failures > 2, "{failures} of them");
    // A scene that does not fit in memory.
    let output = limited(least + 100, "generate landscape --size 1000,1000 --cell 0.5 -o DIR/big.glb");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert_eq!(stderr(&output).lines().count(), 1, "{}", stderr(&output));
}

#[test]
fn names_of_files_are_bytes() {
    let folder = tempfile::tempdir().unwrap();
    // A folder of such a name, too.
    let odd = folder.path().join(OsStr::from_bytes(b"d\xff\n"));
    fs::create_dir(&odd).unwrap();
    let at = |name: &[u8]| [odd.as_os_str().as_bytes(), b"/", name].concat();
    let write = |name: &[u8], text: &str| {
        fs::write(OsStr::from_bytes(&at(name)), text).unwrap();
        at(name)
    };
    let scene = write(b"s\xff.obj", &format!("{TRIANGLE}f 1 2 3\n"));
    let labels = write(b"l\xff.yaml", "{}");
    let env = write(b"e\xff.yaml", "{}");
    let track = write(b"t\xff.txt", "0 0 0 1 0 0 0 1\n");
    let sensor =
        write(b"n\xff.yaml", &BEAM.replace("pinhole, resolution: [1, 1], fov_deg: [1, 1]", "table, file: rays.csv"));
    write(b"rays.csv", "azimuth_deg,elevation_deg\n0,0\n");
    let (cloud, picture) = (at(b"x\xff.las"), at(b"p\xff.png"));
    let output = run_bytes(
        &[
            b"scan",
            &scene,
            b"--sensor",
            &sensor,
            b"--labels",
            &labels,
            b"--env",
            &env,
            b"--trajectory",
            &track,
            b"--set",
            b"pattern.rate_hz=5",
            b"-o",
            &cloud,
            b"--preview",
            &picture,
            b"--json",
        ],
        "",
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["points"], 1);
    let shown = |name: &str| format!("{}/d\\xff\\n/{name}", folder.path().display());
    assert_eq!(report["outputs"][0], shown("x\\xff.las"));
    for (place, name) in [
        ("/run/scene/files/0", "s\\xff.obj"),
        ("/run/scene/labels", "l\\xff.yaml"),
        ("/run/trajectory/file", "t\\xff.txt"),
        ("/run/sensors/0/sensor/pattern/file", "rays.csv"),
        ("/run/outputs/0/preview/file", "p\\xff.png"),
    ] {
        assert_eq!(report.pointer(place).unwrap(), &serde_json::Value::from(shown(name)), "{place}");
    }
    assert!(Path::new(OsStr::from_bytes(&cloud)).exists() && Path::new(OsStr::from_bytes(&picture)).exists());
    // A sonar's files, and the summary for people.
    let (pings, image) = (at(b"q\xff.npz"), at(b"i\xff.npz"));
    let mut args: Vec<&[u8]> = vec![b"scan", &scene, b"--pings", &pings, b"--image", &image, b"--view", b"waterfall"];
    args.extend(SONAR.split(' ').map(str::as_bytes));
    let output = run_bytes(&args, "");
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(String::from_utf8(output.stdout).unwrap().contains("q\\xff.npz"));
    // A missing file is named.
    let output = run_bytes(&[b"info", &at(b"\xff.obj")], "");
    assert!(stderr(&output).ends_with("/d\\xff\\n/\\xff.obj: No such file or directory (os error 2)\n"));
    let output = run_bytes(&[b"sensors", b"\xff\x1b[31m"], "");
    assert!(stderr(&output).contains("\\xff\\u{1b}[31m is neither a preset nor a file"), "{}", stderr(&output));
}

#[test]
fn pipes_devices_and_folders_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("ok.obj"), format!("{TRIANGLE}f 1 2 3\n")).unwrap();
    fs::write(path.join("beam.yaml"), BEAM).unwrap();
    pipe(&path.join("p.glb"));
    pipe(&path.join("p.obj"));
    pipe(&path.join("p.yaml"));
    symlink("/dev/zero", path.join("z.glb")).unwrap();
    symlink("/dev/zero", path.join("z.yaml")).unwrap();
    let scan = "scan DIR/ok.obj --sensor DIR/beam.yaml -o DIR/x.csv";
    for (args, says) in [
        ("info DIR/p.glb", "p.glb: is a pipe; allowed: regular files"),
        ("info DIR/p.obj", "p.obj: is a pipe; allowed: regular files"),
        ("info DIR/z.glb", "z.glb: is a device; allowed: regular files"),
        ("sensors DIR/p.yaml", "p.yaml: is a pipe; allowed: regular files; for standard input, use `-`"),
        (
            &format!("{scan} --at 0,0,0 --labels DIR/z.yaml"),
            "z.yaml: is a device; allowed: regular files; for standard input",
        ),
        (&format!("{scan} --at 0,0,0 --env DIR/p.yaml"), "p.yaml: is a pipe"),
        (&format!("{scan} --trajectory DIR/p.yaml"), "p.yaml: is a pipe"),
        (&format!("{scan} --trajectory DIR"), "is a directory"),
    ] {
        assert!(failure(path, args).contains(says), "{args}\n{}", failure(path, args));
    }
    // Those that files refer to.
    let gltf = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "p.glb", "byteLength": 36}]}"#;
    fs::write(path.join("a.gltf"), gltf).unwrap();
    assert!(failure(path, "info DIR/a.gltf").contains("buffer 0: cannot read "));
    fs::write(path.join("m.obj"), format!("mtllib p.yaml\n{TRIANGLE}f 1 2 3\n")).unwrap();
    assert!(failure(path, "info DIR/m.obj").contains("p.yaml: is a pipe"));
    fs::write(path.join("m.mtl"), "newmtl a\nmap_Kd p.glb\n").unwrap();
    fs::write(path.join("i.obj"), format!("mtllib m.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n")).unwrap();
    assert!(failure(path, "info DIR/i.obj").contains("p.glb: is a pipe"));
    fs::write(path.join("t.yaml"), "{name: a, kind: lidar, pattern: {type: table, file: z.yaml}}").unwrap();
    assert!(failure(path, "sensors DIR/t.yaml").contains("z.yaml: is a device"));
    fs::write(path.join("w.yaml"), "water: {profile: {file: p.yaml}}").unwrap();
    let line = failure(path, &format!("scan DIR/ok.obj {SONAR} --env DIR/w.yaml -o DIR/x.csv"));
    assert!(line.contains("w.yaml: water.profile.file: ") && line.contains("p.yaml: is a pipe"), "{line}");
}

#[test]
fn standard_input_is_read_once() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("ok.obj");
    fs::write(&scene, format!("{TRIANGLE}f 1 2 3\n")).unwrap();
    let beam = folder.path().join("beam.yaml");
    fs::write(&beam, BEAM).unwrap();
    let [scene, beam] = [&scene, &beam].map(|path| path.as_os_str().as_bytes());
    let cloud = folder.path().join("x.csv");
    let cloud = cloud.as_os_str().as_bytes();
    let scan = |more: &[&[u8]], input: &str| run_bytes(&[&[b"scan", scene, b"-o", cloud], more].concat(), input);
    for (option, more, input) in [
        ("--sensor", &[b"--at" as &[u8], b"0,0,1"][..], BEAM),
        ("--env", &[b"--sensor", beam, b"--at", b"0,0,1"], "rain: {rate_mm_h: 5}"),
        ("--labels", &[b"--sensor", beam, b"--at", b"0,0,1"], "numbers: {ok: 5}"),
        ("--trajectory", &[b"--sensor", beam], "0 0 0 1 0 0 0 1\n"),
    ] {
        let more = [&[option.as_bytes(), b"-"], more].concat();
        let output = scan(&more, input);
        assert!(output.status.success(), "{option}: {}", stderr(&output));
        let line = scan(&more, "[");
        assert!(stderr(&line).contains(&format!("{option} -: ")), "{}", stderr(&line));
    }
    let output = run_bytes(&[b"sensors", b"-"], BEAM);
    assert!(output.stdout.starts_with(b"name: pole\n"), "{}", stderr(&output));
    let output = scan(&[b"--sensor", b"-", b"--env", b"-", b"--at", b"0,0,1"], BEAM);
    let says = "standard input is already read by --sensor";
    assert!(stderr(&output).contains(says), "{}", stderr(&output));
}

#[test]
fn scenes_keep_to_their_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::create_dir(path.join("in")).unwrap();
    fs::write(path.join("secret.mtl"), "newmtl a\nKd hunter2\nd hunter2\n").unwrap();
    let gltf = |uri: &str| {
        let text = format!(r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"uri": "{uri}", "byteLength": 3}}]}}"#);
        fs::write(path.join("in/a.gltf"), text).unwrap();
    };
    for uri in ["/etc/passwd", "%2Fetc%2Fpasswd", "file:///etc/passwd", "../secret.mtl", "%2e%2e/secret.mtl"] {
        gltf(uri);
        let line = failure(path, "info DIR/in/a.gltf");
        assert!(
            line.contains("leads out of the folder of the scene") && line.contains("--allow-outside-paths"),
            "{line}"
        );
        assert!(failure(path, "info DIR/in/a.gltf --allow-outside-paths").contains("no triangle to scan"), "{uri}");
    }
    fs::write(path.join("in/a.obj"), format!("mtllib ../secret.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n")).unwrap();
    let line = failure(path, "info DIR/in/a.obj");
    assert!(line.contains("\"../secret.mtl\" leads out of the folder of the scene"), "{line}");
    let line = failure(path, "info DIR/in/a.obj --allow-outside-paths");
    assert!(line.contains("secret.mtl: line 2: ") && !line.contains("hunter2"), "{line}");
}

#[test]
fn images_have_a_budget() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    // 4 MiB decoded each, a few kilobytes as they are.
    for name in ["a", "b"] {
        let mut encoder = png::Encoder::new(fs::File::create(path.join(format!("{name}.png"))).unwrap(), 1024, 1024);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.write_header().unwrap().write_image_data(&[9; 1 << 20]).unwrap();
    }
    let obj = format!("mtllib m.mtl\n{TRIANGLE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n");
    fs::write(path.join("t.obj"), obj).unwrap();
    fs::write(path.join("m.mtl"), "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n").unwrap();
    assert!(common::stdout(path, "info DIR/t.obj --texture-limit 8").contains("textures    2"));
    let line = failure(path, "info DIR/t.obj --texture-limit 7");
    assert!(line.contains("the images of the scene take more than 7 MiB decoded; allowed: "), "{line}");
    // Of all files together.
    assert!(failure(path, "info DIR/t.obj DIR/t.obj --texture-limit 15").contains("more than 15 MiB"));
}

#[test]
fn terminal_controls_are_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("a.obj"), format!("o \x1b]0;OWNED\x07\x1b[31mred\nusemtl \u{9b}31m\n{TRIANGLE}f 1 2 3\n"))
        .unwrap();
    let info = common::stdout(path, "info DIR/a.obj");
    assert!(!info.contains(|c: char| c != '\n' && c.is_control()), "{info:?}");
    assert!(info.contains("\\u{1b}]0;OWNED\\u{7}\\u{1b}[31mred") && info.contains("\\u{9b}31m"), "{info}");
    fs::write(path.join("beam.yaml"), BEAM.replace("pole", "\"\\e[31m\"")).unwrap();
    for args in ["--explain 0", "-o DIR/x.csv --verbose"] {
        let output = run(path, &format!("scan DIR/a.obj --sensor DIR/beam.yaml --at 0,0,0.5 {args}"));
        let all = [output.stdout.as_slice(), &output.stderr].concat();
        assert!(output.status.success() && !all.contains(&0x1b), "{}", String::from_utf8_lossy(&all));
    }
}

#[test]
fn messages_are_short_whatever_is_in_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let long = "x".repeat(100_000);
    for text in [
        format!("{BEAM}{long}: 1\n"),
        format!("{BEAM}noise: {{range_sigma_m: {long}}}\n"),
        format!("{BEAM}noise: {{range_sigma_m: 1e300}}\n"),
        format!("{BEAM}noise: {{{long}: {{{long}: 1}}}}\n"),
        format!("{BEAM}range: {{min_m: -1e300, max_m: 1e300}}\n"),
        format!("{BEAM}name: b\n"),
        format!("{}: {}", "[".repeat(100), long),
        format!("a: &a [{long}]\nb: [{}]", "*a, ".repeat(100_000)),
        format!("{BEAM}---\n{BEAM}"),
    ] {
        fs::write(path.join("a.yaml"), &text).unwrap();
        let line = failure(path, "sensors DIR/a.yaml");
        for jargon in ["Policy", "budget", "Nodes", "struct", "serde", "000000000000000000000000", "&str"] {
            assert!(!line.contains(jargon), "{line}");
        }
    }
}
