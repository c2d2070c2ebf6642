//! What varies from sample to sample: rules, applied one after the other.

mod apply;
mod look;
mod spot;

pub(super) use apply::{SampleScene, Units};
pub(super) use look::LookRule;

use super::random::{Random, check_range};
use engine::scene::matches;
use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::yaml::inner;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde_json::Value;
use std::collections::HashSet;
use std::path::PathBuf;

/// A rule of the section `variation`.
#[derive(Clone, Debug)]
pub(crate) struct Rule {
    /// Its name, part of the address of everything it draws.
    pub name: String,
    pub what: What,
}

/// What a rule does.
#[derive(Clone, Debug)]
pub(crate) enum What {
    /// Sets a key of the scenario to another value.
    Set(SetRule),
    /// Removes objects.
    Remove(RemoveRule),
    /// Replaces objects with models.
    Swap(SwapRule),
    /// Moves, turns and scales objects.
    Move(MoveRule),
    /// Adds models.
    Place(PlaceRule),
    /// Changes what surfaces are made of.
    Look(LookRule),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SetRule {
    /// Path of the key, such as `environment.rain.rate_mm_h`; list entries by number or, for sensors, by name.
    pub set: String,
    pub to: Random,
    /// Whether the key takes whole numbers.
    #[serde(skip)]
    pub whole: bool,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RemoveRule {
    pub remove: RuleTarget,
    /// Probability for each object.
    #[serde(default = "certain")]
    pub chance: Random,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SwapRule {
    pub swap: RuleTarget,
    pub with: Models,
    #[serde(default = "certain")]
    pub chance: Random,
    /// Scales the model to the height of the object.
    #[serde(default)]
    pub fit: bool,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MoveRule {
    #[serde(rename = "move")]
    pub moved: RuleTarget,
    /// Displacement along the world's axes, m.
    #[serde(default)]
    pub by_m: Option<Random>,
    #[serde(default)]
    pub chance: Option<Random>,
    /// New place.
    #[serde(default)]
    pub to: Option<PlaceSpec>,
    #[serde(default)]
    pub turn_deg: Option<Random>,
    #[serde(default)]
    pub scale: Option<Random>,
    /// Whether it is then dropped onto what is below it.
    #[serde(default)]
    pub drop: bool,
    #[serde(default)]
    pub align: Align,
    /// Clearance around it, m; if `None`, it may intersect other objects.
    #[serde(default)]
    pub clearance_m: Option<f64>,
    #[serde(default = "tries")]
    pub tries: u32,
    #[serde(default)]
    pub otherwise: Otherwise,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaceRule {
    pub place: Models,
    #[serde(default = "certain")]
    pub count: Random,
    /// Name of the instances, to which a number is appended.
    #[serde(default)]
    pub call: Option<String>,
    /// Defaults to the categories of the model's file.
    #[serde(default)]
    pub category: Option<String>,
    pub at: PlaceSpec,
    #[serde(default)]
    pub turn_deg: Option<Random>,
    #[serde(default)]
    pub scale: Option<Random>,
    #[serde(default)]
    pub drop: bool,
    #[serde(default)]
    pub align: Align,
    /// Clearance around it, m.
    #[serde(default)]
    pub clearance_m: f64,
    /// Whether it may intersect other objects.
    #[serde(default)]
    pub overlap: bool,
    #[serde(default = "tries")]
    pub tries: u32,
    #[serde(default)]
    pub otherwise: Otherwise,
}

/// Where an object is placed: on surfaces, in a box, on surfaces in a box, or along a line.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaceSpec {
    /// Surfaces of the scene that face up.
    #[serde(default)]
    pub on: Option<RuleTarget>,
    /// Steepest slope of these surfaces.
    #[serde(default = "steepest")]
    pub steepest_deg: f64,
    /// A box in the world.
    #[serde(default)]
    pub within: Option<Space>,
    /// A line through points in the world; the object's x axis points along it.
    #[serde(default)]
    pub along: Option<Vec<[f64; 3]>>,
    /// Height above the drawn point, m.
    #[serde(default)]
    pub height_m: Option<Random>,
}

/// Where the carrier of the sensors is placed.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Spot {
    pub on: RuleTarget,
    /// A box in the world.
    #[serde(default)]
    pub within: Option<Space>,
    #[serde(default = "steepest")]
    pub steepest_deg: f64,
    #[serde(default)]
    pub height_m: Option<Random>,
    #[serde(default)]
    pub turn_deg: Option<Random>,
    #[serde(default)]
    pub align: Align,
    /// Clearance around it, m.
    #[serde(default)]
    pub clearance_m: f64,
    #[serde(default = "tries")]
    pub tries: u32,
}

/// A box in the world, m.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Space {
    pub min_m: [f64; 3],
    pub max_m: [f64; 3],
}

/// How an object is oriented on a slope.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Align {
    /// Upright.
    #[default]
    Up,
    /// Along the slope's normal.
    Slope,
}

/// What happens if there is no room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Otherwise {
    /// The sample continues without the object, with a warning.
    #[default]
    Skip,
    /// The sample fails.
    Fail,
}

/// Model files, or folders of model files, with their weights.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Models(pub Vec<(PathBuf, f64)>);

/// Objects of the scene, or their surfaces.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct RuleTarget {
    /// Pattern of their names.
    pub object: Option<String>,
    /// Pattern of their categories.
    pub category: Option<String>,
    /// Pattern of the names of parts.
    pub part: Option<String>,
}

impl RuleTarget {
    /// Whether it matches an object with these names and this category.
    pub fn takes<'n>(&self, mut names: impl Iterator<Item = &'n str>, category: &str) -> bool {
        let fits = |pattern: &Option<String>, name: &str| pattern.as_ref().is_none_or(|it| matches(it, name));
        fits(&self.category, category) && (self.object.is_none() || names.any(|name| fits(&self.object, name)))
    }

    /// Its description, for messages.
    pub fn shown(&self) -> String {
        let keys = [("object", &self.object), ("category", &self.category), ("part", &self.part)];
        let keys = keys.iter().filter_map(|(key, pattern)| Some((key, pattern.as_ref()?)));
        keys.map(|(key, pattern)| format!("{key} {pattern:?}")).collect::<Vec<_>>().join(", ")
    }
}

impl<'de> Deserialize<'de> for RuleTarget {
    /// An object name pattern, or a section of keys.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct TargetKeys {
            object: Option<String>,
            category: Option<String>,
            part: Option<String>,
        }
        let value = Value::deserialize(deserializer)?;
        if let Value::String(object) = value {
            return Ok(RuleTarget { object: Some(object), ..RuleTarget::default() });
        }
        let TargetKeys { object, category, part } = inner(&value)?;
        if object.is_none() && category.is_none() && part.is_none() {
            return Err(D::Error::custom("names nothing; allowed: object, category, part"));
        }
        Ok(RuleTarget { object, category, part })
    }
}

impl<'de> Deserialize<'de> for Models {
    /// A file or folder, or a list of them, each with an optional weight.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct WeightedFile {
            value: PathBuf,
            weight: f64,
        }
        let value = Value::deserialize(deserializer)?;
        let items = match &value {
            Value::Array(items) => items.as_slice(),
            one => std::slice::from_ref(one),
        };
        let model = |item: &Value| match item {
            Value::String(file) => Ok((file.into(), 1.0)),
            item => {
                let WeightedFile { value, weight } = inner(item)?;
                if !(weight > 0.0 && weight <= 1e12) {
                    return Err(D::Error::custom(format!("weight: is {weight}; allowed: above 0, up to 1e12")));
                }
                Ok((value, weight))
            }
        };
        let models: Vec<_> = items.iter().map(model).collect::<Result<_, _>>()?;
        if models.is_empty() {
            return Err(D::Error::custom("names no model; allowed: files and folders"));
        }
        Ok(Models(models))
    }
}

fn certain() -> Random {
    Random::Fixed(1.into())
}

fn tries() -> u32 {
    100
}

fn steepest() -> f64 {
    45.0
}

impl<'de> Deserialize<'de> for Rule {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const KINDS: &[&str] = &["set", "remove", "swap", "move", "place", "look"];
        let mut value = Value::deserialize(deserializer)?;
        let Some(keys) = value.as_object_mut() else { return Err(D::Error::custom("is not a section of keys")) };
        let name = match keys.shift_remove("name") {
            None => None,
            Some(Value::String(name)) => Some(name),
            Some(other) => return Err(D::Error::custom(format!("name: is {other}; allowed: a word"))),
        };
        let kind = *KINDS.iter().find(|kind| keys.contains_key(**kind)).ok_or_else(|| {
            let found = keys.keys().next().cloned().unwrap_or_default();
            D::Error::unknown_field(&found, KINDS)
        })?;
        // By default, rules are named after what they apply to.
        let called = if kind == "place" { keys.get("call") } else { None };
        let name = name.unwrap_or_else(|| match called.unwrap_or(&keys[kind]) {
            Value::String(about) => format!("{kind} {about}"),
            about => format!("{kind} {about}"),
        });
        let what = match kind {
            "set" => What::Set(inner(&value)?),
            "remove" => What::Remove(inner(&value)?),
            "swap" => What::Swap(inner(&value)?),
            "move" => What::Move(inner(&value)?),
            "place" => What::Place(inner(&value)?),
            _ => What::Look(inner(&value)?),
        };
        Ok(Rule { name, what })
    }
}

impl Rule {
    /// The objects that it changes; these are then not built together with others.
    pub fn target(&self) -> Option<&RuleTarget> {
        match &self.what {
            What::Set(_) | What::Place(_) | What::Look(_) => None,
            What::Remove(rule) => Some(&rule.remove),
            What::Swap(rule) => Some(&rule.swap),
            What::Move(rule) => Some(&rule.moved),
        }
    }

    /// All random values of the rule, with their keys.
    fn randoms(&mut self) -> Vec<(&'static str, &mut Random)> {
        fn given<'r>(key: &'static str, random: &'r mut Option<Random>) -> Option<(&'static str, &'r mut Random)> {
            random.as_mut().map(|random| (key, random))
        }
        match &mut self.what {
            What::Set(rule) => vec![("to", &mut rule.to)],
            What::Remove(rule) => vec![("chance", &mut rule.chance)],
            What::Swap(rule) => vec![("chance", &mut rule.chance)],
            What::Move(rule) => {
                let height = rule.to.as_mut().and_then(|place| given("to.height_m", &mut place.height_m));
                let own = [
                    given("by_m", &mut rule.by_m),
                    given("chance", &mut rule.chance),
                    given("turn_deg", &mut rule.turn_deg),
                    given("scale", &mut rule.scale),
                ];
                own.into_iter().flatten().chain(height).collect()
            }
            What::Place(rule) => {
                let own = [
                    Some(("count", &mut rule.count)),
                    given("turn_deg", &mut rule.turn_deg),
                    given("scale", &mut rule.scale),
                    given("at.height_m", &mut rule.at.height_m),
                ];
                own.into_iter().flatten().collect()
            }
            What::Look(rule) => rule.randoms(),
        }
    }

    /// Checks what its type does not ensure.
    fn check(&self, key: &str) -> Result<()> {
        for (name, random) in self.clone().randoms() {
            let key = format!("{key}.{name}");
            match name {
                "to" => {}
                "by_m" | "color" if !random.is_vector() => {
                    return Err(Error::invalid(key, "not three numbers", "[x, y, z], or a distribution of such"));
                }
                "by_m" => {}
                "color" => check_range(key, random, 0.0, 1.0)?,
                "turn_deg" | "scale" if random.is_vector() => {}
                "texture" => {}
                "chance" | "reflectance" | "wetness" | "dirt" => check_number(key, random, 0.0, 1.0)?,
                "count" => check_number(key, random, 0.0, MOST_PLACED)?,
                "scale" => check_number(key, random, SCALES[0], SCALES[1])?,
                _ => check_number(key, random, -LARGEST, LARGEST)?,
            }
        }
        let (place, clearance, tries) = match &self.what {
            What::Move(rule) => (rule.to.as_ref().map(|place| ("to", place)), rule.clearance_m, rule.tries),
            What::Place(rule) => (Some(("at", &rule.at)), Some(rule.clearance_m), rule.tries),
            _ => (None, None, 1),
        };
        if let Some((name, place)) = place {
            place.check(&format!("{key}.{name}"))?;
        }
        check_room(key, clearance.unwrap_or(0.0), tries)
    }
}

/// Checks the parameters of the search for room.
fn check_room(key: &str, clearance_m: f64, tries: u32) -> Result<()> {
    if !(0.0..=1e6).contains(&clearance_m) {
        return Err(Error::invalid(format!("{key}.clearance_m"), clearance_m, "0 to 1e6"));
    }
    if !(1..=1_000_000).contains(&tries) {
        return Err(Error::invalid(format!("{key}.tries"), tries, "1 to 1000000"));
    }
    Ok(())
}

fn check_steepest(key: &str, steepest_deg: f64) -> Result<()> {
    if !(0.0..90.0).contains(&steepest_deg) {
        return Err(Error::invalid(format!("{key}.steepest_deg"), steepest_deg, "0 to 90"));
    }
    Ok(())
}

/// Checks that `random` is a number from `low` to `high`.
fn check_number(key: String, random: &Random, low: f64, high: f64) -> Result<()> {
    if !random.is_number() {
        return Err(Error::invalid(key, "not a number", "a number, or a distribution of numbers"));
    }
    check_range(key, random, low, high)
}

impl Spot {
    /// Checks what its type does not ensure.
    pub fn check(&self, key: &str) -> Result<()> {
        check_steepest(key, self.steepest_deg)?;
        self.within.map_or(Ok(()), |space| space.check(key))?;
        let height = self.height_m.as_ref().map(|height| ("height_m", height));
        let turn = self.turn_deg.as_ref().filter(|turn| !turn.is_vector()).map(|turn| ("turn_deg", turn));
        for (name, random) in height.into_iter().chain(turn) {
            check_number(format!("{key}.{name}"), random, -LARGEST, LARGEST)?;
        }
        check_room(key, self.clearance_m, self.tries)
    }
}

/// Maximum number of models that one rule places.
const MOST_PLACED: f64 = 100_000.0;

/// Smallest and largest factor that objects are scaled by.
pub(crate) const SCALES: [f64; 2] = [1e-6, 1e6];

/// Largest angle or height.
const LARGEST: f64 = 1e9;

impl Space {
    /// `key` is that of the section it belongs to.
    fn check(&self, key: &str) -> Result<()> {
        let Space { min_m, max_m } = self;
        let wrong = (0..3).find(|&k| !(min_m[k] <= max_m[k] && (max_m[k] - min_m[k]).is_finite()));
        wrong.map_or(Ok(()), |axis| {
            let found = format!("from {} to {}", min_m[axis], max_m[axis]);
            Err(Error::invalid(format!("{key}.within"), found, "min_m not above max_m, finite numbers"))
        })
    }

    fn holds(&self, at: DVec3) -> bool {
        (DVec3::from_array(self.min_m).cmple(at) & at.cmple(DVec3::from_array(self.max_m))).all()
    }
}

impl PlaceSpec {
    fn check(&self, key: &str) -> Result<()> {
        let places = [self.on.is_some() || self.within.is_some(), self.along.is_some()];
        if places[0] == places[1] {
            let found = if places[0] { "several places" } else { "no place" };
            return Err(Error::invalid(key, found, "one of on, within, along, or on and within"));
        }
        check_steepest(key, self.steepest_deg)?;
        self.within.map_or(Ok(()), |space| space.check(key))?;
        if let Some(points) = &self.along
            && (points.len() < 2 || !points.iter().flatten().all(|number| number.is_finite()))
        {
            let found = format!("{} points", points.len());
            return Err(Error::invalid(format!("{key}.along"), found, "two points or more, finite numbers"));
        }
        Ok(())
    }
}

/// Checks all rules, and that their names are distinct.
pub(crate) fn check(rules: &[Rule]) -> Result<()> {
    let mut names = HashSet::new();
    for (index, rule) in rules.iter().enumerate() {
        let key = format!("variation[{index}]");
        if !names.insert(&rule.name) {
            let found = format!("called {:?}, like an earlier rule", rule.name);
            return Err(Error::invalid(key, found, "a `name` of its own, by which its draws are addressed"));
        }
        rule.check(&key)?;
    }
    Ok(())
}

/// Gives the grids of all rules their strides; returns the number of combinations.
pub(crate) fn number_grids(rules: &mut [Rule]) -> u64 {
    let mut next = 1;
    rules.iter_mut().flat_map(Rule::randoms).for_each(|(_, random)| random.number_grids(&mut next));
    next
}
