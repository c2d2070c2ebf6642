//! Meshes: primitives to parts.

use super::accessor::{Accessors, SharedVectors, attribute, same_count};
use super::deform::{GltfDeformations, GltfForm};
use super::material::GltfMaterials;
use super::{GltfDocument, Notes, place};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};
use ground::array::Array;
use ground::error::Result;
use model::motion::{PartVertices, Vertices};
use model::{Mesh, Part, beyond_reach, is_degenerate, normals_are_flat, share_vertices};
use std::collections::HashMap;
use std::sync::Arc;

/// Reads the meshes that nodes use, each once; data that primitives share is decoded once.
pub(super) struct GltfMeshes<'a> {
    pub document: &'a GltfDocument<'a>,
    pub accessors: &'a Accessors<'a>,
    pub materials: GltfMaterials<'a>,
    pub notes: Notes,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    deformations: GltfDeformations<'a>,
    cache: AccessorCache,
}

/// A mesh as modelled.
#[derive(Clone)]
pub(super) struct GltfModelled {
    pub mesh: Arc<Mesh>,
    /// The deforming vertices, part by part; empty for a mesh that does not deform.
    pub vertices: Arc<Vertices>,
}

/// Decoded data, by accessor.
#[derive(Default)]
struct AccessorCache {
    /// `None`: nothing to scan in it.
    meshes: HashMap<(usize, GltfForm), Option<GltfModelled>>,
    positions: HashMap<usize, SharedVectors<3>>,
    triangles: HashMap<TriangleKey, Triangles>,
    /// Unit normals; `None`: some have zero length.
    normals: HashMap<usize, Option<SharedVectors<3>>>,
    uvs: HashMap<usize, SharedVectors<2>>,
    /// Normals and texture coordinates in the parts' form.
    part_normals: HashMap<(usize, TriangleKey), Option<SharedVectors<3>>>,
    part_uvs: HashMap<(usize, TriangleKey), SharedVectors<2>>,
    colors: HashMap<usize, VertexColors>,
    /// Alpha of vertex colours in the parts' form.
    part_alphas: HashMap<(usize, TriangleKey), Array<f32>>,
}

/// What a triangle list is made from: accessors of positions and indices, the mode, and whether the part deforms.
type TriangleKey = (usize, Option<usize>, u32, bool);

#[derive(Clone)]
struct Triangles {
    kept: Array<[u32; 3]>,
    /// The vertices that `kept` indexes.
    positions: SharedVectors<3>,
    /// Which of the accessor's vertices those are; `None`: all, in order.
    used: Option<Arc<Vec<u32>>>,
    /// How many vertices the accessor has.
    vertices: usize,
    /// How many triangles were left out because they have no area.
    degenerate: usize,
}

/// `COLOR_0` of a primitive.
#[derive(Clone)]
struct VertexColors {
    /// The linear colour of every vertex; `None`: they differ, which is not supported.
    color: Option<[f32; 3]>,
    alpha: VertexAlpha,
}

#[derive(Clone)]
enum VertexAlpha {
    /// The same at every vertex.
    Constant(f32),
    Varying(Array<f32>),
}

impl<'a> GltfMeshes<'a> {
    pub fn new(
        document: &'a GltfDocument<'a>,
        accessors: &'a Accessors<'a>,
        materials: GltfMaterials<'a>,
        notes: Notes,
    ) -> Self {
        let (deformations, cache) = (GltfDeformations::new(accessors), AccessorCache::default());
        GltfMeshes { document, accessors, materials, notes, degenerate_triangles: 0, deformations, cache }
    }

    /// The file's mesh `index`; `None` if it has nothing to scan.
    pub fn get(&mut self, index: usize, form: GltfForm) -> Result<Option<GltfModelled>> {
        if let Some(known) = self.cache.meshes.get(&(index, form)) {
            return Ok(known.clone());
        }
        let document = self.document;
        let source = &document.json.meshes[index];
        let here = place("mesh", index, source.name.as_deref());
        let (mut parts, mut vertices) = (Vec::new(), Vertices::default());
        for (number, primitive) in source.primitives.iter().enumerate() {
            let here = format!("{here} primitive {number}");
            if let Some((part, deforming)) = self.part(primitive, form, &here)? {
                parts.push(part);
                vertices.parts.extend(deforming);
            }
        }
        let read = (!parts.is_empty()).then(|| {
            let name = source.name.clone().unwrap_or_else(|| format!("mesh_{index}"));
            GltfModelled { mesh: Arc::new(Mesh::trusted(name, parts)), vertices: Arc::new(vertices) }
        });
        self.cache.meshes.insert((index, form), read.clone());
        Ok(read)
    }

    /// A primitive as a part, with its vertices if they deform; `None` if it has no triangle.
    fn part(
        &mut self,
        primitive: &Primitive,
        form: GltfForm,
        here: &str,
    ) -> Result<Option<(Part, Option<PartVertices>)>> {
        let document = self.document;
        let fault = |message: String| document.error(here, message);
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) => {
                self.notes.add("points and lines are skipped", || here.to_owned());
                return Ok(None);
            }
            Checked::Invalid => return Err(fault("its mode is unknown; allowed: 0 to 6".into())),
        };
        let Some(position) = attribute(primitive, Semantic::Positions) else {
            self.notes.add("primitives without positions are skipped", || here.to_owned());
            return Ok(None);
        };
        let material = primitive.material.map(|index| index.value());
        let known = document.json.materials.len();
        if let Some(missing) = material.filter(|&index| index >= known) {
            return Err(fault(format!("its material {missing} does not exist: the file has {known}")));
        }

        let key = (position.value(), primitive.indices.map(|index| index.value()), mode.as_gl_enum(), form.deforms());
        let vertices = self.positions(position).map_err(fault)?;
        let triangles = self.triangles(key, primitive.indices, mode, &vertices, here).map_err(fault)?;
        self.degenerate_triangles += triangles.degenerate;
        if triangles.kept.is_empty() {
            return Ok(None);
        }
        let normals = match attribute(primitive, Semantic::Normals) {
            Some(normal) => self.normals(normal, key, vertices.len(), &triangles, here).map_err(fault)?,
            None => None,
        };
        let set = match material {
            Some(index) => self.materials.texture_set(index, &mut self.notes)?,
            None => None,
        };
        let uvs = match set.map(|set| attribute(primitive, Semantic::TexCoords(set))) {
            Some(uvs) => self.uvs(uvs, key, vertices.len(), &triangles, here).map_err(fault)?,
            None => None,
        };
        let (mut material, mut alphas) = (material, None);
        if let Some(index) = attribute(primitive, Semantic::Colors(0)) {
            let VertexColors { color, alpha } = self.colors(index, vertices.len()).map_err(fault)?;
            if color.is_none() {
                self.notes.add("vertex colours that change over a primitive are not used", || here.to_owned());
            }
            let alpha = match alpha {
                VertexAlpha::Constant(alpha) => alpha,
                VertexAlpha::Varying(all) => {
                    // Rules may later give alpha a meaning.
                    alphas = Some(self.alphas(index, key, &all, &triangles).map_err(fault)?);
                    1.0
                }
            };
            let [r, g, b] = color.unwrap_or([1.0; 3]);
            if [r, g, b, alpha] != [1.0; 4] {
                material = Some(self.materials.tint(material, [r, g, b, alpha]));
            }
        }
        let material = material.map(|index| self.materials.get(index));
        let mut deforming = None;
        if form.deforms() {
            let mut vertices = PartVertices {
                positions: triangles.positions.clone(),
                normals: normals.clone(),
                ..PartVertices::default()
            };
            let used = (triangles.used.as_deref(), triangles.vertices);
            self.deformations.add_to(&mut vertices, primitive, form, used, &mut self.notes, here).map_err(fault)?;
            deforming = Some(vertices);
        }
        let part = Part::default().positions(triangles.positions).normals(normals).uvs(uvs).alphas(alphas);
        let part = part.triangles(triangles.kept).material(material);
        Ok(Some((part, deforming)))
    }

    fn positions(&mut self, index: Index<Accessor>) -> Result<SharedVectors<3>, String> {
        if let Some(known) = self.cache.positions.get(&index.value()) {
            return Ok(known.clone());
        }
        let positions = self.accessors.vectors::<3>(index).map_err(|message| format!("POSITION: {message}"))?;
        if let Some(vertex) = beyond_reach(&positions) {
            return Err(format!("vertex {vertex} is {:?}; allowed: -1e18 to 1e18", positions[vertex]));
        }
        let positions = SharedVectors::from(positions);
        self.cache.positions.insert(index.value(), positions.clone());
        Ok(positions)
    }

    fn triangles(
        &mut self,
        key: TriangleKey,
        indices: Option<Index<Accessor>>,
        mode: Mode,
        positions: &SharedVectors<3>,
        here: &str,
    ) -> Result<Triangles, String> {
        if let Some(known) = self.cache.triangles.get(&key) {
            return Ok(known.clone());
        }
        let count = positions.len();
        let corners = match indices {
            Some(index) => {
                let corners = self.accessors.indices(index).map_err(|message| format!("indices: {message}"))?;
                if let Some(past) = corners.iter().find(|&&corner| corner as usize >= count) {
                    return Err(format!("index {past} is past the last of {count} vertices"));
                }
                corners
            }
            None => {
                let last =
                    u32::try_from(count).map_err(|_| format!("it has {count} vertices; allowed: {}", u32::MAX))?;
                self.accessors.charge(count * size_of::<u32>())?;
                (0..last).collect()
            }
        };
        if mode == Mode::Triangles && corners.len() % 3 != 0 {
            self.notes.add("corners left over after the last whole triangle are skipped", || here.to_owned());
        }
        let mut triangles = assemble(mode, &corners);
        drop(corners);
        self.accessors.charge(triangles.len() * size_of::<[u32; 3]>())?;
        let all = triangles.len();
        let places: &[[f32; 3]] = positions;
        let (.., deforms) = key;
        triangles.retain(|&[a, b, c]| {
            // Deforming triangles may gain area, unless two of their corners are the same vertex.
            let opens = deforms && a != b && b != c && c != a;
            opens || !is_degenerate(places[a as usize], places[b as usize], places[c as usize])
        });
        let degenerate = all - triangles.len();
        let used = used_vertices(&mut triangles, count).map(Arc::new);
        self.accessors.charge(used.as_ref().map_or(0, |used| used.len() * size_of::<u32>()))?;
        let positions = self.accessors.pick(positions, used.as_deref())?;
        let read = Triangles { kept: triangles.into(), positions, used, vertices: count, degenerate };
        self.cache.triangles.insert(key, read.clone());
        Ok(read)
    }

    /// Unit normals of a part; `None` if they are flat or unusable. `vertices` is the length of the accessors.
    fn normals(
        &mut self,
        index: Index<Accessor>,
        triangle_key: TriangleKey,
        vertices: usize,
        triangles: &Triangles,
        here: &str,
    ) -> Result<Option<SharedVectors<3>>, String> {
        let key = (index.value(), triangle_key);
        if let Some(known) = self.cache.part_normals.get(&key) {
            return Ok(known.clone());
        }
        let fault = |message: String| format!("NORMAL: {message}");
        let described = self.accessors.describe(index).map_err(fault)?;
        same_count("NORMAL", described, vertices)?;
        let all = match self.cache.normals.get(&index.value()) {
            Some(known) => known.clone(),
            None => {
                let read = self.accessors.vectors::<3>(index).map_err(fault)?;
                // The squares of short normals are too small for single precision.
                let unit = |normal| Some(glam::Vec3::from(normal).as_dvec3().try_normalize()?.as_vec3().to_array());
                let units: Option<Vec<_>> = read.into_iter().map(unit).collect();
                let units = units.map(SharedVectors::from);
                self.cache.normals.insert(index.value(), units.clone());
                units
            }
        };
        if all.is_none() {
            self.notes.add("normals of zero length are not used, the surface is flat-shaded", || here.to_owned());
        }
        let picked = all.map(|all| self.accessors.pick(&all, triangles.used.as_deref())).transpose()?;
        let normals = picked.filter(|normals| {
            // Deforming parts are flat-shaded only where neighbours share no normals: a flat sheet may roll up.
            let (.., deforms) = triangle_key;
            deforms && share_vertices(&triangles.kept, normals.len())
                || !normals_are_flat(&triangles.positions, normals, &triangles.kept)
        });
        self.cache.part_normals.insert(key, normals.clone());
        Ok(normals)
    }

    /// Texture coordinates of a part. `vertices` is the length of the accessors.
    fn uvs(
        &mut self,
        index: Option<Index<Accessor>>,
        triangle_key: TriangleKey,
        vertices: usize,
        triangles: &Triangles,
        here: &str,
    ) -> Result<Option<SharedVectors<2>>, String> {
        let Some(index) = index else {
            self.notes.add("textures are not used where texture coordinates are missing", || here.to_owned());
            return Ok(None);
        };
        let key = (index.value(), triangle_key);
        if let Some(known) = self.cache.part_uvs.get(&key) {
            return Ok(Some(known.clone()));
        }
        let fault = |message: String| format!("TEXCOORD: {message}");
        same_count("TEXCOORD", self.accessors.describe(index).map_err(fault)?, vertices)?;
        let all = match self.cache.uvs.get(&index.value()) {
            Some(known) => known.clone(),
            None => self.accessors.vectors::<2>(index).map_err(fault)?.into(),
        };
        self.cache.uvs.insert(index.value(), all.clone());
        let uvs = self.accessors.pick(&all, triangles.used.as_deref())?;
        self.cache.part_uvs.insert(key, uvs.clone());
        Ok(Some(uvs))
    }

    fn colors(&mut self, index: Index<Accessor>, vertices: usize) -> Result<VertexColors, String> {
        let fault = |message: String| format!("COLOR_0: {message}");
        let described = self.accessors.describe(index).map_err(fault)?;
        same_count("COLOR_0", described, vertices)?;
        if let Some(known) = self.cache.colors.get(&index.value()) {
            return Ok(known.clone());
        }
        let colors = if described.type_ == Checked::Valid(Type::Vec3) {
            let all = self.accessors.vectors::<3>(index).map_err(fault)?;
            VertexColors { color: constant(&all), alpha: VertexAlpha::Constant(1.0) }
        } else {
            let all = self.accessors.vectors::<4>(index).map_err(fault)?;
            self.accessors.charge(all.len() * size_of::<f32>()).map_err(fault)?;
            let alphas: Vec<f32> = all.iter().map(|color| color[3].clamp(0.0, 1.0)).collect();
            let alpha = match alphas.split_first() {
                Some((first, others)) if others.iter().any(|other| other != first) => {
                    VertexAlpha::Varying(alphas.into())
                }
                first => VertexAlpha::Constant(first.map_or(1.0, |(first, _)| *first)),
            };
            let colors: Vec<[f32; 3]> = all.into_iter().map(|[r, g, b, _]| [r, g, b]).collect();
            VertexColors { color: constant(&colors), alpha }
        };
        self.cache.colors.insert(index.value(), colors.clone());
        Ok(colors)
    }

    /// The alpha of the vertices of a part, picked from `all`, the values of the accessor `index`.
    fn alphas(
        &mut self,
        index: Index<Accessor>,
        triangle_key: TriangleKey,
        all: &Array<f32>,
        triangles: &Triangles,
    ) -> Result<Array<f32>, String> {
        let key = (index.value(), triangle_key);
        if let Some(known) = self.cache.part_alphas.get(&key) {
            return Ok(known.clone());
        }
        let alphas = self.accessors.pick(all, triangles.used.as_deref())?;
        self.cache.part_alphas.insert(key, alphas.clone());
        Ok(alphas)
    }
}

/// Corners to triangles (glTF 2.0, 3.7.2.1).
fn assemble(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let in_turn = |(i, c): (usize, &[u32])| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] };
            corners.windows(3).enumerate().map(in_turn).collect()
        }
        Mode::TriangleFan => {
            let Some((&first, rim)) = corners.split_first() else { return Vec::new() };
            rim.windows(2).map(|edge| [edge[0], edge[1], first]).collect()
        }
        _ => corners.as_chunks().0.to_vec(),
    }
}

/// The vertices that `triangles` use, ascending, if fewer than half of `vertices`: `triangles` then index them. A part
/// must not carry a buffer that hundreds of parts share; it is copied for each when the scene is built.
fn used_vertices(triangles: &mut [[u32; 3]], vertices: usize) -> Option<Vec<u32>> {
    // Closed meshes have two triangles per vertex: with that many, counting is not needed.
    if triangles.len() >= vertices {
        return None;
    }
    let mut used: Vec<u32> = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    if used.len() >= vertices.div_ceil(2) {
        return None;
    }
    used.shrink_to_fit();
    for corner in triangles.as_flattened_mut() {
        *corner = used.partition_point(|vertex| vertex < corner) as u32;
    }
    Some(used)
}

/// The colour shared by all vertices, clamped to 0..1.
fn constant<const N: usize>(colors: &[[f32; N]]) -> Option<[f32; N]> {
    let first = *colors.first()?;
    let usable = first.iter().all(|channel| channel.is_finite()) && colors.iter().all(|color| *color == first);
    usable.then(|| first.map(|channel| channel.clamp(0.0, 1.0)))
}
