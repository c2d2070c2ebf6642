//! Values as readable YAML.

use crate::error::{Error, Result};
use crate::shown;
use serde::Serialize;
use serde_json::{Map, Value};

/// Widest line that [`to_string`] writes, where a value can be broken at all.
const WIDTH: usize = 120;

/// Writes `value` as readable YAML: one key per line, short sections and lists of numbers in flow style.
///
/// # Errors
/// A value that YAML cannot hold, such as a map whose keys are not words.
pub fn to_string<T: Serialize>(value: &T) -> Result<String> {
    let value = serde_json::to_value(value).map_err(|error| Error::Internal(error.to_string()))?;
    let mut text = String::new();
    match &value {
        Value::Object(map) if !map.is_empty() => write_map(&mut text, map, 0),
        // Where a text or a file name is accepted, an empty text would be a file name: a section without keys is `{}`.
        other => text = flow(other) + "\n",
    }
    Ok(text)
}

fn write_map(text: &mut String, map: &Map<String, Value>, indent: usize) {
    for (key, value) in map {
        let start = format!("{:indent$}{}:", "", scalar(key));
        text.push_str(&start);
        let inline = flow(value);
        match value {
            _ if start.len() + 1 + inline.len() <= WIDTH => {
                text.push(' ');
                text.push_str(&inline);
                text.push('\n');
            }
            Value::Object(section) => {
                text.push('\n');
                write_map(text, section, indent + 2);
            }
            Value::Array(items) => {
                text.push('\n');
                write_list(text, items, indent + 2);
            }
            _ => {
                text.push(' ');
                text.push_str(&inline);
                text.push('\n');
            }
        }
    }
}

/// A long list, with as many items per line as fit.
fn write_list(text: &mut String, items: &[Value], indent: usize) {
    let mut line = format!("{:indent$}[", "");
    for (i, item) in items.iter().enumerate() {
        let item = flow(item) + if i + 1 < items.len() { "," } else { "]" };
        if line.len() + 1 + item.len() > WIDTH && line.len() > indent + 1 {
            text.push_str(line.trim_end());
            text.push('\n');
            line = format!("{:indent$} ", "");
        }
        line.push_str(&item);
        line.push(' ');
    }
    text.push_str(line.trim_end());
    text.push('\n');
}

/// `value` on one line.
fn flow(value: &Value) -> String {
    match value {
        Value::Object(map) => {
            let entries: Vec<String> =
                map.iter().map(|(key, value)| format!("{}: {}", scalar(key), flow(value))).collect();
            format!("{{{}}}", entries.join(", "))
        }
        Value::Array(items) => format!("[{}]", items.iter().map(flow).collect::<Vec<_>>().join(", ")),
        Value::String(text) => scalar(text),
        Value::Number(number) => match number.as_f64() {
            // Whole numbers without ".0", and no long runs of zeros.
            Some(x) if number.is_f64() && x != 0.0 && !(1e-5..1e15).contains(&x.abs()) => format!("{x:e}"),
            Some(x) if number.is_f64() => format!("{x}"),
            _ => number.to_string(),
        },
        other => other.to_string(),
    }
}

/// `text` unquoted where YAML would read it back as the same text, quoted otherwise.
fn scalar(text: &str) -> String {
    let words = ["true", "false", "null", "yes", "no", "on", "off", "y", "n"];
    let bare = text.starts_with(|c: char| c.is_ascii_alphabetic())
        && !text.ends_with(' ')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-./() ;+".contains(c))
        && !words.contains(&text.to_ascii_lowercase().as_str());
    if bare {
        return text.to_owned();
    }
    // A JSON string is a YAML string, and JSON escapes only some control characters.
    let quoted = Value::from(text).to_string();
    quoted.chars().fold(String::new(), |mut shown, c| {
        if shown::is_unseen(c) {
            shown.push_str(&format!("\\u{:04x}", u32::from(c)))
        } else {
            shown.push(c)
        }
        shown
    })
}
