//! Categories of nuScenes.

use crate::set::points::is_word;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};

/// In the order of their numbers in its lidarseg (Fong et al. 2022, Panoptic nuScenes; tables of its development kit):
/// those from 1 to 23 have boxes.
const NAMES: [&str; 32] = [
    "noise",
    "animal",
    "human.pedestrian.adult",
    "human.pedestrian.child",
    "human.pedestrian.construction_worker",
    "human.pedestrian.personal_mobility",
    "human.pedestrian.police_officer",
    "human.pedestrian.stroller",
    "human.pedestrian.wheelchair",
    "movable_object.barrier",
    "movable_object.debris",
    "movable_object.pushable_pullable",
    "movable_object.trafficcone",
    "static_object.bicycle_rack",
    "vehicle.bicycle",
    "vehicle.bus.bendy",
    "vehicle.bus.rigid",
    "vehicle.car",
    "vehicle.construction",
    "vehicle.emergency.ambulance",
    "vehicle.emergency.police",
    "vehicle.motorcycle",
    "vehicle.trailer",
    "vehicle.truck",
    "flat.driveable_surface",
    "flat.other",
    "flat.sidewalk",
    "flat.terrain",
    "static.manmade",
    "static.other",
    "static.vegetation",
    "vehicle.ego",
];

/// Number that stands for points without a category.
pub(super) const NOISE: u8 = 0;

/// Number that stands for categories that nuScenes does not have.
pub(super) const OTHER: u8 = 29;

/// The first number of the categories without boxes.
const STUFF: usize = 24;

/// Maximum number of added categories: numbers have 8 bits.
pub(super) const MOST_OWN: usize = 256 - NAMES.len();

/// Names in nuScenes of those that scenes use.
const KNOWN: [(&str, &str); 35] = [
    ("person", "human.pedestrian.adult"),
    ("pedestrian", "human.pedestrian.adult"),
    ("adult", "human.pedestrian.adult"),
    ("child", "human.pedestrian.child"),
    ("barrier", "movable_object.barrier"),
    ("traffic-cone", "movable_object.trafficcone"),
    ("cone", "movable_object.trafficcone"),
    ("bicycle", "vehicle.bicycle"),
    ("bicyclist", "vehicle.bicycle"),
    ("cyclist", "vehicle.bicycle"),
    ("bus", "vehicle.bus.rigid"),
    ("car", "vehicle.car"),
    ("van", "vehicle.car"),
    ("motorcycle", "vehicle.motorcycle"),
    ("motorcyclist", "vehicle.motorcycle"),
    ("trailer", "vehicle.trailer"),
    ("truck", "vehicle.truck"),
    ("road", "flat.driveable_surface"),
    ("parking", "flat.driveable_surface"),
    ("lane-marking", "flat.driveable_surface"),
    ("path", "flat.other"),
    ("other-ground", "flat.other"),
    ("sidewalk", "flat.sidewalk"),
    ("terrain", "flat.terrain"),
    ("grass", "flat.terrain"),
    ("building", "static.manmade"),
    ("fence", "static.manmade"),
    ("other-structure", "static.manmade"),
    ("pole", "static.manmade"),
    ("traffic-sign", "static.manmade"),
    ("vegetation", "static.vegetation"),
    ("trunk", "static.vegetation"),
    ("tree", "static.vegetation"),
    ("bush", "static.vegetation"),
    ("other-object", "static.other"),
];

/// The categories of a set: those of nuScenes, and those that a scenario adds.
pub(super) struct Categories<'c> {
    given: &'c BTreeMap<String, String>,
    /// The added ones, sorted.
    own: Vec<&'c str>,
}

impl<'c> Categories<'c> {
    /// With the names that a scenario gives to its categories.
    pub fn new(given: &'c BTreeMap<String, String>) -> Self {
        let own: BTreeSet<&str> = given.values().map(String::as_str).filter(|name| !NAMES.contains(name)).collect();
        Categories { given, own: own.into_iter().collect() }
    }

    /// The added categories.
    pub fn own(&self) -> &[&'c str] {
        &self.own
    }

    /// Name in the set of the scene's category `ours`.
    fn name<'n>(&self, ours: &'n str) -> Option<&'n str>
    where
        'c: 'n,
    {
        let known = || KNOWN.iter().find(|(name, _)| is_word(name, ours)).map(|(_, theirs)| *theirs);
        let same = || NAMES.into_iter().find(|name| is_word(name, ours));
        self.given.get(ours).map(String::as_str).or_else(known).or_else(same)
    }

    /// Number of the scene's category `ours`.
    pub fn index(&self, ours: &str) -> Option<u8> {
        let name = self.name(ours)?;
        let found = NAMES.iter().chain(&self.own).position(|known| *known == name)?;
        u8::try_from(found).ok()
    }

    /// Name in the set of the scene's category `ours`, if it has boxes.
    pub fn of_boxes<'n>(&self, ours: &'n str) -> Option<&'n str>
    where
        'c: 'n,
    {
        self.name(ours).filter(|name| NAMES[1..STUFF].contains(name) || self.own.contains(name))
    }

    /// The rows of the table.
    pub fn rows(&self) -> Vec<String> {
        let row = |(index, name): (usize, &&str)| {
            json!({"token": token_of(name), "name": name, "description": "", "index": index}).to_string()
        };
        NAMES.iter().chain(&self.own).enumerate().map(row).collect()
    }
}

/// The token of a category.
pub(super) fn token_of(name: &str) -> String {
    super::token(&["category", name])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn categories_have_the_numbers_of_nuscenes_or_new_ones() {
        let given = |pairs: &[(&str, &str)]| pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
        let none = BTreeMap::new();
        let known = Categories::new(&none);
        // As lidarseg numbers them.
        let numbers =
            ["car", "person", "road", "vehicle.truck", "tree", "vehicle.ego", "kiosk"].map(|name| known.index(name));
        assert_eq!(numbers, [Some(17), Some(2), Some(24), Some(23), Some(30), Some(31), None]);
        let numbers = ["Car", "Vehicle.Car", "Traffic_Cone", "cars"].map(|name| known.index(name));
        assert_eq!(numbers, [Some(17), Some(17), Some(12), None]);
        assert_eq!(known.of_boxes("bus"), Some("vehicle.bus.rigid"));
        assert_eq!((known.of_boxes("road"), known.of_boxes("kiosk"), known.of_boxes("noise")), (None, None, None));
        // New names are numbered in sorted order, whichever categories they are given to.
        let given = given(&[
            ("kiosk", "static.kiosk"),
            ("bench", "static.bench"),
            ("car", "vehicle.truck"),
            ("seat", "static.bench"),
        ]);
        let more = Categories::new(&given);
        let numbers = ["kiosk", "bench", "seat", "car", "van"].map(|name| more.index(name));
        assert_eq!(numbers, [Some(33), Some(32), Some(32), Some(23), Some(17)]);
        assert_eq!(more.of_boxes("kiosk"), Some("static.kiosk"));
        assert_eq!((more.rows().len(), known.rows().len()), (34, 32));
    }
}
