//! Where Embree is (rpath.rs, shared with the other packages), and whether there are recorded scans.

use std::env;
use std::path::PathBuf;

mod rpath;

fn main() {
    rpath::main();
    // Tests without them are listed as ignored, with the reason.
    println!("cargo::rustc-check-cfg=cfg(recorded)");
    println!("cargo::rerun-if-env-changed=ECHOCAST_SHARED");
    let beside = || PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("../../shared");
    let folder = env::var_os("ECHOCAST_SHARED").map_or_else(beside, PathBuf::from).join("reference/scans");
    println!("cargo::rerun-if-changed={}", folder.display());
    println!("cargo::rustc-env=RECORDED_SCANS={}", folder.display());
    if folder.is_dir() {
        println!("cargo::rustc-cfg=recorded");
    }
}
