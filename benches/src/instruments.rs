//! `bench instruments`: how many times faster than the instrument presets are simulated, written into
//! docs/instruments.md for every preset, and into docs/embedding.md for some with fewer rays.

use crate::Result;
use crate::clock::{cpu_per_call, cpu_seconds, median, two_digits};
use crate::scenes::{Site, site};
use echocast::{Environment, Ping, PointCloud, ScanOptions, Sensor, SensorKind, Trajectory};
use rayon::ThreadPoolBuilder;
use std::path::Path;
use std::time::Duration;

/// The argument that requests it: it is not among the sections, which write no documents.
pub const COMMAND: &str = "instruments";

const ROUNDS: usize = 5;
const LEAST: Duration = Duration::from_millis(20);

/// Scans that take longer than this are measured once, s.
const LONG: f64 = 0.5;

/// What the tables are between.
const BEGIN: &str = "<!-- written by `bench instruments` -->\n";
const END: &str = "<!-- end -->\n";

/// Tables: a folder of presets, and the scenes in which these are measured.
const TABLES: [(&str, &[&str]); 5] = [
    ("lidar", &["city", "street", "landscape"]),
    ("survey", &["landscape"]),
    ("tof", &["flat"]),
    ("sonar", &["lake"]),
    ("radar", &["street"]),
];

/// Presets, scenes and limits of rays of the table for hosts with a clock.
const HOSTS: [&str; 5] = ["velodyne_vlp16", "velodyne_vlp32c", "ouster_os1_128", "livox_mid40", "hokuyo_utm30lx"];
const HOSTS_SCENES: [&str; 2] = ["street", "landscape"];
const LIMITS: [(&str, &str); 4] =
    [("adaptive", "adaptive"), ("at most 16", "{adaptive: 16}"), ("at most 4", "{adaptive: 4}"), ("one ray", "1")];

pub fn write() -> Result<()> {
    replace("docs/instruments.md", &of_presets()?)?;
    replace("docs/embedding.md", &of_hosts()?)
}

/// Puts `tables` between the marks of a document.
fn replace(name: &str, tables: &str) -> Result<()> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name);
    let text = std::fs::read_to_string(&path)?;
    let parts = text.split_once(BEGIN).and_then(|(before, after)| Some((before, after.split_once(END)?.1)));
    let (before, after) = parts.ok_or_else(|| format!("{name} has no place for the tables"))?;
    std::fs::write(&path, [before, BEGIN, tables, "\n", END, after].concat())?;
    println!("written: {name}");
    Ok(())
}

fn of_presets() -> Result<String> {
    let mut tables = String::new();
    for (folder, scenes) in TABLES {
        let presets = Sensor::presets().into_iter().filter(|preset| preset.folder == folder);
        let mut rows: Vec<(String, String)> = presets.map(|preset| (preset.name, String::new())).collect();
        for scene in scenes {
            let site = site(scene)?;
            for (preset, row) in &mut rows {
                let speed = two_digits(real_time(&site, &Sensor::preset(preset)?)?);
                println!("{preset:<34}{scene:<12}{speed:>8}");
                *row += &format!(" {speed} |");
            }
        }
        tables += &table(scenes, &rows);
    }
    Ok(tables)
}

/// A table of speeds, with a row for each preset.
fn table(heads: &[impl AsRef<str>], rows: &[(impl AsRef<str>, String)]) -> String {
    let names: Vec<&str> = heads.iter().map(AsRef::as_ref).collect();
    let mut table = format!("\n| preset | {} |\n|---|{}\n", names.join(" | "), "---|".repeat(names.len()));
    table.extend(rows.iter().map(|(preset, row)| format!("| `{}` |{row}\n", preset.as_ref())));
    table
}

fn of_hosts() -> Result<String> {
    let heads: Vec<String> =
        HOSTS_SCENES.iter().flat_map(|scene| LIMITS.map(|(limit, _)| format!("{scene}: {limit}"))).collect();
    let mut rows = HOSTS.map(|preset| (preset, String::new()));
    for scene in HOSTS_SCENES {
        let site = site(scene)?;
        for (preset, row) in &mut rows {
            for (limit, value) in LIMITS {
                let mut sensor = Sensor::preset(preset)?;
                sensor.set("beam.sub_rays", value)?;
                let speed = two_digits(real_time(&site, &sensor)?);
                println!("{preset:<34}{scene:<12}{limit:<12}{speed:>8}");
                *row += &format!(" {speed} |");
            }
        }
    }
    Ok(table(&heads, &rows))
}

/// Time between two scans of the instrument over the processor time of one here, on one thread.
fn real_time(site: &Site, sensor: &Sensor) -> Result<f64> {
    let one = ThreadPoolBuilder::new().num_threads(1).build()?;
    let trajectory = Trajectory::fixed(site.pose);
    let water = Environment::from_yaml("water: {profile: {constant: {speed_m_s: 1480}}}")?;
    let options = match sensor.kind() {
        SensorKind::Sonar => ScanOptions::default().environment(water),
        _ => ScanOptions::default(),
    };
    let (mut cloud, mut ping) = (PointCloud::default(), Ping::default());
    let mut scan = || match sensor.kind() {
        SensorKind::Sonar => site.built.ping_into(sensor, &trajectory, &options, &mut ping),
        _ => site.built.scan_into(sensor, &trajectory, &options, &mut cloud),
    };
    let start = cpu_seconds();
    one.install(&mut scan)?;
    let mut seconds = cpu_seconds() - start;
    // A long scan warms up by itself.
    if seconds < LONG {
        let mut measure = || one.install(|| cpu_per_call(LEAST, || scan().expect("what succeeds succeeds again")));
        seconds = median((0..ROUNDS).map(|_| measure()).collect());
    }
    Ok(sensor.beams().period / seconds)
}
