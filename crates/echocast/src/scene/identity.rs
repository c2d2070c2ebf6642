//! What objects are, and which of them are one: a chair of six meshes is a chair, and one.
//!
//! Rules of a label file match the names of objects and of the nodes that they hang on, the nearest name first. What
//! gives an object its category also makes it one instance with all that it gives a category to. Where nothing does, all
//! that hangs on the outermost node that is no mere group is one.

use super::label::{best_of, is_lettered, matches};
use super::{Ancestor, InstanceRule, LabelRules, RawObject, some_of};
use std::collections::{BTreeSet, HashMap};

/// What the rules, the file and the names make of an object.
pub(super) struct Identity {
    pub category: String,
    /// Objects with the same key are one instance.
    pub instance: InstanceKey,
    /// What the instance is called.
    pub name: String,
}

/// Which objects are one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum InstanceKey {
    /// All on a node of the file, or with a number in the file at a place of the list.
    Shared(usize, u32),
    /// The object at a place of the list.
    Alone(usize),
}

/// A name that an object answers to: its own, or that of a node that it hangs on.
#[derive(Clone, Copy)]
struct Level<'a> {
    name: &'a str,
    /// The category that the file gives there.
    category: Option<&'a str>,
    /// Number of the node; `None`: the object, which shares it with others.
    node: Option<u32>,
    /// Whether it only holds other things together.
    is_group: bool,
}

/// Tells what objects are, and remembers rules that contradict each other.
pub(super) struct Identifier<'r> {
    rules: &'r LabelRules,
    /// The pattern and its category for each name so far: nodes have many objects below them.
    matched: HashMap<String, Option<(&'r str, &'r str)>>,
    /// Pairs of patterns of which each has been told of.
    known: BTreeSet<(&'r str, &'r str)>,
    contradictions: Vec<String>,
}

impl<'r> Identifier<'r> {
    pub fn new(rules: &'r LabelRules) -> Self {
        Identifier { rules, matched: HashMap::new(), known: BTreeSet::new(), contradictions: Vec::new() }
    }

    /// What `object` is, the one at `place` of the list.
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

    /// Sentences about patterns that say different things of the same object.
    pub fn contradictions(self) -> Option<String> {
        (!self.contradictions.is_empty() && !self.rules.general).then(|| {
            format!(
                "label rules: objects: of two patterns the one of the nearer name counts: {}",
                some_of(&self.contradictions)
            )
        })
    }

    /// The rule for the nearest name that one matches.
    fn rule<'a>(&mut self, levels: &[Level<'a>]) -> Option<(&'a str, Level<'a>)>
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

    /// The level that `instances` of the label file chooses.
    fn ordered<'a>(&self, levels: &[Level<'a>]) -> Option<Level<'a>> {
        match self.rules.instances.as_ref()? {
            InstanceRule::Node => levels.first().copied(),
            InstanceRule::Root => levels.last().copied(),
            InstanceRule::Named(patterns) => {
                let named = |level: &&Level| patterns.iter().any(|pattern| matches(pattern, level.name));
                levels.iter().rev().find(named).copied()
            }
        }
    }
}

/// The names that `object` answers to, its own first.
fn levels(object: &RawObject) -> Vec<Level<'_>> {
    let (own, above) = match object.ancestors.split_last() {
        Some((own, above)) if object.has_node => (Some(own), above),
        _ => (None, &*object.ancestors),
    };
    let itself = Level {
        name: &object.name,
        category: match own {
            Some(own) => own.category.as_deref(),
            // What no node above it gives is its own.
            None => object.category.as_deref().filter(|_| above.iter().all(|node| node.category.is_none())),
        },
        node: own.map(|own| own.node),
        is_group: false,
    };
    let nodes = above.iter().rev().map(|node: &Ancestor| Level {
        name: &node.name,
        category: node.category.as_deref(),
        node: Some(node.node),
        is_group: node.is_group,
    });
    std::iter::once(itself).chain(nodes).collect()
}

/// The outermost level that is no mere group.
fn whole<'a>(levels: &[Level<'a>]) -> Level<'a> {
    // The object itself is none.
    *levels.iter().rfind(|level| !level.is_group).unwrap_or(&levels[0])
}

/// `Chair` for `Chair.001`, as Blender calls a copy.
fn without_copy_number(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, digits)) if !stem.is_empty() && digits.len() >= 3 && digits.bytes().all(|b| b.is_ascii_digit()) => {
            stem
        }
        _ => name,
    }
}
