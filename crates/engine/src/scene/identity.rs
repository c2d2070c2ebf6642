//! Categories of objects, and which objects are one instance: a chair of six meshes is one chair.
//!
//! Rules of a label file match the names of objects and of their ancestor nodes, the nearest name first. The object or
//! node that gives an object its category also makes one instance of everything that it gives a category to. Where
//! there is none, everything below the outermost node that is not a mere group is one.

use super::pattern::{best_of, is_lettered, matches};
use super::{InstanceRule, LabelRules};
use ground::shown;
use model::{Ancestor, RawObject};
use std::collections::{BTreeSet, HashMap};

/// Category and instance of an object, by the rules, the file and the names.
pub(super) struct Identity {
    pub category: String,
    /// Objects with the same key are one instance.
    pub instance: InstanceKey,
    /// Name of the instance.
    pub name: String,
}

/// Which objects are one instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum InstanceKey {
    /// All objects below this node of the file; or, where files are merged, all with this instance number in the file
    /// at this index.
    Shared(usize, u32),
    /// The object at this index of the list.
    Alone(usize),
}

/// A name that counts for an object: its own, or that of an ancestor node.
#[derive(Clone, Copy)]
struct NameLevel<'a> {
    name: &'a str,
    /// The category that the file assigns there.
    category: Option<&'a str>,
    /// Number of the node; `None`: the object itself, which shares its node with others.
    node: Option<u32>,
    /// Whether it is a mere group of other nodes.
    is_group: bool,
}

/// Finds the identity of objects, and collects rules that contradict each other.
pub(super) struct Identifier<'r> {
    rules: &'r LabelRules,
    /// The pattern and its category for each name so far, cached: nodes have many objects below them.
    matched: HashMap<String, Option<(&'r str, &'r str)>>,
    /// Pairs of patterns that have been reported.
    known: BTreeSet<(&'r str, &'r str)>,
    contradictions: Vec<String>,
}

impl<'r> Identifier<'r> {
    pub fn new(rules: &'r LabelRules) -> Self {
        Identifier { rules, matched: HashMap::new(), known: BTreeSet::new(), contradictions: Vec::new() }
    }

    /// The identity of `object`, which is at index `place` of the list.
    pub fn identify(&mut self, object: &RawObject, place: usize) -> Identity {
        let levels = levels(object);
        let rule = self.rule(&levels);
        let given = levels.iter().find(|level| level.category.is_some());
        let decides = match (rule, given) {
            (Some((_, level)), _) => Some(level),
            (None, Some(given)) => Some(*given),
            _ => None,
        };
        let owner = self.ordered(&levels).or(decides).unwrap_or_else(|| whole(&levels));
        let name = if owner.name.is_empty() { &object.name } else { owner.name };
        let everything = || best_of(self.rules.patterns(), &object.name).map(|(_, category)| category);
        let category = match rule {
            Some((category, _)) => category,
            None => object.category.as_deref().or_else(everything).unwrap_or_else(|| without_copy_number(name)),
        };
        Identity {
            category: category.to_owned(),
            instance: owner.node.map_or(InstanceKey::Alone(place), |node| InstanceKey::Shared(0, node)),
            name: name.to_owned(),
        }
    }

    /// A sentence about patterns that give the same object different categories.
    pub fn contradictions(self) -> Option<String> {
        (!self.contradictions.is_empty() && !self.rules.general).then(|| {
            format!(
                "label rules: objects: of two patterns, the one that matches the nearer name counts: {}",
                shown::some_of(&self.contradictions)
            )
        })
    }

    /// The category, and the level with the nearest name that a rule matches.
    fn rule<'a>(&mut self, levels: &[NameLevel<'a>]) -> Option<(&'a str, NameLevel<'a>)>
    where
        'r: 'a,
    {
        let Identifier { rules, matched, known, contradictions } = self;
        let mut found = levels.iter().filter_map(|&level| {
            let best = *matched.entry(level.name.to_owned()).or_insert_with(|| {
                let lettered = rules.patterns().filter(|(pattern, _)| is_lettered(pattern));
                best_of(lettered, level.name)
            });
            best.map(|(pattern, category)| (pattern, category, level))
        });
        let (pattern, category, level) = found.next()?;
        if let Some((other, another, above)) = found.find(|(_, another, _)| *another != category)
            && known.insert((pattern, other))
        {
            contradictions.push(format!(
                "{:?} is {category:?} by {pattern:?}, and {another:?} by {other:?}, which matches {:?} above it",
                level.name, above.name
            ));
        }
        Some((category, level))
    }

    /// The level that `instances` of the label file selects.
    fn ordered<'a>(&self, levels: &[NameLevel<'a>]) -> Option<NameLevel<'a>> {
        match self.rules.instances.as_ref()? {
            InstanceRule::Node => levels.first().copied(),
            InstanceRule::Root => levels.last().copied(),
            InstanceRule::Named(patterns) => {
                let named = |level: &&NameLevel| patterns.iter().any(|pattern| matches(pattern, level.name));
                levels.iter().rev().find(named).copied()
            }
        }
    }
}

/// The names that count for `object`, its own first.
fn levels(object: &RawObject) -> Vec<NameLevel<'_>> {
    let (own, above) = match object.ancestors.split_last() {
        Some((own, above)) if object.has_node => (Some(own), above),
        _ => (None, &*object.ancestors),
    };
    let own_level = NameLevel {
        name: &object.name,
        category: match own {
            Some(own) => own.category.as_deref(),
            // A category that no node above it assigns is its own.
            None => object.category.as_deref().filter(|_| above.iter().all(|node| node.category.is_none())),
        },
        node: own.map(|own| own.node),
        is_group: false,
    };
    let nodes = above.iter().rev().map(|node: &Ancestor| NameLevel {
        name: &node.name,
        category: node.category.as_deref(),
        node: Some(node.node),
        is_group: node.is_group,
    });
    std::iter::once(own_level).chain(nodes).collect()
}

/// The outermost level that is not a mere group.
fn whole<'a>(levels: &[NameLevel<'a>]) -> NameLevel<'a> {
    // The object itself is not a group.
    *levels.iter().rfind(|level| !level.is_group).unwrap_or(&levels[0])
}

/// `Chair` for `Chair.001`, as Blender names copies.
fn without_copy_number(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, digits)) if !stem.is_empty() && digits.len() >= 3 && digits.bytes().all(|b| b.is_ascii_digit()) => {
            stem
        }
        _ => name,
    }
}
