//! `echocast preview`

use crate::pipe::ColumnArgs;
use crate::{choice, names, picture, pipe, text, usage};
use anyhow::{Context as _, Result};
use echocast::preview::{self, ColorBy, PreviewOptions, View};
use echocast::{PointCloud, Report, shown};
use std::path::PathBuf;

/// Draw a picture of a cloud file, with a legend
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate street -o street.glb
  echocast scan street.glb --sensor velodyne_vlp16 --at 0,0,2 -o scan.las
  echocast preview scan.las -o scan.png
  echocast preview scan.las -o ranges.png --color range --view perspective --width 1200")]
pub struct PreviewArgs {
    /// Cloud file of any format that echocast writes, or LAS, LAZ, PLY, PCD, E57, MCAP or text of another program; `-`
    /// for standard input
    #[arg(value_name = "CLOUD")]
    input: PathBuf,
    /// Picture to write
    #[arg(short, long, value_name = "FILE.png")]
    output: PathBuf,
    /// What the colours show, as for `scan` [default: label, or intensity or height where points have no labels]
    #[arg(long, value_parser = choice::of::<ColorBy>())]
    color: Option<ColorBy>,
    /// How the picture shows the cloud: `top`, `perspective` or `range`
    #[arg(long, default_value = "top", value_parser = choice::of::<View>())]
    view: View,
    /// Width of the picture, pixels; its height follows the content
    #[arg(long, value_name = "PIXELS", default_value_t = PreviewOptions::default().width)]
    width: u32,
    /// What the picture shows in addition: `boxes`, the edges of the boxes of the cloud, which .npz and .h5 hold
    #[arg(long, value_name = "WHAT", value_parser = ["boxes"])]
    show: Option<String>,
    #[command(flatten)]
    columns: ColumnArgs,
}

pub fn run(args: &PreviewArgs) -> Result<()> {
    let options = PreviewOptions::default().view(args.view).width(args.width).boxes(args.show.is_some());
    let file = &args.output;
    picture::check_picture("-o", file, &options).map_err(usage::wrong)?;
    names::check_kept(file, &args.input).map_err(usage::wrong)?;
    let mut report = Report::default();
    let (cloud, inputs) = pipe::read_cloud(&args.input, &args.columns, &mut report)?;
    inputs.iter().try_for_each(|input| names::check_kept(file, input)).map_err(usage::wrong)?;
    let options = options.color(args.color.unwrap_or_else(|| default_color(&cloud)));
    report.absorb(preview::write(&cloud, file, &options).map_err(usage::wrong).context("-o")?);
    report.warnings.iter().for_each(|warning| text::note(&format!("warning: {warning}")));
    let points = text::counted(cloud.len(), "point");
    text::print(&format!("{}: {points}\n  {}\n", shown::path(&args.input), shown::path(file)))
}

/// The most informative colours for `cloud`.
fn default_color(cloud: &PointCloud) -> ColorBy {
    let c = cloud.columns();
    let [first, ..] = c.intensity()[..] else {
        return if labelled(cloud) { ColorBy::Label } else { ColorBy::Height };
    };
    match labelled(cloud) {
        true => ColorBy::Label,
        false if c.intensity().iter().any(|&intensity| intensity != first) => ColorBy::Intensity,
        false => ColorBy::Height,
    }
}

fn labelled(cloud: &PointCloud) -> bool {
    let c = cloud.columns();
    c.category_id().iter().chain(c.part_id()).any(|&id| id != 0)
}
