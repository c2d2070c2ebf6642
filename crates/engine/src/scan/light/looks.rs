//! A block of beams of a depth camera: pixels.

use super::block::{Block, LookMemory};
use super::plan::ScanPlan;
use crate::detect::DepthCamera;
use crate::echo::RequestedQuantities;
use crate::trace::HitBatch;
use echocast_kernels::boundary::clearance;
use echocast_kernels::{camera as kernels, light};
use emitter::Aim;
use glam::{Mat3, Vec3};
use ground::cause::Cause;
use ground::lanes::{LANES, MEDIUM, MISS, boxed};
use ground::rng::Draw;
use std::f32::consts::TAU;

/// Fraction of the way to a surface that must be free for it to be visible. The rest is too short for a shadow that a
/// pixel would show, and keeps a slanted surface from hiding itself in single precision.
const FREE: f32 = 0.999;

/// Light by way of another surface is the cause of a point if it moves the point by more than this, m.
const MOVED: f32 = 0.005;

impl LookMemory {
    /// Aims the ray of a lane from `from` towards `to`; without `to`, it hits nothing.
    fn look(&mut self, lane: usize, from: Vec3, to: Option<Vec3>) {
        // Rays that are not needed end where they begin.
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
    /// Cosines of the angles between the rays, wherever they point, and the optical axis.
    fn off_axes(&self, scan: &ScanPlan, count: usize, to: &mut [f32; LANES]) {
        if let Aim::Fixed { rotation, .. } = &scan.aim.pose {
            return kernels::off_axis(rotation.x_axis.to_array(), self.rays.directions(), to);
        }
        for lane in 0..count {
            to[lane] = self.off_axis(scan, lane);
        }
    }

    /// Rotation to the world and position of the camera when a lane is exposed.
    fn pose(&self, scan: &ScanPlan, lane: usize) -> (Mat3, Vec3) {
        scan.aim.pose.pose(scan.aim.beams, self.lanes.beam[lane] as usize)
    }

    /// Cosine of the angle between the ray of a lane, wherever it points, and the optical axis.
    fn off_axis(&self, scan: &ScanPlan, lane: usize) -> f32 {
        let (rotation, _) = self.pose(scan, lane);
        rotation.x_axis.dot(self.rays.direction(lane))
    }

    /// Where the ray of a lane hits its surface.
    fn place(&self, lane: usize) -> Vec3 {
        self.rays.origin(lane) + self.rays.direction(lane) * self.hits.range[lane]
    }

    /// Whether a lane hits a surface without mirrors and glass in between.
    fn is_direct(&self, lane: usize) -> bool {
        self.hits.surface[lane] < MEDIUM && self.bounces[lane] == 0
    }

    /// Step 6: removes what is not visible from the `eye`, a point in the sensor frame, m. What is seen in a mirror or
    /// through glass is kept.
    #[inline(never)]
    pub fn shadow(&mut self, scan: &ScanPlan, eye: Vec3, count: usize) {
        let mut looks = self.looks.take().unwrap_or_else(boxed);
        let rays = &mut looks.rays;
        (rays.time, rays.beam) = (self.rays.time, self.rays.beam);
        match &scan.aim.pose {
            Aim::Fixed { rotation, origin } => {
                let eye = *rotation * eye + *origin;
                (rays.org_x, rays.org_y, rays.org_z) = ([eye.x; LANES], [eye.y; LANES], [eye.z; LANES]);
            }
            Aim::Moving { .. } => {
                for lane in 0..count {
                    let (rotation, origin) = self.pose(scan, lane);
                    (rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]) = (rotation * eye + origin).into();
                }
            }
        }
        kernels::look_at(
            self.rays.origins(),
            self.rays.directions(),
            &self.hits.range,
            FREE,
            [&rays.org_x, &rays.org_y, &rays.org_z],
            [&mut rays.dir_x, &mut rays.dir_y, &mut rays.dir_z],
            &mut rays.range_max,
        );
        for lane in 0..count {
            if !self.is_direct(lane) {
                looks.look(lane, Vec3::ZERO, None);
            }
        }
        let blocked = HitBatch::blocked(scan.world.scene, &looks.rays, count, scan.aim.coherent, scan.world.sight);
        for lane in 0..count {
            if blocked[lane] {
                self.hits.surface[lane] = MISS;
            }
        }
        self.looks = Some(looks);
    }

    /// Step 8: light of a wide projector that reaches the surfaces seen by the pixels via other surfaces, as echoes in
    /// `looks`; light via more than one other surface is neglected.
    ///
    /// With the emitted light `I`, the surface M scatters `rho_M I cos_M / (pi R_M^2)` 1/sr to T, and T scatters that
    /// light times `rho_T cos_T / pi`, over all directions, to the pixel, which receives `rho_T I cos_T / (pi R_T^2)`
    /// directly. So each of N directions drawn with the density `cos_T / pi` is an echo of power `rho_T rho_M cos_M /
    /// (N R_M^2)` where that of T is `rho_T cos_T / R_T^2`, at half of the path length `|SM| + |MT| + |TS|`.
    #[inline(never)]
    fn bounce(&mut self, scan: &ScanPlan, camera: &DepthCamera, looks: &mut LookMemory, count: usize) {
        let rays = camera.multipath_rays;
        let each = rays as usize + 1;
        (looks.rays.time, looks.rays.beam) = (self.rays.time, self.rays.beam);
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
                // Uniform over the disk, one in each ring of equal area, is weighted with the cosine over the
                // hemisphere.
                let square = (ray as f32 + u) / rays as f32;
                let (sin, cos) = (TAU * turn).sin_cos();
                let (across, up) = normal.any_orthonormal_pair();
                let direction = square.sqrt() * (cos * across + sin * up) + (1.0 - square).sqrt() * normal;
                let (facet, along) = (self.hits.facet(lane), self.rays.direction(lane));
                if direction.dot(facet) <= 0.0 {
                    // Through the triangle, whatever its shading normal.
                    looks.look(lane, Vec3::ZERO, None);
                    continue;
                }
                let [back, up] = clearance(1e-4 * self.hits.range[lane], -facet.dot(along));
                looks.set(lane, self.place(lane) + facet * up - along * back, direction, f32::INFINITY);
            }
            let LookMemory { rays: way, first: met, surfaces, .. } = &mut *looks;
            met.trace(scan.world.scene, way, count, false, scan.world.sight);
            surfaces.face(scan.world.scene, way, met, count, scan.world.smooth);
            let requested = RequestedQuantities { colors: false, reflectance: true };
            surfaces.look_up(&scan.world.scene.surfaces, &scan.world.reflectances, met, 0..count, requested);
            // Whether the projector illuminates it.
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
                // The illumination of T itself is included in its reflectance, as is the lens.
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
            let blocked = HitBatch::blocked(scan.world.scene, &looks.rays, count, false, scan.world.sight);
            for lane in 0..count {
                if blocked[lane] {
                    looks.powers[lane * each + ray as usize + 1] = 0.0;
                }
            }
        }
    }

    /// Step 8: lens and projector dim pixels off the axis.
    pub fn dim_by_lens(&mut self, scan: &ScanPlan, camera: &DepthCamera, count: usize) {
        let mut off_axes = [1.0; LANES];
        self.off_axes(scan, count, &mut off_axes);
        camera.dim(&off_axes, &mut self.surfaces.reflectance);
    }

    /// Step 9: the ranges that the pixels form from their light, before other errors, into `formed`.
    pub fn form(&mut self, scan: &ScanPlan, camera: &DepthCamera, count: usize) {
        let (mut powers, mut valid) = ([0.0; LANES], [false; LANES]);
        light::over_squares(&self.rho_eff, &self.hits.range, &mut powers);
        let beams = &self.lanes.beam[..count];
        camera.form_all(&scan.rng, beams, [&self.hits.range, &powers], &mut self.formed, &mut valid);
        if camera.multipath_rays > 0 {
            self.form_multipath(scan, camera, count, &mut valid);
        }
        light::keep(&valid, &mut self.hits.surface);
        let axis = self.lanes.take(&scan.aim.beams.dir_x, count);
        let mut off_axes = [1.0; LANES];
        let seen = camera.aside.is_some().then(|| {
            self.off_axes(scan, count, &mut off_axes);
            &off_axes
        });
        let beams = &self.lanes.beam[..count];
        camera.measure_all(&scan.rng, beams, &axis, seen, &self.surfaces.cos_incidence, &mut self.formed);
    }

    /// [`Block::form`] with the light that comes via other surfaces; `formed` and `valid` are those without it.
    #[inline(never)]
    fn form_multipath(&mut self, scan: &ScanPlan, camera: &DepthCamera, count: usize, valid: &mut [bool; LANES]) {
        let mut looks = self.looks.take().unwrap_or_else(boxed);
        self.bounce(scan, camera, &mut looks, count);
        let each = camera.multipath_rays as usize + 1;
        for lane in 0..count {
            if self.hits.surface[lane] == MISS {
                continue;
            }
            let echoes = lane * each..(lane + 1) * each;
            let (ranges, powers) = (&looks.ranges[echoes.clone()], &looks.powers[echoes]);
            let all = camera.form(&scan.rng, self.lanes.beam[lane], ranges, powers);
            if let Some((range, _)) = all
                && (!valid[lane] || (range - self.formed[lane]).abs() > MOVED)
            {
                self.cause[lane] = Cause::Multipath as u8;
            }
            valid[lane] = all.is_some();
            self.formed[lane] = all.map_or(self.formed[lane], |(range, _)| range);
        }
        self.looks = Some(looks);
    }
}
