//! Positions of plants and rocks.

use super::sites::{PATCH, ROCKS, Site, Sites, TUFTS, VARIANTS};
use super::species::TREES;
use super::{Land, Landscape};
use crate::noise::{Dice, GradientNoise};
use glam::DVec2;
use ground::rng::Draw;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Slope of the steepest ground on which plants grow.
const STEEPEST: f64 = 0.7;
/// Noise fields of the density of the woods, and of the kinds of trees.
const WOODS: u32 = 37;
const KINDS: u32 = 38;

/// Positions with a minimum distance from each other, found by dart throwing (Cook 1986, ACM Trans. Graph. 5).
struct Spaced {
    spacing: f64,
    squares: HashMap<[i64; 2], Vec<DVec2>>,
}

impl Spaced {
    fn new(spacing: f64) -> Self {
        // Squares of zero size would be too many to number.
        Spaced { spacing: spacing.max(1e-3), squares: HashMap::new() }
    }

    fn of(spacing: f64, sites: &[Site]) -> Self {
        let mut spaced = Spaced::new(spacing);
        sites.iter().for_each(|site| spaced.add(site.at));
        spaced
    }

    fn square(&self, at: DVec2) -> [i64; 2] {
        [at.x, at.y].map(|along| (along / self.spacing).floor() as i64)
    }

    fn add(&mut self, at: DVec2) {
        self.squares.entry(self.square(at)).or_default().push(at);
    }

    fn is_free(&self, at: DVec2) -> bool {
        let [column, row] = self.square(at);
        let around = (0..9).filter_map(|side| self.squares.get(&[column + side % 3 - 1, row + side / 3 - 1]));
        around.flatten().all(|other| other.distance(at) >= self.spacing)
    }
}

/// `count` positions at least `spacing` m apart, each accepted with the probability that `likes` returns; fewer if
/// there is no room.
fn darts(land: &Land, dice: &mut Dice, count: usize, spacing: f64, likes: impl Fn(DVec2) -> f64) -> Vec<DVec2> {
    /// Maximum number of darts per position.
    const TRIES: usize = 40;
    let [x, y] = land.terrain.size;
    let mut spaced = Spaced::new(spacing);
    let mut places = Vec::new();
    for _ in 0..count.saturating_mul(TRIES) {
        if places.len() == count {
            break;
        }
        let at = DVec2::new(dice.between(-0.5, 0.5) * (x - 1.0), dice.between(-0.5, 0.5) * (y - 1.0));
        let chance = dice.unit();
        if spaced.is_free(at) && chance < likes(at) {
            spaced.add(at);
            places.push(at);
        }
    }
    places
}

/// Minimum distance between `count` objects on the land, m: `part` of the mean distance, as more would leave no room.
fn spacing(land: &Land, count: usize, part: f64, most: f64) -> f64 {
    let [x, y] = land.terrain.size;
    (part * (x * y / count.max(1) as f64).sqrt()).min(most)
}

/// Finds positions for all plants and rocks.
pub(super) fn sites(landscape: &Landscape, land: &Land, seed: u64) -> Sites {
    let trees = trees(landscape, land, seed);
    let bushes = bushes(landscape, land, &trees, seed);
    let rocks = rocks(landscape, land, &trees, seed);
    let grass = grass(landscape, land, &trees, seed);
    Sites { trees, bushes, rocks, grass }
}

fn noise(land: &Land, field: u32, wavelength: f64, seed: u64) -> impl Fn(DVec2) -> f64 + use<> {
    let size = land.terrain.size;
    let wavelength = wavelength.min(size[0].min(size[1]));
    let noise = GradientNoise::new(seed, field, size, [wavelength, wavelength / 4.0], 3, 0.5);
    move |at: DVec2| noise.at(at.x + size[0] / 2.0, at.y + size[1] / 2.0)
}

fn trees(landscape: &Landscape, land: &Land, seed: u64) -> Vec<Site> {
    /// Minimum distance of trunks from path and stream, m.
    const CLEAR: f64 = 1.2;
    /// Shares of the kinds of trees: oaks, birches and spruces, which grow in groups, and dead trees, which are
    /// anywhere.
    const SHARES: [f64; TREES.len()] = [0.4, 0.3, 0.27, 0.03];
    let mut dice = Dice::new(seed, Draw::Forest, 0);
    let (woods, kinds) = (noise(land, WOODS, 50.0, seed), noise(land, KINDS, 60.0, seed));
    let count = land.count(landscape.trees_per_ha);
    let likes = |at: DVec2| {
        if land.clearance(at) < CLEAR || land.terrain.slope(at.x, at.y) > STEEPEST {
            return 0.0;
        }
        // Glades and thickets.
        (0.55 + 1.6 * woods(at)).clamp(0.12, 1.0)
    };
    let places = darts(land, &mut dice, count, spacing(land, count, 0.5, 4.0), likes);
    let mut dice = Dice::new(seed, Draw::Forest, 1);
    let site = |at: DVec2| {
        // From 0 to 1, divided into the shares of oaks, birches and spruces one after the other.
        let mut chance = (0.5 + 0.9 * kinds(at) + dice.between(-0.3, 0.3)).clamp(0.0, 1.0 - 1e-9);
        if dice.unit() < SHARES[3] {
            chance = 1.0 - 1e-9;
        } else {
            chance *= 1.0 - SHARES[3];
        }
        let mut kind = 0;
        while kind + 1 < TREES.len() && chance >= SHARES[kind] {
            chance -= SHARES[kind];
            kind += 1;
        }
        let (turn, size) = (dice.between(0.0, TAU), dice.between(0.7, 1.15));
        Site { at, turn, size, kind, variant: dice.below(VARIANTS) }
    };
    places.into_iter().map(site).collect()
}

fn bushes(landscape: &Landscape, land: &Land, trees: &[Site], seed: u64) -> Vec<Site> {
    /// Minimum distances from path and stream, and from trunks, m.
    const CLEAR: f64 = 1.2;
    const FROM_TRUNK: f64 = 1.0;
    let mut dice = Dice::new(seed, Draw::Bush, 0);
    let woods = noise(land, WOODS, 50.0, seed);
    let trunks = Spaced::of(FROM_TRUNK, trees);
    let count = land.count(landscape.bushes_per_ha);
    let likes = |at: DVec2| {
        let free = land.clearance(at) >= CLEAR && land.terrain.slope(at.x, at.y) <= STEEPEST && trunks.is_free(at);
        // Along the edges of the woods.
        if free { (1.0 - 2.5 * (woods(at) + 0.1).abs()).max(0.15) } else { 0.0 }
    };
    let places = darts(land, &mut dice, count, spacing(land, count, 0.4, 1.2), likes);
    let mut dice = Dice::new(seed, Draw::Bush, 1);
    let site = |at: DVec2| {
        let (turn, size) = (dice.between(0.0, TAU), dice.between(0.6, 1.2));
        Site { at, turn, size, kind: 0, variant: dice.below(VARIANTS) }
    };
    places.into_iter().map(site).collect()
}

fn rocks(landscape: &Landscape, land: &Land, trees: &[Site], seed: u64) -> Vec<Site> {
    /// Minimum distance from path, stream and trunks over the size of a rock; and the size of the largest, m.
    const CLEAR: f64 = 0.6;
    const LARGEST: f64 = 2.0;
    let mut dice = Dice::new(seed, Draw::Stone, 0);
    let count = land.count(landscape.rocks_per_ha);
    let trunks = Spaced::of(CLEAR * LARGEST, trees);
    let [x, y] = land.terrain.size;
    let mut sites = Vec::new();
    for _ in 0..20 * count {
        if sites.len() == count {
            break;
        }
        // Many small ones, few large ones.
        let size = 0.2 * f64::powf(LARGEST / 0.2, dice.unit().powi(2));
        let at = DVec2::new(dice.between(-0.5, 0.5) * (x - size), dice.between(-0.5, 0.5) * (y - size));
        let (turn, variant) = (dice.between(0.0, TAU), dice.below(ROCKS));
        if land.clearance(at) >= CLEAR * size + 0.3 && trunks.is_free(at) {
            sites.push(Site { at, turn, size, kind: 0, variant });
        }
    }
    sites
}

/// Centres of patches of grass.
fn grass(landscape: &Landscape, land: &Land, trees: &[Site], seed: u64) -> Vec<Site> {
    let mut dice = Dice::new(seed, Draw::Grass, 0);
    let trunks = Spaced::of(0.5, trees);
    let [x, y] = land.terrain.size;
    // Patches are drawn anywhere, and kept if they are on turf: the density is that on turf.
    let count = (landscape.grass_per_m2 * x * y / TUFTS as f64).round() as usize;
    let mut sites = Vec::new();
    for _ in 0..count {
        let margin = 2.0 * PATCH;
        let at = DVec2::new(dice.between(-0.5, 0.5) * (x - margin), dice.between(-0.5, 0.5) * (y - margin));
        let (turn, size) = (dice.between(0.0, TAU), dice.between(0.8, 1.0));
        let variant = dice.below(VARIANTS);
        if land.clearance(at) >= PATCH && land.is_turf(at) && trunks.is_free(at) {
            sites.push(Site { at, turn, size, kind: 0, variant });
        }
    }
    sites
}
