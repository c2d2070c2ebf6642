//! Sets: samples written to a folder, by any number of threads and runs.
//!
//! | file | contents |
//! |---|---|
//! | `scenario.json` | the scenario that made it |
//! | files of the styles | the files of each sample, which appear when it is complete |
//! | `samples/000017.json` | what was drawn for the sample |
//! | `pictures/000000.png` | previews of some samples |
//! | `.lock*` | the processes that are writing to the set |
//! | `manifest*.jsonl` | a line for each sample: its files with sizes and digests, its counts; one file for each shard |
//! | `README.md` | a description of the set, for people |
//! | `splits/train.txt` | the samples of each split |
//! | `files.json` | the files made from all samples together, with sizes and digests |
//! | `manifest.json`, `report.json`, `report.html`, `contact_sheet.png` | the whole set, once all samples are present |

mod check;
mod coco;
mod files;
mod imaging;
mod kitti;
mod lock;
mod making;
mod manifest;
mod names;
mod noticed;
mod nuscenes;
mod origin;
mod plain;
mod points;
mod readme;
mod report;
mod rig;
mod run;
mod semantic_kitti;
mod style;
mod styles;
mod voc;
mod webdataset;
mod whole;

pub use check::check_folder;
pub use manifest::{Entry, FileEntry};
pub use noticed::Noticed;
pub use run::{Event, RunOptions, RunSummary, complete, finish, run};

use super::{Sample, Scenario};
use ground::error::Result;
use ground::read::yaml::Document;
use style::Style;

/// The styles of `scenario`.
fn styles(scenario: &Scenario) -> Result<Vec<Box<dyn Style>>> {
    styles::all(&scenario.spec.outputs, &Document::from_value(&scenario.origin, scenario.value.clone()))
}

impl Scenario {
    /// Checks that its outputs can hold the scans of `sample`.
    ///
    /// # Errors
    /// An unknown style or key; a sensor that a style does not support.
    pub fn check_outputs(&self, sample: &Sample) -> Result<()> {
        styles(self)?.iter().try_for_each(|style| run::check_fit(&**style, sample))
    }
}
