//! `echocast trajectory`

use crate::flight::{self, EarthArgs, NavigationArgs};
use crate::names::check_kept;
use crate::{interrupt, text, usage};
use anyhow::{Context as _, Result, ensure};
use echocast::{Pose, Report, Trajectory, read, shown};
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Show a trajectory, write it in another format, or as a surveyor would get it, with errors of navigation
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  printf 'gps_time,lat,lon,height,roll_deg,pitch_deg,heading_deg\\n' > flight.csv
  printf '388800,49.4,8.7,512,0,2,45\\n388860,49.422,8.734,515,1,2,45\\n' >> flight.csv
  echocast trajectory flight.csv
  echocast trajectory flight.csv --crs EPSG:25832 -o flight.sbet
  printf 'position: {horizontal_m: 0.02, vertical_m: 0.03}\\nattitude: {roll_pitch_deg: 0.005}\\n' > errors.yaml
  echocast trajectory flight.sbet --navigation errors.yaml --seed 7 -o estimated.sbet
  echocast trajectory estimated.sbet --crs EPSG:25832 --offset 478000,5471000,0 -o estimated.csv")]
pub struct TrajectoryArgs {
    /// Trajectory: TUM text, CSV with a header, SBET (.sbet, .out), or of HELIOS++ (.trj); `-` for text from standard input
    #[arg(value_name = "TRAJECTORY")]
    input: PathBuf,
    /// Trajectory to write; its ending selects the format: .sbet or .out (SBET), .csv, .txt (TUM). With --navigation it is
    /// the estimated one; the true one is beside it in `name_true`, the accuracy of an SBET in `smrmsg_name.out`
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    earth: EarthArgs,
    #[command(flatten)]
    navigation: NavigationArgs,
    /// Seed of the errors of navigation
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// Print what is known of it as one JSON object
    #[arg(long)]
    json: bool,
}

pub fn run(args: &TrajectoryArgs) -> Result<()> {
    interrupt::listen().context("cannot listen for signals")?;
    let mut report = Report::default();
    let (loaded, inputs) = read::noting(|| args.earth.load("TRAJECTORY", &args.input, &mut report));
    let path = loaded?;
    let navigation = args.navigation.load()?;
    let mut files = Vec::new();
    if let Some(file) = &args.output {
        flight::check_trajectory_file("-o", file, &path).map_err(usage::wrong)?;
        inputs.iter().try_for_each(|input| check_kept(file, input)).map_err(usage::wrong)?;
        let span = [path.span().0, path.span().1];
        let solve = |errors: &echocast::emitter::Navigation| errors.solve(args.seed, &path, &Pose::IDENTITY, span);
        let solution = navigation.as_ref().map(solve).transpose()?;
        files = flight::save(file, &path, solution.as_ref())?;
    } else {
        ensure!(navigation.is_none(), usage::wrong(anyhow::anyhow!("--navigation: allowed: with -o")));
    }
    report.warnings.iter().for_each(|warning| text::note(&format!("warning: {warning}")));
    text::print(&if args.json { text::json(&as_json(&path, &files)) } else { described(args, &path, &files)? })
}

/// Length of the way, m.
fn length(path: &Trajectory) -> f64 {
    path.keys().windows(2).map(|ends| ends[0].1.position.distance(ends[1].1.position)).sum()
}

/// Least and greatest coordinates, m.
fn bounds(path: &Trajectory) -> [[f64; 3]; 2] {
    let positions = path.keys().iter().map(|key| key.1.position);
    let ends = positions.map(|at| (at, at)).reduce(|(low, high), (a, b)| (low.min(a), high.max(b)));
    let (low, high) = ends.unwrap_or_default();
    [low.to_array(), high.to_array()]
}

fn as_json(path: &Trajectory, files: &[PathBuf]) -> serde_json::Value {
    let (start, end) = path.span();
    let [low, high] = bounds(path);
    let world = path.georeference();
    json!({
        "poses": path.keys().len(),
        "start_s": start,
        "end_s": end,
        "length_m": length(path),
        "min_m": low,
        "max_m": high,
        "crs": world.map(|world| world.crs().name()),
        "offset_m": world.map(|world| world.offset().to_array()),
        "outputs": text::paths(files),
    })
}

fn described(args: &TrajectoryArgs, path: &Trajectory, files: &[PathBuf]) -> Result<String> {
    let (start, end) = path.span();
    let (way, duration) = (length(path), end - start);
    let mut said = format!("{}: {}", shown::path(&args.input), text::counted(path.keys().len(), "pose"));
    writeln!(said, ", {start} to {end} s ({})", text::duration(duration))?;
    let speed = if duration > 0.0 { format!(", {:.2} m/s on average", way / duration) } else { String::new() };
    writeln!(said, "  {way:.1} m long{speed}")?;
    let [low, high] = bounds(path);
    let axis = |index: usize| format!("{:.2} to {:.2}", low[index], high[index]);
    writeln!(said, "  x {}, y {}, z {} m", axis(0), axis(1), axis(2))?;
    if let Some(world) = path.georeference() {
        let [x, y, z] = world.offset().to_array();
        writeln!(said, "  in {}, whose {x}, {y}, {z} m are the origin", world.crs().name())?;
    }
    for file in files {
        writeln!(said, "  {}", shown::path(file))?;
    }
    Ok(said)
}
