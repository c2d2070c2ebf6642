//! Clouds to files: one file per format, one table of formats.

mod atomic;
pub mod preview;

use crate::cloud::PointCloud;
use crate::error::{Error, Result};
use crate::report::Report;
use std::path::Path;

/// A point-cloud file format.
pub trait Format: Sync {
    /// Name for `--format`.
    fn name(&self) -> &'static str;
    /// File name endings, lower case, without the dot; the first format with an ending owns it.
    fn extensions(&self) -> &'static [&'static str];
    /// One line for people: what it is and what it cannot hold.
    fn description(&self) -> &'static str;
    /// Writes `cloud` to the new file `path`, which nobody else sees yet. What the format cannot
    /// hold goes to `report`.
    ///
    /// # Errors
    /// A full disk, or a cloud that lacks what the format must have.
    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> Result<()>;
    /// Whether the label names stand inside the file; otherwise they go to `NAME.labels.json`.
    fn holds_label_names(&self) -> bool;
}

/// Every output format.
pub const FORMATS: &[&dyn Format] = &[];

/// The format called `name`, or the one that owns the ending of `path`.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Unsupported`], listing what there is.
pub fn format_for(path: &Path, name: Option<&str>) -> Result<&'static dyn Format> {
    if let Some(name) = name {
        return FORMATS
            .iter()
            .find(|format| format.name() == name)
            .copied()
            .ok_or_else(|| Error::missing("output format", name, FORMATS.iter().map(|format| format.name())));
    }
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    FORMATS.iter().find(|format| format.extensions().contains(&ending.as_str())).copied().ok_or_else(|| {
        Error::Unsupported {
            what: format!("{}: output format", path.display()),
            instead: format!(
                "clouds are written as {}",
                FORMATS.iter().flat_map(|f| f.extensions()).map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ")
            ),
        }
    })
}

/// Writes `cloud` to `path` in the format called `format`, or the one its ending says.
///
/// The file, and `NAME.labels.json` beside formats that cannot hold the label names, appear under
/// their names only when complete.
///
/// # Errors
/// As [`format_for`] and [`Format::write`].
pub fn write(cloud: &PointCloud, path: &Path, format: Option<&str>) -> Result<Report> {
    let format = format_for(path, format)?;
    let mut report = Report::default();
    atomic::replace(path, |temporary| format.write(cloud, temporary, &mut report))?;
    Ok(report)
}
