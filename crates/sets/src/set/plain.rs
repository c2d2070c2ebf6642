//! One folder per sample, in any cloud format.

use super::names::file_name;
use super::style::{Scanned, Style, Writer as Write};
use crate::Sample;
use cloud::FieldSet;
use cloud::export;
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
    /// Options of a picture next to each cloud.
    pub preview: Option<PreviewOptions>,
}

impl Default for Plain {
    fn default() -> Self {
        Plain { format: "npz".into(), preview: None }
    }
}

struct PlainWriter<'w> {
    style: &'w Plain,
    folder: &'w Path,
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

    fn readme(&self) -> String {
        let mut text = format!(
            "`data` holds a folder for each sample, with a file for each sensor in the format `{}`, of several frames one \
             for each.\n",
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
        Ok(Box::new(PlainWriter { style: self, folder }))
    }
}

impl Write for PlainWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, cloud, .. }: &Scanned) -> Result<Report> {
        let scan = &sample.scans()[scan];
        let format = export::format_for(Path::new(""), Some(&self.style.format))?;
        let mut stem = file_name(scan.name());
        if scan.frames().len() > 1 {
            stem += &format!("_{:04}", scan.frames()[frame].number);
        }
        let path = |ending: &str| -> PathBuf { self.folder.join(format!("{stem}.{ending}")) };
        let ending = format.info().extensions.first().copied().unwrap_or(format.name());
        let mut report = export::write_new(cloud, &path(ending), format)?;
        if let Some(options) = &self.style.preview {
            report.absorb(pictures::write_new(cloud, &path("png"), options)?);
        }
        Ok(report)
    }
}
