//! Trees after Weber & Penn, "Creation and Rendering of Realistic Trees" (SIGGRAPH '95): stems that curve, fork and
//! taper, each with stems of the next order around it, the last with leaves. Features that few kinds need are left out:
//! lobes of the trunk, stems that coil, and pruning.

use super::species::{CrownShape, Species, StemOrder, Varied};
use crate::noise::Dice;
use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// A plant as a mesh. Its foot is at the origin.
#[derive(Default)]
pub(super) struct Plant {
    pub vertices: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    /// Triangles of trunk, branches and leaves.
    pub parts: [Vec<[u32; 3]>; 3],
}

/// Depth of a trunk in the ground over its height, so that there is no gap below it on slopes.
const ROOT: f64 = 0.03;

pub(super) fn grow(species: &Species, dice: &mut Dice) -> Plant {
    let height = varied(species.height, dice);
    let mut growth = Growth { species, dice, height, plant: Plant::default(), fork_debts: [0.0; 3] };
    let mut around = growth.dice.between(0.0, TAU);
    for _ in 0..species.orders[0].count {
        let order = &species.orders[0];
        let lean = varied(order.down, growth.dice).to_radians();
        let turned = DQuat::from_rotation_z(around) * DQuat::from_rotation_x(lean);
        around += varied(order.around, growth.dice).to_radians();
        let length = varied(order.length, growth.dice) * height;
        let stem = Stem { order: 0, length, radius: length * species.ratio };
        growth.stem(&stem, 0, StemFrame { at: DVec3::ZERO, turned }, 1.0);
    }
    growth.plant
}

fn varied([mean, by]: Varied, dice: &mut Dice) -> f64 {
    mean + by.abs() * dice.between(-1.0, 1.0)
}

/// A position and an orientation: z along the stem.
#[derive(Clone, Copy)]
struct StemFrame {
    at: DVec3,
    turned: DQuat,
}

/// A stem that begins to grow.
struct Stem {
    order: usize,
    length: f64,
    /// At its foot.
    radius: f64,
}

struct Growth<'a, 'd> {
    species: &'a Species,
    dice: &'d mut Dice,
    /// Height of the tree.
    height: f64,
    plant: Plant,
    /// Forks that are due, by order: with 0.3 forks per piece, about every third piece forks.
    fork_debts: [f64; 3],
}

impl Growth<'_, '_> {
    /// Grows a stem from the piece `first` on, with its outgrowths: `share` of those of a stem without forks.
    fn stem(&mut self, stem: &Stem, first: usize, mut frame: StemFrame, mut share: f64) {
        let order = self.species.orders[stem.order];
        let piece = stem.length / order.pieces as f64;
        // Positions along it, with radii and the share of what grows there.
        let mut rings = Vec::with_capacity(order.pieces + 2);
        let part = |piece: usize| piece as f64 / order.pieces as f64;
        if stem.order == 0 && first == 0 {
            let below = frame.at - frame.turned * DVec3::Z * (ROOT * stem.length).max(0.1);
            rings.push((StemFrame { at: below, ..frame }, self.radius(stem, 0.0)));
        }
        let start = rings.len();
        rings.push((frame, self.radius(stem, part(first))));
        let mut shares = Vec::new();
        for number in first..order.pieces {
            shares.push(share);
            if stem.order == 0 && number == 0 {
                // The flare of the foot needs rings of its own.
                for along in [0.15, 0.4] {
                    let at = frame.at + frame.turned * DVec3::Z * piece * along;
                    rings.push((StemFrame { at, ..frame }, self.radius(stem, part(0) + along * part(1))));
                }
            }
            frame.at += frame.turned * DVec3::Z * piece;
            rings.push((frame, self.radius(stem, part(number + 1))));
            if number + 1 == order.pieces {
                break;
            }
            frame.turned = self.bent(stem, &order, number, frame.turned);
            self.fork_debts[stem.order] += order.forks;
            // Below the crown a trunk does not fork.
            let above = stem.order > 0 || part(number + 1) >= self.species.bare;
            if above && self.fork_debts[stem.order] + self.dice.between(-0.5, 0.5) >= 0.5 {
                self.fork_debts[stem.order] -= 1.0;
                let (angle, other) =
                    (varied(order.fork_angle, self.dice).to_radians(), varied(order.fork_angle, self.dice));
                let to = DQuat::from_rotation_z(self.dice.between(0.0, TAU));
                let leaning = |angle: f64| to * DQuat::from_rotation_x(angle) * to.inverse();
                share /= 2.0;
                let arm = StemFrame { turned: frame.turned * leaning(-other.to_radians()), ..frame };
                frame.turned *= leaning(angle);
                self.stem(stem, number + 1, arm, share);
            }
        }
        self.tube(stem.order, &rings, order.sides);
        // The rings at the ends of pieces, without those of the foot.
        let joints: Vec<StemFrame> = if start > 0 {
            [rings[start].0].into_iter().chain(rings[start + 3..].iter().map(|ring| ring.0)).collect()
        } else {
            rings.iter().map(|ring| ring.0).collect()
        };
        self.outgrowths(stem, first, &joints, &shares);
    }

    /// Radius at a fraction of the length.
    fn radius(&self, stem: &Stem, part: f64) -> f64 {
        let taper = self.species.orders[stem.order].taper;
        let radius = stem.radius * (1.0 - taper * part).max(0.06);
        if stem.order > 0 {
            return radius;
        }
        let near = (1.0 - 8.0 * part).max(0.0);
        radius * (1.0 + self.species.flare * (100f64.powf(near) - 1.0) / 100.0)
    }

    /// The direction after a piece.
    fn bent(&mut self, stem: &Stem, order: &StemOrder, number: usize, turned: DQuat) -> DQuat {
        let pieces = order.pieces as f64;
        let bend = order.bend[usize::from(2 * number >= order.pieces)] / (pieces / 2.0);
        let waver = order.waver / pieces;
        let side = self.dice.between(-waver, waver);
        let bend = (bend + self.dice.between(-waver, waver)).to_radians();
        let mut turned = turned * DQuat::from_rotation_x(bend) * DQuat::from_rotation_y(side.to_radians());
        if stem.order > 0 {
            // Turns towards the light by the shortest way, the more the more it leans.
            let ahead = turned * DVec3::Z;
            let lean = ahead.z.clamp(-1.0, 1.0).acos();
            if let Some(axis) = ahead.cross(DVec3::Z).try_normalize() {
                let by = (self.species.upwards * lean / pieces).min(lean);
                turned = DQuat::from_axis_angle(axis, by) * turned;
            }
        }
        turned.normalize()
    }

    /// Stems of the next order, or leaves, along the pieces of a stem from the piece `first` on.
    fn outgrowths(&mut self, stem: &Stem, first: usize, joints: &[StemFrame], shares: &[f64]) {
        let species = self.species;
        let pieces = species.orders[stem.order].pieces as f64;
        let bare = if stem.order == 0 { species.bare } else { 0.0 };
        let next = species.orders.get(stem.order + 1);
        let expected = match next {
            // Shorter stems have fewer.
            Some(next) if stem.order == 0 => f64::from(next.count),
            Some(next) => f64::from(next.count) * (0.2 + 0.8 * self.fullness(stem)),
            None => f64::from(species.leaves) * (0.4 + 0.6 * self.fullness(stem)),
        };
        if expected <= 0.0 {
            return;
        }
        let mut around = self.dice.between(0.0, TAU);
        let mut due = self.dice.unit();
        for (number, pair) in joints.windows(2).enumerate() {
            let (low, high) = ((first + number) as f64 / pieces, (first + number + 1) as f64 / pieces);
            let (low, high) = (low.max(bare), high.max(bare));
            let here = expected * shares[number] * (high - low) / (1.0 - bare);
            due += here;
            let count = due.floor();
            due -= count;
            for one in 0..count as usize {
                let part = low + (high - low) * (one as f64 + self.dice.between(0.1, 0.9)) / count;
                let along = part * pieces - (first + number) as f64;
                let at = pair[0].at.lerp(pair[1].at, along.clamp(0.0, 1.0));
                let frame = StemFrame { at, turned: pair[0].turned };
                match next {
                    Some(next) => {
                        around += varied(next.around, self.dice).to_radians();
                        self.branch(stem, next, part, frame, around);
                    }
                    None => {
                        around += varied([140.0, 30.0], self.dice).to_radians();
                        self.leaf(frame, around);
                    }
                }
            }
        }
    }

    /// Length of a stem over the longest of its order.
    fn fullness(&self, stem: &Stem) -> f64 {
        let of_order = self.species.orders[1..=stem.order].iter().map(|order| order.length[0]).product::<f64>();
        (stem.length / (self.height * of_order)).min(1.0)
    }

    fn branch(&mut self, parent: &Stem, order: &StemOrder, part: f64, frame: StemFrame, around: f64) {
        let species = self.species;
        let bare = if parent.order == 0 { species.bare } else { 0.0 };
        let above = ((1.0 - part) / (1.0 - bare)).clamp(0.0, 1.0);
        let most = varied(order.length, self.dice).max(0.01);
        let length = match parent.order {
            0 => parent.length * most * species.outline.ratio(above),
            _ => most * (parent.length - 0.6 * part * parent.length),
        };
        let radius = (parent.radius * (length / parent.length).powf(species.ratio_power))
            .min(self.radius(parent, part))
            .max(0.002);
        let [down, by] = order.down;
        let down = match by < 0.0 {
            true => down + by * (1.0 - 2.0 * CrownShape::Conical.ratio(above)),
            false => varied(order.down, self.dice),
        };
        let turned = frame.turned * DQuat::from_rotation_z(around) * DQuat::from_rotation_x(down.to_radians());
        let stem = Stem { order: parent.order + 1, length, radius };
        self.stem(&stem, 0, StemFrame { turned, ..frame }, 1.0);
    }

    /// A leaf: two triangles, its foot at the stem.
    fn leaf(&mut self, frame: StemFrame, around: f64) {
        let [length, width] = self.species.leaf;
        let length = length * self.dice.between(0.75, 1.25);
        let down = self.dice.between(0.6, 1.3);
        let roll = self.dice.between(-FRAC_PI_2, FRAC_PI_2);
        let turned = frame.turned
            * DQuat::from_rotation_z(around)
            * DQuat::from_rotation_x(down)
            * DQuat::from_rotation_z(0.7 * roll);
        let [ahead, side] = [turned * DVec3::Z * length, turned * DVec3::X * (0.5 * width * length)];
        let normal = turned * DVec3::Y;
        let first = self.plant.vertices.len() as u32;
        let middle = frame.at + ahead * 0.45;
        self.plant.vertices.extend([frame.at, middle + side, frame.at + ahead, middle - side]);
        self.plant.normals.extend([normal; 4]);
        self.plant.parts[2].extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
    }

    /// A skin around a stem, pointed at its end.
    fn tube(&mut self, order: usize, rings: &[(StemFrame, f64)], sides: usize) {
        let plant = &mut self.plant;
        let first = plant.vertices.len() as u32;
        let [body @ .., (tip, _)] = rings else { return };
        // Each ring turns about the axis as little as possible, so that the skin is not twisted.
        let mut across = rings[0].0.turned * DVec3::X;
        for &(StemFrame { at, turned }, radius) in body {
            let ahead = turned * DVec3::Z;
            across = across.reject_from_normalized(ahead).normalize_or(turned * DVec3::X);
            let beside = ahead.cross(across);
            for side in 0..sides {
                let (sin, cos) = (side as f64 / sides as f64 * TAU).sin_cos();
                let normal = across * cos + beside * sin;
                plant.vertices.push(at + normal * radius);
                plant.normals.push(normal);
            }
        }
        plant.vertices.push(tip.at);
        plant.normals.push(tip.turned * DVec3::Z);
        let end = plant.vertices.len() as u32 - 1;
        let part = &mut plant.parts[usize::from(order > 0)];
        let corner = |ring: usize, side: usize| first + (ring * sides + side % sides) as u32;
        for ring in 0..body.len() {
            for side in 0..sides {
                let [a, b] = [corner(ring, side), corner(ring, side + 1)];
                if ring + 1 == body.len() {
                    part.push([a, b, end]);
                    continue;
                }
                let [d, c] = [corner(ring + 1, side), corner(ring + 1, side + 1)];
                part.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
}
