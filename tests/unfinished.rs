//! Files of a process about to end: alone in its file, as unfinished files concern the whole process.

use echocast::export::{self, FramesFile};
use echocast::generate::Seabed;
use echocast::{Error, Field, PointCloud};
use std::fs;
use std::sync::atomic::Ordering;

#[test]
fn unfinished_files_go_and_no_others_are_made() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let names = || fs::read_dir(folder.path()).unwrap().count();
    let fields = [Field::X, Field::Y, Field::Z].into_iter().collect();
    let mut cloud = PointCloud::new(fields, 3).unwrap();
    let columns = cloud.columns_mut();
    for column in [columns.x, columns.y, columns.z] {
        column.copy_from_slice(&[1.0, 2.0, 3.0]);
    }
    cloud.write(at("old.csv")).unwrap();
    let old = fs::read(at("old.csv")).unwrap();
    let mut frames = FramesFile::create(at("frames.h5")).unwrap();
    frames.add(&cloud).unwrap();
    // Those of another process, whatever its number.
    let theirs = format!(".echocast-{}-theirs", std::process::id());
    fs::write(at(&theirs), "").unwrap();
    assert_eq!(names(), 4);

    export::remove_unfinished();
    assert_eq!(names(), 3);
    assert!(at(&theirs).exists());
    for name in ["old.csv", "a.ply", "a.las", "a.npz", "a.h5"] {
        assert!(matches!(cloud.write(at(name)), Err(Error::Cancelled)), "{name}");
    }
    assert!(matches!(frames.add(&cloud), Err(Error::Cancelled)));
    assert!(matches!(frames.finish(), Err(Error::Cancelled)));
    let lake = Seabed::default().size_m([10.0, 10.0]).scene(1).unwrap();
    assert!(matches!(lake.write(at("lake.glb")), Err(Error::Cancelled)));
    assert_eq!(names(), 3);
    assert_eq!(fs::read(at("old.csv")).unwrap(), old);

    export::cancel_flag().store(false, Ordering::SeqCst);
    cloud.write(at("a.h5")).unwrap();
    assert_eq!(names(), 4);
}
