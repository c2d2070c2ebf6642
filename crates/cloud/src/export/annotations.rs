//! What images show of each instance, in the formats of COCO and Pascal VOC.

use crate::image::{Annotation, RangeImage, Runs, runs_text};
use ground::report::Report;
use model::Labels;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;

/// An image and what it shows.
pub struct Shown<'s> {
    /// Its pixels, with the labels of what each shows.
    pub image: &'s RangeImage,
    /// What it shows of each instance that is to be annotated.
    pub found: &'s [Annotation],
    /// Name of the image file that the annotations refer to.
    pub picture: &'s str,
    /// Frame index of the scan.
    pub frame: u32,
    /// s.
    pub time: f64,
}

/// COCO's instances (cocodataset.org, data format), image by image; one per line, for files of any length.
#[derive(Debug, Default)]
pub(crate) struct CocoInstances {
    images: Vec<String>,
    annotations: Vec<String>,
}

impl CocoInstances {
    /// Adds an image with the pixels of its instances.
    pub fn add(&mut self, shown: &Shown, masks: &HashMap<u32, Runs>, report: &mut Report) {
        let image = self.images.len() + 1;
        self.images.push(line(&[("id", image.into())], image_keys(shown)));
        for keys in instances(shown, masks, report) {
            let number = self.annotations.len() + 1;
            self.annotations.push(line(&[("id", number.into()), ("image_id", image.into())], keys));
        }
    }

    /// The file.
    pub fn to_json(&self, labels: &Labels) -> String {
        table(&list(&self.images), &list(&self.annotations), &categories(labels.category.iter(), false))
    }
}

/// COCO's panoptic segmentation: every pixel with a label belongs to one segment.
#[derive(Debug, Default)]
pub struct Panoptic {
    images: Vec<String>,
    annotations: Vec<String>,
}

impl Panoptic {
    /// Adds an image, whose segments are in the file `name`; returns its pixels.
    pub fn add(&mut self, shown: &Shown, name: &str) -> Vec<[u8; 3]> {
        let image = self.images.len() + 1;
        self.images.push(line(&[("id", image.into())], image_keys(shown)));
        let (keys, pixels) = segments(shown, name);
        self.annotations.push(line(&[("image_id", image.into())], keys));
        pixels
    }

    /// The file.
    pub fn to_json(&self, labels: &Labels) -> String {
        table(&list(&self.images), &list(&self.annotations), &categories(labels.category.iter(), true))
    }
}

/// A file of `images` and `annotations`, lists that are already JSON.
fn table(images: &str, annotations: &str, categories: &[String]) -> String {
    format!(
        "{{\n\"info\": {},\n\"licenses\": [],\n\"images\": {images},\n\"annotations\": {annotations},\n\
         \"categories\": {}\n}}\n",
        info(),
        list(categories)
    )
}

/// Information on the file and its creator.
pub fn info() -> Value {
    json!({ "description": "Simulated images", "version": "1.0", "contributor": contributor() })
}

/// One element per line.
fn list(elements: &[String]) -> String {
    if elements.is_empty() { "[]".to_owned() } else { format!("[\n{}\n]", elements.join(",\n")) }
}

/// An object of its numbers and further keys.
pub fn line(numbers: &[(&str, Value)], keys: Map<String, Value>) -> String {
    let numbers = numbers.iter().map(|(key, value)| ((*key).to_owned(), value.clone()));
    Value::Object(numbers.chain(keys).collect()).to_string()
}

/// The keys of an image in COCO, except its number.
pub fn image_keys(shown: &Shown) -> Map<String, Value> {
    let mut keys = Map::new();
    let mut put = |key: &str, value: Value| keys.insert(key.to_owned(), value);
    put("file_name", shown.picture.into());
    put("width", shown.image.width.into());
    put("height", shown.image.height.into());
    put("frame", shown.frame.into());
    put("time_s", shown.time.into());
    keys
}

/// The keys of the instances of an image in COCO, except numbers.
pub fn instances(
    shown: &Shown,
    masks: &HashMap<u32, Runs>,
    report: &mut Report,
) -> impl Iterator<Item = Map<String, Value>> {
    if shown.found.iter().any(|found| found.category_id == 0) {
        report.warn("annotations: instances without a category left out");
    }
    shown.found.iter().filter(|found| found.category_id != 0).map(|found| {
        let counts = masks.get(&found.instance_id).map(|runs| runs_text(runs)).unwrap_or_default();
        let mut keys = instance_keys(found, &shown.image.labels);
        let mask = json!({ "size": [shown.image.height, shown.image.width], "counts": counts });
        keys.insert("segmentation".to_owned(), mask);
        keys
    })
}

/// The segments of an image in the file `name`, and its pixels: the number of the segment of each,
/// `R + 256 G + 65536 B`.
pub fn segments(shown: &Shown, name: &str) -> (Map<String, Value>, Vec<[u8; 3]>) {
    let RangeImage { instance_id, category_id, width, .. } = shown.image;
    let known: Vec<&Annotation> = shown.found.iter().filter(|found| found.category_id != 0).collect();
    let most = known.last().map_or(0, |found| found.instance_id);
    // Numbers that do not fit into three bytes are replaced by the index of the instance in the image.
    let fits = most < (1 << 24) - (1 << 16);
    let numbers = known.iter().zip(1..).map(|(found, place)| {
        let id = found.instance_id;
        (id, if fits { id } else { place })
    });
    let of: HashMap<u32, u32> = numbers.collect();
    let free = if fits { most } else { known.len() as u32 };
    // Pixels with a category and no instance form a segment of that category.
    let mut rest: BTreeMap<u32, StuffSegment> = BTreeMap::new();
    let mut pixels = Vec::with_capacity(instance_id.len());
    for (pixel, (instance, &category)) in instance_id.iter().zip(category_id).enumerate() {
        let segment = match of.get(instance) {
            Some(&number) => number,
            None if category == 0 => 0,
            None => {
                let number = free + 1 + rest.len() as u32;
                let place = [(pixel % width) as u32, (pixel / width) as u32];
                let rest = rest.entry(category).or_insert(StuffSegment { number, low: place, high: place, area: 0 });
                rest.low = [0, 1].map(|axis| rest.low[axis].min(place[axis]));
                rest.high = [0, 1].map(|axis| rest.high[axis].max(place[axis]));
                rest.area += 1;
                rest.number
            }
        };
        let [red, green, blue, _] = segment.to_le_bytes();
        pixels.push([red, green, blue]);
    }
    let things = known.iter().map(|found| {
        let mut keys = instance_keys(found, &shown.image.labels);
        keys.insert("id".to_owned(), of[&found.instance_id].into());
        Value::Object(keys)
    });
    let rest = rest.iter().map(|(category, StuffSegment { number, low, high, area })| {
        let bounds = [low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1];
        json!({ "category_id": category, "bbox": bounds, "area": area, "iscrowd": 0, "id": number })
    });
    let mut keys = Map::new();
    keys.insert("file_name".to_owned(), name.into());
    keys.insert("segments_info".to_owned(), things.chain(rest).collect());
    (keys, pixels)
}

/// Pixels of a category without an instance.
struct StuffSegment {
    /// Number of its segment.
    number: u32,
    /// First and last column and row.
    low: [u32; 2],
    high: [u32; 2],
    area: u32,
}

fn contributor() -> String {
    format!("echocast {}", env!("CARGO_PKG_VERSION"))
}

/// The keys common to both: boxes, how much of the instance is visible, and its names.
fn instance_keys(found: &Annotation, labels: &Labels) -> Map<String, Value> {
    let mut keys = Map::new();
    let mut put = |key: &str, value: Value| keys.insert(key.to_owned(), value);
    put("category_id", found.category_id.into());
    put("bbox", found.bounds.as_slice().into());
    put("area", found.area.into());
    put("iscrowd", 0.into());
    put("instance_id", found.instance_id.into());
    put("instance", labels.instance.name(found.instance_id).unwrap_or_default().into());
    if let Some([left, top, right, bottom]) = found.amodal {
        put("amodal_bbox", [left, top, right - left, bottom - top].map(rounded).as_slice().into());
    }
    if let Some(truncation) = found.truncation {
        put("truncation", rounded(truncation).into());
    }
    if let Some(occlusion) = found.occlusion {
        put("occlusion", rounded(occlusion).into());
    }
    keys
}

/// Rounds to a thousandth, of a pixel or of a whole.
fn rounded(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0 + 0.0
}

/// Categories as COCO lists them, for panoptic segmentation or not.
pub fn categories<'c>(all: impl Iterator<Item = (u32, &'c str)>, panoptic: bool) -> Vec<String> {
    let one = |(id, name): (u32, &str)| {
        let mut keys = Map::new();
        keys.insert("name".to_owned(), name.into());
        keys.insert("supercategory".to_owned(), "object".into());
        if panoptic {
            keys.insert("isthing".to_owned(), 1.into());
        }
        line(&[("id", id.into())], keys)
    };
    all.map(one).collect()
}

/// Fraction of the area of the amodal box outside the image, and hidden fraction of an object, above which it counts as
/// truncated and as occluded (guidelines of VOC2012: 15 to 20 %, and 5 %).
const TRUNCATED: f64 = 0.15;
const OCCLUDED: f64 = 0.05;

/// What an image in `folder` with this number of `channels` shows, in the format of Pascal VOC. Pixels count from 1;
/// boxes include their last pixel.
pub fn voc(shown: &Shown, folder: &str, channels: u32) -> String {
    let (image, labels) = (shown.image, &shown.image.labels);
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "<annotation>\n  <folder>{}</folder>\n  <filename>{}</filename>\n  \
         <source>\n    <database>{}</database>\n  </source>\n  <size>\n    <width>{}</width>\n    \
         <height>{}</height>\n    <depth>{}</depth>\n  </size>\n  <segmented>1</segmented>",
        escaped(folder),
        escaped(shown.picture),
        escaped(&contributor()),
        image.width,
        image.height,
        channels,
    );
    for found in shown.found.iter().filter(|found| found.category_id != 0) {
        let name = labels.category.name(found.category_id).unwrap_or_default();
        let [left, top, width, height] = found.bounds;
        let flag = |value: Option<f64>, least: f64| u8::from(value.is_some_and(|value| value > least));
        let _ = writeln!(
            text,
            "  <object>\n    <name>{}</name>\n    <pose>Unspecified</pose>\n    <truncated>{}</truncated>\n    \
             <occluded>{}</occluded>\n    <difficult>0</difficult>\n    <bndbox>\n      <xmin>{}</xmin>\n      \
             <ymin>{}</ymin>\n      <xmax>{}</xmax>\n      <ymax>{}</ymax>\n    </bndbox>\n    <instance>{}</instance>",
            escaped(name),
            flag(found.truncation, TRUNCATED),
            flag(found.occlusion, OCCLUDED),
            left + 1,
            top + 1,
            left + width,
            top + height,
            found.instance_id,
        );
        if let Some([left, top, right, bottom]) = found.amodal {
            let [left, top, right, bottom] = [left + 1.0, top + 1.0, right, bottom].map(rounded);
            let _ = writeln!(
                text,
                "    <amodal>\n      <xmin>{left}</xmin>\n      <ymin>{top}</ymin>\n      <xmax>{right}</xmax>\n      \
                 <ymax>{bottom}</ymax>\n    </amodal>",
            );
        }
        for (key, value) in [("truncation", found.truncation), ("occlusion", found.occlusion)] {
            if let Some(value) = value {
                let _ = writeln!(text, "    <{key}>{}</{key}>", rounded(value));
            }
        }
        text.push_str("  </object>\n");
    }
    text.push_str("</annotation>\n");
    text
}

/// Text between tags; characters that XML 1.0 cannot hold become the replacement character.
fn escaped(text: &str) -> String {
    let mut all = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => all.push_str("&amp;"),
            '<' => all.push_str("&lt;"),
            '>' => all.push_str("&gt;"),
            '\t' | '\n' => all.push(letter),
            // A reader would turn it into a line feed.
            '\r' => all.push_str("&#13;"),
            '\0'..'\u{20}' | '\u{fffe}' | '\u{ffff}' => all.push('\u{fffd}'),
            _ => all.push(letter),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped() {
        assert_eq!(escaped("a<b> & \u{1}\"ü'\r\n"), "a&lt;b&gt; &amp; \u{fffd}\"ü'&#13;\n");
    }
}
