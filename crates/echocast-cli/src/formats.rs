//! `echocast formats`

use crate::text;
use anyhow::Result;
use clap::builder::StyledStr;
use echocast::cloud::FIELDS;
use echocast::export::Format;
use echocast::{export, import, scene};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// List the input and output formats and what each can hold
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  echocast formats\n  echocast formats --json")]
pub struct FormatsArgs {
    /// Print one JSON object with the lists scenes, clouds, clouds_read, pictures, pings and radars
    #[arg(long)]
    json: bool,
}

/// Name, endings and description of a format.
type FormatRow = (&'static str, &'static [&'static str], &'static str);

const PICTURES: [FormatRow; 1] = [("png", &["png"], "RGB picture with legend")];
const RADARS: [FormatRow; 5] = [
    ("npz", &["npz"], "arrays: cube, samples, polar image"),
    ("hdf5", &["h5", "hdf5"], "one dataset per array, with unit and meaning"),
    ("dca1000", &["bin"], "frames only: samples as TI's capture card stores them"),
    ("nuscenes", &["pcd"], "detections only: PCD of nuScenes"),
    ("vod", &["bin"], "detections only: View-of-Delft"),
];
const PINGS: [FormatRow; 5] = [
    ("npz", &["npz"], "arrays, including labels"),
    ("hdf5", &["h5", "hdf5"], "one dataset per array, with unit and meaning"),
    ("xtf", &["xtf"], "pings only: samples of side-scan sonars or soundings of swath sonars, without labels"),
    ("kmall", &["kmall"], "pings only: soundings and water columns of swath sonars, without labels"),
    ("png", &["png"], "images only: greyscale, labels in files beside it"),
];

pub fn run(args: &FormatsArgs) -> Result<()> {
    if args.json { text::print_json(&to_json()) } else { text::print(&list()?) }
}

fn list() -> Result<String> {
    let mut list = String::from("Scenes are read from\n");
    for format in scene::FORMATS {
        row(&mut list, (format.name, format.extensions, format.description))?;
    }
    list.push_str("\nClouds are written as\n");
    for format in export::FORMATS {
        row(&mut list, (format.name(), format.info().extensions, format.info().description))?;
        let lost = lost(*format);
        if !lost.is_empty() {
            writeln!(list, "{:23}cannot hold {}", "", lost.join(", "))?;
        }
        if !format.info().holds_label_names {
            writeln!(list, "{:23}label names are in a file beside it, NAME.labels.json", "")?;
        }
    }
    list.push_str("\nClouds are read (convert, info, preview) from\n");
    for reader in import::READERS {
        row(&mut list, (reader.name, reader.extensions, reader.description))?;
    }
    list.push_str("\nPictures (--preview) are written as\n");
    PICTURES.iter().try_for_each(|&format| row(&mut list, format))?;
    list.push_str("\nSonar pings (--pings) and their images (--image) are written as\n");
    PINGS.iter().try_for_each(|&format| row(&mut list, format))?;
    list.push_str("\nFrames of radars (--radar) and their detections (--detections) are written as\n");
    RADARS.iter().try_for_each(|&format| row(&mut list, format))?;
    Ok(list)
}

fn row(list: &mut String, (name, extensions, description): FormatRow) -> Result<()> {
    let endings: Vec<String> = extensions.iter().map(|ending| format!(".{ending}")).collect();
    Ok(writeln!(list, "  {name:<7} {:<12} {description}", endings.join(" "))?)
}

/// Columns that `format` cannot hold.
fn lost(format: &dyn Format) -> Vec<&'static str> {
    FIELDS.iter().filter(|info| !format.holds(info)).map(|info| info.name).collect()
}

fn to_json() -> Value {
    let plain = |(name, extensions, description): FormatRow| {
        json!({
            "name": name,
            "extensions": extensions,
            "description": description,
        })
    };
    let scenes = scene::FORMATS.iter().map(|format| plain((format.name, format.extensions, format.description)));
    let clouds = export::FORMATS.iter().map(|format| {
        let mut cloud = plain((format.name(), format.info().extensions, format.info().description));
        cloud["cannot_hold"] = json!(lost(*format));
        cloud["label_names"] = json!(format.info().holds_label_names);
        cloud
    });
    let readers = import::READERS.iter().map(|reader| plain((reader.name, reader.extensions, reader.description)));
    json!({
        "scenes": scenes.collect::<Vec<_>>(),
        "clouds": clouds.collect::<Vec<_>>(),
        "clouds_read": readers.collect::<Vec<_>>(),
        "pictures": PICTURES.map(plain),
        "pings": PINGS.map(plain),
        "radars": RADARS.map(plain),
    })
}

/// The columns, one per line, for the help of `--fields`.
pub fn column_help() -> StyledStr {
    let mut help = String::from(
        "Columns to compute and write: names separated by commas, `default` or `all`\n\n* = written by \
         default; for sonars, also cause:\n",
    );
    for info in FIELDS {
        let mark = if info.default { "*" } else { " " };
        let unit = match info.unit {
            "" | "1" => String::new(),
            unit => format!(" [{unit}]"),
        };
        help.push_str(&format!("{mark} {:<14} {}{unit}\n", info.name, info.meaning));
    }
    help.truncate(help.trim_end().len());
    help.into()
}
