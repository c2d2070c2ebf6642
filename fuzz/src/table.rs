//! CSV files of beams, and trajectories of all formats: any bytes are read or refused, and what is read is sound.

use echocast::{Sensor, Trajectory};
use std::cell::OnceCell;

const SENSOR: &str = "{name: fuzzed, kind: lidar, pattern: {type: table, file: rays.csv, rate_hz: 10}}";

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// Runs it with one input.
pub fn run(bytes: &[u8]) {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder for the file")).path();
        let file = folder.join("rays.csv");
        std::fs::write(&file, bytes).expect("the file can be written");
        if let Ok(sensor) = Sensor::from_yaml(SENSOR, folder) {
            sensor.beams().check().expect("beams of an accepted table are sound");
        }
        for name in ["rays.csv", "path.sbet", "path.trj"] {
            let file = folder.join(name);
            if name != "rays.csv" {
                std::fs::write(&file, bytes).expect("the file can be written");
            }
            let Ok(trajectory) = Trajectory::load(&file) else { continue };
            let (start, end) = trajectory.span();
            for time in [start, 0.5 * (start + end), end, -1.0] {
                let pose = trajectory.at(time);
                assert!(pose.position.is_finite() && pose.orientation.is_normalized());
            }
        }
    });
}
