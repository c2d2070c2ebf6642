//! All styles in which samples are written, and those that a scenario selects.

use super::coco::Coco;
use super::kitti::Kitti;
use super::nuscenes::NuScenes;
use super::plain::Plain;
use super::semantic_kitti::SemanticKitti;
use super::style::Style;
use super::voc::Voc;
use super::webdataset::WebDataset;
use ground::error::{Error, Result, nearest};
use ground::read::yaml::Document;
use serde::de::DeserializeOwned;
use serde_json::Value;

type ReadKeys = fn(&Document, &str, &Value) -> Result<Box<dyn Style>>;

/// All styles.
const STYLES: &[(&str, ReadKeys)] = &[
    ("plain", keys::<Plain>),
    ("semantic_kitti", keys::<SemanticKitti>),
    ("kitti", keys::<Kitti>),
    ("nuscenes", keys::<NuScenes>),
    ("webdataset", keys::<WebDataset>),
    ("coco", keys::<Coco>),
    ("voc", keys::<Voc>),
];

/// Names of all styles.
pub(super) fn names() -> impl Iterator<Item = &'static str> + Clone {
    STYLES.iter().map(|(name, _)| *name)
}

/// The style of the files that `echocast scan` reports.
const FILES: &str = "files";

fn keys<S: Style + DeserializeOwned + 'static>(document: &Document, key: &str, keys: &Value) -> Result<Box<dyn Style>> {
    Ok(Box::new(document.read_at::<S>(key, keys)?))
}

/// The styles of the section `outputs` of `document`; plain, if it names none.
///
/// # Errors
/// An unknown style or key.
pub(super) fn all(outputs: &[Value], document: &Document) -> Result<Vec<Box<dyn Style>>> {
    if outputs.is_empty() {
        return Ok(vec![Box::new(Plain::default())]);
    }
    let mut all: Vec<Box<dyn Style>> = Vec::new();
    for (index, output) in outputs.iter().enumerate() {
        let key = format!("outputs[{index}]");
        let mut keys = output.clone();
        let name = keys.as_object_mut().and_then(|keys| keys.shift_remove("style"));
        let Some(name) = name.as_ref().and_then(Value::as_str) else {
            return Err(document.error(&key, "the key `style` is missing"));
        };
        let Some((_, read)) = STYLES.iter().find(|(known, _)| *known == name) else {
            let message = if name == FILES {
                let allowed = names().collect::<Vec<_>>().join(", ");
                format!("writes the files of one sample; allowed in a set: {allowed}")
            } else {
                let near = nearest(name, names().chain([FILES]));
                let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
                let allowed = names().chain([FILES]).collect::<Vec<_>>().join(", ");
                format!("unknown value {name:?}{near}; allowed: {allowed}")
            };
            return Err(document.error(&format!("{key}.style"), &message));
        };
        let style = read(document, &key, &keys)?;
        style.check().map_err(|error| match error {
            Error::InvalidParameter { name, value, allowed } => {
                document.error(&format!("{key}.{name}"), &format!("is {value}; allowed: {allowed}"))
            }
            other => other,
        })?;
        if all.iter().any(|other| other.root() == style.root()) {
            return Err(document.error(&key, "is of the same style as one before it; allowed: each style once"));
        }
        all.push(style);
    }
    Ok(all)
}
