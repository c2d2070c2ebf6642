//! `echocast formats`

use crate::text;
use anyhow::Result;
use clap::builder::StyledStr;
use echocast::cloud::FIELDS;
use echocast::{export, scene};
use std::fmt::Write as _;

/// List the input and output formats and what each can hold
#[derive(clap::Args)]
#[command(after_help = "Example:\n  echocast formats")]
pub struct Args {}

pub fn run() -> Result<()> {
    let mut list = String::from("Scenes are read from\n");
    for format in scene::FORMATS {
        row(&mut list, format.name, format.extensions, format.description);
    }
    list.push_str("\nClouds are written as\n");
    for format in export::FORMATS {
        row(&mut list, format.name(), format.extensions(), format.description());
        let lost: Vec<&str> = FIELDS.iter().filter(|info| !format.holds(info)).map(|info| info.name).collect();
        if !lost.is_empty() {
            writeln!(list, "{:23}cannot hold {}", "", lost.join(", "))?;
        }
        if !format.holds_label_names() {
            writeln!(list, "{:23}label names are beside it, in NAME.labels.json", "")?;
        }
    }
    list.push_str("\nPictures (--preview) are written as\n");
    row(&mut list, "png", &["png"], "RGB picture with legend");
    list.push_str("\nSonar pings (--pings) and their images (--image) are written as\n");
    row(&mut list, "npz", &["npz"], "arrays, including labels");
    row(&mut list, "hdf5", &["h5", "hdf5"], "one dataset per array, with unit and meaning");
    row(&mut list, "png", &["png"], "images only: greyscale, labels in files beside it");
    text::print(&list)
}

fn row(list: &mut String, name: &str, extensions: &[&str], description: &str) {
    let endings: Vec<String> = extensions.iter().map(|ending| format!(".{ending}")).collect();
    list.push_str(&format!("  {name:<7} {:<12} {description}\n", endings.join(" ")));
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
