//! Triangle meshes, split into parts of one material each.

use super::{LARGEST, Quadric};
use crate::material::Material;
use glam::{DAffine3, DVec3, Vec3};
use ground::array::Array;
use ground::builder;
use ground::error::{Error, Result};
use std::any::Any;
use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex};

builder! {
    /// Triangles with one material.
    #[derive(Clone, Debug, Default)]
    pub struct Part {
        /// Vertex positions, metres, mesh frame. Shared where several parts use the same vertices.
        pub positions: Array<[f32; 3]>,
        /// Unit shading normals per vertex; `None`: the surface is flat-shaded.
        pub normals: Option<Array<[f32; 3]>>,
        /// Texture coordinates per vertex, of the set that the material's base colour texture uses.
        pub uvs: Option<Array<[f32; 2]>>,
        /// Alpha per vertex, which multiplies that of the material where that has an effect; `None`: 1.
        pub alphas: Option<Array<f32>>,
        /// Vertex indices, three per triangle, all in range.
        pub triangles: Array<[u32; 3]>,
        /// What it is made of; `None`: the default material.
        pub material: Option<Arc<Material>>,
        /// Curved surfaces that some of its triangles stand for.
        pub quadrics: Vec<Quadric>,
    }
}

impl Part {
    /// The point of a triangle with the barycentric weights `u` and `v` of its second and third corners.
    #[doc(hidden)]
    pub fn point(&self, triangle: u32, [u, v]: [f32; 2]) -> Vec3 {
        let corner = |index: u32| Vec3::from(self.positions[index as usize]);
        let [a, b, c] = self.triangles[triangle as usize].map(corner);
        a * (1.0 - u - v) + b * u + c * v
    }

    /// Whether its triangles form a closed surface: each edge of each, by the positions of its ends, is an edge of one
    /// other.
    #[doc(hidden)]
    pub fn is_closed(&self) -> bool {
        let place = |index: u32| self.positions[index as usize].map(|value| (value + 0.0).to_bits());
        let mut sides: HashMap<[[u32; 3]; 2], u32> = HashMap::new();
        for corners in self.triangles.iter() {
            let [a, b, c] = corners.map(place);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *sides.entry([from.min(to), from.max(to)]).or_default() += 1;
            }
        }
        !sides.is_empty() && sides.values().all(|number| *number == 2)
    }

    /// Area in the world, m^2, as placed by `world_from_object`.
    #[doc(hidden)]
    pub fn area(&self, world_from_object: &DAffine3) -> f64 {
        let corner = |index: u32| {
            let position = self.positions[index as usize].map(f64::from);
            world_from_object.transform_vector3(DVec3::from(position))
        };
        let double = |&[a, b, c]: &[u32; 3]| {
            let a = corner(a);
            (corner(b) - a).cross(corner(c) - a).length()
        };
        self.triangles.iter().map(double).sum::<f64>() * 0.5
    }

    fn check(&self) -> Result<()> {
        let vertices = self.positions.len();
        if self.triangles.is_empty() {
            return Err(Error::invalid("triangles", "none", "at least one"));
        }
        if let Some(index) = self.triangles.iter().flatten().find(|&&index| index as usize >= vertices) {
            return Err(Error::invalid("index", index, format!("below the number of vertices, {vertices}")));
        }
        if let Some(vertex) = beyond_reach(&self.positions) {
            return Err(Error::invalid(
                format!("vertex {vertex}"),
                format!("{:?}", self.positions[vertex]),
                "-1e18 to 1e18",
            ));
        }
        let lengths = [
            ("normals", self.normals.as_ref().map(|normals| normals.len())),
            ("uvs", self.uvs.as_ref().map(|uvs| uvs.len())),
            ("alphas", self.alphas.as_ref().map(|alphas| alphas.len())),
        ];
        for (name, length) in lengths {
            if length.is_some_and(|length| length != vertices) {
                let found = format!("{} elements long", length.unwrap_or_default());
                return Err(Error::invalid(name, found, format!("as many as vertices, {vertices}")));
            }
        }
        let count = self.triangles.len();
        let is_beyond = |quadric: &&Quadric| quadric.triangles().end > count as u64;
        if let Some(quadric) = self.quadrics.iter().find(is_beyond) {
            let found = format!("of triangles up to {}", quadric.triangles().end);
            return Err(Error::invalid("quadrics", found, format!("as many as there are, {count}")));
        }
        Ok(())
    }

    /// Where a ray that hits a triangle at `near`, in lengths of `direction`, meets the curved surface that it stands for, and
    /// a normal there, of any length; `None`: it stands for none, or the ray passes that.
    #[doc(hidden)]
    pub fn meet(&self, triangle: u32, origin: DVec3, direction: DVec3, near: f64) -> Option<(f64, DVec3)> {
        let own = self.quadrics.iter().find(|quadric| quadric.triangles().contains(&triangle.into()))?;
        // Where two surfaces touch, the one may be met through triangles of the other.
        let beside = || {
            let met = self.quadrics.iter().filter_map(|quadric| quadric.meet(origin, direction, near));
            met.min_by(|a, b| (a.0 - near).abs().total_cmp(&(b.0 - near).abs()))
        };
        own.meet(origin, direction, near).or_else(beside)
    }

    /// Name of its material; empty without one.
    #[doc(hidden)]
    pub fn material_name(&self) -> &str {
        self.material.as_ref().map_or("", |material| &material.name)
    }
}

/// The ray-tracing structure of a mesh by itself, built when tracing first needs it.
#[derive(Default)]
pub struct Structure {
    /// Whether the mesh is one of a sequence.
    pub changing: bool,
    /// What the engine that last needed it has built; `None`: nothing yet.
    pub built: Mutex<Option<Box<dyn Any + Send + Sync>>>,
}

impl Structure {
    /// The structure of a mesh that follows others with different positions.
    #[doc(hidden)]
    pub fn changing() -> Self {
        Structure { changing: true, ..Structure::default() }
    }
}

impl Clone for Structure {
    /// The clone is not built, as its mesh may differ.
    fn clone(&self) -> Self {
        Structure { changing: self.changing, ..Structure::default() }
    }
}

impl fmt::Debug for Structure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Structure")
    }
}

/// A mesh: one or more parts.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file.
    pub name: String,
    /// Its parts, none empty.
    pub parts: Vec<Part>,
    /// What is needed to trace the mesh by itself, as in moving objects.
    #[doc(hidden)]
    pub structure: Structure,
    /// Where its vertices are in the file, if the file has them in another order and a vertex cache may need it.
    #[doc(hidden)]
    pub source: Option<Arc<VertexSource>>,
}

/// Where the vertices of a mesh come from.
#[derive(Debug)]
pub struct VertexSource {
    /// For each part, which of the file's vertices each vertex is, from 0.
    pub vertices: Vec<Vec<u32>>,
    /// Vertices in the file, those of other meshes included.
    pub count: usize,
    /// The origin of the mesh in the file's coordinates.
    pub origin: DVec3,
}

impl Mesh {
    /// A mesh of parts from any source.
    ///
    /// # Errors
    /// No part; one without triangles; a corner past the last vertex; a coordinate that is not finite or beyond 1e18; a
    /// different number of normals, texture coordinates or alphas than vertices.
    pub fn new(name: impl Into<String>, parts: Vec<Part>) -> Result<Mesh> {
        if parts.is_empty() {
            return Err(Error::invalid("parts", "none", "at least one"));
        }
        for (number, part) in parts.iter().enumerate() {
            part.check().map_err(|error| match error {
                Error::InvalidParameter { name, value, allowed } => {
                    Error::InvalidParameter { name: format!("part {number}: {name}"), value, allowed }
                }
                other => other,
            })?;
        }
        Ok(Mesh::trusted(name.into(), parts))
    }

    /// A mesh of already checked parts.
    #[doc(hidden)]
    pub fn trusted(name: String, parts: Vec<Part>) -> Mesh {
        Mesh { name, parts, ..Mesh::default() }
    }

    /// The same mesh as one of several that follow each other with different positions.
    pub fn changing(self) -> Mesh {
        Mesh { structure: Structure::changing(), ..self }
    }

    /// The same mesh, whose vertices come from those of a file.
    #[doc(hidden)]
    pub fn with_source(self, source: Option<Arc<VertexSource>>) -> Mesh {
        Mesh { source, ..self }
    }

    /// Memory of its arrays and, approximately, of what is built from them to trace it, bytes.
    #[doc(hidden)]
    pub fn bytes(&self) -> usize {
        /// Bytes of Embree's structure per triangle.
        const STRUCTURE: usize = 100;
        let of_part = |part: &Part| part.positions.len() * 32 + part.triangles.len() * (12 + STRUCTURE);
        self.parts.iter().map(of_part).sum()
    }

    /// This mesh with its materials replaced by what `made_of` returns, where it returns one.
    #[doc(hidden)]
    pub fn with_materials(&self, made_of: impl Fn(&Arc<Material>) -> Option<Arc<Material>>) -> Mesh {
        let mut mesh = self.clone();
        for part in &mut mesh.parts {
            part.material = part.material.take().map(|material| made_of(&material).unwrap_or(material));
        }
        mesh
    }

    /// This mesh with other vertex positions and, if given, shading normals.
    ///
    /// # Errors
    /// As [`Mesh::new`]; a different number of vertices; parts that do not share their vertices.
    #[doc(hidden)]
    pub fn with_vertices(&self, positions: Array<[f32; 3]>, normals: Option<Array<[f32; 3]>>) -> Result<Mesh> {
        let before = &self.parts[0].positions;
        if !self.parts.iter().all(|part| part.positions.is(before)) {
            let found = "those of a mesh whose parts have vertices of their own";
            return Err(Error::invalid("positions", found, "meshes whose parts share their vertices"));
        }
        if positions.len() != before.len() {
            return Err(Error::invalid("positions", positions.len(), format!("as many as before, {}", before.len())));
        }
        let parts = self.parts.iter().map(|part| Part {
            positions: positions.clone(),
            normals: normals.clone(),
            quadrics: Vec::new(),
            ..part.clone()
        });
        let mesh = Mesh::new(self.name.clone(), parts.collect())?.with_source(self.source.clone());
        Ok(Mesh { structure: Structure::changing(), ..mesh })
    }

    /// Triangles of all parts.
    pub fn triangle_count(&self) -> usize {
        self.parts.iter().map(|part| part.triangles.len()).sum()
    }

    /// Lowest and highest corner of the box around the vertices that triangles use; `None` without triangles.
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let mut bounds: Option<[[f32; 3]; 2]> = None;
        for p in self.points() {
            let [low, high] = bounds.get_or_insert([p, p]);
            for axis in 0..3 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis]);
            }
        }
        bounds
    }

    /// The corners of all triangles.
    fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        self.parts.iter().flat_map(|part| part.triangles.iter().flatten().map(|&index| part.positions[index as usize]))
    }

    /// The corners of all triangles in the world.
    #[doc(hidden)]
    pub fn world_points(&self, world_from_object: &DAffine3) -> impl Iterator<Item = DVec3> {
        self.points().map(|p| world_from_object.transform_point3(Vec3::from(p).as_dvec3()))
    }
}

/// The first vertex that is not finite, or so far out that later steps overflow.
pub fn beyond_reach(positions: &[[f32; 3]]) -> Option<usize> {
    // A comparison that NaN fails too.
    positions.iter().position(|p| !p.iter().all(|x| f64::from(x.abs()) <= LARGEST))
}

/// Whether a triangle has no area: two corners equal, or all three on one line to the last bit.
pub fn is_degenerate(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> bool {
    // In f64 the products of f32 differences are exact enough that only true slivers vanish.
    let edge = |p: [f32; 3], q: [f32; 3]| glam::Vec3::from(q).as_dvec3() - glam::Vec3::from(p).as_dvec3();
    edge(a, b).cross(edge(a, c)).length_squared() == 0.0
}

/// Whether the vertex normals add nothing to the triangles: then they are not kept, and rays that hit the part skip the
/// interpolation.
pub fn normals_are_flat(positions: &[[f32; 3]], normals: &[[f32; 3]], triangles: &[[u32; 3]]) -> bool {
    /// About 0.08 degrees: exporters round normals to 8 bits or more.
    const COS_TOLERANCE: f32 = 1.0 - 1e-6;
    triangles.iter().all(|&[a, b, c]| {
        let [pa, pb, pc] = [a, b, c].map(|i| glam::Vec3::from(positions[i as usize]));
        let face = (pb - pa).cross(pc - pa).normalize_or_zero();
        [a, b, c].iter().all(|&i| glam::Vec3::from(normals[i as usize]).dot(face).abs() >= COS_TOLERANCE)
    })
}

/// Whether any two triangles share one of `vertices` vertices.
pub fn share_vertices(triangles: &[[u32; 3]], vertices: usize) -> bool {
    let mut seen = vec![false; vertices];
    triangles.iter().flatten().any(|&vertex| std::mem::replace(&mut seen[vertex as usize], true))
}
