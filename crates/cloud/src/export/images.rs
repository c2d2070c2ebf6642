//! Images of cameras and other optical sensors, frame by frame into a folder: pixels as PNG, TIFF and arrays, and what
//! they show as annotations.

use super::Instrument;
use super::annotations::{CocoInstances, Panoptic, Shown, voc};
use super::npz::Archive;
use super::pixels::{Png, palette, write_tiff};
use crate::image::{RangeImage, annotations, masks};
use crate::{Column, Field, FieldSet, PointCloud};
use emitter::{ImageGrid, Intrinsics};
use ground::builder;
use ground::error::{Error, Result};
use ground::named;
use ground::report::Report;
use ground::write::{self, Pending, failed};
use model::NameTable;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A layer of images that files hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ImageLayer {
    /// Distance along the axis of a camera, for other sensors the slant range: PNG of 16 bits, 0 where there is no
    /// return, else millimetres or as specified by [`ImageOptions::depth_range_m`].
    Depth,
    /// The same in metres, NaN where there is no return: TIFF of 32-bit floats.
    Depth32,
    /// Categories: PNG with a palette if all numbers are below 256, else of 16 bits.
    Category,
    /// Parts, likewise.
    Part,
    /// Instances, likewise.
    Instance,
    /// Categories: PNG of 16 bits.
    Category16,
    /// Parts: PNG of 16 bits.
    Part16,
    /// Instances: PNG of 16 bits.
    Instance16,
    /// Base colours of the surfaces, without light and shadow: PNG.
    Color,
    /// What the instrument reports, from 0 to its full scale, or without one to the greatest value of the image: PNG of
    /// 16 bits.
    Intensity,
    /// Normals to the right, up and back: PNG in which red, green and blue are `127.5 (n + 1)`, black where there is no
    /// return.
    Normal,
    /// All of these as NumPy arrays, with the numbers of the cloud: NPZ.
    Arrays,
}

named! {
    ImageLayer:
        Depth "depth", Depth32 "depth32", Category "category", Part "part", Instance "instance",
        Category16 "category16", Part16 "part16", Instance16 "instance16", Color "color",
        Intensity "intensity", Normal "normal", Arrays "arrays",
}

/// The format in which files describe what images show of each instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum AnnotationStyle {
    /// COCO's instances, `coco.json`: boxes, masks, areas.
    Coco,
    /// COCO's panoptic segmentation, `panoptic.json` and a PNG for each image.
    Panoptic,
    /// Pascal VOC: an XML file for each image.
    Voc,
}

named! { AnnotationStyle: Coco "coco", Panoptic "panoptic", Voc "voc" }

builder! {
    /// What a folder of images holds.
    #[derive(Clone, Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct ImageOptions {
        /// The layers written for every image; depth, category, instance and color by default.
        pub layers: Vec<ImageLayer> =
            vec![ImageLayer::Depth, ImageLayer::Category, ImageLayer::Instance, ImageLayer::Color],
        /// Distances, m, between which `depth` is linear, 1 to 65535; `None`: it is in millimetres.
        pub depth_range_m: Option<[f64; 2]> = None,
        /// Formats of the annotations; none by default.
        pub annotations: Vec<AnnotationStyle> = Vec::new(),
    }
}

impl ImageLayer {
    /// Ending of its files.
    #[doc(hidden)]
    pub fn ending(self) -> &'static str {
        match self {
            ImageLayer::Depth32 => "tiff",
            ImageLayer::Arrays => "npz",
            _ => "png",
        }
    }

    /// The columns that it is made from, in addition to `beam` and `range`.
    fn fields(self) -> FieldSet {
        let fields: &[Field] = match self {
            ImageLayer::Depth | ImageLayer::Depth32 => &[Field::Depth],
            ImageLayer::Category | ImageLayer::Category16 => &[Field::CategoryId],
            ImageLayer::Part | ImageLayer::Part16 => &[Field::PartId],
            ImageLayer::Instance | ImageLayer::Instance16 => &[Field::InstanceId],
            ImageLayer::Color => &[Field::Red, Field::Green, Field::Blue],
            ImageLayer::Intensity => &[Field::Intensity],
            ImageLayer::Normal => &[Field::NormalX, Field::NormalY, Field::NormalZ],
            ImageLayer::Arrays => return RangeImage::fields(),
        };
        fields.iter().copied().collect()
    }
}

impl ImageOptions {
    /// The columns that images are made from.
    pub fn fields(&self) -> FieldSet {
        let mut fields = FieldSet::EMPTY.with(Field::Beam).with(Field::Range);
        if !self.annotations.is_empty() {
            fields = fields.with(Field::CategoryId).with(Field::InstanceId);
        }
        self.layers.iter().fold(fields, |all, layer| all.union(layer.fields()))
    }

    /// Checks that images can be made with these options.
    ///
    /// # Errors
    /// No layer, a layer given twice, depths that do not ascend from 0 or more.
    pub fn check(&self) -> Result<()> {
        let twice = |index: usize| self.layers[..index].contains(&self.layers[index]);
        if self.layers.is_empty() || (0..self.layers.len()).any(twice) {
            let names: Vec<&str> = self.layers.iter().map(|layer| layer.name()).collect();
            return Err(Error::invalid("image layers", format!("{names:?}"), "one or more, each once"));
        }
        if let Some([low, high]) = self.depth_range_m
            && !(low >= 0.0 && low < high && high.is_finite())
        {
            let allowed = "two distances, m, the first 0 or more, the second greater";
            return Err(Error::invalid("depth range", format!("{low},{high}"), allowed));
        }
        Ok(())
    }

    /// The layer that annotations refer to: the one that is viewed as a picture.
    pub(crate) fn pictured(&self) -> ImageLayer {
        let seen = [ImageLayer::Color, ImageLayer::Intensity, ImageLayer::Depth];
        let seen = seen.into_iter().find(|layer| self.layers.contains(layer));
        seen.or(self.layers.first().copied()).unwrap_or(ImageLayer::Depth)
    }

    /// Names of the files of an image.
    pub fn file_names(&self, frame: u32) -> Vec<String> {
        let mut names: Vec<String> = self.layers.iter().map(|&layer| file_name(layer, frame)).collect();
        for style in &self.annotations {
            match style {
                AnnotationStyle::Coco => {}
                AnnotationStyle::Panoptic => names.push(panoptic_name(frame)),
                AnnotationStyle::Voc => names.push(voc_name(self.pictured(), frame)),
            }
        }
        names
    }

    /// Names of the files that cover all images.
    pub fn table_names(&self) -> Vec<String> {
        let tables = [(AnnotationStyle::Coco, "coco.json"), (AnnotationStyle::Panoptic, "panoptic.json")];
        let tables = tables.into_iter().filter(|(style, _)| self.annotations.contains(style)).map(|(_, name)| name);
        tables.chain(["images.json"]).map(str::to_owned).collect()
    }
}

/// `depth_0007.png`.
fn file_name(layer: ImageLayer, frame: u32) -> String {
    format!("{}_{frame:04}.{}", layer.name(), layer.ending())
}

fn panoptic_name(frame: u32) -> String {
    format!("panoptic_{frame:04}.png")
}

fn voc_name(pictured: ImageLayer, frame: u32) -> String {
    format!("{}_{frame:04}.xml", pictured.name())
}

/// Checks, before a long scan, whether images of `sensor` can be written to the folder `folder`, which need not exist.
///
/// # Errors
/// As [`ImageOptions::check`] and [`Instrument::image_grid`]; a folder that can neither be made nor written to.
pub fn check_images(folder: &Path, sensor: &impl Instrument, options: &ImageOptions) -> Result<()> {
    options.check()?;
    sensor.image_grid()?;
    let made = make(folder)?;
    let tried = Pending::create(&folder.join("images.json")).map(drop);
    if made {
        fs::remove_dir(folder).map_err(|source| Error::io(folder, source))?;
    }
    tried
}

/// Makes `folder`; returns whether it did not exist.
fn make(folder: &Path) -> Result<bool> {
    match fs::create_dir(folder) {
        Ok(()) => Ok(true),
        Err(_) if folder.is_dir() => Ok(false),
        Err(source) => Err(Error::io(folder, source)),
    }
}

/// A folder of images of one sensor, frame by frame: `depth_0007.png` and so on, and `images.json` for all of them.
#[derive(Debug)]
pub struct ImageFolder {
    folder: PathBuf,
    options: ImageOptions,
    grid: ImageGrid,
    sensor: String,
    /// The entry of each image in `images.json`.
    frames: Vec<Value>,
    coco: CocoInstances,
    panoptic: Panoptic,
    labels: Arc<model::Labels>,
    files: Vec<PathBuf>,
}

impl ImageFolder {
    /// Begins a folder, which is made if it does not exist.
    ///
    /// # Errors
    /// As [`check_images`].
    pub fn create(folder: impl Into<PathBuf>, sensor: &impl Instrument, options: &ImageOptions) -> Result<ImageFolder> {
        let folder = folder.into();
        options.check()?;
        let grid = sensor.image_grid()?;
        make(&folder)?;
        Ok(ImageFolder {
            folder,
            options: options.clone(),
            grid,
            sensor: sensor.name().to_owned(),
            frames: Vec::new(),
            coco: CocoInstances::default(),
            panoptic: Panoptic::default(),
            labels: Arc::default(),
            files: Vec::new(),
        })
    }

    /// Adds the image of `cloud`, the scan number `frame`, which began at `time`, s; it has the columns
    /// [`ImageOptions::fields`], and for annotations the boxes of `ScanOptions::image_boxes`. Its files appear
    /// under their names when all of them are complete.
    ///
    /// # Errors
    /// As [`RangeImage::new`]; a column that is missing; more labels than a file holds; a full disk.
    pub fn add(&mut self, cloud: &PointCloud, frame: u32, time: f64) -> Result<Report> {
        let mut report = Report::default();
        let image = RangeImage::new(cloud, &self.grid)?;
        let mut pending = Vec::new();
        let mut names = Map::new();
        for &layer in &self.options.layers {
            let name = file_name(layer, frame);
            let file = Pending::create(&self.folder.join(&name))?;
            write_layer(&image, layer, self.options.depth_range_m, file.path(), &mut report)
                .map_err(|error| named_by(error, &self.folder.join(&name)))?;
            names.insert(layer.name().to_owned(), name.into());
            pending.push(file);
        }
        if !self.options.annotations.is_empty() {
            need(&image, &image.category_id, "category_id")?;
            need(&image, &image.instance_id, "instance_id")?;
            let boxes = cloud.boxes.as_deref().unwrap_or_default();
            let found = annotations(&image, boxes);
            let picture = file_name(self.options.pictured(), frame);
            let shown = Shown { image: &image, found: &found, picture: &picture, frame, time };
            for style in &self.options.annotations {
                match style {
                    AnnotationStyle::Coco => self.coco.add(&shown, &masks(&image), &mut report),
                    AnnotationStyle::Panoptic => {
                        let name = panoptic_name(frame);
                        let file = Pending::create(&self.folder.join(&name))?;
                        let pixels = self.panoptic.add(&shown, &name);
                        write_segments(&image, &pixels, file.path())
                            .map_err(|error| named_by(error, &self.folder.join(&name)))?;
                        names.insert("panoptic".to_owned(), name.into());
                        pending.push(file);
                    }
                    AnnotationStyle::Voc => {
                        let pictured = self.options.pictured();
                        let channels = if matches!(pictured, ImageLayer::Color | ImageLayer::Normal) { 3 } else { 1 };
                        let text = voc(&shown, &self.folder_name(), channels);
                        let name = voc_name(pictured, frame);
                        let file = Pending::create(&self.folder.join(&name))?;
                        write::bytes(file.path(), text.as_bytes())
                            .map_err(|source| failed(&self.folder.join(&name), source))?;
                        names.insert("voc".to_owned(), name.into());
                        pending.push(file);
                    }
                }
            }
        }
        write::commit_all(pending)?;
        self.files.extend(names.values().filter_map(Value::as_str).map(|name| self.folder.join(name)));
        self.frames.push(json!({
            "frame": frame,
            "time_s": time,
            "sensor_position": image.sensor_pose.position.to_array(),
            "sensor_orientation_xyzw": image.sensor_pose.orientation.to_array(),
            "files": names,
        }));
        self.labels = image.labels;
        Ok(report)
    }

    fn folder_name(&self) -> String {
        let whole = fs::canonicalize(&self.folder).unwrap_or_else(|_| self.folder.clone());
        whole.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Writes the files that cover all images. Returns every file of the folder that was written.
    ///
    /// # Errors
    /// A full disk.
    pub fn finish(mut self) -> Result<Vec<PathBuf>> {
        let mut tables = Vec::new();
        for style in &self.options.annotations {
            match style {
                AnnotationStyle::Coco => tables.push(("coco.json", self.coco.to_json(&self.labels))),
                AnnotationStyle::Panoptic => tables.push(("panoptic.json", self.panoptic.to_json(&self.labels))),
                AnnotationStyle::Voc => {}
            }
        }
        tables.push(("images.json", self.to_json()));
        let mut pending = Vec::new();
        for (name, text) in tables {
            let path = self.folder.join(name);
            let file = Pending::create(&path)?;
            write::bytes(file.path(), text.as_bytes()).map_err(|source| failed(&path, source))?;
            pending.push(file);
            self.files.push(path);
        }
        write::commit_all(pending)?;
        Ok(self.files)
    }

    /// `images.json`.
    fn to_json(&self) -> String {
        let camera = self.grid.intrinsics.map(
            |Intrinsics { focal, centre, .. }| json!({ "fx": focal[0], "fy": focal[1], "cx": centre[0], "cy": centre[1] }),
        );
        let mut all = Map::new();
        let mut put = |key: &str, value: Value| all.insert(key.to_owned(), value);
        put("sensor", self.sensor.as_str().into());
        put("width", self.grid.width.into());
        put("height", self.grid.height.into());
        put("camera", camera.into());
        let [low, high] = self.options.depth_range_m.unwrap_or(MILLIMETRES);
        put("depth", json!({ "nothing": 0, "1": low, "65535": high, "unit": "m" }));
        for (stem, table) in self.labels.tables() {
            put(&format!("{stem}_ids"), table.ids.as_slice().into());
            put(&format!("{stem}_names"), table.names.as_slice().into());
        }
        put("frames", Value::Array(self.frames.clone()));
        serde_json::Value::Object(all).to_string() + "\n"
    }
}

/// Makes errors of the system refer to the file by its final name.
fn named_by(error: Error, path: &Path) -> Error {
    match error {
        Error::Io { source, .. } => failed(path, source),
        other => other,
    }
}

/// Distances of the values 1 and 65535 in millimetres.
const MILLIMETRES: [f64; 2] = [0.001, 65.535];

/// Writes a layer of `image` to the file `path`, which is not visible to others yet; depths between the distances
/// `range`, m.
///
/// # Errors
/// As [`ImageFolder::add`].
pub fn write_layer(
    image: &RangeImage,
    layer: ImageLayer,
    range: Option<[f64; 2]>,
    path: &Path,
    report: &mut Report,
) -> Result<()> {
    let size = [image.width, image.height];
    let labels = &image.labels;
    let texts = |quantity: &str, values: &str| {
        vec![("quantity".to_owned(), quantity.to_owned()), ("values".to_owned(), values.to_owned())]
    };
    let written = match layer {
        ImageLayer::Depth => {
            let (distance, quantity) = image.distance();
            let [low, high] = range.unwrap_or(MILLIMETRES);
            let texts = texts(quantity, &format!("0 = nothing; 1 to 65535 = {low} to {high} m"));
            grey16(size, texts).write(path, &depths(distance, range, report))
        }
        ImageLayer::Depth32 => {
            let (distance, quantity) = image.distance();
            write_tiff(path, size, distance, &format!("{quantity}, m; NaN = nothing"))
        }
        ImageLayer::Category | ImageLayer::Category16 => {
            return write_mask(image, &image.category_id, (layer, &labels.category), path, report);
        }
        ImageLayer::Part | ImageLayer::Part16 => {
            return write_mask(image, &image.part_id, (layer, &labels.part), path, report);
        }
        ImageLayer::Instance | ImageLayer::Instance16 => {
            return write_mask(image, &image.instance_id, (layer, &labels.instance), path, report);
        }
        ImageLayer::Color => {
            need(image, &image.color, "red, green, blue")?;
            rgb(image, texts("base colour", "sRGB; black = nothing")).write(path, image.color.as_flattened())
        }
        ImageLayer::Intensity => {
            need(image, &image.intensity, "intensity")?;
            let greatest = || image.intensity.iter().copied().fold(0.0, f32::max);
            let full = image.intensity_full_scale.filter(|full| *full > 0.0).unwrap_or_else(greatest);
            let texts = texts("intensity", &format!("0 to 65535 = 0 to {full}; nothing = 0"));
            grey16(size, texts).write(path, &intensities(&image.intensity, full, report))
        }
        ImageLayer::Normal => {
            need(image, &image.normal, "normal_x, normal_y, normal_z")?;
            let byte = |part: f32| (127.5 * (part + 1.0) + 0.5) as u8;
            let color = |normal: &[f32; 3]| if normal[0].is_nan() { [0; 3] } else { normal.map(byte) };
            let pixels: Vec<[u8; 3]> = image.normal.iter().map(color).collect();
            let texts = texts("normal", "red right, green up, blue back: 127.5 (n + 1); black = nothing");
            rgb(image, texts).write(path, pixels.as_flattened())
        }
        ImageLayer::Arrays => write_arrays(image, path, report),
    };
    written.map_err(|source| failed(path, source))
}

/// Writes segments as COCO numbers them, `R + 256 G + 65536 B`.
pub fn write_segments(image: &RangeImage, pixels: &[[u8; 3]], path: &Path) -> Result<()> {
    let texts = vec![("quantity".to_owned(), "segment = R + 256 G + 65536 B".to_owned())];
    rgb(image, texts).write(path, pixels.as_flattened()).map_err(|source| failed(path, source))
}

/// Checks that an image has values that come from the columns `of`.
fn need<T>(image: &RangeImage, values: &[T], of: &str) -> Result<()> {
    if values.len() == image.len() {
        return Ok(());
    }
    Err(Error::invalid("image", format!("of a cloud without {of}"), "one of a cloud with what its layers show"))
}

fn grey16<'p>(size: [usize; 2], texts: Vec<(String, String)>) -> Png<'p> {
    let (color, depth) = (png::ColorType::Grayscale, png::BitDepth::Sixteen);
    Png { size, color, depth, palette: None, texts, fast: true }
}

fn rgb<'p>(image: &RangeImage, texts: Vec<(String, String)>) -> Png<'p> {
    let (color, depth) = (png::ColorType::Rgb, png::BitDepth::Eight);
    Png { size: [image.width, image.height], color, depth, palette: None, texts, fast: true }
}

/// Distances as values of 16 bits, big-endian.
fn depths(distance: &[f32], range: Option<[f64; 2]>, report: &mut Report) -> Vec<u8> {
    let [offset, scale] = match range {
        None => [0.0, 1000.0],
        Some([low, high]) => [1.0 - low * 65534.0 / (high - low), 65534.0 / (high - low)],
    };
    let (mut nearer, mut farther) = (false, false);
    let value = |&distance: &f32| {
        if distance.is_nan() {
            return [0; 2];
        }
        let value = offset + 0.5 + f64::from(distance) * scale;
        nearer |= value < 1.0;
        farther |= value >= 65536.0;
        // A cast saturates.
        (value as u16).max(1).to_be_bytes()
    };
    let bytes = distance.iter().map(value).collect::<Vec<_>>().into_flattened();
    let [low, high] = range.unwrap_or(MILLIMETRES);
    if farther {
        report.warn(format!("depth: distances above {high} m are written as 65535; a depth range covers more"));
    }
    if nearer {
        report.warn(format!("depth: distances below {low} m are written as 1"));
    }
    bytes
}

/// Intensities as values of 16 bits, big-endian; `full` is the greatest.
fn intensities(values: &[f32], full: f32, report: &mut Report) -> Vec<u8> {
    let scale = if full > 0.0 { 65535.0 / full } else { 0.0 };
    let mut above = false;
    let value = |&value: &f32| {
        above |= value > full;
        // No return, NaN, becomes 0.
        ((value * scale + 0.5) as u16).to_be_bytes()
    };
    let bytes = values.iter().map(value).collect::<Vec<_>>().into_flattened();
    if above {
        report.warn(format!("intensity: values above the full scale, {full}, are written as 65535"));
    }
    bytes
}

/// Writes label numbers: with a palette where all of them have 8 bits and the layer does not require 16.
fn write_mask(
    image: &RangeImage,
    ids: &[u32],
    (layer, table): (ImageLayer, &NameTable),
    path: &Path,
    report: &mut Report,
) -> Result<()> {
    let stem = layer.name().trim_end_matches("16");
    need(image, ids, &format!("{stem}_id"))?;
    let seen: BTreeSet<u32> = ids.chunk_by(|a, b| a == b).map(|run| run[0]).filter(|&id| id != 0).collect();
    // The same for all images of a scene.
    let greatest = table.ids.last().copied().max(seen.last().copied()).unwrap_or(0);
    let mut texts = vec![("quantity".to_owned(), stem.to_owned())];
    let values: Vec<(u32, u32)> = if greatest <= u32::from(u16::MAX) {
        seen.iter().map(|&id| (id, id)).collect()
    } else {
        renumbered(&seen, table, stem, report)?
    };
    if greatest > u32::from(u16::MAX) {
        let numbers = values.iter().map(|(id, value)| (value.to_string(), Value::from(*id)));
        texts.push(("numbers".to_owned(), Value::Object(numbers.collect()).to_string()));
    }
    let names = values.iter().map(|(id, value)| (value.to_string(), table.name(*id).unwrap_or_default().into()));
    texts.push(("names".to_owned(), Value::Object(names.collect()).to_string()));
    let of: Option<HashMap<u32, u32>> = (greatest > u32::from(u16::MAX)).then(|| values.into_iter().collect());
    let wide = greatest > u32::from(u8::MAX) || layer.name() != stem;
    let samples = if wide { PixelFormat::Grey16 } else { PixelFormat::Indexed };
    let number = |id: &u32| of.as_ref().map_or(*id, |of| of.get(id).copied().unwrap_or(0));
    write_numbers(image, ids.iter().map(number), samples, texts, path)
}

/// The pixel format of an image of numbers.
#[derive(Clone, Copy, Debug)]
pub enum PixelFormat {
    /// 8 bits, with the colours of Pascal VOC.
    Indexed,
    /// 8 bits, without colours.
    Grey8,
    /// 16 bits.
    Grey16,
}

/// Writes a number for each pixel.
pub fn write_numbers(
    image: &RangeImage,
    numbers: impl Iterator<Item = u32>,
    samples: PixelFormat,
    texts: Vec<(String, String)>,
    path: &Path,
) -> Result<()> {
    let bytes: Vec<u8> = match samples {
        PixelFormat::Grey16 => numbers.flat_map(|number| (number as u16).to_be_bytes()).collect(),
        PixelFormat::Indexed | PixelFormat::Grey8 => numbers.map(|number| number as u8).collect(),
    };
    let grey = grey16([image.width, image.height], texts);
    let (palette, depth) = (palette(), png::BitDepth::Eight);
    let png = match samples {
        PixelFormat::Indexed => Png { color: png::ColorType::Indexed, depth, palette: Some(&palette), ..grey },
        PixelFormat::Grey8 => Png { depth, ..grey },
        PixelFormat::Grey16 => grey,
    };
    png.write(path, &bytes).map_err(|source| failed(path, source))
}

/// Values of 16 bits for numbers that do not fit: indices of all labels in the table, or if these are too many, of
/// those `seen`.
fn renumbered(seen: &BTreeSet<u32>, table: &NameTable, stem: &str, report: &mut Report) -> Result<Vec<(u32, u32)>> {
    let most = usize::from(u16::MAX);
    let place = |id: u32| table.ids.binary_search(&id).ok().map(|place| place as u32 + 1);
    report.warn(format!("{stem}: numbers above {most} renumbered; the text `numbers` of each image lists them"));
    if table.ids.len() <= most
        && let Some(values) = seen.iter().map(|&id| Some((id, place(id)?))).collect()
    {
        return Ok(values);
    }
    if seen.len() > most {
        let found = format!("of {} labels in an image", seen.len());
        return Err(Error::invalid(format!("mask of {stem}"), found, format!("up to {most}, or the layer arrays")));
    }
    Ok(seen.iter().copied().zip(1..).collect())
}

/// Writes everything as arrays of rows and columns.
fn write_arrays(image: &RangeImage, path: &Path, report: &mut Report) -> io::Result<()> {
    let shape = [image.height, image.width];
    let colors = [image.height, image.width, 3];
    let mut file = Archive::create(path)?;
    let columns: [(&str, &[usize], Column); 8] = [
        ("range", &shape, Column::F32(&image.range)),
        ("depth", &shape, Column::F32(&image.depth)),
        ("category_id", &shape, Column::U32(&image.category_id)),
        ("part_id", &shape, Column::U32(&image.part_id)),
        ("instance_id", &shape, Column::U32(&image.instance_id)),
        ("intensity", &shape, Column::F32(&image.intensity)),
        ("color", &colors, Column::U8(image.color.as_flattened())),
        ("normal", &colors, Column::F32(image.normal.as_flattened())),
    ];
    for (name, shape, column) in columns {
        if !column.is_empty() {
            file.column(name, shape, column)?;
        }
    }
    if let Some(camera) = image.intrinsics {
        file.column("camera_matrix", &[3, 3], Column::F64(camera.matrix().as_flattened()))?;
    }
    let pose = image.sensor_pose;
    file.column("sensor_position", &[3], Column::F64(&pose.position.to_array()))?;
    file.column("sensor_orientation_xyzw", &[4], Column::F64(&pose.orientation.to_array()))?;
    file.names(&image.labels, report)?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::range_image::tests::wall;
    use crate::test_sensor::TestSensor;
    use ground::write::sink;

    /// Everything but parts, which the wall does not have.
    fn options() -> ImageOptions {
        use ImageLayer::{Arrays, Category, Color, Depth, Depth32, Instance, Intensity, Normal};
        ImageOptions {
            layers: vec![Depth, Depth32, Category, Instance, Color, Intensity, Normal, Arrays],
            depth_range_m: None,
            annotations: vec![AnnotationStyle::Coco, AnnotationStyle::Panoptic, AnnotationStyle::Voc],
        }
    }

    #[test]
    fn names_of_files_are_known_before() {
        let folder = tempfile::tempdir().unwrap();
        let (camera, options) = (TestSensor::camera(), options());
        check_images(&folder.path().join("a"), &camera, &options).unwrap();
        assert!(!folder.path().join("a").exists());
        let mut images = ImageFolder::create(folder.path().join("a"), &camera, &options).unwrap();
        images.add(&wall(camera.beams()), 12345, 0.5).unwrap();
        let mut written = images.finish().unwrap();
        let names = options.file_names(12345).into_iter().chain(options.table_names());
        let mut names: Vec<PathBuf> = names.map(|name| folder.path().join("a").join(name)).collect();
        written.sort();
        names.sort();
        assert_eq!(written, names);
        assert!(names.iter().all(|name| name.exists()));
    }

    #[test]
    fn a_full_disk_leaves_no_part_of_an_image() {
        let folder = tempfile::tempdir().unwrap();
        let (camera, options) = (TestSensor::camera(), options());
        let cloud = wall(camera.beams());
        let mut images = ImageFolder::create(folder.path(), &camera, &options).unwrap();
        let mut added = |writes| {
            sink::full_disk::WRITES.set(writes);
            let added = images.add(&cloud, 0, 0.0);
            sink::full_disk::WRITES.set(usize::MAX);
            added
        };
        let there = || fs::read_dir(folder.path()).unwrap().count();
        let failed = (0..100).take_while(|&writes| added(writes).is_err() && there() == 0).count();
        assert!((5..100).contains(&failed) && there() == options.file_names(0).len(), "{failed} {}", there());
    }

    #[test]
    fn what_is_too_far_or_too_near_is_reported() {
        let values = |distance: &[f32], range| {
            let mut report = Report::default();
            let bytes = depths(distance, range, &mut report);
            let values: Vec<u16> = bytes.chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
            (values, report.warnings.len())
        };
        assert_eq!(values(&[f32::NAN, 0.001, 1.2345, 65.535], None), (vec![0, 1, 1235, 65535], 0));
        assert_eq!(values(&[65.6, 0.0002, f32::INFINITY], None), (vec![65535, 1, 65535], 2));
        assert_eq!(values(&[1.0, 3.0, 2.0], Some([1.0, 3.0])), (vec![1, 65535, 32768], 0));
        assert_eq!(values(&[0.9, 3.1], Some([1.0, 3.0])), (vec![1, 65535], 2));
        let mut report = Report::default();
        assert_eq!(
            intensities(&[f32::NAN, 0.0, 0.5, 1.0, 2.0], 1.0, &mut report),
            [0, 0, 0, 0, 128, 0, 255, 255, 255, 255]
        );
        assert_eq!(report.warnings.len(), 1);
    }

    #[test]
    fn layers_of_missing_columns_and_wrong_options_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let camera = TestSensor::camera();
        let with =
            |layers: &[ImageLayer], depth_range_m| ImageOptions { layers: layers.to_vec(), depth_range_m, ..options() };
        let options = with(&[ImageLayer::Part], None);
        let mut images = ImageFolder::create(folder.path(), &camera, &options).unwrap();
        let error = images.add(&wall(camera.beams()), 0, 0.0).unwrap_err().to_string();
        assert!(error.contains("without part_id"), "{error}");
        for (layers, range) in [
            (&[][..], None),
            (&[ImageLayer::Depth, ImageLayer::Color, ImageLayer::Depth], None),
            (&[ImageLayer::Depth], Some([2.0, 2.0])),
            (&[ImageLayer::Depth], Some([-1.0, 2.0])),
            (&[ImageLayer::Depth], Some([1.0, f64::NAN])),
            (&[ImageLayer::Depth], Some([1.0, f64::INFINITY])),
        ] {
            assert!(check_images(folder.path(), &camera, &with(layers, range)).is_err(), "{layers:?} {range:?}");
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn too_many_labels_for_16_bits_are_numbered_by_image() {
        let mut report = Report::default();
        let ids: Vec<u32> = (1..=70_000).collect();
        let names = vec![String::new(); ids.len()];
        let table = NameTable { ids, names };
        let seen: BTreeSet<u32> = [5, 69_999, 70_000].into();
        assert_eq!(renumbered(&seen, &table, "part", &mut report).unwrap(), [(5, 1), (69_999, 2), (70_000, 3)]);
        // Few labels with large numbers have the same index in all images.
        let few = NameTable { ids: vec![5, 9, 70_000], names: vec![String::new(); 3] };
        assert_eq!(renumbered(&[5, 70_000].into(), &few, "part", &mut report).unwrap(), [(5, 1), (70_000, 3)]);
        let all: BTreeSet<u32> = (1..=70_000).collect();
        let error = renumbered(&all, &table, "part", &mut report).unwrap_err().to_string();
        assert!(error.contains("70000 labels"), "{error}");
    }
}
