//! Compilers, and programs in C and C++ that run with the library just built.
#![allow(dead_code)] // each test uses some of it

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::{env, fs};

/// The C compilers that are installed, with their C++ compilers.
pub fn compilers() -> Vec<[&'static str; 2]> {
    let all = [["gcc", "g++"], ["clang", "clang++"]];
    let here =
        all.into_iter().filter(|[c, _]| Command::new(c).arg("--version").output().is_ok_and(|o| o.status.success()));
    let here: Vec<_> = here.collect();
    assert!(!here.is_empty(), "there is neither gcc nor clang: run scripts/setup --test");
    here
}

/// Whether a program can be run.
pub fn is_here(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

pub fn include() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../include")
}

pub fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c").join(name)
}

/// The folder of this test, newly created.
pub fn folder(name: &str) -> PathBuf {
    // Programs of tests run side by side.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(env!("CARGO_CRATE_NAME")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// The library of the build that this test belongs to: `libechocast_capi` with the extension `.so` or `.a`.
pub fn library(ending: &str) -> PathBuf {
    let deps = env::current_exe().unwrap();
    let library = deps.with_file_name(format!("libechocast_capi{ending}"));
    assert!(library.exists(), "{} has not been built", library.display());
    library
}

/// A folder where programs find the shared library under its installed name.
pub fn stage(folder: &Path) -> PathBuf {
    let stage = folder.join("lib");
    fs::create_dir_all(&stage).unwrap();
    for name in ["libechocast.so", "libechocast.so.1"] {
        let link = stage.join(name);
        if !link.exists() {
            std::os::unix::fs::symlink(library(".so"), link).unwrap();
        }
    }
    stage
}

/// Runs a command that must succeed.
#[track_caller]
pub fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(
        output.status.success(),
        "{command:?}: {}\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// Compiles `sources` to a program in `folder` that is linked to the shared library.
#[track_caller]
pub fn program(folder: &Path, compiler: &str, options: &[&str], sources: &[PathBuf]) -> PathBuf {
    let stage = stage(folder);
    let path = folder.join(sources[0].file_stem().unwrap());
    run(Command::new(compiler)
        .args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-g", "-O1"])
        .args(options)
        .arg("-I")
        .arg(include())
        .args(sources)
        .arg("-L")
        .arg(&stage)
        .arg(format!("-Wl,-rpath,{}", stage.display()))
        .args(["-lechocast", "-lm", "-lpthread", "-o"])
        .arg(&path));
    path
}
