//! Names and numbers of the labels of what is added to a scene.

use crate::scene::Object;
use model::Labels;
use model::material::Material;
use std::collections::HashMap;

/// Label numbers that differ from those in the scene that the objects come from.
pub(super) struct Renumbered {
    categories: HashMap<u32, u32>,
    parts: HashMap<u32, u32>,
}

impl Renumbered {
    /// Merges the names of categories, parts and materials from `other` into `labels`.
    pub fn absorbing(labels: &mut Labels, other: &Labels) -> Renumbered {
        labels.material.absorb(&other.material);
        let (categories, parts) = (labels.category.absorb(&other.category), labels.part.absorb(&other.part));
        let numbers = Renumbered { categories, parts };
        labels.las_class.extend(other.las_class.iter().map(|(&id, &class)| (numbers.category_of(id), class)));
        numbers
    }

    pub fn category(&self, object: &Object) -> u32 {
        self.category_of(object.category_id)
    }

    fn category_of(&self, id: u32) -> u32 {
        self.categories.get(&id).copied().unwrap_or(id)
    }

    pub fn parts(&self, object: &Object) -> Vec<u32> {
        object.part_ids.iter().map(|id| self.parts.get(id).copied().unwrap_or(*id)).collect()
    }
}

/// Names an instance number, if both are given and it has no name yet.
pub(super) fn name_instance(labels: &mut Labels, number: u32, name: &str) {
    if !name.is_empty() && labels.instance.name(number).is_none() {
        labels.instance.set(number, name);
    }
}

/// Gives the name of a material a number, if it has none yet.
pub(super) fn name_material(labels: &mut Labels, material: &Material) {
    labels.material.numbered(&material.name);
}
