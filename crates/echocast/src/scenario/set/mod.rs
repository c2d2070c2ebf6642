//! Sets: samples written to a folder, by any number of threads and runs.
//!
//! | in the folder | what |
//! |---|---|
//! | `scenario.json` | the scenario that made it |
//! | what the styles write | a folder for each sample, which appears when it is complete |
//! | `samples/000017.json` | what was drawn for the sample |
//! | `pictures/000000.png` | some samples, for people |
//! | `manifest*.jsonl` | a line for each sample: its files with sizes and digests, its counts; one file for each shard |
//! | `manifest.json`, `report.json`, `report.html`, `contact_sheet.png` | the whole set, once all samples are there |

mod folder;
mod kitti;
mod manifest;
mod plain;
mod report;
mod run;
mod style;

pub use folder::check_folder;
pub use manifest::{Entry, FileEntry};
pub use run::{Event, RunOptions, RunSummary, finish, run};

use super::{Sample, Scenario};
use crate::ground::error::Result;

/// Checks that the styles of `scenario` can hold the scans of `sample`.
pub(super) fn check_outputs(scenario: &Scenario, sample: &Sample) -> Result<()> {
    style::Style::all(scenario)?.iter().try_for_each(|style| style.fits(sample))
}
