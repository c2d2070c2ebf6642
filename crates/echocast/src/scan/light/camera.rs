//! What a block of beams is to a depth camera: pixels.

use super::block::{Block, boxed};
use super::run::Scan;
use crate::echo::{Contribution, Wanted};
use crate::ground::cause::Cause;
use crate::ground::lanes::{LANES, MEDIUM, MISS, RayBatch};
use crate::ground::rng::Draw;
use crate::sensor::Camera;
use crate::trace::HitBatch;
use glam::{Mat3, Vec3};
use std::f32::consts::TAU;

/// Part of the way to a surface that must be free for it to be seen. The rest hides no shadow that a pixel shows, and
/// single precision does not let a slanted surface hide itself.
const FREE: f32 = 0.999;

/// Light that came over another surface is why a point is there if it moves it by more than this, m.
const MOVED: f32 = 0.005;

/// Memory of a block to look from elsewhere in: from a second eye, or after light that comes over other surfaces.
pub(super) struct Looks {
    rays: RayBatch,
    hits: HitBatch,
    /// What light comes over.
    first: HitBatch,
    surfaces: Contribution,
    /// Ranges, m, and powers, 1/m^2, of the echoes of each lane, the direct one first.
    ranges: Vec<f32>,
    powers: Vec<f32>,
}

impl Default for Looks {
    fn default() -> Self {
        Looks {
            rays: RayBatch::default(),
            hits: HitBatch::new(),
            first: HitBatch::new(),
            surfaces: Contribution::new(),
            ranges: Vec::new(),
            powers: Vec::new(),
        }
    }
}

impl Looks {
    /// Lets a lane look from `from` towards `to`; without, it sees nothing.
    fn look(&mut self, lane: usize, from: Vec3, to: Option<Vec3>) {
        // Rays that nobody asked for end where they begin.
        let (direction, length) = to.map_or((Vec3::X, 0.0), |to| (to - from).normalize_and_length());
        self.set(lane, from, direction, length * FREE);
    }

    fn set(&mut self, lane: usize, from: Vec3, direction: Vec3, range_max: f32) {
        let rays = &mut self.rays;
        (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = from.into();
        (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = direction.into();
        rays.range_max[lane] = range_max;
    }
}

impl Block {
    /// Step 5: pixels look beside their place. What they report stays along their own directions.
    #[inline(never)]
    pub fn look_aside(&mut self, scan: &Scan, camera: &Camera, count: usize) {
        for lane in 0..count {
            let beam = self.lanes.beam[lane] as usize;
            let place = camera.look_aside(&scan.rng, beam as u32, scan.beams.direction(beam));
            let (rotation, _) = self.pose(scan, lane);
            (self.rays.dir_x[lane], self.rays.dir_y[lane], self.rays.dir_z[lane]) = (rotation * place).into();
        }
    }

    /// Rotation to the world and place of the camera when a lane is exposed.
    fn pose(&self, scan: &Scan, lane: usize) -> (Mat3, Vec3) {
        scan.aim.pose(scan.beams, self.lanes.beam[lane] as usize)
    }

    /// Cosine of the angle between the ray of a lane, wherever it looks, and the optical axis.
    fn off_axis(&self, scan: &Scan, lane: usize) -> f32 {
        let (rotation, _) = self.pose(scan, lane);
        rotation.x_axis.dot(self.rays.direction(lane))
    }

    /// Where the ray of a lane meets its surface.
    fn place(&self, lane: usize) -> Vec3 {
        self.rays.origin(lane) + self.rays.direction(lane) * self.hits.range[lane]
    }

    /// Whether a lane meets a surface without mirrors and glass in between.
    fn is_direct(&self, lane: usize) -> bool {
        self.hits.surface[lane] < MEDIUM && self.answer.bounces[lane] == 0
    }

    /// Step 6: takes away what the `eye`, a place in the sensor frame, m, does not see. What is seen in a mirror or
    /// through glass stays.
    #[inline(never)]
    pub fn shadow(&mut self, scan: &Scan, eye: Vec3, count: usize) {
        let mut looks = self.looks.take().unwrap_or_else(boxed);
        for lane in 0..count {
            let (rotation, origin) = self.pose(scan, lane);
            looks.look(lane, rotation * eye + origin, self.is_direct(lane).then(|| self.place(lane)));
        }
        looks.hits.trace(scan.scene, &looks.rays, count, scan.coherent, scan.options.mask);
        for lane in 0..count {
            if looks.hits.surface[lane] != MISS {
                self.hits.surface[lane] = MISS;
            }
        }
        self.looks = Some(looks);
    }

    /// Step 8: light that a wide projector sends to other surfaces, and these to those that the pixels see, as echoes in
    /// `looks`; light over more surfaces is left out.
    ///
    /// With the light `I` that goes out, the surface M sends `rho_M I cos_M / (pi R_M^2)` 1/sr to T, and T that light
    /// times `rho_T cos_T / pi` over all directions to the pixel, which gets `rho_T I cos_T / (pi R_T^2)` straight. So each
    /// of N directions drawn with the density `cos_T / pi` is an echo of power `rho_T rho_M cos_M / (N R_M^2)` where that
    /// of T is `rho_T cos_T / R_T^2`, from half of the way `|SM| + |MT| + |TS|`.
    #[inline(never)]
    fn bounce(&mut self, scan: &Scan, camera: &Camera, looks: &mut Looks, count: usize) {
        let rays = camera.multipath_rays;
        let each = rays as usize + 1;
        looks.ranges.clear();
        looks.powers.clear();
        looks.ranges.resize(LANES * each, 0.0);
        looks.powers.resize(LANES * each, 0.0);
        for lane in 0..count {
            let range = self.hits.range[lane];
            looks.ranges[lane * each] = range;
            looks.powers[lane * each] = self.rho_eff[lane] / (range * range);
        }
        for ray in 0..rays {
            for lane in 0..count {
                let normal = self.hits.normal(lane);
                if !self.is_direct(lane) || !normal.is_normalized() {
                    looks.look(lane, Vec3::ZERO, None);
                    continue;
                }
                let [u, turn, ..] = scan.rng.four(self.lanes.beam[lane], Draw::SecondBounce, ray);
                // Evenly over the disk, one in each ring of equal area, is with the cosine over the hemisphere.
                let square = (ray as f32 + u) / rays as f32;
                let (sin, cos) = (TAU * turn).sin_cos();
                let (across, up) = normal.any_orthonormal_pair();
                let direction = square.sqrt() * (cos * across + sin * up) + (1.0 - square).sqrt() * normal;
                let start = self.place(lane) + 1e-4 * self.hits.range[lane] * normal;
                looks.set(lane, start, direction, f32::INFINITY);
            }
            let Looks { rays: way, first: met, surfaces, .. } = &mut *looks;
            met.trace(scan.scene, way, count, false, scan.options.mask);
            surfaces.face(scan.scene, way, met, count, scan.smooth);
            let wanted = Wanted { colors: false, reflectance: true };
            surfaces.look_up(&scan.scene.surfaces, &scan.reflectances, met, count, wanted);
            // Whether the projector sees it.
            for lane in 0..count {
                let (rotation, origin) = self.pose(scan, lane);
                let (surface, length) = (looks.first.surface[lane], looks.first.range[lane]);
                if surface == MISS || scan.goes_on(surface) || !self.is_direct(lane) {
                    looks.look(lane, origin, None);
                    continue;
                }
                let place = looks.rays.origin(lane) + looks.rays.direction(lane) * length;
                let (out, distance) = (place - origin).normalize_and_length();
                let met = &looks.first;
                let normal = met.normal(lane);
                let light = camera.light_along(rotation.transpose() * out);
                // The light on T itself is in its reflectance, as the lens is.
                let straight = camera.light(self.off_axis(scan, lane));
                let cos = -normal.dot(out);
                if cos > 0.0 && light > 0.0 && straight > 0.0 {
                    let echo = lane * each + ray as usize + 1;
                    let rho = self.surfaces.reflectance[lane] * looks.surfaces.reflectance[lane];
                    looks.ranges[echo] = 0.5 * (distance + length + self.hits.range[lane]);
                    looks.powers[echo] = rho * cos * light / (straight * rays as f32 * distance * distance);
                    looks.look(lane, origin, Some(place));
                } else {
                    looks.look(lane, origin, None);
                }
            }
            looks.hits.trace(scan.scene, &looks.rays, count, false, scan.options.mask);
            for lane in 0..count {
                if looks.hits.surface[lane] != MISS {
                    looks.powers[lane * each + ray as usize + 1] = 0.0;
                }
            }
        }
    }

    /// Step 8: lens and projector dim pixels off the axis.
    #[inline(never)]
    pub fn dim(&mut self, scan: &Scan, camera: &Camera, count: usize) {
        for lane in 0..count {
            self.surfaces.reflectance[lane] *= camera.gain(self.off_axis(scan, lane));
        }
    }

    /// Step 9: the ranges that the pixels make of their light, before other errors, into `formed`.
    #[inline(never)]
    pub fn form(&mut self, scan: &Scan, camera: &Camera, count: usize) {
        let mut looks = self.looks.take();
        if camera.multipath_rays > 0 {
            self.bounce(scan, camera, looks.get_or_insert_with(boxed), count);
        }
        let each = camera.multipath_rays as usize + 1;
        for lane in 0..count {
            if self.hits.surface[lane] == MISS {
                continue;
            }
            let (beam, truth) = (self.lanes.beam[lane], self.hits.range[lane]);
            let straight = camera.form(&scan.rng, beam, &[truth], &[self.rho_eff[lane] / (truth * truth)]);
            let formed = match &looks {
                Some(looks) if each > 1 => {
                    let echoes = lane * each..(lane + 1) * each;
                    camera.form(&scan.rng, beam, &looks.ranges[echoes.clone()], &looks.powers[echoes])
                }
                _ => straight,
            };
            let Some((mut range, _)) = formed else {
                self.hits.surface[lane] = MISS;
                continue;
            };
            if each > 1 && straight.is_none_or(|(straight, _)| (range - straight).abs() > MOVED) {
                self.answer.cause[lane] = Cause::Multipath as u8;
            }
            let axis = scan.beams.direction(self.lanes.beam[lane] as usize).x;
            if camera.aside.is_some() {
                // A depth image holds depths: the depth of the place it looks at goes where it should look.
                range *= self.off_axis(scan, lane) / axis;
            }
            self.formed[lane] = camera.err(&scan.rng, beam, axis, self.surfaces.cos_incidence[lane], range);
        }
        self.looks = looks;
    }
}
