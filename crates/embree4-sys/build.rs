//! Finds `libembree4.so` and tells the linker. Search order: `EMBREE_LIB_DIR`, `.embree/lib` in a folder above this
//! package (where `scripts/setup` puts it on systems without an Embree 4 package), the system's library folders.

use std::env;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-env-changed=EMBREE_LIB_DIR");
    println!("cargo::rustc-link-lib=dylib=embree4");
    match find() {
        Ok(EmbreeFolder::Private(dir)) => {
            let dir = dir.display();
            println!("cargo::rerun-if-changed={dir}/{LIBRARY}");
            println!("cargo::rustc-link-search=native={dir}");
            println!("cargo::rustc-link-arg=-Wl,-rpath,{dir}"); // this package's own tests
            println!("cargo::metadata=lib_dir={dir}"); // DEP_EMBREE4_LIB_DIR, see rpath.rs
        }
        Ok(EmbreeFolder::System(dir)) => println!("cargo::rerun-if-changed={}/{LIBRARY}", dir.display()),
        Err(sentence) => println!("cargo::error={sentence}"), // and cargo fails
    }
}

const LIBRARY: &str = "libembree4.so";

enum EmbreeFolder {
    /// The loader does not search here by itself: binaries need an rpath.
    Private(PathBuf),
    System(PathBuf),
}

fn find() -> Result<EmbreeFolder, String> {
    if let Some(dir) = env::var_os("EMBREE_LIB_DIR") {
        // The path ends up in binaries, so it must not depend on the current folder.
        return match Path::new(&dir).canonicalize() {
            Ok(path) if path.join(LIBRARY).exists() => Ok(EmbreeFolder::Private(path)),
            _ => Err(format!("EMBREE_LIB_DIR is {}, where there is no {LIBRARY}", dir.display())),
        };
    }
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    if let Some(dir) = package.ancestors().map(|dir| dir.join(".embree/lib")).find(|dir| dir.join(LIBRARY).exists()) {
        return Ok(EmbreeFolder::Private(dir));
    }
    let arch = env::var("CARGO_CFG_TARGET_ARCH").expect("cargo sets it");
    let multiarch = format!("/usr/lib/{arch}-linux-gnu");
    [multiarch.as_str(), "/usr/lib64", "/usr/lib", "/usr/local/lib64", "/usr/local/lib"]
        .into_iter()
        .map(PathBuf::from)
        .find(|dir| dir.join(LIBRARY).exists())
        .map(EmbreeFolder::System)
        .ok_or(format!(
            "Embree 4.3 or later ({LIBRARY}) was not found: run scripts/setup, install libembree-dev \
             (Debian 13, Ubuntu 24.04), or set EMBREE_LIB_DIR to its folder"
        ))
}
