//! The meshes of ground, path and water, and the cover of the ground.

use super::course::Course;
use super::{Land, material};
use crate::glb::{Glb, Look, Placement, Primitive};
use crate::noise::GradientNoise;
use glam::{DVec2, Vec3};
use ground::parallel;
use std::collections::HashMap;

/// Noise field of where soil is bare.
const BARE: u32 = 36;
/// Noise above which the ground is bare soil, and distance from the stream up to which it is sand, m.
const SOIL: f64 = 0.3;
const SAND: f64 = 0.5;
/// Number of kinds of ground other than turf.
const LEVELS: usize = 4;
/// Slopes above which the ground is rock, and rough soil.
const ROCK_SLOPE: f64 = 0.75;
const SOIL_SLOPE: f64 = 0.58;

/// Parts of the terrain: name, linear colour and reflectance at 905 nm, which are our own plausible choices.
const GROUND: [(&str, [f32; 3], f64); 4] = [
    ("turf", [0.1, 0.14, 0.035], 0.4),
    ("soil", [0.13, 0.085, 0.05], 0.25),
    ("rock", [0.2, 0.2, 0.2], 0.3),
    ("sand", [0.42, 0.35, 0.23], 0.35),
];

/// Noise of where the soil is bare, for land of this size and cells.
pub(super) fn cover(size: [f64; 2], cell: f64, seed: u64) -> GradientNoise {
    let wavelength = 14.0_f64.min(size[0].min(size[1]) / 2.0);
    GradientNoise::new(seed, BARE, size, [wavelength, 2.0 * cell], 4, 0.5)
}

impl Land {
    /// Levels of sand, path, rock and soil at a position with this slope: the ground is the first kind whose level is
    /// positive.
    fn levels(&self, at: DVec2, slope: f64) -> [f64; LEVELS] {
        // Beyond 100 m the distance does not matter.
        let clearance =
            |course: &Option<Course>| course.as_ref().map_or(100.0, |course| course.clearance(at).min(100.0));
        let [x, y] = self.terrain.size;
        let bare = self.cover.at(at.x + x / 2.0, at.y + y / 2.0) - SOIL;
        let rough = slope - SOIL_SLOPE;
        [SAND - clearance(&self.stream), -clearance(&self.path), slope - ROCK_SLOPE, bare.max(rough)]
    }

    pub fn is_turf(&self, at: DVec2) -> bool {
        self.levels(at, self.terrain.slope(at.x, at.y)).iter().all(|&level| level <= 0.0)
    }

    /// Distance of a point from the edges of path and stream, negative on them.
    pub fn clearance(&self, at: DVec2) -> f64 {
        let courses = [&self.path, &self.stream].into_iter().flatten();
        courses.map(|course| course.clearance(at)).fold(f64::INFINITY, f64::min)
    }
}

pub(super) fn add(glb: &mut Glb, land: &Land) {
    let mut sheet = Sheet::new(land);
    let terrain = &land.terrain;
    let mut triangles: Vec<[u32; 3]> = (0..terrain.cells[1])
        .flat_map(|row| (0..terrain.cells[0]).flat_map(move |column| terrain.triangles(column, row)))
        .collect();
    for level in 0..LEVELS {
        triangles = sheet.cut(&triangles, level);
    }
    let mut kinds = [const { Vec::new() }; LEVELS + 1];
    triangles.into_iter().for_each(|triangle| kinds[sheet.kind(triangle)].push(triangle));
    let [sand, mut path, rock, soil, turf] = kinds;
    let mut ground = [turf, soil, rock, sand];
    let (positions, normals) = sheet.vertices_of(&mut ground);
    let parts: Vec<Primitive> = GROUND
        .iter()
        .zip(&ground)
        .filter(|(_, triangles)| !triangles.is_empty())
        .map(|(&(name, color, reflectance), triangles)| Primitive {
            triangles,
            material: material(glb, name, Look::Matt, color, reflectance),
        })
        .collect();
    let mesh = glb.mesh("Terrain", &positions, Some(&normals), &parts);
    let node = glb.object("Terrain", "terrain", mesh, Placement::HERE);
    glb.root(node);
    if !path.is_empty() {
        let (positions, normals) = sheet.vertices_of(std::slice::from_mut(&mut path));
        let gravel = material(glb, "path", Look::Matt, [0.3, 0.26, 0.2], 0.3);
        let part = Primitive { triangles: &path, material: gravel };
        let mesh = glb.mesh("Path", &positions, Some(&normals), &[part]);
        let node = glb.object("Path", "path", mesh, Placement::HERE);
        glb.root(node);
    }
    add_water(glb, land);
}

/// The vertices of the ground, including those added where its triangles are cut.
struct Sheet {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Levels of sand, path, rock and soil at each vertex, positive where the ground is of that kind.
    levels: Vec<[f32; LEVELS]>,
}

impl Sheet {
    fn new(land: &Land) -> Self {
        let (positions, normals) = (land.terrain.positions(), land.terrain.normals());
        let mut levels = vec![[0.0; LEVELS]; positions.len()];
        let columns = land.terrain.columns();
        parallel::for_each_chunk(&mut levels, columns, |row, levels| {
            for (column, levels) in levels.iter_mut().enumerate() {
                let [_, _, z] = normals[row * columns + column];
                let slope = f64::from((1.0 - z * z).max(0.0).sqrt() / z);
                *levels = land.levels(DVec2::from(land.terrain.place(column, row)), slope).map(|level| level as f32);
            }
        });
        Sheet { positions, normals, levels }
    }

    /// Cuts the triangles on which a level changes its sign.
    fn cut(&mut self, triangles: &[[u32; 3]], level: usize) -> Vec<[u32; 3]> {
        let mut pieces = Vec::with_capacity(triangles.len());
        let mut cuts = HashMap::new();
        for &triangle in triangles {
            let is_inside = triangle.map(|corner| self.levels[corner as usize][level] > 0.0);
            let inside = is_inside.iter().filter(|&&inside| inside).count();
            if inside == 0 || inside == 3 {
                pieces.push(triangle);
                continue;
            }
            // The corner that is alone on its side comes first.
            let first = (0..3).find(|&corner| is_inside[corner] == (inside == 1)).unwrap_or(0);
            let [a, b, c] = [0, 1, 2].map(|corner| triangle[(first + corner) % 3]);
            let mut between = |a: u32, b: u32| {
                let ends = [a.min(b), a.max(b)];
                *cuts.entry(ends).or_insert_with(|| self.between(ends[0], ends[1], level))
            };
            let (ab, ac) = (between(a, b), between(a, c));
            pieces.extend([[a, ab, ac], [ab, b, c], [ab, c, ac]]);
        }
        pieces
    }

    /// The first level that is positive on a triangle that has been cut, or [`LEVELS`].
    fn kind(&self, triangle: [u32; 3]) -> usize {
        let sum = |level: &usize| triangle.iter().map(|&corner| self.levels[corner as usize][*level]).sum::<f32>();
        (0..LEVELS).find(|level| sum(level) > 0.0).unwrap_or(LEVELS)
    }

    /// Adds a vertex on an edge where a level is 0, but not so near the ends that a triangle degenerates.
    fn between(&mut self, a: u32, b: u32, level: usize) -> u32 {
        let [from, to] = [a, b].map(|end| self.levels[end as usize][level]);
        let part = (from / (from - to)).clamp(0.05, 0.95);
        fn mix<const N: usize>(from: [f32; N], to: [f32; N], part: f32) -> [f32; N] {
            std::array::from_fn(|i| from[i] + part * (to[i] - from[i]))
        }
        let (a, b) = (a as usize, b as usize);
        self.positions.push(mix(self.positions[a], self.positions[b], part));
        let normal = Vec3::from(mix(self.normals[a], self.normals[b], part));
        self.normals.push(normal.normalize_or(Vec3::Z).to_array());
        let mut levels = mix(self.levels[a], self.levels[b], part);
        levels[level] = 0.0;
        self.levels.push(levels);
        self.positions.len() as u32 - 1
    }

    /// Positions and normals of the vertices that triangles use, which are renumbered.
    fn vertices_of(&self, parts: &mut [Vec<[u32; 3]>]) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let mut numbers = vec![u32::MAX; self.positions.len()];
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for corner in parts.iter_mut().flat_map(|part| part.as_flattened_mut()) {
            let index = *corner as usize;
            if numbers[index] == u32::MAX {
                numbers[index] = positions.len() as u32;
                positions.push(self.positions[index]);
                normals.push(self.normals[index]);
            }
            *corner = numbers[index];
        }
        (positions, normals)
    }
}

/// The surface of the stream: a ribbon that ends in its banks.
fn add_water(glb: &mut Glb, land: &Land) {
    /// How far it reaches into the banks, m.
    const BEYOND: f64 = 0.25;
    let Some(stream) = &land.stream else { return };
    let stations = &stream.stations;
    let mut positions = Vec::new();
    for (number, station) in stations.iter().enumerate() {
        let ahead = stations[(number + 1).min(stations.len() - 1)].at - stations[number.saturating_sub(1)].at;
        let side = ahead.perp().normalize_or(DVec2::Y) * (station.half_width + BEYOND);
        for at in [station.at + side, station.at - side] {
            // It stops at the edge of the land.
            let half = DVec2::from(land.terrain.size) / 2.0;
            positions.push(at.clamp(-half, half).extend(station.level).as_vec3().to_array());
        }
    }
    let count = stations.len() as u32;
    let quads = (1..count).flat_map(|next| {
        let [a, b, c, d] = [2 * next - 2, 2 * next - 1, 2 * next + 1, 2 * next];
        [[a, b, c], [a, c, d]]
    });
    let triangles: Vec<[u32; 3]> = quads.collect();
    // Water reflects 2 % of the light of a near-infrared laser and absorbs most of the rest.
    let water = material(glb, "water", Look::Sheet, [0.02, 0.05, 0.055], 0.02);
    let mesh = glb.mesh("Stream", &positions, None, &[Primitive { triangles: &triangles, material: water }]);
    let node = glb.object("Stream", "water", mesh, Placement::HERE);
    glb.root(node);
}
