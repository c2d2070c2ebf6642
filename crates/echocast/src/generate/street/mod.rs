//! A street with houses, trees, parked cars, traffic and people, which an animation moves.

mod cars;
mod drive;
mod furniture;
mod ground;
mod houses;
mod model;
mod person;
mod plan;
#[cfg(test)]
mod tests;
mod walk;

use super::GeneratedScene;
use super::glb::Placement;
use crate::ground::error::{Error, Result};
use glam::{DQuat, DVec3, EulerRot};
use model::Made;
use plan::{KERB, Plan};
use serde::{Deserialize, Serialize};

/// Parameters of a street. It runs along x and is 200 m long (longer if the animation is longer than 10 s); a side
/// street crosses it at the origin. Traffic keeps to the right.
///
/// Objects have the categories `road`, `pavement`, `building`, `vegetation`, `pole`, `furniture`, `traffic_light`,
/// `flag`, `car` and `person`; the parts of each are named after their materials. The animation `Street` moves
///
/// * the cars `Car_1` and so on, with their wheels: the second brakes, stops at a red light and drives on, the third
///   turns right at the crossing;
/// * `Person_1` and `Person_2`, who walk along the pavements: a mesh with a skeleton of 17 joints each;
/// * the flag, whose mesh changes between two shapes;
/// * the lamps of the traffic lights, which come and go (`KHR_node_visibility`, `KHR_animation_pointer`).
///
/// The camera node `Lidar` is on the roof of `Car_1`, 1.9 m above the road, and looks ahead; `Corner` stands at the
/// crossing, 3 m high, and looks along the street.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Street {
    /// Cars that drive, 1 to 10. Others are parked.
    pub cars: u32,
    /// Length of the animation, 8 to 30 s.
    pub seconds: f64,
}

impl Default for Street {
    fn default() -> Self {
        Street { cars: 6, seconds: 10.0 }
    }
}

impl Street {
    /// Generates the scene.
    ///
    /// # Errors
    /// A parameter outside its range; the message names the field.
    pub fn scene(&self, seed: u64) -> Result<GeneratedScene> {
        let plan = Plan::new(self)?;
        let mut made = Made::default();
        ground::add(&mut made, &plan);
        houses::add(&mut made, &plan, seed);
        furniture::add(&mut made, &plan, seed);
        let drives = drive::drives(&plan, self.cars, seed);
        let parked = cars::add(&mut made, &plan, &drives, seed);
        person::add(&mut made, &plan);
        let at = DVec3::new(6.8, -6.8, 3.0 + KERB);
        let turned = DQuat::from_euler(EulerRot::ZYX, 2.72, 0.09, 0.0);
        let corner = made.glb.camera("Corner", Placement { at, turned, ..Placement::HERE });
        made.glb.root(corner);
        made.glb.animation("Street");
        let details = vec![
            format!("street of {} m, crossing at 0,0, {} parked cars", 2.0 * plan.end, parked),
            format!("animation Street: {} s, {} cars drive, 2 people walk", self.seconds, self.cars),
            "camera Lidar on the roof of Car_1, camera Corner at the crossing".to_owned(),
        ];
        made.glb.finish(details).map_err(|size| Error::invalid("seconds", size, "a shorter animation"))
    }
}
