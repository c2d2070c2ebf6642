//! One block of beams with a ray each and a return each, step by step.

use super::camera::Looks;
use super::run::Scan;
use crate::cause::Cause;
use crate::cloud::{Kept, Slices};
use crate::detect::Threshold;
use crate::echo::{AIR, Air, Answer, Chosen, Contribution, Follower, PathEcho, PathLimits, Surroundings};
use crate::material::Optics;
use crate::rng::Draw;
use crate::sensor::ReturnMode;
use crate::tof::Camera;
use crate::trace::{HitBatch, LANES, MISS, RayBatch};
use pulp::{Simd, WithSimd};

/// Beams `first .. first + count` and the rows they may fill.
pub(super) struct Task<'a> {
    pub scan: &'a Scan<'a>,
    pub first: usize,
    pub count: usize,
    pub rows: Slices<'a>,
}

/// A task with the memory it works in, to be run with the widest vector instructions of this machine.
pub(super) struct TaskOn<'a, 'b> {
    pub task: Task<'a>,
    pub block: &'b mut Block,
}

impl WithSimd for TaskOn<'_, '_> {
    type Output = usize;

    /// The rows filled.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        let Task { scan, first, count, mut rows } = self.task;
        let mut filled = 0;
        for start in (0..count).step_by(LANES) {
            let beam = first + start;
            filled += self.block.scan(scan, beam, LANES.min(count - start), rows.rows_after(filled));
        }
        filled
    }
}

/// The intermediate results of one block of beams: the table in the crate's documentation, column by column.
pub(super) struct Block {
    pub rays: RayBatch,
    pub hits: HitBatch,
    pub surfaces: Contribution,
    pub rho_eff: [f32; LANES],
    pub measured: [f32; LANES],
    pub intensity: [f32; LANES],
    /// Angle by which a beam is reported turned to the left, rad.
    pub turn: [f32; LANES],
    pub kept: Kept,
    pub scratch: [f32; LANES],
    pub answer: Answer,
    /// Memory to follow light in, where a scene has mirrors or glass.
    pub paths: Option<Box<(Follower, Chosen)>>,
    /// Memory of a depth camera to look from elsewhere in.
    pub looks: Option<Box<Looks>>,
}

impl Block {
    pub fn new() -> Self {
        Block {
            rays: RayBatch::new(),
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
            rho_eff: [0.0; LANES],
            measured: [0.0; LANES],
            intensity: [0.0; LANES],
            turn: [0.0; LANES],
            kept: Kept::new(),
            scratch: [0.0; LANES],
            answer: Answer::new(),
            paths: None,
            looks: None,
        }
    }

    /// Scans beams `first .. first + count` (at most [`LANES`]) and fills the first of `rows`; returns how many.
    #[inline(always)]
    fn scan(&mut self, scan: &Scan, first: usize, count: usize, rows: Slices) -> usize {
        self.aim(scan, first, count);
        self.trace(scan, count);
        if scan.paths.is_some() || scan.air.is_some() || scan.camera.is_some() {
            self.answer.reset();
            self.answer.end = self.hits.range;
        }
        if let Some(limits) = scan.paths {
            self.follow(scan, limits, first, count);
        }
        if let Some(eye) = scan.camera.and_then(|camera| camera.second_eye) {
            self.shadow(scan, eye, first, count);
        }
        let needs_surfaces = !scan.options.organised && !scan.air.as_ref().is_some_and(Air::answers);
        if needs_surfaces && self.hits.surface[..count].iter().all(|&surface| surface == MISS) {
            return 0;
        }
        self.detect(scan, first, count);
        self.collect(scan, first, count, rows)
    }

    /// Steps 4 and 5: every beam at the pose of its own time.
    #[inline(always)]
    fn aim(&mut self, scan: &Scan, first: usize, count: usize) {
        scan.aim.rays(scan.beams, first, count, scan.reach, &mut self.rays);
        if let Some(camera) = scan.camera.filter(|camera| camera.aside.is_some()) {
            self.look_aside(scan, camera, first, count);
        }
    }

    /// Steps 6 and 8: what the rays hit and what it is like.
    #[inline(always)]
    fn trace(&mut self, scan: &Scan, count: usize) {
        let Block { rays, hits, surfaces, .. } = self;
        hits.trace(scan.scene, rays, count, scan.coherent, scan.options.mask);
        if scan.wants_normals {
            surfaces.face(scan.scene, rays, hits, count, scan.smooth);
        }
        if scan.wants_surfaces {
            surfaces.look_up(&scan.scene.surfaces, &scan.reflectances, hits, count, scan.wanted);
        }
    }

    /// Step 7: beams that meet a mirror or glass see what is behind it. Of all echoes of a beam the one that the return
    /// mode prefers takes the place of the surface.
    #[inline(never)]
    fn follow(&mut self, scan: &Scan, limits: PathLimits, first: usize, count: usize) {
        let Block { rays, hits, surfaces, answer, paths, .. } = self;
        (answer.first_category, answer.first_instance) = (surfaces.category_id, surfaces.instance_id);
        let goes_on = |surface| scan.scene.surfaces.optics(&scan.reflectances, surface).is_some_and(Optics::goes_on);
        if !hits.surface[..count].iter().any(|&surface| goes_on(surface)) {
            return;
        }
        let (follower, chosen) = &mut **paths.get_or_insert_with(|| Box::new((Follower::new(), Chosen::new())));
        let depth = |from, direction, travelled, length| {
            // The paper's program knows weather on the whole of the way alone.
            let air = scan.air.as_ref().filter(|_| !scan.keeps_undetected);
            air.map_or(0.0, |air| air.depth(from, direction, travelled, length))
        };
        let around = Surroundings {
            scene: scan.scene,
            reflectances: &scan.reflectances,
            mask: scan.options.mask,
            smooth: scan.smooth,
            wanted: scan.wanted,
            limits,
            range_max: &rays.range_max,
            least_power: scan.threshold.least_power().filter(|_| !scan.keeps_undetected).unwrap_or(0.0) as f32,
            strongest: !scan.keeps_undetected && !matches!(scan.mode, ReturnMode::First | ReturnMode::Last),
            depth: &depth,
        };
        follower.follow(&around, rays, hits, surfaces, count, chosen, |echo: &PathEcho| {
            let rho_eff = echo.reflectance * echo.cos_incidence;
            let seen = scan.keeps_undetected || scan.threshold.detects(rho_eff, echo.range);
            let least = scan.beams.range_min.get(first + echo.lane).copied().unwrap_or(scan.range_min);
            let within = echo.range >= least && echo.range <= rays.range_max[echo.lane];
            (seen && within).then(|| match scan.mode {
                // The brighter one, whatever its range.
                _ if scan.keeps_undetected => rho_eff,
                ReturnMode::First => -echo.range,
                ReturnMode::Last => echo.range,
                _ => rho_eff / (echo.range * echo.range),
            })
        });
        for lane in 0..count {
            if !goes_on(hits.surface[lane]) {
                continue;
            }
            if chosen.strength[lane] == f32::NEG_INFINITY {
                hits.surface[lane] = MISS;
                continue;
            }
            hits.take(lane, &chosen.hits, lane);
            surfaces.take(lane, &chosen.surfaces, lane);
            (answer.cause[lane], answer.bounces[lane]) = (chosen.cause[lane], chosen.bounces[lane]);
            answer.dimmed[lane] = true;
        }
    }

    /// Steps 9 and 10: what the instrument makes of it.
    #[inline(always)]
    fn detect(&mut self, scan: &Scan, first: usize, count: usize) {
        let beams = first as u32;
        if let Some(air) = scan.air.as_ref().filter(|_| !scan.keeps_undetected) {
            air.dim(&self.rays, &self.hits.range, count, &mut self.scratch);
            for lane in 0..LANES {
                if self.answer.dimmed[lane] {
                    self.scratch[lane] = 1.0;
                }
            }
            for lane in 0..LANES {
                self.surfaces.reflectance[lane] *= self.scratch[lane];
            }
        }
        if let Some(camera) = scan.camera.filter(|camera| camera.dims()) {
            self.dim(scan, camera, first, count);
        }
        let Block { hits, surfaces, rho_eff, intensity, .. } = self;
        for lane in 0..LANES {
            rho_eff[lane] = surfaces.reflectance[lane] * surfaces.cos_incidence[lane];
            let (rho, cos) = (surfaces.reflectance[lane], surfaces.cos_incidence[lane]);
            intensity[lane] = scan.intensity.of(rho, cos, hits.range[lane]);
        }
        if let Some(air) = scan.air.as_ref().filter(|_| scan.keeps_undetected) {
            self.weather_of_the_program(scan, air, count);
        } else if scan.threshold != Threshold::Open {
            for lane in 0..LANES {
                if !scan.threshold.detects(rho_eff[lane], hits.range[lane]) {
                    intensity[lane] = 0.0;
                    if !scan.keeps_undetected {
                        hits.surface[lane] = MISS;
                    }
                }
            }
        }
        if !scan.camera.is_some_and(Camera::wraps) {
            scan.limit(&mut self.hits.surface, &self.hits.range, first, count);
        }
        if let Some(air) = scan.air.as_ref().filter(|air| air.answers()) {
            self.answer(scan, air, first, count);
        }
        if let Some(camera) = scan.camera {
            self.form(scan, camera, first, count);
        }
        let Block { hits, rho_eff, measured, turn, scratch, .. } = self;
        let formed = if scan.camera.is_some() { &*scratch } else { &hits.range };
        scan.range_error.measure(&scan.rng, beams, &rho_eff[..count], &formed[..count], &mut measured[..count]);
        if let Some(sigma) = scan.air.as_ref().map(Air::range_noise).filter(|&sigma| sigma > 0.0) {
            scan.rng.normals(beams, Draw::RainRange, &mut scratch[..count]);
            for lane in 0..count {
                measured[lane] = (measured[lane] + sigma * hits.range[lane] * scratch[lane]).max(0.0);
            }
        }
        scan.range_error.round(&mut measured[..count]);
        if scan.limits_measured {
            scan.limit(&mut hits.surface, measured, first, count);
        }
        if scan.dropout > 0.0 {
            scan.rng.uniforms(beams, Draw::Dropout, 0, &mut scratch[..count]);
            for lane in 0..count {
                if scratch[lane] < scan.dropout {
                    hits.surface[lane] = MISS;
                }
            }
        }
        if scan.azimuth_sigma > 0.0 {
            scan.rng.normals(beams, Draw::AzimuthJitter, &mut turn[..count]);
            turn.iter_mut().for_each(|angle| *angle *= scan.azimuth_sigma);
        }
    }

    /// Rain and dust as the paper's program has them: intensity is as without, or 0 where nothing is seen.
    #[inline(never)]
    fn weather_of_the_program(&mut self, scan: &Scan, air: &Air, count: usize) {
        let Block { hits, rho_eff, intensity, answer, .. } = self;
        for lane in 0..count {
            let limit = scan.threshold.limit_of_the_program(hits.range[lane]);
            let (tested, cloud) = air.as_the_program(hits.range[lane], rho_eff[lane], limit);
            if let Some((range, backscatter)) = cloud {
                (hits.range[lane], intensity[lane]) = (range, backscatter);
                answer.cause[lane] = Cause::Dust as u8;
            }
            if scan.threshold != Threshold::Open && tested <= limit {
                intensity[lane] = 0.0;
            }
        }
    }

    /// Echoes of the air in place of surfaces, where the instrument prefers them.
    #[inline(always)]
    fn answer(&mut self, scan: &Scan, air: &Air, first: usize, count: usize) {
        let Block { rays, hits, surfaces, rho_eff, intensity, answer, .. } = self;
        (answer.range, answer.rho_eff) = (hits.range, *rho_eff);
        air.answer(rays, &scan.rng, first as u32, count, &mut hits.surface, answer);
        (hits.range, *rho_eff) = (answer.range, answer.rho_eff);
        for lane in 0..count {
            if hits.surface[lane] == AIR {
                surfaces.clear(lane);
                (answer.first_category[lane], answer.first_instance[lane], answer.bounces[lane]) = (0, 0, 0);
                (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = (f32::NAN, f32::NAN, f32::NAN);
                intensity[lane] = scan.intensity.of(rho_eff[lane], 1.0, hits.range[lane]);
            }
        }
    }
}
