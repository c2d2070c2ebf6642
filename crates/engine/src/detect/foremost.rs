//! Beams of one ray and one return: of all echoes of a beam the one that the return mode prefers.

use super::{LaneEchoes, Receiver, ReturnMode, gate};
use crate::echo::{Air, AirEcho, AirEchoes, Contribution, LIGHT_ROUNDING, PathEcho, PathEchoes};
use crate::trace::HitBatch;
use echocast_kernels::light;
use ground::cause::Cause;
use ground::lanes::{LANES, MEDIUM, MISS, RayBatch};

/// Keeps, of all echoes along the paths of each beam, the one that the receiver prefers.
pub(crate) struct ForemostPaths<'a> {
    pub receiver: &'a Receiver<'a>,
    pub beams: &'a [u32],
    /// Farthest range of each beam, m.
    pub farthest: &'a [f32; LANES],
    /// Fraction of the light that the channel of each beam uses.
    pub efficiency: &'a [f32; LANES],
    /// Merit of the echo so far; negative infinity if there is none.
    pub merit: &'a mut [f32; LANES],
    pub hits: &'a mut HitBatch,
    pub surfaces: &'a mut Contribution,
    pub cause: &'a mut [u8; LANES],
    pub bounces: &'a mut [u8; LANES],
    /// Its apparent motion.
    pub image: &'a mut [u32; LANES],
}

impl PathEchoes for ForemostPaths<'_> {
    fn least(&self, lane: usize) -> f32 {
        self.receiver.least_power(self.merit[lane])
    }

    fn take(&mut self, echo: &PathEcho, hits: &HitBatch, surfaces: &Contribution) {
        let (lane, range) = (echo.lane, echo.range);
        let (receiver, beam) = (self.receiver, self.beams[lane]);
        let rho_eff = echo.reflectance * echo.cos_incidence * self.efficiency[lane];
        let merit = receiver.merit(range, rho_eff);
        let [nearest, _] = receiver.gate.limits(beam);
        let detected =
            receiver.reports_undetected() || receiver.gate.detects(beam, gate::numbered(range), rho_eff, range);
        if detected && range >= nearest && range <= self.farthest[lane] && merit > self.merit[lane] {
            self.merit[lane] = merit;
            self.hits.take(lane, hits, echo.hit);
            self.surfaces.take(lane, surfaces, echo.hit);
            self.hits.range[lane] = range;
            self.surfaces.reflectance[lane] = echo.reflectance;
            self.surfaces.cos_incidence[lane] = echo.cos_incidence;
            (self.cause[lane], self.bounces[lane], self.image[lane]) = (echo.cause as u8, echo.bounces, echo.image);
        }
    }
}

/// Puts echoes of the air in place of the surfaces where the receiver prefers them.
struct ForemostOfAir<'a, 'b> {
    receiver: &'a Receiver<'a>,
    echoes: &'a mut LaneEchoes<'b>,
    efficiency: &'a [f32; LANES],
    /// Range at which surfaces end each beam's view of the air, m.
    view_end: &'a [f32; LANES],
    /// Light, `rho_eff / R^2` in 1/m^2, that an echo of the air must exceed in each lane.
    least: [f32; LANES],
}

impl<'a, 'b> ForemostOfAir<'a, 'b> {
    fn new(
        receiver: &'a Receiver<'a>,
        echoes: &'a mut LaneEchoes<'b>,
        efficiency: &'a [f32; LANES],
        view_end: &'a [f32; LANES],
    ) -> Self {
        // Weaker ones are not detected, whatever part of their light the channel uses.
        let faintest = receiver.gate.least_power() * (1.0 - LIGHT_ROUNDING);
        let mut least = [faintest; LANES];
        if receiver.mode.is_by_power() {
            light::least(echoes.surface, echoes.rho_eff, echoes.range, efficiency, faintest, &mut least);
        } else if receiver.mode == ReturnMode::Last {
            for lane in 0..LANES {
                // Nothing in front of a surface is farther.
                if echoes.surface[lane] < MEDIUM {
                    least[lane] = f32::INFINITY;
                }
            }
        }
        ForemostOfAir { receiver, echoes, efficiency, view_end, least }
    }
}

impl AirEchoes for ForemostOfAir<'_, '_> {
    fn end(&self) -> &[f32; LANES] {
        self.view_end
    }

    fn least(&self) -> &[f32; LANES] {
        &self.least
    }

    fn take(&mut self, lane: usize, echo: AirEcho, cause: Cause) -> bool {
        let echo = AirEcho { rho_eff: echo.rho_eff * self.efficiency[lane], ..echo };
        let (beam, number) = (self.echoes.beams[lane], gate::numbered(echo.range));
        let passes = echo.rho_eff > 0.0 && self.receiver.gate.passes(beam, number, echo.rho_eff, echo.range);
        if passes {
            self.receiver.offer(self.echoes, lane, echo, cause);
            if self.receiver.mode.is_by_power() {
                let LaneEchoes { range, rho_eff, .. } = &*self.echoes;
                self.least[lane] = rho_eff[lane] / (range[lane] * range[lane] * self.efficiency[lane]);
            }
        }
        passes
    }
}

impl Receiver<'_> {
    /// Replaces the echo of `lane` by `echo`, which is not from a surface, if it is preferred.
    fn offer(&self, echoes: &mut LaneEchoes, lane: usize, echo: AirEcho, cause: Cause) {
        let own = || self.merit(echoes.range[lane], echoes.rho_eff[lane]);
        if echoes.surface[lane] == MISS || self.merit(echo.range, echo.rho_eff) > own() {
            echoes.surface[lane] = MEDIUM;
            (echoes.range[lane], echoes.rho_eff[lane]) = (echo.range, echo.rho_eff);
            echoes.cause[lane] = cause as u8;
        }
    }

    /// Puts echoes of the air along `rays` and false alarms in place of the surfaces in the lanes where they are
    /// preferred. `efficiency`: fraction of the light that the channel of each beam uses; `view_end`: where surfaces,
    /// detected or not, end its view of the air, m.
    pub(crate) fn prefer_others(
        &self,
        rays: &RayBatch,
        air: Option<&Air>,
        efficiency: &[f32; LANES],
        view_end: &[f32; LANES],
        echoes: &mut LaneEchoes,
    ) {
        let beams = echoes.beams;
        if let Some(air) = air.filter(|air| air.has_echoes()) {
            let mut foremost = ForemostOfAir::new(self, echoes, efficiency, view_end);
            air.echoes(rays, &self.gate.rng, beams, &mut foremost);
        }
        self.raise_alarms(beams, |lane, range, rho_eff| {
            self.offer(echoes, lane, AirEcho { range, rho_eff }, Cause::FalseAlarm);
        });
    }
}
