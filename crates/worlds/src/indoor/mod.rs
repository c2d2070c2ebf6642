//! Rooms with furniture, mirrors and panes.

mod furniture;
mod plan;
#[cfg(test)]
mod tests;

use super::GeneratedScene;
use super::glb::Placement;
use super::model::{Made, Model};
use super::noise::Dice;
use furniture::{Furniture, back_to};
use glam::{DQuat, DVec2, DVec3};
use ground::builder;
use ground::error::{Error, Result};
use ground::rng::Draw;
use plan::{DOOR, EYE, FloorPlan, Opening, Room, WALL, Wall, Zone};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

builder! {
    /// Parameters of a floor of rooms side by side, centred on the z axis, the floor at z = 0. All rooms can be reached
    /// through doors, which stand open; outer walls have windows, and one of them a closed door.
    ///
    /// Objects have the categories `wall`, `floor`, `ceiling`, `door`, `window`, `mirror`, `partition` (a pane of glass
    /// that reaches into the room), `table`, `chair`, `sofa`, `bed`, `shelf`, `cupboard`, `lamp`, `plant` and `tv`.
    /// Their parts are named after their materials, as `leg`, `seat` and `back` of a chair. Pieces of furniture keep
    /// apart and clear of doors, and high ones are not in front of windows; a piece for which a room is too small is
    /// left out.
    ///
    /// The camera nodes `Camera_1` and so on are in a corner of each room, 1.5 m high, and look at its middle;
    /// `Scanner` is in the first room, equally high, and looks along x.
    #[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Indoor {
        /// Rooms along x and y, 1 to 10 each.
        pub rooms: [u32; 2] = [2, 2],
        /// Usual extent of a room along x and y, from the middle of one wall to that of the next, 3 to 20 m.
        pub room_m: [f64; 2] = [5.0, 4.5],
        /// Height of the rooms, 2.3 to 6 m.
        pub height_m: f64 = 2.6,
        /// How much furniture there is: 0 (none) to 1.
        pub furniture: f64 = 1.0,
        /// Mirrors on walls, 0 to 100, but at most one in a room.
        pub mirrors: u32 = 2,
        /// Partitions of glass, likewise.
        pub panes: u32 = 1,
        /// Whether rooms have a ceiling.
        pub ceiling: bool = true,
    }
}

impl Indoor {
    /// Generates the scene.
    ///
    /// # Errors
    /// A parameter outside its range; the message names the field.
    pub fn scene(&self, seed: u64) -> Result<GeneratedScene> {
        let mut plan = FloorPlan::new(self, seed)?;
        let mut made = Made::default();
        for (number, wall) in plan.walls.iter().enumerate() {
            add_wall(&mut made, &plan, wall, number + 1, seed);
        }
        add_floors(&mut made, &plan, self.ceiling, seed);
        let [mirrors, panes] = self.add_glass(&mut made, &mut plan, seed);
        let cameras = plan.rooms.len();
        let mut furniture = Furniture::default();
        for (number, room) in plan.rooms.iter_mut().enumerate() {
            add_cameras(&mut made, room, number);
            furniture.furnish(&mut made, room, number as u32, self.furniture, seed);
        }
        let [x, y] = self.rooms;
        let size = plan.rooms.first().map_or(DVec2::ZERO, |room| 2.0 * room.outer[0].abs() + WALL);
        let details = vec![
            format!(
                "{x} x {y} rooms, {:.2} x {:.2} m, {} m high, mirrors: {mirrors}, panes: {panes}",
                size.x, size.y, self.height_m
            ),
            format!("cameras Camera_1 to Camera_{cameras} in corners, camera Scanner in the first room, {EYE} m high"),
        ];
        made.glb.finish(details).map_err(|size| Error::invalid("rooms", size, "fewer rooms"))
    }

    /// Adds mirrors and partitions; returns how many of each there was room for.
    fn add_glass(&self, made: &mut Made, plan: &mut FloorPlan, seed: u64) -> [u32; 2] {
        const ATTEMPTS: usize = 200;
        let mut dice = Dice::new(seed, Draw::Glass, 0);
        let mut order: Vec<usize> = (0..plan.rooms.len()).collect();
        let mut counts = [0; 2];
        for (kind, requested) in [self.mirrors, self.panes].into_iter().enumerate() {
            for place in 0..order.len() {
                let other = place + dice.below(order.len() - place);
                order.swap(place, other);
            }
            for &number in &order {
                if counts[kind] == requested {
                    break;
                }
                let room = &mut plan.rooms[number];
                let placed = (0..ATTEMPTS).find_map(|_| match kind {
                    0 => place_mirror(room, &mut dice),
                    _ => place_partition(room, plan.height, &mut dice),
                });
                let Some((place, zone, length)) = placed else { continue };
                room.zones.push(zone);
                counts[kind] += 1;
                let (name, category, model) = match kind {
                    0 => ("Mirror", "mirror", mirror()),
                    _ => ("Partition", "partition", partition(length, plan.height)),
                };
                let name = format!("{name}_{}", counts[kind]);
                let mesh = made.mesh(&name, &model);
                made.put(&name, category, mesh, place);
            }
        }
        counts
    }
}

/// Size of a mirror with its frame, and its lower edge.
const MIRROR: [f64; 2] = [0.9, 1.3];
const MIRROR_FROM: f64 = 0.55;
/// Width of the frame, and its thickness.
const FRAME: f64 = 0.05;
const MIRROR_THICK: f64 = 0.03;

/// A mirror in a frame, its back on y = 0, facing -y.
fn mirror() -> Model {
    let mut mirror = Model::default();
    let [half, low, high] = [MIRROR[0] / 2.0, MIRROR_FROM, MIRROR_FROM + MIRROR[1]];
    let mut bar = |x: [f64; 2], z: [f64; 2]| {
        mirror.add_box("mirror_frame", [x[0], -MIRROR_THICK, z[0]], [x[1], 0.0, z[1]]);
    };
    bar([-half, half], [low, low + FRAME]);
    bar([-half, half], [high - FRAME, high]);
    bar([-half, -half + FRAME], [low + FRAME, high - FRAME]);
    bar([half - FRAME, half], [low + FRAME, high - FRAME]);
    let (x, z) = (half - FRAME, [low + FRAME, high - FRAME]);
    let y = -MIRROR_THICK / 2.0;
    mirror.polygon("mirror", &[[-x, z[0]], [x, z[0]], [x, z[1]], [-x, z[1]]].map(|[x, z]| DVec3::new(x, y, z)));
    mirror
}

/// A pane from a wall on y = 0 towards -y, with a frame around it.
fn partition(length: f64, height: f64) -> Model {
    /// Half the thickness of the frame, its width, and its distance from the ceiling.
    const HALF: f64 = 0.02;
    const WIDE: f64 = 0.05;
    const BELOW_CEILING: f64 = 0.05;
    let mut partition = Model::default();
    let top = height - BELOW_CEILING;
    let mut bar = |y: [f64; 2], z: [f64; 2]| partition.add_box("metal", [-HALF, y[0], z[0]], [HALF, y[1], z[1]]);
    bar([-length, 0.0], [0.0, WIDE]);
    bar([-length, 0.0], [top - WIDE, top]);
    bar([-WIDE, 0.0], [WIDE, top - WIDE]);
    bar([-length, -length + WIDE], [WIDE, top - WIDE]);
    let (y, z) = ([-WIDE, -length + WIDE], [WIDE, top - WIDE]);
    let corners = [[y[0], z[0]], [y[1], z[0]], [y[1], z[1]], [y[0], z[1]]];
    partition.polygon("glass", &corners.map(|[y, z]| DVec3::new(0.0, y, z)));
    partition
}

/// Half the extent of a room towards a side, and the direction of the side: x, y, -x, -y.
fn side_of(room: &Room, side: usize) -> (f64, DVec2) {
    let out = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y][side];
    (((room.high - room.low) / 2.0).dot(out.abs()), out)
}

/// A position on a wall where nothing hides the mirror.
fn place_mirror(room: &Room, dice: &mut Dice) -> Option<(Placement, Zone, f64)> {
    const FREE: f64 = 0.7;
    let side = dice.below(4);
    let (half, out) = side_of(room, side);
    let (half_along, along) = side_of(room, (side + 1) % 4);
    let way = half_along - MIRROR[0] / 2.0 - 0.1;
    let at = room.middle() + out * half + along * dice.between(-way, way);
    let size = (along * MIRROR[0]).abs() + (out * FREE).abs();
    let zone = Zone { below: 0.0, ..Zone::about(at - out * FREE / 2.0, size, 0.0) };
    let place = Placement { at: at.extend(0.0), turned: back_to(side), ..Placement::HERE };
    // Its upper edge is above the lower edge of windows.
    room.fits(&zone, MIRROR_FROM + MIRROR[1]).then_some((place, zone, 0.0))
}

/// A position for a partition that leaves a way around it, and its length.
fn place_partition(room: &Room, height: f64, dice: &mut Dice) -> Option<(Placement, Zone, f64)> {
    const FREE: f64 = 0.5;
    let side = dice.below(4);
    let (half, out) = side_of(room, side);
    let (half_along, along) = side_of(room, (side + 1) % 4);
    let length = (2.0 * half * dice.between(0.4, 0.6)).min(2.0 * half - 1.0);
    let at = room.middle() + out * half + along * half_along * dice.between(-0.3, 0.3);
    let size = (along * FREE).abs() + (out * length).abs();
    let zone = Zone::about(at - out * length / 2.0, size, 0.0);
    let place = Placement { at: at.extend(0.0), turned: back_to(side), ..Placement::HERE };
    room.fits(&zone, height).then_some((place, zone, length))
}

/// Adds a wall, with the door or window in its opening.
fn add_wall(made: &mut Made, plan: &FloorPlan, wall: &Wall, number: usize, seed: u64) {
    let mut model = Model::default();
    let mut block = |along: [f64; 2], up: [f64; 2]| {
        let [a, b] = [(0, -WALL / 2.0), (1, WALL / 2.0)].map(|(end, aside)| wall.place(along[end], aside, up[end]));
        model.add_box("wall_paint", a.min(b).to_array(), a.max(b).to_array());
    };
    let [from, to] = wall.ends;
    match wall.opening {
        None => block([from, to], [0.0, plan.height]),
        Some(Opening { along: [left, right], up: [low, high], .. }) => {
            block([from, left], [0.0, plan.height]);
            block([right, to], [0.0, plan.height]);
            block([left, right], [high, plan.height]);
            if low > 0.0 {
                block([left, right], [0.0, low]);
            }
        }
    }
    let mesh = made.mesh(&format!("Wall_{number:02}"), &model);
    made.put(&format!("Wall_{number:02}"), "wall", mesh, Placement::HERE);
    let Some(opening) = wall.opening else { return };
    let turned = if wall.axis == 0 { DQuat::IDENTITY } else { DQuat::from_rotation_z(FRAC_PI_2) };
    let place = Placement { at: wall.place(opening.along[0], 0.0, 0.0), turned, ..Placement::HERE };
    let width = opening.along[1] - opening.along[0];
    if opening.is_door() {
        let name = format!("Door_{number:02}");
        let mesh = made.mesh(&name, &door_frame(width));
        let node = made.put(&name, "door", mesh, place);
        let mesh = made.mesh(&format!("{name}_Leaf"), &door_leaf(width));
        let open = match opening.leads_outside {
            true => 0.0,
            false => Dice::new(seed, Draw::Room, number as u32).between(1.2, 1.6),
        };
        // Hinged at the edge of the frame, so that it opens clear of it.
        let hinge = DVec3::new(HINGE, WALL / 2.0, 0.0);
        let hinged = Placement { at: hinge, turned: DQuat::from_rotation_z(open), ..Placement::HERE };
        let leaf = made.glb.object(&format!("{name}_Leaf"), "door", mesh, hinged);
        made.glb.adopt(node, &[leaf]);
    } else {
        let name = format!("Window_{number:02}");
        let mesh = made.mesh(&name, &window(width, opening.up));
        made.put(&name, "window", mesh, place);
    }
}

/// Width of the frame of doors and windows, and the position of the hinges of leaves.
const EDGE: f64 = 0.05;
const HINGE: f64 = EDGE + 0.005;

/// A frame in an opening that begins at x = 0 in the middle of a wall along x.
fn door_frame(width: f64) -> Model {
    let mut frame = Model::default();
    let half = WALL / 2.0 + 0.01;
    frame.add_box("door_frame", [0.0, -half, 0.0], [EDGE, half, DOOR[1]]);
    frame.add_box("door_frame", [width - EDGE, -half, 0.0], [width, half, DOOR[1]]);
    frame.add_box("door_frame", [EDGE, -half, DOOR[1] - EDGE], [width - EDGE, half, DOOR[1]]);
    frame
}

/// A leaf along x from its hinges at the origin.
fn door_leaf(width: f64) -> Model {
    const THICK: f64 = 0.04;
    let mut leaf = Model::default();
    let wide = width - 2.0 * HINGE;
    leaf.add_box("door_leaf", [0.0, -THICK, 0.01], [wide, 0.0, DOOR[1] - EDGE - 0.005]);
    for (near, far) in [(-THICK - 0.05, -THICK), (0.0, 0.05)] {
        leaf.add_box("handle", [wide - 0.08, near, 1.03], [wide - 0.06, far, 1.05]);
    }
    for y in [-THICK - 0.055, 0.04] {
        leaf.add_box("handle", [wide - 0.18, y, 1.03], [wide - 0.08, y + 0.015, 1.05]);
    }
    leaf
}

/// A window of two panes in an opening that begins at x = 0 in the middle of a wall along x.
fn window(width: f64, [low, high]: [f64; 2]) -> Model {
    const HALF: f64 = 0.03;
    let mut window = Model::default();
    let mut bar = |x: [f64; 2], z: [f64; 2]| window.add_box("window_frame", [x[0], -HALF, z[0]], [x[1], HALF, z[1]]);
    let middle = width / 2.0;
    bar([0.0, width], [low, low + EDGE]);
    bar([0.0, width], [high - EDGE, high]);
    let (inner, beside) = ([low + EDGE, high - EDGE], EDGE / 2.0);
    for x in [[0.0, EDGE], [middle - beside, middle + beside], [width - EDGE, width]] {
        bar(x, inner);
    }
    for [left, right] in [[EDGE, middle - beside], [middle + beside, width - EDGE]] {
        let corners = [[left, inner[0]], [right, inner[0]], [right, inner[1]], [left, inner[1]]];
        window.polygon("glass", &corners.map(|[x, z]| DVec3::new(x, 0.0, z)));
    }
    window
}

/// Adds floors, as far as the middle of the walls, and ceilings.
fn add_floors(made: &mut Made, plan: &FloorPlan, ceiling: bool, seed: u64) {
    const FLOORS: [&str; 3] = ["parquet", "carpet", "tiles"];
    let half = DVec2::splat(WALL / 2.0);
    let low = plan.rooms.iter().map(|room| room.outer[0]).fold(DVec2::INFINITY, DVec2::min);
    let high = plan.rooms.iter().map(|room| room.outer[1]).fold(DVec2::NEG_INFINITY, DVec2::max);
    for (number, room) in plan.rooms.iter().enumerate() {
        // To the outer face of outer walls.
        let grown = |at: DVec2| {
            let out = DVec2::select(at.cmpeq(high), half, DVec2::ZERO);
            at + out - DVec2::select(at.cmpeq(low), half, DVec2::ZERO)
        };
        let [a, b] = room.outer.map(grown);
        let corners = [[a.x, a.y], [b.x, a.y], [b.x, b.y], [a.x, b.y]];
        let number = number + 1;
        let cover = FLOORS[Dice::new(seed, Draw::Room, 1 << 16 | number as u32).below(FLOORS.len())];
        let mut put = |name: &str, category, material, z: f64, corners: [[f64; 2]; 4]| {
            let mut model = Model::default();
            model.polygon(material, &corners.map(|[x, y]| DVec3::new(x, y, z)));
            let name = format!("{name}_{number}");
            let mesh = made.mesh(&name, &model);
            made.put(&name, category, mesh, Placement::HERE);
        };
        put("Floor", "floor", cover, 0.0, corners);
        if ceiling {
            let [a, b, c, d] = corners;
            put("Ceiling", "ceiling", "ceiling_paint", plan.height, [d, c, b, a]);
        }
    }
}

/// Adds a camera in a corner, and the scanner in the first room. Objects as high as these are kept away from them.
fn add_cameras(made: &mut Made, room: &mut Room, number: usize) {
    /// Distances from the walls, and from high objects.
    const ASIDE: f64 = 0.4;
    const FREE: f64 = 0.35;
    const BELOW: f64 = EYE - 0.1;
    let half = (room.high - room.low) / 2.0;
    let around = |at: DVec2| Zone::about(at, DVec2::splat(2.0 * FREE), BELOW);
    let find = |room: &Room, places: Vec<DVec2>| {
        let first = places.first().copied().unwrap_or(room.middle());
        places.into_iter().find(|&at| room.fits(&around(at), EYE)).unwrap_or(first)
    };
    let corners = [[-1.0, -1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0]].map(DVec2::from);
    let at = find(room, corners.map(|corner| room.middle() + corner * (half - ASIDE)).to_vec());
    room.zones.push(around(at));
    let ahead = room.middle() - at;
    let turned = DQuat::from_rotation_z(ahead.y.atan2(ahead.x)) * DQuat::from_rotation_y(0.12);
    let place = Placement { at: at.extend(EYE), turned, ..Placement::HERE };
    let camera = made.glb.camera(&format!("Camera_{}", number + 1), place);
    made.glb.root(camera);
    if number == 0 {
        // As near to the middle as there is room.
        let mut places: Vec<DVec2> = (0..81)
            .map(|place| DVec2::new(f64::from(place % 9) - 4.0, f64::from(place / 9) - 4.0) / 5.0)
            .map(|part| room.middle() + part * (half - ASIDE))
            .collect();
        places.sort_by(|a, b| a.distance(room.middle()).total_cmp(&b.distance(room.middle())));
        let at = find(room, places);
        room.zones.push(around(at));
        let camera = made.glb.camera("Scanner", Placement { at: at.extend(EYE), ..Placement::HERE });
        made.glb.root(camera);
    }
}
