//! Whatever the bytes, reading a glTF file gives an error or a scene that keeps its promises.
//!
//! `cargo fuzz run -s none gltf fuzz/corpus/gltf fuzz/seeds/gltf -- -dict=fuzz/gltf.dict`

use echocast::{LoadOptions, Scene};

/// Runs it with one input.
pub fn run(data: &[u8]) {
    if let Ok(scene) = Scene::from_glb_bytes(data, &LoadOptions::default()) {
        super::common::check(&scene);
    }
}
