//! Paths of values: `a.b[3]`.

use serde_json::Value;

/// `path` followed by `key`.
pub fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// The value at `path` (`a.b[3]`) below `value`.
pub fn lookup<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    steps(path).try_fold(value, |value, step| match step {
        KeyStep::Key(key) => value.get(key),
        KeyStep::Index(index) => value.get(index),
    })
}

/// [`lookup`] of a value to be changed.
pub(super) fn lookup_mut<'v>(value: &'v mut Value, path: &str) -> Option<&'v mut Value> {
    steps(path).filter(|step| *step != KeyStep::Key("")).try_fold(value, |value, step| match step {
        KeyStep::Key(key) => value.get_mut(key),
        KeyStep::Index(index) => value.get_mut(index),
    })
}

/// Whether two paths name the same place.
pub fn same_path(a: &str, b: &str) -> bool {
    steps(a).eq(steps(b))
}

/// Paths of all numbers below `value`.
pub fn numbers(value: &Value) -> Vec<String> {
    fn add(value: &Value, path: &str, paths: &mut Vec<String>) {
        match value {
            Value::Number(_) => paths.push(path.to_owned()),
            Value::Array(items) => {
                items.iter().enumerate().for_each(|(index, item)| add(item, &format!("{path}[{index}]"), paths));
            }
            Value::Object(map) => map.iter().for_each(|(key, item)| add(item, &join(path, key), paths)),
            _ => {}
        }
    }
    let mut paths = Vec::new();
    add(value, "", &mut paths);
    paths
}

/// A part of a path.
#[derive(PartialEq)]
pub(super) enum KeyStep<'p> {
    Key(&'p str),
    Index(usize),
}

/// Splits `a.b[3]` into a, b, 3.
pub(super) fn steps(path: &str) -> impl Iterator<Item = KeyStep<'_>> {
    path.split(['.', '[']).map(|step| match step.strip_suffix(']').and_then(|index| index.parse().ok()) {
        Some(index) => KeyStep::Index(index),
        None => KeyStep::Key(step),
    })
}
