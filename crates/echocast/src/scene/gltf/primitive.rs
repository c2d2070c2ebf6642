//! Meshes: primitives to parts.

use super::accessor::Accessors;
use super::material::Materials;
use super::{Document, Notes, place};
use crate::error::Result;
use crate::scene::mesh::{is_degenerate, normals_are_flat};
use crate::scene::{Mesh, Part};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};
use std::collections::HashMap;
use std::sync::Arc;

/// Reads the meshes that nodes ask for, each once; data that primitives share is decoded once.
pub(super) struct Meshes<'a> {
    pub document: &'a Document<'a>,
    pub accessors: &'a Accessors<'a>,
    pub materials: Materials,
    pub notes: Notes,
    /// Meshes read so far.
    pub list: Vec<Arc<Mesh>>,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    pub cache: Cache,
}

/// Vectors that several parts may use.
type Shared<const N: usize> = Arc<Vec<[f32; N]>>;

/// What has been decoded, by accessor.
#[derive(Default)]
pub(super) struct Cache {
    /// Index in `Meshes::list`; `None`: nothing to scan in it.
    meshes: HashMap<usize, Option<usize>>,
    positions: HashMap<usize, Shared<3>>,
    triangles: HashMap<TriangleKey, Triangles>,
    normals: HashMap<(usize, TriangleKey), Option<Shared<3>>>,
    uvs: HashMap<usize, Shared<2>>,
    colors: HashMap<usize, VertexColors>,
}

/// What a triangle list is made of: accessors of positions and indices, and the mode.
type TriangleKey = (usize, Option<usize>, u32);

#[derive(Clone)]
struct Triangles {
    kept: Arc<Vec<[u32; 3]>>,
    /// How many were left out because they have no area.
    degenerate: usize,
}

/// `COLOR_0` of a primitive.
#[derive(Clone, Copy)]
enum VertexColors {
    /// The same linear colour at every vertex.
    Constant([f32; 4]),
    /// Cannot be kept.
    Varying,
}

impl Meshes<'_> {
    /// Index in `list` of the file's mesh `index`; `None` if it has nothing to scan.
    pub fn get(&mut self, index: usize) -> Result<Option<usize>> {
        if let Some(&known) = self.cache.meshes.get(&index) {
            return Ok(known);
        }
        let document = self.document;
        let source = &document.json.meshes[index];
        let here = place("mesh", index, source.name.as_deref());
        let mut parts = Vec::new();
        for (number, primitive) in source.primitives.iter().enumerate() {
            let here = format!("{here} primitive {number}");
            parts.extend(self.part(primitive, &here).map_err(|message| document.error(&here, message))?);
        }
        let read = (!parts.is_empty()).then(|| {
            let name = source.name.clone().unwrap_or_else(|| format!("mesh_{index}"));
            self.list.push(Arc::new(Mesh { name, parts }));
            self.list.len() - 1
        });
        self.cache.meshes.insert(index, read);
        Ok(read)
    }

    /// A primitive as a part; `None` if it has no triangle.
    fn part(&mut self, primitive: &Primitive, here: &str) -> Result<Option<Part>, String> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) => {
                self.notes.add("points and lines are skipped", || here.to_owned());
                return Ok(None);
            }
            Checked::Invalid => return Err("its mode is unknown; allowed: 0 to 6".into()),
        };
        let Some(position) = attribute(primitive, Semantic::Positions) else {
            self.notes.add("primitives without positions are skipped", || here.to_owned());
            return Ok(None);
        };
        let material = primitive.material.map(|index| index.value());
        let known = self.document.json.materials.len();
        if let Some(missing) = material.filter(|&index| index >= known) {
            return Err(format!("its material {missing} does not exist: the file has {known}"));
        }

        let positions = self.positions(position)?;
        let key = (position.value(), primitive.indices.map(|index| index.value()), mode.as_gl_enum());
        let Triangles { kept: triangles, degenerate } =
            self.triangles(key, primitive.indices, mode, &positions, here)?;
        self.degenerate_triangles += degenerate;
        if triangles.is_empty() {
            return Ok(None);
        }
        let normals = match attribute(primitive, Semantic::Normals) {
            Some(normal) => self.normals(normal, key, &positions, &triangles, here)?,
            None => None,
        };
        let uvs = match self.materials.set_of(material) {
            Some(set) => self.uvs(attribute(primitive, Semantic::TexCoords(set)), positions.len(), here)?,
            None => None,
        };
        let color = attribute(primitive, Semantic::Colors(0)).map(|color| self.colors(color, positions.len()));
        let material = match color.transpose()? {
            Some(VertexColors::Constant(color)) if color != [1.0; 4] => Some(self.materials.tint(material, color)),
            Some(VertexColors::Varying) => {
                self.notes.add("vertex colours that change over a primitive are not used", || here.to_owned());
                material
            }
            Some(VertexColors::Constant(_)) | None => material,
        };
        Ok(Some(Part { positions, normals, uvs, triangles, material }))
    }

    fn positions(&mut self, index: Index<Accessor>) -> Result<Shared<3>, String> {
        if let Some(known) = self.cache.positions.get(&index.value()) {
            return Ok(known.clone());
        }
        let positions = self.accessors.vectors::<3>(index).map_err(|message| format!("POSITION: {message}"))?;
        if let Some(vertex) = positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(format!("vertex {vertex} is {:?}; allowed: finite numbers", positions[vertex]));
        }
        let positions = Arc::new(positions);
        self.cache.positions.insert(index.value(), positions.clone());
        Ok(positions)
    }

    fn triangles(
        &mut self,
        key: TriangleKey,
        indices: Option<Index<Accessor>>,
        mode: Mode,
        positions: &[[f32; 3]],
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
        triangles.retain(|corners| {
            let [a, b, c] = corners.map(|corner| positions[corner as usize]);
            !is_degenerate(a, b, c)
        });
        let read = Triangles { degenerate: all - triangles.len(), kept: Arc::new(triangles) };
        self.cache.triangles.insert(key, read.clone());
        Ok(read)
    }

    /// Unit normals; `None` where they are flat or useless.
    fn normals(
        &mut self,
        index: Index<Accessor>,
        triangle_key: TriangleKey,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
        here: &str,
    ) -> Result<Option<Shared<3>>, String> {
        let key = (index.value(), triangle_key);
        if let Some(known) = self.cache.normals.get(&key) {
            return Ok(known.clone());
        }
        let mut normals = self.accessors.vectors::<3>(index).map_err(|message| format!("NORMAL: {message}"))?;
        same_count("NORMAL", normals.len(), positions.len())?;
        let mut usable = true;
        for normal in &mut normals {
            match glam::Vec3::from(*normal).try_normalize() {
                Some(unit) => *normal = unit.to_array(),
                None => usable = false,
            }
        }
        if !usable {
            self.notes.add("normals of no length are not used, the surface is flat-shaded", || here.to_owned());
        }
        let normals = (usable && !normals_are_flat(positions, &normals, triangles)).then(|| Arc::new(normals));
        self.cache.normals.insert(key, normals.clone());
        Ok(normals)
    }

    fn uvs(
        &mut self,
        index: Option<Index<Accessor>>,
        vertices: usize,
        here: &str,
    ) -> Result<Option<Shared<2>>, String> {
        let Some(index) = index else {
            self.notes.add("textures are not used where texture coordinates are missing", || here.to_owned());
            return Ok(None);
        };
        let uvs = match self.cache.uvs.get(&index.value()) {
            Some(known) => known.clone(),
            None => Arc::new(self.accessors.vectors::<2>(index).map_err(|message| format!("TEXCOORD: {message}"))?),
        };
        same_count("TEXCOORD", uvs.len(), vertices)?;
        self.cache.uvs.insert(index.value(), uvs.clone());
        Ok(Some(uvs))
    }

    fn colors(&mut self, index: Index<Accessor>, vertices: usize) -> Result<VertexColors, String> {
        let fault = |message: String| format!("COLOR_0: {message}");
        let described = self.accessors.describe(index).map_err(fault)?;
        same_count("COLOR_0", usize::try_from(described.count.0).unwrap_or(usize::MAX), vertices)?;
        if let Some(&known) = self.cache.colors.get(&index.value()) {
            return Ok(known);
        }
        let constant = if described.type_ == Checked::Valid(Type::Vec3) {
            constant(&self.accessors.vectors::<3>(index).map_err(fault)?).map(|[r, g, b]| [r, g, b, 1.0])
        } else {
            constant(&self.accessors.vectors::<4>(index).map_err(fault)?)
        };
        let colors = constant.map_or(VertexColors::Varying, VertexColors::Constant);
        self.cache.colors.insert(index.value(), colors);
        Ok(colors)
    }
}

/// The accessor of an attribute.
fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<Index<Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
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

fn same_count(what: &str, found: usize, vertices: usize) -> Result<(), String> {
    if found == vertices { Ok(()) } else { Err(format!("{what} has {found} elements for {vertices} vertices")) }
}

/// The colour that all vertices have, clamped to 0..1.
fn constant<const N: usize>(colors: &[[f32; N]]) -> Option<[f32; N]> {
    let first = *colors.first()?;
    let usable = first.iter().all(|channel| channel.is_finite()) && colors.iter().all(|color| *color == first);
    usable.then(|| first.map(|channel| channel.clamp(0.0, 1.0)))
}
