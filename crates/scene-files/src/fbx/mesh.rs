//! Meshes: polygons to parts of one material each.

use super::FbxDocument;
use super::deform::{FbxForm, deforming};
use super::material::FbxMaterials;
use crate::faces::polygon::{check_budget, triangulate};
use crate::notes::Notes;
use glam::{DVec3, Vec3};
use ground::error::Result;
use ground::shown;
use model::motion::{PartVertices, Vertices};
use model::{Mesh, Part, VertexSource, is_degenerate, normals_are_flat, share_vertices, within_reach};
use std::collections::HashMap;
use std::sync::Arc;

/// Most vertices at one position that are compared before a corner gets a vertex of its own: beyond that, sharing gains
/// little, and a million corners at one point must not be compared with each other.
const LONGEST_SEARCH: usize = 16;

/// Memory for a corner while its mesh is read, and afterwards for its vertex.
const CORNER_BYTES: usize = 64;

const NONE: u32 = u32::MAX;

/// Reads the meshes that nodes use, each once per set of materials.
pub(super) struct FbxMeshes<'a> {
    pub document: &'a FbxDocument<'a>,
    pub materials: FbxMaterials<'a>,
    pub notes: Notes,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    /// Whether the sources of vertices are recorded.
    traced: bool,
    /// By the numbers of the mesh and of its materials. `None`: nothing to scan in it.
    known: HashMap<(u32, Vec<Option<u32>>), Option<FbxModelled>>,
    /// Remaining budget of [`triangulate`].
    checks_left: usize,
}

/// A mesh as modelled.
#[derive(Clone)]
pub(super) struct FbxModelled {
    pub mesh: Arc<Mesh>,
    /// The deforming vertices, part by part; empty for a mesh that does not deform.
    pub vertices: Arc<Vertices>,
    /// The origin of `mesh` in the file's coordinates of the mesh: relative to it `f32` preserves `f64` coordinates.
    pub middle: DVec3,
}

/// Builds the parts of a mesh, one per material.
struct FbxPartMaker<'a> {
    mesh: &'a ufbx::Mesh,
    middle: DVec3,
    /// For every vertex of the file the part that used it last (counted from 1) and its newest vertex there.
    newest: Vec<[u32; 2]>,
    parts: u32,
    degenerate: usize,
    tangled: usize,
    /// Faces of one or two corners.
    lines: usize,
    checks_left: usize,
}

/// A part, and the file's vertex that each of its vertices comes from.
pub(super) struct FbxPart {
    pub part: Part,
    pub sources: Vec<u32>,
}

impl<'a> FbxMeshes<'a> {
    pub fn new(document: &'a FbxDocument<'a>, materials: FbxMaterials<'a>, notes: Notes) -> Self {
        let corners = document.file.meshes.as_ref().iter().map(|mesh| mesh.num_indices).sum();
        let traced = materials.options.keeps_sources;
        let (known, checks_left) = (HashMap::new(), check_budget(corners));
        FbxMeshes { document, materials, notes, degenerate_triangles: 0, traced, known, checks_left }
    }

    /// The mesh of a node; `None` if it has nothing to scan.
    pub fn get(&mut self, node: &'a ufbx::Node, mesh: &'a ufbx::Mesh, form: FbxForm) -> Result<Option<FbxModelled>> {
        let slots = mesh.material_parts.len();
        let material = |slot: usize| node.materials.as_ref().get(slot).map(|material| &**material);
        let numbers = (0..slots).map(|slot| material(slot).map(|material| material.element.typed_id)).collect();
        let key = (mesh.element.typed_id, numbers);
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let here = format!("mesh {:?}", shown::name(&mesh.element.name));
        let fault = |message: String| self.document.error(&here, message);
        let bytes = mesh.num_indices.saturating_mul(CORNER_BYTES).saturating_add(mesh.num_vertices.saturating_mul(8));
        self.document.budget.charge(bytes).map_err(fault)?;
        let mut maker = FbxPartMaker::new(mesh, self.checks_left).map_err(fault)?;
        let (mut parts, mut vertices, mut sources) = (Vec::new(), Vertices::default(), Vec::new());
        for (slot, of_slot) in mesh.material_parts.iter().enumerate().filter(|(_, part)| part.num_faces > 0) {
            let material = match material(slot) {
                Some(material) => Some(self.materials.get(material, &mut self.notes)?),
                None => None,
            };
            let uvs = material.as_ref().and_then(|(_, set)| set.as_ref()).and_then(|set| uvs(mesh, set));
            let textured = material.as_ref().is_some_and(|(material, _)| material.images().next().is_some());
            if textured && uvs.is_none() {
                self.notes.add("textures are not used where texture coordinates are missing", || here.clone());
            }
            let Some(mut made) = maker.part(&of_slot.face_indices, uvs, form.deforms()) else { continue };
            made.part.material = material.map(|(material, _)| material);
            if form.deforms() {
                let mut vertices_of_part = PartVertices {
                    positions: made.part.positions.clone(),
                    normals: made.part.normals.clone(),
                    ..PartVertices::default()
                };
                deforming(mesh, form, &made.sources, self.document.budget, &mut vertices_of_part).map_err(fault)?;
                vertices.parts.push(vertices_of_part);
            }
            parts.push(made.part);
            sources.push(made.sources);
        }
        self.degenerate_triangles += maker.degenerate;
        self.checks_left = maker.checks_left;
        for (number, what) in [
            (maker.lines, "points and lines are skipped"),
            (maker.tangled, "polygons cross themselves or are folded, the triangles there are a guess"),
        ] {
            if number > 0 {
                self.notes.add(what, || here.clone());
            }
        }
        if mesh.subdivision_display_mode == ufbx::SubdivisionDisplayMode::Smooth {
            self.notes.add("subdivision surfaces are read as the polygons that they are made of", || here.clone());
        }
        let middle = maker.middle;
        let read = (!parts.is_empty()).then(|| {
            let name = mesh.element.name.to_string();
            let name = if name.is_empty() { format!("mesh_{}", mesh.element.typed_id) } else { name };
            let source = VertexSource { vertices: sources, count: mesh.num_vertices, origin: middle };
            let source = self.traced.then(|| Arc::new(source));
            let mesh = Arc::new(Mesh { source, ..Mesh::trusted(name, parts) });
            FbxModelled { mesh, vertices: Arc::new(vertices), middle }
        });
        self.known.insert(key, read.clone());
        Ok(read)
    }
}

/// The texture coordinate set named `set`, else the first.
fn uvs<'a>(mesh: &'a ufbx::Mesh, set: &str) -> Option<&'a ufbx::VertexVec2> {
    let sets = &mesh.uv_sets;
    let found = sets.iter().find(|known| !set.is_empty() && known.name.as_ref() == set).or(sets.first());
    found.map(|found| &found.vertex_uv).filter(|uvs| uvs.exists)
}

impl<'a> FbxPartMaker<'a> {
    fn new(mesh: &'a ufbx::Mesh, checks_left: usize) -> Result<FbxPartMaker<'a>, String> {
        if let Some(bad) = mesh.vertices.iter().position(|&vertex| !within_reach(&super::vector(vertex))) {
            let found = super::vector(mesh.vertices[bad]).to_array();
            return Err(format!("vertex {bad} is {found:?}; allowed: -1e18 to 1e18"));
        }
        let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
        for &vertex in &mesh.vertex_indices {
            let position = super::vector(mesh.vertices[vertex as usize]);
            (low, high) = (low.min(position), high.max(position));
        }
        let middle = if mesh.vertex_indices.is_empty() { DVec3::ZERO } else { ((low + high) / 2.0).round() };
        let newest = vec![[0; 2]; mesh.num_vertices];
        Ok(FbxPartMaker { mesh, middle, newest, parts: 0, degenerate: 0, tangled: 0, lines: 0, checks_left })
    }

    /// Some faces as a part; `None` if no triangle has area.
    fn part(&mut self, faces: &[u32], uvs: Option<&ufbx::VertexVec2>, deforms: bool) -> Option<FbxPart> {
        let triangles = self.triangles(faces, deforms);
        if triangles.is_empty() {
            return None;
        }
        let has_normals = self.mesh.vertex_normal.exists;
        let smooth = has_normals
            && (deforms
                || triangles.iter().any(|triangle| {
                    let points = triangle.map(|corner| self.local(corner));
                    let normals = triangle.map(|corner| self.normal(corner).unwrap_or_else(|| face_normal(points)));
                    !normals_are_flat(&points, &normals, &[[0, 1, 2]])
                }));
        let mut made = self.weld(&triangles, smooth, uvs);
        // Deforming parts are flat-shaded only where neighbours share no normals: a flat sheet may roll up.
        if deforms && !share_vertices(&made.part.triangles, made.part.positions.len()) {
            made.part.normals = None;
        }
        Some(made)
    }

    /// Corners of the triangles of `faces` that have area.
    fn triangles(&mut self, faces: &[u32], deforms: bool) -> Vec<[u32; 3]> {
        let mut triangles = Vec::with_capacity(2 * faces.len());
        let mut points = Vec::new();
        let (mut degenerate, mut tangled, mut checks_left) = (0, 0, self.checks_left);
        for &face in faces {
            let face = self.mesh.faces[face as usize];
            let (first, count) = (face.index_begin, face.num_indices);
            if count < 3 {
                self.lines += 1;
                continue;
            }
            let mut add = |corners: [u32; 3]| {
                let [a, b, c] = corners.map(|corner| self.local(corner));
                // Deforming triangles may gain area, unless two of their corners are the same vertex.
                let [d, e, f] = corners.map(|corner| self.mesh.vertex_indices[corner as usize]);
                let opens = deforms && d != e && e != f && f != d;
                let kept = opens || !is_degenerate(a, b, c);
                if kept {
                    triangles.push(corners);
                }
                kept
            };
            if count == 3 {
                degenerate += usize::from(!add([first, first + 1, first + 2]));
                continue;
            }
            points.clear();
            points.extend((first..first + count).map(|corner| self.position(corner)));
            let (mut added, mut empty) = (0, 0);
            let simple = triangulate(&points, &mut checks_left, |corners| {
                let kept = add(corners.map(|corner| first + corner as u32));
                added += usize::from(kept);
                empty += usize::from(!kept);
            });
            // A polygon with all corners on one line yields nothing: it counts once.
            degenerate += if added + empty == 0 { 1 } else { empty };
            tangled += usize::from(!simple);
        }
        self.degenerate += degenerate;
        self.tangled += tangled;
        self.checks_left = checks_left;
        triangles
    }

    /// Merges corners with the same position, normal and texture coordinate into one vertex: files have normals for
    /// each corner, mostly without specifying which are the same.
    fn weld(&mut self, triangles: &[[u32; 3]], smooth: bool, uvs: Option<&ufbx::VertexVec2>) -> FbxPart {
        self.parts += 1;
        let (mut positions, mut normals, mut own_uvs) = (Vec::new(), Vec::new(), Vec::new());
        let (mut older, mut sources) = (Vec::new(), Vec::new());
        let mut indices = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            indices.push(triangle.map(|corner| {
                let of_face = || face_normal(triangle.map(|corner| self.local(corner)));
                let normal = if smooth { self.normal(corner).unwrap_or_else(of_face) } else { [0.0; 3] };
                let uv = uvs.map_or([0.0; 2], |uvs| {
                    let uv = uvs[corner as usize];
                    [uv.x as f32, uv.y as f32]
                });
                let source = self.mesh.vertex_indices[corner as usize];
                let [part, newest] = self.newest[source as usize];
                let newest = if part == self.parts { newest } else { NONE };
                let mut vertex = newest;
                for _ in 0..LONGEST_SEARCH {
                    if vertex == NONE {
                        break;
                    }
                    let same_normal = !smooth || normals[vertex as usize] == normal;
                    if same_normal && (uvs.is_none() || own_uvs[vertex as usize] == uv) {
                        return vertex;
                    }
                    vertex = older[vertex as usize];
                }
                let vertex = positions.len() as u32;
                self.newest[source as usize] = [self.parts, vertex];
                older.push(newest);
                sources.push(source);
                positions.push(self.local(corner));
                if smooth {
                    normals.push(normal);
                }
                if uvs.is_some() {
                    own_uvs.push(uv);
                }
                vertex
            }));
        }
        let part = Part::default()
            .positions(positions.into())
            .normals(smooth.then(|| normals.into()))
            .uvs(uvs.map(|_| own_uvs.into()))
            .triangles(indices.into());
        FbxPart { part, sources }
    }

    fn position(&self, corner: u32) -> DVec3 {
        super::vector(self.mesh.vertices[self.mesh.vertex_indices[corner as usize] as usize])
    }

    fn local(&self, corner: u32) -> [f32; 3] {
        (self.position(corner) - self.middle).as_vec3().to_array()
    }

    /// Unit normal of a corner; `None` if it has no direction.
    fn normal(&self, corner: u32) -> Option<[f32; 3]> {
        Some(super::vector(self.mesh.vertex_normal[corner as usize]).try_normalize()?.as_vec3().to_array())
    }
}

/// Unit normal of a triangle; arbitrary if it has no area.
fn face_normal(points: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = points.map(|p| Vec3::from(p).as_dvec3());
    (b - a).cross(c - a).normalize_or(DVec3::Z).as_vec3().to_array()
}
