//! The fuzz targets (`scripts/fuzz`), with inputs derived from the seeds: a short part of that work, the same in every
//! run.

use echocast_tests::reference::Random;
use std::fs;
use std::path::Path;

#[path = "../fuzz/src/lib.rs"]
#[allow(unsafe_code, clippy::undocumented_unsafe_blocks, missing_docs)]
mod targets;

/// One to eight changes of an input.
fn change(random: &mut Random, input: &mut Vec<u8>, others: &[Vec<u8>]) {
    const ODD: &[u8] = b"\0\xff\x80-0.9eE+{}[]:,\n \"'#&*!|>%@";
    for _ in 0..=random.below(8) {
        let at = random.below(input.len() + 1);
        let end = (at + random.below(32)).min(input.len());
        match random.below(7) {
            0 => drop(input.drain(at..end)),
            1 => input.insert(at, ODD[random.below(ODD.len())]),
            2 if at < input.len() => input[at] = ODD[random.below(ODD.len())],
            3 if at < input.len() => input[at] ^= 1 << random.below(8),
            4 => {
                let copy = input[at..end].to_vec();
                let to = random.below(input.len() + 1);
                input.splice(to..to, copy);
            }
            5 if !others.is_empty() => {
                let other = &others[random.below(others.len())];
                let from = random.below(other.len() + 1);
                let piece = &other[from..(from + random.below(64)).min(other.len())];
                input.splice(at..at, piece.iter().copied());
            }
            _ => input.truncate(at.max(1)),
        }
    }
}

/// Runs a target with its seeds, and with `rounds` inputs derived from them.
fn fuzz(target: &str, rounds: usize, seeds: &[&[u8]], run: impl Fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds").join(target);
    let mut known: Vec<Vec<u8>> = seeds.iter().map(|seed| seed.to_vec()).collect();
    let mut files: Vec<_> = fs::read_dir(folder).into_iter().flatten().map(|file| file.unwrap().path()).collect();
    files.sort();
    known.extend(files.iter().map(|file| fs::read(file).unwrap()));
    assert!(!known.is_empty(), "no seeds of {target}");
    known.iter().for_each(|seed| run(seed));
    let random = &mut Random::new(1);
    for _ in 0..rounds {
        let mut input = known[random.below(known.len())].clone();
        change(random, &mut input, &known);
        run(&input);
    }
}

#[test]
fn gltf() {
    let moving: &[&[u8]] = &[
        include_bytes!("data/motion/morph_skin.glb"),
        include_bytes!("data/motion/trs_cubic.glb"),
        include_bytes!("data/motion/flag.glb"),
        include_bytes!("data/scenes/compressed/draco_edgebreaker.glb"),
        include_bytes!("data/scenes/compressed/draco_sequential.glb"),
        include_bytes!("data/scenes/compressed/pack_instanced.glb"),
        include_bytes!("data/scenes/compressed/pack_khr.glb"),
    ];
    fuzz("gltf", 3000, moving, targets::gltf::run);
}

#[test]
fn fbx() {
    fuzz("fbx", 1000, &[include_bytes!("data/scenes/blender/scene.fbx")], targets::fbx::run);
}

#[test]
fn obj() {
    fuzz("obj", 2000, &[], targets::obj::run);
}

#[test]
fn ply() {
    fuzz("ply", 2000, &[], targets::ply::run);
}

#[test]
fn stl() {
    fuzz("stl", 2000, &[], targets::stl::run);
}

#[test]
fn cache() {
    fuzz("cache", 1000, &[], targets::cache::run);
}

#[test]
fn cloud() {
    fuzz("cloud", 3000, &[], targets::cloud::run);
}

#[test]
fn hdf5() {
    fuzz("hdf5", 1500, &[], targets::hdf5::run);
}

#[test]
fn scenario() {
    fuzz("scenario", 1500, &[], |bytes| {
        if let Ok(text) = std::str::from_utf8(bytes) {
            targets::scenario::run(text);
        }
    });
}

#[test]
fn table() {
    let table = b"azimuth_deg,elevation_deg,time_us,channel\n0,1,0,0\n10,-1,2.5,1\n";
    let poses = b"time,x,y,z,qx,qy,qz,qw\n0,0,0,1,0,0,0,1\n1,2,0,1,0,0,0.7,0.7\n";
    let places = b"t,lat,lon,height,roll_deg,pitch_deg,heading_deg\n0,49,9,100,0,1,2\n1,49.1,9,100,0,1,2\n";
    let helios = b"#HEADER: \"t\", \"roll\", \"pitch\", \"yaw\", \"x\", \"y\", \"z\"\n0, 0, 5, 90, 0, -40, 7\n";
    let record = |time: f64| [time, 0.85, 0.16, 500.0].into_iter().chain([0.0; 13]).flat_map(f64::to_le_bytes);
    let sbet: Vec<u8> = (0..3).flat_map(|second| record(f64::from(second))).collect();
    fuzz("table", 2000, &[table, poses, places, helios, &sbet], targets::table::run);
}

#[test]
fn yaml() {
    fuzz("yaml", 500, &[], |bytes| {
        if let Ok(text) = std::str::from_utf8(bytes) {
            targets::yaml::run(text);
        }
    });
}

#[test]
fn capi() {
    fuzz("capi", 100, &[], targets::capi::run);
}
