//! Errors: the sentences of the library as exceptions of `echocast._errors`.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyType;

/// What a function of the module returns.
pub type Outcome<T> = Result<T, Failure>;

/// An error of the library, or of Python.
pub enum Failure {
    Library(echocast::Error),
    Python(PyErr),
}

impl From<echocast::Error> for Failure {
    fn from(error: echocast::Error) -> Self {
        Failure::Library(error)
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Failure::Python(error)
    }
}

impl Failure {
    /// A wrong argument.
    pub fn argument(name: impl Into<String>, value: impl ToString, allowed: impl Into<String>) -> Failure {
        Failure::Library(echocast::Error::invalid(name, value, allowed))
    }

    /// It, unless it says that something is of a wrong type.
    pub fn unless_type(self, py: Python<'_>) -> Option<Failure> {
        match &self {
            Failure::Python(error) if error.is_instance_of::<PyTypeError>(py) => None,
            _ => Some(self),
        }
    }
}

/// What is said where `pickle` and `copy` take `what`, which they cannot.
pub fn no_pickle<T>(what: &str, instead: &str) -> PyResult<T> {
    Err(PyTypeError::new_err(format!("{what} cannot be pickled or copied: {instead}")))
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> PyErr {
        let error = match failure {
            Failure::Python(error) => return error,
            Failure::Library(error) => error,
        };
        Python::attach(|py| {
            let class = class_of(&error);
            let found = py.import("echocast._errors").and_then(|module| module.getattr(class));
            match found.and_then(|class| Ok(class.cast_into::<PyType>()?)) {
                Ok(class) => PyErr::from_type(class, error.to_string()),
                Err(other) => other,
            }
        })
    }
}

/// The exception for `error`.
fn class_of(error: &echocast::Error) -> &'static str {
    use echocast::Error::{Cancelled, InvalidParameter, Io, Memory, Missing, Parse, Unsupported};
    match error {
        Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => "NotFoundError",
        Io { .. } => "FileError",
        Parse { .. } => "FormatError",
        InvalidParameter { .. } | Missing { .. } => "ArgumentError",
        Unsupported { .. } => "UnsupportedError",
        Cancelled => "CancelledError",
        Memory(_) => "OutOfMemoryError",
        _ => "Error",
    }
}
