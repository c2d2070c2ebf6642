//! One block of beams that are several rays each, or have several returns: what comes back of every ray makes a signal,
//! and the echoes in it make returns.

use super::block::{Block, boxed, no_images};
use super::run::Scan;
use crate::cloud::Slices;
use crate::detect::Peak;
use crate::echo::{
    AirEcho, AirEchoes, Contribution, Follower, Meeting, PathEcho, PathEchoes, Pulselet, Wanted, Waveform,
};
use crate::emitter::{Across, Footprint};
use crate::ground::cause::Cause;
use crate::ground::lanes::{LANES, MEDIUM, MISS, RayBatch};
use crate::ground::rng::Draw;
use crate::sensor::Signals;
use crate::trace::HitBatch;
use echocast_kernels::signal::Plain;
use echocast_kernels::{light, signal};
use glam::Vec3;

/// Off the surface that sends most of an echo, in sigmas of the pulse: farther away is another surface.
const OFF_SURFACE: f32 = 0.1;

/// The same for depth cameras, m.
const OFF_SURFACE_M: f32 = 0.01;

/// Part of an echo's light that must come from another surface for the echo to be mixed.
const MIXED: f32 = 0.1;

/// The same of a pixel, where all light counts, however far apart it comes from.
const MIXED_PIXEL: f32 = 0.02;

/// What one ray of a block's beams meets.
pub(super) struct Ray {
    pub hits: HitBatch,
    pub cos_incidence: [f32; LANES],
    /// What it adds to the signal, `rho_eff / R^2` in 1/m^2, its share of the beam taken into account; 0 is nothing.
    pub power: [f32; LANES],
}

/// An echo that no ray's own surface sends: of what is seen in mirrors and through glass, or of the air.
#[derive(Clone, Copy)]
pub(super) struct Other {
    pub range: f32,
    pub power: f32,
    /// The one of the same beam that was noted before it, or [`NONE`].
    pub before: u32,
    pub cause: Cause,
    pub bounces: u8,
    pub cos_incidence: f32,
    /// [`MEDIUM`] for the air.
    pub surface: u32,
    /// First surface on the way.
    pub first: u32,
    pub triangle: u32,
    pub uv: [f32; 2],
    pub normal: Vec3,
    /// How it is seen to move: a row of [`Follower::image`], 0 of what is seen directly.
    pub image: u32,
}

pub(super) const NONE: u32 = u32::MAX;

/// Source of an echo that is noise.
pub(super) const ALARM: u32 = u32::MAX;

/// All echoes that no ray's own surface sends, chained beam by beam.
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

/// The echo of a beam all of whose rays meet one place of one surface.
fn plain_peak(plain: &Plain, lane: usize) -> Peak {
    Peak { range: plain.range[lane], power: plain.power[lane] }
}

/// Finds the echoes of such beams, whose `rays` have all been met.
///
/// Rays that span more than the pulse stand for a surface that is met all over its span: a few of them, pulse by pulse,
/// would look like a row of echoes. With a spread `sigma_R` of the ranges the echo has the width
/// `hypot(sigma, sigma_R)`, and its peak falls as much as it widens.
fn finish(plain: &mut Plain, rays: &[Ray], waveform: &Waveform) {
    let sigma = waveform.sigma();
    let mut wide = [false; LANES];
    let narrow = signal::middle(plain, Waveform::NARROW * sigma, 1e-2 * sigma, &mut wide);
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
            plain.power[lane] = whole[lane] * sigma / (sigma * sigma + variance).sqrt();
        }
    }
}

/// Memory to make signals and returns of a block of beams in.
pub(super) struct Gatherer {
    plain: Plain,
    across: Across,
    /// The beams themselves.
    pub beams: RayBatch,
    /// The beams as they are reported to be, where those are others.
    reported: Option<Box<RayBatch>>,
    /// Part of the light that the channel of each beam makes use of.
    efficiency: [f32; LANES],
    pub rays: Vec<Ray>,
    pub others: Others,
    surfaces: Contribution,
    /// Memory to follow light in, where a scene has mirrors or glass.
    follower: Option<Box<Follower>>,
    pub forming: Forming,
    /// Noise that looks like echoes: lane, and what it looks like, lane after lane.
    alarms: Vec<(usize, Peak)>,
    /// Where paths lead, for those who want to know.
    pub log: Option<Vec<Meeting>>,
}

/// Memory to form the signal of one beam.
pub(super) struct Forming {
    waveform: Waveform,
    parts: Vec<Pulselet>,
    pub peaks: Vec<Peak>,
    order: Vec<usize>,
    /// Of the parts, as a depth camera takes them.
    ranges: Vec<f32>,
    powers: Vec<f32>,
    pub chosen: Vec<usize>,
    /// Light of each surface in an echo, and its strongest part: kind of surface, light, light of that part, its
    /// source.
    shares: Vec<([u32; 2], f32, f32, u32)>,
}

/// An echo and where it comes from.
#[derive(Clone, Copy)]
pub(super) struct Found {
    /// With its range before errors, m.
    pub peak: Peak,
    /// Range that a depth camera makes of it, m.
    pub formed: f32,
    pub source: u32,
    pub mixed: bool,
}

/// Echoes of what one ray sees in mirrors and through glass.
struct OfPaths<'a> {
    others: &'a mut Others,
    weight: f32,
    efficiency: &'a [f32; LANES],
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
            power: echo.reflectance * echo.cos_incidence * self.weight * self.efficiency[echo.lane]
                / (echo.range * echo.range),
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
            self.others.add(echo.lane, other);
        }
    }

    fn meet(&mut self, meeting: Meeting) {
        if let Some(log) = &mut self.log {
            log.push(meeting);
        }
    }
}

/// Echoes of the air in front of what the rays of a beam meet.
struct OfAir<'a> {
    others: &'a mut Others,
    rays: &'a [Ray],
    efficiency: &'a [f32; LANES],
}

impl AirEchoes for OfAir<'_> {
    fn end(&self, lane: usize) -> f32 {
        self.rays.iter().map(|ray| ray.end(lane)).fold(0.0, f32::max)
    }

    fn least(&self, _: usize) -> f32 {
        0.0
    }

    fn take(&mut self, lane: usize, echo: AirEcho, cause: Cause) -> bool {
        // What surfaces stop before does not get there.
        let on = self.rays.iter().filter(|ray| ray.end(lane) > echo.range).count();
        let share = on as f32 / self.rays.len() as f32;
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

impl Ray {
    fn new() -> Self {
        Ray { hits: HitBatch::new(), cos_incidence: [0.0; LANES], power: [0.0; LANES] }
    }

    /// Where the first surface is, m.
    fn end(&self, lane: usize) -> f32 {
        if self.hits.surface[lane] == MISS { f32::INFINITY } else { self.hits.range[lane] }
    }
}

impl Gatherer {
    /// Makes it one for `signals`, whatever it was for.
    pub fn fit(&mut self, signals: &Signals) {
        self.rays.resize_with(signals.rays(), Ray::new);
        self.forming.waveform.set_sigma(signals.sigma);
        self.efficiency = [1.0; LANES];
    }
}

impl Default for Gatherer {
    fn default() -> Self {
        Gatherer {
            plain: Plain::default(),
            across: Across::new(),
            beams: RayBatch::default(),
            reported: None,
            efficiency: [1.0; LANES],
            rays: Vec::new(),
            others: Others { list: Vec::new(), last: [NONE; LANES] },
            surfaces: Contribution::new(),
            follower: None,
            forming: Forming {
                waveform: Waveform::new(0.0),
                parts: Vec::new(),
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
        scan: &Scan,
        signals: &Signals,
        first: usize,
        count: usize,
        mut rows: Slices,
    ) -> usize {
        let mut gatherer = self.gatherer.take().unwrap_or_else(boxed);
        gatherer.fit(signals);
        self.lanes.start_at(first);
        self.aim(scan, first, count);
        gatherer.beams = self.rays.clone();
        if scan.points_elsewhere() {
            gatherer.reported.clone_from(&self.reported);
        }
        gatherer.gather(scan, signals, &mut self.rays, &self.lanes.beam[..count]);
        let filled = self.report(scan, signals, &mut gatherer, first, count, &mut rows);
        self.gatherer = Some(gatherer);
        filled
    }

    /// Steps 9 and 10: signal, echoes and returns of beam after beam.
    fn report(
        &mut self,
        scan: &Scan,
        signals: &Signals,
        gatherer: &mut Gatherer,
        first: usize,
        count: usize,
        rows: &mut Slices,
    ) -> usize {
        let (mut filled, mut lanes) = (0, 0);
        self.lanes.first = None;
        self.answer.reset();
        for lane in 0..count {
            let beam = first + lane;
            gatherer.form(scan, signals, lane, beam);
            // A beam is in one piece, so that its returns can be counted.
            if lanes + gatherer.forming.chosen.len().max(1) > LANES {
                filled += self.flush(scan, lanes, rows.rows_after(filled));
                lanes = 0;
            }
            for number in 0..gatherer.forming.chosen.len() {
                let chosen = &gatherer.forming.chosen;
                // An echo that is reported twice has the same errors twice.
                let draws = if number > 0 && chosen[number] == chosen[number - 1] { number - 1 } else { number };
                let echo = gatherer.found(scan, signals, lane, beam, gatherer.forming.peaks[chosen[number]]);
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

    /// Makes lane `to` the return that `found` of the beam at `lane` is.
    fn put(&mut self, scan: &Scan, gatherer: &Gatherer, lane: usize, to: usize, found: Found) {
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
        } else if let Some(ray) = gatherer.rays.get(source as usize) {
            hits.take(to, &ray.hits, lane);
            surfaces.cos_incidence[to] = ray.cos_incidence[lane];
            (first, answer.bounces[to]) = (ray.hits.surface[lane], 0);
        } else {
            let other = &gatherer.others.list[source as usize - gatherer.rays.len()];
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
    fn flush(&mut self, scan: &Scan, count: usize, rows: Slices) -> usize {
        let Block { lanes, hits, surfaces, rho_eff, intensity, scratch, .. } = self;
        // The air has no labels to look up.
        let mut air = [false; LANES];
        for lane in 0..count {
            air[lane] = hits.surface[lane] == MEDIUM;
            if air[lane] {
                hits.surface[lane] = MISS;
            }
        }
        let cos_incidence = surfaces.cos_incidence;
        surfaces.look_up(&scan.world.scene.surfaces, &scan.world.reflectances, hits, count, scan.world.wanted);
        for lane in 0..LANES {
            // What the surface would have to be to send back as much.
            scratch[lane] = rho_eff[lane] / cos_incidence[lane];
            if lane < count && !scan.detect.efficiency.is_empty() {
                scratch[lane] /= scan.shown_of(lanes.beam[lane]);
            }
            intensity[lane] = scan.measure.intensity.of(scratch[lane], cos_incidence[lane], hits.range[lane]);
        }
        for lane in 0..count {
            if air[lane] {
                surfaces.clear(lane);
                hits.surface[lane] = MEDIUM;
            }
        }
        self.measure(scan, count);
        self.number_returns(count);
        self.collect(scan, count, rows)
    }

    /// Counts the returns of each beam that are left.
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
    /// Steps 5 to 8: what every ray of `beams` sends back. `rays` is memory for them.
    pub fn gather(&mut self, scan: &Scan, signals: &Signals, rays: &mut RayBatch, beams: &[u32]) {
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
        let weight = 1.0 / signals.rays() as f32;
        let wanted = Wanted { colors: false, reflectance: true };
        for index in 0..self.rays.len() {
            let Gatherer {
                plain, across, beams, efficiency, rays: met, others, surfaces, follower, forming, log, ..
            } = self;
            let (before, ray) = met.split_at_mut(index);
            let ray = &mut ray[0];
            if let Some(footprint) = &signals.footprint {
                footprint.rays(index, across, beams, rays);
            }
            ray.hits.trace(scan.world.scene, rays, count, scan.aim.coherent, scan.options.mask);
            surfaces.face(scan.world.scene, rays, &mut ray.hits, count, scan.world.smooth);
            surfaces.look_up(&scan.world.scene.surfaces, &scan.world.reflectances, &ray.hits, count, wanted);
            ray.cos_incidence = surfaces.cos_incidence;
            ray.power = [weight; LANES];
            if let Some(air) = &scan.world.air {
                air.dim(rays, &ray.hits.range, count, &mut ray.power);
                ray.power.iter_mut().for_each(|part| *part *= weight);
            }
            let Contribution { reflectance, cos_incidence, .. } = surfaces;
            light::contribute(
                &ray.hits.surface,
                &ray.hits.range,
                reflectance,
                cos_incidence,
                efficiency,
                &mut ray.power,
            );
            let mut lanes = [0; LANES];
            let going_on = scan.world.paths.map(|limits| (limits, scan.going_on(&ray.hits.surface, count, &mut lanes)));
            if let Some((limits, found @ 1..)) = going_on {
                let lanes = &lanes[..found];
                let around = scan.surroundings(scan.world.air.as_ref(), limits, wanted, rays);
                // A hundredth of what is seen adds nothing to what is seen.
                let least_power = 0.01 * scan.detect.threshold.least_power().unwrap_or(0.0) as f32;
                let mut echoes =
                    OfPaths { others, weight, efficiency, least_power, first: &ray.hits.surface, log: log.as_mut() };
                let follower = follower.get_or_insert_with(boxed);
                follower.begin(rays, &ray.hits, surfaces, lanes);
                follower.follow(&around, &mut echoes);
                lanes.iter().for_each(|&lane| ray.power[usize::from(lane)] = 0.0);
            }
            let hits = &ray.hits;
            let (origin, direction) =
                ([&rays.org_x, &rays.org_y, &rays.org_z], [&rays.dir_x, &rays.dir_y, &rays.dir_z]);
            match before {
                [] => {
                    let normal = [&hits.normal_x, &hits.normal_y, &hits.normal_z];
                    signal::start(plain, normal, origin, direction, &hits.range, &ray.power);
                }
                [first, ..] => {
                    let off = OFF_SURFACE * forming.waveform.sigma();
                    let first = &first.hits.surface;
                    signal::meet(plain, origin, direction, &hits.range, &ray.power, &hits.surface, first, off);
                }
            }
        }
        finish(&mut self.plain, &self.rays, &self.forming.waveform);
        if let Some(air) = scan.world.air.as_ref().filter(|air| air.answers()) {
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

    /// Draws the noise that looks like echoes.
    fn alarm(&mut self, scan: &Scan, beams: &[u32]) {
        self.alarms.clear();
        if let Some(alarms) = &scan.detect.alarms {
            let limits = |beam| scan.limits_of(beam as usize);
            alarms.of_beams(&scan.rng, beams, scan.detect.range[1], limits, |lane, range, rho_eff| {
                self.alarms.push((lane, Peak { range, power: rho_eff / (range * range) }));
            });
        }
    }

    /// Turns the footprint of each beam.
    fn turn(&mut self, scan: &Scan, footprint: &Footprint, beams: &[u32]) {
        let mut turns = [0.0; LANES];
        if footprint.turns {
            scan.rng.uniforms(beams, &[0; LANES][..beams.len()], Draw::Footprint, &mut turns[..beams.len()]);
        }
        for (lane, &beam) in beams.iter().enumerate() {
            let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, beam as usize);
            if footprint.turns {
                self.across.set(lane, self.beams.direction(lane), rotation.z_axis, turns[lane]);
            } else {
                // The image plane at the distance 1 along the ray.
                let off_axis = scan.aim.beams.direction(beam as usize).x;
                self.across.set_axes(lane, [rotation.y_axis * off_axis, rotation.z_axis * off_axis], 0.0);
            }
        }
    }

    /// Forms the signal of the beam at `lane`: `forming.peaks` has its detected echoes, `forming.chosen` says which are
    /// reported.
    pub fn form(&mut self, scan: &Scan, signals: &Signals, lane: usize, beam: usize) {
        let Gatherer { plain, rays, others, forming, alarms, .. } = self;
        let Forming { waveform, parts, peaks, order, chosen, ranges, powers, .. } = forming;
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
                chosen.extend((0..signals.rule.copies()).map(|_| 0));
            }
            return;
        }
        for (source, ray) in rays.iter().enumerate() {
            if ray.power[lane] > 0.0 {
                parts.push(Pulselet { range: ray.hits.range[lane], power: ray.power[lane], source: source as u32 });
            }
        }
        let mut other = others.last[lane];
        while other != NONE {
            let Other { range, power, before, .. } = others.list[other as usize];
            parts.push(Pulselet { range, power, source: rays.len() as u32 + other });
            other = before;
        }
        if let Some(camera) = scan.camera {
            // All light of a pixel becomes one range, and range limits hold for that.
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
        // The nearest that rays meet straight away is echo 0, others are told apart by their range: so echoes of the
        // air do not move the chances of surfaces.
        let straight = rays
            .iter()
            .filter(|ray| ray.power[lane] > 0.0)
            .map(|ray| ray.hits.range[lane])
            .fold(f32::INFINITY, f32::min);
        let surface = peaks.iter().map(|peak| peak.range).find(|&range| range >= straight - waveform.sigma());
        peaks.retain(|peak| is_reported(peak, if Some(peak.range) == surface { 0 } else { peak.range.to_bits() }));
        peaks.extend(alarms[of_beam].iter().map(|&(_, peak)| peak));
        peaks.sort_by(|a, b| a.range.total_cmp(&b.range));
        signals.rule.choose(peaks, order, chosen);
    }

    /// All echoes of the beam at `lane`, after it was formed, seen or not.
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

    /// Which surface sends most of the echo at `peak` of the beam at `lane`, and whether others send much.
    pub fn found(&mut self, scan: &Scan, signals: &Signals, lane: usize, beam: usize, peak: Peak) -> Found {
        if self.alarms.iter().any(|&(other, alarm)| other == lane && alarm == peak) {
            return Found { peak, formed: peak.range, source: ALARM, mixed: false };
        }
        if self.forming.parts.is_empty() {
            // A plain beam.
            return Found { peak, formed: peak.range, source: 0, mixed: false };
        }
        let Gatherer { rays, others, forming, across, beams, .. } = self;
        let Forming { waveform, parts, shares, .. } = forming;
        // All light of a pixel is one, however far apart.
        let sigma = if scan.camera.is_some() { 0.0 } else { waveform.sigma() };
        let rays_count = rays.len();
        let other_of = |source: u32| &others.list[source as usize - rays_count];
        let kind = |source: u32| match rays.get(source as usize) {
            Some(ray) => [ray.hits.surface[lane], Cause::Surface as u32],
            None => [other_of(source).surface, other_of(source).cause as u32],
        };
        shares.clear();
        // All light of a pixel is one echo; without a pulse only what is at the very range.
        let reach = if scan.camera.is_some() { f32::INFINITY } else { (3.0 * sigma).max(1e-6 * peak.range) };
        let apart = if scan.camera.is_some() { OFF_SURFACE_M } else { OFF_SURFACE * sigma };
        let light = |part: &Pulselet| {
            let x = if sigma > 0.0 { (part.range - peak.range) / sigma } else { 0.0 };
            part.power * (-0.5 * x * x).exp()
        };
        let near = || parts.iter().filter(|part| (part.range - peak.range).abs() <= reach);
        let mut all = 0.0;
        for part in near() {
            let light = light(part);
            all += light;
            let kind = kind(part.source);
            match shares.iter_mut().find(|(known, ..)| *known == kind) {
                Some((_, sum, most, source)) => {
                    *sum += light;
                    if light > *most {
                        (*most, *source) = (light, part.source);
                    }
                }
                None => shares.push((kind, light, light, part.source)),
            }
        }
        // The first of those that send as much.
        let mut greatest = (f32::NEG_INFINITY, 0);
        for &(_, sum, _, source) in shares.iter() {
            if sum > greatest.0 {
                greatest = (sum, source);
            }
        }
        let source = greatest.1;
        let mut mixed = false;
        if let (Some(ray), Some(footprint)) = (rays.get(source as usize), &signals.footprint) {
            let normal = ray.hits.normal(lane);
            let place = |source: u32, range: f32| footprint.crossing(source as usize, across, beams, lane, range);
            let here = place(source, ray.hits.range[lane]);
            let mut off = 0.0;
            for part in near() {
                let is_off = part.source as usize >= rays_count
                    || (place(part.source, part.range) - here).dot(normal).abs() > apart;
                if is_off {
                    off += light(part);
                }
            }
            mixed = off > if scan.camera.is_some() { MIXED_PIXEL } else { MIXED } * all;
        }
        let Some(camera) = scan.camera else { return Found { peak, formed: peak.range, source, mixed } };
        // What is true is the surface that most light is from.
        let truth = parts.iter().find(|part| part.source == source).map_or(peak.range, |part| part.range);
        let axis = scan.aim.beams.direction(beam).x;
        let cos = match rays.get(source as usize) {
            Some(ray) => ray.cos_incidence[lane],
            None => other_of(source).cos_incidence,
        };
        let mut range = peak.range;
        if camera.aside.is_some() {
            // As in a pixel of one ray: the depth of the place it looks at goes where it should look.
            let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, beam);
            range *= rotation.x_axis.dot(beams.direction(lane)) / axis;
        }
        let formed = camera.err(&scan.rng, beam as u32, axis, cos, range);
        Found { peak: Peak { range: truth, power: peak.power }, formed, source, mixed }
    }
}
