//! Custom properties (`extras`) of nodes and materials.

use crate::properties;
use gltf::json::extras::Extras;
use serde_json::Value;

/// The custom property `key`, if there is one.
pub(super) fn get(extras: &Extras, key: &str) -> Option<Value> {
    let raw = extras.as_ref()?.get();
    // Most extras hold nothing of ours: searching is faster than parsing.
    if !raw.contains(key) {
        return None;
    }
    match serde_json::from_str(raw) {
        Ok(Value::Object(mut map)) => map.remove(key).filter(|value| !value.is_null()),
        _ => None,
    }
}

/// A string, or a number as a string.
pub(super) fn text(extras: &Extras, key: &str) -> Option<String> {
    properties::text(get(extras, key)?)
}
