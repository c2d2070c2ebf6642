//! FBX files: any bytes give an error or a scene that keeps its promises.
//!
//! `cargo fuzz run -s none fbx fuzz/corpus/fbx fuzz/seeds/fbx -- -dict=fuzz/fbx.dict`

use echocast::Scene;
use std::cell::OnceCell;
use std::fs;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// Runs it with one input.
pub fn run(data: &[u8]) {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder for the files")).path();
        fs::write(folder.join("scene.fbx"), data).expect("the file can be written");
        if let Ok(scene) = Scene::load(folder.join("scene.fbx")) {
            super::common::check(&scene);
        }
    });
}
