//! The examples of all languages run, and say the same. What the program writes is compared in its own tests.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

const EXAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// A folder for programs and what they write.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(env!("CARGO_CRATE_NAME")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// What a program prints.
#[track_caller]
fn said(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Compiles an example of C or C++ and links it to the library that was just built.
fn compile(folder: &Path, source: &str) -> PathBuf {
    let (compiler, standard) = if source.ends_with(".c") { ("cc", "-std=c99") } else { ("c++", "-std=c++11") };
    let program = folder.join(source.replace(['/', '.'], "-"));
    let deps = env::current_exe().unwrap().parent().unwrap().to_owned();
    let mut command = Command::new(compiler);
    command.args([standard, "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I"]);
    command.arg(Path::new(EXAMPLES).join("../include")).arg(Path::new(EXAMPLES).join(source));
    for name in ["libechocast.so", "libechocast.so.1"] {
        let _ = std::os::unix::fs::symlink(deps.join("libechocast_capi.so"), folder.join(name));
    }
    command.arg("-L").arg(folder).arg("-lechocast").arg(format!("-Wl,-rpath,{}", folder.display()));
    said(command.arg("-o").arg(&program));
    program
}

/// The Python in which the wheel is installed: `make test` builds it and says where. None in other tests.
fn python(source: &str) -> Option<Command> {
    let mut command = Command::new(env::var_os("ECHOCAST_WHEEL_PYTHON")?);
    command.arg(Path::new(EXAMPLES).join(source));
    Some(command)
}

#[test]
fn one_scan_has_one_digest_in_every_language() {
    let folder = folder("scan");
    let scene = format!("{EXAMPLES}/scenes/indoor-1.glb");
    let rust = |path: &Path| said(Command::new(env!("CARGO_BIN_EXE_echocast-example")).arg(path));
    let path = folder.join("hall.las");
    let line = rust(&path);
    let file = fs::read(&path).unwrap();
    assert!(line.contains(" points, digest ") && file.len() > 10_000, "{line}, {} bytes", file.len());
    assert_eq!(rust(&path), line);
    let compiled = ["c/scan.c", "cpp/scan.cpp"].map(|source| (source, Command::new(compile(&folder, source))));
    let python = python("python/scan.py").map(|command| ("python/scan.py", command));
    for (source, mut program) in compiled.into_iter().chain(python) {
        fs::remove_file(&path).unwrap();
        assert_eq!(said(program.arg(&scene).arg(&path)), line, "{source}");
        assert!(fs::read(&path).unwrap() == file, "the file of {source} differs");
    }
}

#[test]
fn a_live_loop_has_one_digest_in_every_language() {
    let folder = folder("live");
    let line = said(&mut Command::new(env!("CARGO_BIN_EXE_live")));
    assert!(line.starts_with("100 frames: ") && line.contains(" points, digest "), "{line}");
    let compiled = ["c/live.c", "cpp/live.cpp"].map(|source| Command::new(compile(&folder, source)));
    for mut program in compiled.into_iter().chain(python("python/live.py")) {
        assert_eq!(said(&mut program), line, "{program:?}");
    }
}
