//! Warnings about samples, one sentence for each kind.

use super::styles;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// A warning about samples.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Noticed {
    /// The warning about the first of them, a sentence; if it ends in a list of names, with those of all samples.
    pub warning: String,
    /// Number of samples that it concerns; 0: it concerns the run.
    pub samples: u64,
    /// Number of the first of them.
    pub first: u64,
}

/// Warnings by kind.
#[derive(Debug, Default)]
pub(super) struct Kinds(BTreeMap<String, NoticeKind>);

#[derive(Debug)]
struct NoticeKind {
    sentence: String,
    /// Names in the list at its end, from all samples.
    names: BTreeSet<String>,
    samples: BTreeSet<u64>,
}

impl Kinds {
    /// Adds the warnings about a sample.
    pub fn add(&mut self, sample: u64, warnings: &[String]) {
        for warning in warnings {
            let (sentence, list) = parted(warning);
            let new = || NoticeKind { sentence: String::new(), names: BTreeSet::new(), samples: BTreeSet::new() };
            let kind = self.0.entry(kind_of(sentence)).or_insert_with(new);
            // That of the first sample, in whatever order they arrive.
            if kind.samples.first().is_none_or(|&first| sample < first) {
                sentence.clone_into(&mut kind.sentence);
            }
            kind.samples.insert(sample);
            kind.names.extend(list.into_iter().flat_map(|list| list.split(", ")).map(str::to_owned));
        }
    }

    /// One sentence for each kind.
    pub fn notices(self) -> Vec<Noticed> {
        let notices = |NoticeKind { sentence, names, samples }: NoticeKind| {
            let names = names.into_iter().collect::<Vec<_>>().join(", ");
            let warning = if names.is_empty() { sentence } else { format!("{sentence}: {names}") };
            Noticed { warning, samples: samples.len() as u64, first: samples.first().copied().unwrap_or(0) }
        };
        self.0.into_values().map(notices).collect()
    }
}

/// A warning without the list of names in which warnings of styles may end, and that list.
fn parted(warning: &str) -> (&str, Option<&str>) {
    let of_style = warning.split_once(": ").filter(|(name, _)| styles::names().any(|style| style == *name));
    match (of_style, warning.rsplit_once(": ")) {
        (Some((_, rest)), Some((sentence, list))) if rest.contains(": ") => (sentence, Some(list)),
        _ => (warning, None),
    }
}

/// A sentence without what differs from sample to sample: names in quotes, numbers that are not part of a name or key.
fn kind_of(sentence: &str) -> String {
    let mut kind = String::with_capacity(sentence.len());
    let (mut quoted, mut before) = (false, ' ');
    for letter in sentence.chars() {
        let ends = letter == '"' && before != '\\';
        if ends {
            quoted = !quoted;
        }
        let in_name = before.is_alphabetic() || ['_', '['].contains(&before);
        match letter {
            _ if quoted && !ends => {}
            '0'..='9' if !in_name => {
                if before != '#' {
                    kind.push('#');
                }
                before = '#';
                continue;
            }
            _ => kind.push(letter),
        }
        // Digits of a name are parts of it.
        before = if letter.is_ascii_digit() { '_' } else { letter };
    }
    kind
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_reported_once() {
        let mut kinds = Kinds::default();
        let place = |rule: u32, name: &str, tries: u32| {
            format!("variation[{rule}]: no room for {name:?} in {tries} tries: left out")
        };
        let kitti = |names: &str| format!("kitti: objects without a type have no box: {names}");
        kinds.add(7, &[place(2, "Chair_3", 100), place(2, "a \"b\" 4", 100), kitti("road, tree")]);
        kinds.add(4, &[place(2, "Chair_1", 90), place(3, "Chair_1", 100), kitti("bench")]);
        kinds.add(9, &["top16: a cloud without points".into(), "top128: a cloud without points".into()]);
        let noticed = |warning: String, samples, first| Noticed { warning, samples, first };
        assert_eq!(
            kinds.notices(),
            [
                noticed(kitti("bench, road, tree"), 2, 4),
                noticed("top128: a cloud without points".into(), 1, 9),
                noticed("top16: a cloud without points".into(), 1, 9),
                noticed(place(2, "Chair_1", 90), 2, 4),
                noticed(place(3, "Chair_1", 100), 1, 4),
            ]
        );
    }
}
