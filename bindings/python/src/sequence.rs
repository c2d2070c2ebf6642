//! Sequences: indexing and iteration.

use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

/// The place of `index` among `count` items called `what`, from the end if it is negative; IndexError for others.
pub fn place(what: &str, index: isize, count: usize) -> PyResult<usize> {
    let place = if index < 0 { index + count as isize } else { index };
    let found = usize::try_from(place).ok().filter(|&place| place < count);
    found.ok_or_else(|| missing(what, index, count))
}

/// The error for an `index` of which there is no `what`, but `count` others.
pub fn missing(what: &str, index: impl std::fmt::Display, count: usize) -> PyErr {
    PyIndexError::new_err(format!("{what} {index}; there are {count}"))
}

/// Iterates over `sequence` as Python does by itself, but type checkers require an `__iter__`.
pub fn iterate<'py>(sequence: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    sequence.py().import("collections.abc")?.getattr("Sequence")?.call_method1("__iter__", (sequence,))
}
