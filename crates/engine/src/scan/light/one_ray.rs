//! Beams with one ray and one return each, block by block, step by step.

use super::block::{Block, no_images};
use super::plan::{Measuring, ScanPlan};
use super::split::{Axes, Splitter};
use crate::detect::{ForemostPaths, LaneEchoes, Returns};
use crate::echo::{EchoShape, PathLimits};
use crate::sensor::Signals;
use crate::trace::HitBatch;
use cloud::Slices;
use echocast_kernels::{light, rows};
use emitter;
use ground::lanes::{LANES, MEDIUM, MISS, RayBatch, boxed};
use std::sync::Arc;

impl Block {
    /// Scans beams `first .. first + count` (at most [`LANES`]) and fills the first of `rows`; returns how many.
    /// `splits`: how beams that hit more than one place are formed, if these are several rays.
    pub fn scan(
        &mut self,
        scan: &ScanPlan,
        splits: Option<&Arc<Signals>>,
        first: usize,
        count: usize,
        rows: Slices,
    ) -> usize {
        self.lanes.start_at(first);
        self.aim(scan, first, count);
        self.trace(scan, count);
        let mut splitter = splits.map(|signals| {
            let mut splitter = self.splitter.take().unwrap_or_else(boxed);
            self.split(scan, signals, &mut splitter, first, count);
            splitter
        });
        if scan.several_causes {
            self.reset_causes();
            self.view_end = self.hits.range;
            if let (Some(splitter), true) = (&splitter, scan.measure.shapes) {
                let shapes = splitter.oblique.map(EchoShape::of_plane);
                (self.widened, self.deviation) = (shapes.map(|shape| shape.width), shapes.map(|shape| shape.deviation));
            }
        }
        if !scan.receiver.efficiency.is_empty() {
            for lane in 0..count {
                self.efficiency[lane] = scan.receiver.efficiency_of(self.lanes.beam[lane]);
            }
        }
        if let Some(limits) = scan.world.paths {
            self.follow(scan, limits, count);
        }
        if let Some(eye) = scan.receiver.camera().and_then(|camera| camera.second_eye) {
            self.shadow(scan, eye, count);
        }
        let has_others = scan.receiver.may_prefer_others(scan.world.air);
        let is_split = splitter.as_ref().is_some_and(|splitter| !splitter.found.is_empty());
        let needs_surfaces = !scan.options.organised && !has_others && !is_split;
        if needs_surfaces && self.hits.surface[..count].iter().all(|&surface| surface == MISS) {
            self.splitter = splitter;
            return 0;
        }
        self.detect(scan, count);
        if let (Some(signals), Some(splitter)) = (splits, &mut splitter) {
            self.replace(scan, signals, splitter, first);
        }
        self.splitter = splitter;
        self.measure(scan, count);
        self.collect(scan, count, rows)
    }

    /// Finds the beams that are several rays, and dims the light of oblique surfaces for all others.
    fn split(&mut self, scan: &ScanPlan, signals: &Signals, splitter: &mut Splitter, first: usize, count: usize) {
        let Block { rays, hits, surfaces, scratch: power, .. } = self;
        power.fill(1.0);
        light::contribute(
            &hits.surface,
            &hits.range,
            &surfaces.reflectance,
            &surfaces.cos_incidence,
            &[1.0; LANES],
            power,
        );
        let cos_incidence = &surfaces.cos_incidence;
        splitter.find(scan, signals, Axes { first, count, rays, hits, cos_incidence, power });
        light::dim(&mut surfaces.reflectance, &splitter.oblique);
    }

    /// Steps 4 and 5: every beam at the pose of its own time.
    pub fn aim(&mut self, scan: &ScanPlan, first: usize, count: usize) {
        let nominal = scan.aim.beams.directions(first, count);
        let rays = |directions, rays: &mut RayBatch| {
            scan.aim.pose.rays(scan.aim.beams, first, directions, scan.aim.reach, rays);
        };
        if let Some(clock) = &scan.aim.clock {
            clock.set(&scan.aim.beams.time[first..first + count], &mut self.rays.time);
        }
        if !scan.points_elsewhere() {
            return rays(nominal, &mut self.rays);
        }
        rays(nominal, self.reported.get_or_insert_with(boxed));
        let (mut pointed, beams) = ([[0.0; LANES]; 3], &self.lanes.beam[..count]);
        match scan.receiver.jittering() {
            Some(camera) => camera.jitter_directions(&scan.rng, beams, nominal, &mut pointed),
            None => emitter::scatter(&scan.rng, beams, scan.measure.errors.pointing_sigma, nominal, &mut pointed),
        }
        if let Some(encoder) = &scan.measure.errors.encoder {
            encoder.correct(count, &mut pointed);
        }
        rays(pointed.each_ref().map(|axis| &axis[..count]), &mut self.rays);
    }

    /// Steps 6 and 8: what the rays hit, and its properties.
    pub fn trace(&mut self, scan: &ScanPlan, count: usize) {
        let Block { rays, hits, surfaces, .. } = self;
        hits.trace(scan.world.scene, rays, count, scan.aim.coherent, scan.world.sight);
        if scan.world.needs_normals {
            surfaces.face(scan.world.scene, rays, hits, count, scan.world.smooth);
        }
        if scan.world.needs_lookup {
            surfaces.look_up(
                &scan.world.scene.surfaces,
                &scan.world.reflectances,
                hits,
                0..count,
                scan.world.requested,
            );
        }
    }

    /// Step 7: beams that hit a mirror or glass see what is behind it. Of all echoes of a beam the one that the return
    /// mode prefers replaces that of the surface.
    #[inline(never)]
    fn follow(&mut self, scan: &ScanPlan, limits: PathLimits, count: usize) {
        (self.first_category, self.first_instance) = (self.surfaces.category_id, self.surfaces.instance_id);
        let Block { lanes: numbers, rays, hits, surfaces, cause, bounces, settled, efficiency, paths, images, .. } =
            self;
        let mut lanes = [0; LANES];
        let found = scan.going_on(&hits.surface, count, &mut lanes);
        let lanes = &lanes[..found];
        if lanes.is_empty() {
            return;
        }
        let follower = paths.get_or_insert_with(boxed);
        follower.forget_images();
        follower.begin(rays, hits, surfaces, lanes);
        let around = scan.surroundings(scan.air_on_the_way(), limits, scan.world.requested, rays);
        let (mut merit, mut image) = ([f32::NEG_INFINITY; LANES], [0; LANES]);
        let mut foremost = ForemostPaths {
            receiver: &scan.receiver,
            beams: &numbers.beam,
            farthest: &rays.range_max,
            efficiency,
            merit: &mut merit,
            hits,
            surfaces,
            cause,
            bounces,
            image: &mut image,
        };
        follower.follow(&around, &mut foremost);
        if scan.world.motion {
            let images = images.get_or_insert_with(no_images);
            lanes.iter().map(|&lane| usize::from(lane)).for_each(|lane| images[lane] = *follower.image(image[lane]));
        }
        for lane in lanes.iter().map(|&lane| usize::from(lane)) {
            if merit[lane] == f32::NEG_INFINITY {
                hits.surface[lane] = MISS;
            } else {
                settled[lane] = true;
            }
        }
    }

    /// Steps 9 and 10: which echo the instrument reports.
    fn detect(&mut self, scan: &ScanPlan, count: usize) {
        self.dim(scan, count);
        let Block { lanes, hits, surfaces, rho_eff, intensity, scratch, cause, settled, .. } = self;
        light::product(&surfaces.reflectance, &surfaces.cos_incidence, rho_eff);
        let mut shown = &surfaces.reflectance;
        if !scan.receiver.efficiency.is_empty() {
            for lane in 0..count {
                scratch[lane] = shown[lane] / scan.shown_of(lanes.beam[lane]);
            }
            shown = scratch;
        }
        scan.measure.intensity.of_all(shown, &surfaces.cos_incidence, &hits.range, intensity);
        let settled = scan.world.paths.is_some().then_some(&*settled);
        let HitBatch { range, surface, .. } = hits;
        let mut echoes = LaneEchoes { beams: &lanes.beam[..count], range, rho_eff, surface, cause };
        scan.receiver.detect_lanes(settled, intensity, &mut echoes);
        if scan.receiver.may_prefer_others(scan.world.air) {
            scan.receiver.prefer_others(&self.rays, scan.world.air, &self.efficiency, &self.view_end, &mut echoes);
            self.clear_others(scan, count);
        }
        if let Some(camera) = scan.receiver.camera() {
            self.form(scan, camera, count);
        }
    }

    /// Dims the surfaces: by weather on the way, by the efficiency of channels, and by lenses.
    fn dim(&mut self, scan: &ScanPlan, count: usize) {
        if let Some(air) = scan.air_on_the_way() {
            air.dim(&self.rays, &self.hits.range, count, &mut self.scratch);
            for lane in 0..LANES {
                if self.settled[lane] {
                    self.scratch[lane] = 1.0;
                }
            }
            light::dim(&mut self.surfaces.reflectance, &self.scratch);
        }
        if !scan.receiver.efficiency.is_empty() {
            light::dim(&mut self.surfaces.reflectance, &self.efficiency);
        }
        if let Some(camera) = scan.receiver.camera().filter(|camera| camera.dims()) {
            self.dim_by_lens(scan, camera, count);
        }
    }

    /// Step 10: measurement errors.
    pub fn measure(&mut self, scan: &ScanPlan, count: usize) {
        let Block { lanes, hits, rho_eff, formed, measured, intensity, shown, turn, scratch, .. } = self;
        let Measuring { errors, saturation, rain, limited, flickers, intensity: model, radiometry, assignment, .. } =
            &scan.measure;
        let channels = lanes.take(&scan.aim.beams.channel, count);
        let returns = Returns {
            beams: &lanes.beam[..count],
            numbers: &lanes.number[..count],
            channels: &channels[..count],
            rho_eff,
            range: &hits.range,
        };
        let formed = if scan.receiver.camera().is_some() { &*formed } else { &hits.range };
        errors.measure(&scan.rng, &returns, formed, *rain, measured, flickers.then_some(&mut *scratch));
        let saturated = |lane: usize| {
            let most = saturation.map_or(f32::INFINITY, |most| most * hits.range[lane] * hits.range[lane]);
            rho_eff[lane].min(most)
        };
        if *radiometry {
            for lane in 0..count {
                shown[lane] = saturated(lane) * if *flickers { scratch[lane] } else { 1.0 };
            }
        }
        if *flickers {
            for lane in 0..LANES {
                scratch[lane] *= saturated(lane);
            }
            if !scan.receiver.efficiency.is_empty() {
                for lane in 0..count {
                    scratch[lane] /= scan.shown_of(lanes.beam[lane]);
                }
            }
            model.of_all(scratch, &[1.0; LANES], &hits.range, intensity);
        } else if let Some(most) = saturation {
            for lane in 0..count {
                let most = most * hits.range[lane] * hits.range[lane];
                if rho_eff[lane] > most {
                    let shown = most / scan.shown_of(lanes.beam[lane]);
                    intensity[lane] = model.of(shown, 1.0, hits.range[lane]);
                }
            }
        }
        if *limited {
            scan.receiver.gate.limit(&lanes.beam[..count], measured, &mut hits.surface);
        }
        errors.lose(&scan.rng, &returns, &mut hits.surface);
        if errors.turn_beams() {
            let [x, y] = [&scan.aim.beams.dir_x, &scan.aim.beams.dir_y].map(|axis| lanes.take(axis, count));
            errors.turn(&scan.rng, &lanes.beam[..count], [&x[..count], &y[..count]], &mut turn[..count]);
        }
        if let Some(assignment) = *assignment {
            self.assign(scan, assignment, count);
        }
    }

    /// Clears the surfaces of the lanes whose echoes are those of the air and false alarms.
    fn clear_others(&mut self, scan: &ScanPlan, count: usize) {
        let Block { lanes: numbers, hits, surfaces, rho_eff, intensity, bounces, .. } = self;
        let mut lanes = [0; LANES];
        let found = rows::of_surface(&hits.surface, MEDIUM, count, &mut lanes);
        if found == 0 {
            return;
        }
        let [mut shown, mut range, mut reported] = [[0.0; LANES]; 3];
        for (place, lane) in lanes[..found].iter().map(|&lane| usize::from(lane)).enumerate() {
            surfaces.clear(lane);
            (self.first_category[lane], self.first_instance[lane], bounces[lane]) = (0, 0, 0);
            (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = (f32::NAN, f32::NAN, f32::NAN);
            (shown[place], range[place]) = (rho_eff[lane], hits.range[lane]);
            if !scan.receiver.efficiency.is_empty() {
                shown[place] /= scan.shown_of(numbers.beam[lane]);
            }
        }
        scan.measure.intensity.of_all(&shown, &[1.0; LANES], &range, &mut reported);
        for (place, lane) in lanes[..found].iter().map(|&lane| usize::from(lane)).enumerate() {
            intensity[lane] = reported[place];
        }
    }
}
