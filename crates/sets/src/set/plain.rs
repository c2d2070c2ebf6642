//! One folder per sample, in any cloud format.

use super::names::file_name;
use super::style::{Scanned, StripUse, Style, Writer as Write};
use crate::Sample;
use cloud::export::{self, GrowingFile};
use cloud::{FieldSet, PointCloud};
use ground::error::Result;
use ground::report::Report;
use pictures::PreviewOptions;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// `data/000017/top.npz`, or for several frames `data/000017/top_0003.npz`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Plain {
    /// Name of the format, as `echocast formats` lists them.
    pub format: String,
    /// Whether each frame or strip has a file of its own; otherwise all of a sensor are in one.
    pub single: bool,
    /// Options of a picture next to each cloud.
    pub preview: Option<PreviewOptions>,
}

impl Default for Plain {
    fn default() -> Self {
        Plain { format: "npz".into(), single: true, preview: None }
    }
}

struct PlainWriter<'w> {
    style: &'w Plain,
    folder: &'w Path,
    /// The file that more is to be added to, if there is one.
    open: Option<OpenCloud>,
}

/// A file that takes several frames or pieces.
struct OpenCloud {
    /// Its name without ending.
    stem: String,
    /// `None`: files of the format need all points at once.
    file: Option<GrowingFile>,
    /// All points, if a file or a picture needs them at once.
    all: PointCloud,
}

impl Style for Plain {
    fn check(&self) -> Result<()> {
        export::format_for(Path::new(""), Some(&self.format)).map(drop)?;
        match &self.preview {
            Some(options) => pictures::check_options(options),
            None => Ok(()),
        }
    }

    fn root(&self) -> &'static str {
        "data"
    }

    fn folder_per_sample(&self) -> bool {
        true
    }

    fn strips(&self) -> StripUse {
        StripUse::Pieces
    }

    fn readme(&self) -> String {
        let files = match self.single {
            true => "of several frames one for each",
            false => "all of its frames in one",
        };
        let mut text = format!(
            "`data` holds a folder for each sample, with a file for each sensor in the format `{}`, {files}.\n",
            self.format
        );
        if self.format == "npz" {
            text += "\n```python\n\
                     import glob\n\
                     import numpy as np\n\
                     for name in sorted(glob.glob('data/*/*.npz')):\n    \
                         cloud = np.load(name)\n    \
                         points = np.stack([cloud['x'], cloud['y'], cloud['z']], axis=1)\n\
                     ```\n";
        }
        text
    }

    fn fields(&self, _sample: &Sample) -> FieldSet {
        self.preview.as_ref().map_or(FieldSet::EMPTY, PreviewOptions::fields)
    }

    fn fits(&self, _sample: &Sample) -> Result<()> {
        Ok(())
    }

    fn writer<'w>(&'w self, _number: u64, _sample: &Sample, folder: &'w Path) -> Result<Box<dyn Write + 'w>> {
        Ok(Box::new(PlainWriter { style: self, folder, open: None }))
    }
}

impl PlainWriter<'_> {
    fn path(&self, stem: &str, ending: &str) -> PathBuf {
        self.folder.join(format!("{stem}.{ending}"))
    }

    /// The file of a cloud called `stem`.
    fn cloud_path(&self, stem: &str) -> Result<PathBuf> {
        let format = export::format_for(Path::new(""), Some(&self.style.format))?;
        Ok(self.path(stem, format.info().extensions.first().copied().unwrap_or(format.name())))
    }

    /// Writes a cloud that is complete.
    fn write(&self, stem: &str, cloud: &PointCloud) -> Result<Report> {
        let format = export::format_for(Path::new(""), Some(&self.style.format))?;
        let mut report = export::write_new(cloud, &self.cloud_path(stem)?, format)?;
        report.absorb(self.write_picture(stem, cloud)?);
        Ok(report)
    }

    fn write_picture(&self, stem: &str, cloud: &PointCloud) -> Result<Report> {
        match &self.style.preview {
            Some(options) => pictures::write_new(cloud, &self.path(stem, "png"), options),
            None => Ok(Report::default()),
        }
    }

    /// Completes the file that is open, if one is.
    fn close(&mut self) -> Result<Report> {
        let Some(OpenCloud { stem, file, all }) = self.open.take() else { return Ok(Report::default()) };
        let Some(file) = file else { return self.write(&stem, &all) };
        let mut report = file.finish()?;
        report.absorb(self.write_picture(&stem, &all)?);
        Ok(report)
    }
}

impl Write for PlainWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, last, cloud, .. }: &Scanned) -> Result<Report> {
        let scan = &sample.scans()[scan];
        let mut stem = file_name(scan.name());
        if self.style.single && (scan.frames().len() > 1 || scan.has_strips()) {
            stem += &format!("_{:04}", scan.frames()[frame].number);
        }
        let mut report = Report::default();
        if self.open.as_ref().is_some_and(|open| open.stem != stem) {
            report.absorb(self.close()?);
        }
        let complete = self.style.single && last;
        if complete && self.open.is_none() {
            report.absorb(self.write(&stem, cloud)?);
            return Ok(report);
        }
        let mut open = match self.open.take() {
            Some(open) => open,
            None => {
                let file = GrowingFile::begin(&self.cloud_path(&stem)?, Some(&self.style.format), cloud)?;
                OpenCloud { stem, file, all: PointCloud::default() }
            }
        };
        if let Some(file) = &mut open.file {
            file.add(cloud)?;
        }
        if open.file.is_none() || self.style.preview.is_some() {
            open.all.append(cloud)?;
        }
        self.open = Some(open);
        if complete {
            report.absorb(self.close()?);
        }
        Ok(report)
    }

    fn finish(mut self: Box<Self>) -> Result<Report> {
        self.close()
    }
}
