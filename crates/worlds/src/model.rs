//! Meshes with several materials, and the materials of streets and rooms.

use super::glb::{Glb, Look, Placement, Primitive};
use super::shapes::ClosedShape;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// Cosine of the crease angle: normals are averaged over faces that meet at a smaller angle.
const CREASE: f64 = 0.7;

/// Materials by name: look, linear colour and reflectance at 905 nm. Those without a reflectance are in the material
/// library, or are panes or mirrors; the other values are our own plausible choices.
const MATERIALS: &[(&str, Look, [f32; 3], Option<f64>)] = &[
    ("asphalt_dry", Look::Matt, [0.055, 0.055, 0.06], None),
    ("concrete", Look::Matt, [0.34, 0.33, 0.31], None),
    ("granite", Look::Matt, [0.22, 0.22, 0.23], Some(0.3)),
    ("white_paint", Look::Matt, [0.75, 0.75, 0.73], None),
    ("lane_marking", Look::Matt, [0.7, 0.7, 0.66], Some(0.6)),
    ("grass", Look::Matt, [0.07, 0.16, 0.03], Some(0.45)),
    ("brick", Look::Matt, [0.26, 0.085, 0.05], Some(0.35)),
    ("brick_yellow", Look::Matt, [0.42, 0.31, 0.16], Some(0.45)),
    ("plaster_white", Look::Matt, [0.66, 0.64, 0.58], Some(0.65)),
    ("plaster_ochre", Look::Matt, [0.56, 0.38, 0.16], Some(0.55)),
    ("plaster_blue", Look::Matt, [0.24, 0.32, 0.38], Some(0.5)),
    ("sandstone", Look::Matt, [0.45, 0.36, 0.24], Some(0.45)),
    ("roof_tile", Look::Matt, [0.23, 0.06, 0.03], Some(0.3)),
    ("slate", Look::Matt, [0.06, 0.065, 0.075], Some(0.12)),
    ("wood", Look::Matt, [0.13, 0.06, 0.025], Some(0.4)),
    ("door", Look::Matt, [0.1, 0.05, 0.03], Some(0.4)),
    ("fence_wood", Look::Matt, [0.25, 0.16, 0.08], Some(0.45)),
    ("curtain", Look::Sheet, [0.6, 0.56, 0.48], Some(0.6)),
    ("awning", Look::Sheet, [0.4, 0.04, 0.03], Some(0.5)),
    ("window", Look::Pane, [0.9, 0.95, 0.95], None),
    ("sign_white", Look::Matt, [0.8, 0.8, 0.8], Some(0.4)),
    ("sign_yellow", Look::Matt, [0.75, 0.45, 0.02], Some(0.35)),
    ("sign_red", Look::Matt, [0.5, 0.02, 0.02], Some(0.3)),
    ("sign_blue", Look::Matt, [0.01, 0.07, 0.35], Some(0.2)),
    ("steel", Look::Matt, [0.13, 0.14, 0.14], Some(0.25)),
    ("bark", Look::Matt, [0.09, 0.06, 0.04], Some(0.3)),
    ("vegetation", Look::Sheet, [0.06, 0.17, 0.025], None),
    ("car_paint", Look::Matt, [0.4, 0.02, 0.02], Some(0.4)),
    ("black_car_paint", Look::Matt, [0.012, 0.012, 0.014], None),
    ("blue_car_paint", Look::Matt, [0.02, 0.06, 0.22], Some(0.3)),
    ("silver_car_paint", Look::Matt, [0.42, 0.43, 0.44], Some(0.5)),
    ("rubber", Look::Matt, [0.018, 0.018, 0.018], Some(0.05)),
    ("plastic", Look::Matt, [0.03, 0.03, 0.032], Some(0.1)),
    ("rim", Look::Matt, [0.45, 0.45, 0.46], Some(0.5)),
    ("headlight", Look::Matt, [0.8, 0.82, 0.85], Some(0.7)),
    ("tail_light", Look::Matt, [0.35, 0.01, 0.01], Some(0.5)),
    ("skin", Look::Matt, [0.5, 0.27, 0.18], Some(0.5)),
    ("hair", Look::Matt, [0.035, 0.02, 0.012], Some(0.2)),
    ("jacket", Look::Matt, [0.05, 0.13, 0.2], Some(0.45)),
    ("red_jacket", Look::Matt, [0.3, 0.02, 0.03], Some(0.5)),
    ("grey_jacket", Look::Matt, [0.2, 0.2, 0.2], Some(0.3)),
    ("trousers", Look::Matt, [0.09, 0.075, 0.06], Some(0.4)),
    ("shoe", Look::Matt, [0.03, 0.02, 0.015], Some(0.15)),
    ("flag", Look::Sheet, [0.02, 0.1, 0.4], Some(0.5)),
    ("flag_stripe", Look::Sheet, [0.7, 0.7, 0.68], Some(0.7)),
    ("lamp_red", Look::Glow, [1.0, 0.02, 0.0], Some(0.4)),
    ("lamp_yellow", Look::Glow, [1.0, 0.45, 0.0], Some(0.5)),
    ("lamp_green", Look::Glow, [0.0, 0.8, 0.25], Some(0.4)),
    // Rooms.
    ("wall_paint", Look::Matt, [0.78, 0.76, 0.7], Some(0.7)),
    ("ceiling_paint", Look::Matt, [0.82, 0.82, 0.8], Some(0.8)),
    ("parquet", Look::Matt, [0.3, 0.17, 0.08], Some(0.5)),
    ("carpet", Look::Matt, [0.2, 0.19, 0.2], Some(0.35)),
    ("tiles", Look::Matt, [0.5, 0.47, 0.42], Some(0.55)),
    ("door_frame", Look::Matt, [0.7, 0.68, 0.62], Some(0.65)),
    ("door_leaf", Look::Matt, [0.35, 0.22, 0.11], Some(0.5)),
    ("handle", Look::Matt, [0.4, 0.4, 0.4], Some(0.4)),
    ("window_frame", Look::Matt, [0.75, 0.75, 0.72], Some(0.7)),
    ("glass", Look::Pane, [0.95, 0.97, 0.97], None),
    ("metal", Look::Matt, [0.35, 0.35, 0.36], Some(0.4)),
    ("mirror_frame", Look::Matt, [0.3, 0.18, 0.06], Some(0.45)),
    ("mirror", Look::Mirror, [0.9, 0.9, 0.9], None),
    ("table_top", Look::Matt, [0.4, 0.24, 0.11], Some(0.5)),
    ("leg", Look::Matt, [0.25, 0.14, 0.06], Some(0.45)),
    ("seat", Look::Matt, [0.12, 0.2, 0.28], Some(0.5)),
    ("back", Look::Matt, [0.13, 0.22, 0.3], Some(0.5)),
    ("arm", Look::Matt, [0.14, 0.23, 0.31], Some(0.5)),
    ("bed_frame", Look::Matt, [0.32, 0.19, 0.09], Some(0.5)),
    ("mattress", Look::Matt, [0.75, 0.74, 0.7], Some(0.75)),
    ("blanket", Look::Matt, [0.35, 0.1, 0.1], Some(0.55)),
    ("pillow", Look::Matt, [0.8, 0.79, 0.76], Some(0.8)),
    ("board", Look::Matt, [0.45, 0.3, 0.16], Some(0.5)),
    ("book", Look::Matt, [0.25, 0.08, 0.05], Some(0.4)),
    ("cupboard_body", Look::Matt, [0.5, 0.36, 0.2], Some(0.55)),
    ("cupboard_door", Look::Matt, [0.55, 0.4, 0.23], Some(0.55)),
    ("stand", Look::Matt, [0.06, 0.06, 0.06], Some(0.15)),
    ("shade", Look::Sheet, [0.75, 0.68, 0.5], Some(0.65)),
    ("pot", Look::Matt, [0.3, 0.11, 0.05], Some(0.4)),
    ("leaves", Look::Sheet, [0.04, 0.16, 0.03], Some(0.45)),
    ("casing", Look::Matt, [0.02, 0.02, 0.02], Some(0.08)),
    ("screen", Look::Matt, [0.01, 0.01, 0.012], Some(0.04)),
];

/// Sheeting of traffic signs: coefficient of retro-reflection in cd/(lx m^2) at incidences of 4 and 30 degrees, the
/// minimum of ASTM D4956 for type III (high-intensity) sheeting, observed 0.2 degrees off the lamp. The cut-off at 60
/// degrees is our own choice.
const SHEETINGS: [(&str, [f64; 2]); 4] = [
    ("sign_white", [250.0, 150.0]),
    ("sign_yellow", [170.0, 100.0]),
    ("sign_red", [45.0, 25.0]),
    ("sign_blue", [20.0, 11.0]),
];

/// The file under construction, and the materials in it.
#[derive(Default)]
pub(super) struct Made {
    pub glb: Glb,
    materials: Vec<(&'static str, usize)>,
}

impl Made {
    /// The material called `name`.
    pub fn material(&mut self, name: &'static str) -> usize {
        if let Some((_, known)) = self.materials.iter().find(|(known, _)| *known == name) {
            return *known;
        }
        let row = MATERIALS.iter().find(|(known, ..)| *known == name);
        let &(_, look, color, reflectance) = row.unwrap_or_else(|| unreachable!("no material {name}"));
        let mut extras = match (look, reflectance) {
            // A clean pane would be invisible: this is the dust on it.
            (Look::Pane, _) => json!({ "dirt": 0.03, "pane_m": 0.006 }),
            // Likewise a clean mirror.
            (Look::Mirror, _) => json!({ "dirt": 0.03 }),
            (_, Some(reflectance)) => json!({ "reflectance": reflectance }),
            _ => Value::Null,
        };
        if let Some((_, [ahead, aside])) = SHEETINGS.iter().find(|(sheeting, _)| *sheeting == name) {
            let sample = |angle: u32, value: f64| json!({ "angle_deg": angle, "cd_lx_m2": value });
            let samples = [sample(4, *ahead), sample(30, *aside), sample(60, 0.0)];
            extras["scattering"] = json!({ "model": "retro_reflector", "samples": samples });
        }
        let index = self.glb.material(name, look, color, extras);
        self.materials.push((name, index));
        index
    }

    /// A mesh with flat faces.
    pub fn mesh(&mut self, name: &str, model: &Model) -> usize {
        let vertices = single(&model.vertices);
        self.parts(name, model, &vertices, None, model.parts.iter().map(|(_, triangles)| triangles.as_slice()))
    }

    /// A mesh whose faces are shaded smoothly where they meet at a shallow angle.
    pub fn rounded_mesh(&mut self, name: &str, model: &Model) -> usize {
        let Rounded { vertices, normals, parts } = model.rounded();
        self.parts(name, model, &vertices, Some(&normals), parts.iter().map(Vec::as_slice))
    }

    /// A mesh with a normal at each vertex.
    pub fn shaded_mesh(&mut self, name: &str, model: &Model, normals: &[DVec3]) -> usize {
        let triangles = model.parts.iter().map(|(_, triangles)| triangles.as_slice());
        self.parts(name, model, &single(&model.vertices), Some(&single(normals)), triangles)
    }

    fn parts<'a>(
        &mut self,
        name: &str,
        model: &Model,
        vertices: &[[f32; 3]],
        normals: Option<&[[f32; 3]]>,
        triangles: impl Iterator<Item = &'a [[u32; 3]]>,
    ) -> usize {
        let materials: Vec<usize> = model.parts.iter().map(|(name, _)| self.material(name)).collect();
        let parts: Vec<Primitive> =
            triangles.zip(materials).map(|(triangles, material)| Primitive { triangles, material }).collect();
        self.glb.mesh(name, vertices, normals, &parts)
    }

    /// Adds an object at the top level of the scene.
    pub fn put(&mut self, name: &str, category: &'static str, mesh: usize, place: Placement) -> usize {
        let node = self.glb.object(name, category, mesh, place);
        self.glb.root(node);
        node
    }
}

/// Triangles that share vertices, grouped by the name of their material.
#[derive(Default)]
pub(super) struct Model {
    pub vertices: Vec<DVec3>,
    pub parts: Vec<(&'static str, Vec<[u32; 3]>)>,
}

/// A model as it is stored in the file.
struct Rounded {
    vertices: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    parts: Vec<Vec<[u32; 3]>>,
}

impl Model {
    pub fn triangle(&mut self, material: &'static str, corners: [u32; 3]) {
        match self.parts.iter_mut().find(|(known, _)| *known == material) {
            Some((_, triangles)) => triangles.push(corners),
            None => self.parts.push((material, vec![corners])),
        }
    }

    /// Adds a whole shape.
    pub fn add(&mut self, material: &'static str, shape: &ClosedShape) {
        self.add_placed(material, shape, &Placement::HERE);
    }

    pub fn add_placed(&mut self, material: &'static str, shape: &ClosedShape, place: &Placement) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(shape.vertices.iter().map(|&vertex| place.apply(vertex)));
        for corners in &shape.triangles {
            self.triangle(material, corners.map(|corner| first + corner));
        }
    }

    /// Adds a box, given by its lowest and highest corner.
    pub fn add_box(&mut self, material: &'static str, low: [f64; 3], high: [f64; 3]) {
        let mut shape = ClosedShape::default();
        shape.add_box(low.into(), high.into());
        self.add(material, &shape);
    }

    /// Adds a flat convex polygon, its corners counter-clockwise seen from outside.
    pub fn polygon(&mut self, material: &'static str, corners: &[DVec3]) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners);
        for corner in 1..corners.len() as u32 - 1 {
            self.triangle(material, [first, first + corner, first + corner + 1]);
        }
    }

    /// Adds a skin over rings with equally many corners, counter-clockwise seen from the last ring; `material` is
    /// called with `ring` and `side` for the face between the corners `side` and `side + 1` of the rings `ring` and
    /// `ring + 1`. `ends` are the materials of the end caps; an end without one stays open.
    pub fn loft(
        &mut self,
        rings: &[Vec<DVec3>],
        ends: [Option<&'static str>; 2],
        material: impl Fn(usize, usize) -> &'static str,
    ) {
        let first = self.vertices.len() as u32;
        let sides = rings.first().map_or(0, Vec::len);
        self.vertices.extend(rings.iter().flatten());
        let corner = |ring: usize, side: usize| first + (ring * sides + side % sides) as u32;
        for ring in 0..rings.len().saturating_sub(1) {
            for side in 0..sides {
                let (low, high) = (
                    [corner(ring, side), corner(ring, side + 1)],
                    [corner(ring + 1, side), corner(ring + 1, side + 1)],
                );
                let material = material(ring, side);
                self.triangle(material, [low[0], low[1], high[1]]);
                self.triangle(material, [low[0], high[1], high[0]]);
            }
        }
        for (end, material) in ends.into_iter().enumerate() {
            let (Some(material), ring) = (material, if end == 0 { 0 } else { rings.len() - 1 }) else { continue };
            let middle = self.vertices.len() as u32;
            self.vertices.push(rings[ring].iter().sum::<DVec3>() / sides as f64);
            for side in 0..sides {
                let [a, b] = [corner(ring, side), corner(ring, side + 1)];
                self.triangle(material, if end == 0 { [b, a, middle] } else { [a, b, middle] });
            }
        }
    }

    /// Adds a closed round tube through points, with a radius at each.
    pub fn tube(&mut self, material: &'static str, points: &[(DVec3, f64)], sides: usize) {
        let last = points.len() - 1;
        let rings: Vec<Vec<DVec3>> = (0..points.len())
            .map(|i| {
                let (middle, radius) = points[i];
                let ahead = (points[(i + 1).min(last)].0 - points[i.saturating_sub(1)].0).normalize();
                let side = if ahead.x.abs() < 0.9 { ahead.cross(DVec3::X) } else { ahead.cross(DVec3::Y) }.normalize();
                ring(sides, |sin, cos| middle + (side * cos + ahead.cross(side) * sin) * radius)
            })
            .collect();
        self.loft(&rings, [Some(material); 2], |_, _| material);
    }

    /// Adds an open surface of revolution about the y axis; its outline is given as distances along the axis and from
    /// it.
    pub fn turned(&mut self, material: &'static str, outline: &[[f64; 2]], sides: usize) {
        let rings: Vec<Vec<DVec3>> = outline
            .iter()
            .map(|&[along, radius]| ring(sides, |sin, cos| DVec3::new(radius * sin, along, radius * cos)))
            .collect();
        self.loft(&rings, [None; 2], |_, _| material);
    }

    /// Vertices with normals: one vertex for each distinct normal at a position.
    fn rounded(&self) -> Rounded {
        let corner = |index: u32| self.vertices[index as usize];
        let all = || self.parts.iter().flat_map(|(_, triangles)| triangles);
        // For each vertex, the normals of its triangles, each as long as twice the triangle's area.
        let mut faces: Vec<Vec<DVec3>> = vec![Vec::new(); self.vertices.len()];
        let face = |&[a, b, c]: &[u32; 3]| (corner(b) - corner(a)).cross(corner(c) - corner(a));
        for corners in all() {
            let face = face(corners);
            corners.iter().for_each(|&corner| faces[corner as usize].push(face));
        }
        let (mut vertices, mut normals) = (Vec::new(), Vec::new());
        let mut made: Vec<Vec<u32>> = vec![Vec::new(); self.vertices.len()];
        let mut vertex = |index: u32, own: DVec3| {
            let own = own.normalize_or(DVec3::Z);
            let near = faces[index as usize].iter().filter(|face| face.normalize_or(own).dot(own) >= CREASE);
            let normal = near.sum::<DVec3>().normalize_or(own).as_vec3();
            let made = &mut made[index as usize];
            let alike = |&&other: &&u32| normal.dot(Vec3::from(normals[other as usize])) > 0.9999;
            if let Some(&known) = made.iter().find(alike) {
                return known;
            }
            made.push(vertices.len() as u32);
            vertices.push(corner(index).as_vec3().to_array());
            normals.push(normal.to_array());
            vertices.len() as u32 - 1
        };
        let mut parts = Vec::new();
        for (_, triangles) in &self.parts {
            let rounded = |corners: &[u32; 3]| corners.map(|corner| vertex(corner, face(corners)));
            parts.push(triangles.iter().map(rounded).collect());
        }
        Rounded { vertices, normals, parts }
    }
}

/// Corners of a ring from the sine and cosine of their angles.
pub(super) fn ring(sides: usize, corner: impl Fn(f64, f64) -> DVec3) -> Vec<DVec3> {
    (0..sides)
        .map(|side| {
            let (sin, cos) = (side as f64 / sides as f64 * TAU).sin_cos();
            corner(sin, cos)
        })
        .collect()
}

/// Vectors in single precision.
pub(super) fn single(vectors: &[DVec3]) -> Vec<[f32; 3]> {
    vectors.iter().map(|vector| vector.as_vec3().to_array()).collect()
}
