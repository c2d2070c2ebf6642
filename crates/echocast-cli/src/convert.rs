//! `echocast convert`

use crate::flight::TRAJECTORY_ENDINGS;
use crate::input::has_ending;
use crate::pipe::{self, ColumnArgs, Outgoing};
use crate::{interrupt, names, text, usage};
use anyhow::{Context as _, Result, ensure};
use echocast::{FieldSet, Report, export, shown};
use std::path::PathBuf;

/// Write a cloud file in another format: with its labels and their names, and whatever else the format can hold
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate street -o street.glb
  echocast scan street.glb --sensor velodyne_vlp16 --at 0,0,2 -o scan.las
  echocast convert scan.las -o scan.pcd
  echocast convert scan.las -o scan.npz
  echocast convert scan.npz -o small.las --format las2
  echocast convert scan.las -o - --format laz | echocast info -")]
pub struct ConvertArgs {
    /// Cloud file of any format that echocast writes, or LAS, LAZ, PLY, PCD, E57, MCAP or text of another program; its
    /// content determines the format; `-` for standard input
    #[arg(value_name = "CLOUD")]
    input: PathBuf,
    /// Cloud file to write; its ending selects the format (`echocast formats` lists them); `-` with `--format` is
    /// standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Format of the file to write, whatever its ending
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    #[command(flatten)]
    columns: ColumnArgs,
}

pub fn run(args: &ConvertArgs) -> Result<()> {
    interrupt::listen().context("cannot listen for signals")?;
    let name = args.format.as_deref();
    check(args).map_err(usage::wrong)?;
    let format = export::format_for(&args.output, name).map_err(usage::wrong)?;
    let mut report = Report::default();
    let (cloud, inputs) = pipe::read_cloud(&args.input, &args.columns, &mut report)?;
    let stdout = pipe::is_standard(&args.output).then(Outgoing::new).transpose()?;
    let file = stdout.as_ref().map_or_else(|| args.output.clone(), Outgoing::place);
    // Names of labels beside the input may be those beside the output: they are the same.
    inputs.iter().try_for_each(|input| names::check_kept(&file, input)).map_err(usage::wrong)?;
    export::check(&file, name, cloud.fields())?;
    interrupt::check()?;
    report.absorb(export::write(&cloud, &file, name)?);
    if cloud.boxes.is_some() && !matches!(format.name(), "npz" | "hdf5") {
        report.warn(format!("{}: cannot hold the boxes around instances; npz and hdf5 do", format.name()));
    }
    if cloud.organised().is_some() && format.name().starts_with("la") {
        report.warn(format!("{}: cannot hold the rows and columns of the sensor", format.name()));
    }
    let poured = stdout.map(|cloud| cloud.pour(format.name(), &mut report)).transpose()?;
    report.warnings.iter().for_each(|warning| text::note(&format!("warning: {warning}")));
    let points = text::counted(cloud.len(), "point");
    let message =
        format!("{}: {points} as {}\n  {}\n", shown::path(&args.input), format.name(), shown::path(&args.output));
    if poured.is_some() {
        text::print_error(&message);
        return Ok(());
    }
    text::print(&message)
}

/// Checks that the output is possible.
fn check(args: &ConvertArgs) -> Result<()> {
    for file in [&args.input, &args.output] {
        ensure!(
            !has_ending(file, TRAJECTORY_ENDINGS),
            "{}: is the name of a trajectory, not of a cloud; allowed: with echocast trajectory",
            shown::path(file)
        );
    }
    if pipe::is_standard(&args.output) {
        // The columns are not known yet.
        return Outgoing::check(args.format.as_deref(), FieldSet::all());
    }
    names::check_kept(&args.output, &args.input)?;
    names::check_kept(&export::labels_path(&args.output), &args.input)
}
