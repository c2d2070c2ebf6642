//! What returns along the rays of a block of beams that have several rays or several returns each: the arrivals of each
//! beam, and its echoes.

use super::plan::ScanPlan;
use super::rounds::{Evidence, Rounds};
use super::split::{Axes, Splitter};
use crate::detect::{Detections, ReceivedBeam};
use crate::echo::{
    AirArrivals, Arrivals, Batch, BeamRays, Contribution, Contributor, EchoShape, Follower, Meeting, Met, MirrorImage,
    OFF_SURFACE, PathArrivals, Peak, PieceOrigin, PieceSource, PlainEchoes, Provenance, RequestedQuantities,
    SurfacePlane, strongest_contributor,
};
use crate::sensor::Signals;
use echocast_kernels::light;
use emitter::{Across, Footprint};
use ground::cause::Cause;
use ground::lanes::{LANES, RayBatch, boxed};
use ground::rng::Draw;
use std::array;
use std::sync::Arc;

/// Rays that hit one surface closer together in range than this, in sigmas of the pulse, are one part of the signal: it
/// changes by less than `0.1^2 / 2`, 0.5 percent.
const BUNDLE: f32 = 0.1;

/// Buffers to form the signals and returns of a block of beams.
pub(super) struct Gatherer {
    /// How beams become signals, and these returns.
    signals: Arc<Signals>,
    pub(super) plain: PlainEchoes,
    pub(super) across: Across,
    /// The beams themselves.
    pub beams: RayBatch,
    /// The beams as reported, where these differ.
    pub reported: Option<Box<RayBatch>>,
    /// Fraction of the light that the channel of each beam uses.
    pub(super) efficiency: [f32; LANES],
    /// Factors by which the echoes of oblique planes are lower, where beams are one ray.
    oblique: [f32; LANES],
    pub rays: BeamRays,
    /// Buffers for beams of as many rays as it takes.
    pub(super) rounds: Option<Box<Rounds>>,
    pub arrivals: Arrivals,
    pub(super) surfaces: Contribution,
    /// Buffers to trace light, where a scene has mirrors or glass.
    pub(super) follower: Option<Box<Follower>>,
    /// The detections of one beam.
    pub found: Detections,
    /// Noise that looks like echoes: lane and apparent echo, in order of lanes.
    alarms: Vec<(usize, Peak)>,
    /// The surfaces that paths hit, if requested.
    pub log: Option<Vec<Meeting>>,
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
    /// Its shape, if that is requested.
    pub shape: EchoShape,
}

impl Gatherer {
    /// Sets it up for `signals`, whatever it was used for.
    pub fn fit(&mut self, signals: &Arc<Signals>) {
        if !Arc::ptr_eq(&self.signals, signals) {
            self.signals = signals.clone();
        }
        self.found.waveform.set_sigma(signals.sigma);
        (self.efficiency, self.oblique) = ([1.0; LANES], [1.0; LANES]);
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
            oblique: [1.0; LANES],
            rays: BeamRays::default(),
            rounds: None,
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
            let numbers = &numbers[..splitter.found.len()];
            self.gather(scan, &mut splitter.rays, numbers, &splitter.evidence);
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
        self.oblique = *factors;
        self.plain.dim(factors);
        light::dim(&mut self.rays.batches[0].power, factors);
    }

    /// Steps 5 to 8: what returns along every ray of `beams`. `rays` is a buffer for them; `evidence`, for beams of as
    /// many rays as it takes, what is known of each.
    pub fn gather(&mut self, scan: &ScanPlan, rays: &mut RayBatch, beams: &[u32], evidence: &[Evidence]) {
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
        match &signals.adaptive {
            Some(adaptive) => self.meet_in_rounds(scan, (signals, adaptive), rays, evidence),
            None => self.meet_ray_after_ray(scan, signals, rays, count),
        }
        if let Some(air) = scan.world.air.filter(|air| air.has_echoes()) {
            let Gatherer { arrivals, rays, efficiency, .. } = self;
            air.echoes(&self.beams, &scan.rng, beams, &mut AirArrivals::new(arrivals, rays, efficiency, beams.len()));
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
        self.rays.fit(signals.rays());
        let weight = 1.0 / self.rays.each as f32;
        let parts = self.efficiency.map(|efficiency| weight * efficiency);
        for index in 0..self.rays.each {
            if let Some(footprint) = &signals.footprint {
                footprint.rays(index, &self.across, &self.beams, rays);
            }
            self.meet(scan, (rays, scan.aim.coherent), index, count, &parts);
            self.go_on_from(scan, rays, index, count, &parts);
            let (origin, direction) = (rays.origins(), rays.directions());
            self.plain.add(&self.rays.batches[..=index], origin, direction, self.found.waveform.sigma());
        }
        self.plain.finish(&self.rays.batches[..self.rays.each], &self.found.waveform);
    }

    /// Fills batch `index` with what returns along the first `count` of `rays`. `parts`: fraction of its beam's light
    /// that each represents; `coherent`: whether neighbours among them are neighbours in space.
    pub(super) fn meet(
        &mut self,
        scan: &ScanPlan,
        (rays, coherent): (&RayBatch, bool),
        index: usize,
        count: usize,
        parts: &[f32; LANES],
    ) {
        let requested = RequestedQuantities { colors: false, reflectance: true };
        let Gatherer { rays: met, surfaces, .. } = self;
        let Batch { hits, cos_incidence, power, .. } = &mut met.batches[index];
        hits.trace(scan.world.scene, rays, count, coherent, scan.world.sight);
        surfaces.face(scan.world.scene, rays, hits, count, scan.world.smooth);
        surfaces.look_up(&scan.world.scene.surfaces, &scan.world.reflectances, hits, 0..count, requested);
        *cos_incidence = surfaces.cos_incidence;
        match &scan.world.air {
            Some(air) => air.dim(rays, &hits.range, count, power),
            None => power.fill(1.0),
        }
        light::contribute(&hits.surface, &hits.range, &surfaces.reflectance, cos_incidence, parts, power);
    }

    /// Follows light that continues from the surfaces that the rays of batch `index` hit, one ray of each beam in its
    /// lane.
    fn go_on_from(&mut self, scan: &ScanPlan, rays: &RayBatch, index: usize, count: usize, parts: &[f32; LANES]) {
        let Some(limits) = scan.world.paths else { return };
        let requested = RequestedQuantities { colors: false, reflectance: true };
        let Gatherer { rays: met, arrivals, surfaces, follower, log, .. } = self;
        let Batch { hits, power, .. } = &mut met.batches[index];
        let mut lanes = [0; LANES];
        let found = scan.going_on(&hits.surface, count, &mut lanes);
        if found > 0 {
            let (lanes, beams) = (&lanes[..found], &array::from_fn(|lane| lane as u8));
            let around = scan.surroundings(scan.world.air, limits, requested, rays);
            let (least_power, first) = (scan.least_power_of_paths(), &hits.surface);
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
        let plain = self.plain_peak(scan, lane);
        let Gatherer { signals, rays, arrivals, found, alarms, .. } = self;
        let (is_camera, alarms) = (scan.receiver.camera().is_some(), of_lane(alarms, lane));
        let mut received = ReceivedBeam { beam: beam as u32, plain, straight: f32::INFINITY, alarms };
        found.received.clear();
        if received.plain.is_none() || rays.is_mixed(lane, OFF_SURFACE * found.waveform.sigma()) {
            // What a pixel sees is not merged.
            let sigma = found.waveform.sigma();
            let width = if is_camera { -1.0 } else { BUNDLE * sigma };
            arrivals.receive(rays, lane, [width, sigma], &mut found.received);
            let direct = rays.of_beam(lane).filter(|(_, met)| met.power() > 0.0).map(|(_, met)| met.ends()[0]);
            received.straight = direct.fold(f32::INFINITY, f32::min);
        }
        scan.receiver.detect(&received, &signals.rule, found);
    }

    /// The echo of the beam at `lane` if it can have no other.
    fn plain_peak(&self, scan: &ScanPlan, lane: usize) -> Option<Peak> {
        let is_alone = !self.arrivals.has_others(lane) && of_lane(&self.alarms, lane).is_empty();
        self.plain.of(lane).filter(|_| is_alone && scan.receiver.camera().is_none())
    }

    /// All echoes of the beam at `lane`, after it was formed, detected or not.
    pub fn all_peaks(&mut self, scan: &ScanPlan, lane: usize) -> Vec<Peak> {
        let mut peaks = Vec::new();
        match self.plain_peak(scan, lane) {
            Some(peak) => peaks.push(peak),
            None => self.found.waveform.peaks(&self.found.received, &mut peaks),
        }
        peaks.extend(of_lane(&self.alarms, lane).iter().map(|&(_, peak)| peak));
        peaks
    }

    /// Which surface contributes most to the echo at `peak` of the beam at `lane`, and whether others contribute much.
    pub fn trace_back(&mut self, scan: &ScanPlan, lane: usize, beam: usize, peak: Peak) -> Found {
        let is_alarm = of_lane(&self.alarms, lane).iter().any(|&(_, alarm)| alarm == peak);
        let shape = if scan.measure.shapes && !is_alarm { self.shape(lane, peak) } else { EchoShape::default() };
        let found = |provenance| Found { peak, formed: peak.range, provenance, mixed: false, shape };
        if is_alarm {
            return found(Provenance::of_no_surface(Cause::FalseAlarm));
        }
        let Gatherer {
            signals,
            rays,
            rounds,
            arrivals,
            found: Detections { waveform, received, shares, .. },
            across,
            beams,
            ..
        } = self;
        let receiver = &scan.receiver;
        let sigma = waveform.sigma();
        let reach = receiver.reach_of_echo(peak.range, sigma);
        // All light of a pixel counts together, however far apart its sources are.
        let sigma = if receiver.camera().is_some() { 0.0 } else { sigma };
        let scale = if sigma > 0.0 { 1.0 / sigma } else { 0.0 };
        let contributors = arrivals.contributors(rays, lane, received, [peak.range, reach, scale]);
        // Where a ray hits its surface, and the normal of the triangle there; for one ray along the beam it does not
        // matter.
        let plane = |ray: u32, met: Met<'_>| {
            let footprint = signals.footprint.as_ref()?;
            let crossing = || footprint.crossing(ray as usize, across, beams, lane, met.range());
            let (place, normal) = (met.place().unwrap_or_else(crossing), met.batch.hits.facet(met.lane));
            Some(SurfacePlane { place, normal })
        };
        let origin = |from: &Contributor| match arrivals.source(from.source) {
            PieceSource::Other(from) => PieceOrigin { surface: from.surface, cause: from.cause, plane: None },
            PieceSource::Ray(ray) => rays.get(ray, lane).map_or(PieceOrigin::NOWHERE, |met| PieceOrigin {
                surface: met.surface(),
                cause: Cause::Surface,
                plane: plane(ray, met),
            }),
        };
        let apart = receiver.off_surface(sigma);
        let of_ray =
            |ray: u32| Provenance::of_ray(rays, lane, ray).unwrap_or(Provenance::of_no_surface(Cause::Surface));
        let Some(strongest) = strongest_contributor(contributors.clone(), origin, apart, shares) else {
            // A plain beam.
            return found(of_ray(rays.first_of(lane)));
        };
        let provenance = match arrivals.source(strongest.contributor.source) {
            PieceSource::Ray(ray) => of_ray(ray),
            PieceSource::Other(from) => *from,
        };
        // The light from off its plane: all of what no ray hits directly.
        let elsewhere = |to: SurfacePlane| -> f32 {
            let off = |from: Contributor| match arrivals.source(from.source) {
                PieceSource::Ray(ray) if rays.is_patched => {
                    let fan = rounds.as_ref().map(|rounds| rounds.fan(lane));
                    from.light * fan.map_or(0.0, |fan| rays.patchworks[lane].part_off(ray, fan, to, apart))
                }
                _ => {
                    let is_on = |plane: SurfacePlane| to.holds(plane.place, apart);
                    if origin(&from).plane.is_some_and(is_on) { 0.0 } else { from.light }
                }
            };
            contributors.map(off).sum()
        };
        let mixed = strongest.plane.map_or(0.0, elsewhere) > receiver.mixed_part() * strongest.light;
        let Some(camera) = receiver.camera() else { return Found { mixed, ..found(provenance) } };
        // The true range is that of the surface that most light comes from.
        let truth = strongest.contributor.range;
        let axis = scan.aim.beams.direction(beam).x;
        let seen = camera.aside.is_some().then(|| {
            let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, beam);
            rotation.x_axis.dot(beams.direction(lane))
        });
        let formed = camera.measure(&scan.rng, beam as u32, axis, seen, provenance.cos_incidence, peak.range);
        Found { peak: Peak { range: truth, power: peak.power }, formed, mixed, ..found(provenance) }
    }

    /// The shape of the echo at `peak` of the beam at `lane`.
    fn shape(&mut self, lane: usize, peak: Peak) -> EchoShape {
        let Gatherer { rays, found: Detections { waveform, received, .. }, .. } = self;
        let direct = rays.of_beam(lane).map(|(_, met)| (met.range(), met.power())).filter(|(_, power)| *power > 0.0);
        waveform.shape(received, direct, peak).unwrap_or(EchoShape::of_plane(self.oblique[lane]))
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
