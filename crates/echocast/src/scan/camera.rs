//! What a block of beams is to a depth camera: pixels.

use super::block::Block;
use super::run::Scan;
use crate::tof::Camera;
use crate::trace::{HitBatch, MISS, RayBatch};
use glam::Vec3;

impl Block {
    /// Step 5: pixels look beside their place. What they report stays along their own directions.
    #[inline(never)]
    pub fn look_aside(&mut self, scan: &Scan, camera: &Camera, first: usize, count: usize) {
        for lane in 0..count {
            let beam = first + lane;
            let place = camera.look_aside(&scan.rng, beam as u32, direction(scan, beam));
            let (rotation, _) = scan.aim.pose(scan.beams, beam);
            (self.rays.dir_x[lane], self.rays.dir_y[lane], self.rays.dir_z[lane]) = (rotation * place).into();
        }
    }

    /// Cosine of the angle between the ray of a lane, wherever it looks, and the optical axis.
    #[inline(always)]
    fn off_axis(&self, scan: &Scan, first: usize, lane: usize) -> f32 {
        let (rotation, _) = scan.aim.pose(scan.beams, first + lane);
        rotation.x_axis.dot(Vec3::new(self.rays.dir_x[lane], self.rays.dir_y[lane], self.rays.dir_z[lane]))
    }

    /// Step 6: takes away what the `eye`, a place in the sensor frame, m, does not see. What is seen in a mirror or
    /// through glass stays.
    #[inline(never)]
    pub fn shadow(&mut self, scan: &Scan, eye: Vec3, first: usize, count: usize) {
        /// Part of the way from the eye to a surface that must be free. The rest hides no shadow that a pixel shows, and
        /// single precision does not let a slanted surface hide itself.
        const FREE: f32 = 0.999;
        let Block { rays, hits, answer, second_eye, .. } = self;
        let (looks, seen) = &mut **second_eye.get_or_insert_with(|| Box::new((RayBatch::new(), HitBatch::new())));
        for lane in 0..count {
            let (rotation, origin) = scan.aim.pose(scan.beams, first + lane);
            let from = rotation * eye + origin;
            let along = Vec3::new(rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]);
            let start = Vec3::new(rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]);
            let way = start + along * hits.range[lane] - from;
            (looks.org_x[lane], looks.org_y[lane], looks.org_z[lane]) = from.into();
            let wanted = hits.surface[lane] != MISS && answer.bounces[lane] == 0;
            // Rays that nobody asked for end where they begin.
            let (direction, length) = if wanted { way.normalize_and_length() } else { (Vec3::X, 0.0) };
            (looks.dir_x[lane], looks.dir_y[lane], looks.dir_z[lane]) = direction.into();
            looks.range_max[lane] = length * FREE;
        }
        seen.trace(scan.scene, looks, count, scan.coherent, scan.options.mask);
        for lane in 0..count {
            if seen.surface[lane] != MISS {
                hits.surface[lane] = MISS;
            }
        }
    }

    /// Step 8: lens and projector dim pixels off the axis.
    #[inline(never)]
    pub fn dim(&mut self, scan: &Scan, camera: &Camera, first: usize, count: usize) {
        for lane in 0..count {
            self.surfaces.reflectance[lane] *= camera.gain(self.off_axis(scan, first, lane));
        }
    }

    /// Step 9: the ranges that the pixels make of their light, before other errors, into `scratch`.
    #[inline(never)]
    pub fn form(&mut self, scan: &Scan, camera: &Camera, first: usize, count: usize) {
        for lane in 0..count {
            if self.hits.surface[lane] == MISS {
                continue;
            }
            let (beam, truth) = (first + lane, self.hits.range[lane]);
            let power = self.rho_eff[lane] / (truth * truth);
            let Some((mut range, _)) = camera.form(&scan.rng, beam as u32, &[truth], &[power]) else {
                self.hits.surface[lane] = MISS;
                continue;
            };
            let axis = direction(scan, beam).x;
            if camera.aside.is_some() {
                // A depth image holds depths: the depth of the place it looks at goes where it should look.
                range *= self.off_axis(scan, first, lane) / axis;
            }
            self.scratch[lane] = camera.err(&scan.rng, beam as u32, axis, self.surfaces.cos_incidence[lane], range);
        }
    }
}

/// The direction that a beam should have, in the sensor frame.
#[inline(always)]
fn direction(scan: &Scan, beam: usize) -> Vec3 {
    Vec3::new(scan.beams.dir_x[beam], scan.beams.dir_y[beam], scan.beams.dir_z[beam])
}
