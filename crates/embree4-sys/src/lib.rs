//! Raw declarations of [Embree](https://www.embree.org) 4.3 and later 4.x: what bindgen makes of the C header of 4.3.3,
//! restricted to what 4.3.0, 4.3.3 and 4.4 share. `regenerate` beside `Cargo.toml` re-makes them. Names are C's; the
//! documentation is [Embree's](https://github.com/RenderKit/embree#embree-api). For safe use see the crate `embree4`.
//!
//! # Linking
//!
//! The build script searches for `libembree4.so` in `EMBREE_LIB_DIR`, then `.embree/lib` in a folder above the package
//! (`scripts/setup` fills it where the system has no package), then the system's library folders. In the first two the
//! loader would not find it at run time, and an rpath only reaches the binaries of the package whose build script sets
//! it. So every package that builds binaries, tests or shared libraries on top of this one
//!
//! * names `embree4-sys` as a direct dependency, and
//! * has `build.rs` as a symbolic link to `crates/embree4-sys/rpath.rs`, or calls that file as a module.
#![allow(unsafe_code)] // declarations of a C library

#[allow(missing_docs, non_camel_case_types, non_snake_case)] // as bindgen wrote them
mod bindings;
pub use bindings::*;

// Embree writes hits into our memory: if these were wrong, it would write past the end. (bindings.rs also asserts every
// field's offset; these are the figures to check a new header against.)
const _: () = {
    assert!(size_of::<RTCRayHit>() == 96);
    assert!(size_of::<RTCRayHit4>() == 336);
    assert!(size_of::<RTCRayHit8>() == 672);
    assert!(size_of::<RTCRayHit16>() == 1344);
    // The layout above holds for libraries with one level of instances, such as Debian's and PyPI's.
    assert!(RTC_MAX_INSTANCE_LEVEL_COUNT == 1);
};
