//! Vertex caches: any bytes are refused, or give their object a shape of finite positions.
//!
//! `cargo fuzz run -s none cache fuzz/corpus/cache fuzz/seeds/cache`

use echocast::scene::CacheFile;
use echocast::{Error, LoadOptions, Scene};
use std::cell::OnceCell;
use std::fs;

/// Objects of three vertices and of four, whose file has nine; the last has them in another order.
const SCENE: &str = "o three\nv 1 0 0\nv 2 0 0\nv 1 1 0\nf 1 2 3\n\
    o four\nv 5 0 0\nv 6 0 0\nv 6 1 0\nv 5 1 0\nv 0 0 7\nv 0 0 8\nf 7 6 5\nf 4 5 7\n";

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// Runs it with one input.
pub fn run(data: &[u8]) {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| {
            let folder = tempfile::tempdir().expect("a folder for the files");
            fs::write(folder.path().join("scene.obj"), SCENE).expect("the file can be written");
            folder
        });
        for name in ["a.pc2", "a.mdd"] {
            let file = folder.path().join(name);
            fs::write(&file, data).expect("the file can be written");
            for object in ["three", "four"] {
                let cache = CacheFile::new(file.clone());
                let caches = [(object.to_owned(), cache)].into();
                let options = LoadOptions::default().caches(caches);
                if let Ok(scene) = Scene::load_with(folder.path().join("scene.obj"), &options) {
                    check(&scene);
                }
            }
        }
    });
}

/// Its triangles may have lost their area, all else is as for every scene.
fn check(scene: &Scene) {
    assert_eq!(scene.triangle_count(), 3);
    assert_eq!(scene.objects.iter().filter(|object| object.motion.is_some()).count(), 1);
    for part in scene.meshes().iter().flat_map(|mesh| &mesh.parts) {
        assert!(part.positions.iter().flatten().all(|x| x.abs() <= 1e18));
        assert!(part.triangles.iter().flatten().all(|&vertex| (vertex as usize) < part.positions.len()));
    }
    // Samples are read when they are needed: what is wrong with one is told then.
    if let Err(error) = scene.build() {
        assert!(matches!(error, Error::Parse { .. }), "{error}");
    }
}
