//! The header that is checked in is the one generated from the sources; it compiles everywhere and is correct.
#![allow(unsafe_code)] // reads the bytes of structures

mod common;

use common::{compilers, folder, library, program, run, source};
use std::fs;
use std::path::Path;
use std::process::Command;

/// The files of the crate in the order of the header, and the titles of their sections.
const SECTIONS: [(&str, &str); 20] = [
    ("guard", "Errors"),
    ("library", "The library"),
    ("context", "Contexts"),
    ("material", "Materials"),
    ("mesh", "Meshes"),
    ("pose", "Poses"),
    ("scene", "Scenes and snapshots"),
    ("instance", "Instances"),
    ("sensor", "Sensors"),
    ("column", "Columns"),
    ("boxes", "Boxes"),
    ("image", "Images"),
    ("result", "Results"),
    ("driver", "Messages of drivers"),
    ("message", "Messages of ROS 2"),
    ("scan", "Scans"),
    ("ping", "Pings"),
    ("radar", "Frames of radars"),
    ("scenario", "Scenarios"),
    ("file", "Files"),
];

#[test]
fn header_is_fresh() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let sections: String = SECTIONS.iter().map(|(file, title)| section(root, file, title)).collect();
    let mut made = fs::read_to_string(root.join("header.in")).unwrap();
    for (mark, text) in [
        ("@MAJOR@", env!("CARGO_PKG_VERSION_MAJOR")),
        ("@MINOR@", env!("CARGO_PKG_VERSION_MINOR")),
        ("@PATCH@", env!("CARGO_PKG_VERSION_PATCH")),
        ("@SECTIONS@", &sections),
    ] {
        made = made.replace(mark, text);
    }
    let path = root.join("../../include/echocast.h");
    if fs::read_to_string(&path).is_ok_and(|kept| kept == made) {
        return;
    }
    if std::env::var_os("BLESS").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, &made).unwrap();
        panic!("include/echocast.h has been made anew: look at what changed");
    }
    panic!("include/echocast.h is not what the sources make: run the test with BLESS=1");
}

/// The declarations that one file of the crate exports.
fn section(root: &Path, file: &str, title: &str) -> String {
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    let source = root.join(format!("src/{file}.rs"));
    let mut made = Vec::new();
    let bindings = cbindgen::Builder::new().with_config(config).with_src(source).generate();
    bindings.expect("the sources can be read").write(&mut made);
    let rule = "-".repeat(112 - title.len());
    format!("\n/* -- {title} {rule} */\n\n{}", on_one_line(String::from_utf8(made).unwrap().trim_start()))
}

/// With one-line comments on one line, and types named without `struct`.
fn on_one_line(text: &str) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let mut made = String::new();
    let mut at = 0;
    while at < lines.len() {
        let indent = lines[at].len() - lines[at].trim_start().len();
        match lines.get(at..at + 3) {
            Some(three) if three[0].trim() == "/**" && three[2].trim() == "*/" => {
                let sentence = three[1].trim().trim_start_matches("* ");
                made.push_str(&format!("{}/** {sentence} */\n", " ".repeat(indent)));
                at += 3;
                continue;
            }
            _ => {}
        }
        let line = if lines[at].starts_with("typedef ") {
            lines[at].into()
        } else {
            lines[at].replace("struct echocast_", "echocast_")
        };
        made.push_str(&line);
        made.push('\n');
        at += 1;
    }
    made
}

/// The header compiles in every language version, with every compiler that is installed, and from two files of one
/// program.
#[test]
fn header_compiles_everywhere() {
    let folder = folder("header");
    let [one, two] = ["one.c", "two.c"].map(source);
    let standards =
        ["c99", "c11", "c17", "gnu99", "c++11", "c++14", "c++17", "c++20"].map(|standard| format!("-std={standard}"));
    for [c, cpp] in compilers() {
        for standard in &standards {
            if standard.contains("++") {
                let options = [standard, "-x", "c++", "-pedantic-errors"];
                let wrapper = folder.join("wrapper.cpp");
                fs::write(&wrapper, "#include <echocast.hpp>\n#include <echocast.hpp>\nint main() { return 0; }\n")
                    .unwrap();
                program(&folder, cpp, &[standard, "-pedantic-errors", "-Wshadow"], &[wrapper]);
                // C's linkage is in the header.
                run(&mut Command::new(program(&folder, cpp, &options, &[one.clone(), two_as_cpp(&folder)])));
            } else {
                run(&mut Command::new(program(
                    &folder,
                    c,
                    &[standard, "-pedantic-errors"],
                    &[one.clone(), two.clone()],
                )));
            }
        }
    }
}

/// `two.c` for a C++ compiler.
fn two_as_cpp(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("two.cpp");
    let text = fs::read_to_string(source("two.c")).unwrap();
    fs::write(&path, text.replace("echocast_scan_desc second(void);", "extern \"C\" echocast_scan_desc second(void);"))
        .unwrap();
    path
}

/// The INIT macros of the header are the defaults of the library.
#[test]
fn defaults_are_the_librarys_own() {
    use echocast_capi::*;
    let folder = folder("defaults");
    let output =
        run(&mut Command::new(program(&folder, compilers()[0][0], &["-std=c99"], &["one.c", "two.c"].map(source))));
    let text = String::from_utf8(output.stdout).unwrap();
    let of_header = |name: &str| {
        let hex = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')).unwrap();
        (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap()).collect::<Vec<_>>()
    };
    macro_rules! compare {
        ($($name:ident)*) => {$(
            let mut of_library = std::mem::MaybeUninit::<$name>::zeroed();
            // SAFETY: plain numbers and pointers; padding stays 0, as long as fields are written one by one.
            let bytes = unsafe {
                let default = $name::default();
                std::ptr::copy_nonoverlapping(
                    std::ptr::from_ref(&default).cast::<u8>(),
                    of_library.as_mut_ptr().cast::<u8>(),
                    size_of::<$name>(),
                );
                std::slice::from_raw_parts(of_library.as_ptr().cast::<u8>(), size_of::<$name>())
            };
            assert_eq!(of_header(stringify!($name)), bytes, stringify!($name));
        )*};
    }
    compare!(echocast_context_desc echocast_image echocast_mesh_desc echocast_instance_desc echocast_scene_desc
        echocast_beams_desc echocast_instance_info echocast_scene_info echocast_sensor_info echocast_scan_desc
        echocast_result_info echocast_ping_info echocast_radar_info echocast_scan_info echocast_frame_info);
}

/// The shared library exports exactly what the header declares, and has the right SONAME.
#[test]
fn symbols_are_those_of_the_header() {
    let output = run(Command::new("nm").args(["-D", "--defined-only"]).arg(library(".so")));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut symbols: Vec<&str> = text.lines().filter_map(|line| line.split_whitespace().nth(2)).collect();
    symbols.sort();
    let header = fs::read_to_string(common::include().join("echocast.h")).unwrap();
    let mut declared: Vec<&str> = header
        .split("ECHOCAST_API")
        .skip(1)
        .filter_map(|text| text.split(';').next()?.split('(').next()?.split([' ', '*', '\n']).next_back())
        .filter(|name| name.starts_with("echocast_"))
        .collect();
    declared.sort();
    assert_eq!(symbols, declared);
    let output = run(Command::new("readelf").arg("-d").arg(library(".so")));
    assert!(String::from_utf8_lossy(&output.stdout).contains("Library soname: [libechocast.so.1]"));
}
