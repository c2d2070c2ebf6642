//! What returns along the rays of a block of beams that have several rays or several returns each: the arrivals of each
//! beam, and its echoes.

use super::plan::ScanPlan;
use super::split::{Axes, Splitter};
use crate::detect::{Detections, ReceivedBeam};
use crate::echo::{
    AirArrivals, Arrivals, Batch, BeamRays, Contribution, Follower, Meeting, MirrorImage, PathArrivals, Peak,
    PlainEchoes, Provenance, Pulselet, RequestedQuantities, strongest_contributor,
};
use crate::sensor::Signals;
use echocast_kernels::{light, signal};
use emitter::{Across, Footprint};
use ground::cause::Cause;
use ground::lanes::{LANES, RayBatch, boxed};
use ground::rng::Draw;
use std::sync::Arc;

/// Rays that hit one surface closer together in range than this, in sigmas of the pulse, are one part of the signal: it
/// changes by less than `0.1^2 / 2`, 0.5 percent.
const BUNDLE: f32 = 0.1;

/// Buffers to form the signals and returns of a block of beams.
pub(super) struct Gatherer {
    /// How beams become signals, and these returns.
    signals: Arc<Signals>,
    plain: PlainEchoes,
    across: Across,
    /// The beams themselves.
    pub beams: RayBatch,
    /// The beams as reported, where these differ.
    pub reported: Option<Box<RayBatch>>,
    /// Fraction of the light that the channel of each beam uses.
    efficiency: [f32; LANES],
    pub rays: BeamRays,
    /// Buffers for the axes of rays if beams are packed.
    axes_of_rays: Option<Box<PackedAxes>>,
    pub arrivals: Arrivals,
    surfaces: Contribution,
    /// Buffers to trace light, where a scene has mirrors or glass.
    follower: Option<Box<Follower>>,
    /// The detections of one beam.
    pub found: Detections,
    /// Noise that looks like echoes: lane and apparent echo, in order of lanes.
    alarms: Vec<(usize, Peak)>,
    /// The surfaces that paths hit, if requested.
    pub log: Option<Vec<Meeting>>,
}

/// The beams of the rays of a batch if beams are packed, ray by ray.
struct PackedAxes {
    rays: RayBatch,
    across: Across,
    /// Fraction of its beam's light that each ray represents.
    parts: [f32; LANES],
    /// The lane of its beam.
    lanes: [u8; LANES],
}

impl Default for PackedAxes {
    fn default() -> Self {
        PackedAxes { rays: RayBatch::default(), across: Across::default(), parts: [0.0; LANES], lanes: [0; LANES] }
    }
}

/// An echo and where it comes from.
pub(super) struct Found {
    /// The echo, with its range before errors, m.
    pub peak: Peak,
    /// Range that a depth camera forms from it, m.
    pub formed: f32,
    /// That of its strongest contributor.
    pub provenance: Provenance,
    pub mixed: bool,
}

impl Gatherer {
    /// Sets it up for `signals`, whatever it was used for.
    pub fn fit(&mut self, signals: &Arc<Signals>) {
        if !Arc::ptr_eq(&self.signals, signals) {
            self.signals = signals.clone();
        }
        self.found.waveform.set_sigma(signals.sigma);
        self.efficiency = [1.0; LANES];
    }
}

impl Default for Gatherer {
    fn default() -> Self {
        Gatherer {
            signals: Arc::default(),
            plain: PlainEchoes::default(),
            across: Across::default(),
            beams: RayBatch::default(),
            reported: None,
            efficiency: [1.0; LANES],
            rays: BeamRays::default(),
            axes_of_rays: None,
            arrivals: Arrivals::default(),
            surfaces: Contribution::new(),
            follower: None,
            found: Detections::default(),
            alarms: Vec::new(),
            log: None,
        }
    }
}

impl Gatherer {
    /// Gathers what returns along the beams that `splitter` found among `beams`, which are reported as `reported`; the
    /// first has the number `first`.
    pub fn split_up(
        &mut self,
        scan: &ScanPlan,
        signals: &Arc<Signals>,
        splitter: &mut Splitter,
        first: usize,
        [beams, reported]: [&RayBatch; 2],
    ) {
        self.fit(signals);
        let mut numbers = [0; LANES];
        for (to, lane) in splitter.found.iter().map(|&lane| usize::from(lane)).enumerate() {
            self.beams.fill(to..to + 1, beams, lane);
            if scan.points_elsewhere() {
                self.reported.get_or_insert_with(boxed).take(to, reported, lane);
            }
            numbers[to] = (first + lane) as u32;
        }
        if !splitter.found.is_empty() {
            self.gather(scan, &mut splitter.rays, &numbers[..splitter.found.len()]);
        }
    }

    /// The beams as reported.
    pub fn reported_beams(&self) -> &RayBatch {
        self.reported.as_deref().unwrap_or(&self.beams)
    }

    /// Hits of the axes of `count` beams from `first` on, where beams are one ray.
    pub fn axes(&self, first: usize, count: usize) -> Axes<'_> {
        let Batch { hits, cos_incidence, power, .. } = &self.rays.batches[0];
        Axes { first, count, rays: &self.beams, hits, cos_incidence, power }
    }

    /// Reduces the directly returned light by `factors`, where beams are one ray.
    pub fn lower(&mut self, factors: &[f32; LANES]) {
        self.plain.dim(factors);
        light::dim(&mut self.rays.batches[0].power, factors);
    }

    /// Steps 5 to 8: what returns along every ray of `beams`. `rays` is a buffer for them.
    pub fn gather(&mut self, scan: &ScanPlan, rays: &mut RayBatch, beams: &[u32]) {
        let signals = &*self.signals.clone();
        let count = beams.len();
        if let Some(follower) = &mut self.follower {
            follower.forget_images();
        }
        self.arrivals.clear();
        if let Some(footprint) = &signals.footprint {
            self.turn(scan, footprint, beams);
        }
        self.alarm(scan, beams);
        if scan.receiver.is_uneven() {
            for (lane, &beam) in beams.iter().enumerate() {
                self.efficiency[lane] = scan.receiver.gain_of(beam);
            }
        }
        self.rays.fit(signals.rays(), signals.adaptive.is_some(), count);
        if self.rays.packed {
            self.meet_beam_after_beam(scan, signals, rays, count);
        } else {
            self.meet_ray_after_ray(scan, signals, rays, count);
        }
        if let Some(air) = scan.world.air.filter(|air| air.has_echoes()) {
            let Gatherer { arrivals, rays, efficiency, .. } = self;
            air.echoes(&self.beams, &scan.rng, beams, &mut AirArrivals { arrivals, rays, efficiency });
        }
        if let Some(halos) = &scan.halos {
            halos.shine(scan.aim.beams, beams, |lane, bright| {
                let power = bright.power * self.efficiency[lane];
                self.arrivals.add(lane, bright.range, power, bright.provenance);
            });
        }
    }

    /// Traces ray `i` of all beams, for one `i` after the other.
    fn meet_ray_after_ray(&mut self, scan: &ScanPlan, signals: &Signals, rays: &mut RayBatch, count: usize) {
        let own = std::array::from_fn(|lane| lane as u8);
        let weight = 1.0 / self.rays.each as f32;
        let parts = self.efficiency.map(|efficiency| weight * efficiency);
        for index in 0..self.rays.each {
            if let Some(footprint) = &signals.footprint {
                footprint.rays(index, &self.across, &self.beams, rays);
            }
            self.meet(scan, rays, index, count, &parts, &own);
            let (origin, direction) = (rays.origins(), rays.directions());
            self.plain.add(&self.rays.batches[..=index], origin, direction, self.found.waveform.sigma());
        }
        self.plain.finish(&self.rays.batches[..self.rays.each], &self.found.waveform);
    }

    /// Traces all rays of some beams, one beam after the other: as many as fit into a batch at a time.
    fn meet_beam_after_beam(&mut self, scan: &ScanPlan, signals: &Signals, rays: &mut RayBatch, count: usize) {
        let Some(footprint) = &signals.footprint else { return };
        self.plain.clear();
        let each = self.rays.each;
        let mut axes = self.axes_of_rays.take().unwrap_or_else(boxed);
        let PackedAxes { rays: beams, across, parts, lanes } = &mut *axes;
        let in_batch = self.rays.beams_of_batch();
        for (index, first) in (0..count).step_by(in_batch).enumerate() {
            let end = count.min(first + in_batch);
            for lane in first..end {
                let of_beam = (lane - first) * each..(lane - first + 1) * each;
                beams.fill(of_beam.clone(), &self.beams, lane);
                footprint.lay_out(across, of_beam.start, &self.across, lane);
                lanes[of_beam.clone()].fill(lane as u8);
                parts[of_beam].fill(self.efficiency[lane] / each as f32);
            }
            footprint.laid_out_rays(across, beams, rays);
            self.meet(scan, rays, index, (end - first) * each, parts, lanes);
            let Batch { hits, offset, .. } = &mut self.rays.batches[index];
            let normals = [&hits.normal_x, &hits.normal_y, &hits.normal_z];
            signal::offsets(normals, rays.origins(), rays.directions(), &hits.range, offset);
        }
        for lane in 0..count {
            self.plain.join(&self.rays, lane, self.found.waveform.sigma());
        }
        self.axes_of_rays = Some(axes);
    }

    /// Fills batch `index` with what returns along the first `count` of `rays`. `parts`: fraction of its beam's light
    /// that each represents; `beams`: the lane of its beam.
    fn meet(
        &mut self,
        scan: &ScanPlan,
        rays: &RayBatch,
        index: usize,
        count: usize,
        parts: &[f32; LANES],
        beams: &[u8; LANES],
    ) {
        let requested = RequestedQuantities { colors: false, reflectance: true };
        let Gatherer { rays: met, arrivals, surfaces, follower, log, .. } = self;
        let Batch { hits, cos_incidence, power, .. } = &mut met.batches[index];
        hits.trace(scan.world.scene, rays, count, scan.aim.coherent, scan.world.sight);
        surfaces.face(scan.world.scene, rays, hits, count, scan.world.smooth);
        surfaces.look_up(&scan.world.scene.surfaces, &scan.world.reflectances, hits, 0..count, requested);
        *cos_incidence = surfaces.cos_incidence;
        match &scan.world.air {
            Some(air) => air.dim(rays, &hits.range, count, power),
            None => power.fill(1.0),
        }
        light::contribute(&hits.surface, &hits.range, &surfaces.reflectance, cos_incidence, parts, power);
        let mut lanes = [0; LANES];
        let going_on = scan.world.paths.map(|limits| (limits, scan.going_on(&hits.surface, count, &mut lanes)));
        if let Some((limits, found @ 1..)) = going_on {
            let lanes = &lanes[..found];
            let around = scan.surroundings(scan.world.air, limits, requested, rays);
            // A hundredth of what is just detected adds nothing to what is detected.
            let least_power = 0.01 * scan.receiver.gate.least_power();
            let first = &hits.surface;
            let mut echoes = PathArrivals { arrivals, parts, beams, least_power, first, log: log.as_mut() };
            let follower = follower.get_or_insert_with(boxed);
            follower.begin(rays, hits, surfaces, lanes);
            follower.follow(&around, &mut echoes);
            lanes.iter().for_each(|&lane| power[usize::from(lane)] = 0.0);
        }
    }

    /// Draws the noise that looks like echoes.
    fn alarm(&mut self, scan: &ScanPlan, beams: &[u32]) {
        self.alarms.clear();
        scan.receiver.raise_alarms(beams, |lane, range, rho_eff| {
            self.alarms.push((lane, Peak { range, power: rho_eff / (range * range) }));
        });
    }

    /// Rotates the footprint of each beam.
    fn turn(&mut self, scan: &ScanPlan, footprint: &Footprint, beams: &[u32]) {
        let mut turns = [0.0; LANES];
        if footprint.turns {
            scan.rng.uniforms(beams, &[0; LANES][..beams.len()], Draw::Footprint, &mut turns[..beams.len()]);
        }
        for (lane, &beam) in beams.iter().enumerate() {
            let direction = self.beams.direction(lane);
            scan.set_across(&mut self.across, footprint, lane, beam as usize, direction, turns[lane]);
        }
    }

    /// Detects the echoes of the beam at `lane`: `found.peaks` has them, `found.chosen` the indices of those that are
    /// reported.
    pub fn form(&mut self, scan: &ScanPlan, lane: usize, beam: usize) {
        let Gatherer { signals, plain, rays, arrivals, found, alarms, .. } = self;
        let (is_camera, alarms) = (scan.receiver.camera().is_some(), of_lane(alarms, lane));
        let is_plain = !is_camera && !arrivals.has_others(lane) && alarms.is_empty();
        let mut received = ReceivedBeam { beam: beam as u32, plain: None, straight: f32::INFINITY, alarms };
        found.parts.clear();
        match plain.of(lane).filter(|_| is_plain) {
            Some(peak) => received.plain = Some(peak),
            None => {
                // What a pixel sees is not merged.
                let width = if is_camera { -1.0 } else { BUNDLE * found.waveform.sigma() };
                arrivals.receive(rays, lane, width, &mut found.parts);
                let direct = rays.of_beam(lane).filter(|met| met.power() > 0.0).map(|met| met.range());
                received.straight = direct.fold(f32::INFINITY, f32::min);
            }
        }
        scan.receiver.detect(&received, &signals.rule, found);
    }

    /// All echoes of the beam at `lane`, after it was formed, detected or not.
    pub fn all_peaks(&mut self, lane: usize) -> Vec<Peak> {
        let mut peaks = Vec::new();
        if self.found.parts.is_empty() {
            peaks.extend(self.plain.of(lane));
        } else {
            self.found.waveform.peaks(&mut self.found.parts, &mut peaks);
        }
        peaks.extend(of_lane(&self.alarms, lane).iter().map(|&(_, peak)| peak));
        peaks
    }

    /// Which surface contributes most to the echo at `peak` of the beam at `lane`, and whether others contribute much.
    pub fn trace_back(&mut self, scan: &ScanPlan, lane: usize, beam: usize, peak: Peak) -> Found {
        let found = |provenance| Found { peak, formed: peak.range, provenance, mixed: false };
        if of_lane(&self.alarms, lane).iter().any(|&(_, alarm)| alarm == peak) {
            return found(Provenance::of_no_surface(Cause::FalseAlarm));
        }
        let Gatherer {
            signals, rays, arrivals, found: Detections { waveform, parts, shares, .. }, across, beams, ..
        } = self;
        let receiver = &scan.receiver;
        let sigma = waveform.sigma();
        let reach = receiver.reach_of_echo(peak.range, sigma);
        let near = parts.iter().filter(|part| (part.range - peak.range).abs() <= reach);
        // All light of a pixel counts together, however far apart its sources are.
        let sigma = if receiver.camera().is_some() { 0.0 } else { sigma };
        let light = |part: &Pulselet| {
            let x = if sigma > 0.0 { (part.range - peak.range) / sigma } else { 0.0 };
            part.power * (-0.5 * x * x).exp()
        };
        // Where a ray hits its surface, and the normal of the triangle there; for one ray along the beam it does not
        // matter.
        let plane = |part: &Pulselet| {
            let (ray, footprint) = arrivals.provenance(part.source).ray.zip(signals.footprint.as_ref())?;
            let met = rays.get(ray, lane)?;
            let place = footprint.crossing(ray as usize, across, beams, lane, part.range);
            Some((place, met.batch.hits.facet(met.lane)))
        };
        let apart = receiver.off_surface(sigma);
        let Some(strongest) = strongest_contributor(arrivals, near, light, plane, apart, shares) else {
            // A plain beam.
            return found(Provenance::of_ray(rays, lane, 0).unwrap_or(Provenance::of_no_surface(Cause::Surface)));
        };
        let provenance = *arrivals.provenance(strongest.source);
        let mixed = strongest.elsewhere > receiver.mixed_part() * strongest.light;
        let Some(camera) = receiver.camera() else { return Found { mixed, ..found(provenance) } };
        // The true range is that of the surface that most light comes from.
        let truth = arrivals.range[strongest.source as usize];
        let axis = scan.aim.beams.direction(beam).x;
        let seen = camera.aside.is_some().then(|| {
            let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, beam);
            rotation.x_axis.dot(beams.direction(lane))
        });
        let formed = camera.measure(&scan.rng, beam as u32, axis, seen, provenance.cos_incidence, peak.range);
        Found { peak: Peak { range: truth, power: peak.power }, formed, provenance, mixed }
    }

    /// Apparent motion of what has the provenance `from`, if it is seen in mirrors or through glass.
    pub fn image(&self, from: &Provenance) -> Option<MirrorImage> {
        self.follower.as_ref().filter(|_| from.bounces > 0).map(|follower| *follower.image(from.image))
    }
}

/// Those of the `alarms` of a block that are of the beam at `lane`.
fn of_lane(alarms: &[(usize, Peak)], lane: usize) -> &[(usize, Peak)] {
    let before = |lane: usize| alarms.partition_point(|&(other, _)| other < lane);
    &alarms[before(lane)..before(lane + 1)]
}
