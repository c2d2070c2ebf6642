//! Options with a few named values.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use echocast::Named;

/// Takes one of the names of `T`.
pub fn of<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(T::NAMES.iter().map(|(name, _)| *name)).map(|given| {
        let (_, value) = T::NAMES.iter().find(|(name, _)| *name == given).expect("the parser lets no other through");
        *value
    })
}
