//! One block of beams with several rays or several returns each: the light returned along all rays forms a signal, and
//! the echoes in it become returns.

use super::block::{Block, boxed, no_images};
use super::rays::{Batch, BeamRays};
use super::run::{ScanPlan, World};
use super::split::{Axes, OFF_SURFACE, OFF_SURFACE_M, Splitter};
use crate::cloud::Slices;
use crate::detect::Peak;
use crate::echo::{
    AirEcho, AirEchoes, Contribution, Follower, Meeting, PathEcho, PathEchoes, Pulselet, RequestedQuantities, Waveform,
};
use crate::emitter::{Across, Footprint};
use crate::ground::cause::Cause;
use crate::ground::lanes::{LANES, MEDIUM, MISS, RayBatch};
use crate::ground::rng::Draw;
use crate::sensor::{Adaptive, Signals};
use crate::trace::HitBatch;
use echocast_kernels::signal::PlainSignal;
use echocast_kernels::{light, signal};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

/// Rays that hit one surface closer together in range than this, in sigmas of the pulse, are one part of the signal: it
/// changes by less than `0.1^2 / 2`, 0.5 percent.
const BUNDLE: f32 = 0.1;

/// Fraction of an echo's light that must come from another surface for the echo to be mixed.
const MIXED: f32 = 0.1;

/// The same for a pixel, where all light counts, however far apart its sources are.
const MIXED_PIXEL: f32 = 0.02;

/// An echo that is not from a ray's own surface: from what is seen in mirrors and through glass, or from the air.
#[derive(Clone, Copy)]
pub(super) struct Other {
    pub range: f32,
    pub power: f32,
    /// The previous one of the same beam, or [`NONE`].
    pub before: u32,
    pub cause: Cause,
    pub bounces: u8,
    pub cos_incidence: f32,
    /// [`MEDIUM`] for the air.
    pub surface: u32,
    /// First surface on the path.
    pub first: u32,
    pub triangle: u32,
    pub uv: [f32; 2],
    pub normal: Vec3,
    /// Its apparent motion: a row of [`Follower::image`], 0 for what is seen directly.
    pub image: u32,
}

pub(super) const NONE: u32 = u32::MAX;

/// Source of an echo that is noise.
pub(super) const ALARM: u32 = u32::MAX;

/// All echoes that are not from a ray's own surface, chained beam by beam.
pub(super) struct Others {
    pub list: Vec<Other>,
    pub last: [u32; LANES],
}

impl Others {
    fn add(&mut self, lane: usize, other: Other) {
        self.list.push(Other { before: self.last[lane], ..other });
        self.last[lane] = self.list.len() as u32 - 1;
    }
}

/// The echo of a beam all of whose rays hit one place of one surface.
fn plain_peak(plain: &PlainSignal, lane: usize) -> Peak {
    Peak { range: plain.range[lane], power: plain.power[lane] }
}

/// Merges the rays of the beam at `lane` into `parts`, one for all that hit a surface within `width` m of range.
fn bundle(rays: &BeamRays, lane: usize, width: f32, parts: &mut Vec<Pulselet>, bundles: &mut Vec<(u32, [f32; 3])>) {
    bundles.clear();
    for (source, met) in (0..).zip(rays.of_beam(lane)) {
        let (surface, range, power) = (met.surface(), met.range(), met.power());
        if power <= 0.0 {
            continue;
        }
        let near = |(of, [first, ..]): &(u32, [f32; 3])| *of == surface && (range - first).abs() <= width;
        match bundles.iter().position(near) {
            Some(index) => {
                let (part, (_, [first, moment, most])) = (&mut parts[index], &mut bundles[index]);
                part.power += power;
                *moment += power * (range - *first);
                if power > *most {
                    (*most, part.source) = (power, source);
                }
            }
            None => {
                parts.push(Pulselet { range, power, source });
                bundles.push((surface, [range, 0.0, power]));
            }
        }
    }
    for (part, (_, [first, moment, _])) in parts.iter_mut().zip(bundles) {
        part.range = *first + *moment / part.power;
    }
}

/// Ranges that span less than this, in sigmas of the pulse, count as one.
const FINE: f32 = 1e-2;

/// Peak of an echo of the power `power` whose ranges have a `variance`, m^2, in addition to the pulse's `sigma`, m.
fn widened(power: f32, sigma: f32, variance: f32) -> f32 {
    power * sigma / (sigma * sigma + variance).sqrt()
}

/// Finds the echoes of such beams, whose `rays` have all been traced.
///
/// Rays that span more than the pulse sample a surface that is hit all over its span: a few of them, pulse by pulse,
/// would look like a row of echoes. With a spread `sigma_R` of the ranges the echo has the width `hypot(sigma,
/// sigma_R)`, and its peak falls as much as it widens.
fn finish(plain: &mut PlainSignal, rays: &[Batch], waveform: &Waveform) {
    let sigma = waveform.sigma();
    let mut wide = [false; LANES];
    let narrow = signal::middle(plain, Waveform::NARROW * sigma, FINE * sigma, &mut wide);
    let (middle, whole) = (plain.range, plain.power);
    if narrow {
        let signals = rays.iter().map(|ray| [&ray.hits.range, &ray.power]);
        waveform.refine_narrow(signals, [&mut plain.range, &mut plain.power]);
    }
    for lane in 0..LANES {
        if wide[lane] {
            let mean = plain.moments[0][lane] / whole[lane];
            let variance = (plain.moments[1][lane] / whole[lane] - mean * mean).max(0.0);
            plain.range[lane] = middle[lane];
            plain.power[lane] = widened(whole[lane], sigma, variance);
        }
    }
}

/// Buffers to form the signals and returns of a block of beams.
pub(super) struct Gatherer {
    /// How beams become signals, and these returns.
    signals: Arc<Signals>,
    plain: PlainSignal,
    across: Across,
    /// The beams themselves.
    pub beams: RayBatch,
    /// The beams as reported, where these differ.
    reported: Option<Box<RayBatch>>,
    /// Fraction of the light that the channel of each beam uses.
    efficiency: [f32; LANES],
    pub rays: BeamRays,
    /// Buffers for the axes of rays if beams are packed.
    axes_of_rays: Option<Box<PackedAxes>>,
    pub others: Others,
    surfaces: Contribution,
    /// Buffers to trace light, where a scene has mirrors or glass.
    follower: Option<Box<Follower>>,
    pub forming: Forming,
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
        PackedAxes { rays: RayBatch::default(), across: Across::new(), parts: [0.0; LANES], lanes: [0; LANES] }
    }
}

/// Buffers to form the signal of one beam.
pub(super) struct Forming {
    waveform: Waveform,
    parts: Vec<Pulselet>,
    /// For parts that represent several rays: surface, range of the first ray, sum of power times range beyond that,
    /// power of the strongest ray.
    bundles: Vec<(u32, [f32; 3])>,
    pub peaks: Vec<Peak>,
    order: Vec<usize>,
    /// Ranges and powers of the parts, as a depth camera takes them.
    ranges: Vec<f32>,
    powers: Vec<f32>,
    pub chosen: Vec<usize>,
    shares: Vec<Share>,
}

/// What a plane of a surface contributes to an echo.
struct Share {
    /// Row of the surface, and the cause.
    kind: [u32; 2],
    /// A point on it and its normal; none for what no ray hits directly.
    plane: Option<(Vec3, Vec3)>,
    light: f32,
    /// Light of its strongest part, and the source of that.
    most: f32,
    source: u32,
}

/// An echo and where it comes from.
#[derive(Clone, Copy)]
pub(super) struct Found {
    /// The echo, with its range before errors, m.
    pub peak: Peak,
    /// Range that a depth camera forms from it, m.
    pub formed: f32,
    pub source: u32,
    pub mixed: bool,
}

/// Echoes of what one ray sees in mirrors and through glass.
struct OfPaths<'a> {
    others: &'a mut Others,
    /// Fraction of the light of a ray of nominal strength that each ray contributes, including the efficiency of its
    /// channel.
    parts: &'a [f32; LANES],
    /// The lanes of the rays' beams.
    beams: &'a [u8; LANES],
    least_power: f32,
    first: &'a [u32; LANES],
    log: Option<&'a mut Vec<Meeting>>,
}

impl PathEchoes for OfPaths<'_> {
    fn least(&self, _: usize) -> f32 {
        self.least_power
    }

    fn take(&mut self, echo: &PathEcho, hits: &HitBatch, _: &Contribution) {
        let hit = echo.hit;
        let other = Other {
            range: echo.range,
            power: echo.reflectance * echo.cos_incidence * self.parts[echo.lane] / (echo.range * echo.range),
            before: NONE,
            cause: echo.cause,
            bounces: echo.bounces,
            cos_incidence: echo.cos_incidence,
            surface: hits.surface[hit],
            first: self.first[echo.lane],
            triangle: hits.triangle[hit],
            uv: [hits.u[hit], hits.v[hit]],
            normal: hits.normal(hit),
            image: echo.image,
        };
        if other.power > 0.0 {
            self.others.add(usize::from(self.beams[echo.lane]), other);
        }
    }

    fn meet(&mut self, meeting: Meeting) {
        if let Some(log) = &mut self.log {
            log.push(meeting);
        }
    }
}

/// Echoes of the air in front of what the rays of a beam hit.
struct OfAir<'a> {
    others: &'a mut Others,
    rays: &'a BeamRays,
    efficiency: &'a [f32; LANES],
}

impl AirEchoes for OfAir<'_> {
    fn end(&self, lane: usize) -> f32 {
        self.rays.of_beam(lane).map(|met| met.end()).fold(0.0, f32::max)
    }

    fn least(&self, _: usize) -> f32 {
        0.0
    }

    fn take(&mut self, lane: usize, echo: AirEcho, cause: Cause) -> bool {
        // Rays that surfaces stop before do not get there.
        let on = self.rays.of_beam(lane).filter(|met| met.end() > echo.range).count();
        let share = on as f32 / self.rays.each as f32;
        let other = Other {
            range: echo.range,
            power: echo.rho_eff * share * self.efficiency[lane] / (echo.range * echo.range),
            before: NONE,
            cause,
            bounces: 0,
            cos_incidence: 1.0,
            surface: MEDIUM,
            first: MEDIUM,
            triangle: 0,
            uv: [0.0; 2],
            normal: Vec3::NAN,
            image: 0,
        };
        if other.power > 0.0 {
            self.others.add(lane, other);
        }
        other.power > 0.0
    }
}

impl Gatherer {
    /// Sets it up for `signals`, whatever it was used for.
    pub fn fit(&mut self, signals: &Arc<Signals>) {
        if !Arc::ptr_eq(&self.signals, signals) {
            self.signals = signals.clone();
        }
        self.forming.waveform.set_sigma(signals.sigma);
        self.efficiency = [1.0; LANES];
    }
}

impl Default for Gatherer {
    fn default() -> Self {
        Gatherer {
            signals: Arc::default(),
            plain: PlainSignal::default(),
            across: Across::new(),
            beams: RayBatch::default(),
            reported: None,
            efficiency: [1.0; LANES],
            rays: BeamRays::default(),
            axes_of_rays: None,
            others: Others { list: Vec::new(), last: [NONE; LANES] },
            surfaces: Contribution::new(),
            follower: None,
            forming: Forming {
                waveform: Waveform::new(0.0),
                parts: Vec::new(),
                bundles: Vec::new(),
                peaks: Vec::new(),
                order: Vec::new(),
                ranges: Vec::new(),
                powers: Vec::new(),
                chosen: Vec::new(),
                shares: Vec::new(),
            },
            alarms: Vec::new(),
            log: None,
        }
    }
}

impl Block {
    /// [`Block::scan`] for beams of several rays or returns.
    pub fn scan_signals(
        &mut self,
        scan: &ScanPlan,
        signals: &Arc<Signals>,
        first: usize,
        count: usize,
        mut rows: Slices,
    ) -> usize {
        let mut gatherer = self.gatherer.take().unwrap_or_else(boxed);
        self.lanes.start_at(first);
        self.aim(scan, first, count);
        gatherer.beams = self.rays.clone();
        if scan.points_elsewhere() {
            gatherer.reported.clone_from(&self.reported);
        }
        let beams = &self.lanes.beam[..count];
        let filled = if let Some(Adaptive { one_ray, .. }) = &signals.adaptive {
            gatherer.fit(one_ray);
            gatherer.gather(scan, &mut self.rays, beams);
            let mut splitter = self.splitter.take().unwrap_or_else(boxed);
            splitter.find(scan, signals, gatherer.axes(first, count));
            gatherer.lower(&splitter.oblique);
            let mut parts = self.parts.take().unwrap_or_else(boxed);
            parts.split_up(scan, signals, &mut splitter, first, [&gatherer.beams, gatherer.reported_beams()]);
            let filled = self.report(scan, &mut gatherer, Some((&mut parts, &splitter.found)), first, count, &mut rows);
            (self.parts, self.splitter) = (Some(parts), Some(splitter));
            filled
        } else {
            gatherer.fit(signals);
            gatherer.gather(scan, &mut self.rays, beams);
            self.report(scan, &mut gatherer, None, first, count, &mut rows)
        };
        self.gatherer = Some(gatherer);
        filled
    }

    /// Replaces what the beams that `splitter` found would report as one ray by what they report as several.
    pub fn replace(&mut self, scan: &ScanPlan, signals: &Arc<Signals>, splitter: &mut Splitter, first: usize) {
        let mut parts = self.parts.take().unwrap_or_else(boxed);
        let reported = self.reported.as_deref().unwrap_or(&self.rays);
        parts.split_up(scan, signals, splitter, first, [&self.rays, reported]);
        for (from, lane) in splitter.found.iter().map(|&lane| usize::from(lane)).enumerate() {
            let beam = first + lane;
            parts.form(scan, from, beam);
            self.answer.dimmed[lane] = false;
            let Some(&chosen) = parts.forming.chosen.first() else {
                self.hits.surface[lane] = MISS;
                continue;
            };
            let echo = parts.found(scan, from, beam, parts.forming.peaks[chosen]);
            self.put(scan, &parts, from, lane, echo);
            self.name(scan, lane..lane + 1);
        }
        self.parts = Some(parts);
    }

    /// Steps 9 and 10: signal, echoes and returns of beam after beam. For the lanes of `split`, those of its gatherer.
    fn report(
        &mut self,
        scan: &ScanPlan,
        gatherer: &mut Gatherer,
        mut split: Option<(&mut Gatherer, &[u8])>,
        first: usize,
        count: usize,
        rows: &mut Slices,
    ) -> usize {
        let (mut filled, mut lanes, mut next) = (0, 0, 0);
        self.lanes.first = None;
        self.answer.reset();
        for lane in 0..count {
            let beam = first + lane;
            let (gatherer, lane) = match &mut split {
                Some((parts, found)) if found.get(next) == Some(&(lane as u8)) => {
                    next += 1;
                    (&mut **parts, next - 1)
                }
                _ => (&mut *gatherer, lane),
            };
            gatherer.form(scan, lane, beam);
            // A beam is kept in one piece, so that its returns can be counted.
            if lanes + gatherer.forming.chosen.len().max(1) > LANES {
                filled += self.flush(scan, lanes, rows.rows_after(filled));
                lanes = 0;
            }
            for number in 0..gatherer.forming.chosen.len() {
                let chosen = &gatherer.forming.chosen;
                // An echo that is reported twice has the same errors twice.
                let draws = if number > 0 && chosen[number] == chosen[number - 1] { number - 1 } else { number };
                let echo = gatherer.found(scan, lane, beam, gatherer.forming.peaks[chosen[number]]);
                self.put(scan, gatherer, lane, lanes, echo);
                (self.lanes.beam[lanes], self.lanes.number[lanes]) = (beam as u32, draws as u32);
                lanes += 1;
            }
            if gatherer.forming.chosen.is_empty() && scan.options.organised {
                self.hits.surface[lanes] = MISS;
                (self.lanes.beam[lanes], self.lanes.number[lanes]) = (beam as u32, 0);
                lanes += 1;
            }
        }
        filled + self.flush(scan, lanes, rows.rows_after(filled))
    }

    /// Writes `found`, an echo of the beam at `lane`, to lane `to` as a return.
    fn put(&mut self, scan: &ScanPlan, gatherer: &Gatherer, lane: usize, to: usize, found: Found) {
        let Block { rays, reported, hits, surfaces, rho_eff, formed, answer, images, .. } = self;
        let Found { peak, source, mixed, .. } = found;
        formed[to] = found.formed;
        rays.take(to, &gatherer.beams, lane);
        if scan.points_elsewhere()
            && let (Some(reported), Some(beams)) = (reported, &gatherer.reported)
        {
            reported.take(to, beams, lane);
        }
        let first;
        let mut cause = Cause::Surface;
        if source == ALARM {
            (hits.surface[to], surfaces.cos_incidence[to]) = (MEDIUM, 1.0);
            (hits.normal_x[to], hits.normal_y[to], hits.normal_z[to]) = (f32::NAN, f32::NAN, f32::NAN);
            (first, cause, answer.bounces[to]) = (MEDIUM, Cause::FalseAlarm, 0);
        } else if let Some(met) = gatherer.rays.get(source, lane) {
            hits.take(to, &met.batch.hits, met.lane);
            surfaces.cos_incidence[to] = met.cos_incidence();
            (first, answer.bounces[to]) = (met.surface(), 0);
        } else {
            let other = &gatherer.others.list[source as usize - gatherer.rays.each];
            (hits.normal_x[to], hits.normal_y[to], hits.normal_z[to]) = other.normal.into();
            [hits.u[to], hits.v[to]] = other.uv;
            (hits.triangle[to], hits.surface[to]) = (other.triangle, other.surface);
            surfaces.cos_incidence[to] = other.cos_incidence;
            (first, cause, answer.bounces[to]) = (other.first, other.cause, other.bounces);
            if let Some(follower) = gatherer.follower.as_ref().filter(|_| scan.world.motion) {
                images.get_or_insert_with(no_images)[to] = *follower.image(other.image);
            }
        }
        hits.range[to] = peak.range;
        rho_eff[to] = peak.power * peak.range * peak.range;
        answer.cause[to] = if mixed { Cause::Mixed } else { cause } as u8;
        let row = scan.world.scene.surfaces.rows.get(first as usize);
        (answer.first_category[to], answer.first_instance[to]) =
            row.map_or((0, 0), |row| (row.category_id, row.instance_id));
    }

    /// Step 11 of the first `count` lanes, and the errors before it.
    fn flush(&mut self, scan: &ScanPlan, count: usize, rows: Slices) -> usize {
        self.name(scan, 0..count);
        self.measure(scan, count);
        self.number_returns(count);
        self.collect(scan, count, rows)
    }

    /// Labels and intensity of what has been put in `lanes`.
    fn name(&mut self, scan: &ScanPlan, lanes: Range<usize>) {
        let Block { lanes: numbers, hits, surfaces, rho_eff, intensity, .. } = self;
        // The air has no labels to look up.
        let mut air = [false; LANES];
        for lane in lanes.clone() {
            air[lane] = hits.surface[lane] == MEDIUM;
            if air[lane] {
                hits.surface[lane] = MISS;
            }
        }
        let World { scene, reflectances, requested, .. } = &scan.world;
        surfaces.look_up(&scene.surfaces, reflectances, hits, lanes.clone(), *requested);
        for lane in lanes {
            // The reflectance that the surface would need to return as much.
            let cos = surfaces.cos_incidence[lane];
            let shown = rho_eff[lane] / cos / scan.shown_of(numbers.beam[lane]);
            intensity[lane] = scan.measure.intensity.of(shown, cos, hits.range[lane]);
            if air[lane] {
                surfaces.clear(lane);
                hits.surface[lane] = MEDIUM;
            }
        }
    }

    /// Numbers and counts the returns of each beam that are left.
    fn number_returns(&mut self, count: usize) {
        let Block { lanes, hits, .. } = self;
        let mut start = 0;
        while start < count {
            let same = lanes.beam[start..count].iter().take_while(|&&beam| beam == lanes.beam[start]).count();
            let beam = start..start + same;
            let left = beam.clone().filter(|&lane| hits.surface[lane] != MISS).count();
            let mut number = 0;
            for lane in beam {
                number += u8::from(hits.surface[lane] != MISS);
                (lanes.return_number[lane], lanes.return_count[lane]) = (number, left as u8);
            }
            start += same;
        }
    }
}

impl Gatherer {
    /// Gathers what returns along the beams that `splitter` found among `beams`, which are reported as `reported`; the
    /// first has the number `first`.
    fn split_up(
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
    fn reported_beams(&self) -> &RayBatch {
        self.reported.as_deref().unwrap_or(&self.beams)
    }

    /// Hits of the axes of `count` beams from `first` on, where beams are one ray.
    pub fn axes(&self, first: usize, count: usize) -> Axes<'_> {
        let Batch { hits, cos_incidence, power, .. } = &self.rays.batches[0];
        Axes { first, count, rays: &self.beams, hits, cos_incidence, power }
    }

    /// Reduces the directly returned light by `factors`, where beams are one ray.
    pub fn lower(&mut self, factors: &[f32; LANES]) {
        light::dim(&mut self.plain.power, factors);
        light::dim(&mut self.rays.batches[0].power, factors);
    }

    /// Steps 5 to 8: what returns along every ray of `beams`. `rays` is a buffer for them.
    pub fn gather(&mut self, scan: &ScanPlan, rays: &mut RayBatch, beams: &[u32]) {
        let signals = &*self.signals.clone();
        let count = beams.len();
        if let Some(follower) = &mut self.follower {
            follower.forget_images();
        }
        self.others.list.clear();
        self.others.last = [NONE; LANES];
        if let Some(footprint) = &signals.footprint {
            self.turn(scan, footprint, beams);
        }
        self.alarm(scan, beams);
        let uneven = scan.camera.is_some() || !scan.detect.efficiency.is_empty();
        for (lane, &beam) in beams.iter().enumerate().filter(|_| uneven) {
            let lens = scan.camera.map_or(1.0, |camera| camera.gain(scan.aim.beams.direction(beam as usize).x));
            self.efficiency[lane] = scan.efficiency_of(beam) * lens;
        }
        self.rays.fit(signals.rays(), signals.adaptive.is_some(), count);
        if self.rays.packed {
            self.meet_beam_after_beam(scan, signals, rays, count);
        } else {
            self.meet_ray_after_ray(scan, signals, rays, count);
        }
        if let Some(air) = scan.world.air.filter(|air| air.answers()) {
            let mut echoes = OfAir { others: &mut self.others, rays: &self.rays, efficiency: &self.efficiency };
            air.answer(&self.beams, &scan.rng, beams, &mut echoes);
        }
        if let Some(halos) = &scan.detect.halos {
            halos.shine(scan.aim.beams, beams, |lane, bright| {
                let other = Other {
                    range: bright.range,
                    power: bright.power * self.efficiency[lane],
                    before: NONE,
                    cause: Cause::Multipath,
                    bounces: 0,
                    cos_incidence: bright.cos_incidence,
                    surface: bright.surface,
                    first: bright.surface,
                    triangle: bright.triangle,
                    uv: bright.uv,
                    normal: bright.normal,
                    image: 0,
                };
                self.others.add(lane, other);
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
            let (plain, off) = (&mut self.plain, OFF_SURFACE * self.forming.waveform.sigma());
            let (before, batch) = self.rays.batches.split_at(index);
            let Batch { hits, power, .. } = &batch[0];
            let (origin, direction) = (rays.origins(), rays.directions());
            match before {
                [] => {
                    let normal = [&hits.normal_x, &hits.normal_y, &hits.normal_z];
                    signal::start(plain, normal, origin, direction, &hits.range, power);
                }
                [first, ..] => {
                    let first = &first.hits.surface;
                    signal::meet(plain, origin, direction, &hits.range, power, &hits.surface, first, off);
                }
            }
        }
        finish(&mut self.plain, &self.rays.batches[..self.rays.each], &self.forming.waveform);
    }

    /// Traces all rays of some beams, one beam after the other: as many as fit into a batch at a time.
    fn meet_beam_after_beam(&mut self, scan: &ScanPlan, signals: &Signals, rays: &mut RayBatch, count: usize) {
        let Some(footprint) = &signals.footprint else { return };
        self.plain.is = [false; LANES];
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
            self.join(lane);
        }
        self.axes_of_rays = Some(axes);
    }

    /// Merges the beam at `lane`, whose rays are packed, into one echo if they all hit one place of one surface.
    fn join(&mut self, lane: usize) {
        let sigma = self.forming.waveform.sigma();
        let mut rays = self.rays.of_beam(lane);
        let Some(first) = rays.next().filter(|first| first.power() > 0.0) else { return };
        let (mut power, mut moments, mut span) = (first.power(), [0.0; 2], [0.0f32; 2]);
        for met in rays {
            if met.power() <= 0.0 || !met.is_beside(&first, OFF_SURFACE * sigma) {
                return;
            }
            let beyond = met.range() - first.range();
            power += met.power();
            moments[0] += met.power() * beyond;
            moments[1] += met.power() * beyond * beyond;
            span = [span[0].min(beyond), span[1].max(beyond)];
        }
        let mean = moments[0] / power;
        let variance = (moments[1] / power - mean * mean).max(0.0);
        // As in `finish`; between the two the signal is searched.
        let span = span[1] - span[0];
        let wide = span > Waveform::NARROW * sigma;
        if wide || span <= FINE * sigma {
            self.plain.is[lane] = true;
            self.plain.range[lane] = first.range() + mean;
            self.plain.power[lane] = if wide { widened(power, sigma, variance) } else { power };
        }
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
        let Gatherer { rays: met, others, surfaces, follower, log, .. } = self;
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
            let least_power = 0.01 * scan.detect.threshold.faintest();
            let first = &hits.surface;
            let mut echoes = OfPaths { others, parts, beams, least_power, first, log: log.as_mut() };
            let follower = follower.get_or_insert_with(boxed);
            follower.begin(rays, hits, surfaces, lanes);
            follower.follow(&around, &mut echoes);
            lanes.iter().for_each(|&lane| power[usize::from(lane)] = 0.0);
        }
    }

    /// Draws the noise that looks like echoes.
    fn alarm(&mut self, scan: &ScanPlan, beams: &[u32]) {
        self.alarms.clear();
        if let Some(alarms) = &scan.detect.alarms {
            let limits = |beam| scan.limits_of(beam as usize);
            alarms.of_beams(&scan.rng, beams, scan.detect.range[1], limits, |lane, range, rho_eff| {
                self.alarms.push((lane, Peak { range, power: rho_eff / (range * range) }));
            });
        }
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

    /// Forms the signal of the beam at `lane`: `forming.peaks` has its detected echoes, `forming.chosen` the indices of
    /// those that are reported.
    pub fn form(&mut self, scan: &ScanPlan, lane: usize, beam: usize) {
        let Gatherer { signals, plain, rays, others, forming, alarms, .. } = self;
        let rule = &signals.rule;
        let Forming { waveform, parts, bundles, peaks, order, chosen, ranges, powers, .. } = forming;
        parts.clear();
        let [low, high] = scan.limits_of(beam);
        let is_reported = |peak: &Peak, echo: u32| {
            let rho_eff = peak.power * peak.range * peak.range;
            let noise = scan.detect.threshold.noise(&scan.rng, beam as u32, echo);
            (low..=high).contains(&peak.range)
                && peak.range > 0.0
                && scan.detect.threshold.detects(rho_eff, peak.range, noise)
        };
        let of_beam =
            alarms.partition_point(|&(other, _)| other < lane)..alarms.partition_point(|&(other, _)| other <= lane);
        if plain.is[lane] && others.last[lane] == NONE && of_beam.is_empty() && scan.camera.is_none() {
            let peak = plain_peak(plain, lane);
            peaks.clear();
            chosen.clear();
            if is_reported(&peak, 0) {
                peaks.push(peak);
                chosen.extend((0..rule.copies()).map(|_| 0));
            }
            return;
        }
        if scan.camera.is_none() {
            bundle(rays, lane, BUNDLE * waveform.sigma(), parts, bundles);
        } else {
            for (source, met) in rays.of_beam(lane).enumerate() {
                if met.power() > 0.0 {
                    parts.push(Pulselet { range: met.range(), power: met.power(), source: source as u32 });
                }
            }
        }
        let mut other = others.last[lane];
        while other != NONE {
            let Other { range, power, before, .. } = others.list[other as usize];
            parts.push(Pulselet { range, power, source: rays.each as u32 + other });
            other = before;
        }
        if let Some(camera) = scan.camera {
            // All light of a pixel becomes one range, and range limits apply to that.
            peaks.clear();
            chosen.clear();
            ranges.clear();
            powers.clear();
            ranges.extend(parts.iter().map(|part| part.range));
            powers.extend(parts.iter().map(|part| part.power));
            let formed = if parts.is_empty() { None } else { camera.form(&scan.rng, beam as u32, ranges, powers) };
            let (light, moment) = parts
                .iter()
                .fold((0.0, 0.0), |(light, moment), part| (light + part.power, moment + part.power * part.range));
            let truth = moment / light;
            let noise = scan.detect.threshold.noise(&scan.rng, beam as u32, 0);
            if let Some((range, power)) = formed
                && scan.detect.threshold.detects(power * truth * truth, truth, noise)
            {
                peaks.push(Peak { range, power });
                chosen.push(0);
            }
            return;
        }
        waveform.peaks(parts, peaks);
        // The nearest that rays hit directly is echo 0, others are distinguished by their range: so echoes of the air
        // do not change the draws of surfaces.
        let straight =
            rays.of_beam(lane).filter(|met| met.power() > 0.0).map(|met| met.range()).fold(f32::INFINITY, f32::min);
        let surface = peaks.iter().map(|peak| peak.range).find(|&range| range >= straight - waveform.sigma());
        peaks.retain(|peak| is_reported(peak, if Some(peak.range) == surface { 0 } else { peak.range.to_bits() }));
        peaks.extend(alarms[of_beam].iter().map(|&(_, peak)| peak));
        peaks.sort_unstable_by(|a, b| a.range.total_cmp(&b.range).then(a.power.total_cmp(&b.power)));
        rule.choose(peaks, order, chosen);
    }

    /// All echoes of the beam at `lane`, after it was formed, detected or not.
    pub fn all_peaks(&mut self, lane: usize) -> Vec<Peak> {
        let Forming { waveform, parts, .. } = &mut self.forming;
        let mut peaks = Vec::new();
        if parts.is_empty() && self.plain.is[lane] {
            peaks.push(plain_peak(&self.plain, lane));
        } else {
            waveform.peaks(parts, &mut peaks);
        }
        peaks.extend(self.alarms.iter().filter(|&&(other, _)| other == lane).map(|&(_, peak)| peak));
        peaks
    }

    /// Which surface contributes most to the echo at `peak` of the beam at `lane`, and whether others contribute much.
    pub fn found(&mut self, scan: &ScanPlan, lane: usize, beam: usize, peak: Peak) -> Found {
        if self.alarms.iter().any(|&(other, alarm)| other == lane && alarm == peak) {
            return Found { peak, formed: peak.range, source: ALARM, mixed: false };
        }
        if self.forming.parts.is_empty() {
            // A plain beam.
            return Found { peak, formed: peak.range, source: 0, mixed: false };
        }
        let Gatherer { signals, rays, others, forming, across, beams, .. } = self;
        let Forming { waveform, parts, shares, .. } = forming;
        // All light of a pixel counts together, however far apart its sources are.
        let sigma = if scan.camera.is_some() { 0.0 } else { waveform.sigma() };
        let rays_count = rays.each;
        let other_of = |source: u32| &others.list[source as usize - rays_count];
        let kind = |source: u32| match rays.get(source, lane) {
            Some(met) => [met.surface(), Cause::Surface as u32],
            None => [other_of(source).surface, other_of(source).cause as u32],
        };
        shares.clear();
        // All light of a pixel is one echo; without a pulse only what is at exactly this range.
        let reach = if scan.camera.is_some() { f32::INFINITY } else { (3.0 * sigma).max(1e-6 * peak.range) };
        let apart = if scan.camera.is_some() { OFF_SURFACE_M } else { OFF_SURFACE * sigma };
        let light = |part: &Pulselet| {
            let x = if sigma > 0.0 { (part.range - peak.range) / sigma } else { 0.0 };
            part.power * (-0.5 * x * x).exp()
        };
        let near = || parts.iter().filter(|part| (part.range - peak.range).abs() <= reach);
        // Where a ray hits its surface, and the normal of the triangle there; for one ray along the beam it does not
        // matter.
        let plane = |part: &Pulselet| match (rays.get(part.source, lane), &signals.footprint) {
            (Some(met), Some(footprint)) => {
                let place = footprint.crossing(part.source as usize, across, beams, lane, part.range);
                Some((place, met.batch.hits.facet(met.lane)))
            }
            _ => None,
        };
        let off = |of: &Share, plane: Option<(Vec3, Vec3)>| match (of.plane, plane) {
            (Some((here, normal)), Some((place, _))) => (place - here).dot(normal).abs() > apart,
            (here, plane) => here.is_some() != plane.is_some(),
        };
        let mut all = 0.0;
        for part in near() {
            let (light, plane, kind) = (light(part), plane(part), kind(part.source));
            all += light;
            match shares.iter_mut().find(|share| share.kind == kind && !off(share, plane)) {
                Some(share) => {
                    share.light += light;
                    if light > share.most {
                        (share.most, share.source) = (light, part.source);
                    }
                }
                None => shares.push(Share { kind, plane, light, most: light, source: part.source }),
            }
        }
        // The first of those that contribute equally.
        let mut greatest: Option<&Share> = None;
        for share in shares.iter() {
            if greatest.is_none_or(|greatest| share.light > greatest.light) {
                greatest = Some(share);
            }
        }
        let source = greatest.map_or(0, |share| share.source);
        let mut mixed = false;
        if let Some(share) = greatest.filter(|share| share.plane.is_some()) {
            let elsewhere: f32 = near().filter(|part| off(share, plane(part))).map(light).sum();
            mixed = elsewhere > if scan.camera.is_some() { MIXED_PIXEL } else { MIXED } * all;
        }
        let Some(camera) = scan.camera else { return Found { peak, formed: peak.range, source, mixed } };
        // The true range is that of the surface that most light comes from.
        let truth = parts.iter().find(|part| part.source == source).map_or(peak.range, |part| part.range);
        let axis = scan.aim.beams.direction(beam).x;
        let cos = match rays.get(source, lane) {
            Some(met) => met.cos_incidence(),
            None => other_of(source).cos_incidence,
        };
        let mut range = peak.range;
        if camera.aside.is_some() {
            // As in a pixel of one ray: the depth of the point that it really sees is reported in its nominal
            // direction.
            let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, beam);
            range *= rotation.x_axis.dot(beams.direction(lane)) / axis;
        }
        let formed = camera.err(&scan.rng, beam as u32, axis, cos, range);
        Found { peak: Peak { range: truth, power: peak.power }, formed, source, mixed }
    }
}
