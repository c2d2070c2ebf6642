//! COCO: images, and their annotations in one file for each split of the set.

use super::imaging::{ImagingSensors, scans};
use super::manifest::FileEntry;
use super::names::numbered;
use super::style::{Scanned, Style, Writer as Write};
use super::whole::{Whole, damaged};
use crate::Sample;
use crate::sample::BoxScope;
use cloud::FieldSet;
use cloud::export::annotations::{Shown, categories, image_keys, info, instances, line, segments};
use cloud::export::images::write_segments;
use cloud::export::{AnnotationStyle, ImageLayer, ImageOptions};
use cloud::image::masks;
use engine::scene::Labels;
use ground::error::{Error, Result};
use ground::report::Report;
use ground::write;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

/// `coco/images/000017.png` and other layers in folders of the same names, `coco/annotations/instances_train.json`
/// (cocodataset.org, data format).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Coco {
    /// Name of the sensor; defaults to all that have images.
    pub sensor: Option<String>,
    /// Layers that are written of each image; the first is in `images`.
    pub layers: Vec<ImageLayer>,
    /// Distances, m, between which depths are linear; by default, depths are in millimetres.
    pub depth_range_m: Option<[f64; 2]>,
    /// Whether panoptic segments of all pixels are written, too.
    pub panoptic: bool,
}

impl Default for Coco {
    fn default() -> Self {
        Coco { sensor: None, layers: vec![ImageLayer::Color], depth_range_m: None, panoptic: false }
    }
}

const ROOT: &str = "coco";

/// The folder of the rows that each sample adds to the tables, one per line after the name of its table.
const PIECES: &str = "annotations/pieces";

struct CocoWriter<'w> {
    style: &'w Coco,
    options: ImageOptions,
    imaging: ImagingSensors<'w>,
    folder: &'w Path,
    number: u64,
    piece: String,
    /// Numbers and names of the categories.
    categories: BTreeSet<(u32, String)>,
}

impl Coco {
    fn options(&self) -> ImageOptions {
        let annotations = vec![AnnotationStyle::Coco];
        ImageOptions::default().layers(self.layers.clone()).depth_range_m(self.depth_range_m).annotations(annotations)
    }

    /// The folder of a layer.
    fn folder_of(&self, layer: ImageLayer) -> &'static str {
        if self.layers.first() == Some(&layer) { "images" } else { layer.name() }
    }
}

impl Style for Coco {
    fn check(&self) -> Result<()> {
        self.options().check().map_err(|error| match error {
            Error::InvalidParameter { name, value, allowed } => {
                let name = if name == "image layers" { "layers" } else { "depth_range_m" };
                Error::invalid(name, value, allowed)
            }
            other => other,
        })
    }

    fn root(&self) -> &'static str {
        ROOT
    }

    fn fields(&self, _sample: &Sample) -> FieldSet {
        self.options().fields()
    }

    fn boxes(&self, _sample: &Sample, _scan: usize, _frame: usize) -> BoxScope {
        BoxScope::InImage
    }

    fn fits(&self, sample: &Sample) -> Result<()> {
        scans(sample, "coco: sensor", self.sensor.as_deref()).map(drop)
    }

    fn writer<'w>(&'w self, number: u64, sample: &Sample, folder: &'w Path) -> Result<Box<dyn Write + 'w>> {
        let grids = scans(sample, "coco: sensor", self.sensor.as_deref())?;
        let mut names: Vec<&str> = self.layers.iter().map(|&layer| self.folder_of(layer)).collect();
        names.push(PIECES);
        names.extend(self.panoptic.then_some("panoptic"));
        let imaging = ImagingSensors::begin(folder, &names, number, grids)?;
        let (options, piece, categories) = (self.options(), String::new(), BTreeSet::new());
        Ok(Box::new(CocoWriter { style: self, options, imaging, folder, number, piece, categories }))
    }

    fn join(&self, whole: &mut Whole) -> Result<()> {
        let samples = whole.samples();
        let categories = CocoCategories::read(whole.root, &whole.pieces(&samples, piece)?)?;
        let licences: Vec<Value> =
            whole.licence.iter().map(|name| json!({ "id": 1, "name": name, "url": "" })).collect();
        let licensed = !licences.is_empty();
        let licences = Value::Array(licences);
        let mut tables = vec![("instances", "annotation", false)];
        tables.extend(self.panoptic.then_some(("panoptic", "segments", true)));
        for (part, samples) in whole.parts() {
            let pieces = whole.pieces(&samples, piece)?;
            for (table, rows, panoptic) in &tables {
                let root = whole.root;
                let path = Path::new(ROOT).join(format!("annotations/{table}_{part}.json"));
                whole.write(path, &mut |out| {
                    write!(out, "{{\n\"info\": {},\n\"licenses\": {licences},\n\"images\": [", info())?;
                    let mut image = 0;
                    each_row(root, &pieces, &["image"], |_, keys| {
                        image += 1;
                        let between = if image == 1 { "\n" } else { ",\n" };
                        let numbers = [("id", image.into()), ("license", 1.into())];
                        write!(out, "{between}{}", line(&numbers[..1 + usize::from(licensed)], keys))
                    })?;
                    write!(out, "\n],\n\"annotations\": [")?;
                    let (mut image, mut count) = (0_u64, 0_u64);
                    each_row(root, &pieces, &["image", rows], |row, mut keys| {
                        if row == "image" {
                            image += 1;
                            return Ok(());
                        }
                        count += 1;
                        categories.renumber(&mut keys);
                        let between = if count == 1 { "\n" } else { ",\n" };
                        let mut numbers = vec![("id", Value::from(count)), ("image_id", image.into())];
                        if *panoptic {
                            numbers.remove(0);
                        }
                        write!(out, "{between}{}", line(&numbers, keys))
                    })?;
                    writeln!(out, "\n],\n\"categories\": [\n{}\n]\n}}", categories.rows(*panoptic).join(",\n"))
                })?;
            }
        }
        Ok(())
    }

    fn readme(&self) -> String {
        "`coco` is laid out as COCO: images in `coco/images`, and what they show of each instance in \
         `coco/annotations/instances_train.json` and so on: boxes around the visible part (`bbox`) and around the \
         whole object (`amodal_bbox`, which may extend beyond the image), masks, the fractions outside of the image \
         (`truncation`) and hidden by other objects (`occlusion`), both 0 to 1. `color` shows the surfaces' own \
         colours, without light and shadow; what has no return is black, and in no mask.\n\n\
         ```python\n\
         from pycocotools.coco import COCO\n\
         coco = COCO('coco/annotations/instances_train.json')\n\
         for image in coco.loadImgs(coco.getImgIds()):\n    \
             for annotation in coco.loadAnns(coco.getAnnIds(image['id'])):\n        \
                 mask = coco.annToMask(annotation)\n\
         ```\n"
            .to_owned()
    }
}

impl Write for CocoWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, cloud, boxes, .. }: &Scanned) -> Result<Report> {
        let mut report = Report::default();
        let Some(taken) = self.imaging.take(sample, [scan, frame], cloud, boxes)? else { return Ok(report) };
        for &layer in &self.options.layers {
            self.imaging.write(self.style.folder_of(layer), &taken, layer, &self.options, &mut report)?;
        }
        let scan = &sample.scans()[scan];
        let picture = format!("{}.{}", taken.stem, self.options.layers[0].ending());
        let at = scan.frames()[frame];
        let shown =
            Shown { image: &taken.image, found: &taken.found, picture: &picture, frame: at.number, time: at.start };
        let mut keys = image_keys(&shown);
        keys.insert("sample".to_owned(), self.number.into());
        keys.insert("sensor".to_owned(), scan.name().into());
        let mut row = |table: &str, mut keys| {
            name_category(&mut keys, &cloud.labels);
            self.piece += &format!("{table} {}\n", line(&[], keys));
        };
        row("image", keys);
        instances(&shown, &masks(&taken.image), &mut report).for_each(|keys| row("annotation", keys));
        if self.style.panoptic {
            let (keys, pixels) = segments(&shown, &format!("{}.png", taken.stem));
            row("segments", keys);
            write_segments(&taken.image, &pixels, &self.imaging.path("panoptic", &taken, "png"))?;
        }
        self.categories.extend(cloud.labels.category.iter().map(|(id, name)| (id, name.to_owned())));
        Ok(report)
    }

    fn finish(mut self: Box<Self>) -> Result<Report> {
        for (id, name) in &self.categories {
            let keys = [("id".to_owned(), (*id).into()), ("name".to_owned(), name.as_str().into())];
            self.piece += &format!("category {}\n", line(&[], keys.into_iter().collect()));
        }
        let path = self.folder.join(PIECES).join(format!("{}.txt", numbered(self.number)));
        write::whole(&path, self.piece.as_bytes())?;
        Ok(Report::default())
    }
}

/// The file with the rows of a sample, relative to the set's folder.
fn piece(sample: u64) -> PathBuf {
    Path::new(ROOT).join(PIECES).join(format!("{}.txt", numbered(sample)))
}

/// Passes the rows of `tables` in `pieces`, in order, to `row`.
fn each_row(
    root: &Path,
    pieces: &[FileEntry],
    tables: &[&str],
    mut row: impl FnMut(&str, Map<String, Value>) -> io::Result<()>,
) -> io::Result<()> {
    for piece in pieces {
        let text = Whole::text(root, piece)?;
        for (table, keys) in text.lines().filter_map(|line| line.split_once(' ')) {
            if tables.contains(&table) {
                row(table, serde_json::from_str(keys)?)?;
            }
        }
    }
    Ok(())
}

/// Numbers of the categories of a set, by their names.
struct CocoCategories(BTreeMap<String, u32>);

impl CocoCategories {
    /// The numbers of the samples; if these contradict each other, names are renumbered.
    fn read(root: &Path, pieces: &[FileEntry]) -> Result<CocoCategories> {
        let mut known: BTreeSet<(u32, String)> = BTreeSet::new();
        each_row(root, pieces, &["category"], |_, keys| {
            let id = keys.get("id").and_then(Value::as_u64).unwrap_or(0);
            let name = keys.get("name").and_then(Value::as_str).unwrap_or_default();
            known.insert((id as u32, name.to_owned()));
            Ok(())
        })
        .map_err(|fault| damaged(fault.to_string()))?;
        let ids: BTreeSet<u32> = known.iter().map(|(id, _)| *id).collect();
        let names: BTreeSet<String> = known.iter().map(|(_, name)| name.clone()).collect();
        let same = ids.len() == known.len() && names.len() == known.len();
        Ok(CocoCategories(match same {
            true => known.into_iter().map(|(id, name)| (name, id)).collect(),
            false => names.into_iter().zip(1..).collect(),
        }))
    }

    /// Replaces the name of the category of a row, and of its segments, by the number.
    fn renumber(&self, keys: &mut Map<String, Value>) {
        if let Some(name) = keys.shift_remove("category") {
            let number = name.as_str().and_then(|name| self.0.get(name));
            keys.insert("category_id".to_owned(), number.copied().into());
        }
        let segments = keys.get_mut("segments_info").and_then(Value::as_array_mut);
        segments.into_iter().flatten().filter_map(Value::as_object_mut).for_each(|keys| self.renumber(keys));
    }

    /// The rows of COCO's list of categories.
    fn rows(&self, panoptic: bool) -> Vec<String> {
        let mut all: Vec<(u32, &str)> = self.0.iter().map(|(name, id)| (*id, name.as_str())).collect();
        all.sort_unstable();
        categories(all.into_iter(), panoptic)
    }
}

/// Adds the name of its category to a row, since its number may be another in other samples.
fn name_category(keys: &mut Map<String, Value>, labels: &Labels) {
    if let Some(id) = keys.get("category_id").and_then(Value::as_u64) {
        keys.insert("category".to_owned(), labels.category.name(id as u32).unwrap_or_default().into());
    }
    let segments = keys.get_mut("segments_info").and_then(Value::as_array_mut);
    segments.into_iter().flatten().filter_map(Value::as_object_mut).for_each(|keys| name_category(keys, labels));
}
