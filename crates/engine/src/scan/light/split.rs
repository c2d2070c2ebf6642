//! Which beams of a block are several rays where that is decided beam by beam: those whose footprint hits more than one
//! place.
//!
//! A beam is suspect if its axis hits another surface, or another plane, than the rays around it: one ray at the rim of
//! its own footprint (above the axis in even columns, below it in odd ones) and the axes and rim rays of its neighbours
//! in the row. Suspects are split if what is around them can cause a second echo, or share one, or is all that can be
//! detected; a beam on whose axis a draw decided whether a surface stopped it is split in any case.

use super::plan::ScanPlan;
use super::rounds::Evidence;
use crate::detect::ReturnMode;
use crate::echo::{Contribution, OFF_SURFACE, RequestedQuantities};
use crate::sensor::{Adaptive, Signals};
use crate::trace::HitBatch;
use echocast_kernels::{measure, rim};
use emitter::{Across, Footprint};
use glam::Vec3;
use ground::lanes::{LANES, MISS, RayBatch};
use std::array;

/// Echoes closer together than this, in sigmas of the pulse, share a peak.
const SHARING: f32 = 3.5;

/// Echoes closer together than this, in sigmas of the pulse, are never two.
const MERGED: f32 = 1.5;

/// Greatest fraction of the light of a beam that a surface other than that on its axis takes.
const MOST: f32 = 0.5;

/// Fraction of what the surface on the axis would return that another must return to share its echo.
const SHARE: f32 = 0.1;

/// What an axis is compared with: the bits of its mark.
const OWN_RIM: usize = 0;
const BEFORE: usize = 1;
const BEHIND: usize = 2;
const RIM_BEFORE: usize = 3;
const RIM_BEHIND: usize = 4;
/// Nothing is compared: a draw decided on the axis, and decides differently for some of the other rays.
const DRAWN: usize = 5;

/// Buffers to find such beams, and what is found.
pub(super) struct Splitter {
    /// Vectors across the beams.
    across: Across,
    /// Buffer for rays.
    pub rays: RayBatch,
    /// Hits of the rays at the rims; where none was traced, those of the axes.
    rim: HitBatch,
    /// Hits of some of those rays, packed.
    met: HitBatch,
    surfaces: Contribution,
    /// `rho_eff / R^2` of what is at the rims, 1/m^2, where it is known.
    rim_power: [f32; LANES],
    centres: [[f32; LANES]; 3],
    rims: [[f32; LANES]; 3],
    /// Factors by which echoes of oblique surfaces are reduced.
    pub oblique: [f32; LANES],
    marks: [u8; LANES],
    /// The lanes of the beams to split, ascending.
    pub found: Vec<u8>,
    /// What is known of each of them.
    pub evidence: Vec<Evidence>,
    lanes: Vec<u8>,
}

impl Default for Splitter {
    fn default() -> Self {
        Splitter {
            across: Across::default(),
            rays: RayBatch::default(),
            rim: HitBatch::new(),
            met: HitBatch::new(),
            surfaces: Contribution::new(),
            rim_power: [0.0; LANES],
            centres: [[0.0; LANES]; 3],
            rims: [[0.0; LANES]; 3],
            oblique: [1.0; LANES],
            marks: [0; LANES],
            found: Vec::with_capacity(LANES),
            evidence: Vec::with_capacity(LANES),
            lanes: Vec::with_capacity(LANES),
        }
    }
}

/// Hits of the axes of a block's beams.
#[derive(Clone, Copy)]
pub(super) struct Axes<'a> {
    /// Number of the first beam.
    pub first: usize,
    pub count: usize,
    pub rays: &'a RayBatch,
    pub hits: &'a HitBatch,
    pub cos_incidence: &'a [f32; LANES],
    /// What they return, `rho_eff / R^2` in 1/m^2.
    pub power: &'a [f32; LANES],
}

/// What an axis is compared with.
#[derive(Clone, Copy)]
struct Around<'a> {
    hits: &'a HitBatch,
    /// What it returns, `rho_eff / R^2` in 1/m^2.
    power: f32,
    places: &'a [[f32; LANES]; 3],
}

impl Splitter {
    /// Finds the beams to split among those whose `axes` have been traced, and how much oblique surfaces reduce the
    /// echoes of all others.
    #[inline(never)]
    pub fn find(&mut self, scan: &ScanPlan, signals: &Signals, axes: Axes) {
        self.found.clear();
        self.evidence.clear();
        self.oblique = [1.0; LANES];
        let (Some(footprint), Some(Adaptive { rim: around, .. })) = (&signals.footprint, &signals.adaptive) else {
            return;
        };
        self.turn(scan, footprint, axes);
        let sigma = signals.sigma as f32;
        if scan.receiver.camera().is_none() {
            let normals = [&axes.hits.normal_x, &axes.hits.normal_y, &axes.hits.normal_z];
            let met = (normals, [axes.cos_incidence, &axes.hits.range]);
            footprint.obliqueness(&self.across, sigma, met, &mut self.oblique);
        }
        self.send(scan, around, axes);
        self.compare(scan, axes, scan.receiver.off_surface(sigma));
        self.weigh(scan, axes);
        for lane in 0..axes.count {
            if self.marks[lane] != 0 && self.matters(scan, axes, (signals.rule.mode, sigma), lane) {
                self.found.push(lane as u8);
                let evidence = self.gather_evidence(axes, lane);
                self.evidence.push(evidence);
            }
        }
    }

    /// Sets the vectors across the beams, upside down in odd columns.
    fn turn(&mut self, scan: &ScanPlan, footprint: &Footprint, axes: Axes) {
        if footprint.turns && !scan.aim.pose.moves() {
            let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, axes.first);
            self.across.set_all(axes.rays, rotation.z_axis);
        } else {
            for lane in 0..axes.count {
                let direction = axes.rays.direction(lane);
                scan.set_across(&mut self.across, footprint, lane, axes.first + lane, direction, 0.0);
            }
        }
        let columns = scan.aim.beams.columns.max(1) as usize;
        for lane in (0..axes.count).filter(|lane| (axes.first + lane) % columns % 2 == 1) {
            self.across.turn_over(lane);
        }
    }

    /// Traces the rays at the rims, except where neither the beam nor its neighbours detect anything.
    fn send(&mut self, scan: &ScanPlan, around: &Footprint, axes: Axes) {
        let Axes { count, rays: beams, hits, power, .. } = axes;
        let least = scan.receiver.gate.least_power();
        let mut undetected = [true; LANES];
        for lane in 0..count {
            undetected[lane] = power[lane] <= 0.0 || power[lane] < least;
        }
        if scan.world.paths.is_some() {
            let mut lanes = [0; LANES];
            let found = scan.going_on(&hits.surface, count, &mut lanes);
            lanes[..found].iter().for_each(|&lane| undetected[usize::from(lane)] = false);
        }
        self.lanes.clear();
        for lane in 0..count {
            if !(undetected[lane] && undetected[lane.saturating_sub(1)] && undetected[(lane + 1).min(count - 1)]) {
                self.lanes.push(lane as u8);
            }
        }
        self.rim.range = hits.range;
        self.rim.surface = hits.surface;
        self.rim.facet = hits.facet;
        self.rim.triangle = hits.triangle;
        measure_places(beams, &hits.range, &mut self.centres);
        self.rims = self.centres;
        let Splitter { across, rays, met, lanes, rim, rims, .. } = self;
        around.rays(0, across, beams, rays);
        // Packed, one after the other.
        for (to, from) in lanes.iter().map(|&lane| usize::from(lane)).enumerate() {
            if to != from {
                rays.move_lane(to, from);
            }
        }
        met.trace(scan.world.scene, rays, lanes.len(), scan.aim.coherent, scan.world.sight);
        for (from, lane) in lanes.iter().map(|&lane| usize::from(lane)).enumerate() {
            rim.range[lane] = met.range[from];
            rim.surface[lane] = met.surface[from];
            rim.triangle[lane] = met.triangle[from];
            if met.surface[from] != MISS {
                let place = rays.origin(from) + rays.direction(from) * met.range[from];
                (rims[0][lane], rims[1][lane], rims[2][lane]) = place.into();
            }
        }
    }

    /// Marks beams that hit another place than the rays around them.
    fn compare(&mut self, scan: &ScanPlan, axes: Axes, off: f32) {
        let Axes { first, count, hits, .. } = axes;
        self.marks = [0; LANES];
        let Splitter { rim, centres, rims, marks, .. } = self;
        let mut compare = |bit: usize, shift: isize| {
            let (own, other) = match shift {
                0 => (0..count, 0..count),
                1 => (0..count - 1, 1..count),
                _ => (1..count, 0..count - 1),
            };
            let (places, surface) =
                if bit == BEFORE || bit == BEHIND { (&*centres, &hits.surface) } else { (&*rims, &rim.surface) };
            rim::compare(
                hits.facet.each_ref().map(|axis| &axis[own.clone()]),
                array::from_fn(|axis| &centres[axis][own.clone()]),
                &hits.surface[own.clone()],
                array::from_fn(|axis| &places[axis][other.clone()]),
                &surface[other.clone()],
                off,
                1 << bit,
                &mut marks[own],
            );
        };
        for (bit, shift) in [(OWN_RIM, 0), (BEFORE, -1), (BEHIND, 1), (RIM_BEFORE, -1), (RIM_BEHIND, 1)] {
            compare(bit, shift);
        }
        // The end of one row of the table and the start of the next are not neighbours.
        let columns = scan.aim.beams.columns.max(1) as usize;
        let mut start = columns - first % columns;
        while start < count {
            marks[start - 1] &= !(1 << BEHIND | 1 << RIM_BEHIND);
            marks[start] &= !(1 << BEFORE | 1 << RIM_BEFORE);
            start += columns;
        }
        if scan.world.scene.surfaces.has_holes {
            for lane in 0..count {
                marks[lane] |= u8::from(hits.veil[lane] <= hits.range[lane]) << DRAWN;
            }
        }
    }

    /// Computes what returns from the rims that differ from some axis.
    fn weigh(&mut self, scan: &ScanPlan, axes: Axes) {
        let Splitter { rays, rim, met, surfaces, rim_power, marks, lanes, .. } = self;
        *rim_power = *axes.power;
        let (own, before, behind) = (1u8 << OWN_RIM, 1u8 << RIM_BEFORE, 1u8 << RIM_BEHIND);
        let mut kept = 0;
        for from in 0..lanes.len() {
            let lane = usize::from(lanes[from]);
            let requested = marks[lane] & own != 0
                || lane > 0 && marks[lane - 1] & behind != 0
                || lane + 1 < axes.count && marks[lane + 1] & before != 0;
            if requested && met.surface[from] != MISS {
                met.move_lane(kept, from);
                rays.move_lane(kept, from);
                lanes[kept] = lane as u8;
                kept += 1;
            } else if requested {
                rim_power[lane] = 0.0;
            }
        }
        lanes.truncate(kept);
        if kept == 0 {
            return;
        }
        let requested = RequestedQuantities { colors: false, reflectance: true };
        surfaces.face(scan.world.scene, rays, met, kept, scan.world.smooth);
        surfaces.look_up(&scan.world.scene.surfaces, &scan.world.reflectances, met, 0..kept, requested);
        for (from, lane) in lanes.iter().map(|&lane| usize::from(lane)).enumerate() {
            let range = met.range[from];
            rim_power[lane] = surfaces.reflectance[from] * surfaces.cos_incidence[from] / (range * range);
            rim.take(lane, met, from);
        }
    }

    /// Whether anything around the suspect at `lane` can change what it reports.
    fn matters(&self, scan: &ScanPlan, axes: Axes, (mode, sigma): (ReturnMode, f32), lane: usize) -> bool {
        let Axes { first, hits, power, .. } = axes;
        let efficiency = scan.receiver.efficiency_of((first + lane) as u32);
        let least = scan.receiver.gate.least_power() / efficiency;
        let hit = hits.surface[lane] != MISS;
        if self.marks[lane] & 1 << DRAWN != 0 {
            return true;
        }
        (OWN_RIM..=RIM_BEHIND).filter(|bit| self.marks[lane] & 1 << bit != 0).any(|bit| {
            let other = other_lane(bit, lane);
            let around = self.around(axes, bit, other);
            let Around { hits: met, power: light, .. } = around;
            let (surface, range) = (met.surface[other], met.range[other]);
            if surface == MISS {
                return false;
            }
            // What is seen in mirrors and through glass is not known yet.
            if scan.world.paths.is_some() && (scan.goes_on(surface) || hit && scan.goes_on(hits.surface[lane])) {
                return true;
            }
            let is_detectable = light > 0.0 && MOST * light >= least;
            // The rim of something before nothing, as leaves before the sky.
            if !hit {
                return is_detectable;
            }
            if !is_detectable {
                return light > SHARE * power[lane] && self.share(axes, around, [lane, other], sigma);
            }
            if scan.receiver.camera().is_some() || power[lane] < least {
                return true;
            }
            let beyond = range - hits.range[lane];
            let is_second = beyond.abs() > MERGED * sigma
                && (mode.reports_others() || mode.merit(range, light) > mode.merit(hits.range[lane], power[lane]));
            is_second || light > SHARE * power[lane] && self.share(axes, around, [lane, other], sigma)
        })
    }

    /// What the suspect at `lane` and the rays around it hit.
    fn gather_evidence(&self, axes: Axes, lane: usize) -> Evidence {
        let mut evidence = Evidence::default();
        evidence.add(axes.hits.surface[lane], axes.hits.triangle[lane]);
        for bit in (OWN_RIM..=RIM_BEHIND).filter(|bit| self.marks[lane] & 1 << bit != 0) {
            let other = other_lane(bit, lane);
            let Around { hits, .. } = self.around(axes, bit, other);
            evidence.add(hits.surface[other], hits.triangle[other]);
        }
        evidence
    }

    /// What `bit` compares the axes with.
    fn around<'a>(&'a self, axes: Axes<'a>, bit: usize, other: usize) -> Around<'a> {
        if bit == BEFORE || bit == BEHIND {
            Around { hits: axes.hits, power: axes.power[other], places: &self.centres }
        } else {
            Around { hits: &self.rim, power: self.rim_power[other], places: &self.rims }
        }
    }

    /// Whether what the axis at `lane` hits and what is `around` it, at the lane `other`, are two planes within one
    /// pulse.
    fn share(&self, axes: Axes, around: Around, [lane, other]: [usize; 2], sigma: f32) -> bool {
        let Around { hits, places, .. } = around;
        let way = Vec3::from_array(array::from_fn(|axis| places[axis][other] - self.centres[axis][lane]));
        let off = way.dot(axes.hits.facet(lane)).abs().max(way.dot(hits.facet(other)).abs());
        (hits.range[other] - axes.hits.range[lane]).abs() < SHARING * sigma && off > OFF_SURFACE * sigma
    }
}

/// The lane that `bit` compares the axis at `lane` with.
fn other_lane(bit: usize, lane: usize) -> usize {
    match bit {
        OWN_RIM => lane,
        BEFORE | RIM_BEFORE => lane - 1,
        _ => lane + 1,
    }
}

/// Positions at `range` along `rays`.
fn measure_places(rays: &RayBatch, range: &[f32; LANES], places: &mut [[f32; LANES]; 3]) {
    for ((from, along), to) in rays.origins().into_iter().zip(rays.directions()).zip(places) {
        measure::place(from, along, range, to);
    }
}
