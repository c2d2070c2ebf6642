//! Masks of KITTI's semantic benchmark: the class of each pixel, and the number of its instance.

use crate::set::points::{LabelCache, is_word};
use cloud::export::images::{PixelFormat, write_numbers};
use cloud::image::RangeImage;
use ground::error::Result;
use ground::report::Report;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// Classes and their numbers, which are those of Cityscapes (Abu Alhaija et al. 2018, Augmented reality meets computer
/// vision; `labels.py` of KITTI's `devkit_semantics`).
const CLASSES: [(&str, u32); 30] = [
    ("unlabeled", 0),
    ("static", 4),
    ("dynamic", 5),
    ("ground", 6),
    ("road", 7),
    ("sidewalk", 8),
    ("parking", 9),
    ("rail-track", 10),
    ("building", 11),
    ("wall", 12),
    ("fence", 13),
    ("guard-rail", 14),
    ("bridge", 15),
    ("tunnel", 16),
    ("pole", 17),
    ("traffic-light", 19),
    ("traffic-sign", 20),
    ("vegetation", 21),
    ("terrain", 22),
    ("sky", 23),
    ("person", 24),
    ("rider", 25),
    ("car", 26),
    ("truck", 27),
    ("bus", 28),
    ("caravan", 29),
    ("trailer", 30),
    ("train", 31),
    ("motorcycle", 32),
    ("bicycle", 33),
];

/// Other names that scenes use: those of KITTI's boxes, of SemanticKITTI and of generated scenes.
const OTHERS: [(&str, &str); 19] = [
    ("outlier", "unlabeled"),
    ("other-structure", "static"),
    ("other-object", "static"),
    ("other-vehicle", "dynamic"),
    ("other-ground", "ground"),
    ("path", "ground"),
    ("floor", "ground"),
    ("lane-marking", "road"),
    ("trunk", "vegetation"),
    ("tree", "vegetation"),
    ("bush", "vegetation"),
    ("grass", "terrain"),
    ("pedestrian", "person"),
    ("bicyclist", "rider"),
    ("cyclist", "rider"),
    ("motorcyclist", "rider"),
    ("van", "car"),
    ("on-rails", "train"),
    ("tram", "train"),
];

/// Number of a class.
pub(super) fn number(class: &str) -> Option<u32> {
    CLASSES.iter().find(|(known, _)| is_word(known, class)).map(|(_, number)| *number)
}

/// Number of the class of a category.
pub(super) fn number_of(category: &str) -> Option<u32> {
    number(OTHERS.iter().find(|(known, _)| is_word(known, category)).map_or(category, |(_, class)| class))
}

/// Names of all classes.
pub(super) fn classes() -> String {
    CLASSES.map(|(name, _)| name).join(", ")
}

/// Writes the two masks of an image, given the class of each category by its name.
///
/// # Errors
/// I/O errors.
pub(super) fn write(
    image: &RangeImage,
    mut class: impl FnMut(&str) -> u32,
    [semantic, instance]: [&Path; 2],
    report: &mut Report,
) -> Result<()> {
    let mut known = LabelCache::new();
    let mut of = |category: u32| known.of(category, || image.labels.category.name(category).map_or(0, &mut class));
    let classes: Vec<u32> = image.category_id.iter().map(|&category| of(category)).collect();
    let (instances, all) = instances(&classes, &image.instance_id);
    if !all {
        report.warn(format!("kitti: masks number {MOST} instances of a class in an image, others have no number"));
    }
    let texts = |quantity: &str| vec![("quantity".to_owned(), quantity.to_owned())];
    write_numbers(image, classes.into_iter(), PixelFormat::Grey8, texts("class"), semantic)?;
    write_numbers(image, instances.into_iter(), PixelFormat::Grey16, texts("256 class + instance"), instance)
}

/// Maximum number of instances of a class: they have 8 bits, and 0 is none.
const MOST: u32 = 255;

/// Values of the instance mask for pixels of these classes and instances: 256 times the class plus the number of the
/// instance, counted from 1 in each class; and whether all instances have a number.
fn instances(classes: &[u32], ids: &[u32]) -> (Vec<u32>, bool) {
    let pixels: Vec<[u32; 2]> = classes.iter().zip(ids).map(|(&class, &id)| [class, id]).collect();
    let runs = || pixels.chunk_by(|a, b| a == b);
    let seen: BTreeSet<[u32; 2]> = runs().map(|run| run[0]).filter(|[class, id]| *class != 0 && *id != 0).collect();
    let seen: Vec<[u32; 2]> = seen.into_iter().collect();
    let of_class = seen.chunk_by(|a, b| a[0] == b[0]);
    let numbers: HashMap<[u32; 2], u32> = of_class.flat_map(|things| things.iter().copied().zip(1..=MOST)).collect();
    let value = |pixel: [u32; 2]| 256 * pixel[0] + numbers.get(&pixel).copied().unwrap_or(0);
    let values = runs().flat_map(|run| std::iter::repeat_n(value(run[0]), run.len())).collect();
    (values, numbers.len() == seen.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instances_are_counted_in_their_class() {
        // Nothing, a car, the road, a person, two cars, the first again, an instance without a class.
        let (classes, ids) = ([0, 26, 7, 24, 26, 26, 26, 0], [0, 70_000, 0, 9, 5, 6, 70_000, 8]);
        let car = 26 * 256;
        assert_eq!(
            instances(&classes, &ids),
            (vec![0, car + 3, 7 * 256, 24 * 256 + 1, car + 1, car + 2, car + 3, 0], true)
        );
        let (values, all) = instances(&[26; 300], &(1..=300).collect::<Vec<u32>>());
        assert!(!all && values[254] == car + 255 && values[255..].iter().all(|value| *value == car));
    }

    #[test]
    fn every_name_has_a_class() {
        assert!(OTHERS.iter().all(|(name, class)| number(name).is_none() && number(class).is_some()));
    }
}
