//! Serde's messages in users' terms.

/// Serde's messages about missing keys and wrong types, in users' terms.
pub fn plain(message: &str) -> String {
    if let Some(missing) = message.strip_prefix("missing field ") {
        return format!("the key {missing} is missing");
    }
    match message.rsplit_once(", expected ") {
        Some((found, expected)) => format!("{found}, expected {}", plain_type(expected)),
        None => message.to_owned(),
    }
}

/// A type in users' terms.
fn plain_type(expected: &str) -> String {
    let of_length = ["an array of length ", "a tuple of size ", "tuple of ", "tuple struct "].into_iter();
    if let Some(rest) = of_length.filter_map(|start| expected.strip_prefix(start)).next() {
        let length: String = rest.chars().filter(char::is_ascii_digit).collect();
        return if length.is_empty() { "a list".to_owned() } else { format!("a list of {length}") };
    }
    let plain = match expected {
        "f64" | "f32" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "usize" | "i8" | "i16" | "i32" | "i64" => "a whole number",
        "a sequence" => "a list",
        "a map" => "a section of keys",
        "unit" => "nothing",
        "string or map" | "variant identifier" => "a word",
        name if name.starts_with("struct ") || name.starts_with("newtype struct ") => "a section of keys",
        name if name.starts_with("enum ") => "a word",
        name if name.starts_with("unit struct ") => "nothing",
        other => other,
    };
    plain.to_owned()
}

/// The names in "unknown field `a`, expected one of `b`, `c`": (a, [b, c]).
pub(super) fn unknown_name(message: &str) -> Option<(&str, Vec<&str>)> {
    if !(message.starts_with("unknown field `") || message.starts_with("unknown variant `")) {
        return None;
    }
    // The unknown name itself may contain anything, so it is cut at the words that follow it.
    let start = message.find('`')? + 1;
    let end = message.rfind("`, expected ").or_else(|| message.rfind("`, there are no "))?;
    let known = message[end + 1..].split('`').skip(1).step_by(2).collect();
    Some((message.get(start..end)?, known))
}
