//! Raw declarations of [Embree](https://www.embree.org) 4.3 and later 4.x: what bindgen makes of the C header of 4.3.3,
//! restricted to what 4.3.0, 4.3.3 and 4.4 share. `regenerate` beside `Cargo.toml` re-makes them. Names are C's; the
//! documentation is [Embree's](https://github.com/RenderKit/embree#embree-api). For safe use see the crate `embree4`.
//!
//! Nothing is linked: [`Functions`] are those of a library that is opened at run time. Its version has to be checked
//! before anything else is called.
#![allow(unsafe_code)] // declarations of a C library

#[allow(missing_docs, non_camel_case_types, non_snake_case, unsafe_op_in_unsafe_fn, clippy::missing_safety_doc)]
// as bindgen wrote them
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
