//! Clouds to files: one file per format, one table of formats.

pub mod annotations;
mod arrays;
#[cfg(feature = "mcap")]
mod bag;
mod boxes;
#[cfg(feature = "mcap")]
mod camera;
#[cfg(feature = "mcap")]
mod carrier;
mod csv;
mod e57;
#[cfg_attr(not(feature = "hdf5"), path = "no_frames.rs")]
mod frames;
mod growing;
#[cfg(feature = "hdf5")]
mod hdf5;
pub mod images;
mod kmall;
mod las;
mod laz;
#[cfg(feature = "mcap")]
mod mcap;
mod npz;
mod pcd;
mod pings;
mod pixels;
mod ply;
mod polar;
mod radar_frame;
#[cfg(feature = "mcap")]
mod radar_messages;
mod radar_points;
mod survey;
mod tail;
mod xtf;

pub use boxes::{check_boxes, write_boxes};
pub use frames::FramesFile;
pub use growing::GrowingFile;
#[cfg(feature = "hdf5")]
pub use hdf5::WIDEST as HDF5_WIDEST;
pub use images::{AnnotationStyle, ImageFolder, ImageLayer, ImageOptions, check_images};
pub use pings::{check_image, check_pings, image_label_paths};
pub use polar::{PolarFolder, PolarStyle};
pub use radar_frame::check_radar_frame;
pub use radar_points::{RadarPoints, check_radar_points};

use crate::cells::SonarView;
use crate::messages::BagOptions;
use crate::{Field, FieldInfo, FieldSet, PointCloud, Record};
use emitter::ImageGrid;
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::read::ending;
use ground::report::Report;
use ground::shown;
use ground::write::{self, Pending, failed};
pub use ground::write::{cancel_flag, remove_unfinished};
pub(crate) use las::ANGLE_STEP_DEG;
pub use las::RAW_INTENSITY;
use std::io;
use std::path::{Path, PathBuf};

/// What files need to know of a sensor before its first scan.
pub trait Instrument {
    /// Its name.
    fn name(&self) -> &str;

    /// The image that each of its scans is.
    ///
    /// # Errors
    /// A sensor without one.
    fn image_grid(&self) -> Result<ImageGrid>;

    /// How its pings are arranged.
    fn sonar_view(&self) -> SonarView;
}

impl PointCloud {
    /// Writes the cloud to `path`; the format is chosen by the extension. Only NPZ, HDF5 and MCAP hold boxes; see
    /// [`write_boxes`].
    ///
    /// The file appears under its name only when it is complete.
    ///
    /// # Errors
    /// Unknown extension, a cloud without positions, a full disk.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<Report> {
        write(self, path.as_ref(), None)
    }
}

/// Coordinates up to this are precise in f32, m: to 0.12 mm.
const NEAR: f64 = 4096.0;

/// A point-cloud file format.
pub trait Format: Sync {
    /// Its name, endings and properties.
    fn info(&self) -> &FormatInfo;
    /// Name for `--format`.
    fn name(&self) -> &'static str {
        self.info().name
    }
    /// Whether it can hold the column `info`.
    fn holds(&self, _info: &FieldInfo) -> bool {
        true
    }
    /// Whether it can hold `record` of a survey file.
    fn keeps(&self, _record: &Record) -> bool {
        false
    }
    /// Maximum number of points with the columns `fields` in a file, if runs may produce more.
    fn most_points(&self, _fields: FieldSet) -> Option<u64> {
        None
    }
    /// Writes `cloud` to the file `path`, which is not visible to others yet. `cloud` is consistent and has positions
    /// if the format needs them. Columns that the format does not hold are left out; any other loss is added to
    /// `report`.
    ///
    /// # Errors
    /// Errors of the system, such as a full disk.
    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()>;
    /// The same format in smaller files that take longer to write, for files that are kept; `None`: there is none.
    fn packed(&self) -> Option<&'static dyn Format> {
        None
    }
    /// Starts the file `path`, which is not visible to others yet, for clouds like `first` that are added to it one
    /// after the other; `None`: the format needs all points at once.
    fn begin(&self, _first: &PointCloud, _path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        None
    }
    /// [`Format::begin`] for a bag, with a choice of messages; `None`: it is another format, which has none.
    fn begin_bag(
        &self,
        _first: &PointCloud,
        _path: &Path,
        _options: &BagOptions,
    ) -> Option<io::Result<Box<dyn Growing>>> {
        None
    }
}

/// Properties of a format.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct FormatInfo {
    /// Name for `--format`.
    pub name: &'static str,
    /// File name endings, lower case, without the dot; the first format with an ending owns it.
    pub extensions: &'static [&'static str],
    /// One line for users: what it is and how it differs from the others.
    pub description: &'static str,
    /// Whether it can only hold clouds with the columns `x`, `y` and `z`.
    pub needs_positions: bool,
    /// Whether the label names are inside the file; otherwise they are written to `NAME.labels.json`.
    pub holds_label_names: bool,
}

/// A file to which clouds are added one after the other; they are not kept in memory.
pub trait Growing {
    /// Adds the rows of `cloud`, which is compatible with the first.
    ///
    /// # Errors
    /// Errors of the system.
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()>;
    /// Completes the file. `head` is all clouds together, without their rows and boxes. Losses are added to `report`.
    ///
    /// # Errors
    /// Errors of the system.
    fn finish(&mut self, head: &PointCloud, report: &mut Report) -> io::Result<()>;
}

/// Writes `cloud` alone to `file`.
fn write_alone(mut file: impl Growing, cloud: &PointCloud, report: &mut Report) -> io::Result<()> {
    file.add(cloud)?;
    file.finish(cloud, report)
}

/// Every output format.
pub const FORMATS: &[&dyn Format] = &[
    &las::LAS,
    &las::LAZ,
    &las::LAS2,
    #[cfg(feature = "hdf5")]
    &hdf5::Hdf5,
    &csv::Csv,
    &ply::Ply,
    &pcd::PCD,
    &pcd::PCD_ASCII,
    &pcd::PCD_COMPRESSED,
    &e57::E57,
    #[cfg(feature = "mcap")]
    &mcap::MCAP,
    #[cfg(feature = "mcap")]
    &mcap::MCAP_VELODYNE,
    #[cfg(feature = "mcap")]
    &mcap::MCAP_OUSTER,
    #[cfg(feature = "mcap")]
    &mcap::MCAP_HESAI,
    #[cfg(feature = "mcap")]
    &mcap::MCAP_ROBOSENSE,
    #[cfg(feature = "mcap")]
    &mcap::MCAP_LIVOX,
    #[cfg(feature = "mcap")]
    &mcap::MCAP_AUTOWARE,
    &npz::Npz::PLAIN,
];

/// The format called `name`, or the one that owns the ending of `path`.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Unsupported`], listing the formats, or naming the missing feature.
pub fn format_for(path: &Path, name: Option<&str>) -> Result<&'static dyn Format> {
    let ending = ending(path);
    #[cfg(not(feature = "hdf5"))]
    if matches!(name.unwrap_or(&ending), "hdf5" | "h5") {
        let instead = "build echocast with the feature hdf5".into();
        return Err(Error::Unsupported { what: "HDF5 in this build".into(), instead });
    }
    #[cfg(not(feature = "mcap"))]
    if name.unwrap_or(&ending).starts_with("mcap") {
        let instead = "build echocast with the feature mcap".into();
        return Err(Error::Unsupported { what: "MCAP in this build".into(), instead });
    }
    if let Some(name) = name {
        return FORMATS
            .iter()
            .find(|format| format.name() == name)
            .copied()
            .ok_or_else(|| Error::missing("output format", name, FORMATS.iter().map(|format| format.name())));
    }
    format_with(&ending).ok_or_else(|| Error::Unsupported {
        what: format!("the ending of the output file {}", shown::path(path)),
        instead: format!(
            "clouds are written as {}",
            FORMATS.iter().flat_map(|f| f.info().extensions).map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ")
        ),
    })
}

/// The format that owns `ending`.
fn format_with(ending: &str) -> Option<&'static dyn Format> {
    FORMATS.iter().find(|format| format.info().extensions.contains(&ending)).copied()
}

/// Checks, before a long scan, whether a cloud with the columns `fields` can be written to `path`, and its label names
/// next to it.
///
/// # Errors
/// As [`format_for`]; a missing folder or one that cannot be written to; no `x`, `y`, `z` for a format that needs them.
pub fn check(path: &Path, format: Option<&str>, fields: FieldSet) -> Result<()> {
    let format = format_for(path, format)?;
    check_fields(format, fields)?;
    Output::create(path, format).map(drop)
}

/// Checks that a file at `path` can hold `points` points with the columns `fields`.
///
/// # Errors
/// An unknown format, as [`format_for`]; more points than the format holds.
pub fn check_room(path: &Path, format: Option<&str>, fields: FieldSet, points: u64) -> Result<()> {
    let format = format_for(path, format)?;
    match format.most_points(fields) {
        Some(most) if points > most => {
            let allowed = format!("{most} points of these columns in a {} file", format.name());
            Err(Error::invalid(shown::path(path), format!("for up to {points} points"), allowed))
        }
        _ => Ok(()),
    }
}

fn check_fields(format: &dyn Format, fields: FieldSet) -> Result<()> {
    let missing: Vec<&str> = [Field::X, Field::Y, Field::Z]
        .map(Field::info)
        .iter()
        .filter(|i| !fields.contains(i.field))
        .map(|i| i.name)
        .collect();
    if format.info().needs_positions && !missing.is_empty() {
        let allowed = format!("columns that include x, y and z, which a {} file must have", format.name());
        return Err(Error::invalid("fields", format!("a list without {}", missing.join(", ")), allowed));
    }
    Ok(())
}

/// Writes `cloud` to `path` in the format called `format`, or the one that owns its ending.
///
/// The file, and `NAME.labels.json` for formats that cannot hold the label names, appear under their names only when
/// both are complete and on the disk; the label names first. An error leaves both as they were. The report lists what
/// the format could not hold.
///
/// # Errors
/// As [`check`], a full disk, and a set [`cancel_flag`].
pub fn write(cloud: &PointCloud, path: &Path, format: Option<&str>) -> Result<Report> {
    write_with(cloud, path, format, &BagOptions::default())
}

/// [`write()`] with a choice of messages for bags; other formats hold none.
///
/// # Errors
/// As [`write()`], and messages that cannot be made of the cloud.
pub fn write_with(cloud: &PointCloud, path: &Path, format: Option<&str>, bag: &BagOptions) -> Result<Report> {
    let format = format_for(path, format)?;
    check_fields(format, cloud.fields)?;
    let mut report = lost(format, cloud);
    let output = Output::create(path, format)?;
    let place = output.file.path();
    let written = match format.begin_bag(cloud, place, bag) {
        None => format.write(cloud, place, &mut report),
        Some(file) => file.and_then(|mut file| {
            file.add(cloud)?;
            file.finish(cloud, &mut report)
        }),
    };
    written.map_err(|source| failed(path, source))?;
    output.commit(path, cloud)?;
    Ok(report)
}

/// What the cloud with the rows of `head` would lose in `format`.
fn lost(format: &dyn Format, head: &PointCloud) -> Report {
    let mut report = Report::default();
    let lost: Vec<&str> = head.fields.iter().filter(|info| !format.holds(info)).map(|info| info.name).collect();
    for names in listed(&lost) {
        report.warn(format!("{}: cannot hold the columns {names}", format.name()));
    }
    let lost: Vec<&Record> = head.records.all.iter().filter(|record| !format.keeps(record)).collect();
    let system = lost.iter().any(|record| record.is_system());
    let system = system.then(|| format!("the coordinate system {}", head.records.system().unwrap_or_default()));
    let others = lost.iter().filter(|record| !record.is_system());
    let others: Vec<String> = others.map(|record| format!("{} {}", shown::name(&record.user), record.id)).collect();
    let others = (!others.is_empty()).then(|| format!("the records {}", others.join(", ")));
    let lost: Vec<String> = system.into_iter().chain(others).collect();
    if !lost.is_empty() {
        report.warn(format!("{}: cannot hold {}; las and laz do", format.name(), lost.join(" and ")));
    }
    report
}

/// Bytes of a list of columns: longer warnings would be cut.
const LONGEST_LIST: usize = 400;

/// The `names` of columns in table order, of a vector only the first and the last, in as many lists as it takes.
fn listed(names: &[&str]) -> Vec<String> {
    let mut lists: Vec<String> = Vec::new();
    let mut put = |word: String| match lists.last_mut().filter(|list| list.len() + word.len() < LONGEST_LIST) {
        Some(list) => *list += &format!(", {word}"),
        None => lists.push(word),
    };
    let mut rest = names;
    while let Some((first, after)) = rest.split_first() {
        let is_vector =
            |stem: &str| after.len() > 1 && after[0] == format!("{stem}_y") && after[1] == format!("{stem}_z");
        if first.strip_suffix("_x").is_some_and(is_vector) {
            put(format!("{first} to {}", after[1]));
            rest = &after[2..];
        } else {
            put((*first).to_owned());
            rest = after;
        }
    }
    lists
}

/// Writes `cloud` to the new file `path`, and its label names next to it if `format` cannot hold them, in a folder that
/// is not visible to others yet.
///
/// # Errors
/// As [`write()`].
pub fn write_new(cloud: &PointCloud, path: &Path, format: &dyn Format) -> Result<Report> {
    check_fields(format, cloud.fields)?;
    let mut report = Report::default();
    let packed = format.packed().unwrap_or(format);
    packed.write(cloud, path, &mut report).map_err(|source| failed(path, source))?;
    if !format.info().holds_label_names {
        write::whole(&labels_path(path), labels_json(cloud).as_bytes())?;
    }
    Ok(report)
}

/// The files of one cloud.
struct Output {
    file: Pending,
    /// For the label names, if `file` cannot hold them.
    labels: Option<Pending>,
}

impl Output {
    fn create(path: &Path, format: &dyn Format) -> Result<Output> {
        let file = Pending::create(path)?;
        let labels = (!format.info().holds_label_names).then(|| Pending::create(&labels_path(path))).transpose()?;
        Ok(Output { file, labels })
    }

    /// Gives their names to the complete cloud file and to the file of label names of `cloud`, whose rows are not
    /// needed.
    fn commit(self, path: &Path, cloud: &PointCloud) -> Result<()> {
        let Output { file, labels } = self;
        if let Some(labels) = &labels {
            write::bytes(labels.path(), labels_json(cloud).as_bytes())
                .map_err(|source| failed(&labels_path(path), source))?;
        }
        // A program that is triggered by the cloud file finds the label names.
        write::commit_all(labels.into_iter().chain([file]).collect())
    }
}

/// Where the label names of the cloud file at `path` are if its format cannot hold them: `street.labels.json` for
/// `street.csv`. An ending that belongs to no format is a part of the name: `run_1.5m.labels.json` for `run_1.5m`.
pub fn labels_path(path: &Path) -> PathBuf {
    match format_with(&ending(path)) {
        Some(_) => path.with_extension("labels.json"),
        None => path.with_added_extension("labels.json"),
    }
}

/// World position and orientation of the sensor under the names that all formats use.
fn sensor_pose(cloud: &PointCloud) -> [(&'static str, Vec<f64>); 2] {
    let Pose { position, orientation } = cloud.sensor_pose;
    [("sensor_position", position.to_array().into()), ("sensor_orientation_xyzw", orientation.to_array().into())]
}

/// What is not in the columns, under the names that all formats use. There is no origin: the formats that need this
/// hold absolute positions. To restore the same cloud, `f32_origin` is what has been added to its f32 positions, and
/// `columns` are those that it had.
fn labels_json(cloud: &PointCloud) -> String {
    let mut map = serde_json::Map::new();
    // Not "frame", which is a column.
    map.insert("coordinates".into(), cloud.frame.name().into());
    map.extend(sensor_pose(cloud).map(|(name, values)| (name.into(), values.into())));
    if let Some(full) = cloud.intensity_full_scale {
        map.insert("intensity_full_scale".into(), full.into());
    }
    if let Some(driver) = cloud.driver {
        map.insert("driver".into(), driver.name().into());
    }
    if let Some(shape) = cloud.organised {
        map.insert("shape".into(), shape.as_slice().into());
    }
    let columns: Vec<&str> = cloud.fields.iter().map(|info| info.name).collect();
    map.insert("columns".into(), columns.into());
    map.insert("f32_origin".into(), cloud.origin.to_array().as_slice().into());
    for (stem, table) in cloud.labels.tables() {
        map.insert(format!("{stem}_ids"), table.ids.as_slice().into());
        map.insert(format!("{stem}_names"), table.names.as_slice().into());
    }
    serde_json::Value::Object(map).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FIELDS;
    use std::fs;

    #[test]
    fn formats_are_found_by_name_and_ending() {
        let of = |path: &str, name| format_for(Path::new(path), name).map(Format::name);
        assert_eq!(of("a/Street.LAS", None).unwrap(), "las");
        assert_eq!(of("street.bin", Some("las2")).unwrap(), "las2");
        assert!(of("street", None).unwrap_err().to_string().contains(".npz"));
        assert!(of("street.las", Some("la2")).unwrap_err().to_string().contains("las2"));
        for (i, format) in FORMATS.iter().enumerate() {
            assert!(FORMATS[..i].iter().all(|other| other.name() != format.name()));
            assert!(!format.info().needs_positions || FIELDS[..3].iter().all(|info| format.holds(info)));
        }
    }

    #[test]
    fn what_cannot_be_written_is_an_error_that_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = PointCloud { len: 2, ..PointCloud::default() };
        cloud.fields = FieldSet::EMPTY.with(Field::X).with(Field::Range);
        cloud.columns.resize(cloud.fields, 2).unwrap();
        let error = write(&cloud, &folder.path().join("a.las"), None).unwrap_err().to_string();
        assert!(error.contains("without y, z"), "{error}");
        assert!(check(&folder.path().join("a.las"), None, cloud.fields).is_err());
        assert!(check(&folder.path().join("no/a.csv"), None, cloud.fields).is_err());
        check(&folder.path().join("a.csv"), None, cloud.fields).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// The disk is full at each of its writes in turn; the writers of libraries must cope with that when they are
    /// dropped.
    #[test]
    fn a_disk_that_is_full_at_any_write_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = PointCloud { len: 4_000, fields: FieldSet::all(), ..PointCloud::default() };
        cloud.columns.resize(cloud.fields, cloud.len).unwrap();
        for format in FORMATS.iter().filter(|format| format.name() != "hdf5") {
            let path = folder.path().join("a");
            let written = |writes| {
                ground::write::sink::full_disk::WRITES.set(writes);
                let written = write(&cloud, &path, Some(format.name()));
                ground::write::sink::full_disk::WRITES.set(usize::MAX);
                written
            };
            let count = (0..500).take_while(|&writes| written(writes).is_err()).count();
            assert!((1..500).contains(&count), "{}: {count}", format.name());
            assert!(path.exists());
            fs::remove_file(&path).unwrap();
            fs::remove_file(labels_path(&path)).unwrap_or_default();
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn label_names_are_next_to_their_own_cloud() {
        let of = |path: &str| labels_path(Path::new(path));
        assert_eq!(of("a.b/street.CSV"), Path::new("a.b/street.labels.json"));
        assert_eq!(of("run_1.5m"), Path::new("run_1.5m.labels.json"));
        assert_eq!(of("a.b/street"), Path::new("a.b/street.labels.json"));
    }

    #[test]
    fn a_cloud_without_its_label_names_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::write(&path, "old").unwrap();
        fs::create_dir(labels_path(&path)).unwrap();
        let cloud = PointCloud::default();
        let error = check(&path, None, cloud.fields).unwrap_err().to_string();
        assert!(error.contains("a.labels.json"), "{error}");
        assert!(write(&cloud, &path, None).is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
