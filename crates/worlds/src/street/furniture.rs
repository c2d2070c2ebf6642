//! Objects on the sidewalks and in gardens: lamps, trees, traffic lights, benches, bollards, bicycles and a flag.

use super::houses::DEPTH;
use super::plan::{
    CORNER, Crossing, FRONT, HALF_ROAD, KERB, POSTS, SIDE_FRONT, SIDE_HALF_ROAD, SIDE_STOP, STOP, StreetPlan,
};
use super::signs;
use crate::glb::{Placement, Primitive};
use crate::model::{Made, Model, ring, single};
use crate::noise::Dice;
use crate::shapes::{ClosedShape, direction};
use glam::{DQuat, DVec2, DVec3};
use ground::rng::Draw;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Distance from one lamp or tree to the next.
const SPACING: f64 = 10.0;
/// Number of different trees.
const TREES: u32 = 3;
/// Fraction of the lamps with a bicycle beside them.
const BICYCLES: f64 = 0.5;
/// Area per tree behind the houses, m^2.
const ROOM: f64 = 180.0;

/// Adds all of these; `gardens` are positions for trees between houses.
pub(super) fn add(made: &mut Made, plan: &StreetPlan, gardens: &[DVec3], seed: u64) {
    let mut trees = Trees::new(made, seed);
    let mut things = Things::new(made, seed);
    let lights = Lights::new(made, plan);
    for crossing in &plan.crossings {
        for (side, end) in [-1.0, 1.0].into_iter().flat_map(|side| [(side, -1.0), (side, 1.0)]) {
            let facing = if side > 0.0 { DQuat::IDENTITY } else { DQuat::from_rotation_z(PI) };
            let count = ((crossing.reach(0, end) - STOP - 4.0) / SPACING) as u32;
            for step in 0..=count {
                let x = end * (STOP + 5.0 + SPACING * f64::from(step));
                let place =
                    |x: f64| Placement { at: crossing.place(x, side * POSTS, KERB), turned: facing, ..Placement::HERE };
                // Lamps on one side stand opposite trees on the other.
                if (step % 2 == 0) == (side > 0.0) {
                    things.put(made, StreetFurniture::Lamp, place(x));
                    if things.dice.unit() < BICYCLES {
                        things.put(made, StreetFurniture::Bicycle, place(x + 1.2));
                    }
                    continue;
                }
                trees.plant(made, place(x).at);
                if step % 2 == 0 {
                    things.put(made, StreetFurniture::Bench, place(x + 2.4));
                    things.put(made, StreetFurniture::Bin, place(x + 4.0));
                }
            }
            let middle = DVec2::new(SIDE_HALF_ROAD, HALF_ROAD) + CORNER;
            for i in 1..4 {
                let (sin, cos) = (f64::from(i) / 4.0 * FRAC_PI_2).sin_cos();
                let at = middle - DVec2::new(sin, cos) * (CORNER - 0.4);
                let at = crossing.place(end * at.x, side * at.y, KERB);
                things.put(made, StreetFurniture::Bollard, Placement { at, ..Placement::HERE });
            }
            // Behind the houses.
            let from = DVec2::new(SIDE_FRONT, FRONT) + DEPTH + 4.0;
            let room = DVec2::new(crossing.reach(0, end), crossing.reach(1, side)) - 2.0 - from;
            let count = (room.x.max(0.0) * room.y.max(0.0) / ROOM).round() as u32;
            for _ in 0..count {
                let [x, y] = [room.x, room.y].map(|room| trees.dice.between(0.0, room));
                trees.plant(made, crossing.place(end * (from.x + x), side * (from.y + y), KERB));
            }
        }
        lights.put(made, crossing);
    }
    for &garden in gardens {
        trees.plant(made, garden.with_z(KERB));
    }
    signs::add(made, plan, seed);
    flag(made, plan);
}

/// Kinds of objects that are repeated along the streets.
#[derive(Clone, Copy)]
enum StreetFurniture {
    Lamp,
    Bench,
    Bin,
    Bollard,
    Bicycle,
}

/// Their meshes, and the number of each kind so far.
struct Things {
    meshes: [usize; 5],
    counts: [u32; 5],
    dice: Dice,
}

impl Things {
    fn new(made: &mut Made, seed: u64) -> Self {
        let meshes = [
            made.rounded_mesh("Lamp", &lamp()),
            made.mesh("Bench", &bench()),
            made.rounded_mesh("Bin", &bin()),
            made.rounded_mesh("Bollard", &bollard()),
            made.rounded_mesh("Bicycle", &bicycle()),
        ];
        // The random stream after that of the positions of trees.
        Things { meshes, counts: [0; 5], dice: Dice::new(seed, Draw::Tree, TREES + 1) }
    }

    fn put(&mut self, made: &mut Made, thing: StreetFurniture, place: Placement) {
        let (name, category) = match thing {
            StreetFurniture::Lamp => ("Lamp", "pole"),
            StreetFurniture::Bench => ("Bench", "other-object"),
            StreetFurniture::Bin => ("Bin", "other-object"),
            StreetFurniture::Bollard => ("Bollard", "pole"),
            StreetFurniture::Bicycle => ("Bicycle", "bicycle"),
        };
        self.counts[thing as usize] += 1;
        let number = self.counts[thing as usize];
        made.put(&format!("{name}_{number:02}"), category, self.meshes[thing as usize], place);
    }
}

/// Trees: crowns, and the trunks that carry them.
struct Trees {
    meshes: Vec<[usize; 2]>,
    dice: Dice,
    count: u32,
}

impl Trees {
    fn new(made: &mut Made, seed: u64) -> Self {
        let mesh = |number: u32| {
            let parts = tree(&mut Dice::new(seed, Draw::Tree, number));
            let [crown, trunk] = &parts;
            let number = number + 1;
            [made.mesh(&format!("Tree_{number}"), crown), made.mesh(&format!("Trunk_{number}"), trunk)]
        };
        Trees { meshes: (0..TREES).map(mesh).collect(), dice: Dice::new(seed, Draw::Tree, TREES), count: 0 }
    }

    fn plant(&mut self, made: &mut Made, at: DVec3) {
        let turned = DQuat::from_rotation_z(self.dice.between(0.0, TAU));
        let scale = DVec3::splat(self.dice.between(0.85, 1.1));
        let [crown, trunk] = self.meshes[self.dice.below(self.meshes.len())];
        self.count += 1;
        let name = format!("Tree_{:02}", self.count);
        let node = made.put(&name, "vegetation", crown, Placement { at, turned, scale });
        let trunk = made.glb.object(&format!("{name}_Trunk"), "trunk", trunk, Placement::HERE);
        made.glb.adopt(node, &[trunk]);
    }
}

/// A street lamp whose arm extends along -y.
fn lamp() -> Model {
    let mut lamp = Model::default();
    let up = DVec3::Z;
    lamp.tube("steel", &[(DVec3::ZERO, 0.11), (up * 0.9, 0.11), (up, 0.075), (up * 6.2, 0.05)], 10);
    let arm = |y: f64, z: f64| (DVec3::new(0.0, y, z), 0.04);
    lamp.tube("steel", &[arm(0.0, 6.1), arm(-0.15, 6.5), arm(-0.5, 6.75), arm(-1.3, 6.85)], 8);
    lamp.add_box("steel", [-0.14, -2.0, 6.84], [0.14, -1.25, 6.94]);
    lamp.add_box("headlight", [-0.11, -1.95, 6.8], [0.11, -1.35, 6.84]);
    lamp
}

/// The crown of leaves around the ends of branches, and the trunk with these branches.
fn tree(dice: &mut Dice) -> [Model; 2] {
    const BRANCHES: usize = 7;
    const LEAVES: usize = 2000;
    let [mut crown, mut tree] = [Model::default(), Model::default()];
    let lean = DVec3::new(dice.between(-0.15, 0.15), dice.between(-0.15, 0.15), 0.0);
    let trunk = [
        (DVec3::ZERO, 0.19),
        (lean * 0.3 + DVec3::Z * 0.4, 0.14),
        (lean + DVec3::Z * 2.4, 0.12),
        (lean + DVec3::Z * 4.4, 0.07),
    ];
    tree.tube("bark", &trunk, 9);
    // Balls of leaves: centre and radius.
    let mut balls = vec![(lean + DVec3::Z * 5.0, 1.3)];
    for branch in 0..BRANCHES {
        let from = lean + DVec3::Z * dice.between(2.3, 3.6);
        let (sin, cos) = ((branch as f64 + dice.between(-0.3, 0.3)) * TAU / BRANCHES as f64).sin_cos();
        let reach = DVec3::new(cos, sin, 0.0) * dice.between(1.0, 1.5) + DVec3::Z * dice.between(0.7, 1.7);
        tree.tube("bark", &[(from, 0.055), (from + reach * 0.5 + DVec3::Z * 0.1, 0.04), (from + reach, 0.02)], 5);
        balls.push((from + reach, dice.between(0.75, 1.05)));
    }
    for leaf in 0..LEAVES {
        // The first ball is larger than the others, and gets more leaves.
        let (middle, radius) = balls[if leaf % 4 == 0 { 0 } else { leaf % balls.len() }];
        // Most leaves are near the surface, where the light is.
        let at = middle + direction(dice) * radius * dice.between(0.15, 1.0).sqrt();
        let (normal, size) = (direction(dice), dice.between(0.13, 0.24));
        let side = normal.any_orthonormal_vector();
        let corners =
            [0.0, 2.1, 4.2].map(|angle: f64| at + (side * angle.cos() + normal.cross(side) * angle.sin()) * size);
        crown.polygon("vegetation", &corners);
    }
    [crown, tree]
}

/// A bench that faces -y.
fn bench() -> Model {
    let mut bench = Model::default();
    for i in 0..4 {
        let y = -0.22 + f64::from(i) * 0.13;
        bench.add_box("wood", [-0.9, y, 0.42], [0.9, y + 0.1, 0.46]);
    }
    for i in 0..3 {
        let z = 0.55 + f64::from(i) * 0.13;
        bench.add_box("wood", [-0.9, 0.28, z], [0.9, 0.31, z + 0.1]);
    }
    for x in [-0.75, 0.7] {
        bench.add_box("steel", [x, -0.2, 0.0], [x + 0.05, -0.15, 0.42]);
        bench.add_box("steel", [x, 0.31, 0.0], [x + 0.05, 0.36, 0.95]);
        bench.add_box("steel", [x, -0.15, 0.36], [x + 0.05, 0.31, 0.41]);
    }
    bench
}

fn bin() -> Model {
    let mut bin = Model::default();
    let at = |z: f64, radius: f64| (DVec3::Z * z, radius);
    bin.tube("steel", &[at(0.0, 0.05), at(0.3, 0.05)], 8);
    bin.tube("plastic", &[at(0.3, 0.18), at(0.95, 0.22), at(1.0, 0.2)], 14);
    bin
}

fn bollard() -> Model {
    let mut bollard = Model::default();
    let at = |z: f64, radius: f64| (DVec3::Z * z, radius);
    bollard.tube("steel", &[at(0.0, 0.06), at(0.8, 0.06), at(0.85, 0.075), at(0.92, 0.075), at(0.96, 0.04)], 10);
    bollard
}

/// A bicycle along x.
fn bicycle() -> Model {
    const WHEEL: f64 = 0.34;
    const HUBS: [DVec3; 2] = [DVec3::new(-0.52, 0.0, WHEEL), DVec3::new(0.52, 0.0, WHEEL)];
    let mut bicycle = Model::default();
    for hub in HUBS {
        // The outline of a tyre, around the hole.
        let outline = [[-0.016, 0.31], [-0.016, WHEEL], [0.016, WHEEL], [0.016, 0.31], [-0.016, 0.31]];
        let rings = outline.map(|[y, radius]| ring(24, |sin, cos| hub + DVec3::new(radius * sin, y, radius * cos)));
        bicycle.loft(&rings, [None; 2], |_, _| "rubber");
        for spoke in 0..4 {
            let (sin, cos) = (f64::from(spoke) / 4.0 * PI).sin_cos();
            let out = DVec3::new(cos, 0.0, sin) * 0.315;
            bicycle.tube("rim", &[(hub - out, 0.004), (hub + out, 0.004)], 5);
        }
    }
    let at = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let (pedals, saddle, head) = (at(-0.08, 0.29), at(-0.24, 0.82), at(0.36, 0.84));
    for (from, to) in [
        (pedals, saddle),
        (pedals, head),
        (at(-0.21, 0.74), head),
        (HUBS[0], pedals),
        (HUBS[0], saddle),
        (HUBS[1], head),
    ] {
        bicycle.tube("blue_car_paint", &[(from, 0.016), (to, 0.016)], 8);
    }
    let bar = at(0.33, 0.98);
    bicycle.tube("steel", &[(head, 0.014), (bar, 0.014)], 8);
    bicycle.tube("plastic", &[(bar - DVec3::Y * 0.28, 0.014), (bar + DVec3::Y * 0.28, 0.014)], 8);
    bicycle.add_box("plastic", [-0.38, -0.07, 0.83], [-0.13, 0.07, 0.88]);
    for side in [-1.0, 1.0] {
        let y = [0.02, 0.13].map(|y: f64| side * y);
        let (low, high) = (at(-0.08 + side * 0.14, 0.27), at(-0.02 + side * 0.14, 0.31));
        let [near, far] = [y[0].min(y[1]), y[0].max(y[1])];
        bicycle.add_box("plastic", [low.x, near, low.z], [high.x, far, high.z]);
        let arm = DVec3::Y * side * 0.03;
        bicycle.tube("steel", &[(pedals + arm, 0.01), (pedals + arm + DVec3::X * side * 0.16, 0.01)], 6);
    }
    bicycle
}

/// Colours of the lamps of traffic lights from top to bottom, and their heights.
const LAMPS: [(&str, &str, f64); 3] =
    [("red", "lamp_red", 3.2), ("yellow", "lamp_yellow", 2.9), ("green", "lamp_green", 2.6)];
/// Front of their housing.
const FACE: f64 = 0.2;

/// Traffic lights, whose lamps are switched on and off.
struct Lights {
    post: usize,
    lamps: [usize; 3],
    /// Samplers that switch the lamps, and which lamps are lit at first: of the street, of the side street.
    switches: [([usize; 3], [bool; 3]); 2],
}

impl Lights {
    fn new(made: &mut Made, plan: &StreetPlan) -> Self {
        let mut post = Model::default();
        post.tube("steel", &[(DVec3::ZERO, 0.07), (DVec3::Z * 3.45, 0.06)], 10);
        post.add_box("plastic", [0.06, -0.16, 2.42], [FACE, 0.16, 3.38]);
        for (.., z) in LAMPS {
            // The hood above a lamp is half a tube.
            let hood = |i: u32, x: f64| {
                let (sin, cos) = (PI * f64::from(i) / 8.0).sin_cos();
                DVec3::new(x, 0.13 * cos, z + 0.13 * sin)
            };
            for i in 0..8 {
                let (near, far) = (FACE, FACE + 0.17);
                post.polygon("plastic", &[hood(i, near), hood(i, far), hood(i + 1, far), hood(i + 1, near)]);
            }
        }
        let post = made.rounded_mesh("TrafficLight", &post);
        let lamps = LAMPS.map(|(color, material, _)| {
            let mut lamp = Model::default();
            let at = |x: f64, radius: f64| (DVec3::X * x, radius);
            lamp.tube(material, &[at(0.0, 0.105), at(0.02, 0.095), at(0.04, 0.05)], 16);
            made.rounded_mesh(&format!("Lamp_{color}"), &lamp)
        });
        let changes = plan.lights();
        let times: Vec<f64> = changes.iter().map(|(time, _)| *time).collect();
        let times = made.glb.times(&times);
        let switches = [0, 1].map(|street| {
            let switches = std::array::from_fn(|lamp| {
                let on: Vec<bool> = changes.iter().map(|(_, lamps)| lamps[street][lamp]).collect();
                made.glb.switches(times, &on)
            });
            (switches, changes[0].1[street])
        });
        Lights { post, lamps, switches }
    }

    /// Adds one for each of the four approaches to a crossing.
    fn put(&self, made: &mut Made, crossing: &Crossing) {
        let (beside, aside) = (STOP - 0.6, SIDE_STOP - 0.6);
        let edge = SIDE_HALF_ROAD + 0.6;
        for (street, ways) in [
            [("East", -beside, -POSTS, PI), ("West", beside, POSTS, 0.0)],
            [("North", edge, -aside, -FRAC_PI_2), ("South", -edge, aside, FRAC_PI_2)],
        ]
        .into_iter()
        .enumerate()
        {
            let (switches, at_first) = self.switches[street ^ usize::from(crossing.is_odd)];
            for (way, x, y, yaw) in ways {
                let at = crossing.place(x, y, KERB);
                let place = Placement { at, turned: DQuat::from_rotation_z(yaw), ..Placement::HERE };
                let name = crossing.name("TrafficLight", way);
                let node = made.put(&name, "other-object", self.post, place);
                let mut children = Vec::new();
                for (lamp, (color, _, z)) in LAMPS.into_iter().enumerate() {
                    let place = Placement { at: DVec3::new(FACE, 0.0, z), ..Placement::HERE };
                    let child = made.glb.object(&format!("{name}_{color}"), "other-object", self.lamps[lamp], place);
                    made.glb.visible(child, at_first[lamp]);
                    made.glb.animate_visible(child, switches[lamp]);
                    children.push(child);
                }
                made.glb.adopt(node, &children);
            }
        }
    }
}

/// A flag on a mast. Two morph targets, a quarter of a wave apart, make a wave that runs along it: A sin(k x) cos(w
/// t) - A cos(k x) sin(w t) = A sin(k x - w t).
fn flag(made: &mut Made, plan: &StreetPlan) {
    const MAST: f64 = 7.6;
    const SIZE: [f64; 2] = [2.1, 1.3];
    const CELLS: [usize; 2] = [24, 9];
    /// Waves on the flag, their height at its end, and waves per second.
    const WAVES: f64 = 1.4;
    const HEIGHT: f64 = 0.2;
    const RATE: f64 = 1.1;
    const KEYS_PER_WAVE: f64 = 16.0;
    let mut mast = Model::default();
    mast.tube("steel", &[(DVec3::ZERO, 0.06), (DVec3::Z * MAST, 0.035)], 10);
    mast.add_placed(
        "steel",
        &ClosedShape::ball(1),
        &Placement { at: DVec3::Z * MAST, scale: DVec3::splat(0.07), ..Placement::HERE },
    );
    let mast = made.rounded_mesh("Mast", &mast);
    let at = DVec3::new(-SIDE_FRONT - 2.0, FRONT - 0.9, KERB);
    let mast = made.put("Mast", "pole", mast, Placement { at, turned: DQuat::from_rotation_z(3.5), ..Placement::HERE });

    let [columns, rows] = CELLS;
    let (mut flat, mut shapes) = (Vec::new(), [[Vec::new(), Vec::new()], [Vec::new(), Vec::new()]]);
    for row in 0..=rows {
        for column in 0..=columns {
            let part = column as f64 / columns as f64;
            let x = part * SIZE[0];
            flat.push(DVec3::new(0.06 + x, 0.0, MAST - 0.12 - row as f64 / rows as f64 * SIZE[1]));
            let (wave, height) = (WAVES * TAU / SIZE[0], HEIGHT * part);
            let (sin, cos) = (wave * x).sin_cos();
            // Displacement of the cloth from y = 0, and its slope.
            let steepness = HEIGHT / SIZE[0];
            let slopes = [steepness * sin + height * wave * cos, -steepness * cos + height * wave * sin];
            for ([moves, turns], (out, slope)) in
                shapes.iter_mut().zip([(height * sin, slopes[0]), (-height * cos, slopes[1])])
            {
                moves.push(DVec3::Y * out);
                turns.push(DVec3::new(slope, -1.0, 0.0).normalize() - DVec3::NEG_Y);
            }
        }
    }
    let mut parts = [("flag", Vec::new()), ("flag_stripe", Vec::new())];
    for row in 0..rows {
        for column in 0..columns {
            let corner = |down: usize, right: usize| ((row + down) * (columns + 1) + column + right) as u32;
            let stripe = usize::from(row * 3 / rows == 1);
            parts[stripe].1.push([corner(1, 0), corner(1, 1), corner(0, 1)]);
            parts[stripe].1.push([corner(1, 0), corner(0, 1), corner(0, 0)]);
        }
    }
    let parts: Vec<Primitive> =
        parts.iter().map(|(name, triangles)| Primitive { triangles, material: made.material(name) }).collect();
    let normals = vec![[0.0, -1.0, 0.0]; flat.len()];
    let mesh = made.glb.mesh("Flag", &single(&flat), Some(&normals), &parts);
    made.glb.morphs(mesh, &shapes.map(|shape| shape.map(|vectors| single(&vectors))), &[1.0, 0.0]);
    let node = made.glb.object("Flag", "other-object", mesh, Placement::HERE);
    made.glb.adopt(mast, &[node]);

    let waves = (RATE * plan.seconds).round();
    let keys = (waves * KEYS_PER_WAVE) as u32;
    let (times, weights): (Vec<f64>, Vec<[f64; 2]>) = (0..=keys)
        .map(|key| {
            let part = f64::from(key) / f64::from(keys);
            let (sin, cos) = (part * waves * TAU).sin_cos();
            (part * plan.seconds, [cos, sin])
        })
        .unzip();
    let times = made.glb.times(&times);
    let weights = made.glb.weights(times, &weights);
    made.glb.animate(node, "weights", weights);
}
