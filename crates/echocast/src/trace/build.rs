//! From the resolved scene to Embree's structure and the tables behind its ids.

use super::Tables;
use crate::error::Result;
use crate::material::Material;
use crate::report::Report;
use crate::scene::{Mesh, Object, Scene, cofactors};
use embree4::{CommittedScene, Device};
use glam::{DAffine3, DVec3, Mat3};
use std::sync::Arc;

/// A part of an object: what a hit on it means.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub category_id: u32,
    pub part_id: u32,
    pub instance_id: u32,
    pub material_id: u32,
    /// Index into [`Tables::materials`].
    pub material: u32,
    /// Index into [`Tables::parts`].
    pub part: u32,
    /// Index into [`Tables::normal_matrices`].
    pub object: u32,
    /// Base colour of the material's factor, sRGB.
    pub rgb: [u8; 3],
    /// Whether the base colour comes from an image.
    pub textured: bool,
    /// Whether hits come with normals in the mesh's frame.
    pub instanced: bool,
}

/// Scenes within this distance of the world's origin keep it as their own, so that coordinates stay
/// as the file has them: an f32 step there is 0.06 mm.
const NEAR_ORIGIN_M: f64 = 1000.0;

pub(super) fn build(scene: &Scene) -> Result<Tables> {
    let device = Device::new()?;
    let origin = local_origin(scene);
    let mut uses = vec![0usize; scene.meshes.len()];
    for object in &scene.objects {
        uses[object.mesh] += 1;
    }

    let mut parts = Vec::new();
    let first_part: Vec<u32> = scene
        .meshes
        .iter()
        .map(|mesh| {
            let first = parts.len() as u32;
            parts.extend(mesh.parts.iter().cloned());
            first
        })
        .collect();
    let materials: Vec<Material> = scene.materials.iter().cloned().chain([Material::default()]).collect();
    let material_ids = scene.labels.material.to_map();
    let default_material = scene.materials.len();

    let mut top = embree4::Scene::new(&device)?;
    let mut first_surface = Vec::new();
    let mut surfaces = Vec::new();
    let mut normal_matrices = Vec::with_capacity(scene.objects.len());
    let mut shared: Vec<Option<CommittedScene>> = vec![None; scene.meshes.len()];
    let mut has_instances = false;
    for (index, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh];
        let local_from_object = DAffine3::from_translation(-origin) * object.world_from_object;
        let first = surfaces.len() as u32;
        let matrix = columns(&local_from_object);
        // A copy that is squeezed flat cannot be an instance: rays could not be brought to its frame.
        let instanced = uses[object.mesh] > 1 && embree4::is_invertible(&matrix);
        if !instanced {
            // Vertices go to the top level in world space, so that rays need no transform.
            for (number, part) in mesh.parts.iter().enumerate() {
                let positions = part.positions.iter().map(|p| {
                    let local = DVec3::from(p.map(f64::from));
                    local_from_object.transform_point3(local).as_vec3().to_array()
                });
                top.attach_mesh(&embree4::Mesh::new(&device, positions, &part.triangles)?)?;
                first_surface.push(first + number as u32);
            }
        } else {
            has_instances = true;
            let of = match &mut shared[object.mesh] {
                Some(built) => &*built,
                empty => empty.insert(mesh_scene(&device, mesh)?),
            };
            top.attach_instance(of, matrix)?;
            first_surface.push(first);
        }
        for (number, part) in mesh.parts.iter().enumerate() {
            let material = &materials[part.material.unwrap_or(default_material)];
            surfaces.push(Surface {
                category_id: object.category_id,
                part_id: object.part_ids[number],
                instance_id: object.instance_id,
                material_id: material_ids.get(material.name.as_str()).copied().unwrap_or(0),
                material: part.material.unwrap_or(default_material) as u32,
                part: first_part[object.mesh] + number as u32,
                object: index as u32,
                rgb: std::array::from_fn(|c| crate::scene::srgb_byte(material.base_color[c])),
                textured: material.base_color_texture.is_some() && part.uvs.is_some(),
                instanced,
            });
        }
        normal_matrices.push(normal_matrix(object));
    }
    let mut report = Report::default();
    warn_of_far_objects(scene, origin, &mut report);
    Ok(Tables {
        report,
        committed: top.commit()?,
        packet_width: device.packet_width(),
        origin,
        first_surface,
        has_instances,
        has_shading_normals: parts.iter().any(|part| part.normals.is_some()),
        surfaces,
        normal_matrices,
        parts,
        materials,
        textures: scene.textures.clone(),
        labels: Arc::new(scene.labels.clone()),
    })
}

/// Farther from the scene's origin than this, coordinates lose more than half a millimetre.
const FAR_M: f64 = 8192.0;

/// The world's origin where the scene is near it, else, in whole metres, where the middle one of its triangles lies: a
/// stray object far from all others does not draw it away.
fn local_origin(scene: &Scene) -> DVec3 {
    if scene.object_boxes().all(|(_, corners)| reach(&corners, DVec3::ZERO) <= NEAR_ORIGIN_M) {
        return DVec3::ZERO;
    }
    let weight = |object: &Object| scene.meshes[object.mesh].triangle_count();
    let half = scene.triangle_count() / 2;
    let middle = |axis: usize| {
        // The first and the last corner of a box face each other.
        let centre = |corners: [DVec3; 8]| corners[0].midpoint(corners[7])[axis];
        let mut centres: Vec<_> =
            scene.object_boxes().map(|(object, corners)| (centre(corners), weight(object))).collect();
        centres.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut before = 0;
        let found = centres.iter().find(|(_, weight)| {
            before += weight;
            before > half
        });
        found.map_or(0.0, |(centre, _)| centre.round())
    };
    DVec3::new(middle(0), middle(1), middle(2))
}

/// Greatest coordinate of `corners` relative to `origin`, m.
fn reach(corners: &[DVec3; 8], origin: DVec3) -> f64 {
    corners.iter().map(|corner| (*corner - origin).abs().max_element()).fold(0.0, f64::max)
}

fn warn_of_far_objects(scene: &Scene, origin: DVec3, report: &mut Report) {
    let far = scene.object_boxes().map(|(object, corners)| (object, reach(&corners, origin)));
    let farthest = far.filter(|(_, reach)| *reach > FAR_M).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((object, reach)) = farthest {
        let km = reach / 1000.0;
        // Spacing of f32 numbers of this size.
        let step_mm = 1000.0 * 2f64.powi(reach.log2().floor() as i32 - 23);
        report.warn(format!(
            "object {:?} reaches {km:.0} km from the scene's origin at {:.0},{:.0},{:.0}: coordinates there are rounded to \
             {step_mm:.1} mm",
            object.name, origin.x, origin.y, origin.z,
        ));
    }
}

fn mesh_scene(device: &Device, mesh: &Mesh) -> Result<CommittedScene> {
    let mut scene = embree4::Scene::new(device)?;
    for part in &mesh.parts {
        scene.attach_mesh(&embree4::Mesh::new(device, part.positions.iter().copied(), &part.triangles)?)?;
    }
    Ok(scene.commit()?)
}

/// A transform as Embree takes it: column by column, single precision.
fn columns(m: &DAffine3) -> [f32; 12] {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    std::array::from_fn(|k| columns[k / 3][k % 3] as f32)
}

/// The matrix that takes an object's normals to the world's, up to length (scaled to unit size against underflow).
fn normal_matrix(object: &Object) -> Mat3 {
    let cofactors = cofactors(&object.world_from_object.matrix3);
    let size = cofactors.x_axis.abs().max(cofactors.y_axis.abs()).max(cofactors.z_axis.abs()).max_element();
    let scale = if size > 0.0 { 1.0 / size } else { 0.0 };
    // A mirrored object's cofactors point its normals inwards; surfaces are two-sided, so that is no matter.
    (cofactors * scale).as_mat3()
}
