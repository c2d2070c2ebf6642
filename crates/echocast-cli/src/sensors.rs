//! `echocast sensors`

use crate::{input, text};
use anyhow::Result;
use echocast::{PresetInfo, Sensor};
use serde_json::{Value, json};
use std::ffi::{OsStr, OsString};
use std::fmt::Write as _;
use std::path::Path;

/// List the sensor presets, or those that match words, or show one sensor, fully resolved, as YAML
///
/// Words are searched for in name, title and folder, ignoring case; all of them must be found. If they are the name of
/// a preset, or a part of one that no other has, or the name of a file, that sensor is shown instead.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast sensors
  echocast sensors velodyne
  echocast sensors sonar --json
  echocast sensors vlp16
  echocast sensors velodyne_vlp16 > mine.yaml")]
pub struct SensorsArgs {
    /// Words that the listed presets contain; or the preset or sensor file (.yaml) to show, `-` for one from standard
    /// input
    #[arg(value_name = "WORD|NAME|FILE")]
    words: Vec<OsString>,
    /// Print JSON: a list of objects with name, title, kind and folder, or the sensor with the keys of its YAML
    #[arg(long)]
    json: bool,
}

pub fn run(args: &SensorsArgs) -> Result<()> {
    let presets = Sensor::presets();
    let name = args.words.join(OsStr::new(" "));
    let chosen: Vec<&PresetInfo> = presets.iter().filter(|preset| has(preset, &args.words)).collect();
    let lists = args.words.is_empty() || presets.iter().any(|preset| name == preset.folder.as_str());
    if !lists {
        match input::load_sensor(Path::new(&name)) {
            Ok(sensor) if args.json => {
                return text::print_json(&serde_json::to_value(sensor.spec())?);
            }
            Ok(sensor) => return text::print(&sensor.to_yaml()?),
            Err(error) if chosen.is_empty() || name == "-" => return Err(error),
            Err(_) => {}
        }
    }
    if args.json { text::print_json(&to_json(&chosen)) } else { text::print(&list(&chosen)?) }
}

/// Whether each of `words` is in `preset`.
fn has(preset: &PresetInfo, words: &[OsString]) -> bool {
    let text = format!("{} {} {}", preset.name, preset.title, preset.folder).to_lowercase();
    words.iter().all(|word| text.contains(&word.to_string_lossy().to_lowercase()))
}

fn list(presets: &[&PresetInfo]) -> Result<String> {
    let mut list = String::new();
    let mut folder = "";
    for preset in presets {
        if preset.folder != folder {
            writeln!(list, "{}{}", if folder.is_empty() { "" } else { "\n" }, preset.folder)?;
            folder = &preset.folder;
        }
        writeln!(list, "  {:<28} {}", preset.name, preset.title)?;
    }
    Ok(list)
}

fn to_json(presets: &[&PresetInfo]) -> Value {
    let list: Vec<_> = presets
        .iter()
        .map(|preset| {
            let kind = preset.kind.to_string();
            json!({ "name": preset.name, "title": preset.title, "kind": kind, "folder": preset.folder })
        })
        .collect();
    json!(list)
}
