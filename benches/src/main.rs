//! `make bench`: rays per second compared with the bare Embree loop, what weather adds, what adaptive beams cost, and
//! how exact they are, motion, sonar, radar, surveys, samples of sets and the cost of their styles, the paper's two experiments,
//! how fast files are read and written, the C library and the Python package compared with the Rust crate, and scans
//! side by side. Prints tables and writes `target/bench.json`.
//!
//! `bench instruments` measures every preset and writes the speeds into docs/instruments.md.
//!
//! All ratios come from interleaved rounds in one process; times are processor time, medians.
#![forbid(unsafe_code)]

mod accuracy;
mod adaptive;
mod clock;
mod embedding;
mod fair;
mod files;
mod instruments;
mod light;
mod memory;
mod motion;
mod paper;
mod presets;
mod radar;
mod rays;
mod scenario;
mod scenes;
mod sound;
mod survey;

use serde_json::{Map, Value};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// A named benchmark.
type Section = (&'static str, fn() -> Result<Value>);

const SECTIONS: &[Section] = &[
    ("rays", rays::run),
    ("light", light::run),
    ("adaptive", adaptive::run),
    ("accuracy", accuracy::run),
    ("motion", motion::run),
    ("sound", sound::run),
    ("radar", radar::run),
    ("survey", survey::run),
    ("scenario", scenario::run),
    ("styles", scenario::styles),
    ("paper", paper::run),
    ("files", files::run),
    ("memory", memory::run),
    ("embedding", embedding::run),
    ("fair", fair::run),
];

fn main() -> Result<()> {
    let selected: Vec<String> = std::env::args().skip(1).collect();
    if let [first, scene] = selected.as_slice()
        && first == memory::CHILD
    {
        return memory::child(scene);
    }
    if selected == [instruments::COMMAND] {
        return instruments::write();
    }
    if let Some(unknown) = selected.iter().find(|name| SECTIONS.iter().all(|(known, _)| known != name)) {
        let known: Vec<&str> = SECTIONS.iter().map(|(name, _)| *name).collect();
        return Err(format!("there is no benchmark {unknown:?}; there are {}", known.join(", ")).into());
    }
    let mut results = Map::new();
    for (name, run) in SECTIONS {
        if selected.is_empty() || selected.iter().any(|chosen| chosen == name) {
            results.insert((*name).to_owned(), run()?);
        }
    }
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/bench.json");
    std::fs::create_dir_all(path.parent().expect("a file in a folder"))?;
    std::fs::write(&path, serde_json::to_string_pretty(&results)?)?;
    println!("written: target/bench.json");
    Ok(())
}
