//! Whether there are recorded scans, and the Rust of the README as functions.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

fn main() {
    // Tests without them are listed as ignored, with the reason.
    println!("cargo::rustc-check-cfg=cfg(recorded)");
    println!("cargo::rerun-if-env-changed=ECHOCAST_SHARED");
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let beside = || here.join("../../shared");
    let folder = env::var_os("ECHOCAST_SHARED").map_or_else(beside, PathBuf::from).join("reference/scans");
    println!("cargo::rerun-if-changed={}", folder.display());
    println!("cargo::rustc-env=RECORDED_SCANS={}", folder.display());
    if folder.is_dir() {
        println!("cargo::rustc-cfg=recorded");
    }

    let readme = here.join("../README.md");
    println!("cargo::rerun-if-changed={}", readme.display());
    let readme = fs::read_to_string(readme).expect("the README is there");
    let blocks = readme.split("```rust\n").skip(1).filter_map(|rest| rest.split("\n```").next());
    let mut code = String::new();
    for (number, block) in blocks.enumerate() {
        writeln!(code, "pub fn block_{number}(given: Given) -> Result<()> {{").expect("a String takes all");
        writeln!(
            code,
            "let Given {{ sensor, drive, options, mut cloud, world_from_car }} = given;\n{block}\nOk(())\n}}"
        )
        .expect("a String takes all");
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it")).join("readme.rs");
    fs::write(out, code).expect("OUT_DIR can be written");
}
