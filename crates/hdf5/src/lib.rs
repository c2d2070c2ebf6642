//! HDF5 files, opened by a library within a host program, and read from untrusted sources.
//!
//! The C library locks the files that it opens, with locks that belong to the handle of the system, and opens them in a
//! way that every child process inherits: a child that another thread starts meanwhile holds the lock for as long as it
//! lives, and the next attempt to open the file fails because it is in use. Files here are not locked: those that are
//! written do not have their final name yet, and those that are read are not changed. Their handles are closed in
//! children. The environment (`HDF5_DRIVER`) does not affect how they are opened.
#![allow(unsafe_code)] // only the C library gives access to the handle, and to what may be in untrusted files

mod error;
mod read;

pub use read::{Dataset, Kind, Reader, StorageLayout};

use hdf5::{File, FileBuilder, Result};
use hdf5_sys::h5i::{H5Idec_ref, hid_t};
use std::io;
use std::path::Path;

/// Creates the file at `path`; one that is there is emptied.
///
/// # Errors
/// Those of HDF5.
pub fn create(path: &Path) -> Result<File> {
    let mut options = FileBuilder::new();
    options.with_fapl(|access| access.sec2().file_locking(false));
    options.create(path).inspect(|file| keep_from_children(file.id()))
}

/// The error of the system if it is the cause, else that of HDF5.
pub fn io_error(error: hdf5::Error) -> io::Error {
    match error.stack() {
        Some(stack) => error::of(stack.iter().map(|frame| frame.desc())),
        None => io::Error::other(format!("HDF5: {error}")),
    }
}

/// An object of the C library, which is released with this.
#[derive(Debug)]
struct Id(hid_t);

impl Drop for Id {
    fn drop(&mut self) {
        // SAFETY: it is alive; called under the lock of the library.
        hdf5::sync::sync(|| unsafe { H5Idec_ref(self.0) });
    }
}

/// Closes the handle of `file` in children that are started from now on. Without a lock, the only harm of one that was
/// started before is that it keeps the space of a deleted file.
#[cfg(unix)]
fn keep_from_children(file: hid_t) {
    use rustix::fd::BorrowedFd;
    use rustix::io::{FdFlags, fcntl_setfd};
    use std::ffi::c_int;
    use std::ptr;

    let mut handle = ptr::null_mut();
    hdf5::sync::sync(|| {
        // SAFETY: the file is open, and `handle` outlives the call; called under the lock of the library.
        let status = unsafe { hdf5_sys::h5f::H5Fget_vfd_handle(file, hdf5_sys::h5p::H5P_DEFAULT, &mut handle) };
        if status < 0 || handle.is_null() {
            return;
        }
        // SAFETY: with the driver that all files are opened with here (`H5FD_SEC2`), this points to a descriptor that
        // the open file owns.
        let descriptor = unsafe { BorrowedFd::borrow_raw(*handle.cast::<c_int>()) };
        // It was opened a moment ago; if this fails, nothing can be done about it.
        let _ = fcntl_setfd(descriptor, FdFlags::CLOEXEC);
    });
}

#[cfg(not(unix))]
fn keep_from_children(_: hid_t) {}
