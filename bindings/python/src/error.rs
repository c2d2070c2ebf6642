//! Errors: the sentences of the library as exceptions of `echocast._errors`.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyType;

/// What a function of the module returns.
pub type BindingResult<T> = Result<T, BindingError>;

/// An error of the library, or of Python.
pub enum BindingError {
    Library(echocast::Error),
    Python(PyErr),
}

impl From<echocast::Error> for BindingError {
    fn from(error: echocast::Error) -> Self {
        BindingError::Library(error)
    }
}

impl From<PyErr> for BindingError {
    fn from(error: PyErr) -> Self {
        BindingError::Python(error)
    }
}

impl BindingError {
    /// A wrong argument.
    pub fn argument(name: impl Into<String>, value: impl ToString, allowed: impl Into<String>) -> BindingError {
        BindingError::Library(echocast::Error::invalid(name, value, allowed))
    }

    /// This error, unless it is about a wrong type.
    pub fn unless_type(self, py: Python<'_>) -> Option<BindingError> {
        match &self {
            BindingError::Python(error) if error.is_instance_of::<PyTypeError>(py) => None,
            _ => Some(self),
        }
    }
}

/// The error of `pickle` and `copy` for `what`, which does not support them.
pub fn no_pickle<T>(what: &str, instead: &str) -> PyResult<T> {
    Err(PyTypeError::new_err(format!("{what} cannot be pickled or copied: {instead}")))
}

impl From<BindingError> for PyErr {
    fn from(failure: BindingError) -> PyErr {
        let error = match failure {
            BindingError::Python(error) => return error,
            BindingError::Library(error) => error,
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
