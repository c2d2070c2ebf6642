//! The example runs, and says the same each time.

use std::process::Command;
use std::{env, fs};

#[test]
fn the_same_scan_has_the_same_digest() {
    let path = env::temp_dir().join(format!("echocast-example-{}.las", std::process::id()));
    let run = || {
        let output = Command::new(env!("CARGO_BIN_EXE_echocast-example")).arg(&path).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let size = fs::metadata(&path).unwrap().len();
        fs::remove_file(&path).unwrap();
        (String::from_utf8(output.stdout).unwrap(), size)
    };
    let (line, size) = run();
    assert!(line.contains(" points, digest ") && size > 10_000, "{line}, {size} bytes");
    assert_eq!(run(), (line, size));
}
