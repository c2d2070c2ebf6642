//! User properties: custom properties of nodes and materials.

use serde_json::Value;
use ufbx::{Prop, PropFlags, PropType, Props};

/// The property in which 3ds Max keeps what its users write: lines of `key = value`.
const MAX_LINES: &str = "UDP3DSMAX";

/// The user property `key`, if there is one.
pub(super) fn get(props: &Props, key: &str) -> Option<Value> {
    let own = |name: &str| props.find_prop(name).filter(|prop| prop.flags.has_any(PropFlags::USER_DEFINED));
    own(key).and_then(value).or_else(|| line(&own(MAX_LINES)?.value_str, key))
}

/// The value of a property; FBX has lists and tables as strings, written as JSON.
fn value(prop: &Prop) -> Option<Value> {
    let vector = prop.value_vec4;
    match prop.type_ {
        PropType::Boolean => Some(Value::from(prop.value_int != 0)),
        PropType::Integer => Some(Value::from(prop.value_int)),
        PropType::Number | PropType::Distance => number(vector.x),
        PropType::Vector | PropType::Color | PropType::Translation | PropType::Rotation | PropType::Scaling => {
            [vector.x, vector.y, vector.z].map(number).into_iter().collect()
        }
        PropType::ColorWithAlpha => [vector.x, vector.y, vector.z, vector.w].map(number).into_iter().collect(),
        PropType::String => Some(word(&prop.value_str)),
        _ => None,
    }
}

fn number(value: f64) -> Option<Value> {
    serde_json::Number::from_f64(value).map(Value::Number)
}

/// A string, unless it holds a list or table.
fn word(text: &str) -> Value {
    let list = text.starts_with(['[', '{']).then(|| serde_json::from_str(text).ok()).flatten();
    list.unwrap_or_else(|| Value::from(text))
}

/// The value on the line of `key`: a number, list, table or string.
fn line(lines: &str, key: &str) -> Option<Value> {
    let pairs = lines.lines().filter_map(|line| line.split_once('='));
    let (_, value) = pairs.map(|(name, value)| (name.trim(), value.trim())).find(|(name, _)| *name == key)?;
    let plain = value.parse().ok().and_then(number);
    Some(plain.unwrap_or_else(|| word(value.trim_matches('"'))))
}
