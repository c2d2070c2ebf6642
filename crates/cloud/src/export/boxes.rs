//! Boxes around instances: as separate JSON and CSV files, and as columns of files of arrays.

use crate::{Column, InstanceBox};
use ground::error::{Error, Result};
use ground::read::ending;
use ground::shown;
use ground::write::{self, Pending, failed};
use model::Labels;
use serde_json::{Map, Value};
use std::path::Path;

/// A property of boxes that files hold.
pub(super) struct BoxColumn {
    pub name: &'static str,
    /// SI unit, `1` for ratios, empty for counts and ids.
    pub unit: &'static str,
    #[cfg_attr(not(feature = "hdf5"), allow(dead_code))] // only HDF5 holds it
    pub meaning: &'static str,
    pub values: BoxValues,
}

pub(super) enum BoxValues {
    Number(fn(&InstanceBox) -> u32),
    Quantity(fn(&InstanceBox) -> f64),
    /// x, y, z.
    Vector(fn(&InstanceBox) -> [f64; 3]),
    /// x, y, z, w.
    Quaternion(fn(&InstanceBox) -> [f64; 4]),
}

/// All of them, in the order of the files; in files of arrays their names are prefixed with `boxes/`.
pub(super) const COLUMNS: [BoxColumn; 11] = [
    column("frame", "", "index of the frame", BoxValues::Number(|b| b.frame)),
    column("time", "s", "time at which the box is valid", BoxValues::Quantity(|b| b.time)),
    column("track_id", "", "object over all frames", BoxValues::Number(|b| b.track_id)),
    column("instance_id", "", "object", BoxValues::Number(|b| b.instance_id)),
    column("category_id", "", "category, 0 = unlabelled", BoxValues::Number(|b| b.category_id)),
    column("position", "m", "centre of the box", BoxValues::Vector(|b| b.pose.position.to_array())),
    column("size", "m", "lengths along its axes", BoxValues::Vector(|b| b.size.to_array())),
    column(
        "orientation_xyzw",
        "",
        "rotation from its axes to the frame of the points",
        BoxValues::Quaternion(|b| b.pose.orientation.to_array()),
    ),
    column("velocity", "m/s", "velocity of its centre over the ground", BoxValues::Vector(|b| b.velocity.to_array())),
    column("points", "", "number of returns on the object", BoxValues::Number(|b| b.points)),
    column("visible", "1", "fraction of the beams towards it that hit it", BoxValues::Quantity(|b| b.visible)),
];

const fn column(name: &'static str, unit: &'static str, meaning: &'static str, values: BoxValues) -> BoxColumn {
    BoxColumn { name, unit, meaning, values }
}

/// Numbers of all boxes.
pub(super) enum Numbers {
    U32(Vec<u32>),
    F64(Vec<f64>),
}

impl Numbers {
    pub(super) fn column(&self) -> Column<'_> {
        match self {
            Numbers::U32(values) => Column::U32(values),
            Numbers::F64(values) => Column::F64(values),
        }
    }
}

impl BoxColumn {
    /// How many numbers a box has in the column; `None`: one, in arrays of one dimension.
    pub(super) fn width(&self) -> Option<usize> {
        match self.values {
            BoxValues::Number(_) | BoxValues::Quantity(_) => None,
            BoxValues::Vector(_) => Some(3),
            BoxValues::Quaternion(_) => Some(4),
        }
    }

    /// Shape of the array of `count` boxes.
    pub(super) fn shape(&self, count: usize) -> Vec<usize> {
        [count].into_iter().chain(self.width()).collect()
    }

    /// The column's numbers, box by box.
    pub(super) fn numbers(&self, boxes: &[InstanceBox]) -> Numbers {
        match self.values {
            BoxValues::Number(of) => Numbers::U32(boxes.iter().map(of).collect()),
            BoxValues::Quantity(of) => Numbers::F64(boxes.iter().map(of).collect()),
            BoxValues::Vector(of) => Numbers::F64(boxes.iter().flat_map(of).collect()),
            BoxValues::Quaternion(of) => Numbers::F64(boxes.iter().flat_map(of).collect()),
        }
    }
}

/// Endings of files of boxes.
const ENDINGS: &[&str] = &["json", "csv"];

/// Checks, before a long scan, whether boxes can be written to `path`.
///
/// # Errors
/// Another ending than `.json` and `.csv`; a missing folder or one that cannot be written to.
pub fn check_boxes(path: &Path) -> Result<()> {
    check_ending(path)?;
    Pending::create(path).map(drop)
}

fn check_ending(path: &Path) -> Result<()> {
    if ENDINGS.contains(&&*ending(path)) {
        return Ok(());
    }
    Err(Error::Unsupported {
        what: format!("the ending of the output file {}", shown::path(path)),
        instead: "boxes are written as .json, .csv".to_owned(),
    })
}

/// Writes `boxes` to `path`: as JSON (`.json`), a list of objects, or CSV (`.csv`), a row for each. `labels` name their
/// categories and instances. The file appears under its name only when it is complete.
///
/// # Errors
/// As [`check_boxes`], a full disk, and a set [`write::cancel_flag`](ground::write::cancel_flag).
pub fn write_boxes(boxes: &[InstanceBox], labels: &Labels, path: &Path) -> Result<()> {
    check_ending(path)?;
    let pending = Pending::create(path)?;
    let text = if ending(path) == "json" { json(boxes, labels) } else { csv(boxes, labels) };
    write::bytes(pending.path(), text.as_bytes()).map_err(|source| failed(path, source))?;
    pending.commit()
}

/// Names of category and instance; empty if they have none.
fn names<'a>(found: &InstanceBox, labels: &'a Labels) -> [(&'static str, &'a str); 2] {
    let category = labels.category.name(found.category_id).unwrap_or_default();
    [("category", category), ("instance", labels.instance.name(found.instance_id).unwrap_or_default())]
}

/// One box a line.
fn json(boxes: &[InstanceBox], labels: &Labels) -> String {
    let lines = boxes.iter().map(|found| {
        let numbers = COLUMNS.iter().map(|column| {
            let value = match column.values {
                BoxValues::Number(of) => of(found).into(),
                BoxValues::Quantity(of) => of(found).into(),
                BoxValues::Vector(of) => of(found).as_slice().into(),
                BoxValues::Quaternion(of) => of(found).as_slice().into(),
            };
            (column.name.to_owned(), value)
        });
        let names = names(found, labels).map(|(name, value)| (name.to_owned(), value.into()));
        Value::Object(numbers.chain(names).collect::<Map<_, _>>()).to_string()
    });
    format!("[\n{}\n]\n", lines.collect::<Vec<_>>().join(",\n"))
}

/// A header, in which names end with their units, and a row for each box.
fn csv(boxes: &[InstanceBox], labels: &Labels) -> String {
    let mut header: Vec<String> = Vec::new();
    for BoxColumn { name, unit, values, .. } in &COLUMNS {
        let unit = match *unit {
            "" | "1" => String::new(),
            unit => format!("_{}", unit.replace('/', "_")),
        };
        match values {
            BoxValues::Number(_) | BoxValues::Quantity(_) => header.push(format!("{name}{unit}")),
            BoxValues::Vector(_) => header.extend(["x", "y", "z"].map(|axis| format!("{name}_{axis}{unit}"))),
            BoxValues::Quaternion(_) => {
                let stem = name.trim_end_matches("_xyzw");
                header.extend(["x", "y", "z", "w"].map(|axis| format!("{stem}_{axis}{unit}")));
            }
        }
    }
    header.extend(["category", "instance"].map(str::to_owned));
    let mut text = header.join(",") + "\n";
    for found in boxes {
        let mut row: Vec<String> = Vec::with_capacity(header.len());
        for column in &COLUMNS {
            match column.values {
                BoxValues::Number(of) => row.push(of(found).to_string()),
                BoxValues::Quantity(of) => row.push(of(found).to_string()),
                BoxValues::Vector(of) => row.extend(of(found).map(|value| value.to_string())),
                BoxValues::Quaternion(of) => row.extend(of(found).map(|value| value.to_string())),
            }
        }
        row.extend(names(found, labels).map(|(_, name)| quoted(name)));
        text.push_str(&row.join(","));
        text.push('\n');
    }
    text
}

/// A name as a CSV cell, in quotes where it needs them (RFC 4180).
fn quoted(name: &str) -> String {
    if name.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_owned() }
}
