//! Files of named arrays: NPZ, and HDF5 with a unit and a meaning for each.

use super::npz::Archive;
use crate::Column;
use ground::error::{Error, Result};
use ground::read::ending;
use ground::report::Report;
use ground::shown;
use ground::write::{Pending, failed};
use model::Labels;
use num_complex::Complex32;
use std::io;
use std::path::Path;

/// Checks that `path` has one of the `endings` of files of `what`, and that this build writes it.
pub(super) fn check_ending(path: &Path, what: &str, endings: &[&str]) -> Result<()> {
    let ending = ending(path);
    if !endings.contains(&&*ending) {
        let all: Vec<String> = endings.iter().map(|ending| format!(".{ending}")).collect();
        return Err(Error::Unsupported {
            what: format!("the ending of the output file {}", shown::path(path)),
            instead: format!("{what} are written as {}", all.join(", ")),
        });
    }
    if cfg!(not(feature = "hdf5")) && ["h5", "hdf5"].contains(&&*ending) {
        let instead = "build echocast with the feature hdf5".into();
        return Err(Error::Unsupported { what: "HDF5 in this build".into(), instead });
    }
    Ok(())
}

/// Writes a file with `fill`.
pub(super) fn into_file(path: &Path, fill: impl FnOnce(&Pending, &mut Report) -> io::Result<()>) -> Result<Report> {
    let mut report = Report::default();
    let pending = Pending::create(path)?;
    fill(&pending, &mut report).map_err(|source| match source.kind() {
        io::ErrorKind::OutOfMemory => Error::Memory("a column of a file".to_owned()),
        _ => failed(path, source),
    })?;
    pending.commit()?;
    Ok(report)
}

/// Writes a file of arrays with `fill`.
pub(super) fn into_arrays(
    path: &Path,
    fill: impl FnOnce(&mut ArrayFile, &mut Report) -> io::Result<()>,
) -> Result<Report> {
    into_file(path, |pending, report| {
        let mut file = ArrayFile::create(pending, path)?;
        fill(&mut file, report)?;
        file.finish()
    })
}

/// A file of named arrays.
pub(super) enum ArrayFile {
    Npz(Box<Archive>),
    #[cfg(feature = "hdf5")]
    Hdf5(::hdf5::File),
}

/// Name, unit and meaning of an array.
pub(super) type ArrayCaption<'a> = [&'a str; 3];

impl ArrayFile {
    fn create(pending: &Pending, named: &Path) -> io::Result<ArrayFile> {
        #[cfg(feature = "hdf5")]
        if ending(named) != "npz" {
            return echocast_hdf5::create(pending.path()).map(ArrayFile::Hdf5).map_err(echocast_hdf5::io_error);
        }
        debug_assert_eq!(ending(named), "npz");
        Archive::create(pending.path()).map(|file| ArrayFile::Npz(Box::new(file)))
    }

    pub(super) fn add(&mut self, about: ArrayCaption, shape: &[usize], data: Column<'_>) -> io::Result<()> {
        match self {
            // NumPy arrays have only names.
            ArrayFile::Npz(file) => file.column(about[0], shape, data),
            #[cfg(feature = "hdf5")]
            ArrayFile::Hdf5(file) => super::hdf5::add_column(file, about[0], shape, data)
                .and_then(|dataset| super::hdf5::describe(&dataset, about[1], about[2]))
                .map_err(echocast_hdf5::io_error),
        }
    }

    /// Adds complex numbers: `complex64` of NumPy, in HDF5 pairs `r`, `i`, which h5py reads as such.
    pub(super) fn complex(&mut self, about: ArrayCaption, shape: &[usize], data: &[Complex32]) -> io::Result<()> {
        match self {
            ArrayFile::Npz(file) => file.add(about[0], "c8", shape, data),
            #[cfg(feature = "hdf5")]
            ArrayFile::Hdf5(file) => super::hdf5::add(file, about[0], shape, data)
                .and_then(|dataset| super::hdf5::describe(&dataset, about[1], about[2]))
                .map_err(echocast_hdf5::io_error),
        }
    }

    /// Adds 16-bit numbers with a sign.
    pub(super) fn signed(&mut self, about: ArrayCaption, shape: &[usize], data: &[i16]) -> io::Result<()> {
        match self {
            ArrayFile::Npz(file) => file.add(about[0], "i2", shape, data),
            #[cfg(feature = "hdf5")]
            ArrayFile::Hdf5(file) => super::hdf5::add(file, about[0], shape, data)
                .and_then(|dataset| super::hdf5::describe(&dataset, about[1], about[2]))
                .map_err(echocast_hdf5::io_error),
        }
    }

    pub(super) fn text(&mut self, name: &str, words: &str) -> io::Result<()> {
        match self {
            ArrayFile::Npz(file) => file.text(name, words),
            #[cfg(feature = "hdf5")]
            ArrayFile::Hdf5(file) => super::hdf5::add_text(file, name, words).map_err(echocast_hdf5::io_error),
        }
    }

    pub(super) fn names(&mut self, labels: &Labels, report: &mut Report) -> io::Result<()> {
        match self {
            ArrayFile::Npz(file) => file.names(labels, report),
            #[cfg(feature = "hdf5")]
            ArrayFile::Hdf5(file) => super::hdf5::add_names(file, labels, report).map_err(echocast_hdf5::io_error),
        }
    }

    fn finish(self) -> io::Result<()> {
        match self {
            ArrayFile::Npz(file) => file.finish(),
            #[cfg(feature = "hdf5")]
            ArrayFile::Hdf5(file) => file.close().map_err(echocast_hdf5::io_error),
        }
    }
}
