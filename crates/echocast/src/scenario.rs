//! Scenarios: a scene, a rig of sensors, and what varies from sample to sample, read from one file.
//!
//! ```no_run
//! use echocast::Scenario;
//!
//! let scenario = Scenario::load("drive.yaml")?;
//! for index in 0..scenario.samples() {
//!     let mut sample = scenario.sample(index)?;
//!     for scan in 0..sample.scans().len() {
//!         for frame in 0..sample.scans()[scan].frames().len() {
//!             let cloud = sample.cloud(scan, frame)?;
//!             cloud.write(format!("{index}_{scan}_{frame}.las"))?;
//!         }
//!     }
//! }
//! # Ok::<(), echocast::Error>(())
//! ```

#[doc(inline)]
pub use sets::{FrameTime, Sample, Scan, ScanPiece};

/// Sets: samples written to a folder, by any number of threads and runs.
///
/// | file | contents |
/// |---|---|
/// | `scenario.json` | the scenario that made it |
/// | files of the styles | the files of each sample, which appear when it is complete |
/// | `samples/000017.json` | what was drawn for the sample |
/// | `pictures/000000.png` | previews of some samples |
/// | `.lock*` | the processes that are writing to the set |
/// | `manifest*.jsonl` | a line for each sample: its files with sizes and digests, its counts; one file for each shard |
/// | `README.md` | a description of the set, for people |
/// | `splits/train.txt` | the samples of each split |
/// | `files.json` | the files made from all samples together, with sizes and digests |
/// | `manifest.json`, `report.json`, `report.html`, `contact_sheet.png` | the whole set, once all samples are present |
pub mod set {
    #[doc(inline)]
    pub use sets::set::{
        Entry, Event, FileEntry, Noticed, RunOptions, RunSummary, check_folder, complete, finish, run,
    };
}
