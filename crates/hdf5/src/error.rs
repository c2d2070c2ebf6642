//! Errors of HDF5: a stack of sentences, the outermost first.

use hdf5_sys::h5::herr_t;
use hdf5_sys::h5e::{H5E_DEFAULT, H5E_WALK_DOWNWARD, H5E_error2_t, H5Ewalk2};
use std::ffi::{CStr, c_uint, c_void};
use std::io;

/// The last error of HDF5, whose lock the caller must hold. What it quotes from a file may not be UTF-8.
pub(crate) fn last() -> io::Error {
    unsafe extern "C" fn note(_: c_uint, error: *const H5E_error2_t, all: *mut c_void) -> herr_t {
        // SAFETY: `all` is the list below, borrowed by nothing else during the walk; the error is alive for the call.
        let (all, error) = unsafe { (&mut *all.cast::<Vec<String>>(), &*error) };
        if !error.desc.is_null() {
            // SAFETY: a C string that lives as long as the error.
            all.push(unsafe { CStr::from_ptr(error.desc) }.to_string_lossy().into_owned());
        }
        0
    }
    let mut all: Vec<String> = Vec::new();
    // SAFETY: `all` outlives the call.
    unsafe { H5Ewalk2(H5E_DEFAULT, H5E_WALK_DOWNWARD, Some(note), (&raw mut all).cast()) };
    of(all.iter().map(String::as_str))
}

/// The error of the system if it is the cause. HDF5 itself reports places in its memory and its sources.
pub(crate) fn of<'a>(sentences: impl DoubleEndedIterator<Item = &'a str> + Clone) -> io::Error {
    let number = |sentence: &str| {
        let digits = sentence.split_once("errno = ")?.1;
        digits.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
    };
    // For a filter that is not installed, the innermost sentence is about the folders that were searched.
    let filter = || sentences.clone().find(|sentence| sentence.starts_with("required filter"));
    // If one error follows from another, such as closing what could not be written, the first states the cause.
    match (sentences.clone().find_map(number), filter().or_else(|| sentences.clone().next_back())) {
        (Some(number), _) => io::Error::from_raw_os_error(number),
        (None, Some(last)) => io::Error::other(format!("HDF5: {}", last.split([',', ':']).next().unwrap_or_default())),
        (None, None) => io::Error::other("HDF5: an error without a reason"),
    }
}
