//! Build script of every package whose own binaries, tests or shared libraries link Embree: they name `embree4-sys` as
//! a direct dependency, and their `build.rs` is a link to this file (or, where it has more to do, calls this as a
//! module).
//!
//! A build script's link arguments reach only its own package's targets, and `DEP_EMBREE4_LIB_DIR` only direct
//! dependents of `embree4-sys`; hence one copy of this script per package. It is unset where Embree is a system
//! library, which the loader finds by itself.

/// Makes the package's binaries look for Embree beside where they are installed, then in the folder it was linked from.
pub fn main() {
    println!("cargo::rerun-if-env-changed=DEP_EMBREE4_LIB_DIR");
    if let Ok(dir) = std::env::var("DEP_EMBREE4_LIB_DIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../lib/echocast");
        println!("cargo::rustc-link-arg=-Wl,-rpath,{dir}");
    }
}
