//! `echocast sensors`

use crate::{input, text};
use anyhow::Result;
use echocast::Sensor;
use std::fmt::Write as _;
use std::path::PathBuf;

/// List the sensor presets, or show one sensor, fully resolved, as YAML
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  echocast sensors\n  echocast sensors velodyne_vlp16 > mine.yaml")]
pub struct Args {
    /// Preset or sensor file (.yaml) to show, or `-` for one from standard input
    name: Option<PathBuf>,
}

pub fn run(args: &Args) -> Result<()> {
    match &args.name {
        Some(name) => text::print(&input::load_sensor(name)?.to_yaml()?),
        None => text::print(&list()?),
    }
}

fn list() -> Result<String> {
    let mut list = String::new();
    let mut folder = String::new();
    for preset in Sensor::presets() {
        if preset.folder != folder {
            writeln!(list, "{}{}", if folder.is_empty() { "" } else { "\n" }, preset.folder)?;
            folder.clone_from(&preset.folder);
        }
        writeln!(list, "  {:<28} {}", preset.name, preset.title)?;
    }
    Ok(list)
}
