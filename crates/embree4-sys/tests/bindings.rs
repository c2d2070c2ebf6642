//! The checked-in declarations are what bindgen makes of the header today.

use std::fs;
use std::process::Command;

#[test]
fn checked_in_bindings_equal_regenerated_ones() {
    let fresh = concat!(env!("CARGO_TARGET_TMPDIR"), "/bindings.rs");
    let output = Command::new(concat!(env!("CARGO_MANIFEST_DIR"), "/regenerate"))
        .arg(fresh)
        .output()
        .expect("the script `regenerate` runs");
    let message = String::from_utf8_lossy(&output.stderr);
    match output.status.code() {
        Some(0) => assert!(
            fs::read(fresh).expect("regenerate wrote it") == include_bytes!("../src/bindings.rs"),
            "src/bindings.rs is stale: run crates/embree4-sys/regenerate"
        ),
        Some(3) => println!("skipped: {}", message.trim()),
        _ => panic!("regenerate failed: {message}"),
    }
}
