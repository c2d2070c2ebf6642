//! What surfaces are made of, by material name pattern.

use super::Scene;
use super::pattern::matches;
use ground::error::{Error, Result};
use ground::read::yaml::{Document, join};
use ground::shown;
use model::Mesh;
use model::material::Material;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Material name patterns (`*` and `?`), and what the materials that they match become. Where several match, those with
/// more letters take precedence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct MaterialRules(BTreeMap<String, MaterialRule>);

/// What a rule does to a material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum MaterialRule {
    /// It reflects light and sound like the library material of this name.
    Library(String),
    /// These keys of a material file are set; the others are unchanged.
    Keys(Value),
}

impl MaterialRules {
    /// Reads a file (YAML) of patterns, each with the name of a library material or with keys of a material file.
    ///
    /// # Errors
    /// A missing file; an unknown key or library material, with its line.
    pub fn load(path: impl AsRef<Path>) -> Result<MaterialRules> {
        MaterialRules::read(&Document::load(path.as_ref())?)
    }

    /// [`MaterialRules::load`] from the text of a file.
    ///
    /// # Errors
    /// As [`MaterialRules::load`].
    pub fn from_yaml(text: &str) -> Result<MaterialRules> {
        MaterialRules::read(&Document::parse("YAML text", text)?)
    }

    fn read(document: &Document) -> Result<MaterialRules> {
        // An empty file has no rules.
        let rules: MaterialRules = if document.value().is_null() { Self::default() } else { document.read()? };
        rules.check(document, "")?;
        Ok(rules)
    }

    /// Checks the rules, which are at `key` of `document`.
    #[doc(hidden)]
    pub fn check(&self, document: &Document, key: &str) -> Result<()> {
        self.0.iter().try_for_each(|(pattern, rule)| {
            let key = join(key, pattern);
            rule.of(&key, pattern, &Material::default()).map(drop).map_err(|error| match error {
                // From a separate section, which has no lines.
                Error::Parse { place, message, .. } => document.error(&join(&key, &place), &message),
                Error::Missing { .. } => document.error(&key, &error.to_string()),
                other => document.locate(other),
            })
        })
    }

    /// Adds a rule, which replaces one with the same pattern.
    pub fn set(&mut self, pattern: impl Into<String>, rule: MaterialRule) {
        self.0.insert(pattern.into(), rule);
    }

    /// The patterns, in order.
    pub fn patterns(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Whether there are no rules.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// `material` as changed by the rules; `None` if no rule matches. `key` is that of the rules.
    fn of(&self, key: &str, material: &Material) -> Result<Option<Material>> {
        let mut matching: Vec<_> = self.0.iter().filter(|(pattern, _)| matches(pattern, &material.name)).collect();
        matching.sort_by_key(|(pattern, _)| pattern.chars().filter(|letter| !"*?".contains(*letter)).count());
        matching.into_iter().try_fold(None, |before: Option<Material>, (pattern, rule)| {
            rule.of(&join(key, pattern), pattern, before.as_ref().unwrap_or(material)).map(Some)
        })
    }
}

impl MaterialRule {
    /// `material` as changed by this rule for `pattern`, which is at `key`.
    fn of(&self, key: &str, pattern: &str, material: &Material) -> Result<Material> {
        let by = |what: &str| format!("{what} by the rule {:?}", shown::name(pattern));
        match self {
            MaterialRule::Library(name) => Ok(material.made_of(&Material::library(name)?, by(name))),
            MaterialRule::Keys(keys) => {
                let mut changed = material.with_keys(key, keys)?;
                if keys.get("reflectance").is_some() && keys.get("source").is_none() {
                    changed.source = by("").trim_start().to_owned();
                }
                Ok(changed)
            }
        }
    }
}

impl Scene {
    /// Applies `rules`, which are at `key`, to the materials. Returns the patterns that no material's name matches.
    #[doc(hidden)]
    pub fn apply(&mut self, rules: &MaterialRules, key: &str) -> Result<Vec<String>> {
        let mut replaced: HashMap<*const Material, Arc<Material>> = HashMap::new();
        for material in self.materials.iter().filter(|_| !rules.is_empty()) {
            if let Some(changed) = rules.of(key, material)? {
                replaced.insert(Arc::as_ptr(material), Arc::new(changed));
            }
        }
        let unmatched = |pattern: &&str| !self.materials.iter().any(|material| matches(pattern, &material.name));
        let unmatched = rules.patterns().filter(unmatched).map(str::to_owned).collect();
        if replaced.is_empty() {
            return Ok(unmatched);
        }
        let mut meshes: HashMap<*const Mesh, Arc<Mesh>> = HashMap::new();
        let of = |material: &Arc<Material>| replaced.get(&Arc::as_ptr(material)).cloned();
        for object in &mut self.objects {
            let mesh = meshes.entry(Arc::as_ptr(&object.mesh));
            object.mesh = mesh.or_insert_with(|| Arc::new(object.mesh.with_materials(of))).clone();
        }
        self.materials.iter_mut().for_each(|material| *material = of(material).unwrap_or_else(|| material.clone()));
        Ok(unmatched)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LoadOptions;
    use model::material::{Alpha, Reflectance, Scattering};

    fn rules(text: &str) -> MaterialRules {
        MaterialRules::from_yaml(text).unwrap()
    }

    fn named(name: &str) -> Material {
        Material::default().name(name).base_color([0.1, 0.2, 0.3, 1.0])
    }

    #[test]
    fn more_letters_take_precedence() {
        let rules = rules("'*': {roughness: 0.3, reflectance: 0.1}\nSofa*: fabric\nSofa?: {reflectance: 0.7}");
        let of = |name: &str| rules.of("", &named(name)).unwrap().unwrap();
        let plain = of("thing");
        assert_eq!((plain.reflectance, plain.roughness), (Some(Reflectance::Constant(0.1)), 0.3));
        assert_eq!(plain.source, "by the rule \"*\"");
        let sofa = of("Sofa_blue");
        assert_eq!(sofa.reflectance, Material::library("fabric").unwrap().reflectance);
        assert_eq!((sofa.name.as_str(), sofa.base_color, sofa.roughness), ("Sofa_blue", [0.1, 0.2, 0.3, 1.0], 0.3));
        assert_eq!(sofa.source, "fabric by the rule \"Sofa*\"");
        assert_eq!(of("Sofa2").reflectance, Some(Reflectance::Constant(0.7)));
        let none = MaterialRules::from_yaml("{}").unwrap();
        assert!(none.is_empty() && none.of("", &named("a")).unwrap().is_none());
        let optics =
            MaterialRules::from_yaml("a: {transmission: 0.9, scattering: {model: oren_nayar, slope_sigma_deg: 20}}");
        let optics = optics.unwrap().of("", &named("a")).unwrap().unwrap();
        assert_eq!((optics.transmission, optics.reflectance), (0.9, None));
        assert!(matches!(optics.scattering, Scattering::OrenNayar { .. }));
    }

    #[test]
    fn mistakes_are_reported_with_their_line() {
        for (text, expected) in [
            ("a: wood\nb: wod", "line 2: b: there is no library material named \"wod\"; near: wood"),
            ("a:\n  reflectance: 2", "line 2: a.reflectance: is 2; allowed: 0 to 1"),
            ("a:\n  roughnes: 1", "line 2: a.roughnes: unknown key \"roughnes\"; near: roughness"),
            ("a: {reflectance: []}", "line 1: a.reflectance: is an empty list; allowed: a number"),
            ("- a", "line 1: invalid type: sequence, expected a section"),
        ] {
            let error = MaterialRules::from_yaml(text).unwrap_err().to_string();
            assert!(error.starts_with(&format!("YAML text: {expected}")), "{text:?}\n  {error}");
        }
    }

    /// Rules and warnings reach the parts of a scene: a box of glass has no volume until a rule gives it one, and
    /// patterns that match nothing are reported with similar names.
    #[test]
    fn rules_apply_to_scenes() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let corners: String = (0..8).map(|k| format!("v {} {} {}\n", k & 1, k >> 1 & 1, k >> 2)).collect();
        let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
        let objects = format!("mtllib a.mtl\n{corners}o box\nusemtl vase\n{faces}o sheet\nusemtl pane\nf 1 3 4 2\n");
        std::fs::write(path("a.obj"), objects).unwrap();
        std::fs::write(path("a.mtl"), "newmtl vase\nd 0.1\nnewmtl pane\nd 0.1\n").unwrap();
        let load = |rules: &str| {
            let options = LoadOptions { materials: self::rules(rules), ..LoadOptions::default() };
            let scene = Scene::load_with(path("a.obj"), &options).unwrap();
            let of = |object: usize| scene.objects[object].mesh.parts[0].material.clone().unwrap();
            ([of(0), of(1)], scene.report.warnings)
        };
        let ([vase, pane], warnings) = load("'*': {transmission: 0.9, roughness: 0}\nvaze: glass");
        assert_eq!((vase.transmission, pane.transmission), (0.9, 0.9));
        // A material that rules turn into glass is a pane, whatever its alpha, unless they specify what alpha means.
        let alphas = |rules: &str| load(rules).0.map(|material| material.alpha);
        assert_eq!([vase.alpha, pane.alpha], [Alpha::Solid; 2]);
        assert_eq!(alphas("vase: {alpha_cutoff: 0.2}"), [Alpha::Coverage, Alpha::Solid], "a pane is glass by its name");
        assert_eq!(alphas("vase: glass\npane: {alpha: coverage}"), [Alpha::Solid, Alpha::Coverage]);
        assert_eq!(alphas("vase: {alpha: cutout, transmission: 0.5}")[0], Alpha::Cutout);
        let thin_bodies = warnings.iter().filter(|warning| warning.contains("infinitely thin")).collect::<Vec<_>>();
        assert!(
            thin_bodies.len() == 1 && thin_bodies[0].starts_with("material \"vase\": 1 part with a closed surface"),
            "{warnings:?}"
        );
        let unmatched = "material rules: no material's name matches \"vaze\"; near: vase";
        assert!(warnings.iter().any(|warning| warning == unmatched), "{warnings:?}");
        for (pattern, near) in [("vaze*", "vase"), ("'*wase'", "vase"), ("'*an*'", "pane")] {
            let (_, warnings) = load(&format!("{pattern}: glass"));
            let matched = warnings.is_empty();
            assert!(matched || warnings[0].ends_with(&format!("; near: {near}")), "{pattern}: {warnings:?}");
            assert_eq!(matched, pattern == "'*an*'", "{pattern}");
        }
        let ([vase, pane], warnings) = load("'*': {transmission: 0.9}\nvase: {thickness_m: 0.01}\npane: fabric");
        assert_eq!((vase.thickness_m, pane.reflectance.is_some()), (0.01, true));
        assert!(warnings.is_empty(), "{warnings:?}");
    }
}
