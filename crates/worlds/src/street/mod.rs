//! A street, or a town of streets, with houses, trees, parked cars, and animated traffic and people.

mod cars;
mod drive;
mod furniture;
mod ground;
mod houses;
mod person;
mod plan;
mod signs;
mod skeleton;
#[cfg(test)]
mod tests;
mod walk;

use super::glb::Placement;
use super::model::Made;
use super::{GeneratedScene, within};
use ::ground::builder;
use ::ground::error::{Error, Result};
use glam::{DQuat, DVec3, EulerRot};
use plan::{KERB, StreetPlan};
use serde::{Deserialize, Serialize};

builder! {
    /// Parameters of a street, or of a town of streets. Without `blocks`, a street runs along x and is 200 m long
    /// (longer if the animation is longer than 10 s), and a side street crosses it at the origin. With `blocks`, that
    /// many blocks of houses have streets around them, with a crossing every 100 m along x and every 84 m along y, one
    /// of them at the origin. Traffic keeps to the right.
    ///
    /// Objects have the categories of SemanticKITTI: `road`, `lane-marking`, `parking`, `sidewalk`, `terrain`,
    /// `building`, `fence`, `vegetation` (the crowns of trees), `trunk`, `pole`, `traffic-sign` (retro-reflecting
    /// plates), `car`, `truck`, `bicycle`, `person` and, for benches, bins, traffic lights and a flag, `other-object`.
    /// The parts of each are named after their materials. The animation `Street` moves
    ///
    /// * the cars `Car_1` and so on, with their wheels. At a single crossing the second brakes, stops at a red light
    ///   and drives on, the third turns right; in a town they drive straight on and stop at red lights and where
    ///   streets end;
    /// * `Person_1` and so on, who walk along the sidewalks: a mesh with a skeleton of 17 joints each;
    /// * the flag, whose mesh has two morph targets;
    /// * the lamps of the traffic lights, which are shown and hidden (`KHR_node_visibility`, `KHR_animation_pointer`).
    ///
    /// The camera node `Lidar` is on the roof of `Car_1`, 1.9 m above the road, and looks ahead; `Corner` is at the
    /// crossing at the origin, 3 m high, and looks along the street.
    #[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Street {
        /// Blocks of houses along x and y, 1 to 10 each. `None`: a single crossing.
        pub blocks: Option<[u32; 2]> = None,
        /// Moving cars, 1 to 10, or with `blocks` as many as there is room for. `None`: 6, with `blocks` two per
        /// crossing. Other cars are parked.
        pub cars: Option<u32> = None,
        /// People who walk, at most as many as there is room for. `None`: 2, with `blocks` two per crossing.
        pub people: Option<u32> = None,
        /// Length of the animation, 8 to 30 s.
        pub seconds: f64 = 10.0,
    }
}

impl Street {
    /// Generates the scene.
    ///
    /// # Errors
    /// A parameter outside its range; the message names the field.
    pub fn scene(&self, seed: u64) -> Result<GeneratedScene> {
        let plan = StreetPlan::new(self)?;
        let crossings = plan.crossings.len() as u32;
        let usual = |single: u32| if plan.is_town { 2 * crossings } else { single };
        let cars = self.cars.unwrap_or(usual(6));
        within("cars", cars.into(), 1.0, drive::most_cars(&plan).into())?;
        let mut walks = person::walks(&plan, seed);
        let people = self.people.unwrap_or(usual(2));
        within("people", people.into(), 0.0, walks.len() as f64)?;
        walks.truncate(people as usize);

        let mut made = Made::default();
        ground::add(&mut made, &plan);
        let gardens = houses::add(&mut made, &plan, seed);
        furniture::add(&mut made, &plan, &gardens, seed);
        let drives = drive::drives(&plan, cars, seed);
        let parked = cars::add(&mut made, &plan, &drives, seed);
        person::add(&mut made, &plan, &walks);
        let at = DVec3::new(6.8, -6.8, 3.0 + KERB);
        let turned = DQuat::from_euler(EulerRot::ZYX, 2.72, 0.09, 0.0);
        let corner = made.glb.camera("Corner", Placement { at, turned, ..Placement::HERE });
        made.glb.root(corner);
        made.glb.animation("Street");
        let [[west, east], [south, north]] = plan.ends();
        let size = match self.blocks {
            None => format!("street of {} m, crossing at 0,0, {parked} parked cars", east - west),
            Some([x, y]) => format!(
                "town of {x} x {y} blocks, {} x {} m, {crossings} crossings, {parked} parked cars",
                east - west,
                north - south
            ),
        };
        let details = vec![
            size,
            format!("animation Street: {} s, {cars} cars drive, {people} people walk", self.seconds),
            "camera Lidar on the roof of Car_1, camera Corner at the crossing at 0,0".to_owned(),
        ];
        made.glb.finish(details).map_err(|size| Error::invalid("blocks", size, "fewer blocks or a shorter animation"))
    }
}
