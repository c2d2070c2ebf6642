//! An engine with one thread starts none, one with more starts all but the caller's at once. A program of its own, because other
//! tests start threads.

#![cfg(target_os = "linux")]

use echocast::export::{self, FORMATS};
use echocast::preview::{self, ColorBy, PreviewOptions, View};
use echocast::{Engine, Field, FieldSet, PackItem, PackType, Pose, Report, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};

fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

/// Checks that this many threads are left: one that has been joined may still be counted for a moment.
#[track_caller]
fn are_left(expected: usize) {
    for _ in 0..3000 {
        if threads() == expected {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert_eq!(threads(), expected);
}

/// Both in one test: tests run side by side, and all threads are counted.
#[test]
fn engines_start_the_threads_that_they_say() {
    an_engine_with_one_thread_starts_none();
    an_engine_with_more_starts_no_others_later();
}

fn an_engine_with_more_starts_no_others_later() {
    let before = threads();
    let engine = Engine::with_threads(3).unwrap();
    let cores = std::thread::available_parallelism().unwrap().get();
    let own = 3 - 1 + 3.min(cores) - 1;
    assert_eq!(threads(), before + own, "threads that help to scan, and to build, of {cores} cores");
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::sphere(20.0, 200), None);
    let scene = scene.finish();
    assert!(scene.triangle_count() > 50_000);
    // Several threads commit at once, as a host's may.
    std::thread::scope(|scope| {
        let commits: Vec<_> = (0..4).map(|_| scope.spawn(|| scene.build_with(&engine).unwrap())).collect();
        let built = commits.into_iter().map(|commit| commit.join().unwrap()).next_back().unwrap();
        let sensor = Sensor::preset("velodyne_vlp16").unwrap();
        let cloud = built.scan(&sensor, &Trajectory::fixed(Pose::at(1.0, 2.0, 3.0)), &ScanOptions::default()).unwrap();
        assert!(cloud.len() > 10_000);
    });
    are_left(before + own);
    drop(engine);
    are_left(before);
}

fn an_engine_with_one_thread_starts_none() {
    let before = threads();
    let engine = Engine::with_threads(1).unwrap();
    let mut scene = SceneBuilder::new();
    scene.stand(Shape::sphere(20.0, 30), None);
    let scene = scene.finish().build_with(&engine).unwrap();
    let sensor = Sensor::preset("velodyne_vls128").unwrap();
    let options = ScanOptions::default().fields(FieldSet::all());
    let cloud = scene.scan(&sensor, &Trajectory::fixed(Pose::at(1.0, 2.0, 3.0)), &options).unwrap();
    assert!(cloud.len() > 200_000, "{} points", cloud.len());
    engine.install(|| {
        let item = PackItem::new(Field::Range, PackType::F32, 0);
        cloud.pack(&[item], 4, &mut vec![0; 4 * cloud.len()]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for format in FORMATS {
            export::write(&cloud, &folder.path().join("cloud"), Some(format.name())).unwrap();
        }
        for view in [View::Top, View::Perspective, View::Range] {
            for color in [ColorBy::Label, ColorBy::Height] {
                let options = PreviewOptions::default().view(view).color(color);
                preview::render(&cloud, &options, &mut Report::default()).unwrap();
            }
        }
    });
    assert_eq!(threads(), before);
}
