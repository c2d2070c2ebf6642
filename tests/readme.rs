//! The Rust of the README compiles, and its first example does what it says.

#![allow(dead_code, unused_variables, unused_mut, unused_imports, unreachable_code, clippy::all)] // snippets, one by one

/// What snippets take as given.
mod snippets {
    use echocast::{PointCloud, Result, ScanOptions, Sensor, Trajectory};

    pub struct Given {
        pub sensor: Sensor,
        pub drive: Trajectory,
        pub options: ScanOptions,
        pub cloud: PointCloud,
        pub world_from_car: glam::DAffine3,
    }

    include!(concat!(env!("OUT_DIR"), "/readme.rs"));
}

#[test]
fn the_first_example_scans_a_street() {
    let folder = tempfile::tempdir().unwrap();
    std::env::set_current_dir(&folder).unwrap();
    let street = echocast::generate::Street::default().scene(1).unwrap();
    street.write("street.glb").unwrap();
    let given = snippets::Given {
        sensor: echocast::Sensor::preset("velodyne_vlp16").unwrap(),
        drive: echocast::Trajectory::fixed(echocast::Pose::IDENTITY),
        options: Default::default(),
        cloud: Default::default(),
        world_from_car: glam::DAffine3::IDENTITY,
    };
    snippets::block_0(given).unwrap();
    assert!(std::fs::metadata("street.las").unwrap().len() > 1_000_000);
}
