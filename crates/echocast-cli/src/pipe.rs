//! Clouds on standard input and output, which `-` stands for. Reading and writing formats requires seeking, so that a
//! cloud is kept in the folder for temporary files (`TMPDIR`) meanwhile.

use crate::{interrupt, text, usage};
use anyhow::{Context as _, Result, ensure};
use echocast::import::ReadOptions;
use echocast::{Error, FieldSet, PointCloud, Report, export, import, read, shown};
use serde_json::Value;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempDir};

/// Bytes that are copied at once.
const PIECE: usize = 1 << 20;

/// Whether `file` stands for standard input or output.
pub fn is_standard(file: &Path) -> bool {
    file == Path::new("-")
}

/// What a cloud file does not state itself.
#[derive(clap::Args)]
pub struct ColumnArgs {
    /// Columns of a text file without a header, or in place of its header: names of columns of clouds, `_` for those to
    /// leave out, as are all further ones. Example: `--columns x,y,z,intensity` [default: by the header, or a guess,
    /// which is reported]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    columns: Option<Vec<String>>,
}

impl ColumnArgs {
    /// Whether columns were named.
    pub fn is_some(&self) -> bool {
        self.columns.is_some()
    }

    fn options(&self) -> Result<ReadOptions> {
        let options = ReadOptions::default().columns(self.columns.clone());
        options.check().context("--columns").map_err(usage::wrong)?;
        Ok(options)
    }
}

/// Reads the cloud file `file`, or the cloud on standard input, and returns which files were read.
pub fn read_cloud(file: &Path, columns: &ColumnArgs, report: &mut Report) -> Result<(PointCloud, Vec<PathBuf>)> {
    let options = columns.options()?;
    if !is_standard(file) {
        let (cloud, files) = read::noting(|| import::read_with(file, &options, report));
        return Ok((cloud?, files));
    }
    const NAME: &str = "standard input";
    let kept = NamedTempFile::new().context(NAME)?;
    copy(io::stdin().lock(), kept.as_file()).map_err(|(side, error)| match side {
        Side::From => error.context(NAME),
        Side::To => error.context(format!("{NAME}, kept in the folder for temporary files")),
    })?;
    let cloud = import::read_with(kept.path(), &options, report).map_err(|error| match error {
        Error::Io { source, .. } => Error::Io { path: NAME.into(), source },
        Error::Parse { place, message, .. } => Error::Parse { origin: NAME.into(), place, message },
        other => other,
    })?;
    Ok((cloud, Vec::new()))
}

/// A cloud for standard output, which is written there once it is complete.
pub struct Outgoing(TempDir);

impl Outgoing {
    /// Checks that a cloud with the columns `fields` can go there in the format called `format`.
    pub fn check(format: Option<&str>, fields: FieldSet) -> Result<()> {
        ensure!(
            format.is_some(),
            "-o -: standard output has no ending that chooses a format; allowed: with --format NAME, such as csv"
        );
        export::check(&std::env::temp_dir().join("cloud"), format, fields).context("-o -")
    }

    pub fn new() -> Result<Outgoing> {
        text::check_stdout().context("-o -")?;
        TempDir::new().map(Outgoing).context("-o -")
    }

    /// Where it is to be written.
    pub fn place(&self) -> PathBuf {
        self.0.path().join("cloud")
    }

    /// Copies it, in the format called `format`, to standard output. A reader that closes the pipe early is not an
    /// error.
    pub fn pour(self, format: &str, report: &mut Report) -> Result<()> {
        let cloud = File::open(self.place()).context("-o -")?;
        let labels = fs::read_to_string(export::labels_path(&self.place())).unwrap_or_default();
        let names = names(&labels);
        if !names.is_empty() {
            let holding =
                export::FORMATS.iter().filter(|format| format.info().holds_label_names).map(|format| format.name());
            report.warn(format!(
                "-o -: {format} cannot hold label names, which are lost; formats that can: {}{names}",
                holding.collect::<Vec<_>>().join(", "),
            ));
        }
        // The file is deleted before a slow reader can block this.
        drop(self);
        copy(cloud, io::stdout().lock()).or_else(|(side, error)| match side {
            Side::From => Err(error.context("-o -")),
            Side::To if is_broken_pipe(&error) => Ok(()),
            Side::To => Err(error.context("stdout")),
        })
    }
}

/// The names of the first few categories and parts of `labels`, the JSON beside a cloud, as the end of a sentence.
fn names(labels: &str) -> String {
    const SHOWN: usize = 12;
    let labels: Value = serde_json::from_str(labels).unwrap_or_default();
    let list = |key: String| labels[key].as_array().cloned().unwrap_or_default();
    let tables = ["category", "part"].into_iter().filter_map(|stem| {
        let (ids, names) = (list(format!("{stem}_ids")), list(format!("{stem}_names")));
        let pairs = ids.iter().zip(&names).take(SHOWN);
        let pairs: Vec<String> =
            pairs.map(|(id, name)| format!("{id} {}", shown::name(name.as_str().unwrap_or_default()))).collect();
        let more = if ids.len() > SHOWN { ", ..." } else { "" };
        (!pairs.is_empty()).then(|| format!("; {stem}_id: {}{more}", pairs.join(", ")))
    });
    tables.collect()
}

/// On which side of a copy something went wrong.
enum Side {
    From,
    To,
}

fn copy(mut from: impl Read, mut to: impl Write) -> Result<(), (Side, anyhow::Error)> {
    let mut piece = vec![0; PIECE];
    loop {
        interrupt::check().map_err(|error| (Side::From, error.into()))?;
        let count = match from.read(&mut piece) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err((Side::From, error.into())),
        };
        let written = to.write_all(&piece[..count]).and_then(|()| to.flush());
        written.map_err(|error| (Side::To, error.into()))?;
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
}
