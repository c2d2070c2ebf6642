//! `echocast import`

use crate::text::{self, counted};
use crate::usage;
use anyhow::{Result, anyhow, ensure};
use echocast::shown;
use helios::Import;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Convert a survey of HELIOS++ to a scenario, sensors and a trajectory
///
/// What is not read, or not quite, is listed; the file report.json in the folder says it of every element and attribute.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast import examples/helios/terraces.xml -o terraces
  echocast run terraces/survey.yaml -o clouds
Both at once:
  echocast run examples/helios/terraces.xml -o both")]
pub struct ImportArgs {
    /// Survey file
    #[arg(value_name = "SURVEY.xml")]
    survey: PathBuf,
    /// New folder to write
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    assets: AssetArgs,
    /// Print the whole report as JSON
    #[arg(long)]
    json: bool,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
}

/// Where files are that a survey names.
#[derive(clap::Args)]
pub struct AssetArgs {
    /// Folder in which files are looked for that a survey of HELIOS++ names, after that of the survey: a copy of its
    /// repository, or of its folder data; repeatable
    #[arg(long, value_name = "DIR")]
    assets: Vec<PathBuf>,
}

impl AssetArgs {
    /// Whether none is given.
    pub fn is_empty(&self) -> bool {
        self.assets.is_empty()
    }

    fn load(&self, survey: &Path) -> Result<Import> {
        for folder in &self.assets {
            let missing =
                || usage::wrong(anyhow!("--assets {}: is no folder; allowed: an existing one", shown::path(folder)));
            ensure!(folder.is_dir(), missing());
        }
        Ok(Import::load(survey, &self.assets)?)
    }
}

pub fn run(args: &ImportArgs) -> Result<()> {
    let import = args.assets.load(&args.survey)?;
    let scenario = import.write(&args.output)?;
    if args.json {
        return text::print_json(&import.report());
    }
    if args.quiet {
        return Ok(());
    }
    note(&import);
    let [used, approximated, unread] = import.counts();
    let legs = counted(import.survey.legs.len(), "leg");
    let message = format!(
        "{}: {legs}; {used} elements and attributes used, {approximated} approximated, {unread} not understood\n  {}\n",
        shown::path(&args.survey),
        shown::path(&scenario),
    );
    text::print(&message)
}

/// Lists what is not read, or not quite.
fn note(import: &Import) {
    const MOST: usize = 40;
    let lines = import.summary();
    lines.iter().take(MOST).for_each(|line| text::note(&format!("note: {line}")));
    if lines.len() > MOST {
        text::note(&format!("note: {} more, which report.json lists", lines.len() - MOST));
    }
}

/// A survey as the scenario in a folder that is removed when dropped.
pub struct Imported {
    folder: TempDir,
}

impl Imported {
    /// Imports the survey at `survey`; `quiet` does not list what is not read.
    pub fn load(survey: &Path, assets: &AssetArgs, quiet: bool) -> Result<Imported> {
        let import = assets.load(survey)?;
        if !quiet {
            note(&import);
        }
        let folder = tempfile::tempdir()?;
        import.write(folder.path())?;
        Ok(Imported { folder })
    }

    /// Its scenario file.
    pub fn scenario(&self) -> PathBuf {
        self.folder.path().join("survey.yaml")
    }
}
