//! Rows of houses with shops, windows, doors, balconies and roofs, and fences between them.

use super::plan::{Crossing, FRONT, KERB, SIDE_FRONT, StreetPlan};
use crate::glb::Placement;
use crate::model::{Made, Model};
use crate::noise::Dice;
use glam::{DQuat, DVec3};
use ground::rng::Draw;
use std::f64::consts::{FRAC_PI_2, PI};

/// Depth of a house, and height of its ground floor, of the other storeys and of the wall above them.
pub(super) const DEPTH: f64 = 11.0;
const GROUND: f64 = 3.8;
const STOREY: f64 = 3.1;
const TOP: f64 = 0.5;
/// Usual width.
const WIDTH: f64 = 11.0;
/// Distance behind the front of windows, and of the back wall of rooms.
const RECESS: f64 = 0.2;
const ROOM: f64 = 4.0;
/// Inset of side walls, so that those of neighbours do not coincide.
const INSET: f64 = 0.05;
const WALLS: [&str; 6] = ["brick", "plaster_white", "sandstone", "plaster_ochre", "brick_yellow", "plaster_blue"];

/// Adds the houses, and fences in front of the gardens between them; returns the positions of these gardens.
pub(super) fn add(made: &mut Made, plan: &StreetPlan, seed: u64) -> Vec<DVec3> {
    let stock = Stock::new(made, seed);
    let mut built = HouseRows { stock, seed, houses: 0, rows: 0, fences: 0, gardens: Vec::new() };
    for crossing in &plan.crossings {
        for side in [1.0, -1.0] {
            for right in [true, false] {
                let across = DQuat::from_rotation_z(if side > 0.0 { 0.0 } else { PI });
                let along = DQuat::from_rotation_z(-side * FRAC_PI_2);
                // On the right when facing the fronts: east of the crossing on the north side.
                let beside = if right { side } else { -side };
                // In the side street, when facing east or west: to the south or north.
                let behind = if right { -side } else { side };
                for row in [
                    HouseRow {
                        turned: across,
                        front: FRONT,
                        from: SIDE_FRONT,
                        to: crossing.reach(0, beside),
                        right,
                        at_corner: true,
                    },
                    HouseRow {
                        turned: along,
                        front: SIDE_FRONT,
                        from: FRONT + DEPTH,
                        to: crossing.reach(1, behind),
                        right,
                        at_corner: false,
                    },
                ] {
                    built.add(made, crossing, &row);
                }
            }
        }
    }
    built.gardens
}

/// Houses side by side. A house is modelled with its front on y = 0, facing -y, from x = 0 to its width.
struct HouseRow {
    /// Rotation of the houses.
    turned: DQuat,
    /// Distance of the fronts from the middle of their street.
    front: f64,
    /// Distances of the ends from the crossing.
    from: f64,
    to: f64,
    /// On the right of the crossing, when facing the fronts.
    right: bool,
    /// Whether the first house is at the crossing and has a second front.
    at_corner: bool,
}

/// Houses in the file, from which rows are made.
struct Stock {
    plain: Vec<Built>,
    /// With a second front on the left, and on the right.
    corners: [Vec<Built>; 2],
    balcony: usize,
    fence: usize,
}

#[derive(Clone)]
struct Built {
    mesh: usize,
    width: f64,
    wall: &'static str,
    balconies: Vec<DVec3>,
}

impl Stock {
    fn new(made: &mut Made, seed: u64) -> Self {
        /// Number of different houses, and of different corner houses for each side.
        const PLAIN: u32 = 24;
        const CORNERS: u32 = 4;
        let balcony = made.mesh("Balcony", &balcony());
        let fence = made.mesh("Fence", &fence());
        let mut build = |number: u32, corner: Option<bool>| {
            let mut dice = Dice::new(seed, Draw::House, number);
            let width = WIDTH * dice.between(0.8, 1.25);
            let wall = WALLS[dice.below(WALLS.len())];
            let house = House { width, storeys: 2 + dice.below(3), wall, corner };
            let (model, balconies) = house.model(&mut dice);
            Built { mesh: made.mesh(&format!("House_{}", number + 1), &model), width, wall, balconies }
        };
        let plain = (0..PLAIN).map(|number| build(number, None)).collect();
        let corners = [true, false].map(|is_left| {
            let first = PLAIN + if is_left { 0 } else { CORNERS };
            (first..first + CORNERS).map(|number| build(number, Some(is_left))).collect()
        });
        Stock { plain, corners, balcony, fence }
    }
}

/// The rows under construction, and the number of objects in them so far.
struct HouseRows {
    stock: Stock,
    seed: u64,
    rows: u32,
    houses: u32,
    fences: u32,
    gardens: Vec<DVec3>,
}

impl HouseRows {
    fn add(&mut self, made: &mut Made, crossing: &Crossing, row: &HouseRow) {
        /// Random choices for a row, of which the one whose widths fit best is used.
        const CHOICES: usize = 8;
        /// Fraction of the places between houses that are gardens, and the width of a garden.
        const GARDENS: f64 = 0.12;
        const GARDEN: f64 = 9.0;
        let length = row.to - row.from;
        let count = (length / WIDTH).round().max(1.0) as usize;
        // The lower numbers are those of the stock.
        let mut dice = Dice::new(self.seed, Draw::House, 1 << 16 | self.rows);
        self.rows += 1;
        let mut chosen: Vec<Option<Built>> = Vec::new();
        let mut misfit = f64::INFINITY;
        for _ in 0..CHOICES {
            let mut choice: Vec<Option<Built>> = Vec::new();
            for place in 0..count {
                let at_corner = row.at_corner && place == 0;
                let stock = if at_corner { &self.stock.corners[usize::from(!row.right)] } else { &self.stock.plain };
                let neighbour = choice.last().and_then(Option::as_ref).map(|house| house.wall);
                let is_garden = place > 0 && place + 1 < count && neighbour.is_some() && dice.unit() < GARDENS;
                let others: Vec<&Built> = stock.iter().filter(|house| Some(house.wall) != neighbour).collect();
                choice.push((!is_garden).then(|| others[dice.below(others.len())].clone()));
            }
            let width: f64 = choice.iter().map(|house| house.as_ref().map_or(GARDEN, |house| house.width)).sum();
            if (length / width).ln().abs() < misfit {
                misfit = (length / width).ln().abs();
                chosen = choice;
            }
        }
        let width = |house: &Option<Built>| house.as_ref().map_or(GARDEN, |house| house.width);
        let stretch = length / chosen.iter().map(width).sum::<f64>();
        let mut at = row.from;
        for house in &chosen {
            let width = width(house) * stretch;
            let left = if row.right { at } else { -at - width };
            let place =
                |x: f64, y: f64| crossing.place(0.0, 0.0, 0.0) + row.turned * DVec3::new(left + x, row.front + y, 0.0);
            at += width;
            let Some(house) = house else {
                self.gardens.push(place(width / 2.0, 5.0));
                self.fence(made, place(0.0, 0.35), row.turned, width);
                continue;
            };
            self.houses += 1;
            let name = format!("House_{:02}", self.houses);
            let scale = DVec3::new(stretch, 1.0, 1.0);
            let placed = Placement { at: place(0.0, 0.0), turned: row.turned, scale };
            let node = made.put(&name, "building", house.mesh, placed);
            let hang = |&at: &DVec3| {
                let place = Placement { at, ..Placement::HERE };
                made.glb.object(&format!("{name}_Balcony"), "building", self.stock.balcony, place)
            };
            let balconies: Vec<usize> = house.balconies.iter().map(hang).collect();
            if !balconies.is_empty() {
                made.glb.adopt(node, &balconies);
            }
        }
    }

    /// A fence of several panels along x, beginning at `from`.
    fn fence(&mut self, made: &mut Made, from: DVec3, turned: DQuat, length: f64) {
        let panels = (length / PANEL).round().max(1.0);
        let width = length / panels;
        for panel in 0..panels as u32 {
            self.fences += 1;
            let at = from + turned * DVec3::X * (width * f64::from(panel)) + DVec3::Z * KERB;
            let scale = DVec3::new(width / PANEL, 1.0, 1.0);
            made.put(&format!("Fence_{:03}", self.fences), "fence", self.stock.fence, Placement { at, turned, scale });
        }
    }
}

/// Width of a panel of a fence.
const PANEL: f64 = 2.0;

/// A panel along x, 1.1 m high.
fn fence() -> Model {
    let mut fence = Model::default();
    for z in [0.25, 0.85] {
        fence.add_box("fence_wood", [0.0, -0.02, z], [PANEL, 0.02, z + 0.07]);
    }
    for picket in 0..12 {
        let x = PANEL / 12.0 * (f64::from(picket) + 0.5);
        fence.add_box("fence_wood", [x - 0.045, -0.045, 0.0], [x + 0.045, -0.02, 1.1]);
    }
    fence
}

struct House {
    width: f64,
    /// Above the ground floor.
    storeys: usize,
    wall: &'static str,
    /// A second front: the left side (true) or the right one.
    corner: Option<bool>,
}

/// What a house's windows have in common.
#[derive(Clone, Copy)]
struct Windows {
    /// Approximate distance from one to the next.
    pitch: f64,
    width: f64,
    /// Heights of the sill and the lintel above the floor.
    sill: f64,
    lintel: f64,
}

impl House {
    fn height(&self) -> f64 {
        GROUND + STOREY * self.storeys as f64 + TOP
    }

    /// The house, and the positions of its balconies.
    fn model(&self, dice: &mut Dice) -> (Model, Vec<DVec3>) {
        let (mut model, width, height) = (Model::default(), self.width, self.height());
        let model = &mut model;
        let sill = dice.between(0.75, 0.95);
        let lintel = sill + dice.between(1.45, 1.8);
        let windows = Windows { pitch: dice.between(2.4, 3.0), width: dice.between(1.0, 1.3), sill, lintel };
        let shop = self.corner.is_some() || dice.unit() < 0.45;
        let front = HouseWall { from: DVec3::ZERO, along: DVec3::X, out: DVec3::NEG_Y, length: width };
        let balconies = if dice.unit() < 0.4 { 1 + dice.below(2) } else { 0 };
        let balconies = self.front(model, &front, windows, shop, balconies, dice);
        let left = HouseWall { from: DVec3::Y * DEPTH, along: DVec3::NEG_Y, out: DVec3::NEG_X, length: DEPTH };
        let right = HouseWall { from: DVec3::X * width, along: DVec3::Y, out: DVec3::X, length: DEPTH };
        for (wall, is_left) in [(left, true), (right, false)] {
            if self.corner == Some(is_left) {
                self.front(model, &wall, windows, false, 0, dice);
            } else {
                wall.rectangle(model, self.wall, [0.0, 0.0], [DEPTH, height], -INSET);
            }
        }
        let back = HouseWall { from: DVec3::new(width, DEPTH, 0.0), along: DVec3::NEG_X, out: DVec3::Y, length: width };
        back.rectangle(model, self.wall, [0.0, 0.0], [width, height], 0.0);
        let columns = (width / windows.pitch).round().max(2.0);
        for (storey, column) in (0..self.storeys).flat_map(|storey| (0..columns as usize).map(move |c| (storey, c))) {
            let (u, low) = (width / columns * (column as f64 + 0.5), GROUND + STOREY * storey as f64);
            let mut window = |material, edge: f64, out| {
                let half = windows.width / 2.0 - edge;
                back.rectangle(model, material, [u - half, low + sill + edge], [u + half, low + lintel - edge], out);
            };
            window("white_paint", 0.0, 0.02);
            window("window", 0.08, 0.03);
        }
        for storey in 0..=self.storeys {
            let z = if storey == 0 { 0.15 } else { GROUND + STOREY * (storey - 1) as f64 };
            let (x, y) = ([INSET, width - INSET], [RECESS + 0.05, DEPTH - INSET]);
            let corners = [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]];
            model.polygon("wood", &corners.map(|[x, y]| DVec3::new(x, y, z)));
        }
        self.roof(model, dice);
        (std::mem::take(model), balconies)
    }

    /// Adds a wall with windows and perhaps a shop; returns the positions of its balconies.
    fn front(
        &self,
        model: &mut Model,
        wall: &HouseWall,
        windows: Windows,
        shop: bool,
        balconies: usize,
        dice: &mut Dice,
    ) -> Vec<DVec3> {
        let height = self.height();
        let columns = (wall.length / windows.pitch).round().max(2.0);
        let pitch = wall.length / columns;
        let columns = columns as usize;
        let [left, right] =
            [-0.5, 0.5].map(|side| move |column: usize| pitch * (column as f64 + 0.5) + side * windows.width);
        let ground = if shop {
            shop_front(wall.length, dice)
        } else {
            let door = dice.below(columns);
            let of_column = |column: usize| match column == door && wall.out == DVec3::NEG_Y {
                true => {
                    let middle = pitch * (column as f64 + 0.5);
                    WallOpening { from: [middle - 0.55, 0.3], to: [middle + 0.55, 2.6], filling: Filling::Door }
                }
                false => WallOpening {
                    from: [left(column), 0.3 + windows.sill],
                    to: [right(column), 0.3 + windows.lintel],
                    filling: Filling::window(dice),
                },
            };
            (0..columns).map(of_column).collect()
        };
        wall.storey(model, self.wall, [0.0, GROUND], &ground);
        let with_balcony = |column: usize| (1..=balconies).any(|i| column == i * columns / (balconies + 1));
        let mut places = Vec::new();
        for storey in 0..self.storeys {
            let low = GROUND + STOREY * storey as f64;
            let mut openings = Vec::new();
            for column in 0..columns {
                let sill = if with_balcony(column) { 0.15 } else { windows.sill };
                let filling = Filling::window(dice);
                openings.push(WallOpening {
                    from: [left(column), low + sill],
                    to: [right(column), low + windows.lintel],
                    filling,
                });
                if with_balcony(column) {
                    places.push(wall.at(pitch * (column as f64 + 0.5), low, 0.0));
                }
            }
            wall.storey(model, self.wall, [low, low + STOREY], &openings);
        }
        wall.rectangle(model, self.wall, [0.0, height - TOP], [wall.length, height], 0.0);
        wall.rectangle(model, "plaster_white", [INSET, 0.0], [wall.length - INSET, height], -ROOM);
        wall.block(model, "sandstone", [0.0, GROUND - 0.3], [wall.length, GROUND - 0.12], [0.0, 0.07]);
        wall.block(model, "sandstone", [0.0, height - 0.4], [wall.length, height - 0.15], [0.0, 0.2]);
        if shop {
            wall.block(model, "plastic", [0.4, 3.0], [wall.length - 0.4, 3.45], [0.0, 0.12]);
            if dice.unit() < 0.6 {
                let [u0, u1] = [0.5, wall.length - 0.5];
                let edge = [wall.at(u0, 2.5, 1.4), wall.at(u1, 2.5, 1.4)];
                model.polygon("awning", &[edge[0], edge[1], wall.at(u1, 2.98, 0.13), wall.at(u0, 2.98, 0.13)]);
                model.polygon("awning", &[edge[0] - DVec3::Z * 0.2, edge[1] - DVec3::Z * 0.2, edge[1], edge[0]]);
            }
        }
        let pipe = wall.length - 0.25;
        model.tube("steel", &[(wall.at(pipe, 0.1, 0.1), 0.05), (wall.at(pipe, height - 0.4, 0.1), 0.05)], 6);
        places
    }

    fn roof(&self, model: &mut Model, dice: &mut Dice) {
        /// How far the eaves reach out.
        const EAVES: f64 = 0.35;
        let (width, height) = (self.width, self.height());
        let material = if dice.unit() < 0.6 { "roof_tile" } else { "slate" };
        let rise = dice.between(2.6, 4.0);
        let (middle, ridge) = (DEPTH / 2.0, height + rise);
        let low = height - EAVES * rise / middle;
        let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let (front, back) = (-EAVES, DEPTH + EAVES);
        model.polygon(
            material,
            &[at(0.0, front, low), at(width, front, low), at(width, middle, ridge), at(0.0, middle, ridge)],
        );
        model.polygon(
            material,
            &[at(width, back, low), at(0.0, back, low), at(0.0, middle, ridge), at(width, middle, ridge)],
        );
        for (x, [first, second]) in [(INSET, [DEPTH, 0.0]), (width - INSET, [0.0, DEPTH])] {
            model.polygon(self.wall, &[at(x, first, height), at(x, second, height), at(x, middle, ridge)]);
        }
        let x = width * dice.between(0.2, 0.8);
        model.add_box("brick", [x - 0.5, middle - 0.4, ridge - 0.8], [x + 0.5, middle + 0.3, ridge + 1.1]);
        // A dormer.
        let x = width * dice.between(0.25, 0.75);
        let (face, top) = (middle * 0.3, height + rise * 0.3 + 1.3);
        model.add_box(self.wall, [x - 0.8, face, height], [x + 0.8, middle, top]);
        model.add_box(material, [x - 0.95, face - 0.15, top], [x + 0.95, middle, top + 0.12]);
        let dormer = HouseWall { from: at(x - 0.8, face, top - 1.2), along: DVec3::X, out: DVec3::NEG_Y, length: 1.6 };
        dormer.rectangle(model, "white_paint", [0.25, 0.1], [1.35, 1.15], 0.02);
        dormer.rectangle(model, "window", [0.33, 0.18], [1.27, 1.07], 0.03);
    }
}

/// Large windows and a door somewhere between them.
fn shop_front(length: f64, dice: &mut Dice) -> Vec<WallOpening> {
    const DOOR: f64 = 1.2;
    const PILLAR: f64 = 0.45;
    let windows = ((length - 2.0) / 3.2).round().max(1.0);
    let width = (length - DOOR - PILLAR * (windows + 2.0)) / windows;
    let windows = windows as usize;
    let door = dice.below(windows + 1);
    let mut left = PILLAR;
    let mut openings = Vec::new();
    for place in 0..=windows {
        let is_door = place == door;
        let right = left + if is_door { DOOR } else { width };
        let (sill, filling) = if is_door { (0.15, Filling::Door) } else { (0.5, Filling::Shop) };
        openings.push(WallOpening { from: [left, sill], to: [right, 2.9], filling });
        left = right + PILLAR;
    }
    openings
}

/// A wall, from the left end of its foot, seen from outside.
struct HouseWall {
    from: DVec3,
    along: DVec3,
    out: DVec3,
    length: f64,
}

/// What is in an opening.
#[derive(Clone, Copy, PartialEq)]
enum Filling {
    /// With curtains over this fraction of it.
    Window(f64),
    Shop,
    Door,
}

impl Filling {
    fn window(dice: &mut Dice) -> Self {
        Filling::Window([0.0, 0.0, 0.3, 0.45, 1.0][dice.below(5)])
    }
}

/// A hole in a wall: corners along the wall and above its foot.
struct WallOpening {
    from: [f64; 2],
    to: [f64; 2],
    filling: Filling,
}

impl HouseWall {
    fn at(&self, along: f64, up: f64, out: f64) -> DVec3 {
        self.from + self.along * along + DVec3::Z * up + self.out * out
    }

    /// A rectangle parallel to the wall, seen from outside.
    fn rectangle(&self, model: &mut Model, material: &'static str, [u0, v0]: [f64; 2], [u1, v1]: [f64; 2], out: f64) {
        let corners = [[u0, v0], [u1, v0], [u1, v1], [u0, v1]];
        model.polygon(material, &corners.map(|[u, v]| self.at(u, v, out)));
    }

    /// A box on the wall.
    fn block(&self, model: &mut Model, material: &'static str, [u0, v0]: [f64; 2], [u1, v1]: [f64; 2], out: [f64; 2]) {
        let corners = [[u0, v0], [u1, v0], [u1, v1], [u0, v1]];
        let rings = out.map(|out| corners.map(|[u, v]| self.at(u, v, out)).to_vec());
        model.loft(&rings, [None, None], |_, _| material);
        self.rectangle(model, material, [u0, v0], [u1, v1], out[1]);
    }

    /// A strip of the wall between two heights, with openings from left to right.
    fn storey(&self, model: &mut Model, material: &'static str, [low, high]: [f64; 2], openings: &[WallOpening]) {
        let mut left = 0.0;
        for opening in openings {
            let ([u0, v0], [u1, v1]) = (opening.from, opening.to);
            self.rectangle(model, material, [left, low], [u0, high], 0.0);
            self.rectangle(model, material, [u0, low], [u1, v0], 0.0);
            self.rectangle(model, material, [u0, v1], [u1, high], 0.0);
            self.fill(model, material, opening);
            left = u1;
        }
        self.rectangle(model, material, [left, low], [self.length, high], 0.0);
    }

    fn fill(&self, model: &mut Model, material: &'static str, opening: &WallOpening) {
        let ([u0, v0], [u1, v1]) = (opening.from, opening.to);
        let corners = [[u0, v0], [u1, v0], [u1, v1], [u0, v1]];
        for side in 0..4 {
            let ([ua, va], [ub, vb]) = (corners[side], corners[(side + 1) % 4]);
            let reveal = [(ua, va, -RECESS), (ub, vb, -RECESS), (ub, vb, 0.0), (ua, va, 0.0)];
            model.polygon(material, &reveal.map(|(u, v, out)| self.at(u, v, out)));
        }
        if opening.filling == Filling::Door {
            self.rectangle(model, "door", opening.from, opening.to, -RECESS);
            self.block(model, "granite", [u0 - 0.1, 0.0], [u1 + 0.1, v0], [0.0, 0.3]);
            return;
        }
        let (frame, edge) = if opening.filling == Filling::Shop { ("steel", 0.08) } else { ("white_paint", 0.06) };
        let ([ul, ur], [vl, vh]) = ([u0 + edge, u1 - edge], [v0 + edge, v1 - edge]);
        let mut part = |material, from, to| self.rectangle(model, material, from, to, -RECESS);
        part(frame, [u0, v0], [u1, vl]);
        part(frame, [u0, vh], [u1, v1]);
        part(frame, [u0, vl], [ul, vh]);
        part(frame, [ur, vl], [u1, vh]);
        let Filling::Window(curtain) = opening.filling else {
            part("window", [ul, vl], [ur, vh]);
            return;
        };
        let middle = f64::midpoint(u0, u1);
        part(frame, [middle - edge / 2.0, vl], [middle + edge / 2.0, vh]);
        part("window", [ul, vl], [middle - edge / 2.0, vh]);
        part("window", [middle + edge / 2.0, vl], [ur, vh]);
        let covered = curtain * (u1 - u0) / 2.0;
        if covered > 0.0 {
            self.rectangle(model, "curtain", [u0, v0], [u0 + covered, v1], -RECESS - 0.12);
            self.rectangle(model, "curtain", [u1 - covered, v0], [u1, v1], -RECESS - 0.12);
        }
        self.block(model, "granite", [u0 - 0.08, v0 - 0.07], [u1 + 0.08, v0], [0.0, 0.1]);
    }
}

/// A slab with a railing, in front of the wall on y = 0.
fn balcony() -> Model {
    const HALF: f64 = 1.0;
    const OUT: f64 = 1.0;
    let mut model = Model::default();
    model.add_box("concrete", [-HALF, -OUT, -0.05], [HALF, 0.0, 0.12]);
    let mut bar = |x: f64, y: f64| model.add_box("steel", [x - 0.01, y - 0.01, 0.12], [x + 0.01, y + 0.01, 1.08]);
    for i in 0..=16 {
        bar(-HALF + 0.03 + f64::from(i) * (HALF - 0.03) / 8.0, -OUT + 0.03);
    }
    for i in 1..8 {
        let y = -OUT + 0.03 + f64::from(i) * (OUT - 0.03) / 8.0;
        bar(-HALF + 0.03, y);
        bar(HALF - 0.03, y);
    }
    model.add_box("steel", [-HALF, -OUT, 1.08], [HALF, -OUT + 0.06, 1.12]);
    model.add_box("steel", [-HALF, -OUT + 0.06, 1.08], [-HALF + 0.06, 0.0, 1.12]);
    model.add_box("steel", [HALF - 0.06, -OUT + 0.06, 1.08], [HALF, 0.0, 1.12]);
    model
}
