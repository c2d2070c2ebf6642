//! Clutter: the incoherent echoes of rough surfaces, in patches that are small against a cell of the radar.
//!
//! `|a|^2 = Pt Gt Gr lambda^2 s0 A / ((4 pi)^3 R^4)` of a patch of area `A` with the backscatter `s0` per area (Ulaby,
//! Moore and Fung 1982, eq. 7.25), with the amplitude and phase of many scatterers (speckle). Patches are fixed parts of
//! their triangles, and their speckle is a function of the part: what stands still looks the same in every frame.

use super::echoes::{RadarEchoes, RadarRoute};
use super::wave::{Scattering, WaveField};
use crate::trace::{Mirrors, RadarRow, Search, SightMemory, Sighted, Sightlines};
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
struct Patch {
    triangle: u32,
    /// Which part of the triangle: two bits for each of its divisions by four after a leading one.
    part: u32,
    place: DVec3,
    /// Backscattering area, m^2.
    area: f64,
}

/// Buffers of [`scatter_from_rough`].
#[derive(Default)]
pub(crate) struct ClutterMemory {
    sight: SightMemory,
    patches: Vec<Patch>,
    places: Vec<DVec3>,
    seen: Vec<Sighted>,
    stack: Vec<([DVec3; 3], u32)>,
}

/// Most divisions of a triangle by two, as its part has 32 bits.
const MOST_DIVISIONS: u32 = 15;

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
    let direct = Mirrors::new(field.place, std::iter::empty());
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
        let scattering = Scattering { row, triangle, velocity, place, strength, incoherent: true };
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
    let facets = field.scene.row_facets(row, field.time);
    for triangle in facets.triangles() {
        let corners = facets.corners(triangle);
        let [a, b, c] = corners;
        let across = (b - a).cross(c - a);
        let Some(normal) = across.try_normalize() else { continue };
        stack.clear();
        stack.push((corners, 1));
        while let Some((corners, part)) = stack.pop() {
            let [a, b, c] = corners;
            let middle = (a + b + c) / 3.0;
            let reach = [a, b, c].map(|corner| (corner - middle).length()).into_iter().fold(0.0, f64::max);
            let to = middle - field.place;
            let distance = to.length();
            if distance - reach > field.reach {
                continue;
            }
            let along = to / distance;
            let area = 0.5 * across.length() / f64::from(1u32 << (2 * divisions(part))).max(1.0);
            // Extent in range, and across.
            let ranges = [a, b, c].map(|corner| (corner - field.place).length());
            let deep = ranges.into_iter().fold(0.0, f64::max) - ranges.into_iter().fold(f64::INFINITY, f64::min);
            let wide = [a, b, c].map(|corner| (corner - middle).reject_from_normalized(along).length());
            let wide = 2.0 * wide.into_iter().fold(0.0, f64::max);
            let fine = deep <= grid.range && wide <= grid.angle * distance;
            if !fine && divisions(part) < MOST_DIVISIONS {
                // Whatever is too weak even as a whole is not divided.
                let cos = 1.0;
                if reach < 0.5 * distance && !counts(field, distance - reach, area * f64::from(greatest) * cos, along) {
                    continue;
                }
                let [x, y, z] = [0.5 * (b + c), 0.5 * (a + c), 0.5 * (a + b)];
                let parts = [[a, z, y], [z, b, x], [y, x, c], [x, y, z]];
                stack.extend((0..4).zip(parts).map(|(number, corners)| (corners, part << 2 | number)));
                continue;
            }
            let cos = normal.dot(along).abs() as f32;
            let area = area * f64::from(surface.clutter(cos));
            if distance <= field.reach && counts(field, distance, area, along) {
                patches.push(Patch { triangle, part, place: middle, area });
            }
        }
    }
}

fn divisions(part: u32) -> u32 {
    (31 - part.leading_zeros()) / 2
}

/// Whether a backscattering area could matter together with others in its cell.
fn counts(field: &WaveField, distance: f64, area: f64, along: DVec3) -> bool {
    let along = along.as_vec3();
    let strength = (area / (4.0 * PI)).sqrt() / (distance * distance).max(1e-6);
    strength * field.scale() * field.gain(along, along) > field.floor
}
