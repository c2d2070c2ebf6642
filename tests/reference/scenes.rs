//! Scenes put together by hand.

use echocast::Scene;
use echocast::material::Reflectance;
use echocast::scene::{Array, Labels, Material, Mesh, Object, Part};
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// Triangles of one part.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    /// Vertices, m.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals of the vertices; none: flat.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates of the vertices.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Three vertices a triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// One triangle.
    pub fn triangle(corners: [DVec3; 3]) -> Self {
        Shape {
            positions: corners.map(|p| p.as_vec3().to_array()).to_vec(),
            triangles: vec![[0, 1, 2]],
            ..Shape::default()
        }
    }

    /// A parallelogram from `corner` along `u` and `v`.
    pub fn quad(corner: DVec3, u: DVec3, v: DVec3) -> Self {
        let corners = [corner, corner + u, corner + u + v, corner + v];
        Shape {
            positions: corners.map(|p| p.as_vec3().to_array()).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Shape::default()
        }
    }

    /// A square plate around `centre` that shows its face to `normal`, `half` wide to each side.
    pub fn plate(centre: DVec3, normal: DVec3, half: f64) -> Self {
        let u = normal.any_orthogonal_vector().normalize();
        let v = normal.cross(u).normalize();
        Shape::quad(centre - half * (u + v), 2.0 * half * u, 2.0 * half * v)
    }

    /// A box.
    pub fn cuboid(low: DVec3, high: DVec3) -> Self {
        let size = high - low;
        let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        [(low, y, x), (low + z, x, y), (low, x, z), (low + y, z, x), (low, z, y), (low + x, y, z)]
            .into_iter()
            .map(|(corner, u, v)| Shape::quad(corner, u, v))
            .reduce(Shape::and)
            .unwrap_or_default()
    }

    /// A sphere around 0 with smooth normals: `rows` rings of `2 * rows` quads.
    pub fn sphere(radius: f64, rows: u32) -> Self {
        let columns = 2 * rows;
        let mut shape = Shape { normals: Some(Vec::new()), ..Shape::default() };
        for row in 0..=rows {
            let (sin_el, cos_el) = (std::f64::consts::PI * (f64::from(row) / f64::from(rows) - 0.5)).sin_cos();
            for column in 0..columns {
                let (sin_az, cos_az) = (std::f64::consts::TAU * f64::from(column) / f64::from(columns)).sin_cos();
                let normal = DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el);
                shape.positions.push((radius * normal).as_vec3().to_array());
                shape.normals.get_or_insert_default().push(normal.as_vec3().to_array());
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let next = (column + 1) % columns;
                let [a, b] = [row * columns + column, row * columns + next];
                let [c, d] = [b + columns, a + columns];
                // The rows at the poles are triangles.
                if row > 0 {
                    shape.triangles.push([a, b, c]);
                }
                if row + 1 < rows {
                    shape.triangles.push([a, c, d]);
                }
            }
        }
        shape
    }

    /// This without its smooth normals.
    #[must_use]
    pub fn flat(self) -> Self {
        Shape { normals: None, ..self }
    }

    /// Both shapes as one; both flat, without texture coordinates.
    #[must_use]
    pub fn and(mut self, other: Shape) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|index| index + first)));
        self
    }

    fn part(self, material: Option<Arc<Material>>) -> Part {
        Part::default()
            .positions(self.positions.into())
            .normals(self.normals.map(Array::from))
            .uvs(self.uvs.map(Array::from))
            .triangles(self.triangles.into())
            .material(material)
    }
}

/// A scene under construction. Every part of every mesh gets a part number of its own, every mesh a category, every
/// object an instance number, all from 1.
#[derive(Default)]
pub struct SceneBuilder {
    scene: Scene,
    meshes: Vec<Arc<Mesh>>,
    parts: u32,
    part_ids: Vec<Vec<u32>>,
}

impl SceneBuilder {
    /// An empty scene.
    pub fn new() -> Self {
        SceneBuilder::default()
    }

    /// Adds a material and returns its index.
    pub fn material(&mut self, material: Material) -> usize {
        self.scene.materials.push(Arc::new(material));
        self.scene.materials.len() - 1
    }

    /// Adds a material of reflectance `reflectance`.
    pub fn reflector(&mut self, reflectance: f32) -> usize {
        let name = format!("reflector {}", self.scene.materials.len());
        let reflectance = Some(Reflectance::Constant(reflectance));
        self.material(Material::default().name(name).reflectance(reflectance))
    }

    /// Adds a mesh of parts with their materials and returns its index.
    pub fn mesh(&mut self, parts: impl IntoIterator<Item = (Shape, Option<usize>)>) -> usize {
        let index = self.meshes.len();
        let materials = &self.scene.materials;
        let with_material =
            |(shape, index): (Shape, Option<usize>)| shape.part(index.map(|index| materials[index].clone()));
        let parts: Vec<Part> = parts.into_iter().map(with_material).collect();
        self.part_ids.push((1..=parts.len() as u32).map(|number| self.parts + number).collect());
        self.parts += parts.len() as u32;
        self.meshes.push(Arc::new(Mesh::new(format!("mesh {index}"), parts).expect("sound parts")));
        index
    }

    /// Places a mesh in the world.
    pub fn place(&mut self, mesh: usize, world_from_object: DAffine3) -> &mut Self {
        let instance_id = self.scene.objects.len() as u32 + 1;
        self.scene.objects.push(
            Object::new(format!("object {instance_id}"), self.meshes[mesh].clone())
                .world_from_object(world_from_object)
                .category_id(mesh as u32 + 1)
                .part_ids(self.part_ids[mesh].clone())
                .instance_id(instance_id),
        );
        self
    }

    /// Adds `shape` as a mesh of its own that stands where its coordinates say.
    pub fn stand(&mut self, shape: Shape, material: Option<usize>) -> &mut Self {
        let mesh = self.mesh([(shape, material)]);
        self.place(mesh, DAffine3::IDENTITY)
    }

    /// The scene.
    pub fn finish(mut self) -> Scene {
        let table =
            |stem: &str, count: usize| (1..=count as u32).map(|number| (number, format!("{stem} {number}"))).collect();
        self.scene.labels = Labels::default()
            .category(table("category", self.meshes.len()))
            .part(table("part", self.parts as usize))
            .material((1..).zip(self.scene.materials.iter().map(|material| &material.name)).collect())
            .instance(table("object", self.scene.objects.len()));
        self.scene
    }
}
