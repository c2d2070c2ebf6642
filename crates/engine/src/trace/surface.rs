//! What the ids of Embree's hits mean.

use super::Tables;
use super::hits::Cover;
use crate::scene::{Labels, Mesh, Object, Part};
use embree4::{Candidate, INVALID};
use glam::{DVec3, Mat3, Vec3};
use ground::lanes::{LANES, RayBatch};
use ground::rng::Draw;
use model::material::{Alpha, Material, Optics, Reflectances, Sound, srgb_byte};
use std::collections::HashMap;
use std::sync::Arc;

/// Where rays pass through a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holes {
    Nowhere,
    /// Where alpha is below the cutoff.
    Cut,
    /// Anywhere, at random: the lower alpha is, the more of them.
    Between,
}

/// A part of an object: what a hit on it means.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    pub category_id: u32,
    pub part_id: u32,
    pub instance_id: u32,
    pub material_id: u32,
    /// Index into [`Surfaces::materials`].
    pub material: u32,
    /// Index into [`Surfaces::parts`].
    pub part: u32,
    /// Which part of its mesh, from 0.
    pub number: u16,
    /// Index into [`super::Tables::normal_matrices`].
    pub object: u32,
    /// Base colour of the material's factor, sRGB.
    pub rgb: [u8; 3],
    /// Whether the base colour comes from an image.
    pub textured: bool,
    /// Whether hits come with normals in the mesh's frame.
    pub instanced: bool,
    pub holes: Holes,
    /// Whether triangles stand for quadrics.
    pub curved: bool,
    /// Area, m^2, of a part that scatters sound as a whole; 0 for all others, where it is not used.
    pub area: f32,
}

/// A part that scatters sound as a whole: its row, and the middle and radius of its box, m, in its object's frame.
#[derive(Clone, Copy, Debug)]
pub struct SoundTarget {
    pub row: u32,
    pub middle: DVec3,
    pub radius: f64,
}

impl SoundTarget {
    fn new(row: usize, part: &Part) -> SoundTarget {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &corner in part.triangles.iter().flatten() {
            let place = Vec3::from(part.positions[corner as usize]).as_dvec3();
            (low, high) = (low.min(place), high.max(place));
        }
        SoundTarget { row: row as u32, middle: 0.5 * (low + high), radius: 0.5 * (high - low).length() }
    }
}

impl Holes {
    /// Holes of a `part` made of a `material`. What is opaque everywhere has none: its hits are not filtered.
    fn of(material: &Material, part: &Part) -> Holes {
        let alpha = material.base_color[3];
        let varies = part.alphas.is_some()
            || part.uvs.is_some() && material.alpha_image().is_some_and(|image| !image.texture.opaque);
        match material.alpha {
            Alpha::Cutout if varies || alpha < material.alpha_cutoff => Holes::Cut,
            Alpha::Coverage if varies || alpha < 1.0 => Holes::Between,
            _ => Holes::Nowhere,
        }
    }
}

/// Hash of several words, each bit of which depends on all of theirs (the mixing steps are those of the finalizer of A.
/// Appleby's MurmurHash3).
fn mixed<const N: usize>(words: [u32; N]) -> u32 {
    words.into_iter().fold(0, |mixed, word| {
        let mixed = mixed ^ word;
        let mixed = (mixed ^ mixed >> 16).wrapping_mul(0x85eb_ca6b);
        let mixed = (mixed ^ mixed >> 13).wrapping_mul(0xc2b2_ae35);
        mixed ^ mixed >> 16
    })
}

/// All parts of all objects, in the order of Embree's ids: first those in the top level or in its group of fixed
/// objects, by geometry, then the instances, by part.
#[derive(Default)]
pub struct Surfaces {
    pub rows: Vec<Surface>,
    /// First row of each top-level geometry, where those are instances.
    pub first_row: Vec<u32>,
    /// Mesh parts, by [`Surface::part`].
    pub parts: Vec<Part>,
    /// Materials, by [`Surface::material`]; the first is the default material.
    pub materials: Vec<Arc<Material>>,
    pub labels: Arc<Labels>,
    /// Whether hits can be in instances whose normals must be transformed.
    pub has_instances: bool,
    /// Whether any part has shading normals.
    pub has_shading_normals: bool,
    /// Whether triangles of any part stand for quadrics.
    pub has_quadrics: bool,
    /// Whether rays may pass through any surface.
    pub has_holes: bool,
    /// The parts that scatter sound as a whole.
    pub targets: Vec<SoundTarget>,
}

/// The material that replaces another on the object in a slot, if any.
pub(crate) type Looks<'l> = &'l dyn Fn(u32, &Arc<Material>) -> Option<Arc<Material>>;

impl Surfaces {
    /// Rows of `objects`, in order, at `time`, s; each with its slot, and whether its normals come in the mesh's frame.
    /// `looks` gives the material that replaces another on an object, if any.
    pub fn new<'a>(
        objects: impl Iterator<Item = (u32, &'a Object, bool)>,
        looks: Option<Looks>,
        labels: Arc<Labels>,
        time: f64,
    ) -> Surfaces {
        let mut surfaces = Surfaces { materials: vec![Arc::default()], ..Surfaces::default() };
        let material_ids = labels.material.to_map();
        let mut first_part: HashMap<*const Mesh, u32> = HashMap::new();
        let mut material_index: HashMap<*const Material, u32> = HashMap::new();
        for (index, (slot, object, instanced)) in objects.enumerate() {
            let parts = &mut surfaces.parts;
            let first_part = *first_part.entry(Arc::as_ptr(&object.mesh)).or_insert_with(|| {
                parts.extend(object.mesh.parts.iter().cloned());
                (parts.len() - object.mesh.parts.len()) as u32
            });
            for (number, part) in object.mesh.parts.iter().enumerate() {
                let given = object.material.as_ref().or(part.material.as_ref());
                let look = looks.zip(given).and_then(|(look, material)| look(slot, material));
                let material = match look.as_ref().or(given) {
                    None => 0,
                    Some(material) => *material_index.entry(Arc::as_ptr(material)).or_insert_with(|| {
                        surfaces.materials.push(material.at(time).map_or_else(|| material.clone(), Arc::new));
                        surfaces.materials.len() as u32 - 1
                    }),
                };
                let made_of = &surfaces.materials[material as usize];
                let textured = made_of.base_color_texture.is_some() && part.uvs.is_some();
                let holes = Holes::of(made_of, part);
                surfaces.has_holes |= holes != Holes::Nowhere;
                let scatters_whole = matches!(made_of.sound_law(), Some(Sound::Target { .. }));
                if scatters_whole && !part.triangles.is_empty() {
                    surfaces.targets.push(SoundTarget::new(surfaces.rows.len(), part));
                }
                surfaces.rows.push(Surface {
                    category_id: object.category_id,
                    part_id: object.part_ids.get(number).copied().unwrap_or(0),
                    instance_id: object.instance_id,
                    material_id: material_ids.get(made_of.name.as_str()).copied().unwrap_or(0),
                    material,
                    part: first_part + number as u32,
                    number: number as u16,
                    object: index as u32,
                    rgb: std::array::from_fn(|c| srgb_byte(made_of.base_color[c])),
                    textured,
                    instanced,
                    holes,
                    curved: !part.quadrics.is_empty(),
                    area: if scatters_whole { part.area(&object.world_from_object) as f32 } else { 0.0 },
                });
            }
            surfaces.has_instances |= instanced;
        }
        drop(material_ids);
        surfaces.has_quadrics = surfaces.rows.iter().any(|row| row.curved);
        surfaces.has_shading_normals = surfaces.parts.iter().any(|part| part.normals.is_some());
        surfaces.labels = labels;
        surfaces
    }

    /// The row of a hit: that of `geometry` itself, or within `instance` where that is not [`INVALID`].
    pub fn row(&self, geometry: u32, instance: u32) -> u32 {
        if instance == INVALID { geometry } else { self.first_row[instance as usize] + geometry }
    }

    /// Linear base colour and alpha of `surface` at the weights `u` and `v` of the second and third corner of
    /// `triangle`.
    pub fn base_color(&self, surface: &Surface, triangle: u32, [u, v]: [f32; 2]) -> [f32; 4] {
        let material = &self.materials[surface.material as usize];
        let part = &self.parts[surface.part as usize];
        let (Some(image), Some(uvs)) = (&material.base_color_texture, part.uvs.as_deref()) else {
            return material.base_color;
        };
        let [a, b, c] = part.triangles[triangle as usize].map(|index| uvs[index as usize]);
        let texel = image.sample(std::array::from_fn(|k| a[k] * (1.0 - u - v) + b[k] * u + c[k] * v));
        std::array::from_fn(|k| material.base_color[k] * texel[k])
    }

    /// How far, m, a smooth part bulges beyond its triangle at the weights `u` and `v` of the second and third corner;
    /// `None`: it is flat. `normals` and `linear` transform normals and vectors to the world frame.
    ///
    /// Half the weighted offset of the tangent planes at the corners: a sphere, to second order (Boubekeur and Alexa
    /// 2008, Phong tessellation, with their shape factor as a sphere requires).
    pub fn bulge(
        &self,
        surface: &Surface,
        triangle: u32,
        [u, v]: [f32; 2],
        normals: &Mat3,
        linear: &Mat3,
    ) -> Option<Vec3> {
        let part = &self.parts[surface.part as usize];
        let of_corners = part.normals.as_deref()?;
        let corners = part.triangles[triangle as usize].map(|index| index as usize);
        let [a, b, c] = corners.map(|index| Vec3::from(part.positions[index]));
        let weights = [1.0 - u - v, u, v];
        let place = a * weights[0] + b * u + c * v;
        let beside = |corner: Vec3, index: usize, weight: f32| {
            let normal = (*normals * Vec3::from(of_corners[index])).normalize_or_zero();
            normal * (0.5 * weight * (*linear * (corner - place)).dot(normal))
        };
        Some(beside(a, corners[0], weights[0]) + beside(b, corners[1], u) + beside(c, corners[2], v))
    }

    /// Base colour of `surface` as in [`Surfaces::base_color`], sRGB.
    pub fn rgb(&self, surface: &Surface, triangle: u32, corner: [f32; 2]) -> [u8; 3] {
        if !surface.textured {
            return surface.rgb;
        }
        let rgba = self.base_color(surface, triangle, corner);
        std::array::from_fn(|channel| srgb_byte(rgba[channel]))
    }

    /// Alpha of `surface` at the weights `u` and `v` of the second and third corner of `triangle`: that of its
    /// material, its image and its vertices.
    fn alpha(&self, surface: &Surface, triangle: u32, [u, v]: [f32; 2]) -> f32 {
        let material = &self.materials[surface.material as usize];
        let part = &self.parts[surface.part as usize];
        let corners = || part.triangles[triangle as usize].map(|index| index as usize);
        let mut alpha = material.base_color[3];
        if let (Some(image), Some(uvs)) = (material.alpha_image(), &part.uvs) {
            let [a, b, c] = corners().map(|index| uvs[index]);
            alpha *= image.sample(std::array::from_fn(|k| a[k] * (1.0 - u - v) + b[k] * u + c[k] * v))[3];
        }
        if let Some(alphas) = &part.alphas {
            let [a, b, c] = corners().map(|index| alphas[index]);
            alpha *= a * (1.0 - u - v) + b * u + c * v;
        }
        alpha
    }

    /// The row of a hit, if it has holes.
    pub(crate) fn with_holes(&self, hit: &Candidate) -> Option<u32> {
        let row = self.row(hit.geom_id, hit.inst_id);
        (self.rows[row as usize].holes != Holes::Nowhere).then_some(row)
    }

    /// Whether a ray that hits a surface is stopped there rather than passing through. `hit.ray` is its lane in `rays`.
    pub fn stops(&self, hit: &Candidate, cover: Cover, rays: &RayBatch) -> bool {
        self.with_holes(hit).is_none_or(|row| self.covers(row, hit, cover, rays))
    }

    /// [`Surfaces::stops`] for a `row` with holes.
    ///
    /// It depends on nothing but the hit (by the order of the objects) and the ray (by its beam, origin and direction):
    /// tracing the ray again gives the same result, in whatever order its hits come.
    pub fn covers(&self, row: u32, hit: &Candidate, cover: Cover, rays: &RayBatch) -> bool {
        let surface = &self.rows[row as usize];
        let alpha = || self.alpha(surface, hit.prim_id, [hit.u, hit.v]);
        match cover {
            _ if surface.holes == Holes::Cut => alpha() >= self.materials[surface.material as usize].alpha_cutoff,
            Cover::Reflecting => true,
            Cover::Solid => alpha() > 0.0,
            Cover::Drawn(rng) => {
                let lane = hit.ray as usize;
                let word = |axis: &[f32; LANES]| axis[lane].to_bits();
                let [[ox, oy, oz], [dx, dy, dz]] = [rays.origins(), rays.directions()].map(|axes| axes.map(word));
                let ray = mixed([ox, oy, oz, dx, dy, dz, row, hit.prim_id]);
                let [draw, ..] = rng.four(rays.beam[lane], Draw::Coverage, ray);
                draw < alpha()
            }
        }
    }

    /// Whether a random draw decides if a ray passes through the surface `row`.
    pub(crate) fn is_drawn(&self, row: u32, cover: Cover) -> bool {
        matches!(cover, Cover::Drawn(_)) && self.rows[row as usize].holes == Holes::Between
    }

    /// Whether what is behind a surface is seen through it.
    pub(crate) fn is_glass(&self, surface: &Surface) -> bool {
        let Material { transmission, metallic, .. } = *self.materials[surface.material as usize];
        transmission > 0.0 && metallic < 1.0
    }

    /// Optical properties of `surface`, a row or [`super::MISS`], according to `reflectances`.
    pub(crate) fn optics<'a>(&self, reflectances: &'a Reflectances, surface: u32) -> Option<&'a Optics> {
        let row = self.rows.get(surface as usize)?;
        Some(&reflectances.optics[row.material as usize])
    }
}

/// The unit normal of a smooth surface as seen by a ray along `direction`, and the cosine of incidence on it, above 0.
/// `smooth` is the interpolated normal, of any length and on either side; `facet` the unit normal of the triangle on
/// the side that the ray comes from, which it meets at the cosine `cos_facet`.
///
/// At the rim of a body a smooth normal may face away from the sensor while its triangle faces it. There it is bent
/// back until it faces the sensor, as renderers do (Lagarde and de Rousiers 2014, Moving Frostbite to PBR, keep its
/// cosine above 0; so does Blender's Cycles with that of the reflected ray): where its cosine `c` is less than `h`,
/// half of the triangle's, it becomes `h^2 / (2 h - c)`, which joins `c` smoothly at `h` and falls off without ever
/// reaching 0.
pub(crate) fn seen_normal(smooth: Vec3, facet: Vec3, cos_facet: f32, direction: Vec3) -> (Vec3, f32) {
    let normal = smooth.normalize() * if smooth.dot(facet) < 0.0 { -1.0 } else { 1.0 };
    let cos = -normal.dot(direction);
    let half = 0.5 * cos_facet;
    if cos >= half {
        return (normal, cos.min(1.0));
    }
    let bent = half * half / (2.0 * half - cos);
    match (normal + direction * cos).try_normalize() {
        Some(across) => {
            // Orthogonalised again: what is left of a normal along the ray is mostly rounding.
            let across = across - direction * across.dot(direction);
            (across * (1.0 - bent * bent).sqrt() - direction * bent, bent)
        }
        // It points along the ray, at the back of a triangle that is seen edge-on.
        None => (facet, cos_facet),
    }
}

impl Tables {
    /// Whether two rows are parts of one object.
    pub(crate) fn is_of_one_object(&self, row: u32, other: u32) -> bool {
        let object = |row: u32| self.surfaces.rows.get(row as usize).map(|surface| surface.object);
        row == other || object(row).is_some_and(|one| object(other) == Some(one))
    }

    /// The interpolated normal of a smooth part at `time` and the weights `u` and `v` of the second and third corner of
    /// `triangle`, in the world frame, of any length and on the mesh's side; `None`: the part is flat, or the normals
    /// of its corners cancel.
    pub(crate) fn shading_normal(&self, surface: u32, triangle: u32, [u, v]: [f32; 2], time: f32) -> Option<Vec3> {
        let surfaces = &self.surfaces;
        if !surfaces.has_shading_normals {
            return None;
        }
        let row = surfaces.rows.get(surface as usize)?;
        if let Some(mover) = self.mover(row.object).filter(|mover| mover.bends()) {
            let smooth = mover.smooth_normal((row.number.into(), triangle, [u, v]), time)?;
            return Some(mover.path.at(time).normal(smooth))
                .filter(|normal| normal.length_squared() > f32::MIN_POSITIVE);
        }
        let part = &surfaces.parts[row.part as usize];
        let normals = part.normals.as_deref()?;
        let [a, b, c] = part.triangles[triangle as usize].map(|index| Vec3::from(normals[index as usize]));
        let smooth = self.turned(row.object, a * (1.0 - u - v) + b * u + c * v, time);
        (smooth.length_squared() > f32::MIN_POSITIVE).then_some(smooth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the smooth normal, the result faces the sensor, is on the side of the triangle, and changes little with
    /// it.
    #[test]
    fn smooth_normals_are_seen_wherever_the_triangle_is() {
        for cos_facet in [1.0_f32, 0.5, 0.1, 1e-3, 1e-6] {
            let along = Vec3::new((1.0 - cos_facet * cos_facet).sqrt(), 0.0, -cos_facet);
            let mut before: Option<(Vec3, f32)> = None;
            for step in 1..2000 {
                // All around, with the half on the other side flipped.
                let angle = std::f32::consts::PI * (step as f32 / 2000.0 - 0.5);
                let smooth = 3.0 * Vec3::new(angle.sin(), 0.02, angle.cos());
                let (normal, cos) = seen_normal(smooth, Vec3::Z, cos_facet, along);
                let case = format!("{smooth} of a triangle hit at {cos_facet}");
                assert!((normal.length() - 1.0).abs() < 1e-6 && normal.z > -1e-6, "{case}: {normal}");
                assert!(cos > 0.0 && (normal.dot(-along) - cos).abs() < 1e-6, "{case}: {cos}");
                let plain = smooth.normalize().dot(-along);
                assert!(cos >= plain.min(1.0) && (plain < 0.5 * cos_facet || cos == plain.min(1.0)), "{case}: {cos}");
                let moved = before.map_or(0.0, |(other, less)| (other - normal).length() + (less - cos).abs());
                // Where it passes the ray, at an offset of 0.02, its component across the ray turns most: by 0.0016 /
                // 0.02.
                assert!(moved < 0.09, "{case}: {moved}");
                before = Some((normal, cos));
            }
        }
        // Head-on from behind.
        let (normal, cos) = seen_normal(Vec3::X, Vec3::Z, 1e-6, Vec3::X);
        assert!(normal.is_normalized() && cos > 0.0, "{normal} {cos}");
    }
}
