//! Helpers of the tests in this package.
#![forbid(unsafe_code)]

pub mod reference;

use echocast::emitter::pattern::Pattern;
use echocast::{PresetInfo, Sensor, SubRays};
use echocast_kernels::{Level, VARIABLE, level};
use std::collections::BTreeMap;
use std::mem::discriminant;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Root of the repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("this package is a folder of the repository")
}

/// The document at `path` in the repository has these `rows` of a table.
#[track_caller]
pub fn assert_in_document(path: &str, rows: &str) {
    let file = std::fs::read_to_string(root().join(path)).unwrap();
    assert!(file.contains(rows), "{path} is not up to date; its rows are:\n{rows}");
}

/// The same for figures that differ from processor to processor, as Embree's hits do, in a column by up to the number in
/// `within`.
#[track_caller]
pub fn assert_nearly_in_document(path: &str, rows: &str, within: &[f64]) {
    let file = std::fs::read_to_string(root().join(path)).unwrap();
    let lines: Vec<&str> = file.lines().collect();
    let rows: Vec<&str> = rows.lines().collect();
    let are_near = |found: &[&str]| found.iter().zip(&rows).all(|(line, row)| is_near(line, row, within));
    assert!(lines.windows(rows.len()).any(are_near), "{path} is not up to date; its rows are:\n{}", rows.join("\n"));
}

/// Whether the cells of two rows of a table are alike but for the numbers that begin them, and these differ by no more
/// than is given for their column.
fn is_near(a: &str, b: &str, within: &[f64]) -> bool {
    let cells = |row: &str| row.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let (a, b) = (cells(a), cells(b));
    // Bars are before the first and after the last.
    let limits = [0.0].iter().chain(within).chain(&[0.0]);
    a.len() == b.len()
        && a.len() == within.len() + 2
        && a.iter().zip(&b).zip(limits).all(|((a, b), within)| {
            let split = |cell: &str| {
                let end = cell.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(cell.len());
                (cell[..end].parse::<f64>().ok(), cell[end..].to_owned())
            };
            match (split(a), split(b)) {
                ((Some(a), unit), (Some(b), other)) => unit == other && (a - b).abs() <= within + 1e-9,
                _ => a == b,
            }
        })
}

/// Runs `tests` of the test program that calls this at every other vector level that the processor has, each in a process
/// of its own: Embree traces differently at each.
#[track_caller]
pub fn run_at_other_levels(tests: &[&str]) {
    for other in Level::here().filter(|&other| other != level()) {
        let program = std::env::current_exe().unwrap();
        let run = Command::new(program).arg("--exact").args(tests).env(VARIABLE, other.name()).output().unwrap();
        let said = String::from_utf8_lossy(&run.stdout);
        assert!(run.status.success(), "{}: {said}{}", other.name(), String::from_utf8_lossy(&run.stderr));
        assert!(said.contains(&format!(" {} passed", tests.len())), "{}: {said}", other.name());
    }
}

/// Of the presets whose scans take the same ways through the code, the one with the fewest beams: for what is true of all
/// code and takes long to see.
pub fn different_presets() -> Vec<(PresetInfo, Sensor)> {
    let mut different: BTreeMap<String, (usize, PresetInfo, Sensor)> = BTreeMap::new();
    for info in Sensor::presets() {
        let sensor = Sensor::preset(&info.name).unwrap();
        let spec = sensor.spec();
        let sweep = match &spec.pattern {
            Pattern::LineScan(lines) => Some((discriminant(&lines.mechanism), lines.head.is_some())),
            _ => None,
        };
        let parts = (discriminant(&spec.pattern), sweep, discriminant(&spec.detection.model), spec.returns.mode);
        let one_ray = spec.beam.sub_rays == SubRays::Count(1);
        let way = format!("{} {parts:?} {one_ray} {}", info.folder, spec.doppler.is_some());
        let beams = sensor.beams().len();
        if different.get(&way).is_none_or(|(least, ..)| beams < *least) {
            different.insert(way, (beams, info, sensor));
        }
    }
    different.into_values().map(|(_, info, sensor)| (info, sensor)).collect()
}

/// The Python of `.venv`, where `scripts/setup --test` installs third-party readers, or `ECHOCAST_PYTHON`.
pub fn python() -> Command {
    let python = match std::env::var_os("ECHOCAST_PYTHON") {
        Some(path) => PathBuf::from(path),
        None => root().join(".venv/bin/python"),
    };
    assert!(python.exists(), "{} is not there: run scripts/setup --test, or set ECHOCAST_PYTHON", python.display());
    let mut command = Command::new(python);
    // Processes started by concurrent tests inherit this one's open files, and their locks.
    command.env("HDF5_USE_FILE_LOCKING", "FALSE");
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_near_within_what_is_allowed() {
        let near = |a, b| is_near(a, b, &[0.0, 0.5, 0.1]);
        assert!(near("| `a` | 11.4 % | 3 m |", "| `a` | 11.9 % | 3.1 m |"));
        assert!(!near("| `a` | 11.4 % | 3 m |", "| `a` | 11.95 % | 3 m |"));
        assert!(!near("| `a` | 11.4 % | 3 m |", "| `a` | 11.4 m | 3 m |"));
        assert!(!near("| `a` | 11.4 % | 3 m |", "| `b` | 11.4 % | 3 m |"));
        assert!(!near("| `a` | - | 3 m |", "| `a` | 11.4 % | 3 m |"));
        assert!(near("| `a` | - | 3 m |", "| `a` | - | 3 m |"));
        assert!(!near("| `a` | 11.4 % |", "| `a` | 11.4 % | 3 m |"));
    }
}
