//! Sections of keys that select their kind, lists that may be single items.

use serde::Deserialize;
use serde::de::{self, DeserializeOwned, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use std::fmt;
use std::marker::PhantomData;

/// A mapping without the key that selects its kind, see [`split_tag`].
pub struct Section {
    tag: &'static str,
    keys: Map<String, Value>,
}

/// Reads a mapping whose key `tag` selects one of several kinds of section: the word, and the other keys. Unlike
/// serde's own tagged enums, errors keep the key they are about.
///
/// # Errors
/// Not a mapping; no such key, or its value is not a word.
pub fn split_tag<'de, D: Deserializer<'de>>(deserializer: D, tag: &'static str) -> Result<(String, Section), D::Error> {
    let mut keys = Map::deserialize(deserializer)?;
    match keys.shift_remove(tag) {
        Some(Value::String(word)) => Ok((word, Section { tag, keys })),
        Some(_) => Err(de::Error::custom(format!("{tag}: is not a word"))),
        None => Err(de::Error::missing_field(tag)),
    }
}

/// Reads a mapping as two: the keys that `first` names, and all others.
///
/// # Errors
/// Not a mapping.
pub fn split_keys<'de, D: Deserializer<'de>>(
    deserializer: D,
    first: &'static [&'static str],
) -> Result<(Section, Section), D::Error> {
    let (taken, left) = Map::deserialize(deserializer)?.into_iter().partition(|(key, _)| first.contains(&key.as_str()));
    Ok((Section { tag: "", keys: taken }, Section { tag: "", keys: left }))
}

/// Reads a list of words, or a word as a list of one.
///
/// # Errors
/// Neither.
pub fn one_or_more_words<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    match Value::deserialize(deserializer)? {
        Value::String(word) => Ok(vec![word]),
        value => inner(&value),
    }
}

/// Reads a list, a section as a list of one, or nothing as an empty list.
///
/// # Errors
/// None of these; what is wrong in an item.
pub fn one_or_more<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
    struct OneOrMore<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for OneOrMore<T> {
        type Value = Vec<T>;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a section of keys or a list of them")
        }
        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Vec<T>, A::Error> {
            Ok(vec![T::deserialize(de::value::MapAccessDeserializer::new(map))?])
        }
        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Vec<T>, A::Error> {
            Deserialize::deserialize(de::value::SeqAccessDeserializer::new(seq))
        }
        fn visit_unit<E: de::Error>(self) -> Result<Vec<T>, E> {
            Ok(Vec::new())
        }
    }
    deserializer.deserialize_any(OneOrMore(PhantomData))
}

/// Turns `value`, which is read as a part of another, into a `T`.
///
/// # Errors
/// As [`Document::read`](super::Document::read), with the key in front.
pub fn inner<T: DeserializeOwned, E: de::Error>(value: &Value) -> Result<T, E> {
    // By reference, like whole documents: by value all of it would be compiled again.
    serde_path_to_error::deserialize(value).map_err(|error| match error.path().to_string().as_str() {
        "." => E::custom(error.inner()),
        path => E::custom(format!("{path}: {}", error.inner())),
    })
}

impl Section {
    /// Names of the keys.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.keys.keys().map(String::as_str)
    }

    /// Turns the keys into a `T`.
    ///
    /// # Errors
    /// As [`Document::read`](super::Document::read), with the key in front.
    pub fn read<T: DeserializeOwned, E: de::Error>(self) -> Result<T, E> {
        inner(&Value::Object(self.keys))
    }

    /// Checks that there are no keys.
    ///
    /// # Errors
    /// As [`Section::read`].
    pub fn end<E: de::Error>(self) -> Result<(), E> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct NoKeys {}
        let NoKeys {} = self.read()?;
        Ok(())
    }

    /// The error that `word` is not one of the kinds `known`.
    pub fn unknown<E: de::Error>(&self, word: &str, known: &'static [&'static str]) -> E {
        E::custom(format!("{}: {}", self.tag, E::unknown_variant(word, known)))
    }
}
