//! Description of a set for its readers: `README.md`.

use super::origin::Origin;
use super::style::Style;
use super::whole::Whole;
use cloud::Field;
use pictures::thousands;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// Scenarios longer than this, bytes, are only in their own file.
const LONGEST_SCENARIO: usize = 20_000;

/// The text of `README.md`.
pub(super) fn text(origin: &Origin, whole: &Whole, styles: &[Box<dyn Style>], licence: Option<&str>) -> String {
    let entries = || whole.entries.values().filter(|entry| entry.error.is_none());
    let points: u64 = entries().map(|entry| entry.points).sum();
    let mut text = format!(
        "# Set of {}\n\nSimulated scans, {} points, made by echocast {} from `scenario.json`. `report.html` shows what is \
         in it, `manifest.json` and `files.json` list its files with their SHA-256, `samples` holds what was drawn for \
         each sample. `echocast run --check-output` of this folder checks it.\n",
        counted(origin.samples, "sample"),
        thousands(points as usize),
        origin.echocast,
    );
    let failed = origin.samples - entries().count() as u64;
    if failed > 0 {
        let _ = write!(text, "\nOf its samples, {failed} could not be made.\n");
    }
    text += "\n## Licence\n\n";
    match licence {
        Some(licence) => text += &format!("{}\n", plain(licence)),
        None => text += "None specified.\n",
    }
    text += "\n## Sensors\n\n| name | |\n|---|---|\n";
    for sensor in &origin.sensors {
        let _ = writeln!(text, "| {} | {} |", plain(&sensor.name), plain(&sensor.title));
    }
    text += "\n## Columns of clouds\n\nIn files whose format can hold them.\n\n| column | unit | |\n|---|---|---|\n";
    let columns: BTreeSet<Field> = origin
        .sensors
        .iter()
        .flat_map(|sensor| &sensor.columns)
        .filter_map(|name| Field::from_name(name).ok())
        .collect();
    for info in columns.into_iter().map(Field::info) {
        let _ = writeln!(text, "| `{}` | {} | {} |", info.name, info.unit, info.meaning);
    }
    let mut categories: BTreeMap<&str, u64> = BTreeMap::new();
    for (name, count) in entries().flat_map(|entry| &entry.categories) {
        *categories.entry(name).or_default() += count;
    }
    text += "\n## Classes\n\n| class | points |\n|---|---:|\n";
    for (name, count) in categories {
        let _ = writeln!(text, "| {} | {} |", plain(name), thousands(count as usize));
    }
    if !whole.splits.is_empty() {
        text += "\n## Parts\n\n`splits` lists the samples of each. A sample stays in its part when the set grows.\n\n\
                 | part | samples |\n|---|---:|\n";
        for (name, samples) in whole.parts() {
            let _ = writeln!(text, "| {name} | {} |", samples.len());
        }
    }
    text += "\n## How to read it\n";
    for style in styles {
        let _ = write!(text, "\n{}", style.readme());
    }
    text += "\n## How it was made\n\n";
    let scenario = format!("{:#}", origin.scenario);
    if scenario.len() <= LONGEST_SCENARIO && !scenario.contains("```") {
        let _ = write!(text, "`echocast run` of this scenario:\n\n```json\n{scenario}\n```\n");
    } else {
        text += "By the scenario in `scenario.json`.\n";
    }
    text
}

fn counted(count: u64, what: &str) -> String {
    format!("{} {what}{}", thousands(count as usize), if count == 1 { "" } else { "s" })
}

/// A name in Markdown, with the special characters escaped.
fn plain(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        match letter {
            '\n' | '\r' => text.push(' '),
            '\\' | '`' | '*' | '_' | '[' | ']' | '<' | '>' | '|' | '#' | '&' => text.extend(['\\', letter]),
            letter => text.push(letter),
        }
    }
    text
}
