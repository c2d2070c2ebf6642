//! Custom properties (`extras`) of nodes and materials.

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

/// A text or a number as text: exporters turn "7" into 7 or 7.0.
pub(super) fn text(extras: &Extras, key: &str) -> Option<String> {
    match get(extras, key)? {
        Value::String(text) => Some(text),
        Value::Number(number) => Some(match number.as_f64() {
            Some(whole) if number.is_f64() && whole.fract() == 0.0 => format!("{whole}"),
            _ => number.to_string(),
        }),
        _ => None,
    }
}
