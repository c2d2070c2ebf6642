//! Which surfaces a radar sees, directly and in which mirrors: rays over its field of view and to the planes of small
//! objects, reflected wherever they meet a plane that mirrors waves.

use super::facets::RadarRow;
use super::images::{MOST_MIRRORS, Mirror, MirrorChain};
use super::sightlines::MOST_PANES;
use crate::trace::Tables;
use crate::trace::hits::{HitBatch, Sight};
use glam::{DVec3, Vec3};
use ground::lanes::{LANES, RayBatch};
use rustc_hash::{FxHashMap, FxHashSet};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Numbers of mirrors in order; unused ones are [`NO_MIRROR`].
type Chain = [u16; MOST_MIRRORS];

const NO_MIRROR: u16 = u16::MAX;

/// The mirror of a plane that no ray has met.
const UNKNOWN: u16 = u16::MAX - 1;

/// Least area of mirrors in which whatever is small is looked for, m^2, and which need fewer rays.
const LARGE: f64 = 1.0;

/// Most different mirrors of a frame.
const MOST_PLANES: usize = 4096;

/// Rays to each plane of a small object: to the middles of the four triangles that its largest one divides into.
const RAYS_PER_PLANE: usize = 4;

/// Planes of a small object that get such rays.
const PLANES_PER_OBJECT: usize = 8;

/// Planes whose distances from the origin differ by more than this, m, are not the same.
const APART: f64 = 0.05;

/// Greatest cosine between the faces of a corner.
const SQUARE: f64 = 0.2;

/// By how much rays start off surfaces, m.
const OFF: f32 = 1e-4;

/// A surface as seen in mirrors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ImageTarget {
    /// Index of the row in [`Search::rows`].
    pub target: usize,
    /// Indices of mirrors in [`Search::mirrors`]; empty: it is seen directly.
    pub mirrors: Vec<usize>,
}

/// What is searched, and how.
pub(crate) struct SearchLimits<'a> {
    /// Place of the radar relative to the scene's origin, m.
    pub start: DVec3,
    /// Directions over the field of view, unit vectors, world, row by row.
    pub directions: &'a [Vec3],
    /// How many there are in a row.
    pub columns: usize,
    /// Angle between neighbours, rad.
    pub step: f64,
    /// Whether the radar looks in a direction, or within an angle, rad, of it.
    pub looks: &'a dyn Fn(DVec3, f64) -> bool,
    pub reach: f64,
    pub wavelength: f64,
    /// Most mirrors on a path, up to [`MOST_MIRRORS`].
    pub most_mirrors: usize,
    /// Most surfaces seen in mirrors: those that appear largest.
    pub most_images: usize,
    /// Whether a surface (a row) mirrors waves.
    pub mirrors: &'a dyn Fn(u32) -> bool,
    /// Whether waves pass through a surface (a row).
    pub passes: &'a dyn Fn(u32) -> bool,
    /// Part of the amplitude of a wave that mirrors leave, by the image of the radar in them and the place that it goes to.
    pub kept: &'a dyn Fn(&mut dyn Iterator<Item = Mirror>, DVec3, DVec3) -> f64,
    /// Least `(radius / (r s))^2`, 1/m^2, of what is looked at in mirrors, times the power that these leave; `r` and `s`:
    /// distances from the image of the radar and from the radar.
    pub least: f64,
    pub sight: Sight,
    /// Part of the time span, 0 to 1.
    pub time: f32,
}

impl SearchLimits<'_> {
    /// Whether the radar looks at a sphere, or a part of it.
    fn sees(&self, middle: DVec3, radius: f64) -> bool {
        let way = middle - self.start;
        let distance = way.length();
        distance < radius || (self.looks)(way / distance, (radius / distance).min(1.0).asin())
    }
}

/// The surfaces in view, and those in mirrors.
#[derive(Debug, Default)]
pub(crate) struct Search {
    /// Rows that are or may be visible directly.
    pub rows: Vec<RadarRow>,
    pub mirrors: Vec<Mirror>,
    /// In a fixed order: direct ones first.
    pub targets: Vec<ImageTarget>,
    /// Distances between mirrors that rays went from one to the other of, m.
    legs: FxHashMap<[u16; 2], f64>,
    /// For each of `rows` the mirrors that its planes are part of, [`NO_MIRROR`] or [`UNKNOWN`].
    planes: Vec<Vec<u16>>,
    /// Mirrors by how far their planes are from the origin, in steps of [`APART`].
    by_distance: FxHashMap<i64, Vec<u16>>,
}

/// A ray on its way.
#[derive(Clone, Copy)]
struct SearchRay {
    from: Vec3,
    along: Vec3,
    left: f32,
    /// Number of the chain of mirrors behind it.
    chain: u32,
    /// Whether large mirrors need not turn it: others beside it suffice.
    fine: bool,
}

/// A search under way.
struct Searcher<'a> {
    scene: &'a Tables,
    limits: &'a SearchLimits<'a>,
    search: Search,
    /// Index in [`Search::rows`] of each row of surfaces, or [`u32::MAX`].
    of_row: Vec<u32>,
    /// Of each of [`Search::rows`], whether it mirrors waves, and whether it lets them through.
    surfaces: Vec<[bool; 2]>,
    chains: Vec<Chain>,
    longer: FxHashMap<(u32, u16), u32>,
    /// Numbers of chains, and of rows that are seen in them.
    seen: FxHashSet<(u32, u32)>,
    batch: Box<RayBatch>,
    hits: Box<HitBatch>,
}

impl Search {
    /// Finds what is seen of `rows`.
    pub fn new(scene: &Tables, mut rows: Vec<RadarRow>, limits: &SearchLimits) -> Search {
        let near = |row: &RadarRow| (row.middle - limits.start).length() - row.radius < limits.reach;
        rows.retain(near);
        let mut of_row = vec![u32::MAX; scene.surfaces.rows.len()];
        (0..).zip(&rows).for_each(|(index, row): (u32, &RadarRow)| of_row[row.row as usize] = index);
        let surfaces = rows.iter().map(|row| [(limits.mirrors)(row.row), (limits.passes)(row.row)]).collect();
        let planes = vec![Vec::new(); rows.len()];
        let mut searcher = Searcher {
            scene,
            limits,
            search: Search { rows, planes, ..Search::default() },
            of_row,
            surfaces,
            chains: vec![[NO_MIRROR; MOST_MIRRORS]],
            longer: FxHashMap::default(),
            seen: FxHashSet::default(),
            batch: Box::default(),
            hits: Box::new(HitBatch::new()),
        };
        searcher.run();
        let Searcher { mut search, chains, seen, .. } = searcher;
        search.list(&chains, &seen, limits);
        search
    }

    /// Whether a row may be missed by the rays over the field of view.
    fn is_small(&self, index: usize, limits: &SearchLimits) -> bool {
        /// Rays across it.
        const RAYS: f64 = 4.0;
        let row = &self.rows[index];
        let distance = (row.middle - limits.start).length().max(1e-6);
        2.0 * row.radius < RAYS * limits.step * distance
    }

    /// Whether the radar looks at a row, or a part of it.
    fn is_in_view(&self, index: usize, limits: &SearchLimits) -> bool {
        let row = &self.rows[index];
        limits.sees(row.middle, row.radius)
    }
}

impl Searcher<'_> {
    fn run(&mut self) {
        let limits = self.limits;
        let from = limits.start.as_vec3();
        let ray = |along: Vec3, fine: bool| SearchRay { from, along, left: limits.reach as f32, chain: 0, fine };
        let columns = limits.columns.max(1);
        let is_fine = |at: usize| (at / columns % 2, at % columns % 2) != (0, 0);
        let fan = limits.directions.iter().enumerate();
        let mut rays: Vec<SearchRay> = fan.map(|(at, &along)| ray(along, is_fine(at))).collect();
        let rows = 0..self.search.rows.len();
        let small: Vec<u32> = rows.filter(|&row| self.search.is_small(row, limits)).map(|row| row as u32).collect();
        for &index in small.iter().filter(|&&index| self.search.is_in_view(index as usize, limits)) {
            // What falls between rays may be visible.
            self.seen.insert((0, index));
            self.add_rays_to_planes(index, &mut |along| rays.push(ray(along, false)));
        }
        for depth in 0..=limits.most_mirrors {
            rays = self.follow(&rays);
            if depth == 0 && limits.most_mirrors > 0 {
                self.look_in_mirrors(&small);
            }
        }
    }

    fn add_rays_to_planes(&self, index: u32, add: &mut dyn FnMut(Vec3)) {
        let row = &self.search.rows[index as usize];
        let [mirrors, _] = self.surfaces[index as usize];
        if self.limits.most_mirrors == 0 || !mirrors {
            return;
        }
        let facets = self.scene.row_facets(*row, self.limits.time);
        let planes = self.scene.surfaces.planes(self.scene.surfaces.rows[row.row as usize].part);
        for plane in planes.all().iter().take(PLANES_PER_OBJECT) {
            let [a, b, c] = facets.corners(plane.largest);
            let middle = (a + b + c) / 3.0;
            let parts: [DVec3; RAYS_PER_PLANE] = [middle, 0.5 * (a + middle), 0.5 * (b + middle), 0.5 * (c + middle)];
            parts.into_iter().for_each(|place| add((place - self.limits.start).normalize_or_zero().as_vec3()));
        }
    }

    /// Traces `rays`, also through panes, notes what they hit, and returns those that are mirrored.
    fn follow(&mut self, rays: &[SearchRay]) -> Vec<SearchRay> {
        let [mut next, mut beyond] = [Vec::new(), Vec::new()];
        self.follow_once(rays, &mut next, &mut beyond);
        for _ in 1..MOST_PANES {
            let rays = std::mem::take(&mut beyond);
            if rays.is_empty() {
                break;
            }
            self.follow_once(&rays, &mut next, &mut beyond);
        }
        next
    }

    /// Traces `rays` up to what they hit first; adds those that are mirrored to `next`, and those that go on behind it to
    /// `beyond`.
    fn follow_once(&mut self, rays: &[SearchRay], next: &mut Vec<SearchRay>, beyond: &mut Vec<SearchRay>) {
        let mut last = (u32::MAX, u32::MAX);
        for block in rays.chunks(LANES) {
            let batch = &mut self.batch;
            for (lane, ray) in block.iter().enumerate() {
                (batch.org_x[lane], batch.org_y[lane], batch.org_z[lane]) = ray.from.into();
                (batch.dir_x[lane], batch.dir_y[lane], batch.dir_z[lane]) = ray.along.into();
                (batch.range_max[lane], batch.time[lane]) = (ray.left, self.limits.time);
            }
            self.hits.trace(self.scene, &self.batch, block.len(), block[0].chain == 0, self.limits.sight);
            for (lane, ray) in block.iter().enumerate() {
                let Some(&index) = self.of_row.get(self.hits.surface[lane] as usize) else { continue };
                let Some(&[mirrors, passes]) = self.surfaces.get(index as usize) else { continue };
                let range = self.hits.range[lane];
                let place = ray.from + ray.along * range;
                let left = ray.left - range;
                if passes {
                    beyond.push(SearchRay { from: place + ray.along * OFF, left: left - OFF, ..*ray });
                }
                let chain = self.chains[ray.chain as usize];
                let depth = depth(&chain);
                let leg = f64::from(range);
                // A mirror that is smaller than its first Fresnel zone scatters instead.
                if depth > 0 && self.search.mirrors[usize::from(chain[depth - 1])].area < self.limits.wavelength * leg {
                    continue;
                }
                if last != (ray.chain, index) {
                    last = (ray.chain, index);
                    self.seen.insert(last);
                }
                let mirror = if mirrors { self.mirror(index, self.hits.triangle[lane]) } else { None };
                let Some(mirror) = mirror else { continue };
                if depth > 0 {
                    let before = chain[depth - 1];
                    let pair = [before.min(mirror), before.max(mirror)];
                    let shortest = self.search.legs.entry(pair).or_insert(leg);
                    *shortest = shortest.min(leg);
                }
                let plane = &self.search.mirrors[usize::from(mirror)];
                if depth == self.limits.most_mirrors || ray.fine && plane.area >= LARGE {
                    continue;
                }
                let along = plane.turned(ray.along.as_dvec3()).normalize().as_vec3();
                let side = plane.normal.dot(along.as_dvec3()).signum();
                let from = place + (plane.normal * side).as_vec3() * OFF;
                next.push(SearchRay { from, along, left, chain: self.longer(ray.chain, mirror), ..*ray });
            }
        }
    }

    /// The number of a chain with one more mirror.
    fn longer(&mut self, chain: u32, mirror: u16) -> u32 {
        *self.longer.entry((chain, mirror)).or_insert_with(|| {
            let mut longer = self.chains[chain as usize];
            longer[depth(&longer)] = mirror;
            self.chains.push(longer);
            self.chains.len() as u32 - 1
        })
    }

    /// Notes in which large mirrors the middles of the `small` rows are seen; small mirrors are met by rays to their planes.
    fn look_in_mirrors(&mut self, small: &[u32]) {
        let limits = self.limits;
        let mut aimed: Vec<(u16, u32, DVec3)> = Vec::new();
        for (number, mirror) in self.search.mirrors.iter().enumerate().filter(|(_, mirror)| mirror.area >= LARGE) {
            let path = MirrorChain::new(limits.start, std::iter::once(*mirror));
            for &index in small {
                let row = &self.search.rows[index as usize];
                let leg = mirror.height(row.middle).abs();
                if mirror.area < limits.wavelength * leg || leg > limits.reach {
                    continue;
                }
                if let Some([bend, ..]) = path.bends(row.middle)
                    && (bend - mirror.point).length() < mirror.radius
                    && mirror.area >= limits.wavelength * (bend - row.middle).length()
                    && (limits.looks)((bend - limits.start).normalize_or_zero(), 0.0)
                {
                    aimed.push((number as u16, index, bend));
                }
            }
        }
        for block in aimed.chunks(LANES) {
            let batch = &mut self.batch;
            for (lane, (_, _, bend)) in block.iter().enumerate() {
                let way = *bend - limits.start;
                (batch.org_x[lane], batch.org_y[lane], batch.org_z[lane]) = limits.start.as_vec3().into();
                (batch.dir_x[lane], batch.dir_y[lane], batch.dir_z[lane]) = way.normalize().as_vec3().into();
                (batch.range_max[lane], batch.time[lane]) = (f32::INFINITY, limits.time);
            }
            self.hits.trace(self.scene, &self.batch, block.len(), false, limits.sight);
            for (lane, &(number, index, bend)) in block.iter().enumerate() {
                let Some(&hit) = self.of_row.get(self.hits.surface[lane] as usize) else { continue };
                let Some(&[true, _]) = self.surfaces.get(hit as usize) else { continue };
                let near = f64::from(self.hits.range[lane]) - (bend - limits.start).length();
                if near.abs() < 0.1 && self.mirror(hit, self.hits.triangle[lane]) == Some(number) {
                    let chain = self.longer(0, number);
                    self.seen.insert((chain, index));
                }
            }
        }
    }

    /// The number of the mirror that a triangle of a row that mirrors waves is part of.
    fn mirror(&mut self, index: u32, triangle: u32) -> Option<u16> {
        let row = self.search.rows[index as usize];
        let number = self.scene.plane_number(&row, triangle)?;
        let known = &mut self.search.planes[index as usize];
        if known.len() <= number {
            known.resize(number + 1, UNKNOWN);
        }
        if known[number] == UNKNOWN {
            self.search.planes[index as usize][number] = self.new_mirror(&row, number).unwrap_or(NO_MIRROR);
        }
        let mirror = self.search.planes[index as usize][number];
        (mirror != NO_MIRROR).then_some(mirror)
    }

    /// Adds a plane of a row to the mirrors, as one of its own or as a part of one.
    fn new_mirror(&mut self, row: &RadarRow, number: usize) -> Option<u16> {
        /// Side of the least square that mirrors anything, wavelengths.
        const LEAST: f64 = 5.0;
        let plane = self.scene.plane(row, number)?;
        if plane.area < (LEAST * self.limits.wavelength).powi(2) {
            return None;
        }
        let Search { mirrors, by_distance, .. } = &mut self.search;
        let step = (plane.normal.dot(plane.point).abs() / APART).round() as i64;
        let near = (step - 1..=step + 1).filter_map(|step| by_distance.get(&step)).flatten();
        let same = near.copied().filter(|&it| mirrors[usize::from(it)].is_plane(plane.normal, plane.point)).min();
        if let Some(number) = same {
            let mirror = &mut mirrors[usize::from(number)];
            mirror.area += plane.area;
            mirror.radius = mirror.radius.max((plane.point - mirror.point).length() + plane.radius);
            return same;
        }
        if mirrors.len() == MOST_PLANES {
            return None;
        }
        let number = mirrors.len() as u16;
        mirrors.push(plane);
        by_distance.entry(step).or_default().push(number);
        Some(number)
    }
}

/// The number of mirrors in a chain.
fn depth(chain: &Chain) -> usize {
    chain.iter().take_while(|&&mirror| mirror != NO_MIRROR).count()
}

impl Search {
    /// Lists what was `seen`. Waves go both ways: a target seen in a mirror is a mirror in which that one is seen.
    fn list(&mut self, chains: &[Chain], seen: &FxHashSet<(u32, u32)>, limits: &SearchLimits) {
        let rows_of = self.rows_of_mirrors();
        let rows = |mirror: u16| rows_of[usize::from(mirror)].iter().copied();
        let mut strongest = StrongestImages::new(self, limits);
        let mut direct: Vec<u32> = Vec::new();
        for &(chain, row) in seen {
            match chain {
                0 => direct.push(row),
                _ => strongest.offer(chains[chain as usize], row),
            }
        }
        for &[a, b] in self.legs.keys() {
            for (first, second) in [(a, b), (b, a)] {
                rows(second).for_each(|row| strongest.offer([first, NO_MIRROR, NO_MIRROR], row));
            }
        }
        if limits.most_mirrors > 1 {
            for [a, b, c] in self.corners(chains) {
                for [x, y, z] in [[a, b, c], [a, c, b], [b, a, c], [b, c, a], [c, a, b], [c, b, a]] {
                    rows(z).for_each(|row| strongest.offer([x, y, NO_MIRROR], row));
                }
            }
        }
        let images = strongest.list();
        direct.retain(|&row| self.is_in_view(row as usize, limits));
        direct.sort_unstable();
        let direct = direct.into_iter().map(|row| ImageTarget { target: row as usize, mirrors: Vec::new() });
        self.targets = direct.chain(images).collect();
    }

    /// For each mirror the indices of rows that have facets in it, each once.
    fn rows_of_mirrors(&self) -> Vec<Vec<u32>> {
        let mut rows = vec![Vec::new(); self.mirrors.len()];
        for (index, planes) in (0..).zip(&self.planes) {
            for &mirror in planes {
                // Neither unknown ones nor those that mirror nothing.
                let Some(rows) = rows.get_mut(usize::from(mirror)) else { continue };
                if rows.last() != Some(&index) {
                    rows.push(index);
                }
            }
        }
        rows
    }

    /// Triples of mirrors that face each other, in rising order, of which rays met two one after the other, or which are at
    /// right angles: the three faces of a corner need no ray that meets all of them.
    fn corners(&self, chains: &[Chain]) -> Vec<[u16; 3]> {
        let count = self.mirrors.len();
        // Of each mirror, those of higher number beside it, in rising order.
        let mut beside: Vec<Vec<u16>> = vec![Vec::new(); count];
        self.legs.keys().filter(|[a, b]| a != b).for_each(|&[a, b]| beside[usize::from(a)].push(b));
        beside.iter_mut().for_each(|beside| beside.sort_unstable());
        let pairs = chains.iter().filter(|chain| chain[1] != NO_MIRROR);
        let met: FxHashSet<[u16; 2]> = pairs.map(|&[a, b, _]| [a.min(b), a.max(b)]).collect();
        let normal = |mirror: u16| self.mirrors[usize::from(mirror)].normal;
        let is_square = |a: u16, b: u16| normal(a).dot(normal(b)).abs() < SQUARE;
        let mut corners = Vec::new();
        // Which mirrors are beside the first, with whether both were met.
        let mut of_first: Vec<Option<bool>> = vec![None; count];
        for (a, first) in (0..).zip(&beside) {
            first.iter().for_each(|&b| of_first[usize::from(b)] = Some(met.contains(&[a, b])));
            for &b in first {
                let pair = of_first[usize::from(b)] == Some(true);
                let square = is_square(a, b);
                for &c in &beside[usize::from(b)] {
                    let Some(other) = of_first[usize::from(c)] else { continue };
                    if pair || other || met.contains(&[b, c]) || square && is_square(a, c) && is_square(b, c) {
                        corners.push([a, b, c]);
                    }
                }
            }
            first.iter().for_each(|&b| of_first[usize::from(b)] = None);
        }
        corners
    }

    /// Number of the mirror that a triangle of a row is part of, if rays found that; `row` is an index of
    /// [`Search::rows`].
    pub fn mirror_of(&self, scene: &Tables, row: usize, triangle: u32) -> Option<usize> {
        let number = scene.plane_number(&self.rows[row], triangle)?;
        let mirror = usize::from(*self.planes[row].get(number)?);
        (mirror < self.mirrors.len()).then_some(mirror)
    }

    /// Whether waves from mirror `from` are mirrored by mirror `to` rather than scattered: its facets fill the first Fresnel
    /// zone of the way between them.
    pub fn is_mirrored(&self, from: usize, to: usize, wavelength: f64) -> bool {
        let (a, b) = (from.min(to) as u16, from.max(to) as u16);
        self.legs.get(&[a, b]).is_some_and(|leg| self.mirrors[to].area >= wavelength * leg)
    }
}

/// The surfaces in mirrors that appear largest, of those offered.
struct StrongestImages<'a> {
    search: &'a Search,
    limits: &'a SearchLimits<'a>,
    /// Of each mirror, the image of the radar.
    images: Vec<DVec3>,
    /// Of each row, `(radius / distance)^2`.
    sizes: Vec<f64>,
    /// The weakest first.
    kept: BinaryHeap<Reverse<SizedImage>>,
    /// Those that were ever kept: some are offered several times.
    known: FxHashSet<(Chain, u32)>,
}

/// An image by its size, then the number of its mirrors, and these and its row.
#[derive(PartialEq)]
struct SizedImage(f64, Reverse<(usize, Chain, u32)>);

impl Eq for SizedImage {}

impl PartialOrd for SizedImage {
    fn partial_cmp(&self, other: &SizedImage) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for SizedImage {
    fn cmp(&self, other: &SizedImage) -> Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

impl<'a> StrongestImages<'a> {
    fn new(search: &'a Search, limits: &'a SearchLimits) -> StrongestImages<'a> {
        let images = search.mirrors.iter().map(|mirror| mirror.image(limits.start)).collect();
        let size = |row: &RadarRow| (row.radius / (row.middle - limits.start).length().max(row.radius)).powi(2);
        let sizes = search.rows.iter().map(size).collect();
        StrongestImages { search, limits, images, sizes, kept: BinaryHeap::new(), known: FxHashSet::default() }
    }

    /// Keeps an image if it is among the strongest so far and waves can go this way.
    fn offer(&mut self, chain: Chain, index: u32) {
        let (search, limits) = (self.search, self.limits);
        let count = depth(&chain);
        let of_chain = || chain[..count].iter().map(|&it| search.mirrors[usize::from(it)]);
        let row = &search.rows[index as usize];
        let image = chain[1..count].iter().fold(self.images[usize::from(chain[0])], |place, &mirror| {
            search.mirrors[usize::from(mirror)].image(place)
        });
        let size = self.sizes[index as usize] / (row.middle - image).length_squared().max(row.radius * row.radius);
        let least = match self.kept.peek() {
            Some(Reverse(SizedImage(least, _))) if self.kept.len() == limits.most_images => limits.least.max(*least),
            _ => limits.least,
        };
        // Many are offered, few are kept: what is simple is asked first.
        if size <= limits.least || size < least {
            return;
        }
        let mirrors = MirrorChain::new(limits.start, of_chain());
        if mirrors.bends(row.middle).is_some_and(|bends| !mirrors.hold(&bends, row.radius))
            || !limits.sees(mirrors.target_image(row.middle), row.radius)
        {
            return;
        }
        let left = (limits.kept)(&mut of_chain(), image, row.middle);
        let size = size * left * left;
        if size > limits.least && self.known.insert((chain, index)) {
            self.kept.push(Reverse(SizedImage(size, Reverse((count, chain, index)))));
            if self.kept.len() > limits.most_images {
                self.kept.pop();
            }
        }
    }

    /// Those kept, by the number of their mirrors, these, and their rows.
    fn list(self) -> impl Iterator<Item = ImageTarget> {
        let mut images: Vec<_> = self.kept.into_iter().map(|Reverse(SizedImage(_, Reverse(image)))| image).collect();
        images.sort_unstable();
        images.into_iter().map(|(count, chain, row)| ImageTarget {
            target: row as usize,
            mirrors: chain[..count].iter().map(|&mirror| usize::from(mirror)).collect(),
        })
    }
}
