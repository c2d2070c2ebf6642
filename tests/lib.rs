//! Helpers of the tests in this package.
#![forbid(unsafe_code)]

pub mod reference;

use std::path::{Path, PathBuf};
use std::process::Command;

/// Root of the repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("this package is a folder of the repository")
}

/// The document at `path` in the repository has these `rows` of a table.
#[track_caller]
pub fn assert_in_document(path: &str, rows: &str) {
    let file = std::fs::read_to_string(root().join(path)).unwrap();
    assert!(file.contains(rows), "{path} is not up to date; its rows are:\n{rows}");
}

/// The Python of `.venv`, where `scripts/setup --test` installs third-party readers, or `ECHOCAST_PYTHON`.
pub fn python() -> Command {
    let python = match std::env::var_os("ECHOCAST_PYTHON") {
        Some(path) => PathBuf::from(path),
        None => root().join(".venv/bin/python"),
    };
    assert!(python.exists(), "{} is not there: run scripts/setup --test, or set ECHOCAST_PYTHON", python.display());
    let mut command = Command::new(python);
    // Processes started by concurrent tests inherit this one's open files, and their locks.
    command.env("HDF5_USE_FILE_LOCKING", "FALSE");
    command
}
