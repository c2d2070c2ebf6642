//! Runs the program and inspects its output.
#![allow(dead_code, reason = "each test program uses its part")]

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::{fs, str};

/// The program with `args`, which are separated by spaces; `DIR` in them is `folder`, `HALL` the scene that ships with
/// the repository and its labels.
pub fn command(folder: &Path, args: &str) -> Command {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/scenes");
    let mut command = Command::new(env!("CARGO_BIN_EXE_echocast"));
    for arg in args.split_whitespace() {
        match arg {
            "HALL" => {
                command.arg(scenes.join("indoor-1.glb")).arg("--labels").arg(scenes.join("indoor-1.labels.yaml"));
            }
            "FLAT" => {
                command.arg(scenes.join("apartment.glb"));
            }
            _ => {
                command.arg(arg.replace("DIR", &folder.display().to_string()));
            }
        }
    }
    command
}

pub fn run(folder: &Path, args: &str) -> Output {
    command(folder, args).output().expect("the program starts")
}

/// Runs the program, which must succeed, and returns its stdout.
pub fn stdout(folder: &Path, args: &str) -> String {
    let output = run(folder, args);
    assert!(output.status.success(), "{args}\n{}", stderr(&output));
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Runs the program with `--json`, which must succeed, and returns its report.
pub fn report(folder: &Path, args: &str) -> Value {
    serde_json::from_str(&stdout(folder, &format!("{args} --json"))).expect("stdout is one JSON value")
}

pub fn stderr(output: &Output) -> &str {
    str::from_utf8(&output.stderr).expect("UTF-8")
}

/// Names of all files in `folder`, sorted.
pub fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8"))
        .collect();
    names.sort();
    names
}

/// Column `name` of a CSV cloud.
pub fn csv_column(file: &Path, name: &str) -> Vec<f64> {
    let text = fs::read_to_string(file).expect("a text file");
    let mut lines = text.lines();
    let column = lines.next().expect("a header").split(',').position(|known| known == name).expect("the column");
    lines.map(|line| line.split(',').nth(column).expect("a value").parse().expect("a number")).collect()
}

/// Writes `room.gltf` with its buffer to `folder`: a floor of 20 x 20 m at z = 0 called `Floor`, and a camera node for
/// each of `cameras`, 2 m above it, looking straight down.
pub fn write_room(folder: &Path, cameras: &[&str]) -> PathBuf {
    let mut buffer = Vec::new();
    // glTF is y up.
    for [x, z] in [[-10.0f32, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]] {
        buffer.extend([x, 0.0, z].iter().flat_map(|value| value.to_le_bytes()));
    }
    buffer.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    fs::write(folder.join("room.bin"), &buffer).expect("the folder is writable");

    let mut nodes = vec![serde_json::json!({ "name": "Floor", "mesh": 0 })];
    // A quarter turn about x takes the camera's -z to -y, which is down.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    nodes.extend(cameras.iter().map(|name| {
        serde_json::json!({ "name": name, "camera": 0, "translation": [0, 2, 0], "rotation": [-half, 0, 0, half] })
    }));
    let mut room = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "buffers": [{ "uri": "room.bin", "byteLength": buffer.len() }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-10, 0, -10], "max": [10, 0, 10] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
    });
    if !cameras.is_empty() {
        room["cameras"] = serde_json::json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    }
    let path = folder.join("room.gltf");
    fs::write(&path, room.to_string()).expect("the folder is writable");
    path
}

/// Writes `pole.yaml` to `folder`: an ideal sensor with a single beam, straight ahead, 10 scans a second.
pub fn write_single_beam(folder: &Path) {
    let text = "name: pole\nkind: lidar\npattern: {type: pinhole, resolution: [1, 1], fov_deg: [1, 1], rate_hz: 10}\n";
    fs::write(folder.join("pole.yaml"), text).expect("the folder is writable");
}
