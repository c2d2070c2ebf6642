//! Reading and writing YAML: the only file that depends on the YAML crate.
//!
//! A text is read in two steps: YAML to a tree of values that remembers the line of every key, then the tree to a type.
//! So every error can name file, line and key, even errors found later ([`Document::locate`]).

use crate::ground::error::{Error, Result, nearest};
use crate::ground::shown;
use crate::read::{self, Limit};
use serde::de::{self, DeserializeOwned, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Number, Value};
use serde_saphyr::{Options, Spanned};
use std::fmt;
use std::marker::PhantomData;
use std::path::Path;

/// Deepest nesting accepted: three times what our files need. Parsing recurses at every level, on the caller's stack,
/// and little stack is promised to be enough.
const MAX_DEPTH: usize = 24;

/// Reads YAML `text` that came from `origin` (a file name, or a word for messages).
///
/// # Errors
/// As [`load`].
pub fn from_str<T: DeserializeOwned>(origin: &str, text: &str) -> Result<T> {
    Document::parse(origin, text)?.read()
}

/// A YAML text as a tree of values, with the line of every key.
pub struct Document {
    origin: String,
    value: Value,
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

/// `path` followed by `key`.
pub fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// The names in "unknown field `a`, expected one of `b`, `c`": (a, [b, c]).
fn unknown_name(message: &str) -> Option<(&str, Vec<&str>)> {
    if !(message.starts_with("unknown field `") || message.starts_with("unknown variant `")) {
        return None;
    }
    // The unknown name itself may contain anything, so it is cut at the words that follow it.
    let start = message.find('`')? + 1;
    let end = message.rfind("`, expected ").or_else(|| message.rfind("`, there are no "))?;
    let known = message[end + 1..].split('`').skip(1).step_by(2).collect();
    Some((message.get(start..end)?, known))
}

/// The value at `path` (`a.b[3]`) below `value`.
pub fn lookup<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    steps(path).try_fold(value, |value, step| match step {
        KeyStep::Key(key) => value.get(key),
        KeyStep::Index(index) => value.get(index),
    })
}

/// [`lookup`] of a value to be changed.
fn lookup_mut<'v>(value: &'v mut Value, path: &str) -> Option<&'v mut Value> {
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

#[derive(PartialEq)]
enum KeyStep<'p> {
    Key(&'p str),
    Index(usize),
}

/// Splits `a.b[3]` into a, b, 3.
fn steps(path: &str) -> impl Iterator<Item = KeyStep<'_>> {
    path.split(['.', '[']).map(|step| match step.strip_suffix(']').and_then(|index| index.parse().ok()) {
        Some(index) => KeyStep::Index(index),
        None => KeyStep::Key(step),
    })
}

/// Keys that select one of several kinds of section, see [`split_tag`].
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

fn too_deep() -> String {
    format!("sections and lists are nested deeper than {MAX_DEPTH}, the most allowed")
}

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
/// As [`Document::read`], with the key in front.
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
    /// As [`Document::read`], with the key in front.
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

/// A YAML value with the lines of its contents.
enum YamlTree {
    Leaf(Value),
    List(Vec<Spanned<YamlTree>>),
    Map(Vec<(Spanned<String>, Spanned<YamlTree>)>),
}

impl YamlTree {
    fn to_value(&self) -> Value {
        match self {
            YamlTree::Leaf(value) => value.clone(),
            YamlTree::List(items) => items.iter().map(|item| item.value.to_value()).collect(),
            YamlTree::Map(entries) => {
                entries.iter().map(|(key, item)| (key.value.clone(), item.value.to_value())).collect()
            }
        }
    }
}

/// YAML 1.2 words (`yes` is a text), and limits against texts made to exhaust memory.
fn options() -> Options {
    serde_saphyr::options! {
        strict_booleans: true,
        with_snippet: false,
        budget: serde_saphyr::budget! { max_depth: MAX_DEPTH, flow_nesting_limit: MAX_DEPTH },
    }
}

/// The YAML crate's message, on one line, without the place (which we add ourselves) and without terms that only its
/// own users know.
fn plain_message(error: &serde_saphyr::Error) -> String {
    use serde_saphyr::Error as Yaml;
    use serde_saphyr::budget::BudgetBreach;
    match error.without_snippet() {
        Yaml::AliasError { error, .. } => plain_message(error),
        Yaml::Budget { breach: BudgetBreach::Depth { .. }, .. } => too_deep(),
        Yaml::Budget { .. }
        | Yaml::AliasReplayCounterOverflow { .. }
        | Yaml::AliasReplayLimitExceeded { .. }
        | Yaml::AliasExpansionLimitExceeded { .. }
        | Yaml::AliasReplayStackDepthExceeded { .. } => {
            "there are too many values, including those that aliases repeat".into()
        }
        Yaml::DuplicateMappingKey { key: Some(key), .. } => format!("duplicate key {:?}", shown::name(key)),
        Yaml::DuplicateMappingKey { key: None, .. } => "duplicate key".into(),
        Yaml::MultipleDocuments { .. } => "a second document begins; allowed: one".into(),
        Yaml::NonFiniteFloat { value, .. } => format!("{} is not a finite number", shown::name(value)),
        other => {
            let text = other.render_with_formatter(&serde_saphyr::UserMessageFormatter);
            let line = text.lines().next().unwrap_or_default();
            if line.starts_with("recursion limit") {
                return too_deep();
            }
            line.rsplit_once(" at line ").map_or(line, |(message, _)| message).to_owned()
        }
    }
}

impl<'de> Deserialize<'de> for YamlTree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TreeVisitor;

        impl<'de> Visitor<'de> for TreeVisitor {
            type Value = YamlTree;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a YAML value")
            }
            fn visit_unit<E>(self) -> Result<YamlTree, E> {
                Ok(YamlTree::Leaf(Value::Null))
            }
            fn visit_bool<E>(self, value: bool) -> Result<YamlTree, E> {
                Ok(YamlTree::Leaf(Value::Bool(value)))
            }
            fn visit_i64<E>(self, value: i64) -> Result<YamlTree, E> {
                Ok(YamlTree::Leaf(value.into()))
            }
            fn visit_u64<E>(self, value: u64) -> Result<YamlTree, E> {
                Ok(YamlTree::Leaf(value.into()))
            }
            fn visit_f64<E: de::Error>(self, value: f64) -> Result<YamlTree, E> {
                let number = Number::from_f64(value);
                Ok(YamlTree::Leaf(Value::Number(number.ok_or_else(|| E::custom("a number that is not finite"))?)))
            }
            fn visit_str<E>(self, value: &str) -> Result<YamlTree, E> {
                Ok(YamlTree::Leaf(value.into()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<YamlTree, A::Error> {
                let mut items = Vec::new();
                while let Some(item) = access.next_element()? {
                    items.push(item);
                }
                Ok(YamlTree::List(items))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<YamlTree, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = access.next_entry()? {
                    entries.push(entry);
                }
                Ok(YamlTree::Map(entries))
            }
        }
        deserializer.deserialize_any(TreeVisitor)
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::collections::HashMap;

    fn value(text: &str) -> Result<Value> {
        Document::parse("text", text).map(|document| document.value)
    }

    #[test]
    fn words_are_those_of_yaml_1_2() {
        let text = "{a: yes, b: true, c: 0x1F, d: 1e3, e: ~, f: '1', g: [1, -2.5], h: on, i: 2024-01-01}";
        let expected = json!({"a": "yes", "b": true, "c": 31, "d": 1000.0, "e": null, "f": "1", "g": [1, -2.5], "h": "on", "i": "2024-01-01"});
        assert_eq!(value(text).unwrap(), expected);
        assert_eq!(value("base: &b {x: 1}\nmore: *b\n").unwrap(), json!({"base": {"x": 1}, "more": {"x": 1}}));
    }

    #[test]
    fn numbers_are_finite() {
        for text in ["x: .inf", "x: [.nan]", "x: 1e999"] {
            assert!(value(text).unwrap_err().to_string().starts_with("text: line 1: "), "{text}");
        }
    }

    #[test]
    fn texts_made_to_exhaust_memory_are_refused() {
        let deep = "[".repeat(100_000);
        let deep_blocks: String = (0..5_000).map(|i| format!("{}a:\n", " ".repeat(i))).collect();
        let doubling: String = (1..40).map(|i| format!("k{i}: &k{i} [*k{0}, *k{0}]\n", i - 1)).collect();
        let doubling = format!("k0: &k0 [x, x]\n{doubling}");
        let long = format!("a: &a {}\nb: [{}]\n", "x".repeat(1_000_000), "*a, ".repeat(40_000));
        let wide = format!("[{}]", "1,".repeat(300_000));
        for text in [deep, deep_blocks, doubling, long, wide] {
            let error = value(&text).unwrap_err().to_string();
            assert!(error.starts_with("text: line ") && error.len() < 1000, "{error}");
        }
    }

    #[test]
    fn messages_of_the_crate_are_made_plain() {
        for (text, expected) in [
            ("a: 1\na: 2".to_owned(), "line 2: duplicate key \"a\""),
            ("[".repeat(100), "line 1: sections and lists are nested deeper than 24, the most allowed"),
            (format!("[{}]", "1,".repeat(300_000)), "line 1: there are too many values, including those that"),
            ("a: 1\n---\nb: 2".to_owned(), "line 3: a second document begins; allowed: one"),
            ("a: .inf".to_owned(), "line 1: .inf is not a finite number"),
        ] {
            let error = value(&text).unwrap_err().to_string();
            assert!(error.starts_with(&format!("text: {expected}")), "{error}");
        }
    }

    #[test]
    fn a_text_is_read_up_to_a_limit() {
        let error = value(&" ".repeat((16 << 20) + 1)).unwrap_err().to_string();
        assert_eq!(error, "text: is longer than 16 MiB, the most allowed");
        assert!(Document::load(Path::new("no/such.yaml")).err().unwrap().to_string().starts_with("no/such.yaml: "));
    }

    #[test]
    fn written_text_reads_back_the_same() {
        let tree = json!({
            "plain": "two words", "number": "12", "word": "Yes", "empty": "", "colon": "a: b", "hash": "a #b", "dash": "- a",
            "quote": "\"\\\n\t", "accent": "\u{e9}\u{1f600}", "unseen": "\x1b[1m\u{7f}\u{9b}\u{202e}", "a b": {"x": {}, "y": []}, "null": null, "true": true, "1": 1,
            "small": 1e-9, "large": 1e300, "whole": 3.0, "tenth": 0.1, "int": u64::MAX,
            "long": (0..100).map(f64::from).collect::<Vec<_>>(),
            "section": {"first": "x".repeat(80), "second": "y".repeat(80), "deeper": {"list": vec!["word"; 40]}},
        });
        let text = to_string(&tree).unwrap();
        let back = value(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        // Whole numbers may come back as integers.
        let same = |a: &Value, b: &Value| a == b || (a.as_f64().is_some() && a.as_f64() == b.as_f64());
        for (key, expected) in tree.as_object().unwrap() {
            let list = expected.as_array().zip(back[key].as_array());
            let equal = list.map_or(same(expected, &back[key]), |(a, b)| {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
            });
            assert!(equal, "{key}: {expected} is not {}\n{text}", back[key]);
        }
        assert_eq!(to_string(&back).unwrap(), text);
        assert!(!text.contains(|c: char| c != '\n' && shown::is_unseen(c)), "{text}");
    }

    /// Whatever value is in place of one of another type, errors use no Rust terms.
    #[test]
    fn types_are_named_in_users_terms() {
        #[derive(Debug, Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Word {
            One,
            Two,
        }
        #[derive(Debug, Default, Deserialize)]
        #[serde(default)]
        #[allow(dead_code)]
        struct Keys {
            pair: (f64, f64),
            three: [f32; 3],
            word: Option<Word>,
            section: Option<Box<Keys>>,
            list: Vec<u16>,
            map: HashMap<String, i64>,
            flag: bool,
        }
        for value in ["3", "[1]", "{a: b}", "text", "true", "-1.5", "null", "[a, b, c, d]"] {
            let sections =
                ["pair", "three", "word", "section", "list", "map", "flag"].map(|key| format!("{key}: {value}"));
            for text in sections.iter().map(String::as_str).chain([value]) {
                let Err(error) = from_str::<Keys>("text", text) else { continue };
                let error = error.to_string();
                let words =
                    ["struct", "enum", "tuple", "unit", "variant", "array", "sequence", "map,", "i64", "u16", "f32"];
                let said = error.rsplit_once(", expected ").map_or(&*error, |(_, expected)| expected);
                assert!(!words.iter().any(|word| said.contains(word)), "{text}: {error}");
            }
        }
        let said = from_str::<Keys>("text", "three: 3").unwrap_err().to_string();
        assert!(said.ends_with("expected a list of 3"), "{said}");
    }

    #[test]
    fn unknown_names_are_found_in_messages_of_serde() {
        assert_eq!(unknown_name("unknown field `a`, expected `b` or `c`"), Some(("a", vec!["b", "c"])));
        assert_eq!(unknown_name("unknown field `a`, there are no fields"), Some(("a", vec![])));
        assert_eq!(unknown_name("unknown variant ``, expected `, expected `b`"), Some(("`, expected ", vec!["b"])));
        assert_eq!(unknown_name("missing field `a`"), None);
    }
}
