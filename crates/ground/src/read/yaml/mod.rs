//! Reading and writing YAML: the only folder that depends on the YAML crate.
//!
//! A text is read in two steps: YAML to a tree of values that remembers the line of every key, then the tree to a type.
//! So every error can name file, line and key, even errors found later ([`Document::locate`]).

mod document;
mod edit;
mod message;
mod path;
mod section;
mod tree;
mod write;

pub use document::{Document, from_str};
pub use edit::{TAGS, assignment, put, set};
pub use message::plain;
pub use path::{join, lookup, numbers, same_path};
pub use section::{Section, inner, one_or_more, one_or_more_words, split_keys, split_tag};
pub use write::to_string;

#[cfg(test)]
mod tests {
    use super::message::unknown_name;
    use super::{Document, from_str, to_string};
    use crate::error::Result;
    use crate::shown;
    use serde::Deserialize;
    use serde_json::{Value, json};
    use std::collections::HashMap;
    use std::path::Path;

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
