//! Names to numbers: categories, parts, materials and instances.

use super::pattern::{best_of, matches};
use super::{CacheFile, MaterialRules, Scene};
use ground::builder;
use ground::error::Result;
use ground::read::presets;
use ground::read::yaml::{Document, join, one_or_more_words};
use ground::shown;
use model::{Labels, Part};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// The labels that a file gives to objects or parts, names or numbers, as names with numbers.
pub(super) struct Given<'r> {
    /// Which labels these are, for messages.
    what: &'static str,
    rules: &'r LabelRules,
    /// Numbers of names: those of the rules, and those that the file gives instead of names.
    pub numbers: BTreeMap<String, u32>,
    /// Numbers that no label can have.
    odd: BTreeSet<String>,
    /// Names that stand for numbers of the file, and those that come from elsewhere.
    of_numbers: BTreeSet<String>,
    others: BTreeSet<String>,
}

impl<'r> Given<'r> {
    pub fn new(what: &'static str, rules: &'r LabelRules) -> Self {
        let none = BTreeSet::new;
        Given { what, rules, numbers: rules.numbers.clone(), odd: none(), of_numbers: none(), others: none() }
    }

    /// The name of the label `text`. A whole number remains the number of the label; its name is the one that the rules
    /// have for it, otherwise the number itself. 0 is unlabelled, without a name.
    pub fn name(&mut self, text: String) -> String {
        if self.rules.numbers.contains_key(&text) {
            return text;
        }
        match text.parse::<u32>() {
            Ok(number) if number.to_string() != text => text,
            Ok(0) => String::new(),
            Ok(number) => {
                let known = self.rules.numbers.iter().find(|(_, known)| **known == number);
                let name = known.map_or(text, |(name, _)| name.clone());
                self.numbers.insert(name.clone(), number);
                self.of_numbers.insert(name.clone());
                name
            }
            Err(_) => {
                if text.parse::<f64>().is_ok_and(f64::is_finite) {
                    self.odd.insert(text.clone());
                }
                text
            }
        }
    }

    /// Records a name that comes from elsewhere.
    pub fn meet(&mut self, name: &str) {
        if !self.others.contains(name) {
            self.others.insert(name.to_owned());
        }
    }

    /// Sentences about numbers that no label can have, and about numbers that clash with names.
    pub fn wording(&self) -> Vec<String> {
        let odd: Vec<String> = self.odd.iter().cloned().collect();
        let clashes: Vec<String> = self.of_numbers.intersection(&self.others).cloned().collect();
        [
            (odd, "numbers that are not whole or not in 0 to 4294967295 are taken as names"),
            (clashes, "names of numbers in the file and equal names from elsewhere are the same labels"),
        ]
        .into_iter()
        .filter(|(names, _)| !names.is_empty())
        .map(|(names, fault)| format!("{}: {fault}: {}", self.what, shown::some_of(&names)))
        .collect()
    }
}

builder! {
    /// A label file: fixed numbers, and patterns that assign names.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct LabelRules {
        /// Category or part name to number, from 1, no number twice.
        pub numbers: BTreeMap<String, u32>,
        /// Pattern (`*` and `?`) of the names of objects, or of their ancestor nodes, to category. The nearest name
        /// that a pattern matches counts, and of several patterns the one with the most letters; a pattern without
        /// letters counts only where nothing else gives a category.
        pub objects: BTreeMap<String, String>,
        /// Patterns of the names of objects, or of their ancestor nodes, to leave out, such as sky boxes.
        #[serde(deserialize_with = "one_or_more_words")]
        pub hide: Vec<String>,
        /// Which objects are one instance; `None`: everything below the node that gives the category, otherwise below
        /// the outermost node that is not a mere group.
        pub instances: Option<InstanceRule>,
        /// Category to ASPRS class (LAS 1.4, table 17), for LAS files.
        pub las_class: BTreeMap<String, u8>,
        /// Material name pattern (`*` and `?`) to part; the longest matching pattern wins.
        pub materials: BTreeMap<String, String>,
        /// Object name pattern (`*` and `?`) to the file that describes how the object's shape changes; added to those
        /// of the load options.
        pub caches: BTreeMap<String, CacheFile>,
        /// What surfaces are made of, by material name pattern.
        #[serde(skip_serializing_if = "MaterialRules::is_empty")]
        pub surfaces: MaterialRules,
        /// Whether they are for a kind of scene, not for one scene: it is then no mistake if a scene lacks what some of
        /// them name.
        #[serde(skip)]
        pub general: bool,
    }
}

/// Which objects are one instance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Words", into = "Words")]
#[non_exhaustive]
pub enum InstanceRule {
    /// Each placed mesh.
    Node,
    /// Everything below an outermost node of the file.
    Root,
    /// Everything below the outermost node whose name one of these patterns (`*` and `?`) matches; what is below none,
    /// as if there were no rule.
    Named(Vec<String>),
}

/// An [`InstanceRule`] as it is written: `node`, `root`, a pattern, or several.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Words {
    One(String),
    Several(Vec<String>),
}

impl From<Words> for InstanceRule {
    fn from(words: Words) -> Self {
        match words {
            Words::One(word) if word == "node" => InstanceRule::Node,
            Words::One(word) if word == "root" => InstanceRule::Root,
            Words::One(pattern) => InstanceRule::Named(vec![pattern]),
            Words::Several(patterns) => InstanceRule::Named(patterns),
        }
    }
}

impl From<InstanceRule> for Words {
    fn from(rule: InstanceRule) -> Self {
        match rule {
            InstanceRule::Node => Words::One("node".into()),
            InstanceRule::Root => Words::One("root".into()),
            InstanceRule::Named(patterns) => Words::Several(patterns),
        }
    }
}

impl LabelRules {
    /// Reads a label file (YAML). The files that it names are relative to its folder.
    ///
    /// # Errors
    /// A missing file, an unknown key, a number that is 0 or invalid or used by two names.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let mut rules = LabelRules::read(&Document::load(path)?)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        rules.caches.values_mut().for_each(|cache| cache.file = folder.join(&cache.file));
        Ok(rules)
    }

    /// The label file called `name`, or if there is none, the rules for a kind of scene that ship with the library
    /// under that name ([`LabelRules::presets`]).
    ///
    /// # Errors
    /// As [`LabelRules::load`].
    pub fn open(name: impl AsRef<Path>) -> Result<Self> {
        LabelRules::open_in(Path::new(""), name.as_ref())
    }

    /// [`LabelRules::open`] of a name relative to `folder`.
    ///
    /// # Errors
    /// As [`LabelRules::open`].
    #[doc(hidden)]
    pub fn open_in(folder: &Path, name: &Path) -> Result<Self> {
        let path = folder.join(name);
        let preset = LabelRules::presets().find(|(preset, _)| name == Path::new(preset) && !path.exists());
        let Some((_, text)) = preset else { return LabelRules::load(path) };
        let rules = LabelRules::read(&Document::parse(&shown::path(name), text)?)?;
        Ok(LabelRules { general: true, ..rules })
    }

    /// Names and texts of the rules that ship with the library.
    pub fn presets() -> impl Iterator<Item = (&'static str, &'static str)> {
        let named =
            |(path, text): (&'static str, _)| Some((path.strip_prefix("labels/")?.strip_suffix(".yaml")?, text));
        presets::embedded("labels/").filter_map(named)
    }

    /// [`LabelRules::load`] from the text of a file.
    ///
    /// # Errors
    /// As [`LabelRules::load`], except for the file.
    pub fn from_yaml(text: &str) -> Result<Self> {
        LabelRules::read(&Document::parse("YAML text", text)?)
    }

    fn read(document: &Document) -> Result<Self> {
        let rules: LabelRules = document.read()?;
        rules.check(document, "")?;
        Ok(rules)
    }

    /// Checks that each number has one name, and the material rules. The rules are at `key` of `document`.
    #[doc(hidden)]
    pub fn check(&self, document: &Document, key: &str) -> Result<()> {
        let wrong = |name: &str, message: &str| document.error(&join(key, &format!("numbers.{name}")), message);
        if let Some((name, _)) = self.numbers.iter().find(|(_, number)| **number == 0) {
            return Err(wrong(name, "0 means unlabelled; allowed: 1 to 4294967295"));
        }
        let mut names = HashMap::new();
        for (name, number) in &self.numbers {
            if let Some(other) = names.insert(number, name) {
                let line = document.line(&join(key, &join("numbers", other)));
                let place = line.map_or(String::new(), |line| format!(" (line {line})"));
                let message =
                    format!("{other:?}{place} has the number {number} too; allowed: one name for each number");
                return Err(wrong(name, &message));
            }
        }
        self.surfaces.check(document, &join(key, "surfaces"))
    }

    /// Sentences about names in these rules that `scene`, read with them, does not have: mostly typos.
    pub(super) fn idle(&self, scene: &Scene) -> Vec<String> {
        if self.general {
            return Vec::new();
        }
        let own = scene.objects.iter().map(|object| object.name.as_str());
        let above = scene.objects.iter().flat_map(|object| object.ancestors.iter()).map(|node| &*node.name);
        let objects: BTreeSet<&str> = own.chain(above).collect();
        let hidden: BTreeSet<&str> = scene.hidden.iter().map(String::as_str).collect();
        let parts = scene.objects.iter().flat_map(|object| &object.mesh.parts);
        let materials: BTreeSet<&str> = parts.map(Part::material_name).collect();
        fn unmatched<'p>(patterns: impl Iterator<Item = &'p String>, names: &BTreeSet<&str>) -> Vec<String> {
            patterns.filter(|pattern| !names.iter().any(|name| matches(pattern, name))).cloned().collect()
        }
        let instances = match &self.instances {
            Some(InstanceRule::Named(patterns)) => patterns.as_slice(),
            _ => &[],
        };
        let Labels { category, part, .. } = &scene.labels;
        let known: BTreeSet<&String> = category.names.iter().chain(&part.names).collect();
        [
            ("patterns that no object's name matches (objects)", unmatched(self.objects.keys(), &objects)),
            ("patterns that no object's name matches (hide)", unmatched(self.hide.iter(), &hidden)),
            ("patterns that no object's name matches (instances)", unmatched(instances.iter(), &objects)),
            ("patterns that no used material's name matches (materials)", unmatched(self.materials.keys(), &materials)),
            (
                "names that no object and no part has (numbers)",
                self.numbers.keys().filter(|name| !known.contains(name)).cloned().collect(),
            ),
            (
                "categories that no object has (las_class)",
                self.las_class.keys().filter(|name| !category.names.contains(name)).cloned().collect(),
            ),
        ]
        .into_iter()
        .filter(|(_, names)| !names.is_empty())
        .map(|(what, names)| format!("label rules: {what}: {}", shown::some_of(&names)))
        .collect()
    }

    /// Patterns of names of objects and the categories that they assign.
    pub(super) fn patterns(&self) -> impl Iterator<Item = (&str, &str)> {
        self.objects.iter().map(|(pattern, category)| (pattern.as_str(), category.as_str()))
    }

    /// Part that the patterns assign to the faces of a material; they override the scene file.
    pub fn part(&self, material: &str) -> Option<&str> {
        best_match(&self.materials, material)
    }
}

fn best_match<'a>(patterns: &'a BTreeMap<String, String>, name: &str) -> Option<&'a str> {
    let patterns = patterns.iter().map(|(pattern, value)| (pattern.as_str(), value.as_str()));
    best_of(patterns, name).map(|(_, value)| value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use model::NameTable;

    #[test]
    fn names_are_numbered_in_sorted_order_around_fixed_numbers() {
        let names = ["wall", "chair", "", "floor", "road"].map(String::from);
        let plain = NameTable::number(names.clone(), &BTreeMap::new());
        assert_eq!(plain.iter().collect::<Vec<_>>(), [(1, "chair"), (2, "floor"), (3, "road"), (4, "wall")]);
        let fixed = BTreeMap::from([("road".to_owned(), 40), ("wall".to_owned(), 1), ("unused".to_owned(), 2)]);
        let table = NameTable::number(names, &fixed);
        assert_eq!(table.iter().collect::<Vec<_>>(), [(1, "wall"), (3, "chair"), (4, "floor"), (40, "road")]);
        assert_eq!((table.id("road"), table.id("sky"), table.name(40), table.name(2)), (40, 0, Some("road"), None));
    }

    #[test]
    fn patterns_give_names() {
        let rules = LabelRules {
            objects: BTreeMap::from([
                ("Desk_*".into(), "desk".into()),
                ("*".into(), "thing".into()),
                ("Desk_1?".into(), "big".into()),
            ]),
            ..LabelRules::default()
        };
        let category = |name| best_of(rules.patterns(), name).map(|(_, category)| category);
        assert_eq!(category("Desk_7"), Some("desk"));
        assert_eq!(category("Desk_12"), Some("big"));
        assert_eq!(category("Lamp"), Some("thing"));
        assert_eq!(rules.part("leg_metal"), None);
    }

    #[test]
    fn load_options_name_rules_and_files() {
        use crate::scene::LoadOptions;
        let read = |labels: &str| LoadOptions::from_yaml(&format!("{{scale: 2, labels: {labels}}}"));
        assert_eq!(read("street").unwrap().labels, LabelRules::open("street").unwrap());
        assert_eq!(read("{numbers: {road: 40}}").unwrap().labels.numbers["road"], 40);
        assert!(matches!(read("missing.yaml"), Err(ground::error::Error::Io { .. })));
    }

    #[test]
    fn a_number_has_one_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labels.yaml");
        let error = |text: &str| {
            std::fs::write(&path, text).unwrap();
            LabelRules::load(&path).unwrap_err().to_string()
        };
        assert_eq!(
            error("numbers: {chair: 10, wall: 2, desk: 10}"),
            format!(
                "{}: line 1: numbers.desk: \"chair\" (line 1) has the number 10 too; allowed: one name for each number",
                path.display()
            )
        );
        let lines = error("numbers:\n  chair: 10\n  desk: 10\n");
        assert!(lines.contains("line 3: numbers.desk: \"chair\" (line 2) has the number 10 too"), "{lines}");
        assert!(error("numbers: {chair: 0}").ends_with("numbers.chair: 0 means unlabelled; allowed: 1 to 4294967295"));
    }
}
