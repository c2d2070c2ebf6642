//! Meshes as modelling programs have them: each triangle with a material, each corner with attributes of its own.

use crate::material::Material;
use crate::mesh::{Mesh, Part, VertexSource, normals_are_flat};
use ground::array::Array;
use ground::error::{Error, Result};
use std::sync::Arc;
use std::{iter, mem};

/// Triangles of several materials, whose corners have texture coordinates and normals of their own.
#[derive(Clone, Debug, Default)]
pub struct CornerMesh {
    /// Vertex positions, metres, mesh frame.
    pub positions: Vec<[f32; 3]>,
    /// Indices of positions.
    pub triangles: Vec<[u32; 3]>,
    /// Its materials; none: the triangles have the default material.
    pub materials: Vec<Arc<Material>>,
    /// For each triangle, the index of its material; `None`: that of the first.
    pub material_index: Option<Vec<u32>>,
    /// Texture coordinates of the corners, three per triangle; used where the material has an image.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Unit shading normals of the corners, three per triangle; `None`: the triangles are flat.
    pub normals: Option<Vec<[f32; 3]>>,
}

/// Most vertices at one position that are compared before a corner gets a vertex of its own: a million corners at one
/// point must not be compared with each other.
const LONGEST_SEARCH: usize = 16;

/// No vertex.
const NONE: u32 = u32::MAX;

impl CornerMesh {
    /// The mesh, and for each of its parts the index of its material: a part for each that a triangle has. All parts
    /// share their vertices, and [`Mesh::source`] states which position each vertex has.
    ///
    /// # Errors
    /// As [`Mesh::new`]; arrays of other lengths, a material that does not exist.
    pub fn mesh(mut self, name: impl Into<String>) -> Result<(Mesh, Vec<usize>)> {
        self.check()?;
        let materials = self.materials.len().max(1);
        let is_textured = |material: &Arc<Material>| material.alpha_image().is_some();
        let textured: Vec<bool> = self.materials.iter().map(is_textured).collect();
        if textured.contains(&true) {
            self.clear_unused_uvs(&textured);
        } else {
            self.uvs = None;
        }
        self.normals = self.normals.take().filter(|normals| !self.is_flat(normals));
        let count = self.positions.len();
        let source = self.weld();
        let mut groups = vec![Vec::new(); if self.material_index.is_some() { materials } else { 0 }];
        match self.material_index.take() {
            None => groups.push(mem::take(&mut self.triangles)),
            Some(index) => {
                for (triangle, material) in self.triangles.iter().zip(index) {
                    groups[material as usize].push(*triangle);
                }
            }
        }
        let positions: Array<[f32; 3]> = self.positions.into();
        let (uvs, normals): (Option<Array<_>>, Option<Array<_>>) =
            (self.uvs.map(Into::into), self.normals.map(Into::into));
        let (mut parts, mut material_of) = (Vec::new(), Vec::new());
        for (index, triangles) in groups.into_iter().enumerate().filter(|(_, triangles)| !triangles.is_empty()) {
            let smooth = normals.clone().filter(|normals| !normals_are_flat(&positions, normals, &triangles));
            let has_image = textured.get(index).copied().unwrap_or(false);
            parts.push(
                Part::default()
                    .positions(positions.clone())
                    .normals(smooth)
                    .uvs(uvs.clone().filter(|_| has_image))
                    .triangles(triangles.into())
                    .material(self.materials.get(index).cloned()),
            );
            material_of.push(index);
        }
        let source = source.map(|vertices| {
            Arc::new(VertexSource { vertices: vec![vertices; parts.len()], count, origin: glam::DVec3::ZERO })
        });
        Ok((Mesh::new(name, parts)?.with_source(source), material_of))
    }

    fn check(&self) -> Result<()> {
        let (triangles, vertices) = (self.triangles.len(), self.positions.len());
        if triangles > (NONE / 3) as usize {
            return Err(Error::invalid("triangles", triangles, format!("up to {}", NONE / 3)));
        }
        let lengths = [
            ("material_index", self.material_index.as_ref().map(Vec::len), triangles, "one for each triangle"),
            ("uvs", self.uvs.as_ref().map(Vec::len), 3 * triangles, "one for each corner"),
            ("normals", self.normals.as_ref().map(Vec::len), 3 * triangles, "one for each corner"),
        ];
        for (name, length, needed, what) in lengths {
            if let Some(length) = length.filter(|&length| length != needed) {
                return Err(Error::invalid(name, format!("{length} long"), format!("{needed}, {what}")));
            }
        }
        if let Some(index) = self.triangles.iter().flatten().find(|&&index| index as usize >= vertices) {
            return Err(Error::invalid("index", index, format!("below the number of vertices, {vertices}")));
        }
        let materials = self.materials.len().max(1);
        let wrong = self.material_index.iter().flatten().find(|&&index| index as usize >= materials);
        if let Some(index) = wrong {
            return Err(Error::invalid("material_index", index, format!("below the number of materials, {materials}")));
        }
        Ok(())
    }

    /// Index of the material of each triangle.
    fn material(&self, triangle: usize) -> usize {
        self.material_index.as_ref().map_or(0, |index| index[triangle] as usize)
    }

    /// Sets texture coordinates that no image uses to one value, so that they separate no vertices.
    fn clear_unused_uvs(&mut self, textured: &[bool]) {
        let Some(mut uvs) = self.uvs.take() else { return };
        for (triangle, corners) in uvs.chunks_exact_mut(3).enumerate() {
            if !textured[self.material(triangle)] {
                corners.fill([0.0; 2]);
            }
        }
        self.uvs = Some(uvs);
    }

    /// Whether the normals of its corners are those of their triangles.
    fn is_flat(&self, normals: &[[f32; 3]]) -> bool {
        self.triangles.iter().zip(normals.chunks_exact(3)).all(|(triangle, normals)| {
            let points = triangle.map(|vertex| self.positions[vertex as usize]);
            normals_are_flat(&points, normals, &[[0, 1, 2]])
        })
    }

    /// Replaces positions and attributes of corners by those of vertices, which corners share that have the same; returns
    /// the position of each vertex, `None` if corners have no attributes.
    fn weld(&mut self) -> Option<Vec<u32>> {
        let (uvs, normals) = (self.uvs.take(), self.normals.take());
        if uvs.is_none() && normals.is_none() {
            return None;
        }
        let mut newest = vec![NONE; self.positions.len()];
        // For each vertex: the one before it at its position, its position, and a corner that has its attributes.
        let (mut older, mut sources, mut corners) = (Vec::new(), Vec::new(), Vec::<u32>::new());
        let bits = |corner: usize| {
            let uv = uvs.as_ref().map(|uvs| uvs[corner].map(f32::to_bits));
            (uv, normals.as_ref().map(|normals| normals[corner].map(f32::to_bits)))
        };
        for (triangle, vertices) in self.triangles.iter_mut().enumerate() {
            for (k, vertex) in vertices.iter_mut().enumerate() {
                let (position, corner) = (*vertex, 3 * triangle + k);
                let newest = &mut newest[position as usize];
                let there_is = |&vertex: &u32| vertex != NONE;
                let before = |&vertex: &u32| Some(older[vertex as usize]).filter(there_is);
                let mut compared = iter::successors(Some(*newest).filter(there_is), before).take(LONGEST_SEARCH);
                let known = compared.find(|&vertex| bits(corners[vertex as usize] as usize) == bits(corner));
                *vertex = known.unwrap_or_else(|| {
                    let vertex = sources.len() as u32;
                    older.push(mem::replace(newest, vertex));
                    sources.push(position);
                    corners.push(corner as u32);
                    vertex
                });
            }
        }
        self.positions = sources.iter().map(|&position| self.positions[position as usize]).collect();
        self.uvs = uvs.map(|uvs| corners.iter().map(|&corner| uvs[corner as usize]).collect());
        self.normals = normals.map(|normals| corners.iter().map(|&corner| normals[corner as usize]).collect());
        Some(sources)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Texture, TextureRef};

    /// A square of two triangles.
    fn square() -> CornerMesh {
        CornerMesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..CornerMesh::default()
        }
    }

    fn material(name: &str, image: bool) -> Arc<Material> {
        let texture = || TextureRef::plain(Arc::new(Texture::new(1, 1, vec![[9, 9, 9, 255]])));
        Arc::new(Material { name: name.into(), base_color_texture: image.then(texture), ..Material::default() })
    }

    const UVS: [[f32; 2]; 6] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    #[test]
    fn corners_with_the_same_attributes_share_a_vertex() {
        let normals = vec![[0.0, 0.6, 0.8]; 6];
        let materials = vec![material("image", true)];
        let given = CornerMesh { uvs: Some(UVS.into()), normals: Some(normals), materials, ..square() };
        let (mesh, material_of) = given.mesh("square").unwrap();
        let part = &mesh.parts[0];
        assert_eq!((part.positions.len(), material_of), (4, vec![0]));
        assert_eq!(part.uvs.as_ref().unwrap()[2], [1.0, 1.0]);
        assert_eq!(part.normals.as_ref().unwrap()[3], [0.0, 0.6, 0.8]);
    }

    #[test]
    fn a_seam_has_two_vertices_and_both_know_their_position() {
        let mut uvs = UVS;
        uvs[3] = [0.5, 0.5];
        let given = CornerMesh { uvs: Some(uvs.into()), materials: vec![material("image", true)], ..square() };
        let (mesh, _) = given.mesh("square").unwrap();
        let source = mesh.source.clone().unwrap();
        assert_eq!((source.count, &source.vertices[0][..]), (4, &[0, 1, 2, 0, 3][..]));
        assert_eq!(*mesh.parts[0].triangles, [[0, 1, 2], [3, 2, 4]]);
    }

    #[test]
    fn a_part_for_each_material_in_use_with_coordinates_where_an_image_uses_them() {
        let materials = vec![material("image", true), material("unused", false), material("plain", false)];
        let material_index = Some(vec![2, 0]);
        let given = CornerMesh { uvs: Some(UVS.into()), materials, material_index, ..square() };
        let (mesh, material_of) = given.mesh("square").unwrap();
        assert_eq!(material_of, [0, 2]);
        assert!(mesh.parts[0].uvs.is_some() && mesh.parts[1].uvs.is_none());
        assert!(mesh.parts[0].positions.is(&mesh.parts[1].positions));
        // The triangle without an image has its own vertices only where the other's coordinates are not 0.
        assert_eq!(mesh.parts[0].positions.len(), 5);
    }

    #[test]
    fn flat_normals_and_unused_coordinates_are_left_out() {
        let given = CornerMesh { uvs: Some(UVS.into()), normals: Some(vec![[0.0, 0.0, 1.0]; 6]), ..square() };
        let (mesh, _) = given.mesh("square").unwrap();
        assert!(mesh.parts[0].uvs.is_none() && mesh.parts[0].normals.is_none() && mesh.source.is_none());
        assert_eq!(mesh.parts[0].positions.len(), 4);
    }

    #[test]
    fn wrong_arrays_are_refused_with_what_is_allowed() {
        let fault = |given: CornerMesh| given.mesh("square").unwrap_err().to_string();
        let uvs = Some(vec![[0.0; 2]; 4]);
        assert_eq!(fault(CornerMesh { uvs, ..square() }), "uvs is 4 long; allowed: 6, one for each corner");
        let index = |index: &[u32]| CornerMesh { material_index: Some(index.to_vec()), ..square() };
        assert_eq!(fault(index(&[0, 1])), "material_index is 1; allowed: below the number of materials, 1");
        assert_eq!(fault(index(&[0])), "material_index is 1 long; allowed: 2, one for each triangle");
        let triangles = vec![[0, 1, 4]];
        assert_eq!(fault(CornerMesh { triangles, ..square() }), "index is 4; allowed: below the number of vertices, 4");
    }

    #[test]
    fn a_million_corners_at_one_point_are_not_compared_with_each_other() {
        let count = 300_000;
        let normals = (0..3 * count).map(|k| {
            let angle = k as f32;
            [angle.cos(), angle.sin(), 0.0]
        });
        let given = CornerMesh {
            positions: square().positions,
            triangles: vec![[0, 1, 2]; count],
            normals: Some(normals.collect()),
            ..CornerMesh::default()
        };
        let (mesh, _) = given.mesh("fan").unwrap();
        assert!(mesh.parts[0].positions.len() > count);
    }
}
