//! What surfaces return to the sensor.

use crate::trace::{HitBatch, Surface, Surfaces, Tables, seen_normal};
use echocast_kernels::light;
use glam::Vec3;
use ground::lanes::{LANES, MISS, RayBatch, gather};
use model::material::{ByColor, Reflectances, Scattering, srgb_byte};
use std::ops::Range;

/// What images are sampled for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RequestedQuantities {
    pub colors: bool,
    pub reflectance: bool,
}

/// The surfaces hit by a block of beams, lane by lane.
#[repr(align(64))]
pub(crate) struct Contribution {
    /// Cosine of the incidence angle, 0..1.
    pub cos_incidence: [f32; LANES],
    /// Reflectance of a Lambert surface there that would return as much, 0 or more; above 1 for gloss and
    /// retro-reflectors, and for others at grazing incidence.
    pub reflectance: [f32; LANES],
    pub category_id: [u32; LANES],
    pub part_id: [u32; LANES],
    pub instance_id: [u32; LANES],
    pub material_id: [u32; LANES],
    pub red: [u8; LANES],
    pub green: [u8; LANES],
    pub blue: [u8; LANES],
}

impl Contribution {
    pub fn new() -> Self {
        Contribution {
            cos_incidence: [0.0; LANES],
            reflectance: [0.0; LANES],
            category_id: [0; LANES],
            part_id: [0; LANES],
            instance_id: [0; LANES],
            material_id: [0; LANES],
            red: [0; LANES],
            green: [0; LANES],
            blue: [0; LANES],
        }
    }

    /// Incidence of the first `count` rays, turning the normals of `hits` into unit vectors in the world frame on the
    /// sensor's side; interpolated ones where the part has them and `smooth` is set.
    pub fn face(&mut self, scene: &Tables, rays: &RayBatch, hits: &mut HitBatch, count: usize, smooth: bool) {
        if scene.surfaces.has_instances {
            hits.orient_normals(scene, rays, count);
        }
        self.meet(rays, hits);
        hits.facet = [hits.normal_x, hits.normal_y, hits.normal_z];
        if smooth {
            self.shade(scene, rays, hits, count);
        }
    }

    /// Incidence, turning the normals of `hits` into unit vectors on the sensor's side.
    fn meet(&mut self, rays: &RayBatch, hits: &mut HitBatch) {
        let normals = [&mut hits.normal_x, &mut hits.normal_y, &mut hits.normal_z];
        light::face(normals, [&rays.dir_x, &rays.dir_y, &rays.dir_z], &mut self.cos_incidence);
    }

    /// Replaces the triangle's normal by the interpolated shading normal on smooth parts, with its incidence. The
    /// triangle, turned to face the sensor by [`Contribution::meet`], determines on which side of the surface the
    /// sensor is; a shading normal that faces away from there is bent back ([`seen_normal`]).
    fn shade(&mut self, scene: &Tables, rays: &RayBatch, hits: &mut HitBatch, count: usize) {
        let surfaces = &scene.surfaces;
        let mut start = 0;
        while start < count {
            // Neighbours mostly hit the same surface.
            let index = hits.surface[start];
            let run = start..start + run_of(&hits.surface[start..count]);
            start = run.end;
            let Some(surface) = surfaces.rows.get(index as usize) else { continue };
            let part = &surfaces.parts[surface.part as usize];
            let Some(normals) = &part.normals else { continue };
            let matrix = scene.normal_matrices[surface.object as usize];
            let moves = scene.mover(surface.object).is_some();
            for lane in run {
                let (triangle, u, v) = (hits.triangle[lane], hits.u[lane], hits.v[lane]);
                let smooth = if moves {
                    scene.shading_normal(index, triangle, [u, v], rays.time[lane]).unwrap_or(Vec3::ZERO)
                } else {
                    let corners = part.triangles[triangle as usize];
                    let [a, b, c] = corners.map(|index| Vec3::from(normals[index as usize]));
                    matrix * (a * (1.0 - u - v) + b * u + c * v)
                };
                // Opposite vertex normals may cancel; then the triangle's own normal is kept.
                if smooth.length_squared() > f32::MIN_POSITIVE {
                    let (facet, cos_facet) = (hits.normal(lane), self.cos_incidence[lane]);
                    let (normal, cos) = seen_normal(smooth, facet, cos_facet, rays.direction(lane));
                    (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = normal.into();
                    self.cos_incidence[lane] = cos;
                }
            }
        }
    }

    /// Labels, colours and reflectance of the surfaces hit by the rays of `lanes`, whose incidence is known
    /// ([`Contribution::face`]). Neighbours mostly hit the same surface, so whole runs of lanes are filled at once.
    pub(crate) fn look_up(
        &mut self,
        surfaces: &Surfaces,
        reflectances: &Reflectances,
        hits: &HitBatch,
        lanes: Range<usize>,
        requested: RequestedQuantities,
    ) {
        let mut start = lanes.start;
        while start < lanes.end {
            let index = hits.surface[start];
            let run = start..start + run_of(&hits.surface[start..lanes.end]);
            start = run.end;
            if index != MISS {
                let surface = &surfaces.rows[index as usize];
                let reflectance = reflectances.by_material[surface.material as usize];
                self.category_id[run.clone()].fill(surface.category_id);
                self.part_id[run.clone()].fill(surface.part_id);
                self.instance_id[run.clone()].fill(surface.instance_id);
                self.material_id[run.clone()].fill(surface.material_id);
                self.reflectance[run.clone()].fill(reflectance);
                self.red[run.clone()].fill(surface.rgb[0]);
                self.green[run.clone()].fill(surface.rgb[1]);
                self.blue[run.clone()].fill(surface.rgb[2]);
                if (requested.colors && surface.textured) || (requested.reflectance && reflectance.is_nan()) {
                    let by_color = &reflectances.by_color[surface.material as usize];
                    self.sample(surfaces, by_color, surface, hits, run.clone());
                }
                if requested.reflectance && reflectances.scatter {
                    self.scatter(&surfaces.materials[surface.material as usize].scattering, run);
                }
            }
        }
    }

    /// Copies lane `other` of `from` to `lane`.
    pub fn take(&mut self, lane: usize, from: &Contribution, other: usize) {
        self.cos_incidence[lane] = from.cos_incidence[other];
        self.reflectance[lane] = from.reflectance[other];
        self.category_id[lane] = from.category_id[other];
        self.part_id[lane] = from.part_id[other];
        self.instance_id[lane] = from.instance_id[other];
        self.material_id[lane] = from.material_id[other];
        self.red[lane] = from.red[other];
        self.green[lane] = from.green[other];
        self.blue[lane] = from.blue[other];
    }

    /// Copies `lanes` of `from` to the first lanes.
    pub fn gather(&mut self, from: &Contribution, lanes: &[u8]) {
        let Contribution { cos_incidence, reflectance, red, green, blue, .. } = from;
        let Contribution { category_id, part_id, instance_id, material_id, .. } = from;
        gather(&mut self.cos_incidence, cos_incidence, lanes);
        gather(&mut self.reflectance, reflectance, lanes);
        gather(&mut self.category_id, category_id, lanes);
        gather(&mut self.part_id, part_id, lanes);
        gather(&mut self.instance_id, instance_id, lanes);
        gather(&mut self.material_id, material_id, lanes);
        gather(&mut self.red, red, lanes);
        gather(&mut self.green, green, lanes);
        gather(&mut self.blue, blue, lanes);
    }

    /// Clears the surface of a lane: it has no label, colour or incidence.
    pub fn clear(&mut self, lane: usize) {
        self.cos_incidence[lane] = f32::NAN;
        (self.category_id[lane], self.part_id[lane]) = (0, 0);
        (self.instance_id[lane], self.material_id[lane]) = (0, 0);
        (self.red[lane], self.green[lane], self.blue[lane]) = (0, 0, 0);
    }

    /// Converts lanes that scatter according to `model` into Lambert surfaces equally bright at their angle.
    #[inline(never)]
    fn scatter(&mut self, model: &Scattering, lanes: Range<usize>) {
        if *model != Scattering::Lambert {
            for lane in lanes {
                self.reflectance[lane] = model.as_lambert(self.reflectance[lane], self.cos_incidence[lane]);
            }
        }
    }

    /// Colour and reflectance of lanes whose surface has an image.
    #[inline(never)]
    fn sample(
        &mut self,
        surfaces: &Surfaces,
        by_color: &ByColor,
        surface: &Surface,
        hits: &HitBatch,
        lanes: Range<usize>,
    ) {
        for lane in lanes {
            let rgba = surfaces.base_color(surface, hits.triangle[lane], [hits.u[lane], hits.v[lane]]);
            [self.red[lane], self.green[lane], self.blue[lane]] = std::array::from_fn(|k| srgb_byte(rgba[k]));
            if self.reflectance[lane].is_nan() {
                self.reflectance[lane] = by_color.of(rgba);
            }
        }
    }
}

/// Length of the run of `surfaces` that equal the first.
fn run_of(surfaces: &[u32]) -> usize {
    surfaces.iter().position(|surface| *surface != surfaces[0]).unwrap_or(surfaces.len())
}
