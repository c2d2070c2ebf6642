//! What a beam's footprint falls on, point by point, from few rays.
//!
//! A footprint is sampled at its points, each with a ray of its own. Which of them fall on a triangle can be computed
//! without tracing once the triangle is known, and every ray that is traced makes one known: so rays are traced only
//! until they show nothing new. Points on no known triangle are like the nearest point that was traced although it was
//! on none, either.

use super::Waveform;
use super::signal::BeamSignal;
use super::strongest::{PARALLEL, SurfacePlane};
use crate::trace::Tables;
use echocast_kernels::cover::{add_moments, count_off, cover, measure};
use emitter::{ROUND, SubRayFan};
use glam::Vec3;
use ground::lanes::MISS;

/// The owner of points on no known triangle.
const NO_PATCH: u8 = u8::MAX;

/// Most triangles that are known before rays are sent.
pub(crate) const MOST_EXPECTED: usize = 6;

/// Rays of the first round.
const FIRST: usize = 8;

/// Patches closer together in range than this, in sigmas of the pulse, return one echo.
const WITHIN: f32 = 1.5;

/// The strongest echo is known once its part of the light exceeds half by this over the square root of the number of
/// rays, one and a half standard deviations, and its range, by the spread of its patches, to this many sigmas.
const MAJORITY: f32 = 0.75;
const PLACED: f32 = 0.03;

/// What rays of a beam see of one triangle; of everything that they do not hit.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    /// Row of the surface, or [`MISS`].
    pub surface: u32,
    is_solid: bool,
    /// Its plane: unit normal, and distance from the origin along it, m.
    normal: Vec3,
    offset: f32,
    /// Its first ray: batch and lane; `None`: it was not traced.
    pub ray: Option<(u32, u32)>,
    /// The middle of its points, once it is settled.
    pub place: Vec3,
    /// How many rays hit it, and the sum of what they return if each is one point of the footprint.
    rays: u32,
    light: f32,
    /// Bits of the points that fall on it, once it is settled.
    on: u64,
    /// Mean, least and greatest of their ranges, m; until it is settled, the sum of those of its rays.
    pub range: f32,
    pub ends: [f32; 2],
}

/// What a ray hits.
#[derive(Clone, Copy)]
pub(crate) struct HitTriangle {
    pub surface: u32,
    pub triangle: u32,
    /// Whether every ray that meets the triangle is stopped by it.
    pub is_solid: bool,
}

impl HitTriangle {
    /// A number for its surface and triangle; all that hits nothing has the same.
    fn key(&self) -> u64 {
        let triangle = if self.surface == MISS { 0 } else { self.triangle };
        u64::from(self.surface) << 32 | u64::from(triangle)
    }
}

/// One ray of a beam, traced.
pub(crate) struct TracedRay {
    pub seen: HitTriangle,
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

/// The footprint of a beam as the patches that it consists of. Points are bits of a number.
pub(crate) struct Patchwork {
    pub patches: Vec<Patch>,
    /// Surface and triangle of each patch: looked up for every ray.
    keys: Vec<u64>,
    /// The number of the patch of each point, or [`NO_PATCH`].
    owner: [u8; SubRayFan::MOST],
    /// Range of each point, m: of what it is on, or of the nearest known triangle there; infinite where nothing is hit.
    range: [f32; SubRayFan::MOST],
    all: u64,
    /// Those on no known triangle.
    open: u64,
    /// Those that were traced, and those of them that were on no known triangle before.
    traced: u64,
    fair: u64,
    /// Range beyond which nothing is traced, m.
    farthest: f32,
}

/// The light of a footprint over range.
#[derive(Clone, Copy)]
pub(crate) struct Light {
    /// `rho_eff / R^2`, 1/m^2.
    pub power: f32,
    /// Mean range, m.
    pub mean: f32,
    /// Difference of the greatest and the least range, m.
    pub span: f32,
}

impl Default for Patchwork {
    fn default() -> Self {
        // One for each ray, and for what is known before: no beam needs more.
        let most = SubRayFan::MOST + MOST_EXPECTED;
        Patchwork {
            patches: Vec::with_capacity(most),
            keys: Vec::with_capacity(most),
            owner: [NO_PATCH; SubRayFan::MOST],
            range: [0.0; SubRayFan::MOST],
            all: 0,
            open: 0,
            traced: 0,
            fair: 0,
            farthest: 0.0,
        }
    }
}

/// The points among `bits`, ascending.
fn points(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let point = bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
        (point < u64::BITS).then_some(point as usize)
    })
}

impl Patch {
    fn new(HitTriangle { surface, is_solid, .. }: HitTriangle, normal: Vec3, offset: f32) -> Patch {
        Patch {
            surface,
            is_solid,
            normal,
            offset,
            ray: None,
            place: Vec3::ZERO,
            rays: 0,
            light: 0.0,
            on: 0,
            range: 0.0,
            ends: [f32::INFINITY, 0.0],
        }
    }

    /// What each of its points returns, `rho_eff / R^2` in 1/m^2.
    pub fn power(&self) -> f32 {
        self.light / self.rays as f32
    }

    /// How many points fall on it.
    pub fn points(&self) -> u32 {
        self.on.count_ones()
    }

    /// Whether light returns from it.
    fn is_lit(&self) -> bool {
        self.on != 0 && self.light > 0.0
    }

    /// How many points each of its rays stands for.
    pub fn points_per_ray(&self) -> f32 {
        self.points() as f32 / self.rays as f32
    }

    /// Whether a triangle with this `normal` at `place` is on its plane, to within `off` m.
    fn meets(&self, place: Vec3, normal: Vec3, off: f32) -> bool {
        (self.normal.dot(place) - self.offset).abs() <= off && self.normal.dot(normal).abs() >= PARALLEL
    }

    /// Whether what a ray hits is on its plane, to within `off` m.
    fn holds(&self, traced: &TracedRay, off: f32) -> bool {
        self.surface == traced.seen.surface && self.meets(traced.place, traced.facet, off)
    }
}

impl Patchwork {
    /// Starts with a footprint of `count` points of which nothing is known; nothing beyond the range `farthest`, m, is
    /// traced.
    pub fn start(&mut self, count: usize, farthest: f32) {
        self.patches.clear();
        self.keys.clear();
        self.owner = [NO_PATCH; SubRayFan::MOST];
        (self.range, self.farthest) = ([farthest; SubRayFan::MOST], farthest);
        self.all = u64::MAX >> (u64::BITS as usize - count);
        (self.open, self.traced, self.fair) = (self.all, 0, 0);
    }

    /// Adds a triangle that may be in the footprint.
    pub fn know(&mut self, scene: &Tables, seen: HitTriangle, fan: &SubRayFan, time: f32) {
        let is_known = self.keys.contains(&seen.key());
        if seen.is_solid && !is_known && scene.keeps_triangles(seen.surface) {
            self.add(scene, seen, fan, time);
        }
    }

    /// Adds a patch and finds the points that fall on its triangle; returns its number.
    fn add(&mut self, scene: &Tables, seen: HitTriangle, fan: &SubRayFan, time: f32) -> usize {
        let corners = scene.corners(seen.surface, seen.triangle, time);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let [origin, direction] = [fan.origin.each_ref(), fan.direction.each_ref()];
        let free = self.all & !self.traced;
        let on = cover(corners.map(|corner| corner.to_array()), origin, direction, free, &mut self.range);
        self.open &= !on;
        let number = self.push(seen, normal, normal.dot(a));
        points(on).for_each(|point| self.owner[point] = number as u8);
        number
    }

    /// Adds a patch without points; returns its number.
    fn push(&mut self, seen: HitTriangle, normal: Vec3, offset: f32) -> usize {
        self.keys.push(seen.key());
        self.patches.push(Patch::new(seen, normal, offset));
        self.patches.len() - 1
    }

    /// Adds the ray of `point`. Returns the number of its patch and whether it shows anything new: a surface, or a plane
    /// more than `off` m off those that were known.
    pub fn take(&mut self, scene: &Tables, point: usize, traced: &TracedRay, fan: &SubRayFan, off: f32) -> (u32, bool) {
        let (bit, seen) = (1 << point, traced.seen);
        let known = self.keys.iter().position(|&key| key == seen.key());
        let is_new = known.is_none() && !self.patches.iter().any(|patch| patch.holds(traced, off));
        self.fair |= self.open & bit;
        self.traced |= bit;
        let number = match known {
            Some(known) => known,
            None if seen.is_solid => self.add(scene, seen, fan, traced.time),
            None => self.push(seen, traced.facet, traced.facet.dot(traced.place)),
        };
        self.open &= !bit;
        self.owner[point] = number as u8;
        self.range[point] = if seen.surface == MISS { f32::INFINITY } else { traced.range };
        let patch = &mut self.patches[number];
        patch.ray.get_or_insert(traced.ray);
        patch.rays += 1;
        patch.light += traced.power;
        patch.range += traced.range;
        (number as u32, is_new)
    }

    /// How many of its points were traced.
    pub fn traced(&self) -> u32 {
        self.traced.count_ones()
    }

    /// Whether all rays hit one surface.
    pub fn is_one_surface(&self) -> bool {
        let mut seen = self.patches.iter().filter(|patch| patch.ray.is_some());
        seen.next().is_some_and(|first| seen.all(|patch| patch.surface == first.surface))
    }

    /// The points to trace next, in order, up to [`ROUND`], and `most` with those that were traced before.
    pub fn choose(&self, most: u32) -> impl Iterator<Item = usize> {
        let untraced = self.all & !self.traced;
        let round = if self.traced == 0 { FIRST } else { ROUND };
        let most = round.min((most - self.traced()) as usize);
        // What may be there is looked at.
        let unseen = (0..).zip(&self.patches).filter(|(_, patch)| patch.ray.is_none());
        let first = unseen.filter_map(|(number, _)| self.owner.iter().position(|&owner| owner == number));
        let looks = first.fold(0, |looks, point| looks | 1 << point);
        let open = if self.traced == 0 { 0 } else { self.open & !looks };
        points(looks).chain(points(open)).chain(points(untraced & !looks & !open)).take(most)
    }

    /// Whether the strongest echo of a pulse of `sigma` m is known, and its range; not where light goes on from surfaces.
    pub fn is_decided(&self, sigma: f32) -> bool {
        let is_dark = |patch: &Patch| patch.rays > 0 && patch.light <= 0.0 && patch.surface != MISS;
        if self.patches.iter().any(is_dark) {
            return false;
        }
        let seen = || self.patches.iter().filter(|patch| patch.light > 0.0);
        let range = |patch: &Patch| patch.range / patch.rays as f32;
        let Some(first) = seen().max_by(|a, b| a.light.total_cmp(&b.light)) else { return false };
        let (mut all, mut light, mut moment, mut square, mut rays) = (0.0, 0.0, 0.0, 0.0, 0);
        for patch in seen() {
            let beyond = range(patch) - range(first);
            all += patch.light;
            if beyond.abs() < WITHIN * sigma {
                light += patch.light;
                moment += patch.light * beyond;
                square += patch.light * beyond * beyond;
                rays += patch.rays;
            }
        }
        let mean = moment / light;
        let variance = square / light - mean * mean;
        let placed = PLACED * sigma;
        light > all * (0.5 + MAJORITY / (self.traced() as f32).sqrt()) && variance < rays as f32 * placed * placed
    }

    /// Decides what the points are on that are on no known triangle, and measures the patches. `near`: for each point
    /// all points, the nearest first.
    pub fn settle(&mut self, fan: &SubRayFan, near: &[Vec<u8>]) {
        for point in points(self.all & !self.open) {
            let patch = &mut self.patches[usize::from(self.owner[point])];
            match patch.ray {
                Some(_) => patch.on |= 1 << point,
                None => self.open |= 1 << point,
            }
        }
        // What has holes may be in front of any triangle: all points are like those that were traced.
        if self.patches.iter().any(|patch| patch.ray.is_some() && !patch.is_solid && patch.surface != MISS) {
            (self.open, self.fair) = (self.all & !self.traced, self.traced);
            self.patches.iter_mut().for_each(|patch| patch.on &= self.traced);
        }
        points(self.open).for_each(|point| self.guess(point, fan, &near[point]));
        let [origin, direction] = [fan.origin.each_ref(), fan.direction.each_ref()];
        for patch in self.patches.iter_mut().filter(|patch| patch.on != 0) {
            let [sum, x, y, z, low, high] = measure(patch.on, &self.range, origin, direction);
            let count = patch.points() as f32;
            patch.range = sum / count;
            patch.place = Vec3::new(x, y, z) / count;
            patch.ends = [low, high];
        }
    }

    /// Decides what `point` is on, from those `near` it.
    fn guess(&mut self, point: usize, fan: &SubRayFan, near: &[u8]) {
        let find = |bits: u64| near.iter().copied().find(|&other| bits & 1 << other != 0);
        self.range[point] = f32::INFINITY;
        let Some(other) = find(self.fair).or_else(|| find(self.traced)).map(usize::from) else { return };
        let Some(patch) = self.patches.get_mut(usize::from(self.owner[other])) else { return };
        let [origin, direction] =
            [&fan.origin, &fan.direction].map(|axes| Vec3::from_array(axes.each_ref().map(|axis| axis[point])));
        let there = self.range[other];
        // On the same plane, unless it is seen too obliquely to be continued.
        let along = (patch.offset - patch.normal.dot(origin)) / patch.normal.dot(direction);
        let range = if along > 0.5 * there && along < 2.0 * there { along } else { there };
        if patch.surface == MISS || range < self.farthest {
            self.range[point] = range;
            patch.on |= 1 << point;
        }
    }

    /// The patches that return light.
    fn lit(&self) -> impl Iterator<Item = &Patch> {
        self.patches.iter().filter(|patch| patch.is_lit())
    }

    /// The light of all its points; `None`: no light returns.
    pub fn light(&self) -> Option<Light> {
        let (mut power, mut moment, mut ends) = (0.0, 0.0, [f32::INFINITY, 0.0f32]);
        for patch in self.lit() {
            let light = patch.power() * patch.points() as f32;
            power += light;
            moment += light * patch.range;
            ends = [ends[0].min(patch.ends[0]), ends[1].max(patch.ends[1])];
        }
        if power <= 0.0 {
            return None;
        }
        Some(Light { power, mean: moment / power, span: ends[1] - ends[0] })
    }

    /// Second, third and fourth central moment of the ranges of its `light`, in powers of m.
    pub fn moments(&self, light: &Light) -> [f32; 3] {
        let mut moments = [0.0; 3];
        for patch in self.lit() {
            add_moments(patch.on, light.mean, patch.power() / light.power, &self.range, &mut moments);
        }
        moments
    }

    /// Adds what returns from its patches to `received`; the source of each is its number and the bits of `direct`.
    /// Those that span no more than `narrow` m are one pulse.
    pub fn receive(&self, [narrow, sigma]: [f32; 2], direct: u32, received: &mut BeamSignal) {
        for (number, patch) in (0..).zip(&self.patches).filter(|(_, patch)| patch.is_lit()) {
            let (each, source) = (patch.power(), number | direct);
            let all = each * patch.points() as f32;
            let ranges = points(patch.on).map(|point| self.range[point]);
            let span = patch.ends[1] - patch.ends[0];
            if span <= narrow {
                received.push(patch.range, all, source);
            } else if span <= Waveform::LONGEST_PIECE * sigma {
                received.push_pulses(source, [patch.range, all], patch.ends, ranges, each);
            } else {
                ranges.for_each(|range| received.push(range, each, source));
            }
        }
    }

    /// The part of the patch `number` that is more than `off` m off the plane `of` a surface.
    pub fn part_off(&self, number: u32, fan: &SubRayFan, of: SurfacePlane, off: f32) -> f32 {
        let patch = &self.patches[number as usize];
        let [origin, direction] = [fan.origin.each_ref(), fan.direction.each_ref()];
        let plane = [of.place.to_array(), of.normal.to_array()];
        count_off(patch.on, &self.range, origin, direction, plane, off) as f32 / patch.points() as f32
    }

    /// Range of the farthest place that its points get to, m.
    pub fn end(&self) -> f32 {
        points(self.all).map(|point| self.range[point]).fold(0.0, f32::max)
    }

    /// How many of its points get beyond `range` m.
    pub fn points_beyond(&self, range: f32) -> u32 {
        points(self.all).filter(|&point| self.range[point] > range).count() as u32
    }

    /// Whether all of it is on one plane of one surface that returns light, to within `off` m.
    pub fn is_one_plane(&self, off: f32) -> bool {
        let mut patches = self.patches.iter().filter(|patch| patch.on != 0);
        let Some(first) = patches.next().filter(|first| first.is_lit()) else { return false };
        patches.all(|patch| {
            patch.power() > 0.0 && patch.surface == first.surface && first.meets(patch.place, patch.normal, off)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_bits() {
        assert_eq!(points(0).next(), None);
        assert_eq!(points(1 << 63 | 0b1010).collect::<Vec<_>>(), [1, 3, 63]);
        assert_eq!(points(u64::MAX).count(), 64);
    }

    /// A patch of some points, seen by `rays` of them.
    fn patch(surface: u32, on: u64, rays: u32, [range, light]: [f32; 2]) -> Patch {
        let seen = HitTriangle { surface, triangle: 0, is_solid: true };
        let ray = (rays > 0).then_some((0, 0));
        Patch { on, rays, ray, range: range * rays as f32, light, ..Patch::new(seen, Vec3::X, range) }
    }

    /// A beam of which these patches are known, whose points are `traced`.
    fn patchwork(traced: u64, patches: Vec<Patch>) -> Patchwork {
        let mut beam = Patchwork { all: u64::MAX, open: u64::MAX, traced, farthest: 100.0, ..Patchwork::default() };
        for (number, patch) in (0..).zip(patches) {
            points(patch.on).for_each(|point| beam.owner[point] = number);
            beam.open &= !patch.on;
            beam.patches.push(Patch { on: 0, ..patch });
        }
        beam
    }

    /// First one point of every triangle that may be there, then points on none, then all others.
    #[test]
    fn what_is_unknown_is_looked_at_first() {
        let mut beam = Patchwork::default();
        beam.start(64, 100.0);
        assert_eq!(beam.choose(64).collect::<Vec<_>>(), (0..FIRST).collect::<Vec<_>>());
        assert_eq!(beam.choose(3).collect::<Vec<_>>(), [0, 1, 2]);
        let (seen, unseen) = (patch(1, 0xff00_00ff, 8, [9.0, 1.0]), patch(2, 0xf000 | 1 << 60, 0, [9.0, 0.0]));
        let beam = patchwork(0xff, vec![seen, unseen]);
        let next: Vec<_> = beam.choose(64).collect();
        assert_eq!(next.len(), ROUND);
        assert_eq!(next[..6], [12, 8, 9, 10, 11, 16]);
        assert_eq!(beam.choose(10).count(), 2, "two more than the eight");
        beam.choose(64).for_each(|point| assert_eq!(beam.traced & 1 << point, 0));
    }

    #[test]
    fn the_strongest_echo_is_known_by_its_majority() {
        let is = |patches: &[(u32, f32, f32)]| {
            let rays = patches.iter().map(|(rays, ..)| rays).sum::<u32>();
            let of = |(number, &(rays, range, light)): (usize, &(u32, f32, f32))| {
                patch(number as u32, 0, rays, [range, light])
            };
            let traced = u64::MAX.checked_shr(64 - rays).unwrap_or(0);
            patchwork(traced, patches.iter().enumerate().map(of).collect()).is_decided(0.3)
        };
        assert!(is(&[(15, 10.0, 0.9), (1, 12.0, 0.05)]));
        assert!(!is(&[(9, 10.0, 0.55), (7, 12.0, 0.45)]), "either can be stronger");
        assert!(is(&[(9, 10.0, 0.55), (7, 10.01, 0.45)]), "one echo");
        assert!(!is(&[(5, 10.0, 0.55), (3, 10.3, 0.45)]), "one echo, but where?");
        assert!(!is(&[(15, 10.0, 0.9), (1, 12.0, 0.0)]), "light goes on");
        assert!(!is(&[]));
    }

    /// Fits of two patches: power, mean and moments are those of their points one by one.
    #[test]
    fn light_is_that_of_all_points() {
        let (near, far) = (patch(1, 0xffff, 2, [10.0, 0.2]), patch(2, !0xffff, 4, [10.2, 0.8]));
        let mut beam = patchwork(u64::MAX, vec![near, far]);
        beam.range = std::array::from_fn(|point| if point < 16 { 10.0 } else { 10.2 } + 1e-3 * (point % 8) as f32);
        beam.settle(&SubRayFan::default(), &[]);
        let points: Vec<[f64; 2]> =
            (0..64).map(|point| [f64::from(beam.range[point]), if point < 16 { 0.1 } else { 0.2 }]).collect();
        let power = points.iter().map(|[_, power]| power).sum::<f64>();
        let mean = points.iter().map(|[range, power]| range * power).sum::<f64>() / power;
        let light = beam.light().unwrap();
        let (Light { power: is, mean: at, span }, moments) = (light, beam.moments(&light));
        assert!((f64::from(is) / power - 1.0).abs() < 1e-5 && (f64::from(at) - mean).abs() < 1e-5);
        assert!((span - 0.207).abs() < 1e-5);
        for (exponent, moment) in (2..).zip(moments) {
            let expected =
                points.iter().map(|[range, power]| power * (range - mean).powi(exponent)).sum::<f64>() / power;
            assert!((f64::from(moment) / expected - 1.0).abs() < 1e-3, "{exponent}: {moment} {expected}");
        }
        let mut received = BeamSignal::default();
        beam.receive([0.01, 0.3], 1 << 31, &mut received);
        assert_eq!(received.pieces.iter().map(|piece| piece.source).collect::<Vec<_>>(), [1 << 31, 1 | 1 << 31]);
        assert_eq!(received.pulses()[0].len(), 2);
        beam.receive([0.001, 0.3], 0, &mut received);
        assert_eq!(received.pulses()[0].len(), 2 + 64, "wide patches consist of their points");
    }
}
