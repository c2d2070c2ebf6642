//! Heights of the ground at points of a survey.

use crate::scene::HeliosPart;
use crate::surfaces::MtlSurfaces;
use glam::{DAffine3, DMat3, DVec3};
use ground::error::Result;
use model::material::TextureBudget;
use scene_files::FileOptions;

/// World from the points of the files of a part.
pub(crate) fn placement(part: &HeliosPart) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_quat(part.rotation) * part.scale, part.offset)
}

/// Triangles of the ground.
#[derive(Default)]
pub(crate) struct GroundMesh(Vec<[DVec3; 3]>);

impl GroundMesh {
    /// Those of `parts`, each with the materials of its files, that are of materials which are ground.
    pub fn load(parts: &[(&HeliosPart, Vec<MtlSurfaces>)]) -> Result<GroundMesh> {
        let options = FileOptions { scale: 1.0, ..FileOptions::default() };
        let mut found = Vec::new();
        for (part, surfaces) in parts {
            for (file, surfaces) in
                part.files.iter().zip(surfaces).filter(|(_, own)| own.values().any(|one| one.ground))
            {
                const IMAGES_MIB: u64 = 4096;
                let scene = scene_files::read(file, &options, &mut TextureBudget::new(IMAGES_MIB))?;
                for object in &scene.objects {
                    let place = placement(part) * object.world_from_object;
                    for piece in &object.mesh.parts {
                        let name = piece.material.as_ref().map_or("", |material| material.name.as_str());
                        if !surfaces.get(name).is_some_and(|surface| surface.ground) {
                            continue;
                        }
                        let corner = |index: u32| {
                            place.transform_point3(DVec3::from_array(piece.positions[index as usize].map(f64::from)))
                        };
                        found.extend(piece.triangles.iter().map(|triangle| triangle.map(corner)));
                    }
                }
            }
        }
        Ok(GroundMesh(found))
    }

    /// Height at x and y, m: the lowest, as HELIOS++ looks up from below (getGroundPointAt in Scene.cpp,
    /// 3dgeo-heidelberg/helios fd94d1f).
    pub fn height(&self, x: f64, y: f64) -> Option<f64> {
        let heights = self.0.iter().filter_map(|corners| height_in(corners, x, y));
        heights.reduce(f64::min)
    }
}

/// Height of a triangle at x and y, m, by barycentric coordinates in the plane.
fn height_in([a, b, c]: &[DVec3; 3], x: f64, y: f64) -> Option<f64> {
    let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    let u = ((b.x - x) * (c.y - y) - (c.x - x) * (b.y - y)) / area;
    let v = ((c.x - x) * (a.y - y) - (a.x - x) * (c.y - y)) / area;
    let w = 1.0 - u - v;
    // Points on an edge belong to both of its triangles.
    let is_inside = area != 0.0 && [u, v, w].iter().all(|weight| *weight >= -1e-9);
    is_inside.then_some(u * a.z + v * b.z + w * c.z)
}
