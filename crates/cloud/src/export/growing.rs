//! A cloud file that grows frame by frame.

use super::{Format, Growing, Output, check_fields, format_for, lost};
use crate::PointCloud;
use crate::messages::BagOptions;
use ground::error::{Error, Result};
use ground::report::Report;
use ground::shown;
use ground::write::failed;
use std::path::{Path, PathBuf};

/// The clouds of several frames in one file, as if they were one cloud, of which one at a time is in memory.
///
/// The file, and `NAME.labels.json` for formats that cannot hold the label names, appear under their names with
/// [`GrowingFile::finish`]; if dropped before, it leaves nothing behind.
pub struct GrowingFile {
    format: &'static dyn Format,
    path: PathBuf,
    // Closed before it gets its name or is removed.
    file: Box<dyn Growing>,
    output: Output,
    /// All clouds together, without their rows and boxes.
    head: PointCloud,
    /// Whether adding a frame failed halfway.
    broken: bool,
}

impl GrowingFile {
    /// Starts the file that will be called `path`, for clouds like `first`, in the format called `format` or the one
    /// that owns the ending; `None`: files of the format need all points at once. `first` is not added yet.
    ///
    /// # Errors
    /// As [`super::write()`].
    pub fn begin(path: &Path, format: Option<&str>, first: &PointCloud) -> Result<Option<GrowingFile>> {
        GrowingFile::begin_with(path, format, first, &BagOptions::default())
    }

    /// [`GrowingFile::begin`] with a choice of messages for bags; other formats hold none.
    ///
    /// # Errors
    /// As [`super::write_with`].
    pub fn begin_with(
        path: &Path,
        format: Option<&str>,
        first: &PointCloud,
        bag: &BagOptions,
    ) -> Result<Option<GrowingFile>> {
        let format = format_for(path, format)?;
        check_fields(format, first.fields)?;
        let output = Output::create(path, format)?;
        let begun = format.begin_bag(first, output.file.path(), bag);
        let Some(file) = begun.or_else(|| format.begin(first, output.file.path())) else { return Ok(None) };
        let file = file.map_err(|source| failed(path, source))?;
        Ok(Some(GrowingFile { format, path: path.to_owned(), file, output, head: first.head(), broken: false }))
    }

    /// Adds `cloud`, the next frame.
    ///
    /// # Errors
    /// A cloud with other columns or labels, another frame, origin or intensity scale than the first; a full disk; a
    /// set [`cancel_flag`](ground::write::cancel_flag).
    pub fn add(&mut self, cloud: &PointCloud) -> Result<()> {
        self.head.lengthen(cloud)?;
        let added = self.file.add(cloud);
        self.broken |= added.is_err();
        added.map_err(|source| failed(&self.path, source))
    }

    /// Gives the file its name, replacing an older file. The report lists what the format could not hold.
    ///
    /// # Errors
    /// A full disk, also when that made [`GrowingFile::add`] fail before.
    pub fn finish(self) -> Result<Report> {
        let GrowingFile { format, path, mut file, output, head, broken } = self;
        if broken {
            let found = "incomplete, because adding a frame failed";
            return Err(Error::invalid(shown::path(&path), found, "a file of complete frames"));
        }
        let mut report = lost(format, &head);
        file.finish(&head, &mut report).map_err(|source| failed(&path, source))?;
        drop(file);
        output.commit(&path, &head)?;
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FORMATS, labels_path, write};
    use super::*;
    use crate::{Field, FieldSet};
    use glam::DVec3;
    use ground::write::sink;
    use std::fs;

    /// A frame of `rows` rows with all columns, organised in one column, with a beam that has no return.
    fn frame(number: usize, rows: usize) -> PointCloud {
        let mut cloud = PointCloud { len: rows, fields: FieldSet::all(), ..PointCloud::default() };
        cloud.origin = DVec3::new(5e5, 5.6e6, 100.0);
        cloud.columns.resize(cloud.fields, rows).unwrap();
        for row in 0..rows {
            let value = (number * 1000 + row) as f32;
            cloud.columns.x[row] = if row == 3 { f32::NAN } else { value.sin() * 20.0 };
            cloud.columns.y[row] = value * 0.01;
            cloud.columns.intensity[row] = value.cos().abs();
            cloud.columns.return_number[row] = 1 + (row % 3) as u8;
            cloud.columns.category_id[row] = (row / 7) as u32;
            cloud.columns.time[row] = f64::from(value);
        }
        cloud.organised = Some([rows as u32, 1]);
        cloud
    }

    fn growing(path: &Path, frames: &[PointCloud]) -> Result<Option<Report>> {
        let Some(mut file) = GrowingFile::begin(path, None, &frames[0])? else { return Ok(None) };
        frames.iter().try_for_each(|frame| file.add(frame))?;
        file.finish().map(Some)
    }

    #[test]
    fn frames_that_are_added_are_as_one_cloud() {
        let folder = tempfile::tempdir().unwrap();
        let frames = [frame(0, 60_000), frame(1, 1), frame(2, 50_001)];
        let mut all = PointCloud::default();
        frames.iter().for_each(|frame| all.append(frame).unwrap());
        let mut grew = 0;
        for format in FORMATS.iter().filter(|format| !format.info().extensions.is_empty()) {
            let path = |stem: &str| folder.path().join(stem).with_extension(format.info().extensions[0]);
            let Some(report) = growing(&path("grown"), &frames).unwrap() else { continue };
            grew += 1;
            assert_eq!(report.warnings, write(&all, &path("whole"), None).unwrap().warnings);
            // Bytes, except for HDF5, whose datasets are in chunks, E57, which has a scan for each frame, and bags,
            // which have a message for each.
            if !["hdf5", "e57", "mcap"].contains(&format.name()) {
                let read = |stem| fs::read(path(stem)).unwrap();
                assert!(read("grown") == read("whole"), "{}", format.name());
            }
            let labels = |stem| fs::read(labels_path(&path(stem))).ok();
            assert_eq!(labels("grown"), labels("whole"));
        }
        assert!(grew >= 4, "{grew}");
    }

    #[cfg(feature = "hdf5")]
    #[test]
    fn datasets_grow_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grown.h5");
        let frames = [frame(0, 100), frame(1, 0), frame(2, 70)];
        growing(&path, &frames).unwrap().unwrap();
        let file = ::hdf5::File::open(&path).unwrap();
        let column = |name: &str| file.dataset(name).unwrap().read_raw::<f64>().unwrap();
        let expected: Vec<f64> = frames.iter().flat_map(|frame| frame.columns.time.clone()).collect();
        assert_eq!(column("time"), expected);
        assert_eq!(column("origin"), [5e5, 5.6e6, 100.0]);
        assert_eq!(column("shape"), [170.0, 1.0]);
    }

    #[test]
    fn what_does_not_fit_or_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.laz");
        fs::write(&path, "old").unwrap();
        let first = frame(0, 10);
        let mut file = GrowingFile::begin(&path, None, &first).unwrap().unwrap();
        file.add(&first).unwrap();
        let other = PointCloud { origin: DVec3::ZERO, ..frame(1, 10) };
        assert!(file.add(&other).unwrap_err().to_string().contains("of another origin"));
        drop(file);
        // A disk that is full in the middle.
        let mut file = GrowingFile::begin(&path, None, &first).unwrap().unwrap();
        sink::full_disk::WRITES.set(0);
        let added = file.add(&frame(1, 200_000));
        sink::full_disk::WRITES.set(usize::MAX);
        assert!(added.is_err());
        assert!(file.finish().unwrap_err().to_string().contains("incomplete"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        // The strongest of all points is not known before the last.
        let unscaled = PointCloud { intensity_full_scale: None, ..first };
        assert!(GrowingFile::begin(&path, None, &unscaled).unwrap().is_none());
        assert!(unscaled.fields.contains(Field::Intensity));
    }

    #[test]
    fn points_out_of_the_range_of_the_first_frame_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let mut far = frame(1, 10);
        far.columns.x[5] = 3e5;
        let report = growing(&folder.path().join("a.las"), &[frame(0, 10), far]).unwrap().unwrap();
        let expected_warning = "las: 1 of 18 points left out: their coordinates are out of the range of LAS";
        assert!(report.warnings.iter().any(|warning| warning == expected_warning), "{report:?}");
    }
}
