//! Scenarios by the program: scans repeated from their reports, sets of samples.

mod common;

use common::{files, run, stderr, stdout};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Contents of all files below `folder`, by name.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(inner) = open.pop() {
        for entry in fs::read_dir(inner).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_string_lossy().into_owned();
                all.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// Every kind of scan: weather, drives, cameras that ride, organised clouds, sonars, pictures, several formats.
#[test]
fn reports_of_scans_repeat_them() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    stdout(folder, "generate street --cars 2 --seconds 8 -q -o DIR/street.glb");
    stdout(folder, "generate seabed --size 20,20 --cell 0.5 -q -o DIR/lake.glb");
    fs::write(folder.join("drive.txt"), "5 -3 0 1.8 0 0 0 1\n6 3 0 1.8 0 0 0.1 0.995\n").unwrap();
    fs::write(folder.join("labels.yaml"), "objects: {\"Car_*\": vehicle}\nnumbers: {vehicle: 10}\n").unwrap();
    fs::write(folder.join("rays.csv"), "azimuth_deg,elevation_deg\n0,0\n1,-5\n2,-10\n3,-20\n").unwrap();
    fs::write(
        folder.join("mine.yaml"),
        "name: mine\nkind: lidar\npattern: {type: table, file: rays.csv}\nnoise: {range_sigma_m: 0.02}\n",
    )
    .unwrap();
    for (name, options) in [
        ("rain", "DIR/street.glb --sensor velodyne_vlp16 --camera Corner --rain 12.3 --fog 150 --seed 77 -o OUT/a.csv"),
        (
            "ride",
            "DIR/street.glb --sensor velodyne_vlp16 --camera Lidar --frames 3:7:2 --single --fields \
             default,velocity,flow --labels DIR/labels.yaml -o OUT/a.npz --preview OUT/a.png --view range --color velocity",
        ),
        (
            "drive",
            "DIR/street.glb --sensor velodyne_vlp16 --set noise.range_sigma_m=0.1 --trajectory DIR/drive.txt --frames 0:2 \
             --fps 4 --frame sensor --order time --freeze -o OUT/a.las -o OUT/a.ply --boxes OUT/boxes.json --box-axes frame",
        ),
        (
            "camera",
            "DIR/street.glb --sensor kinect_v2 --set pattern.resolution=[32,24] --at 1.1,-6.3,1.7 --rpy 1,2,33.3 \
             --organised --profile paper -o OUT/a.npz",
        ),
        ("table", "DIR/street.glb --sensor DIR/mine.yaml --at 0.1,0.2,1.7 -o OUT/a.csv"),
        (
            "sonar",
            "DIR/lake.glb --sensor fls_900 --set range.max_m=20 --camera Sonar --frames 0:1 --pings OUT/a.npz --image \
             OUT/fan.png --view fan --color intensity --preview OUT/p.png",
        ),
    ] {
        let out = folder.join(name);
        fs::create_dir(&out).unwrap();
        let options = options.replace("OUT/", &format!("DIR/{name}/"));
        let report = stdout(folder, &format!("scan {options} --json"));
        fs::write(folder.join("report.json"), &report).unwrap();
        let first = contents(&out);
        assert!(!first.is_empty());
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
        stdout(folder, "run DIR/report.json -q");
        let again = contents(&out);
        assert_eq!(again.keys().collect::<Vec<_>>(), first.keys().collect::<Vec<_>>(), "{name}");
        for (file, bytes) in &first {
            assert!(again[file] == *bytes, "{name}: {file}");
        }
    }
}

/// A street in which cars move and trees are missing.
fn street(folder: &Path) {
    stdout(folder, "generate street --cars 2 --seconds 8 -q -o DIR/street.glb");
    let text = "scene: {files: street.glb}\nsensors: [{name: top, sensor: velodyne_vlp16}]\n\
                trajectory: {on: {category: road}, height_m: 1.9, clearance_m: 0.5}\nsamples: 12\nseed: 3\n\
                outputs: [{style: semantic_kitti}, {style: plain, format: las}]\nvariation:\n\
                \x20 - {move: \"Car_*\", by_m: [{uniform: [-3, 3]}, 0, 0]}\n\
                \x20 - {remove: {category: vegetation}, chance: 0.3}\n\
                \x20 - {set: environment.fog.visibility_m, to: {log_uniform: [80, 500]}}\n";
    fs::write(folder.join("street.yaml"), text).unwrap();
}

#[test]
fn a_set_that_is_killed_goes_on_to_the_same_files() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    street(folder);
    let said = stdout(folder, "run DIR/street.yaml");
    assert!(said.contains("12 samples made in") && said.contains("complete, see report.html"), "{said}");
    let whole = contents(&folder.join("street"));
    assert!(stdout(folder, "run --check-output DIR/street").contains("all there, all as written"));

    let again = folder.join("again").display().to_string();
    let program = env!("CARGO_BIN_EXE_echocast");
    for kill in 0..20_u32 {
        let resume = ["run", "street.yaml", "-o", &again, "--resume", "-q", "--threads", "2"];
        let mut child = Command::new(program).args(resume).current_dir(folder).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(60 + u64::from(kill * kill % 17) * 40));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    stdout(folder, "run DIR/street.yaml -o DIR/again --resume -q");
    let again = contents(&folder.join("again"));
    assert_eq!(again.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    assert!(again == whole);

    // What has been damaged is found.
    fs::write(folder.join("again/sequences/000004/times.txt"), "1e0\n").unwrap();
    let wrong = run(folder, "run --check-output DIR/again");
    assert_eq!(wrong.status.code(), Some(1));
    assert!(stderr(&wrong).contains("sequences/000004/times.txt has other contents"), "{}", stderr(&wrong));
}

#[test]
fn shards_are_parts_of_the_same_set() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    street(folder);
    stdout(folder, "run DIR/street.yaml -q");
    for part in [2, 0, 1] {
        let said = stdout(folder, &format!("run DIR/street.yaml --shard {part}/3 -o DIR/parts"));
        assert!(said.contains("4 samples made") && said.contains("not complete yet"), "{said}");
    }
    stdout(folder, "run --finish DIR/parts");
    assert!(contents(&folder.join("parts")) == contents(&folder.join("street")));
}

#[test]
fn an_interrupted_run_ends_after_the_samples_under_way() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    street(folder);
    let program = env!("CARGO_BIN_EXE_echocast");
    let mut child = Command::new(program)
        .args(["run", "street.yaml", "--set", "samples=100000"])
        .current_dir(folder)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let log = folder.join("street/manifest.jsonl");
    while fs::read_to_string(&log).map_or(0, |log| log.lines().count()) < 3 && start.elapsed().as_secs() < 300 {
        std::thread::sleep(Duration::from_millis(20));
    }
    // Not SIGINT, which a shell lets programs in the background ignore.
    Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let names = files(&folder.join("street/sequences"));
    assert!(names.len() >= 2 && names.iter().all(|name| !name.starts_with('.')), "{names:?}");
    let faults = run(folder, "run --check-output DIR/street");
    assert!(stderr(&faults).contains("of 100000 samples are missing"), "{}", stderr(&faults));
}

#[test]
fn one_sample_is_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    street(folder);
    let said = stdout(folder, "run DIR/street.yaml --sample 7 --preview DIR/seven.png --view perspective");
    assert!(said.contains("seven.png") && said.contains("set environment.fog.visibility_m") && said.contains("Car_1"));
    assert!(fs::metadata(folder.join("seven.png")).unwrap().len() > 10_000);
    assert!(!folder.join("street").exists());
    let said = stdout(folder, "run DIR/street.yaml --check");
    assert!(said.contains("12 samples, 1 sensor") && said.contains("top: Velodyne VLP-16"), "{said}");
    assert!(!folder.join("street").exists());
    let json = stdout(folder, "run DIR/street.yaml --samples 0:1 --json");
    let lines: Vec<serde_json::Value> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((lines.len(), &lines[2]["made"]), (3, &2.into()));
    assert!(lines[0]["points"].as_u64().unwrap() > 1000);
}

#[test]
fn what_is_wrong_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    street(folder);
    stdout(folder, "run DIR/street.yaml --samples 0:0 -q");
    for (args, code, words) in [
        ("run", 2, "SCENARIO"),
        ("run DIR/none.yaml", 1, "none.yaml: No such file"),
        ("run DIR/street.yaml --samples 0:12", 2, "samples is 0 to 12, every 1; allowed: 0 to 11"),
        ("run DIR/street.yaml --shard 4/4", 2, "shard is 4/4; allowed: 0/4 to 3/4"),
        ("run DIR/street.yaml --shard four", 2, "expected K/N"),
        (
            "run DIR/street.yaml",
            1,
            "in which 1 of these samples are; allowed: another folder, or to go on with it (--resume)",
        ),
        ("run DIR/street.yaml --set seed=4 --resume", 1, "which holds a set of another scenario"),
        ("run DIR/street.yaml --set sensor=3", 2, "sensor=3: sensor: unknown key \"sensor\"; near: sensors"),
        (
            "run DIR/street.yaml -o DIR/x --set outputs[0].style=plane",
            1,
            "outputs[0].style: unknown value \"plane\"; allowed: plain, semantic_kitti, kitti, nuscenes, webdataset, coco, voc, \
             files",
        ),
        ("run DIR/street.yaml --preview DIR/x.png", 2, "--sample"),
        (
            "run DIR/street.yaml --set outputs=[{style: files, preview: a.png}]",
            1,
            "outputs[0].preview: invalid type: string \"a.png\", expected a section of keys",
        ),
        ("run --check-output DIR", 1, "in which there is no scenario.json"),
        ("run --finish DIR/street", 1, "not complete: 11 of 12 samples are missing, the first is 1"),
    ] {
        let output = run(folder, args);
        assert_eq!(output.status.code(), Some(code), "{args}: {}", stderr(&output));
        assert!(stderr(&output).contains(words), "{args}: {}", stderr(&output));
    }
}
