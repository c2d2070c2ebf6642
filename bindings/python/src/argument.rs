//! Arguments: the error for a wrong one is a sentence that begins with its name. PyO3 puts the name in a note, which
//! the text of an exception does not show, and which Python 3.10 does not have.

use crate::array::{numbers, rows};
use crate::error::{BindingError, BindingResult};
use numpy::ndarray::{Ix1, Ix2};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyUnicodeEncodeError};
use pyo3::prelude::*;
use pyo3::types::{PyMapping, PyString};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A type that can be an argument of a function.
pub trait Argument<'a, 'py>: Sized {
    /// Converts `value`, which was given for `name`.
    fn of(name: &str, value: &'a Bound<'py, PyAny>) -> BindingResult<Self>;
}

/// Defines how arguments with these names are read: `#[pyo3(from_py_with = argument::seed)] seed: u64`.
macro_rules! named {
    ($($name:ident)+) => { $(
        pub fn $name<'a, 'py, T: Argument<'a, 'py>>(value: &'a Bound<'py, PyAny>) -> PyResult<T> {
            Ok(T::of(stringify!($name), value)?)
        }
    )+ };
}

named! {
    alpha_image beam blend cameras category cell_m check child_frame_id color column columns count cube driver
    environment files filter fixed folder format frame frame_id image image_matrix imu instance key kind layer length
    mask material materials mesh message name names number object objects overlap parts path pixels position quaternion
    range resume row rpy_deg samples scenario scene seed sensor shard source stamp table threads time view width wrap
}

/// The error for a `value` whose type is not `allowed` for `name`.
pub fn wrong_type(name: &str, value: &Bound<'_, PyAny>, allowed: &str) -> BindingError {
    let kind = value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
    PyTypeError::new_err(format!("{name} is of the type {kind}; allowed: {allowed}")).into()
}

/// What PyO3 has made of `value`, or an error in place of PyO3's. Other errors are kept: `value` may run code of its
/// own.
fn converted<T>(found: PyResult<T>, name: &str, value: &Bound<'_, PyAny>, allowed: &str) -> BindingResult<T> {
    found.map_err(|error| {
        let py = value.py();
        if error.is_instance_of::<PyTypeError>(py) {
            wrong_type(name, value, allowed)
        } else if error.is_instance_of::<PyOverflowError>(py) || error.is_instance_of::<PyUnicodeEncodeError>(py) {
            let shown = value.repr().map_or_else(|_| "beyond that".to_owned(), |shown| shown.to_string());
            BindingError::argument(name, shown, allowed)
        } else {
            error.into()
        }
    })
}

/// `value` as a whole number, 0 to the greatest `T`.
fn whole<T: TryFrom<u64>>(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<T> {
    let most = u64::MAX >> (64 - 8 * size_of::<T>());
    let number = match value.extract::<u64>() {
        Err(error) if error.is_instance_of::<PyTypeError>(value.py()) => {
            return Err(wrong_type(name, value, &format!("a whole number from 0 to {most}")));
        }
        number => converted(number, name, value, &format!("0 to {most}"))?,
    };
    T::try_from(number).map_err(|_| BindingError::argument(name, number, format!("0 to {most}")))
}

macro_rules! whole {
    ($($kind:ty)+) => { $(
        impl Argument<'_, '_> for $kind {
            fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
                whole(name, value)
            }
        }
    )+ };
}

whole! { u8 u16 u32 u64 usize }

impl Argument<'_, '_> for f64 {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        converted(value.extract(), name, value, "a number")
    }
}

impl Argument<'_, '_> for bool {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        converted(value.extract(), name, value, "True or False")
    }
}

impl<'a> Argument<'a, '_> for &'a str {
    fn of(name: &str, value: &'a Bound<'_, PyAny>) -> BindingResult<Self> {
        converted(value.extract(), name, value, "a text")
    }
}

impl Argument<'_, '_> for String {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        <&str>::of(name, value).map(str::to_owned)
    }
}

impl Argument<'_, '_> for PathBuf {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        converted(value.extract(), name, value, "the path of a file or folder")
    }
}

/// Lists of items; a text, which is a sequence, too, is none.
macro_rules! list {
    ($($kind:ty, $allowed:literal);+) => { $(
        impl Argument<'_, '_> for Vec<$kind> {
            fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
                if value.is_instance_of::<PyString>() {
                    return Err(wrong_type(name, value, $allowed));
                }
                let items: Vec<Bound<'_, PyAny>> = converted(value.extract(), name, value, $allowed)?;
                let item = |item: &Bound<'_, PyAny>| Argument::of(&format!("an item of {name}"), item);
                items.iter().map(item).collect()
            }
        }
    )+ };
}

list! {
    u64, "whole numbers in a list or tuple"; u32, "whole numbers in a list or tuple"; String, "a list of texts";
    PathBuf, "a list of paths"
}

impl<const N: usize> Argument<'_, '_> for [f64; N] {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        if let Ok(found) = value.extract() {
            return Ok(found);
        }
        let array = numbers::<f64, Ix1>(name, value, &N.to_string())?;
        let found = array.as_array().to_vec();
        found.try_into().map_err(|found: Vec<f64>| {
            let plural = if found.len() == 1 { "" } else { "s" };
            BindingError::argument(name, format!("{} number{plural}", found.len()), N.to_string())
        })
    }
}

impl Argument<'_, '_> for [[f64; 3]; 3] {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        let rows = rows::<f64, 3>(name, &numbers::<f64, Ix2>(name, value, "3 x 3")?)?;
        rows.try_into().map_err(|rows: Vec<_>| BindingError::argument(name, format!("{} x 3", rows.len()), "3 x 3"))
    }
}

impl Argument<'_, '_> for BTreeMap<u32, String> {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        let Ok(keys) = value.cast::<PyMapping>() else {
            return Err(wrong_type(name, value, "a dict of names by their numbers"));
        };
        let (number, named) = (format!("a number in {name}"), format!("a name in {name}"));
        let item = |item: Bound<'_, PyAny>| {
            let (key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
            Ok((Argument::of(&number, &key)?, Argument::of(&named, &value)?))
        };
        keys.items()?.into_iter().map(item).collect()
    }
}

impl<'a, 'py, T: Argument<'a, 'py>> Argument<'a, 'py> for Option<T> {
    fn of(name: &str, value: &'a Bound<'py, PyAny>) -> BindingResult<Self> {
        if value.is_none() { Ok(None) } else { T::of(name, value).map(Some) }
    }
}

impl<'py> Argument<'_, 'py> for Bound<'py, PyAny> {
    fn of(_: &str, value: &Bound<'py, PyAny>) -> BindingResult<Self> {
        Ok(value.clone())
    }
}

impl<'py> Argument<'_, 'py> for Bound<'py, PyMapping> {
    fn of(name: &str, value: &Bound<'py, PyAny>) -> BindingResult<Self> {
        converted(value.cast().cloned().map_err(Into::into), name, value, "a dict")
    }
}

/// Allows objects of a class of the module as arguments.
macro_rules! class {
    ($class:ty, $allowed:literal) => {
        impl<'py> $crate::argument::Argument<'_, 'py> for pyo3::Bound<'py, $class> {
            fn of(name: &str, value: &pyo3::Bound<'py, pyo3::PyAny>) -> $crate::error::BindingResult<Self> {
                value.cast().cloned().map_err(|_| $crate::argument::wrong_type(name, value, $allowed))
            }
        }
    };
}
pub(crate) use class;

/// Converts to the first variant of `$name` that fits.
macro_rules! one_of {
    ($name:ident $(<$py:lifetime>)?: $($variant:ident)|+; $allowed:expr) => {
        impl<'py> $crate::argument::Argument<'_, 'py> for $name $(<$py>)? {
            fn of(name: &str, value: &pyo3::Bound<'py, pyo3::PyAny>) -> $crate::error::BindingResult<Self> {
                // The error for a value of the right type that is not allowed.
                let mut close = None;
                $( match $crate::argument::Argument::of(name, value) {
                    Ok(found) => return Ok($name::$variant(found)),
                    Err(error) => close = close.or_else(|| error.unless_type(value.py())),
                } )+
                Err(close.unwrap_or_else(|| $crate::argument::wrong_type(name, value, $allowed)))
            }
        }
    };
}
pub(crate) use one_of;
