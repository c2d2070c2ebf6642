//! Help, exit codes and error lines.

mod common;
#[path = "usage/options.rs"]
mod options;

use common::{command, report, run, stderr, stdout, write_room};
use serde_json::{Value, json};
use std::fs;
use std::io::pipe;
use std::path::Path;

const COMMANDS: [&str; 8] = ["scan", "run", "sensors", "info", "generate", "formats", "bench", "completions"];

#[test]
fn every_command_explains_itself_with_an_example() {
    let folder = Path::new(".");
    let all = stdout(folder, "--help");
    for command in COMMANDS {
        assert!(all.contains(command), "{command}");
        let help = stdout(folder, &format!("{command} --help"));
        assert!(help.contains(&format!("  echocast {command}")), "{command} has no example:\n{help}");
    }
    let scan = stdout(folder, "scan --help");
    for option in "--sensor --set --at --rpy --camera --trajectory --frames --fps --profile --frame --fields --labels \
                   --seed --threads --single --merged --order --organised --output --format --preview --color --view \
                   --up --scale --json --quiet --verbose --reflectance-source --returns --env --rain --snow --fog --dust \
                   --cache --material --materials"
        .split_whitespace()
    {
        assert!(scan.contains(option), "{option}");
    }
    // The columns are those of the library's table.
    for info in echocast::cloud::FIELDS {
        assert!(scan.contains(info.name) && scan.contains(info.meaning), "{}", info.name);
    }
}

#[test]
fn the_version_says_which_vector_instructions_are_used() {
    let folder = Path::new(".");
    let plain = format!("echocast {}\n", env!("CARGO_PKG_VERSION"));
    assert_eq!((stdout(folder, "--version"), stdout(folder, "-V")), (plain.clone(), plain.clone()));
    let verbose = |level: &str| {
        let output = command(folder, "--version --verbose").env("ECHOCAST_SIMD", level).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    for (level, width) in [("plain", 4), ("avx2", 8), ("avx512", 16)] {
        let (code, said, error) = verbose(level);
        // What the processor lacks is reported.
        if code == Some(1) {
            assert!(error.starts_with(&format!("error: ECHOCAST_SIMD is {level}; allowed: ")), "{error}");
            assert_ne!(level, "plain");
            continue;
        }
        assert!(said.starts_with(&plain) && said.contains(&format!("\nkernels: {level}\nEmbree 4.")), "{said}");
        assert!(said.ends_with(&format!(", packets of {width} rays\n")) || cfg!(not(target_arch = "x86_64")), "{said}");
    }
    for wrong in ["AVX2", "avx", "\u{1b}[1m"] {
        let (code, said, error) = verbose(wrong);
        assert_eq!((code, said.as_str(), error.lines().count()), (Some(1), "", 1), "{error}");
        assert!(error.contains("; allowed: ") && error.ends_with("plain on this processor\n"), "{error}");
        let scan = command(folder, "scan HALL --sensor velodyne_vlp16 --at 0,0,1 -o DIR/never.las");
        let output = { scan }.env("ECHOCAST_SIMD", wrong).output().unwrap();
        assert_eq!((output.status.code(), stderr(&output).lines().count()), (Some(1), 1), "{}", stderr(&output));
    }
    assert_eq!(run(folder, "--verbose").status.code(), Some(2));
}

#[test]
fn wrong_usage_is_2() {
    let folder = tempfile::tempdir().unwrap();
    for (args, says) in [
        ("", "Usage"),
        ("scna", "scan"),
        ("scan HALL --at 0,0,0 -o DIR/x.las", "--sensor"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0", "--output"),
        ("scan --sensor kinect_v2 --at 0,0,0 -o DIR/x.las", "SCENE"),
        ("scan HALL --sensor kinect_v2 --at 0,0 -o DIR/x.las", "three numbers"),
        ("scan HALL --sensor kinect_v2 --at 0,0,inf -o DIR/x.las", "three numbers"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --camera Sensor -o DIR/x.las", "--camera"),
        ("scan HALL --sensor kinect_v2 --rpy 0,0,0 -o DIR/x.las", "--at"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --frames 3:1 -o DIR/x.las", "--frames"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --profile papre -o DIR/x.las", "blainder"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --fields x,rnge -o DIR/x.las", "near: range"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --set noise -o DIR/x.las", "KEY=VALUE"),
        ("scan HALL --sensor kinect_v2 --trajectory DIR/t.csv --rpy 0,0,90 -o DIR/x.las", "--rpy"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --rian 10 -o DIR/x.las", "--rain"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --dust 50,1e5,5 -o DIR/x.las", "RADIUS_UM,PER_M3,START_M,LENGTH_M"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --threads 0 -o DIR/x.las", "--threads"),
        ("scan HALL --sensor kinect_v2 --at 0,0,0 --view top -o DIR/x.las", "--preview"),
        ("info HALL --cache chair", "NAME=FILE"),
        ("info HALL --cache =a.pc2@25", "NAME=FILE"),
    ] {
        let output = run(folder.path(), args);
        assert_eq!(output.status.code(), Some(2), "{args}");
        assert!(stderr(&output).contains(says), "{args}\n{}", stderr(&output));
        assert!(output.stdout.is_empty(), "{args}");
    }
    assert!(common::files(folder.path()).is_empty());
}

/// Runs the program in `folder` for each row of `table`: arguments, and words in the single line that it ends with.
#[track_caller]
fn all_end_with(code: i32, folder: &Path, table: &[(&str, &[&str])]) {
    for (args, says) in table {
        let output = run(folder, args);
        let line = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{args}\n{line}");
        assert!(line.starts_with("error: ") && line.trim_end().lines().count() == 1, "{args}\n{line}");
        for word in *says {
            let word = word.replace("DIR", &folder.display().to_string());
            assert!(line.contains(&word), "{args}\n{line} lacks {word}");
        }
        assert!(!line.contains(".echocast-"), "{args}\n{line}");
        assert!(output.stdout.is_empty(), "{args}");
    }
}

/// What the parser of arguments accepts, and only the sensor, the scene or the library can detect.
#[test]
fn wrong_usage_that_is_found_late_is_2_and_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "scan HALL --sensor kinect_v2 --at 0,0,1";
    let name = folder.path().file_name().unwrap().to_str().unwrap();
    write_room(folder.path(), &["Front", "Rear"]);
    let written = "scene: {files: [room.gltf]}\nsensors: [{sensor: kinect_v2}]\n\
                   trajectory: {position_m: [0, 0, 1]}\nsamples: 3\noutputs: [{style: plain, format: npz}]\n";
    fs::write(folder.path().join("set.yaml"), written).unwrap();
    let before = common::files(folder.path());
    all_end_with(
        2,
        folder.path(),
        &[
            ("scan DIR/scene.blend --sensor kinect_v2 --at 0,0,0 -o DIR/x.las", &["scene.blend", ".glb", ".obj"]),
            (
                "scan HALL --sensor kinect_v3 --at 0,0,0 -o DIR/x.las",
                &["--sensor", "kinect_v3", "near: kinect_v1, kinect_v2"],
            ),
            (
                &format!("{scene} --set noise.range_sgma_m=0 -o DIR/x.las"),
                &["--set", "range_sgma_m", "near: range_sigma_m"],
            ),
            (&format!("{scene} --set noise.range_sigma_m=-1 -o DIR/x.las"), &["--set", "noise.range_sigma_m", "-1"]),
            (&format!("{scene} --rain=-1 -o DIR/x.las"), &["--rain is -1; allowed: 0 to 500"]),
            (&format!("{scene} --rain -3 -o DIR/x.las"), &["--rain is -3; allowed: 0 to 500"]),
            (&format!("{scene} --snow -0.5 -o DIR/x.las"), &["--snow is -0.5; allowed: 0 to 100"]),
            (&format!("{scene} --fog -3 -o DIR/x.las"), &["--fog is -3; allowed: 0.1 or more"]),
            (&format!("{scene} --fog 0 -o DIR/x.las"), &["--fog is 0; allowed: 0.1 or more"]),
            (&format!("{scene} --dust 50,1e5,5,-1 -o DIR/x.las"), &["--dust: length_m is -1; allowed: above 0"]),
            (&format!("{scene} --dust -50,1e5,5,1 -o DIR/x.las"), &["--dust: radius_um is -50; allowed: "]),
            (
                &format!("{scene} --dust 50,1e5,5,1 --dust 50,-1,5,1 -o DIR/x.las"),
                &["--dust[1]: per_m3 is -1; allowed: "],
            ),
            (&format!("{scene} -o DIR/x.lsa"), &["x.lsa", ".las", ".npz"]),
            (&format!("{scene} -o DIR/x --format laz2"), &["laz2", "las2"]),
            (&format!("{scene} -o DIR --format las"), &["allowed", "name of a file"]),
            (&format!("{scene} -o DIR/x.csv -o DIR/x.csv"), &["x.csv", "twice"]),
            (&format!("{scene} -o DIR/x.csv -o DIR/../{name}/x.csv"), &["x.csv", "twice"]),
            (&format!("{scene} -o DIR/x.png --format las --preview DIR/x.png"), &["x.png", "twice"]),
            (&format!("{scene} -o DIR/x.labels.json --format csv -o DIR/x.csv"), &["x.labels.json", "twice"]),
            (&format!("{scene} -o -"), &["-o -: standard output has no ending", "--format NAME"]),
            (&format!("{scene} -o - --format lsa"), &["lsa", "las"]),
            (&format!("{scene} -o - -o - --format las"), &["-: would be written twice"]),
            (&format!("{scene} -o - --format las --single"), &["-o -", "--single", "a file name"]),
            (&format!("{scene} -o - --format las --fields range"), &["-o -", "x, y and z"]),
            (&format!("{scene} --set noise.range_sigma_m= -o DIR/x.las"), &["has no value"]),
            (&format!("{scene} --organised --order time -o DIR/x.las"), &["--organised", "--order beam"]),
            (&format!("{scene} --up y -o DIR/x.las"), &["--up", "indoor-1.glb"]),
            (&format!("{scene} --frames 0:4294967295 -o DIR/x.las"), &["--frames", "up to 10000000"]),
            (&format!("{scene} --frames 0:99999 -o DIR/x.csv --preview DIR/x.png"), &["--preview", "--single"]),
            (
                &format!("{scene} --frames 0:99999 -o DIR/x.npz"),
                &["x.npz is for up to 21708800000 points; allowed: 4000000000 points of these columns in a npz file"],
            ),
            (&format!("{scene} --frames 0:99999 -o DIR/x --format las2"), &["allowed: 4294967295 points"]),
            (&format!("{scene} --frames 0:999 -o DIR/x --format pcd_compressed"), &["x is for up to 217088000 points"]),
            (&format!("{scene} --explain 217088"), &["--explain", "beam is 217088; allowed: 0 to 217087"]),
            (&format!("{scene} --preview DIR/x.jpg"), &["--preview", "x.jpg", ".png"]),
            (&format!("{scene} --fields range -o DIR/x.las"), &["x, y and z"]),
            ("scan HALL --sensor kinect_v2 --camera Eye -o DIR/x.las", &["--camera", "Eye", "no camera node"]),
            ("scan HALL --sensor kinect_v2 -o DIR/x.las", &["--at X,Y,Z"]),
            ("info HALL --cache Chiar=DIR/a.pc2", &["there is no object named \"Chiar\""]),
            ("info HALL --cache *=DIR/no.abc", &["no.abc", ".mdd and .pc2"]),
            ("info HALL --cache *=DIR/a.pc2@-1", &["caches.*.fps is -1; allowed: numbers above 0"]),
            ("info HALL --cache a=b.pc2 --cache a=c.pc2", &["--cache", "\"a\"", "twice"]),
            ("bench HALL --sensor kinect_v2", &["--at X,Y,Z"]),
            ("info DIR/scene.blend", &["scene.blend", ".glb", ".obj"]),
            ("scan DIR/room.gltf --sensor kinect_v2 -o DIR/x.las", &["--camera NODE", "Front, Rear"]),
            ("scan DIR/room.gltf --sensor kinect_v2 --camera Side -o DIR/x.las", &["--camera Side", "Front, Rear"]),
            ("scan HALL --sensor velodyne --at 0,0,1 -o DIR/x.las", &["--sensor", "matches several", "velodyne_vlp16"]),
            (&format!("{scene} --view fan --preview DIR/x.png"), &["--view fan: the sensor is a tof"]),
            (&format!("{scene} --pings DIR/x.npz"), &["--pings: the sensor is a tof"]),
            (&format!("{scene} --color doppler --preview DIR/x.png"), &["--color doppler"]),
            (&format!("{scene} --boxes DIR/x.txt"), &["--boxes", ".json, .csv"]),
            (&format!("{scene} --ground --preview DIR/x.png"), &["--ground"]),
            (&format!("{scene} --animation Walk -o DIR/x.las"), &["there is no animation named \"Walk\""]),
            (&format!("{scene} --material Sofa=fbric -o DIR/x.las"), &["--material", "near: fabric"]),
            (&format!("{scene} --motion-tolerance 1e9 -o DIR/x.las"), &["--motion-tolerance"]),
            (&format!("{scene} --materials - --env - -o DIR/x.las"), &["standard input is already read"]),
            ("scan HALL --sensor sss_450 --at 0,0,-1 --rain 3 -o DIR/x.las", &["--rain: the sensor is a sonar"]),
            (
                "scan HALL --sensor sss_450 --at 0,0,-1 --returns first -o DIR/x.las",
                &["--returns: the sensor is a sonar"],
            ),
            ("generate seabed --depth -3 -o DIR/x.glb", &["--depth is -3; allowed: "]),
            ("generate seabed -o DIR/x.obj", &["-o DIR/x.obj: scenes are written as .glb"]),
            ("run DIR/set.yaml --set sampels=4", &["--set", "near: samples"]),
            ("run DIR/set.yaml --samples 0:9", &["samples is 0 to 9, every 1; allowed: 0 to 2"]),
            ("run DIR/set.yaml --shard 3/3", &["shard is 3/3; allowed: 0/3 to 2/3"]),
            ("run DIR/set.yaml --sample 0 --preview DIR/x.jpg", &["--preview", "x.jpg", ".png"]),
            ("sensors vleodyne", &["vleodyne"]),
        ],
    );
    assert_eq!(common::files(folder.path()), before);
}

#[test]
fn failed_work_is_1_and_one_line_that_names_the_cause() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "scan HALL --sensor kinect_v2 --at 0,0,1";
    for (name, text) in [
        ("wrong.yaml", "rian: {rate_mm_h: 5}\n"),
        ("broken.glb", "glTF"),
        ("video.gltf", r#"{"asset": {"version": "2.0"}, "extensionsRequired": ["MPEG_media"]}"#),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let before = common::files(folder.path());
    all_end_with(
        1,
        folder.path(),
        &[
            ("scan DIR/no.glb --sensor kinect_v2 --at 0,0,0 -o DIR/x.las", &["no.glb: No such file"]),
            ("scan HALL --sensor DIR/no.yaml --at 0,0,0 -o DIR/x.las", &["--sensor", "no.yaml: No such file"]),
            (&format!("{scene} --env DIR/no.yaml -o DIR/x.las"), &["no.yaml: No such file"]),
            (&format!("{scene} -o DIR/no/x.las"), &["no/x.las: No such file"]),
            (&format!("{scene} --preview DIR/no/x.png"), &["--preview", "DIR/no"]),
            ("scan HALL --sensor kinect_v2 --trajectory DIR/no.txt -o DIR/x.las", &["no.txt: No such file"]),
            ("scan HALL FLAT DIR/no.obj --sensor kinect_v2 --at 0,0,0 -o DIR/x.las", &["no.obj: No such file"]),
            ("info DIR/no.glb", &["no.glb: No such file"]),
            ("info HALL --cache *=DIR/no.pc2", &["no.pc2: No such file"]),
            (&format!("{scene} --env DIR/wrong.yaml -o DIR/x.las"), &["wrong.yaml: line 1: ", "near: rain"]),
            ("scan HALL --sensor DIR/wrong.yaml --at 0,0,1 -o DIR/x.las", &["--sensor", "wrong.yaml", "name"]),
            ("info DIR/broken.glb", &["broken.glb"]),
            ("info DIR/video.gltf", &["MPEG_media", "not supported"]),
            ("scan HALL --sensor sss_450 --at 0,0,1 -o DIR/x.las", &["the sonar is 1.000 m above the water"]),
            ("generate landscape --height-map DIR/no.png -o DIR/x.glb", &["no.png: No such file"]),
            ("run DIR/wrong.yaml", &["wrong.yaml"]),
            ("run DIR/no.yaml", &["no.yaml: No such file"]),
            ("run --check-output DIR/no", &["--check-output"]),
        ],
    );
    assert_eq!(common::files(folder.path()), before);
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    for command in ["sensors", "formats", "scan --help"] {
        let (reader, writer) = pipe().unwrap();
        drop(reader);
        let mut program = common::command(Path::new("."), command);
        let output = program.stdout(writer).output().unwrap();
        assert!(output.status.success(), "{command}");
        assert_eq!(stderr(&output), "", "{command}");
    }
}

#[test]
fn one_beam_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(folder.path(), "scan HALL --sensor kinect_v2 --at 0,0,1 --explain 100000");
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for word in ["beam 100000: row 195, column 160", "aim:", "ray: one", "echoes", "returns:"] {
        assert!(text.contains(word), "{word} is not in\n{text}");
    }
    assert!(common::files(folder.path()).is_empty());
}

#[test]
fn sensors_are_listed_and_shown_as_files_that_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let list = stdout(folder.path(), "sensors");
    for preset in echocast::Sensor::presets() {
        assert!(list.contains(&preset.name) && list.contains(&preset.title), "{}", preset.name);
    }
    let text = stdout(folder.path(), "sensors velodyne_vlp16");
    assert!(text.starts_with("name: velodyne_vlp16\n"));
    std::fs::write(folder.path().join("mine.yaml"), &text).unwrap();
    assert_eq!(stdout(folder.path(), "sensors DIR/mine.yaml"), text);
}

#[test]
fn words_choose_sensors() {
    let folder = Path::new(".");
    let list = stdout(folder, "sensors velodyne");
    let presets = echocast::Sensor::presets();
    for preset in &presets {
        let fits = preset.name.contains("velodyne") || preset.title.contains("Velodyne");
        assert_eq!(list.contains(&format!("  {} ", preset.name)), fits, "{}", preset.name);
    }
    // All words, each in name, title or folder; a folder is not a name.
    let list = stdout(folder, "sensors OUSTER 128 os1");
    assert!(list.lines().count() == 2 && list.contains("  ouster_os1_128 "), "{list}");
    assert_eq!(stdout(folder, "sensors ouster os1").lines().count(), 3);
    for name in ["lidar", "survey", "tof", "sonar", "radar", "paper"] {
        let folders = presets.iter().filter(|preset| preset.folder == name).count();
        assert!(stdout(folder, &format!("sensors {name}")).lines().count() > folders, "{name}");
    }
    for name in ["VLP-16", "vlp16", "velodyne vlp16", "velodyne_vlp16"] {
        assert!(stdout(folder, &format!("sensors {name}")).starts_with("name: velodyne_vlp16\n"), "{name}");
    }
}

/// Programs rely on these keys, which docs/files.md lists.
#[test]
fn lists_are_json_for_programs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let keys = |value: &Value| {
        let mut names: Vec<String> = value.as_object().expect("an object").keys().cloned().collect();
        names.sort();
        names.join(" ")
    };
    let sensors = report(folder, "sensors");
    assert_eq!(sensors.as_array().unwrap().len(), echocast::Sensor::presets().len());
    assert!(sensors.as_array().unwrap().iter().all(|sensor| keys(sensor) == "folder kind name title"));
    let kinds: Vec<_> = report(folder, "sensors velodyne").as_array().unwrap().clone();
    assert!(kinds.len() > 4 && kinds.iter().all(|sensor| sensor["kind"] == "lidar"));
    let sensor = report(folder, "sensors vlp16");
    assert_eq!((&sensor["name"], &sensor["pattern"]["type"]), (&"velodyne_vlp16".into(), &"spinning".into()));

    let formats = report(folder, "formats");
    assert_eq!(keys(&formats), "clouds clouds_read pictures pings radars scenes");
    let clouds = formats["clouds"].as_array().unwrap();
    assert!(clouds.iter().all(|cloud| keys(cloud) == "cannot_hold description extensions label_names name"));
    let [las, oldest] = ["las", "las2"].map(|name| clouds.iter().find(|cloud| cloud["name"] == name).unwrap());
    assert_eq!((&las["extensions"], &las["cannot_hold"]), (&json!(["las"]), &json!([])));
    assert!(oldest["cannot_hold"].as_array().unwrap().contains(&"range".into()));
    for kind in ["scenes", "pictures", "pings", "radars"] {
        let formats = formats[kind].as_array().unwrap();
        assert!(!formats.is_empty() && formats.iter().all(|it| keys(it) == "description extensions name"), "{kind}");
    }

    write_room(folder, &["Front"]);
    let room = report(folder, "info DIR/room.gltf");
    assert_eq!(
        keys(&room),
        "animations bounds cameras categories degenerate_triangles files instances materials meshes parts textures \
         triangles warnings"
    );
    assert_eq!((&room["triangles"], &room["instances"], &room["meshes"]), (&2.into(), &1.into(), &1.into()));
    assert_eq!(room["bounds"], json!({"low": [-10.0, -10.0, 0.0], "high": [10.0, 10.0, 0.0]}));
    assert_eq!(keys(&room["cameras"][0]), "direction name position");
    assert_eq!(
        (&room["cameras"][0]["name"], &room["cameras"][0]["position"]),
        (&"Front".into(), &json!([0.0, 0.0, 2.0]))
    );
    assert!((room["cameras"][0]["direction"][2].as_f64().unwrap() + 1.0).abs() < 1e-9);
    let hall = report(folder, "info HALL");
    assert_eq!(
        keys(&hall["materials"][0]),
        "alpha by_image changes name opacity radar radar_why reflectance source spread why"
    );
    assert_eq!(keys(&hall["categories"][0]), "id name objects");
    assert_eq!(keys(&hall["parts"][0]), "id name");
    stdout(folder, "generate street --seconds 8 -q -o DIR/street.glb");
    assert_eq!(keys(&report(folder, "info DIR/street.glb")["animations"][0]), "length_s name");
}

#[test]
fn a_plan_is_drawn_of_any_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_room(path, &["Front", "A camera with a long name"]);
    assert!(stdout(path, "info DIR/room.gltf --preview DIR/room.png").contains("triangles   2\n"));
    report(path, "info HALL --preview DIR/hall.png");
    for name in ["room.png", "hall.png"] {
        let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(path.join(name)).unwrap()));
        let info = decoder.read_info().unwrap();
        assert!(info.info().width == 1600 && info.info().height > 300, "{name}");
    }
    let before = common::files(path);
    all_end_with(2, path, &[("info HALL --preview DIR/x.jpg", &["--preview", "x.jpg", ".png"])]);
    all_end_with(1, path, &[("info HALL --preview DIR/no/x.png", &["--preview", "no"])]);
    assert_eq!(common::files(path), before);
}

#[test]
fn a_time_of_boxes_needs_boxes() {
    let folder = tempfile::tempdir().unwrap();
    let scan = "scan HALL --sensor velodyne_vlp16 --at 0,0,1 --box-time";
    for alone in ["end", "start", "scan"] {
        let output = run(folder.path(), &format!("{scan} {alone} -o DIR/x.las"));
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        for option in ["--boxes", "--show", "--annotations"] {
            assert!(message.contains(option), "{message}");
        }
    }
    assert!(common::files(folder.path()).is_empty());
    stdout(folder.path(), &format!("{scan} end --boxes DIR/boxes.json"));
}

#[test]
fn shells_complete_commands_and_options() {
    for shell in ["bash", "zsh", "fish"] {
        let script = stdout(Path::new("."), &format!("completions {shell}"));
        for word in ["scan", "sensors", "--trajectory", "frames", "preview"] {
            assert!(script.contains(word.trim_start_matches('-')), "{shell}: {word}");
        }
    }
    assert_eq!(run(Path::new("."), "completions cmd").status.code(), Some(2));
}

#[test]
fn formats_are_listed_with_what_they_lack() {
    let list = stdout(Path::new("."), "formats");
    for format in echocast::export::FORMATS {
        assert!(list.contains(&format!("  {} ", format.name())) && list.contains(format.info().description));
    }
    for format in echocast::scene::FORMATS {
        assert!(list.contains(&format!("  {} ", format.name)) && list.contains(format.description));
    }
    assert!(list.contains("cannot hold range") && list.contains(".labels.json"));
}

#[test]
fn info_describes_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let hall = stdout(folder.path(), "info HALL");
    for text in ["triangles   58,", "ChromeMat", "chair", "3 objects", "cameras     0", "animations  0", "seat"] {
        assert!(hall.contains(text), "{text} is missing in\n{hall}");
    }
    write_room(folder.path(), &["Front"]);
    let room = stdout(folder.path(), "info DIR/room.gltf");
    for text in [
        "triangles   2\n",
        "1 instance",
        "Floor",
        "Front",
        "at 0.000,0.000,2.000",
        "size        20.000 x 20.000 x 0.000 m",
    ] {
        assert!(room.contains(text), "{text} is missing in\n{room}");
    }
    // Its floor from another file, the `@` in whose name does not begin a rate.
    fs::write(folder.path().join("bed@home_1.obj"), "v 0 0 0\nv 7 0 0\nv 0 1 2\nf 1 2 3\n").unwrap();
    let room = stdout(folder.path(), "info DIR/room.gltf --cache Floor=DIR/bed@home_1.obj@25");
    assert!(room.contains("triangles   1\n") && room.contains("size        7.000 x 2.000 x 1.000 m"), "{room}");
}
