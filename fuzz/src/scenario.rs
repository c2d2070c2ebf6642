//! Scenario files: any text is read or refused, and samples of what is read are made or refused, the same twice.

use echocast::{Engine, Scenario};
use std::fs;
use std::sync::LazyLock;
use tempfile::TempDir;

/// A tetrahedron on a floor, and a model.
static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    const ROOM: &str = "o Floor\nv -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\no Box\nusemtl wood\n\
                        v 1 0 0\nv 2 0 0\nv 1 1 0\nv 1 0 1\nf 4 6 5\nf 4 5 7\nf 4 7 6\nf 5 6 7\n";
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("a file");
    file("room.obj", ROOM);
    file("model.obj", "o Pole\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    folder
});

static ENGINE: LazyLock<Engine> = LazyLock::new(|| Engine::with_threads(1).expect("Embree starts"));

/// Runs it with one input.
pub fn run(text: &str) {
    // What is much to do is allowed, but not here: many objects, tries, frames and beams, whole landscapes.
    let many = text.as_bytes().windows(4).any(|digits| digits.iter().all(u8::is_ascii_digit));
    if many || ["generate", "e+", "e1", "e2", "e3"].iter().any(|much| text.contains(much)) {
        return;
    }
    let Ok(scenario) = Scenario::from_yaml(text, FOLDER.path()) else { return };
    let mut scenario = scenario.with_engine(&ENGINE);
    for index in [0, 4_294_967_295] {
        let (first, second) = (scenario.sample(index), scenario.sample(index));
        if let (Ok(first), Ok(second)) = (&first, &second) {
            assert_eq!(first.drawn(), second.drawn());
            assert!(first.scene().objects().all(|(_, object)| object.world_from_object.is_finite()));
            assert!(first.scans().iter().all(|scan| scan.frames().iter().all(|frame| frame.start.is_finite())));
        }
        assert_eq!(first.is_ok(), second.is_ok());
    }
    // The last line as a setting.
    if let Some((key, value)) = text.lines().next_back().and_then(|line| line.split_once('=')) {
        let _ = scenario.set(key.trim_start_matches('#'), value);
    }
}
