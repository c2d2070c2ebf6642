//! Documents: trees of values that know their lines, read as types.

use super::message::{plain, unknown_name};
use super::path::{KeyStep, join, lookup, lookup_mut, steps};
use super::tree::{YamlTree, options, plain_message};
use crate::error::{Error, Result, nearest};
use crate::read::{self, Limit};
use crate::shown;
use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_saphyr::Spanned;
use std::path::Path;

/// Reads YAML `text` that came from `origin` (a file name, or a word for messages).
///
/// # Errors
/// As [`Document::parse`] and [`Document::read`].
pub fn from_str<T: DeserializeOwned>(origin: &str, text: &str) -> Result<T> {
    Document::parse(origin, text)?.read()
}

/// A YAML text as a tree of values, with the line of every key.
pub struct Document {
    origin: String,
    pub(super) value: Value,
    /// The same tree with lines; `None` if there is no text.
    tree: Option<Spanned<YamlTree>>,
}

impl Document {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// A missing or too long file, a syntax error with its line.
    pub fn load(path: &Path) -> Result<Document> {
        let bytes = read::bytes(path, Limit::YAML)?;
        let text = String::from_utf8(bytes).map_err(|_| Error::parse(path, "", "is not UTF-8 text"))?;
        Document::parse(&shown::path(path), &text)
    }

    /// Reads `text` that came from `origin` (a file name, or a word for messages).
    ///
    /// # Errors
    /// A text that is too long, a syntax error with its line.
    pub fn parse(origin: &str, text: &str) -> Result<Document> {
        Limit::YAML.check(origin, text.len() as u64)?;
        let tree: Spanned<YamlTree> = serde_saphyr::from_str_with_options(text, options()).map_err(|error| {
            let place = error.location().map_or(String::new(), |at| format!("line {}", at.line()));
            Error::Parse { origin: origin.to_owned(), place, message: plain_message(&error) }
        })?;
        Ok(Document { origin: origin.to_owned(), value: tree.value.to_value(), tree: Some(tree) })
    }

    /// A document of one value that came from `origin`, without lines.
    pub fn from_value(origin: impl Into<String>, value: Value) -> Document {
        Document { origin: origin.into(), value, tree: None }
    }

    /// The tree of values.
    pub fn value(&self) -> &Value {
        &self.value
    }

    /// Line of the value at `path`, or of the innermost existing section around it.
    pub fn line(&self, path: &str) -> Option<u64> {
        let mut node = self.tree.as_ref()?;
        let mut line = node.referenced.line();
        for step in steps(path) {
            match (step, &node.value) {
                (KeyStep::Key(key), YamlTree::Map(entries)) => match entries.iter().find(|(name, _)| name.value == key)
                {
                    Some((name, child)) => (line, node) = (name.referenced.line(), child),
                    None => break,
                },
                (KeyStep::Index(index), YamlTree::List(items)) => match items.get(index) {
                    Some(child) => (line, node) = (child.referenced.line(), child),
                    None => break,
                },
                _ => break,
            }
        }
        Some(line)
    }

    /// Turns the tree into a `T`.
    ///
    /// # Errors
    /// An unknown key (with similar ones), a missing key, a wrong type, with the line and the key.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T> {
        self.read_at("", &self.value)
    }

    /// Turns `value`, which is at `key`, into a `T`.
    ///
    /// # Errors
    /// As [`Document::read`].
    pub fn read_at<T: DeserializeOwned>(&self, key: &str, value: &Value) -> Result<T> {
        let (place, message) = match attempt(key, value) {
            Ok(read) => return Ok(read),
            Err(fault) => fault,
        };
        Err(self.explain(place, message, |unknown| {
            // Whether the key is known one section further up.
            let (section, name) = unknown.rsplit_once('.')?;
            let (outside, _) = section.rsplit_once('.')?;
            let inside = |path: &str| path.strip_prefix(key).map(|rest| rest.trim_start_matches('.').to_owned());
            let mut moved = value.clone();
            let taken = lookup_mut(&mut moved, &inside(section)?)?.as_object_mut()?.shift_remove(name)?;
            lookup_mut(&mut moved, &inside(outside)?)?.as_object_mut()?.insert(name.to_owned(), taken);
            attempt::<T>(key, &moved).is_ok().then(|| join(outside, name))
        }))
    }

    /// An error about `key` from serde's message; `moved` gives the place where a misplaced key belongs.
    fn explain(&self, mut key: String, mut message: String, moved: impl Fn(&str) -> Option<String>) -> Error {
        // A section chosen by a tag reports "inner.key: message", see `Section`.
        while let Some((inner, rest)) = message.split_once(": ") {
            let path = join(&key, inner);
            if lookup(&self.value, &path).is_none() {
                break;
            }
            (key, message) = (path, rest.to_owned());
        }
        if let Some((found, known)) = unknown_name(&message) {
            let what = if message.starts_with("unknown field") { "key" } else { "value" };
            let near = nearest(found, &known);
            let near = if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) };
            if what == "key" && !(key == found || key.ends_with(&format!(".{found}"))) {
                key = join(&key, found);
            }
            let allowed = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            message = match moved(&key).filter(|_| what == "key") {
                Some(place) => format!("the key is not one of this section: it is {place}; allowed here: {allowed}"),
                None => format!("unknown {what} {found:?}{near}; allowed: {allowed}"),
            };
        } else {
            message = plain(&message);
        }
        self.error(&key, &message)
    }

    /// An error about `key`: with its line, or the line of the nearest section around it.
    pub fn error(&self, key: &str, message: &str) -> Error {
        let place = match (self.line(key), key) {
            (Some(line), "") => format!("line {line}"),
            (Some(line), _) => format!("line {line}: {key}"),
            (None, _) => key.to_owned(),
        };
        Error::Parse { origin: self.origin.clone(), place, message: message.to_owned() }
    }

    /// Adds to the [`Error::Io`] of a file the place of the `key` that names it.
    pub fn asks(&self, key: &str, error: Error) -> Error {
        let Error::Io { path, source } = error else { return error };
        let place = self.line(key).map_or_else(String::new, |line| format!("line {line}: "));
        let message = format!("{source}, requested by {}: {place}{key}", shown::origin(&self.origin));
        Error::io(path, std::io::Error::new(source.kind(), message))
    }

    /// Adds file and line to an [`Error::InvalidParameter`] whose name is a key of this document.
    pub fn locate(&self, error: Error) -> Error {
        match error {
            Error::InvalidParameter { name, value, allowed } => {
                self.error(&name, &format!("is {value}; allowed: {allowed}"))
            }
            other => other,
        }
    }
}

/// Turns `value`, which is at `key`, into a `T`; otherwise the path of what is wrong, and serde's message about it.
fn attempt<T: DeserializeOwned>(key: &str, value: &Value) -> Result<T, (String, String)> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let place = match error.path().to_string() {
            root if root == "." => key.to_owned(),
            item if item.starts_with('[') => format!("{key}{item}"),
            path => join(key, &path),
        };
        (place, error.inner().to_string())
    })
}
