//! Files to clouds: one file per format, one table of readers.

mod about;
mod boxes;
mod csv;
mod e57;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(feature = "hdf5")]
mod heap;
mod las;
mod laz;
#[cfg(feature = "mcap")]
mod mcap;
mod names;
mod npz;
mod number;
mod pcd;
mod ply;
#[cfg(feature = "mcap")]
mod ros;
mod rows;
mod text;

use crate::cloud::PointCloud;
use crate::ground::error::{Error, Result};
use crate::ground::report::Report;
use crate::ground::shown;
use crate::read::{self, Limit};
use crate::scene::is_scene;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read as _, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Bytes at the beginning of a file that tell its format.
const BEGINNING: u64 = 4096;

/// Most bytes that are believed to be in a compressed byte: deflate and zstd make a thousand of one.
const MOST_OF_ONE: u64 = 1100;

/// Most bytes of memory for an array beside the columns, of a file that is shorter.
const BESIDE: u64 = 256 << 20;

impl PointCloud {
    /// Reads the cloud file at `path`: of any format of [`crate::export::FORMATS`], and LAS, LAZ, PLY, PCD, E57, text
    /// and MCAP files of other programs. The content tells the format, whatever the name ends in. [`read()`] also reports what a
    /// cloud could not take over.
    ///
    /// # Errors
    /// As [`read()`].
    pub fn read(path: impl AsRef<Path>) -> Result<PointCloud> {
        read(path.as_ref(), &mut Report::default())
    }
}

/// A point-cloud file format that is read.
pub struct CloudReader {
    /// What it is called.
    pub name: &'static str,
    /// File name endings, lower case, without the dot. Those of other files are read too.
    pub extensions: &'static [&'static str],
    /// One line for people: which files are read.
    pub description: &'static str,
    /// Whether a file that begins so is one.
    begins: fn(&[u8]) -> bool,
    read: fn(&Source, &mut Report) -> Result<PointCloud>,
}

/// Every format that is read.
pub const READERS: &[CloudReader] = &[
    CloudReader {
        name: "las",
        extensions: &["las", "laz"],
        description: "LAS 1.0 to 1.4, point formats 0 to 10, extra bytes; LAZ",
        begins: |bytes| bytes.starts_with(b"LASF"),
        read: las::read,
    },
    #[cfg(feature = "hdf5")]
    CloudReader {
        name: "hdf5",
        extensions: &["h5", "hdf5"],
        description: "HDF5 as echocast writes it: a dataset for each column",
        // What has it behind a block of its user is found later.
        begins: |bytes| bytes.starts_with(hdf5::SIGNATURE),
        read: hdf5::read,
    },
    CloudReader {
        name: "ply",
        extensions: &["ply"],
        description: "PLY without faces, as text or binary",
        begins: |bytes| bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r\n"),
        read: ply::read,
    },
    CloudReader {
        name: "pcd",
        extensions: &["pcd"],
        description: "PCD 0.6 and 0.7, as text, binary or compressed",
        begins: pcd::begins,
        read: pcd::read,
    },
    CloudReader {
        name: "e57",
        extensions: &["e57"],
        description: "E57: all its scans, in the world",
        begins: |bytes| bytes.starts_with(b"ASTM-E57"),
        read: e57::read,
    },
    #[cfg(feature = "mcap")]
    CloudReader {
        name: "mcap",
        extensions: &["mcap"],
        description: "bags of ROS 2: the PointCloud2 messages of one topic, put by the transforms into one frame",
        begins: |bytes| bytes.starts_with(b"\x89MCAP0\r\n"),
        read: mcap::read,
    },
    CloudReader {
        name: "npz",
        extensions: &["npz"],
        description: "NumPy arrays as echocast writes them: one for each column",
        begins: |bytes| bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06"),
        read: npz::read,
    },
    CloudReader {
        name: "csv",
        extensions: &["csv", "txt", "asc", "xyz", "pts"],
        description: "rows of numbers, behind a header of column names or not",
        begins: csv::begins,
        read: csv::read,
    },
];

/// Reads the cloud file at `path`, whose content tells the format. Names of labels are in it, or in `NAME.labels.json`
/// beside it. `report` gets what the file says and a cloud does not hold.
///
/// Positions farther than 1e18 m, infinite ones and those that are no numbers become NaN, as those of beams without a
/// return are.
///
/// # Errors
/// A missing file, or one of another format; one that is cut off, damaged or says what cannot be; no memory.
pub fn read(path: &Path, report: &mut Report) -> Result<PointCloud> {
    read_with(path, &ReadOptions::default(), report)
}

/// What files do not say of themselves.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// The columns of text, from the first on, by the names of [`Field`](crate::Field)s or those that other programs
    /// give them; `_` is left out, and so are those behind the last. `None`: as the header has them, or, where there is
    /// none, as they are likely to be, which is reported.
    pub columns: Option<Vec<String>>,
}

impl ReadOptions {
    /// Checks the names of the columns.
    ///
    /// # Errors
    /// One that is unknown.
    pub fn check(&self) -> Result<()> {
        csv::check(self.columns.as_deref().unwrap_or_default())
    }
}

/// [`read()`] with what the file does not say itself.
///
/// # Errors
/// As [`read()`] and [`ReadOptions::check`]; columns for what is not text.
pub fn read_with(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<PointCloud> {
    options.check()?;
    let (mut source, mut reader) = open(path)?;
    if options.columns.is_some() {
        source.columns = options.columns.as_deref();
        // Whatever stands above the rows.
        let text = READERS.iter().find(|reader| reader.name == "csv");
        reader = reader.or(text);
        if let Some(other) = reader.filter(|reader| reader.name != "csv") {
            let format = other.name.to_uppercase();
            return Err(Error::invalid("columns", format!("given for {format}, which names its own"), "for text"));
        }
    }
    let Some(reader) = reader else {
        let endings = READERS.iter().flat_map(|reader| reader.extensions).map(|ending| format!(".{ending}"));
        let all = endings.collect::<Vec<_>>().join(", ");
        return Err(source.error(format!("does not begin as a cloud does; clouds are read from {all}")));
    };
    (reader.read)(&source, report)
}

/// Whether the file at `path` is, or by its name should be, a cloud rather than a scene: a PLY file with faces is none.
///
/// # Errors
/// A missing file that should be one; a PLY file with a header that is none.
pub fn is_cloud(path: &Path) -> Result<bool> {
    let ending = ending_of(path);
    let named = ending != "ply" && READERS.iter().any(|reader| reader.extensions.contains(&&*ending));
    match open(path) {
        Ok((source, Some(reader))) if reader.name == "ply" => ply::has_faces(&source).map(|faces| !faces),
        // Comments of scenes may look like a header.
        Ok((_, Some(reader))) if reader.name == "csv" => Ok(!is_scene(path)),
        Ok((_, reader)) => Ok(named || reader.is_some()),
        Err(error) if named => Err(error),
        // Who reads scenes says it.
        Err(_) => Ok(false),
    }
}

/// What the name of the file at `path` ends in, lower case.
fn ending_of(path: &Path) -> String {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Opens the file at `path` and finds its reader.
fn open(path: &Path) -> Result<(Source<'_>, Option<&'static CloudReader>)> {
    let file = read::open(path, Limit::CLOUD)?;
    let (length, mut file) = (file.limit(), file.into_inner());
    let fault = |source| Error::io(path, source);
    let mut beginning = Vec::new();
    (&mut file).take(BEGINNING).read_to_end(&mut beginning).map_err(fault)?;
    file.rewind().map_err(fault)?;
    let reader = READERS.iter().find(|reader| (reader.begins)(&beginning));
    let source = Source { path, file, length, columns: None };
    let text = || READERS.iter().find(|reader| reader.name == "csv");
    #[cfg(feature = "hdf5")]
    if reader.is_none_or(|reader| reader.name == "csv") && hdf5::begins_at(&source).map_err(fault)?.is_some() {
        // The block of the user may be text.
        return Ok((source, READERS.iter().find(|reader| reader.name == "hdf5")));
    }
    // Text may begin with anything.
    let named = |reader: &&CloudReader| reader.extensions.contains(&&*ending_of(path));
    Ok((source, reader.or_else(|| text().filter(named))))
}

/// A cloud file that is being read.
struct Source<'a> {
    path: &'a Path,
    file: File,
    /// Bytes of the file when it was opened.
    length: u64,
    /// As [`ReadOptions::columns`].
    columns: Option<&'a [String]>,
}

impl Source<'_> {
    /// What is wrong with the file as a whole.
    fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(self.path, "", message)
    }

    /// The system's error, or where the file ends too early.
    fn failed(&self, error: io::Error, place: &str) -> Error {
        match error.kind() {
            ErrorKind::UnexpectedEof => self.error(format!("ends within {place}: it is cut off")),
            // What the system says has a number; all else, what a library says of the content.
            _ if error.raw_os_error().is_some() => Error::io(self.path, error),
            _ => self.error(format!("{place}: {}", shown::text(&error.to_string()))),
        }
    }

    /// The file from byte `at` on.
    fn from(&self, at: u64) -> Result<BufReader<&File>> {
        Ok(BufReader::with_capacity(1 << 16, self.at(at).map_err(|error| Error::io(self.path, error))?))
    }

    /// The file itself, at byte `at`.
    fn at(&self, at: u64) -> io::Result<&File> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(at)).map(|_| &self.file)
    }

    /// Checks that the `count` things in `name`, beside the columns, take no more memory, `size` bytes each, than what
    /// describes a cloud may.
    fn check_beside(&self, name: &str, count: u64, size: usize) -> Result<()> {
        if count.saturating_mul(size as u64) <= BESIDE.max(self.length) {
            return Ok(());
        }
        let message = format!("has {count} of them; allowed beside the columns: what fits in {} MB", BESIDE >> 20);
        Err(Error::parse(self.path, name, message))
    }

    /// Checks that `count` points of `size` bytes can stand behind byte `at`.
    fn check_count(&self, count: u64, size: usize, at: u64) -> Result<usize> {
        let room = self.length.saturating_sub(at) / (size as u64).max(1);
        match usize::try_from(count) {
            Ok(count) if count as u64 <= room => Ok(count),
            _ => Err(self.error(format!("says it has {count} points, and holds {room}: it is cut off, or damaged"))),
        }
    }
}

/// Does `work` of a library that panics on some damaged files.
fn contained<T>(work: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    let damaged = |_| Err(io::Error::new(ErrorKind::InvalidData, "is damaged"));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(damaged)
}
