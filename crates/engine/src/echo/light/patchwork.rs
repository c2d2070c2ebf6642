//! What a beam's footprint falls on, point by point, from few rays.
//!
//! A footprint is sampled at its points, each with a ray of its own. Which of them fall on a triangle can be computed
//! without tracing once the triangle is known, and every ray that is traced makes one known: so rays are traced only
//! until they show nothing new. Points on no known triangle are like the nearest point that was traced although it was
//! on none, either.

use crate::trace::Tables;
use echocast_kernels::cover::{cover, measure, moments};
use emitter::{Fan, ROUND};
use glam::Vec3;
use ground::lanes::MISS;

/// Most points of a footprint.
const POINTS: usize = Fan::MOST;

/// Rays of the first round: where all points fall on one triangle that is known, and elsewhere.
const COVERED: usize = 2;
const FIRST: usize = 8;

/// No patch.
const NONE: u32 = u32::MAX;

/// Cosine of the greatest angle, 8 degrees, between triangles that count as one plane where they are close together.
const PARALLEL: f32 = 0.99;

/// What rays of a beam see of one triangle; of everything that they do not hit.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    /// Row of the surface, or [`MISS`].
    pub surface: u32,
    triangle: u32,
    /// Its plane: unit normal, and distance from the origin along it, m.
    normal: Vec3,
    offset: f32,
    /// Its first ray: batch and lane; `None`: it was not traced.
    pub ray: Option<(u32, u32)>,
    /// Where that ray ends; finally the middle of its points.
    pub place: Vec3,
    /// How many rays hit it, and the sum of what they return if each is one point of the footprint.
    rays: u32,
    light: f32,
    /// Points that fall on it.
    pub points: u32,
    /// Mean, least and greatest of their ranges, m.
    pub range: f32,
    pub ends: [f32; 2],
}

/// What a ray hits.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    pub surface: u32,
    pub triangle: u32,
    /// Whether other rays that meet the triangle would be stopped by it, and light does not continue from there.
    pub is_solid: bool,
}

/// One ray of a beam, traced.
pub(crate) struct TracedRay {
    pub seen: Seen,
    /// Batch and lane.
    pub ray: (u32, u32),
    pub range: f32,
    /// Its time, 0 to 1.
    pub time: f32,
    /// Where it ends, and the normal of the triangle there.
    pub place: Vec3,
    pub facet: Vec3,
    /// What it returns if it is one point of the footprint.
    pub power: f32,
}

/// The footprint of a beam as the patches that it consists of.
pub(crate) struct Patchwork {
    pub patches: Vec<Patch>,
    /// Range of each point, m; infinite where nothing is hit. Only those that were traced, until it is settled.
    range: [f32; POINTS],
    /// Patch of each point, or [`NONE`].
    patch: [u32; POINTS],
    /// Range up to which a triangle could still be in front of what a point is on, m; negative where it was traced.
    end: [f32; POINTS],
    /// Bits of points that were traced, and of those of them that were on no known triangle before.
    traced: u64,
    fair: u64,
    count: usize,
}

/// The light of a footprint over range.
pub(crate) struct Light {
    /// `rho_eff / R^2`, 1/m^2.
    pub power: f32,
    /// Mean range, m.
    pub mean: f32,
    /// Second, third and fourth central moment of ranges, in powers of m.
    pub moments: [f32; 3],
    /// Difference of the greatest and the least range, m.
    pub span: f32,
}

impl Default for Patchwork {
    fn default() -> Self {
        Patchwork {
            patches: Vec::new(),
            range: [0.0; POINTS],
            patch: [NONE; POINTS],
            end: [f32::INFINITY; POINTS],
            traced: 0,
            fair: 0,
            count: 0,
        }
    }
}

impl Patch {
    fn new(Seen { surface, triangle, .. }: Seen, normal: Vec3, offset: f32) -> Patch {
        Patch {
            surface,
            triangle,
            normal,
            offset,
            ray: None,
            place: Vec3::ZERO,
            rays: 0,
            light: 0.0,
            points: 0,
            range: 0.0,
            ends: [f32::INFINITY, 0.0],
        }
    }

    /// What each of its points returns, `rho_eff / R^2` in 1/m^2.
    pub fn power(&self) -> f32 {
        self.light / self.rays as f32
    }

    /// Whether light returns from it.
    fn is_lit(&self) -> bool {
        self.points > 0 && self.light > 0.0
    }

    /// How many points each of its rays stands for.
    pub fn points_per_ray(&self) -> f32 {
        self.points as f32 / self.rays as f32
    }

    fn is(&self, seen: Seen) -> bool {
        self.surface == seen.surface && (self.triangle == seen.triangle || seen.surface == MISS)
    }

    /// Whether a triangle with this `normal` at `place` is on its plane, to within `off` m.
    fn meets(&self, place: Vec3, normal: Vec3, off: f32) -> bool {
        (self.normal.dot(place) - self.offset).abs() <= off && self.normal.dot(normal).abs() >= PARALLEL
    }

    /// Whether what a ray hits is on its plane, to within `off` m.
    fn holds(&self, traced: &TracedRay, off: f32) -> bool {
        self.is(traced.seen) || self.surface == traced.seen.surface && self.meets(traced.place, traced.facet, off)
    }
}

impl Patchwork {
    /// Starts with a footprint of `count` points of which nothing is known.
    pub fn start(&mut self, count: usize) {
        self.patches.clear();
        self.patch = [NONE; POINTS];
        self.end = [f32::INFINITY; POINTS];
        self.range = [0.0; POINTS];
        (self.traced, self.fair, self.count) = (0, 0, count);
    }

    /// Adds a triangle that may be in the footprint.
    pub fn know(&mut self, scene: &Tables, seen: Seen, points: &Fan, time: f32) {
        if seen.is_solid && !self.patches.iter().any(|patch| patch.is(seen)) {
            self.add(scene, seen, points, time);
        }
    }

    /// Adds a patch and finds the points that fall on its triangle; returns its number.
    fn add(&mut self, scene: &Tables, seen: Seen, points: &Fan, time: f32) -> u32 {
        let number = self.patches.len() as u32;
        let corners = scene.corners(seen.surface, seen.triangle, time);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        self.patches.push(Patch::new(seen, normal, normal.dot(a)));
        let [origin, direction] =
            [&points.origin, &points.direction].map(|axes| axes.each_ref().map(|axis| &axis[..self.count]));
        let (end, patch) = (&mut self.end[..self.count], &mut self.patch[..self.count]);
        cover(corners.map(|corner| corner.to_array()), origin, direction, number, end, patch);
        number
    }

    /// Adds the ray of `point`. Returns whether it shows anything new: a surface, or a plane more than `off` m off those
    /// that were known.
    pub fn take(&mut self, scene: &Tables, point: usize, traced: &TracedRay, points: &Fan, off: f32) -> bool {
        let bit = 1 << point;
        let known = self.patches.iter().position(|patch| patch.is(traced.seen));
        let is_new = known.is_none() && !self.patches.iter().any(|patch| patch.holds(traced, off));
        if self.patch[point] == NONE {
            self.fair |= bit;
        }
        self.traced |= bit;
        self.end[point] = -1.0;
        let seen = traced.seen;
        let number = match known {
            Some(known) => known as u32,
            None if seen.is_solid => self.add(scene, seen, points, traced.time),
            None => {
                self.patches.push(Patch::new(seen, traced.facet, traced.facet.dot(traced.place)));
                self.patches.len() as u32 - 1
            }
        };
        self.patch[point] = number;
        self.range[point] = if seen.surface == MISS { f32::INFINITY } else { traced.range };
        let patch = &mut self.patches[number as usize];
        if patch.ray.is_none() {
            (patch.ray, patch.place) = (Some(traced.ray), traced.place);
        }
        patch.rays += 1;
        patch.light += traced.power;
        is_new
    }

    /// How many of its points were traced.
    pub fn traced(&self) -> u32 {
        self.traced.count_ones()
    }

    /// The points to trace next, up to [`ROUND`], in `next`; returns how many.
    pub fn choose(&self, next: &mut [u8; ROUND]) -> usize {
        let (mut chosen, mut found) = (self.traced, 0);
        let most = match self.traced {
            0 if self.is_covered_by_one() => COVERED,
            0 => FIRST,
            _ => ROUND,
        };
        let mut take = |point: usize| {
            if found < most && chosen & 1 << point == 0 {
                chosen |= 1 << point;
                next[found] = point as u8;
                found += 1;
            }
        };
        // What may be there is looked at.
        for (number, _) in (0..).zip(&self.patches).filter(|(_, patch)| patch.ray.is_none()) {
            let on = self.patch[..self.count].iter().enumerate();
            let mut on = on.filter(|&(point, &patch)| patch == number && self.traced & 1 << point == 0);
            on.next().into_iter().for_each(|(point, _)| take(point));
        }
        if self.traced != 0 {
            (0..self.count).filter(|&point| self.patch[point] == NONE).for_each(&mut take);
        }
        (0..self.count).for_each(take);
        found
    }

    /// The patch of a `point` that was traced.
    pub fn patch_of(&self, point: usize) -> u32 {
        self.patch[point]
    }

    /// Whether all points fall on one triangle, though others may be around.
    pub fn is_covered_by_one(&self) -> bool {
        let first = self.patch[0];
        first != NONE && self.patch[..self.count].iter().all(|&patch| patch == first)
    }

    /// Decides what the points are on that are on no known triangle, and measures the patches.  `near`: for each point
    /// all points, the nearest first.
    pub fn settle(&mut self, points: &Fan, near: &[Vec<u8>]) {
        for point in 0..self.count {
            if self.traced & 1 << point == 0 {
                let number = self.patch[point];
                if number == NONE || self.patches[number as usize].ray.is_none() {
                    self.guess(point, points, &near[point]);
                } else {
                    self.range[point] = self.end[point];
                }
            }
        }
        let [origin, direction] = [points.origin.each_ref(), points.direction.each_ref()];
        for (number, patch) in (0..).zip(&mut self.patches) {
            let [count, sum, x, y, z, low, high] = measure(number, &self.patch, &self.range, origin, direction);
            if count > 0.0 {
                patch.points = count as u32;
                patch.range = sum / count;
                patch.place = Vec3::new(x, y, z) / count;
                patch.ends = [low, high];
            }
        }
    }

    /// Decides what `point` is on, from those `near` it.
    fn guess(&mut self, point: usize, points: &Fan, near: &[u8]) {
        let find = |bits: u64| near.iter().copied().find(|&other| bits & 1 << other != 0);
        let Some(other) = find(self.fair).or_else(|| find(self.traced)).map(usize::from) else { return };
        let [origin, direction] =
            [&points.origin, &points.direction].map(|axes| Vec3::from_array(axes.each_ref().map(|axis| axis[point])));
        let patch = &self.patches[self.patch[other] as usize];
        let there = self.range[other];
        // On the same plane, unless it is seen too obliquely to be continued.
        let along = (patch.offset - patch.normal.dot(origin)) / patch.normal.dot(direction);
        self.range[point] = if along > 0.5 * there && along < 2.0 * there { along } else { there };
        self.patch[point] = self.patch[other];
    }

    /// The light of all its points; `None`: no light returns.
    pub fn light(&self) -> Option<Light> {
        let (mut power, mut moment, mut ends) = (0.0, 0.0, [f32::INFINITY, 0.0f32]);
        for patch in self.patches.iter().filter(|patch| patch.is_lit()) {
            let light = patch.power() * patch.points as f32;
            power += light;
            moment += light * patch.range;
            ends = [ends[0].min(patch.ends[0]), ends[1].max(patch.ends[1])];
        }
        if power <= 0.0 {
            return None;
        }
        let mean = moment / power;
        let (mut parts, mut ranges) = ([0.0; POINTS], [mean; POINTS]);
        for (point, &number) in self.patch.iter().enumerate().take(self.count) {
            let patch = &self.patches[number as usize];
            if patch.is_lit() {
                (parts[point], ranges[point]) = (patch.power() / power, self.range[point]);
            }
        }
        Some(Light { power, mean, moments: moments(mean, &ranges, &parts), span: ends[1] - ends[0] })
    }

    /// The ranges of the points on the patch `number`, m.
    pub fn ranges_of(&self, number: u32) -> impl Iterator<Item = f32> {
        let of = self.patch.iter().zip(&self.range).take(self.count);
        of.filter(move |&(&patch, _)| patch == number).map(|(_, &range)| range)
    }

    /// Whether all of it is on one plane of one surface that returns light, to within `off` m.
    pub fn is_one_plane(&self, off: f32) -> bool {
        let mut patches = self.patches.iter().filter(|patch| patch.points > 0);
        let Some(first) = patches.next().filter(|first| first.is_lit()) else { return false };
        patches.all(|patch| {
            patch.power() > 0.0 && patch.surface == first.surface && first.meets(patch.place, patch.normal, off)
        })
    }
}
