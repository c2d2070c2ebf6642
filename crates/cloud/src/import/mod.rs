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
mod target;
mod text;

use crate::PointCloud;
use ground::builder;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::report::Report;
use ground::shown;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read as _, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Bytes at the beginning of a file from which its format is detected.
const BEGINNING: u64 = 4096;

/// Maximum plausible expansion of a compressed byte: deflate and zstd reach a thousand.
const MOST_OF_ONE: u64 = 1100;

/// Maximum bytes of memory for an array other than the columns, of a file that is shorter.
const BESIDE: u64 = 256 << 20;

impl PointCloud {
    /// Reads the cloud file at `path`: of any format of [`FORMATS`](crate::export::FORMATS), and LAS, LAZ, PLY, PCD, E57, text
    /// and MCAP files of other programs. The format is detected from the content, regardless of the file name's ending.
    /// [`read()`] also reports what the cloud cannot hold.
    ///
    /// # Errors
    /// As [`read()`].
    pub fn read(path: impl AsRef<Path>) -> Result<PointCloud> {
        read(path.as_ref(), &mut Report::default())
    }
}

/// A point-cloud file format that can be read.
pub struct CloudReader {
    /// Its name.
    pub name: &'static str,
    /// File name endings, lower case, without the dot. Files with other endings are read too.
    pub extensions: &'static [&'static str],
    /// One line for users: which files are read.
    pub description: &'static str,
    /// Whether a file that begins with these bytes is in this format.
    begins: fn(&[u8]) -> bool,
    read: fn(&Source, &mut Report) -> Result<PointCloud>,
}

/// Every format that can be read.
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
        // Files with the signature after a user block are detected later.
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
        description: "bags of ROS 2: the PointCloud2 messages of one topic, transformed into one frame",
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
        description: "rows of numbers, with or without a header of column names",
        begins: csv::begins,
        read: csv::read,
    },
];

/// Reads the cloud file at `path`, whose format is detected from the content. Label names are in it, or in
/// `NAME.labels.json` next to it. What the file contains and a cloud does not hold is added to `report`.
///
/// Positions farther than 1e18 m, infinite ones and those that are not numbers become NaN, like those of beams without
/// a return.
///
/// # Errors
/// A missing file, or one of another format; one that is cut off, damaged or has invalid content; no memory.
pub fn read(path: &Path, report: &mut Report) -> Result<PointCloud> {
    read_with(path, &ReadOptions::default(), report)
}

builder! {
    /// What files do not state themselves.
    #[derive(Clone, Debug, Default)]
    pub struct ReadOptions {
        /// The columns of text, from the first on, by the names of [`Field`](crate::fields::Field)s or those that other
        /// programs use; `_` is left out, and so are columns after the last. `None`: as in the header, or, if there is
        /// none, as guessed, which is reported.
        pub columns: Option<Vec<String>>,
    }
}

impl ReadOptions {
    /// Checks the names of the columns.
    ///
    /// # Errors
    /// An unknown name.
    pub fn check(&self) -> Result<()> {
        csv::check(self.columns.as_deref().unwrap_or_default())
    }
}

/// [`read()`] with what the file does not state itself.
///
/// # Errors
/// As [`read()`] and [`ReadOptions::check`]; columns for a file that is not text.
pub fn read_with(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<PointCloud> {
    options.check()?;
    let (mut source, mut reader) = open(path)?;
    if options.columns.is_some() {
        source.columns = options.columns.as_deref();
        // Regardless of what is above the rows.
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

/// Whether the file at `path` is, or by its name should be, a cloud rather than a scene: a PLY file with faces is not a
/// cloud.
///
/// # Errors
/// A missing file that should be a cloud; a PLY file with an invalid header.
pub fn is_cloud(path: &Path) -> Result<bool> {
    let ending = read::ending(path);
    let named = ending != "ply" && READERS.iter().any(|reader| reader.extensions.contains(&&*ending));
    match open(path) {
        Ok((source, Some(reader))) if reader.name == "ply" => ply::has_faces(&source).map(|faces| !faces),
        // Comments of scenes may look like a header.
        Ok((_, Some(reader))) if reader.name == "csv" => Ok(!model::ENDINGS.contains(&&*ending)),
        Ok((_, reader)) => Ok(named || reader.is_some()),
        Err(error) if named => Err(error),
        // The reader of scenes reports it.
        Err(_) => Ok(false),
    }
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
        // The user block may be text.
        return Ok((source, READERS.iter().find(|reader| reader.name == "hdf5")));
    }
    // Text may begin with anything.
    let named = |reader: &&CloudReader| reader.extensions.contains(&&*read::ending(path));
    Ok((source, reader.or_else(|| text().filter(named))))
}

/// A cloud file that is being read.
struct Source<'a> {
    path: &'a Path,
    file: File,
    /// Length of the file when it was opened, bytes.
    length: u64,
    /// As [`ReadOptions::columns`].
    columns: Option<&'a [String]>,
}

impl Source<'_> {
    /// An error in the file as a whole.
    fn error(&self, message: impl Into<String>) -> Error {
        Error::parse(self.path, "", message)
    }

    /// The error of the system, or that the file ends within `place`.
    fn failed(&self, error: io::Error, place: &str) -> Error {
        match error.kind() {
            ErrorKind::UnexpectedEof => self.error(format!("ends within {place}: it is cut off")),
            // Errors of the system have a number; all others are a library's errors on the content.
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

    /// Checks that the `count` elements of `name`, which is not a column, take no more memory, at `size` bytes each,
    /// than metadata of a cloud may.
    fn check_beside(&self, name: &str, count: u64, size: usize) -> Result<()> {
        if count.saturating_mul(size as u64) <= BESIDE.max(self.length) {
            return Ok(());
        }
        let message = format!("has {count} of them; allowed beside the columns: what fits in {} MB", BESIDE >> 20);
        Err(Error::parse(self.path, name, message))
    }

    /// Checks that there is room for `count` points of `size` bytes after byte `at`.
    fn check_count(&self, count: u64, size: usize, at: u64) -> Result<usize> {
        let room = self.length.saturating_sub(at) / (size as u64).max(1);
        match usize::try_from(count) {
            Ok(count) if count as u64 <= room => Ok(count),
            _ => Err(self.error(format!("says it has {count} points, and holds {room}: it is cut off, or damaged"))),
        }
    }
}

/// Runs `work` of a library that panics on some damaged files.
fn contained<T>(work: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    let damaged = |_| Err(io::Error::new(ErrorKind::InvalidData, "is damaged"));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(damaged)
}
