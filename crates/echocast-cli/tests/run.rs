//! Scenarios run by the program: scans repeated from their reports, sets of samples.

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

/// Every kind of scan: weather, drives, moving cameras, organised clouds, sonars, pictures, several formats.
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
    assert!(stdout(folder, "run --check-output DIR/street").contains("complete and unchanged"));

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

/// A second run reports which process is writing, and touches nothing: of a set, of one shard, and at its end.
#[cfg(unix)]
#[test]
fn a_set_has_one_writer() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    street(folder);
    let program = env!("CARGO_BIN_EXE_echocast");
    let begin = |args: &[&str], log: &str| {
        let child = Command::new(program)
            .args(["run", "street.yaml", "--set", "samples=100000", "-q"])
            .args(args)
            .current_dir(folder)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (start, log) = (Instant::now(), folder.join(log));
        while fs::read_to_string(&log).map_or(0, |log| log.lines().count()) < 2 && start.elapsed().as_secs() < 60 {
            std::thread::sleep(Duration::from_millis(20));
        }
        child
    };
    let end = |mut child: std::process::Child| {
        Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130));
    };
    let refused = |args: &str, child: &std::process::Child| {
        let output = run(folder, args);
        let words = format!("which is being written by process {}", child.id());
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{args}: {message}");
        assert!(message.contains(&words) && message.trim_end().lines().count() == 1, "{args}: {message}");
    };
    let whole = begin(&[], "street/manifest.jsonl");
    for args in ["run DIR/street.yaml", "run DIR/street.yaml --resume", "run DIR/street.yaml --shard 0/2"] {
        refused(&format!("{args} --set samples=100000"), &whole);
    }
    refused("run --finish DIR/street", &whole);
    end(whole);
    let shard = begin(&["--shard", "0/2", "-o", "parts"], "parts/manifest.0_of_2.jsonl");
    for args in ["--shard 0/2", "--shard 0/2 --resume", "--shard 1/3", "--resume"] {
        refused(&format!("run DIR/street.yaml {args} -o DIR/parts --set samples=100000"), &shard);
    }
    refused("run --finish DIR/parts", &shard);
    // Another shard of the same number can run at the same time.
    let beside = "run DIR/street.yaml --shard 1/2 -o DIR/parts --samples 1:1 --set samples=100000";
    assert!(stdout(folder, beside).contains("1 sample made"));
    end(shard);
    for set in ["street", "parts"] {
        let names = files(&folder.join(set));
        assert!(names.iter().all(|name| !name.starts_with(".lock")), "{names:?}");
    }
}

/// Runs that write to one folder at the same time leave a whole set, whichever of them makes it.
#[test]
fn runs_at_once_leave_a_whole_set() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("room.obj"), "v -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\ng Floor\nf 1 2 3 4\n").unwrap();
    let text = "scene: {files: room.obj, labels: {objects: {Floor: road}}}\nsamples: 4\nset: {splits: 50/50}\n\
                sensors: [{name: top, sensor: {name: s, kind: lidar, pattern: {type: spinning, azimuth: {fov_deg: 360, \
                rate_hz: 10, step_deg: 30}, elevation: {fov_deg: 60, step_deg: 10}}}}]\n\
                trajectory: {position_m: [0, 0, 1]}\noutputs: [{style: webdataset, samples: 2}, {style: nuscenes}]\n";
    fs::write(folder.join("room.yaml"), text).unwrap();
    stdout(folder, "run DIR/room.yaml -q -o DIR/alone");
    let alone = contents(&folder.join("alone"));
    let spawn = |args: &str| {
        let args = args.split(' ');
        let program = env!("CARGO_BIN_EXE_echocast");
        let mut command = Command::new(program);
        command.arg("run").args(args).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    };
    let codes = |all: Vec<std::process::Child>| {
        let codes = all.into_iter().map(|mut child| child.wait().unwrap().code().unwrap());
        codes.collect::<Vec<_>>()
    };
    for turn in 0..4 {
        let set = format!("set{turn}");
        let both = codes(vec![spawn(&format!("room.yaml -o {set}")), spawn(&format!("room.yaml -o {set}"))]);
        assert!(both.contains(&0) && both.iter().all(|code| *code < 2), "{both:?}");
        assert!(stdout(folder, &format!("run --check-output DIR/{set}")).contains("complete and unchanged"));
        assert!(contents(&folder.join(&set)) == alone, "{set}");

        let parts = format!("parts{turn}");
        let shard = |part: u32| spawn(&format!("room.yaml -o {parts} --shard {part}/2"));
        let made = codes(vec![shard(0), shard(0), shard(1)]);
        assert!(made[..2].contains(&0) && made[2] == 0, "{made:?}");
        let ended = codes(vec![spawn(&format!("--finish {parts}")), spawn(&format!("--finish {parts}"))]);
        assert!(ended.contains(&0), "{ended:?}");
        assert!(contents(&folder.join(&parts)) == alone, "{parts}");
    }
}

/// Pieces that are no longer as they were written are found when they are joined, whatever their manifests say.
#[test]
fn what_is_damaged_is_not_joined() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    stdout(folder, "generate indoor --rooms 1,1 -q -o DIR/room.glb");
    let text = "scene: {files: room.glb}\nsensors: [{name: top, sensor: velodyne_vlp16}]\ntrajectory: {camera: Scanner}\n\
                samples: 2\noutputs: [{style: webdataset}, {style: plain, format: csv}]\n";
    fs::write(folder.join("room.yaml"), text).unwrap();
    for part in [0, 1] {
        stdout(folder, &format!("run DIR/room.yaml --shard {part}/2 -o DIR/set -q"));
    }
    let set = folder.join("set");
    let fails = |command: &str, words: &str| {
        let output = run(folder, command);
        assert_eq!(output.status.code(), Some(1), "{command}");
        assert!(stderr(&output).contains(words), "{command}: {}", stderr(&output));
    };
    let damage = |name: &str| {
        let before = fs::read(set.join(name)).unwrap();
        let mut bytes = before.clone();
        bytes[1000] ^= 1;
        fs::write(set.join(name), bytes).unwrap();
        before
    };
    for name in ["webdataset/.pieces/000001.tar", "data/000000/top.csv"] {
        let before = damage(name);
        fails("run --finish DIR/set", &format!("damaged: {name} has other contents"));
        fails("run --check-output DIR/set", &format!("{name} has other contents"));
        fs::remove_file(set.join(name)).unwrap();
        fails("run --finish DIR/set", &format!("damaged: {name} is missing"));
        fs::write(set.join(name), before).unwrap();
    }
    // A manifest without a sample's archive, and one that names what is not in the set.
    let manifest = set.join("manifest.1_of_2.jsonl");
    let lines = fs::read_to_string(&manifest).unwrap();
    let without = lines.replace("webdataset/.pieces/000001.tar", "data/000000/top.csv");
    fs::write(&manifest, without).unwrap();
    fails("run --finish DIR/set", "damaged: data/000000/top.csv has ");
    for name in ["../room.glb", "/etc/hostname", "data/../../room.glb"] {
        fs::write(&manifest, lines.replace("webdataset/.pieces/000001.tar", name)).unwrap();
        for command in ["run --check-output DIR/set", "run --finish DIR/set", "run DIR/room.yaml -o DIR/set --resume"] {
            fails(command, &format!("manifest.1_of_2.jsonl: names \"{name}\", which is not in the set"));
        }
    }
    fs::write(&manifest, lines).unwrap();
    stdout(folder, "run --finish DIR/set");
    // Archives that exist already are checked, too.
    damage("webdataset/train-000000.tar");
    fails("run --check-output DIR/set", "webdataset/train-000000.tar has other contents");
    fails("run --finish DIR/set", "webdataset/train-000000.tar has other contents");
}

/// A run that cannot write ends with the reason, and can be resumed when there is room.
#[cfg(unix)]
#[test]
fn a_full_disk_is_reported_and_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    stdout(folder, "generate indoor --rooms 1,1 -q -o DIR/room.glb");
    let text = "scene: {files: room.glb}\nsensors: [{name: top, sensor: velodyne_vlp16}]\ntrajectory: {camera: Scanner}\n\
                samples: 3\noutputs: [{style: nuscenes}]\n";
    fs::write(folder.join("room.yaml"), text).unwrap();
    let program = env!("CARGO_BIN_EXE_echocast");
    // Files of 64 blocks of 512 or 1024 bytes: the first cloud does not fit.
    let limited = |args: &str| {
        let script = format!("ulimit -f 64; exec {program} run room.yaml -o set -q {args}");
        Command::new("sh").args(["-c", &script]).current_dir(folder).output().unwrap()
    };
    for args in ["", "--resume"] {
        let output = limited(args);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("File too large") && message.trim_end().lines().count() == 1, "{message}");
        assert!(!folder.join("set/manifest.json").exists());
    }
    let half = files(&folder.join("set/nuscenes"));
    assert!(half.iter().all(|name| !name.ends_with(".unfinished")), "{half:?}");
    assert!(files(&folder.join("set/pictures")).is_empty());
    stdout(folder, "run DIR/room.yaml -o DIR/set -q --resume");
    stdout(folder, "run DIR/room.yaml -o DIR/again -q");
    assert!(contents(&folder.join("set")) == contents(&folder.join("again")));
}

/// Each kind of warning is given once, empty clouds are counted, points have their causes, and arrays are small.
#[test]
fn reports_of_sets_are_short() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    stdout(folder, "generate indoor --rooms 1,1 -q -o DIR/room.glb");
    let text = "scene: {files: room.glb}\ntrajectory: {camera: Scanner}\nsamples: 5\n\
                sensors:\n  - {name: top, sensor: velodyne_vlp16}\n  - name: eye\n    sensor: {name: eye, kind: lidar, \
                pattern: {type: pinhole, resolution: [8, 6], fov_deg: [60, 45]}, range: {min_m: 90, max_m: 100}}\n\
                variation:\n  - {place: room.glb, call: Twin, at: {within: {min_m: [0, 0, 0], max_m: [1, 1, 0]}}, tries: 2, \
                count: {uniform: [1, 3]}}\n  - {set: environment.rain.rate_mm_h, to: 20}\n";
    fs::write(folder.join("room.yaml"), text).unwrap();
    let output = run(folder, "run DIR/room.yaml -o DIR/set");
    let message = stderr(&output);
    let kinds = |words: &str| message.lines().filter(|line| line.contains(words)).count();
    assert_eq!((kinds("no room for"), kinds("eye: an image in which nothing is seen")), (1, 1), "{message}");
    assert!(message.contains(" (5 samples, the first is 0)"), "{message}");
    let report: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("set/report.json")).unwrap()).unwrap();
    assert_eq!(report["empty"], serde_json::json!({"eye": 5}));
    let noticed = report["warnings"].as_array().unwrap();
    assert!(noticed.iter().any(|noticed| noticed["samples"] == 5 && noticed["first"] == 0), "{noticed:?}");
    // Arrays are compressed, the same in both layouts of the file, and have the cause of each point.
    let [sample, plain] = ["set/data/000000/top.npz", "plain.npz"].map(|name| folder.join(name));
    stdout(folder, "convert DIR/set/data/000000/top.npz -o DIR/plain.npz");
    let size = |path: &Path| fs::metadata(path).unwrap().len() as f64;
    assert!(size(&sample) < 0.6 * size(&plain), "{} of {}", size(&sample), size(&plain));
    let info: serde_json::Value =
        serde_json::from_str(&stdout(folder, "info DIR/set/data/000000/top.npz --json")).unwrap();
    let columns = info["columns"].as_array().unwrap();
    assert!(columns.iter().any(|column| column["name"] == "cause" && column["high"] != 0), "{info}");
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
fn one_sample_is_previewed() {
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
            "in which 1 of these samples are; allowed: another folder, or to go on with the set (--resume)",
        ),
        ("run DIR/street.yaml --set seed=4 --resume", 1, "which holds a set of another scenario"),
        ("run DIR/street.yaml --set sensor=3", 2, "sensor=3: sensor: unknown key \"sensor\"; near: sensors"),
        (
            "run DIR/street.yaml -o DIR/x --set outputs[0].style=plane",
            1,
            "outputs[0].style: unknown value \"plane\"; allowed: plain, semantic_kitti, kitti, nuscenes, webdataset, coco, voc, \
             files",
        ),
        ("run DIR/street.yaml --set set.folder=\"\"", 2, "set.folder: is \"\"; allowed: the name of a folder"),
        ("run DIR/street.yaml --preview DIR/x.png", 2, "--sample"),
        (
            "run DIR/street.yaml --set outputs=[{\"style\":\"files\",\"preview\":\"a.png\"}]",
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
