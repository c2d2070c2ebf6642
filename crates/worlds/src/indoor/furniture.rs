//! Furniture of simple shape, and its placement.
//!
//! A piece is modelled with the centre of its base at the origin and its back towards y.

use super::plan::{Room, Zone};
use crate::glb::Placement;
use crate::model::{Made, Model};
use crate::noise::Dice;
use crate::shapes::direction;
use glam::{DQuat, DVec2, DVec3};
use ground::rng::Draw;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Kinds of pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FurnitureKind {
    Table,
    Desk,
    LowTable,
    Chair,
    Sofa,
    Bed,
    Shelf,
    Cupboard,
    Board,
    Tv,
    Lamp,
    Plant,
}

impl FurnitureKind {
    /// Name of objects, category, and size: width, depth, height.
    fn facts(self) -> (&'static str, &'static str, [f64; 3]) {
        match self {
            FurnitureKind::Table => ("Table", "table", [1.6, 0.9, 0.75]),
            FurnitureKind::Desk => ("Desk", "table", [1.4, 0.7, 0.73]),
            FurnitureKind::LowTable => ("LowTable", "table", [1.0, 0.55, 0.42]),
            FurnitureKind::Chair => ("Chair", "chair", [0.44, 0.48, 0.88]),
            FurnitureKind::Sofa => ("Sofa", "sofa", [1.9, 0.88, 0.8]),
            FurnitureKind::Bed => ("Bed", "bed", [1.5, 2.08, 0.9]),
            FurnitureKind::Shelf => ("Shelf", "shelf", [0.9, 0.3, 1.9]),
            FurnitureKind::Cupboard => ("Cupboard", "cupboard", [1.2, 0.58, 2.0]),
            FurnitureKind::Board => ("Board", "cupboard", [1.5, 0.42, 0.5]),
            FurnitureKind::Tv => ("TV", "tv", [1.2, 0.2, 0.74]),
            FurnitureKind::Lamp => ("Lamp", "lamp", [0.4, 0.4, 1.6]),
            FurnitureKind::Plant => ("Plant", "plant", [0.6, 0.6, 1.1]),
        }
    }

    fn size(self) -> DVec3 {
        DVec3::from(self.facts().2)
    }

    fn model(self, dice: &mut Dice) -> Model {
        let mut model = Model::default();
        let DVec3 { x: wide, y: deep, z: high } = self.size();
        let (x, y) = (wide / 2.0, deep / 2.0);
        // Adds a box in the coordinates of the whole piece.
        let mut bar = |material, low: [f64; 3], high: [f64; 3]| model.add_box(material, low, high);
        match self {
            FurnitureKind::Table | FurnitureKind::Desk | FurnitureKind::LowTable => {
                bar("table_top", [-x, -y, high - 0.04], [x, y, high]);
                for (right, back) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                    let (u, v) = (right * (x - 0.06), back * (y - 0.06));
                    bar("leg", [u - 0.03, v - 0.03, 0.0], [u + 0.03, v + 0.03, high - 0.04]);
                }
            }
            FurnitureKind::Chair => {
                bar("seat", [-x, -y, 0.42], [x, y, 0.46]);
                bar("back", [-x + 0.02, y - 0.04, 0.56], [x - 0.02, y, high]);
                for (right, back) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                    let (u, v) = (right * (x - 0.025), back * (y - 0.025));
                    bar("leg", [u - 0.02, v - 0.02, 0.0], [u + 0.02, v + 0.02, 0.42]);
                }
                for right in [-1.0, 1.0] {
                    let u = right * (x - 0.06);
                    bar("leg", [u - 0.02, y - 0.035, 0.46], [u + 0.02, y - 0.005, 0.56]);
                }
            }
            FurnitureKind::Sofa => {
                bar("seat", [-x + 0.16, -y, 0.12], [0.0, y - 0.22, 0.44]);
                bar("seat", [0.005, -y, 0.12], [x - 0.16, y - 0.22, 0.44]);
                bar("back", [-x + 0.16, y - 0.22, 0.12], [x - 0.16, y, high]);
                bar("arm", [-x, -y, 0.08], [-x + 0.155, y, 0.6]);
                bar("arm", [x - 0.155, -y, 0.08], [x, y, 0.6]);
                for (right, back) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                    let (u, v) = (right * (x - 0.07), back * (y - 0.07));
                    bar("leg", [u - 0.025, v - 0.025, 0.0], [u + 0.025, v + 0.025, 0.08]);
                }
            }
            FurnitureKind::Bed => {
                bar("bed_frame", [-x, -y, 0.12], [x, y - 0.05, 0.3]);
                bar("bed_frame", [-x, y - 0.05, 0.0], [x, y, high]);
                bar("mattress", [-x + 0.03, -y + 0.03, 0.3], [x - 0.03, y - 0.06, 0.48]);
                bar("blanket", [-x + 0.01, -y + 0.01, 0.481], [x - 0.01, y - 0.75, 0.56]);
                bar("pillow", [-x + 0.1, y - 0.5, 0.481], [-0.06, y - 0.12, 0.6]);
                bar("pillow", [0.06, y - 0.5, 0.481], [x - 0.1, y - 0.12, 0.6]);
                for right in [-1.0, 1.0] {
                    let u = right * (x - 0.06);
                    bar("leg", [u - 0.04, -y + 0.02, 0.0], [u + 0.04, -y + 0.1, 0.12]);
                }
            }
            FurnitureKind::Shelf => {
                for side in [-x, x - 0.02] {
                    bar("board", [side, -y, 0.0], [side + 0.02, y, high]);
                }
                bar("board", [-x + 0.02, y - 0.01, 0.0], [x - 0.02, y, high]);
                let storeys = 5;
                for storey in 0..=storeys {
                    let z = 0.05 + (high - 0.07) * f64::from(storey) / f64::from(storeys);
                    bar("board", [-x + 0.02, -y, z], [x - 0.02, y - 0.01, z + 0.02]);
                    let mut u = -x + 0.03;
                    while storey < storeys && u < x - 0.25 {
                        let (thick, tall, out) =
                            (dice.between(0.02, 0.05), dice.between(0.2, 0.3), dice.between(0.02, 0.08));
                        bar("book", [u, -y + out, z + 0.02], [u + thick, y - 0.02, z + 0.02 + tall]);
                        u += thick + if dice.unit() < 0.15 { 0.12 } else { 0.002 };
                    }
                }
            }
            FurnitureKind::Cupboard | FurnitureKind::Board => {
                bar("cupboard_body", [-x, -y + 0.02, 0.0], [x, y, high]);
                for (left, right, handle) in [(-x + 0.005, -0.003, -0.05), (0.003, x - 0.005, 0.05)] {
                    bar("cupboard_door", [left, -y + 0.002, 0.06], [right, -y + 0.02, high - 0.01]);
                    let middle = (0.52 * high).max(0.2);
                    bar(
                        "handle",
                        [handle - 0.008, -y - 0.02, middle - 0.06],
                        [handle + 0.008, -y + 0.002, middle + 0.06],
                    );
                }
            }
            FurnitureKind::Tv => {
                bar("casing", [-x, -0.02, 0.06], [x, 0.03, high]);
                bar("screen", [-x + 0.012, -0.0215, 0.075], [x - 0.012, -0.02, high - 0.012]);
                bar("stand", [-0.3, -y, 0.0], [0.3, y, 0.012]);
                bar("stand", [-0.05, 0.03, 0.012], [0.05, 0.05, 0.3]);
            }
            FurnitureKind::Lamp => {
                let at = |z: f64, radius: f64| (DVec3::Z * z, radius);
                model.tube("stand", &[at(0.0, 0.15), at(0.02, 0.15)], 20);
                model.tube("stand", &[at(0.02, 0.012), at(high - 0.1, 0.012)], 8);
                // An open shade about the vertical axis.
                let ring = |z: f64, radius: f64| -> Vec<DVec3> {
                    (0..20)
                        .map(|side| {
                            let (sin, cos) = (f64::from(side) / 20.0 * TAU).sin_cos();
                            DVec3::new(radius * cos, radius * sin, z)
                        })
                        .collect()
                };
                model.loft(&[ring(high - 0.3, x), ring(high, 0.6 * x)], [None; 2], |_, _| "shade");
            }
            FurnitureKind::Plant => {
                let at = |z: f64, radius: f64| (DVec3::Z * z, radius);
                model.tube("pot", &[at(0.0, 0.13), at(0.28, 0.17)], 16);
                model.tube("leg", &[at(0.28, 0.015), at(0.7, 0.01)], 6);
                for _ in 0..140 {
                    let out = direction(dice) * dice.unit().cbrt();
                    let middle = DVec3::new(0.0, 0.0, 0.75) + out * DVec3::new(0.24, 0.24, 0.28);
                    let (along, normal) = (direction(dice), direction(dice));
                    let side = along.cross(normal).normalize_or(DVec3::X) * 0.025;
                    let tip = along * 0.06;
                    model.polygon("leaves", &[middle - tip, middle + side, middle + tip, middle - side]);
                }
            }
        }
        model
    }
}

/// Pieces that belong together, each with its position and its rotation in quarter turns. The whole is `wide` and
/// `deep` about its centre, its back towards y.
struct FurnitureGroup {
    pieces: &'static [(FurnitureKind, [f64; 3], u32)],
    wide: f64,
    deep: f64,
    /// Depth of free space in front of it.
    free: f64,
    /// Whether it is in the middle of the room, not at a wall.
    in_middle: bool,
}

const fn alone(pieces: &'static [(FurnitureKind, [f64; 3], u32)], wide: f64, deep: f64, free: f64) -> FurnitureGroup {
    FurnitureGroup { pieces, wide, deep, free, in_middle: false }
}

const DINING: FurnitureGroup = FurnitureGroup {
    pieces: &[
        (FurnitureKind::Table, [0.0, 0.0, 0.0], 0),
        (FurnitureKind::Chair, [-0.38, 0.72, 0.0], 0),
        (FurnitureKind::Chair, [0.38, 0.72, 0.0], 0),
        (FurnitureKind::Chair, [-0.38, -0.72, 0.0], 2),
        (FurnitureKind::Chair, [0.38, -0.72, 0.0], 2),
    ],
    wide: 1.6,
    deep: 1.92,
    free: 0.0,
    in_middle: true,
};
const DESK: FurnitureGroup =
    alone(&[(FurnitureKind::Desk, [0.0, 0.27, 0.0], 0), (FurnitureKind::Chair, [0.0, -0.36, 0.0], 2)], 1.4, 1.24, 0.2);
const SOFA: FurnitureGroup = alone(
    &[(FurnitureKind::Sofa, [0.0, 0.49, 0.0], 0), (FurnitureKind::LowTable, [0.0, -0.655, 0.0], 0)],
    1.9,
    1.86,
    0.3,
);
const TV: FurnitureGroup =
    alone(&[(FurnitureKind::Board, [0.0, 0.0, 0.0], 0), (FurnitureKind::Tv, [0.0, 0.0, 0.5], 0)], 1.5, 0.46, 0.8);
const BED: FurnitureGroup = alone(&[(FurnitureKind::Bed, [0.0; 3], 0)], 1.5, 2.08, 0.4);
const CHAIR: FurnitureGroup = alone(&[(FurnitureKind::Chair, [0.0; 3], 0)], 0.44, 0.48, 0.3);
const SHELF: FurnitureGroup = alone(&[(FurnitureKind::Shelf, [0.0; 3], 0)], 0.9, 0.3, 0.5);
const CUPBOARD: FurnitureGroup = alone(&[(FurnitureKind::Cupboard, [0.0; 3], 0)], 1.2, 0.62, 0.6);
const LAMP: FurnitureGroup = alone(&[(FurnitureKind::Lamp, [0.0; 3], 0)], 0.4, 0.4, 0.0);
const PLANT: FurnitureGroup = alone(&[(FurnitureKind::Plant, [0.0; 3], 0)], 0.6, 0.6, 0.0);

/// Furniture of several kinds of rooms, the most important first.
const ROOMS: [&[&FurnitureGroup]; 4] = [
    &[&SOFA, &TV, &SHELF, &PLANT, &LAMP, &CUPBOARD],
    &[&DINING, &CUPBOARD, &PLANT, &SHELF, &LAMP],
    &[&BED, &CUPBOARD, &LAMP, &CHAIR, &PLANT, &SHELF],
    &[&DESK, &SHELF, &PLANT, &SHELF, &LAMP, &SOFA],
];

/// Furniture in the file, and the number of each kind so far.
#[derive(Default)]
pub(super) struct Furniture {
    known: Vec<(FurnitureKind, usize, u32)>,
}

impl Furniture {
    /// Furnishes a room: `amount` of its usual furniture. Pieces for which there is no room are left out.
    pub fn furnish(&mut self, made: &mut Made, room: &mut Room, number: u32, amount: f64, seed: u64) {
        /// Area for which a room's list of furniture is meant, m^2.
        const USUAL: f64 = 20.0;
        const ATTEMPTS: usize = 80;
        let mut dice = Dice::new(seed, Draw::Furniture, number + 1);
        let first = (Dice::new(seed, Draw::Furniture, 0).unit() * ROOMS.len() as f64) as usize;
        let list = ROOMS[(first + number as usize) % ROOMS.len()];
        let area = (room.high - room.low).element_product();
        let count = (amount * list.len() as f64 * (area / USUAL).max(1.0)).round() as usize;
        for group in list.iter().cycle().take(count) {
            let found = (0..ATTEMPTS).find_map(|_| group.place(room, &mut dice));
            let Some((at, quarters, zone)) = found else { continue };
            room.zones.push(zone);
            let turned = quarter_turns(quarters);
            for &(piece, offset, own) in group.pieces {
                let at = at.extend(0.0) + turned * DVec3::from(offset);
                self.put(made, piece, Placement { at, turned: turned * quarter_turns(own), ..Placement::HERE }, seed);
            }
        }
    }

    fn put(&mut self, made: &mut Made, piece: FurnitureKind, place: Placement, seed: u64) {
        let (name, category, _) = piece.facts();
        let place_of = self.known.iter().position(|(known, ..)| *known == piece);
        let index = place_of.unwrap_or_else(|| {
            // Random stream of the shapes, separate from those of the rooms.
            let model = piece.model(&mut Dice::new(seed, Draw::Furniture, 1 << 31 | piece as u32));
            self.known.push((piece, made.mesh(name, &model), 0));
            self.known.len() - 1
        });
        let (_, mesh, count) = &mut self.known[index];
        *count += 1;
        made.put(&format!("{name}_{count}"), category, *mesh, place);
    }
}

fn quarter_turns(quarters: u32) -> DQuat {
    DQuat::from_rotation_z(f64::from(quarters) * FRAC_PI_2)
}

impl FurnitureGroup {
    fn height(&self) -> f64 {
        self.pieces.iter().map(|(piece, at, _)| at[2] + piece.size().z).fold(0.0, f64::max)
    }

    /// A random place in a room, if it is free: the centre, quarter turns, and the zone that it takes up.
    fn place(&self, room: &Room, dice: &mut Dice) -> Option<(DVec2, u32, Zone)> {
        /// Distance from a wall and from other objects.
        const GAP: f64 = 0.03;
        let quarters = dice.below(4) as u32;
        let size = room.high - room.low;
        let turned = |v: DVec2| (quarter_turns(quarters) * v.extend(0.0)).truncate();
        let own = turned(DVec2::new(self.wide, self.deep)).abs() + 2.0 * GAP;
        let margin = own / 2.0 + if self.in_middle { 0.5 } else { 0.0 };
        if margin.cmpge(size / 2.0).any() {
            return None;
        }
        let mut at = DVec2::new(
            dice.between(room.low.x + margin.x, room.high.x - margin.x),
            dice.between(room.low.y + margin.y, room.high.y - margin.y),
        );
        let mut zone = Zone::about(at, own, 0.0);
        if !self.in_middle {
            // Back to the wall.
            let back = turned(DVec2::Y).round();
            let to_wall = (size - own) / 2.0 * back;
            at = room.middle() + to_wall + (at - room.middle()) * (DVec2::ONE - back.abs());
            zone = Zone::about(at, own, 0.0);
            let front = -back * self.free;
            zone =
                Zone { low: zone.low + front.min(DVec2::ZERO), high: zone.high + front.max(DVec2::ZERO), below: 0.0 };
        }
        room.fits(&zone, self.height()).then_some((at, quarters, zone))
    }
}

/// Rotation of an object modelled with its back towards y so that its back is to a side: x, y, -x, -y.
pub(super) fn back_to(side: usize) -> DQuat {
    DQuat::from_rotation_z([-FRAC_PI_2, 0.0, FRAC_PI_2, PI][side])
}
