//! Frames of a sequence in one HDF5 file, written one by one.

use super::hdf5::{BoxRows, ROWS, add_tables, describe};
use super::sensor_pose;
use crate::{Column, FieldInfo, FieldSet, Frame, PointCloud};
use ::hdf5::types::VarLenArray;
use ::hdf5::{Dataset, Extent, File, H5Type};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::report::Report;
use ground::shown;
use ground::write::{self, Pending, failed};
use model::Labels;
use std::path::Path;
use std::sync::Arc;

/// An HDF5 file that grows by one frame at a time: one dataset per column, one variable-length row per frame, and a row
/// of `sensor_position` and `sensor_orientation_xyzw` per frame. Boxes are rows of one group and state their frame.
/// Everything else is as in a merged HDF5 file. Only one frame is in memory at a time.
///
/// The file appears under its name with [`FramesFile::finish`]; if dropped before, it leaves nothing behind.
#[derive(Debug)]
pub struct FramesFile {
    // Dropped in this order: the datasets before the file, the file before its name.
    columns: Vec<(&'static FieldInfo, Dataset)>,
    poses: Vec<Dataset>,
    /// The boxes of all frames, if there are any.
    boxes: Option<BoxRows>,
    file: File,
    pending: Pending,
    frames: usize,
    /// Whether adding a frame failed halfway, which leaves columns of unequal length.
    broken: bool,
    report: Report,
    /// What every frame must share with the first.
    common: Option<Common>,
}

#[derive(Debug, PartialEq)]
struct Common {
    fields: FieldSet,
    frame: Frame,
    origin: DVec3,
    intensity_full_scale: Option<f32>,
    organised: Option<[u32; 2]>,
    boxes: bool,
    labels: Arc<Labels>,
}

impl FramesFile {
    /// Starts the file that will be called `path`.
    ///
    /// # Errors
    /// A missing folder, no permission, or a `path` that is not a file.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        let pending = Pending::create(path.as_ref())?;
        let file = echocast_hdf5::create(pending.path()).map_err(|e| hdf5_error(&pending, e))?;
        Ok(FramesFile {
            columns: Vec::new(),
            poses: Vec::new(),
            boxes: None,
            file,
            pending,
            frames: 0,
            broken: false,
            report: Report::default(),
            common: None,
        })
    }

    /// Appends `cloud` as the next frame.
    ///
    /// # Errors
    /// A cloud with other columns or labels, another frame, origin, shape or intensity scale than the first; a full
    /// disk; a set [`cancel_flag`](ground::write::cancel_flag).
    pub fn add(&mut self, cloud: &PointCloud) -> Result<()> {
        write::check().map_err(|source| failed(self.pending.target(), source))?;
        let common = Common {
            fields: cloud.fields,
            frame: cloud.frame,
            origin: cloud.origin,
            intensity_full_scale: cloud.intensity_full_scale,
            organised: cloud.organised,
            boxes: cloud.boxes.is_some(),
            labels: Arc::clone(&cloud.labels),
        };
        if self.common.as_ref().is_some_and(|first| *first != common) {
            return Err(Error::invalid(
                format!("frame {}", self.frames),
                "of another frame, origin, shape, intensity scale, set of columns or labels, or as to boxes",
                "a scan of the same scene with the same options as the first frame",
            ));
        }
        let added = self.add_row(cloud, common);
        self.broken |= added.is_err();
        added.map_err(|e| hdf5_error(&self.pending, e))
    }

    fn add_row(&mut self, cloud: &PointCloud, common: Common) -> ::hdf5::Result<()> {
        if self.common.is_none() {
            add_tables(&self.file, cloud, &mut self.report)?;
            for info in cloud.fields.iter() {
                let dataset = match cloud.column(info.field) {
                    Column::F32(_) => create::<f32>(&self.file, info),
                    Column::F64(_) => create::<f64>(&self.file, info),
                    Column::U8(_) => create::<u8>(&self.file, info),
                    Column::U16(_) => create::<u16>(&self.file, info),
                    Column::U32(_) => create::<u32>(&self.file, info),
                }?;
                self.columns.push((info, dataset));
            }
            for (name, values) in sensor_pose(cloud) {
                let shape = (Extent::resizable(0), Extent::fixed(values.len()));
                let rows = self.file.new_dataset::<f64>().obj_track_times(false).chunk((ROWS, values.len()));
                self.poses.push(rows.shape(shape).create(name)?);
            }
            if common.boxes {
                self.boxes = Some(BoxRows::create(&self.file)?);
            }
            self.common = Some(common);
        }
        for (info, dataset) in &self.columns {
            dataset.resize(self.frames + 1)?;
            match cloud.column(info.field) {
                Column::F32(c) => put(dataset, self.frames, c),
                Column::F64(c) => put(dataset, self.frames, c),
                Column::U8(c) => put(dataset, self.frames, c),
                Column::U16(c) => put(dataset, self.frames, c),
                Column::U32(c) => put(dataset, self.frames, c),
            }?;
        }
        for ((_, values), dataset) in sensor_pose(cloud).iter().zip(&self.poses) {
            dataset.resize((self.frames + 1, values.len()))?;
            dataset.write_slice(values, (self.frames, ..))?;
        }
        if let (Some(rows), Some(boxes)) = (&mut self.boxes, &cloud.boxes) {
            rows.add(boxes)?;
        }
        self.frames += 1;
        Ok(())
    }

    /// Gives the file its name, replacing an older file. The report lists what it could not hold.
    ///
    /// # Errors
    /// A full disk, also when that made [`FramesFile::add`] fail before.
    pub fn finish(self) -> Result<Report> {
        if self.broken {
            let file = format!("frame {} of {}", self.frames, shown::path(self.pending.target()));
            return Err(Error::invalid(file, "incomplete, because adding it failed", "a file of complete frames"));
        }
        let FramesFile { columns, poses, boxes, file, pending, report, .. } = self;
        drop((columns, poses, boxes));
        file.close().map_err(|e| hdf5_error(&pending, e))?;
        pending.commit()?;
        Ok(report)
    }
}

fn hdf5_error(pending: &Pending, error: ::hdf5::Error) -> Error {
    failed(pending.target(), echocast_hdf5::io_error(error))
}

fn create<T: H5Type + Copy>(file: &File, info: &FieldInfo) -> ::hdf5::Result<Dataset> {
    let dataset = file
        .new_dataset::<VarLenArray<T>>()
        .obj_track_times(false)
        .chunk(ROWS)
        .shape(Extent::resizable(0))
        .create(info.name)?;
    describe(&dataset, info.unit, info.meaning)?;
    Ok(dataset)
}

fn put<T: H5Type + Copy>(dataset: &Dataset, frame: usize, column: &[T]) -> ::hdf5::Result<()> {
    dataset.write_slice(&[VarLenArray::from_slice(column)], frame..frame + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_frame_that_failed_half_way_is_not_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.h5");
        fs::write(&path, "old").unwrap();
        let mut cloud = PointCloud { fields: FieldSet::default(), len: 3, ..PointCloud::default() };
        cloud.columns.resize(cloud.fields, 3).unwrap();
        let mut file = FramesFile::create(&path).unwrap();
        file.add(&cloud).unwrap();
        // A dataset of one dimension holds no pose: this frame fails after its columns were written.
        file.poses[0] = file.columns[0].1.clone();
        assert!(file.add(&cloud).is_err());
        let error = file.finish().unwrap_err().to_string();
        assert!(error.contains("frame 1 of") && error.contains("incomplete"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
