//! Pascal VOC: images, objects and masks of each.

use super::imaging::{ImagingSensors, scans};
use super::style::{Scanned, Style, Writer as Write};
use super::whole::Whole;
use crate::Sample;
use crate::sample::BoxScope;
use cloud::FieldSet;
use cloud::export::annotations::{Shown, voc};
use cloud::export::images::{PixelFormat, write_numbers};
use cloud::export::{AnnotationStyle, ImageLayer, ImageOptions};
use ground::error::Result;
use ground::report::Report;
use ground::write;
use serde::Deserialize;
use std::collections::HashMap;
use std::path::Path;

/// `voc/JPEGImages/000017.png`, `Annotations/000017.xml`, `SegmentationClass`, `SegmentationObject`, `ImageSets`
/// (Everingham et al. 2010, The Pascal Visual Object Classes challenge; folders as in its development kit).
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Voc {
    /// Name of the sensor; defaults to all that have images.
    pub sensor: Option<String>,
}

const ROOT: &str = "voc";

/// Folders of pictures, annotations and masks.
const FOLDERS: [&str; 4] = ["JPEGImages", "Annotations", "SegmentationClass", "SegmentationObject"];

struct VocWriter<'w> {
    options: ImageOptions,
    imaging: ImagingSensors<'w>,
}

impl Voc {
    fn options() -> ImageOptions {
        let layers = vec![ImageLayer::Color, ImageLayer::Category, ImageLayer::Instance];
        ImageOptions::default().layers(layers).depth_range_m(None).annotations(vec![AnnotationStyle::Voc])
    }
}

impl Style for Voc {
    fn root(&self) -> &'static str {
        ROOT
    }

    fn fields(&self, _sample: &Sample) -> FieldSet {
        Voc::options().fields()
    }

    fn boxes(&self, _sample: &Sample, _scan: usize, _frame: usize) -> BoxScope {
        BoxScope::InImage
    }

    fn fits(&self, sample: &Sample) -> Result<()> {
        scans(sample, "voc: sensor", self.sensor.as_deref()).map(drop)
    }

    fn writer<'w>(&'w self, number: u64, sample: &Sample, folder: &'w Path) -> Result<Box<dyn Write + 'w>> {
        let grids = scans(sample, "voc: sensor", self.sensor.as_deref())?;
        let imaging = ImagingSensors::begin(folder, &FOLDERS, number, grids)?;
        Ok(Box::new(VocWriter { options: Voc::options(), imaging }))
    }

    fn join(&self, whole: &mut Whole) -> Result<()> {
        for (part, samples) in whole.parts() {
            let mut lines = String::new();
            for sample in samples {
                let files = &whole.entries[&sample].files;
                let names =
                    files.iter().filter_map(|file| file.path.strip_prefix("voc/Annotations/")?.strip_suffix(".xml"));
                names.for_each(|name| lines += &format!("{name}\n"));
            }
            for task in ["Main", "Segmentation"] {
                let path = Path::new(ROOT).join(format!("ImageSets/{task}/{part}.txt"));
                whole.write(path, &mut |out| out.write_all(lines.as_bytes()))?;
            }
        }
        Ok(())
    }

    fn readme(&self) -> String {
        "`voc` is laid out as Pascal VOC. Pictures are PNG, although in `JPEGImages`, and show the surfaces' own \
         colours, without light and shadow. In `Annotations`, pixels count from 1; `truncated` is 1 where more than \
         15 % of the box around the whole object (`amodal`) are outside of the picture, `occluded` where more than 5 \
         % of the object are hidden. Numbers in `SegmentationClass` are those of the categories of the scene, named \
         in the text `names` of each file; those in `SegmentationObject` count the objects of `Annotations` from 1. \
         What has no return is 0.\n\n\
         ```python\n\
         import numpy as np\n\
         from PIL import Image\n\
         from xml.etree import ElementTree\n\
         for name in open('voc/ImageSets/Main/train.txt').read().split():\n    \
             picture = np.asarray(Image.open(f'voc/JPEGImages/{name}.png'))\n    \
             classes = np.asarray(Image.open(f'voc/SegmentationClass/{name}.png'))\n    \
             objects = ElementTree.parse(f'voc/Annotations/{name}.xml').findall('object')\n\
         ```\n"
            .to_owned()
    }
}

impl Write for VocWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, cloud, boxes, .. }: &Scanned) -> Result<Report> {
        let mut report = Report::default();
        let Some(taken) = self.imaging.take(sample, [scan, frame], cloud, boxes)? else { return Ok(report) };
        let layers = [("JPEGImages", ImageLayer::Color), ("SegmentationClass", ImageLayer::Category)];
        for (name, layer) in layers {
            self.imaging.write(name, &taken, layer, &self.options, &mut report)?;
        }
        let known: Vec<_> = taken.found.iter().copied().filter(|found| found.category_id != 0).collect();
        let of: HashMap<u32, u32> = known.iter().map(|found| found.instance_id).zip(1..).collect();
        let numbers = taken.image.instance_id.iter().map(|id| of.get(id).copied().unwrap_or(0));
        let mut samples = PixelFormat::Indexed;
        if known.len() > usize::from(u8::MAX) {
            samples = PixelFormat::Grey16;
            report.warn("voc: pictures of more than 255 objects have SegmentationObject in 16 bits");
        }
        let texts = vec![("quantity".to_owned(), "object, by its place in the annotation".to_owned())];
        write_numbers(&taken.image, numbers, samples, texts, &self.imaging.path("SegmentationObject", &taken, "png"))?;
        let at = sample.scans()[scan].frames()[frame];
        let picture = format!("{}.png", taken.stem);
        let shown = Shown { image: &taken.image, found: &known, picture: &picture, frame: at.number, time: at.start };
        let text = voc(&shown, "JPEGImages", 3);
        write::whole(&self.imaging.path("Annotations", &taken, "xml"), text.as_bytes())?;
        Ok(report)
    }
}
