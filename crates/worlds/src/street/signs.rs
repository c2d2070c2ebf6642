//! Traffic signs: posts with plates of retro-reflecting sheeting.

use super::plan::{Crossing, KERB, POSTS, SIDE_HALF_ROAD, SIDE_STOP, STOP, StreetPlan};
use crate::glb::Placement;
use crate::model::{Made, Model, ring};
use crate::noise::Dice;
use glam::{DQuat, DVec3};
use ground::rng::Draw;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_8, PI};

/// Height of the middle of a plate, half its size, and its thickness.
const HEIGHT: f64 = 2.4;
const HALF: f64 = 0.32;
const THICKNESS: f64 = 0.004;
/// Distance from one layer of sheeting to the next, sufficient for single precision.
const LAYER: f64 = 0.001;

/// A sign: the number of corners of its plate, its rotation, and its layers from the back: size and material.
struct Sign {
    name: &'static str,
    corners: usize,
    turn: f64,
    layers: &'static [(f64, &'static str)],
}

const STOP_SIGN: Sign =
    Sign { name: "Stop", corners: 8, turn: FRAC_PI_8, layers: &[(1.0, "sign_white"), (0.92, "sign_red")] };
const GIVE_WAY: Sign =
    Sign { name: "GiveWay", corners: 3, turn: PI, layers: &[(1.25, "sign_red"), (0.85, "sign_white")] };
const LIMIT: Sign = Sign { name: "Limit", corners: 24, turn: 0.0, layers: &[(1.0, "sign_red"), (0.75, "sign_white")] };
const PRIORITY: Sign =
    Sign { name: "Priority", corners: 4, turn: 0.0, layers: &[(1.1, "sign_white"), (0.8, "sign_yellow")] };
const PARKING: Sign =
    Sign { name: "Parking", corners: 4, turn: FRAC_PI_4, layers: &[(1.2, "sign_white"), (1.1, "sign_blue")] };

impl Sign {
    /// The plate about the origin, its front towards x.
    fn plate(&self) -> Model {
        let mut plate = Model::default();
        let outline = |x: f64, size: f64| {
            let size = size * HALF;
            let turned = DQuat::from_rotation_x(self.turn);
            ring(self.corners, |sin, cos| turned * DVec3::new(x, -sin * size, cos * size))
        };
        let size = self.layers[0].0;
        plate.loft(&[outline(-THICKNESS, size), outline(0.0, size)], [Some("steel"), None], |_, _| "steel");
        for (layer, &(size, material)) in self.layers.iter().enumerate() {
            plate.polygon(material, &outline(LAYER * layer as f64, size));
        }
        plate
    }
}

/// A post on the z axis, which ends behind the plate.
fn post() -> Model {
    let mut post = Model::default();
    post.tube("steel", &[(DVec3::ZERO, 0.03), (DVec3::Z * (HEIGHT + 0.2), 0.03)], 8);
    post
}

pub(super) fn add(made: &mut Made, plan: &StreetPlan, seed: u64) {
    let post = made.rounded_mesh("SignPost", &post());
    let signs = [STOP_SIGN, GIVE_WAY, LIMIT, PRIORITY, PARKING];
    let [stop, give_way, limit, priority, parking] = signs.map(|sign| made.mesh(sign.name, &sign.plate()));
    let mut dice = Dice::new(seed, Draw::Sign, 0);
    let mut number = 0;
    let mut put = |crossing: &Crossing, [x, y]: [f64; 2], yaw: f64, plate: usize| {
        number += 1;
        let name = format!("Sign_{number:02}");
        let place =
            Placement { at: crossing.place(x, y, KERB), turned: DQuat::from_rotation_z(yaw), ..Placement::HERE };
        let node = made.put(&name, "pole", post, place);
        let place = Placement { at: DVec3::new(0.03 + THICKNESS, 0.0, HEIGHT), ..Placement::HERE };
        let plate = made.glb.object(&format!("{name}_Plate"), "traffic-sign", plate, place);
        made.glb.adopt(node, &[plate]);
    };
    for crossing in &plan.crossings {
        for side in [-1.0, 1.0] {
            // On the right of traffic that approaches the crossing from the west and the south, or the east and the
            // north.
            let facing = if side < 0.0 { PI } else { 0.0 };
            put(
                crossing,
                [side * (STOP + 10.5), side * POSTS],
                facing,
                if dice.unit() < 0.6 { priority } else { limit },
            );
            let minor = if dice.unit() < 0.7 { give_way } else { stop };
            put(crossing, [-side * (SIDE_HALF_ROAD + 0.5), side * (SIDE_STOP + 1.5)], facing + FRAC_PI_2, minor);
            // And of traffic that leaves it.
            if crossing.reach(0, -side) > STOP + 25.0 {
                put(crossing, [-side * (STOP + 20.5), side * POSTS], facing, parking);
            }
        }
    }
}
