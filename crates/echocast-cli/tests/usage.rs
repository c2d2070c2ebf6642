//! Help, exit codes and error lines.

mod common;

use common::{run, stderr, stdout, write_room};
use std::fs;
use std::io::pipe;
use std::path::Path;

const COMMANDS: [&str; 6] = ["scan", "sensors", "info", "generate", "formats", "bench"];

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

#[test]
fn failed_work_is_1_and_one_line_that_names_the_cause() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "scan HALL --sensor kinect_v2 --at 0,0,1";
    let name = folder.path().file_name().unwrap().to_str().unwrap();
    for (args, says) in [
        ("scan DIR/no.glb --sensor kinect_v2 --at 0,0,0 -o DIR/x.las", &["no.glb: No such file"][..]),
        ("scan DIR/scene.blend --sensor kinect_v2 --at 0,0,0 -o DIR/x.las", &["scene.blend", ".glb", ".obj"]),
        (
            "scan HALL --sensor kinect_v3 --at 0,0,0 -o DIR/x.las",
            &["--sensor", "kinect_v3", "near: kinect_v1, kinect_v2"],
        ),
        ("scan HALL --sensor DIR/no.yaml --at 0,0,0 -o DIR/x.las", &["--sensor", "no.yaml: No such file"]),
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
        (&format!("{scene} --dust 50,1e5,5,1 --dust 50,-1,5,1 -o DIR/x.las"), &["--dust[1]: per_m3 is -1; allowed: "]),
        (&format!("{scene} --env DIR/no.yaml -o DIR/x.las"), &["no.yaml: No such file"]),
        (&format!("{scene} -o DIR/x.lsa"), &["x.lsa", ".las", ".npz"]),
        (&format!("{scene} -o DIR/x --format laz2"), &["laz2", "las2"]),
        (&format!("{scene} -o DIR/no/x.las"), &["no/x.las: No such file"]),
        (&format!("{scene} -o DIR --format las"), &["allowed", "name of a file"]),
        (&format!("{scene} -o DIR/x.csv -o DIR/x.csv"), &["x.csv", "twice"]),
        (&format!("{scene} -o DIR/x.csv -o DIR/../{name}/x.csv"), &["x.csv", "twice"]),
        (&format!("{scene} -o DIR/x.png --format las --preview DIR/x.png"), &["x.png", "twice"]),
        (&format!("{scene} -o DIR/x.labels.json --format csv -o DIR/x.csv"), &["x.labels.json", "twice"]),
        (&format!("{scene} -o - --format las"), &["-o -", "a file name"]),
        (&format!("{scene} --set noise.range_sigma_m= -o DIR/x.las"), &["has no value"]),
        (&format!("{scene} --organised --order time -o DIR/x.las"), &["--organised", "--order beam"]),
        (&format!("{scene} --up y -o DIR/x.las"), &["--up", "indoor-1.glb"]),
        (&format!("{scene} --frames 0:4294967295 -o DIR/x.las"), &["--frames", "--single"]),
        (&format!("{scene} --explain 217088"), &["--explain", "beam is 217088; allowed: 0 to 217087"]),
        (&format!("{scene} --preview DIR/x.jpg"), &["--preview", "x.jpg", ".png"]),
        (&format!("{scene} --preview DIR/no/x.png"), &["--preview", "DIR/no"]),
        (&format!("{scene} --fields range -o DIR/x.las"), &["x, y and z"]),
        ("scan HALL --sensor kinect_v2 --camera Eye -o DIR/x.las", &["--camera", "Eye", "no camera node"]),
        ("scan HALL --sensor kinect_v2 -o DIR/x.las", &["--at X,Y,Z"]),
        ("scan HALL --sensor kinect_v2 --trajectory DIR/no.txt -o DIR/x.las", &["no.txt: No such file"]),
        ("scan HALL FLAT DIR/no.obj --sensor kinect_v2 --at 0,0,0 -o DIR/x.las", &["no.obj: No such file"]),
        ("sensors kinect", &["kinect", "kinect_v2"]),
        ("info DIR/no.glb", &["no.glb: No such file"]),
        ("info HALL --cache Chiar=DIR/a.pc2", &["there is no object named \"Chiar\""]),
        ("info HALL --cache *=DIR/no.pc2", &["no.pc2: No such file"]),
        ("info HALL --cache *=DIR/no.ply", &["no.ply", ".mdd and .pc2"]),
        ("info HALL --cache *=DIR/a.pc2@-1", &["caches.*.fps is -1; allowed: numbers above 0"]),
        ("info HALL --cache a=b.pc2 --cache a=c.pc2", &["--cache", "\"a\"", "twice"]),
        ("bench HALL --sensor kinect_v2", &["--at X,Y,Z"]),
    ] {
        let output = run(folder.path(), args);
        let line = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{args}\n{line}");
        assert!(line.starts_with("error: ") && line.trim_end().lines().count() == 1, "{args}\n{line}");
        for word in says {
            let word = word.replace("DIR", &folder.path().display().to_string());
            assert!(line.contains(&word), "{args}\n{line} lacks {word}");
        }
        assert!(!line.contains(".echocast-"), "{args}\n{line}");
        assert!(output.stdout.is_empty(), "{args}");
    }
    assert!(common::files(folder.path()).is_empty());
}

#[test]
fn cameras_are_listed_where_one_must_be_chosen() {
    let folder = tempfile::tempdir().unwrap();
    write_room(folder.path(), &["Front", "Rear"]);
    for args in ["", "--camera Side"] {
        let output = run(folder.path(), &format!("scan DIR/room.gltf --sensor kinect_v2 {args} -o DIR/x.las"));
        assert_eq!(output.status.code(), Some(1));
        let line = stderr(&output);
        assert!(line.contains("Front, Rear") && line.contains("--camera"), "{line}");
    }
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
fn formats_are_listed_with_what_they_lack() {
    let list = stdout(Path::new("."), "formats");
    for format in echocast::export::FORMATS {
        assert!(list.contains(&format!("  {} ", format.name())) && list.contains(format.description()));
    }
    for format in echocast::scene::FORMATS {
        assert!(list.contains(&format!("  {} ", format.name)) && list.contains(format.description));
    }
    assert!(list.contains("cannot hold range") && list.contains(".labels.json"));
}

#[test]
fn info_tells_what_a_scene_holds() {
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
    // Its floor from another file, whose name is not that of a rate.
    fs::write(folder.path().join("bed@home_1.obj"), "v 0 0 0\nv 7 0 0\nv 0 1 2\nf 1 2 3\n").unwrap();
    let room = stdout(folder.path(), "info DIR/room.gltf --cache Floor=DIR/bed@home_1.obj@25");
    assert!(room.contains("triangles   1\n") && room.contains("size        7.000 x 2.000 x 1.000 m"), "{room}");
}
