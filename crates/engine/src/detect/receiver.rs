//! How an instrument turns the light that arrives along its beams into detections.
//!
//! | receiver | file | an echo is |
//! |---|---|---|
//! | pulsed | `pulsed` | a maximum of a beam's signal that is above the threshold |
//! | AMCW, and cameras that match patterns | `amcw` | all light of a pixel together |
//! | of the paper's program | `paper` | what a beam hits; intensity 0 marks it as not detected |
//!
//! Beams of one ray and one return are processed side by side ([`LaneEchoes`]), others one by one, as lists of arrivals
//! ([`Receiver::detect`]). Sonars have receivers of their own: [`beamformer`](super::beamformer) and
//! [`janus`](super::janus).

use super::{
    DepthCamera, Detections, FalseAlarms, Gate, LaneEchoes, ReceivedBeam, ReturnMode, ReturnRule, Threshold, paper,
    pulsed,
};
use crate::echo::{Air, OFF_SURFACE};
use echocast_kernels::light;
use ground::lanes::LANES;

/// Distance from a plane that counts as off it for a depth camera, m.
const OFF_SURFACE_M: f32 = 0.01;

/// Fraction of an echo's light that must come from another surface for the echo to be mixed.
const MIXED: f32 = 0.1;

/// The same for a pixel, where all light counts, however far apart its sources are.
const MIXED_PIXEL: f32 = 0.02;

/// The receiver of one scan.
pub(crate) struct Receiver<'a> {
    pub method: Method<'a>,
    pub gate: Gate<'a>,
    /// Noise that looks like echoes, if there is any.
    pub alarms: Option<FalseAlarms>,
    /// Fraction of the light that each channel uses; empty if all are alike.
    pub efficiency: &'a [f32],
    /// Which echo a beam of one return reports.
    pub mode: ReturnMode,
}

/// How it detects.
#[derive(Clone, Copy)]
pub(crate) enum Method<'a> {
    Pulsed,
    Amcw(&'a DepthCamera),
    /// Through what is in the air, if anything.
    Paper(Option<&'a Air>),
}

impl Receiver<'_> {
    /// The depth camera that forms ranges, if it is one.
    pub fn camera(&self) -> Option<&DepthCamera> {
        match self.method {
            Method::Amcw(camera) => Some(camera),
            _ => None,
        }
    }

    /// Whether it reports what it does not detect, with intensity 0, and knows of no weather on the way.
    pub(crate) fn reports_undetected(&self) -> bool {
        matches!(self.method, Method::Paper(_))
    }

    /// Whether its ranges wrap, so that surfaces beyond its greatest range count.
    pub(crate) fn wraps(&self) -> bool {
        self.camera().is_some_and(DepthCamera::wraps)
    }

    /// Whether light matters to what it reports, apart from intensity.
    pub(crate) fn depends_on_light(&self) -> bool {
        *self.gate.threshold != Threshold::Open || self.camera().is_some()
    }

    /// The camera whose pixels sample points other than their centres, if it is one.
    pub(crate) fn jittering(&self) -> Option<&DepthCamera> {
        self.camera().filter(|camera| camera.aside.is_some())
    }

    /// Whether it uses different fractions of the light of different beams.
    pub(crate) fn is_uneven(&self) -> bool {
        self.camera().is_some() || !self.efficiency.is_empty()
    }

    /// Fraction of the light that the channel of `beam` uses.
    pub(crate) fn efficiency_of(&self, beam: u32) -> f32 {
        let channel = usize::from(self.gate.beams.channel[beam as usize]);
        self.efficiency.get(channel).copied().unwrap_or(1.0)
    }

    /// Fraction of the light that it uses of `beam`, whose centre ray is not jittered.
    pub(crate) fn gain_of(&self, beam: u32) -> f32 {
        let lens = self.camera().map_or(1.0, |camera| camera.gain(self.gate.beams.direction(beam as usize).x));
        self.efficiency_of(beam) * lens
    }

    /// Reports its false alarms in `beams`: index into `beams`, range, m, and effective reflectance.
    pub(crate) fn raise_alarms(&self, beams: &[u32], report: impl FnMut(usize, f32, f32)) {
        let Gate { rng, range: [_, farthest], .. } = &self.gate;
        if let Some(alarms) = &self.alarms {
            alarms.of_beams(rng, beams, *farthest, |beam| self.gate.limits(beam), report);
        }
    }

    /// Whether beams through `air` may report echoes other than those of surfaces.
    pub(crate) fn may_prefer_others(&self, air: Option<&Air>) -> bool {
        self.alarms.is_some() || air.is_some_and(Air::has_echoes)
    }

    /// How much it prefers an echo, where it reports one of several.
    pub(crate) fn merit(&self, range: f32, rho_eff: f32) -> f32 {
        match self.method {
            // The stronger one, whatever its range.
            Method::Paper(_) => rho_eff,
            _ => self.mode.merit(range, rho_eff / (range * range)),
        }
    }

    /// Light, `rho_eff / R^2` in 1/m^2, that an echo must exceed to be preferred to one with `merit`.
    pub(crate) fn least_power(&self, merit: f32) -> f32 {
        match self.method {
            Method::Paper(_) => 0.0,
            _ if self.mode.is_by_power() => self.gate.least_power().max(merit),
            _ => self.gate.least_power(),
        }
    }

    /// Distance from a plane that counts as off it, m; `sigma`: standard deviation of the pulse, m.
    pub(crate) fn off_surface(&self, sigma: f32) -> f32 {
        if self.camera().is_some() { OFF_SURFACE_M } else { OFF_SURFACE * sigma }
    }

    /// Distance in range up to which arrivals contribute to the echo at `range`, m, by a pulse of `sigma`, m.
    pub(crate) fn reach_of_echo(&self, range: f32, sigma: f32) -> f32 {
        // All light of a pixel is one echo; without a pulse only what is at exactly this range.
        if self.camera().is_some() { f32::INFINITY } else { (3.0 * sigma).max(1e-6 * range) }
    }

    /// Fraction of an echo's light that must come from elsewhere for the echo to be mixed.
    pub(crate) fn mixed_part(&self) -> f32 {
        if self.camera().is_some() { MIXED_PIXEL } else { MIXED }
    }

    /// Detects the echoes of a beam whose signal is `found.received`, and selects the returns by `rule`.
    pub(crate) fn detect(&self, received: &ReceivedBeam, rule: &ReturnRule, found: &mut Detections) {
        found.peaks.clear();
        found.chosen.clear();
        match self.method {
            Method::Amcw(camera) => camera.detect(&self.gate, received.beam, found),
            Method::Pulsed | Method::Paper(_) => pulsed::detect(&self.gate, received, rule, found),
        }
    }

    /// Detects the echoes of beams of one ray each: removes from the lanes what is not detected or out of range.
    pub(crate) fn detect_lanes(
        &self,
        settled: Option<&[bool; LANES]>,
        intensity: &mut [f32; LANES],
        echoes: &mut LaneEchoes,
    ) {
        if let Method::Paper(air) = self.method {
            paper::detect_lanes(&self.gate, air, intensity, echoes);
        } else if *self.gate.threshold != Threshold::Open {
            let detected = self.gate.detects_all(echoes.beams, echoes.rho_eff, echoes.range, settled);
            light::forget(&detected, echoes.surface, intensity);
        }
        if !self.wraps() {
            self.gate.limit(echoes.beams, echoes.range, echoes.surface);
        }
    }
}
