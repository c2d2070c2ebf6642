//! Faces to parts: polygons become triangles, corners become shared vertices.

use super::polygon::{check_budget, triangulate};
use super::{Corner, Faces, NONE};
use glam::{DVec3, Vec3};
use model::{Part, VertexSource, is_degenerate, normals_are_flat};
use std::mem;
use std::ops::Range;
use std::sync::Arc;

/// Most vertices at one position that are compared before a corner gets a vertex of its own: beyond that, sharing gains
/// little, and a million corners at one point must not be compared with each other.
const LONGEST_SEARCH: usize = 16;

/// Makes parts from the faces of a file.
pub(crate) struct PartMaker<'a> {
    file: &'a Faces,
    /// For every position the part that used it last (counted from 1) and its newest vertex there.
    newest: Vec<[u32; 2]>,
    parts: u32,
    /// Remaining budget of [`triangulate`].
    checks_left: usize,
    /// For each part so far, the file's position that each vertex comes from; `None`: not recorded.
    sources: Option<Vec<Vec<u32>>>,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    /// Polygons that cross themselves.
    pub tangled_polygons: usize,
}

impl<'a> PartMaker<'a> {
    /// For the faces of `file`; `traced`: whether to record the sources of vertices.
    pub fn new(file: &'a Faces, traced: bool) -> Self {
        let newest = vec![[0; 2]; file.positions.len()];
        let checks_left = check_budget(file.corners.len());
        let sources = traced.then(Vec::new);
        PartMaker { file, newest, parts: 0, checks_left, sources, degenerate_triangles: 0, tangled_polygons: 0 }
    }

    /// The centre of the faces of `runs`, rounded to whole units: relative to it `f32` preserves `f64` coordinates.
    pub fn middle(&self, runs: &[Range<usize>]) -> DVec3 {
        let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
        for corner in runs.iter().flat_map(|run| self.file.of(run)).flatten() {
            let p = self.position(corner);
            (low, high) = (low.min(p), high.max(p));
        }
        ((low + high) / 2.0).round()
    }

    /// The faces of `runs`, which share one material, as a part relative to `middle`; `None` if no triangle has area.
    pub fn part(&mut self, runs: &[Range<usize>], middle: DVec3, textured: bool) -> Option<Part> {
        let triangles = self.triangles(runs, middle);
        if triangles.is_empty() {
            return None;
        }
        let smooth = triangles.iter().any(|triangle| {
            if triangle.iter().all(|corner| self.normal(corner).is_none()) {
                return false;
            }
            let points = triangle.map(|corner| self.local(&corner, middle));
            let normals = triangle.map(|corner| self.normal(&corner).unwrap_or_else(|| face_normal(points)));
            !normals_are_flat(&points, &normals, &[[0, 1, 2]])
        });
        let textured = textured && triangles.iter().flatten().any(|corner| self.texcoord(corner).is_some());
        Some(self.weld(&triangles, middle, smooth, textured))
    }

    /// Sources of the vertices of the parts since the last call, which are relative to `origin`; `None`: not recorded.
    pub fn source(&mut self, origin: DVec3) -> Option<Arc<VertexSource>> {
        let vertices = mem::take(self.sources.as_mut()?);
        Some(Arc::new(VertexSource { vertices, count: self.file.positions.len(), origin }))
    }

    /// Corners of the triangles of `runs` that have area.
    fn triangles(&mut self, runs: &[Range<usize>], middle: DVec3) -> Vec<[Corner; 3]> {
        let mut triangles = Vec::with_capacity(runs.iter().map(|run| run.end - run.start).sum());
        let mut points = Vec::new();
        let (mut degenerate, mut tangled, mut checks_left) = (0, 0, self.checks_left);
        let mut add = |triangle: [Corner; 3]| {
            let [a, b, c] = triangle.map(|corner| self.local(&corner, middle));
            let has_area = !is_degenerate(a, b, c);
            if has_area {
                triangles.push(triangle);
            }
            has_area
        };
        for face in runs.iter().flat_map(|run| self.file.of(run)) {
            if let [a, b, c] = *face {
                degenerate += usize::from(!add([a, b, c]));
                continue;
            }
            points.clear();
            points.extend(face.iter().map(|corner| self.position(corner)));
            let (mut added, mut empty) = (0, 0);
            let simple = triangulate(&points, &mut checks_left, |corners| {
                let has_area = add(corners.map(|i| face[i]));
                added += usize::from(has_area);
                empty += usize::from(!has_area);
            });
            // A polygon with all corners on one line yields nothing: it counts once.
            degenerate += if added + empty == 0 { 1 } else { empty };
            tangled += usize::from(!simple);
        }
        self.degenerate_triangles += degenerate;
        self.tangled_polygons += tangled;
        self.checks_left = checks_left;
        triangles
    }

    /// Merges corners with the same position, normal and texture coordinate into one vertex.
    fn weld(&mut self, triangles: &[[Corner; 3]], middle: DVec3, smooth: bool, textured: bool) -> Part {
        self.parts += 1;
        let (mut positions, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
        // For each vertex: the indices that define it, and the previous vertex at its position.
        let (mut keys, mut older) = (Vec::new(), Vec::new());
        let mut source = self.sources.is_some().then(Vec::new);
        let mut indices = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            indices.push(triangle.map(|corner| {
                let normal = if smooth { self.normal(&corner) } else { None };
                let key = [if textured { corner.texcoord } else { NONE }, if smooth { corner.normal } else { NONE }];
                let [part, newest] = self.newest[corner.position as usize];
                let newest = if part == self.parts { newest } else { NONE };
                // In a smooth part, a corner without a normal takes that of its face.
                if !smooth || normal.is_some() {
                    let mut vertex = newest;
                    for _ in 0..LONGEST_SEARCH {
                        if vertex == NONE {
                            break;
                        }
                        if keys[vertex as usize] == key {
                            return vertex;
                        }
                        vertex = older[vertex as usize];
                    }
                }
                let vertex = positions.len() as u32;
                self.newest[corner.position as usize] = [self.parts, vertex];
                keys.push(key);
                older.push(newest);
                positions.push(self.local(&corner, middle));
                source.iter_mut().for_each(|source| source.push(corner.position));
                if smooth {
                    let of_face = || face_normal(triangle.map(|corner| self.local(&corner, middle)));
                    normals.push(normal.unwrap_or_else(of_face));
                }
                if textured {
                    uvs.push(self.texcoord(&corner).unwrap_or_default());
                }
                vertex
            }));
        }
        self.sources.iter_mut().for_each(|sources| sources.extend(source.take()));
        Part::default()
            .positions(positions.into())
            .normals(smooth.then(|| normals.into()))
            .uvs(textured.then(|| uvs.into()))
            .triangles(indices.into())
    }

    fn position(&self, corner: &Corner) -> DVec3 {
        DVec3::from(self.file.positions[corner.position as usize])
    }

    fn local(&self, corner: &Corner, middle: DVec3) -> [f32; 3] {
        (self.position(corner) - middle).as_vec3().to_array()
    }

    fn texcoord(&self, corner: &Corner) -> Option<[f32; 2]> {
        self.file.texcoords.get(corner.texcoord as usize).copied()
    }

    /// Normal of a corner; `None` if it has none or a zero one.
    fn normal(&self, corner: &Corner) -> Option<[f32; 3]> {
        self.file.normals.get(corner.normal as usize).copied().filter(|&normal| normal != [0.0; 3])
    }
}

/// Unit normal of a triangle with area.
fn face_normal(points: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = points.map(|p| Vec3::from(p).as_dvec3());
    (b - a).cross(c - a).normalize().as_vec3().to_array()
}
