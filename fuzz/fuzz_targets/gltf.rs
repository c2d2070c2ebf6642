//! Whatever the bytes, reading a glTF file gives an error or a scene that keeps its promises.
//!
//! `cargo fuzz run -s none gltf fuzz/corpus/gltf fuzz/seeds/gltf -- -dict=fuzz/gltf.dict`
#![no_main]

mod common;

use echocast::{LoadOptions, Scene};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(scene) = Scene::from_glb_bytes(data, &LoadOptions::default()) {
        common::check(&scene);
    }
});
