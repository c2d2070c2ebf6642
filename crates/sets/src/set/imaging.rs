//! Images of the sensors of a sample: common code of the styles of image sets.

use super::names::{file_name, numbered};
use crate::Sample;
use cloud::export::images::write_layer;
use cloud::export::{ImageLayer, ImageOptions};
use cloud::image::{Annotation, RangeImage, annotations};
use cloud::{InstanceBox, PointCloud};
use emitter::ImageGrid;
use ground::error::{Error, Result};
use ground::report::Report;
use std::fs;
use std::path::{Path, PathBuf};

/// The sensors of a sample that have images, and the names of their files.
pub(super) struct ImagingSensors<'w> {
    folder: &'w Path,
    /// Number of the sample.
    number: u64,
    /// Indices of the scans with images, and their image grids.
    grids: Vec<(usize, ImageGrid)>,
}

/// An image, its annotations, and the stem of its file names.
pub(super) struct Taken {
    pub image: RangeImage,
    pub found: Vec<Annotation>,
    pub stem: String,
}

/// Indices of the scans of `sample` that have images, or that of the sensor with the requested name.
///
/// # Errors
/// No scan has images; no such sensor, which `key` names.
pub(super) fn scans(sample: &Sample, key: &str, sensor_name: Option<&str>) -> Result<Vec<(usize, ImageGrid)>> {
    let scans = sample.scans();
    if let Some(name) = sensor_name {
        let Some(scan) = scans.iter().position(|scan| scan.name() == name) else {
            let names: Vec<&str> = scans.iter().map(|scan| scan.name()).collect();
            return Err(Error::invalid(key, format!("{name:?}"), names.join(", ")));
        };
        return Ok(vec![(scan, scans[scan].sensor().image_grid()?)]);
    }
    let all: Vec<_> =
        scans.iter().enumerate().filter_map(|(scan, of)| Some((scan, of.sensor().image_grid().ok()?))).collect();
    match scans.first() {
        Some(first) if all.is_empty() => first.sensor().image_grid().map(|grid| vec![(0, grid)]),
        _ => Ok(all),
    }
}

impl<'w> ImagingSensors<'w> {
    /// Starts the images of the sample with this `number` in `folder`, in which it creates the folders `names`.
    ///
    /// # Errors
    /// I/O errors.
    pub fn begin(
        folder: &'w Path,
        names: &[&str],
        number: u64,
        grids: Vec<(usize, ImageGrid)>,
    ) -> Result<ImagingSensors<'w>> {
        for name in names {
            let folder = folder.join(name);
            fs::create_dir_all(&folder).map_err(|source| Error::Io { path: folder, source })?;
        }
        Ok(ImagingSensors { folder, number, grids })
    }

    /// The image of a scan; `None` if it has none, or if another sensor was requested.
    ///
    /// # Errors
    /// As [`RangeImage::new`].
    pub fn take(
        &self,
        sample: &Sample,
        [scan, frame]: [usize; 2],
        cloud: &PointCloud,
        boxes: &[InstanceBox],
    ) -> Result<Option<Taken>> {
        let Some((_, grid)) = self.grids.iter().find(|(known, _)| *known == scan) else { return Ok(None) };
        let scan = &sample.scans()[scan];
        let mut stem = numbered(self.number);
        if self.grids.len() > 1 {
            stem += &format!("_{}", file_name(scan.name()));
        }
        if scan.frames().len() > 1 {
            stem += &format!("_{:04}", scan.frames()[frame].number);
        }
        let image = RangeImage::new(cloud, grid)?;
        let found = annotations(&image, boxes);
        Ok(Some(Taken { image, found, stem }))
    }

    /// Path of the file of `taken` in the folder `name`.
    pub fn path(&self, name: &str, taken: &Taken, ending: &str) -> PathBuf {
        self.folder.join(name).join(format!("{}.{ending}", taken.stem))
    }

    /// Writes a layer to the folder `name`.
    ///
    /// # Errors
    /// As [`write_layer`].
    pub fn write(
        &self,
        name: &str,
        taken: &Taken,
        layer: ImageLayer,
        options: &ImageOptions,
        report: &mut Report,
    ) -> Result<()> {
        write_layer(&taken.image, layer, options.depth_range_m, &self.path(name, taken, layer.ending()), report)
    }
}
