//! The flight of a scan: its coordinate system, the errors of its navigation, and the files of trajectories.

use crate::input::{self, has_ending};
use crate::names::is_same;
use crate::place::three_numbers;
use crate::usage;
use anyhow::{Context as _, Result, ensure};
use clap::Args;
use echocast::emitter::{Accuracy, Crs, Navigation, NavigationSolution, TrajectoryOptions};
use echocast::glam::DVec3;
use echocast::{Report, Trajectory, shown};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Endings of trajectories that are nothing else.
pub const TRAJECTORY_ENDINGS: &[&str] = &["sbet", "out", "trj"];

/// How the world lies on the Earth.
#[derive(Args)]
pub struct EarthArgs {
    /// Coordinate system of the world: EPSG:25832 and the like, `UTM 32N`, `local`, or a .prj file; latitudes and longitudes of
    /// a trajectory are projected into it [default: the UTM zone of the first pose]
    #[arg(long, value_name = "CRS", help_heading = "Place")]
    crs: Option<String>,
    /// Easting, northing and height of the world's origin, metres: they are subtracted from those of a trajectory, for scenes
    /// whose coordinates are small
    #[arg(long, value_name = "E,N,H", value_parser = three_numbers, allow_hyphen_values = true, help_heading = "Place")]
    offset: Option<[f64; 3]>,
    /// GPS week from whose start the times of the trajectory count, as those of an SBET do: LAS then stores standard GPS time
    #[arg(long, value_name = "N", help_heading = "Place")]
    gps_week: Option<u16>,
}

impl EarthArgs {
    /// How to read trajectories.
    pub fn options(&self) -> Result<TrajectoryOptions> {
        let crs = self.crs.as_deref().map(Crs::open).transpose().context("--crs").map_err(usage::wrong)?;
        let offset = DVec3::from_array(self.offset.unwrap_or_default());
        Ok(TrajectoryOptions::default().crs(crs).offset(offset).gps_week(self.gps_week))
    }

    /// The trajectory in `file`, an option's; `-` is standard input.
    pub fn load(&self, option: &'static str, file: &Path, report: &mut Report) -> Result<Trajectory> {
        let options = self.options()?;
        // One of the two reads.
        let mut of_text = Report::default();
        let read = input::file_or_stdin(
            option,
            file,
            |file| Trajectory::load_with(file, &options, report),
            |text| Trajectory::from_text_with(text, &options, &mut of_text),
        )?;
        report.absorb(of_text);
        Ok(read)
    }

    /// `path`, which is of the world, on the Earth.
    pub fn place(&self, path: Trajectory) -> Result<Trajectory> {
        Ok(path.on_earth(&self.options()?)?)
    }

    /// The first option that is given.
    pub fn first_given(&self) -> Option<&'static str> {
        let given = [
            ("--crs", self.crs.is_some()),
            ("--offset", self.offset.is_some()),
            ("--gps-week", self.gps_week.is_some()),
        ];
        given.into_iter().find_map(|(option, is_given)| is_given.then_some(option))
    }

    /// The section `georeference` of a scenario, if an option is given.
    pub fn to_json(&self) -> Option<Value> {
        self.first_given()?;
        let mut section = json!({});
        if let Some(crs) = &self.crs {
            section["crs"] = json!(crs);
        }
        if let Some(offset) = self.offset {
            section["offset_m"] = json!(offset);
        }
        if let Some(week) = self.gps_week {
            section["gps_week"] = json!(week);
        }
        Some(section)
    }
}

/// Errors of navigation.
#[derive(Args)]
pub struct NavigationArgs {
    /// Errors of the trajectory and the mounting that points are placed with (YAML): the section `navigation` of a scenario,
    /// or only its keys; `-` for standard input. Columns true_x, true_y and true_z stay the truth
    #[arg(long, value_name = "FILE", help_heading = "Place")]
    navigation: Option<PathBuf>,
}

impl NavigationArgs {
    /// The errors, if there are any.
    pub fn load(&self) -> Result<Option<Navigation>> {
        let read = |file| input::file_or_stdin("--navigation", file, Navigation::load, Navigation::from_yaml);
        self.navigation.as_deref().map(read).transpose()
    }
}

/// Files of the trajectories of a run.
#[derive(Args, Default)]
pub struct FlightFiles {
    /// Trajectory of the carrier: .sbet or .out (SBET, with --crs), .csv, or .txt (TUM). With --navigation it is the estimated
    /// one; the true one is beside it in `name_true`, the accuracy of an SBET in `smrmsg_name.out`
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    trajectory_out: Option<PathBuf>,
}

impl FlightFiles {
    pub fn new(trajectory_out: Option<PathBuf>) -> FlightFiles {
        FlightFiles { trajectory_out }
    }

    /// Names of the files that may be written.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.trajectory_out.iter().flat_map(|file| [file.clone(), beside_true(file), beside_accuracy(file)])
    }

    /// For the report.
    pub fn to_json(&self) -> Value {
        json!(self.trajectory_out.as_deref().map(shown::path))
    }

    /// Checks that the trajectory `path` can be written.
    pub fn check(&self, path: &Trajectory) -> Result<()> {
        let Some(file) = &self.trajectory_out else { return Ok(()) };
        check_trajectory_file("--trajectory-out", file, path)
    }

    /// Writes the trajectory of `carrier`, or the estimate and the truth of `solution`; returns the files.
    pub fn write(&self, carrier: &Trajectory, solution: Option<&NavigationSolution>) -> Result<Vec<PathBuf>> {
        let Some(file) = &self.trajectory_out else { return Ok(Vec::new()) };
        save(file, carrier, solution).context("--trajectory-out")
    }
}

/// Writes the trajectory of `carrier` to `file`, or the estimate of `solution`, with the truth and the accuracy beside it;
/// returns the files.
pub fn save(file: &Path, carrier: &Trajectory, solution: Option<&NavigationSolution>) -> Result<Vec<PathBuf>> {
    let Some(NavigationSolution { truth, carrier: estimate, accuracy, .. }) = solution else {
        carrier.save(file)?;
        return Ok(vec![file.to_owned()]);
    };
    estimate.save(file)?;
    let of_truth = beside_true(file);
    truth.save(&of_truth)?;
    let mut files = vec![file.to_owned(), of_truth];
    if has_ending(file, TRAJECTORY_ENDINGS) {
        let of_accuracy = beside_accuracy(file);
        Accuracy::save(accuracy, &of_accuracy)?;
        files.push(of_accuracy);
    }
    Ok(files)
}

/// Checks before the work that a trajectory such as `path` can be written to `file`, which was given with `option`.
pub fn check_trajectory_file(option: &str, file: &Path, path: &Trajectory) -> Result<()> {
    let name = shown::path(file);
    ensure!(has_ending(file, &["sbet", "out", "csv", "txt"]), "{option} {name}: allowed: .sbet, .out, .csv or .txt");
    let projected = path.georeference().is_some_and(|world| world.crs().projection().is_some());
    ensure!(
        projected || has_ending(file, &["csv", "txt"]),
        "{option} {name}: an SBET has latitudes and longitudes; allowed: with the coordinate system of a UTM zone, such as \
         --crs EPSG:32632"
    );
    ensure!(
        !is_same(file, &beside_accuracy(file)) && !is_same(file, &beside_true(file)),
        "{option} {name}: the name of a file beside it; allowed: another name"
    );
    Ok(())
}

/// `flight_true.sbet` of `flight.sbet`.
fn beside_true(file: &Path) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let ending = file.extension().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("{stem}_true.{ending}"))
}

/// `smrmsg_flight.out` of `flight.sbet` and of `sbet_flight.out`.
fn beside_accuracy(file: &Path) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("smrmsg_{}.out", stem.strip_prefix("sbet_").unwrap_or(&stem)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_as_surveyors_know_them() {
        let of = |name: &str| [beside_true(Path::new(name)), beside_accuracy(Path::new(name))];
        assert_eq!(of("a/flight.sbet"), [Path::new("a/flight_true.sbet"), Path::new("a/smrmsg_flight.out")]);
        assert_eq!(of("sbet_flight.out"), [Path::new("sbet_flight_true.out"), Path::new("smrmsg_flight.out")]);
    }
}
