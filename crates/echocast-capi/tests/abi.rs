//! The ABI of every release is kept: libabigail compares what compilers make of its header with what they make of the
//! current one.

mod common;

use common::{folder, run};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What may change: functions are added, structures grow at their ends, reserved numbers are named (`docs/abi.md`).
const ALLOWED: &str = "
[suppress_type]
type_kind = struct
has_data_member_inserted_at = end
has_size_change = yes

[suppress_type]
type_kind = struct
has_data_member_inserted_at = offset_of(reserved)
";

/// A library that defines the functions of `header`, with its types in the debug information.
fn defined(folder: &Path, name: &str, header: &Path) -> PathBuf {
    let text = fs::read_to_string(header).unwrap();
    let mut code = format!("#include \"{}\"\n", header.display());
    let declarations: Vec<&str> =
        text.split("\nECHOCAST_API").skip(1).map(|rest| rest.split(';').next().unwrap()).collect();
    assert!(declarations.len() > 40, "{}: {} functions", header.display(), declarations.len());
    for declaration in declarations {
        writeln!(code, "{declaration} {{ __builtin_unreachable(); }}").unwrap();
    }
    let source = folder.join(format!("{name}.c"));
    fs::write(&source, code).unwrap();
    // One name for all, as libabigail compares it.
    let library = folder.join(name).join("libechocast.so.1");
    fs::create_dir_all(library.parent().unwrap()).unwrap();
    run(Command::new("cc")
        .args(["-g", "-shared", "-fPIC", "-Wl,-soname,libechocast.so.1", "-o"])
        .arg(&library)
        .arg(&source));
    library
}

/// What libabigail says of the change from one header to another; none if programs linked before still work.
fn breaks(folder: &Path, old: &Path, new: &Path) -> Option<String> {
    let allowed = folder.join("allowed");
    fs::write(&allowed, ALLOWED).unwrap();
    let output = Command::new("abidiff")
        .args(["--no-added-syms", "--suppressions"])
        .arg(&allowed)
        .args([old, new])
        .output()
        .expect("there is no abidiff: run scripts/setup --test");
    (!output.status.success()).then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn programs_linked_with_any_release_still_work() {
    let folder = folder("abi");
    let new = defined(&folder, "new", &common::include().join("echocast.h"));
    for release in fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/releases")).unwrap() {
        let release = release.unwrap();
        let name = release.file_name().into_string().unwrap();
        let old = defined(&folder, &name, &release.path().join("echocast.h"));
        if let Some(report) = breaks(&folder, &old, &new) {
            panic!("release {name}: {report}");
        }
    }
}

/// The comparison sees what would break: a parameter, a field in the middle, a function that is gone.
#[test]
fn what_breaks_programs_is_seen() {
    let folder = folder("abi-breaks");
    let kept = fs::read_to_string(common::include().join("echocast.h")).unwrap();
    let old = defined(&folder, "old", &common::include().join("echocast.h"));
    for (name, from, to) in [
        ("parameter", "echocast_version(void)", "echocast_version(int which)"),
        ("field", "    uint64_t seed;\n", "    uint64_t other;\n    uint64_t seed;\n"),
        ("function", "echocast_version_string(void)", "echocast_version_text(void)"),
    ] {
        assert!(kept.contains(from), "{name}");
        let header = folder.join(format!("{name}.h"));
        fs::write(&header, kept.replace(from, to)).unwrap();
        let new = defined(&folder, name, &header);
        assert!(breaks(&folder, &old, &new).is_some(), "{name}");
    }
}
