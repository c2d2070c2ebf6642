//! OBJ and MTL files: any bytes give an error or a scene that keeps its promises.
//!
//! What follows the first NUL byte is the file `m.mtl` beside the scene.
//! `cargo fuzz run -s none obj fuzz/corpus/obj fuzz/seeds/obj -- -dict=fuzz/obj.dict`

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
        let mut files = data.splitn(2, |&byte| byte == 0);
        fs::write(folder.join("scene.obj"), files.next().unwrap_or_default()).expect("the file can be written");
        fs::write(folder.join("m.mtl"), files.next().unwrap_or_default()).expect("the file can be written");
        if let Ok(scene) = Scene::load(folder.join("scene.obj")) {
            super::common::check(&scene);
        }
    });
}
