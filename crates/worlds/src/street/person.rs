//! Walking people: a body with a skeleton.

use super::plan::{FRONT, HALF_ROAD, KERB, SIDE_FRONT, SIDE_HALF_ROAD, SIDE_STOP, StreetPlan};
use super::skeleton::JOINTS;
use super::walk::{self, Gait};
use crate::glb::Placement;
use crate::model::{Made, Model};
use crate::noise::Dice;
use glam::{DQuat, DVec3};
use ground::rng::Draw;
use std::f64::consts::{FRAC_PI_2, PI};

/// A piece of the body: a line with a radius at each end, its depth from front to back over its width, and the joint
/// that moves it.
struct Limb {
    joint: usize,
    from: [f64; 3],
    to: [f64; 3],
    radii: [f64; 2],
    depth: f64,
}

const fn limb(joint: usize, from: [f64; 3], to: [f64; 3], radii: [f64; 2], depth: f64) -> Limb {
    Limb { joint, from, to, radii, depth }
}

/// Limbs on the middle line and on the left; those on the right are their mirror images.
const LIMBS: [Limb; 17] = [
    limb(0, [0.0, 0.0, 0.95], [0.0, 0.06, 0.93], [0.12, 0.12], 0.95),
    limb(1, [0.0, 0.0, 1.03], [0.0, 0.05, 1.12], [0.115, 0.115], 0.9),
    limb(2, [-0.005, 0.0, 1.2], [-0.01, 0.07, 1.34], [0.115, 0.125], 0.88),
    limb(2, [-0.01, 0.0, 1.43], [-0.01, 0.165, 1.41], [0.06, 0.06], 1.0),
    limb(3, [-0.015, 0.0, 1.44], [0.0, 0.0, 1.55], [0.056, 0.052], 1.0),
    limb(4, [0.01, 0.0, 1.615], [0.005, 0.0, 1.675], [0.082, 0.09], 1.12),
    limb(4, [0.05, 0.0, 1.58], [0.06, 0.0, 1.6], [0.05, 0.05], 1.0),
    limb(4, [0.1, 0.0, 1.625], [0.112, 0.0, 1.61], [0.012, 0.018], 1.0),
    limb(5, [-0.01, 0.185, 1.41], [-0.01, 0.371, 1.188], [0.062, 0.05], 1.0),
    limb(6, [-0.01, 0.371, 1.188], [-0.01, 0.538, 0.989], [0.048, 0.036], 1.0),
    limb(7, [-0.01, 0.545, 0.98], [0.0, 0.62, 0.89], [0.036, 0.028], 1.25),
    limb(7, [0.0, 0.56, 0.965], [0.045, 0.58, 0.92], [0.018, 0.014], 1.0),
    limb(11, [0.0, 0.088, 0.9], [0.005, 0.095, 0.5], [0.093, 0.062], 1.0),
    limb(12, [0.005, 0.095, 0.49], [-0.005, 0.095, 0.1], [0.06, 0.044], 1.0),
    limb(12, [-0.02, 0.095, 0.4], [-0.018, 0.095, 0.32], [0.052, 0.05], 1.0),
    limb(13, [-0.02, 0.095, 0.05], [0.12, 0.1, 0.04], [0.05, 0.042], 1.0),
    limb(13, [0.12, 0.1, 0.04], [0.155, 0.1, 0.035], [0.042, 0.034], 1.0),
];

/// A walk: where it begins, and its heading.
pub(super) struct Walk {
    pub from: DVec3,
    pub heading: f64,
}

/// Walks that do not obstruct each other: between the houses and the trees, towards a crossing or away from it.
pub(super) fn walks(plan: &StreetPlan, seed: u64) -> Vec<Walk> {
    /// Distance of the first walk from the crossing, and from one walk to the next.
    const FIRST: f64 = 13.0;
    const APART: f64 = 2.0;
    /// Distances of the walking lanes from the middle of the street and of the side street.
    const LANES: [f64; 2] = [(HALF_ROAD + FRONT) / 2.0 + 0.6, (HALF_ROAD + FRONT) / 2.0 - 0.1];
    const SIDE_LANE: f64 = (SIDE_HALF_ROAD + SIDE_FRONT) / 2.0 + 0.35;
    let way = walk::SPEED * plan.seconds;
    let mut walks = Vec::new();
    for axis in 0..2 {
        let first = [FIRST, SIDE_STOP + 2.0][axis];
        let lanes: &[f64] = [&LANES[..], &[SIDE_LANE]][axis];
        let [low, high] = plan.ends()[axis];
        let knots: Vec<f64> = [low].into_iter().chain(plan.middles[axis].iter().copied()).chain([high]).collect();
        for &street in &plan.middles[1 - axis] {
            for (piece, pair) in knots.windows(2).enumerate() {
                let is_first = piece == 0;
                let from = pair[0] + if is_first { 1.0 } else { first };
                let to = pair[1] - if piece + 2 == knots.len() { 1.0 } else { first };
                let count = ((to - from + APART) / (way + APART)).max(0.0) as u32;
                for (side, (lane, aside)) in
                    [-1.0, 1.0].into_iter().flat_map(|side| lanes.iter().enumerate().map(move |lane| (side, lane)))
                {
                    for place in 0..count {
                        let along = (way + APART) * f64::from(place);
                        // The walk nearest to the crossing comes first.
                        let start = if is_first { to - way - along } else { from + along };
                        // One lane in each direction: to the east in the south and to the north in the east.
                        let ahead = ((side < 0.0) == (lane == 0)) != (axis == 1);
                        let at = if ahead { start } else { start + way };
                        let across = street + side * aside;
                        let (x, y) = if axis == 0 { (at, across) } else { (across, at) };
                        let heading = f64::from(axis as u32) * FRAC_PI_2 + if ahead { 0.0 } else { PI };
                        walks.push(Walk { from: DVec3::new(x, y, KERB), heading });
                    }
                }
            }
        }
    }
    // In random order, but at a single crossing two that are visible from its corner come first.
    let first = if plan.is_town { 0 } else { 2 };
    if !plan.is_town {
        let second = walks.iter().position(|walk| walk.from.y > 0.0).unwrap_or(1);
        walks.swap(1, second);
    }
    let mut dice = Dice::new(seed, Draw::Person, 0);
    for place in first..walks.len() {
        let other = place + dice.below(walks.len() - place);
        walks.swap(place, other);
    }
    walks
}

pub(super) fn add(made: &mut Made, plan: &StreetPlan, walks: &[Walk]) {
    /// Fractions of a cycle of the gait by which people are ahead of each other.
    const PHASES: [f64; 4] = [0.0, 0.37, 0.62, 0.85];
    let meshes = PersonBody::new().meshes(made);
    let bound = JOINTS.map(|(.., at)| DVec3::from(at));
    let times = walk::times(plan.seconds);
    let keys = made.glb.times(&times);
    let ends = made.glb.times(&[0.0, plan.seconds]);
    let way = walk::SPEED * plan.seconds;
    // People in the same phase share their keyframes.
    let steps: Vec<Steps> =
        PHASES[..walks.len().min(PHASES.len())].iter().map(|&phase| Steps::new(made, &times, keys, phase)).collect();
    for (number, &Walk { from, heading }) in walks.iter().enumerate() {
        let name = format!("Person_{}", number + 1);
        let Steps { first, hips, turns } = &steps[number % steps.len()];
        let turned = DQuat::from_rotation_z(heading);
        let root = made.glb.frame(&name, Placement { at: from, turned, ..Placement::HERE });
        made.glb.root(root);
        let places = made.glb.places(ends, &[from, from + turned * DVec3::X * way]);
        made.glb.animate(root, "translation", places);

        let mut nodes = Vec::new();
        for (joint, (own, parent, _)) in JOINTS.into_iter().enumerate() {
            let at = match parent {
                Some(parent) => bound[joint] - bound[parent],
                None => first.hips,
            };
            let place = Placement { at, turned: first.turns[joint], ..Placement::HERE };
            nodes.push(made.glb.frame(&format!("{name}_{own}"), place));
            made.glb.animate(nodes[joint], "rotation", turns[joint]);
        }
        made.glb.animate(nodes[0], "translation", *hips);
        for parent in 0..JOINTS.len() {
            let children = (0..JOINTS.len()).filter(|&child| JOINTS[child].1 == Some(parent));
            let children: Vec<usize> = children.map(|child| nodes[child]).collect();
            if !children.is_empty() {
                made.glb.adopt(nodes[parent], &children);
            }
        }
        made.glb.adopt(root, &nodes[..1]);
        let mesh = meshes[number % meshes.len()];
        let skin = made.put(&format!("{name}_Body"), "person", mesh, Placement::HERE);
        made.glb.skin(skin, nodes[0], &nodes, &bound);
    }
}

/// Keyframes of the joints: samplers of the position of the hips and of the rotations of the joints.
struct Steps {
    first: Gait,
    hips: usize,
    turns: [usize; JOINTS.len()],
}

impl Steps {
    fn new(made: &mut Made, times: &[f64], keys: usize, phase: f64) -> Self {
        let gaits: Vec<Gait> = times.iter().map(|&time| walk::gait(time, phase)).collect();
        let turns = std::array::from_fn(|joint| {
            let turns: Vec<DQuat> = gaits.iter().map(|gait| gait.turns[joint]).collect();
            made.glb.turns(keys, &turns)
        });
        let hips: Vec<DVec3> = gaits.iter().map(|gait| gait.hips).collect();
        Steps { first: walk::gait(0.0, phase), hips: made.glb.places(keys, &hips), turns }
    }
}

/// The surface of the body.
pub(super) struct PersonBody {
    limbs: Vec<Limb>,
}

impl Limb {
    /// Distance of a point from the surface, negative inside; approximate, as the limb may be flat.
    fn distance(&self, at: DVec3) -> f64 {
        let flat = DVec3::new(1.0 / self.depth, 1.0, 1.0);
        let [from, to] = [self.from, self.to].map(|end| DVec3::from(end) * flat);
        let (at, along) = (at * flat - from, to - from);
        let part = (at.dot(along) / along.length_squared()).clamp(0.0, 1.0);
        (at - along * part).length() - (self.radii[0] + (self.radii[1] - self.radii[0]) * part)
    }
}

impl PersonBody {
    pub fn new() -> Self {
        let mut limbs = Vec::new();
        for Limb { joint, from, to, radii, depth } in LIMBS {
            limbs.push(Limb { joint, from, to, radii, depth });
            if from[1] != 0.0 || to[1] != 0.0 {
                // The right arm and leg come after the left ones.
                let joint = if joint >= 5 { joint + 3 } else { joint };
                let [from, to] = [from, to].map(|[x, y, z]| [x, -y, z]);
                limbs.push(Limb { joint, from, to, radii, depth });
            }
        }
        PersonBody { limbs }
    }

    /// Distance from the skin: that of the nearest limb, less where limbs meet, which rounds the corner. The smooth
    /// minimum is -k ln(sum of e^(-d / k)). The soles are flat.
    fn distance(&self, at: DVec3) -> f64 {
        const ROUNDING: f64 = 0.014;
        let sum: f64 = self.limbs.iter().map(|limb| (-limb.distance(at) / ROUNDING).exp()).sum();
        (-ROUNDING * sum.max(f64::MIN_POSITIVE).ln()).max(-at.z)
    }

    /// The skin as a net over a grid ("surface nets", Gibson 1998): one vertex in each cell that the skin passes
    /// through, at the mean of the points where it cuts the edges, and one face around each edge that it cuts.
    pub fn skin(&self) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        const CELL: f64 = 0.031;
        const LOW: DVec3 = DVec3::new(-0.2, -0.72, -0.06);
        const HIGH: DVec3 = DVec3::new(0.26, 0.72, 1.86);
        let cells = ((HIGH - LOW) / CELL).ceil();
        let [nx, ny, nz] = [cells.x as usize, cells.y as usize, cells.z as usize];
        let place = |x: usize, y: usize, z: usize| LOW + DVec3::new(x as f64, y as f64, z as f64) * CELL;
        let index = |x: usize, y: usize, z: usize| (z * (ny + 1) + y) * (nx + 1) + x;
        let mut values = Vec::with_capacity((nx + 1) * (ny + 1) * (nz + 1));
        for z in 0..=nz {
            for y in 0..=ny {
                values.extend((0..=nx).map(|x| self.distance(place(x, y, z))));
            }
        }
        let mut vertices = Vec::new();
        let mut of_cell = vec![u32::MAX; values.len()];
        for (z, y, x) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x)))) {
            let corner = |bits: usize| (x + (bits & 1), y + (bits >> 1 & 1), z + (bits >> 2));
            let value = |bits: usize| {
                let (x, y, z) = corner(bits);
                values[index(x, y, z)]
            };
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            for (a, b) in (0..8).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))).filter(|(a, b)| a != b) {
                let (from, to) = (value(a), value(b));
                if (from < 0.0) != (to < 0.0) {
                    let [p, q] = [a, b].map(|bits| {
                        let (x, y, z) = corner(bits);
                        place(x, y, z)
                    });
                    sum += p + (q - p) * (from / (from - to));
                    count += 1.0;
                }
            }
            if count > 0.0 {
                of_cell[index(x, y, z)] = vertices.len() as u32;
                vertices.push(sum / count);
            }
        }
        let mut triangles = Vec::new();
        for (z, y, x) in (1..nz).flat_map(|z| (1..ny).flat_map(move |y| (1..nx).map(move |x| (z, y, x)))) {
            for axis in 0..3 {
                let step = [[1, 0, 0], [0, 1, 0], [0, 0, 1]][axis];
                let (here, next) = (values[index(x, y, z)], values[index(x + step[0], y + step[1], z + step[2])]);
                if (here < 0.0) == (next < 0.0) {
                    continue;
                }
                // The four cells around the edge, counter-clockwise seen from its end.
                let [u, v] = [[[0, 1, 0], [0, 0, 1]], [[0, 0, 1], [1, 0, 0]], [[1, 0, 0], [0, 1, 0]]][axis];
                let cell = |back: [usize; 3]| of_cell[index(x - back[0], y - back[1], z - back[2])];
                let both = [u[0] + v[0], u[1] + v[1], u[2] + v[2]];
                let quad = [cell(both), cell(v), cell([0; 3]), cell(u)];
                let [a, b, c, d] = if here < 0.0 { quad } else { [quad[3], quad[2], quad[1], quad[0]] };
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        (vertices, triangles)
    }

    /// Joints that move a point, and their weights: that of the nearest limb, and its neighbours where they are near.
    pub fn weights(&self, at: DVec3) -> ([u8; 4], [f32; 4]) {
        const REACH: f64 = 0.035;
        let mut near = [f64::INFINITY; JOINTS.len()];
        for limb in &self.limbs {
            near[limb.joint] = near[limb.joint].min(limb.distance(at));
        }
        let order = |a: &usize, b: &usize| near[*a].total_cmp(&near[*b]);
        let nearest = (0..JOINTS.len()).min_by(order).unwrap_or(0);
        let parent = |joint: usize| JOINTS[joint].1;
        let mut joints: Vec<usize> = (0..JOINTS.len())
            .filter(|&joint| joint == nearest || parent(joint) == Some(nearest) || parent(nearest) == Some(joint))
            .collect();
        joints.sort_by(order);
        joints.truncate(4);
        let share = |joint: usize| (-((near[joint] - near[nearest]) / REACH).powi(2)).exp();
        let sum: f64 = joints.iter().map(|&joint| share(joint)).sum();
        let (mut numbers, mut weights) = ([0; 4], [0.0; 4]);
        for (slot, &joint) in joints.iter().enumerate() {
            let weight = (share(joint) / sum) as f32;
            // A joint that hardly moves the point is left out, and the nearest gets the remaining weight.
            if slot > 0 && weight > 0.005 {
                (numbers[slot], weights[slot]) = (joint as u8, weight);
            }
        }
        numbers[0] = nearest as u8;
        weights[0] = 1.0 - (weights[1] + weights[2] + weights[3]);
        (numbers, weights)
    }

    /// The meshes: clothed, with jackets of several colours.
    fn meshes(&self, made: &mut Made) -> [usize; 3] {
        let (vertices, triangles) = self.skin();
        let mut model = Model { vertices, parts: Vec::new() };
        for corners in triangles {
            let middle = corners.iter().map(|&corner| model.vertices[corner as usize]).sum::<DVec3>() / 3.0;
            let cloth = self.cloth(middle);
            model.triangle(cloth, corners);
        }
        let weights: (Vec<[u8; 4]>, Vec<[f32; 4]>) = model.vertices.iter().map(|&at| self.weights(at)).unzip();
        let normals: Vec<DVec3> = model.vertices.iter().map(|&at| self.normal(at)).collect();
        let mesh = made.shaded_mesh("Person", &model, &normals);
        made.glb.joints(mesh, &weights.0, &weights.1);
        let jacket = made.material("jacket");
        let mut other = |name: &'static str| {
            let material = made.material(name);
            made.glb.repainted(mesh, &format!("Person_{name}"), jacket, material)
        };
        [mesh, other("red_jacket"), other("grey_jacket")]
    }

    /// Direction in which the distance increases most.
    fn normal(&self, at: DVec3) -> DVec3 {
        const STEP: f64 = 0.004;
        let along = |axis: DVec3| self.distance(at + axis * STEP) - self.distance(at - axis * STEP);
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize_or(DVec3::Z)
    }

    fn cloth(&self, at: DVec3) -> &'static str {
        let distance = |limb: &&Limb| limb.distance(at);
        let nearest = self.limbs.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        match nearest.map_or(0, |limb| limb.joint) {
            4 if at.z > 1.69 || at.x < -0.01 && at.z > 1.57 => "hair",
            3 if at.z < 1.47 => "jacket",
            3 | 4 | 7 | 10 => "skin",
            13 | 16 => "shoe",
            0 | 11 | 12 | 14 | 15 if at.z < 0.93 => "trousers",
            _ => "jacket",
        }
    }
}
