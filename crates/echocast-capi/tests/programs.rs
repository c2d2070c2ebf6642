//! Programs in C that use the library as hosts do: plainly, under AddressSanitizer and under Valgrind.

mod common;

use common::{compilers, folder, is_here, program, run, source};
use std::path::PathBuf;
use std::process::Command;

const C99: &[&str] = &["-std=c99"];
const ASAN: &[&str] = &["-std=c99", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

#[track_caller]
fn passes(output: &std::process::Output) {
    assert_eq!(String::from_utf8_lossy(&output.stdout), "passed\n");
}

/// Runs the program of one file in a folder of its own.
#[track_caller]
fn check(name: &str, kind: &str, options: &[&str], wrap: &[&str]) {
    let folder = folder(&format!("{name}-{kind}"));
    let program = program(&folder, compilers()[0][0], options, &[source(&format!("{name}.c"))]);
    let mut command = match wrap {
        [] => Command::new(&program),
        [first, rest @ ..] => {
            let mut command = Command::new(first);
            command.args(rest).arg(&program);
            command
        }
    };
    passes(&run(command.arg(&folder).env("ASAN_OPTIONS", "detect_leaks=1:abort_on_error=0")));
}

/// Valgrind, which must not find leaks or errors.
const VALGRIND: &[&str] = &[
    "valgrind",
    "-q",
    "--error-exitcode=9",
    "--leak-check=full",
    "--errors-for-leak-kinds=definite",
    "--show-leak-kinds=definite",
    concat!("--suppressions=", env!("CARGO_MANIFEST_DIR"), "/tests/valgrind.supp"),
];

fn under_valgrind(name: &str) {
    assert!(is_here("valgrind"), "there is no valgrind: run scripts/setup --test");
    check(name, "valgrind", C99, VALGRIND);
}

/// The wrapper for C++ adds nothing to C but comfort.
#[test]
fn the_wrapper_works() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/scenes/glass.gltf");
    for [_, cpp] in compilers() {
        let program = program(&folder("wrapper"), cpp, &["-std=c++11"], &[source("wrapper.cpp")]);
        run(Command::new(program).arg(scene));
    }
}

/// The example moves a sonar along a track, and the block on the bed is in its pings.
#[test]
fn the_example_pings() {
    let folder = folder("example");
    let example = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/c/ping.c"));
    let picture = folder.join("ping.png");
    let output = run(Command::new(program(&folder, compilers()[0][0], C99, &[example])).arg(&picture));
    let printed = String::from_utf8(output.stdout).unwrap();
    let numbers: Vec<u32> = printed.split(' ').filter_map(|word| word.parse().ok()).collect();
    assert!(matches!(numbers[..], [20, cells, on_block, ..] if cells > 10_000 && on_block > 0), "{printed}");
    assert!(picture.exists());
}

#[test]
fn functions_work() {
    check("api", "plain", C99, &[]);
}

/// Cubes and samples of a radar in front of a plate.
#[test]
fn frames_of_radars_work() {
    check("radar", "plain", C99, &[]);
    check("radar", "asan", ASAN, &[]);
}

#[test]
fn functions_work_under_address_sanitizer() {
    check("api", "asan", ASAN, &[]);
}

/// `make test-valgrind`
#[test]
#[ignore = "takes a minute; the sanitizer sees most of it"]
fn functions_work_under_valgrind() {
    under_valgrind("api");
}

#[test]
fn scenarios_work() {
    check("scenario", "plain", C99, &[]);
}

#[test]
fn scenarios_work_under_address_sanitizer() {
    check("scenario", "asan", ASAN, &[]);
}

#[test]
fn scenarios_work_under_valgrind() {
    under_valgrind("scenario");
}

#[test]
fn misuse_is_an_error() {
    check("misuse", "plain", C99, &[]);
}

#[test]
fn misuse_is_an_error_under_address_sanitizer() {
    // The deliberately misaligned pointers are never dereferenced.
    check("misuse", "asan", &["-std=c99", "-fsanitize=address"], &[]);
}

#[test]
fn misuse_is_an_error_under_valgrind() {
    under_valgrind("misuse");
}

#[test]
fn scans_and_edits_run_beside_each_other() {
    check("stress", "plain", C99, &[]);
}

#[test]
fn scans_and_edits_run_beside_each_other_under_address_sanitizer() {
    check("stress", "asan", ASAN, &[]);
}

#[test]
fn threads_that_end_may_still_fail() {
    check("late", "plain", C99, &[]);
}

#[test]
fn a_system_without_threads_is_an_error() {
    check("threads", "plain", C99, &[]);
}

#[test]
fn what_is_the_hosts_stays_the_hosts() {
    check("host", "plain", C99, &[]);
}

#[test]
fn the_hosts_embree_stays_the_hosts() {
    check("embree", "plain", &["-std=c99", "-rdynamic"], &[]);
}

/// Programs written for any release of the header work with the current library.
#[test]
fn old_clients_work() {
    let releases = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/releases")).unwrap();
    let releases: Vec<PathBuf> = releases.map(|entry| entry.unwrap().path()).collect();
    assert!(!releases.is_empty());
    for release in releases {
        let folder = folder(&format!("client-{}", release.file_name().unwrap().to_string_lossy()));
        let header = format!("-I{}", release.display());
        let program = program(&folder, compilers()[0][0], &["-std=c99", &header], &[release.join("api.c")]);
        passes(&run(Command::new(program).arg(&folder)));
    }
}
