//! Several scene files as one scene.

use super::{Mesh, NamedObject, Scene};
use std::collections::BTreeMap;
use std::sync::Arc;

impl Scene {
    /// Puts `scenes` together as they stand: one world, one numbering of the labels. Objects, cameras and warnings keep
    /// their order. `numbers` are those of the label rules that the scenes were read with
    /// ([`super::LabelRules::numbers`]).
    #[must_use]
    pub fn merge(scenes: Vec<Scene>, numbers: &BTreeMap<String, u32>) -> Scene {
        let mut all = Scene::default();
        let mut objects = Vec::new();
        for scene in scenes {
            let (mesh_offset, material_offset, texture_offset) =
                (all.meshes.len(), all.materials.len(), all.textures.len());
            let Scene { meshes, labels, .. } = scene;
            objects.extend(scene.objects.into_iter().map(|object| NamedObject {
                category: labels.category.name(object.category_id).unwrap_or_default().to_owned(),
                parts: object.part_ids.iter().map(|&id| labels.part.name(id).unwrap_or_default().to_owned()).collect(),
                name: object.name,
                mesh: object.mesh + mesh_offset,
                world_from_object: object.world_from_object,
            }));
            all.meshes.extend(meshes.into_iter().map(|mesh| with_materials_from(mesh, material_offset)));
            all.materials.extend(scene.materials.into_iter().map(|mut material| {
                if let Some(texture) = &mut material.base_color_texture {
                    texture.texture += texture_offset;
                }
                material
            }));
            all.textures.extend(scene.textures);
            all.cameras.extend(scene.cameras);
            all.animations.extend(scene.animations);
            all.degenerate_triangles += scene.degenerate_triangles;
            all.report.absorb(scene.report);
        }
        all.number(objects, numbers)
    }
}

/// `mesh` with its materials `offset` further on; vertices and triangles stay shared.
fn with_materials_from(mut mesh: Arc<Mesh>, offset: usize) -> Arc<Mesh> {
    if offset > 0 {
        for part in &mut Arc::make_mut(&mut mesh).parts {
            part.material = part.material.map(|material| material + offset);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::super::{LabelRules, Material, Part, RawObject, Texture, TextureRef};
    use super::*;
    use glam::DAffine3;

    /// One object of one triangle with a textured material.
    fn scene(object: &str, category: Option<&str>, material: &str, rules: &LabelRules) -> Scene {
        let part = Part {
            positions: Arc::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            triangles: Arc::new(vec![[0, 1, 2]]),
            material: Some(0),
            ..Part::default()
        };
        let material = Material {
            name: material.to_owned(),
            base_color_texture: Some(TextureRef::plain(0)),
            ..Material::default()
        };
        let empty = Scene {
            meshes: vec![Arc::new(Mesh { name: String::new(), parts: vec![part] })],
            materials: vec![material],
            textures: vec![Arc::new(Texture { width: 1, height: 1, pixels: vec![[255; 4]] })],
            ..Scene::default()
        };
        let object = RawObject {
            name: object.to_owned(),
            mesh: 0,
            world_from_object: DAffine3::IDENTITY,
            category: category.map(str::to_owned),
            part: None,
        };
        empty.assemble(vec![object], rules)
    }

    #[test]
    fn labels_are_numbered_together_and_indices_move() {
        let rules = LabelRules { numbers: BTreeMap::from([("road".to_owned(), 40)]), ..LabelRules::default() };
        let first = scene("Tree", None, "wood", &rules);
        let second = scene("Street_1", Some("road"), "asphalt", &rules);
        let third = scene("Car", None, "wood", &rules);
        let all = Scene::merge(vec![first, second, third], &rules.numbers);

        let category = |index: usize| all.labels.category.name(all.objects[index].category_id);
        assert_eq!([category(0), category(1), category(2)], [Some("Tree"), Some("road"), Some("Car")]);
        assert_eq!(all.labels.category.id("road"), 40);
        let part = |index: usize| all.labels.part.name(all.objects[index].part_ids[0]);
        assert_eq!([part(0), part(1), part(2)], [Some("wood"), Some("asphalt"), Some("wood")]);
        assert_eq!(all.labels.material.names, ["asphalt", "wood"]);
        let instances: Vec<u32> = all.objects.iter().map(|object| object.instance_id).collect();
        assert_eq!(instances, [3, 2, 1]);
        for (index, object) in all.objects.iter().enumerate() {
            assert_eq!(object.mesh, index);
            assert_eq!(all.meshes[index].parts[0].material, Some(index));
            assert_eq!(all.materials[index].base_color_texture.as_ref().map(|t| t.texture), Some(index));
        }
    }
}
