//! Changes of single values.

use super::document::Document;
use super::path::{KeyStep, join, steps};
use super::tree::{MAX_DEPTH, too_deep};
use crate::error::{Error, Result};
use crate::shown;
use serde_json::{Map, Value};

/// Keys that select one of several kinds of section, see [`split_tag`](super::split_tag).
pub const TAGS: [&str; 3] = ["type", "model", "shape"];

/// `key=value` for messages, shortened if too long to read.
pub fn assignment(key: &str, value: &str) -> String {
    format!("{}={}", shown::name(key), shown::name(value))
}

/// [`put`] for the YAML `text`.
///
/// # Errors
/// As there; no text, invalid YAML.
pub fn set(value: &mut Value, path: &str, text: &str, tags: &[&str]) -> Result<()> {
    let origin = assignment(path, text);
    let new = Document::parse(&origin, text)?.value;
    let fail = |message: String| Error::Parse { origin: origin.clone(), place: String::new(), message };
    if text.trim().is_empty() {
        return Err(fail("has no value; `null` removes a key".into()));
    }
    put(value, path, new, tags).map_err(fail)
}

/// Puts `new` at `path` (`noise.range_sigma_m`, `pattern.resolution[0]`) below `value`; `null` removes a key. Missing
/// sections on the way are created. Entries of lists are named by number or by their key `name` (`sensors.top`). Where
/// the last key is one of `tags` and changes, its section is of another kind: the keys of the old kind are removed.
///
/// # Errors
/// A sentence about a path through something that is not a section, an entry that a list does not have.
pub fn put(value: &mut Value, path: &str, new: Value, tags: &[&str]) -> Result<(), String> {
    // The limit is that of a text with the value at this place.
    if steps(path).take(MAX_DEPTH + 1).count() + depth(&new) > MAX_DEPTH {
        return Err(too_deep());
    }
    let mut place = value;
    let mut done = String::new();
    let mut steps = steps(path).peekable();
    while let Some(step) = steps.next() {
        let last = steps.peek().is_none();
        // A section without keys.
        if place.is_null() && !done.is_empty() {
            *place = Value::Object(Map::new());
        }
        place = match (step, place) {
            (KeyStep::Key(""), _) => return Err("the key has an empty part; allowed: names joined by dots".into()),
            (KeyStep::Key(key), Value::Object(map)) => {
                // A missing key gets its null: reading checks whether it may exist.
                if last && new.is_null() && map.shift_remove(key).is_some() {
                    return Ok(());
                }
                if last && tags.contains(&key) && map.get(key).is_some_and(|old| *old != new) {
                    map.clear();
                }
                done = join(&done, key);
                map.entry(key).or_insert(Value::Null)
            }
            (KeyStep::Key(key), Value::Array(items)) => {
                let length = items.len();
                let entry = items.iter_mut().find(|item| item.get("name").and_then(Value::as_str) == Some(key));
                let entry = entry.ok_or_else(|| format!("{done}, a list of {length}, has no entry called {key:?}"))?;
                done = join(&done, key);
                entry
            }
            (KeyStep::Index(index), Value::Array(items)) => {
                let length = items.len();
                done = format!("{done}[{index}]");
                items.get_mut(index).ok_or_else(|| format!("{done} is past the end of the list of {length}"))?
            }
            (KeyStep::Key(key), _) => return Err(format!("{done} has no key {key:?}: it is not a section")),
            (KeyStep::Index(_), _) => return Err(format!("{done} is not a list")),
        };
    }
    *place = new;
    Ok(())
}

/// How many sections and lists there are around the innermost value.
fn depth(value: &Value) -> usize {
    match value {
        Value::Array(items) => 1 + items.iter().map(depth).max().unwrap_or(0),
        Value::Object(map) => 1 + map.values().map(depth).max().unwrap_or(0),
        _ => 0,
    }
}
