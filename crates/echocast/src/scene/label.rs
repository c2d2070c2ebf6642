//! Names to numbers: categories, parts, materials and instances.

use super::{CacheFile, MaterialRules, Part, Scene, some_of};
use crate::ground::error::{Result, nearest};
use crate::ground::shown;
use crate::read::presets;
use crate::read::yaml::{Document, join, one_or_more_words};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// Numbers and names of one label column, sorted by number.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NameTable {
    /// Numbers, rising, each once; never 0 (which means unlabelled).
    pub ids: Vec<u32>,
    /// Names, one for each number.
    pub names: Vec<String>,
}

impl NameTable {
    /// Numbers `names` in sorted order from 1, keeping the numbers that `fixed` gives.
    ///
    /// Names without a fixed number take the free numbers in sorted order. An empty name gets none.
    pub fn number(names: impl IntoIterator<Item = String>, fixed: &BTreeMap<String, u32>) -> Self {
        let names: BTreeSet<String> = names.into_iter().filter(|name| !name.is_empty()).collect();
        let taken: BTreeSet<u32> = fixed.values().copied().collect();
        let mut free = (1u32..).filter(|id| !taken.contains(id));
        let mut rows: Vec<(u32, String)> = names
            .into_iter()
            .map(|name| (fixed.get(&name).copied().unwrap_or_else(|| free.next().unwrap_or(0)), name))
            .filter(|(id, _)| *id != 0)
            .collect();
        rows.sort();
        let (ids, names) = rows.into_iter().unzip();
        NameTable { ids, names }
    }

    /// Names the number `id`, replacing any earlier name; 0 has none.
    pub(crate) fn set(&mut self, id: u32, name: &str) {
        match self.ids.binary_search(&id) {
            _ if id == 0 => {}
            Ok(row) => name.clone_into(&mut self.names[row]),
            Err(row) => {
                self.ids.insert(row, id);
                self.names.insert(row, name.to_owned());
            }
        }
    }

    /// Forgets the number `id`.
    pub(crate) fn remove(&mut self, id: u32) {
        if let Ok(row) = self.ids.binary_search(&id) {
            self.ids.remove(row);
            self.names.remove(row);
        }
    }

    /// Adopts the names of `other`: known ones keep their number here, the others theirs if it is free. Returns the
    /// numbers here of those of `other` that differ.
    pub(crate) fn absorb(&mut self, other: &NameTable) -> HashMap<u32, u32> {
        let known: HashMap<String, u32> = self.iter().map(|(id, name)| (name.to_owned(), id)).collect();
        let mut changed = HashMap::new();
        for (id, name) in other.iter() {
            let here = known.get(name).copied().unwrap_or_else(|| {
                let id = self.free(id);
                self.set(id, name);
                id
            });
            if here != id {
                changed.insert(id, here);
            }
        }
        changed
    }

    /// The number of `name`, a new one if it has none.
    pub(crate) fn numbered(&mut self, name: &str) -> u32 {
        match self.id(name) {
            0 if !name.is_empty() => {
                let id = self.free(self.ids.len() as u32 + 1);
                self.set(id, name);
                id
            }
            known => known,
        }
    }

    /// A free number: `wanted`, else the one after the last.
    pub(crate) fn free(&self, wanted: u32) -> u32 {
        let is_free = |id: &u32| self.ids.binary_search(id).is_err();
        if is_free(&wanted) {
            return wanted;
        }
        let next = self.ids.last().and_then(|last| last.checked_add(1));
        next.or_else(|| (1..).find(is_free)).unwrap_or(wanted)
    }

    /// Number of `name`; 0 when it has none.
    pub fn id(&self, name: &str) -> u32 {
        self.names.iter().position(|n| n == name).map_or(0, |row| self.ids[row])
    }

    /// Names to numbers.
    pub(crate) fn to_map(&self) -> HashMap<&str, u32> {
        self.iter().map(|(id, name)| (name, id)).collect()
    }

    /// Name of number `id`.
    pub fn name(&self, id: u32) -> Option<&str> {
        self.ids.binary_search(&id).ok().map(|row| self.names[row].as_str())
    }

    /// `(number, name)` pairs, rising.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &str)> {
        self.ids.iter().copied().zip(self.names.iter().map(String::as_str))
    }
}

/// What a file says of objects or parts, names or numbers, as names with numbers.
pub(super) struct Given<'r> {
    /// What it says of them, for people.
    what: &'static str,
    rules: &'r LabelRules,
    /// Numbers of names: those of the rules, and those that the file gives instead of names.
    pub numbers: BTreeMap<String, u32>,
    /// Numbers that none can have.
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

    /// The name of what is called `text`. A whole number stays the number that comes out; its name is that which the rules
    /// have for it, else the number itself. 0 is unlabelled, without a name.
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

    /// Takes note of a name that comes from elsewhere.
    pub fn meet(&mut self, name: &str) {
        if !self.others.contains(name) {
            self.others.insert(name.to_owned());
        }
    }

    /// Sentences about numbers that none can have, and such that clash with names.
    pub fn told(&self) -> Vec<String> {
        let odd: Vec<String> = self.odd.iter().cloned().collect();
        let clashes: Vec<String> = self.of_numbers.intersection(&self.others).cloned().collect();
        [
            (odd, "numbers that are not whole or not in 0 to 4294967295 are taken as names"),
            (clashes, "numbers of the file and names that come from elsewhere are the same labels"),
        ]
        .into_iter()
        .filter(|(names, _)| !names.is_empty())
        .map(|(names, fault)| format!("{}: {fault}: {}", self.what, some_of(&names)))
        .collect()
    }
}

/// The name tables of a scene; they travel with every output.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Labels {
    /// Names of `category_id`.
    pub category: NameTable,
    /// Names of `part_id`.
    pub part: NameTable,
    /// Names of `material_id`.
    pub material: NameTable,
    /// Names of `instance_id`: the objects. Names may repeat here, numbers do not.
    pub instance: NameTable,
    /// Class of the ASPRS, as LAS has it, of a `category_id`; that of others is 0, never classified.
    #[serde(skip)]
    pub las_class: BTreeMap<u32, u8>,
}

impl Labels {
    /// The four tables with the stems of their column names: `category`, `part`, `material`, `instance`.
    pub fn tables(&self) -> [(&'static str, &NameTable); 4] {
        [("category", &self.category), ("part", &self.part), ("material", &self.material), ("instance", &self.instance)]
    }
}

/// A label file: fixed numbers, and patterns that assign names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LabelRules {
    /// Category or part name to number, from 1, no number twice.
    pub numbers: BTreeMap<String, u32>,
    /// Pattern (`*` and `?`) of the names of objects, or of nodes that they hang on, to category. The nearest name that a
    /// pattern matches counts, and of several patterns the one with the most letters; one without letters only where
    /// nothing else gives a category.
    pub objects: BTreeMap<String, String>,
    /// Patterns of the names of objects, or of nodes that they hang on, which are left out: sky boxes.
    #[serde(deserialize_with = "one_or_more_words")]
    pub hide: Vec<String>,
    /// Which objects are one instance; `None`: all that hangs on the node that gives them their category, else on the
    /// outermost node that is no mere group.
    pub instances: Option<InstanceRule>,
    /// Category to class of the ASPRS (LAS 1.4, table 17), for LAS files.
    pub las_class: BTreeMap<String, u8>,
    /// Material name pattern (`*` and `?`) to part; the longest matching pattern wins.
    pub materials: BTreeMap<String, String>,
    /// Object name pattern (`*` and `?`) to the file that says how the object changes its shape; added to those of the load
    /// options.
    pub caches: BTreeMap<String, CacheFile>,
    /// What surfaces are made of, by material name pattern.
    #[serde(skip_serializing_if = "MaterialRules::is_empty")]
    pub surfaces: MaterialRules,
    /// Whether they are for scenes of a kind: it is no mistake that a scene has nothing that some of them name.
    #[serde(skip)]
    pub general: bool,
}

/// Which objects are one instance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Words", into = "Words")]
pub enum InstanceRule {
    /// Each placed mesh.
    Node,
    /// All that hangs on an outermost node of the file.
    Root,
    /// All that hangs on the outermost node with a name that one of these patterns (`*` and `?`) matches; what hangs on none
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

    /// The label file called `name`, or if there is none the rules for scenes of a kind that ship with the library under
    /// that name ([`LabelRules::presets`]).
    ///
    /// # Errors
    /// As [`LabelRules::load`].
    pub fn open(name: impl AsRef<Path>) -> Result<Self> {
        LabelRules::open_in(Path::new(""), name.as_ref())
    }

    /// [`LabelRules::open`] where relative names start at `folder`.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn open_in(folder: &Path, name: &Path) -> Result<Self> {
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
    /// As there, except for the file.
    pub fn from_yaml(text: &str) -> Result<Self> {
        LabelRules::read(&Document::parse("YAML text", text)?)
    }

    fn read(document: &Document) -> Result<Self> {
        let rules: LabelRules = document.read()?;
        rules.check(document, "")?;
        Ok(rules)
    }

    /// Checks that each number has one name, and what surfaces are made of. The rules stand at `key` of `document`.
    pub(crate) fn check(&self, document: &Document, key: &str) -> Result<()> {
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

    /// Sentences about names in these rules that `scene`, read with them, does not have: mostly typing errors.
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
        .map(|(what, names)| format!("label rules: {what}: {}", some_of(&names)))
        .collect()
    }

    /// Patterns of names of objects and the categories that they give.
    pub(super) fn patterns(&self) -> impl Iterator<Item = (&str, &str)> {
        self.objects.iter().map(|(pattern, category)| (pattern.as_str(), category.as_str()))
    }

    /// Part that the patterns assign to the faces of a material; they override the scene file.
    pub fn part(&self, material: &str) -> Option<&str> {
        best_match(&self.materials, material)
    }
}

/// Whether `pattern` says anything of a name.
pub(super) fn is_lettered(pattern: &str) -> bool {
    pattern.chars().any(|c| !"*?".contains(c))
}

fn best_match<'a>(patterns: &'a BTreeMap<String, String>, name: &str) -> Option<&'a str> {
    let patterns = patterns.iter().map(|(pattern, value)| (pattern.as_str(), value.as_str()));
    best_of(patterns, name).map(|(_, value)| value)
}

/// Of `patterns` and what they stand for the one with the most letters that matches `name`.
pub(super) fn best_of<'a, T>(patterns: impl Iterator<Item = (&'a str, T)>, name: &str) -> Option<(&'a str, T)> {
    patterns
        .filter(|(pattern, _)| matches(pattern, name))
        .max_by_key(|(pattern, _)| (pattern.chars().filter(|c| !"*?".contains(*c)).count(), has_capitals(pattern)))
}

fn has_capitals(pattern: &str) -> bool {
    pattern.chars().any(char::is_uppercase)
}

/// Of `names` those that are most like what `pattern` means, as the end of a message; empty if none is.
pub(super) fn near(pattern: &str, names: &[&str]) -> String {
    let plain: String = pattern.chars().filter(|letter| !"*?".contains(*letter)).collect();
    let length = plain.chars().count();
    // Of what a `*` stands for nothing is compared.
    let told = |name: &&str| -> String {
        match (pattern.starts_with('*'), pattern.ends_with('*')) {
            (false, true) => name.chars().take(length).collect(),
            (true, false) => name.chars().skip(name.chars().count().saturating_sub(length)).collect(),
            _ => (*name).to_owned(),
        }
    };
    let like = nearest(&plain, names.iter().map(told));
    let found: BTreeSet<&str> = names.iter().copied().filter(|name| like.contains(&told(name))).collect();
    match found.into_iter().take(3).collect::<Vec<_>>().join(", ") {
        none if none.is_empty() => none,
        near => format!("; near: {near}"),
    }
}

/// Shell-style match: `*` any run of characters, `?` any one; a pattern without capitals fits capitals too.
pub(crate) fn matches(pattern: &str, name: &str) -> bool {
    let any_case = !has_capitals(pattern);
    let letters = name.chars().flat_map(|c| {
        let same = [c].into_iter().filter(move |_| !any_case);
        same.chain(c.to_lowercase().filter(move |_| any_case))
    });
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), letters.collect());
    let (mut p, mut n) = (0, 0);
    // Where to continue when the text after the last `*` does not fit: (pattern after it, next start).
    let mut retry: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                retry = Some((p + 1, n + 1));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match retry {
                Some((after, start)) => {
                    p = after;
                    n = start;
                    retry = Some((after, start + 1));
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!(matches("car_*", "Car_1") && !matches("Car_*", "car_1") && matches("straße", "STRAßE"));
        let shade = [("Car*", 1), ("car*", 2)].into_iter();
        assert_eq!(best_of(shade, "Car").map(|(_, found)| found), Some(1));
        assert!(matches("a*b*c", "axxbyybc") && !matches("a*b*c", "axxbyyb") && matches("*", "") && !matches("?", ""));
    }

    #[test]
    fn load_options_name_rules_and_files() {
        use crate::scene::LoadOptions;
        let read = |labels: &str| LoadOptions::from_yaml(&format!("{{scale: 2, labels: {labels}}}"));
        assert_eq!(read("street").unwrap().labels, LabelRules::open("street").unwrap());
        assert_eq!(read("{numbers: {road: 40}}").unwrap().labels.numbers["road"], 40);
        assert!(matches!(read("missing.yaml"), Err(crate::Error::Io { .. })));
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
