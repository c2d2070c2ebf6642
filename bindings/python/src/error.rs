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

    /// The same with the name of the argument in front, as PyO3 puts it, where a TypeError does not begin with it.
    pub fn about(self, py: Python<'_>, name: &str) -> Failure {
        let Failure::Python(error) = &self else { return self };
        let told = error.value(py).to_string();
        if name.is_empty() || told.starts_with(name) || !error.get_type(py).is(py.get_type::<PyTypeError>()) {
            return self;
        }
        Failure::Python(PyTypeError::new_err(format!("argument '{name}': {told}")))
    }
}

/// `value` is of no type that is `allowed`; PyO3 names the argument.
pub fn wrong_type(value: &Bound<'_, PyAny>, allowed: &str) -> PyErr {
    let kind = value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
    PyTypeError::new_err(format!("it is of the type {kind}; allowed: {allowed}"))
}

/// Lets `$name` be extracted as the first of its variants that fits; what is none of them gets a sentence, where PyO3 would
/// list its own types.
macro_rules! one_of {
    ($name:ident $(<$py:lifetime>)?: $($variant:ident)|+; $allowed:expr) => {
        impl<'py> pyo3::FromPyObject<'_, 'py> for $name $(<$py>)? {
            type Error = pyo3::PyErr;

            fn extract(value: pyo3::Borrowed<'_, 'py, pyo3::PyAny>) -> pyo3::PyResult<Self> {
                $( if let Ok(found) = value.extract() {
                    return Ok($name::$variant(found));
                } )+
                Err($crate::error::wrong_type(&value, $allowed))
            }
        }
    };
}
pub(crate) use one_of;

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
