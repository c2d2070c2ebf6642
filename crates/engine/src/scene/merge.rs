//! Several scene files as one scene.

use super::identity::InstanceKey;
use super::load::NamedObject;
use super::{LabelRules, Scene};
use model::Camera;
use model::motion::Timeline;
use std::sync::Arc;

impl Scene {
    /// Merges `scenes`, which were read with `rules`, as they are: one world, one numbering of the labels. Objects,
    /// cameras and warnings keep their order.
    pub(super) fn merge(mut scenes: Vec<Scene>, rules: &LabelRules) -> Scene {
        if scenes.len() == 1 {
            return scenes.remove(0);
        }
        let mut all = Scene::default();
        let (mut objects, mut timeline) = (Vec::new(), Timeline::default());
        let mut numbers = [rules.numbers.clone(), rules.numbers.clone()];
        for (number, scene) in scenes.into_iter().enumerate() {
            let Scene { labels, .. } = scene;
            for (numbers, table) in numbers.iter_mut().zip([&labels.category, &labels.part]) {
                // The file itself assigned these, or they do no harm.
                let given = table.iter().filter(|(id, name)| id.to_string() == **name);
                given.for_each(|(id, name)| {
                    numbers.entry(name.to_owned()).or_insert(id);
                });
            }
            let shift = timeline.append(Arc::unwrap_or_clone(scene.timeline));
            objects.extend(scene.objects.into_iter().map(|object| NamedObject {
                category: labels.category.name(object.category_id).unwrap_or_default().to_owned(),
                parts: object.part_ids.iter().map(|&id| labels.part.name(id).unwrap_or_default().to_owned()).collect(),
                instance: InstanceKey::Shared(number, object.instance_id),
                instance_name: labels.instance.name(object.instance_id).unwrap_or_default().to_owned(),
                name: object.name,
                mesh: object.mesh,
                world_from_object: object.world_from_object,
                up: object.up,
                motion: object.motion.map(|motion| motion.shifted(shift)),
                ancestors: object.ancestors,
            }));
            all.materials.extend(scene.materials);
            all.cameras.extend(
                scene.cameras.into_iter().map(|camera| Camera { node: camera.node.map(|node| node + shift), ..camera }),
            );
            all.animations.extend(scene.animations);
            all.animation_lengths.extend(scene.animation_lengths);
            all.joints.extend(scene.joints);
            all.degenerate_triangles += scene.degenerate_triangles;
            all.hidden.extend(scene.hidden);
            all.report.absorb(scene.report);
        }
        all.timeline = Arc::new(timeline);
        all.number(objects, rules, numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Material, Mesh, Part, UpAxis};
    use super::*;
    use glam::DAffine3;
    use model::{RawObject, RawScene};
    use std::collections::BTreeMap;

    /// One object of one triangle.
    fn scene(object: &str, category: Option<&str>, material: &str, rules: &LabelRules) -> Scene {
        let material = Arc::new(Material::default().name(material.to_owned()));
        let part = Part::default()
            .positions(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].into())
            .triangles(vec![[0, 1, 2]].into())
            .material(Some(material.clone()));
        let object = RawObject {
            name: object.to_owned(),
            mesh: Arc::new(Mesh::trusted(String::new(), vec![part])),
            world_from_object: DAffine3::IDENTITY,
            up: UpAxis::Z,
            category: category.map(str::to_owned),
            part: None,
            motion: None,
            ancestors: Arc::default(),
            has_node: false,
        };
        let options = super::super::LoadOptions { labels: rules.clone(), ..Default::default() };
        let raw = RawScene { objects: vec![object], materials: vec![material], ..RawScene::default() };
        Scene::assemble(raw, &options)
    }

    #[test]
    fn labels_are_numbered_together() {
        let rules = LabelRules { numbers: BTreeMap::from([("road".to_owned(), 40)]), ..LabelRules::default() };
        let first = scene("Tree", None, "wood", &rules);
        let second = scene("Street_1", Some("road"), "asphalt", &rules);
        let third = scene("Car", None, "wood", &rules);
        let all = Scene::merge(vec![first, second, third], &rules);

        let category = |index: usize| all.labels.category.name(all.objects[index].category_id);
        assert_eq!([category(0), category(1), category(2)], [Some("Tree"), Some("road"), Some("Car")]);
        assert_eq!(all.labels.category.id("road"), 40);
        let part = |index: usize| all.labels.part.name(all.objects[index].part_ids[0]);
        assert_eq!([part(0), part(1), part(2)], [Some("wood"), Some("asphalt"), Some("wood")]);
        assert_eq!(all.labels.material.names, ["asphalt", "wood"]);
        let instances: Vec<u32> = all.objects.iter().map(|object| object.instance_id).collect();
        assert_eq!(instances, [3, 2, 1]);
    }

    #[test]
    fn unused_rules_are_reported_once_all_files_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["Tree_1", "Car"].map(|name| folder.path().join(format!("{name}.obj")));
        for (path, name) in files.iter().zip(["Tree_1", "Car"]) {
            std::fs::write(path, format!("o {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {name}s\nf 1 2 3\n")).unwrap();
        }
        let words = |pairs: &[(&str, &str)]| pairs.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
        let labels = LabelRules {
            numbers: ["tree", "vehicle", "Cars", "sky"].map(str::to_owned).into_iter().zip(1..).collect(),
            objects: words(&[("Tree_*", "tree"), ("Car", "vehicle"), ("Lamp*", "lamp")]),
            materials: words(&[("Tree?1s", "bark"), ("Steal", "steel"), ("Wod", "wood")]),
            ..LabelRules::default()
        };
        let options = super::super::LoadOptions { labels, ..Default::default() };
        let warnings = |files: &[std::path::PathBuf]| {
            let warnings = Scene::load_all(files, &options).unwrap().report.warnings;
            warnings.into_iter().filter(|warning| warning.starts_with("label rules: ")).collect::<Vec<_>>()
        };
        assert_eq!(
            warnings(&files),
            [
                "label rules: patterns that no object's name matches (objects): Lamp*",
                "label rules: patterns that no used material's name matches (materials): Steal, Wod",
                "label rules: names that no object and no part has (numbers): sky",
            ]
        );
        assert!(warnings(&files[1..])[0].ends_with(": Lamp*, Tree_*"));
    }
}
