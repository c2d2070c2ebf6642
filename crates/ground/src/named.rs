//! Choices between a few named values.

use super::error::{Error, Result, nearest};

/// A type of a few named values: the names of options and files, and the numbers of the C ABI, which count them from 0.
pub trait Named: Copy + PartialEq + 'static {
    /// Every value with its name.
    const NAMES: &'static [(&'static str, Self)];
}

/// The value called `name`; an error lists similar names and all others. `what`: kind of thing, for the error.
pub fn by_name<T: Named>(what: &'static str, name: &str) -> Result<T> {
    if let Some((_, value)) = T::NAMES.iter().find(|(known, _)| *known == name) {
        return Ok(*value);
    }
    // There are so few names that the message may list all of them, similar ones first.
    let mut names = nearest(name, T::NAMES.iter().map(|(known, _)| known));
    for (known, _) in T::NAMES {
        if !names.iter().any(|near| near == known) {
            names.push((*known).to_owned());
        }
    }
    Err(Error::Missing { what, name: name.to_owned(), near: names })
}

/// Names the values of a type, in the order of their numbers.
#[macro_export]
macro_rules! named {
    ($type:ident: $($variant:ident $name:literal),* $(,)?) => {
        impl $crate::named::Named for $type {
            const NAMES: &'static [(&'static str, Self)] = &[$(($name, $type::$variant)),*];
        }

        impl $type {
            /// Its name in options and files.
            pub fn name(self) -> &'static str {
                let mut names = <Self as $crate::named::Named>::NAMES.iter();
                names.find(|(_, known)| *known == self).map_or("", |(name, _)| name)
            }
        }
    };
}
