//! PLY meshes: any bytes give an error or a scene that keeps its promises.
//!
//! `cargo fuzz run -s none ply fuzz/corpus/ply fuzz/seeds/ply -- -dict=fuzz/ply.dict`

use echocast::Scene;
use std::cell::OnceCell;
use std::fs;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// Runs it with one input.
pub fn run(data: &[u8]) {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder for the file")).path();
        fs::write(folder.join("scene.ply"), data).expect("the file can be written");
        if let Ok(scene) = Scene::load(folder.join("scene.ply")) {
            super::common::check(&scene);
        }
    });
}
