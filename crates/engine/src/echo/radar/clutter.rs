//! Clutter: the incoherent echoes of rough surfaces, in patches that are small against a cell of the radar.
//!
//! `|a|^2 = Pt Gt Gr lambda^2 s0 A / ((4 pi)^3 R^4)` of a patch of area `A` with the backscatter `s0` per area (Ulaby,
//! Moore and Fung 1982, eq. 7.25), with the amplitude and phase of many scatterers (speckle). Patches are fixed parts of
//! their triangles, and their speckle is a function of the part: what stands still looks the same in every frame.

use super::echoes::{RadarEchoes, RadarRoute};
use super::wave::{Scatterer, WaveField};
use crate::trace::{MirrorChain, RadarRow, Search, SightMemory, Sighted, Sightlines};
use glam::DVec3;
use ground::rng::{Draw, Rng};
use num_complex::Complex64;
use std::f64::consts::PI;

/// How small patches are, and their draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClutterGrid {
    pub rng: Rng,
    /// Extent in range, m.
    pub range: f64,
    /// Extent across, rad.
    pub angle: f64,
}

/// A patch of a rough surface.
struct ClutterPatch {
    triangle: u32,
    /// Which part of the triangle: a bit for each of its divisions in two after a leading one.
    part: u32,
    place: DVec3,
    /// Backscattering area, m^2.
    area: f64,
}

/// Buffers of [`scatter_from_rough`].
#[derive(Default)]
pub(crate) struct ClutterMemory {
    sight: SightMemory,
    patches: Vec<ClutterPatch>,
    places: Vec<DVec3>,
    seen: Vec<Sighted>,
    stack: Vec<ClutterPart>,
}

/// A part of a triangle that is to be divided into patches.
struct ClutterPart {
    corners: [DVec3; 3],
    /// As [`ClutterPatch::part`].
    part: u32,
    /// How many parts of its size it stands for, itself among them.
    stands_for: f64,
}

/// Extent of a part, as seen by the radar, within which gain and backscatter are about the same, rad.
const NARROW: f64 = 0.1;

/// Most divisions of a triangle, as its part has 32 bits.
const MOST_DIVISIONS: u32 = 31;

/// Adds the clutter of target `number`, which is seen directly, to `echoes`.
pub(crate) fn scatter_from_rough(
    field: &WaveField,
    sightlines: &Sightlines,
    search: &Search,
    number: u32,
    grid: ClutterGrid,
    memory: &mut ClutterMemory,
    echoes: &mut RadarEchoes,
) {
    let row = search.rows[search.targets[number as usize].target];
    memory.patches.clear();
    find_patches(field, row, grid, memory);
    let ClutterMemory { sight, patches, places, seen, .. } = memory;
    if patches.is_empty() {
        return;
    }
    places.clear();
    places.extend(patches.iter().map(|patch| patch.place));
    let direct = MirrorChain::new(field.place, std::iter::empty());
    sightlines.look(field.place, &direct, places, sight, seen);
    let facets = field.scene.row_facets(row, field.time);
    let k = field.k();
    for (patch, seen) in patches.iter().zip(&mut *seen).filter(|(_, seen)| seen.through > 0.0) {
        seen.through *= seen.through;
        let distance = (patch.place - field.place).length();
        let [re, im] = speckle(&grid.rng, [row.row, patch.triangle, patch.part]);
        let strength = (patch.area / (4.0 * PI)).sqrt() / (distance * distance)
            * Complex64::new(re.into(), im.into())
            * Complex64::cis(-2.0 * k * distance);
        let velocity = facets.velocity(patch.triangle);
        let (row, triangle, place) = (row.row, patch.triangle, patch.place);
        let scattering = Scatterer { row, triangle, velocity, place, strength, incoherent: true };
        if let Some(echo) = field.echo(&scattering, &direct, seen, RadarRoute::Direct, number) {
            echoes.push(echo);
        }
    }
}

/// A complex number with an exponentially distributed power of mean 1.
fn speckle(rng: &Rng, [row, triangle, part]: [u32; 3]) -> [f32; 2] {
    let ([mut re], [mut im]) = ([0.0], [0.0]);
    rng.phasors(
        [&[row], &[triangle], &[part], &[Draw::RadarSpeckle as u32]],
        std::slice::from_mut(&mut re),
        std::slice::from_mut(&mut im),
    );
    [re, im]
}

/// Divides the triangles of a row into patches whose echoes may matter.
fn find_patches(field: &WaveField, row: RadarRow, grid: ClutterGrid, memory: &mut ClutterMemory) {
    let ClutterMemory { patches, stack, .. } = memory;
    let surface = field.surfaces.of(&field.scene.surfaces, row.row);
    let greatest = (1..=8).map(|step| surface.clutter(step as f32 / 8.0)).fold(0.0, f32::max);
    if greatest == 0.0 {
        return;
    }
    // Of weak patches a few stand for all: each is kept with the probability by which it would be too weak, and is as much
    // stronger. Halves of weak parts are thinned in the same way: one of two is divided further, and stands for both.
    let mut add = |patch: ClutterPatch, distance: f64, along: DVec3| {
        let chance = (amplitude(field, distance, patch.area, along) / field.noise()).powi(2);
        let address = [row.row, patch.triangle, patch.part];
        if chance >= 1.0 {
            patches.push(patch);
        } else if f64::from(grid.rng.uniform_at(address, Draw::RadarPatch)) < chance {
            patches.push(ClutterPatch { area: patch.area / chance, ..patch });
        }
    };
    let facets = field.scene.row_facets(row, field.time);
    for triangle in facets.triangles() {
        let corners = facets.corners(triangle);
        let [a, b, c] = corners;
        let normal_area = (b - a).cross(c - a);
        let Some(normal) = normal_area.try_normalize() else { continue };
        stack.clear();
        stack.push(ClutterPart { corners, part: 1, stands_for: 1.0 });
        while let Some(ClutterPart { corners, part, stands_for }) = stack.pop() {
            let [a, b, c] = corners;
            let middle = (a + b + c) / 3.0;
            let reach = [a, b, c].map(|corner| (corner - middle).length()).into_iter().fold(0.0, f64::max);
            let to = middle - field.place;
            let distance = to.length();
            if distance - reach > field.reach {
                continue;
            }
            let along = to / distance;
            let area = stands_for * 0.5 * normal_area.length() * 0.5f64.powi(divisions(part) as i32);
            let extent = 2.0 * reach;
            if extent < grid.range && extent < grid.angle * distance {
                // Smaller than any patch needs to be.
                let area = area * f64::from(surface.clutter(normal.dot(along).abs() as f32));
                add(ClutterPatch { triangle, part, place: middle, area }, distance, along);
                continue;
            }
            if reach < distance && !field.looks(along, (reach / distance).asin()) {
                continue;
            }
            // While a part is larger than a patch in both extents, its longest edge is halved: so it keeps its shape, and is
            // not cut along a direction that is another one nearer to the radar. Then the edge that spans most of the extent
            // that is too large.
            let edges = [[0, 1], [1, 2], [2, 0]];
            let lengths = edges.map(|[from, to]| (corners[to] - corners[from]).length());
            let across = grid.angle * distance;
            let large = lengths.map(|length| length / across.max(grid.range));
            let ranges = corners.map(|corner| (corner - field.place).length());
            let sides = corners.map(|corner| (corner - middle).reject_from_normalized(along));
            let deep = edges.map(|[from, to]| (ranges[to] - ranges[from]).abs() / grid.range);
            let wide = edges.map(|[from, to]| (sides[to] - sides[from]).length() / across);
            let greatest_of = |spans: [f64; 3]| spans.into_iter().fold(0.0, f64::max);
            let spans = if greatest_of(large) > 1.0 {
                large
            } else if greatest_of(deep) > greatest_of(wide) {
                deep
            } else {
                wide
            };
            let most = greatest_of(spans);
            if most > 1.0 && divisions(part) < MOST_DIVISIONS {
                // Whatever is too weak even as a whole is not divided.
                if reach < 0.5 * distance
                    && amplitude(field, distance - reach, area * f64::from(greatest), along) < field.floor
                {
                    continue;
                }
                let edge = spans.iter().position(|&span| span == most).unwrap_or_default();
                let [a, b, c] = [0, 1, 2].map(|corner| corners[(edge + corner) % 3]);
                let halfway = 0.5 * (a + b);
                let halves = [([a, halfway, c], part << 1), ([halfway, b, c], part << 1 | 1)];
                let half = |(corners, part): ([DVec3; 3], u32), more: f64| ClutterPart {
                    corners,
                    part,
                    stands_for: more * stands_for,
                };
                let area = area * f64::from(surface.clutter(normal.dot(along).abs() as f32));
                if reach < NARROW * distance && greatest_amplitude(field, area, corners, middle) < field.noise() {
                    let draw = grid.rng.uniform_at([row.row, triangle, part], Draw::RadarPatch);
                    stack.push(half(halves[usize::from(draw < 0.5)], 2.0));
                } else {
                    stack.extend(halves.map(|it| half(it, 1.0)));
                }
                continue;
            }
            let cos = normal.dot(along).abs() as f32;
            let area = area * f64::from(surface.clutter(cos));
            if distance <= field.reach {
                add(ClutterPatch { triangle, part, place: middle, area }, distance, along);
            }
        }
    }
}

/// How often a part has been halved.
fn divisions(part: u32) -> u32 {
    31 - part.leading_zeros()
}

/// Received amplitude of a backscattering area, sqrt(W).
fn amplitude(field: &WaveField, distance: f64, area: f64, along: DVec3) -> f64 {
    let along = along.as_vec3();
    let strength = (area / (4.0 * PI)).sqrt() / (distance * distance).max(1e-6);
    strength * field.scale() * field.gain(along, along)
}

/// The greatest of the received amplitudes of a backscattering area in the middle and at the corners of a triangle, sqrt(W).
fn greatest_amplitude(field: &WaveField, area: f64, corners: [DVec3; 3], middle: DVec3) -> f64 {
    let of = |place: DVec3| {
        let way = place - field.place;
        let distance = way.length();
        amplitude(field, distance, area, way / distance)
    };
    corners.into_iter().map(of).fold(of(middle), f64::max)
}
