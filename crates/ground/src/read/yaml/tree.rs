//! YAML texts as trees of values that remember their lines.

use crate::shown;
use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Number, Value};
use serde_saphyr::{Options, Spanned};
use std::fmt;

/// Deepest nesting accepted: three times what our files need. Parsing recurses at every level, on the caller's stack,
/// and little stack is promised to be enough.
pub(super) const MAX_DEPTH: usize = 24;

/// A YAML value with the lines of its contents.
pub(super) enum YamlTree {
    Leaf(Value),
    List(Vec<Spanned<YamlTree>>),
    Map(Vec<(Spanned<String>, Spanned<YamlTree>)>),
}

impl YamlTree {
    pub fn to_value(&self) -> Value {
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
pub(super) fn options() -> Options {
    serde_saphyr::options! {
        strict_booleans: true,
        with_snippet: false,
        budget: serde_saphyr::budget! { max_depth: MAX_DEPTH, flow_nesting_limit: MAX_DEPTH },
    }
}

/// The YAML crate's message, on one line, without the place (which we add ourselves) and without terms that only its
/// own users know.
pub(super) fn plain_message(error: &serde_saphyr::Error) -> String {
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

/// The message about text or values nested too deeply.
pub(super) fn too_deep() -> String {
    format!("sections and lists are nested deeper than {MAX_DEPTH}, the most allowed")
}
