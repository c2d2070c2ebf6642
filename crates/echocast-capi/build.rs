//! The SONAME of the library.

use std::env;

/// First number of the ABI: it changes when a program that was linked against an older one would break.
const ABI: u32 = 1;

fn main() {
    // cargo-c sets it itself.
    if env::var_os("CARGO_FEATURE_CAPI").is_none() {
        println!("cargo::rustc-link-arg-cdylib=-Wl,-soname,libechocast.so.{ABI}");
    }
}
