//! Sequences: an item by its number, and one after the other.

use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

/// The place that `index` means among `count` of what is called `what`, from the end below 0; IndexError for others.
pub fn place(what: &str, index: isize, count: usize) -> PyResult<usize> {
    let place = if index < 0 { index + count as isize } else { index };
    let found = usize::try_from(place).ok().filter(|&place| place < count);
    found.ok_or_else(|| missing(what, index, count))
}

/// There is no `what` with the number `index`, whatever that is, but `count` others.
pub fn missing(what: &str, index: impl std::fmt::Display, count: usize) -> PyErr {
    PyIndexError::new_err(format!("{what} {index}; there are {count}"))
}

/// Goes through `sequence` as Python does by itself, but type checkers ask for an `__iter__`.
pub fn iterate<'py>(sequence: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    sequence.py().import("collections.abc")?.getattr("Sequence")?.call_method1("__iter__", (sequence,))
}
