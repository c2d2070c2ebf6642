//! Where the loader finds Embree (rpath.rs, shared with the other packages), and the SONAME of the library.

use std::env;

mod rpath;

/// First number of the ABI: it changes when a program that was linked against an older one would break.
const ABI: u32 = 1;

fn main() {
    // Once installed, the library finds the Embree that comes with it in a folder beside it.
    println!("cargo::rustc-link-arg-cdylib=-Wl,-rpath,$ORIGIN/echocast");
    rpath::main();
    // cargo-c sets it itself.
    if env::var_os("CARGO_FEATURE_CAPI").is_none() {
        println!("cargo::rustc-link-arg-cdylib=-Wl,-soname,libechocast.so.{ABI}");
    }
}
